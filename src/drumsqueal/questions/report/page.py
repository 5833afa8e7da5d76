"""The page: the template filled in with all that it needs, and a policy that forbids the network and other scripts."""

import base64
import hashlib
import importlib.metadata
import math
import re
import struct
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup, escape

from drumsqueal.errors import RequestError
from drumsqueal.findings.columns import Column, columns_of
from drumsqueal.findings.prediction import PredictedMode
from drumsqueal.ordinary import read_ordinary
from drumsqueal.physics.model import at_lining
from drumsqueal.scene import Scene

MEGABYTE = 1e6
LARGEST = 64 * 2**20  # bytes of a picture; those of drumsqueal have some 1 MB
_HERE = Path(__file__).parent
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


class Picture(NamedTuple):
    """A picture in the page: heading, what it shows, file name, size in points, and itself."""

    heading: str
    text: str
    file: str
    width: int
    height: int
    uri: str


def picture(path: Path, words: tuple[str, str]) -> Picture | None:
    """Read a PNG file; None where there is none. Raises RequestError for what is no PNG."""
    try:
        content = read_ordinary(path, LARGEST)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RequestError(f"{path}: cannot be read ({error.strerror or error})") from None
    if content[:8] != _SIGNATURE or content[12:16] != b"IHDR" or len(content) < 24:
        raise RequestError(f"{path} is not a PNG file, as the figures of drumsqueal are; run the scene again")
    width, height = struct.unpack(">II", content[16:24])
    return Picture(*words, path.name, width, height, data_uri("image/png", content))


def data_uri(kind: str, content: bytes) -> str:
    """The content as an address that holds it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def about_scene(scene: Scene) -> dict[str, Any]:
    """What a template takes of the scene."""
    toml = scene.to_toml()
    return {
        "title": scene.title or "Untitled scene",
        "tolerance": scene.simulate.tolerance,
        "toml": toml,
        "toml_uri": data_uri("application/toml", toml.encode()),
    }


def render(template: str, content: dict[str, Any]) -> str:
    """Fill in a template of this folder; whatever comes from a scene is escaped.

    The page states its own size, and allows by their hashes only its own style and script.
    """
    style, script = ((_HERE / name).read_text(encoding="utf-8") for name in ("style.css", "view.js"))
    hashes = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (style, script))
    policy = (
        "default-src 'none'; img-src data:; media-src data:; style-src 'sha256-{}'; script-src 'sha256-{}'; "
        "base-uri 'none'; form-action 'none'"
    ).format(*hashes)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "breakable": breakable, "at_lining": at_lining, "cell": cell}
    environment.globals["columns_of_mode"] = columns_of(PredictedMode)
    given = content | {
        "maker": importlib.metadata.version("drumsqueal"),
        # Not escaped, for they are ours: what a browser takes as text to the end of the element.
        "style": Markup(style),
        "script": Markup(script),
        "policy": policy,
    }
    page = environment.get_template(template)
    size = len(page.render(**given, size="0.00 MB").encode())
    return page.render(**given, size=f"{size / MEGABYTE:.2f} MB")


def breakable(text: str) -> str:
    """A dotted key, or the heading of a column, that may go on in the next line after a dot or an underscore."""
    return Markup(re.sub(r"[._](?=\w)", r"\g<0><wbr>", str(escape(text))))


def cell(value: Any, column: Column) -> str:
    """A value of a result as its column shows it."""
    return number(value, column.digits, column.factor) if isinstance(value, int | float) else value or "–"


def number(value: float | None, form: str = ".4g", factor: float = 1.0) -> str:
    """A number as it reads well, and as it was found for programs; a dash where there is none."""
    if value is None or math.isnan(value):
        return Markup('<span class="none">–<span class="unseen"> not reported</span></span>')
    shown = format(value if factor == 1 else factor * value, form) if value else "0"
    shown = shown.lstrip("+-") if float(shown) == 0 else shown  # round-off has no sign
    shown = re.sub(r"e([+-])0", r"e\1", shown).replace("e+", "e").replace("-", "−")
    return Markup('<data value="{}">{}</data>').format(repr(value), shown)
