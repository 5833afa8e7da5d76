"""What the study of sensitivity writes, draws and prints, and its sentences on a quiet brake."""

import math
import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from drumsqueal.coordinates import largest_of
from drumsqueal.dynamics.attractor import SteadyResponse, VelocityPerturbation
from drumsqueal.findings.columns import Column
from drumsqueal.findings.kinds import Kind
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.sensitivity.disturbing import Decay, DisturbedSqueal, Origin, Trial
from drumsqueal.questions.sensitivity.quieting import Alone, Quieting
from drumsqueal.questions.sensitivity.stabilising import MARGIN, Change, size_of
from drumsqueal.questions.sensitivity.study import MODES_STEP, Operating, SensitivityStudy, where, where_else
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.variation import unit_of
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.style import frame, new_figure, styled
from drumsqueal.terminal.tables import print_cells, rows_to_csv

SI = {"drum.speed": "rad/s", "contact.normal_load": "N"}
MOST_NAMED = 3  # changes in a sentence


def as_it_is(study: SensitivityStudy) -> str | None:
    """What the brake does before anything is changed; None where modes grow but nothing can squeal."""
    squeal = study.squeal
    if study.needs_no_change:
        tried = "" if squeal is None else f", and none of the {len(squeal.disturbances)} disturbances tried squeals"
        at = f"at {where(study.operating)}{where_else(study.operating)}"
        return f"Nothing in this scene is unstable {at}{tried}: there is nothing to make quiet."
    return None if squeal is None else squeal_words(squeal, study.scene)


def squeal_words(squeal: DisturbedSqueal, scene: Scene) -> str:
    """What a brake that is not quiet does: whether it squeals, after which disturbance, at what frequency, how loud."""
    number = len(squeal.disturbances)
    if not squeal.motions:
        if not squeal.steady_sliding_stable:
            return f"As it is, steady sliding is unstable; none of the {number} disturbances tried settles to squeal."
        left = [each for each in squeal.disturbances if each.leads_to is not Kind.DECAYS]
        how = ", ".join(dict.fromkeys(each.leads_to for each in left))
        return (
            "As it is, steady sliding is stable, and no disturbance was seen to settle to squeal, but "
            f"{len(left)} of the {number} tried do not decay either ({how})."
        )
    if squeal.steady_sliding_stable:
        return (
            f"As it is, steady sliding is stable, but squeals after a large disturbance. {_disturbances(squeal, scene)}"
        )
    return f"As it is, the brake squeals: {_each(squeal.squealing, scene)}."


def _disturbances(squeal: DisturbedSqueal, scene: Scene) -> str:
    smallest, decays, sentences = squeal.smallest_disturbance, squeal.largest_that_decays, list[str]()
    named = list(squeal.squealing)
    if smallest is not None and smallest.disturbance is not None and smallest.motion is not None:
        less = "" if decays is None else f"; {decays.energy_J:.2g} J in the same way decays"
        led = f"{_motion(smallest.motion, scene)}{_at(smallest)}"
        sentences.append(f"A velocity along mode {_disturbance(smallest.disturbance)} leads to {led}{less}.")
        named = [each for each in named if each.motion and not each.motion.like(smallest.motion)]
    if named:
        other = "Other disturbances lead" if sentences else "Disturbances lead"
        sentences.append(f"{other} to {_each(named, scene)}.")
    return " ".join(sentences)


def _each(trials: Sequence[Trial], scene: Scene) -> str:
    """The squeal that transients lead to, the loudest first, and how."""
    named = [f"{_motion(each.motion, scene)}{_at(each)} ({_start(each)})" for each in trials if each.motion]
    left = len(named) - MOST_NAMED
    return "; ".join(named[:MOST_NAMED]) + (f"; and {left} more" if left > 0 else "")


def _at(trial: Trial) -> str:
    """At which operating point, where it is not that of the scene."""
    return "".join(f" at {key} = {value:.4g} {SI.get(key, '')}".rstrip() for key, value in trial.at.items())


def _motion(motion: SteadyResponse, scene: Scene) -> str:
    at = "" if motion.frequency_Hz is None else f" at {motion.frequency_Hz:.0f} Hz"
    name = motion.line_of
    if name is None:
        return f"squeal{at}"
    factor, unit, shown = at_lining(scene, name)
    return f"squeal{at}, {shown} ±{factor * motion.amplitude[name]:.3g} {unit}"


def _disturbance(found: VelocityPerturbation) -> str:
    return f"{found.mode} of {found.energy_J:.2g} J ({found.speed_m_per_s:.2g} m/s of the lining's surface)"


def _start(trial: Trial) -> str:
    """A disturbance, in words."""
    if trial.disturbance is not None:
        return f"from a velocity along mode {_disturbance(trial.disturbance)}"
    if trial.kind is Origin.EARLIER:
        return f"from {trial.start}, before the change"
    if trial.kind is Origin.RANDOM:
        return f"from a disturbance of all modes at once, {trial.start}"
    return f"from {trial.start}"


def tried_words(trials: Sequence[Trial]) -> str:
    """Which disturbances were tried, by their kinds."""
    disturbances = [each.disturbance for each in trials if each.disturbance is not None]
    carried = sum(each.kind is Origin.EARLIER for each in trials)
    random = sum(each.kind is Origin.RANDOM for each in trials)
    parts = [
        "its own start",
        "a displacement of three compressions",
        "each mode three times beyond both contact boundaries",
    ]
    if disturbances:
        modes = ", ".join(dict.fromkeys(each.mode for each in disturbances))
        energies = [each.energy_J for each in disturbances]
        parts.append(f"velocities along {modes}, both ways, from {min(energies):.1g} J to {max(energies):.1g} J")
    if random:
        parts.append(f"{random} random ones of all modes at once")
    if carried:
        parts.append(f"{carried} from the squeal that there was before")
    return "; ".join(parts)


def quiet_sentence(quiet: Quieting, operating: Operating) -> str:
    """Where it is quiet, what to change, what the eigenvalues say of it, and what the transients do."""
    word = "Quiet" if quiet.quiet else "Stable"
    rates = f"every growth rate is {quiet.largest_growth_rate_1_per_s:.3g} 1/s or below"
    sentences = [f"{word} at {where(operating)}{where_else(operating)} with {_changes(quiet)}: {rates}."]
    sentences += [f"{each[0].upper()}{each[1:]}." for each in quiet.cautions]
    if quiet.quiet:
        tried = tried_words(quiet.disturbances)
        sentences.append(f"None of the {len(quiet.disturbances)} disturbances tried squeals: {tried}.")
        sentences.append("At other speeds and loads it may squeal.")
    # Of what has been shown to decay from every disturbance a record that is too short says nothing.
    shown = [each for each in quiet.transients if not (quiet.quiet and each.outcome is Kind.UNDECIDED)]
    return " ".join([*sentences, *map(_ending, shown)])


def _changes(quiet: Quieting) -> str:
    if not quiet.changes:
        return "nothing changed"
    named = ", ".join(
        f"{each.key} changed from {each.before_in_unit:.5g} to {_after(each, quiet.scene)}"
        for each in _by_size(quiet)[:MOST_NAMED]
    )
    left = len(quiet.changes) - MOST_NAMED
    return f"{named} and {left} smaller change{'s' if left > 1 else ''}" if left > 0 else named


def _by_size(quiet: Quieting) -> list[Change]:
    return sorted(quiet.changes, key=lambda each: -abs(each.logarithm))


def _unit(change: Change, scene: Scene) -> str:
    """That of the scene file or, without one there, of SI; what was zero is a damping ratio, which has none."""
    return change.unit or (unit_of(change.key, scene) if change.before else "")


def _after(change: Change, scene: Scene) -> str:
    return f"{change.after_in_unit:.6g} {_unit(change, scene)}".rstrip()


def not_found(study: SensitivityStudy) -> str:
    """Why a search has no result."""
    quiet, names = study.quiet, ", ".join(each.key for each in study.alone)
    assert quiet is not None
    if not quiet.found:
        least = f"the largest growth rate can be brought down to {quiet.largest_growth_rate_1_per_s:+.4g} 1/s"
        none = f"no change of {names} within the bounds was found that brings every growth rate"
        return f"{none} to {-MARGIN:g} 1/s or below; {least}"
    none = f"no change of {names} within the bounds was found after which no disturbance squeals"
    squealing = [each for each in quiet.disturbances if each.motion is not None]
    still = (
        f"there is still {_each(squealing[:1], quiet.scene)}"
        if squealing
        else "the brake has not been shown to be quiet"
    )
    return f"{none}; with {_changes(quiet)} every mode decays, but {still}"


def cautions_of(alone: Sequence[Alone]) -> tuple[str, ...]:
    """What is to be said of brakes with one number changed, a sentence each."""
    said: dict[str, list[str]] = {}
    for row in alone:
        for each in row.cautions:
            said.setdefault(each, []).append(row.key)
    return tuple(f"{', '.join(keys)}: {caution}." for caution, keys in said.items())


def without_answer(alone: Sequence[Alone], stable_now: bool) -> tuple[str, ...]:
    """Which numbers have no row, and why."""
    none = [each.key for each in alone if each.quiet is None and each.stable is None]
    if not none:
        return ()
    what = "quiet" if stable_now else "stable"
    found = f"No change within the bounds was found that makes the brake {what} with one of these alone"
    # Of a stable brake each number is changed one way only.
    way = ", each changed the way in which the least stable mode decays faster" if stable_now else ""
    return (f"{found}{way}: {', '.join(none)}.",)


def _ending(decay: Decay) -> str:
    """How a transient of the changed scene ends."""
    mostly = "" if decay.frequency_Hz is None else f", mostly at {decay.frequency_Hz:.0f} Hz"
    ends = {
        Kind.DECAYS: "the transient decays; at its end there is neither lift-off nor slip reversal",
        Kind.SQUEALS: f"the transient keeps squealing: its motion is {decay.kind}{mostly}",
        Kind.UNDECIDED: f"the transient has not settled within {decay.duration_s} s; run it for longer",
        Kind.NOT_STARTED: "no transient was run, because nothing was started",
        Kind.FAILED: f"the transient failed: {decay.reason}",
    }
    return f"From {decay.start} {ends[decay.outcome]}."


def modes_that_matter(study: SensitivityStudy) -> str:
    """What the modes are by which the numbers are sorted."""
    first, *others = (study.modes[k] for k in study.relevant)
    if first.unstable:
        return "the unstable modes" if others else "the unstable mode"
    if first.name in study.squealing:
        return "the modes that squeal" if others else "the mode that squeals"
    return "the least stable mode"


# The figures of the study of sensitivity: what each number does to the growth rates, and what makes it quiet.


_ROW = 0.8  # of the distance between two numbers that their bars take up
_HATCHES = ("", "////", "....")  # of a second and a third mode of one name
# What may be marked on the axis of changes, the first first, and how far apart, of the axis, marks must be.
_FACTORS = (1, 0, 10, 0.1, 3, 0.3, 2, 0.5, 5, 0.2, 1.5, 0.7, 1.2, 0.8, 1.1, 0.9)
_APART = 0.07
STABLE, _TOGETHER = style.FAINT, style.DARK
_QUIET_FILL = style.COLOUR["X"]


@styled()
def _draw_sensitivity(study: SensitivityStudy) -> Figure:
    """Draw the change of the growth rates of the modes that matter, per +1 % of each number."""
    shown = [study.modes[k] for k in study.relevant]
    figure = new_figure(study.title, "growth rates per +1 % of each number")
    axes = figure.subplots()
    places = np.arange(len(study.effective))
    height = _ROW / len(shown)
    for k, mode in enumerate(shown):
        values = [row.growth_per_percent_1_per_s[study.relevant[k]] for row in study.effective]
        shift = (k - (len(shown) - 1) / 2) * height
        earlier = sum(other.name == mode.name for other in shown[:k])
        label = f"{mode.label}: {mode.frequency_Hz:.0f} Hz, {mode.growth_rate_1_per_s:+.3g} 1/s"
        hatch = _HATCHES[min(earlier, len(_HATCHES) - 1)]
        axes.barh(places + shift, values, height=height, color=style.COLOUR[mode.name], hatch=hatch, label=label)
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    style.label_rows(axes, [row.key for row in study.effective])
    frame(axes, f"Change of the growth rate of {modes_that_matter(study)} (1/s), to the right: grows faster", None)
    figure.legend(loc="outside lower center", ncols=min(len(shown), 3))
    return figure


@styled()
def draw_quiet(study: SensitivityStudy) -> Figure | None:
    """Draw how far each number alone has to change for the brake to be stable, and quiet; and all of them together.

    None where that was not looked for.
    """
    if not study.alone:
        return None
    figure = new_figure(study.title, "what makes it quiet")
    axes = figure.subplots()
    kinds = [("quiet", _QUIET_FILL)] if study.stable else [("stable", STABLE), ("quiet", _QUIET_FILL)]
    height = _ROW / len(kinds)
    for k, (name, colour) in enumerate(kinds):
        changes: list[Change | None] = [getattr(row, name) for row in study.alone]
        at = np.arange(len(changes)) + (k - (len(kinds) - 1) / 2) * height
        sizes = [0.0 if each is None else each.logarithm for each in changes]
        texts = [f"none found ({name})" if each is None else _value(each) for each in changes]
        bars = axes.barh(at, sizes, height=height, color=colour, label=f"{name} with this number alone")
        axes.bar_label(bars, texts, padding=8, fontsize=style.SMALL_SIZE, color=style.DARK)
    if study.quiet is not None and study.quiet.succeeded:
        places = {row.key: place for place, row in enumerate(study.alone)}
        some = [each for each in study.quiet.changes if each.key in places]
        axes.plot(
            [each.logarithm for each in some],
            [places[each.key] for each in some],
            "D",
            color=_TOGETHER,
            markeredgecolor="white",
            label="the smallest change found, all of these together",
        )
    ends = [each.logarithm for row in study.alone for each in (row.stable, row.quiet) if each is not None]
    low, high = min([0.0, *ends]), max([0.0, *ends])
    # 0.55 of the axis of changes on each side, for the values at the ends of the bars
    room = 0.55 * max(high - low, math.log(2))
    axes.set_xlim(low - room, high + room)
    marked: dict[float, str] = {}
    for factor in _FACTORS:
        size = size_of("", 1.0, factor)
        if low - room < size < high + room and all(abs(size - at) > _APART * (high - low + 2 * room) for at in marked):
            marked[size] = f"× {factor:g}"
    axes.set_xticks(list(marked), list(marked.values()))
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    style.label_rows(axes, [row.key for row in study.alone])
    frame(axes, "Change of the number (logarithmic), and the value that it would have", None)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _value(change: Change) -> str:
    return f"{change.after_in_unit:.4g} {change.unit}".rstrip()


def print_study(console: Console, study: SensitivityStudy) -> None:
    """Print every number with the change of every growth rate per +1 %, and the smallest change that was found."""
    shown, others = largest_of({mode.label: mode.growth_rate_1_per_s for mode in study.modes})
    places = [k for k, mode in enumerate(study.modes) if mode.label in shown]
    modes = [f"{each.label}\n{each.frequency_Hz:.0f} Hz\n{each.growth_rate_1_per_s:+.4g}" for each in study.modes]
    columns = Column("number"), Column("SI value", ".3g"), *(Column(modes[k], ">") for k in places)
    rows = (
        (row.key, row.value_SI, *(_change(study, row.growth_per_percent_1_per_s[k]) for k in places))
        for row in study.effective
    )
    print_cells(console, "Change of each growth rate per +1 %, in 1/s", columns, rows)
    if others:
        lower = f"{', '.join(others)}: {'their growth rates are' if len(others) > 1 else 'its growth rate is'} lower"
        console.print(f"Without {lower} than those shown; sensitivity.csv has all modes", style="dim")
    names = ", ".join(study.modes[k].label for k in study.relevant)
    console.print(
        f"At {where(study.operating)}. Sorted by the largest change of {modes_that_matter(study)} {names}; "
        "0: below round-off. "
        "Automatic derivatives and central differences of ±0.1 % agree to "
        f"{study.largest_deviation_from_central_differences:.1g} of the largest.",
        style="dim",
    )
    without = [f"{row.key} ({row.value_SI:.3g})" for row in study.numbers if row not in study.effective]
    if without:
        console.print(f"Without effect on any growth rate, per +1 %: {', '.join(without)}", style="dim")
    if study.divergence_rate_1_per_s is not None:
        console.print(
            f"A motion without oscillation also grows: {study.divergence_rate_1_per_s:+.4g} 1/s.", style="dim"
        )
    if study.by_free_modes:
        console.print(
            f"The modes of what bends change with {', '.join(study.by_free_modes)}: these rows are central "
            f"differences of ±{100 * MODES_STEP:g} %, each with shapes of its own. Of two modes whose frequencies "
            "come near each other within that, only the sum is sure.",
            style="dim",
        )
    if study.not_followed:
        listed = " and ".join(study.not_followed)
        console.print(f"Not covered: {listed}: modes change places there, or the scene takes no such value.")
    if study.not_covered:
        lists = ", ".join(study.not_covered)
        console.print(f"Not covered: {lists}, which are lists; the table and the search leave them as they are.")
    if study.until_stable:
        _print_search(console, study)


def _print_search(console: Console, study: SensitivityStudy) -> None:
    """Print what squeals, what each number alone would have to be, and the smallest change of all of them."""
    words = as_it_is(study)
    if words is not None:
        console.print(printable(words), style="bold")
    if any(each.stable is not None or each.quiet is not None for each in study.alone):
        both = ("quiet",) if study.stable else ("stable", "quiet")
        columns = (Column(heading, ">", missing="") for name in both for heading in (f"{name} with", "change"))
        rows = (
            (
                *(row.key, f"{row.change.before_in_unit:.6g} {_unit(row.change, study.scene)}".rstrip()),
                *(cell for name in both for cell in _cells(getattr(row, name), study.scene)),
            )
            for row in study.alone
            if row.change is not None
        )
        columns = (Column("number"), Column("now", ">"), *columns)
        print_cells(console, "Each number alone, the least change first", columns, rows)
    for line in (*cautions_of(study.alone), *without_answer(study.alone, study.stable)):
        console.print(line, style="dim")
    if study.quiet is not None:
        _print_quiet(console, study.quiet, study.operating)


def _cells(change: Change | None, scene: Scene) -> tuple[str, str]:
    return ("none found", "") if change is None else (_after(change, scene), _relative(change))


def _relative(change: Change) -> str:
    return f"{100 * change.relative:+.3g} %" if change.before else "new"


def _print_quiet(console: Console, quiet: Quieting, operating: Operating) -> None:
    title = "The smallest change found that makes the brake quiet" if quiet.quiet else (
        "The smallest change that makes every mode decay" if quiet.found else "The change with the least growth"
    )  # fmt: skip
    columns = (
        *(Column("number"), Column("before", ".6g"), Column("after", ".6g")),
        *(Column("unit", missing=""), Column("change", ">")),
    )
    if quiet.changes:
        rows = (
            (each.key, each.before_in_unit, each.after_in_unit, _unit(each, quiet.scene), _relative(each))
            for each in _by_size(quiet)
        )
        print_cells(console, title, columns, rows)
    if quiet.succeeded:
        console.print(printable(quiet_sentence(quiet, operating)), style="bold")


def sensitivity_table(study: SensitivityStudy) -> str:
    """One row a number and mode, as CSV: derivatives in SI and per +1 %, and the same by central differences."""
    rows = []
    for row in study.numbers:
        by_mode = row.model_dump(exclude={"key", "value_SI"})
        for k, mode in enumerate(study.modes):
            of_mode = {
                "number": row.key,
                "value_SI": row.value_SI,
                "mode": mode.label,
                "frequency_Hz": mode.frequency_Hz,
                "growth_rate_1_per_s": mode.growth_rate_1_per_s,
            }
            rows.append(of_mode | {name: values[k] for name, values in by_mode.items()})
    return rows_to_csv(rows)


def quiet_scene(study: SensitivityStudy) -> str | None:
    """The changed scene as a file, headed by what was found; None where it is not quiet."""
    quiet = study.quiet
    if quiet is None or not quiet.succeeded:
        return None
    # The comment that heads a scene file has 110 letters a line.
    lines = textwrap.wrap(printable(quiet_sentence(quiet, study.operating)), 110, break_long_words=False)
    return "".join(f"# {line}\n" for line in lines) + quiet.scene_file


def _change(study: SensitivityStudy, value: float) -> str:
    if abs(value) <= study.round_off_1_per_s:
        return "0"
    return f"{value:+.2g}" if abs(value) >= 0.01 else f"{value:+.0e}"  # 1/s; so that six modes fit on a terminal


def sensitivity_answer(*, until_stable: bool) -> Answer[SensitivityStudy]:
    """What is written and printed: the figure of what makes the brake quiet only where that was asked for."""
    return Answer(
        words=print_study,
        summary="sensitivity.json",
        tables={"sensitivity.csv": sensitivity_table, "quiet.toml": quiet_scene},
        figures={"sensitivity": _draw_sensitivity, **({"quiet": draw_quiet} if until_stable else {})},
    )
