"""Where a transient leads, by the numbers of its rounds: the rules of docs/onset.md one by one."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.dynamics import ensemble
from drumsqueal.dynamics.attractor import SMALL_START, Response
from drumsqueal.dynamics.ensemble import Family, IntegratorOptions, Start, round_seconds
from drumsqueal.dynamics.saturated import Course, Saturated, trend
from drumsqueal.errors import COMPLETE
from drumsqueal.findings.decay import Rest
from drumsqueal.findings.kinds import Kind

NAMES, ROUND = ("X", "Tz"), 2.0
HOW = IntegratorOptions(1e3, 1e-6, ROUND)


def mode(name: str, frequency: float, rate: float) -> Any:
    eigenvalue = rate + 2j * np.pi * frequency
    ratio = -rate / abs(eigenvalue)
    return SimpleNamespace(name=name, label=name, frequency_Hz=frequency, growth_rate=rate, damping_ratio=ratio)


def point(*modes: Any, eigenvalues: Any = (1e3,), divergence=None, value: float = 3.0) -> Any:
    return SimpleNamespace(
        value=value, modes=modes, divergence=divergence, largest=1e3, eigenvalues=np.array(eigenvalues),
        matrix=np.arange(36.0).reshape(6, 6), steady=np.array([7.0, 8.0, 9.0]),
    )  # fmt: skip


FAMILY = Family(lambda value: f"model at {value:g}", NAMES, ("Tz", "Y", "X"))  # pyright: ignore[reportArgumentType]


def ended(energy: float = 1.0, rate: float = 0.0, ratio: float = 0.5, **changed: Any) -> Saturated:
    known: dict[str, Any] = {
        "amplitude": np.ones(2), "rms": np.ones(2), "boundary_ratios": (0.0, ratio), "frequency_Hz": 50.0, "line": "X",
        "kinetic_energy": energy, "rate": rate, "seconds": 1.0, "vibration": np.array([1.0, 0.5]),
        "velocity": np.array([2.0, 3.0]), "outcome": COMPLETE,
    }  # fmt: skip
    return Saturated(**(known | changed))


def course_at(where: Any, name: str = "disturbance", energies=(), rounds=()) -> Course:
    found = ensemble._job(FAMILY, where, Start(name, np.array([1.0, 2.0]), np.array([3.0, 4.0])), HOW).course
    found.rounds += [*rounds, *(ended(energy) for energy in energies)]
    return found


def judged(where: Any, *rounds: Saturated, name: str = "disturbance", lasts: int = 3) -> list[Kind | None]:
    course = course_at(where, name)
    return [course.add(motion, lasts) for motion in rounds]


def test_a_transient_begins_at_its_start_over_the_coordinates_that_move():
    where, start = point(mode("X", 50.0, -3.0)), Start("disturbance", np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    job = ensemble._job(FAMILY, where, start, HOW)
    assert (job.model, job.course.seconds, job.course.simulated) == ("model at 3", ROUND, 0.0)
    np.testing.assert_array_equal(job.steady, [9.0, 7.0])
    rows = [2, 0, 5, 3]
    np.testing.assert_array_equal(job.matrix, [[6.0 * r + c for c in rows] for r in rows])
    np.testing.assert_array_equal(job.course.state, [[1, 2], [3, 4]])


def test_the_change_of_a_motion_is_that_of_the_logarithm_of_its_rms_a_round():
    course = course_at(point(), energies=[9.0, 1.0, np.exp(0.2), np.exp(0.8)])
    assert course.change(2) == pytest.approx(0.3)
    assert course.change(3) == pytest.approx(0.2)
    assert np.isnan(course.change(5))
    assert np.isnan(course_at(point(), energies=[1.0]).change(1))
    assert np.isnan(course_at(point(), energies=[1.0, 0.0, 2.0]).change(3))
    # A round that drifts begins anew, in what is looked at of its last rounds alone.
    course.rounds.append(ended(5.0, rate=0.2, seconds=0.94))
    assert len(course.energies) == 5
    course.rounds.append(ended(6.0, rate=0.2, seconds=0.97))
    assert (course.energies, len(course.rounds)) == ([6.0], 6)
    course.rounds.append(ended(7.0))
    assert course.energies == [6.0, 7.0]


def test_a_motion_nears_rest_where_its_rate_goes_to_the_linear_one_as_its_energy_falls():
    def falls_as_linear(energies, rates, linear=-10.0) -> bool:
        rounds = [ended(energy, rate) for energy, rate in zip(energies, rates, strict=True)]
        return course_at(point(), rounds=rounds).falls_as_linear(linear)

    # Linear in the energy: −10 + 4 E, at 1 and at 1/2.
    assert falls_as_linear([1.0, 0.5], [-6.0, -8.0])
    assert not falls_as_linear([1.0], [-10.0])
    assert not falls_as_linear([0.5, 1.0], [-8.0, -6.0])  # it grows
    assert not falls_as_linear([1.0, 0.5], [-2.0, -4.9])  # −7.8 at rest, but by less than half the linear one now
    assert falls_as_linear([1.0, 0.5], [-2.0, -5.1])
    assert not falls_as_linear([1.0, 0.5], [-8.0, -11.6])  # −15.2 at rest
    assert falls_as_linear([1.0, 0.5], [-8.0, -11.4])
    assert not falls_as_linear([1.0, 0.0], [-8.0, -9.0])


def test_what_a_motion_still_grows_is_a_geometric_series():
    def remains(*logs: float) -> float:
        return course_at(point(), energies=np.exp(2 * np.array(logs))).remains(1e-5)

    assert remains(0.0, 0.4, 0.5) == pytest.approx(0.1**2 / 0.3)  # 0.1 (1/4 + 1/16 + …)
    assert remains(0.0, 0.1, 0.5) == np.inf
    assert remains(0.0, 0.1) == np.inf
    assert remains(0.0, 0.1, 0.1 + 0.9e-5) == 0.0
    assert remains(0.0, 0.1, 0.05) == 0.0


def test_a_motion_converges_where_its_changes_get_ever_smaller():
    def converges(*logs: float) -> bool:
        return course_at(point(), energies=np.exp(2 * np.array(logs))).converges()

    assert converges(0.0, 0.9e-5)
    assert not converges(0.0, 0.1)
    assert converges(0.0, 0.3, 0.2)  # it comes and goes
    assert converges(0.0, 0.5, 0.59)  # 0.09² / 0.41 is 0.0198
    assert not converges(0.0, 0.5, 0.6)
    assert not converges(0.0, 0.1, 0.3)
    assert converges(0.0, -0.5, -0.59)


def test_an_irregular_motion_goes_on_where_its_halves_are_alike_and_it_neither_falls_nor_spreads():
    scatter = np.exp(0.2 * np.random.default_rng(1).normal(size=20))

    def is_stationary(energies, fluctuations=None, least=1e-4) -> tuple[bool, bool]:
        spread = np.full(20, 0.05) if fluctuations is None else fluctuations
        course = course_at(point(), rounds=[ended(e, fluctuation=f) for e, f in zip(energies, spread, strict=True)])
        return course.is_stationary(20, least), course.leaves(20, least)

    assert is_stationary(scatter) == (True, False)
    assert is_stationary(scatter * np.exp(-0.05 * np.arange(20))) == (False, True)
    assert is_stationary(scatter * np.exp(0.05 * np.arange(20))) == (False, False)  # by e^0.5 from half to half
    assert is_stationary(scatter * np.exp(-1e-6 * np.arange(20)) ** np.arange(20)) == (True, False)
    fall = np.exp(-0.01 * np.arange(20))
    assert is_stationary(fall, least=0.0051) == (True, False)
    assert is_stationary(fall, least=0.0049) == (False, True)
    assert is_stationary(scatter, 0.05 * 1.1 ** np.arange(20)) == (False, True)
    assert is_stationary(scatter, 0.9e-3 * 1.1 ** np.arange(20)) == (True, False)  # as little as that is none
    assert is_stationary(scatter * np.where(np.arange(20) == 3, 0.0, 1.0)) == (False, False)
    assert course_at(point(), energies=scatter[:19]).is_stationary(20, 1e-4) is False


def test_a_trend_counts_from_two_standard_errors_on():
    x, off = np.arange(8), np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0])  # off by no slope
    spread = np.sqrt(np.sum(off**2) / 4 / np.sum((x - 3.5) ** 2))  # as `numpy.polyfit` scales its covariance
    spread *= np.sqrt(4 / 6)
    for factor in (1.95, 2.05):
        found = trend(np.exp(factor * spread * x + off).tolist())
        assert found == (pytest.approx(factor * spread) if factor > 2 else 0.0)


def test_a_round_lasts_a_hundred_periods_of_the_slowest_mode_that_oscillates_freely():
    slow, fast, heavy = mode("X", 20.0, -1.0), mode("Tz", 90.0, -30.0), mode("X", 5.0, -4.0)
    unmoved = mode("Y", 1.0, 0.0)
    assert round_seconds([point(fast, unmoved), point(slow, heavy)], NAMES) == pytest.approx(100 / 20.0)
    assert round_seconds([point(heavy, unmoved)], NAMES) == pytest.approx(100 / 5.0)
    overdamped = point(unmoved, eigenvalues=[-7.0, -40.0, 1e-7])
    assert round_seconds([overdamped], NAMES) == pytest.approx(100 * 2 * np.pi / 7.0)
    assert round_seconds([], NAMES) == 100.0


def test_the_linear_model_says_whether_something_grows_decays_or_does_neither():
    # Of |λ| up to 1000 1/s, 1e-9 1/s is round-off; in 2 s, 5e-6 1/s changes by less than ten times the tolerance.
    for rate, stable, neutral in (
        (-3.0, True, False), (-5.1e-6, True, False), (-4.9e-6, True, True), (0.9e-9, True, True), (1.1e-9, False, False)
    ):  # fmt: skip
        where = point(mode("X", 50.0, rate), mode("Tz", 50.0, -9.0), mode("Y", 50.0, 99.0))
        assert FAMILY.linear(where, HOW) == (rate, stable, neutral)
    assert FAMILY.linear(point(divergence=4.0), HOW) == (4.0, False, False)
    assert FAMILY.linear(point(eigenvalues=[0.0, -1e3]), HOW) == (0.0, True, False)
    # Where nothing oscillates, what creeps back is what decays slowest.
    assert FAMILY.linear(point(eigenvalues=[-4.0, -1e3]), HOW) == (-4.0, True, False)


DECAYING, GROWING, UNDAMPED = (point(mode("X", 50.0, rate)) for rate in (-10.0, 10.0, 0.0))


@pytest.mark.parametrize(
    ("where", "motion", "leads"),
    [
        (DECAYING, ended(outcome="failed: so"), Kind.FAILED),
        (DECAYING, ended(vibration=np.array([9.0, -0.11])), Kind.RUNS_AWAY),
        (DECAYING, ended(vibration=np.array([9.0, 0.09]), ratio=0.09, rate=-1e-9), Kind.DECAYS),
        (DECAYING, ended(sticking=0.51, phases=11), None),
        (DECAYING, ended(rest=Rest(near=False, elsewhere=np.ones(2))), Kind.RESTS),
        (DECAYING, ended(ratio=0.0), Kind.DECAYS),
        (DECAYING, ended(ratio=2.0, at_rest=True), Kind.DECAYS),
        (DECAYING, ended(ratio=2.0, at_rest=True, rest=Rest(near=False)), None),
        (DECAYING, ended(ratio=0.09, rate=-1e-9), Kind.DECAYS),
        (DECAYING, ended(ratio=0.09, rate=1e-9), None),
        (DECAYING, ended(ratio=0.11, rate=-1e-9), None),
        (GROWING, ended(ratio=0.09), Kind.GROWS),
        (GROWING, ended(ratio=0.11), None),
        (GROWING, ended(ratio=0.0), Kind.GROWS),
        (UNDAMPED, ended(ratio=0.0), Kind.DECAYS),
        (UNDAMPED, ended(ratio=0.09, rate=-1e-3), None),
    ],
)
def test_one_round_decides_where_a_motion_is_small_or_rests_or_fails(where, motion, leads):
    still = motion if motion.vibration[0] == 9.0 else motion._replace(vibration=np.array([1.0, 0.05]))
    assert judged(where, still) == [leads]
    if leads is Kind.GROWS:
        assert judged(where, still, name=SMALL_START) == [None]


def below(*energies: float, rate: float = 0.0, ratio: float = 0.5, **changed: Any) -> list[Saturated]:
    vibration = np.array([1.0, 0.05])
    return [ended(each, rate, ratio, vibration=vibration, **changed) for each in energies]


def test_what_keeps_its_size_for_three_rounds_squeals():
    for where, ratio in ((DECAYING, 1.5), (DECAYING, 0.5), (GROWING, 0.95), (GROWING, 0.5)):
        assert judged(where, *below(1.0, 1.0, 1.0, ratio=ratio)) == [None, None, Kind.SQUEALS]
    assert judged(DECAYING, *below(1.0, 1.0, 1.0, 1.0, ratio=1.5), lasts=4)[-2:] == [None, Kind.SQUEALS]
    # Beyond the boundaries it must not fall by more than ten times the tolerance a round; below them by 2 of e^1.
    fall = np.exp(-2 * 1.1e-5 * np.arange(3))
    assert judged(DECAYING, *below(*fall, ratio=1.5))[-1] is None
    assert judged(DECAYING, *below(*fall**0.8, ratio=1.5))[-1] is Kind.SQUEALS
    assert judged(DECAYING, *below(*fall, ratio=0.5))[-1] is None  # each change is as the one before
    assert judged(DECAYING, *below(1.0, 1.1, 1.101))[-1] is Kind.SQUEALS
    assert judged(DECAYING, *below(1.0, 1.0, 1.0, ratio=1.5, at_rest=True, rest=Rest(near=False)))[-1] is None


def test_what_falls_as_the_linear_model_says_decays_and_what_lasts_is_cut_off():
    falls = [np.exp(-2 * 4.0 * k) for k in range(12)]
    # At 0.5 of the boundaries it falls at 6 of 10 1/s, and ever more so.
    rounds = [ended(e, -6.0 - 2 * min(k, 1), 0.5, vibration=np.array([1, 0.05])) for k, e in enumerate(falls)]
    assert judged(DECAYING, *rounds[:2]) == [None, Kind.DECAYS]
    rounds = [ended(e, -4.0, 0.5, vibration=np.array([1, 0.05])) for e in falls]
    assert judged(DECAYING, *rounds) == [None] * 12
    # After sixty rounds what is below the boundaries is undecided, or grows; what is beyond them squeals.
    moving = [ended(e, 0.2, 0.5, vibration=np.array([1, 0.05])) for e in np.exp(0.3 * np.arange(60))]
    assert judged(DECAYING, *moving)[-2:] == [None, Kind.UNDECIDED]
    assert judged(GROWING, *moving)[-2:] == [None, Kind.GROWS]
    away = Rest(near=False)
    assert judged(GROWING, *(each._replace(rest=away) for each in moving))[-1] is Kind.UNDECIDED
    beyond = [each._replace(boundary_ratios=(0.91, 0.0)) for each in moving]
    assert judged(GROWING, *beyond)[-2:] == [None, Kind.SQUEALS]
    falling = [each._replace(kinetic_energy=1 / each.kinetic_energy, rate=-0.2) for each in beyond]
    assert judged(GROWING, *falling)[-1] is Kind.UNDECIDED


def test_where_nothing_decays_a_motion_that_settles_is_made_smaller_to_see_whether_it_comes_back():
    assert judged(UNDAMPED, *below(1.0, 1.0, 1.0, ratio=0.09))[-1] is Kind.NEUTRAL
    assert judged(UNDAMPED, *below(1.0, 1.0, 1.0, sticking=0.011))[-1] is Kind.SQUEALS
    for energy, leads in ((0.69, Kind.NEUTRAL), (0.71, Kind.SQUEALS)):
        found = judged(UNDAMPED, *below(1.0, 1.0, 1.0, energy, energy, energy))
        assert found == [None, None, None, None, None, leads]
    course = course_at(UNDAMPED)
    for motion in below(5.0, 5.0, 5.0):
        course.add(motion, 3)
    assert (course.probed, course.rounds) == (5.0, [])
    np.testing.assert_allclose(course.state, [[0.7, 0.035], [1.4, 2.1]])


def test_a_motion_that_fluctuates_ever_more_leaves_what_it_was_near():
    def settled(*fluctuations: float, ratio: float = 1.5) -> bool:
        rounds = [ended(1.0, ratio=ratio, fluctuation=each) for each in fluctuations]
        return course_at(DECAYING, rounds=rounds).has_settled(3)

    assert settled(1e-4, 2e-4, 2.3e-4)
    assert not settled(1e-4, 2e-4, 2.5e-4)
    assert settled(1e-5, 2e-5, 9e-5)
    assert not settled(2e-3, 2e-3, 1.1e-3)  # without an amplitude
    assert settled(2e-3, 2e-3, 1.1e-3, ratio=0.5)


def test_slow_stick_slip_gets_longer_rounds():
    for phases, factor in ((0, 8.0), (1, 8.0), (3, 6.0), (10, 2.0)):
        course = course_at(DECAYING, energies=[1.0, 2.0])
        assert course.add(ended(sticking=0.6, phases=phases), 3) is None
        assert (course.seconds, course.simulated, course.rounds) == (factor * ROUND, ROUND, [])
    for sticking, phases in ((0.6, 12), (0.5, 0)):
        course = course_at(DECAYING)
        course.add(below(1.0, sticking=sticking, phases=phases)[0], 3)
        assert (course.seconds, len(course.rounds)) == (ROUND, 1)
    course.seconds = 300 * ROUND
    assert course.add(below(1.0, sticking=0.6, phases=0)[0], 3) is Kind.UNDECIDED


def test_a_motion_comes_to_one_that_is_known_where_it_is_steady_and_moves_towards_it():
    def response(motion: Saturated) -> Response:
        return Response.of(3.0, "disturbance", Kind.SQUEALS, motion, 1.0, NAMES)

    known = response(ended(1.0)).motion
    assert known is not None

    def comes(energy: float, rate: float = 0.0, **changed: Any) -> bool:
        motion = response(ended(energy, rate, **changed)).motion
        return motion is not None and motion.comes_to([known])

    assert comes(1.0)
    assert comes(np.exp(2 * 0.9e-3))
    assert not comes(np.exp(2 * 1.1e-3))
    assert comes(np.exp(2 * 1.1e-3), -0.01)  # it falls towards it
    assert not comes(np.exp(2 * 1.1e-3), 0.01)
    assert not comes(1.0, 0.05)  # by 2.5 % from half to half
    assert not comes(1.0, fluctuation=0.03)
    assert not comes(1.0, rms=np.array([1.0, 1.2]))


def test_a_response_has_what_its_transient_ended_with():
    motion = ended(
        2.0, 0.1, amplitude=np.array([3.0, 4.0]), rms=np.array([5.0, 6.0]), boundary_ratios=(0.7, 0.8), fluctuation=0.03
    )
    found = Response.of(3.0, "so", Kind.SQUEALS, motion, 9.0, NAMES, from_value=2.0)
    assert (found.value, found.start, found.simulated_s, found.from_value, found.outcome) == (
        3.0,
        "so",
        9.0,
        2.0,
        COMPLETE,
    )
    seen = found.motion
    assert seen is not None
    assert (seen.amplitude, seen.rms) == ({"X": 3.0, "Tz": 4.0}, {"X": 5.0, "Tz": 6.0})
    assert (seen.share_of_contact_loss, seen.share_of_slip_reversal, seen.kinetic_energy_J) == (0.7, 0.8, 2.0)
    assert (seen.frequency_Hz, seen.line_of, seen.fluctuation) == (50.0, "X", 0.03)
    assert seen.drift == pytest.approx(np.expm1(0.05))
    np.testing.assert_array_equal(seen.state, [[1.0, 0.5], [2.0, 3.0]])
    resting = Response.of(
        3.0, "so", Kind.RESTS, ended(rest=Rest(near=False, elsewhere=np.array([7.0, 8.0]))), 9.0, NAMES
    )
    assert (resting.motion, resting.rests_at) == (None, {"X": 7.0, "Tz": 8.0})
    assert (found.lasts, resting.lasts) == (True, False)


def test_jobs_run_together_by_the_length_of_their_rounds_until_each_is_judged(monkeypatch):
    calls = []

    def motions(models, steady, vibration, velocity, how, *, matrices, progress):
        calls.append((len(models), how.round_seconds, [float(each[0]) for each in vibration], matrices[0].shape))
        assert (how.sample_rate, how.tolerance, how.solver) == (1e3, 1e-6, "auto")
        for each in vibration:
            slow = each[0] == 5.0 and how.round_seconds == ROUND
            yield ended(
                ratio=1.5,
                vibration=np.array([each[0], 0.05]),
                sticking=0.6 if slow else 0.0,
                phases=6,
                smallest_force=-each[0],
            )

    monkeypatch.setattr(ensemble, "saturated_motions", motions)
    starts = [Start(f"start {x:g}", np.array([x, 0.0]), np.zeros(2)) for x in (4.0, 5.0, 6.0)]
    found = list(ensemble.find_attractors(FAMILY, [(DECAYING, each) for each in starts], HOW))
    # Two are the same and settle together after three rounds; the slow one is known by then after one that is longer.
    assert [each.start for each in found] == ["start 4", "start 6", "start 5"]
    assert [each.simulated_s for each in found] == [6.0, 6.0, 2.0 + 3.0 * ROUND]
    assert calls == [
        (3, 2.0, [4.0, 5.0, 6.0], (4, 4)), (2, 2.0, [4.0, 6.0], (4, 4)), (2, 2.0, [4.0, 6.0], (4, 4)),
        (1, 6.0, [5.0], (4, 4)),
    ]  # fmt: skip
    assert [each.saturated.smallest_force for each in found] == [-4.0, -6.0, -5.0]
