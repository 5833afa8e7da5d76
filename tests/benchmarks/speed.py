"""How fast drumsqueal is: beside its peers, a step taken apart, long runs, starts, and how time grows.

Run it with `python tests/benchmarks/speed.py -o DIR`, or parts of it with `--only`; all of it takes some ten minutes
on two cores. The peers need `pip install --group benchmark`; what is missing is named and left out. DIR then holds
speed.csv, with every raw figure, and pictures; `--docs` writes tables and pictures of docs/speed.md and
docs/accuracy.md as well, where all parts of a table were measured. Whoever is compared takes turns, so that a noisy
machine slows them alike: ratios are worth more than times.
"""

import argparse
import shutil
import sys
import time
from importlib import import_module
from pathlib import Path

from rich.console import Console

from drumsqueal import programs
from parts.record import Record, describe_machine

PARTS = ("evaluation", "bending", "brake", "one", "many", "sticking", "step", "long", "start", "growth", "accuracy")
DOCS = Path(__file__).parents[2] / "docs"


def main() -> None:
    """Measure the parts asked for, and write what they found after each of them."""
    arguments = argparse.ArgumentParser(description="How fast drumsqueal is")
    arguments.add_argument("-o", "--output", metavar="DIR", type=Path, required=True, help="folder of the results")
    arguments.add_argument("--only", choices=PARTS, nargs="+", default=PARTS, help="some parts instead of all")
    arguments.add_argument("--docs", action="store_true", help="write the docs' tables and pictures, too")
    chosen = arguments.parse_args()
    chosen.output.mkdir(parents=True, exist_ok=True)
    programs.folder = None  # what is said to be compiled is not loaded instead
    record = Record(Console(width=None if sys.stdout.isatty() else 160))
    record.say(", ".join(f"{name} {value}" for name, value in describe_machine().items()))
    for name in chosen.only:
        before = time.perf_counter()
        measure(name, record, chosen.output)
        record.say(f"{name}: {time.perf_counter() - before:.0f} s")
        record.write(chosen.output / "speed.csv")
    if record.targets:
        record.show_targets()
    if chosen.docs:
        record.write_docs(DOCS / "speed.md")
        for picture in chosen.output.glob("*.png"):
            if (DOCS / picture.name).exists():
                shutil.copy(picture, DOCS)
    record.say(f"Every figure is in {chosen.output / 'speed.csv'}")


def measure(name: str, record: Record, folder: Path) -> None:
    """One part; without numba, with which the peers' forces are written, there are none."""
    try:
        part = import_module(f"parts.{name}")
    except ModuleNotFoundError as error:
        if error.name != "numba":
            raise
        record.say(f"{name}: left out, for numba is not installed")
        record.aim(name, "as fast as its peers", "numba is not installed", None)
        return
    record.begin(name)
    part.measure(record, folder)


if __name__ == "__main__":
    main()
