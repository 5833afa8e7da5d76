"""The elastic modes of a scene's shoe and drum: their names, frequencies and shapes, found once for each scene."""

import math
from typing import Any

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.drum_modes import DrumModes, find_drum_modes
from drumsqueal.physics.bodies.free_modes import FreeModes, find_free_modes
from drumsqueal.scene import Scene
from drumsqueal.scene.coordinates import DRUM
from drumsqueal.scene.usual import unusual

SHAPING = ("shoe.outer_radius", "shoe.thickness", "shoe.width", "shoe.arc_angle", "shoe.elastic.poisson")
DRUM_SHAPING = ("shoe.outer_radius", *(f"drum.elastic.{key}" for key in ("thickness", "width", "back_plate")))
DRUM_SHAPING += ("drum.elastic.hub_radius", "drum.elastic.poisson")
STEP_OF_DEGREES = 4
# Of the modes, among a model's numbers.
WAVENUMBERS, SHAPES = "shoe.elastic.wavenumbers", "shoe.elastic.shapes"
DRUM_WAVENUMBERS, DRUM_SHAPES = "drum.elastic.wavenumbers", "drum.elastic.shapes"


def free_modes(scene: Scene) -> FreeModes | None:
    """The free modes of the scene's shoe up to the frequency that it asks for; None of a rigid one."""
    shoe, elastic = scene.shoe, scene.shoe.elastic
    if elastic is None:
        return None
    highest = 2 * math.pi * elastic.up_to * math.sqrt(shoe.density / elastic.young)
    try:
        return find_free_modes(shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle, elastic.poisson, highest)
    except ArithmeticError as error:
        raise RequestError(f"the shoe's free modes were not found: {error}") from None
    except RequestError as error:  # which a number in a wrong unit may have brought about
        raise RequestError("; ".join([str(error), *unusual(scene)])) from None


def drum_modes(scene: Scene) -> DrumModes | None:
    """The modes of the scene's drum, clamped at its hub, up to the frequency that it asks for; None of a rigid one."""
    drum = scene.drum.elastic
    if drum is None:
        return None
    highest = 2 * math.pi * drum.up_to * math.sqrt(drum.density / drum.young)
    sizes = drum.thickness, drum.width, drum.back_plate, drum.hub_radius
    try:
        return find_drum_modes(scene.shoe.outer_radius, *sizes, drum.poisson, highest)
    except RequestError as error:  # which a number in a wrong unit may have brought about
        raise RequestError("; ".join([str(error), *unusual(scene)])) from None


def elastic_frequencies(scene: Scene, body: str) -> list[float]:
    """Frequencies (Hz) of the "shoe"'s free modes, or of the "drum"'s; none of a rigid one."""
    drum = body == "drum"
    modes, elastic = (drum_modes(scene) if drum else free_modes(scene)), getattr(scene, body).elastic
    if modes is None or elastic is None:
        return []
    density = getattr(elastic, "density", scene.shoe.density)
    return (modes.wavenumbers * math.sqrt(elastic.young / density) / (2 * math.pi)).tolist()


def elastic_names(scene: Scene, *, symmetric: bool = False) -> tuple[str, ...]:
    """Names of the free modes of the scene's shoe, E1, E2 and so on; of those that are symmetric about z = 0."""
    modes = free_modes(scene)
    even = () if modes is None else modes.symmetric
    return tuple(f"E{k}" for k, each in enumerate(even, start=1) if each or not symmetric)


def drum_names(scene: Scene) -> tuple[str, ...]:
    """Names of the modes of the scene's drum: drum.E1, drum.E2 and so on."""
    modes = drum_modes(scene)
    return () if modes is None else tuple(f"{DRUM}E{k + 1}" for k in range(len(modes.wavenumbers)))


def numbers_of(scene: Scene) -> dict[str, Any]:
    """The numbers that a model is assembled from: those of the scene, and the modes of its shoe and its drum."""
    shoe, drum = free_modes(scene), drum_modes(scene)
    found = scene.numbers() | ({} if shoe is None else modal_numbers(shoe))
    return found | ({} if drum is None else drum_numbers(drum))


def modal_numbers(modes: FreeModes, most: int | None = None) -> dict[str, Any]:
    """Wavenumbers and shapes of so many modes, polynomials with zeros beyond their degrees.

    So that shoes of about one size, whose shapes are of other degrees, share a program.
    """
    degrees = ((0, -degree % STEP_OF_DEGREES) for degree in modes.coefficients.shape[2:])
    shapes = np.pad(modes.coefficients[:most], ((0, 0), (0, 0), *degrees))
    return {WAVENUMBERS: modes.wavenumbers[:most], SHAPES: shapes}


def drum_numbers(modes: DrumModes, most: int | None = None) -> dict[str, Any]:
    """The same of a drum."""
    shapes = modes.coefficients[:most]
    across = np.pad(shapes, ((0, 0), (0, 0), (0, 0), (0, -shapes.shape[-1] % STEP_OF_DEGREES)))
    return {DRUM_WAVENUMBERS: modes.wavenumbers[:most], DRUM_SHAPES: across}


def shaping_numbers(scene: Scene) -> tuple[str, ...]:
    """Keys of the numbers with which the shapes of the shoe's and the drum's modes change: none of rigid ones."""
    shoe, drum = elastic_names(scene), drum_names(scene)
    return tuple(dict.fromkeys((*SHAPING * bool(shoe), *DRUM_SHAPING * bool(drum))))


def check_shapes_stay(scene: Scene, key: str) -> None:
    """Raise RequestError for a number that a model cannot follow: the shapes of elastic modes change with it.

    Density and Young's modulus are followed exactly, for they only scale the modes.
    """
    if key in shaping_numbers(scene):
        shoe, drum = key in SHAPING and bool(elastic_names(scene)), key in DRUM_SHAPING and bool(drum_names(scene))
        bodies = [name for name, changes in (("shoe", shoe), ("drum", drum)) if changes]
        raise RequestError(
            f"{key}: the modes of the elastic {' and '.join(bodies)} change with it, and are found for one value after "
            f"the other only by: drumsqueal sweep SCENE --vary {key}=FROM..TO; or leave out "
            f"{' and '.join(f'{name}.elastic' for name in bodies)}"
        )
