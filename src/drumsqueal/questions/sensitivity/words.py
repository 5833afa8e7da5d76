"""What was found about making a brake quiet, in sentences."""

from collections.abc import Sequence

from drumsqueal.dynamics.attractor import Kick, SteadyResponse
from drumsqueal.findings.kinds import Kind
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.sensitivity.alone import Alone
from drumsqueal.questions.sensitivity.disturbing import Decay, DisturbedSqueal, Origin, Trial
from drumsqueal.questions.sensitivity.operating import Operating, where, where_else
from drumsqueal.questions.sensitivity.quieting import Quieting
from drumsqueal.questions.sensitivity.stabilising import MARGIN, Change
from drumsqueal.questions.sensitivity.study import Relevant, SensitivityStudy
from drumsqueal.scene import Scene
from drumsqueal.scene.variation import unit_of

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
    if smallest is not None and smallest.kick is not None and smallest.motion is not None:
        less = "" if decays is None else f"; {decays.energy_J:.2g} J in the same way decays"
        led = f"{_motion(smallest.motion, scene)}{_at(smallest)}"
        sentences.append(f"A velocity along mode {_kick(smallest.kick)} leads to {led}{less}.")
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


def _kick(kick: Kick) -> str:
    return f"{kick.mode} of {kick.energy_J:.2g} J ({kick.speed_m_per_s:.2g} m/s of the lining's surface)"


def _start(trial: Trial) -> str:
    """A disturbance, in words."""
    if trial.kick is not None:
        return f"from a velocity along mode {_kick(trial.kick)}"
    if trial.kind is Origin.EARLIER:
        return f"from {trial.start}, before the change"
    if trial.kind is Origin.RANDOM:
        return f"from a disturbance of all modes at once, {trial.start}"
    return f"from {trial.start}"


def tried_words(trials: Sequence[Trial]) -> str:
    """Which disturbances were tried, by their kinds."""
    kicks = [each.kick for each in trials if each.kick is not None]
    carried = sum(each.kind is Origin.EARLIER for each in trials)
    random = sum(each.kind is Origin.RANDOM for each in trials)
    parts = ["its own start", "a displacement of 3 p0/k_c", "each mode three times beyond both contact boundaries"]
    if kicks:
        modes = ", ".join(dict.fromkeys(each.mode for each in kicks))
        energies = [each.energy_J for each in kicks]
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
    by_size = sorted(quiet.changes, key=lambda each: -abs(each.logarithm))
    named = ", ".join(
        f"{each.key} changed from {each.before_in_unit:.5g} to {each.after_in_unit:.6g} {_unit(each, quiet)}".rstrip()
        for each in by_size[:MOST_NAMED]
    )
    left = len(by_size) - MOST_NAMED
    return f"{named} and {left} smaller change{'s' if left > 1 else ''}" if left > 0 else named


def _unit(change: Change, quiet: Quieting) -> str:
    return change.unit or unit_of(change.key, quiet.scene)


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
    several = len(study.relevant) > 1
    return {
        Relevant.UNSTABLE: "the unstable modes" if several else "the unstable mode",
        Relevant.SQUEALS: "the modes that squeal" if several else "the mode that squeals",
        Relevant.LEAST_STABLE: "the least stable mode",
    }[study.kind_of_relevant]
