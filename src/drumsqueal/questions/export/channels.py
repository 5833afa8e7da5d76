"""What goes out, whatever the format: signals side by side, sampled evenly, with names, units and origin."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.scene import Scene

if TYPE_CHECKING:
    from drumsqueal.solve.linear.modes import Stability

DISPLACEMENT, VELOCITY, ACCELERATION, FLAG = "displacement", "velocity", "acceleration", "flag"
# Lengths and forces multiplied in the units of a signal that is no motion: what formats with codes of units ask for.
NO_UNITS = (0, 0)
UNKNOWN = "eigenvalues_unknown"


class Channel(NamedTuple):
    """One signal (n,): `quantity` is what it measures, in `units`.

    `short_name` has ten characters at most. `point` numbers a point of the shoe; `direction` is 1 to 6 for x, y, z and
    the rotations about them at the centre of gravity, and 1 and 2 for radially and along the drum at the lining. Both
    are 0 for what has none. `length_force` are the powers of length and force in the units (time aside).
    """

    name: str
    short_name: str
    quantity: str
    units: str
    meaning: str
    values: NDArray[np.float64]
    point: int = 0
    direction: int = 0
    length_force: tuple[int, int] = NO_UNITS


class Channels(NamedTuple):
    """Signals that were sampled together at start + k / sample_rate (s, Hz), and what is to be known of them.

    `texts` has title, scene (TOML), versions, outcome, source and more by name. `stability` is what the eigenvalues
    say, None where they were not asked for or, as `texts` then says under "eigenvalues_unknown", are not to be had.
    `slow` is how many times slower than it was a sound is to be played.
    """

    start: float
    sample_rate: float
    channels: tuple[Channel, ...]
    texts: dict[str, str]
    scene: Scene
    stability: "Stability | None" = None
    slow: float = 1.0

    @property
    def time(self) -> NDArray[np.float64]:
        """Times of the samples (s), shape (n,)."""
        return self.start + np.arange(self.channels[0].values.size) / self.sample_rate

    @property
    def prediction(self) -> tuple[str, ...]:
        """A line for each oscillating mode of steady sliding: name, frequency, growth rate; or why there is none."""
        if self.stability is None:
            return (f"unknown: {self.texts[UNKNOWN]}",) if UNKNOWN in self.texts else ()
        return tuple(
            f"{mode.label} {mode.frequency_Hz:.6g} Hz {mode.growth_rate:+.6g}/s" for mode in self.stability.modes
        )
