"""Two shoes on one drum: limits of one shoe and of a stiff drum, places on the drum, forces, damping, wrong scenes."""

import functools
import inspect
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import drums
from drumsqueal import command_line
from drumsqueal.command_line import take_each
from drumsqueal.coordinates import is_elastic, is_of_drum, is_static
from drumsqueal.errors import NoSteadySliding, NothingToDoError, RequestError, SteadyStateError
from drumsqueal.files import history_file
from drumsqueal.files.history_file import Reached
from drumsqueal.files.output_folder import HISTORY, files_of
from drumsqueal.findings.brake import describe_brake
from drumsqueal.findings.squeals import changing_keys, instant_at
from drumsqueal.findings.vibration import surface_levels
from drumsqueal.physics.bodies.brake import Placed, share, turned
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.composition import coordinates_of, kept_coordinates
from drumsqueal.physics.effects.effect import BY_SHOE
from drumsqueal.physics.effects.springs import Springs
from drumsqueal.physics.elasticity import elastic_frequencies
from drumsqueal.physics.model import build_model
from drumsqueal.precision import real
from drumsqueal.questions import check as checking
from drumsqueal.questions.accuracy.study import check_motion
from drumsqueal.questions.cycle.study import checked
from drumsqueal.scene import SceneError, load_scene, quantity_of
from drumsqueal.scene.usual import unusual
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.family import analyse_many
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.motion import integrate
from drumsqueal.solve.transient.integrate import Checkpoint
from drumsqueal.solve.transient.runge_kutta import DEFAULT
from drumsqueal.solve.transient.state import State
from drumsqueal.solve.transient.stick_slip import Method
from drumsqueal.solve.transient.sticking import drum_motion, friction_limit, slip, stuck_model

MESHES = Path(__file__).with_name("meshes")
CUP = {**drums.CUP, "up_to": 2.7e3}  # as in test_mesh_drum.py: its modes are found once


def two(nominal, position=0.0, apart=np.pi, drum=CUP, **tables):
    """Return the paper's brake with two of its shoes at a position (rad) and so much beyond it."""
    return drums.several(nominal, {"first": position, "second": position + apart}, drum, **tables)


def eigenvalues(scene):
    """Return those of all coordinates, in order."""
    return np.sort_complex(analyse_stability(build_model(scene, coordinates=coordinates_of(scene))).eigenvalues)


def test_what_is_unusual_of_one_shoe_is_said_under_its_key(nominal):
    own = {"stiffness": 3.5e1, "normal_load": 2e3}
    scene = two(nominal, damping={"ratio": 0.5}).with_values({"shoe.1.contact": own, "shoe.0.density": 7.85})
    said = list(unusual(scene))
    assert [each.partition(" ")[0] for each in said] == ["shoe.0.density", "damping.ratio", "shoe.1.contact.stiffness"]


def test_starts_of_coordinates_have_the_name_of_their_shoe(nominal):
    scene = two(nominal).with_values({"start.velocity": {"first.Y": 2e-3, "second.Tz": 0.1, "drum.E1": 1e-4}})
    found = scene.starts()
    wanted = {"first.Y": 2e-3, "second.Tz": 0.1, "drum.E1": 1e-4, "second.Y": 0.0}
    assert {name: found[f"start.velocity.{name}"] for name in wanted} == wanted
    units = [quantity_of(f"start.velocity.{name}", scene).unit for name in ("first.Y", "second.Tz", "drum.E1")]
    assert units == ["m/s", "rad/s", "m*kg^0.5/s"]


PUSHED = (
    {"at": (0.0558, 0.0707, 0.0), "direction": (1.0, 0.0, 0.0), "stiffness": 1e9, "damping": 0.0},
    {"at": (0.0558, 0.0707, 0.0), "direction": (0.0, 1.0, 0.0), "stiffness": 1e9, "damping": 0.0},
)


def pushed(nominal, frictions):
    """Return a brake of two shoes on pins, pushed, each with a coefficient of friction of its own."""
    scene = two(nominal, apart=np.pi, steady={"state": "self-consistent"}, support=None)
    force = [{"at": (0.04, -0.09, 0.0), "direction": (1.0, 0.0, 0.0), "size": 1000.0}]
    values: dict[str, Any] = {"contact": {"stiffness": 3.5e10}}
    for k, coefficient in enumerate(frictions):
        values[f"shoe.{k}.friction"] = {"law": "constant", "coefficient": coefficient}
        values |= {f"shoe.{k}.spring": [dict(each) for each in PUSHED], f"shoe.{k}.force": force}
    return scene.with_values(values)


@pytest.mark.thorough
def test_locking_of_all_shoes_does_not_depend_on_their_order(nominal):
    found = []
    for frictions in ((0.3, 0.5), (0.5, 0.3)):
        prepared = prepare(pushed(nominal, frictions))
        found.append(describe_brake(prepared.scene, prepared.linear, prepared.stability))
    one, other = found
    assert one.locking_coefficient == pytest.approx(other.locking_coefficient, rel=1e-3)
    assert one.friction_coefficient == other.friction_coefficient == 0.5


@pytest.mark.thorough
def test_loads_of_each_shoe_count_at_every_time(nominal):
    load = {"time": (0.0, 0.01), "value": (1000.0, 2000.0)}
    area = nominal.shoe.outer_radius * nominal.shoe.arc_angle * nominal.shoe.width
    scene = two(nominal).with_values(
        {"shoe.1.arc_angle": 1.2, "shoe.1.contact": {"stiffness": 3.5e10, "normal_load": load}}
    )
    model: Any = build_model(scene, coordinates=coordinates_of(scene))
    assert list(changing_keys(model)) == ["shoe.1.contact.normal_load"]
    assert instant_at(model, 0.01).value("shoe.1.contact.normal_load") == pytest.approx(2000)
    assert instant_at(model, 0.01).rate("shoe.1.contact.normal_load") == pytest.approx(1e5)
    assert instant_at(model, 0.01).normal_load_N == pytest.approx(2000 + nominal.contact.normal_load)
    both = two(nominal).with_values({"shoe.1.arc_angle": 1.2, "contact.normal_load": load})
    shared: Any = build_model(both, coordinates=coordinates_of(both))
    assert instant_at(shared, 0.01).value("contact.normal_load") == pytest.approx(2000)
    # What is pressed more at a time lifts off later: as in the model of that time.
    still, late = np.zeros(len(model.names)), model.frozen(0.01)
    first, second = pressures = surface_levels(model, still[None], [0.01])
    for found, wanted in zip(pressures, surface_levels(late, still[None], [0.0]), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-12)
    np.testing.assert_allclose(first, nominal.contact.normal_load / area)
    np.testing.assert_allclose(second, 2000 * nominal.shoe.arc_angle / (1.2 * area))
    # A load that does not change beside one that does makes no trouble.
    assert np.all(np.isfinite(model.act(0.005, still, still)[0]))


@pytest.mark.thorough
def test_each_shoe_has_its_own_numbers_and_what_it_includes(nominal):
    scene = two(nominal).with_values(
        {"shoe.1.arc_angle": 1.2, "shoe.1.friction": {"law": "constant", "coefficient": 0.3}}
    )
    prepared = prepare(
        scene.with_values({"shoe.0.contact": {"stiffness": 1e10, "normal_load": 500.0, "separation": False}})
    )
    numbers = {name: value for name, value, _, _ in checking._numbers(prepared)}
    area = nominal.shoe.outer_radius * nominal.shoe.width
    assert numbers["first: mean pressure p0"] == pytest.approx(500 / (area * nominal.shoe.arc_angle))
    assert numbers["second: mean pressure p0"] == pytest.approx(nominal.contact.normal_load / (area * 1.2))
    assert "first: bonded contact" in prepared.inventory.includes
    assert "second: contact that separates" in prepared.inventory.includes
    assert "second: friction: constant law" in prepared.inventory.includes
    assert "friction along the unit slip velocity" in prepared.inventory.includes


@pytest.mark.parametrize("check", [check_motion, checked])
def test_what_is_asked_of_one_shoe_is_refused_before_anything_is_computed(nominal, check):
    with pytest.raises(RequestError, match="--set shoe=first or --set shoe=second"):
        check(two(nominal))
    check(two(nominal).alone[1].with_values({"start.displacement": {"Y": 1e-7}}))


LAW = {"law": "constant", "coefficient": 0.3}


def second_rubs(nominal, drum=CUP, **tables):
    """Return two shoes of which the second alone has friction and load, in tables of its own."""
    load = {"stiffness": 3.5e10, "normal_load": 1000.0}
    scene = two(nominal, drum=drum, friction=None, contact={**load, "normal_load": 0.0})
    return scene.with_values({"shoe.1.friction": LAW, "shoe.1.contact": load, **tables})


@pytest.mark.thorough
def test_a_brake_rubs_and_is_pressed_where_one_shoe_is_by_its_own_tables(nominal):
    scene = second_rubs(nominal)
    assert (scene.rubs, scene.pressed) == (True, True)
    without = scene.with_values({"shoe.1.friction": None, "shoe.1.contact.normal_load": 0.0})
    assert (without.rubs, without.pressed) == (False, False)
    model: Any = build_model(scene, friction_law=lambda slip_speed: 0.4 + 0.0 * slip_speed)
    assert [contact.friction is not None for contact in model.contact.each] == [False, True]
    first, second = second_rubs(nominal, drum=None, temperature={"heat_capacity": 300.0}).alone
    assert (first.temperature, second.temperature is not None) == (None, True)


@pytest.mark.thorough
def test_a_drum_at_rest_under_friction_of_one_shoe_is_at_rest(nominal):
    (found,) = analyse_many([second_rubs(nominal, **{"drum.speed": 0.0})])
    assert isinstance(found, SteadyStateError)
    assert found.reason is NoSteadySliding.AT_REST


@pytest.mark.thorough
def test_a_run_that_sticks_by_friction_of_one_shoe_goes_on(nominal):
    scene = second_rubs(nominal)
    whole = round(scene.simulate.duration * scene.simulate.sample_rate)
    rest, step = real(np.zeros(len(kept_coordinates(scene)))), real(1e-6)
    checkpoint = Checkpoint(whole, State(rest, rest, 0.0 * step), step, 0.0, sticks=True, method=Method(DEFAULT, 1, 0))
    plain = history_file._to_plain(
        history_file.ResumePoint(Reached(whole + 1), checkpoint), history_file._digest(scene)
    )
    assert history_file._from_plain(plain, scene).checkpoint.sticks


def test_a_shoe_that_nothing_presses_is_named(nominal):
    shared = r"^scene: contact\.normal_load: .* the lining of the first shoe .* to \[contact\]"
    with pytest.raises(SceneError, match=shared):
        two(nominal, contact={"stiffness": 3.5e10})
    own = r"^scene: shoe\.1\.contact\.normal_load: .* the lining of the second shoe .* to \[shoe\.contact\]"
    with pytest.raises(SceneError, match=own):
        two(nominal).with_values({"shoe.1.contact": {"stiffness": 3.5e10}})


@pytest.mark.thorough
def test_a_mode_that_one_shoe_does_not_have_is_told_under_its_key(nominal):
    steel = {"young": 210e9, "poisson": 0.3, "up_to": 100.0}
    scene = two(nominal).with_values({"shoe.1.elastic": steel, "start.velocity": {"second.E1": 1e-3}})
    with pytest.raises(SceneError, match=r"the second shoe has no free mode .* raise shoe\.1\.elastic\.up_to"):
        build_model(scene)


def nearest(wanted, found):
    """Return how far each of the wanted eigenvalues that are not zero is from the nearest, relative."""
    moving = np.abs(wanted) > 1
    return np.min(np.abs(wanted[moving, None] - found), axis=1) / np.abs(wanted[moving])


@pytest.mark.thorough
def test_turning_both_shoes_about_the_drum_changes_no_eigenvalue(nominal):
    reference = eigenvalues(two(nominal))
    assert np.max(nearest(reference, eigenvalues(two(nominal, position=0.7)))) < 1e-6
    # How far apart they are does.
    assert np.max(nearest(reference, eigenvalues(two(nominal, apart=2.4)))) > 1e-3


@pytest.mark.thorough
def test_a_stiff_drum_leaves_each_shoe_its_own_eigenvalues(nominal):
    stiff = {**CUP, "young": 1e8 * CUP["young"], "up_to": 1e4 * CUP["up_to"]}
    found = eigenvalues(two(nominal, drum=stiff, apart=2.4))
    # The drum yields 1e-8 of what the one of iron does; two equal eigenvalues part by the root of their coupling.
    assert np.max(nearest(eigenvalues(nominal), found)) < 1e-6


@pytest.mark.thorough
def test_a_second_shoe_that_hardly_touches_leaves_the_brake_of_one(nominal):
    one = nominal.with_values({"drum.elastic": CUP})
    soft = two(nominal, position=0.3, apart=2.4).with_values(
        {"shoe.1.contact": {"stiffness": 1.0, "normal_load": 1e-6}}
    )
    assert np.max(nearest(eigenvalues(one), eigenvalues(soft))) < 1e-6


@pytest.mark.thorough
def test_each_shoe_has_the_force_of_the_brake_of_one_and_the_drum_has_both(nominal):
    # Of the drum's modes, which both brakes have in common.
    one, model = (
        cast(
            "Any", build_model(scene, coordinates=tuple(name for name in coordinates_of(scene) if not is_static(name)))
        )
        for scene in (nominal.with_values({"drum.elastic": CUP}), two(nominal, apart=2.4))
    )
    rng, n = np.random.default_rng(4), len(model.names)
    q, v = 1e-7 * rng.normal(size=n), 1e-3 * rng.normal(size=n)
    force = np.asarray(model.contact.act(model.operation.at(0.0), q, v).force)
    wanted, drum = np.zeros(n), {}
    waves = dict(zip(drum_names := one.names[6:], one.body.drum.shapes, strict=True))
    for mine, position in zip(model.contact.shares, (0.0, 2.4), strict=True):
        # What the drum does at a shoe that is turned is what one shoe sees of its modes turned the other way.
        turned = turn(waves, drum_names, position)
        places = np.array(mine.places)
        own, rate = q[places].copy(), v[places].copy()
        own[6:], rate[6:] = turned @ own[6:], turned @ rate[6:]
        found = np.asarray(one.contact.act(one.operation.at(0.0), own, rate).force)
        wanted[places[:6]] = found[:6]
        drum[position] = turned.T @ found[6:]
    wanted[12:] = sum(drum.values())
    np.testing.assert_allclose(force, wanted, rtol=1e-9, atol=1e-9 * np.max(np.abs(wanted)))


def turn(waves, names, angle):
    """Return the matrix (m, m) by which amplitudes of pairs cos nθ, sin nθ become those seen from an angle on."""
    found, n = np.eye(len(names)), {}
    for k, name in enumerate(names):
        shapes = np.abs(np.asarray(waves[name])).sum(axis=(0, 2))
        n[k] = (int(np.argmax(shapes)) + 1) // 2
    for k in range(len(names) - 1):
        if n[k] and n[k] == n[k + 1] and found[k, k] == 1 and found[k, k + 1] == 0:
            c, s = np.cos(n[k] * angle), np.sin(n[k] * angle)
            found[k : k + 2, k : k + 2] = [[c, s], [-s, c]]
    return found


@pytest.mark.thorough
def test_energy_balances_in_a_transient_and_forces_are_summed(nominal):
    model: Any = build_model(two(nominal, apart=2.4))
    motion = integrate(model, {"velocity": {"first.Y": 0.02}}, 1e-3, sample_rate=50e3)
    kinetic = np.max(np.sum(np.asarray(model.mass) * motion.velocity**2, axis=1)) / 2
    assert np.max(np.abs(motion.energy_balance_error)) < 1e-6 * kinetic
    still = np.zeros(len(model.names))
    # At rest both linings bear their load.
    assert float(model.observe(0.0, still, still).normal_force) == pytest.approx(2 * nominal.contact.normal_load)


def test_what_is_of_one_shoe_has_its_places_among_those_of_the_brake():
    names, (first, second) = share(["first.", "second."], [("X", "Tz", "drum.E1"), ("X", "drum.E1")])
    assert names == ("first.X", "first.Tz", "second.X", "drum.E1")
    assert (first.places, second.places, second.of_states) == ((0, 1, 3), (2, 3), [2, 3, 6, 7])
    assert list(map(float, second.taken((1.0, 2.0, 3.0, 4.0)))) == [3.0, 4.0]
    # Forces on the second and on the drum, with none on the first; so is a matrix, and what pushes along a row.
    np.testing.assert_array_equal(second.given((5.0, 7.0)), [0, 0, 5, 7])
    matrix = np.zeros((4, 4))
    matrix[np.ix_([2, 3], [2, 3])] = [[1, 2], [3, 4]]
    np.testing.assert_array_equal(second.spread(jnp.array([[1.0, 2.0], [3.0, 4.0]])), matrix)
    np.testing.assert_array_equal(first.spread(jnp.array([[1.0, 2.0, 3.0]]), 1), [[1, 2, 0, 3]])
    known = {"first.X": 1, "second.X": 2, "drum.E1": 3}
    assert (first.own(known), second.own(known)) == ({"X": 1, "drum.E1": 3}, {"X": 2, "drum.E1": 3})
    # A quarter of a turn takes x to y, and y to −x.
    np.testing.assert_allclose(turned(3.0, 4.0, np.pi / 2), (-4.0, 3.0), atol=1e-15)


def test_a_shoe_and_the_drum_under_it_are_asked_at_its_own_angle_and_move_along_the_axes_of_the_brake():
    # The middle of its lining is at a quarter of a turn: what is at 90 deg or 180 deg is at 0 or π/2 of its own.
    stub: Any = SimpleNamespace(
        of_drum=lambda q, angle, z: (q["X"] + angle, 0.0, z),
        displacement=lambda q, angle, z, radius: (q["X"] + angle, radius, z),
    )
    stub.displaced = functools.partial(RigidShoe.displaced, stub)
    part = Placed(share(["a.", "b."], [("X",), ("X",)])[1][1], stub, np.pi / 2)
    q = {"a.X": 7.0, "b.X": 2.0}
    np.testing.assert_allclose(part.of_drum(q, np.pi, 0.25), (-(2 + np.pi / 2), 0.0, 0.25), atol=1e-15)
    # On the y axis, radially is along y and along the drum against x.
    np.testing.assert_allclose(part.displaced(q, 0.0, 0.1, 0.25), (-0.1, 2.0, 0.25), atol=1e-15)


@pytest.fixture(scope="module")
def unlike(nominal) -> Any:
    """A brake whose second shoe has another contact."""
    scene = two(nominal, apart=2.4, friction={"law": "constant", "coefficient": 0.4})
    scene = scene.with_values({"shoe.1.contact": {"stiffness": 2e10, "normal_load": 500.0}})
    return scene, build_model(scene)


def test_both_shoes_turn_with_the_drum_which_is_there_once(nominal, unlike):
    scene, model = unlike
    # Both turn with the drum: their centres of gravity along Y at c from its axis, and nothing bends by that.
    centroid, lining = float(model.contact.each[0].body.centroid), model.contact.each[0].body.area
    following = dict(zip(model.names, map(float, model.body.velocity_with_drum), strict=True))
    wanted = {f"{name}.{key}": x for name in ("first", "second") for key, x in (("Y", centroid), ("Tz", 1.0))}
    assert {name: x for name, x in following.items() if x != 0} == pytest.approx(wanted)
    assert float(model.body.area) == pytest.approx(2 * float(lining))
    assert (float(model.body.outer_radius), model.body.characteristic_lengths()["second.Tz"]) == pytest.approx(
        (0.1, 0.1)
    )
    assert [float(law.stiffness) for law in model.contact.laws] == [nominal.contact.stiffness, 2e10]
    assert [name for name, slides in zip(model.names, model.contact.slides, strict=True) if not slides] == []
    # The drum is there once, and stores ω² a²/2 in each of its modes.
    (springs,) = (each for each in model.others if isinstance(each, Springs))
    frequencies = 2 * np.pi * np.array(elastic_frequencies(scene, "drum"))
    of_drum = np.array([is_of_drum(name) for name in model.names])
    np.testing.assert_allclose(np.diag(springs.matrix)[of_drum], frequencies**2, rtol=1e-12)


@pytest.mark.thorough
def test_torque_force_and_extent_of_contact_are_known_of_each_shoe(nominal, unlike):
    """By sums over a fine grid of each lining: ∫ N dA, R ∫ μ N dA, and where N > 0."""
    _, model = unlike
    rng = np.random.default_rng(8)
    q = rng.normal(size=len(model.names)) * np.array([1e-6 if is_elastic(name) else 1e-5 for name in model.names])
    still = np.zeros_like(q)
    seen = model.observe(0.0, q, still)
    found = np.reshape(seen.by_shoe, (2, len(BY_SHOE)))
    for (mine, side), (torque, normal, touching) in zip(model.sides, found, strict=True):
        shoe, moment = side.shoe, side.operation.at(0.0)
        half, width, radius = float(shoe.half_angle), float(shoe.width), float(shoe.outer_radius)
        theta = half * (2 * (np.arange(4000) + 0.5) / 4000 - 1)
        lines = width / 2 * (2 * (np.arange(40) + 0.5) / 40 - 1)
        own = q[np.array(mine.places)]
        along = eqx.filter_jit(side.lining.along_arc)  # one program for all lines
        pressure = np.stack([along(moment, own, 0 * own, theta, jnp.asarray(z))[0] for z in lines])
        force = np.mean(pressure) * radius * 2 * half * width
        assert 0.1 < np.mean(pressure > 0) < 0.99  # else the extent proves nothing
        # Midpoints: 2e-4 of the extent is a cell in forty lines, 1e-4 of the force what a kink costs them.
        assert touching == pytest.approx(np.mean(pressure > 0), abs=2e-3)
        assert normal == pytest.approx(force, rel=1e-3)
        assert torque == pytest.approx(0.4 * radius * force, rel=1e-3)
    assert seen.brake_torque == pytest.approx(found[:, 0].sum(), rel=1e-12)
    # At rest each is pressed as its load says, the second one the least.
    area = nominal.shoe.outer_radius * nominal.shoe.arc_angle * nominal.shoe.width
    assert model.observe(0.0, still, still).smallest_pressure == pytest.approx(500.0 / area, rel=1e-12)


@pytest.mark.thorough
def test_damping_of_one_shoe_is_spread_by_kinetic_energy(nominal):
    """With one ratio for all, and with the same ratio as each shoe's own, damping is the same but for the drum's."""
    scene = two(nominal, damping={"ratio": 0.01})
    own = scene.with_values({"shoe.0.damping": {"ratio": 0.01}, "shoe.1.damping": {"ratio": 0.01}})
    np.testing.assert_allclose(eigenvalues(scene), eigenvalues(own), rtol=1e-12)
    less = own.with_values({"shoe.1.damping.ratio": 0.0})
    assert np.sum(eigenvalues(less).real) > np.sum(eigenvalues(own).real)


def test_a_rigid_drum_makes_two_problems(nominal, tmp_path, drumsqueal):
    rigid = two(nominal).with_values({"drum.elastic": None})
    with pytest.raises(RequestError, match="shoes do not feel each other"):
        build_model(rigid)
    file = tmp_path / "two.toml"
    file.write_text(rigid.to_toml())
    status, told, _ = drumsqueal("stability", str(file))
    assert status == 0
    assert told.count("Modes of steady sliding") == 2
    assert told.index("first shoe") < told.index("second shoe")
    assert "each is a problem of its own" in told
    status, _, asked = drumsqueal("stability", str(file), "--json", "-")
    assert status == 2
    assert "add --set shoe=first or --set shoe=second" in asked
    alone = load_scene(file, ["shoe=first"])
    np.testing.assert_allclose(eigenvalues(alone), eigenvalues(nominal), rtol=1e-12)


def test_what_is_refused_for_one_shoe_is_refused_before_the_first(nominal, tmp_path):
    rigid = two(nominal).with_values({"drum.elastic": None, "shoe.1.friction": {"law": "constant", "coefficient": 0.3}})
    (tmp_path / "two.toml").write_text(rigid.to_toml())
    taken = tmp_path / "taken" / "second"
    taken.mkdir(parents=True)
    (taken / HISTORY).write_text("")
    asked: dict[str, Any] = {"scene": tmp_path / "two.toml", "settings": [], "quiet": True}
    for name, values, told in (
        ("run", {"output": taken.parent}, r"second/history\.nc exists"),
        ("sweep", {"vary": ["friction.static=0.3..0.4"]}, "the second shoe has its own, shoe.1.friction.static"),
        ("sweep", {"vary": ["shoe.1.friction.coefficient=0..1"]}, "--set shoe=second, and write friction.coefficient="),
        ("sweep", {"vary": ["shoe.1.density=7000..8000"]}, "--set shoe=second, and write shoe.density="),
        ("sweep", {"vary": ["start.velocity.first.Y=0..1"]}, "--set shoe=first, and write start.velocity.Y="),
    ):
        with pytest.raises(RequestError, match=told):
            take_each(name, lambda **_: pytest.fail("a shoe was taken"), {**asked, **values})


def test_files_of_every_command_are_known_beforehand(tmp_path):
    for name, command in (each for group in command_line.GROUPS.values() for each in group.items()):
        asked = inspect.signature(command).parameters
        if {"scene", "settings", "output"} <= set(asked):
            assert files_of(name, tmp_path), name


@pytest.mark.thorough
def test_each_shoe_that_sticks_has_its_share_of_the_torque(nominal):
    """The shares make the whole; what a shoe is turned against its springs adds to its own alone."""
    model: Any = build_model(two(nominal))
    rest = np.zeros(len(model.names))
    turned = rest.copy()
    turned[model.names.index("second.Tz")] = 1e-6
    sticking: Any = stuck_model(model)
    seen = sticking.observe(0.0, turned, rest)
    first, second = np.reshape(seen.by_shoe, (2, len(BY_SHOE)))[:, 0]
    assert first + second == pytest.approx(float(seen.brake_torque), rel=1e-12)
    support = nominal.support.upper_stiffness + nominal.support.lower_stiffness
    # At rest both bear the friction that the assembly balances.
    assert second - first == pytest.approx(support * nominal.shoe.outer_radius**2 * 1e-6, rel=1e-2)


@pytest.mark.thorough
def test_a_lining_without_friction_holds_nothing_and_stops_no_other(nominal):
    model: Any = build_model(second_rubs(nominal))
    assert [name for name, slides in zip(model.names, model.contact.slides, strict=True) if slides] == [
        name for name in model.names if not name.startswith("first.")
    ]
    assert float(slip(model, 0.0, np.asarray(drum_motion(model, 0.0, np.zeros(len(model.names)))))) < 1e-12


@pytest.mark.thorough
def test_every_lining_is_held_by_its_own_static_friction(nominal):
    """At rest the farthest force along a shoe's turning with the drum is μ_s times its load, at the drum's radius."""
    own = {f"shoe.{k}.friction": {"law": "constant", "coefficient": mu} for k, mu in enumerate((0.5, 0.2))}
    model: Any = build_model(two(nominal, friction=None).with_values(own))
    rest = np.zeros(len(model.names))
    for mine, side, coefficient in zip(*zip(*model.sides, strict=True), (0.5, 0.2), strict=True):
        turning = np.zeros(len(rest))
        turning[np.array(mine.places)] = np.asarray(side.body.velocity_with_drum)
        limit: Any = friction_limit(model, 0.0, rest, rest, turning[None, :])
        torque = float(limit.farthest[0] @ turning)
        load, radius = nominal.contact.normal_load, float(side.shoe.outer_radius)
        assert torque == pytest.approx(coefficient * load * radius, rel=1e-9)


def test_shoes_that_are_complete_are_passed_over(nominal, tmp_path):
    (tmp_path / "two.toml").write_text(two(nominal).with_values({"drum.elastic": None}).to_toml())
    (tmp_path / "first").mkdir()
    complete, taken = {"first"}, []

    def command(output, resume, **_):
        if output.name in complete:
            raise NothingToDoError("nothing to resume")
        taken.append((output.name, resume))

    values = {"scene": tmp_path / "two.toml", "settings": [], "quiet": True, "output": tmp_path, "resume": True}
    take_each("run", command, values)
    assert taken == [("second", False)]
    complete.add("second")
    with pytest.raises(NothingToDoError):
        take_each("run", command, values)
    # Where none has begun, each is to say that there is nothing to go on with.
    (tmp_path / "first").rmdir()
    complete.clear()
    taken.clear()
    take_each("run", command, values)
    assert taken == [("first", True), ("second", True)]


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"shoe.1.position": 1.0}, "the linings of first and second overlap; put them at least 130 deg apart"),
        ({"shoe.1.position": 180.0}, "position = 180.0: the linings .* apart; a number without a unit is in rad"),
        ({"shoe.1.name": "first"}, "two shoes have this name"),
        ({"shoe.1.name": 41 * "n"}, "a shoe's name has at most 40 letters, and this has 41"),
        ({"shoe.1.name": "drum"}, "a shoe's name begins with a letter"),
        ({"shoe.1.outer_radius": 0.101}, "all shoes rub on one drum, and shoe.0.outer_radius is 0.1 m"),
        ({"start.velocity": {"first": {"X": 1.0}, "first.X": 2.0}}, "first.X: this coordinate is given twice"),
        ({"start.velocity": {"third.X": 1.0}}, "those of the shoes here are first.X, second.X"),
        ({"shoe.1.thickness": 0.2}, "the thickness must be smaller"),
        ({"temperature": {"heat_capacity": 300.0}}, "the temperature is that of one lining"),
    ],
)
def test_wrong_scenes_of_two_shoes_are_refused(nominal, values, told):
    with pytest.raises(SceneError, match=told):
        two(nominal).with_values(values)


@pytest.mark.thorough
def test_radii_out_of_files_agree_to_what_their_meshers_leave(nominal):
    mesh = {"file": str(MESHES / "shoe_hex20.inp"), "unit": "mm", "lining": "LINING"}
    shoes = [
        {"name": "first", "position": 0.0, "mesh": mesh, "density": 7820.0},
        {"name": "second", "position": np.pi, "modes": {"file": str(MESHES / "shoe_modes.unv")}},
    ]
    scene = two(nominal, shoe=shoes)
    first, second = (shoe.outer_radius for shoe in scene.shoes)
    assert 1e-9 < abs(second / first - 1) < 1e-6
    build_model(scene)
    with pytest.raises(SceneError, match=r"outer_radius is 1 m; make them equal to 0\.1 %"):
        scene.with_values({"shoe.0.mesh.unit": "cm"})


@pytest.mark.thorough
def test_a_drum_without_modes_that_low_is_refused_with_its_lowest(nominal):
    with pytest.raises(RequestError, match=r"elastic\.up_to = 100 Hz: no mode .* the lowest is at 658\.5 Hz"):
        build_model(two(nominal, drum={**CUP, "up_to": 100.0}, start={}))


def test_a_position_in_degrees_without_a_unit_is_remarked(nominal):
    said = list(unusual(two(nominal, apart=160.0)))
    assert said == ["shoe.1.position = 160 rad is more than a full turn, 6.283 rad; did you mean 160 deg?"]


@pytest.mark.parametrize("key", ["start.velocity.first.Y", "start.displacement.drum.E1"])
def test_starts_of_named_coordinates_may_be_uncertain(nominal, key):
    table, kind, coordinate = key.split(".", 2)
    uniform = {"distribution": "uniform", "low": 0.0, "high": 1e-3}
    scene = two(nominal, start={kind: {coordinate: 1e-3}}, uncertain={key: uniform})
    body, name = coordinate.split(".")
    assert two(nominal, start={kind: {coordinate: 1e-3}}, uncertain={table: {kind: {body: {name: uniform}}}}) == scene
    with pytest.raises(SceneError, match="low"):
        scene.with_values({"uncertain": {key: {**uniform, "low": "1 N"}}})


def test_a_scene_of_two_shoes_survives_its_file(nominal, tmp_path):
    scene = two(nominal)
    (tmp_path / "two.toml").write_text(scene.to_toml())
    assert load_scene(tmp_path / "two.toml") == scene
    assert [one.title for one in scene.alone] == [f"{nominal.title}: first shoe", f"{nominal.title}: second shoe"]
