"""What commands answered when somebody last looked: kept in tests/data/answers, compared number by number.

Other tests show that an answer is right, this one that nothing of it has changed since: no unit, no column, no word.
`pytest --keep-answers` keeps what is answered now; look at the difference before you commit it.
"""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import xarray

FOLDER = Path(__file__).parent / "data" / "answers"
# Programs that are compiled with all optimisations and without give the same numbers to 1e-6, but for what is itself an
# error, or a number that hardly differs from zero.
CLOSE = 1e-4
TINY = 1e-12  # in any unit of an answer
ERRORS = re.compile("error|residual|uncertainty|energy_balance|drift|distance")
OTHER_EACH_TIME = re.compile("seconds|elapsed|version|created|platform|processor|evaluations_per|command|folder|path")
NUMBER = re.compile(r"[-−+]?(?<![\w.])\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Answers:
    """Compares what a command printed and wrote with what is kept under a name, or keeps it."""

    def __init__(self, *, keep: bool) -> None:
        self._keep = keep

    def __call__(self, name: str, printed: str, folder: Path | None = None, *, hide: str = "") -> None:
        """Fail where a word or a number differs; `hide` is a pattern of what is printed otherwise each time."""
        words = printed.replace(str(folder), "FOLDER") if folder else printed
        words = " ".join(re.sub(hide, "", words).split() if hide else words.split())
        files = {path.name: _read(path) for path in sorted(folder.iterdir())} if folder else {}
        found = json.loads(json.dumps({"printed": words, "files": files}))
        file = FOLDER / f"{name}.json"
        if self._keep:
            FOLDER.mkdir(exist_ok=True)
            file.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        _compare(json.loads(file.read_text(encoding="utf-8")), found, name)


def _read(path: Path) -> Any:
    """What a file says; of large arrays their size and how they begin and end, of a picture that it is there."""
    if path.suffix == ".json":
        return json.loads(path.read_text(encoding="utf-8"))
    if path.suffix in (".csv", ".toml", ".txt", ".md"):
        return path.read_text(encoding="utf-8")
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
    if OTHER_EACH_TIME.search(place.rpartition("/")[2]):
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
    elif isinstance(kept, float) and not ERRORS.search(place):
        same = math.isclose(kept, found, rel_tol=CLOSE, abs_tol=TINY) or (math.isnan(kept) and math.isnan(found))
        assert same, f"{place}: {kept!r}, now {found!r}"
    elif not isinstance(kept, float):
        assert kept == found, f"{place}: {kept!r}, now {found!r}"


def _compare_text(kept: str, found: str, place: str) -> None:
    """The same words, and numbers that differ by one in their last digit at most."""
    assert NUMBER.sub("#", kept) == NUMBER.sub("#", found), f"{place}: {kept}\nnow: {found}"
    for old, new in zip(NUMBER.findall(kept), NUMBER.findall(found), strict=True):
        before, after = (float(each.replace("−", "-")) for each in (old, new))
        digits, _, power = old.partition("e")
        last = 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
        assert abs(after - before) <= 1.001 * last or math.isclose(before, after, rel_tol=CLOSE), (
            f"{place}: {old}, now {new} in {found}"
        )
