"""The departure from steady sliding, and how far it has come towards the edges."""

import jax
import numpy as np
import xarray
from numpy.typing import NDArray

from drumsqueal.bodies.rigid_shoe import TX, TY, TZ, X, Y
from drumsqueal.model import Model
from drumsqueal.modes import Mode, Stability
from drumsqueal.scene import COORDINATES
from drumsqueal.signals import Spectrum, amplitude_spectrum, modal_amplitudes

FEWEST_SAMPLES = 16  # for a spectrum


class Departure:
    """A history seen from steady sliding: displacement and velocity (time, n) over the stability's coordinates."""

    def __init__(self, history: xarray.Dataset, stability: Stability) -> None:
        """Subtract the steady state."""
        index = [COORDINATES.index(name) for name in stability.coordinates]
        self.coordinates = stability.coordinates
        self.time: NDArray[np.float64] = history["time"].values
        self.displacement: NDArray[np.float64] = history["displacement"].values[:, index] - stability.steady_state
        self.velocity: NDArray[np.float64] = history["velocity"].values[:, index]

    @property
    def sample_rate(self) -> float:
        """Samples per second (Hz)."""
        return (self.time.size - 1) / float(self.time[-1] - self.time[0])

    def modal(self, mode: Mode) -> NDArray[np.complex128]:
        """Complex amplitude 2 leftᴴ y of a mode (time,); its modulus is that of the named coordinate, in m or rad."""
        states = np.hstack([self.displacement, self.velocity])
        return 2 * modal_amplitudes(mode.left[:, None], states)[:, 0]

    def wide(self) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
        """Displacement and velocity of all six coordinates, zero where left out: six arrays (time,) each."""
        zero = np.zeros(self.time.size)
        found = {name: k for k, name in enumerate(self.coordinates)}
        displacement = [self.displacement[:, found[n]] if n in found else zero for n in COORDINATES]
        return displacement, [self.velocity[:, found[n]] if n in found else zero for n in COORDINATES]

    def spectra(self, part: slice) -> dict[str, Spectrum]:
        """Displacement spectra of the coordinates that move in a part of the record (none if it is too short)."""
        displacement = self.displacement[part]
        if len(displacement) < FEWEST_SAMPLES:
            return {}
        moving = [k for k in range(len(self.coordinates)) if np.ptp(displacement[:, k]) > 0]
        return {self.coordinates[k]: amplitude_spectrum(displacement[:, k], self.sample_rate) for k in moving}


def edge_share(departure: Departure, stability: Stability, model: Model) -> NDArray[np.float64]:
    """How far the motion has come towards contact loss or slip reversal (time,): 1 is the first edge.

    The larger of k_c max|u_r − u_r*| over the smallest steady pressure and max|u̇_θ| over R|Ω|. Both maxima are bounds
    over the whole circle, so the true edge is reached at 1 or somewhat above.
    """
    shoe, c = model.shoe, float(model.shoe.centroid)
    half_width, radius = float(shoe.width) / 2, float(shoe.outer_radius)
    q, v = departure.wide()
    radial = np.hypot(q[X], q[Y] - c * q[TZ]) + half_width * np.hypot(q[TX], q[TY])
    tangential = np.abs(radius * v[TZ]) + np.hypot(v[X], v[Y] - c * v[TZ]) + half_width * np.hypot(v[TX], v[TY])
    speed = np.asarray(jax.vmap(model.contact.drum_speed.at)(departure.time))
    with np.errstate(divide="ignore", invalid="ignore"):
        loss = radial * float(model.contact.law.stiffness) / max(stability.pressure_range[0], 0.0)
        reversal = tangential / (radius * np.abs(speed))
    return np.nan_to_num(np.maximum(loss, reversal), nan=0.0, posinf=np.inf)
