"""What goes out, whatever the format: signals side by side, sampled evenly, with names, units and origin."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

CENTRE_OF_GRAVITY, MIDDLE, LEADING_END, TRAILING_END = 1, 2, 3, 4
"""Numbers of the points of the shoe; 0 is no point, for what belongs to the whole lining."""
DISPLACEMENT, VELOCITY, ACCELERATION, FLAG = "displacement", "velocity", "acceleration", "flag"
# Lengths and forces multiplied in the units of a signal that is no motion: what formats with codes of units ask for.
NO_UNITS = (0, 0)


class Channel(NamedTuple):
    """One signal (n,): `quantity` is what it measures, in `units`.

    `short_name` has ten characters at most. `point` numbers a point of the shoe and `direction` is 1 to 6 for x, y, z
    and the rotations about them; both are 0 for what has none. `length_force` are the powers of length and force in
    the units (time aside).
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

    `texts` has title, scene (TOML), versions, outcome, source and more by name; `prediction` a line for each mode.
    `slow` is how many times slower than it was a sound is to be played.
    """

    start: float
    sample_rate: float
    channels: tuple[Channel, ...]
    texts: dict[str, str]
    prediction: tuple[str, ...] = ()
    slow: float = 1.0

    @property
    def time(self) -> NDArray[np.float64]:
        """Times of the samples (s), shape (n,)."""
        return self.start + np.arange(self.channels[0].values.size) / self.sample_rate
