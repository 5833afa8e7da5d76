"""What a scene amounts to before it is run: what its meshes hold, derived numbers, and what is odd about it."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from pydantic import Field
from rich.console import Console

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.brake import Brakes, ShoeAsBrake, brake_sentences, describe_brake
from drumsqueal.findings.columns import Column, columns_of, values_of
from drumsqueal.findings.prediction import (
    Prediction,
    ShapeResolution,
    predict,
    resolution_in_words,
    resolution_of,
    sliding_later,
    turned_far,
)
from drumsqueal.findings.schema import Finding, Findings, Held, InMemory
from drumsqueal.findings.vibration import boundary_ratios, mean_pressures, moved_by
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.solid_mesh import SolidMesh
from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.effects.pressure import LinearLining, Unilateral, depth_under, tangent_under
from drumsqueal.physics.elasticity import resolved, shoe_modes
from drumsqueal.physics.friction_law import FrictionLaw
from drumsqueal.physics.model import Model
from drumsqueal.physics.trial_shapes import meshes_of
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import COORDINATES, Profile, Scene
from drumsqueal.scene.quantities import percent, printable
from drumsqueal.scene.tables import BYTES_PER_MODE, BYTES_PER_SAMPLE
from drumsqueal.scene.usual import unusual
from drumsqueal.simulation import Prepared, check_transient, prepare, start_of, steady_at_start
from drumsqueal.solve.linear.modes import Mode, while_sliding
from drumsqueal.solve.transient.integrate import integrate
from drumsqueal.solve.transient.state import CHUNK_SAMPLES
from drumsqueal.terminal.tables import print_cells, print_model, print_notes

Reals = NDArray[np.float64]


class Amount(Finding):
    """How many solid elements there are, their volume, and their mass by the scene's densities."""

    elements: Annotated[int, Column("elements", "d")]
    volume_m3: Annotated[float, Column("volume", ".6g", unit="mm^3", factor=1e9, in_cells=True)]
    mass_kg: Annotated[float, Column("mass", ".6g", in_cells=True)]


class MeshContents(Finding):
    """What is read of a mesh: elements by the file's names of types, solid ones by set, and the bounding box.

    Point masses are counted by their nodes, and their mass is not in that of the whole.
    """

    body: str
    file: str
    elements_by_type: dict[str, int]
    whole: Amount
    point_masses: int
    point_masses_kg: float
    sets: dict[str, Amount]
    lowest_m: tuple[float, float, float]
    highest_m: tuple[float, float, float]
    notes: tuple[str, ...]


def mesh_contents(scene: Scene) -> tuple[MeshContents, ...]:
    """Take stock of each mesh that a scene names."""
    return tuple(_contents(*each) for each in meshes_of(scene))


def _contents(body: str, file: str, mesh: SolidMesh, masses: Reals) -> MeshContents:
    volumes, (low, high) = mesh.volumes, (extreme(mesh.points, axis=0).tolist() for extreme in (np.min, np.max))
    amounts = {
        name: Amount(
            elements=len(masses[held]), volume_m3=float(volumes[held].sum()), mass_kg=float(masses[held].sum())
        )
        for name, held in [("", slice(None)), *sorted(mesh.element_sets.items())]
    }
    return MeshContents(
        body=body,
        file=file,
        elements_by_type=mesh.counts,
        whole=amounts.pop(""),
        point_masses=int(np.count_nonzero(mesh.point_masses)),
        point_masses_kg=float(mesh.point_masses.sum()),
        sets=amounts,
        lowest_m=low,
        highest_m=high,
        notes=mesh.notes,
    )


# What a run takes next to its integration goes with the speed of the machine, as does loading what a check needs:
# comparison, figures and programs fetched from the cache took so many times as long, for the nominal scene.
BESIDES_INTEGRATION = 8.0
HARMONICS = 2  # of the highest frequency that a record should hold: contact that comes and goes makes them
PHASES = 64  # of an oscillation, at which its distance from the contact boundaries is looked at


class Number(Finding):
    """A derived number in SI: its value, its unit, and what it is in a few words."""

    value: float
    unit: str
    meaning: str = Field(default="", exclude=True)


@dataclass(frozen=True)
class PredictedGrowth:
    """A mode that grows: frequency (Hz), growth rate (1/s), and when it would reach a contact boundary (s).

    `start_boundary_ratio` is how far the start comes towards the nearest one in this mode; 0 and None where it is not
    excited.
    """

    label: str
    frequency_Hz: float
    growth_rate: float
    start_boundary_ratio: float
    edge_time: float | None


@dataclass(frozen=True)
class RunTime:
    """Time of the integration and of a whole `drumsqueal run` once compiled (s), and evaluations; None if unknown."""

    integration_s: float | None
    evaluations: float | None
    run_s: float | None


class Check(Findings):
    """What a scene amounts to: numbers, growing modes, the size of its record, the time it takes, and warnings.

    `estimate` is None where that time was not measured. `first_edge_s` is when the first mode reaches a contact
    boundary by the eigenvalues (s); None where none does.
    """

    printed_by = "drumsqueal.questions.check.print_check"
    numbers: dict[str, Number]
    prediction: Prediction
    growing: tuple[PredictedGrowth, ...]
    start_share_of_contact_loss: float | None
    start_share_of_slip_reversal: float | None
    first_edge_s: float | None
    highest_frequency_Hz: float
    least_sample_rate_Hz: float
    samples: int
    history_bytes: int
    estimate: RunTime | None
    warnings: tuple[str, ...]
    model: dict[str, tuple[str, ...]]
    brake: ShoeAsBrake | Brakes | None
    meshes: tuple[MeshContents, ...]
    prepared: InMemory[Prepared] = Held


def check_scene(scene: Scene, loading: float = 0.0, *, measure: bool = False, progress: Progress = silent) -> Check:
    """Explain a scene and, to `measure`, estimate what its run takes on this machine, from short pieces of it.

    `loading` (s) is what it took to load the package, 0 where it was loaded before. Raises SceneError for what `run`
    refuses, too.
    """
    prepared = prepare(scene, progress=progress)
    check_transient(prepared)
    progress("looking how far the start is from contact boundaries", 0.0, None)
    n, state = len(prepared.model.names), _start(prepared, prepared.model.names)
    fractions = boundary_ratios(while_sliding(prepared.model)[0], state[None, :n], state[None, n:])
    growing = tuple(_growth(prepared, mode) for mode in prepared.stability.unstable)
    boundary = first_boundary_time(growing, fractions)
    time = _time(prepared, growing, boundary, loading, progress) if measure else None
    progress("looking for the friction at which the brake locks", 0.0, None)
    brake = describe_brake(scene, prepared.linear, prepared.stability)
    resolution = resolution_of(scene, prepared.linear, prepared.stability, progress)
    unknown = () if isinstance(resolution, ShapeResolution) else resolution_in_words(resolution)
    samples = round(scene.simulate.duration * scene.simulate.sample_rate) + 1
    return Check(
        scene=scene,
        numbers={name: Number(value=value, unit=unit, meaning=said) for name, value, unit, said in _numbers(prepared)},
        prediction=predict(prepared.stability, resolution),
        growing=growing,
        start_share_of_contact_loss=fractions[0],
        start_share_of_slip_reversal=fractions[1],
        first_edge_s=boundary,
        highest_frequency_Hz=prepared.stability.highest_frequency_Hz,
        least_sample_rate_Hz=2 * prepared.stability.highest_frequency_Hz,
        samples=samples,
        history_bytes=samples * (BYTES_PER_SAMPLE + BYTES_PER_MODE * (len(coordinates_of(scene)) - len(COORDINATES))),
        estimate=time,
        warnings=(*warnings_of(prepared, growing, fractions), *unknown),
        model={key: tuple(words) for key, words in prepared.inventory._asdict().items()},
        brake=brake,
        meshes=mesh_contents(scene),
        prepared=prepared,
    )


def _time(
    prepared: Prepared, growing: tuple[PredictedGrowth, ...], boundary: float | None, loading: float, progress: Progress
) -> RunTime:
    """What a run takes, by short pieces of it."""
    progress("compiling and timing pieces of the transient", 0.0, None)
    found = estimate(prepared, boundary, _at_the_boundaries(prepared, growing), progress)
    seconds, evaluations = found or (None, None)
    # 0.1 s; loading that is faster did not happen, for all was loaded before
    whole = None if seconds is None or loading < 0.1 else seconds + (1 + BESIDES_INTEGRATION) * loading
    return RunTime(seconds, evaluations, whole)


def _numbers(prepared: Prepared) -> Iterator[tuple[str, float, str, str]]:
    """What follows from the numbers of a scene, for the drum's speed and the load for which the eigenvalues are."""
    model = while_sliding(prepared.linear)[0]
    sides = model.sides
    for (mine, side), mean in zip(sides, mean_pressures(model, model.operation.at(0.0)), strict=True):
        for name, value, unit, said in _numbers_of(side, float(mean), pushed=model.pushed):
            yield f"{mine.name}: {name}" if len(sides) > 1 else name, value, unit, said


def _numbers_of(model: Model, preload: float, *, pushed: bool) -> Iterator[tuple[str, float, str, str]]:
    """Those of one shoe, on which there is a mean pressure (Pa)."""
    contact, shoe = model.lining, model.shoe
    moment = model.operation.at(0.0)
    radius, centroid, half = (float(each) for each in (shoe.outer_radius, shoe.centroid, shoe.half_angle))
    yield ("arc length", 2 * half * radius, "m", "of the lining, R β")
    yield ("lining area", float(shoe.area), "m^2", "R β b")
    yield ("mass", float(shoe.inertia.X), "kg", "of the shoe")
    yield ("centre of gravity", centroid, "m", "from the drum's axis")
    for k, axis in enumerate(("Tx", "Ty", "Tz"), start=1):
        inertia = float(getattr(shoe.inertia, axis))
        yield (f"moment of inertia I{k}", inertia, "kg m^2", f"about the centre, for {axis}")
    if pushed:
        mean = "mean pressure"
        yield (mean, preload, "Pa", "normal force in steady sliding / (R β b)")
    else:
        mean = "p0"
        yield ("mean pressure p0", preload, "Pa", "normal load / (R β b)")
    depth, linear = float(depth_under(contact.law, np.asarray(preload))), isinstance(contact.law.normal, LinearLining)
    if not linear:
        stiffness = float(tangent_under(contact.law.normal, np.asarray(preload)))
        yield ("contact stiffness", stiffness, "N/m^3", f"of the lining under {mean}, dp/du")
    if isinstance(contact.law, Unilateral) and float(contact.law.stiffness) > 0:
        under = f"{mean}/k_c" if linear else f"the compression under {mean}"
        yield ("lifting displacement", depth, "m", f"{under}: away from the drum, at which that pressure is lost")
        arm = centroid * (math.sin(half) if half < math.pi / 2 else 1.0)
        if arm > 0 and not pushed:  # next to its pin such a shoe lifts off at once
            yield ("lifting rotation", depth / arm, "rad", "Tz alone at which an end of the lining lifts off")
    if contact.friction is not None:
        speed = abs(float(moment.drum_speed))
        sliding = radius * speed
        yield ("sliding speed", sliding, "m/s", "R Ω; as a velocity along the drum, slip begins to reverse there")
        farthest = radius - centroid * math.cos(half)
        yield ("reversing rotation", sliding / farthest, "rad/s", "the rate of Tz alone at which slip reverses")
        law = contact.friction.law
        coefficient, slope = _friction_at(law, np.asarray(sliding))
        yield ("friction coefficient", float(coefficient), "1", "at the sliding speed")
        yield ("slope of friction", float(slope) + 0.0, "s/m", "of its curve there; falling friction feeds squeal")


@Interpreted
def _friction_at(law: FrictionLaw, speed: Array) -> tuple[Array, Array]:
    """The coefficient at a slip speed (m/s), and its slope there (s/m)."""
    return law.coefficient(speed), jax.grad(lambda s: jnp.sum(law.coefficient(s)))(speed)


def first_boundary_time(growing: tuple[PredictedGrowth, ...], fractions: tuple[float, float]) -> float | None:
    """When the first contact boundary is reached (s): at once, by the growth of a mode, or never."""
    if max(fractions) >= 1:
        return 0.0
    return min((each.edge_time for each in growing if each.edge_time is not None), default=None)


def _start(prepared: Prepared, names: tuple[str, ...]) -> Reals:
    """The displacement from steady sliding and the velocity at the start (2n,)."""
    return np.concatenate(start_of(prepared.scene, names))


def _growth(prepared: Prepared, mode: Mode) -> PredictedGrowth:
    """A mode that grows, and a_j(0) = 2 leftᴴ y of the start over its amplitude at the nearest contact boundary."""
    coordinates = prepared.stability.coordinates
    amplitude = abs(2 * np.vdot(mode.left, _start(prepared, coordinates)))
    fraction = float(amplitude * _fraction_of_shape(prepared, mode))
    # 1e-6 of the way to a contact boundary; less is round-off
    time = max(0.0, math.log(1 / fraction) / mode.growth_rate) if fraction > 1e-6**2 else None
    return PredictedGrowth(mode.label, mode.frequency_Hz, mode.growth_rate, fraction, time)


def _fraction_of_shape(prepared: Prepared, mode: Mode) -> float:
    """How far a mode of amplitude 1 comes towards the nearer contact boundary: it is proportional to the amplitude."""
    turning = np.exp(2j * np.pi * np.arange(PHASES) / PHASES)
    states, n = np.real(turning[:, None] * mode.right), len(prepared.stability.coordinates)
    return max(boundary_ratios(while_sliding(prepared.linear)[0], states[:, :n], states[:, n:]))


def _at_the_boundaries(prepared: Prepared, growing: tuple[PredictedGrowth, ...]) -> Reals:
    """A state (2n,) over the model's coordinates: each mode that the start excites, at its nearest contact boundary."""
    names, wide = prepared.model.names, prepared.stability.coordinates
    state = np.zeros(2 * len(wide))
    for mode, growth in zip(prepared.stability.unstable, growing, strict=True):
        fraction = 0.0 if growth.edge_time is None else _fraction_of_shape(prepared, mode)
        if 0 < fraction < math.inf:
            state += np.real(mode.right) / fraction
    kept = [wide.index(name) for name in names]
    return state[[*kept, *(len(wide) + k for k in kept)]]


def warnings_of(
    prepared: Prepared, growing: tuple[PredictedGrowth, ...], fractions: tuple[float, float]
) -> Iterator[str]:
    """What users get wrong, in plain words."""
    yield from unusual(prepared.scene)
    for one in resolved(prepared.scene).alone:
        # A mesh with several elements a wavelength stays below 0.01 of a mode's shape.
        if one.shoe.solid is None or (solid := shoe_modes(one)).fit_error <= 0.01:
            continue
        what = "its elements" if one.shoe.modes is None else "its nodes"
        yield (
            f"The shoe's mesh is coarse: on the lining, smooth shapes of its modes are up to "
            f"{percent(solid.fit_error)} off those of {what}; refine it along the lining."
        )
    yield from _about_the_steady_state(prepared)
    yield from _about_the_start(prepared, growing, fractions)
    yield from _about_the_record(prepared, growing, fractions)


def _about_the_steady_state(prepared: Prepared) -> Iterator[str]:
    stability = prepared.stability
    # 5e-4 of the lining, which is off the drum for what the pin of a shoe gives way: 1e-5 to 1e-4 were found
    least = 1 - (5e-4 if prepared.linear.pushed else 1e-9)
    if stability.contact_fraction < least:
        yield (
            f"In steady sliding the lining presses on {100 * stability.contact_fraction:.3g} % of its area only: the "
            "eigenvalues are those of the part that touches."
        )
    elif stability.pressure_range[0] < 0:
        yield "In steady sliding the pressure is negative on part of the lining: without separation the contact pulls."
    yield from turned_far(stability)
    if stability.divergence is not None:
        yield f"A motion grows without oscillation ({stability.divergence:+.3g} 1/s): the shoe runs away or jams."
    if stability.time > 0:
        yield sliding_later(stability)
    if prepared.held:
        held = ", ".join(prepared.held)
        yield f"Held at zero by simulate.coordinates, though the other coordinates would move them: {held}."
    speed = prepared.scene.drum.speed
    if isinstance(speed, Profile) and prepared.scene.rubs and 0.0 in speed.value:
        yield "The drum comes to rest: the lining may stick as a whole, which the time below does not count."


def _about_the_start(
    prepared: Prepared, growing: tuple[PredictedGrowth, ...], fractions: tuple[float, float]
) -> Iterator[str]:
    if not np.any(_start(prepared, prepared.stability.coordinates)) and prepared.scene.forcing is None:
        moving = moved_by(prepared.linear, prepared.stability, prepared.scene.simulate.duration)
        if moving:
            yield f"Nothing is started, but the {moving} moves the shoe out of steady sliding."
        else:
            yield "Nothing is started and no force acts: the shoe stays in steady sliding; set start.displacement."
        return
    lost, reversed_slip = fractions
    # A start from half of the way to a contact boundary on leaves next to no linear growth.
    if math.isinf(lost):
        yield "At t = 0 nothing presses the lining on: any start is beyond the loss of contact, without linear growth."
    elif max(fractions) >= 0.5:
        which = "loss of contact" if lost >= reversed_slip else "slip reversal"
        where = "beyond" if max(fractions) >= 1 else "close to"
        yield (
            f"The start is {where} the contact boundaries, at {max(fractions):.3g} times that of {which}: hardly any "
            "linear growth is left to compare with the eigenvalues; make it smaller, or take it as a large disturbance."
        )
    still = [each.label for each in growing if each.edge_time is None]
    if still:
        yield f"The start does not excite {', '.join(still)}: the transient does not show that instability."


def _about_the_record(
    prepared: Prepared, growing: tuple[PredictedGrowth, ...], fractions: tuple[float, float]
) -> Iterator[str]:
    simulate, highest = prepared.scene.simulate, prepared.stability.highest_frequency_Hz
    if simulate.sample_rate < 2 * (HARMONICS + 1) * highest:
        yield (
            f"The sample rate is {simulate.sample_rate / highest:.3g} times the highest frequency, {highest:.5g} Hz: "
            f"with lift-off or slip reversal, motion above {simulate.sample_rate / 2:.5g} Hz is aliased; "
            f"{2 * (HARMONICS + 1) * highest:.3g} Hz would hold its third harmonic."
        )
    boundary = first_boundary_time(growing, fractions)
    rates = [each.growth_rate for each in growing if each.edge_time is not None]
    enough = math.inf if boundary is None else float(f"{1.5 * boundary:.2g}")
    if boundary is not None and rates and simulate.duration < enough:
        saturates = "will not saturate" if boundary > simulate.duration else "may not have settled by its end"
        yield (
            f"The duration of {simulate.duration:g} s is {simulate.duration * max(rates):.3g} e-folding times of the "
            f"growth: the eigenvalues put the first contact boundary at {boundary:.3g} s, so squeal {saturates}; take "
            f"at least {enough:g} s, or a larger start."
        )


# How long a run will take on this machine: short pieces of it are timed, below the contact boundaries and at them.
#
# It is processor time that is taken, so that what else the machine does counts little.


_PIECES = (4, 20, 100, CHUNK_SAMPLES)  # samples
_LONG_ENOUGH = 0.3  # s; a piece that takes longer is not made five times as long
REPEATS = 3


def estimate(
    prepared: Prepared, boundary: float | None, at_the_boundaries: Reals, progress: Progress = silent
) -> tuple[float, float] | None:
    """Estimate computing time (s) and evaluations of a run, NaN if not counted; None where the integration fails.

    Pieces from the start are added up until the time `boundary` (s; None: all along), and pieces from a state (2n,) at
    a contact boundary from then on. A lining that sticks takes other programs, which are not timed.
    """
    simulate = prepared.scene.simulate
    own = np.concatenate(start_of(prepared.scene, prepared.model.names))
    below = 1.0 if boundary is None else min(1.0, boundary / simulate.duration)
    try:
        _timed(prepared, own, _PIECES[0], progress)  # compiles
        pace = below * _pace(prepared, own, progress)
        if below < 1:
            # 1.5 of the way to a contact boundary, where the second pieces begin
            further = 1.5 * at_the_boundaries if np.any(at_the_boundaries) else own
            pace = pace + (1 - below) * _pace(prepared, further, progress)
    except IntegrationError:
        return None
    seconds, evaluations = simulate.duration * simulate.sample_rate / CHUNK_SAMPLES * pace
    return float(seconds), float(evaluations)


def _pace(prepared: Prepared, state: Reals, progress: Progress) -> Reals:
    """Computing time (s) and evaluations (2,) of a whole chunk, from pieces of it that are long enough to be timed.

    A piece observes a whole chunk.
    """
    found: list[Reals] = []
    for samples in _PIECES:
        timed = [_timed(prepared, state, samples, progress)]
        while len(timed) < REPEATS and timed[0][0] < _LONG_ENOUGH:
            timed.append(_timed(prepared, state, samples, progress))
        found.append(np.array(min(timed)))  # whatever else the machine does makes it longer, never shorter
        if found[-1][0] > _LONG_ENOUGH:
            break
    last = _PIECES[len(found) - 1]
    if len(found) == 1 or last == CHUNK_SAMPLES:
        return found[-1] * (CHUNK_SAMPLES / last)
    more = found[-1] - found[-2]
    return found[-1] + (CHUNK_SAMPLES - last) / (last - _PIECES[len(found) - 2]) * np.array(
        [max(more[0], 0.0), more[1]]
    )


def _timed(prepared: Prepared, state: Reals, samples: int, progress: Progress) -> tuple[float, float]:
    """Computing time (s) and evaluations of so many samples from a displacement and velocity (2n,)."""
    progress(f"timing {samples} samples", 0.0, None)
    simulate = prepared.scene.simulate
    begun = time.process_time()
    pieces = integrate(
        prepared.model,
        steady_at_start(prepared),
        *np.split(state, 2),
        duration=samples / simulate.sample_rate,
        sample_rate=simulate.sample_rate,
        tolerance=simulate.tolerance,
        solver=simulate.solver,
    )
    evaluations = sum(chunk.evaluations for chunk in pieces)
    return time.process_time() - begun, evaluations


def print_check(console: Console, found: Check) -> None:
    """Print numbers, growing modes, the record, the time it takes, and the warnings."""
    simulate = found.scene.simulate
    console.print(printable(f"{found.title or 'The scene'}: no mistakes found"), style="bold")
    print_model(console, found.model)
    columns = Column("number"), Column("value", ".6g"), Column("unit", missing=""), Column("meaning")
    numbers = ((name, each.value, each.unit, each.meaning) for name, each in found.numbers.items())
    print_cells(console, "What follows from it", columns, numbers)
    for mesh in found.meshes:
        _print_mesh(console, mesh)
    if found.brake is not None:
        for line in brake_sentences(found.brake):
            console.print(line)
    for line in [_grows(growth) for growth in found.growing] or ["No mode grows."]:
        console.print(line)
    print_notes(console, resolution_in_words(found.prediction.resolution))
    console.print(
        f"Highest frequency {found.highest_frequency_Hz:.5g} Hz: at least {found.least_sample_rate_Hz:.5g} samples a "
        f"second are needed, and {simulate.sample_rate:g} are taken"
    )
    size = f"about {found.history_bytes / 1e6:.2g} MB"
    console.print(f"{found.samples} samples in {simulate.duration:g} s, history.nc of {size}")
    console.print(_takes(found))
    print_notes(console, found.warnings)


def _print_mesh(console: Console, mesh: MeshContents) -> None:
    """Elements by type, volume and mass by set, and the bounding box, to compare with one's own model."""
    types = ", ".join(f"{count} {name}" for name, count in mesh.elements_by_type.items())
    console.print(printable(f"Mesh of the {mesh.body}, {mesh.file}: {types}"))
    columns = Column("set"), *columns_of(Amount).values()
    amounts = (("all", mesh.whole), *mesh.sets.items())
    rows = ((printable(name), *values_of(each)) for name, each in amounts)
    print_cells(console, "", columns, rows)
    if mesh.point_masses:
        places = "1 node" if mesh.point_masses == 1 else f"{mesh.point_masses} nodes"
        console.print(f"Point masses at {places}, in addition: {mesh.point_masses_kg:.6g} kg")
    ranges = zip("xyz", mesh.lowest_m, mesh.highest_m, strict=True)
    console.print(f"Bounding box: {', '.join(f'{axis} {low:.6g} to {high:.6g} m' for axis, low, high in ranges)}")
    print_notes(console, map(printable, mesh.notes))


def _grows(growth: PredictedGrowth) -> str:
    grows = f"{growth.label} grows: {growth.frequency_Hz:.2f} Hz, {growth.growth_rate:+.3f} 1/s"
    if growth.edge_time is None:
        return f"{grows}; the start does not excite it"
    start = f"{grows}; the start is {growth.start_boundary_ratio:.2g} of the way to the nearest contact boundary"
    if growth.edge_time == 0:
        return f"{start}, and so beyond it"
    return f"{start}, which this mode alone reaches after {growth.edge_time:.3g} s"


def _takes(found: Check) -> str:
    """The time of a run, as the estimate that it is."""
    if found.estimate is None:
        return "How long a run takes was not measured: --measure does, or measure=True in Python"
    seconds, evaluations, whole = found.estimate.integration_s, found.estimate.evaluations, found.estimate.run_s
    if seconds is None:
        return "Computing time unknown: the integration fails soon after the start"
    counted = "" if evaluations is None or math.isnan(evaluations) else f" ({evaluations:.2g} evaluations)"
    text = f"Estimated from short pieces of the run: about {_duration(seconds)} of integration{counted}"
    return text if whole is None else f"{text}, {_duration(whole)} in all once it is compiled"


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.1g} s" if seconds < 1 else f"{seconds:.2g} s"
    return f"{seconds / 60:.2g} min" if seconds < 7200 else f"{seconds / 3600:.2g} h"
