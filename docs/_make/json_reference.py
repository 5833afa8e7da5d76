"""The keys of every command's JSON, from the models that write it; run as a program it renews docs/json.md.

Of each section whose first words name a model, all from "Keys:" on is made anew; the rest of the page stays.
"""

import importlib
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[1] / "json.md"
SECTION = re.compile(
    r"^### (?P<command>.*)\n\n`(?P<model>drumsqueal\.[\w.]+)`(?:.*\n)*?(?P<keys>Keys:(?:.*\n)*?)(?=\n### |\Z)", re.M
)
WIDTH = 118


def page(text: str) -> str:
    """The page with the keys of all models made anew."""
    told: dict[str, str] = {}

    def renewed(found: re.Match[str]) -> str:
        before = found[0].removesuffix(found["keys"])
        schema = model_named(found["model"]).model_json_schema(mode="serialization")
        return before + _keys(schema, found["command"], told)

    return SECTION.sub(renewed, text)


def model_named(path: str) -> Any:
    """The model of that dotted name."""
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def _keys(schema: dict[str, Any], command: str, told: dict[str, str]) -> str:
    keys = _wrap(f"Keys: {', '.join(f'`{key}`' for key in schema['properties'])}.")
    meanings = "".join(f"{_wrap(f'- `{key}`: {text}.')}\n" for key, text in _meanings(schema, command, told))
    return f"{keys}\n\n{meanings}" if meanings else f"{keys}\n"


def _meanings(schema: dict[str, Any], command: str, told: dict[str, str]) -> Iterator[tuple[str, str]]:
    """What the keys are that hold parts, each told once, or have a meaning of their own."""
    for key, field in schema["properties"].items():
        if key in ("scene", "title"):
            continue
        named = (schema["$defs"][name] for name in re.findall(r"#/\$defs/(\w+)", str(field)))
        parts = [each for each in named if "properties" in each]
        if not parts and "description" in field:
            yield key, _first(field)
        for part in parts:
            inside = ", ".join(_described(*each) for each in part["properties"].items())
            earlier = told.setdefault(inside, command)
            yield key, f"{_first(part)}: {inside}" if earlier == command else f"{_first(part)}, as of {earlier}"


def _described(key: str, field: dict[str, Any]) -> str:
    return f"`{key}` ({_first(field)})" if "description" in field else f"`{key}`"


def _first(schema: dict[str, Any]) -> str:
    """The first sentence of what something is."""
    text = " ".join(schema.get("description", "").split("\n\n")[0].split())
    return text.removesuffix(".")


def _wrap(text: str) -> str:
    return textwrap.fill(
        text,
        WIDTH,
        subsequent_indent="  " * text.startswith("- "),
        break_long_words=False,
        break_on_hyphens=False,
    )


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
