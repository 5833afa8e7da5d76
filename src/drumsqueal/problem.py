"""A scene or a model as a problem of diffrax: the keywords of `diffrax.diffeqsolve`, but for the solver."""

from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.flatten_util import ravel_pytree

from drumsqueal.errors import RequestError
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.composition import compose
from drumsqueal.physics.elasticity import numbers_of
from drumsqueal.physics.model import Model, Numbers, assemble, build_model
from drumsqueal.physics.shoe_building import Composition
from drumsqueal.precision import real
from drumsqueal.programs import Program
from drumsqueal.scene import Scene
from drumsqueal.solve.linear.modes import while_sliding
from drumsqueal.solve.linear.steady import steady_sliding
from drumsqueal.solve.motion import Start, check_samples, start_of
from drumsqueal.solve.transient.runge_kutta import DEFAULT, DIFFRAX_STEPS
from drumsqueal.solve.transient.segment import first_step
from drumsqueal.solve.transient.state import QUIET, MotionScale, Span, State, local_tolerance, resolution
from drumsqueal.solve.transient.stick_slip import STICKING_WHOLE, check_slips
from drumsqueal.solve.transient.sticking import can_stick, slip
from drumsqueal.solve.transient.through_diffrax import controller

Motion = tuple[Array, ...]
"""Displacement from q = 0 (n,), velocity (n,) and, where effects remember, what they do (m,)."""


def diffrax_problem(
    of: Scene | Model,
    start: Start | None = None,
    duration: float | None = None,
    *,
    sample_rate: float | None = None,
    tolerance: float | None = None,
    numbers: Numbers | None = None,
) -> dict[str, Any]:
    """The equation of motion as the keywords of `diffrax.diffeqsolve`, but `solver`; each may be replaced.

    M q̈ = Q(t, q, q̇, w; args) and ẇ = W(t, q, q̇, w; args) as dy/dt of y = (q, q̇) or (q, q̇, w), a tuple of float64
    arrays. q (n,) are displacements in m and rad (of elastic modes m √kg) in the order of `build_model(scene).names`,
    measured from q = 0 as in history.nc: where springs are unloaded, or with the steady state "uniform-pressure"
    steady sliding itself. q̇ (n,) is in their units per second. w (m,) is what effects remember, now the temperature of
    the lining (K), and is there only where one does. t is in s.

    Parameters
    ----------
    of
        A scene, or a model, of an oscillator of one's own too. Of a model what a scene has to say is given here.
    start
        `displacement` from steady sliding and `velocity`, by names or as (n,), as in `integrate`; of a scene its own.
    duration, sample_rate
        Where it ends (s), and how often it is saved (Hz); of a scene its own.
    tolerance
        Of the trajectory, as in a scene, by default its own or 1e-6: a step may err by a hundredth of that, relative
        to the amplitudes that the energy of vibration gives each coordinate.
    numbers
        Replaces a scene's numbers, as in `build_model`, traced ones too: steady sliding in `y0` then follows them.

    Returns
    -------
    dict
        `terms`, `t0`, `t1`, `dt0`, `y0`, `args`, `saveat`, `stepsize_controller` and `max_steps`. `args` are the
        scene's numbers by dotted key in SI, from which the model is put together at each evaluation; of a model they
        are the model. Both carry gradients. With `build_model(scene)` for `of` it is put together once.

    Raises
    ------
    RequestError
        Where the lining sticks as a whole: for a drum at rest, or a start without slip. Friction is set-valued there.
        Not where numbers are traced: such a problem ends at its `max_steps`.
    TypeError
        For what is neither a scene nor a model, and where JAX was switched to float32.
    ValueError
        For a wrong start, no sample beyond it, a tolerance that is not positive, a model without duration and sample
        rate, or numbers for a model.

    Examples
    --------
    ```pycon
    >>> import diffrax
    >>> scene = drumsqueal.load_scene("nominal", ["simulate.duration=2 ms"])
    >>> problem = drumsqueal.diffrax_problem(scene)
    >>> solution = diffrax.diffeqsolve(solver=diffrax.Tsit5(), **problem)
    >>> displacement, velocity = solution.ys
    >>> displacement.shape
    (101, 3)
    >>> diffrax.diffeqsolve(solver=diffrax.Tsit5(), **problem | {"saveat": diffrax.SaveAt(t1=True)}).ts
    Array([0.002], dtype=float64)

    ```
    """
    if isinstance(of, Scene):
        simulate, composition, given = of.simulate, compose(of), numbers_of(of) | dict(numbers or {})
        args: Any = {key: real(number) for key, number in given.items()}
        keys = frozenset(given)
        model = build_model(of, numbers)
        start = {key: value for key, value in of.start if value} if start is None else start
        duration = simulate.duration if duration is None else duration
        sample_rate = simulate.sample_rate if sample_rate is None else sample_rate
        tolerance = simulate.tolerance if tolerance is None else tolerance
    elif not isinstance(of, Model):
        raise TypeError(f"a scene or a model is wanted, got {of!r}; load_scene reads a scene")
    elif duration is None or sample_rate is None:
        raise ValueError("a model has no duration and sample_rate of its own: give both")
    elif numbers is not None:
        raise ValueError("numbers belong to a scene; of a model give one that is built from them")
    else:
        model, composition, args, keys = of, None, of, frozenset()
    tolerance = 1e-6 if tolerance is None else tolerance
    check_samples(duration, sample_rate)
    if not tolerance > 0:
        raise ValueError(f"tolerance must be positive, got {tolerance}")
    local = local_tolerance(tolerance, DEFAULT)
    displacement, velocity = map(real, start_of(model.names, start or {}))
    y0: Any = (_steady(model, duration, velocity) + displacement, velocity, model.first_memory)
    size, dt0 = _measured(model, y0[0] - displacement, local)
    times = np.arange(round(duration * sample_rate) + 1) / sample_rate
    return {
        "terms": diffrax.ODETerm(_Rates(composition, keys)),
        "t0": 0.0,
        "t1": float(times[-1]),
        "dt0": dt0,
        "y0": tuple(part for part in y0 if part is not None),
        "args": args,
        "saveat": diffrax.SaveAt(ts=real(times)),
        "stepsize_controller": controller(local, QUIET * local, _largest, size, model.operation.corners),
        "max_steps": DIFFRAX_STEPS * len(times),
    }


class _Rates(eqx.Module):
    """dy/dt; without a composition of a model."""

    composition: Composition | None = eqx.field(static=True)
    keys: frozenset[str] = eqx.field(static=True)

    def __call__(self, t: Any, y: Motion, args: Any) -> Motion:
        model: Model = args
        if self.composition is not None:
            if wrong := args.keys() ^ self.keys:
                raise RequestError(f"args: {sorted(wrong)[0]} is missing, or is no number of this scene")
            model = assemble(self.composition, {key: real(number) for key, number in args.items()})
        q, v, *memory = y
        force, _, changes = model.rates(t, q, v, *memory)
        return (v, force / model.mass, *(() if changes is None else (changes,)))


class _Amplitudes(eqx.Module):
    """What the present vibration energy gives each part of a state, for errors to be measured against."""

    model: Model
    measure: MotionScale
    steady: Array

    def __call__(self, y: Motion) -> Motion:
        q, v, *memory = y
        state = State(q - self.steady, v, jnp.zeros(()), *memory)
        vibration, velocity, _, remembered = self.measure.amplitudes(self.model, state)
        # Derivatives are not taken of the choice of steps.
        return jax.lax.stop_gradient((vibration, velocity, *(() if remembered is None else (remembered,))))


@Program
def _measured(model: Model, steady: Array, local: Array) -> tuple[_Amplitudes, Array]:
    """What errors are measured against, and the first step (s)."""
    span = Span(np.float64(0), np.float64(0), np.int64(0))
    found = _Amplitudes(model, resolution(model, span, local), steady), first_step(model)
    return jax.lax.stop_gradient(found)


def _steady(model: Model, duration: float, velocity: Array) -> Array:
    """Steady sliding (n,) about which it starts, as in a run. Raises RequestError where the lining sticks."""
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(model)):
        return steady_sliding(model)
    check_slips(model, duration)
    if can_stick(model, at_rest=False) and not float(_slip(model, velocity)) > 0:
        raise RequestError(f"it starts without slip: {STICKING_WHOLE}")
    return real(np.zeros(len(model.names))) if while_sliding(model)[1] > 0 else steady_sliding(model)


@Interpreted
def _slip(model: Model, velocity: Array) -> Array:
    return slip(model, 0.0, velocity)


def _largest(scaled_error: Motion) -> Array:
    return jnp.max(jnp.abs(ravel_pytree(scaled_error)[0]))
