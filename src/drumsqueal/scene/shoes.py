"""A brake with several shoes on one drum: the tables of each, and the brake of each alone."""

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, Union

from pydantic import AfterValidator, Discriminator, Field, Tag

from drumsqueal.coordinates import COORDINATES, DRUM, is_of_drum, shoe_of
from drumsqueal.errors import RequestError
from drumsqueal.scene.laws import LAWS
from drumsqueal.scene.mesh import MATCHED
from drumsqueal.scene.quantities import Quantity, SceneError, percent
from drumsqueal.scene.tables import ContactTable, DampingTable, FrictionTable, ShoeTable
from drumsqueal.scene.uncertain import flat

if TYPE_CHECKING:
    AnyLaw = FrictionTable
    AnyShoe = ShoeTable
else:
    AnyLaw = Annotated[Union[tuple(LAWS.values())], Field(discriminator="law")]  # noqa: UP007 (of what is found)

ONE, SEVERAL = "one", "several"  # what pydantic puts behind "shoe" in the path to a mistake
OWN = ("contact", "friction", "damping")
"""Tables that serve all shoes, and that one may have of its own."""
BY_COORDINATE = {"start": ("displacement", "velocity"), "forcing": ("amplitude",)}
"""The keys of tables that have a number for each coordinate."""
_START = re.compile(r"(start\.(?:displacement|velocity)\.)(.+)")


def _name(name: Any) -> str:
    a_word = isinstance(name, str) and re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name)
    if not a_word or name in (*COORDINATES, DRUM.removesuffix(".")):
        reason = "a shoe's name begins with a letter and has letters, digits, - and _ after it; drum is the drum's"
        raise SceneError(f'{reason}; write one such as "leading"')
    longest_name = 40  # letters: it names a folder of results, too
    if len(name) > longest_name:
        raise SceneError(f"a shoe's name has at most {longest_name} letters, and this has {len(name)}; shorten it")
    return name


class NamedShoe(ShoeTable):
    """One of several shoes: its name, and its position, the angle in rad from the x axis to the middle of its lining.

    Its own axes are turned by it. A table `contact`, `friction` or `damping` of its own takes the place of the scene's.
    """

    name: Annotated[str, AfterValidator(_name)]
    """What its coordinates, files and results begin with."""
    position: Annotated[float, Quantity("rad")]
    """Angle from the x axis of the brake to the middle of its lining."""
    contact: ContactTable | None = None
    """In place of the scene's."""
    friction: AnyLaw | None = None
    """In place of the scene's."""
    damping: DampingTable | None = None
    """In place of the scene's."""


class Shoes(tuple[NamedShoe, ...]):
    """Several shoes; asked for what one shoe has, such as its thickness, it raises RequestError."""

    __slots__ = ()

    def __getattr__(self, key: str) -> NoReturn:
        """Refuse what only one shoe has."""
        if key in NamedShoe.model_fields:
            raise self.refused
        raise AttributeError(key)

    @property
    def refused(self) -> RequestError:
        """Of what is asked of one shoe."""
        names = " or ".join(f"--set shoe={each.name}" for each in self)
        return RequestError(f"this is asked of one shoe, and the brake has {len(self)}; take one of them by {names}")


def is_of_no_shoe(key: str, shoe: Any) -> bool:
    """Whether a key is of a shoe where there are several and does not say which: shoe.thickness, leading.thickness."""
    if not isinstance(shoe, Shoes):
        return False
    table, _, within = key.partition(".")
    number = within.partition(".")[0]
    return table in [each.name for each in shoe] or (table == "shoe" and number not in map(str, range(len(shoe))))


def check_one(shoe: Any) -> None:
    """Raise RequestError for several shoes."""
    if isinstance(shoe, Shoes):
        raise shoe.refused


def _together(shoes: tuple[NamedShoe, ...]) -> Shoes:
    """Check that shoes share a drum and leave each other room."""
    same = 1e-9  # of the drum's radius: what units may leave between those of two shoes
    if len(shoes) < 2:
        reason = "one shoe is a table [shoe], in single brackets, without name and position; for two write [[shoe]]"
        raise SceneError(f"{reason} twice")
    for (j, first), (k, second) in itertools.combinations(enumerate(shoes), 2):
        if first.name == second.name:
            raise SceneError("two shoes have this name; give each its own", (k, "name"), second.name)
        # A radius out of a file has the round-off of its mesher, and cannot be edited.
        of_file = "outer_radius" in (*first.found, *second.found)
        if abs(first.outer_radius - second.outer_radius) > (MATCHED if of_file else same) * first.outer_radius:
            reason = f"all shoes rub on one drum, and shoe.{j}.outer_radius is {first.outer_radius:.12g} m"
            cure = f"make them equal to {percent(MATCHED)}" if of_file else "make them equal"
            raise SceneError(f"{reason}; {cure}", (k, "outer_radius"), second.outer_radius)
        apart = abs(math.remainder(second.position - first.position, math.tau))
        least = (first.arc_angle + second.arc_angle) / 2
        if apart < least * (1 - same):
            reason = f"the linings of {first.name} and {second.name} overlap"
            cure = f"put them at least {math.degrees(least):.6g} deg apart"
            if max(abs(first.position), abs(second.position)) > math.tau:
                cure += "; a number without a unit is in rad"
            raise SceneError(f"{reason}; {cure}", (k, "position"), second.position)
    return Shoes(shoes)


if not TYPE_CHECKING:
    AnyShoe = Annotated[
        Annotated[ShoeTable, Tag(ONE)] | Annotated[tuple[NamedShoe, ...], AfterValidator(_together), Tag(SEVERAL)],
        Discriminator(lambda written: SEVERAL if isinstance(written, list | tuple) else ONE),
    ]


def key_alone(key: str) -> str:
    """The key that a number of a brake with several shoes has in the scene of its shoe alone, see `Scene.key_of`."""
    within = re.fullmatch(r"shoe\.[0-9]+\.(.+)", key)
    if within is None:
        return key
    return within[1] if within[1].partition(".")[0] in OWN else f"shoe.{within[1]}"


def key_of_one(key: str, k: int, name: str) -> str:
    """The key in the scene of shoe number k alone, which has this name, of a number of the brake or its start."""
    within = _START.fullmatch(key)
    if within is not None:
        return within[1] + within[2].removeprefix(f"{name}.")
    return key_alone(key) if key.startswith(f"shoe.{k}.") else key


def alone(tables: Mapping[str, Any], name: Any) -> dict[str, Any]:
    """The tables of the brake with one of its shoes, by its name: in its own axes, its coordinates without the name.

    Raises SceneError where no shoe is called so.
    """
    shoes: Any = tables.get("shoe")
    named: dict[Any, Any] = (
        {each.get("name"): each for each in shoes if isinstance(each, Mapping)}
        if isinstance(shoes, list | tuple)
        else {}
    )
    if name not in named:
        there = f"the shoes are {' and '.join(map(str, named))}" if named else "this scene has one shoe, without a name"
        raise SceneError(f"no shoe has this name; {there}", ("shoe",), name)
    shoe = dict(named[name])
    found = {**tables, **{key: shoe.pop(key) for key in OWN if key in shoe}}
    found["shoe"] = {key: each for key, each in shoe.items() if key not in ("name", "position")}
    found["title"] = ": ".join(part for part in (str(tables.get("title", "")), f"{name} shoe") if part)
    for table, keys in BY_COORDINATE.items():
        if isinstance(found.get(table), Mapping):
            within = {key: _own(found[table][key], name) for key in keys if key in found[table]}
            found[table] = {**found[table], **within}
            acts = (any(each.values()) if isinstance(each, Mapping) else True for each in within.values())
            if table != "start" and not any(acts):
                del found[table]  # it acts on other shoes alone
    listed = found.get("simulate", {}).get("coordinates", "auto")
    if not isinstance(listed, str):
        found["simulate"] = {**found["simulate"], "coordinates": list(_own(dict.fromkeys(listed), name))}
    if "friction" not in found:
        found.pop("temperature", None)  # of the others, which rub
    if isinstance(found.get("uncertain"), Mapping):
        place = list(named).index(name)
        ours = ((key, each) for key, each in flat(found["uncertain"]) if _concerns(key, place, named[name], shoes))
        found["uncertain"] = {key_of_one(key, place, name): each for key, each in ours}
    return found


def _concerns(key: str, k: int, shoe: Mapping[str, Any], shoes: Sequence[Any]) -> bool:
    """Whether a number of the brake, or of its start, is one of shoe number k, too."""
    table, _, within = key.partition(".")
    start = _START.fullmatch(key)
    if start is not None:
        return is_of_drum(start[2]) or shoe_of(start[2]) in ("", f"{shoe['name']}.")
    if table == "shoe":
        return within.partition(".")[0] not in [str(j) for j in range(len(shoes)) if j != k]
    return table not in OWN or table not in shoe  # which has its own in place of the scene's


def _own(by_coordinate: Any, name: Any) -> Any:
    """What is of one shoe, without its name, and of the drum."""
    if not isinstance(by_coordinate, Mapping):
        return by_coordinate
    of_drum = DRUM.removesuffix(".")
    nested = {key: each for key, each in by_coordinate.items() if isinstance(each, Mapping)}
    found = dict(nested.get(name, {}))
    found |= {f"{DRUM}{key}": each for key, each in nested.get(of_drum, {}).items()}
    for key, each in by_coordinate.items():
        if key not in nested and key.startswith((f"{name}.", DRUM)):
            found[key.removeprefix(f"{name}.")] = each
    return found
