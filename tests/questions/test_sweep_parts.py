"""What a sweep puts down of each point, and what it counts, against numbers put in by hand."""

import json
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray
from scipy import stats

from drumsqueal.dynamics import ensemble
from drumsqueal.dynamics.ensemble import point_of
from drumsqueal.dynamics.saturated import Saturated, rate_since
from drumsqueal.errors import COMPLETE, SteadyStateError
from drumsqueal.findings.decay import Rest
from drumsqueal.findings.kinds import Kind
from drumsqueal.questions.sweep import file as filling
from drumsqueal.questions.sweep import in_python as study_basin
from drumsqueal.questions.sweep import points as p
from drumsqueal.questions.sweep import study as starts
from drumsqueal.questions.sweep import study as study_module
from drumsqueal.questions.sweep.found import (
    _responses,
    _unstable_modes,
    find_basin,
    fraction,
    number_motions,
    rank_correlation,
    study_chance,
    summarise,
)
from drumsqueal.questions.sweep.points import BodyPlan
from drumsqueal.questions.sweep.study import _note_stability, batches
from drumsqueal.scene.plan import _checked, draw, grid, sample
from drumsqueal.scene.uncertain import Uniform
from drumsqueal.scene.variation import Variation

NAMES = ("X", "Y", "Tz")


def ended(**changed: Any) -> Saturated:
    known: dict[str, Any] = {
        "amplitude": np.array([5.0, 6.0]),
        "rms": np.ones(2),
        "boundary_ratios": (0.3, 0.4),
        "frequency_Hz": 50.0,
        "line": "X",
        "kinetic_energy": 7.0,
        "rate": 0.0,
        "seconds": 1.0,
        "vibration": np.ones(2),
        "velocity": np.ones(2),
        "outcome": COMPLETE,
    }
    return Saturated(**(known | changed))


def body_plan(draws: int = 4) -> BodyPlan:
    model: Any = SimpleNamespace(names=NAMES)
    box = {"velocity.X": Uniform(-1.0, 3.0), "displacement.Tz": Uniform(0.5, 0.75)}
    return BodyPlan(model, box, draws, 5, 100.0, 1e-6, "auto")


def test_shapes_that_are_others_at_each_point_have_no_place_in_a_sweep(nominal, monkeypatch):
    own = {None: ("X", "Y", "E1", "S2"), 0.01: ("X", "Y", "E1", "E2", "E3", "S4"), 0.03: ("X", "Y", "S1")}
    monkeypatch.setattr(p, "coordinates_of", lambda scene: own[scene.asked])

    def scene(asked):
        return SimpleNamespace(asked=asked, with_values=lambda values: scene(next(iter(values.values()), asked)))

    plan: Any = SimpleNamespace(scene=scene(None), ends={"shoe.thickness": (0.01, 0.03), "drum.speed": (1.0, 2.0)})
    assert p.names_of(plan) == ("X", "Y", "E1", "E2", "E3")
    columns = p.blank(body_plan(), 2)
    rest = Rest(near=False, elsewhere=np.array([8.0, 9.0]))
    p.note_motion(columns, 1, ended(line="S2", rest=rest), NAMES, ("S2", "X"), settled=True)
    assert columns["amplitude"][1].tolist() == [6.0, 0.0, 0.0]
    assert columns["rest"][1].tolist() == [9.0, 0.0, 0.0]
    assert columns["main_coordinate"][1] == p.NONE


def test_where_a_body_yields_in_shapes_of_its_own_modes_are_followed_in_those_of_the_scene(nominal, monkeypatch):
    """At the point a third mode lies between two; the scene's own shapes have but these, in another order."""
    built = []

    def modes(*hertz):
        return [SimpleNamespace(eigenvalue=1j * each) for each in hertz]

    def continued(model_at, own, end):
        model_at(0.5)
        assert end.modes == ends
        return [1, 0]

    own, ends = SimpleNamespace(coordinates=("X", "E1", "S2"), modes=modes(90.0, 200.0)), modes(100.0, 210.0)
    monkeypatch.setattr(study_module, "build_model", lambda scene, numbers, coordinates: built.append((scene, numbers)))
    monkeypatch.setattr(study_module, "analyse_stability", lambda model: SimpleNamespace(modes=ends))
    monkeypatch.setattr(study_module, "linear_coordinates", lambda scene: ())
    monkeypatch.setattr(study_module, "shaping_numbers", lambda scene: ())
    monkeypatch.setattr(study_module, "continued", continued)
    load = nominal.contact.normal_load
    plan = grid(nominal, [Variation("contact.normal_load", "N", (3 * load, load))])
    there: Any = SimpleNamespace(coordinates=("X", "E1", "S2", "S3"), modes=modes(101.0, 150.0, 208.0))
    assert study_module._numbers(plan, 0, own, there) == [1, p.NONE, 0]  # pyright: ignore[reportArgumentType]
    assert built == [(nominal, {"contact.normal_load": each * load}) for each in (3, 2)]
    there.coordinates = ("X", "E1", "E2")
    assert study_module._numbers(plan, 0, own, there) == [p.NONE] * 3  # pyright: ignore[reportArgumentType]


def test_a_transient_is_put_down_under_its_coordinates():
    columns = p.blank(body_plan(), 4)
    p.note_motion(columns, 1, ended(smallest_force=-2.0), NAMES, ("Tz", "X"), settled=True)
    p.note_motion(columns, 2, ended(outcome="failed: so"), NAMES, ("Tz", "X"), settled=True)
    rest = Rest(near=False, elsewhere=np.array([8.0, 9.0]))
    p.note_motion(columns, 3, ended(rest=rest, frequency_Hz=None, line=None), NAMES, ("Tz", "X"), settled=False)
    np.testing.assert_array_equal(columns["amplitude"], [[np.nan] * 3, [6, 0, 5], [np.nan] * 3, [6, 0, 5]])
    np.testing.assert_array_equal(columns["rest"], [[np.nan] * 3] * 3 + [[9, 0, 8]])
    np.testing.assert_array_equal(columns["kinetic_energy"], [np.nan, 7, np.nan, 7])
    np.testing.assert_array_equal(columns["separation_ratio"], [np.nan, 0.3, np.nan, 0.3])
    np.testing.assert_array_equal(columns["reversal_ratio"], [np.nan, 0.4, np.nan, 0.4])
    np.testing.assert_array_equal(columns["main_frequency"], [np.nan, 50, np.nan, np.nan])
    np.testing.assert_array_equal(columns["smallest_force"], [np.nan, -2, np.nan, np.inf])
    assert columns["main_coordinate"].tolist() == [-1, 0, -1, -1]
    assert columns["settled"].tolist() == [-1, 1, -1, 0]
    assert [p.TRENDS[k] if k >= 0 else None for k in columns["trend"]] == [None, "settled", "failed", "rests elsewhere"]
    assert columns["outcome"].tolist() == [p.NOT_YET, p.NOT_YET, p.FAILED, p.NOT_YET]


def test_the_variables_of_a_plan_have_its_coordinates_and_their_units(nominal):
    body = p.variables_of(body_plan())
    assert set(body) == {"outcome", "leads_to", "attractor", "smallest_force", *p.TRANSIENT}
    assert body["amplitude"].units == body["rest"].units == "m (X, Y), rad (Tz)"
    assert body["main_coordinate"].flags == ((-1, "none"), (0, "X"), (1, "Y"), (2, "Tz"))
    variation = Variation("drum.speed", "rad/s", (1.0, 2.0, 5.0))
    plan = grid(nominal, [variation, Variation("friction.static", "", (0.4, 0.5))])
    assert set(p.variables_of(plan)) == {"outcome", *p.LINEAR}
    assert set(p.variables_of(plan._replace(transient=True))) == {"outcome", *p.LINEAR, *p.TRANSIENT}
    columns = p.blank(plan, 6)
    assert {name: each.shape for name, each in columns.items() if each.ndim > 1} == dict.fromkeys(
        ("growth_rate", "frequency", "unstable", "mode_coordinate", "mode_number", "mode_in_plane"), (6, 6)
    )
    columns["largest_growth_rate"][:] = np.arange(6.0)
    columns["growth_rate"][:] = np.arange(36.0).reshape(6, 6)
    data = p.to_dataset(plan, columns, "as it is")
    np.testing.assert_array_equal(data["largest_growth_rate"].sel({"drum.speed": 5.0}), [4.0, 5.0])
    np.testing.assert_array_equal(
        data["growth_rate"].sel({"drum.speed": 2.0, "friction.static": 0.5}), np.arange(18.0, 24)
    )
    assert (data.attrs["outcome"], json.loads(data.attrs["sweep"])["transient"]) == ("as it is", False)
    assert (data["drum.speed"].attrs["units"], data["friction.static"].attrs["units"]) == ("rad/s", "1")
    assert p.names_in(data) == ("X", "Y", "Z", "Tx", "Ty", "Tz")
    np.testing.assert_array_equal(plan.values(1, 5), [[1, 0.5], [2, 0.4], [2, 0.5], [5, 0.4]])


def test_eigenvalues_are_put_down_mode_by_mode(nominal):
    columns = p.blank(grid(nominal, [Variation("drum.speed", "rad/s", (1.0, 2.0))]), 2)
    shapes = (
        {"X": 1.0, "Y": 2j, "Z": 2e-6},
        {"X": 1e-7, "Y": 0.0, "Z": -1.0},
        {"X": 1.0, "Y": 0.0, "Z": 4e-6},
        {"Z": 1.0},
    )

    def mode(name: str, rate: float, frequency: float, shape: dict[str, complex]) -> Any:
        return SimpleNamespace(
            name=name, growth_rate=rate, frequency_Hz=frequency, unstable=rate > 0, shape=lambda coordinates: shape
        )

    modes = [
        mode(*each)  # pyright: ignore[reportArgumentType]
        for each in zip(("Y", "Z", "Tz", "E1"), (-1.0, 4.0, 3.0, 9.0), (10.0, 20.0, 30.0, 5.0), shapes, strict=True)
    ]
    stability: Any = SimpleNamespace(
        modes=modes, unstable=modes[1:], divergence=None, contact_fraction=0.7, pressure_range=(-2.0, 8.0),
        coordinates=("X", "Y", "Z"),
    )  # fmt: skip
    _note_stability(columns, 1, stability, [3, -1, 0, 7], p.COORDINATES, ("X", "Y", "Tz"))
    np.testing.assert_array_equal(columns["growth_rate"][1], [-1, 4, 3, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(columns["frequency"][1], [10, 20, 30, np.nan, np.nan, np.nan])
    assert columns["unstable"][1].tolist() == [0, 1, 1, -1, -1, -1]
    assert columns["mode_coordinate"][1].tolist() == [1, 2, 5, -1, -1, -1]
    assert columns["mode_number"][1].tolist() == [3, -1, 0, -1, -1, -1]
    assert columns["mode_in_plane"][1].tolist() == [1, 0, -1, -1, -1, -1]
    names = (
        "largest_growth_rate",
        "squeal",
        "divergence_rate",
        "contact_fraction",
        "smallest_pressure",
        "largest_pressure",
    )
    assert [columns[name][1] for name in names] == [9.0, 1, 0.0, 0.7, -2.0, 8.0]
    assert columns["outcome"].tolist() == [p.NOT_YET, p.COMPUTED]
    still: Any = SimpleNamespace(**{**vars(stability), "modes": (), "unstable": (), "divergence": 6.0})
    _note_stability(columns, 0, still, [], p.COORDINATES, ())
    assert np.isnan(columns["largest_growth_rate"][0])
    assert (columns["squeal"][0], columns["divergence_rate"][0]) == (0, 6.0)


def results(**columns: Any) -> xarray.Dataset:
    return xarray.Dataset({name: ("sample", np.asarray(each)) for name, each in columns.items()})


def test_a_point_squeals_where_its_motion_is_sustained_and_no_slow_decay():
    rows = [  # trend, settled, separation, reversal, linear squeal, squeals
        (2, 1, 0.95, 0.0, 0, True), (2, 1, 0.0, 0.95, 0, True), (2, 1, 0.5, 0.85, 0, False), (2, 1, 0.5, 0.5, 1, True),
        (2, 0, 2.0, 2.0, 1, False), (0, 1, 2.0, 2.0, 1, False), (2, 1, 0.5, 0.5, -1, True), (3, 1, 2.0, 2.0, 1, False),
    ]  # fmt: skip
    trend, settled, lost, back, linear, wanted = zip(*rows, strict=True)
    data = results(trend=trend, settled=settled, separation_ratio=lost, reversal_ratio=back, squeal=linear)
    assert p.squealing(data).tolist() == list(wanted)
    assert p.undecided(data).tolist() == [each == 0 for each in settled]
    leads = [p.LEADS.index(each) for each in (Kind.DECAYS, Kind.SQUEALS, Kind.GROWS)]
    assert p.squealing(results(leads_to=leads)).tolist() == [False, True, False]


def test_motions_are_counted_and_each_has_the_medians_of_its_starts(monkeypatch):
    monkeypatch.setattr(p, "attributes", lambda plan: {})  # a stand-in has no program
    leads = [
        Kind.SQUEALS,
        Kind.DECAYS,
        Kind.SQUEALS,
        Kind.SQUEALS,
        Kind.UNDECIDED,
        Kind.RESTS,
        Kind.SQUEALS,
        Kind.RESTS,
    ]
    # In 0.5 of the logarithm of energy and 0.05 of that of frequency one is like another.
    energy = np.array([1.0, np.nan, 1.62, 1.7, np.nan, 0.0, 1.69, 0.0])
    line = [100.0, np.nan, 104.0, 106.0, np.nan, np.nan, 106.5, np.nan]
    plan = body_plan(8)
    columns = p.blank(plan, 8)
    columns["leads_to"][:] = [p.LEADS.index(each) for each in leads]
    columns["kinetic_energy"][:], columns["main_frequency"][:] = energy, line
    columns["amplitude"][:] = np.arange(24.0).reshape(8, 3) ** 2
    columns["main_coordinate"][:] = [0, 1, 2, 2, 1, 1, 0, 1]
    columns["rest"][5], columns["rest"][7] = [1.0, 2.0, 2.0], [1.0, 2.0, 2.0 + 4e-6]
    columns["smallest_force"][:] = 1.0
    data = p.to_dataset(plan, columns, COMPLETE)
    numbers = number_motions(data)
    assert numbers.tolist() == [2, 0, 1, 1, -1, 3, 1, 4]
    assert number_motions(data, of_one_brake=False).tolist() == [2, 0, 1, 1, -1, -1, 1, -1]
    data["rest"].values[7, 2] = 2.0 + 2e-6
    assert number_motions(data)[7] == 3
    data["attractor"].values = numbers
    found = find_basin(data, plan)
    assert (found.squeal.count, found.decay.count, found.squeal.total, found.unclear) == (4, 1, 7, 1)
    first, second = found.attractors
    assert (first.number, first.chance.count, first.frequency_Hz, first.kinetic_energy_J) == (1, 3, 106.0, 1.69)
    assert (second.frequency_Hz, second.kinetic_energy_J) == (100.0, 1.0)
    rows = np.arange(24.0).reshape(8, 3)[[2, 3, 6]] ** 2
    assert first.amplitude == dict(zip(NAMES, np.median(rows, axis=0), strict=True))
    assert first.start == pytest.approx(dict(zip(plan.keys, plan.values(2, 3)[0], strict=True)))
    assert [each.place for each in found.rests] == [
        {"X": 1.0, "Y": 2.0, "Tz": 2.0},
        {"X": 1.0, "Y": 2.0, "Tz": 2.0 + 2e-6},
    ]
    assert (found.coordinate, found.elsewhere, found.notes) == ("X", {"rests elsewhere": 2}, ())
    data["smallest_force"].values[3] = -4.0
    assert find_basin(data, plan).notes == ("the contact pulls: the normal force fell to −4 N; use separation=True",)


def test_starts_are_drawn_from_the_box_by_their_number_alone():
    plan = body_plan()
    values = plan.values(0, 40)
    raw = np.random.PCG64(5).random_raw(80) >> np.uint64(32)
    places = ((raw + 0.5) / 2.0**32).reshape(40, 2)
    np.testing.assert_allclose(values, places * [4.0, 0.25] + [-1.0, 0.5], rtol=1e-12)
    np.testing.assert_array_equal(draw([*plan.distributions.values()], 5, 17, 23), values[17:23])
    displacement, velocity = plan.start(values[3])
    np.testing.assert_array_equal(displacement, [0, 0, values[3, 1]])
    np.testing.assert_array_equal(velocity, [values[3, 0], 0, 0])
    assert (plan.unit("velocity.X"), plan.unit("displacement.Tz"), plan.unit("velocity.Tz")) == ("m/s", "rad", "rad/s")
    assert (plan.shape, plan.points, plan.starts, plan.listed("velocity.X", 2.0)) == ((4,), 4, plan.keys, 2.0)


def test_a_sample_takes_what_is_uncertain_and_ranges_that_go_first(nominal, monkeypatch):
    uncertain = {
        "friction.static": {"distribution": "uniform", "low": 0.3, "high": 0.5},
        "start.displacement.Y": {"distribution": "uniform", "low": 1e-7, "high": 1e-6},
    }
    scene = nominal.with_values({"uncertain": uncertain, "start.displacement": {"Y": 1e-7}})
    speed = Variation("drum.speed", "rad/s", (40.0, 10.0))
    plan = sample(scene, [speed], 100, seed=3)
    assert plan.keys == ("friction.static", "drum.speed")
    half = 0.5 / 2**32  # a sample lies in the middle of its place
    assert plan.ends["friction.static"] == pytest.approx((0.3 + 0.2 * half, 0.5 - 0.2 * half), rel=1e-14)
    assert plan.ends["drum.speed"] == pytest.approx((10.0 + 30 * half, 40.0 - 30 * half), rel=1e-14)
    assert (plan.shape, plan.dimensions, plan.scene.uncertain) == ((100,), ("sample",), None)
    assert sample(scene, [], 2, transient=True).keys == ("friction.static", "start.displacement.Y")
    assert sample(scene, [], 2, transient=True).starts == ("start.displacement.Y",)
    values = plan.values(0, 100)
    assert np.ptp(values, axis=0) == pytest.approx([0.2, 30.0], rel=0.1)
    assert np.all((values > [0.3, 10.0]) & (values < [0.5, 40.0]))
    assert _checked(plan, ["drum.speed"]) is plan
    assert batches(plan) == [(0, 100)]
    assert batches(plan._replace(transient=True)) == [(0, 32), (32, 64), (64, 96), (96, 100)]
    monkeypatch.setattr(
        study_module, "linear_coordinates", lambda scene: ("X",) * 7
    )  # one that bends, at seconds a point
    assert batches(plan._replace(draws=6)) == [(0, 4), (4, 6)]


def sweep_of(growth: Any, frequency: Any, coordinate: Any, number: Any, **more: Any) -> xarray.Dataset:
    unstable = np.where(np.isnan(growth), -1, np.asarray(growth) > 0)
    modes = {
        "growth_rate": growth,
        "frequency": frequency,
        "unstable": unstable,
        "mode_coordinate": coordinate,
        "mode_number": number,
    }
    data = xarray.Dataset(
        {name: (("drum.speed", "mode"), np.asarray(each)) for name, each in modes.items()},
        {"drum.speed": [1.0, 2.0, 5.0]},
    )
    data["mode_coordinate"].attrs["flag_meanings"] = "none X Y Tz"
    return data.assign({name: ("drum.speed", np.asarray(each)) for name, each in more.items()})


GROWTH = np.array([[-1.0, 2.0, np.nan], [3.0, 7.0, 1.0], [-5.0, 4.0, 6.0]])
FREQUENCY = np.array([[10.0, 20.0, np.nan], [11.0, 21.0, 31.0], [12.0, 22.0, 32.0]])
COORDINATE, NUMBER = [[0, 2, -1], [0, 2, 2], [2, 2, 1]], [[0, 1, -1], [0, 1, -1], [1, 0, -1]]


def test_each_mode_is_counted_where_it_grows_and_named_where_most():
    data = sweep_of(GROWTH, FREQUENCY, COORDINATE, NUMBER)
    plan: Any = SimpleNamespace(keys=("drum.speed",), draws=0)
    found = _unstable_modes(data, plan)
    # Mode 0 is X at first and Tz last; of those that continue none, Tz at 2 rad/s, a second one, and Y at 5.
    assert {
        name: (m.unstable_points, m.largest_growth_rate_1_per_s, m.frequency_there_Hz, m.where["drum.speed"])
        for name, m in found.items()
    } == {"X": (2, 4.0, 22.0, 5.0), "Tz": (2, 7.0, 21.0, 2.0), "Tz (2)": (1, 1.0, 31.0, 2.0), "Y": (1, 6.0, 32.0, 5.0)}
    assert list(p.modes_in(data)) == ["X", "Y", "Tz", "Tz (2)"]


def test_transients_are_counted_by_what_became_of_them():
    data = sweep_of(
        GROWTH, FREQUENCY, COORDINATE, NUMBER, trend=[2, 0, 2], settled=[1, 0, 1], separation_ratio=[2.0] * 3,
        reversal_ratio=[0.0] * 3, squeal=[1, 1, 0], simulated=[3.0, 9.0, 12.0], outcome=[0, 0, p.FAILED],
    )  # fmt: skip
    data["amplitude"] = (("drum.speed", "coordinate"), [[1.0, 5.0, 2.0], [3.0, 4.0, 1.0], [9.0, 9.0, 9.0]])
    data["main_coordinate"] = data["trend"].assign_attrs(flag_meanings="none X Y Tz")
    found = _responses(data)
    assert (found.points_with_squeal, found.points_not_settled, found.longest_of_them_s) == (2, 1, 9.0)
    assert found.trends == {"settled": 2, "not settled": 1}
    assert found.largest_amplitude == {"X": 3.0, "Y": 5.0, "Tz": 2.0}


def test_chances_are_of_the_samples_that_have_eigenvalues(nominal):
    rng = np.random.default_rng(0)
    known = np.array([True] * 7 + [False] * 2)
    growth = rng.normal(size=(9, 6)) - 0.5
    first, second = rng.normal(size=(2, 9))
    plan = sample(
        nominal, [Variation("drum.speed", "rad/s", (1.0, 9.0)), Variation("friction.static", "", (0.3, 0.4))], 9
    )
    columns = p.blank(plan, 9)
    columns["outcome"][:] = np.where(known, p.COMPUTED, p.NOT_TAKEN)
    columns["growth_rate"][known], columns["frequency"][known] = growth[known], 1.0
    columns["unstable"][known] = growth[known] > 0
    columns["mode_coordinate"][known] = columns["mode_number"][known] = np.arange(6)
    columns["largest_growth_rate"][known] = growth[known].max(axis=1)
    columns["squeal"][known] = (growth[known] > 0).any(axis=1)
    columns["divergence_rate"][known] = [0, 1, 0, 0, 2, 0, 3]
    data = p.to_dataset(plan, columns, COMPLETE)
    data = data.assign_coords({"drum.speed": ("sample", first), "friction.static": ("sample", second)})
    found = study_chance(data)
    assert found is not None
    assert (found.squeal.count, found.squeal.total, found.left_out) == ((growth[:7] > 0).any(axis=1).sum(), 7, 2)
    assert {name: each.count for name, each in found.modes.items()} == {
        name: int((growth[:7, k] > 0).sum()) for k, name in enumerate(p.COORDINATES)
    }
    assert found.noise == pytest.approx(1.96 / math.sqrt(6))
    for key, values in (("drum.speed", first), ("friction.static", second)):
        ranks = [stats.rankdata(each) for each in (values[:7], growth[:7].max(axis=1))]
        assert found.correlations[key] == pytest.approx(np.corrcoef(*ranks)[0, 1])
    assert rank_correlation([1, 2, 3, np.nan], [1, 2, 3, 4]) is rank_correlation([1, 2, 3, 4], [5, 5, 5, 5]) is None
    assert rank_correlation([1, 2, 3, 4], [9, 7, 5, 1]) == pytest.approx(-1.0)
    sizes = list(map(abs, found.known_correlations.values()))
    assert sizes == sorted(sizes, reverse=True)
    study = summarise(data, plan)
    assert (study.points, study.points_with_divergence) == (9, 3)
    assert study.outcomes == {"computed": 7, "the scene does not take these values": 2}
    assert study.points_with_squeal == found.squeal.count
    assert study.units == {"drum.speed": "rad/s", "friction.static": "1"}
    assert (fraction(1, 4).share, fraction(1, 4).percent) == (0.25, "25 %")
    assert math.isnan(fraction(1, 4).low)
    assert fraction(0, 0).in_words == "none known"


def test_a_growthrate_since_the_round_before_is_that_of_the_rms():
    assert rate_since(ended(kinetic_energy=2.0), ended(kinetic_energy=3.0), 0.4) == pytest.approx(np.log(1.5) / 0.8)
    assert rate_since(None, ended(), 0.4) == rate_since(ended(kinetic_energy=0.0), ended(), 0.4) == math.inf


def test_a_stability_is_a_linear_point_of_its_number():
    stability: Any = SimpleNamespace(
        steady_state=np.ones(1), modes=("m",), matrix=np.eye(2), vibrations=("o",),
        eigenvalues=np.array([3 + 4j, -6.0, 3.0, 1j]),
    )  # fmt: skip
    found = point_of(7, stability)
    assert (found.value, found.modes, found.divergence, found.largest, found.vibrations) == (
        7.0,
        ("m",),
        3.0,
        6.0,
        ("o",),
    )
    assert not found.reason


def test_a_motion_that_is_brief_runs_on_until_its_size_stays(monkeypatch):
    runs = []

    def response(start: Any, leads: Kind, size: float, seconds: float, fluctuation: float = 0.0) -> Any:
        state = np.array([[size], [0.0]])
        motion = SimpleNamespace(fluctuation=fluctuation, line_of="X", amplitude={"X": size}, state=state)
        squeals = leads is Kind.SQUEALS
        return SimpleNamespace(
            value=float(start.name), disturbance=None, from_value=None, start=start.name, leads_to=leads,
            motion=motion if squeals else None, simulated_s=seconds,
            saturated=ended(amplitude=np.array([size])),
        )  # fmt: skip

    def find_attractors(family, tasks, how, *, rounds, known, progress):
        runs.append((rounds, [start.name for _, start in tasks]))
        for _, start in tasks:
            size = float(start.vibration[0])
            if start.name == "0":
                yield response(start, Kind.DECAYS, size, 1.0)
            elif start.name == "1":
                yield response(start, Kind.SQUEALS, 1.004 * size, 2.0)
            elif start.name == "2":
                yield response(start, Kind.SQUEALS, 1.006 * size, 3.0)
            elif start.name == "3":
                yield response(start, Kind.SQUEALS, size, 5.0, fluctuation=0.1)
            else:
                yield response(start, Kind.FAILED, size, 7.0)

    monkeypatch.setattr(ensemble, "find_attractors", find_attractors)
    monkeypatch.setattr(starts, "point_of", lambda k, found: SimpleNamespace(value=float(k)))
    plan = body_plan(5)
    columns = p.blank(plan, 5)
    stability: Any = SimpleNamespace(coordinates=NAMES)
    models: Any = {k: SimpleNamespace(names=("X",)) for k in range(5)}
    given = {k: (np.array([1.0 + k]), np.zeros(1)) for k in range(5)}
    how: Any = None
    starts.follow_starts(columns, NAMES, models, dict.fromkeys(models, stability), given, how, lambda: None)  # pyright: ignore[reportArgumentType]
    assert runs == [(3, ["0", "1", "2", "3", "4"]), (2, ["1", "2"]), (10, ["2"])]
    assert [p.LEADS[k] for k in columns["leads_to"]] == [Kind.DECAYS, *[Kind.SQUEALS] * 3, Kind.FAILED]
    np.testing.assert_array_equal(columns["simulated"], [1.0, 4.0, 9.0, 5.0, np.nan])
    assert columns["attractor"].tolist() == [0, -1, -1, -1, -1]
    np.testing.assert_allclose(columns["amplitude"][:4, 0], [1.0, 2.0 * 1.004**2, 3.0 * 1.006**3, 4.0])


def test_what_is_missing_of_a_file_is_computed_once_and_starts_are_numbered(monkeypatch):
    done, noted = np.array([True, True, False, True, True, False]), []
    written: dict[int, Any] = {}
    data = results(attractor=np.zeros(6))
    file: Any = SimpleNamespace(
        computed=lambda: done,
        write=written.__setitem__,
        read=lambda: data,
        note=lambda name, values: noted.append((name, values.tolist())),
    )
    plan: Any = SimpleNamespace(points=6, starts=("velocity.X",), shape=(6,))
    monkeypatch.setattr(filling, "batches", lambda plan: [(0, 2), (2, 4), (4, 6)])
    monkeypatch.setattr(filling, "number_motions", lambda data, of_one_brake: np.arange(6) * (2 if of_one_brake else 1))
    monkeypatch.setattr(filling, "starts_alone", lambda plan: True)
    seen: list[tuple[str, float, float]] = []

    def source(plan, left, look):
        assert left == [(2, 4), (4, 6)]
        yield 2, "two"
        yield 4, "four"

    found = filling.fill_file(file, plan, source, lambda *given: seen.append(given))  # pyright: ignore[reportArgumentType]
    assert written == {2: "two", 4: "four"}
    assert noted == [("attractor", [0, 2, 4, 6, 8, 10])]
    assert found["attractor"].values.tolist() == [0, 2, 4, 6, 8, 10]
    assert seen == [("sweeping", 2, 6), ("sweeping", 4, 6), ("sweeping", 6, 6)]


def test_a_basin_is_sampled_forty_times_in_the_shortest_period(monkeypatch):
    stability: Any = SimpleNamespace(highest_frequency_Hz=30.0, eigenvalues=np.array([-8.0 + 0j, -3.0]))
    asked = []
    monkeypatch.setattr(study_basin, "analyse_stability", lambda model: stability)
    monkeypatch.setattr(study_basin, "constant_transient", lambda *given, **how: asked.append(how["sample_rate"]))
    model: Any = SimpleNamespace(forced=False)
    assert study_basin._sample_rate(model, None) == 1200.0
    assert study_basin._sample_rate(model, 50.0) == 50.0
    stability.highest_frequency_Hz = 0.0
    assert study_basin._sample_rate(model, None) == pytest.approx(40 * 8.0 / (2 * np.pi))
    assert asked == pytest.approx([1200.0, 50.0, 160 / np.pi])


def test_points_without_steady_sliding_have_its_reason(monkeypatch, nominal):
    from drumsqueal.errors import NoSteadySliding

    plan = grid(nominal, [Variation("drum.speed", "rad/s", (1.0, 2.0, 5.0))])
    reasons = [NoSteadySliding.SELF_LOCKING, NoSteadySliding.NOT_FINITE, NoSteadySliding.PULLED_OFF]
    found = dict(enumerate(map(SteadyStateError, reasons)))
    monkeypatch.setattr(study_module, "_analyse", lambda plan, first, scenes: {k: found[first + k] for k in scenes})
    monkeypatch.setattr(study_module, "analyse_many", lambda scenes: [None])
    assert study_module.compute(plan, 1, 3)["outcome"].tolist() == [p.NOT_FINITE, p.NOT_FOUND]
    data = filling.in_memory(plan)
    assert data["outcome"].values.tolist() == [p.LOCKED, p.NOT_FINITE, p.NOT_FOUND]


def test_scenes_of_one_kind_are_run_round_by_round_until_each_has_settled(monkeypatch, nominal):
    """Of four points the second settles in the first round, the first in the second, and the last never."""
    scene = nominal.with_values(
        {"simulate.duration": 0.02, "start": {"displacement": {"Y": 2e-6}, "velocity": {"X": 3e-3}}}
    )
    plan = grid(scene, [Variation("drum.speed", "rad/s", (1.0, 2.0, 3.0, 4.0))], transient=True)
    columns = p.blank(plan, 4)
    rounds: list[Any] = []
    moving = ("Y", "X")
    steady = {k: np.arange(6.0) + 10 * k for k in (0, 1, 3)}
    found: dict[int, Any] = {
        k: SimpleNamespace(coordinates=p.COORDINATES, steady_state=steady[k], over=lambda names, k=k: SimpleNamespace(
            matrix=("matrix", k, names))) for k in steady
    }  # fmt: skip

    def motions(models, places, displacements, velocities, how, *, matrices):
        number = len(rounds)
        rounds.append((models, [each.tolist() for each in places], displacements, velocities, how, matrices))
        return [
            ended(
                kinetic_energy=10.0 + k + number, vibration=np.array([k, number]), velocity=np.array([-k, number]),
                amplitude=np.array([k + 0.1 * number, 9.0]),
            )
            for _, k in models
        ]  # fmt: skip

    judged: list[Any] = []

    def settled(motion, stability, rate):
        k, number = motion.vibration
        judged.append((k, number, rate))
        return (k, number) in ((1, 0), (0, 1))

    monkeypatch.setattr(
        study_module, "build_model", lambda scene: NamedModel((scene.title, int(scene.drum.speed) - 1), moving)
    )
    monkeypatch.setattr(study_module, "saturated_motions", motions)
    monkeypatch.setattr(study_module, "has_settled", settled)
    monkeypatch.setattr(study_module, "most_rounds", lambda scene: 3)
    looked: list[int] = []
    scenes = {k: plan.scene_at(plan.values(k, k + 1)[0]) for k in steady}
    study_module._follow_scenes(plan, columns, scenes, found, 5, lambda: looked.append(1))
    assert [[k for _, k in models] for models, *_ in rounds] == [[0, 1, 3], [0, 3], [3]]
    assert len(looked) == 3
    _, places, displacements, velocities, how, matrices = rounds[0]
    assert places == [[10 * k + 1.0, 10.0 * k] for k in steady]  # of Y and X
    assert [each.tolist() for each in displacements] == [[2e-6, 0.0]] * 3
    assert [each.tolist() for each in velocities] == [[0.0, 3e-3]] * 3
    assert matrices == [("matrix", k, moving) for k in steady]
    assert how == (50e3, 1e-6, 0.02, "auto", 5)
    assert [each.tolist() for each in rounds[1][2]] == [[0, 0], [3, 0]]
    assert [each.tolist() for each in rounds[2][3]] == [[-3, 1]]
    rate = np.log(14.0 / 13.0) / 2 / 0.02
    assert judged[-2:] == [(3, 1, pytest.approx(rate)), (3, 2, pytest.approx(np.log(15.0 / 14.0) / 0.04))]
    assert judged[0] == (0, 0, math.inf)
    np.testing.assert_array_equal(columns["simulated"], [0.04, 0.02, np.nan, 0.06])
    np.testing.assert_array_equal(columns["settled"], [1, 1, -1, 0])
    place = p.names_of(plan).index("Y")
    np.testing.assert_allclose(columns["amplitude"][:, place], [0.1, 1.0, np.nan, 3.2])


class NamedModel(tuple):
    """What a model is of, and the names of its coordinates."""

    names: tuple[str, ...]

    def __new__(cls, of, names):
        self = super().__new__(cls, of)
        self.names = names
        return self


@pytest.mark.parametrize("of_body", [True, False])
def test_starts_are_followed_in_rounds_of_the_slowest_mode_of_the_brake_itself(monkeypatch, nominal, of_body):
    given: list[Any] = []
    monkeypatch.setattr(starts, "follow_starts", lambda *of: given.append(of))
    monkeypatch.setattr(study_module, "follow_starts", lambda *of: given.append(of))
    seconds = lambda stability, names: (stability, tuple(names))  # noqa: E731
    monkeypatch.setattr(starts, "round_of", seconds)
    monkeypatch.setattr(study_module, "round_of", seconds)
    look = lambda: None  # noqa: E731
    if of_body:
        plan, stability = body_plan(9), SimpleNamespace(coordinates=NAMES)
        monkeypatch.setattr(starts, "analyse_stability", lambda model: stability)
        columns = starts.compute_starts(plan, 3, 7, 2, look)
        assert (columns["outcome"] == p.COMPUTED).all()
        ((noted, coordinates, models, found, begun, how, looked),) = given
        assert noted is columns
        assert (coordinates, looked) == (NAMES, look)
        assert models == dict.fromkeys(range(4), plan.model)
        assert found == dict.fromkeys(range(4), stability)
        assert how == (100.0, 1e-6, (stability, NAMES), "auto", 2)
        for k, values in enumerate(plan.values(3, 7)):
            np.testing.assert_array_equal(begun[k], plan.start(values))
        return
    scene = nominal.with_values({"start": {"displacement": {"Y": 2e-6}}})
    some = [Variation("start.velocity.Y", "m/s", (0.1, 0.2, 0.3))]
    plan = grid(scene, some, transient=True)
    monkeypatch.setattr(study_module, "Stability", SimpleNamespace)
    own = SimpleNamespace()
    one, other = SimpleNamespace(), SimpleNamespace()
    built: list[Any] = []

    def build(scene):
        built.append(scene)
        return NamedModel((len(built),), ("Y", "Tz"))

    monkeypatch.setattr(study_module, "build_model", build)
    monkeypatch.setattr(study_module, "analyse_many", lambda scenes: [own])
    scenes = {k: plan.scene_at(plan.values(k, k + 1)[0]) for k in range(3)}
    columns = p.blank(plan, 3)
    study_module._follow_starts(plan, columns, scenes, {0: one, 1: other, 2: one, 7: None}, 4, look)  # pyright: ignore[reportArgumentType]
    ((noted, coordinates, models, found, begun, how, looked),) = given
    assert noted is columns
    assert (tuple(coordinates), looked) == (tuple(p.names_of(plan)), look)
    assert len(built) == 2  # one for each brake, whatever its starts
    assert models[0] is models[2]
    assert models[1] is not models[0]
    assert found == {0: one, 1: other, 2: one}
    assert how == (50e3, 1e-6, (own, ("Y", "Tz")), "auto", 4)
    for k in range(3):
        assert [each.tolist() for each in begun[k]] == [[2e-6, 0.0], [pytest.approx(0.1 * (k + 1)), 0.0]]
    monkeypatch.setattr(study_module, "analyse_many", lambda scenes: [None])
    study_module._follow_starts(plan, columns, scenes, {0: one, 1: other, 2: one}, 4, look)  # pyright: ignore[reportArgumentType]
    assert given[-1][5].round_seconds == scene.simulate.duration  # where the scene itself does not slide
