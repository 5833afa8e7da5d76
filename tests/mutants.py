"""Whether the tests see a fault: one-line mutants of the source, and the first test of the first tier that kills each.

    .venv/bin/python tests/mutants.py            # those that the default tier leaves alive, the thorough one is asked
    .venv/bin/python tests/mutants.py default    # the default tier alone
    .venv/bin/python tests/mutants.py default physics/effects   # of these files alone

They stand in `mutants.toml`, written by hand: what goes wrong in this program (a unit, the end of a chunk, a lock, a
term of an equation) is not among the operators of mutation libraries, whose thousands of mutants would take weeks. One
that changes nothing that can be observed says why (`equivalent`), and is not run.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import NamedTuple

ROOT, PACKAGE = Path(__file__).parents[1], Path("src/drumsqueal")
TIERS = {"default": "not thorough and not slow", "thorough": "thorough and not slow"}
LONGEST_S = 3600.0  # what hangs is noticed, too
# Where the tests of a folder of the source are, to be asked first.
NEAR = {
    "physics": ["physics", "solve", "hard"],
    "solve": ["solve", "hard", "physics"],
    "files": ["terminal", "questions"],
}


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


def tests_in_turn(mutant: Mutant, tree: Path) -> list[list[str]]:
    """Those nearest to the mutated file, then all others."""
    first, *rest = Path(mutant.file).parts
    folders = [tree / "tests" / name for name in NEAR.get(first, [first])]
    near = [str(path) for path in folders if path.is_dir()]
    if first == "questions":
        near = [str(path) for path in sorted((tree / "tests/questions").glob(f"test_*{rest[0]}*.py"))]
    return [near, ["tests", *(f"--ignore={path}" for path in near)]] if near else [["tests"]]


def killer(mutant: Mutant, tier: str, tree: Path) -> str | None:
    """The first test of a tier that fails, in a copy of the project."""
    path = tree / PACKAGE / mutant.file
    source = path.read_text()
    path.write_text(mutant.applied(source))
    try:
        for tests in tests_in_turn(mutant, tree):
            if killed_by := _failing(tests, tier, tree):
                return killed_by
    finally:
        path.write_text(source)
    return None


def _failing(tests: list[str], tier: str, tree: Path) -> str | None:
    # The folder of compiled programs is shared: what a mutant does not change is not compiled again.
    arguments = ["-x", "-q", "-m", TIERS[tier], "-o", f"cache_dir={ROOT / '.pytest_cache'}", *tests]
    command = [sys.executable, "-m", "pytest", *arguments]
    environment = os.environ | {"PYTHONPATH": str(tree / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST_S)
    except subprocess.TimeoutExpired:
        return "runs for an hour"
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
    kills: Counter[str | None] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        trees: Queue[Path] = Queue()
        for name in range(os.cpu_count() or 1):
            ignored = shutil.ignore_patterns(".*", "__pycache__", "out")
            trees.put(Path(shutil.copytree(ROOT, Path(scratch) / str(name), ignore=ignored)))

        def ask(mutant: Mutant) -> None:
            tree = trees.get()
            found = next(((tier, test) for tier in tiers if (test := killer(mutant, tier, tree))), (None, "SURVIVES"))
            trees.put(tree)
            kills[found[0]] += 1
            tier, test = found
            print(f"{tier or '-':9} {mutant.file}: {mutant.old!r} -> {mutant.new!r}\n{'':9} {test}", flush=True)

        with ThreadPoolExecutor(trees.qsize()) as pool:
            list(pool.map(ask, mutants))
    print(f"{len(mutants)} mutants: " + ", ".join(f"{kills[tier]} killed by the {tier} tier" for tier in tiers))


if __name__ == "__main__":
    main([name for name in sys.argv[1:2] if name in TIERS] or list(TIERS), *sys.argv[2:3])
