"""The curves of Seo & Kang's Figures 4 to 11: the friction law, and eigenvalues along one number at a time.

The text names the quantity on each axis but not its range, save for the stiffness (0 to 100 %); the ranges are ours.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.physics.composition import coordinates_of, linear_coordinates
from drumsqueal.physics.model import build_model
from drumsqueal.scene import COORDINATES, Scene
from drumsqueal.solve.linear.family import EigenvalueSet, spectra_of

POINTS = 121
CONSTANT_FRICTION = 0.4  # μ of Figure 6


@dataclass(frozen=True)
class Axis:
    """What a figure varies: the number's key, from which to which fraction of the scene's value, and how it is shown.

    `factor` turns SI into the unit of the axis, 0 shows percent of the scene's value. `transients` are the fractions of
    the scene's value at which the nonlinear model is run.
    """

    figure: str
    key: str
    low: float
    high: float
    label: str
    unit: str
    factor: float
    transients: tuple[float, ...]

    def shown(self, value: NDArray[np.float64] | float, nominal: float) -> NDArray[np.float64]:
        """Values (SI) in the unit of the axis."""
        return np.asarray(value) * (self.factor or 100 / nominal)


AXES = (
    Axis("5", "contact.stiffness", 0.0, 1.0, "Contact stiffness", "%", 0, (0.25, 0.5, 0.75, 1.0)),
    Axis("6", "contact.stiffness", 0.0, 1.0, "Contact stiffness", "%", 0, (0.25, 0.5, 1.0)),
    Axis("7", "drum.speed", 0.1, 3.0, "Drum speed", "rad/s", 1, (0.3, 0.6, 1.0, 2.0, 3.0)),
    Axis("8", "contact.normal_load", 0.025, 2.0, "Normal load", "N", 1, (0.5, 1.0, 1.5, 2.0)),
    Axis("9", "shoe.arc_angle", 0.7, 1.3, "Contact arc angle", "deg", 180 / math.pi, (0.75, 0.875, 1.0, 1.125, 1.25)),
    Axis("10", "shoe.outer_radius", 0.7, 1.3, "Outer radius", "mm", 1e3, (0.75, 0.875, 1.0, 1.125, 1.25)),
    Axis("11", "shoe.width", 0.5, 1.5, "Shoe width", "%", 0, (0.6, 0.8, 1.0, 1.2, 1.4)),
)
AXIS = {axis.figure: axis for axis in AXES}


@dataclass(frozen=True)
class FrictionCurve:
    """Figure 4: drum speed Ω (rad/s), coefficient of friction μ at the slip speed RΩ, and its slope dμ/ds (s/m).

    `own_speed` is that of the scene.
    """

    speed: NDArray[np.float64]
    coefficient: NDArray[np.float64]
    slope: NDArray[np.float64]
    own_speed: float


@dataclass(frozen=True)
class Curve:
    """One figure's eigenvalues: `values` (m,) of the number in SI, the scene's own value, the spectra."""

    axis: Axis
    values: NDArray[np.float64]
    nominal: float
    spectrum: EigenvalueSet

    @property
    def shown(self) -> NDArray[np.float64]:
        """The values in the unit of the figure's axis."""
        return self.axis.shown(self.values, self.nominal)

    def rate(self, name: str) -> NDArray[np.float64]:
        """Growth rate (m,) of a coordinate's mode in 1/s."""
        return self.spectrum.of(name).real

    def frequency_Hz(self, name: str) -> NDArray[np.float64]:
        """Frequency (m,) of a coordinate's mode in Hz."""
        return self.spectrum.of(name).imag / (2 * np.pi)


def check_brake(scene: Scene) -> None:
    """Raise RequestError for a scene that the paper's figures cannot be drawn of."""
    wanted = [axis.key for axis in AXES]
    missing = next((key for key in wanted if key not in scene.numbers()), None)
    if missing is not None:
        raise RequestError(f"{missing} changes over time; the figures of the paper vary it: give it one value")
    if scene.friction is None:
        raise RequestError("the scene has no friction; the figures of the paper are about it: add the table friction")
    if coordinates_of(scene) != COORDINATES:
        raise RequestError("the shoe of the paper is rigid; leave the table shoe.elastic out")
    if linear_coordinates(scene) != COORDINATES:
        raise RequestError('the figures of the paper show all six coordinates; set simulate.coordinates to "auto"')
    if scene.drum.speed == 0 or scene.contact.stiffness == 0 or scene.contact.normal_load == 0:
        raise RequestError(
            "drum.speed, contact.stiffness and contact.normal_load must not be 0 for the paper's figures"
        )


def constant_friction(scene: Scene) -> dict[str, Any]:
    """What makes the friction of a scene that of Figure 6."""
    return {} if scene.friction is None else {"friction": scene.friction.constant(CONSTANT_FRICTION)}


def paper_curves(scene: Scene) -> dict[str, Curve]:
    """Eigenvalues along every figure's axis, by figure; one program for all with the scene's own friction."""
    own = [axis for axis in AXES if axis.figure != "6"]
    found = _curves(scene, own) | _curves(scene.with_values(constant_friction(scene)), [AXIS["6"]])
    return {axis.figure: found[axis.figure] for axis in AXES}


def _curves(scene: Scene, axes: Sequence[Axis]) -> dict[str, Curve]:
    own = {key: value for key, value in scene.numbers().items() if isinstance(value, float)}
    grids = [own[axis.key] * np.linspace(axis.low, axis.high, POINTS) for axis in axes]
    pairs = list(zip(axes, grids, strict=True))
    numbers = {
        key: np.concatenate([grid if axis.key == key else np.full(POINTS, value) for axis, grid in pairs])
        for key, value in own.items()
    }
    whole, curves = spectra_of(scene, numbers), {}
    for k, (axis, grid) in enumerate(pairs):
        rows = slice(k * POINTS, (k + 1) * POINTS)
        part = EigenvalueSet(whole.names, *(array[rows] for array in whole[1:]))  # pyright: ignore[reportArgumentType]
        curves[axis.figure] = Curve(axis, grid, own[axis.key], part)
    return curves


def friction_curve(scene: Scene) -> FrictionCurve:
    """The friction law over the drum speeds of Figure 7."""
    model, axis = build_model(scene), AXIS["7"]
    law = model.contact.friction.law  # pyright: ignore[reportOptionalMemberAccess] (checked by check_brake)
    own = abs(float(scene.numbers()["drum.speed"]))  # pyright: ignore[reportArgumentType] (checked by check_brake)
    speed = own * np.linspace(axis.low, axis.high, POINTS)
    slip = jnp.asarray(scene.shoe.outer_radius * speed)

    def at(speed: Array) -> Array:
        return jnp.asarray(law.coefficient(speed), dtype=jnp.float64)

    coefficient, slope = jax.vmap(jax.value_and_grad(at))(slip)
    return FrictionCurve(speed, np.asarray(coefficient), np.asarray(slope), own)
