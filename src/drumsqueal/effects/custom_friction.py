"""A user's own friction law: a function of the slip speed, written for JAX or tabulated."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.interpolate
from jax import Array
from jax.core import Tracer

from drumsqueal.effects.friction_law import FrictionLaw
from drumsqueal.precision import real


class FunctionLaw(eqx.Module):
    """μ(s) from a function that JAX can trace: written with jax.numpy, without `if` on values."""

    function: Callable[[Array], Array] = eqx.field(static=True)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return self.function(slip_speed)


class TabulatedLaw(eqx.Module):
    """μ(s) from a table at equal steps of the slip speed: a cubic spline, held beyond the last point.

    `coefficients` (4, intervals) belong to rising powers of the distance from the left point; `step` in m/s.
    """

    coefficients: Array = eqx.field(converter=real)
    step: Array = eqx.field(converter=real)

    @staticmethod
    def from_function(function: Callable[[float], float], largest_speed: float, points: int = 2001) -> "TabulatedLaw":
        """Tabulate any Python function of the slip speed (m/s), from 0 to the largest speed.

        The error falls like the fourth power of the step, where the function is smooth. Raises ValueError for fewer
        than 4 points, a largest speed that is not positive, and values that are not finite.
        """
        if points < 4 or not largest_speed > 0:
            raise ValueError(f"at least 4 points up to a positive speed are needed, got {points} up to {largest_speed}")
        speeds = np.linspace(0.0, largest_speed, points)
        values = np.array([float(function(float(speed))) for speed in speeds])
        if not np.all(np.isfinite(values)):
            bad = speeds[np.argmin(np.isfinite(values))]
            raise ValueError(f"the friction law is not finite at a slip speed of {bad:g} m/s")
        spline = scipy.interpolate.CubicSpline(speeds, values)
        return TabulatedLaw(spline.c[::-1], largest_speed / (points - 1))

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        intervals = self.coefficients.shape[1]
        position = jnp.minimum(slip_speed / self.step, intervals)
        index = jnp.clip(jnp.floor(position).astype(int), 0, intervals - 1)
        distance = (position - index) * self.step
        c0, c1, c2, c3 = self.coefficients[:, index]
        return c0 + distance * (c1 + distance * (c2 + distance * c3))


def as_law(law: FrictionLaw | Callable[[Array], Array]) -> FrictionLaw:
    """Return a law from a law or from a function of the slip speed.

    Raises TypeError for a function that JAX cannot trace, or that does not give one μ for every slip speed, and
    ValueError for one that is negative at slow slip: it would push what slides.
    """
    found = law if isinstance(law, FrictionLaw) else FunctionLaw(law)
    try:
        shape = jax.eval_shape(found.coefficient, jax.ShapeDtypeStruct((2, 3), jnp.float64))
    except Exception as error:  # whatever a function that was not written for JAX raises
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise TypeError(
            f"this friction law cannot be traced by JAX ({reason}); write it with jax.numpy and jnp.where, or tabulate "
            "it: TabulatedLaw.from_function(law, largest_speed=...)"
        ) from None
    if getattr(shape, "shape", None) not in ((2, 3), ()):
        raise TypeError(f"a friction law gives one coefficient for every slip speed; for shape (2, 3) it gave {shape}")
    slow = found.coefficient(jnp.zeros(()))
    if not isinstance(slow, Tracer) and np.any(np.asarray(slow) < 0):
        raise ValueError(f"a friction coefficient must not be negative; this law gives {float(slow):g} at slow slip")
    return found
