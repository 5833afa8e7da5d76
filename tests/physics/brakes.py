"""Pushed shoes without the code of the package: the textbook's integrals, and a rigid shoe in NumPy."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize

from drumsqueal.findings.brake import ShoeAsBrake, describe_brake
from drumsqueal.scene import Scene, load_scene
from drumsqueal.scene.laws.constant import ConstantFriction
from drumsqueal.simulation import prepare

SCENES = Path(__file__).parents[2] / "scenarios"
GAUSS = 400  # points along the arc; contact ends between two of them, by which forces err by some 1e-5 where it does


def leading_shoe(values: dict[str, Any] | None = None) -> Scene:
    """The shipped scene with other values."""
    return load_scene(SCENES / "leading_shoe.toml").with_values(values or {})


def pin(radius: float, degrees: float, stiffness: float) -> list[dict[str, Any]]:
    """Two springs at a point of the plane z = 0, given by radius (m) and angle, and of no patch around it."""
    at = [radius * math.cos(math.radians(degrees)), radius * math.sin(math.radians(degrees)), 0.0]
    held = {"at": at, "radius": 0.0, "stiffness": stiffness}
    return [{**held, "direction": each} for each in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])]


def brake_of(scene: Scene) -> ShoeAsBrake:
    """What the package says of it."""
    prepared = prepare(scene)
    brake = describe_brake(scene, prepared.linear, prepared.stability)
    assert isinstance(brake, ShoeAsBrake)
    return brake


class Textbook(NamedTuple):
    """Torque (N m) and largest pressure (Pa) of a hinged shoe, and the coefficient of friction at which it locks."""

    torque: float
    largest: float
    locks_at: float


def friction_of(scene: Scene) -> float:
    """The coefficient."""
    assert isinstance(scene.friction, ConstantFriction)
    return scene.friction.coefficient


def speed_of(scene: Scene) -> float:
    """Of the drum (rad/s)."""
    assert isinstance(scene.drum.speed, float)
    return scene.drum.speed


def textbook(scene: Scene) -> Textbook:
    """A rigid shoe that turns about its pin, the point of the first spring: N ∝ sine of the angle from the pin.

    Moments about the pin of forces, pressure and friction balance (R. C. Juvinall and K. M. Marshek, Fundamentals of
    Machine Component Design, chapter 18; R. G. Budynas and J. K. Nisbett, Shigley's Mechanical Engineering Design,
    section 16-2).
    """
    shoe, at = scene.shoe, np.array(scene.shoe.spring[0].at)
    radius, half = shoe.outer_radius, shoe.arc_angle / 2
    nodes, weights = np.polynomial.legendre.leggauss(200)
    angle, area = half * nodes - math.atan2(at[1], at[0]), half * weights * radius * shoe.width
    away, sine = math.hypot(at[0], at[1]), np.sin(angle)
    assert np.all(sine >= -1e-12) or np.all(sine <= 1e-12), "the pin must not lie behind the lining"
    unit = np.abs(sine)
    normal = float(np.sum(area * unit * away * sine))
    drag = float(np.sum(area * unit * (radius - away * np.cos(angle)))) * np.sign(speed_of(scene))
    pushed = sum(float(np.cross(np.array(f.at) - at, f.direction)[2]) * np.asarray(f.size) for f in shoe.force)
    friction = friction_of(scene)
    largest = -pushed / (normal + friction * drag)
    torque = friction * largest * radius * float(np.sum(area * unit))
    limit = -normal / drag
    return Textbook(torque, largest * float(unit.max()), limit if limit > 0 else math.inf)


class RigidShoe:
    """Section 1 to 3 and 10 of the model in NumPy: six coordinates, constant friction, Gauss points over the lining."""

    def __init__(self, scene: Scene) -> None:
        """Take a scene whose drum turns at constant speed."""
        shoe = scene.shoe
        self.scene, self.stiffness = scene, scene.contact.stiffness or 0.0
        radius, half, width = shoe.outer_radius, shoe.arc_angle / 2, shoe.width
        inner = radius - shoe.thickness
        self.mass, self.centroid = self._inertia(shoe, radius, inner, half, width)
        along, of_along = np.polynomial.legendre.leggauss(GAUSS)
        across, of_across = np.polynomial.legendre.leggauss(8)
        theta, z = (each.ravel() for each in np.meshgrid(half * along, width / 2 * across, indexing="ij"))
        self.area = np.outer(half * of_along, width / 2 * of_across).ravel() * radius
        points = np.stack([radius * np.cos(theta), radius * np.sin(theta), z], axis=1)
        shapes = np.stack([self.shape(point) for point in points])  # points, 3, 6
        zero = np.zeros_like(theta)
        radial = np.stack([np.cos(theta), np.sin(theta), zero], axis=1)
        around = np.stack([-np.sin(theta), np.cos(theta), zero], axis=1)
        self.into, self.along = (np.einsum("pk,pkn->pn", each, shapes) for each in (radial, around))
        self.axial = shapes[:, 2]
        self.springs, self.dampers = np.zeros((6, 6)), np.zeros((6, 6))
        for spring in shoe.spring:
            lever = np.array(spring.direction) @ self.shape(np.array(spring.at))
            self.springs += spring.stiffness * np.outer(lever, lever)
            self.dampers += spring.damping * np.outer(lever, lever)
        self.force = sum(
            (np.asarray(each.size) * np.array(each.direction) @ self.shape(np.array(each.at)) for each in shoe.force),
            np.zeros(6),
        )

    @staticmethod
    def _inertia(shoe: Any, radius: float, inner: float, half: float, width: float) -> tuple[np.ndarray, float]:
        nodes, weights = np.polynomial.legendre.leggauss(40)
        r, theta, z = (each.ravel() for each in np.meshgrid(
            (radius + inner) / 2 + (radius - inner) / 2 * nodes, half * nodes, width / 2 * nodes, indexing="ij"
        ))  # fmt: skip
        w = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
        w = w * r * shoe.density * (radius - inner) / 2 * half * width / 2
        x, y, m = r * np.cos(theta), r * np.sin(theta), w.sum()
        c = float((w * x).sum() / m)
        squares = (y**2 + z**2, (x - c) ** 2 + z**2, (x - c) ** 2 + y**2)
        return np.array([m, m, m, *(float((w * each).sum()) for each in squares)]), c

    def shape(self, point: np.ndarray) -> np.ndarray:
        """Displacement of a point for 1 of each coordinate (3, 6): u + φ × (P − centre of gravity)."""
        x, y, z = point - np.array([self.centroid, 0.0, 0.0])
        turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        return np.hstack([np.eye(3), turn])

    def forces(self, q: np.ndarray) -> np.ndarray:
        """Static generalised forces (6,)."""
        pressure = np.maximum(0.0, self.stiffness * self.into @ q) * self.area
        drag = np.sign(speed_of(self.scene)) * friction_of(self.scene)
        return self.force - self.springs @ q - self.into.T @ pressure + drag * (self.along.T @ pressure)

    def steady(self, names: tuple[str, ...] = ("X", "Y", "Tz")) -> np.ndarray:
        """Steady sliding (6,) over some of the coordinates, in units by which the lining gives way alike."""
        kept = [("X", "Y", "Z", "Tx", "Ty", "Tz").index(name) for name in names]
        scale = 1 / np.sqrt(np.diag(self.springs + self.stiffness * (self.into.T * self.area) @ self.into))[kept]

        def left(x: np.ndarray) -> np.ndarray:
            q = np.zeros(6)
            q[kept] = scale * x
            return scale * self.forces(q)[kept]

        found = scipy.optimize.root(left, scale * self.force[kept], method="hybr", options={"xtol": 1e-13})
        assert np.abs(found.fun).max() < 1e-9 * np.abs(scale * self.force[kept]).max(), found.message
        q = np.zeros(6)
        q[kept] = scale * found.x
        return q

    def torque(self, q: np.ndarray) -> float:
        """Of the brake (N m)."""
        pressure = np.maximum(0.0, self.stiffness * self.into @ q) * self.area
        return float(friction_of(self.scene) * self.scene.shoe.outer_radius * pressure.sum())

    def touching(self, q: np.ndarray) -> float:
        """Fraction of the lining."""
        return float(self.area[self.into @ q >= 0].sum() / self.area.sum())

    def eigenvalues(self, q: np.ndarray) -> np.ndarray:
        """Of all six coordinates about steady sliding, (12,)."""
        touches = np.where(self.into @ q > 0, self.stiffness, 0.0) * self.area
        pressure = self.stiffness * np.maximum(0.0, self.into @ q) * self.area
        friction, speed = friction_of(self.scene), speed_of(self.scene)
        stiffness = self.springs + (self.into.T * touches) @ self.into
        stiffness -= np.sign(speed) * friction * (self.along.T * touches) @ self.into
        slip = self.scene.shoe.outer_radius * abs(speed)
        damping = self.dampers + (self.axial.T * (friction * pressure / slip)) @ self.axial
        bottom = -np.hstack([stiffness, damping]) / self.mass[:, None]
        return np.linalg.eigvals(np.vstack([np.hstack([np.zeros((6, 6)), np.eye(6)]), bottom]))
