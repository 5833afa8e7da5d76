"""A history, or a part of it, into one file of another format."""

from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.files.output_folder import written_whole
from drumsqueal.files.saved_history import SavedHistory
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.export.formats import Format
from drumsqueal.questions.export.selection import Part, select
from drumsqueal.scene.quantities import printable


def export_into(
    path: Path, saved: SavedHistory, wanted: Format, part: Part, console: Console, complaints: Console
) -> dict[str, Any]:
    """Write a part of a history as a file, print what is in it and return that; remarks go to the other console, too.

    The file is written whole or not at all. Raises RequestError for a part that cannot be had, and OSError where the
    disk does not take it.
    """
    channels, remarks = select(saved, part, predicts=wanted.predicts)
    stop_if_interrupted()
    with written_whole(path) as place:
        told = wanted.writer()(channels, place)
        stop_if_interrupted()
    for remark in remarks:
        complaints.print(printable(f"drumsqueal: {remark}"), soft_wrap=True)
    time, count = channels.time, len(channels.channels)
    signals = f"{count} signals" if count > 1 else channels.channels[0].name
    span = f"{time.size} samples at {channels.sample_rate:.6g} Hz from {time[0]:.6g} to {time[-1]:.6g} s"
    if told:
        console.print(printable(f"{told[0].upper()}{told[1:]}"), soft_wrap=True)
    console.print(printable(f"{signals}, {span}, in {path}"), soft_wrap=True)
    return {
        "file": str(path),
        "signals": {channel.name: channel.units for channel in channels.channels},
        "samples": time.size,
        "sample_rate_Hz": channels.sample_rate,
        "from_s": float(time[0]),
        "until_s": float(time[-1]),
        "slow": channels.slow,
        "note": told,
        "remarks": remarks,
    }
