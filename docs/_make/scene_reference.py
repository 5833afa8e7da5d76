"""The reference of a scene's keys, from the models that check it; run as a program it writes docs/scene.md."""

import ast
import inspect
import itertools
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pydantic.fields import FieldInfo

from drumsqueal.scene import Scene
from drumsqueal.scene.laws import LAWS
from drumsqueal.scene.quantities import PerCoordinate, Quantities, Quantity, Reader, Scheduled, Table
from drumsqueal.scene.shoes import NamedShoe
from drumsqueal.scene.tables import FrictionTable, ShoeTable

PAGE = Path(__file__).parents[1] / "scene.md"
LEFT_OUT = ("shoe", "friction", "uncertain", "sha256")  # tables that are told by themselves, and what no one writes
BEGINNING = """# Scene reference

A scene is a TOML file of tables and keys. A value is a number in SI units or a string with a unit, such as `"100 mm"`;
every unit of the same dimension is read. `[shoe]`, `[contact]`, `[drum]` and `[simulate]` are in every scene; any other
table that is left out is an effect that is not in the model, but `[steady]` and `[start]`, which have defaults. A key
without a default has to be given where its table is, unless a file of yours gives it (`[shoe.mesh]`, `[shoe.modes]`).
`drumsqueal check SCENE` says what is wrong, and what follows from it.

Where a profile may stand, a number may be a table `{ time = ["0 s", "1 s"], value = ["0 N", "2 kN"] }`: linear between
its points, constant before the first and after the last.

Several shoes are `[[shoe]]`, once for each, with a `name` and a `position`; what follows `[shoe` is then of the last
one above it. Their coordinates begin with their name: `leading.X`. With `--set`, `--along` and `--vary` they are
counted from 0: `shoe.1.spring.0.stiffness`.

A table `[uncertain]` has distributions of numbers by their keys, for [random sweeps](sweep.md); other commands ignore
it.

This page is made from the models that check a scene.

## An example

```toml
title = "Nominal squeal"

[shoe]
outer_radius = "100 mm"
thickness = "20 mm"
width = "36.5 mm"
arc_angle = "130 deg"
density = "7820 kg/m^3"

[support]
upper_stiffness = "1e8 N/m"
lower_stiffness = "6e8 N/m"

[contact]
stiffness = "0.35e11 N/m^3"
normal_load = "2000 N"          # or a profile: { time = ["0 s", "1 s"], value = ["0 N", "2000 N"] }
separation = true

[friction]
law = "exponential"             # falls with the slip speed s: kinetic + (static − kinetic) exp(−decay s)
static = 0.5
kinetic = 0.3
decay = "1 s/m"
direction = "unit-velocity"     # or "tangential"

[drum]
speed = "5 rad/s"               # or a profile, linear between its points

[damping]
ratio = 0.005                   # of each mode of the frictionless shoe

[temperature]                   # of the lining: C dϑ/dt = heat of friction − h ϑ, from ϑ = 0
heat_capacity = "300 J/K"
cooling = "2 W/K"
fade = "0.001 1/K"              # friction falls by max(0, 1 − fade ϑ)

[forcing]                       # a harmonic force: amplitude sin(2π frequency t + phase)
amplitude = { Y = "0.1 N" }
frequency = "1 kHz"

[steady]
state = "uniform-pressure"      # or "self-consistent"

[start]                         # initial displacement and velocity, relative to steady sliding
displacement = { Y = "1e-7 m", Tz = "1e-6 rad" }
velocity = {}

[simulate]
duration = "0.4 s"
sample_rate = "50 kHz"
tolerance = 1e-6                # relative, of the trajectory in its growth phase
solver = "auto"                 # "dopri8" until friction is stiff, then "sdirk4" (implicit); or one of these,
                                # "tsit5" or "dopri5" throughout; or diffrax integrates, as by "diffrax.Kvaerno5"
coordinates = "auto"            # or a list, such as ["X", "Y", "Tz"]
```
"""


class Part(NamedTuple):
    """A table of the page: how it is written in a file, and its models, of which one has to be chosen."""

    heading: str
    model: type[Table]


def page() -> str:
    """The text of the page."""
    return "\n".join([BEGINNING, *(line for part in parts(Scene) for line in section(part))])


def parts(model: type[Table], path: str = "") -> Iterator[Part]:
    """A model and all the tables in it, by the order of their keys."""
    if path != "friction":
        yield Part(f"[{path}]" if path else "Keys before the first table", model)
    for key, field in model.model_fields.items():
        within = f"{path}.{key}" if path else key
        if within == "friction":
            yield Part("[friction]", FrictionTable)
            for name, law in LAWS.items():
                yield Part(f'[friction] with law = "{name}"', law)
        elif within == "shoe":
            yield from parts(ShoeTable, within)
            yield Part("[[shoe]], of several, besides", NamedShoe)
        else:
            for each in _models(field.annotation):
                several = "[" if typing.get_origin(field.annotation) is tuple else ""
                for part in parts(each, within):
                    yield part._replace(heading=f"{several}{part.heading}{']' * len(several)}") if several else part


def section(part: Part) -> Iterator[str]:
    """Heading, what the table is, and its keys."""
    base: type[Table] = next(each for each in part.model.__mro__[1:] if issubclass(each, Table))
    besides = part.model is NamedShoe or part.model in LAWS.values()
    fields = {
        key: field
        for key, field in part.model.model_fields.items()
        if not (besides and (key in base.model_fields or key == "law")) and key not in LEFT_OUT
    }
    plain = {key: field for key, field in fields.items() if not any(_models(field.annotation))}
    yield f"## {part.heading}\n"
    if part.model is not Scene:
        yield f"{' '.join((inspect.getdoc(part.model) or '').split())}\n"
    if plain:
        yield "| key | meaning | unit | default | values |\n| --- | --- | --- | --- | --- |"
        docs = meanings(part.model)
        for key, field in plain.items():
            yield f"| `{key}` | {docs[key]} | {_unit(field)} | {_default(field, docs[key])} | {_limits(field)} |"
        yield ""


def meanings(model: type[Table]) -> dict[str, str]:
    """What stands below each key of a model in the source."""
    found: dict[str, str] = {}
    for each in reversed(model.__mro__):
        if issubclass(each, Table):
            (body,) = (node.body for node in ast.parse(inspect.getsource(each)).body if isinstance(node, ast.ClassDef))
            for before, after in itertools.pairwise(body):
                if isinstance(before, ast.AnnAssign) and isinstance(before.target, ast.Name):
                    match after:
                        case ast.Expr(ast.Constant(str(text))):
                            found[before.target.id] = text
    return found


def _models(annotation: Any) -> Iterator[type[Table]]:
    """The tables that a key may hold."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    elif typing.get_origin(annotation) in (tuple, typing.Union, types.UnionType):
        for each in typing.get_args(annotation):
            yield from _models(each)


def _reader(field: FieldInfo) -> Reader | None:
    return next((each for each in field.metadata if isinstance(each, Reader)), None)


def _unit(field: FieldInfo) -> str:
    match _reader(field):
        case Quantity(unit=unit) | Quantities(quantity=Quantity(unit=unit)):
            return unit or "1"
        case PerCoordinate() as per:
            return f"{per.length_unit}; of rotations {per.angle_unit}, of modes {per.modal_unit}"
        case None:
            return ""
    return "m" if "P" in type(_reader(field)).__name__ else "1"


def _default(field: FieldInfo, meaning: str) -> str:
    if field.is_required():
        return ""
    value = field.get_default(call_default_factory=True)
    if value is None and "by default" in meaning:
        return "see meaning"
    if value in (None, (), {}) or isinstance(value, Mapping):
        return "none"
    return f"`{str(value).lower()}`" if isinstance(value, bool) else f"`{value!r}`".replace("'", '"')


def _limits(field: FieldInfo) -> str:
    if isinstance(reader := _reader(field), Quantity):
        bounds = ((">", reader.above), ("≥", reader.least), ("≤", reader.most))
        found = [f"{sign} {bound:g}" for sign, bound in bounds if bound is not None]
        return ", ".join(found + ["or a profile"] * isinstance(reader, Scheduled))
    choices = [each for each in _flat(field.annotation) if isinstance(each, str)]
    if choices:
        listed = ", ".join(f'`"{each}"`' for each in choices)
        return listed + (", or a list" if typing.get_origin(field.annotation) is not typing.Literal else "")
    if field.annotation is bool:
        return "`true`, `false`"
    return "" if reader is None else f"such as `{reader.example}`"


def _flat(annotation: Any) -> Iterator[Any]:
    if typing.get_origin(annotation) is typing.Literal:
        yield from typing.get_args(annotation)
    elif typing.get_origin(annotation) in (typing.Union, types.UnionType):
        for each in typing.get_args(annotation):
            yield from _flat(each)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
