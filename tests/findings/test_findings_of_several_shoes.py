"""What is found of several shoes: each against its own contact boundaries, what drives them, which is the loudest."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray

import drums
from drumsqueal.dynamics.ensemble import Family
from drumsqueal.errors import NoSteadySliding, SteadyStateError
from drumsqueal.findings import vibration
from drumsqueal.findings.brake import Brakes
from drumsqueal.findings.squeals import changing_keys, drives_of, instant_at, name_of_key
from drumsqueal.findings.vibration import (
    amplitudes_at_boundary,
    beyond_boundaries,
    boundary_fractions,
    boundary_ratios,
    idle_shoes,
    mean_pressures,
)
from drumsqueal.physics.effects.operation import Constant, OperatingPoint, Operation, PiecewiseLinear
from drumsqueal.physics.model import Model, build_model
from drumsqueal.questions.export.signals import default_signal
from drumsqueal.questions.run.figures.contact import _evaluate
from drumsqueal.questions.run.figures.view import View
from drumsqueal.solve.linear.modes import Mode, analyse_stability

CUP = {**drums.CUP, "up_to": 1e3}
STIFFNESS = 3.5e10  # N/m³
FORCE = {"at": (0.04, -0.09, 0.0), "direction": (1.0, 0.0, 0.0), "size": 1000.0}
PIN = {"at": (0.0558, 0.0707, 0.0), "stiffness": 1e9, "damping": 0.0}
RISING = {"time": (0.0, 0.01), "value": (0.0, 1000.0)}


def two(nominal, values=None, **tables) -> Any:
    scene = drums.several(nominal, {"first": 0.0, "second": np.pi}, CUP, **tables)
    return scene.with_values({} if values is None else values)


def loaded(nominal, *loads) -> Model:
    """Return the model of two shoes with these loads (N)."""
    own = {f"shoe.{k}.contact": {"stiffness": STIFFNESS, "normal_load": load} for k, load in enumerate(loads)}
    return build_model(two(nominal, own))


def pushed(nominal, sizes, separation=(True, True)) -> Model:
    """Return the model of two shoes on pins, each pushed by a force of its own size."""
    values: dict[str, Any] = {}
    for k, (size, may) in enumerate(zip(sizes, separation, strict=True)):
        values[f"shoe.{k}.contact"] = {"stiffness": STIFFNESS, "separation": may}
        values[f"shoe.{k}.spring"] = [PIN | {"direction": each} for each in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
        values[f"shoe.{k}.force"] = [FORCE | {"size": size}]
    return build_model(two(nominal, values, steady={"state": "self-consistent"}, support=None))


def driven(*loads: float, forces=(), shoes=()) -> Any:
    """Return what drives two linings of 0.01 m² each, whose preloads (Pa) these are, and forces (N) on some of them."""
    first, *further = map(Constant, loads)
    operation = Operation(Constant(5.0), first, tuple(forces), tuple(further), tuple(shoes))
    lining = SimpleNamespace(area=0.01)
    return SimpleNamespace(operation=operation, sides=[(None, SimpleNamespace(body=lining)) for _ in loads])


def test_what_drives_each_shoe_has_its_own_key_unless_it_is_the_same_on_all():
    rising = PiecewiseLinear([0.0, 2.0], [0.0, 50.0])
    model = driven(1e5, 2e5, forces=(Constant(100.0), rising, Constant(7.0)), shoes=(0, 1, 1))
    values = {key: drive.at(1.0) for key, drive in drives_of(model).items()}
    assert values == {
        "drum.speed": (5.0, 0.0),
        "shoe.0.contact.normal_load": (pytest.approx(1000.0), 0.0),
        "shoe.1.contact.normal_load": (pytest.approx(2000.0), 0.0),
        "shoe.0.force.0.size": (100.0, 0.0),
        "shoe.1.force.0.size": (25.0, 25.0),
        "shoe.1.force.1.size": (7.0, 0.0),
    }
    assert list(changing_keys(model)) == ["shoe.1.force.0.size"]
    assert [name_of_key(key) for key in values][1:5:3] == ["load of shoe 0", "force 0 of shoe 1"]
    found = instant_at(model, 1.0)
    assert (found.normal_load_N, found.drum_speed_rad_per_s) == (pytest.approx(3000.0), 5.0)
    # One pressure on both pistons, and one load on both linings.
    same = driven(1e5, 1e5, forces=(rising, rising), shoes=(0, 1))
    assert set(drives_of(same)) == {"drum.speed", "contact.normal_load", "shoe.force.0.size"}
    assert changing_keys(same)["shoe.force.0.size"].at(1.0) == (25.0, 25.0)
    # One shoe sees its own load, and that it changes where any does.
    seen = OperatingPoint(0.5, np.float64(5.0), np.float64(2.0), np.float64(4.0), further=((np.float64(3.0), None),))  # pyright: ignore[reportArgumentType]
    assert (seen.of_shoe(0).preload, seen.of_shoe(0).preload_rate) == (2.0, 4.0)
    assert (seen.of_shoe(1).preload, seen.of_shoe(1).preload_rate) == (3.0, 0.0)


def test_the_mean_pressure_of_shoes_that_are_pushed_is_that_of_steady_sliding(monkeypatch):
    # Normal forces of 10 N and 20 N for each second, found at the corners of what changes; at 3 s the brake locks.
    rising = PiecewiseLinear([1.0, 2.0, 3.0], [0.0, 5.0, 6.0])
    model = driven(0.0, 0.0, forces=(rising,), shoes=(0,))
    model.pushed, model.frozen = True, lambda time: time
    asked = []

    def forces(time):
        asked.append(time)
        return (np.nan, np.nan) if time == 3.0 else (10.0 * time, 20.0 * time)

    monkeypatch.setattr(vibration, "_normal_forces", forces)
    found = mean_pressures(model, SimpleNamespace(time=np.array([0.0, 0.5, 2.0, 2.5])))  # pyright: ignore[reportArgumentType]
    assert asked == [0.0, 1.0, 2.0, 3.0]
    np.testing.assert_allclose(found[0], np.array([0.0, 5.0, 20.0, 20.0]) / 0.01)
    np.testing.assert_allclose(found[1], np.array([0.0, 10.0, 40.0, 40.0]) / 0.01)


def together(model: Model, size: float = 1e-6) -> np.ndarray:
    """Return a displacement (n,) of both shoes along X, into the drum and off it."""
    return np.array([size if name.endswith(".X") else 0.0 for name in model.names])


def mode_of(shape: np.ndarray) -> Mode:
    right = np.concatenate([shape, 1e-9 * shape]).astype(complex)
    return Mode("first.X", "first.X", 1j, False, right, right)


@pytest.mark.thorough
def test_each_shoe_is_measured_against_its_own_pressure(nominal):
    model = loaded(nominal, 500.0, 2500.0)
    area = nominal.shoe.outer_radius * nominal.shoe.arc_angle * nominal.shoe.width
    shape = together(model)
    q = dict(zip(model.names, shape[:, None], strict=True))
    lost = boundary_fractions(model, q, q, model.operation.at(0.0))[0, :, 0]
    np.testing.assert_allclose(lost, [STIFFNESS * 1e-6 * area / load for load in (500.0, 2500.0)], rtol=1e-9)
    # Disturbances have to go beyond the boundary of the shoe that is pressed harder, too.
    family = Family(lambda _: model, model.names, model.names)
    assert set(lost) <= set(family.reach(mode_of(shape), model)[1])
    # But not of one that hardly takes part.
    alone = shape * [1e-3 if name.startswith("second.") else 1.0 for name in model.names]
    assert len(family.reach(mode_of(alone), model)[1]) == 2


@pytest.mark.thorough
def test_a_shoe_without_load_has_no_contact_to_lose(nominal):
    one, both, none = (loaded(nominal, *loads) for loads in ((500.0, 0.0), (500.0, 500.0), (0.0, 0.0)))
    shape = together(one)[None]
    lost, wanted, unpressed = (boundary_ratios(model, shape, 0 * shape)[0] for model in (one, both, none))
    assert lost == wanted
    assert unpressed == np.inf


@pytest.mark.thorough
def test_a_shoe_without_friction_has_no_slip_to_reverse(nominal):
    model = build_model(two(nominal, {"shoe.1.friction": {"law": "constant", "coefficient": 0.3}}, friction=None))
    v = {name: np.ones(1) for name in model.names}
    first, second = boundary_fractions(model, v, v, model.operation.at(0.0))[1, :, 0]
    assert first == 0 < second


@pytest.mark.thorough
def test_a_tenth_that_lifts_is_of_one_lining(nominal):
    """It takes no more of one shoe where the other one stays."""
    model = pushed(nominal, (1000.0, 1000.0))
    shape = together(model) / 1e-6
    one = mode_of(np.where([name.startswith("first.") for name in model.names], shape, 0.0))
    still = np.array([[1e-6 if name.endswith(".Y") else 0.0 for name in model.names]])
    (alone,), (same,) = (amplitudes_at_boundary(model, [mode], still, [0.0]) for mode in (one, mode_of(shape)))
    assert alone == pytest.approx(same, rel=1e-9)


def record(time: np.ndarray, **fractions: float) -> xarray.Dataset:
    """Return a history of these contact fractions of each shoe, in which nothing slips backwards."""
    own = {f"{name}.contact_fraction": each + 0 * time for name, each in fractions.items()}
    columns = own | {"contact_fraction": np.mean([*own.values()], axis=0), "slip_reversed_fraction": 0 * time}
    return xarray.Dataset({name: ("time", values) for name, values in columns.items()}, {"time": time})


@pytest.mark.thorough
def test_each_lining_leaves_the_drum_on_its_own(nominal):
    time = np.linspace(0.0, 0.01, 12)
    # Of a lining that is bonded nothing leaves the drum, whatever its pressure in steady sliding.
    mixed = pushed(nominal, (1000.0, 1000.0), separation=(False, True))
    assert not beyond_boundaries(record(time, first=1.0, second=0.8), [0.0, 0.8], mixed).any()
    # More than a tenth of one lining may be less than a tenth of both.
    assert beyond_boundaries(record(time, first=1.0, second=0.65), [0.0, 0.8], mixed).all()
    # One shoe is on; of the other it does not count until a tenth of its force is there.
    later = pushed(nominal, (1000.0, RISING))
    found = beyond_boundaries(record(time, first=0.9, second=0.0), [0.9, 0.9], later)
    assert found.tolist() == 2 * [False] + 10 * [True]


@pytest.mark.thorough
def test_a_load_that_changes_moves_shoes_that_no_assembly_balances(nominal, monkeypatch):
    load = {"time": (0.0, 0.01), "value": (500.0, 1000.0)}
    model = build_model(two(nominal, {"contact.normal_load": load}, steady={"state": "self-consistent"}))
    # As if each schedule were a force, which saves compiling those of the contact.
    monkeypatch.setattr(vibration, "_forces", lambda _, rows, q: np.stack(rows, axis=1))
    steady: Any = SimpleNamespace(time=0.0, coordinates=model.names, steady_state=np.zeros(len(model.names)))
    assert vibration.moved_by(model, steady, 0.01) == "changing load"


@pytest.mark.thorough
def test_what_is_the_same_on_all_shoes_is_one_thing_that_changes(nominal):
    same, other = pushed(nominal, (RISING, RISING)), pushed(nominal, (RISING, RISING | {"value": (0.0, 500.0)}))
    assert list(changing_keys(same)) == ["shoe.force.0.size"]
    assert instant_at(same, 0.005).driven["shoe.force.0.size"] == pytest.approx((500.0, 1e5))
    assert list(changing_keys(other)) == ["shoe.0.force.0.size", "shoe.1.force.0.size"]
    assert set(drives_of(loaded(nominal, 500.0, 600.0))) >= {f"shoe.{k}.contact.normal_load" for k in (0, 1)}


@pytest.mark.thorough
def test_an_instant_looks_at_every_shoe_once(nominal, monkeypatch):
    model, looked, sides = loaded(nominal, 500.0, 600.0), [], Model.sides.fget
    assert sides is not None
    monkeypatch.setattr(Model, "sides", property(lambda self: looked.append(1) or sides(self)))
    instant_at(model, 0.0)
    modes = [mode_of(together(model))] * 3
    amplitudes_at_boundary(model, modes, np.zeros((3, len(model.names))), [0.0, 1.0, 2.0])
    assert len(looked) <= 3


@pytest.mark.thorough
def test_the_pressure_is_drawn_over_the_mean_of_the_times_shown(nominal):
    """At rest it is the mean, also where nothing presses at the time of the eigenvalues."""
    load = {"time": (0.0, 0.01, 0.02), "value": (0.0, 1000.0, 1000.0)}
    model = build_model(two(nominal, {"contact.normal_load": load}))
    time = np.linspace(0.0, 0.02, 201)
    still = ("time", "coordinate"), np.zeros((time.size, len(model.names)))
    motion = {"displacement": still, "velocity": still}
    history = xarray.Dataset(motion, {"time": time, "coordinate": list(model.names)})
    unpressed = {name: SimpleNamespace(mean_pressure_Pa=0.0) for name in ("first", "second")}
    findings = SimpleNamespace(brake=Brakes.model_construct(shoes=unpressed))
    result = SimpleNamespace(history=history)
    view: Any = SimpleNamespace(main_frequency=1e3, time=time, model=model, result=result, findings=findings)
    fields = _evaluate(view)
    assert [field.shoe for field in fields] == ["first", "second"]
    for field in fields:
        np.testing.assert_allclose(field.level, 1.0, rtol=1e-9)


def test_the_loudest_shoe_is_not_the_one_that_was_started(nominal):
    model, time = build_model(scene := two(nominal)), np.linspace(0.0, 1.0, 2000)
    velocity = np.zeros((time.size, len(model.names)))
    velocity[:, model.names.index("first.Y")] = np.exp(-40 * time) * np.cos(600 * time)
    velocity[:, model.names.index("second.Y")] = 1e-2 * np.sin(600 * time)
    data = {"velocity": SimpleNamespace(values=velocity)}
    saved: Any = SimpleNamespace(scene=scene, coordinates=model.names, data=data)
    assert default_signal(saved) == "second.surface_velocity"
    view: Any = SimpleNamespace(model=model, vibration=SimpleNamespace(coordinates=model.names, velocity=velocity))
    assert View.loudest.func(view)[0].name == "second"


def test_shoes_on_a_drum_at_rest_are_on_no_belt(nominal):
    with pytest.raises(SteadyStateError) as error:
        analyse_stability(build_model(two(nominal, {"drum.speed": 0.0})))
    assert error.value.reason is NoSteadySliding.AT_REST


@pytest.mark.thorough
def test_a_shoe_without_load_beside_one_with_it_has_no_contact_to_lose(nominal):
    model = build_model(two(nominal, {"shoe.1.contact": {"stiffness": 3.5e10, "normal_load": 0.0}}))
    assert idle_shoes(model, [0.0]).tolist() == [[False], [True]]
    mode, rest = mode_of(together(model)), np.zeros((1, len(model.names)))
    (both,) = amplitudes_at_boundary(model, [mode], rest, [0.0])
    alone = build_model(two(nominal))
    (pressed,) = amplitudes_at_boundary(alone, [mode], rest, [0.0])
    assert both >= pressed > 0
