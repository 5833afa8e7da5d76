"""Traced functions evaluated by NumPy: the same as JAX computes, without compiling anything."""

import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from drumsqueal import interpreter
from drumsqueal.interpreter import MOST_KNOWN, Interpreted
from drumsqueal.numpy_operations import ELEMENTWISE
from drumsqueal.physics.model import build_model
from drumsqueal.scene import load_scene
from drumsqueal.solve.linear import steady

SCENARIOS = Path(__file__).parents[1] / "scenarios"
A = np.random.default_rng(7).normal(size=(3, 4))
SQUARE = np.random.default_rng(8).normal(size=(2, 3, 3))
LARGE = np.random.default_rng(9).normal(size=(40, 5, 300))


def shrink(a):
    """Halve what is above one, for so long as something is."""
    return jax.lax.while_loop(lambda each: jnp.abs(each) > 1, lambda each: each / 2, a)


def running(a):
    """Sums of rows from the last one to the first, and the total."""
    return jax.lax.scan(lambda total, row: (total + row, 2 * total), jnp.zeros(a.shape[1]), a, reverse=True)


OPERATIONS = {
    "division of whole numbers": lambda a: jnp.array([7, -7]) // jnp.array([2, 2]) + jax.lax.div(-7, 2) + 0 * a[0, 0],
    "powers": lambda a: a**2 + a**3 + jnp.abs(a) ** 0.3 + jax.lax.integer_pow(a, -2),
    "cases": lambda a: jax.lax.select_n((a > 0).astype(int) + (a > 1), a, 2 * a, 3 * a),
    "remainders": lambda a: jax.lax.rem(a, 0.3) + jax.lax.rem(jnp.array([7, -7]), 4)[:, None, None],
    "bounds": lambda a: jnp.clip(a, -0.5, 0.5),
    "bits": lambda a: (a > 0) | ~(a > 1) & (a < -1),
    "product of stacks": lambda a: jnp.einsum("ijk,lj->lik", jnp.stack([a, 2 * a, a + 1]), a[:, :3]),
    "product of vectors": lambda a: jax.lax.dot(a[0], a[1]),
    "batched product": lambda a: jnp.einsum("bij,bjk->bik", SQUARE + a[0, 0], SQUARE),
    "large sum of products": lambda a: jnp.sum(a[0, 0] * LARGE[:, :, None] * LARGE[:, None], axis=3),
    "large sum over what one has not": lambda a: jnp.sum(LARGE * a[None, 0, :1, None] * np.ones((40, 5, 1)), (0, 1)),
    "product that is used twice": lambda a: jnp.sum(a * a, axis=0) + jnp.max(a * a),
    "reductions": lambda a: (jnp.all(a > 0, 1), jnp.any(a > 1), jnp.min(a, 0)),
    "several sums": lambda a: jax.lax.reduce((a, 2 * a), (0.0, 1.0), lambda x, y: (x[0] + y[0], x[1] + y[1]), (1,)),
    "search": lambda a: jnp.searchsorted(np.sort(A.ravel()) + 0 * a[0, 0], jnp.array([-0.3, 0.2, 9.0]), side="right"),
    "edges": lambda a: jax.lax.pad(a, 0.5, ((-1, 2, 1), (1, -2, 0))),
    "turned": lambda a: (a[::2, 1:3], jnp.transpose(a), jnp.split(a, [1, 3], axis=1)),
    "rows and columns apart": lambda a: (jnp.unstack(a), jax.vmap(jnp.unstack)(a), jnp.unstack(a[:1])),
    "part beyond the end": lambda a: jax.lax.dynamic_slice(a, (1, 3), (2, 3)),
    "part put beyond the end": lambda a: jax.lax.dynamic_update_slice(a, jnp.ones((2, 2)), (2, -1)),
    "entries": lambda a: (a[jnp.array([2, 0, -1])], a[:, jnp.array([[0, 3], [1, 2]])], a[jnp.array([0, 1]), 2]),
    "entries outside": lambda a: (a.at[jnp.array([5, 0])].get(mode="fill"), a.at[jnp.array([5, 0])].get(mode="clip")),
    "whole entries outside": lambda a: (a > 0).astype(int).at[jnp.array([1, 7])].get(mode="fill"),
    "entries of each row": lambda a: jax.vmap(lambda row, k: row[k])(a, jnp.array([3, 0, 1])),
    "entries set": lambda a: a.at[jnp.array([2, 0])].set(jnp.ones((2, 4))),
    "entries added to twice": lambda a: a.at[:, jnp.array([1, 1, 7])].add(jnp.ones((3, 3))).at[0].multiply(3.0),
    "entries set in each row": lambda a: jax.vmap(lambda row, k: row.at[k].set(9.0))(a, jnp.array([3, 0, 1])),
    "a way of several": lambda a: jax.lax.switch((a[0, 0] > 5).astype(int) + 1, [jnp.sin, jnp.cos, jnp.exp], a),
    "loops that end apart": lambda a: jax.vmap(shrink)(100 * a.ravel()),
    "loop over rows": running,
    "own derivatives": lambda a: jax.jacfwd(lambda x: jnp.tanh(x) ** 2 * jax.nn.relu(x))(a[0]),
    "linear systems": lambda a: jax.jacfwd(lambda s: jnp.linalg.solve(s * SQUARE + jnp.eye(3), SQUARE[0]))(a[0, 0]),
    "triangular systems": lambda a: tuple(
        jax.scipy.linalg.solve_triangular(SQUARE[0] + a[0, 0], a[:, :2], trans=trans, lower=lower, unit_diagonal=unit)
        for trans, lower, unit in ((0, True, False), (1, False, False), (1, True, True))
    ),
    "triangular system from the right": lambda a: jax.lax.linalg.triangular_solve(SQUARE[0], a.T, left_side=False),
    "singular triangle": lambda a: jnp.isfinite(jax.scipy.linalg.solve_triangular(jnp.zeros((3, 3)), a)),
    "symmetric matrix": lambda a: jnp.abs(jnp.linalg.eigh(a @ a.T)[1]),
    "whole powers": lambda a: jnp.floor(a).astype(int) ** 3 & 1,
    "whole numbers of what is none": lambda a: (a[0] * jnp.array([jnp.inf, -jnp.inf, jnp.nan, 1e30])).astype(int),
    "entries changed by a function": lambda a: a.at[1].apply(jnp.cos),
    "complex systems": lambda a: jnp.linalg.solve(jnp.eye(3) * (1 + 1j) + SQUARE[0], a[:, :2] + 0j).imag,
    "sum of bytes": lambda a: jnp.dot(
        (100 * jnp.sign(a)).astype("int8"), jnp.ones(4, "int8"), preferred_element_type=int
    ),
    "reduction by a function": lambda a: jax.lax.reduce(a, 1.0, lambda x, y: jnp.hypot(x, y), (0,)),
    "what NumPy has not": lambda a: jax.lax.erf_inv(a / 10),
}


@pytest.mark.parametrize("name", OPERATIONS)
def test_numpy_computes_what_jax_does(name):
    found, wanted = Interpreted(OPERATIONS[name])(A), jax.jit(OPERATIONS[name])(A)
    assert jax.tree.structure(found) == jax.tree.structure(wanted)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        assert (one.shape, one.dtype) == (other.shape, other.dtype)
        # Sums in another order: round-off of a thousand terms, and of systems with a condition of some hundred.
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-13 if one.dtype == float else 0)


LEFT_TO_JAX = {
    "whole numbers of what is none",
    "entries changed by a function",
    "complex systems",
    "sum of bytes",
    "reduction by a function",
    "what NumPy has not",
}


@pytest.fixture
def nothing_is_left_to_jax(monkeypatch):
    def left(equation):
        pytest.fail(f"{equation.primitive.name} is left to JAX, which compiles it")

    monkeypatch.setattr(interpreter, "_left_to_jax", left)


@pytest.mark.usefixtures("nothing_is_left_to_jax")
@pytest.mark.parametrize("name", sorted(OPERATIONS.keys() - LEFT_TO_JAX))
def test_what_numpy_has_is_not_left_to_jax(name):
    Interpreted(OPERATIONS[name])(A)


@pytest.mark.usefixtures("nothing_is_left_to_jax")
@pytest.mark.thorough(but=["leading_shoe"])
@pytest.mark.parametrize("name", ["leading_shoe", "elastic_drum"])
def test_no_force_of_a_brake_is_left_to_jax(name):
    model = build_model(load_scene(SCENARIOS / f"{name}.toml"))
    rest = jnp.zeros(len(model.names))
    tangent = jax.jacfwd(lambda model, q, v: model.act(0.0, q, v)[0], argnums=(1, 2))
    for found in Interpreted(tangent)(model, rest, rest + 1e-3):
        assert np.all(np.isfinite(found))


def test_what_is_known_goes_by_structure_and_is_kept_for_a_few():
    calls = []

    def noted(values, factor):
        calls.append(factor)
        return factor * values["a"] + jnp.sum(values["b"])

    function = Interpreted(noted)
    for scale in (1.0, 2.0):  # the same structure with other numbers
        found = function({"a": scale * A, "b": A[0]}, 3)
        np.testing.assert_allclose(found, 3 * scale * A + A[0].sum(), rtol=1e-15)
    assert len(calls) == 1
    for factor in range(MOST_KNOWN + 3):
        function({"a": A, "b": A[0]}, factor)
    assert len(function._known) == MOST_KNOWN


def test_what_depends_on_nothing_is_computed_once_and_what_nothing_needs_never(monkeypatch):
    asked = []
    for name in ("sin", "exp"):
        usual = interpreter.known(name, [], {})
        assert usual is not None
        monkeypatch.setitem(
            ELEMENTWISE, name, lambda a, name=name, usual=usual: asked.append((name, np.shape(a))) or usual(a)
        )
    constant = jax.jit(lambda a: jnp.sin(a) * jnp.sin(jnp.ones(7)))
    function = Interpreted(lambda a: jnp.where(a > 0, constant(a), jax.jit(lambda a: (a, jnp.exp(a)))(a)[0]))
    for _ in range(2):
        np.testing.assert_allclose(function(np.asarray(2.0)), np.full(7, np.sin(2.0) * np.sin(1.0)), rtol=1e-15)
    assert asked == [("sin", (7,)), ("sin", ()), ("sin", ())]


def test_what_is_given_is_ones_own():
    constants = Interpreted(lambda a: (a, jnp.asarray(np.arange(3.0)), jnp.broadcast_to(a[0, 0], (2,))))
    for each in constants(A):
        each[...] = -1.0
    np.testing.assert_array_equal(constants(A)[1], np.arange(3.0))
    assert A.min() != -1.0


def test_within_another_program_it_is_part_of_that():
    square = Interpreted(lambda a: jnp.sum(a**2))
    np.testing.assert_allclose(jax.jit(jax.grad(square))(A), 2 * A)
    np.testing.assert_allclose(jax.vmap(square)(A), np.sum(A**2, axis=1))
    # Also where a function among the arguments holds what is traced, as a friction law of the user's own may.
    through = Interpreted(lambda law, a: law(a))
    assert float(jax.grad(lambda s: through(lambda a: s * a, np.asarray(3.0)))(2.0)) == 3.0


@pytest.mark.parametrize(
    "name",
    [
        "nominal",
        pytest.param("leading_shoe", marks=pytest.mark.thorough),
        pytest.param("elastic_drum", marks=pytest.mark.thorough),
        pytest.param("simplex", marks=pytest.mark.thorough),
    ],
)
def test_steady_sliding_and_its_linear_model_are_those_of_the_compiled_program(name):
    model = build_model(load_scene(SCENARIOS / f"{name}.toml"))
    place, linear = steady.linear_model(model)
    wanted_place, wanted = jax.jit(lambda model: steady.linear_model(model))(model)
    size = max(float(np.max(np.abs(wanted_place))), 1e-12)
    # Newton's last step is below round-off of the forces that cancel, some hundred times that of the displacement.
    np.testing.assert_allclose(place, wanted_place, rtol=0, atol=1e-11 * size)
    for one, other in zip(linear, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * float(np.max(np.abs(other))))


COMPILES_NOTHING = """
import sys
import jax
from drumsqueal import command_line
compiled = []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, _, **told: compiled.append(told.get("fun_name")) if "backend_compile" in event else None
)
for command in ("check", "stability"):
    for scene in sys.argv[1:]:
        command_line.command_tree().main([command, scene, "--quiet"], standalone_mode=False)
for scene in sys.argv[1:]:
    if "elastic" in scene:  # of a rigid shoe thousands of points are compiled for
        import drumsqueal
        found = drumsqueal.sweep_parameters(drumsqueal.load_scene(scene), {"drum.speed": [4.0, 5.0]})
        assert (found["outcome"] == 0).all()
assert not compiled, compiled
"""


@pytest.mark.parametrize(
    "scenes",
    [
        ("stop",),
        pytest.param(("nominal", "leading_shoe", "rocking", "elastic_drum", "simplex"), marks=pytest.mark.thorough),
    ],
)
def test_nothing_is_compiled_to_check_a_scene_and_for_its_eigenvalues(scenes):
    # In a process of its own, where nothing has been compiled before.
    files = [str(SCENARIOS / f"{scene}.toml") for scene in scenes]
    done = subprocess.run([sys.executable, "-c", COMPILES_NOTHING, *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_brake_with_numbers_of_its_own_can_be_part_of_another_program(nominal):
    # Its arrays are indexed by what is traced: profiles over time, a measured friction curve.
    profile = {"time": ["0 s", "1 s"], "value": ["5 rad/s", "3 rad/s"]}
    table = {"law": "table", "speed": ["0 m/s", "1 m/s"], "coefficient": [0.4, 0.3]}
    model = build_model(nominal.with_values({"drum.speed": profile, "friction": table}))
    np.testing.assert_allclose(jax.vmap(model.operation.at)(np.array([0.0, 0.5, 2.0])).drum_speed, [5.0, 4.0, 3.0])
    assert model.contact.friction is not None
    law = model.contact.friction.law
    np.testing.assert_allclose(jax.vmap(jax.grad(law.coefficient))(np.array([0.2, 0.7])), -0.1)
