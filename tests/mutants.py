"""Whether the tests see a fault: one-line mutants of the source, and the first test of the first tier that kills each.

    .venv/bin/python tests/mutants.py            # those that the default tier leaves alive, the thorough one is asked
    .venv/bin/python tests/mutants.py default    # the default tier alone
    .venv/bin/python tests/mutants.py default physics/effects   # of these files alone

They stand in `mutants.toml`, written by hand: what goes wrong in this program (a unit, the end of a chunk, a lock, a
term of an equation) is not among the operators of mutation libraries, whose thousands of mutants would take weeks. One
that changes nothing that can be observed says why (`equivalent`), and is not run.

The default tier runs once as it is, in some ten minutes, with a note of the lines that each test reaches. Those that
reach the mutated line are asked first, the quickest before the others, then all.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import NamedTuple
from xml.etree import ElementTree

from coverage import CoverageData

ROOT, PACKAGE = Path(__file__).parents[1], Path("src/drumsqueal")
KEPT = ROOT / ".pytest_cache" / "mutants"
TIERS = {"default": "not thorough and not slow", "thorough": "thorough and not slow"}
HANGS_S = 3600.0


class Mutant(NamedTuple):
    """A text that occurs once in a file, what stands in its place, and what a user would see of that."""

    file: str
    old: str
    new: str
    seen: str
    equivalent: str = ""

    def applied(self, source: str) -> str:
        """The mutated source."""
        assert source.count(self.old) == 1, f"{self.file} has {self.old!r} {source.count(self.old)} times"
        return source.replace(self.old, self.new)


def measure() -> None:
    """Note which lines each test of the default tier reaches, and how long it takes, unless that is known."""
    files = [*(ROOT / "src").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]
    if (KEPT / "times.xml").exists() and max(map(_changed, files)) < _changed(KEPT / "times.xml"):
        return
    KEPT.mkdir(parents=True, exist_ok=True)
    settings = f"[run]\nsource = {ROOT / PACKAGE}\ndynamic_context = test_function\ndata_file = {KEPT / 'lines'}\n"
    (KEPT / "settings").write_text(settings)
    arguments = ["-q", "-o", "junit_family=xunit1", f"--junitxml={KEPT / 'times.xml'}"]
    command = ["coverage", "run", f"--rcfile={KEPT / 'settings'}", "-m", "pytest", *arguments]
    subprocess.run([sys.executable, "-m", *command], cwd=ROOT, check=True)


def _changed(path: Path) -> float:
    return path.stat().st_mtime


def reaching(mutant: Mutant) -> list[str]:
    """The tests that reach the mutated lines, the quickest first; a program that is traced once is traced by one."""
    source = (ROOT / PACKAGE / mutant.file).read_text()
    first = source[: source.index(mutant.old)].count("\n") + 1
    data = CoverageData(str(KEPT / "lines"))
    data.read()
    contexts = data.contexts_by_lineno(str(ROOT / PACKAGE / mutant.file))
    lines = range(first, first + mutant.old.count("\n") + 1)
    names = {name for line in lines for name in contexts.get(line, ()) if name}
    times: dict[str, float] = defaultdict(float)
    for case in ElementTree.parse(KEPT / "times.xml").iter("testcase"):
        module, name = case.attrib["classname"], case.attrib["name"].partition("[")[0]
        if f"{module}.{name}" in names or f"{module.rpartition('.')[2]}.{name}" in names:
            times[f"{case.attrib['file']}::{name}"] += float(case.attrib["time"])
    return sorted(times, key=lambda test: times[test])


def killer(mutant: Mutant, tier: str, tree: Path) -> str | None:
    """The first test of a tier that fails, in a copy of the project."""
    path = tree / PACKAGE / mutant.file
    source = path.read_text()
    path.write_text(mutant.applied(source))
    turns = [reaching(mutant), ["tests"]] if tier == "default" else [["tests"]]
    try:
        return next((found for tests in turns if tests and (found := failing(tests, tier, tree))), None)
    finally:
        path.write_text(source)


def failing(tests: list[str], tier: str, tree: Path) -> str | None:
    """The first of these tests of a tier that fails."""
    # The folder of compiled programs is shared: what a mutant does not change is not compiled again.
    arguments = ["-x", "-q", "-m", TIERS[tier], "-o", f"cache_dir={ROOT / '.pytest_cache'}", *tests]
    command = [sys.executable, "-m", "pytest", *arguments]
    environment = os.environ | {"PYTHONPATH": str(tree / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=HANGS_S)
    except subprocess.TimeoutExpired:
        return f"it runs for {HANGS_S:g} s"
    if done.returncode in (0, 5):  # passed, or none is of this tier
        return None
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return failed[1] if failed else done.stdout[-300:] + done.stderr[-300:]


def main(tiers: list[str], files: str = "") -> None:
    """Run those whose file has this in its name."""
    data = tomllib.loads((ROOT / "tests" / "mutants.toml").read_text())["mutant"]
    mutants = [mutant for each in data if files in (mutant := Mutant(**each)).file and not mutant.equivalent]
    for mutant in mutants:
        mutant.applied((ROOT / PACKAGE / mutant.file).read_text())
    measure()
    kills: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        trees: Queue[Path] = Queue()
        for tree in copies(Path(scratch)):
            trees.put(tree)

        def ask(mutant: Mutant) -> None:
            tree = trees.get()
            found = ((tier, test) for tier in tiers if (test := killer(mutant, tier, tree)))
            tier, test = next(found, ("ALIVE", mutant.seen))
            trees.put(tree)
            kills[tier] += 1
            print(f"{tier:9} {mutant.file}: {mutant.old!r} -> {mutant.new!r}\n{'':9} {test}", flush=True)

        with ThreadPoolExecutor(trees.qsize()) as pool:
            list(pool.map(ask, mutants))
    print(f"{len(mutants)} mutants: " + ", ".join(f"{kills[tier]} killed by the {tier} tier" for tier in tiers))


def copies(scratch: Path) -> Iterator[Path]:
    """Copies of the project, one for each processor."""
    ignored = shutil.ignore_patterns(".*", "__pycache__", "out")
    for name in range(os.cpu_count() or 1):
        yield Path(shutil.copytree(ROOT, scratch / str(name), ignore=ignored))


if __name__ == "__main__":
    main([name for name in sys.argv[1:2] if name in TIERS] or list(TIERS), *sys.argv[2:3])
