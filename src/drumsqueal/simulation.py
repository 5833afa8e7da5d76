"""A run: a scene in, the linear prediction, the nonlinear transient and their comparison out.

What compares is imported when it is needed: it brings half a second of SciPy that eigenvalues do without.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.errors import COMPLETE, IntegrationError, Outcome, RequestError, SteadyStateError
from drumsqueal.findings.history import to_dataset
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.physics.composition import (
    coordinates_of,
    kept_coordinates,
    linear_coordinates,
    moved_coordinates,
)
from drumsqueal.physics.friction_law import FrictionLaw
from drumsqueal.physics.inventory import Inventory, take_inventory
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.shoe_building import GIVEN
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.shown import headed
from drumsqueal.solve import motion
from drumsqueal.solve.linear.modes import Stability, analyse_stability, while_sliding
from drumsqueal.solve.linear.steady import coupling
from drumsqueal.solve.transient.integrate import Checkpoint, Chunk, integrate, load_ahead
from drumsqueal.solve.transient.runge_kutta import DIFFRAX
from drumsqueal.solve.transient.stick_slip import check_slips

if TYPE_CHECKING:
    import xarray

    from drumsqueal.findings.compare import RunFindings


class Prepared(NamedTuple):
    """A scene with its models: `model` over the coordinates that move, `linear` over those of the eigenvalues.

    `inventory` says what the transient includes and leaves out, `held` names the coordinates that the scene leaves out
    though they would move, and `given_law` a friction law that was given in Python.
    """

    scene: Scene
    model: Model
    linear: Model
    stability: Stability
    inventory: Inventory
    held: tuple[str, ...]
    given_law: str


class Result(NamedTuple):
    """What a run leaves: the linear prediction, the history (xarray) and the findings, as `summary.json` holds them."""

    scene: Scene
    stability: Stability
    history: xarray.Dataset
    findings: RunFindings

    def __repr__(self) -> str:
        """Title and verdict."""
        return headed(self, self.scene.title, self.findings.verdict)

    def __str__(self) -> str:
        """What the command prints."""
        return str(self.findings)

    def _repr_html_(self) -> str | None:
        return self.findings._repr_html_()


def prepare(
    scene: Scene,
    friction_law: FrictionLaw | Callable[[Array], Array] | None = None,
    *,
    runs: bool = False,
    progress: Progress = silent,
) -> Prepared:
    """Build the models of a scene, find steady sliding and the eigenvalues; a `friction_law` replaces the scene's.

    Where it `runs` next, what integrates it is loaded or compiled meanwhile. Raises SceneError when the scene has no
    steady sliding to start from.
    """
    _check_pressed(scene)
    progress("finding the modes of what bends" if _bends(scene) else "building the model", 0.0, None)
    model = build_model(scene, friction_law=friction_law)
    if runs:
        load_ahead(model, scene.simulate.tolerance, scene.simulate.solver)
    linear = build_model(scene, coordinates=linear_coordinates(scene), friction_law=friction_law)
    progress("finding steady sliding and its eigenvalues", 0.0, None)
    stop_if_interrupted()
    try:
        stability = analyse_stability(linear)
    except SteadyStateError as error:
        raise SceneError(str(error)) from None
    stop_if_interrupted()
    name = getattr(friction_law, "__name__", type(friction_law).__name__)
    given_law = "" if friction_law is None else f"{name}, {GIVEN}"
    return Prepared(
        scene, model, linear, stability, take_inventory(scene, given_law), held_coordinates(scene), given_law
    )


def _bends(scene: Scene) -> bool:
    return scene.elastic_table("drum")[1] is not None or any(shoe.elastic is not None for shoe in scene.shoes)


def _check_pressed(scene: Scene) -> None:
    """Raise SceneError where forces at points are there to press the lining on the drum, and none ever does."""
    loads = [each for key, each in scene.schedules().items() if key != "drum.speed"]
    pushed = [key for key in scene.schedules() if key.endswith(".size")]
    if pushed and not any(np.any(load.value if isinstance(load, Profile) else load) for load in loads):
        reason = "every force and the load are 0 at all times: nothing ever presses the lining on the drum"
        raise SceneError(f'{reason}; write a size such as "2 kN"', tuple(pushed[0].split(".")))


def held_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates that a scene's list leaves out though what starts or forces the others would move them, too.

    Followed from one coordinate to the next through the linear model of all of them under even pressure, where the same
    ones are coupled as in any other steady sliding, which all of them together may not have.
    """
    if scene.simulate.coordinates == "auto":
        return ()
    unpushed = {scene.key_of(k, "shoe.force"): None for k in range(len(scene.shoes))}
    loads = {key: 1.0 for key in scene.schedules() if key.endswith("contact.normal_load")}
    even = scene.with_values({**unpushed, "steady.state": "uniform-pressure", **loads})
    names = coordinates_of(scene)
    pushes = coupling(while_sliding(build_model(even, coordinates=names))[0])
    moving = np.isin(names, list(moved_coordinates(scene)))
    for _ in names:
        moving = moving | (pushes @ moving)
    kept = kept_coordinates(scene)
    return tuple(name for name, moves in zip(names, moving, strict=True) if moves and name not in kept)


def check_transient(prepared: Prepared) -> None:
    """Raise SceneError where the sampling would alias the highest frequency, or diffrax meet a lining that sticks."""
    solver = prepared.scene.simulate.solver
    if solver.startswith(DIFFRAX):
        try:
            check_slips(prepared.model, prepared.scene.simulate.duration)
        except RequestError as error:
            raise SceneError(str(error), ("simulate", "solver"), solver) from None
    highest = prepared.stability.highest_frequency_Hz
    if prepared.scene.simulate.sample_rate < 2 * highest:
        raise SceneError(
            f"this is below twice the highest frequency of the model, {highest:.5g} Hz, which would be aliased; "
            f"take at least {2 * highest:.5g} Hz",
            ("simulate", "sample_rate"),
            prepared.scene.simulate.sample_rate,
        )


def check_constant(scene: Scene) -> Scene:
    """Return the scene, or raise SceneError where its drum speed, load or temperature change with time."""
    for key, value in scene.schedules().items():
        if isinstance(value, Profile):
            reason = "limit cycles and attractors take a constant value, not a profile over time"
            raise SceneError(reason, tuple(key.split(".")))
    if scene.temperature is not None:
        message = "the lining warms up, so that no motion is stationary; leave the temperature out (temperature=none)"
        raise SceneError(message, ("temperature",))
    return scene


def constant_transient(scene: Scene) -> motion.Transient:
    """The transient of a scene at constant speed and load.

    Raises SceneError where these change, where there is no steady sliding to start from, and for samples that fold.
    """
    prepared = prepare(check_constant(scene))
    check_transient(prepared)
    names, simulate = prepared.model.names, scene.simulate
    how = {name: getattr(simulate, name) for name in ("duration", "sample_rate", "tolerance", "solver")}
    return motion.Transient(prepared.model, prepared.stability.over(names), *start_of(scene, names), how)


def start_of(scene: Scene, names: Sequence[str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacement from steady sliding and velocity at the start, over the named coordinates: (n,) each."""
    displacement, velocity = (
        np.array([table.get(name, 0.0) for name in names]) for table in (scene.start.displacement, scene.start.velocity)
    )
    return displacement, velocity


def steady_at_start(prepared: Prepared) -> NDArray[np.float64]:
    """Steady sliding about which the transient starts (n,), over its coordinates."""
    stability, names = prepared.stability, prepared.model.names
    if stability.time > 0:  # at t = 0 the drum is at rest and drags nothing, or nothing pushes the shoe
        return np.zeros(len(names))
    return np.array([stability.steady_state[stability.coordinates.index(name)] for name in names])


def transient(prepared: Prepared, since: Checkpoint | None = None) -> Generator[Chunk]:
    """Integrate the scene's start, or `since` the end of a chunk of it, and yield the samples chunk by chunk.

    Raises IntegrationError where it fails.
    """
    simulate, names = prepared.scene.simulate, prepared.model.names
    return integrate(
        prepared.model,
        steady_at_start(prepared),
        *start_of(prepared.scene, names),
        duration=simulate.duration,
        sample_rate=simulate.sample_rate,
        tolerance=simulate.tolerance,
        solver=simulate.solver,
        since=since,
    )


def run(
    scene: Scene, progress: Progress = silent, *, friction_law: FrictionLaw | Callable[[Array], Array] | None = None
) -> Result:
    """Run a scene: `run(load_scene("scenarios/nominal.toml")).history` is its time history.

    `friction_law`, a function of the slip speed or a law with the method `coefficient`, replaces the scene's;
    the history's attributes and the inventory say so. `progress` is called after every chunk with the time reached (s).
    Ctrl-C, which waits for the end of a chunk, and a failed integration keep what was computed, and
    `findings.outcome` says so. The whole history is held in memory, some 200 bytes a sample. Raises SceneError for a
    scene that cannot be run, TypeError for a law that JAX cannot trace, and IntegrationError when nothing was computed.

    ```pycon
    >>> scene = drumsqueal.load_scene("nominal", ["simulate.duration=10 ms"])
    >>> result = drumsqueal.run(scene)
    >>> dict(result.history["displacement"].sizes)
    {'time': 501, 'coordinate': 6}
    >>> len(result.stability.unstable)
    3
    ```
    """
    prepared = prepare(scene, friction_law, runs=True)
    check_transient(prepared)
    chunks: list[Chunk] = []
    outcome = collect(prepared, chunks.append, progress)
    return finish(prepared, chunks, outcome)


def run_whole(prepared: Prepared, progress: Progress = silent) -> Result:
    """Run a scene that is one of a study's: all of it or nothing.

    Raises SceneError for a sample rate that folds, and IntegrationError where it fails.
    """
    check_transient(prepared)
    chunks: list[Chunk] = []
    follow(prepared, chunks.append, progress)
    return finish(prepared, chunks, COMPLETE)


def follow(
    prepared: Prepared, take: Callable[[Chunk], object], progress: Progress = silent, *, what: str = "integrating"
) -> None:
    """Integrate a scene, calling `take` with every chunk, until its end or until `take` returns True.

    `progress` is called after each chunk with the time reached (s), and may stop it by raising an exception. Raises
    IntegrationError where the integration fails.
    """
    motion.follow(transient(prepared), prepared.scene.simulate.duration, take, progress, what=what)


def collect(
    prepared: Prepared, keep: Callable[[Chunk], None], progress: Progress = silent, since: Checkpoint | None = None
) -> Outcome:
    """Integrate to the end, to the first failure or to Ctrl-C, and return the outcome; `keep` takes each chunk."""
    reached = None if since is None else since.intervals / prepared.scene.simulate.sample_rate
    chunks = _and_ahead(prepared, transient(prepared, since))
    return motion.collect(chunks, prepared.scene.simulate.duration, keep, progress, reached)


def _and_ahead(prepared: Prepared, chunks: Iterable[Chunk]) -> Generator[Chunk]:
    """Chunks of a run; beside those after the first one, what they are compared with is loaded or compiled."""
    for k, chunk in enumerate(chunks):
        if k == 0:
            from drumsqueal.findings.compare import compile_ahead

            compile_ahead(prepared.model)
        yield chunk


def finish(prepared: Prepared, chunks: list[Chunk], outcome: Outcome) -> Result:
    """Put the chunks into one history and compare it with the prediction."""
    if not chunks:
        raise IntegrationError(outcome)
    history = to_dataset(chunks, prepared.scene, prepared.model.names, outcome)
    if prepared.given_law:
        history.attrs["friction_law"] = prepared.given_law
    return compared(prepared, history)


def compared(prepared: Prepared, history: xarray.Dataset) -> Result:
    """Compare a history with the prediction."""
    from drumsqueal.findings.compare import compare, estimate_quadrature_error

    error = estimate_quadrature_error(history, prepared.model)
    findings = compare(history, prepared.stability, prepared.linear, error, prepared.held, prepared.model)
    return Result(prepared.scene, prepared.stability, history, findings)
