"""Whether the tests see a fault: one-line mutants of the source, and the first test that kills each.

    .venv/bin/python tests/mutants.py                    # what the default tier leaves alive goes to the thorough tier
    .venv/bin/python tests/mutants.py --tier default     # only the default tier
    .venv/bin/python tests/mutants.py physics/effects    # only mutants of these files
    .venv/bin/python tests/mutants.py --reaching         # only tests of the default tier that reach the mutated lines

They stand in `mutants.toml`, written by hand: what goes wrong in this program (a unit, the end of a chunk, a lock, a
term of an equation) is not among the operators of mutation libraries, whose thousands of mutants would take weeks.

Each tier first runs once on an unchanged copy, where it has to pass; the default tier (some ten minutes) then also
notes which lines each test reaches. The tests that reach the mutated line run first, the quickest of them before the
others, and then the whole tier. With `--reaching` it ends there: half an hour, and a lower bound of what is killed; no
test reaches a constant of a module, which was read before the first of them.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import NamedTuple
from xml.etree import ElementTree

from coverage import CoverageData

ROOT, PACKAGE = Path(__file__).parents[1], Path("src/drumsqueal")
KEPT = ROOT / ".pytest_cache" / "mutants"
TIERS = {"default": "not thorough and not slow", "thorough": "thorough and not slow"}
# Four times what the thorough tier takes alone in one process: a mutant that runs for longer never ends.
HANGS_S = 4 * 3600.0


class Mutant(NamedTuple):
    """A text that occurs once in a file, what stands in its place, and what a user would see of that."""

    file: str
    old: str
    new: str
    seen: str

    def applied(self, source: str) -> str:
        """The mutated source."""
        assert source.count(self.old) == 1, f"{self.file} has {self.old!r} {source.count(self.old)} times"
        return source.replace(self.old, self.new)


def measure(tree: Path) -> None:
    """Note which lines each test of the default tier reaches, and how long it takes, unless that is known."""
    files = [*(ROOT / "src").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]
    if (KEPT / "times.xml").exists() and max(map(_changed, files)) < _changed(KEPT / "times.xml"):
        return
    KEPT.mkdir(parents=True, exist_ok=True)
    (tree / "settings").write_text(
        f"[run]\nsource = {PACKAGE}\nrelative_files = true\ndynamic_context = test_function\ndata_file = lines\n"
    )
    arguments = ["-o", "junit_family=xunit1", "--junitxml=times.xml"]
    ran = _pytest(tree, ["coverage", "run", "--rcfile=settings", "-m", "pytest"], "default", arguments)
    if ran.returncode:
        sys.exit(f"the tests fail without any mutant:\n{ran.stdout[-3000:]}{ran.stderr[-3000:]}")
    for name in ("lines", "times.xml"):  # the second last, which says that both are whole
        shutil.copy(tree / name, KEPT / name)


def _changed(path: Path) -> float:
    return path.stat().st_mtime


def reaching(mutant: Mutant) -> list[str]:
    """The tests that reach the mutated lines, the quickest first.

    Of several tests that use one traced program, only the one that traced it is among them.
    """
    source = (ROOT / PACKAGE / mutant.file).read_text()
    first = source[: source.index(mutant.old)].count("\n") + 1
    data = CoverageData(str(KEPT / "lines"))
    data.read()
    contexts = data.contexts_by_lineno(str(PACKAGE / mutant.file))
    lines = range(first, first + mutant.old.count("\n") + 1)
    names = {name for line in lines for name in contexts.get(line, ()) if name}
    times: dict[str, float] = defaultdict(float)
    for case in ElementTree.parse(KEPT / "times.xml").iter("testcase"):
        module, name = case.attrib["classname"], case.attrib["name"].partition("[")[0]
        if f"{module}.{name}" in names or f"{module.rpartition('.')[2]}.{name}" in names:
            times[f"{case.attrib['file']}::{name}"] += float(case.attrib["time"])
    return sorted(times, key=lambda test: times[test])


def killer(mutant: Mutant, tier: str, tree: Path, *, whole: bool) -> str | None:
    """The first test of a tier that fails, in a copy of the project, or the first of those that reach the lines."""
    path = tree / PACKAGE / mutant.file
    source = path.read_text()
    path.write_text(mutant.applied(source))
    turns = [reaching(mutant)] if tier == "default" else []
    turns += [["tests"]] if whole else []
    try:
        return next((found for tests in turns if tests and (found := failing(tests, tier, tree))), None)
    finally:
        path.write_text(source)


def failing(tests: list[str], tier: str, tree: Path) -> str | None:
    """The first of these tests of a tier that fails."""
    try:
        done = _pytest(tree, ["pytest"], tier, ["-x", *tests])
    except subprocess.TimeoutExpired:
        return f"it runs for over {HANGS_S:g} s"
    if done.returncode in (0, 5):  # passed, or none is of this tier
        return None
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return failed[1] if failed else done.stdout[-300:] + done.stderr[-300:]


def _pytest(tree: Path, program: list[str], tier: str, arguments: list[str]) -> subprocess.CompletedProcess[str]:
    # The folder of compiled programs is shared: what a mutant does not change is not compiled again.
    shared = ["-q", "-m", TIERS[tier], "-o", f"cache_dir={ROOT / '.pytest_cache'}"]
    command = [sys.executable, "-m", *program, *shared, *arguments]
    environment = os.environ | {"PYTHONPATH": str(tree / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=HANGS_S)


def main() -> None:
    """Ask the tiers for each mutant, on a copy of the project for each processor."""
    parser = argparse.ArgumentParser(description="Which tests see one-line faults of the source.")
    parser.add_argument("--tier", action="append", choices=list(TIERS), help="default: both, one after the other")
    parser.add_argument("--reaching", action="store_true", help="only tests of the default tier that reach the lines")
    parser.add_argument("files", nargs="?", default="", help="only mutants of files whose path contains this")
    asked = parser.parse_args()
    tiers = ["default"] if asked.reaching else asked.tier or list(TIERS)
    data = tomllib.loads((ROOT / "tests" / "mutants.toml").read_text())["mutant"]
    mutants = [mutant for each in data if asked.files in (mutant := Mutant(**each)).file]
    kills: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        trees = copies(Path(scratch))
        tree = trees.get()
        measure(tree)
        if "thorough" in tiers and (test := failing(["tests"], "thorough", tree)):
            sys.exit(f"the thorough tier fails without any mutant: {test}")
        trees.put(tree)

        def ask(mutant: Mutant) -> None:
            tree = trees.get()
            try:
                found = (
                    (tier, test) for tier in tiers if (test := killer(mutant, tier, tree, whole=not asked.reaching))
                )
                tier, test = next(found, ("ALIVE", mutant.seen))
            finally:
                trees.put(tree)
            kills[tier] += 1
            print(f"{tier:9} {mutant.file}: {mutant.old!r} -> {mutant.new!r}\n{'':9} {test}", flush=True)

        with ThreadPoolExecutor(trees.qsize()) as pool:
            list(pool.map(ask, mutants))
    killed = ", ".join(f"{kills[tier]} killed by the {tier} tier" for tier in tiers)
    print(f"{len(mutants)} mutants: {killed}, {kills['ALIVE']} alive")
    sys.exit(kills["ALIVE"] > 0)


def copies(scratch: Path) -> Queue[Path]:
    """Copies of the project, one for each processor."""
    ignored = shutil.ignore_patterns(".*", "__pycache__", "out")
    trees: Queue[Path] = Queue()
    for name in range(os.cpu_count() or 1):
        trees.put(Path(shutil.copytree(ROOT, scratch / str(name), ignore=ignored)))
    return trees


if __name__ == "__main__":
    main()
