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
# Programs compiled with all optimisations, or for a processor with shorter vectors, give the same numbers to 1e-6 of
# the largest that stands beside them.
CLOSE = 1e-4
ROUND_OFF = 1e-7  # of the largest number in a list or a column
TINY = 1e-11  # in any unit: what is zero but for round-off and stands alone
# What is round-off, or follows from it: errors, which steps are made, what hardly changes, exponents of a short record.
LOOSE = re.compile(
    "error|residual|uncertaint|energy_balance|drift|distance|change_of|fluctuation|evaluations|steps|lyapunov|by_differences"
)
DIFFERS = re.compile(  # from machine to machine, by the name of a key, a column or an attribute
    "seconds|machine|processor|cores|python|versions?$|drumsqueal|jax|diffrax|equinox|numpy|scipy|xarray"
    "|computing_|time_per_|bytes"
)
# Folders, of which answers name none but those of tests, and what pytest calls them, cut off and numbered.
TEMPORARY = re.compile(r"(?<![\w.])/(?:[^\s/]+/)+(?:test_\w*\d\b)?")
NUMBER = re.compile(r"[-−+]?(?<![\w.])\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Answers:
    """Compares what a command printed and wrote with what is kept under a name, or keeps it."""

    def __init__(self, *, keep: bool) -> None:
        self._keep = keep

    def __call__(self, name: str, printed: str, folder: Path) -> None:
        """Fail where a word or a number differs; what is `printed` is left out where it tells how long things took."""
        files = {path.name: _read(path) for path in sorted(folder.iterdir())}
        found = json.loads(json.dumps(_lasting({"printed": printed.splitlines(), "files": files})))
        file = FOLDER / f"{name}.json"
        if self._keep:
            FOLDER.mkdir(exist_ok=True)
            text = json.dumps(found, indent=1, ensure_ascii=False)
            text = re.sub(r"\[[^][{}\"]*\]", lambda numbers: " ".join(numbers[0].split()), text)
            file.write_text(text + "\n", encoding="utf-8")
        assert file.exists(), f"nothing is kept of {name}: pytest --keep-answers keeps it"
        try:
            _compare(json.loads(file.read_text(encoding="utf-8")), found, name)
        except AssertionError as difference:
            difference.add_note("Where that is meant, pytest --keep-answers keeps what is answered now.")
            raise


def _read(path: Path) -> Any:
    """What a file says; of large arrays some numbers, of a picture that it is there."""
    if path.suffix == ".json":
        return json.loads(path.read_text(encoding="utf-8"))
    if path.suffix == ".csv":
        rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
        return {column: [_number(row[k]) for row in rows[1:]] for k, column in enumerate(rows[0])}
    if path.suffix == ".toml":
        return tomllib.loads(path.read_text(encoding="utf-8"))
    if path.suffix == ".nc":
        with xarray.open_dataset(path, engine="h5netcdf", decode_cf=False) as data:
            variables = {str(name): _summary(each) for name, each in data.variables.items()}
            return {"attributes": _attributes(data.attrs), "variables": variables}
    return path.suffix


def _number(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


def _summary(variable: xarray.Variable) -> dict[str, Any]:
    """Dimensions, attributes, and of each of the last dimension means, the first and the last number."""
    values = variable.values
    found = {"dimensions": list(variable.dims), "shape": list(values.shape), "attributes": _attributes(variable.attrs)}
    if values.dtype.kind not in "fiub" or not values.size:
        return found | {"values": [str(each) for each in values.ravel()[:50]]}
    table = values.astype(float).reshape(-1, values.shape[-1] if values.ndim > 1 else 1)
    known = np.isfinite(table)
    table, count = np.where(known, table, 0.0), np.maximum(known.sum(axis=0), 1)
    rms = np.sqrt(np.sum(table**2, axis=0) / count)
    # Each point weighs differently, as no signal goes, so that a sign or an exchange is seen; twice the rms keeps it
    # from zero.
    weighed = 2.0 * rms + np.random.default_rng(0).uniform(-1.0, 1.0, len(table)) @ table / count
    numbers = {"known": known.sum(axis=0), "rms": rms, "weighed": weighed, "first": table[0], "last": table[-1]}
    return found | {key: each.tolist() for key, each in numbers.items()}


def _attributes(given: dict[Any, Any]) -> dict[str, Any]:
    return {str(key): value if isinstance(value, str) else np.asarray(value).tolist() for key, value in given.items()}


def _lasting(found: Any) -> Any:
    """The answer without what differs from machine to machine, numbers to nine digits."""
    if isinstance(found, dict):
        return {key: _lasting(value) for key, value in found.items() if not DIFFERS.search(key)}
    if isinstance(found, list):
        return [_lasting(each) for each in found]
    if isinstance(found, str):
        return TEMPORARY.sub("", " ".join(found.split()))
    return float(f"{found:.9g}") if isinstance(found, float) else found


def _compare(kept: Any, found: Any, place: str, scale: float = 0.0) -> None:
    if _is_number(kept) and _is_number(found) and (float in (type(kept), type(found)) or LOOSE.search(place)):
        assert _alike(kept, found, place, scale), f"{place}: {kept!r}, now {found!r}"
        return
    assert type(kept) is type(found), f"{place}: {kept!r}, now {found!r}"
    if isinstance(kept, dict):
        assert list(kept) == list(found), f"{place}: {list(kept)}, now {list(found)}"
        for key, value in kept.items():
            _compare(value, found[key], f"{place}/{key}")
    elif isinstance(kept, list):
        assert len(kept) == len(found), f"{place}: {len(kept)} of them, now {len(found)}"
        scale = max((abs(each) for each in kept if isinstance(each, float) and math.isfinite(each)), default=0.0)
        for k, pair in enumerate(zip(kept, found, strict=True)):
            _compare(pair[0], pair[1], f"{place}/{k}", scale)
    elif isinstance(kept, str):
        _compare_text(kept, found, place)
    else:
        assert kept == found, f"{place}: {kept!r}, now {found!r}"


def _is_number(value: Any) -> bool:
    return type(value) in (int, float)


def _alike(kept: float, found: float, place: str, scale: float) -> bool:
    if math.isnan(kept) and math.isnan(found):
        return True
    if LOOSE.search(place):
        return math.isclose(kept, found, rel_tol=0.5, abs_tol=1e-6)
    return math.isclose(kept, found, rel_tol=CLOSE, abs_tol=max(TINY, ROUND_OFF * scale))


def _compare_text(kept: str, found: str, place: str) -> None:
    """The same words and numbers, but for one in the last of many digits, and for round-off, as in 2.3e-14 or 4e-07.

    A rule is as long as its table is wide, which its words show better.
    """
    kept, found = (re.sub("─+", "─", each) for each in (kept, found))
    assert NUMBER.sub("#", kept) == NUMBER.sub("#", found), f"{place}: {kept}\nnow: {found}"
    for old, new in zip(NUMBER.findall(kept), NUMBER.findall(found), strict=True):
        before, after = (float(each.replace("−", "-")) for each in (old, new))
        mantissa, _, power = old.partition("e")
        digits = len(re.sub(r"\D", "", mantissa).lstrip("0"))
        last = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
        round_off = "e-" in old and (digits == 2 or abs(before) < TINY) and math.isclose(before, after, rel_tol=0.7)
        now = new.partition("e")[0]  # 9.999 may become 10.00: as many digits, or as many decimals
        as_many = len(re.sub(r"\D", "", now).lstrip("0")) == digits or len(now.partition(".")[2]) == len(
            mantissa.partition(".")[2]
        )
        close = digits >= 4 and "." in old and as_many and abs(after - before) <= 1.001 * last
        same = old == new or round_off or close
        assert same, f"{place}: {old}, now {new} in {found}"
