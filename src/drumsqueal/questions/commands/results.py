"""The commands on results that there are: `report`, `animate`, `export`, `compare`, `fit`."""

import math
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.files.claims import claim_folder, claim_results
from drumsqueal.files.output_folder import (
    FILES,
    FORMATS,
    HISTORY,
    REPORT,
    SUMMARY,
    check_ending,
    files_of_run,
    find_format,
    folder_of,
    history_file,
    is_history,
)
from drumsqueal.progress import Progress
from drumsqueal.scene import load_scene, load_with_tables
from drumsqueal.scene.file import find_scene
from drumsqueal.terminal.options import (
    SIGNALS,
    JsonFile,
    Overwrite,
    Quiet,
    SceneFile,
    Settings,
    Since,
    Until,
    UsageError,
    complete_files,
    complete_list,
    complete_mode,
    complete_signals,
    file_option,
    output_option,
    read_folder,
    read_fraction,
    read_rate,
    read_time,
    words,
)
from drumsqueal.terminal.reply import Reply, answer, answer_without_folder, make_console


def report_command(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", parser=read_folder, help="Folder with the results of run, onset or matrix.")
    ],
    output: Annotated[Path | None, file_option(f"The page (default: DIR/{REPORT}).")] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Make one HTML page of the results of run, onset or matrix.

    The page needs no network. It holds the verdict, figures, animated modes, sound, accuracy, scene and versions.

    Example: drumsqueal report out/nominal
    """
    kind = what_is_in(folder)
    file = folder / REPORT if output is None else output
    check_ending(file, (".html", ".htm"), "a page")
    read = [folder / name for name in (*files_of_run(folder), *FILES["onset"], *FILES["matrix"]) if name != REPORT]
    reply = Reply.with_file(file, read, quiet, json_file, overwrite=overwrite)
    claim_results(folder)
    from drumsqueal.questions.report.answer import print_page, write_page

    answer_without_folder(reply, print_page, lambda progress: write_page(file, folder, kind, progress))


def what_is_in(folder: Path) -> str:
    """Whose results a folder holds, "run", "onset" or "matrix". Raises RequestError for none, and for several."""
    kinds = {"run": (SUMMARY, HISTORY), "onset": ("onset.json", "onset.csv"), "matrix": ("matrix.json", "matrix.nc")}
    try:
        if not folder.is_dir():
            there = "a file, not a folder" if folder.exists() else "not there"
            raise RequestError(f"{folder} is {there}; name a folder that drumsqueal run, onset or matrix wrote")
        held = [kind for kind, files in kinds.items() if any((folder / name).is_file() for name in files)]
    except OSError as error:
        raise RequestError(f"{folder}: cannot be read ({error.strerror or error})") from None
    if not held:
        wanted = f"a run ({SUMMARY}, {HISTORY}), a study of the onset (onset.json) or a matrix (matrix.json)"
        raise RequestError(f"{folder} does not hold {wanted}; name a folder that one of them wrote")
    if len(held) > 1:
        raise RequestError(
            f"{folder} holds the results of {' and '.join(held)}; put one of them into a folder of its own"
        )
    return held[0]


AUTO = "auto"
MODE = "Show this mode of a scene, or of a run's scene, such as Y."


def animate_command(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="HISTORY|SCENE",
            help="History or its folder; with --mode also a scene.",
            autocompletion=complete_files(".nc", ".toml"),
        ),
    ],
    output: Annotated[
        Path | None, file_option("File, .gif or .mp4 (default: next to the history, or out/SCENE-MODE.gif).")
    ] = None,
    mode: Annotated[str | None, typer.Option(metavar="MODE", help=MODE, autocompletion=complete_mode)] = None,
    since: Since = None,
    until: Until = None,
    slow: Annotated[
        str, typer.Option(metavar="FACTOR", help="How many times slower than real time; auto: in 6 s.")
    ] = AUTO,
    magnify: Annotated[
        str, typer.Option(metavar="FACTOR", help="Magnify the displacement; auto: 30 % of the thickness.")
    ] = AUTO,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Animate shoe and drum in section: a history or a mode.

    Shows the last periods of a history, or one period of a mode. Displacement is magnified; colours along the arc show
    the pressure, lift-off, slip reversal and sticking.

    Example: drumsqueal animate scenarios/nominal.toml --mode Y
    """
    slowness, magnification = _factor(slow, "--slow"), _factor(magnify, "--magnify")
    for option, value in {"--from": since, "--until": until, "--magnify": magnification}.items():
        if mode is not None and value is not None:
            raise UsageError(f"{option} is for histories; a mode has neither a time nor a size of its own")
    # With --mode a folder is a run's, whose scene need not be the shipped one of that name.
    read = history_file(source) if mode is None or source.is_dir() else find_scene(str(source))
    recorded = mode is None or read.suffix == Path(HISTORY).suffix
    if recorded and settings:
        raise UsageError("--set changes a scene; a history is of the scene that was run: leave one of them out")
    if mode is None and source.suffix == ".toml":
        raise RequestError(f"{source} is a scene: name one of its modes with --mode, or give a history of a run of it")
    first, last = read_time(since, "--from"), read_time(until, "--until")
    file = output or _default_file(source, read, mode, recorded=recorded)
    loaded = None if recorded else load_scene(read, settings or ())
    if output is None and not recorded and not file.parent.exists():
        claim_folder(file.parent)  # `out`, which is made, and goes again where nothing comes of it
    reply = Reply.with_file(file, (read,), quiet, json_file, overwrite=overwrite)
    if recorded:
        claim_results(read.parent)
    from drumsqueal.files.history_file import read_history
    from drumsqueal.questions.animate.animation import Animation, check_animation_name, print_animation, save_animation
    from drumsqueal.questions.animate.playback import find_mode, play_history, play_mode
    from drumsqueal.simulation import prepare

    check_animation_name(file)

    def find(progress: Progress) -> Animation:
        saved = read_history(read) if loaded is None else None
        if saved is not None and mode is None:
            asked = {"start": first, "end": last, "slow": slowness, "magnification": magnification}
            shown = play_history(saved.data, saved.scene, **asked)
            return save_animation(shown, file, progress)
        if saved is not None and saved.given_law:
            why = "its friction law was given in Python and is not in the file, so that its modes are not known"
            raise RequestError(f"{read}: {why}; name a scene file")
        scene = loaded if saved is None else saved.scene
        assert scene is not None
        assert mode is not None
        stability = prepare(scene).stability
        return save_animation(play_mode(scene, stability, find_mode(stability, mode), slow=slowness), file, progress)

    answer_without_folder(reply, print_animation, find)


def _default_file(source: Path, read: Path, mode: str | None, *, recorded: bool) -> Path:
    """The default file: in the folder of the history, or in `out`."""
    if mode is None:
        return read.with_suffix(".gif")
    name = f"{mode.replace(' ', '').replace('/', '')}.gif"
    return read.with_name(f"mode-{name}") if recorded else Path("out") / f"{source.stem}-{name}"


def _factor(text: str, option: str) -> float | None:
    """A positive number, None for "auto"."""
    if text == AUTO:
        return None
    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if not (factor > 0 and math.isfinite(factor)):
        raise RequestError(f"{option} {text}: write auto, or a positive number such as 1000")
    return factor


LEAST_RATE, MOST_RATE = 1000.0, 192_000.0  # Hz, that players take
_SIGNALS = (
    "Names with commas between, e.g. velocity,brake_torque,displacement_Y (default: all; for sound surface_velocity, "
    "of several shoes that of the one that moves most)."
)


def export_command(
    history: Annotated[Path, typer.Argument(metavar="HISTORY", help="A history, or the folder of a run.")],
    to: Annotated[
        str, typer.Option(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.", autocompletion=words(*FORMATS))
    ],
    signals: Annotated[
        str | None, typer.Option(metavar="NAMES", help=_SIGNALS, autocompletion=complete_signals)
    ] = None,
    since: Since = None,
    until: Until = None,
    rate: Annotated[
        str | None, typer.Option(metavar="RATE", help="Resample (default: as recorded; for sound 44.1 kHz).")
    ] = None,
    slow: Annotated[
        float | None, typer.Option(metavar="TIMES", help="Sound only: how many times slower, and lower.")
    ] = None,
    output: Annotated[Path | None, file_option("File (default: next to HISTORY).")] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Write a history for other programs, or as sound.

    uff58 is the universal file format; --to names all formats.

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


SampleRate = Annotated[
    str | None, typer.Option(metavar="RATE", help='Sample rate of a file without one, such as "51.2 kHz".')
]
SIGNAL = "Simulated signal, such as velocity_Y or brake_torque."
DEFAULT = "Default: surface_velocity, of several shoes that of the one that moves most."
UNIT = 'Unit of the values where the file states none, such as "mm/s", g or, calibrated, "50 mm/s".'


def compare_command(
    history: Annotated[Path, typer.Argument(metavar="HISTORY", help="The history.nc of a run, or its folder.")],
    measured: Annotated[Path, typer.Argument(metavar="MEASURED", help="Measured record: CSV, UFF58 or WAV.")],
    output: Annotated[Path | None, output_option("HISTORY-compare")] = None,
    signal: Annotated[
        str | None, typer.Option(metavar="NAME", help=f"{SIGNAL} {DEFAULT}", autocompletion=words(*SIGNALS))
    ] = None,
    channel: Annotated[str | None, typer.Option(metavar="NAME|N", help="Measured channel, by name or number.")] = None,
    rate: SampleRate = None,
    unit: Annotated[str | None, typer.Option(metavar="UNIT", help=UNIT)] = None,
    since: Since = None,
    until: Until = None,
    within: Annotated[
        str, typer.Option(metavar="FRACTION", help="Largest distance between the two lines of a pair.")
    ] = "5%",
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Which measured lines are simulated, and how far apart are they?

    Compares the lines of a measured record with the simulated ones and with the eigenvalues.

    Writes compare.csv, compare.json and compare.png into DIR. A measured acceleration or displacement is compared with
    a simulated velocity line by line; a record without a unit, such as a microphone's, by frequency and relative level.
    Levels are those of rms values, re ISO 1683. --from and --until take a part of MEASURED.

    Example: drumsqueal compare out/nominal rig.csv --channel vibrometer --unit mm/s
    """
    if is_history(measured) and not is_history(history):
        why = f"{measured} is a history and {history} is not: the history comes first"
        raise RequestError(f"{why}; write drumsqueal compare {measured} {history}")
    read, whole = (history_file(history), measured), history.absolute()
    # Where the history is called as every run calls it, its folder is its name.
    name = whole.parent.name if whole.name == HISTORY else whole.stem
    folder = output or folder_of("compare", name)
    reply = Reply.with_folder("compare", folder, read, quiet, json_file, overwrite=overwrite)
    claim_results(read[0].parent)
    widest = read_fraction(within, "--within")
    begin, end, sampled = read_time(since, "--from"), read_time(until, "--until"), read_rate(rate, "--rate")
    from drumsqueal.questions.compare.answer import COMPARED
    from drumsqueal.questions.compare.measured import read_measured
    from drumsqueal.questions.compare.study import compare_measured

    record = read_measured(measured, channel, rate=sampled, unit=unit, first=begin, last=end)
    with reply.progress() as progress:  # what cannot be done is reported before there is a folder
        found = compare_measured(history, record, signal, within=widest, file=measured, progress=progress)
    answer(reply, COMPARED, lambda *_: found)


_KIND = "Take MEASURED as small vibration (linear) or as saturated squeal; seen from the record without it."
_DEFAULT = "Default: surface_velocity, of several shoes that of the first."


def fit_command(
    scene: SceneFile,
    measured: Annotated[
        Path, typer.Argument(metavar="MEASURED", help="Measured record: CSV, UFF58, WAV or a history.")
    ],
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY,KEY...",
            help="Number to fit, such as contact.stiffness. Repeatable.",
            autocompletion=complete_list,
        ),
    ] = None,
    output: Annotated[Path | None, output_option("SCENE-fit")] = None,
    kind: Annotated[
        str | None, typer.Option("--as", metavar="KIND", help=_KIND, autocompletion=words("linear", "saturated"))
    ] = None,
    channel: Annotated[
        str | None, typer.Option(metavar="NAME|N", help="Measured channel, by name or number; signal of a history.")
    ] = None,
    rate: SampleRate = None,
    signal: Annotated[
        str | None, typer.Option(metavar="NAME", help=f"{SIGNAL} {_DEFAULT}", autocompletion=words(*SIGNALS))
    ] = None,
    since: Since = None,
    until: Until = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Which numbers of the scene fit a measured record?

    Fits the numbers that --vary names to the lines of a measured record, with their uncertainty, and states what the
    record cannot determine. Small vibration (a ring-down, a hammer test, growing squeal) is compared with the
    eigenvalues, in frequency and growth rate; saturated squeal with transients.

    Writes fit.json, fit.png and, unless the lines are missed by far more than their uncertainty, fitted.toml, the scene
    with the fitted numbers, into DIR. --from and --until take a part of MEASURED.

    Example: drumsqueal fit scenarios/nominal.toml rig.wav --vary damping.ratio
    """
    keys = [key.strip() for part in vary or () for key in part.split(",") if key.strip()]
    loaded, tables = load_with_tables(scene, settings or ())
    history = history_file(measured)
    reply = Reply.with_folder("fit", output, (scene, history), quiet, json_file, overwrite=overwrite)
    if is_history(measured):
        claim_results(history.parent)
    begin, end, sampled = read_time(since, "--from"), read_time(until, "--until"), read_rate(rate, "--rate")
    from drumsqueal.questions.fit.answer import FIT_ANSWER
    from drumsqueal.questions.fit.study import check_request, fit_scene, read_record, surface_signal, why_missed
    from drumsqueal.scene.variation import Written

    signal = signal or surface_signal(loaded)
    check_request(loaded, keys, kind, signal)
    record = read_record(measured, channel, signal, rate=sampled, first=begin, last=end)
    with reply.progress() as progress:  # what cannot be done is reported before there is a folder
        found = fit_scene(
            loaded,
            record,
            keys,
            kind=kind,
            signal=signal,
            file=measured,
            written=Written(loaded, tables),
            progress=progress,
        )
    answer(reply, FIT_ANSWER, lambda *_: found)
    if found.missed:
        raise IntegrationError(f"the fit {why_missed(found)}")
