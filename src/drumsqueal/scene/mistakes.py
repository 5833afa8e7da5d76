"""What pydantic found wrong with a scene, in one line a user can act on."""

from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from drumsqueal.errors import nearest
from drumsqueal.scene.laws import LAWS
from drumsqueal.scene.quantities import KeyPath, SceneError, dotted
from drumsqueal.scene.readers import Reader
from drumsqueal.scene.shoes import ONE, SEVERAL

_MOST_NAMED = 20  # mistakes: of more, a file is another kind of thing

Models = Mapping[str, tuple[type[BaseModel], ...]]


def explain(error: ValidationError, models: Models, source: str) -> SceneError:
    """Return all mistakes as one SceneError.

    `models` has the models of each table by its dotted key, with 0 for any entry of a list of tables, and under ""
    the one of the whole scene.
    """
    # Unknown keys first: a key that is missing is often one that is misspelt, and then no mistake of its own.
    found = sorted(error.errors(include_url=False), key=lambda each: each["type"] != "extra_forbidden")
    mistakes = [_mistake(each, models) for each in found]
    meant = {each.meant for each in mistakes if isinstance(each, _UnknownKeyError)}
    missing = [each["type"] == "missing" for each in found]
    mistakes = [each for k, each in enumerate(mistakes) if not (missing[k] and dotted(each.path) in meant)]
    first, *others = mistakes
    listed = [f"[{number}] {each}" for number, each in enumerate(others[: _MOST_NAMED - 1], 2)]
    listed += ["..."] if len(mistakes) > _MOST_NAMED else []
    more = f" (and {len(others)} more to mend: {'; '.join(listed)})" if others else ""
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
        return _UnknownKeyError(path, model, models, value)
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


class _UnknownKeyError(SceneError):
    """A key that there is not, and the one that is `meant`, "" where none is likely."""

    def __init__(self, path: KeyPath, model: type[BaseModel], models: Models, value: Any) -> None:
        key, self.meant = str(path[-1]), ""
        laws = [law for law, other in LAWS.items() if key in other.model_fields]
        if model in LAWS.values() and laws:
            anew = '{ law = "constant", coefficient = 0.4 }'
            reason = (
                f"this key belongs to law {_choice(laws)} only; remove it, or replace all of friction, as by {anew}"
            )
        else:
            near = [dotted((*path[:-1], name)) for name in nearest(key, model.model_fields)]
            self.meant = next(iter([*_elsewhere(key, models, value), *near]), "")
            there = f"the keys here are {', '.join(model.model_fields)}"
            reason = f"unknown key; {f'did you mean {self.meant}?' if self.meant else there}"
        super().__init__(reason, path)


def _elsewhere(key: str, models: Models, value: Any) -> list[str]:
    """Where other tables have the key: as a table if it is one here, and else as a value."""
    is_table = isinstance(value, Mapping) or (isinstance(value, list) and any(isinstance(x, Mapping) for x in value))
    tables = sorted((table for table in models if table), key=lambda table: table.count("."))
    there = [f"{table}.{key}" for table in tables for other in models[table] if key in other.model_fields]
    return [each for each in there if is_table == (each in models or f"{each}.0" in models)]


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
