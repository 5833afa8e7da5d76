"""Makes the pages anew, and says what has changed: `python docs/_make/renew.py`, or with pages, such as docs/drum.md.

Runs every command of a page, in the page's order, compares what it prints with what stands below it, and puts in
numbers and words that have changed one for one, so that lines stay as they are wrapped and may be left out. What is not
printed any more in such a way is left, and named. Copies every picture from the file that the comment below it names,
runs the Python that draws pictures, and executes the notebooks. Some pages take minutes, all of them some hours.
"""

import argparse
import difflib
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
import json_reference
import scene_reference

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
RUN = DOCS / "run.md"  # whose results other pages go on with
FENCE = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
INDENTED = re.compile(r"(?:^ {4}.*\n)+", re.MULTILINE)
HEAD = re.compile(r" {4}(?:\.venv/bin/)?(drumsqueal (?:.*\\\n)*.*)\n")  # at the head of a block
PROMPT = re.compile(r" {4}\$ (drumsqueal .*)\n")  # anywhere in it
PICTURE = re.compile(r"\]\(((?:docs/)?[\w-]+\.(?:png|gif))\)\n<!-- from (\S+) -->")
PYTHON = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
WRITTEN = re.compile(r"as `([\w.-]+)`:\n\n```\w*\n(.*?)```", re.DOTALL)
LEAST = 0.5  # of the words of what was printed are printed still, or it was something else
ALIKE = 0.5  # ratio of difflib from which on one word may have become the other


def main() -> None:
    """Renew the pages asked for, or all."""
    asked = argparse.ArgumentParser(description="Make the pages anew, and say what has changed")
    asked.add_argument("pages", nargs="*", type=Path, help="pages and notebooks instead of all")
    pages = asked.parse_args().pages
    if not pages:
        scene_reference.PAGE.write_text(scene_reference.page(), encoding="utf-8")
        keys = json_reference.page(json_reference.PAGE.read_text(encoding="utf-8"))
        json_reference.PAGE.write_text(keys, encoding="utf-8")
        drawing.style.save_figure(drawing.draw(), drawing.PICTURE)
        pages = [ROOT / "README.md", *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("*.ipynb"))]
    with tempfile.TemporaryDirectory() as scratch:
        nominal = Path(scratch)
        for page in map(Path.resolve, pages):
            if page.suffix == ".ipynb":
                renew_notebook(page)
            else:
                with tempfile.TemporaryDirectory() as own:
                    renew_page(page, _folder_for(page, Path(own), nominal))


def renew_notebook(file: Path) -> None:
    """Execute a notebook and keep what it shows."""
    book = nbformat.read(file, 4)
    NotebookClient(book, timeout=600).execute(cwd=str(ROOT))
    nbformat.write(book, file)
    print(f"{file.name}: executed")


def renew_page(page: Path, folder: Path) -> None:
    """Run the commands of a page in a folder, and put in what they print and draw."""
    print(page.name, flush=True)
    text = page.read_text(encoding="utf-8")
    for name, block in WRITTEN.findall(text):
        (folder / name).write_text(block, encoding="utf-8")
    printed, asks, renewed, end = "", False, [], 0
    for place, part, is_command in _parts(text):
        if is_command:
            printed = (printed if asks else "") + _run(shlex.split(part), folder)
        elif printed:
            renewed += [text[end:place], _renewed(part, printed)]
            end = place + len(part)
        asks = is_command
    page.write_text("".join(renewed) + text[end:], encoding="utf-8")
    for code in _drawing_code(text):
        subprocess.run([sys.executable, "-c", code], cwd=folder, check=True)
    for picture, source in PICTURE.findall(text):
        _take(folder / source, page.parent / picture)


def _folder_for(page: Path, folder: Path, nominal: Path) -> Path:
    """The folder with the scenes, and with the results of the nominal run where a page goes on with them."""
    shutil.copytree(ROOT / "scenarios", folder / "scenarios")
    (folder / "docs").mkdir()
    if page != RUN and "out/nominal" in page.read_text(encoding="utf-8"):
        if not (nominal / "out").exists():
            command = next(part for _, part, is_command in _parts(RUN.read_text(encoding="utf-8")) if is_command)
            shutil.copytree(ROOT / "scenarios", nominal / "scenarios")
            _run(shlex.split(command), nominal)
        shutil.copytree(nominal / "out", folder / "out")
    return folder


def _parts(text: str) -> Iterator[tuple[int, str, bool]]:
    """Commands and what stands as printed, in order: where, what, and whether it is a command. Fences are neither."""
    plain = FENCE.sub(lambda found: re.sub(r"[^\n]", "#", found[0]), text)
    for block in INDENTED.finditer(plain):
        place = block.start()
        while place < block.end():
            at_head = not HEAD.sub("", plain[block.start() : place])
            command = PROMPT.match(plain, place) or (HEAD.match(plain, place) if at_head else None)
            if command:
                yield place, re.sub(r"\\\n\s*", " ", command[1]), True
                place = command.end()
                continue
            following = PROMPT.search(plain, place, block.end())
            stop = following.start() if following else block.end()
            yield place, text[place:stop], False
            place = stop


def _run(command: list[str], folder: Path) -> str:
    """What a command prints; where it fails, its exit status is said, and what it prints has the reason."""
    print(f"  {shlex.join(command)}", flush=True)
    found = subprocess.run([sys.executable, "-m", *command], cwd=folder, capture_output=True, text=True, check=False)
    if found.returncode:
        print(f"  exit status {found.returncode}")
    return found.stdout + (found.stderr if found.returncode else "")


def _renewed(block: str, printed: str) -> str:
    """The block with the words that are printed otherwise now, one for one."""
    spans = [found.span() for found in re.finditer(r"\S+", block)]
    words, now = [block[slice(*span)] for span in spans], printed.split()
    changed: dict[int, str] = {}
    compared = difflib.SequenceMatcher(None, now, words, autojunk=False)
    if sum(match.size for match in compared.get_matching_blocks()) < LEAST * len(words):
        print(f"  not of this command: {block.strip().splitlines()[0].strip()}")
        return block
    for kind, i, j, k, end in compared.get_opcodes():
        pairs = list(zip(words[k:end], now[i:j], strict=False))
        if kind == "replace" and j - i == end - k and all(_alike(*pair) for pair in pairs):
            print(f"  changed: {' '.join(words[k:end])} -> {' '.join(now[i:j])}")
            changed |= dict(zip(range(k, end), now[i:j], strict=True))
        elif kind in ("replace", "insert"):
            print(f"  not printed: {' '.join(words[k:end])}")
    text, last = "", 0
    for number, (begin, end) in enumerate(spans):
        word, gap = changed.get(number, block[begin:end]), block[last:begin]
        if gap.endswith("  ") and text:  # a column of a table, which stays aligned to the right
            gap = gap.rstrip(" ") + " " * max(len(gap) - len(gap.rstrip(" ")) + end - begin - len(word), 1)
        text += gap + word
        last = end
    return text + block[last:]


def _alike(one: str, other: str) -> bool:
    if one.strip("─") == other.strip("─") == "":  # a rule, as wide as its table
        return False
    return difflib.SequenceMatcher(None, re.sub(r"\d", "0", one), re.sub(r"\d", "0", other)).ratio() >= ALIKE


def _drawing_code(text: str) -> Iterator[str]:
    """The Python that saves pictures, with what it goes on from: all since the last block that imports."""
    code = ""
    for block in PYTHON.findall(text):
        code = block if re.match(r"import (drumsqueal|matplotlib)", block) else code + block
        if "savefig(" in block:
            yield code


def _take(source: Path, picture: Path) -> None:
    """The picture as it is drawn now."""
    if not source.exists():
        print(f"  {picture.name}: {source.name} was not drawn")
    elif not picture.exists() or source.read_bytes() != picture.read_bytes():
        shutil.copy(source, picture)
        print(f"  {picture.name}: drawn anew")


if __name__ == "__main__":
    main()
