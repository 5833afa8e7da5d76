"""Friction laws: the coefficient of friction as a function of the slip speed, built in or a user's own.

The latter is a function written for JAX, or a table.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike
from numpy.typing import NDArray

from drumsqueal.interpreter import Interpreted
from drumsqueal.precision import real
from drumsqueal.scene.laws import LAWS
from drumsqueal.scene.tables import FrictionTable
from drumsqueal.shown import short


@runtime_checkable
class FrictionLaw(Protocol):
    """What friction asks of a law; one with parameters of its own is an `equinox.Module` with this method.

    A law that holds what rests with more than it drags what slides has a method `at_rest()`, the largest μ at rest;
    without one that is μ(0). One that knows how steep it is has a method `breakpoints()`, see `breakpoints`.
    """

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s), of any shape; at 0 its limit at slow slip."""
        ...


def static_coefficient(law: FrictionLaw) -> Array:
    """Largest μ where nothing slips: the law's own, or what its μ(s) goes to at slow slip."""
    at_rest = getattr(law, "at_rest", None)
    return law.coefficient(jnp.zeros(())) if at_rest is None else at_rest()


# Slip speeds between which any law is resolved that varies on no scale shorter than a hundredth of its slip speed, at
# slip speeds from 1e-5 to 100 m/s: for a law of which nothing is known.
ANY_LAW = 1e-5 * 4.0 ** np.arange(12)


def breakpoints(law: FrictionLaw) -> Array:
    """Rising slip speeds (K,) in m/s that cut μ(s) into stretches, each resolved by a quadrature of sixteen nodes.

    Contact integrals are cut where the slip speed is one of them, and so follow any law, however steep it is. They lie
    where μ has a kink or a jump, and are close together where it is steep; μ that is the same everywhere has none.
    """
    own = getattr(law, "breakpoints", None)
    return jnp.asarray(ANY_LAW if own is None else own())


def kinks(law: FrictionLaw) -> Array:
    """Those of the breakpoints (m/s) at which a quadrature must be cut that is graded towards where the slip vanishes.

    None of a law that varies on no scale shorter than its slip speed, however steep.
    """
    own = getattr(law, "kinks", None)
    return jnp.zeros(0) if own is None else jnp.asarray(own())


@Interpreted
def coefficient_at(law: FrictionLaw, slip_speed: Array) -> Array:
    """μ at slip speeds s ≥ 0 (m/s), for what is outside of any program."""
    return jnp.asarray(law.coefficient(slip_speed))


class SceneLaw(eqx.Module):
    """A law of `scene/laws` with its numbers as array leaves, so that none of them compiles anything anew."""

    law: type[FrictionTable] = eqx.field(static=True)
    numbers: dict[str, Array]

    def __repr__(self) -> str:
        """Name and numbers: ExponentialLaw(static=1, kinetic=0.5, decay=2 s/m)."""
        keys, usual = self.law.number_keys(), self.law.usual
        numbers = ", ".join(f"{key}={short(self.numbers[key], usual[key].unit)}" for key in keys)
        return f"{self.law.__name__.removesuffix('Friction')}Law({numbers})"

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return self.law.mu(slip_speed, jnp, **self.numbers)

    def breakpoints(self) -> Array:
        """The law's own."""
        return self.law.cuts(jnp, **self.numbers)[0]

    def kinks(self) -> Array:
        """Those of them where it has a kink or is steep."""
        return self.law.cuts(jnp, **self.numbers)[1]


def friction_law(law: str, /, **numbers: ArrayLike) -> SceneLaw:
    """A law by its name in a scene, with its numbers by key in SI: `friction_law("constant", coefficient=0.4)`.

    The numbers may be traced. Raises KeyError for a law that is none and TypeError for numbers that are not its own.

    ```pycon
    >>> law = drumsqueal.friction_law("exponential", static=0.5, kinetic=0.3, decay=2.0)
    >>> round(float(law.coefficient(1.0)), 4)
    0.3271
    ```
    """
    kind = LAWS[law]
    keys = kind.number_keys()
    if not set(numbers) <= set(keys) or set(keys) - set(numbers) - set(kind.defaults()):
        raise TypeError(f'the law "{law}" has the numbers {", ".join(keys)}, got {", ".join(numbers) or "none"}')
    given = {key: real(value) for key, value in (kind.defaults() | numbers).items()}
    return SceneLaw(kind, kind.prepared(jnp, **given))


def ConstantLaw(value: ArrayLike) -> SceneLaw:
    """The same μ at every slip speed."""
    return friction_law("constant", coefficient=value)


def ExponentialLaw(static: ArrayLike, kinetic: ArrayLike, decay: ArrayLike) -> SceneLaw:
    """μ(s) = μ_k + (μ_s − μ_k) exp(−α s); α in s/m."""
    return friction_law("exponential", static=static, kinetic=kinetic, decay=decay)


class StepLaw(eqx.Module):
    """The same μ_k at every slip speed, and up to μ_s ≥ μ_k at rest: Coulomb's law with its step at zero."""

    static: Array = eqx.field(converter=real)
    kinetic: Array = eqx.field(converter=real)

    def __repr__(self) -> str:
        """Its numbers."""
        return f"StepLaw(static={short(self.static)}, kinetic={short(self.kinetic)})"

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        del slip_speed
        return self.kinetic

    def at_rest(self) -> Array:
        """The largest μ where nothing slips."""
        return self.static

    def breakpoints(self) -> ArrayLike:
        """None: what slides knows one μ."""
        return np.zeros(0)


# A stretch of a law is resolved where polynomials of this degree in x give μ(low + length x²) and μ(high − length x²)
# on [0, 1], as where the slip speed has an extremum, to a fraction of its largest value. Sixteen Gauss nodes are exact
# for that degree. The fraction is the finest that MOST_STRETCHES reach.
DEGREE, MOST_STRETCHES = 31, 48
SLOWEST, FASTEST = 1e-6, 1e3  # m/s: below the one nothing is looked for, beyond the other μ counts as resolved


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

    def __repr__(self) -> str:
        """How many points it has, and how far apart."""
        return f"TabulatedLaw({self.coefficients.shape[-1] + 1} points, step={short(self.step, 'm/s')})"

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


class MeasuredLaw(eqx.Module):
    """A law together with the slip speeds (m/s) that cut it, found by sampling it, and whether it is gradual.

    It is where it varies on no scale shorter than its slip speed.
    """

    law: FrictionLaw
    speeds: Array = eqx.field(converter=real)
    gradual: bool = eqx.field(static=True)

    def __repr__(self) -> str:
        """That of the law."""
        return repr(self.law)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return self.law.coefficient(slip_speed)

    def at_rest(self) -> Array:
        """The largest μ where nothing slips."""
        return static_coefficient(self.law)

    def breakpoints(self) -> Array:
        """Those found."""
        return self.speeds

    def kinks(self) -> Array:
        """All of them, or none of a gradual law."""
        return jnp.zeros(0) if self.gradual else self.speeds


def is_gradual(law: FrictionLaw) -> bool:
    """Whether a law varies on no scale shorter than its slip speed: it is resolved from one of ANY_LAW to the next."""
    coefficient = eqx.filter_jit(law.coefficient)
    bounds = pairwise([0.0, *ANY_LAW])
    # 1e-6 of the largest μ: what is resolved so well from one of ANY_LAW to the next needs no cuts in space
    return all(_is_resolved(coefficient, low, high - low, 1e-6) for low, high in bounds)


def find_breakpoints(law: FrictionLaw) -> NDArray[np.float64]:
    """Find slip speeds (m/s) between which μ(s) is resolved, see `breakpoints`, from rest on one by one.

    Where MOST_STRETCHES of them do not resolve the law to any of the fractions they are the first of the coarsest.
    """
    coefficient = eqx.filter_jit(law.coefficient)
    found: list[float] = []
    for fraction in 10.0 ** np.arange(-12, -3):
        found = [0.0]
        while found[-1] < FASTEST and len(found) <= MOST_STRETCHES:
            found.append(_end_of_stretch(coefficient, found[-1], fraction))
        if found[-1] >= FASTEST:
            break
    return np.array(found[1:-1])


def _end_of_stretch(coefficient: Callable[[Array], Array], low: float, fraction: float) -> float:
    """The largest slip speed up to which the law is resolved from `low` on, to round-off: it may be a kink."""
    good, bad = 0.0, max(SLOWEST, 1e3 * np.spacing(low))
    while _is_resolved(coefficient, low, bad, fraction):
        if low + bad >= FASTEST:
            return FASTEST
        good, bad = bad, min(2 * bad, FASTEST - low)
    while bad - good > 4 * np.spacing(low + bad):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if _is_resolved(coefficient, low, middle, fraction) else (good, middle)
    return low + bad


def _is_resolved(coefficient: Callable[[Array], Array], low: float, length: float, fraction: float) -> bool:
    speeds = low + length * np.stack([_PLACES**2, 1 - _PLACES**2])
    values = np.broadcast_to(np.asarray(coefficient(jnp.asarray(speeds))), speeds.shape)
    if not np.isfinite(values).all():
        return False
    apart = values[:, : DEGREE + 1] @ _FIT.T - values[:, DEGREE + 1 :]
    return bool(np.max(np.abs(apart)) <= fraction * np.max(np.abs(values)))


def _fit() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places on [0, 1], Chebyshev's first and then those to look at, and what gives the ones from the others."""
    nodes, looked_at = np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE), np.linspace(-1.0, 1.0, 203)[1:-1]
    basis = np.polynomial.chebyshev.chebvander
    fit = basis(looked_at, DEGREE) @ np.linalg.inv(basis(nodes, DEGREE))
    return (1 + np.concatenate([nodes, looked_at])) / 2, fit


_PLACES, _FIT = _fit()


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
    slow = _at_slow_slip(found)
    if slow is not None and not slow >= 0:
        wanted = "must be finite" if not np.isfinite(slow) else "must not be negative"
        raise ValueError(f"a friction coefficient {wanted}; this law gives {slow:g} at slow slip")
    return found


def _at_slow_slip(law: FrictionLaw) -> float | None:
    """μ at slow slip; None of a law that depends on traced values (its parameters, or what its function encloses)."""
    with jax.ensure_compile_time_eval():
        slow = law.coefficient(jnp.zeros(()))
    return None if isinstance(slow, Tracer) else float(slow)


def with_breakpoints(law: FrictionLaw) -> FrictionLaw:
    """The law with the slip speeds that cut it, found by sampling unless it has them or depends on traced values."""
    if hasattr(law, "breakpoints") or _at_slow_slip(law) is None:
        return law
    with jax.ensure_compile_time_eval():
        return MeasuredLaw(law, find_breakpoints(law), is_gradual(law))
