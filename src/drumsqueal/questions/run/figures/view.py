"""What all figures look at: the result of a run as displacement from steady sliding, its modes and its phases."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drumsqueal.coordinates import MOST_SHOWN, is_elastic, largest_of
from drumsqueal.errors import Ending
from drumsqueal.findings.growth_phase import UNEXCITED_FRACTION
from drumsqueal.findings.vibration import FEWEST_FOR_SPECTRUM, Vibration, characteristic_lengths, loudest_shoe
from drumsqueal.physics.bodies.brake import Share
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.model import Model
from drumsqueal.simulation import Result
from drumsqueal.solve.linear.modes import Mode

MICRO = 1e6
REST = 1e-15  # m or rad; what moves less is round-off


class View:
    """A result prepared for drawing; `model` is the one over the coordinates that moved."""

    def __init__(self, result: Result, model: Model) -> None:
        """Name what is drawn from: times of the samples (s), outer radius (m), saturated motion if any, and title."""
        self.result, self.model, self.findings = result, model, result.findings
        self.vibration = Vibration(result.history, result.stability)
        self.time, self.radius = self.vibration.time, float(model.contact.radius)
        self.saturation = self.findings.saturation
        complete = self.findings.ending is Ending.COMPLETE
        self.title = result.scene.title if complete else f"{result.scene.title} (incomplete run)".strip()

    @cached_property
    def readable(self) -> bool:
        """Whether there are samples enough, and motion, to draw a history."""
        return self.time.size >= FEWEST_FOR_SPECTRUM and bool(np.any(np.ptp(self.vibration.extremes(), axis=0) > REST))

    @property
    def saturated(self) -> slice:
        """The samples of the saturated part, the whole record where nothing saturated."""
        start = 0.0 if self.saturation is None else self.saturation.start_s
        return slice(int(np.searchsorted(self.time, start)), self.time.size)

    def amplitude(self, mode: Mode, part: slice = slice(None)) -> NDArray[np.float64]:
        """Amplitude (time,) of a mode in a part of the record (µm, rotations times the outer radius), computed anew."""
        return np.abs(self.vibration.modal(mode, part)) * self.micrometres(mode.name)

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Of the modes that take part in the motion as many as figures show: those that grow, and that move most."""
        shown, _ = largest_of({mode.label: np.inf if mode.unstable else size for mode, size in self._sizes})
        return tuple(mode for mode in self.moving if mode.label in shown)

    @property
    def moving(self) -> tuple[Mode, ...]:
        """The modes that take part in the motion, by rising frequency."""
        return tuple(mode for mode, _ in self._sizes)

    @cached_property
    def _sizes(self) -> list[tuple[Mode, float]]:
        least = UNEXCITED_FRACTION * self.vibration.largest().max()
        able = [mode for mode in self.result.stability.modes if mode.name in self.model.names]
        sizes = [(mode, float(self.amplitude(mode).max())) for mode in able]
        return [(mode, size) for mode, size in sizes if size > least * self.micrometres(mode.name)]

    @cached_property
    def shown_coordinates(self) -> tuple[str, ...]:
        """Those that move the lining most, as many as figures show: the same for all parts of the record."""
        names = self.vibration.coordinates
        if len(names) <= MOST_SHOWN:
            return names
        sizes = np.ptp(self.vibration.extremes(), axis=0) * [self.micrometres(name) for name in names]
        return largest_of(dict(zip(names, sizes.tolist(), strict=True)))[0]

    @property
    def measure(self) -> str:
        """What displacements are drawn in."""
        elastic = any(is_elastic(name) for name in self.vibration.coordinates)
        return "µm at the lining" if elastic else "µm; rotations times radius"

    def micrometres(self, coordinate: str) -> float:
        """Factor from a coordinate's unit to µm at the drum's surface."""
        return MICRO * self._characteristic_lengths[coordinate]

    @cached_property
    def _characteristic_lengths(self) -> dict[str, float]:
        names = self.vibration.coordinates
        return dict(zip(names, characteristic_lengths(names, self.model.body).tolist(), strict=True))

    @cached_property
    def main_frequency(self) -> float | None:
        """Frequency (Hz) of the strongest saturated line, or of the mode that is strongest at the end of the record."""
        if self.saturation is not None and self.saturation.main is not None:
            return self.saturation.main.frequency_Hz
        last = max(1, self.time.size // 10)
        mass = dict(zip(self.result.stability.coordinates, self.result.stability.mass, strict=True))

        def energy(mode: Mode) -> float:
            size = np.abs(self.vibration.modal(mode, slice(self.time.size - last, None))).mean()
            return mass[mode.name] * float(mode.frequency_Hz * size) ** 2

        strongest = max(self.modes, key=energy, default=None)
        return None if strongest is None else strongest.frequency_Hz

    @cached_property
    def loudest(self) -> tuple[Share, Contact]:
        """The lining of the `loudest_shoe`, and whose it is."""
        linings, vibration = [(mine, side.lining) for mine, side in self.model.sides], self.vibration
        if len(linings) == 1:
            return linings[0]
        return linings[loudest_shoe(self.model.body, vibration.coordinates, vibration.velocity)]

    def surface_motion(self, part: slice) -> NDArray[np.float64]:
        """u_θ (m) and its rate (m/s) at the middle of the lining, θ = z = 0, for a part of the record (time, 2).

        Of several linings, of the one that moves most.
        """
        mine, contact = self.loudest
        along = []
        for kind in ("displacement", "velocity"):
            q = dict(zip(self.vibration.coordinates, self.vibration.read(kind, part).T, strict=True))
            along.append(np.broadcast_to(contact.body.over_drum(mine.own(q), 0.0)[1], self.time[part].shape))
        return np.stack(along, axis=1)

    @property
    def middle(self) -> str:
        """Where that is, in words."""
        name = self.loudest[0].name
        return f"middle of the lining of {name}" if name else "middle of the lining"
