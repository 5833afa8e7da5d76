"""What a scene amounts to before it is run: derived numbers, what its start comes to, and what is odd about it."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.departure import moved_by
from drumsqueal.findings.edges import edge_shares
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.physics.effects.pressure import Unilateral
from drumsqueal.questions.check.run_time import RunTime, estimate
from drumsqueal.scene import Profile, Scene
from drumsqueal.scene.tables import BYTES_PER_SAMPLE
from drumsqueal.scene.usual import unusual
from drumsqueal.simulation import Prepared, check_sample_rate, prepare, start_of
from drumsqueal.solve.linear.modes import Mode, while_sliding

HARMONICS = 2  # of the highest frequency that a record should hold: contact that comes and goes makes them
PHASES = 64  # of an oscillation, at which its distance from the edges is looked at
SMALL = 0.5  # of the edges: a start from there on leaves next to no linear growth
EXCITED = 1e-6  # of the edges; less is round-off


class Number(NamedTuple):
    """A derived number in SI: its name, its value, its unit, and what it is in a few words."""

    name: str
    value: float
    unit: str
    meaning: str


class Growth(NamedTuple):
    """A mode that grows: its frequency (Hz), growth rate (1/s), and when it would reach an edge from this start (s).

    `start_share` is how far the start comes towards the nearest edge in this mode; 0 and None where it leaves it alone.
    """

    label: str
    frequency_Hz: float
    growth_rate: float
    start_share: float
    edge_time: float | None


class Check(NamedTuple):
    """What a scene amounts to: numbers, growing modes, the size of its record, the time it takes, and warnings."""

    prepared: Prepared
    numbers: tuple[Number, ...]
    growing: tuple[Growth, ...]
    start_shares: tuple[float, float]
    least_sample_rate: float
    samples: int
    history_bytes: int
    run_time: RunTime
    warnings: tuple[str, ...]

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.prepared.scene

    @property
    def edge_time(self) -> float | None:
        """When the first mode reaches an edge by the eigenvalues (s); None where none does."""
        return first_edge(self.growing, self.start_shares)


def check_scene(scene: Scene) -> Check:
    """Explain a scene and estimate what its run takes on this machine, from short pieces of it.

    Raises SceneError for what `run` refuses, too.
    """
    prepared = prepare(scene)
    check_sample_rate(prepared)
    shares = start_shares(prepared)
    growing = tuple(_growth(prepared, mode) for mode in prepared.stability.unstable)
    edge = first_edge(growing, shares)
    time = estimate(prepared, edge, _at_the_edges(prepared, growing))
    samples = round(scene.simulate.duration * scene.simulate.sample_rate) + 1
    return Check(
        prepared,
        numbers=tuple(derived_numbers(prepared)),
        growing=growing,
        start_shares=shares,
        least_sample_rate=2 * prepared.stability.highest_frequency_Hz,
        samples=samples,
        history_bytes=samples * BYTES_PER_SAMPLE,
        run_time=time,
        warnings=tuple(warnings_of(prepared, growing, shares)),
    )


def derived_numbers(prepared: Prepared) -> Iterator[Number]:
    """What follows from the numbers of a scene, for the drum's speed and the load for which the eigenvalues are."""
    model = while_sliding(prepared.linear)[0]
    contact, shoe = model.lining, model.shoe
    moment = model.operation.at(0.0)
    radius, centroid, half = (float(each) for each in (shoe.outer_radius, shoe.centroid, shoe.half_angle))
    yield Number("arc length", 2 * half * radius, "m", "of the lining, R β")
    yield Number("lining area", float(shoe.area), "m^2", "R β b")
    yield Number("mass", float(shoe.inertia.X), "kg", "of the shoe")
    yield Number("centre of gravity", centroid, "m", "from the drum's axis")
    for k, axis in enumerate(("Tx", "Ty", "Tz"), start=1):
        inertia = float(getattr(shoe.inertia, axis))
        yield Number(f"moment of inertia I{k}", inertia, "kg m^2", f"about the centre, for {axis}")
    yield from _of_contact(contact, moment, centroid, half)
    if contact.friction is not None:
        speed = abs(float(moment.drum_speed))
        sliding = radius * speed
        yield Number("sliding speed", sliding, "m/s", "R Ω; as a velocity along the drum, slip begins to reverse there")
        farthest = radius - centroid * math.cos(half)
        yield Number("reversing rotation", sliding / farthest, "rad/s", "the rate of Tz alone at which slip reverses")
        law = contact.friction.law
        slope = jax.grad(lambda s: jnp.sum(law.coefficient(s)))(jnp.asarray(sliding))
        yield Number("friction coefficient", float(law.coefficient(jnp.asarray(sliding))), "1", "at the sliding speed")
        yield Number("slope of friction", float(slope), "s/m", "of its curve there; falling friction feeds squeal")


def _of_contact(contact: Contact, moment: Moment, centroid: float, half: float) -> Iterator[Number]:
    preload, stiffness = float(moment.preload), float(contact.law.stiffness)
    yield Number("mean pressure p0", preload, "Pa", "normal load / (R β b)")
    if isinstance(contact.law, Unilateral) and stiffness > 0:
        depth = preload / stiffness
        yield Number("lifting displacement", depth, "m", "p0/k_c: away from the drum, at which pressure p0 is lost")
        arm = centroid * (math.sin(half) if half < math.pi / 2 else 1.0)
        if arm > 0:
            yield Number("lifting rotation", depth / arm, "rad", "Tz alone at which an end of the lining lifts off")


def start_shares(prepared: Prepared) -> tuple[float, float]:
    """How far the start comes towards contact loss and slip reversal; from 1 on it may be beyond."""
    n = len(prepared.model.names)
    state = _start(prepared, prepared.model.names)
    return edge_shares(while_sliding(prepared.model)[0], state[None, :n], state[None, n:])


def first_edge(growing: tuple[Growth, ...], shares: tuple[float, float]) -> float | None:
    """When the first edge is reached (s): at once, by the growth of a mode, or never."""
    if max(shares) >= 1:
        return 0.0
    return min((each.edge_time for each in growing if each.edge_time is not None), default=None)


def _start(prepared: Prepared, names: tuple[str, ...]) -> NDArray[np.float64]:
    """The departure from steady sliding and the velocity at the start (2n,)."""
    return np.concatenate(start_of(prepared.scene, names))


def _growth(prepared: Prepared, mode: Mode) -> Growth:
    """A mode that grows, and a_j(0) = 2 leftᴴ y of the start over its amplitude at the nearest edge."""
    coordinates = prepared.stability.coordinates
    amplitude = abs(2 * np.vdot(mode.left, _start(prepared, coordinates)))
    share = float(amplitude * _share_of_shape(prepared, mode))
    time = max(0.0, math.log(1 / share) / mode.growth_rate) if share > EXCITED**2 else None
    return Growth(mode.label, mode.frequency_Hz, mode.growth_rate, share, time)


def _share_of_shape(prepared: Prepared, mode: Mode) -> float:
    """How far a mode of amplitude 1 comes towards the nearer edge: it is proportional to the amplitude."""
    turning = np.exp(2j * np.pi * np.arange(PHASES) / PHASES)
    states, n = np.real(turning[:, None] * mode.right), len(prepared.stability.coordinates)
    return max(edge_shares(while_sliding(prepared.linear)[0], states[:, :n], states[:, n:]))


def _at_the_edges(prepared: Prepared, growing: tuple[Growth, ...]) -> NDArray[np.float64]:
    """A state (2n,), over the coordinates of the model, with each mode that the start excites at its nearest edge."""
    names, wide = prepared.model.names, prepared.stability.coordinates
    state = np.zeros(2 * len(wide))
    for mode, growth in zip(prepared.stability.unstable, growing, strict=True):
        if growth.edge_time is not None and math.isfinite(share := _share_of_shape(prepared, mode)) and share > 0:
            state += np.real(mode.right) / share
    kept = [wide.index(name) for name in names]
    return state[[*kept, *(len(wide) + k for k in kept)]]


def warnings_of(prepared: Prepared, growing: tuple[Growth, ...], shares: tuple[float, float]) -> Iterator[str]:
    """What users get wrong, in plain words."""
    yield from unusual(prepared.scene)
    yield from _about_the_steady_state(prepared)
    yield from _about_the_start(prepared, growing, shares)
    yield from _about_the_record(prepared, growing, shares)


def _about_the_steady_state(prepared: Prepared) -> Iterator[str]:
    stability = prepared.stability
    if stability.contact_fraction < 1 - 1e-9:
        yield (
            f"In steady sliding the lining presses on {100 * stability.contact_fraction:.3g} % of its area only: the "
            "eigenvalues are those of the part that touches."
        )
    elif stability.pressure_range[0] < 0:
        yield "In steady sliding the pressure is negative on part of the lining: without separation the contact pulls."
    if stability.divergence is not None:
        yield f"A motion grows without oscillation ({stability.divergence:+.3g} 1/s): the shoe runs away or jams."
    if stability.time > 0:
        yield f"The drum is at rest at t = 0: the eigenvalues are for its speed at t = {stability.time:g} s."
    if prepared.held:
        held = ", ".join(prepared.held)
        yield f"The others would move {held}, too, which simulate.coordinates leaves out: they are held."
    speed = prepared.scene.drum.speed
    if isinstance(speed, Profile) and prepared.scene.friction is not None and 0.0 in speed.value:
        yield "The drum comes to rest: the lining may stick as a whole, which the time below does not count."


def _about_the_start(prepared: Prepared, growing: tuple[Growth, ...], shares: tuple[float, float]) -> Iterator[str]:
    if not np.any(_start(prepared, prepared.stability.coordinates)) and prepared.scene.forcing is None:
        moving = moved_by(prepared.linear, prepared.stability, prepared.scene.simulate.duration)
        if moving:
            yield f"Nothing is started, but the {moving} moves the shoe out of steady sliding."
        else:
            yield "Nothing is started and no force acts: the shoe stays in steady sliding; give start a displacement."
        return
    lost, reversed_slip = shares
    if max(shares) >= SMALL:
        which = "contact loss" if lost >= reversed_slip else "slip reversal"
        beyond = "beyond the edges" if max(shares) >= 1 else "near the edges"
        yield (
            f"The start is {beyond}, at {max(shares):.3g} times {which}: there is next to no linear growth to compare "
            "with the eigenvalues; make it smaller, or take it as a large disturbance."
        )
    still = [each.label for each in growing if each.edge_time is None]
    if still:
        yield f"The start leaves {', '.join(still)} alone, which would grow: it is not in the transient."


def _about_the_record(prepared: Prepared, growing: tuple[Growth, ...], shares: tuple[float, float]) -> Iterator[str]:
    simulate, highest = prepared.scene.simulate, prepared.stability.highest_frequency_Hz
    if simulate.sample_rate < 2 * (HARMONICS + 1) * highest:
        yield (
            f"The sample rate is {simulate.sample_rate / highest:.3g} times the highest frequency, {highest:.5g} Hz: "
            f"of a motion that meets the edges what lies above {simulate.sample_rate / 2:.5g} Hz folds back; "
            f"{2 * (HARMONICS + 1) * highest:.3g} Hz would hold its third harmonic."
        )
    edge, rates = first_edge(growing, shares), [each.growth_rate for each in growing if each.edge_time is not None]
    enough = math.inf if edge is None else float(f"{1.5 * edge:.2g}")
    if edge is not None and rates and simulate.duration < enough:
        saturates = "will not saturate" if edge > simulate.duration else "may not have settled by its end"
        yield (
            f"The duration of {simulate.duration:g} s is {simulate.duration * max(rates):.3g} growth times: the "
            f"eigenvalues put the first edge at {edge:.3g} s, so squeal {saturates}; take at least "
            f"{enough:g} s, or a larger start."
        )
