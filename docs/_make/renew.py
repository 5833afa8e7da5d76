"""Makes the pages anew, and says what has changed: `python docs/_make/renew.py`, or with pages, such as docs/drum.md.

Runs every command of a page in a folder of its own, in the page's order, and puts what it prints now in place of what
stands below it: line by line, where a printed line has changed, for pages may leave lines out. Copies every picture
from the file that the comment below it names, runs the Python that draws pictures, and executes the notebooks. Some
pages take minutes, all of them some hours. A printed line that has no successor any more is left, and named.
"""

import argparse
import difflib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import nbformat
from nbclient import NotebookClient

import drawing
import scene_reference

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
COMMAND = re.compile(r"(?:\.venv/bin/|\$ )?(drumsqueal .*)")
PICTURE = re.compile(r"\]\(((?:docs/)?[\w-]+\.(?:png|gif))\)\n<!-- from (\S+) -->")
DRAWN = re.compile(r"```python\n(.*?savefig\(.*?)```", re.DOTALL)
INDENTED = re.compile(r"((?:^ {4}.*\n(?:\n(?= {4}))?)+)", re.MULTILINE)
FIRST = ("README.md", "run.md")  # whose results other pages go on with
ALIKE = 0.6  # ratio of difflib from which on a line is the successor of another
WIDTH = "100"  # columns


def main() -> None:
    """Renew the pages asked for, or all."""
    asked = argparse.ArgumentParser(description="Make the pages anew, and say what has changed")
    asked.add_argument("pages", nargs="*", type=Path, help="pages and notebooks instead of all")
    every = [ROOT / "README.md", *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("*.ipynb"))]
    pages = asked.parse_args().pages or sorted(every, key=lambda page: page.name not in FIRST)
    scene_reference.PAGE.write_text(scene_reference.page(), encoding="utf-8")
    drawing.style.save_figure(drawing.draw(), drawing.PICTURE)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        shutil.copytree(ROOT / "scenarios", folder / "scenarios")
        (folder / "docs").mkdir()
        for page in pages:
            if page.suffix == ".ipynb":
                renew_notebook(page)
            elif page.name in FIRST:
                renew_page(page, folder)
            else:
                with tempfile.TemporaryDirectory() as own:  # where no other page has written
                    renew_page(page, Path(shutil.copytree(folder, own, dirs_exist_ok=True)))


def renew_notebook(file: Path) -> None:
    """Execute a notebook and keep what it shows."""
    book = nbformat.read(file, 4)
    NotebookClient(book, timeout=600).execute(cwd=str(ROOT))
    nbformat.write(book, file)
    print(f"{file.name}: executed")


def renew_page(page: Path, folder: Path) -> None:
    """Run the commands of a page, and put in what they print and draw."""
    text = page.read_text(encoding="utf-8")
    for name, block in re.findall(r"as `([\w.-]+)`:\n\n```\w*\n(.*?)```", text, flags=re.DOTALL):
        (folder / name).write_text(block, encoding="utf-8")
    blocks, printed = INDENTED.split(text), list[str]()
    for k, block in enumerate(blocks):
        if not block.startswith("    "):
            continue
        commands = list(_commands(block))
        for command in commands:
            printed = _run(command, folder)
        if not commands or "$ drumsqueal" in block:
            blocks[k] = _renewed(block, printed, page.name)
    page.write_text("".join(blocks), encoding="utf-8")
    for code in DRAWN.findall(text):
        subprocess.run([sys.executable, "-c", code], cwd=folder, check=True)
    for picture, source in PICTURE.findall(text):
        _take(folder / source, page.parent / picture)


def _commands(block: str) -> Iterator[list[str]]:
    """The commands of an indented block, whose lines may go on behind a backslash."""
    for line in re.sub(r"\\\n\s*", " ", block).splitlines():
        match = COMMAND.fullmatch(line.strip())
        if match:
            yield shlex.split(match[1])


def _run(command: list[str], folder: Path) -> list[str]:
    """What a command prints, line by line; where it fails, that is what it prints."""
    print(f"  {shlex.join(command)}", flush=True)
    words = [sys.executable, "-m", *command]
    found = subprocess.run(
        words, cwd=folder, env=os.environ | {"COLUMNS": WIDTH}, capture_output=True, text=True, check=False
    )
    return (found.stdout + found.stderr).splitlines()


def _renewed(block: str, printed: list[str], page: str) -> str:
    """The block with each line that is printed otherwise now as it is printed."""
    now = {" ".join(line.split()): line for line in printed}
    lines = block.splitlines()
    for k, line in enumerate(lines):
        plain = " ".join(line.split())
        if not plain or plain in now or COMMAND.fullmatch(plain) or not printed:
            continue
        near = difflib.get_close_matches(plain, now, n=1, cutoff=ALIKE)
        if near:
            print(f"{page}: - {plain}\n{' ' * len(page)}  + {near[0]}")
            lines[k] = f"    {now[near[0]].rstrip()}"
        else:
            print(f"{page}: nothing like it is printed: {plain}")
    return "\n".join(lines) + "\n"


def _take(source: Path, picture: Path) -> None:
    """The picture as it is drawn now."""
    if not source.exists():
        print(f"{picture.name}: {source.name} was not drawn")
    elif not picture.exists() or source.read_bytes() != picture.read_bytes():
        shutil.copy(source, picture)
        print(f"{picture.name}: drawn anew")


if __name__ == "__main__":
    main()
