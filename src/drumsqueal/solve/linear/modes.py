"""Complex eigenvalues of steady sliding: modes, growth rates, frequencies, and which mode is which.

Modes of different models are one where their shapes are alike, whatever their order is. Two measures, both from 0 to 1:
by right and left eigenvectors, which is 1 for a mode itself and 0 for all others of its matrix, and, where there are
displacements alone, the root of the modal assurance criterion in the mass metric.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax import Array
from numpy.typing import NDArray

from drumsqueal.coordinates import is_static
from drumsqueal.errors import NoSteadySliding, SteadyStateError
from drumsqueal.interpreter import one_thread
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.damping import MOSTLY
from drumsqueal.physics.effects.operation import PiecewiseLinear
from drumsqueal.physics.effects.several import Contacts
from drumsqueal.physics.model import Model
from drumsqueal.programs import Program
from drumsqueal.shown import as_html, as_text, headed
from drumsqueal.solve.linear.steady import (
    Linear,
    check_held,
    linear_model,
    linearise,
    no_steady_sliding,
    observe_steady,
    steady_sliding,
)

CLEAR = 0.5**0.5  # overlap beyond which no other mode can have as much in common with either
SIDES = ("right", "left")  # of eigenvectors


def overlaps(modes: "Sequence[Mode]", others: "Sequence[Mode]") -> NDArray[np.float64]:
    """How much of each mode is each of others, from 0 to 1."""
    if not modes or not others:
        return np.zeros((len(modes), len(others)))
    return overlap_of(modes, *(np.array([getattr(mode, side) for mode in others]).T for side in SIDES))


def overlap_of(
    modes: "Sequence[Mode]", right: NDArray[np.complex128], left: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """√|l_iᴴ r_j · l_jᴴ r_i| of each mode and of eigenvectors, columns (2n, k), scaled to lᴴ r = 1; at most 1.

    Whatever the units of the state are, it is 1 for a mode itself and 0 for all others of its matrix.
    """
    own_right, own_left = (np.array([getattr(mode, side) for mode in modes]) for side in SIDES)
    return np.minimum(np.sqrt(np.abs((own_left.conj() @ right) * (own_right @ left.conj()))), 1.0)


def assurance(mass: NDArray[np.float64], shape: NDArray, shapes: NDArray) -> NDArray[np.float64]:
    """√MAC (k,) of a shape (n,) and of others, columns (n, k), by a diagonal mass matrix (n,)."""
    norms = np.sqrt((mass @ np.abs(shape) ** 2) * (mass @ np.abs(shapes) ** 2))
    return np.abs((mass * shape.conj()) @ shapes) / np.maximum(norms, np.finfo(np.float64).tiny)


def matched(overlap: NDArray[np.float64], least: float = -np.inf) -> dict[int, int]:
    """Which of the others each mode is, by the largest sum of overlaps, where their own is `least` at least."""
    pairs = zip(*scipy.optimize.linear_sum_assignment(overlap, maximize=True), strict=True)
    return {int(i): int(j) for i, j in pairs if overlap[i, j] >= least}


# An eigenvalue oscillates when its imaginary part exceeds this fraction of the largest modulus: a real one, and the
# zero of the free Z motion, come out of the solver with an imaginary part of round-off size.
OSCILLATING_FRACTION = 1e-9
# A real part below this fraction of the largest modulus is round-off, neither growth nor decay.
UNDAMPED_FRACTION = 1e-12
# A double zero (a free coordinate without friction) comes out of the solver split by the root of round-off.
DRIFT_FRACTION = 1e-7
# A growth rate below this fraction of the frequency is none, and has no relative error.
NEUTRAL_FRACTION = 1e-9


class Mode(NamedTuple):
    """An oscillating mode: eigenvalue λ (1/s), named by its largest mass-weighted coordinate.

    `label` is the name, and for every further mode of that name, by rising frequency, "X (2)", "X (3)".
    `right` and `left` (2n,) are its eigenvectors of the state matrix, with leftᴴ right = 1 and the displacement of the
    named coordinate in `right` scaled to 1. A real motion holds the mode and its conjugate, y = a right + ā right*, so
    2 |leftᴴ y| is the amplitude of that coordinate in m or rad.
    """

    name: str
    label: str
    eigenvalue: complex
    unstable: bool
    right: NDArray[np.complex128]
    left: NDArray[np.complex128]

    def __repr__(self) -> str:
        """Label, frequency and growth rate."""
        return f"Mode({self.label}: {self.frequency_Hz:.2f} Hz, {self.growth_rate:+.3f} 1/s)"

    def shape(self, coordinates: Sequence[str]) -> dict[str, complex]:
        """Displacements by the names of the coordinates."""
        return dict(zip(coordinates, self.right[: len(coordinates)].tolist(), strict=True))

    @property
    def frequency_Hz(self) -> float:
        """Im λ/2π (Hz)."""
        return self.eigenvalue.imag / (2 * np.pi)

    @property
    def growth_rate(self) -> float:
        """Re λ (1/s); positive grows."""
        return self.eigenvalue.real

    @property
    def damping_ratio(self) -> float:
        """ζ = −Re λ/|λ|, negative when unstable (half of what some finite-element programs call so)."""
        return -self.eigenvalue.real / abs(self.eigenvalue)


Solved = tuple[NDArray[np.complex128], tuple[Mode, ...]]  # eigenvalues (2n,), and the modes that oscillate


class Stability(NamedTuple):
    """Steady sliding and its eigenvalues: q* (n,), all eigenvalues (2n,), oscillating modes by rising frequency.

    `matrix` (2n, 2n) is that of d/dt (q − q*, q̇), whose eigenvalues they are.
    `mass` is the diagonal of the mass matrix (n,), `pressure_range` the smallest and largest steady pressure (Pa),
    `contact_fraction` the fraction of all linings that touches the drum in steady sliding, `contact_fractions` that of
    each. All of it is for the drum speed, the load and the forces at `time` (s): 0, or later where the drum is at rest
    or nothing pushes the shoe then.
    """

    coordinates: tuple[str, ...]
    mass: NDArray[np.float64]
    steady_state: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    modes: tuple[Mode, ...]
    pressure_range: tuple[float, float]
    contact_fraction: float
    contact_fractions: tuple[float, ...]
    time: float
    matrix: NDArray[np.float64]
    printed_by = "drumsqueal.questions.stability.print_stability"

    def __repr__(self) -> str:
        """The modes, and what grows without oscillation."""
        rate = self.divergence
        diverges = "" if rate is None else f", {divergence_words(rate)}"
        unstable = f"{len(self.unstable)} of {len(self.modes)} modes unstable{diverges}"
        return headed(self, unstable, *map(repr, self.modes))

    def __str__(self) -> str:
        """What the command prints."""
        return as_text(self)

    def _repr_html_(self) -> str:
        return as_html(self)

    def over(self, names: tuple[str, ...]) -> "Stability":
        """The same seen by some of the coordinates: their part of it, and the modes that they can show."""
        places = np.array([self.coordinates.index(name) for name in names])
        both = np.concatenate([places, len(self.coordinates) + places])
        shown = (mode for mode in self.modes if mode.name in names)
        modes = tuple(mode._replace(right=mode.right[both], left=mode.left[both]) for mode in shown)
        steady, mass = self.steady_state[places], self.mass[places]
        matrix = self.matrix[np.ix_(both, both)]
        return self._replace(coordinates=names, mass=mass, steady_state=steady, modes=modes, matrix=matrix)

    def turned(self, turn: NDArray[np.float64]) -> "Stability":
        """The same over coordinates q' = turn q, an orthogonal matrix (n, n) among coordinates of equal mass."""
        both = np.kron(np.eye(2), turn)
        found = [mode._replace(right=both @ mode.right, left=both @ mode.left) for mode in self.modes]
        modes = name_modes(self.coordinates, self.mass, found)
        return self._replace(steady_state=turn @ self.steady_state, modes=modes, matrix=both @ self.matrix @ both.T)

    @property
    def oscillations(self) -> tuple[Mode, ...]:
        """What it may vibrate like."""
        return oscillations_of(self.coordinates, self.mass, self.matrix, (self.eigenvalues, self.modes))

    @property
    def vibrations(self) -> tuple[Mode, ...]:
        """What it may vibrate like, and what would vibrate next to that without its damping."""
        return vibrations_of(self.coordinates, self.mass, self.matrix, (self.eigenvalues, self.modes))

    @property
    def unstable(self) -> tuple[Mode, ...]:
        """The modes that grow."""
        return tuple(mode for mode in self.modes if mode.unstable)

    @property
    def unresolved(self) -> tuple[complex, ...]:
        """Eigenvalues (1/s) that oscillate and grow, mostly of shapes in which a body yields nearly statically."""
        largest = np.max(np.abs(self.eigenvalues), initial=0.0)
        known = {mode.eigenvalue for mode in self.modes}
        growing = self.eigenvalues[self.eigenvalues.real > UNDAMPED_FRACTION * largest]
        return tuple(
            each for each in growing.tolist() if each.imag > OSCILLATING_FRACTION * largest and each not in known
        )

    @property
    def divergence(self) -> float | None:
        """Largest real eigenvalue that grows without oscillation (1/s), None where there is none."""
        return growing_without_oscillation(self.eigenvalues)

    @property
    def highest_frequency_Hz(self) -> float:
        """The largest of a mode (Hz), of what is overdamped without damping; 0 where nothing oscillates even so."""
        return max((mode.frequency_Hz for mode in self.vibrations), default=0.0)


def analyse_stability(model: Model) -> Stability:
    """Find steady sliding and solve the complex eigenvalue problem about it.

    Raises SteadyStateError when there is no steady sliding: the drum stands still, the equilibrium was not found, or
    numbers out of all proportion leave nothing finite.

    ```pycon
    >>> model = drumsqueal.build_model(drumsqueal.load_scene("nominal"))
    >>> for mode in drumsqueal.analyse_stability(model).unstable:
    ...     print(f"{mode.label}: {mode.frequency_Hz:.0f} Hz, {mode.growth_rate:+.0f} 1/s")
    Y: 1424 Hz, +76 1/s
    X: 4392 Hz, +34 1/s
    Tz: 7399 Hz, +62 1/s
    ```
    """
    model, time = while_sliding(model)
    check_held(model)
    steady, linear = linear_model(model)
    if not np.all(np.isfinite(steady)):
        raise no_steady_sliding(model)
    return stability_of(model.names, about_steady(model, steady, linear), time)


class AboutSteady(NamedTuple):
    """What the eigenvalue problem at steady sliding q* (n,) is made of.

    The diagonal of the mass matrix (n,), the state matrix (2n, 2n), the smallest and largest pressure (Pa) and the
    fraction of the lining that touches the drum, of all linings and of each.
    """

    steady: Array
    mass: Array
    matrix: Array
    pressure_range: tuple[Array, Array]
    contact_fraction: Array
    contact_fractions: tuple[Array, ...]


def about_steady(model: Model, steady: Array, linear: Linear) -> AboutSteady:
    """Matrix, pressure and contact at steady sliding q* (n,), not yet looked at."""
    pressure_range, observed = observe_steady(model, steady)
    touching = observed.contact_fraction, observed.of_each("contact_fraction")
    return AboutSteady(steady, model.mass, linear.state_matrix(), pressure_range, *touching)


def stability_of(names: tuple[str, ...], found: AboutSteady, time: float = 0.0) -> Stability:
    """Solve the complex eigenvalue problem of the coordinates with these names, at a steady sliding that was found.

    Raises SteadyStateError where numbers out of all proportion leave nothing finite.
    """
    steady, mass, matrix = (np.asarray(each) for each in (found.steady, found.mass, found.matrix))
    low, high = (float(each) for each in found.pressure_range)
    if not (np.all(np.isfinite(matrix)) and np.isfinite(low) and np.isfinite(high)):
        raise SteadyStateError(NoSteadySliding.NOT_FINITE)
    eigenvalues, modes = solve_modes(names, mass, matrix)
    touching = float(found.contact_fraction), tuple(map(float, found.contact_fractions))
    return Stability(names, mass, steady, eigenvalues, modes, (low, high), *touching, time, matrix)


def oscillations_of(
    names: tuple[str, ...], mass: NDArray[np.float64], matrix: NDArray[np.float64], solved: Solved
) -> tuple[Mode, ...]:
    """What a state matrix (2n, 2n) may vibrate like: its modes or, where none oscillates, those without damping."""
    eigenvalues, modes = solved
    if np.any(np.abs(eigenvalues.imag) > OSCILLATING_FRACTION * np.max(np.abs(eigenvalues))):
        return modes
    return undamped_modes(names, mass, matrix)


def vibrations_of(
    names: tuple[str, ...], mass: NDArray[np.float64], matrix: NDArray[np.float64], solved: Solved
) -> tuple[Mode, ...]:
    """The oscillations of a state matrix (2n, 2n), and what would vibrate next to them without its damping."""
    known = oscillations_of(names, mass, matrix, solved)
    if len(known) == len(names):
        return known
    undamped = undamped_modes(names, mass, matrix)
    alike = matched(overlaps(known, undamped)).values()
    others = [mode for k, mode in enumerate(undamped) if k not in alike]
    return name_modes(names, mass, (*known, *others)) if others else known


def undamped_modes(names: tuple[str, ...], mass: NDArray[np.float64], matrix: NDArray[np.float64]) -> tuple[Mode, ...]:
    """The modes of a state matrix (2n, 2n) without what it has of velocities: those of stiffness and mass alone."""
    undamped, n = matrix.copy(), len(names)
    undamped[n:, n:] = 0.0
    eigenvalues, modes = solve_modes(names, mass, undamped)
    least = DRIFT_FRACTION * np.max(np.abs(eigenvalues))  # what moves freely is a double zero
    return name_modes(names, mass, [mode for mode in modes if mode.eigenvalue.imag > least])


def while_sliding(model: Model) -> tuple[Model, float]:
    """The model at t = 0 or, where the drum stands still or nothing pushes the shoe then, as it is later.

    That is at the first corner, of the profiles that begin at 0, at which the drum turns and the shoe is pushed; where
    none pushes, at the first at which it turns. Returns that time (s), too. Raises SteadyStateError where friction
    never has a direction.
    """
    if _turns(model) and _is_pressed(model):
        return model, 0.0
    beginning = [each for each in (model.operation.drum_speed, *model.operation.pushes) if float(each.at(0.0)[0]) == 0]
    corners = [np.asarray(each.time) for each in beginning if isinstance(each, PiecewiseLinear)]
    later = [(float(time), model.frozen(float(time))) for time in np.unique(np.concatenate([[], *corners])) if time > 0]
    turning = [(model, 0.0)] if _turns(model) else [(frozen, time) for time, frozen in later if _turns(frozen)]
    if turning:
        return next(((frozen, time) for time, frozen in later if _turns(frozen) and _is_pressed(frozen)), turning[0])
    brake = isinstance(model.contact, Contact | Contacts)
    raise SteadyStateError(NoSteadySliding.AT_REST if brake else NoSteadySliding.BELT_AT_REST)


def _turns(model: Model) -> bool:
    """Whether the drum turns at t = 0, so that friction has a direction, or has none."""
    return model.contact.friction is None or float(model.operation.drum_speed.at(0.0)[0]) != 0


def _is_pressed(model: Model) -> bool:
    """Whether a shoe that forces push is pushed at t = 0, or has a load."""
    forces = (*model.operation.preloads, *model.operation.pushes)
    return not model.pushed or any(float(each.at(0.0)[0]) != 0 for each in forces)


def without_oscillation(eigenvalues: NDArray[np.complex128]) -> NDArray[np.float64]:
    """The real ones of some eigenvalues (1/s)."""
    largest = np.max(np.abs(eigenvalues), initial=0.0)
    return eigenvalues[np.abs(eigenvalues.imag) <= OSCILLATING_FRACTION * largest].real


def growing_without_oscillation(eigenvalues: NDArray[np.complex128]) -> float | None:
    """The largest real eigenvalue above zero (1/s), None where there is none."""
    rate = float(np.max(without_oscillation(eigenvalues), initial=0.0))
    return rate if rate > DRIFT_FRACTION * np.max(np.abs(eigenvalues), initial=0.0) else None


def divergence_words(rate: float) -> str:
    """Name a real eigenvalue that grows (1/s)."""
    return f"divergence without oscillation at {rate:+.4g} 1/s"


@Program
def growth_rate(model: Model, mode: str) -> Array:
    """Re λ (1/s) of the mode with that name, differentiable with respect to the model's numbers.

    Works inside `jax.grad` and `jax.vmap`. Of several modes of one name the least stable counts; NaN where no mode of
    that name oscillates, and on a drum at rest, where friction has no direction. Raises KeyError when the model
    lacks the coordinate.

    ```pycon
    >>> import jax
    >>> scene = drumsqueal.load_scene("nominal")
    >>> def growth(speed):
    ...     return drumsqueal.growth_rate(drumsqueal.build_model(scene, {"drum.speed": speed}), "Y")
    >>> f"{growth(5.0):.1f} 1/s, and {jax.grad(growth)(5.0):.2f} 1/s more for each rad/s"
    '76.2 1/s, and -7.63 1/s more for each rad/s'
    ```
    """
    if mode not in model.names:
        raise KeyError(f"{mode} is no coordinate of this model; it has {', '.join(model.names)}")
    matrix = linearise(model, steady_sliding(model)).state_matrix()
    # Eigenvectors have no derivative in JAX and need none here: they only say which eigenvalue is meant.
    values, vectors = jnp.linalg.eig(jax.lax.stop_gradient(matrix))
    n = len(model.names)
    main = jnp.argmax(jnp.abs(vectors[:n]) * jnp.sqrt(model.mass)[:, None], axis=0)
    meant = (main == model.names.index(mode)) & (values.imag > OSCILLATING_FRACTION * jnp.max(jnp.abs(values)))
    target = values[jnp.argmax(jnp.where(meant, values.real, -jnp.inf))]
    eigenvalues = jnp.linalg.eigvals(matrix)
    rate = eigenvalues[jnp.argmin(jnp.abs(eigenvalues - target))].real
    slides = model.contact.friction is None or model.operation.drum_speed.at(0.0)[0] != 0
    return jnp.where(jnp.any(meant) & slides, rate, jnp.nan)


def eigensystem(matrix: NDArray[np.float64]) -> tuple[NDArray[np.complex128], ...]:
    """Eigenvalues (2n,) of a state matrix, and its eigenvectors right and left, columns (2n, 2n): leftᴴ right = 1."""
    with one_thread():
        eigenvalues, right = (part.astype(np.complex128) for part in np.linalg.eig(matrix))
        left = np.linalg.pinv(right).conj().T  # no inverse: two eigenvalues 0 may share an eigenvector
    return eigenvalues, right, left.astype(np.complex128)


def solve_modes(names: tuple[str, ...], mass: NDArray[np.float64], matrix: NDArray[np.float64]) -> Solved:
    """Eigenvalues (2n,), the slowest first, and oscillating modes by rising frequency, of a state matrix (2n, 2n)."""
    with one_thread():
        found: Any = scipy.linalg.eig(matrix, left=True, right=True)
    eigenvalues, left, right = found
    largest = np.max(np.abs(eigenvalues))
    oscillating = [k for k in np.argsort(eigenvalues.imag) if eigenvalues[k].imag > OSCILLATING_FRACTION * largest]
    unstable = eigenvalues.real > UNDAMPED_FRACTION * largest
    modes = [Mode("", "", complex(eigenvalues[k]), bool(unstable[k]), right[:, k], left[:, k]) for k in oscillating]
    return eigenvalues[np.lexsort((eigenvalues.imag, np.abs(eigenvalues.imag)))], name_modes(names, mass, modes)


def name_modes(names: tuple[str, ...], mass: NDArray[np.float64], found: Sequence[Mode]) -> tuple[Mode, ...]:
    """Modes named by their largest coordinates and scaled to these, each with a label of its own.

    Without those that are mostly shapes in which a body yields nearly statically: they are beyond what is resolved.
    """
    modes: list[Mode] = []
    statics = np.array(list(map(is_static, names)), dtype=bool)
    for mode in found:
        sizes = np.abs(mode.right[: len(names)]) * np.sqrt(mass)
        if np.sum(sizes[statics] ** 2) > MOSTLY * np.sum(sizes**2):
            continue
        main = int(np.argmax(np.where(statics, 0.0, sizes)))
        shape = mode.right / mode.right[main]
        projection = mode.left / np.conj(np.vdot(mode.left, shape))
        modes.append(mode._replace(name=names[main], right=shape, left=projection))
    labels = labels_of([mode.name for mode in modes])
    return tuple(mode._replace(label=label) for mode, label in zip(modes, labels, strict=True))


def labels_of(names: Sequence[str]) -> list[str]:
    """Names as labels, every further one of a name with its number: X, Y, X (2)."""
    earlier = [names[:k].count(name) for k, name in enumerate(names)]
    return [f"{name} ({count + 1})" if count else name for name, count in zip(names, earlier, strict=True)]
