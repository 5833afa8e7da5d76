"""What commands answered when somebody last looked: kept in tests/data/answers, compared number by number.

Other tests show that an answer is right, this one that nothing of it has changed since: no unit, no column, no word.
`pytest --keep-answers` keeps what is answered now; look at the difference before you commit it.
"""

import csv
import json
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import xarray

FOLDER = Path(__file__).parent / "data" / "answers"
# Programs compiled with all optimisations give the same numbers to 1e-6, but for what is round-off, or follows from it:
# errors, which steps are made, what hardly changes, exponents that are zero but for the time they are measured over.
CLOSE = 1e-4
TINY = 1e-10  # in any unit of an answer
LOOSE = re.compile(
    "error|residual|uncertaint|energy_balance|drift|distance|change_of|fluctuation|evaluations|steps|lyapunov"
)
# By the name of a key, a column or a variable.
OTHER_EACH_TIME = re.compile(
    "seconds|machine|processor|cores|python|versions|drumsqueal|jax|diffrax|equinox|numpy|scipy|xarray"
)
TIMES = re.compile("computing_|time_per_")
TEMPORARY = re.compile(r"/\S*/pytest-of-[^/]*(/[^/ ]+)*/")
NUMBER = re.compile(r"[-−+]?(?<![\w.])\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Answers:
    """Compares what a command printed and wrote with what is kept under a name, or keeps it."""

    def __init__(self, *, keep: bool) -> None:
        self._keep = keep

    def __call__(self, name: str, printed: str, folder: Path) -> None:
        """Fail where a word or a number differs."""
        words = TEMPORARY.sub("", " ".join(printed.split()))
        files = {path.name: _read(path) for path in sorted(folder.iterdir())}
        found = json.loads(json.dumps({"printed": words, "files": files}))
        file = FOLDER / f"{name}.json"
        if self._keep:
            FOLDER.mkdir(exist_ok=True)
            text = json.dumps(found, indent=1, ensure_ascii=False)
            text = re.sub(r"\[[^][{}\"]*\]", lambda numbers: " ".join(numbers[0].split()), text)
            file.write_text(text + "\n", encoding="utf-8")
        _compare(json.loads(file.read_text(encoding="utf-8")), found, name)


def _read(path: Path) -> Any:
    """What a file says; of large arrays their size and how they begin and end, of a picture that it is there."""
    if path.suffix == ".json":
        return json.loads(path.read_text(encoding="utf-8"))
    if path.suffix == ".csv":
        return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    if path.suffix == ".toml":
        return tomllib.loads(path.read_text(encoding="utf-8"))
    if path.suffix == ".nc":
        with xarray.open_dataset(path, engine="h5netcdf") as data:
            return {str(name): _summary(each) for name, each in data.variables.items()}
    return path.suffix


def _summary(variable: xarray.Variable) -> dict[str, Any]:
    values = variable.values
    found: dict[str, Any] = {"unit": str(variable.attrs.get("units", "")), "shape": list(values.shape)}
    if values.dtype.kind in "fiub" and values.size:
        flat = values.astype(float).ravel()
        known = flat[np.isfinite(flat)]
        found |= {"first": flat[0], "last": flat[-1], "known": known.size}
        found |= {"rms": float(np.sqrt(np.mean(known**2)))} if known.size else {}
    elif values.dtype.kind in "OUS":
        found["values"] = [str(each) for each in values.ravel()[:50]]
    return found


def _compare(kept: Any, found: Any, place: str) -> None:
    assert type(kept) is type(found) or {type(kept), type(found)} == {int, float}, f"{place}: {kept!r}, now {found!r}"
    if OTHER_EACH_TIME.search(place.rpartition("/")[2]) or TIMES.search(place):
        return
    if isinstance(kept, dict):
        assert list(kept) == list(found), f"{place}: {list(kept)}, now {list(found)}"
        for key, value in kept.items():
            _compare(value, found[key], f"{place}/{key}")
    elif isinstance(kept, list):
        assert len(kept) == len(found), f"{place}: {len(kept)} of them, now {len(found)}"
        for k, pair in enumerate(zip(kept, found, strict=True)):
            _compare(*pair, f"{place}/{k}" if isinstance(pair[0], dict) else place)
    elif isinstance(kept, str):
        _compare_text(kept, found, place)
    elif isinstance(kept, float):
        assert _alike(kept, found, place), f"{place}: {kept!r}, now {found!r}"
    else:
        assert kept == found, f"{place}: {kept!r}, now {found!r}"


def _alike(kept: float, found: float, place: str) -> bool:
    if LOOSE.search(place.split("/", 1)[-1]):
        return math.isclose(kept, found, rel_tol=0.5, abs_tol=1e-6)
    both_none = math.isnan(kept) and math.isnan(found)
    return both_none or math.isclose(kept, found, rel_tol=CLOSE, abs_tol=TINY)


def _compare_text(kept: str, found: str, place: str) -> None:
    """The same words, and numbers that differ by one in their last digit at most."""
    kept, found = (TEMPORARY.sub("", each) for each in (kept, found))
    assert NUMBER.sub("#", kept) == NUMBER.sub("#", found), f"{place}: {kept}\nnow: {found}"
    for old, new in zip(NUMBER.findall(kept), NUMBER.findall(found), strict=True):
        before, after = (float(each.replace("−", "-")) for each in (old, new))
        digits, _, power = old.partition("e")
        last = 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
        same = abs(after - before) <= 1.001 * last or _alike(before, after, place)
        assert same, f"{place}: {old}, now {new} in {found}"
