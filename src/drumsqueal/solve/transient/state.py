"""What a transient carries from chunk to chunk, and a chunk in time."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

CHUNK_SAMPLES = 500  # samples a chunk: some 50 ms of computing in the plane, so that Ctrl-C and the bar respond


class State(NamedTuple):
    """Displacement from steady sliding (n,), velocity (n,) and energy fed in so far beyond the stored one (J).

    `memory` is what effects remember (m,), None where none does. The solver sees it as one flat array, which takes less
    than half the time of a tree of three.
    """

    vibration: Array
    velocity: Array
    work: Array
    memory: Array | None = None

    def flat(self) -> Array:
        """One array (2n + m + 1,), the work last."""
        memory = () if self.memory is None else (self.memory,)
        return jnp.concatenate([self.vibration, self.velocity, *memory, self.work[None]])

    @staticmethod
    def split(flat: Any, remembered: int = 0) -> "State":
        """From an array (..., 2n + m + 1) with m numbers that effects remember."""
        n = (flat.shape[-1] - remembered) // 2
        memory = flat[..., 2 * n : -1] if remembered else None
        return State(flat[..., :n], flat[..., n : 2 * n], flat[..., -1], memory)


class Span(NamedTuple):
    """One chunk in time: its start (s), the interval between samples (s), and how many there are after the first.

    It is entered `offset` and left `until` (s) after its start, if that is before its end. What is prescribed over time
    is taken from within `after` and `before` (s of the transient): where it jumps, from this side of the jump.
    """

    start: Any  # numbers outside a compiled call, arrays within
    interval: Any
    samples: Any
    offset: Any = np.float64(0)
    until: Any = np.float64(np.inf)
    after: Any = np.float64(-np.inf)
    before: Any = np.float64(np.inf)

    @property
    def length(self) -> Any:
        """From its start to its end (s)."""
        return self.samples * self.interval

    @property
    def grid(self) -> Array:
        """Its samples (s after its start), CHUNK_SAMPLES + 1 of them: those beyond its last one never come."""
        numbers = jnp.arange(CHUNK_SAMPLES + 1)
        return jnp.where(numbers <= self.samples, numbers * jnp.asarray(self.interval), jnp.inf)

    def inside(self, time: Any) -> Any:
        """A time (s of the transient) at which to ask for what is prescribed."""
        jax_or_numpy = jnp if isinstance(time, Array) else np
        return jax_or_numpy.clip(time, self.after, self.before)
