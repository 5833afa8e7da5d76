"""The linear prediction against what the transient does, how accurate that is, and how far two runs differ.

The balance of energy does not show the error of the contact forces, because it takes them and its friction power from
the same quadrature: they are compared with those of another, finer rule.
"""

import dataclasses
import math
import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from pydantic import Field, computed_field

from drumsqueal.coordinates import is_elastic, is_of_drum, is_static, shoe_of
from drumsqueal.errors import COMPLETE, Ending
from drumsqueal.findings.brake import Brakes, ShoeAsBrake, describe_brake
from drumsqueal.findings.columns import Column, columns_of
from drumsqueal.findings.growth_phase import (
    FrequencyDrift,
    GrowthPhase,
    ModeComparison,
    Note,
    follow_frequency,
    measure_growth,
)
from drumsqueal.findings.history import memory_of
from drumsqueal.findings.prediction import Prediction, predict
from drumsqueal.findings.ramp import Ramp, find_ramp
from drumsqueal.findings.saturation import (
    Saturation,
    SpectralLine,
    describe_motion,
    describe_saturation,
    saturated_part,
)
from drumsqueal.findings.schema import Finding, Findings
from drumsqueal.findings.squeals import runs
from drumsqueal.findings.verdict import state_verdict
from drumsqueal.findings.vibration import Vibration, boundary_ratio, changes, first_boundary_time, moved_by
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.effects.several import Contacts
from drumsqueal.physics.inventory import take_inventory
from drumsqueal.physics.model import Model
from drumsqueal.physics.quadrature.area import AreaSurface
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.independent import TANH_SINH, IndependentSurface
from drumsqueal.programs import compiled
from drumsqueal.scene import scene_from_dict
from drumsqueal.solve.linear.modes import Mode, Stability

if TYPE_CHECKING:
    import xarray

INSTANTS = 32  # at which it is looked at: half of them evenly spread, half where most of the slip is reversed
# A rule that shares nothing with that of the plane; in space the same kind of rule with other nodes, and far more.
IN_PLANE = IndependentSurface(TANH_SINH, spatial=False, panels=32)
IN_SPACE = AreaSurface(along=24, across=12, turning=24, sections=5, always_split=True)


class Accuracy(Finding):
    """Largest error of the energy balance (J, and relative), and of the contact forces by a finer quadrature.

    Of a small motion the error over the kinetic energy is large: friction turns hundreds of watts, and their round-off
    is in the balance.
    """

    energy_balance_error_J: float
    energy_balance_error_over_kinetic_energy: float
    energy_balance_error_over_friction_work: float
    quadrature_error_over_normal_force: float | None = None


def measure_accuracy(history: "xarray.Dataset", quadrature_error: float | None) -> Accuracy:
    """Read the balance of energy off a history; `quadrature_error` is that of its contact forces."""
    error = float(np.abs(history["energy_balance_error"].values).max())
    kinetic = float(history["kinetic_energy"].values.max())
    work = float(history["friction_power"].integrate("time"))
    return Accuracy(
        energy_balance_error_J=error,
        energy_balance_error_over_kinetic_energy=error / kinetic if kinetic > 0 else 0.0,
        energy_balance_error_over_friction_work=error / work if work > 0 else 0.0,
        quadrature_error_over_normal_force=quadrature_error,
    )


def estimate_quadrature_error(history: "xarray.Dataset", model: Model) -> float | None:
    """Estimate the largest error of normal force, and of brake torque over R, over the largest normal force.

    It is to be well below the run's relative tolerance. `model` is that of the transient.

    None where the lining never slips or nothing presses it.
    """
    if not isinstance(model.contact, Contact | Contacts):
        return None
    recorded = np.isfinite(history["normal_force"].values)  # not so beyond where a run was cut off
    slips = np.flatnonzero((history["sticking"].values == 0) & recorded)
    if slips.size == 0:
        return None
    most_reversed = slips[np.argsort(-history["slip_reversed_fraction"].values[slips], kind="stable")]
    spread = np.linspace(0, slips.size - 1, INSTANTS // 2).astype(int)
    instants = np.concatenate([slips[spread], np.resize(most_reversed[: INSTANTS // 2], INSTANTS - INSTANTS // 2)])
    motion = (
        history[name].isel(time=instants).sel(coordinate=list(model.names)).values
        for name in ("displacement", "velocity")
    )
    memory = memory_of(history.isel(time=instants), model.remembered)
    found = _observe(_with_finer(model), history["time"].values[instants], *motion, memory)
    largest = float(np.max(np.asarray(found.normal_force)))
    if not largest > 0:
        return None
    radius = float(model.contact.radius)
    errors = (
        np.abs(history[name].values[instants] - np.asarray(getattr(found, name))) / reach
        for name, reach in (("normal_force", 1.0), ("brake_torque", radius))
    )
    return float(max(error.max() for error in errors)) / largest


def compile_ahead(model: Model) -> None:
    """Load or compile, in another thread, the program by which `estimate_quadrature_error` looks at the transient's."""
    if isinstance(model.contact, Contact | Contacts):
        none, memory = np.zeros((INSTANTS, len(model.names))), len(model.remembered)
        times, remembered = np.zeros(INSTANTS), np.zeros((INSTANTS, memory)) if memory else None
        _observe.ahead(lambda: (_with_finer(model), times, none, none, remembered))


def _with_finer(model: Model) -> Model:
    return dataclasses.replace(model, contact=model.contact.mapped(_finer))


def _finer(contact: Contact) -> Contact:
    if isinstance(contact.surface, Cells):
        # Twice as many along and across, of a lining that bends: errors fall by some hundred.
        return contact.on_cells(2, 2)
    return dataclasses.replace(contact, surface=IN_SPACE if contact.surface.spatial else IN_PLANE)


@compiled
def _observe(model: Model, times: Array, displacement: Array, velocity: Array, memory: Array | None) -> Observation:
    states = jax.tree.map(jnp.asarray, (times, displacement, velocity, memory))
    return jax.lax.map(lambda state: model.observe(*state), states)


class Integration(Finding):
    """Steps of the integration, and the fraction of the time that the implicit method took."""

    steps: int
    rejected_steps: int
    implicit_fraction: float


class LiningTemperature(Finding):
    """Largest rise of the lining's temperature and that at the end (K), and the fraction of friction left then."""

    largest_K: float
    end_K: float
    friction_left: float


class Sticking(Finding):
    """Fraction of the time in which the lining sticks, how often it does, and since when (s).

    A spell begins and ends with samples that stick; one of a single sample has no length. `first_s` is when the first
    begins, and `to_the_end_from_s` when one does that lasts to the end of the record; None where there is none.
    """

    share: float
    spells: int
    first_s: float | None
    to_the_end_from_s: float | None


class RunFindings(Findings):
    """What a run found, as `summary.json` holds it; where it recorded no samples, the prediction alone.

    `saturation` is None where the motion reached no contact boundary, `frequency` also where no mode's frequency can be
    followed from its onset. `motion_ratio` is the largest motion (root of the vibration energy) in the last tenth of
    the record over that in the first tenth, None without a start. `changing` says that drum speed or load change, so
    that the prediction is for one time only, `predicted_at_s`; `forced`, that a harmonic force acts; `moved_by`, what
    else pushes the shoe. `model` says what the transient includes and leaves out, and
    `held_though_they_would_move` the coordinates that the scene leaves out though they would move. `brake` is what the
    shoe does in steady sliding, None where the assembly balances all forces.
    """

    printed_by = "drumsqueal.questions.run.answer.print_findings"
    outcome: str = COMPLETE
    ending: Ending = Ending.COMPLETE
    prediction: Prediction
    predicted_at_s: float = 0.0
    growth: GrowthPhase = GrowthPhase(linear_until_s=0.0, edge_reached_s=None, modes=())
    saturation: Saturation | None = None
    frequency: FrequencyDrift | None = None
    accuracy: Accuracy | None = None
    integration: Integration | None = None
    sticking: Sticking | None = None
    lining_temperature: LiningTemperature | None = None
    motion_ratio: float | None = None
    changing: bool = False
    forced: bool = False
    moved_by: str = ""
    recorded_s: float = 0.0
    largest_rotation_rad: float = 0.0
    held_though_they_would_move: tuple[str, ...] = ()
    model: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    ramp: Ramp | None = None
    brake: ShoeAsBrake | Brakes | None = None

    @property
    def modes(self) -> tuple[ModeComparison, ...]:
        """The modes, as predicted and as the transient showed them."""
        return self.growth.modes

    @property
    def edge_reached_s(self) -> float | None:
        """When the motion reaches a contact boundary (s), lift-off or slip reversal; None where it never does."""
        return self.growth.edge_reached_s

    @property
    def sticks_at_the_end(self) -> bool:
        """Whether the whole lining sticks to the drum when the record ends."""
        return self.sticking is not None and self.sticking.to_the_end_from_s is not None

    @computed_field
    @property
    def verdict(self) -> str:
        """Prediction and transient in one sentence."""
        return state_verdict(self)


def compare(
    history: "xarray.Dataset",
    stability: Stability,
    model: Model,
    quadrature_error: float | None = None,
    held: tuple[str, ...] = (),
    integrated: Model | None = None,
) -> RunFindings:
    """Compare a history with the eigenvalues of its steady state.

    `stability` may hold more coordinates than moved. The growth phase lasts until the motion comes to 10 % of a contact
    boundary, or the lining sticks. `quadrature_error` and `held` are passed on. With the model that was integrated,
    `integrated`, what does not repeat within its record is asked for the periodic motion that it approaches.
    """
    vibration, scene = Vibration(history, stability), scene_from_dict(tomllib.loads(history.attrs["scene"]))
    time, sticks = vibration.time, history["sticking"].values > 0
    # The motion counts as linear while it stays below this fraction of the contact boundaries, contact loss at the mean
    # pressure and slip reversal.
    nonlinear = np.flatnonzero((boundary_ratio(vibration, model) >= 0.1) | sticks)
    growing = slice(0, int(nonlinear[0]) if nonlinear.size else time.size)
    moving, changing = moved_by(model, stability, float(time[-1])), changes(model, time)
    modes = measure_growth(vibration, stability, model, growing, moving, changing=changing)
    if sticks[0] and not model.forced:
        modes = tuple(m if m.measured_growth else m.model_copy(update={"note": Note.STICKING}) for m in modes)
    boundary = first_boundary_time(history, stability, model)
    saturation = drift = None
    if boundary is not None:
        again = None if integrated is None else (integrated, scene.simulate.solver, scene.simulate.tolerance)
        saturation = describe_saturation(history, vibration, stability, model, boundary, again)
    if boundary is not None and saturation is not None and not model.forced:
        drift = follow_frequency(vibration, saturated_part(time, boundary), stability, model, saturation)
    return RunFindings(
        scene=scene,
        outcome=history.attrs["outcome"],
        ending=history.attrs["ending"],
        prediction=predict(stability),
        predicted_at_s=stability.time,
        growth=GrowthPhase(linear_until_s=float(time[max(growing.stop - 1, 0)]), edge_reached_s=boundary, modes=modes),
        saturation=saturation,
        frequency=drift,
        accuracy=measure_accuracy(history, quadrature_error),
        integration=Integration(
            **{key: int(history.attrs[key]) for key in ("steps", "rejected_steps")},
            implicit_fraction=float(history["implicit"].mean()),
        ),
        sticking=find_sticking(history),
        lining_temperature=_temperature(history, model),
        motion_ratio=_motion_ratio(vibration, stability, model),
        changing=changing,
        forced=model.forced,
        moved_by=moving,
        recorded_s=float(time[-1]),
        largest_rotation_rad=vibration.largest_rotation,
        held_though_they_would_move=held,
        model=take_inventory(scene, history.attrs.get("friction_law", ""))._asdict(),
        ramp=find_ramp(history, vibration, stability, model) if changing else None,
        brake=describe_brake(scene, model, stability),
    )


def find_sticking(history: "xarray.Dataset") -> Sticking:
    """Read off the signal "sticking"."""
    sticks, time = history["sticking"].values > 0, history["time"].values
    spells = np.reshape([(time[first], time[stop - 1]) for first, stop in runs(sticks)], (-1, 2))
    length = float(time[-1] - time[0])
    return Sticking(
        share=float(np.sum(spells[:, 1] - spells[:, 0])) / length if length > 0 else 0.0,
        spells=len(spells),
        first_s=float(spells[0, 0]) if len(spells) else None,
        to_the_end_from_s=float(spells[-1, 0]) if sticks[-1] else None,
    )


def _temperature(history: "xarray.Dataset", model: Model) -> LiningTemperature | None:
    memory = memory_of(history, model.remembered)
    if memory is None:
        return None
    left = model.moment(float(history["time"].values[-1]), jnp.asarray(memory[-1])).friction_left
    rise = memory[:, 0]
    friction_left = 1.0 if left is None else float(left)
    return LiningTemperature(largest_K=float(rise.max()), end_K=float(rise[-1]), friction_left=friction_left)


def _motion_ratio(vibration: Vibration, stability: Stability, model: Model) -> float | None:
    """Largest motion in the last tenth of the record over that in the first tenth; None where nothing was started."""
    if not vibration.started:
        return None
    samples = vibration.time.size
    tenth, stiffness = max(1, samples // 10), np.asarray(model.stiffness)

    def largest(part: slice) -> float:
        energies = (
            np.max(velocity**2 @ stability.mass + np.einsum("ti,ij,tj->t", displacement, stiffness, displacement))
            for _, displacement, velocity in vibration.pieces(part)
        )
        return float(np.sqrt(max(energies)))

    first = largest(slice(0, tenth))
    return largest(slice(samples - tenth, samples)) / first if first > 0 else 1.0  # displaced, and no energy in it


LOST = math.inf  # the change of what one of two runs lacks


@dataclass(frozen=True)
class SceneAnswer:
    """Modes by label, and the motion at the end: half its peak-to-peak values (m, rad) and its main line.

    The end is the saturated part or, where that cannot be determined, the last 60 % of the record. `carriers` are the
    coordinates that hold a hundredth or more of the kinetic energy there; none at rest. `unstable` are the labels of
    the unstable modes, `rotation` (rad) is the shoe's largest. Shapes that are no modes are left out: in another scene
    those of their names are others.
    """

    modes: dict[str, Mode]
    unstable: tuple[str, ...]
    amplitude: dict[str, float]
    carriers: tuple[str, ...]
    main: SpectralLine | None
    rotation: float


@dataclass(frozen=True)
class RelativeChange:
    """Relative changes or errors, each the largest: over the modes, the carriers of the motion at the end, its line.

    None where neither run has the quantity, infinite where one of them lacks it.
    """

    growth_rate: Annotated[float | None, Column("growth\nrates", ">", "growth rates", unit="%")]
    onset_frequency: Annotated[float | None, Column("onset\nfreq.", ">", "onset frequencies", unit="%")]
    amplitude: Annotated[float | None, Column("end\nampl.", ">", "amplitude at the end", unit="%")]
    main_frequency: Annotated[float | None, Column("end\nfreq.", ">", "frequency at the end", unit="%")]


QUANTITIES = {name: each.meaning for name, each in columns_of(RelativeChange).items()}
"""The fields of a change in words."""


def answer_of(history: "xarray.Dataset", findings: RunFindings, stability: Stability, model: Model) -> SceneAnswer:
    """Read the answer off a run; `model` is the one over the coordinates of its eigenvalues."""
    vibration = Vibration(history, stability)
    boundary = findings.edge_reached_s if findings.saturation is not None else None
    part = saturated_part(vibration.time, 0.0 if boundary is None else boundary)
    motion = describe_motion(vibration, part, stability, model)
    amplitude = {name: size for name, size in motion.amplitude.items() if not is_static(name)}
    # 0.01 fraction of the kinetic energy from which the amplitude of a coordinate is compared
    carriers = tuple(name for name in amplitude if motion.kinetic_fraction.get(name, 0.0) >= 0.01)
    unstable = tuple(mode.label for mode in stability.unstable)
    modes = {mode.label: mode for mode in stability.modes}
    return SceneAnswer(modes, unstable, amplitude, carriers, motion.main, vibration.largest_rotation)


def change_of(whole: SceneAnswer, other: SceneAnswer) -> RelativeChange:
    """Change from the whole scene's answer to another one's, over the whole scene's modes and carriers.

    That of a growth rate is relative to it, or to a negligible one where it is smaller. Of a shoe that the other run
    leaves out, only what squeals by itself is missed.
    """
    frequency, growth, shoes = [], [], {shoe_of(name) for name in other.amplitude}
    for label, before in whole.modes.items():
        name = label.split()[0]
        left_out = is_elastic(name) or not _is_among(shoes, name)
        if label not in other.modes and left_out and label not in whole.unstable:
            continue  # one that the other run has no coordinate for, and that decays
        # 1e-6 damping ratio below which growth or decay is none to speak of
        after, negligible = other.modes.get(label), 1e-6 * 2 * math.pi * before.frequency_Hz
        frequency.append(LOST if after is None else after.frequency_Hz / before.frequency_Hz - 1)
        size = max(abs(before.growth_rate), negligible)
        growth.append(LOST if after is None else (after.growth_rate - before.growth_rate) / size)
    carriers = [name for name in whole.carriers if _is_among(shoes, name)]
    amplitude = [other.amplitude.get(name, 0.0) / whole.amplitude[name] - 1 for name in carriers]
    if not whole.carriers and other.carriers:
        amplitude = [LOST]  # rest against motion
    main = None if whole.main is other.main else LOST  # one of them has no line, or neither
    if whole.main is not None and not _is_among(shoes, whole.main.coordinate):
        main = None
    elif whole.main is not None and other.main is not None:
        main = other.main.frequency_Hz / whole.main.frequency_Hz - 1
    largest = [max(changes, key=abs, default=None) for changes in (growth, frequency, amplitude)]
    return RelativeChange(largest[0], largest[1], largest[2], main)


def _is_among(shoes: set[str], name: str) -> bool:
    """Whether a coordinate is of one of these shoes, or of the drum."""
    return is_of_drum(name) or shoe_of(name) in shoes
