"""How what was found is shown in Python: briefly by its name, and printed or in a notebook as its command prints it.

A class says with `printed_by` which function, of a console and of what was found, prints it: that one is imported when
it is asked for, for it brings what draws, too.
"""

import importlib
import io
import reprlib
import shutil
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from rich.console import Console

WIDTH = 100  # columns in a notebook

FEW = 3  # parts that are shown one by one


def headed(found: Any, title: str, *lines: str) -> str:
    """The name of what was found with a title, and lines below it."""
    return "\n".join([f"{type(found).__name__}: {title}".rstrip(": "), *filter(None, lines)])


def abridged(found: Any, fields: dict[str, Any]) -> str:
    """Its name and fields, as in Onset(parameter=Parameter(…), values=<40 Row>)."""
    inside = ", ".join(f"{name}={_brief(value)}" for name, value in fields.items())
    longest = 300  # characters of a part of findings
    cut = inside if len(inside) <= longest else f"{inside[:longest].rstrip()}…"
    return f"{type(found).__name__}({cut})"


def _brief(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if value is None or isinstance(value, int | complex | str):
        return reprlib.repr(value)
    if isinstance(value, dict):
        few = len(value) <= FEW and all(isinstance(each, int | float | str) for each in value.values())
        return f"{{{', '.join(f'{key}: {_brief(value[key])}' for key in value)}}}" if few else f"<{len(value)} entries>"
    if isinstance(value, tuple | list):
        few = len(value) <= FEW and all(isinstance(each, int | float | str) for each in value)
        kind = type(value[0]).__name__ if value else ""
        return f"({', '.join(map(_brief, value))})" if few else f"<{len(value)} {kind}>"
    return f"<array {value.shape}>" if hasattr(value, "shape") else f"{type(value).__name__}(…)"


def short(value: Any, unit: str = "") -> str:
    """A number or a few of them in six digits, with a unit; what is traced, as by `jax.grad`, has no value."""
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return "traced"
    if numbers.size > FEW**2:
        return f"<{numbers.size} numbers>"
    rows = (", ".join(f"{each:.6g}" for each in row) for row in np.atleast_2d(numbers))
    return f"{'; '.join(rows)} {unit}".rstrip()


def as_text(found: Any) -> str:
    """What its command prints, without an empty line at the end."""
    console = _console(width=shutil.get_terminal_size((WIDTH, 24)).columns)
    _print(console, found)
    return console.file.getvalue().rstrip()  # pyright: ignore[reportAttributeAccessIssue]


def as_html(found: Any) -> str:
    """The same for a notebook."""
    console = _console(width=WIDTH, record=True)
    _print(console, found)
    return console.export_html(
        code_format='<pre style="line-height: normal; overflow-x: auto; white-space: pre">{code}</pre>',
        inline_styles=True,
    )


def _console(**how: Any) -> "Console":
    from rich.console import Console  # not before something is shown

    return Console(file=io.StringIO(), highlight=False, markup=False, emoji=False, force_jupyter=False, **how)


def _print(console: "Console", found: Any) -> None:
    module, name = found.printed_by.rsplit(".", 1)
    getattr(importlib.import_module(module), name)(console, found)
