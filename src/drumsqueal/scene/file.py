"""A scene file and settings of the command line as plain nested tables, not yet checked; and the scenes of the package.

Shipped scenes are in a wheel among its files, in a clone in the folder next to src.
"""

import os
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

from pydantic import BaseModel, ValidationError

from drumsqueal.errors import nearest
from drumsqueal.ordinary import NotOrdinaryError, read_ordinary
from drumsqueal.scene.laws import LAWS
from drumsqueal.scene.quantities import DECIMAL_POINT, KeyPath, Reader, SceneError, dotted
from drumsqueal.scene.shoes import ONE, SEVERAL, alone

if TYPE_CHECKING:
    from drumsqueal.scene import Scene


TABLE_LISTS = ("shoe.spring", "shoe.force", "shoe.mesh.material", "drum.mesh.material")
"""Lists of tables, written as [[shoe.spring]]; a dotted key counts them from 0: shoe.spring.0.stiffness."""

OPTIONAL_TABLES = (
    *("support", "friction", "damping", "temperature", "forcing", "uncertain"),
    *("shoe.elastic", "shoe.mesh", "shoe.modes", "drum.elastic", "drum.mesh", *TABLE_LISTS),
)
"""The tables that a scene may leave out; `--set friction=none` leaves one out."""

_SHOE = re.compile(r"shoe\.[0-9]+(?=\.)")  # one of several


def is_list(key: str) -> bool:
    """Whether a list of tables stands at a dotted key, of one shoe or of one of several."""
    return _SHOE.sub("shoe", key) in TABLE_LISTS


def is_optional(key: str) -> bool:
    """Whether a scene may leave out the table at a dotted key: what each of several shoes may have of its own, too."""
    plain = _SHOE.sub("shoe", key)
    return plain in OPTIONAL_TABLES or (plain != key and plain.removeprefix("shoe.") in OPTIONAL_TABLES)


def read_tables(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a TOML file; raises SceneError, naming the file, if it is none or cannot be read."""
    path = Path(path)
    try:
        # A scene with two profiles of full length, as `to_toml` writes it, stays below this.
        content = read_ordinary(path, 16 * 2**20)
    except FileNotFoundError:
        meant = nearest(path.stem, shipped_names())
        other = "check the path, or take one that `drumsqueal scenes` lists"
        reason = f"there is no such file; {f'did you mean the shipped scene {meant[0]}?' if meant else other}"
    except IsADirectoryError:
        reason = "this is a directory; name a scene file, such as nominal.toml"
    except NotOrdinaryError as error:
        reason = f"{error.strerror}, so it is hardly a scene; name a scene file, such as nominal.toml"
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        cause = getattr(error, "strerror", None) or str(error)
        reason = f"the file cannot be read ({cause}); check the path and its permissions"
    else:
        return _with_files_beside(_parsed(content, str(path)), path.parent)
    raise SceneError(reason, (str(path),))


def _with_files_beside(tables: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The tables with the paths of meshes and modes, which a file gives from its own folder, given from here."""

    def found(body: Any) -> Any:
        if isinstance(body, list):
            return [found(each) for each in body]
        if not isinstance(body, Mapping):
            return body
        named = {key: body[key] for key in ("mesh", "modes") if isinstance(body.get(key), Mapping)}
        files = {key: table for key, table in named.items() if isinstance(table.get("file"), str)}
        return {**body, **{key: {**table, "file": str(folder / table["file"])} for key, table in files.items()}}

    return {key: found(table) if key in ("shoe", "drum") else table for key, table in tables.items()}


def _parsed(content: bytes, name: str) -> dict[str, Any]:
    if content.startswith((b"\x89HDF", b"CDF")):
        message = "this is a NetCDF file, such as a history, and no scene; name the scene's TOML file"
        takes = "animate, compare and export take a history, whose attribute scene is the scene that was run"
        raise SceneError(f"{message} ({takes})", (name,))
    try:
        text = content.decode("utf-8-sig")  # as editors of Windows save it
        text = text.replace("\r\n", "\n").replace("\r", "\n")  # CR alone ends lines of old files
        return _loads(text)
    except UnicodeDecodeError as error:
        reason = f"the file is not UTF-8 text (byte {error.start}); save it as UTF-8"
    except RecursionError:
        reason = "the tables are nested too deeply; a scene has two levels"
    except tomllib.TOMLDecodeError as error:
        reason = _decimal_comma(text, str(error)) or f"the file is not TOML: {error}; see the example scenes"
    except ValueError as error:
        reason = f"the file is no scene: {error}"
    raise SceneError(reason, (name,))


def _decimal_comma(text: str, error: str) -> str:
    """What to write in place of a decimal comma, if that is what is wrong with the line that the error names."""
    named = re.search(r"at line (\d+)", error)
    line = text.split("\n")[int(named[1]) - 1] if named else ""
    # A value outside quotes and lists: 0,45 in "static = 0,45" and in "{ Y = 0,45 }".
    value = r"""^[^"'#\[]*?([\w.-]+)\s*=\s*([+-]?\d+),(\d\S*?)\s*(?:[#},]|$)"""
    found = re.search(value, line) if len(line) <= 200 else None
    if named is None or found is None:
        return ""
    key, whole, fraction = found.groups()
    return f"line {named[1]}: {DECIMAL_POINT}; write {key} = {whole}.{fraction}"


def _loads(text: str) -> dict[str, Any]:
    """Read TOML; raises ValueError and RecursionError."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # which Python words for programmers
        raise ValueError("an integer has more digits than can be read; write it as 1e30") from None


def apply_setting(tables: Mapping[str, Any], setting: str) -> dict[str, Any]:
    """Return the tables with one "KEY=VALUE" of `--set` put in; raises SceneError.

    KEY is the dotted path in the file. VALUE is read as a TOML value and, if it is none, as a string. It replaces
    whatever was there; `none` leaves out one of the OPTIONAL_TABLES, and "shoe=NAME" all shoes but one of several.
    """
    key, equals, text = setting.partition("=")
    if not equals:
        raise SceneError("write KEY=VALUE, such as drum.speed=3", (f"--set {setting}",))
    value = _toml_value(text.strip())
    if is_optional(key.strip()) and value == "none":
        value = None
    return replace_value(tables, key, value)


def _toml_value(text: str) -> Any:
    try:
        read = _loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    # A line break in the text could have brought in keys of its own.
    return read["value"] if len(read) == 1 else text


def replace_value(tables: Mapping[str, Any], key: str, value: Any) -> dict[str, Any]:
    """Return the tables with the value put in at the dotted key, or the optional table left out if it is None.

    Tables on the way are made as needed, and a name in place of all shoes takes that one alone. Raises SceneError for a
    key that is none, or that leads through a value.
    """
    parts = [part.strip() for part in key.split(".")]
    if parts == ["shoe"] and isinstance(value, str):
        return alone(tables, value)
    if not all(parts) or len(parts) > 10:  # parts of a dotted key
        raise SceneError('this is no key; write a dotted path such as "drum.speed"', (f'"{key}"',))
    if value is None and not is_optional(key.strip()):
        raise SceneError(f"only the tables {', '.join(OPTIONAL_TABLES)} can be left out; give a value", tuple(parts))
    return _without(tables, parts) if value is None else _replaced(tables, parts, value)


def _without(tables: Mapping[str, Any], parts: list[str]) -> dict[str, Any]:
    first, *rest = parts
    if not rest:
        return {name: table for name, table in tables.items() if name != first}
    inner = tables.get(first)
    if isinstance(inner, list | tuple):  # of several shoes
        kept = [_without(each, rest[1:]) if str(k) == rest[0] else each for k, each in enumerate(inner)]
        return {**tables, first: kept}
    return {**tables, first: _without(inner, rest)} if isinstance(inner, Mapping) else dict(tables)


def _replaced(tables: Mapping[str, Any], parts: list[str], value: Any, done: int = 0) -> dict[str, Any]:
    # A quoted key of the file, such as "drum.speed" in the table uncertain, holds dots of its own.
    quoted = (key for key in tables if "." in key and f"{'.'.join(parts[done:])}.".startswith(f"{key}."))
    name = next(quoted, parts[done])
    done += name.count(".")
    if done + 1 < len(parts):
        where = ".".join(parts[: done + 1])
        inner = tables.get(name, [] if is_list(where) else {})
        value = _replaced_within(inner, where, parts, value, done + 1)
    return {**tables, name: value}


def _replaced_within(inner: Any, where: str, parts: list[str], value: Any, done: int) -> Any:
    """What stands at `where`, a table or a list, with the value put in at parts[done:]."""
    if isinstance(inner, Mapping):
        return _replaced(inner, parts, value, done)
    part = parts[done]
    if not isinstance(inner, list | tuple):
        raise SceneError(f"{where} is a value, not a table, so it has no key {part}", tuple(parts))
    index = next((k for k in range(len(inner)) if str(k) == part), None)
    if index is None:
        raise SceneError(no_entry(where, inner), tuple(parts))
    if done + 1 < len(parts):
        value = _replaced_within(inner[index], f"{where}.{part}", parts, value, done + 1)
    return [*inner[:index], value, *inner[index + 1 :]]


def no_entry(where: str, entries: Sequence[Any]) -> str:
    """Why a list of these entries has none of a certain number, and the cure."""
    if entries:
        count = len(entries)
        names = [each.get("name") if isinstance(each, Mapping) else getattr(each, "name", None) for each in entries]
        named = [f"{where}.{k} ({name})" for k, name in enumerate(names) if name]
        there = " or ".join(named) or f"{where}.0" + (f" to {where}.{count - 1}" if count > 1 else "")
        return f"entries are counted from 0, and this scene has {count} of {where}; write {there}"
    cure = f"add a table [[{where}]] to the file first" if is_list(where) else "set the whole list"
    return f"this scene has no {where}; {cure}"


# What pydantic found wrong with a scene, in one line a user can act on.


_Models = Mapping[str, tuple[type[BaseModel], ...]]


def explain(error: ValidationError, models: _Models, source: str) -> SceneError:
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
    most_named = 20  # mistakes: of more, a file is another kind of thing
    listed = [f"[{number}] {each}" for number, each in enumerate(others[: most_named - 1], 2)]
    listed += ["..."] if len(mistakes) > most_named else []
    more = f" (and {len(others)} more to mend: {'; '.join(listed)})" if others else ""
    return SceneError(f"{first}{more}", (source,))


def _mistake(found: Any, models: _Models) -> SceneError:
    loc, kind, value, context = list(found["loc"]), found["type"], found["input"], found.get("ctx", {})
    # Between table and key pydantic puts the law, and behind "shoe" whether there are several.
    if loc[:1] == ["shoe"] and loc[1:2] in ([ONE], [SEVERAL]):
        del loc[1]
    place = loc.index("friction") + 1 if "friction" in loc[:-1] else None
    law = LAWS[loc.pop(place)] if place is not None else None
    path: KeyPath = tuple(loc)
    table = ".".join("0" if isinstance(part, int) else part for part in path[:-1])  # as `models` has it
    model = law or (models.get(table) or models[""])[0]
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


def _header(path: KeyPath) -> str:
    """How a file heads the table at a path."""
    named = ".".join(part for part in path if isinstance(part, str))
    return f"[[{named}]]" if isinstance(path[-1], int) else f"[{named}]"


class _UnknownKeyError(SceneError):
    """A key that there is not, and the one that is `meant`, "" where none is likely."""

    def __init__(self, path: KeyPath, model: type[BaseModel], models: _Models, value: Any) -> None:
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


def _elsewhere(key: str, models: _Models, value: Any) -> list[str]:
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


class Shipped(NamedTuple):
    """A scene of the package: its name, its file, its title, and in a sentence or two what it shows."""

    name: str
    path: Path
    title: str
    shows: str


def shipped_names() -> tuple[str, ...]:
    """The names of all shipped scenes, such as nominal."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


def shipped_path(name: str) -> Path:
    """The file of a shipped scene. Raises SceneError for a name that none has."""
    if name not in shipped_names():
        meant = nearest(name, shipped_names())
        message = f"did you mean {meant[0]}?" if meant else f"there are {', '.join(shipped_names())}"
        raise SceneError(f"no shipped scene has this name; {message}", (name,))
    return _folder() / f"{name}.toml"


def find_scene(text: str) -> Path:
    """A scene file by its path or, where there is none, a shipped scene by its name; a folder may bear it, too."""
    path = Path(text)
    if text not in shipped_names() or (path.exists() and not path.is_dir()):
        return path
    return shipped_path(text)


def written(path: Path) -> str:
    """How a command names the file of a scene: one that is shipped by its name, if that finds it."""
    return path.stem if path.parent == _folder() and find_scene(path.stem) == path else str(path)


def shipped_scenes() -> tuple[Shipped, ...]:
    """All shipped scenes; what one shows is the comment at the head of its file."""
    return tuple(_read(name) for name in shipped_names())


def _read(name: str) -> Shipped:
    path = shipped_path(name)
    text, head = path.read_text(encoding="utf-8"), list[str]()
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        head.append(line.removeprefix("#").strip())
    return Shipped(name, path, tomllib.loads(text)["title"], " ".join(head))


def _folder() -> Path:
    folder = "scenarios"
    installed = Path(str(files("drumsqueal"))) / folder
    return installed if installed.is_dir() else Path(__file__).parents[3] / folder


def seo_kang_brake(settings: Iterable[str] = ()) -> "Scene":
    """The brake of the paper, with a start and a duration for its transients; `settings` as in `load_scene`.

    Raises SceneError for settings that make no scene.
    """
    from drumsqueal.scene import scene_from_dict

    # Table 1, and the friction curve of Figure 4, of Seo & Kang, Lubricants 2023, 11(12), 496.
    tables = {**read_tables(shipped_path("nominal")), "title": "Seo & Kang 2023"}
    for setting in settings:
        tables = apply_setting(tables, setting)
    return scene_from_dict(tables)
