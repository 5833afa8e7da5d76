"""What is in a model and what is left out, without its numbers: it decides what is in the compiled program."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from drumsqueal.coordinates import is_of_drum
from drumsqueal.scene.shoes import key_alone

GIVEN = "given in Python"  # in place of the name of a friction law


class Composition(NamedTuple):
    """Coordinates (by name) and effects of a model; hashable, so that it can be static."""

    coordinates: tuple[str, ...]
    long_arc: bool = False
    separation: bool = False
    friction_law: str | None = None
    friction_direction: str | None = None
    steady_state: str = "uniform-pressure"
    support: bool = False
    damping: bool = False
    temperature: bool = False
    forced: tuple[str, ...] = ()
    springs: int = 0
    pushes: int = 0
    planar: bool = True
    symmetric_modes: tuple[bool, ...] = ()
    mesh: bool = False
    shoes: tuple["OneOfSeveral", ...] = ()


class OneOfSeveral(NamedTuple):
    """What one of several shoes calls for: alone, and under which names its coordinates and its numbers stand."""

    number: int
    prefix: str
    own: tuple[str, ...]
    composition: Composition

    def of(self, coordinates: tuple[str, ...]) -> Composition:
        """Its composition over those of a brake's coordinates that are its own, or the drum's."""
        mine = (name for name in coordinates if is_of_drum(name) or name.startswith(self.prefix))
        return self.composition._replace(coordinates=tuple(name.removeprefix(self.prefix) for name in mine))

    def values(self, numbers: Mapping[str, Any]) -> dict[str, Any]:
        """The numbers of a brake by the keys that it has alone; `shoe.position` is its angle on the drum."""
        prefix = f"shoe.{self.number}."
        found = {key: each for key, each in numbers.items() if key.partition(".")[0] not in ("shoe", *self.own)}
        return found | {key_alone(key): each for key, each in numbers.items() if key.startswith(prefix)}


# Of bodies, among a model's numbers.
WAVENUMBERS, SHAPES = "shoe.elastic.wavenumbers", "shoe.elastic.shapes"
MESH = "shoe.mesh."
DRUM_WAVENUMBERS, DRUM_SHAPES = "drum.elastic.wavenumbers", "drum.elastic.shapes"
MODAL = ".elastic.shapes"  # with which the keys of both end, of several shoes, too
