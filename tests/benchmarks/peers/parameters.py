"""The numbers of a scene in one flat array, which NumPy, numba and a C callback can share.

State in SI: (qX, qY, qTz, vX, vY, vTz), departure from steady sliding. The solvers see it divided by SCALE, so that
one absolute tolerance serves displacements and velocities, translation and rotation alike.
"""

import numpy as np

from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.model import build_model
from drumsqueal.scene import Scene

RADIUS, WIDTH, HALF_ANGLE, CENTROID, PRELOAD, STIFFNESS = range(6)  # m, m, rad, m, Pa, N/m³
KINETIC, DIFFERENCE, DECAY, DRUM = 6, 7, 8, 9  # μ_k, μ_s − μ_k, α (s/m), surface speed RΩ (m/s)
SUPPORT, TORSION = 10, 11  # k1 + k2 (N/m), (k1 + k2) R² (N m)
BALANCE = 12  # three: −Q(0, 0) (N, N, N m)
COSINE_END, SINE_END = 15, 16  # of the half angle
EVALUATIONS = 17  # a counter
INVERSE_MASS = 18  # three (1/kg, 1/kg, 1/(kg m²))
SCALE, INVERSE_SCALE = 21, 27  # six each: a typical amplitude of the state, and its inverse
TABLE = 33  # cos θ_j, sin θ_j and weight (m²) of the Gauss nodes on the whole arc, NODES each
NODES = 12
SIZE = TABLE + 3 * NODES


def parameters_of(scene: Scene) -> np.ndarray:
    """Flat parameters of a scene with uniform pressure, separation, exponential friction and support springs.

    Raises ValueError for a scene with other effects, which the peers do not know.
    """
    number = {key: value for key, value in scene.numbers().items() if isinstance(value, float)}
    needed = {"drum.speed", "contact.normal_load", "friction.decay", "support.upper_stiffness"} <= number.keys()
    other = {"damping", "forcing"} & {key.split(".")[0] for key in number}
    if not needed or other or scene.steady.state != "uniform-pressure" or not scene.contact.separation:
        raise ValueError("the peers know separation, exponential friction and support springs, from uniform pressure")
    model = build_model(scene, coordinates=IN_PLANE)
    shoe = model.shoe
    array = np.zeros(SIZE)
    radius, half_angle = number["shoe.outer_radius"], number["shoe.arc_angle"] / 2
    array[RADIUS], array[WIDTH], array[HALF_ANGLE] = radius, number["shoe.width"], half_angle
    array[CENTROID] = float(shoe.centroid)
    array[PRELOAD] = number["contact.normal_load"] / (radius * 2 * half_angle * number["shoe.width"])
    array[STIFFNESS] = number["contact.stiffness"]
    array[KINETIC] = number["friction.kinetic"]
    array[DIFFERENCE] = number["friction.static"] - number["friction.kinetic"]
    array[DECAY] = number["friction.decay"]
    array[DRUM] = radius * number["drum.speed"]
    array[SUPPORT] = number["support.upper_stiffness"] + number["support.lower_stiffness"]
    array[TORSION] = array[SUPPORT] * radius**2
    array[COSINE_END], array[SINE_END] = np.cos(half_angle), np.sin(half_angle)
    array[INVERSE_MASS : INVERSE_MASS + 3] = 1 / np.asarray(model.mass)
    _set_scale(array)
    _set_balance(array)
    _set_table(array)
    return array


def with_drum_speed(parameters: np.ndarray, speed: float) -> np.ndarray:
    """The same brake at another drum speed (rad/s)."""
    array = parameters.copy()
    array[DRUM] = speed * array[RADIUS]
    _set_balance(array)
    return array


def _set_balance(array: np.ndarray) -> None:
    """−Q(0, 0): the pressure p0 and the drag μ0 p0, with the integrals of cos θ and 1 over the arc."""
    line = array[PRELOAD] * array[RADIUS] * array[WIDTH]
    friction = array[KINETIC] + array[DIFFERENCE] * np.exp(-array[DECAY] * abs(array[DRUM]))
    drag = np.sign(array[DRUM]) * friction * line
    along = 2 * array[SINE_END] * drag
    spin = 2 * array[HALF_ANGLE] * array[RADIUS] * drag
    array[BALANCE : BALANCE + 3] = 2 * array[SINE_END] * line, -along, array[CENTROID] * along - spin


def _set_scale(array: np.ndarray) -> None:
    """The displacement p0/k_c that lifts the lining off, the rotation that moves the rim as far, and ω times both.

    ω² = ½ k_c area / m, half the contact's stiffness. Ten times more or less changes no configuration's evaluations at
    equal error by more than a fifth, with no direction to it.
    """
    area = 2 * array[HALF_ANGLE] * array[RADIUS] * array[WIDTH]
    frequency = np.sqrt(array[STIFFNESS] * area / 2 * array[INVERSE_MASS])
    displacement = array[PRELOAD] / array[STIFFNESS] * np.array([1.0, 1.0, 1 / array[RADIUS]])
    array[SCALE : SCALE + 6] = np.concatenate([displacement, frequency * displacement])
    array[INVERSE_SCALE : INVERSE_SCALE + 6] = 1 / array[SCALE : SCALE + 6]


def _set_table(array: np.ndarray) -> None:
    point, weight = np.polynomial.legendre.leggauss(NODES)
    angle = array[HALF_ANGLE] * point
    area = weight * array[HALF_ANGLE] * array[RADIUS] * array[WIDTH]
    array[TABLE:] = np.concatenate([np.cos(angle), np.sin(angle), area])
