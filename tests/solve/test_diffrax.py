"""Our loop and diffrax's own, each the other's witness; and the problem that diffrax solves without us."""

import re
from pathlib import Path
from typing import Any, cast, get_args

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from drumsqueal.errors import Ending, RequestError
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.friction_law import ConstantLaw, ExponentialLaw, StepLaw
from drumsqueal.physics.model import build_model
from drumsqueal.physics.small_bodies import block_on_belt, disc_on_plate, sprung_block_on_belt
from drumsqueal.problem import diffrax_problem
from drumsqueal.scene import SceneError, load_scene
from drumsqueal.scene.tables import Solver
from drumsqueal.simulation import check_transient, prepare, steady_at_start, transient
from drumsqueal.solve.motion import integrate
from drumsqueal.solve.transient import integrate as integrate_module
from drumsqueal.solve.transient import through_diffrax
from drumsqueal.solve.transient.integrate import integrate as chunks_of
from drumsqueal.solve.transient.runge_kutta import DIFFRAX, is_implicit

SCENARIOS = Path(__file__).parents[2] / "scenarios"
OF_DIFFRAX = [name for name in get_args(Solver) if name.startswith(DIFFRAX)]
SLIDES = {"velocity": {"X": 0.1}}


def fits(solver: Any) -> bool:
    """Whether diffrax itself takes it for an ordinary equation with adaptive steps; nothing is compiled."""

    def solve(y: jax.Array) -> Any:
        control = diffrax.PIDController(rtol=1e-6, atol=1e-6)
        terms = diffrax.ODETerm(lambda t, y, _: -y)
        return diffrax.diffeqsolve(terms, solver(), 0.0, 1.0, 0.1, y, stepsize_controller=control).ys

    try:
        jax.eval_shape(solve, jnp.ones(2))
    except (ValueError, RuntimeError, TypeError):
        return False
    return True


@pytest.mark.thorough
def test_scenes_may_name_each_solver_of_diffrax_that_solves_their_equations():
    # A reversible method keeps its steps for going back, and damps nothing: no method for a transient.
    every = {name for name in dir(diffrax) if isinstance(getattr(diffrax, name), type)} - {"ReversibleHeun"}
    solvers = (name for name in every if issubclass(getattr(diffrax, name), diffrax.AbstractSolver))
    found = {DIFFRAX + name for name in solvers if fits(getattr(diffrax, name))}
    assert found == set(OF_DIFFRAX)


@pytest.mark.parametrize(
    "name", ["diffrax.tsit5", "diffrax.Euler", "diffrax.SRA1", "diffrax.LeapfrogMidpoint", "Tsit5"]
)
def test_a_solver_that_does_not_fit_is_refused_with_those_that_do(nominal, name):
    with pytest.raises(SceneError, match=r'^[^\n]*simulate.solver = "[^\n]*write [^\n]*"diffrax.Tsit5"$'):
        nominal.with_values({"simulate.solver": name})
    block = block_on_belt(ConstantLaw(0.3), belt_speed=1.0)
    with pytest.raises(RequestError, match=rf"^solver must be one of auto, .*diffrax.Tsit5; got {name}$"):
        integrate(block, SLIDES, 1.0, sample_rate=10.0, solver=name)


# --- each the other's witness ----------------------------------------------------------------------------------------


def random_block(seed: int) -> Any:
    """A block that also moves into its belt, and lifts off; the belt is too fast for it to stick."""
    draw = np.random.default_rng(seed).uniform
    law, coupling = ExponentialLaw(draw(0.3, 0.5), 0.2, draw(0.5, 2.0)), draw(0.1, 0.5)
    return sprung_block_on_belt(
        law, mass=[1.0, draw(0.5, 1.5)], springs=[[2.0, coupling], [coupling, 1.0]], contact_stiffness=draw(0.5, 2.0),
        belt_speed=5.0, damping=0.1 * np.eye(2), forces={"X": (0.3, draw(0.05, 0.3))},
    )  # fmt: skip


def motion_of(model: Any, start: Any, solver: str, **how: Any) -> np.ndarray:
    """Displacements and velocities (k, 2n)."""
    asked: Any = {"duration": 30.0, "sample_rate": 5.0, "tolerance": 1e-10, "solver": solver} | how
    found = integrate(model, start, **asked)
    assert found.outcome == "complete"
    return np.hstack([found.displacement, found.velocity])


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """The largest difference, over the largest value of each state."""
    return float(np.max(np.abs(one - other) / np.max(np.abs(other), axis=0)))


@pytest.mark.parametrize("seed", range(6))
def test_both_loops_find_the_same_motion_of_random_oscillators(seed):
    # They step otherwise where it lifts off: errors of some ten periods came to 0.1 to 4 tolerances.
    start, model = {"displacement": {"X": 0.5, "Y": -3.0}}, random_block(seed)
    force = integrate(model, start, 30.0, sample_rate=5.0, solver="tsit5").normal_force
    assert force.min() == 0 < force[-1]
    assert apart(motion_of(model, start, "diffrax.Tsit5"), motion_of(model, start, "tsit5")) < 1e-9


@pytest.mark.thorough
@pytest.mark.parametrize("solver", ["Dopri8", "Dopri5", "Kvaerno5", "Kvaerno4", "Bosh3"])
def test_every_kind_of_method_finds_the_same_motion(solver):
    start = {"displacement": {"X": 0.5, "Y": 1.5}}
    how = {} if solver != "Bosh3" else {"tolerance": 1e-7}  # of order three, which takes a thousand steps a period
    wanted = motion_of(random_block(0), start, "dopri8")
    assert apart(motion_of(random_block(0), start, DIFFRAX + solver, **how), wanted) < 10 * how.get("tolerance", 1e-10)


def states_of(scene: Any) -> np.ndarray:
    """Vibration and velocity (k, 2n)."""
    prepared = prepare(scene)
    chunks = list(transient(prepared))
    rest = steady_at_start(prepared)
    return np.concatenate([np.hstack([chunk.displacement - rest, chunk.velocity]) for chunk in chunks])


# Rigid ones that feel each other through the first modes of the drum.
TWO_SHOES = (
    "shoe.0.elastic=none",
    "shoe.1.elastic=none",
    "drum.elastic.up_to=1 kHz",
    "simulate.duration=1 ms",
    "simulate.tolerance=1e-8",
)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("nominal", ()),  # saturated: from a start that lifts off and slips back at once
        ("self_consistent", ()),
        ("ramp", ("drum.speed={time=['0 s', '2 ms', '5 ms'], value=[15.0, 3.0, 4.0]}",)),  # with corners
        ("nominal", ("temperature={heat_capacity=3.0, cooling=2.0, fade=0.001}",)),  # with a memory
        ("leading_shoe", ()),
        pytest.param("out_of_plane", ("simulate.duration=2 ms",), marks=pytest.mark.thorough),
        pytest.param("elastic_drum", ("simulate.duration=2 ms",), marks=pytest.mark.slow),
        pytest.param("simplex", TWO_SHOES, marks=pytest.mark.slow),
    ],
)
def test_both_loops_and_the_problem_find_the_same_motion_of_scenes(name, settings):
    scene = load_scene(SCENARIOS / f"{name}.toml", ("simulate.duration=10 ms", "simulate.tolerance=1e-10", *settings))
    scene = scene.with_values({"start": {"displacement": {}, "velocity": dict.fromkeys(first_of(scene), 0.3)}})
    ours, theirs = (states_of(scene.with_values({"simulate.solver": each})) for each in ("dopri8", "diffrax.Dopri8"))
    assert apart(theirs, ours) < 1e-8  # ten periods with impacts, over which errors grow a hundredfold
    problem = diffrax_problem(scene)
    solution = diffrax.diffeqsolve(solver=diffrax.Dopri8(), **problem)
    displacement, velocity, *_ = cast("Any", solution.ys)
    assert apart(np.hstack([displacement - steady_at_start(prepare(scene)), velocity]), ours) < 1e-8


def first_of(scene: Any) -> tuple[str, ...]:
    """Its first rigid coordinate that friction does not hold: Y."""
    return (next(name for name in build_model(scene).names if name.rpartition(".")[2] == "Y"),)


# --- what it cannot do, and how a run of it ends ---------------------------------------------------------------------


def test_a_lining_that_comes_to_stick_ends_the_run_where_it_does_and_keeps_what_there_is():
    # 1 kg, 1 N/m, 1 N, as in docs/oscillators.md; what else there is of a random block, whose program it shares, rests.
    block = sprung_block_on_belt(
        ExponentialLaw(0.5, 0.5, 1.0), mass=[1.0, 1.0], springs=np.eye(2), contact_stiffness=1.0, belt_speed=0.2,
        damping=np.zeros((2, 2)), forces={"X": (0.0, 0.1)},
    )  # fmt: skip
    found = integrate(block, {"displacement": {"X": -0.5}}, 10.0, sample_rate=100.0, solver="diffrax.Tsit5")
    # Until then it swings about 0.5 m from rest: v = 0.5 sin t, and the belt makes 0.2 m/s. Slip below a millionth of
    # the motion's counts as none, which the block has 1.1 µs before.
    when = np.arcsin(0.4)
    assert found.outcome.ending == Ending.FAILED
    told = re.search(r"the lining sticks to the drum at t = (\S+) s: .* friction is set-valued", found.outcome)
    assert told
    assert float(told[1]) == pytest.approx(when, abs=2e-6)
    np.testing.assert_allclose(found.time, np.arange(int(100 * when) + 1) / 100)
    np.testing.assert_allclose(found.displacement[:, 0], 0.5 - 0.5 * np.cos(found.time), atol=1e-6)


@pytest.mark.parametrize(
    ("settings", "when"),
    [((), "0.3"), (("drum.speed={time=['0 s', '1 s'], value=['0 rad/s', '3 rad/s']}",), "0")],
)
def test_a_scene_whose_drum_rests_is_refused_before_anything_runs(settings, when):
    scene = load_scene(SCENARIOS / "stop.toml", ("simulate.solver=diffrax.Tsit5", *settings))
    told = rf'^simulate.solver = "diffrax.Tsit5": the drum is at rest at t = {when} s: [^\n]* set-valued[^\n]*$'
    with pytest.raises(SceneError, match=told):
        check_transient(prepare(scene))
    with pytest.raises(RequestError, match=rf"^the drum is at rest at t = {when} s"):
        diffrax_problem(scene)
    if not settings:  # before it stops, it runs
        check_transient(prepare(scene.with_values({"simulate.duration": 0.29})))


@pytest.mark.thorough
def test_a_budget_that_is_exceeded_says_what_to_set_and_keeps_the_samples(monkeypatch):
    for module in (through_diffrax, integrate_module):
        monkeypatch.setattr(module, "DIFFRAX_STEPS", 20)
    block = block_on_belt(ConstantLaw(0.3), belt_speed=5.0)
    found = integrate(block, {"displacement": {"X": 0.5}}, 1e3, sample_rate=0.6, tolerance=1e-5, solver="diffrax.Heun")
    told = re.search(
        r"max_steps, 10,020 in a chunk of 500 samples, and came to t = (\S+) s; .*tolerance", found.outcome
    )
    assert told
    assert found.time[-1] <= float(told[1]) < found.time[-1] + 1 / 0.6
    assert 1 < len(found.time) < 501
    np.testing.assert_allclose(found.displacement[:, 0], 0.3 + 0.5 * np.cos(found.time), atol=1e-4)


def test_a_run_goes_on_from_a_checkpoint_as_without_a_break():
    start: Any = np.zeros(2), np.array([0.5, 1.0]), np.zeros(2)
    how: Any = {"duration": 30.0, "sample_rate": 40.0, "tolerance": 1e-6, "solver": "diffrax.Tsit5"}
    first, *others = chunks_of(random_block(0), *start, **how)
    again = list(chunks_of(random_block(0), *start, **how, since=first.end))
    assert len(again) == 2
    for one, other in zip(others, again, strict=True):
        assert np.array_equal(one.displacement, other.displacement)


# --- the problem by itself -------------------------------------------------------------------------------------------


def test_the_problem_of_an_oscillator_is_solved_and_differentiated_as_its_closed_form():
    block, stiffness = block_on_belt(ConstantLaw(0.0), belt_speed=5.0, stiffness=4.0), jnp.asarray(4.0)
    problem = diffrax_problem(block, {"displacement": {"X": 0.5}}, 3.0, sample_rate=10.0, tolerance=1e-9)

    def states(stiffness: Any) -> Any:
        args = block_on_belt(ConstantLaw(0.0), belt_speed=5.0, stiffness=stiffness)
        more = {"adjoint": diffrax.ForwardMode(), "args": args}
        return diffrax.diffeqsolve(solver=diffrax.Tsit5(), **problem | more).ys

    found, slopes = jax.jvp(states, (stiffness,), (jnp.ones(()),))
    displacement, velocity = (np.asarray(part)[:, 0] for part in found)
    t, omega = np.arange(31) / 10, 2.0
    np.testing.assert_array_equal(problem["saveat"].subs.ts, t)
    np.testing.assert_allclose(displacement, 0.5 * np.cos(omega * t), atol=1e-8)
    np.testing.assert_allclose(velocity, -0.5 * omega * np.sin(omega * t), atol=1e-8)
    # ∂x/∂k = −0.5 t sin(ω t) ∂ω/∂k, ∂ω/∂k = 1/(2ω) for 1 kg: found by the steps that the motion asks for.
    np.testing.assert_allclose(slopes[0][:, 0], -0.25 * t * np.sin(omega * t) / omega, atol=1e-7)


def test_a_wrong_request_for_a_problem_is_refused(nominal):
    block = block_on_belt(StepLaw(1.0, 0.5), belt_speed=0.2)
    with pytest.raises(RequestError, match=r"^it starts without slip: where"):
        diffrax_problem(block, {"velocity": {"X": 0.2}}, 1.0, sample_rate=10.0)
    with pytest.raises(RequestError, match=r"^the drum is at rest at t = 0 s: where"):
        diffrax_problem(disc_on_plate(ConstantLaw(0.3)), {"velocity": {"X": 0.2}}, 1.0, sample_rate=10.0)
    with pytest.raises(ValueError, match="give both"):
        diffrax_problem(block, {"velocity": {"X": 0.1}}, 1.0)
    with pytest.raises(ValueError, match="belong to a scene"):
        diffrax_problem(block, {}, 1.0, sample_rate=10.0, numbers={"drum.speed": 1.0})
    with pytest.raises(KeyError, match=r"drum\.sped is no number"):
        diffrax_problem(nominal, numbers={"drum.sped": 1.0})
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(TypeError, match="float32"):
            diffrax_problem(nominal)
        with pytest.raises(TypeError, match="float32"):
            diffrax_problem(block, {"velocity": {"X": 0.1}}, 1.0, sample_rate=10.0)
    finally:
        jax.config.update("jax_enable_x64", True)


@pytest.mark.thorough(but=["nominal", "self_consistent"])
@pytest.mark.parametrize("name", sorted(path.stem for path in SCENARIOS.glob("*.toml")))
def test_the_rates_of_the_problem_follow_its_numbers_as_the_model_does(name):
    # Evaluated by NumPy: what stands in the term is what a model of other numbers has, to its round-off.
    scene = load_scene(SCENARIOS / f"{name}.toml", ("simulate.duration=1 ms",))
    warm = {"temperature": {"heat_capacity": 3.0, "cooling": 2.0, "fade": 0.001}} if name == "nominal" else {}
    scene = scene.with_values(warm)
    problem = diffrax_problem(scene)
    args = problem["args"]
    changed = ("contact.stiffness", next(key for key in sorted(args, reverse=True) if key.startswith("friction.")))
    other = {key: 0.9 * args[key] for key in changed}
    model, generator = build_model(scene, other), np.random.default_rng(3)
    n = len(model.names)
    q, v = (jnp.asarray(size * generator.normal(size=n)) for size in (1e-6, 1e-2))
    y = (q, v, jnp.asarray([30.0])) if warm else (q, v)
    terms = problem["terms"]
    found = Interpreted(lambda t, y, args: terms.vf(t, y, args))(np.asarray(5e-4), y, args | other)
    force, _, warming = Interpreted(lambda model, y: model.rates(5e-4, *y))(model, y)
    np.testing.assert_array_equal(found[0], v)
    np.testing.assert_allclose(found[1], force / model.mass, rtol=1e-9, atol=1e-9 * np.abs(force / model.mass).max())
    assert len(found) == len(problem["y0"]) == len(y)
    if warm:
        np.testing.assert_allclose(found[2], warming, rtol=1e-9)


@pytest.mark.thorough
def test_gradients_through_time_are_those_of_differences_and_steady_sliding_follows_the_numbers():
    scene = load_scene(SCENARIOS / "self_consistent.toml", ("simulate.duration=2 ms", "simulate.tolerance=1e-9"))
    numbers, mass = {"drum.speed": 5.0, "contact.normal_load": 2000.0}, jnp.asarray(build_model(scene).mass)

    def energy(numbers: Any) -> Any:
        more: Any = {"saveat": diffrax.SaveAt(t1=True), "adjoint": diffrax.ForwardMode()}
        found: Any = diffrax.diffeqsolve(solver=diffrax.Dopri8(), **diffrax_problem(scene, numbers=numbers) | more)
        velocity = found.ys[1][0]
        return jnp.sum(mass * velocity**2) / 2

    slopes, value = jax.jit(jax.jacfwd(energy))(numbers), jax.jit(energy)
    for key, number in numbers.items():
        step = 1e-4 * number
        higher, lower = (float(value(numbers | {key: number + change})) for change in (step, -step))
        # Steps of 1e-4 are good to 1e-8 of the third derivative, and 1e-9 of the energy over the step to 1e-5.
        assert float(slopes[key]) == pytest.approx((higher - lower) / (2 * step), rel=1e-5)


@pytest.mark.slow
def test_the_page_prints_what_stands_there_and_its_claims_hold(capsys):
    page = (SCENARIOS.parent / "docs" / "diffrax.md").read_text(encoding="utf-8")
    first, *examples = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(compile(first, "diffrax.md", "exec"), names)  # the point of this test
    number, said = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"), []
    for example, shown in zip(examples, re.findall(r"```text\n(.*?)```", page, flags=re.DOTALL), strict=True):
        exec(compile(example, "diffrax.md", "exec"), names)
        printed = capsys.readouterr().out
        assert number.sub("", printed).split() == number.sub("", shown).split()
        said.append([float(each) for each in number.findall(printed)])
        for value, stands in zip(said[-1], map(float, number.findall(shown)), strict=True):
            # Another machine makes some other steps; beyond lift-off motions part by what that changes.
            assert value == pytest.approx(stands, rel=0.1) or max(abs(value), abs(stands)) < 1e-4
    assert said[1][1] > 10 * said[1][4]  # steps of Tsit5 and of Kvaerno5
    for backwards, forwards, differences in (said[2][:3], said[2][3:]):
        assert backwards == forwards == pytest.approx(differences, rel=1e-3)
    assert 0 <= said[3][1] - said[3][0] < 0.02 + 5e-3  # ms: the first sample beyond lift-off, printed to 0.01


@pytest.mark.parametrize(
    ("duration", "sample_rate", "tolerance", "reason"),
    [
        (-1.0, 10.0, None, "one sample at least"),
        (1.0, -10.0, None, "one sample at least"),
        (float("nan"), 10.0, None, "one sample at least"),
        (0.0, 10.0, None, "one sample at least"),
        (1.0, 10.0, 0.0, "tolerance must be positive"),
    ],
)
def test_a_problem_without_samples_or_tolerance_is_refused(duration, sample_rate, tolerance, reason):
    block = block_on_belt(ConstantLaw(0.0), belt_speed=5.0)
    with pytest.raises(ValueError, match=reason):
        diffrax_problem(block, {}, duration, sample_rate=sample_rate, tolerance=tolerance)
    if duration > 0:  # nor does a scene's own number stand in for it
        with pytest.raises(ValueError, match=reason):
            diffrax_problem(load_scene(SCENARIOS / "nominal.toml"), sample_rate=sample_rate, tolerance=tolerance)


def test_numbers_that_a_scene_has_not_are_no_arguments_of_its_problem():
    problem = diffrax_problem(load_scene(SCENARIOS / "nominal.toml"))
    term, arguments = problem["terms"].vector_field, problem["args"]
    for wrong in (arguments | {"drum.sped": 3.0}, {key: arguments[key] for key in arguments if key != "drum.speed"}):
        with pytest.raises(RequestError, match=r"^args: drum\.spe+d is missing, or is no number of this scene$"):
            term(0.0, problem["y0"], wrong)
    with pytest.raises(TypeError, match="a scene or a model is wanted, got 'nominal'; load_scene reads a scene"):
        diffrax_problem("nominal")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("name", "implicit"), [("sdirk4", True), ("dopri8", False), ("diffrax.Kvaerno5", True), ("diffrax.Tsit5", False)]
)
def test_a_method_is_implicit_where_its_steps_are_equations(name, implicit):
    assert is_implicit(name) is implicit
