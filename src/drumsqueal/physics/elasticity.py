"""Names, frequencies and numbers of the shapes in which a scene's shoe and drum bend, and what changes these shapes."""

from typing import Any

import numpy as np

from drumsqueal.coordinates import DRUM, shape_names
from drumsqueal.errors import RequestError
from drumsqueal.physics.basis import kept_shapes
from drumsqueal.physics.bodies.drum_modes import DrumModes
from drumsqueal.physics.trial_shapes import frequencies_of, numbers_of_drum, numbers_of_shoe, trial_shoe
from drumsqueal.physics.up_to import resolved, up_to_of
from drumsqueal.scene import Scene

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
