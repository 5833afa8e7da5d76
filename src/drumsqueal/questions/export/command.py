"""`drumsqueal export HISTORY --to FORMAT`, and the formats by name, which load nothing yet."""

import importlib.util
import math
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from drumsqueal.errors import RequestError, missing_extra
from drumsqueal.files.claims import claim_results
from drumsqueal.files.output_folder import check_ending, history_file
from drumsqueal.progress import Progress
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    Since,
    Until,
    complete_signals,
    read_file,
    read_rate,
    read_time,
    words,
)
from drumsqueal.terminal.reply import Reply, make_console

if TYPE_CHECKING:
    from drumsqueal.questions.export.signals import Channels

LEAST_RATE, MOST_RATE = 1000.0, 192_000.0  # Hz, that players take
_SIGNALS = (
    "Names with commas between, e.g. velocity,brake_torque,displacement_Y (default: all; for sound surface_velocity, "
    "of several shoes that of the one that moves most)."
)


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

    def writer(self) -> "Callable[[Channels, Path, Progress], str]":
        """The function that writes a file, calling a hook for progress, and returns a note on it ("" for none)."""
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


def export_command(
    history: Annotated[
        Path, typer.Argument(metavar="HISTORY", help="A history, or the folder of a run.", show_default=False)
    ],
    to: Annotated[
        str,
        typer.Option("--to", metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.", autocompletion=words(*FORMATS)),
    ],
    signals: Annotated[
        str | None, typer.Option("--signals", metavar="NAMES", help=_SIGNALS, autocompletion=complete_signals)
    ] = None,
    since: Since = None,
    until: Until = None,
    rate: Annotated[
        str | None,
        typer.Option("--rate", metavar="RATE", help="Resample (default: as recorded; for sound 44.1 kHz)."),
    ] = None,
    slow: Annotated[
        float | None,
        typer.Option("--slow", metavar="TIMES", help="Sound only: how many times slower, and lower."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", parser=read_file, help="File (default: next to HISTORY)."),
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Write a history for other programs, or as sound.

    The formats are csv, mat, npz, parquet, uff58 (universal file format) and wav.

    Example: drumsqueal export out/nominal --to wav --from "0.2 s" --slow 4
    """
    wanted = find_format(to)
    sound = to == "wav"
    if slow is not None and not sound:
        raise RequestError(f"--slow {slow:g} is for a sound; add --to wav, or leave --slow out")
    if slow is not None and not (math.isfinite(slow) and 0.01 <= slow <= 1000):
        raise RequestError(f"--slow {slow:g}: write how many times slower, from 0.01 to 1000, such as 4")
    asked = None if signals is None else tuple(name.strip() for name in signals.split(","))
    if sound and asked is not None and len(asked) != 1:
        raise RequestError(f"--signals {signals}: a sound is of one signal, such as surface_velocity")
    begin, end, sampled = read_time(since, "--from"), read_time(until, "--until"), read_rate(rate, "--rate")
    if sound and sampled is not None and not (sampled == round(sampled) and LEAST_RATE <= sampled <= MOST_RATE):
        why = f"that of a sound must be a whole number of Hz, from {LEAST_RATE / 1e3:g} to {MOST_RATE / 1e3:g} kHz"
        raise RequestError(f"--rate {sampled:.10g} Hz: {why}")
    source = history_file(history)
    file = output if output is not None else source.with_suffix(wanted.suffix)
    reply = Reply.with_file(file, (source,), quiet, json_file, overwrite=overwrite)
    claim_results(source.parent)
    from drumsqueal.files.history_file import read_history
    from drumsqueal.findings.signals.sound import CD_RATE
    from drumsqueal.questions.export.export import Part, export_history, print_exported
    from drumsqueal.questions.export.signals import default_signal
    from drumsqueal.terminal.reply import answer_without_folder

    saved = read_history(history)
    check_ending(file, wanted.endings, f"a file of --to {to}")
    if sound:
        asked, sampled = asked or (default_signal(saved),), sampled or float(CD_RATE)
    part = Part(asked, begin, end, rate=sampled, slow=1.0 if slow is None else slow)
    complaints = make_console(stderr=True, quiet=quiet)
    answer_without_folder(
        reply,
        lambda console, done: print_exported(console, complaints, done),
        lambda progress: export_history(saved, file, wanted, part, progress=progress),
    )
