"""The shapes in which a scene's shoe and drum bend: up to which frequency, their numbers, and what changes them."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from drumsqueal.coordinates import DRUM, shape_names
from drumsqueal.errors import RequestError
from drumsqueal.physics.basis import MORE, kept_shapes, once, one_side
from drumsqueal.physics.bodies.drum_modes import DrumModes
from drumsqueal.physics.trial_shapes import frequencies_of, numbers_of_drum, numbers_of_shoe, trial_shoe
from drumsqueal.scene import Scene
from drumsqueal.scene.shoes import Shoes

# Motion is resolved where growth rates stay as they are, to 1/s or to a fraction, which experiments cannot tell apart.
CLOSE, CLOSE_FRACTION = 1.0, 0.01
MOST_STEPS = 4  # to 6.6 times the highest frequency of rigid bodies: some 48 kHz of the paper's shoe


class Comparison(NamedTuple):
    """By numbers which eigenvalues are which with further shapes, the one whose growth rate changes most, if any.

    `stays` says that none changes by more than 1 1/s or 1 %, and that none is lost.
    """

    pairs: dict[int, int]
    worst: int | None
    stays: bool


def compare(own: Sequence[complex], others: Sequence[complex], below: float) -> Comparison:
    """Compare growth rates of eigenvalues (1/s) up to a frequency (rad/s) with those of further shapes."""
    compared = [i for i, each in enumerate(own) if each.imag <= below]
    nearest = pair_nearest([own[i] for i in compared], others)
    pairs = {compared[i]: j for i, j in nearest.items()}

    def change(i: int) -> float:
        return abs(others[pairs[i]].real - own[i].real) / max(CLOSE, CLOSE_FRACTION * abs(own[i].real))

    worst = max(pairs, key=change, default=None)
    return Comparison(pairs, worst, len(pairs) == len(compared) and (worst is None or change(worst) <= 1))


def pair_nearest(own: Sequence[complex], others: Sequence[complex]) -> dict[int, int]:
    """The number of each eigenvalue and that of the nearest one of others, all of them together."""
    one, other = (np.array(each, dtype=complex) for each in (own, others))
    rows, columns = scipy.optimize.linear_sum_assignment(abs(one[:, None] - other) ** 2)
    return dict(zip(rows.tolist(), columns.tolist(), strict=True))


def up_to_of(scene: Scene, body: str) -> float:
    """Up to which frequency (Hz) motion of the "shoe" or the "drum" is resolved."""
    return resolved(scene).elastic_table(body)[1].up_to


def resolved(scene: Scene) -> Scene:
    """The scene with frequencies (Hz) in place of those that are to be found, so that each shoe alone has them, too."""
    return _with_up_to(scene, _find_up_to(scene)[0]) if _open(scene) else scene


def is_cut_short(scene: Scene) -> bool:
    """Whether "auto" ended before growth rates stayed as they are."""
    return bool(_open(scene)) and not _find_up_to(scene)[1]


@once
def _find_up_to(scene: Scene) -> tuple[float, bool]:
    """The least frequency (Hz) with which growth rates stay as they are with further shapes, and whether they do.

    It is found step by step from the highest frequency of rigid bodies on the lining on, with one damping ratio and one
    coefficient of friction, so that it is the same for all of them.
    """
    if not any(_open(scene)):
        return np.inf, True
    up_to = first = _highest_of_rigid(scene)
    before = kept_shapes(_with_up_to(scene, up_to)).eigenvalues
    for _ in range(MOST_STEPS):
        try:
            after = kept_shapes(_with_up_to(scene, MORE * up_to)).eigenvalues
        except RequestError:  # so many shapes are not found
            break
        # What grows next to the highest of rigid bodies counts from the start: bodies that bend couple with these.
        counts = (before.real > CLOSE) & (before.imag <= 2 * np.pi * max(MORE * first, up_to))
        below = np.max(before[counts].imag, initial=0.0) or 2 * np.pi * up_to
        if compare(before.tolist(), after.tolist(), below).stays:
            return up_to, True
        up_to, before = MORE * up_to, after
    return up_to, False


def _open(scene: Scene) -> list[bool]:
    """Of each frequency that is left open whether it is looked for: modal results are taken as far as they go."""
    tables: Any = *((shoe.elastic, shoe.modes is None) for shoe in scene.shoes), (scene.elastic_table("drum")[1], True)
    return [sought for table, sought in tables if table and table.up_to == "auto"]


def _with_up_to(scene: Scene, up_to: float) -> Scene:
    """The scene with a frequency (Hz) in place of each that is left open; of modal results their own."""

    def filled(table: Any, frequency: float) -> Any:
        return table.model_copy(update={"up_to": frequency}) if table and table.up_to == "auto" else table

    own = [float(shoe.modes.read().frequencies.max()) if shoe.modes else up_to for shoe in scene.shoes]
    shoes: list[Any] = [
        shoe.model_copy(update={"elastic": filled(shoe.elastic, each)})
        for shoe, each in zip(scene.shoes, own, strict=True)
    ]
    drum = scene.drum.model_copy(update={key: filled(getattr(scene.drum, key), up_to) for key in ("elastic", "mesh")})
    return scene.model_copy(update={"shoe": Shoes(shoes) if scene.several else shoes[0], "drum": drum})


def _highest_of_rigid(scene: Scene) -> float:
    """The highest frequency (Hz) of rigid shoes on a rigid drum, in full contact. Raises RequestError where it is 0."""
    found = []
    for one in scene.alone:
        rigid = one.model_copy(update={"shoe": one.shoe.model_copy(update={"elastic": None})})
        side, _ = one_side(rigid, 0.0, None)
        scale = 1 / np.sqrt(side.mass)
        found.append(np.linalg.eigvalsh(scale[:, None] * side.stiffness * scale)[-1])
    if max(found) <= 0:
        raise RequestError(
            'up_to = "auto" begins at the highest frequency of rigid bodies, and nothing holds a shoe here: write a '
            "frequency, or a contact stiffness above 0"
        )
    return float(np.sqrt(max(found)) / (2 * np.pi))


# Names, frequencies and numbers of these shapes, and what changes them.


SHAPING = ("shoe.outer_radius", "shoe.thickness", "shoe.width", "shoe.arc_angle", "shoe.elastic.poisson")
DRUM_SHAPING = ("shoe.outer_radius", *(f"drum.elastic.{key}" for key in ("thickness", "width", "back_plate")))
DRUM_SHAPING += ("drum.elastic.hub_radius", "drum.elastic.poisson")


def shoe_modes(scene: Scene) -> Any:
    """In which shapes the scene's shoe bends: free modes up to the frequency asked for, and what `basis.py` adds.

    `FreeModes` of a sector, `SolidModes` of a file; of what is rigid None, or the file's inertia without shapes.
    """
    return trial_shoe(scene) if scene.shoe.elastic is None else kept_shapes(resolved(scene)).shapes(0)


def drum_modes(scene: Scene) -> DrumModes | None:
    """The same of the scene's drum, by its modes when clamped at its hub; None of a rigid one."""
    return None if scene.elastic_table("drum")[1] is None else kept_shapes(resolved(scene)).shapes(-1)


def elastic_frequencies(scene: Scene, body: str) -> list[float]:
    """Frequencies (Hz) of the shapes of the "shoe" or of the "drum"; none of a rigid one.

    Up to the frequency asked for they are those of free modes, of a drum when clamped at its hub.
    """
    return frequencies_of(scene, body, drum_modes(scene) if body == "drum" else shoe_modes(scene)).tolist()


def count_modes(scene: Scene, body: str) -> int:
    """How many of the shapes are free modes, or the clamped drum's."""
    if scene.elastic_table(body)[1] is None:
        return 0
    return int(np.sum(np.array(elastic_frequencies(scene, body)) <= up_to_of(scene, body)))


def symmetric_modes(scene: Scene) -> tuple[bool, ...]:
    """Which of the shoe's free modes the plane z = 0 mirrors: of those of a file, none is taken to be."""
    even = getattr(shoe_modes(scene), "symmetric", None)
    return (False,) * len(elastic_frequencies(scene, "shoe")) if even is None else even


def elastic_names(scene: Scene, *, symmetric: bool = False) -> tuple[str, ...]:
    """Names of the shapes of the scene's shoe, E1, E2 and so on; of those that are symmetric about z = 0."""
    even = symmetric_modes(scene)
    names = shape_names(count_modes(scene, "shoe"), len(even))
    return tuple(name for name, each in zip(names, even, strict=True) if each or not symmetric)


def drum_names(scene: Scene) -> tuple[str, ...]:
    """Names of the shapes of the scene's drum: drum.E1, drum.E2 and so on."""
    return shape_names(count_modes(scene, "drum"), len(elastic_frequencies(scene, "drum")), DRUM)


def numbers_of(scene: Scene) -> dict[str, Any]:
    """The numbers that a model is assembled from: those of the scene, and the modes of its shoes and its drum."""
    return numbers_of_shoes(scene) | numbers_of_drum(scene, drum_modes(scene))


def numbers_of_shoes(scene: Scene) -> dict[str, Any]:
    """Those without the modes of the drum."""
    found = scene.numbers()
    for k, one in enumerate(resolved(scene).alone):
        found |= {scene.key_of(k, key): each for key, each in numbers_of_shoe(one, shoe_modes(one)).items()}
    return found


def shaping_numbers(scene: Scene) -> tuple[str, ...]:
    """Keys of the numbers with which the shapes of the shoe's and the drum's modes change: none of rigid ones."""
    return tuple(dict.fromkeys(key for keys in _shaping(scene).values() for key in keys))


def _shaping(scene: Scene) -> dict[str, tuple[str, ...]]:
    """These by body: of a drum's mesh Poisson's ratio, with point masses density, of several materials all of them."""
    shoes = (scene.key_of(k, key) for k, one in enumerate(resolved(scene).alone) for key in _shaping_the_shoe(one))
    mesh = scene.drum.mesh
    shaping = DRUM_SHAPING
    if mesh is not None:
        beside = ("drum.mesh.density",) if mesh.read().point_masses.any() else ()
        shaping = ("drum.mesh.",) if mesh.material else ("drum.mesh.poisson", *beside)
    shaping = tuple(each for key in shaping for each in scene.as_one(scene.key_of(0, key)))
    drum = [key for key in scene.numbers() if key.startswith(shaping)] if drum_names(scene) else []
    return {"shoe": tuple(shoes), "drum": tuple(drum)}


def _shaping_the_shoe(scene: Scene) -> tuple[str, ...]:
    """Of a mesh, all that its materials are, on which its inertia depends, too; of a file, the patches of its nodes."""
    if scene.shoe.solid is None:
        return SHAPING * bool(elastic_names(scene))
    materials = ("shoe.density", "shoe.elastic", "shoe.mesh")
    return tuple(key for key in scene.numbers() if key.startswith(materials) or key.endswith(".radius"))


def check_shapes_stay(scene: Scene, key: str) -> None:
    """Raise RequestError for a number that a model cannot follow: the shapes of elastic modes change with it.

    Density and Young's modulus are followed exactly, for they only scale the modes.
    """
    if key in shaping_numbers(scene):
        bodies = [name for name, keys in _shaping(scene).items() if key in keys]
        raise RequestError(
            f"{key}: the modes of the elastic {' and '.join(bodies)} change with it, and are found for one value after "
            f"the other only by: drumsqueal sweep SCENE --vary {key}=FROM..TO; or leave out "
            f"{' and '.join(scene.elastic_table(name)[0] for name in bodies)}"
        )
