"""A history, or a part of it, into one file of another format; what a lower rate cannot hold is reported."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from rich.console import Console

from drumsqueal.coordinates import unit_of
from drumsqueal.errors import RequestError, SteadyStateError
from drumsqueal.files.history_file import UNEVEN, SavedHistory
from drumsqueal.files.output_folder import Format, written_whole
from drumsqueal.findings.history import time_window
from drumsqueal.findings.schema import Finding
from drumsqueal.findings.signals.sound import (
    FULL_SCALE,
    HEADROOM_DB,
    PASSES,
    fraction_above,
    reach,
    resample,
    to_sound,
    wav_bytes,
)
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.export.signals import FLAG, UNKNOWN, Channel, Channels, distinct, make_channels, names_of
from drumsqueal.scene.quantities import percent, printable

if TYPE_CHECKING:
    from drumsqueal.solve.linear.modes import Stability

LOWEST = 200  # times the rate may be below the history's: the filter grows as long
MOST_SAMPLES = 2 * 10**8  # of all signals together: 1.6 GB
_BLOCK = 2**14  # rows at a time

Arrays = dict[str, NDArray[Any]]


class Part(NamedTuple):
    """What is asked for: signals (None for all), from and until when (s), and the rate (Hz); None is the history's.

    A sound is `slow` times slower than it was, and is resampled to `slow` times the rate.
    """

    signals: tuple[str, ...] | None = None
    since: float | None = None
    until: float | None = None
    rate: float | None = None
    slow: float = 1.0


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

    Without a rate, or at the history's own, samples are as they were recorded. Flags such as sticking are taken from
    the nearest sample, all else is limited to the new band. Raises RequestError for signals that are not there, for a
    part of fewer than two samples, and for a rate out of proportion, and OSError where the disk does not take the file.
    """
    names, remarks = names_of(part.signals, saved)
    asked = saved.scene.simulate.sample_rate
    own = asked if abs(saved.sample_rate / asked - 1) < UNEVEN else saved.sample_rate
    rate = own if part.rate is None else part.rate * part.slow
    place, end, count = _places(saved, part, own, rate, len(names))
    if not saved.complete:
        remarks.append(f"the run is incomplete ({saved.outcome}); what it computed is exported")
    if rate == own:
        signals = make_channels(saved, names, slice(int(place), int(place) + count))
    else:
        # What lies before and after the part is known, and the filter sees it.
        beyond = reach(own, rate)
        low = max(int(place) - beyond, 0)
        recorded = make_channels(saved, names, slice(low, int(end) + beyond + 2))
        remarks += _lost(recorded, own, rate, part)
        signals = _resampled(recorded, own, place - low, count, rate)
    stability, unknown = _predicted(saved) if wanted.predicts else (None, {})
    start = float(saved.data["time"].values[0]) + place / own
    channels = Channels(start, rate, tuple(signals), _texts(saved) | unknown, saved.scene, stability, part.slow)
    with written_whole(path) as file:
        note = wanted.writer()(channels, file, progress)
        progress("written", 0.0, None)  # Ctrl-C until now leaves what was there before
    time = channels.time
    return Exported(
        file=str(path),
        signals={channel.name: channel.units for channel in signals},
        samples=time.size,
        sample_rate_Hz=rate,
        from_s=time[0],
        until_s=time[-1],
        slow=part.slow,
        note=note,
        remarks=tuple(remarks),
    )


def _places(saved: SavedHistory, part: Part, own: float, rate: float, signals: int) -> tuple[float, float, int]:
    """Begin and end of the part in samples from the first of the history on, and how many there are at the new rate.

    Raises RequestError.
    """
    begin, latest = saved.data["time"].values[[0, -1]].tolist()
    first, last = time_window("the history", (begin, latest), 1 / own, part.since, part.until)
    place, end = (first - begin) * own, (last - begin) * own
    if rate == own:  # the samples within the part
        place, end = float(np.ceil(place - UNEVEN)), float(np.floor(end + UNEVEN))
    count = int((end - place) * rate / own + UNEVEN) + 1
    if rate < own / LOWEST:
        why = f"--rate {rate / part.slow:.6g} Hz is less than 1/{LOWEST} of the history's {own:.6g} Hz"
        raise RequestError(f"{why}; take at least {own / LOWEST / part.slow:.6g} Hz")
    if count < 2:
        why = f"{first:.6g} to {last:.6g} s hold {count} samples at {rate:.6g} Hz, at least two are needed"
        raise RequestError(f"{why}; take more of the history, or a higher --rate")
    if count * signals > MOST_SAMPLES:
        why = f"{count} samples of {signals} signals are more than are written at a time"
        raise RequestError(f"{why}; take a part with --from, --until, --signals, or a lower --rate")
    return place, end, count


def _resampled(recorded: Sequence[Channel], own: float, place: float, count: int, rate: float) -> list[Channel]:
    """Channels at so many times from a place (samples) on, at a rate (Hz)."""
    places = place + np.arange(count) * (own / rate)
    nearest = np.clip(np.floor(places + 0.5).astype(int), 0, recorded[0].values.size - 1)
    resampled = [channel._replace(values=channel.values[nearest]) for channel in recorded]
    smooth = [k for k, channel in enumerate(recorded) if channel.quantity != FLAG]
    if smooth:
        values = resample(np.stack([recorded[k].values for k in smooth], axis=1), own, places / own, rate)
        for k, column in zip(smooth, values.T, strict=True):
            resampled[k] = recorded[k]._replace(values=column)
    return resampled


def _lost(recorded: Sequence[Channel], own: float, rate: float, part: Part) -> list[str]:
    """One line on what the rate cannot hold; nothing where that is next to nothing."""
    if rate >= own:
        return []
    smooth = [channel for channel in recorded if channel.quantity != FLAG]
    lost = [(channel.name, *fraction_above(channel.values, own, rate / 2)) for channel in smooth]
    # 1e-4 of a signal's energy, a hundredth of its amplitude: a smaller loss is not reported
    lost = sorted((found for found in lost if found[1] > 1e-4), key=lambda found: -found[1])
    if not lost:
        return []
    name, fraction, line = lost[0]
    others = f", and part of {len(lost) - 1} other signal{'s' * (len(lost) > 2)}" if len(lost) > 1 else ""
    slower = "" if part.slow == 1 else f", {part.slow:g} times slower,"
    why = (
        f"a rate of {rate / part.slow:.6g} Hz{slower} holds what is below {rate / 2:.6g} Hz: {percent(fraction)} of "
        f"the energy of {name} lies above, most at {line:.5g} Hz{others}; it is filtered out, as it would be aliased"
    )
    keeps = line / PASSES / part.slow
    return [f"{why}; {np.ceil(keeps):.6g} Hz would keep that line" if line / PASSES < own else why]


def _texts(saved: SavedHistory) -> dict[str, str]:
    attributes = saved.data.attrs
    held = json.loads(attributes["versions"]) if "versions" in attributes else {}
    texts = {
        "title": saved.scene.title,
        "scene": saved.scene.to_toml(),
        "versions": " ".join(f"{name} {version}" for name, version in held.items()),
        "outcome": saved.outcome,
        "source": saved.path.name,
        "measured_from": str(attributes.get("measured_from", "")),
    }
    return texts | ({"friction_law": str(attributes["friction_law"])} if saved.given_law else {})


def _predicted(saved: SavedHistory) -> tuple["Stability | None", dict[str, str]]:
    """The modes of steady sliding, or None and why not."""
    if saved.given_law:
        return None, {UNKNOWN: "the friction law was given in Python"}
    from drumsqueal.physics.composition import linear_coordinates
    from drumsqueal.physics.model import build_model
    from drumsqueal.solve.linear.modes import analyse_stability

    try:
        return analyse_stability(build_model(saved.scene, coordinates=linear_coordinates(saved.scene))), {}
    except SteadyStateError as error:
        return None, {UNKNOWN: str(error)}


def print_exported(console: Console, complaints: Console, done: Exported) -> None:
    """Print what a file holds; what it does not hold goes to the other console."""
    for remark in done.remarks:
        complaints.print(printable(f"drumsqueal: {remark}"), soft_wrap=True)
    if done.note:
        console.print(printable(done.note), soft_wrap=True)
    signals = f"{len(done.signals)} signals" if len(done.signals) > 1 else next(iter(done.signals))
    span = f"{done.samples} samples at {done.sample_rate_Hz:.6g} Hz from {done.from_s:.6g} to {done.until_s:.6g} s"
    console.print(printable(f"{signals}, {span}"), soft_wrap=True)


# Formats: each writes signals and returns a note on the file, "" for none. All raise OSError where the disk does not
# take the file.


def write_csv(channels: Channels, path: Path, progress: Progress) -> str:
    """Write one line of names with units, "velocity_X (m/s)", and one for each sample, which read back to the last bit.

    pandas writes the same bytes in 1.7 times the time.
    """
    columns = [channels.time, *(channel.values for channel in channels.channels)]
    names = ["time (s)", *(f"{channel.name} ({channel.units})" for channel in channels.channels)]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(names) + "\n")
        for first in range(0, columns[0].size, _BLOCK):
            progress("writing rows", first, columns[0].size)
            rows = zip(*(column[first : first + _BLOCK].tolist() for column in columns), strict=True)
            # Floats as Python writes them are the shortest that read back to the same number.
            file.writelines(",".join(map(repr, row)) + "\n" for row in rows)
    return ""


def write_mat(channels: Channels, path: Path, progress: Progress) -> str:
    """Write t (s), fs (Hz), each signal by its name, units.NAME, eigenvalues, modes.NAME and the texts, as version 5.

    Names are as MATLAB takes them, displacement_drum_E1 for displacement_drum.E1. Signals are columns. Raises
    RequestError for one that is longer than the format takes.
    """
    if channels.time.nbytes > 2**31 - 2**20:  # bytes of one variable that a MAT file takes
        raise RequestError("--to mat: a variable of a MAT file has 2 GB at most; take a part with --from and --until")
    # 63 characters that MATLAB takes
    names = distinct([re.sub(r"\W", "_", channel.name) for channel in channels.channels], 63)
    named = list(zip(names, channels.channels, strict=True))
    variables: dict[str, Any] = {name: channel.values for name, channel in named}
    variables |= {"t": channels.time, "fs": np.array(channels.sample_rate)}
    units: dict[str, Any] = {name: channel.units for name, channel in named} | {"t": "s", "fs": "Hz"}
    if channels.stability is not None:
        steady, modes = (
            # Text becomes a cell array, as MATLAB has it.
            {name: values.astype(object) if values.dtype.kind == "U" else values for name, values in arrays.items()}
            for arrays in _modes_of(channels)
        )
        units |= {"eigenvalues": "1/s", "steady_state": steady.pop("coordinate_units")}
        variables |= steady | {"modes": modes}
    progress("writing", 0.0, None)
    with path.open("wb") as file:
        scipy.io.savemat(file, variables | channels.texts | {"units": units}, oned_as="column", long_field_names=True)
    return ""


def write_npz(channels: Channels, path: Path, progress: Progress) -> str:
    """Write time (s), sample_rate (Hz), each signal by its name, `signals` with `units`, and the texts, without pickle.

    `signals` and `units` are arrays of text in the same order. Where eigenvalues are known there are those, and
    `coordinates`, `coordinate_units`, `steady_state` and, of the oscillating modes, `mode_name` to `mode_shape`.
    """
    arrays: Arrays = {channel.name: channel.values for channel in channels.channels}
    arrays |= {
        "time": channels.time,
        "sample_rate": np.array(channels.sample_rate),
        "signals": np.array([channel.name for channel in channels.channels]),
        "units": np.array([channel.units for channel in channels.channels]),
    }
    steady, modes = _modes_of(channels)
    arrays |= steady | {f"mode_{name}": values for name, values in modes.items()}
    arrays |= {name: np.array(text) for name, text in channels.texts.items()}
    progress("writing", 0.0, None)
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    return ""


def _modes_of(channels: Channels) -> tuple[Arrays, Arrays]:
    """Of steady sliding, and of its m oscillating modes by rising frequency; empty where eigenvalues are not known.

    All 2n eigenvalues (1/s), the n coordinates with names and units; λ (1/s), frequencies, growth rates, ζ, and shapes
    (n, m). A column of `shape` is the complex eigenvector of the coordinates, that of the mode's name scaled to 1.
    """
    stability = channels.stability
    if stability is None:
        return {}, {}
    modes, n = stability.modes, len(stability.coordinates)
    return {
        "eigenvalues": stability.eigenvalues,
        "coordinates": np.array(stability.coordinates),
        "coordinate_units": np.array([unit_of(name) for name in stability.coordinates]),
        "steady_state": stability.steady_state,
    }, {
        "name": np.array([mode.label for mode in modes], dtype=str),
        "eigenvalue": np.array([mode.eigenvalue for mode in modes], dtype=np.complex128),
        "frequency_Hz": np.array([mode.frequency_Hz for mode in modes]),
        "growth_rate_1_per_s": np.array([mode.growth_rate for mode in modes]),
        "damping_ratio": np.array([mode.damping_ratio for mode in modes]),
        "shape": np.array([mode.right[:n] for mode in modes], dtype=np.complex128).reshape(-1, n).T,
    }


def write_parquet(channels: Channels, path: Path, progress: Progress) -> str:
    """Write the columns, `units` and `meaning` in the metadata of each and the texts in that of the file."""
    import pyarrow
    import pyarrow.parquet

    fields = [pyarrow.field("time", pyarrow.float64(), nullable=False, metadata={"units": "s"})]
    for channel in channels.channels:
        described = {"units": channel.units, "meaning": channel.meaning}
        fields.append(pyarrow.field(channel.name, pyarrow.float64(), nullable=False, metadata=described))
    prediction = "\n".join(channels.prediction)
    texts = channels.texts | {"sample_rate": repr(channels.sample_rate), "eigenvalues": prediction}
    columns = [pyarrow.array(values) for values in (channels.time, *(each.values for each in channels.channels))]
    progress("writing", 0.0, None)
    with path.open("wb") as file:
        table = pyarrow.Table.from_arrays(columns, schema=pyarrow.schema(fields, metadata=texts))
        pyarrow.parquet.write_table(table, file)
    return ""


def write_wav(channels: Channels, path: Path, progress: Progress) -> str:
    """Write the one signal as 16-bit PCM at sample_rate / slow (Hz), and return its scale, which is also in the file.

    Raises RequestError for a signal that is silent.
    """
    if len(channels.channels) != 1:
        why = "a sound is of one signal, such as surface_velocity"
        raise RequestError(f"--signals {', '.join(each.name for each in channels.channels)}: {why}")
    (channel,) = channels.channels
    rate = round(channels.sample_rate / channels.slow)
    try:
        sound = to_sound(channel.values, channels.sample_rate, slow=channels.slow, rate=rate)
    except ValueError:
        raise RequestError(f"--to wav: {channel.name} is constant in this part; there is nothing to hear") from None
    replay = "" if channels.slow == 1 else f" played {channels.slow:g} times slower than it was,"
    scale = f"one step of the samples is {sound.scale:.9g} {channel.units}"
    comment = f"{channel.name}, {channel.meaning},{replay} {scale}, steady part left out"
    progress("writing", 0.0, None)
    path.write_bytes(wav_bytes(sound, channels.texts.get("title", ""), comment))
    return (
        f"{sound.samples.size / rate:.4g} s of sound at {rate} Hz,{replay} peak {sound.peak:.4g} {channel.units} at "
        f"-{HEADROOM_DB:g} dB of full scale, {sound.scale * FULL_SCALE:.4g} {channel.units}"
    )
