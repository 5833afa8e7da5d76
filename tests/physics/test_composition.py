"""What a scene calls for, what it leaves out, and whether it says so."""

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any, get_args

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np
import pytest

from drumsqueal import simulation
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics import inventory
from drumsqueal.physics.inventory import take_inventory
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.quadrature.area import ALONG, TURNING
from drumsqueal.questions.effects.reductions import reductions_of
from drumsqueal.scene import COORDINATES, Scene, load_scene
from drumsqueal.simulation import held_coordinates, run


@pytest.mark.parametrize(
    ("kept", "started", "held"),
    [
        # Friction drives Y and Tz by the pressure that X makes; nothing in the plane moves what is out of it.
        (["Y"], {"Y": 1e-7}, ("X", "Tz")),
        (["Y", "Tz"], {"Y": 1e-7}, ("X",)),
        (["X", "Y", "Tz"], {"Y": 1e-7}, ()),
        (["X", "Y", "Z", "Tx", "Ty", "Tz"], {"Z": 1e-7}, ()),
        # Friction across the arc couples Z to Ty, friction along it Ty to Tx. What nothing starts is not held.
        (["Z"], {"Z": 1e-7}, ("Tx", "Ty")),
        (["X"], {}, ()),
    ],
)
def test_a_list_that_holds_what_would_move_says_so(nominal, kept, started, held):
    scene = nominal.with_values({"simulate.coordinates": kept, "start.displacement": started})
    assert set(held_coordinates(scene)) == set(held)
    unsupported = scene.with_values({"support": None, "steady.state": "self-consistent"})
    assert set(held_coordinates(unsupported)) == set(held)  # though all six together have no steady sliding


def test_nothing_is_held_where_the_coordinates_are_found(nominal):
    assert held_coordinates(nominal) == ()


def test_coordinates_are_followed_in_the_direction_in_which_they_push(nominal, monkeypatch):
    """X pushes Y, Y pushes Tx and Z; Ty pushes X and is itself pushed by none of these."""
    names = ("X", "Y", "Z", "Tx", "Ty", "Tz")
    pushes = np.eye(6, dtype=bool)
    for pushed, pushing in (("Y", "X"), ("Tx", "Y"), ("Z", "Y"), ("X", "Ty")):
        pushes[names.index(pushed), names.index(pushing)] = True
    monkeypatch.setattr(simulation, "coupling", lambda _: pushes)
    scene = nominal.with_values({"simulate.coordinates": ["X", "Z"], "start.displacement": {"X": 1e-6}})
    scene = scene.with_values({"start.velocity": {}})
    assert held_coordinates(scene) == ("Y", "Tx")


@pytest.mark.thorough
def test_what_is_held_moves_when_it_is_let_go(nominal):
    short = {"simulate.duration": 0.002, "start.displacement": {"Y": 1e-7}}
    held = run(nominal.with_values(short | {"simulate.coordinates": ["Y"]}))
    free = run(nominal.with_values(short | {"simulate.coordinates": ["X", "Y", "Z", "Tx", "Ty", "Tz"]}))
    moved = free.history["displacement"]
    largest = {str(name): float(np.abs(moved.sel(coordinate=name)).max()) for name in moved["coordinate"].values}
    assert {name for name, size in largest.items() if size > 1e-15 and name != "Y"} == set(
        held.findings.held_though_they_would_move
    )


def test_the_inventory_of_the_nominal_scene(nominal):
    inventory = take_inventory(nominal)
    assert inventory.includes == (
        "coordinates X, Y, Tz",
        "contact that separates",
        "friction: exponential law",
        "friction along the unit slip velocity",
        "support springs",
    )
    assert {each.split(" (")[0] for each in inventory.leaves_out} == {
        "coordinates Z, Tx, Ty",
        "structural damping",
        "harmonic force",
        "lining temperature and fade of friction",
        "drag of friction on the steady state",
        "changes of the drum speed",
        "changes of the load",
    }


EVERYTHING = {
    "damping": {"ratio": 0.01},
    "temperature": {"heat_capacity": 300.0},
    "forcing": {"amplitude": {"Z": 1.0}, "frequency": 100.0},
    "steady.state": "self-consistent",
    "drum.speed": {"time": [0, 1], "value": [5, 4]},
    "contact.normal_load": {"time": [0, 1], "value": [2000, 2100]},
}


def test_every_effect_is_either_included_or_left_out(nominal):
    assert take_inventory(nominal.with_values(EVERYTHING)).leaves_out == ()
    least = nominal.with_values({"support": None, "friction": None, "contact.separation": False})
    assert take_inventory(least).includes == ("coordinates X, Y, Tz", "bonded contact")


@pytest.mark.parametrize(
    ("key", "changes", "stays"),
    [
        ("drum.speed", "changing drum speed", "changes of the load"),
        ("contact.normal_load", "changing load", "changes of the drum speed"),
    ],
)
def test_what_changes_with_time_is_said_of_its_own_profile(nominal, key, changes, stays):
    inventory = take_inventory(nominal.with_values({key: {"time": [0, 1], "value": [5, 4]}}))
    assert [each for each in inventory.includes if each.startswith("changing")] == [changes]
    assert [each for each in inventory.leaves_out if each.startswith("changes")] == [stays]


OPTIONAL = {name for name, field in Scene.model_fields.items() if type(None) in get_args(field.annotation)}


@pytest.mark.parametrize("table", sorted(OPTIONAL - {"uncertain"}))
def test_every_table_that_a_scene_may_leave_out_is_told_of_and_can_be_reduced(nominal, table):
    everything = nominal.with_values(EVERYTHING)
    assert getattr(everything, table) is not None, "tell EVERYTHING of it"
    heated = {"temperature": None} if table == "friction" else {}  # by friction
    without = everything.with_values({table: None} | heated)
    assert len(take_inventory(without).leaves_out) > len(heated)
    told = {str(each) for each in reductions_of(everything)} - {str(each) for each in reductions_of(without)}
    assert len(told) > len(heated)


@Interpreted
def evaluated_force(model: Model, q, v):
    return model.act(0.0, q, v)[0]


# Below the boundaries both rules are exact: 5e-16 of the load found, and 1e-17 out of the plane. Beyond them the area
# is good to 1e-9 at these states.
@pytest.mark.parametrize(
    ("size", "tolerance"), [(0.2, 5e-15), (3.0, 2e-8)], ids=["below the boundaries", "beyond them"]
)
def test_forces_of_the_plane_are_those_of_all_six_coordinates(nominal, size, tolerance):
    plane, space = build_model(nominal), build_model(nominal, coordinates=COORDINATES)
    generator, scale = np.random.default_rng(3), np.array([2000.0, 2000.0, 200.0])
    for _ in range(50):
        q = generator.uniform(-1, 1, 3) * size * 6.9e-6 / 3 * [1, 1, 10]
        v = generator.uniform(-1, 1, 3) * size * [0.2, 0.2, 2.0]
        wide_q, wide_v = np.zeros((2, 6))
        wide_q[[0, 1, 5]], wide_v[[0, 1, 5]] = q, v
        few, all_six = evaluated_force(plane, q, v), evaluated_force(space, wide_q, wide_v)
        assert np.max(np.abs(all_six[[0, 1, 5]] - few) / scale) < tolerance
        assert np.max(np.abs(all_six[[2, 3, 4]]) / scale) < 1e-14


# --- what is in the program ------------------------------------------------------------------------------------------

BARE = {"support": None, "friction": None, "contact.separation": False}
CONSTANT = {"law": "constant", "coefficient": 0.4}
FORCE = {"amplitude": {"Y": 1.0}, "frequency": 100.0}
CURVE = {"compression": [0, 4e-6, 1e-5], "pressure": [0, 1e5, 4e5], "normal_load": 2000}
# name: (what the scene names beyond a bare bonded shoe, operations that come with it as traced, and as compiled)
EFFECTS = {
    "separation": ({"contact.separation": True}, {"sqrt": 4}, {"sqrt"}),  # whether there are boundaries, and where
    # With and without boundaries, and the balance's.
    "friction": ({"friction": CONSTANT}, {"sign": 3}, {"sign", "sqrt"}),
    "falling friction": (
        {"friction": {"law": "exponential", "static": 0.5, "kinetic": 0.3, "decay": 1.0}},
        {"exp": 4},  # the same, and with cuts for a steep law
        {"exponential"},
    ),
    # The compression under the load, and where the lining has none: twice a contact boundary, in the branch for it.
    "hardening": ({"contact.hardening": 1e15}, {"sqrt": 5}, {"sqrt"}),
    # Points and slopes at both ends of a piece: of the load, and of the pressure in two branches.
    "measured curve": ({"contact": CURVE | {"separation": False}}, {"gather": 14}, {"gather"}),
    "support": ({"support": {"upper_stiffness": 1e8, "lower_stiffness": 6e8}}, {"cond": 1}, {"conditional"}),
    "force": ({"forcing": FORCE}, {"sin": 1}, set()),
    "damping": ({"damping": {"ratio": 0.01}}, {"neg": 3}, set()),  # one a coordinate
    # One search each, whoever asks for drum speed or load.
    "load profile": ({"contact.normal_load": {"time": [0, 1], "value": [2000, 2000]}}, {"scan": 1}, {"dynamic-slice"}),
    "speed profile": (
        {"friction": CONSTANT, "drum.speed": {"time": [0, 1], "value": [5, 5]}},
        {"scan": 1},
        {"dynamic-slice"},
    ),
}


Inner = jax.extend.core.ClosedJaxpr


def force_of(model: Model, time, q, v):
    return model.act(time, q, v)[0]


def at_rest(model: Model):
    return model, jnp.zeros(()), jnp.zeros(len(model.names)), jnp.zeros(len(model.names))


def within(jaxpr) -> Iterator[Any]:
    """Every operation as JAX traces it, inner programs included."""
    for equation in jaxpr.eqns:
        yield equation
        for inner in jax.tree.leaves(list(equation.params.values())):
            if isinstance(inner, Inner):
                yield from within(inner.jaxpr)


def equations(model: Model) -> list:
    """Those of the force."""
    return list(within(jax.make_jaxpr(force_of)(*at_rest(model)).jaxpr))


def traced(model: Model) -> Counter[str]:
    """How often each operation stands in the force."""
    return Counter(equation.primitive.name for equation in equations(model))


def compiled(model: Model) -> set[str]:
    """Names of the operations in the force as XLA compiles it."""
    text = jax.jit(force_of).lower(*at_rest(model)).compile().as_text()
    return set(re.findall(r"= \S+ ([a-z][a-z0-9-]*)\(", text or ""))


@pytest.fixture(scope="module")
def bare(nominal):
    """Return the operations without any effect, as traced and as compiled."""
    model = build_model(nominal.with_values(BARE))
    return traced(model), compiled(model)


@pytest.mark.parametrize(
    ("name", "most"), [("nominal", 1000), ("out_of_plane", 1500), ("rocking", 1500), ("elastic_drum", 6100)]
)
def test_a_force_is_so_many_operations_at_most(name, most):
    """What is repeated, pieces of the arc and stretches across it, is an axis: the time to compile goes with the code.

    Of what bends two fifths are polynomials, written out term by term.

    The model is known, so that what depends on it alone is computed and not counted.
    """
    model = build_model(load_scene(name))
    _, *state = at_rest(model)
    found = within(jax.make_jaxpr(partial(force_of, model))(*state).jaxpr)
    single = [
        each for each in found if not any(isinstance(one, Inner) for one in jax.tree.leaves(list(each.params.values())))
    ]
    assert len(single) <= most


@pytest.mark.parametrize("name", EFFECTS)
def test_what_a_scene_does_not_name_is_not_in_the_program(nominal, bare, name):
    values, operations, machine_operations = EFFECTS[name]
    (before, machine_before), under = bare, build_model(nominal.with_values(BARE | values))
    after = traced(under)
    for operation, count in operations.items():
        assert after[operation] - before[operation] == count
    assert after.total() > before.total()
    assert machine_operations <= compiled(under)
    assert not machine_operations & machine_before


def test_tangential_friction_knows_nothing_of_the_velocity_across(nominal):
    # In space: sgn V_θ at nodes without boundaries, with those and graded towards them.
    unit, tangential = (
        traced(build_model(nominal.with_values({"friction.direction": direction}), coordinates=COORDINATES))
        for direction in ("unit-velocity", "tangential")
    )
    assert tangential["sign"] - unit["sign"] == 3
    assert unit.total() > tangential.total()


@pytest.mark.parametrize("name", EFFECTS)
def test_a_sweep_of_an_effect_traces_its_program_once(nominal, name):
    scene = nominal.with_values(BARE | EFFECTS[name][0])
    traces, forces = [], []

    @jax.jit
    def force(model, time, q, v):
        traces.append(1)
        return force_of(model, time, q, v)

    state = (0.002, jnp.asarray([1e-6, 3e-6, 1e-5]), jnp.asarray([0.1, -0.2, 1.0]))
    for factor in (1.0, 0.9, 1.1):
        numbers = {key: factor * np.asarray(value) for key, value in scene.numbers().items() if ".time" not in key}
        forces.append(np.asarray(force(build_model(scene, numbers), *state)))
    assert traces == [1]
    assert all(np.any(one != other) for one, other in itertools.combinations(forces, 2))


def test_in_the_plane_there_is_no_area(nominal):
    in_plane, in_space = (
        {out.aval.shape for each in equations(model) for out in each.outvars}
        for model in (build_model(nominal), build_model(nominal, coordinates=COORDINATES))
    )
    lines_across_a_panel = (TURNING, 1, 2, ALONG)  # on both sides of a turn
    assert lines_across_a_panel in in_space
    assert lines_across_a_panel not in in_plane
    # The largest is to sort the 19 bounds of the arc where friction is steep, each with each.
    assert max(math.prod(shape) for shape in in_plane) == 19**2


NEUTRAL = {
    # name: (scene with the effect at its neutral value, scene without it, u_r up to this many p0/k_c)
    "damping": ({"damping": {"ratio": 0.0}}, {}, 3.0),
    "hardening": ({"contact.hardening": 0.0}, {}, 3.0),
    "support": ({"support": {"upper_stiffness": 0, "lower_stiffness": 0}}, {"support": None}, 3.0),
    "falling friction": (
        {"friction": {"law": "exponential", "static": 0.4, "kinetic": 0.4, "decay": 1.0}},
        {"friction": CONSTANT},
        3.0,
    ),
    "friction": ({"friction": {"law": "constant", "coefficient": 0.0}}, {"friction": None}, 3.0),
    "separation": ({}, {"contact.separation": False}, 0.3),  # where the lining is pressed everywhere
    "unit velocity": ({}, {"friction.direction": "tangential"}, 3.0),  # in the plane
    "speed profile": ({"drum.speed": {"time": [0, 1], "value": [5, 5]}}, {}, 3.0),
    "load profile": ({"contact.normal_load": {"time": [0, 1], "value": [2000, 2000]}}, {}, 3.0),
}


forces_at = Interpreted(jax.vmap(lambda model, q, v: model.act(0.3, q, v)[0], in_axes=(None, 0, 0)))


@pytest.mark.thorough(but=["damping", "separation"])
@pytest.mark.parametrize("name", NEUTRAL)
def test_an_effect_at_its_neutral_value_is_as_good_as_left_out(nominal, name):
    neutral, without, reach = NEUTRAL[name]
    generator = np.random.default_rng(7)
    q = generator.uniform(-1, 1, (50, 3)) * reach * 6.9e-6 / 3 * [1, 1, 10]
    v = generator.uniform(-1, 1, (50, 3)) * [0.5, 0.5, 5.0]  # slip reverses on part of the lining in most of them
    forces = [forces_at(build_model(nominal.with_values(more)), q, v) for more in (neutral, without)]
    # Round-off of some 2000 N, also of the quadrature where an effect less splits the arc less; 2e-11 N was found.
    assert np.max(np.abs(forces[0] - forces[1])) < 1e-10


@pytest.mark.thorough
def test_a_force_of_nothing_is_no_force(nominal):
    forced = nominal.with_values({"forcing": FORCE})
    q, v = jnp.asarray([1e-6, 2e-5, 1e-4]), jnp.asarray([0.1, -0.2, 1.0])
    none = build_model(forced, {"forcing.amplitude.Y": 0.0}).act(0.3, q, v)
    without = build_model(nominal).act(0.3, q, v)
    np.testing.assert_array_equal(none[0], without[0])


@pytest.mark.thorough
def test_other_numbers_trace_nothing_again(nominal, monkeypatch):
    traces = []
    act = Model.act

    def counted(self, *arguments):
        traces.append(1)
        return act(self, *arguments)

    monkeypatch.setattr(Model, "act", counted)
    counts = []
    for speed, load, ratio in ((5.0, 2000.0, 0.01), (4.0, 1900.0, 0.02), (3.0, 2100.0, 0.0)):
        values = {"drum.speed": speed, "contact.normal_load": load, "damping": {"ratio": ratio}}
        # As in no other test, and with one program for the eigenvalues.
        values |= {"friction": CONSTANT | {"direction": "tangential"}, "forcing": FORCE}
        run(nominal.with_values(values | {"simulate.duration": 0.002, "simulate.tolerance": 1e-6 * speed}))
        counts.append(len(traces))
    # The first run traces the model for its eigenvalues and its steps; a sweep adds nothing.
    assert counts[0] > 0
    assert counts == [counts[0]] * 3


def test_what_shoes_have_in_common_is_said_once_and_the_rest_by_their_names():
    scene: Any = SimpleNamespace(shoe_names=("first", "second", "third"), alone=("a", "b", "c"))
    third = [(False, "two"), (True, "all")]
    facts = {"a": [(True, "all"), (False, "two")], "b": [(True, "all"), (True, "one")], "c": third}
    found = list(inventory._of_shoes(scene, lambda one: facts[str(one)]))
    assert found == [(True, "all"), (False, "first and third: two"), (True, "second: one")]
