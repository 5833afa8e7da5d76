"""A history, or a part of it, into one file of another format."""

from pathlib import Path

from rich.console import Console

from drumsqueal.files.output_folder import written_whole
from drumsqueal.files.saved_history import SavedHistory
from drumsqueal.findings.schema import Finding
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.export.formats import Format
from drumsqueal.questions.export.selection import Part, select
from drumsqueal.scene.quantities import printable


class Exported(Finding):
    """What a file holds: signals with their units, how many samples from and until when (s), and at which rate (Hz).

    `slow` is how many times slower a sound is, `note` what its format adds, `remarks` what it does not hold.
    """

    file: str
    signals: dict[str, str]
    samples: int
    sample_rate_Hz: float
    from_s: float
    until_s: float
    slow: float
    note: str
    remarks: tuple[str, ...]


def export_history(
    saved: SavedHistory, path: Path, wanted: Format, part: Part, *, progress: Progress = silent
) -> Exported:
    """Write a part of a history as a file, whole or not at all, and return what is in it.

    Raises RequestError for a part that cannot be had, and OSError where the disk does not take it.
    """
    channels, remarks = select(saved, part, predicts=wanted.predicts)
    with written_whole(path) as place:
        note = wanted.writer()(channels, place, progress)
        progress("written", 0.0, None)  # Ctrl-C until now leaves what was there before
    time = channels.time
    return Exported(
        file=str(path),
        signals={channel.name: channel.units for channel in channels.channels},
        samples=time.size,
        sample_rate_Hz=channels.sample_rate,
        from_s=time[0],
        until_s=time[-1],
        slow=channels.slow,
        note=note,
        remarks=tuple(remarks),
    )


def print_exported(console: Console, complaints: Console, done: Exported) -> None:
    """Print what a file holds; what it does not hold goes to the other console."""
    for remark in done.remarks:
        complaints.print(printable(f"drumsqueal: {remark}"), soft_wrap=True)
    if done.note:
        console.print(printable(f"{done.note[0].upper()}{done.note[1:]}"), soft_wrap=True)
    signals = f"{len(done.signals)} signals" if len(done.signals) > 1 else next(iter(done.signals))
    span = f"{done.samples} samples at {done.sample_rate_Hz:.6g} Hz from {done.from_s:.6g} to {done.until_s:.6g} s"
    console.print(printable(f"{signals}, {span}"), soft_wrap=True)
