"""What to change to make a brake quiet: how every growth rate goes with every number of the scene."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.interrupts import noted_interrupts, stop_if_interrupted
from drumsqueal.scene import Profile, Scene
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.gradients import StateMatrix, eigenvalue_gradient, state_matrix_of
from drumsqueal.solve.linear.modes import UNDAMPED_SHARE, Mode, Stability

PERCENT = 0.01
DIFFERENCE_STEP = 1e-3  # of a number, for the central differences beside the derivatives


class Sensitivity(NamedTuple):
    """One number of the scene: `key`, `value` (SI) and ∂λ/∂p of every mode (k,), in 1/s per SI unit.

    `difference` (k,) is the same by central differences, NaN where the number is zero and a share of it is none.
    """

    key: str
    value: float
    derivative: NDArray[np.complex128]
    difference: NDArray[np.complex128]

    @property
    def growth_per_percent(self) -> NDArray[np.float64]:
        """Change of each growth rate (1/s) where the number grows by 1 %."""
        return PERCENT * self.value * self.derivative.real

    @property
    def frequency_per_percent_Hz(self) -> NDArray[np.float64]:
        """Change of each frequency (Hz) where the number grows by 1 %."""
        return PERCENT * self.value * self.derivative.imag / (2 * np.pi)


class SensitivityStudy(NamedTuple):
    """The modes of a scene and how they go with its numbers, the number that counts most first.

    `scene` is as it is when the eigenvalues are taken: profiles have one value. `deviation` is the largest difference
    between derivatives and central differences, over the largest derivative, both per per cent. `round_off` (1/s) is
    what a growth rate is not known to, and a change below it is none. `state_matrix` is the function of the numbers
    (in the order of `numbers_of(scene)`) that was differentiated.
    """

    scene: Scene
    stability: Stability
    rows: tuple[Sensitivity, ...]
    deviation: float
    round_off: float
    state_matrix: StateMatrix

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The oscillating modes, by rising frequency."""
        return self.stability.modes

    @property
    def told(self) -> tuple[int, ...]:
        """Places of the modes that matter: the unstable ones or, where none is, all."""
        unstable = tuple(k for k, mode in enumerate(self.modes) if mode.unstable)
        return unstable or tuple(range(len(self.modes)))


def study_sensitivity(scene: Scene) -> SensitivityStudy:
    """Differentiate every growth rate with respect to every number: `study_sensitivity(scene).rows`.

    A profile counts as what it is at t = 0, or where the drum first turns. Raises SceneError for a scene without
    steady sliding and RequestError for one in which nothing oscillates.
    """
    with noted_interrupts():
        stability = prepare(scene).stability
        check_modes(stability)
        stop_if_interrupted()
        frozen = at_one_time(scene, stability.time)
        numbers = numbers_of(frozen)
        evaluate = state_matrix_of(frozen, tuple(numbers))
        values = np.array(list(numbers.values()))
        derivatives = _derivatives(stability.modes, evaluate(values)[1])
        stop_if_interrupted()
        differences = _differences(stability.modes, evaluate, values)
    rows = [
        Sensitivity(key, value, derivatives[:, k], differences[:, k]) for k, (key, value) in enumerate(numbers.items())
    ]
    study = SensitivityStudy(frozen, stability, tuple(rows), _deviation(rows), _round_off(stability), evaluate)
    told = list(study.told)
    ordered = sorted(rows, key=lambda row: -float(np.abs(row.growth_per_percent[told]).max()))
    return study._replace(rows=tuple(ordered))


def check_modes(stability: Stability) -> None:
    """Raise RequestError where there are no growth rates."""
    if not stability.modes:
        raise RequestError("nothing oscillates in this scene, so there are no growth rates to differentiate")


def numbers_of(scene: Scene) -> dict[str, float]:
    """The physical numbers of a scene without profiles, by key, in SI."""
    return {key: value for key, value in scene.numbers().items() if isinstance(value, float)}


def at_one_time(scene: Scene, time: float) -> Scene:
    """The scene with the drum speed and the load that it has at a time (s), at all times."""
    schedules = {"drum.speed": scene.drum.speed, "contact.normal_load": scene.contact.normal_load}
    values = {
        key: float(np.interp(time, profile.time, profile.value))
        for key, profile in schedules.items()
        if isinstance(profile, Profile)
    }
    return scene.with_values(values) if values else scene


def _derivatives(modes: tuple[Mode, ...], matrices: NDArray[np.float64]) -> NDArray[np.complex128]:
    """∂λ/∂p of every mode and number (modes, numbers)."""
    return np.array([eigenvalue_gradient(mode.left, mode.right, matrices) for mode in modes])


def _differences(modes: tuple[Mode, ...], evaluate: StateMatrix, values: NDArray[np.float64]) -> NDArray[np.complex128]:
    """The same by central differences; each mode is followed by its eigenvector."""
    found = np.full((len(modes), values.size), np.nan, dtype=np.complex128)
    for k in np.flatnonzero(values):
        step = np.zeros(values.size)
        step[k] = DIFFERENCE_STEP * values[k]
        above, below = (np.linalg.eig(evaluate(values + sign * step)[0]) for sign in (1, -1))
        stop_if_interrupted()
        for row, mode in enumerate(modes):
            found[row, k] = (_followed(mode, *above) - _followed(mode, *below)) / (2 * step[k])
    return found


def _followed(mode: Mode, eigenvalues: NDArray[np.complex128], right: NDArray[np.complex128]) -> complex:
    """The eigenvalue whose eigenvector is most of the mode's, among the oscillating ones nearest to it."""
    overlap = np.abs(mode.left.conj() @ right) / np.linalg.norm(mode.left)
    apart = np.abs(eigenvalues - mode.eigenvalue) / abs(mode.eigenvalue)
    return complex(eigenvalues[np.argmax(overlap - apart)])


def _deviation(rows: list[Sensitivity]) -> float:
    """Largest difference between both kinds of derivative, over the largest derivative."""
    sizes = np.array([row.value * row.derivative for row in rows])
    apart = np.array([row.value * np.nan_to_num(row.difference - row.derivative) for row in rows if row.value])
    largest = np.abs(sizes).max(initial=0.0)
    return float(np.abs(apart).max(initial=0.0) / largest) if largest > 0 else 0.0


def _round_off(stability: Stability) -> float:
    return UNDAMPED_SHARE * float(np.abs(stability.eigenvalues).max())
