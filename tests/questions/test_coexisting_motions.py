"""Several attractors at one value: found, told apart, reported with what leads to each, and followed."""

import csv
import json
import math
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

from drumsqueal import Seed, follow_cycles
from drumsqueal.dynamics import ensemble
from drumsqueal.dynamics.attractor import Response, SteadyResponse, unpaired
from drumsqueal.dynamics.cycles import branches
from drumsqueal.dynamics.cycles.cycle import BranchEnd, CycleBranch, Diagram, OffBranch, RangeKind, Unfollowed, Why
from drumsqueal.dynamics.cycles.search import RecordedMotion
from drumsqueal.dynamics.ensemble import Family, IntegratorOptions, Start, find_attractors
from drumsqueal.dynamics.saturated import Saturated
from drumsqueal.errors import COMPLETE
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.schema import read_findings
from drumsqueal.physics.friction_law import ExponentialLaw
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.questions.cycle.study import diagram_verdict, missing_words
from drumsqueal.questions.onset import study as study_module
from drumsqueal.questions.onset.found import OnsetStudy
from drumsqueal.questions.onset.study import study_onset
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import point_at
from odd_friction import odd_friction

DAMPED = Path(__file__).parents[2] / "scenarios" / "damped.toml"
# Squares of the amplitudes at which friction gives as much as damping takes; the second and the last are stable.
SQUARES = (0.1, 0.25, 0.45, 0.8)
GAIN = 4.0
# Of x′ⁿ, n odd, averaging leaves this of Aⁿ⁻¹: 3/4, 5/8, 35/64, 63/128.
AVERAGED = [math.comb(2 * k + 2, k + 1) / 2 ** (2 * k + 1) for k in range(5)]
TAKEN = GAIN * np.asarray(Polynomial.fromroots(SQUARES).coef, dtype=float)
FORCE = TAKEN / AVERAGED


def block(damping):
    """For a damping of `FORCE[0]` there are four cycles, of the amplitudes whose squares are `SQUARES`."""
    law = odd_friction(1.0, 0.0, *FORCE[1:])  # with which x″ + c x′ + x + Σ aₙ x′ⁿ = 1, n = 3, 5, 7, 9
    return block_on_belt(law, damping=damping, belt_speed=1.0)


ALONG = Variation("damping", "N s/m", (float(FORCE[0]), 1.02 * float(FORCE[0])))


@pytest.fixture(scope="module")
def study():
    return study_onset(block, ALONG, sample_rate=10.0, smallest_disturbance=True, within=0.5)


@pytest.mark.thorough
def test_every_cycle_that_is_stable_is_found_with_the_smallest_disturbance_that_leads_to_it(study):
    row = study.values[0]
    assert (row.kind, row.small.leads_to) == (RangeKind.BISTABLE, Kind.DECAYS)
    quiet, loud = row.led_to
    # Averaged, to second order in friction; sampled ten times a radian.
    for motion, square, below in ((quiet, 0.25, 0.1), (loud, 0.8, 0.45)):
        assert motion.amplitude["X"] == pytest.approx(math.sqrt(square), rel=0.02)
        assert not motion.after_small
        # On the unstable cycle below it the block passes the place of steady sliding with its amplitude times 1 rad/s.
        smallest = motion.smallest_disturbance
        assert smallest.speed_m_per_s == pytest.approx(math.sqrt(below), rel=0.02)
        assert smallest.leads_to.same(motion)
        # Of all starts the one that was tried and led there with least is next to it.
        assert motion.disturbance.energy_J == pytest.approx(smallest.energy_J, rel=0.05)
        assert len(motion.starts) == len(set(motion.starts)) > 5
    assert row.smallest_disturbance == quiet.smallest_disturbance
    assert row.motions == (loud, quiet)
    told = str(study.verdict)
    assert "Several motions coexist at 0.036 N s/m and" in told
    assert f"m/s along X and 0.159 Hz with {loud.amplitude['X']:.3g} m of X after" in told


@pytest.mark.thorough
def test_without_that_search_the_sizes_by_doublings_find_them(study):
    again = study_onset(block, ALONG, sample_rate=10.0, within=0.5)
    for row, searched in zip(again.values, study.values, strict=True):
        assert len(row.motions) == len(searched.motions) == 2
        for motion, other in zip(row.motions, searched.motions, strict=True):
            assert motion.same(other)
            assert motion.smallest_disturbance is None
            # The smallest that was tried is less than twice the smallest that there is.
            assert motion.disturbance is not None
            assert 1 < motion.disturbance.speed_m_per_s / other.smallest_disturbance.speed_m_per_s < 2.1


@pytest.mark.thorough
def test_motions_that_were_found_begin_a_branch_each_unless_they_are_on_one(study):
    low, high = 0.9 * FORCE[0], 1.1 * FORCE[0]
    assert not follow_cycles(block, (low, high)).branches  # the Hopf point, without damping, is not in the range
    assert len(study.seeds) == 4
    diagram = follow_cycles(block, (low, high), seeds=study.seeds)
    assert not diagram.off_branches
    stable = [piece for branch in diagram.branches for piece, stable in branch.pieces() if stable]
    for value, damping in ((ALONG.values[0], 1.0), (ALONG.values[1], 1.02)):
        squares = [root.real for root in np.roots(_averaged(damping)) if abs(root.imag) < 1e-9]
        found = [
            a.amplitude["X"] + (value - a.value) / (b.value - a.value) * (b.amplitude["X"] - a.amplitude["X"])
            for piece in stable
            for a, b in pairwise(piece)
            if min(a.value, b.value) <= value < max(a.value, b.value)
        ]
        # One piece each and none twice: two seeds of one motion give one branch.
        assert sorted(found) == pytest.approx(sorted(math.sqrt(each) for each in squares)[1::2], rel=0.02)


def _averaged(damping: float) -> list[float]:
    """What damping takes less what friction gives, over the square of the amplitude, highest power first."""
    return [*TAKEN[:0:-1].tolist(), damping * float(TAKEN[0])]


@pytest.mark.thorough
def test_a_branch_begins_at_a_single_seed_given_by_hand():
    low, high = 0.9 * FORCE[0], 1.1 * FORCE[0]
    seed = Seed(float(FORCE[0]), {"displacement": {"X": 0.9}})
    diagram = follow_cycles(block, (low, high), seeds=[seed])
    (branch,) = diagram.branches
    assert {branch.start, branch.end} <= set(BranchEnd)
    assert max(cycle.amplitude["X"] for cycle in branch.cycles) > math.sqrt(0.8)
    # Steady sliding is no motion that could be on a branch.
    resting = follow_cycles(block, (low, high), seeds=[Seed(float(FORCE[0]), {"displacement": {"X": 1e-3}})])
    assert resting.off_branches == ()


# --- what two motions have in common ---------------------------------------------------------------------------------


def motion(amplitude: float, frequency: float = 1000.0, **more: Any) -> SteadyResponse:
    of_Y = {"Y": amplitude, "Tz": amplitude * more.pop("turn", 1.0)}
    return SteadyResponse(
        start=f"{amplitude} {frequency}",
        amplitude=of_Y,
        rms=of_Y,
        frequency_Hz=frequency,
        line_of="Y",
        kinetic_energy_J=(amplitude * frequency) ** 2,
        share_of_contact_loss=1.5,
        share_of_slip_reversal=1.5,
        drift=0.0,
        **more,
    )


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (motion(1.03), True),
        (motion(1.07), False),
        (motion(1.0, 1004.0), True),
        (motion(1.0, 1010.0), False),
        (motion(1.0, turn=1.6), False),  # as 723 and 740 Hz of one brake
        (motion(1.15, fluctuation=0.1), True),  # no better known than that
        (motion(1.0, 1500.0, fluctuation=0.1), True),  # an irregular motion has several lines
        (motion(1.5, fluctuation=0.4), False),
    ],
)
def test_motions_at_one_value_are_the_same_as_far_as_they_fluctuate(other, same):
    assert motion(1.0).same(other) == other.same(motion(1.0)) == same


def test_at_neighbouring_values_each_motion_goes_over_into_one():
    there, here = [motion(1.0, 723.0), motion(0.95, 740.0), motion(0.1, 900.0)], [motion(0.94, 741.0)]
    assert unpaired(there, here) == [there[0], there[2]]
    assert not unpaired(here, there)


# --- where a transient leads -----------------------------------------------------------------------------------------


def judged(monkeypatch, fluctuations, known=None) -> Response:
    """Where a motion beyond the contact boundaries leads whose rms comes and goes by so much, round by round."""
    left = iter(fluctuations)

    def motions(models, *args, **how):
        one = np.ones(1)
        yield Saturated(one, one, (0.0, 1.5), 1.0, "X", 1.0, 0.0, 60.0, one, one, COMPLETE, fluctuation=next(left))

    monkeypatch.setattr(ensemble, "saturated_motions", motions)
    value = float(FORCE[0])
    start = Start("disturbance", np.ones(1), np.zeros(1))
    tasks = [(point_at(block, value), start)]
    (found,) = find_attractors(Family(block, ("X",), ("X",)), tasks, IntegratorOptions(10.0, 1e-6, 120.0), known=known)
    return found


@pytest.mark.parametrize(
    ("fluctuations", "kind", "rounds"),
    [
        (np.full(60, 1e-5), Kind.SQUEALS, 3),
        ([0.3, 0.2, *[0.1] * 18], Kind.SQUEALS, 20),  # a torus, or what approaches one
        (0.1 * 0.95 ** np.arange(60), Kind.SQUEALS, 20),  # approaches a cycle
        (2e-3 * 1.05 ** np.arange(60), Kind.UNDECIDED, 60),  # leaves an unstable cycle
        ([1.1e-4, 2.4e-4, 5.4e-4, 5e-4], Kind.SQUEALS, 4),
        ([1e-6, 1e-5, 1e-4], Kind.SQUEALS, 3),  # round-off
    ],
)
def test_a_motion_that_fluctuates_has_settled_only_when_it_goes_on_as_it_was(monkeypatch, fluctuations, kind, rounds):
    found = judged(monkeypatch, fluctuations)
    assert (found.leads_to, found.simulated_s / 120.0) == (kind, rounds)


def test_a_motion_that_is_known_has_settled_after_one_round(monkeypatch):
    first = judged(monkeypatch, [1e-5] * 3).motion
    assert first is not None
    again = judged(monkeypatch, [1e-5] * 3, {float(FORCE[0]): [first]})
    assert (again.simulated_s, again.leads_to) == (120.0, Kind.SQUEALS)
    # One that fluctuates more than the known one is none of it yet, and one that is farther must come nearer.
    assert judged(monkeypatch, [0.1, *[1e-5] * 3], {float(FORCE[0]): [first]}).simulated_s == 240.0
    larger = first.model_copy(update={"kinetic_energy_J": 1.02 * first.kinetic_energy_J})
    assert judged(monkeypatch, [1e-5] * 3, {float(FORCE[0]): [larger]}).simulated_s == 360.0
    other = first.model_copy(update={"frequency_Hz": 1.1})
    assert judged(monkeypatch, [1e-5] * 3, {float(FORCE[0]): [other]}).simulated_s == 360.0


# --- how they are reported -------------------------------------------------------------------------------------------

QUICK = ["--set", 'simulate.coordinates=["Y"]', "--set", "start.displacement={Y = 1e-7}"]


def two_squeals(family, tasks, how, *, rounds, known=None, progress=None):
    """Above the critical value a loud one after more than 1 m/s, and a quiet one after more than 0.3 m/s."""
    for point, start in tasks:
        speed = (
            start.disturbance.speed_m_per_s
            if start.disturbance
            else 2.0
            if point.unstable or "from" in start.name
            else 0.0
        )
        speed = {1e-6: 0.5, 2e-5: 2.0}.get(float(start.vibration[0]), speed)  # one of them that goes on
        size, line = (2e-5, 1000.0) if speed > 1 else (1e-6, 1400.0)
        one = np.array([size])
        ended = Saturated(one, one, (0.0, 1.5), line, "Y", size**2, 0.0, 1.0, one, one, COMPLETE)
        leads = Kind.SQUEALS if speed > 0.3 else Kind.DECAYS
        yield Response.of(point.value, start.name, leads, ended, 0.1, ("Y",), disturbance=start.disturbance)


def test_all_motions_stand_in_table_files_and_figure(drumsqueal, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(study_module, "find_attractors", two_squeals)
    monkeypatch.setattr("drumsqueal.terminal.style.save_figure", lambda figure, path: drawn.append(figure))
    arguments = ["onset", str(DAMPED), *QUICK, "--along", "drum.speed=8..20x3", "-o", str(tmp_path)]
    assert drumsqueal(*arguments)[::2] == (0, "")
    printed = drumsqueal(*arguments, "--overwrite")[1]
    study = read_findings(tmp_path / "onset.json", OnsetStudy)
    for row in study.values:
        if row.kind is not RangeKind.BISTABLE or not row.asked:
            continue
        quiet, loud = row.led_to
        assert (quiet.frequency_Hz, loud.frequency_Hz) == (1400.0, 1000.0)
        speeds = [each.disturbance.speed_m_per_s for each in (quiet, loud) if each.disturbance is not None]
        assert 0.3 < speeds[0] < 1 < speeds[1]
        lines = [line.split() for line in printed.splitlines()]
        for speed, amplitude, line in zip(speeds, ("1", "20"), ("1400.0", "1000.0"), strict=True):
            assert [f"{speed:.3g}", "m/s", "along", "Y", amplitude, line] in lines
    assert " ".join(str(study.verdict).split()) in " ".join(printed.split())
    assert "Several motions coexist at" in str(study.verdict)
    summary = json.loads((tmp_path / "onset.json").read_text())
    (row,) = (row for row in summary["values"] if row["asked"] and row["value"] == 20.0)
    assert all(motion["starts"] and motion["disturbance"]["mode"] == "Y" for motion in row["motions"])
    (cells,) = (
        row
        for row in csv.DictReader((tmp_path / "onset.csv").read_text().splitlines())
        if row["drum.speed_rad_per_s"] == "20.0"
    )
    assert [cells[f"motion_{k}_frequency_Hz"] for k in (1, 2)] == ["1400.0", "1000.0"]
    assert cells["motion_1_after"].endswith("m/s along Y")
    points = [line.get_xydata()[0].tolist() for line in drawn[0].axes[0].lines if line.get_marker() == "o"]
    assert all(any(at == pytest.approx(point) for at in points) for point in ([20.0, 1.0], [20.0, 20.0]))


def test_what_is_on_no_branch_is_said_by_value_and_motion(monkeypatch):
    speed = Variation("drum.speed", "rad/s", (2.0, 10.0))
    off = tuple(
        OffBranch(value=value, frequency_Hz=700.0 + value, amplitude={"Y": 1e-5}, why=why, reason=why.value)
        for value, why in ((2.0, Why.NOT_PERIODIC), (3.0, Why.NOT_PERIODIC), (9.0, Why.NOT_CLOSED))
    )
    diagram = Diagram(steady_sliding_stable=(), steady_sliding_unstable=((2.0, 10.0),), branches=(), off_branches=off)
    told = diagram_verdict(diagram, speed)
    assert told == (
        "Steady sliding is unstable for drum.speed from 2 to 10 rad/s; no cycle was found, which does not prove that "
        "there is none. From 2 to 3 rad/s (2 values) motions of 702 to 703 Hz with 10 µm of Y are on none of the "
        "branches: not periodic. At 9 rad/s the motion of 709 Hz with 10 µm of Y is on none of the branches: not "
        "closed by Newton's method."
    )


def test_what_was_lost_is_said_once():
    lost, sought = "from the Hopf point of Y at 1.2: lost", "at the scene's own drum.speed, 1.1 rad/s: no cycle"
    unfollowed = (Unfollowed(reason=lost, low=1.0, high=2.0),)
    diagram = Diagram(
        steady_sliding_stable=((1.0, 2.0),), steady_sliding_unstable=(), branches=(), notes=(lost, sought),
        not_followed=unfollowed,
    )  # fmt: skip
    assert missing_words(diagram) == [f"Not found: {lost}", f"Not found: {sought}"]  # there is no verdict yet
    verdict = diagram_verdict(diagram, Variation("drum.speed", "rad/s", (1.0, 2.0)))
    whole = diagram.model_copy(update={"verdict": verdict})
    assert missing_words(whole) == [f"Not found: {sought}"]
    assert verdict.count(lost) == 1


def test_a_motion_that_is_not_periodic_is_reported_and_not_closed(monkeypatch):
    def settled(seed, model, progress):
        return RecordedMotion(np.zeros(2), np.array([[-0.3, 0.0], [1.7, 0.0]]), "settles to no periodic motion")

    monkeypatch.setattr(branches, "recorded_at", settled)
    found = follow_cycles(block, (0.03, 0.04), seeds=[Seed(0.035, {}, 0.2)])
    (off,) = found.off_branches
    assert (off.value, off.why, off.frequency_Hz) == (0.035, Why.NOT_PERIODIC, 0.2)
    assert off.reason == "it settles to no periodic motion"  # Newton's method finds a cycle, but of another size


def test_jax_can_trace_the_block():
    assert jnp.isfinite(jax.jvp(lambda c: block(c).act(0.0, jnp.zeros(1), jnp.zeros(1))[0], (0.1,), (1.0,))[1]).all()


@pytest.mark.thorough
def test_a_seed_at_rest_is_no_motion_and_a_wrong_one_is_refused():
    def block(speed):
        return block_on_belt(ExponentialLaw(1.0, 0.5, 2.0), damping=0.1, belt_speed=speed)

    quiet = Seed(1.5, {"displacement": {"X": 0.01}})
    assert follow_cycles(block, (1.45, 1.55), seeds=[quiet]).off_branches == ()
    with pytest.raises(ValueError, match="'Q' is no coordinate of this model; it has X"):
        follow_cycles(block, (1.45, 1.55), seeds=[Seed(1.5, {"displacement": {"Q": 1.0}})])
    for range_ in ((1.0, 1.0), (1.0, np.nan)):
        with pytest.raises(ValueError, match="from one finite number to another"):
            follow_cycles(block, range_)


def test_what_was_not_found_is_unknown_and_of_one_cycle_both_sides_are():
    none = Diagram(steady_sliding_stable=((1.0, 2.0),), steady_sliding_unstable=(), branches=())
    assert none.squeals_unknown == ((1.0, 2.0),)
    verdict = diagram_verdict(none, Variation("drum.speed", "rad/s", (1.0, 2.0)))
    assert "does not prove that there is none" in verdict
    assert verdict.endswith("Whether it squeals after a large disturbance is unknown from 1 to 2 rad/s.")
    alone = SimpleNamespace(value=0.5)
    branch = CycleBranch.model_construct(
        start=BranchEnd.LOST, end=BranchEnd.LOST, start_detail="", end_detail="", cycles=(alone,)
    )
    assert {(each.low, each.high) for each in branch.not_followed(0.0, 1.0)} == {(0.0, 1.0)}
