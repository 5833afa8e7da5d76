"""What the site needs besides pages: the README as its first page, the example, and equations that browsers draw."""

import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File

ROOT = Path(__file__).parents[2]
# Pages that repositories show by themselves, whose links are from the folder above.
ABOVE = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "CONTRIBUTING.md",
    "CHANGELOG.md": "CHANGELOG.md",
    "examples/seo_kang_2023.py": "seo_kang_2023.md",
}
CODE = re.compile(r"(```.*?```|`[^`\n]*`|^ {4}.*?$)", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"\$([^$]+)\$")


def on_config(config: Any) -> Any:
    """Let fences of `math`, which repositories show as equations, be equations here as well."""
    fence = {"name": "math", "class": "math", "format": _equation}
    config.mdx_configs.setdefault("pymdownx.superfences", {}).setdefault("custom_fences", []).append(fence)
    return config


def on_files(files: Any, config: Any) -> Any:
    """Begin with the README."""
    for name, page in ABOVE.items():
        text = (ROOT / name).read_text(encoding="utf-8").replace("(docs/", "(")
        if name.endswith(".py"):
            text = f"# A paper, recomputed\n\n[What it finds](paper.md).\n\n```python\n{text}```\n"
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Equations within lines; pages from above are here, too."""
    for name, page in ABOVE.items():
        markdown = markdown.replace(f"(../{name}", f"({page}")
    parts = CODE.split(markdown)
    parts[::2] = [INLINE.sub(_within_line, part) for part in parts[::2]]
    return "".join(parts)


def _within_line(found: re.Match[str]) -> str:
    return f"<span>{convert(found[1])}</span>"  # a line that begins with <math> would be a block of its own


def _equation(source: str, *_: Any, **__: Any) -> str:
    return f'<div class="math">{convert(source, display="block")}</div>'
