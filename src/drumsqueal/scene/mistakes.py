"""What pydantic found wrong with a scene, in one line a user can act on."""

from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from drumsqueal.errors import nearest
from drumsqueal.scene.laws import LAWS
from drumsqueal.scene.quantities import KeyPath, SceneError, dotted
from drumsqueal.scene.readers import Reader
from drumsqueal.scene.shoes import ONE, SEVERAL

_MOST_NAMED = 4  # of the keys to mend

Models = Mapping[str, tuple[type[BaseModel], ...]]


def explain(error: ValidationError, models: Models, source: str) -> SceneError:
    """Return the first mistake as a SceneError, with the number of the others and the keys of some.

    `models` has the models of each table by its dotted key, with 0 for any entry of a list of tables, and under ""
    the one of the whole scene.
    """
    # Unknown keys first: a key that is missing is often one that is misspelt.
    found = sorted(error.errors(include_url=False), key=lambda each: each["type"] != "extra_forbidden")
    first, *others = (_mistake(each, models) for each in found)
    named = ", ".join(
        [*(dotted(each.path) for each in others[:_MOST_NAMED]), *(["..."] if others[_MOST_NAMED:] else [])]
    )
    more = f" (and {len(others)} more to mend: {named})" if others else ""
    return SceneError(f"{first}{more}", (source,))


def _mistake(found: Any, models: Models) -> SceneError:
    loc, kind, value, context = list(found["loc"]), found["type"], found["input"], found.get("ctx", {})
    # Between table and key pydantic puts the law, and behind "shoe" whether there are several.
    if loc[:1] == ["shoe"] and loc[1:2] in ([ONE], [SEVERAL]):
        del loc[1]
    place = loc.index("friction") + 1 if "friction" in loc[:-1] else None
    law = LAWS[loc.pop(place)] if place is not None else None
    path: KeyPath = tuple(loc)
    model = law or (models.get(_table_of(path)) or models[""])[0]
    if isinstance(context.get("error"), SceneError):
        return context["error"].under(path, value)
    if kind == "extra_forbidden":
        return SceneError(_unknown(path, model, models), path)
    if kind == "missing":
        return SceneError(_missing(path, model), path)
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        choice = _choice(LAWS)
        if isinstance(value, Mapping) and "law" in value:
            return SceneError(f"write {choice}", (*path, "law"), value["law"])
        return SceneError(f"the key is missing; write law = {choice}", (*path, "law"))
    return SceneError(_wrong_type(kind, path, model), path, value)


def _table_of(path: KeyPath) -> str:
    """The key of the table that a path leads into, as `models` has it."""
    return ".".join("0" if isinstance(part, int) else part for part in path[:-1])


def _header(path: KeyPath) -> str:
    """How a file heads the table at a path."""
    named = ".".join(part for part in path if isinstance(part, str))
    return f"[[{named}]]" if isinstance(path[-1], int) else f"[{named}]"


def _unknown(path: KeyPath, model: type[BaseModel], models: Models) -> str:
    key = str(path[-1])
    laws = [law for law, other in LAWS.items() if key in other.model_fields]
    if model in LAWS.values() and laws:
        anew = '{ law = "constant", coefficient = 0.4 }'
        return f"this key belongs to law {_choice(laws)} only; remove it, or replace all of friction, as by {anew}"
    tables = sorted((table for table in models if table), key=lambda table: table.count("."))
    elsewhere = [f"{table}.{key}" for table in tables for other in models[table] if key in other.model_fields]
    near = [dotted((*path[:-1], name)) for name in nearest(key, model.model_fields)]
    for guess in elsewhere + near:
        return f"unknown key; did you mean {guess}?"
    return f"unknown key; the keys here are {', '.join(model.model_fields)}"


def _missing(path: KeyPath, model: type[BaseModel]) -> str:
    if len(path) == 1:
        return f"the table is missing; add [{path[0]}] with its keys"
    field = model.model_fields[str(path[-1])]
    readers = (each for each in field.metadata if isinstance(each, Reader))
    words = [word for word in get_args(field.annotation) if isinstance(word, str)]
    value = next((reader.example for reader in readers), f'"{words[0]}"' if words else "...")
    return f"the key is missing; add it to {_header(path[:-1])}, such as {path[-1]} = {value}"


def _wrong_type(kind: str, path: KeyPath, model: type[BaseModel]) -> str:
    if kind == "literal_error":
        return f"write {_choice(model.model_fields[str(path[-1])].annotation.__args__)}"  # pyright: ignore
    return {
        "tuple_type": f"this must be a list of tables; write each of them as [[{dotted(path)}]] with its keys",
        "bool_type": "write true or false",
        "string_type": "write a text in quotes",
        "string_too_long": "write a shorter text, of at most 1000 characters",
        "string_unicode": "write a text that is valid Unicode",
        "invalid_key": "a key must be a text",
    }.get(kind, f"this must be a table; write it as {_header(path)} with its keys")


def _choice(names: Any) -> str:
    return " or ".join(f'"{name}"' for name in names)
