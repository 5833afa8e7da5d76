"""A block that cannot lift off: where its contact pulls each answer says so, once; what cannot pull says nothing."""

import numpy as np
import pytest

from drumsqueal import integrate
from drumsqueal.dynamics.saturated import IntegratorOptions, saturated_motions
from drumsqueal.physics.friction_law import ConstantLaw
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.questions.cycle.study import find_cycle, follow_cycles
from drumsqueal.questions.motion.study import study_motion
from drumsqueal.questions.onset.study import study_onset
from drumsqueal.questions.sweep.in_python import study_basin
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.motion import pulling, smallest_force, smallest_recorded

# Of the flutter at μ = 0.8 with dashpots of 0.05 N s/m, which slip reversal limits to 11.79 m: 1 N less 4/3 N/m of it.
PULLS = "the contact pulls: the normal force fell to −14.8 N; use separation=True"
SENTENCE = f"T{PULLS[1:]}."
START = {"displacement": {"X": 0.4, "Y": 0.1}}


def block(friction, *, separation=False):
    """Hoffmann et al., Journal of Sound and Vibration 257 (2002) 1, with dashpots."""
    springs, dashpots = [[2.0, 1.0], [1.0, 2.0 - 4 / 3]], [[0.05, 0.0], [0.0, 0.05]]
    how = {"mass": [1.0, 1.0], "springs": springs, "contact_stiffness": 4 / 3, "damping": dashpots}
    return sprung_block_on_belt(ConstantLaw(friction), separation=separation, **how)


def test_the_smallest_force_is_that_of_the_place_farthest_from_the_belt():
    # The load is 1 N, and y pulls or presses by 4/3 N/m; x slides along.
    moved = [[0.0, 0.0], [5.0, -0.3], [-5.0, -1.5], [0.0, 3.0]]
    assert smallest_force(block(0.8), moved) == pytest.approx(1 - 1.5 * 4 / 3)
    assert smallest_force(block(0.8, separation=True), moved) == np.inf
    assert smallest_recorded(block(0.8), [0.4, -0.2, 3.0]) == -0.2


@pytest.mark.thorough
def test_a_transient_says_that_its_contact_pulls():
    motion = integrate(block(0.8), START, 300.0, sample_rate=20.0)
    assert motion.outcome == "complete"
    assert motion.notes == (pulling(float(motion.normal_force.min())),)
    assert repr(motion).count("the contact pulls: the normal force fell to −14.") == 1
    assert pulling(-14.8123) == PULLS
    # Of a small motion none of it is said, nor where the block can lift off, nor where its load is one number.
    assert not integrate(block(0.6), {"velocity": {"Y": 0.01}}, 10.0, sample_rate=20.0).notes
    assert not integrate(block(0.8, separation=True), START, 300.0, sample_rate=20.0).notes
    assert not integrate(block_on_belt(ConstantLaw(0.5), belt_speed=1.0), {}, 10.0, sample_rate=20.0).notes


@pytest.mark.thorough
def test_a_cycle_and_a_diagram_say_that_their_contact_pulls():
    assert find_cycle(block(0.8), START, 600.0, sample_rate=10.0).verdict.count(SENTENCE) == 1
    assert "pulls" not in find_cycle(block(0.8, separation=True), START, 600.0, sample_rate=10.0).verdict
    verdict = follow_cycles(block, (0.79, 0.81)).verdict
    assert verdict is not None
    assert verdict.count("The contact pulls: the normal force fell to −15 N; use separation=True.") == 1


@pytest.mark.thorough
def test_an_onset_says_that_the_contact_pulls_and_why_a_transient_ended():
    # Large starts grow without bound where small ones decay: nothing but lift-off would limit them.
    along = Variation("friction", "", (0.7, 0.8))
    study = study_onset(block, along, sample_rate=10.0)
    ends = {each.outcome for row in study.values for each in row.starts}
    assert ends == {"complete", "failed: the motion grows without bound"}
    (said,) = (each for each in study.warnings if "pulls" in each)
    assert said == "The contact pulls: the normal force falls without bound; use separation=True."
    lifted = study_onset(lambda friction: block(friction, separation=True), along, sample_rate=10.0)
    assert {each.outcome for row in lifted.values for each in row.starts} == {"complete"}
    assert not any("pulls" in each for each in lifted.warnings)


@pytest.mark.thorough
def test_a_basin_and_the_study_of_a_motion_say_that_the_contact_pulls():
    box = {"displacement": {"X": (-1.0, 1.0), "Y": (-1.0, 1.0)}}
    basin = study_basin(block(0.8), box, samples=5)
    assert basin.notes == (PULLS,)
    assert repr(basin).endswith(f"; {PULLS}")
    assert study_basin(block(0.8, separation=True), box, samples=5).notes == ()
    assert study_motion(block(0.8), START, 600.0, sample_rate=10.0).not_determined.count(PULLS) == 1


@pytest.mark.thorough
@pytest.mark.parametrize("duration", [1e3, 4e3])
def test_what_grows_without_bound_ends_with_that_reason(duration):
    # e^(0.25 t) from 1: 1e108 after 1e3 s, of which squares of squares are no numbers, and no number after 4e3 s.
    model = block_on_belt(lambda slip: 0.0 * slip, belt_speed=1.0, damping=-0.5)
    (found,) = saturated_motions(
        [model], np.zeros((1, 1)), np.ones((1, 1)), np.zeros((1, 1)), IntegratorOptions(2.0, 1e-6, duration)
    )
    assert found.failed
    assert found.outcome.startswith("failed: the motion grows without bound" if duration < 2e3 else "failed: ")
