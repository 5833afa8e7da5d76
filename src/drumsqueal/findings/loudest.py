"""Which of several shoes comes to move most: what is heard, compared and drawn of a record without being asked."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.bodies.brake import placed

LATE = 0.6  # of the record, by which a start that decays has lost most of its motion


def loudest_shoe(body: Any, names: Sequence[str], velocity: NDArray[np.float64]) -> int:
    """The number of the shoe whose lining's middle moves most along the drum in the last part of a record.

    By the mean square of its velocity, of velocities (time, n) of named coordinates.
    """
    late = dict(zip(names, velocity[round((1 - LATE) * len(velocity)) :].T, strict=True))
    along = (each.shoe.displacement(each.share.own(late), 0.0)[1] for each in placed(body))
    return int(np.argmax([np.mean(np.square(each)) for each in along]))
