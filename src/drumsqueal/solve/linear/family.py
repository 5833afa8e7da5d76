"""The linear model as a function of a scene's numbers: eigenvalues of many sets of them or scenes, and derivatives."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax import Array
from numpy.typing import ArrayLike, NDArray

from drumsqueal.errors import SteadyStateError
from drumsqueal.interpreter import one_thread
from drumsqueal.physics.bodies.body import WRITTEN_OUT
from drumsqueal.physics.composition import compose, linear_coordinates
from drumsqueal.physics.elasticity import check_shapes_stay, numbers_of
from drumsqueal.physics.model import assemble, build_model
from drumsqueal.physics.shoe_building import Composition
from drumsqueal.programs import Program
from drumsqueal.scene import Scene
from drumsqueal.solve.linear.modes import (
    DRIFT_FRACTION,
    OSCILLATING_FRACTION,
    UNDAMPED_FRACTION,
    AboutSteady,
    Stability,
    about_steady,
    analyse_stability,
    stability_of,
)
from drumsqueal.solve.linear.steady import Linear, linear_model, linearise, no_steady_sliding, steady_sliding

# Side by side (`jax.vmap`) all sets of numbers search for their equilibria as long as the slowest: one after the other
# within a program they take half to two thirds of that time. So many scenes go into one, always, that a scene's result
# does not depend on which others go with it, not in a bit; the last block is filled up with its last scene.
BLOCK = 32

Complex = NDArray[np.complex128]
StateMatrix = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]


class EigenvalueSet(NamedTuple):
    """Eigenvalues over m sets of numbers, and which of them belong to which coordinate.

    Attributes
    ----------
    names : tuple of str
        The n coordinates.
    mass : (m, n) array
        Diagonal of the mass matrix M (kg, kg m²).
    damping : (m, n, n) array
        Damping matrix C about steady sliding.
    eigenvalues : (m, 2n) complex array
        Eigenvalues λ (1/s), in no order.
    right : (m, 2n, 2n) complex array
        Their eigenvectors as columns: displacements of the coordinates, then velocities.
    own : (m, n) complex array
        The eigenvalue (1/s) of each coordinate: the upper one of a pair that oscillates, the least stable one of two
        that do not, a free drift apart.
    """

    names: tuple[str, ...]
    mass: NDArray[np.float64]
    damping: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    right: NDArray[np.complex128]
    own: NDArray[np.complex128]

    def of(self, name: str) -> NDArray[np.complex128]:
        """The eigenvalue of a coordinate (m,), in 1/s."""
        return self.own[:, self.names.index(name)]

    def part(self, rows: slice) -> "EigenvalueSet":
        """The spectrum over some of the sets of numbers."""
        return EigenvalueSet(self.names, *(array[rows] for array in self[1:]))  # pyright: ignore[reportArgumentType]

    @property
    def drifting(self) -> NDArray[np.bool_]:
        """Which eigenvalues (m, 2n) are zero to round-off: a coordinate that nothing holds."""
        return np.abs(self.eigenvalues) <= DRIFT_FRACTION * self._size

    @property
    def oscillating(self) -> NDArray[np.bool_]:
        """Which eigenvalues (m, 2n) have an imaginary part beyond round-off."""
        return np.abs(self.eigenvalues.imag) > OSCILLATING_FRACTION * self._size

    @property
    def growing(self) -> NDArray[np.bool_]:
        """Which eigenvalues (m, 2n) have a positive real part beyond round-off."""
        least = np.where(self.oscillating, UNDAMPED_FRACTION, DRIFT_FRACTION)
        return self.eigenvalues.real > least * self._size

    @property
    def _size(self) -> NDArray[np.float64]:
        return np.max(np.abs(self.eigenvalues), axis=1, keepdims=True)


def spectra_of(scene: Scene, numbers: Mapping[str, ArrayLike]) -> EigenvalueSet:
    """Eigenvalues about steady sliding for many sets of a scene's numbers, by one compiled program.

    Parameters
    ----------
    scene : Scene
        The brake, at t = 0. What `numbers` does not name is the scene's.
    numbers : mapping of str to (m,) arrays
        Numbers in SI by their keys, as in `scene.numbers()`: set k is the k-th of each array.

    Returns
    -------
    EigenvalueSet
        Eigenvalues (m, 2n) of all sets, and which of them is whose coordinate's.

    Raises
    ------
    RequestError
        For a number with which the modes of a shoe or drum that bends change.
    SteadyStateError
        Where one of the sets has no steady sliding.

    Examples
    --------
    ```pycon
    >>> scene = drumsqueal.load_scene("nominal")
    >>> found = drumsqueal.spectra_of(scene, {"drum.speed": [2.0, 5.0]})
    >>> found.of("Y").real.round(1).tolist()
    [102.9, 76.2]
    ```
    """
    for key in numbers:
        check_shapes_stay(scene, key)
    stacked = {key: np.asarray(value, dtype=np.float64) for key, value in numbers.items()}
    linear, matrices = _linear_models(stacked, _as_arrays(scene), _kind(scene)[0])
    names = linear_coordinates(scene)
    lacking = np.flatnonzero(~np.isfinite(np.asarray(matrices)).all(axis=(1, 2)))
    if lacking.size:
        first = {key: float(values[lacking[0]]) for key, values in stacked.items()}
        raise no_steady_sliding(build_model(scene.with_values(first), coordinates=names))
    with one_thread():
        eigenvalues, right = np.linalg.eig(np.asarray(matrices))
    mass, damping = np.asarray(linear.mass), np.asarray(linear.damping)
    own = np.array([_own(*each) for each in zip(eigenvalues, right, mass, strict=True)])
    return EigenvalueSet(names, mass, damping, eigenvalues, right, own)


def _own(eigenvalues: Complex, right: Complex, mass: NDArray[np.float64]) -> Complex:
    """Give each coordinate the two eigenvalues that hold most of it; of each two, return the informative one (n,)."""
    n = mass.size
    fraction = np.abs(right[:n]) ** 2 * mass[:, None]
    fraction = fraction / fraction.sum(axis=0)
    rows, columns = scipy.optimize.linear_sum_assignment(-np.repeat(fraction, 2, axis=0))
    pairs = eigenvalues[columns[np.argsort(rows)]].reshape(n, 2)
    largest = np.max(np.abs(eigenvalues))
    return np.array([_informative(pair, largest) for pair in pairs])


def _informative(pair: Complex, largest: float) -> complex:
    upper = complex(pair[np.argmax(pair.imag)])
    if upper.imag > OSCILLATING_FRACTION * largest:
        return upper
    held = pair[np.abs(pair) > DRIFT_FRACTION * largest]
    return complex(held[np.argmax(held.real)]) if held.size else 0j


def state_matrix_of(scene: Scene, keys: tuple[str, ...]) -> StateMatrix:
    """The state matrix A (2n, 2n) and ∂A/∂p (k, 2n, 2n) as a function of the numbers p (k,) with these keys, in SI.

    By automatic differentiation of the model's own linearisation, one number after the other in one program, which is
    compiled at the first call. Raises RequestError for keys with which the modes of shoe or drum change.
    """
    for key in keys:
        check_shapes_stay(scene, key)
    numbers, (composition, _) = _as_arrays(scene), _kind(scene)

    def evaluate(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        matrices, derivatives = _with_derivatives(np.asarray(values, dtype=np.float64), keys, numbers, composition)
        return np.asarray(matrices[0]), np.asarray(derivatives)

    return evaluate


def _as_arrays(scene: Scene) -> dict[str, np.ndarray]:
    return {key: np.asarray(value, dtype=np.float64) for key, value in numbers_of(scene).items()}


def _linear(composition: Composition, numbers: Mapping[str, Any]) -> Linear:
    """The linear model about steady sliding, at t = 0."""
    model = assemble(composition, numbers)
    return linearise(model, steady_sliding(model))


@Program
def _linear_models(
    values: Mapping[str, Array], numbers: Mapping[str, Array], composition: Composition
) -> tuple[Linear, Array]:
    """The linear models of m sets of values (m,) in place of some numbers, and their state matrices (m, 2n, 2n)."""

    def one(each: Mapping[str, Array]) -> tuple[Linear, Array]:
        linear = _linear(composition, {**numbers, **each})
        return linear, linear.state_matrix()

    return jax.lax.map(one, values)


@Program
def _with_derivatives(
    values: Array, keys: tuple[str, ...], numbers: Mapping[str, Array], composition: Composition
) -> tuple[Array, Array]:
    """The state matrix (k, 2n, 2n), always the same, and its derivatives (k, 2n, 2n) in the values (k,) of the keys."""

    def matrix(values: Array) -> Array:
        changed = {key: values[k] for k, key in enumerate(keys)}
        return _linear(composition, {**numbers, **changed}).state_matrix()

    return jax.lax.map(lambda direction: jax.jvp(matrix, (values,), (direction,)), jnp.eye(len(keys)))


def eigenvalue_gradient(left: NDArray, right: NDArray, derivatives: NDArray[np.float64]) -> NDArray[np.complex128]:
    """∂λ/∂p (k,) = lᴴ (∂A/∂p) r of one simple eigenvalue, with lᴴ r = 1; `derivatives` (k, 2n, 2n).

    Source: P. Lancaster, "On eigenvalues of matrices dependent on a parameter", Numerische Mathematik 6, 1964.
    """
    return np.einsum("i,kij,j->k", left.conj(), derivatives, right)


def analyse_many(scenes: Sequence[Scene]) -> list[Stability | SteadyStateError]:
    """Steady sliding and complex eigenvalues of each scene, or the error that says why it has none.

    Over the coordinates of the eigenvalue problem, as in `drumsqueal stability`.
    """
    results: dict[int, Stability | SteadyStateError] = {}
    groups: dict[tuple, list[int]] = {}
    for index, scene in enumerate(scenes):
        coordinates = linear_coordinates(scene)
        turns = isinstance(scene.drum.speed, float) and (scene.drum.speed != 0 or not scene.rubs)
        if turns and len(coordinates) <= WRITTEN_OUT:
            groups.setdefault(_kind(scene), []).append(index)
        else:  # at rest, now or always: which moment counts is another question; one that bends compiles for minutes
            results[index] = _or_error(analyse_stability, build_model(scene, coordinates=coordinates))
    for (composition, _), members in groups.items():
        for first in range(0, len(members), BLOCK):
            block = members[first : first + BLOCK]
            results.update(zip(block, _together(composition, [scenes[i] for i in block]), strict=True))
    return [results[index] for index in range(len(scenes))]


def _kind(scene: Scene) -> tuple[Composition, tuple]:
    """What is static in the program of a scene: its composition, and the lengths of its profiles."""
    # Forces do not change the linear model; which ones act would only ask for further programs.
    composition = compose(scene)._replace(coordinates=linear_coordinates(scene), forced=())
    return composition, tuple((key, np.shape(value)) for key, value in numbers_of(scene).items())


def _or_error(analyse: Callable[..., Stability], *arguments: Any) -> Stability | SteadyStateError:
    try:
        return analyse(*arguments)
    except SteadyStateError as error:
        return error


def _together(composition: Composition, scenes: list[Scene]) -> list[Stability | SteadyStateError]:
    filled = [numbers_of(scene) for scene in scenes + scenes[-1:] * (BLOCK - len(scenes))]
    stacked = {key: np.array([numbers[key] for numbers in filled]) for key in filled[0]}
    found = jax.tree.map(np.asarray, _about_many(stacked, composition))
    each = [jax.tree.map(lambda values, k=k: values[k], found) for k in range(len(scenes))]
    return [
        _or_error(stability_of, composition.coordinates, one)
        if np.all(np.isfinite(one.steady))
        else no_steady_sliding(build_model(scene, coordinates=composition.coordinates))
        for scene, one in zip(scenes, each, strict=True)
    ]


@Program
def _about_many(numbers: Mapping[str, np.ndarray], composition: Composition) -> AboutSteady:
    def one(numbers: Mapping[str, Array]) -> AboutSteady:
        model = assemble(composition, numbers)
        return about_steady(model, *linear_model(model))

    return jax.lax.map(one, numbers)
