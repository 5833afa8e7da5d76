"""The page: the template filled in, with a policy that forbids the network and every script but its own."""

import re
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from drumsqueal.questions.report.inline import hashed

MEGABYTE = 1e6
_HERE = Path(__file__).parent


def render(template: str, content: dict[str, Any]) -> str:
    """Fill in a template of this folder; whatever comes from a scene is escaped.

    The page states its own size.
    """
    style, script = ((_HERE / name).read_text(encoding="utf-8") for name in ("style.css", "view.js"))
    policy = (
        f"default-src 'none'; img-src data:; media-src data:; style-src {hashed(style)}; "
        f"script-src {hashed(script)}; base-uri 'none'; form-action 'none'"
    )
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "breakable": breakable}
    # Not escaped, for they are ours: what a browser takes as text to the end of the element.
    fixed = {"style": Markup(style), "script": Markup(script), "policy": policy}
    page = environment.get_template(template)
    text = page.render(**content, **fixed, size="0.00 MB")
    return page.render(**content, **fixed, size=f"{len(text.encode()) / MEGABYTE:.2f} MB")


def breakable(text: str) -> str:
    """A dotted key, or the heading of a column, that may go on in the next line after a dot or an underscore."""
    return Markup(re.sub(r"[._](?=\w)", r"\g<0><wbr>", str(escape(text))))


def number(value: float | None, form: str = ".4g", factor: float = 1.0) -> str:
    """A number as it reads well, with the number as it was found beside it for programs; a dash where there is none."""
    if value is None:
        return Markup('<span class="none">–<span class="unseen"> not reported</span></span>')
    shown = format(value if factor == 1 else factor * value, form) if value else "0"
    shown = shown.lstrip("+-") if float(shown) == 0 else shown  # round-off has no sign
    shown = re.sub(r"e([+-])0", r"e\1", shown).replace("e+", "e").replace("-", "−")
    return Markup('<data value="{}">{}</data>').format(repr(value), shown)
