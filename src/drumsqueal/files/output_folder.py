"""The folder of results: what is written into it, and that nothing there is overwritten unasked."""

import errno
import importlib.util
import os
import pkgutil
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import pydantic_core

from drumsqueal.coordinates import is_coordinate
from drumsqueal.errors import IntegrationError, RequestError, missing_extra
from drumsqueal.ordinary import open_ordinary


def figure_file(name: str) -> str:
    """Return the file name of a figure."""
    return f"{name}.png"


class Format(NamedTuple):
    """A format: the suffix of its files, what `writes` them (module:function), and the package and extra that it needs.

    `predicts` says whether there is room in it for the eigenvalues, `others` what else its files may end in.
    """

    suffix: str
    writes: str
    package: str = ""
    extra: str = ""
    predicts: bool = True
    others: tuple[str, ...] = ()

    @property
    def endings(self) -> tuple[str, ...]:
        """How the name of a file of this format may end: as the default does, or as in other programs."""
        return self.suffix, *self.others

    def writer(self) -> Callable[..., str]:
        """What writes a file of channels, calling a hook for progress, and returns a note on it ("" for none)."""
        return pkgutil.resolve_name(f"drumsqueal.questions.export.{self.writes}")


FORMATS = {
    "csv": Format(".csv", "export:write_csv", predicts=False, others=(".txt",)),
    "mat": Format(".mat", "export:write_mat"),
    "npz": Format(".npz", "export:write_npz"),
    "parquet": Format(".parquet", "export:write_parquet", "pyarrow", "parquet"),
    "uff58": Format(".uff", "uff58:write_uff58", others=(".unv", ".u58")),
    "wav": Format(".wav", "export:write_wav", predicts=False),
}


def find_format(name: str) -> Format:
    """Return a format by its name or the ending of its files, such as uff.

    Raises RequestError for an unknown one, and where its extra is not installed.
    """
    found = FORMATS.get(name) or next((each for each in FORMATS.values() if f".{name}" in each.endings), None)
    if found is None:
        raise RequestError(f"--to {name}: there is no such format; write one of {', '.join(FORMATS)}")
    if found.package and importlib.util.find_spec(found.package) is None:
        raise missing_extra(f"--to {name}", found.extra)
    return found


def made_of(history: str) -> tuple[str, ...]:
    """The names of what `export` and `animate` make of a history where they are given none."""
    endings = (*(each.suffix for each in FORMATS.values()), ".gif")
    return tuple(Path(history).with_suffix(ending).name for ending in endings)


# The names of the files of a run; what other commands make of them is out of date once it has run anew.
HISTORY, SUMMARY, RESUME, REPORT = "history.nc", "summary.json", "resume.json", "report.html"
EARLIER = ".drumsqueal.earlier"
"""The folder in which results wait until those that replace them are complete."""
FIGURES = {
    "growth": "modes",
    "spectrogram": "spectra",
    "spectra": "spectra",
    "phase": "contact",
    "contact": "contact",
    "eigenvalues": "modes",
    "frequency": "modes",
}
"""The figures of a run, and which module of `questions/run/figures/` draws each, by `draw_NAME`."""
WHERE_BRAKE, WHERE_CHANGING = {"pressure": "contact"}, {"waterfall": "spectra"}
"""Those that it has besides where the steady pressure is not prescribed, and where drum speed or load change."""
RUN_FILES = (
    HISTORY,
    SUMMARY,
    RESUME,
    *map(figure_file, (*FIGURES, *WHERE_BRAKE, *WHERE_CHANGING)),
    REPORT,
    *made_of(HISTORY),
)

CYCLE_HISTORY = "cycle.nc"
PAPER_FIGURES = {
    "4": "fig04_friction",
    "5": "fig05_stiffness",
    "6": "fig06_constant_friction",
    "7": "fig07_speed",
    "8": "fig08_load",
    "9": "fig09_arc_angle",
    "10": "fig10_radius",
    "11": "fig11_width",
}
"""The figures of the paper by their numbers."""
FILES = {
    "accuracy": (
        "accuracy.csv",
        "simulate.toml",
        "accuracy_time.png",
        "accuracy_evaluations.png",
        "accuracy_causes.png",
    ),
    "compare": ("compare.csv", "compare.json", "compare.png"),
    "cycle": ("cycle.json", CYCLE_HISTORY, "cycle.png", *made_of(CYCLE_HISTORY)),
    "branch": ("branch.csv", "branch.json", "branch.png"),
    "effects": ("effects.csv", "reduced.toml", "effects.png"),
    "fit": ("fit.json", "fitted.toml", "fit.png"),
    "matrix": ("matrix.nc", "matrix.json", "matrix.csv", "matrix.png"),
    "motion": ("motion.json", "motion.csv", "motion_lines.png", "motion_section.png", "motion_exponents.png"),
    "onset": ("onset.csv", "onset.json", "onset.png", REPORT),
    "paper": ("paper.csv", "statements.csv", "statements.json", *map(figure_file, PAPER_FIGURES.values())),
    "sensitivity": ("sensitivity.csv", "sensitivity.json", "quiet.toml", "sensitivity.png", "quiet.png"),
    "sweep": ("sweep.nc", "sweep.json", "stability.png", "amplitude.png", "chance.png", "basin.png"),
}
"""What each command but `run` writes into its folder; "branch" is what `cycle` does along a range."""


def is_made(name: str) -> bool:
    """Whether other commands make a file of that name of results: it goes with them, and does not come by itself."""
    return name in (REPORT, *made_of(HISTORY), *made_of(CYCLE_HISTORY)) or _is_of_mode(name)


def _is_of_mode(name: str) -> bool:
    # What `animate --mode` calls a file where it is given no name: the mode, and its number.
    match = re.fullmatch(r"mode-(.+?)(?:\(\d+\))?\.gif", name)
    return match is not None and is_coordinate(match[1])


def files_of_run(folder: Path) -> tuple[str, ...]:
    """The names of the files of a run in a folder: also of the modes that are there, which depend on its scene."""
    try:
        there = {path.name for place in (folder, folder / EARLIER) for path in place.glob("*")}
    except (OSError, ValueError):  # which is reported where the folder is looked at
        there = []
    return *RUN_FILES, *sorted(filter(_is_of_mode, there))


def files_of(results: str, folder: Path) -> tuple[str, ...]:
    """What a command that leaves such results writes into a folder."""
    return files_of_run(folder) if results == "run" else FILES[results]


def folder_of(results: str, stem: str) -> Path:
    """Where results of a file of that name go unless told; those of a run have the scene's name alone."""
    return Path("out") / (stem if results == "run" else f"{stem}-{results}")


def history_file(place: Path) -> Path:
    """The history in a folder that a run has left, or the file itself."""
    try:
        return place / HISTORY if place.is_dir() else place
    except OSError:  # such as a name that is too long, which is reported where the file is opened
        return place


def is_history(path: Path) -> bool:
    """Whether there is an HDF5 file, as every history is, or a folder with one."""
    file = history_file(path)
    try:
        with open_ordinary(file, file.stat().st_size) as start:
            return start.read(4) == b"\x89HDF"  # how the files begin
    except (OSError, ValueError):  # reported where the file is read
        return False


def run_figures(*, changing: bool, brake: bool = False) -> tuple[str, ...]:
    """The figures of a run by whether drum speed or load change, and whether the steady pressure had to be found."""
    return (*FIGURES, *(WHERE_BRAKE if brake else ()), *(WHERE_CHANGING if changing else ()))


class UnwrittenError(OSError):
    """A file cannot be written; it is as it was before."""

    def __str__(self) -> str:
        """The file and the cause."""
        return f"{self.filename} cannot be written ({self.strerror})"


def check_output(folder: Path, files: Iterable[str], *, overwrite: bool) -> None:
    """Raise RequestError where files of these names lie already, or where something else is in the folder's place."""
    try:
        _check_place(folder)
        paths = [folder / name for name in files]
        taken = [path for path in paths if _is_there(path)]
        folders = [path for path in (*taken, *map(part_of, paths)) if path.is_dir()]
    except OSError as error:  # a name that is too long, a loop of links, a parent that may not be searched
        raise unusable(folder, error) from None
    if folders:
        raise RequestError(f"{folders[0]} is a folder, where a file is to go; choose another folder with -o")
    if taken and not overwrite:
        what = "remove" if is_made(taken[0].name) else "replace"
        raise RequestError(f"{taken[0]} exists; add --overwrite to {what} it, or choose another folder with -o")


def check_output_file(path: Path, *, overwrite: bool, option: str = "-o") -> None:
    """Raise RequestError where a file lies at the path already, or where none can be; `option` is what names it."""
    another = f"name another with {option}"
    try:
        try:
            _check_place(path.parent, option)
        except RequestError as error:
            raise RequestError(f"{path}: {error}") from None
        if path.is_dir():
            raise RequestError(f"{path} is a folder, where a file is to go; name the file with {option}")
        if path.exists() and not path.is_file():  # it would be replaced, not written to
            raise RequestError(f"{path} is not an ordinary file; {another}")
        part = part_of(path)
        if part.is_dir():
            raise RequestError(f"{part} is a folder, where the file is written; {another}")
        _is_there(part)  # whose name is longer
        if _is_there(path) and not overwrite:
            raise RequestError(f"{path} exists; add --overwrite to replace it, or name another file with {option}")
        if not path.parent.exists():
            raise RequestError(f"{path}: there is no folder {path.parent}; make it, or name another file with {option}")
        _try_to_write(path.parent)
    except OSError as error:
        raise unusable(path, error, option, "file") from None


def check_apart(path: Path, others: Iterable[Path], *, option: str = "-o") -> None:
    """Raise RequestError where a file that is to be written is one that is read, or written, too, by whatever name."""
    for other in others:
        try:
            same = os.path.realpath(path) == os.path.realpath(other)
        except OSError as error:  # the folder that one is in is gone
            raise unusable(path, error, option, "file") from None
        if same:
            raise RequestError(
                f"{path} would replace {other}, which is read or written, too; name another with {option}"
            )


def check_ending(path: Path, endings: Iterable[str], what: str) -> None:
    """Raise RequestError for a name that does not end as those of `what` do, in small letters or capitals."""
    if path.suffix.lower() not in endings:
        raise RequestError(f"{path}: {what} ends in {' or '.join(endings)}; give -o such a name")


def clear(folder: Path, files: Iterable[str], *, but: Iterable[str] = ()) -> list[str]:
    """Clear a folder of earlier files of these names, `but` for some, and return the names of those that went.

    What a program that was killed left half written is cleared, too. Raises RequestError where the folder cannot be
    written.
    """
    gone: list[str] = []
    try:
        _try_to_write(folder)
        for name in files:
            part_of(folder / name).unlink(missing_ok=True)
            if name not in but and _is_there(folder / name):
                (folder / name).unlink()
                gone.append(name)
    except OSError as error:
        raise unusable(folder, error) from None
    return gone


@contextmanager
def set_aside(folder: Path, files: Iterable[str], *, but: Iterable[str] = ()) -> Iterator[list[str]]:
    """Clear a folder of earlier results for the block, which makes them anew, and give the names of those that go.

    They are in the folder EARLIER until the block has ended well, and come back where it has written nothing. Those
    that are there already are from before a command that was stopped, whose own go. With `but`, results are gone on
    with, and all others are cleared at once. Raises RequestError where the folder cannot be written.
    """
    files, aside = tuple(files), folder / EARLIER
    try:
        earlier = [name for name in files if _is_there(aside / name)]
        if not but and not earlier:
            _try_to_write(folder)
            earlier = [name for name in files if _is_there(folder / name)]
            for name in earlier:
                aside.mkdir(exist_ok=True)
                (folder / name).rename(aside / name)
    except OSError as error:
        raise unusable(folder, error) from None
    gone = {*earlier, *clear(folder, files, but=but)}
    try:
        yield [name for name in files if name in gone]
    except BaseException as error:
        where = aside
        with suppress(OSError):  # what cannot come back stays there, and why the block ended is what is told
            if not any(_is_there(folder / name) for name in files):
                for name in earlier:
                    (aside / name).rename(folder / name)
                where = folder
        _remove_empty(aside)
        if earlier and isinstance(error, IntegrationError):
            raise type(error)(f"{error}; the earlier results are in {where}") from None
        raise
    for name in earlier:
        (aside / name).unlink(missing_ok=True)
    _remove_empty(aside)


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):  # there is something in it, or it is not there
        folder.rmdir()


def _try_to_write(folder: Path) -> None:
    """Raise OSError where no file can be made in a folder, whoever asks and whatever its permissions say."""
    with tempfile.TemporaryFile(dir=folder):
        pass


def part_of(path: Path) -> Path:
    """Where a file is written before it takes its place."""
    return path.with_name(f"{path.name}.part")


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or, where the disk or Ctrl-C stops it, leave what was there before. Raises OSError."""
    with written_whole(path) as part:
        part.write_bytes(content)


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Where to write a file, which takes its place after the block, or is no more. Raises OSError, naming the file."""
    part = part_of(path)
    try:
        part.unlink(missing_ok=True)  # a link would be followed
        yield part
        part.replace(path)
    except BaseException as error:
        part.unlink(missing_ok=True)
        if isinstance(error, OSError):  # which names the part, or nothing
            raise UnwrittenError(error.errno or errno.EIO, error.strerror or str(error), str(path)) from None
        raise


def _check_place(folder: Path, option: str = "-o") -> None:
    """Raise RequestError where the innermost part of the path that is there is no folder."""
    there = next(part for part in (folder, *folder.parents) if _is_there(part))
    place = there if there == folder else f"{folder}: {there}"
    if not there.exists():
        raise RequestError(f"{place} is a link that leads nowhere; choose another folder with {option}")
    if not there.is_dir():
        raise RequestError(f"{place} is a file, not a folder; choose another with {option}")


def _is_there(path: Path) -> bool:
    """Whether the name is taken, if only by a link that leads nowhere."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    except ValueError as error:  # a null character
        raise OSError(str(error)) from None
    return True


def not_taken(error: OSError, folder: Path) -> str:
    """How a study fails whose results cannot be written: the file, or the folder where the error names none; why."""
    return f"failed: the disk does not take the results ({error.filename or folder}: {error.strerror or error})"


def unusable(path: Path, error: OSError, option: str = "-o", what: str = "folder") -> RequestError:
    """The error of a folder, or a file, that cannot be written."""
    cure = f"{'choose' if what == 'folder' else 'name'} another with {option}"
    return RequestError(f"{path}: this {what} cannot be written ({error.strerror or error}); {cure}")


# Plain data and findings as JSON.


def to_json(data: Any) -> str:
    """JSON text of plain data or of findings, with a final line break; null for a number that is not finite."""
    return pydantic_core.to_json(data, indent=2, ensure_ascii=True, inf_nan_mode="null").decode() + "\n"


def write_json(data: Any, path: Path) -> None:
    """Write data to a file, whole or not at all. Raises OSError."""
    write_whole(path, to_json(data).encode())
