"""What each effect of a scene costs and changes: which reductions there are, what they change, which are needed."""

import csv
import itertools
import math
import signal
import tomllib
from dataclasses import astuple, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import jax
import numpy as np
import pytest
import xarray

import drums
from along_y import AlongY, brake_along_y
from drumsqueal import simulation
from drumsqueal.coordinates import is_static
from drumsqueal.errors import Ending, IntegrationError
from drumsqueal.files.output_folder import to_json, write_json
from drumsqueal.findings.compare import RelativeChange, SceneAnswer, change_of
from drumsqueal.findings.saturation import SpectralLine
from drumsqueal.findings.schema import read_findings
from drumsqueal.physics.composition import compose, coordinates_of, kept_coordinates, linear_coordinates
from drumsqueal.physics.model import Model, build_model
from drumsqueal.questions.effects import reductions as in_brake
from drumsqueal.questions.effects import study as effects
from drumsqueal.questions.effects import study as variants
from drumsqueal.questions.effects.reductions import Reduction, reduce, reductions_of, shoes_left_out, what_counts
from drumsqueal.questions.effects.study import (
    TOGETHER,
    EffectStudy,
    Variant,
    describe_limits,
    describe_runs,
    excess_of,
    study_effects,
)
from drumsqueal.scene import COORDINATES, load_scene, scene_from_dict
from drumsqueal.scene.quantities import percent
from drumsqueal.simulation import prepare, run, transient
from drumsqueal.solve.linear.modes import Mode, Stability, analyse_stability
from drumsqueal.solve.transient import segment as integration
from findings.fakes import mode_of
from processes import PATIENCE

EVERYTHING = {
    "damping": {"ratio": 0.01},
    "forcing": {"amplitude": {"Y": 1.0, "Z": 2.0}, "frequency": 100.0},
    "steady.state": "self-consistent",
    "drum.speed": {"time": [-1, 1], "value": [6, 4]},
    "contact.normal_load": {"time": [0.5, 1], "value": [2000, 2100]},
    "start.displacement": {"Y": 1e-7, "Tx": 1e-6},
    "start.velocity": {"Z": 1e-3},
}


@pytest.fixture(autouse=True, scope="module")
def _unhurried():
    """No reduced scene is stopped for its time, however slow the machine is or however busy."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(variants, "PATIENCE", PATIENCE)
        yield


@pytest.fixture(scope="module")
def quick(nominal):
    """A scene of one chunk that passes both edges at once, without the direction and with damping that does nothing."""
    values = {
        "friction.direction": "tangential",
        "damping": {"ratio": 0.0},
        "start.displacement": {"Y": 2e-5},
        "simulate.duration": 0.01,
    }
    return nominal.with_values(values)


@pytest.fixture(scope="module")
def study(quick):
    return study_effects(quick)


# --- reductions ------------------------------------------------------------------------------------------------------


def test_every_effect_of_a_scene_can_be_reduced(nominal):
    assert [str(reduction) for reduction in reductions_of(nominal.with_values(EVERYTHING))] == [
        "space → plane",
        "separation → bonded",
        "exponential law → μ 0.4213",
        "unit velocity → tangential",
        "support springs → none",
        "damping → none",
        "harmonic force → none",
        "steady drag → balanced",
        "speed profile → 5 rad/s",
        "load profile → 2000 N",
    ]
    assert {str(reduction) for reduction in reductions_of(nominal)} == {
        "separation → bonded",
        "exponential law → μ 0.4213",
        "unit velocity → tangential",
        "support springs → none",
    }


def test_forces_at_points_keep_the_drag_that_they_balance(nominal):
    profile = {"time": [0.0, 1.0], "value": [100.0, 200.0]}
    forces = [{"at": [0, 0.1, 0], "direction": [1, 0, 0], "size": size} for size in (50.0, profile)]
    pushed = nominal.with_values({"steady.state": "self-consistent", "shoe.force": forces})
    found = {str(reduction) for reduction in reductions_of(pushed)}
    assert found == {str(each) for each in reductions_of(nominal)} | {"profile of shoe.force.1.size → 100 N"}
    assert reduce(pushed, reductions_of(pushed)).shoe.force[1].size == 100.0


@pytest.mark.thorough
def test_reductions_of_coordinates_add_up(nominal):
    bends = {"shoe.elastic": {"young": 210e9, "poisson": 0.3, "up_to": 6e3}, "start.displacement.Z": 1e-7}
    scene = nominal.with_values(bends)
    space, rigid = (each for each in reductions_of(scene) if each.effect in ("space", "elasticity of the shoe"))
    left = reduce(scene, [space, rigid])
    assert left.shoe.elastic is None
    assert set(left.start.displacement) == {"Y", "Tz"}


def test_what_is_reduced_to_is_the_scene_one_would_write(nominal):
    everything = nominal.with_values(EVERYTHING)
    constant = {"law": "constant", "coefficient": 0.3 + 0.2 * math.exp(-0.5), "direction": "tangential"}
    reduced = reduce(everything, reductions_of(everything))
    plain = {"support": None, "friction": constant, "contact.separation": False, "start.displacement": {"Y": 1e-7}}
    # The drum turns at 5 rad/s at t = 0, between the points of its profile; the load is held before its first point.
    wanted = nominal.with_values(plain | {"drum.speed": 5.0, "contact.normal_load": 2000.0})
    assert reduced.numbers() == pytest.approx(wanted.numbers(), rel=1e-15)
    assert reduced.model_copy(update={"friction": wanted.friction}) == wanted
    assert [str(reduction) for reduction in reductions_of(reduced)] == ["friction → none"]


@pytest.mark.thorough(but=["auto-friction0", "kept1-friction1"])
@pytest.mark.parametrize("friction", [{}, {"friction": {"law": "constant", "coefficient": 0.4}}, {"friction": None}])
@pytest.mark.parametrize("kept", ["auto", ["X", "Y", "Z", "Tx"]])
def test_reductions_can_be_put_together_in_any_choice(nominal, friction, kept):
    scene = nominal.with_values(EVERYTHING | friction | {"simulate.coordinates": kept})
    reductions = reductions_of(scene)
    for count in range(len(reductions) + 1):
        for chosen in itertools.combinations(reductions, count):
            left = {reduction.effect for reduction in reductions_of(reduce(scene, chosen))}
            assert not left & {reduction.effect for reduction in chosen}


# --- what changes ----------------------------------------------------------------------------------------------------


def modes_of(stability: Stability) -> dict[str, Mode]:
    return {mode.label: mode for mode in stability.modes}


def answer(growth: float, frequency: float, amplitude: float | None, main: float = 1000.0) -> SceneAnswer:
    line = None if amplitude is None else SpectralLine("Y", main, amplitude)
    modes = {"Y": mode_of(frequency, growth), "X": mode_of(4000.0, -20.0)}
    unstable = ("Y",) if growth > 0 else ()
    return SceneAnswer(modes, unstable, {"Y": amplitude or 0.0, "X": 1.0}, ("Y",) if line else (), line, 0.0)


@pytest.mark.parametrize(
    ("whole", "other", "wanted"),
    [
        ((50, 1000, 2e-5), (55, 990, 1.5e-5, 1100), (0.1, -0.01, -0.25, 0.1)),
        ((-50, 1000, 2e-5), (50, 1000, 2e-5), (2.0, 0.0, 0.0, 0.0)),  # from decay to growth is upwards
        # A growth rate below a damping ratio of 1e-6, 2π 1e-3 1/s here, is none to speak of; nothing moves.
        ((0, 1000, None), (1e-9, 1000, None), (1e-6 / (2 * math.pi), 0.0, None, None)),
        ((0, 1000, 2e-5), (3, 1000, None), (3e3 / (2 * math.pi), 0.0, -1.0, math.inf)),
        ((50, 1000, None), (50, 1000, 1e-5), (0.0, 0.0, math.inf, math.inf)),  # rest against motion
    ],
)
def test_changes_are_relative_and_signed(whole, other, wanted):
    found = change_of(answer(*whole), answer(*other))
    assert astuple(found) == tuple(x and pytest.approx(x) for x in wanted)


def test_a_mode_that_is_lost_is_an_infinite_change():
    whole, other = answer(50, 1000, 1e-5), answer(50, 1000, 1e-5)
    del other.modes["X"]
    assert astuple(change_of(whole, other))[:2] == (math.inf, math.inf)


def test_noise_above_the_accuracy_counts_instead_of_it():
    change = RelativeChange(0.0, 0.005, 0.03, None)
    assert excess_of(change, RelativeChange(0.0, 0.0, 0.001, None), 0.01) == pytest.approx(3.0)
    assert excess_of(change, RelativeChange(0.0, 0.0, -0.04, None), 0.01) == pytest.approx(0.75)
    assert excess_of(change, RelativeChange(0.0, 0.0, math.inf, None), 0.01) == pytest.approx(0.5)
    assert excess_of(change, None, 0.01) == pytest.approx(3.0)
    assert excess_of(None, None, 0.01) == math.inf


def test_the_amplitudes_of_all_that_carry_the_motion_count():
    whole, other = answer(50, 1000, 1e-5), answer(50, 1000, 1e-5)
    other.amplitude["X"] = 0.5
    assert change_of(whole, other).amplitude == 0.0
    assert change_of(replace(whole, carriers=("Y", "X")), other).amplitude == -0.5


# --- the study -------------------------------------------------------------------------------------------------------


@pytest.mark.thorough  # 25 s: the study of all in this file
def test_what_does_nothing_can_be_spared_and_what_counts_cannot(study, quick):
    assert [reduction.effect for reduction in study.spared] == ["damping"]
    assert [reduction.effect for reduction in study.needed] == ["separation", "exponential law", "support springs"]
    assert study.reduced_scene == quick.with_values({"damping": None})
    assert "but not damping. Without that, growth rates" in study.verdict
    assert "do not change, and the run takes" in study.verdict


@pytest.mark.thorough
def test_the_changes_are_those_of_the_scenes_run_by_themselves(study, quick):
    by_label = {variant.label: variant for variant in study.variants}
    separate, bonded = run(quick).findings.saturation, run(quick.with_values({"contact.separation": False}))
    assert separate is not None
    assert separate.main is not None
    # Bonded, the motion reaches no edge: the last 60 % of the record count.
    name = separate.main.coordinate
    motion = bonded.history["displacement"].sel(coordinate=name).values[200:]
    change = by_label["separation → bonded"].change
    answers = [by_label[label].answer.amplitude[name] for label in ("whole scene", "separation → bonded")]
    assert answers == pytest.approx([separate.amplitude[name], np.ptp(motion) / 2], rel=1e-12)
    assert abs(change.amplitude) >= abs(answers[1] / answers[0] - 1)  # it is the largest over the carriers
    # The linear model knows nothing of separation; compiled differently, it differs by round-off.
    assert abs(change.growth_rate) < 1e-12
    assert abs(change.onset_frequency) < 1e-14
    constant = {"law": "constant", "coefficient": 0.3 + 0.2 * math.exp(-0.5), "direction": "tangential"}
    stability = analyse_stability(build_model(quick.with_values({"friction": constant}), coordinates=COORDINATES))
    before = {
        mode.label: mode.growth_rate for mode in analyse_stability(build_model(quick, coordinates=COORDINATES)).modes
    }
    wanted = max(abs(mode.growth_rate / before[mode.label] - 1) for mode in stability.modes)
    assert abs(by_label["exponential law → μ 0.4213"].change.growth_rate) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.thorough
def test_a_run_tells_of_other_squeal_and_of_large_rotations(study):
    told = study.remarks
    assert "exponential law → μ 0.4213: no squeal instead of squeal in Tx, Ty, Y, X, Tz" in told
    assert any(text.startswith("support springs → none: squeal in Tx, Ty, X, Tz instead of") for text in told)
    turned = replace(study.variants[0], answer=replace(study.variants[0].answer, rotation=0.2))
    assert "whole scene: the shoe turns by 0.2 rad, where the model no longer holds" in describe_runs([turned])


@pytest.mark.thorough
def test_profiles_are_told_to_be_compared_at_the_start(nominal, study):
    changing = nominal.with_values({"drum.speed": {"time": [0, 1], "value": [5, 4]}})
    known = study.variants[0].answer, study.noise, study.within
    assert describe_limits(study.scene, *known) == ()
    assert "at t = 0" in describe_limits(changing, *known)[0]


@pytest.mark.thorough
def test_costs_are_those_of_the_run(study, quick):
    whole = study.variants[0]
    chunks = list(transient(prepare(quick)))
    assert whole.evaluations_per_ms == sum(chunk.evaluations for chunk in chunks) / 10
    # Damping of nothing costs its operations, not a step.
    undamped = next(variant for variant in study.variants if variant.label == "damping → none")
    assert undamped.evaluations_per_ms == whole.evaluations_per_ms
    assert all(0 < variant.time_per_ms < 1e4 for variant in study.variants)


@pytest.mark.thorough
def test_evaluations_are_counted_as_they_are_made(quick, monkeypatch):
    made = []
    rates = Model.rates

    def counted(self, *arguments):
        jax.debug.callback(lambda: made.append(1))
        return rates(self, *arguments)

    # This scene is taken by no other method in these tests, so that it is traced here: with what counts in it.
    prepared = prepare(quick.with_values({"simulate.solver": "dopri5", "simulate.duration": 0.03}))
    monkeypatch.setattr(Model, "rates", counted)
    monkeypatch.setattr(integration, "one_kernel", lambda function, *inputs: function(*inputs))  # it takes no callbacks
    chunks = list(transient(prepared))
    jax.effects_barrier()
    assert len(chunks) == 3
    assert len(made) == sum(chunk.evaluations for chunk in chunks)


MADE_UP = [Reduction(name, "none", {}) for name in ("light", "middling", "heavy", "needed")]
ALONE = {"light": 0.003, "middling": 0.006, "heavy": 0.008, "needed": 0.5}


@pytest.mark.parametrize(
    ("within", "spared"),
    # Changes add up: 1.7 % together, so that the heavy one comes back, and then 0.9 %.
    [(0.01, "light middling"), (0.02, "light middling heavy"), (0.004, "light"), (0.002, ""), (0.9, "all")],
)
def test_what_is_too_much_together_comes_back(nominal, monkeypatch, within, spared):
    class MadeUp:
        def __init__(self, *arguments):
            self.noise, self.ran = None, [self.run("whole scene")]

        def run(self, label, reductions=()):
            change = RelativeChange(0.0, 0.0, sum(ALONE[reduction.effect] for reduction in reductions), None)
            variant = Variant(
                label, tuple(reductions), nominal, Ending.COMPLETE, 2.0 - len(reductions) / 2, 1, None, change
            )
            self.ran = [*getattr(self, "ran", []), variant]
            return variant

        def timed_again(self):
            return tuple(self.ran)

    monkeypatch.setattr(effects, "VariantRuns", MadeUp)
    monkeypatch.setattr(effects, "reductions_of", lambda scene: tuple(MADE_UP))
    found = study_effects(nominal, within)
    wanted = list(ALONE) if spared == "all" else spared.split()
    assert [reduction.effect for reduction in found.spared] == wanted
    assert [reduction.effect for reduction in found.needed] == [name for name in ALONE if name not in wanted]
    if len(wanted) > 1:  # what is claimed has been run
        labels = [variant.label for variant in found.variants[len(ALONE) + 1 :]]
        assert labels == ([TOGETHER] if wanted[-1] != "middling" else [TOGETHER, "less heavy"])
        assert [reduction.effect for reduction in found.variants[-1].reductions] == wanted
    text = found.verdict
    assert ("needs all of its effects" in text) == (not wanted)
    assert ("needs none of its effects" in text) == (len(wanted) == len(ALONE))


@pytest.mark.parametrize(
    ("fraction", "text"),
    [
        (0.01, "1 %"),
        (1.3e-5, "0.0013 %"),
        (1e-12, "0 %"),
        (1.0, "100 %"),
        (5.88, "588 %"),
        (35.2, "3520 %"),
        (-85170.0, "-8.5e+06 %"),
    ],
)
def test_fractions_are_told_in_two_digits(fraction, text):
    assert percent(fraction) == text


def only(effect: str):
    return lambda scene: tuple(reduction for reduction in reductions_of(scene) if reduction.effect == effect)


@pytest.mark.thorough
def test_a_reduced_scene_that_fails_is_needed_and_told(quick, monkeypatch):
    stream = simulation.transient

    def failing(prepared, since=None):
        yield from itertools.islice(stream(prepared), 1)
        if prepared.scene.support is None:
            raise IntegrationError("the shoe is gone")

    monkeypatch.setattr(effects, "reductions_of", only("support springs"))
    monkeypatch.setattr(simulation, "transient", failing)
    found = study_effects(quick)
    assert "support springs" in [reduction.effect for reduction in found.needed]
    assert "support springs → none: failed: the shoe is gone" in found.remarks


@pytest.mark.thorough
def test_a_reduced_scene_that_cannot_be_run_is_needed_and_told(quick, monkeypatch):
    monkeypatch.setattr(effects, "reductions_of", only("support springs"))
    # Bonded, which compiles in a third of the time.
    found = study_effects(quick.with_values({"steady.state": "self-consistent", "contact.separation": False}))
    (told,) = found.remarks
    assert told.startswith("support springs → none: cannot be run: there is no steady sliding: neither support")
    assert "support springs" in [reduction.effect for reduction in found.needed]


@pytest.mark.thorough
def test_a_reduced_scene_that_takes_for_ever_is_stopped(quick, monkeypatch):
    monkeypatch.setattr(effects, "reductions_of", only("separation"))
    monkeypatch.setattr(variants, "PATIENCE", 0.0)
    monkeypatch.setattr(variants, "SLOWEST", 1e-6)
    found = study_effects(quick)
    assert found.spared == ()
    assert all("it takes more than 1e-06 times as long" in variant.reason for variant in found.variants[1:])


@pytest.mark.thorough
def test_a_scene_at_rest_has_eigenvalues_alone_to_compare(quick, monkeypatch):
    monkeypatch.setattr(effects, "reductions_of", only("separation"))
    found = study_effects(quick.with_values({"start.displacement": {}}))
    assert [reduction.effect for reduction in found.spared] == ["separation"]
    assert "Without that, growth rates, onset frequencies do not change" in found.verdict
    assert found.remarks == ("The whole scene is at rest at the end: only its eigenvalues are compared.",)


@pytest.mark.thorough
def test_a_record_too_short_for_a_line_has_its_amplitude_compared(quick, monkeypatch):
    monkeypatch.setattr(effects, "reductions_of", only("separation"))
    found = study_effects(quick.with_values({"simulate.duration": 0.0003}))
    assert [reduction.effect for reduction in found.needed] == ["separation"]
    change = found.variants[-1].change
    assert change is not None
    assert change.main_frequency is None
    assert abs(change.amplitude or 0.0) > 0.01
    assert any(text.startswith("The frequency at the end is not compared: the record is") for text in found.remarks)


@pytest.mark.thorough
def test_without_a_tenth_of_the_tolerance_the_noise_is_not_known(quick, monkeypatch):
    monkeypatch.setattr(effects, "reductions_of", only("damping"))
    found = study_effects(quick.with_values({"simulate.tolerance": 5e-12, "simulate.duration": 0.001}))
    assert found.noise is None
    assert [variant.label for variant in found.variants] == ["whole scene", "damping → none"]
    assert "The effect of the tolerance is unknown" in found.remarks[0]


@pytest.mark.thorough
def test_six_coordinates_by_name_are_spared_where_the_plane_will_do(nominal, monkeypatch):
    monkeypatch.setattr(effects, "reductions_of", only("space"))
    values = {"simulate.duration": 0.001, "simulate.coordinates": ["X", "Y", "Z", "Tx", "Ty", "Tz"]}
    found = study_effects(nominal.with_values(values))
    assert found.reduced_scene is not None
    assert found.reduced_scene.simulate.coordinates == "auto"
    assert [reduction.effect for reduction in found.spared] == ["space"]


@pytest.mark.parametrize("within", [0.0, 1.0, math.nan, -0.1])
def test_an_accuracy_out_of_range_is_refused_from_python(quick, within):
    with pytest.raises(ValueError, match="between 0 and 1"):
        study_effects(quick, within)


# --- two shoes -------------------------------------------------------------------------------------------------------

# The pair of one wave, with the frequency of one of iron.
STIFF = {**drums.CUP, "young": 120e17, "density": 7200e8, "up_to": 700.0}
STEEL = {"young": 210e9, "poisson": 0.3, "up_to": 4e3}


@pytest.fixture(scope="module")
def pair(nominal):
    """Two shoes that differ, in a drum that hardly bends; the second brakes at less friction, and does not squeal."""
    scene = nominal.with_values({"contact.separation": False, "friction.direction": "tangential"})
    tables = scene.model_dump(exclude_none=True)
    one, other = {**tables["shoe"], "name": "one", "position": -0.9}, {**tables["shoe"], "name": "other"}
    other |= {"position": 1.5, "density": 7000.0, "friction": {**tables["friction"], "static": 0.1, "kinetic": 0.1}}
    drum = {**tables["drum"], "elastic": STIFF}
    more = {"damping": {"ratio": 0.0005}, "start": {"velocity": {"one.Y": 1e-3, "other.Y": 1e-3}}}
    quick = {**tables["simulate"], "duration": 0.001}
    return scene_from_dict({**tables, "shoe": [one, other], "drum": drum, "simulate": quick, **more})


def named(scene, *effects):
    """Return the reductions of these effects."""
    return [each for each in reductions_of(scene) if each.effect in effects]


@pytest.mark.thorough
def test_each_shoe_of_two_has_effects_of_its_own(pair):
    spring = {"at": [0.09, 0.0, 0.0], "direction": [1.0, 0.0, 0.0], "stiffness": 1e7}
    own = {"shoe.0.elastic": STEEL, "shoe.1.spring": [spring], "shoe.1.damping": {"ratio": 0.02}}
    scene = pair.with_values({**own, "contact.separation": True, "friction.direction": "unit-velocity"})
    assert [str(reduction) for reduction in reductions_of(scene)] == [
        "shoe one → none",
        "shoe other → none",
        "elasticity of one → rigid",
        "elasticity of the drum → rigid",
        "separation → bonded",
        "exponential law → μ 0.4213",
        "unit velocity → tangential",
        "exponential law of other → μ 0.1",
        "support springs → none",
        "damping → none",
        "damping of other → none",
        "spring 0 of other → none",
    ]
    # Without friction or damping of its own a shoe would have that of all.
    constant = reduce(scene, named(scene, "exponential law of other"))
    left = reduce(constant, named(constant, "friction of other", "damping of other", "spring 0 of other"))
    assert [one.damping and one.damping.ratio for one in left.alone] == [0.0005, 0.0]
    assert left.alone[1].numbers()["friction.coefficient"] == 0.0
    assert left.alone[0].friction == scene.alone[0].friction
    assert left.alone[1].shoe.spring == ()


@pytest.mark.thorough(but=["all but one"])
@pytest.mark.parametrize("several", ["any three", "all but one"])
def test_reductions_of_two_shoes_can_be_put_together(pair, several):
    scene = pair.with_values({"shoe.0.elastic": STEEL, "forcing": {"amplitude": {"one.E1": 1.0}, "frequency": 100.0}})
    reductions = reductions_of(scene)
    for chosen in itertools.combinations(reductions, 3 if several == "any three" else len(reductions) - 1):
        if sum(each.leaves_shoe for each in chosen) < 2:
            left = reduce(scene, chosen)
            assert scene_from_dict(tomllib.loads(left.to_toml())) == left
            compose(left)  # every coordinate that it starts, forces and lists is there
    rigid = reduce(scene, named(scene, "elasticity of one", "elasticity of the drum"))
    assert kept_coordinates(rigid) == tuple(f"{name}.{each}" for name in ("one", "other") for each in COORDINATES)


def test_what_is_left_of_two_shoes_is_the_scene_of_one(pair, nominal):
    left = reduce(pair, named(pair, "shoe other", "elasticity of the drum"))
    values = {"contact.separation": False, "friction.direction": "tangential", "damping": {"ratio": 0.0005}}
    start = {"start": {"velocity": {"Y": 1e-3}}, "simulate.duration": 0.001}
    wanted = nominal.with_values({**values, **start, "title": left.title})
    assert left == wanted
    bent = reduce(pair, named(pair, "shoe other"))
    assert bent == wanted.with_values({"drum.elastic": STIFF})


def test_a_shoe_is_left_out_of_a_list_of_coordinates(pair):
    scene = pair.with_values({"simulate.coordinates": ["one.Y", "one.Tz", "other.Y", "drum.E1", "drum.E2"]})
    left = reduce(scene, named(scene, "shoe other"))
    assert left.simulate.coordinates == ("Y", "Tz", "drum.E1", "drum.E2")
    # Of three shoes two stay, whose drum is held still where it is rigid.
    short = [each.model_dump(exclude_none=True) | {"arc_angle": 1.2} for each in (*pair.shoes, pair.shoes[0])]
    shoes = [*short[:2], {**short[2], "name": "third", "position": 3.0}]
    listed = ["one.Y", "other.Y", "third.Y", "drum.E1"]
    three = pair.with_values({"shoe": shoes, "start.velocity": {"one.Y": 1e-3}, "simulate.coordinates": listed})
    left = reduce(three, named(three, "shoe other", "elasticity of the drum"))
    assert kept_coordinates(left) == ("one.Y", "third.Y")


def test_a_shoe_alone_has_its_drum_started_and_forced_as_in_the_brake(pair):
    """Seen from 1.5 rad on, the pair of one wave is turned by that; and back, it is what the brake has."""
    values = {"start.velocity": {"other.Y": 1e-3, "drum.E1": 2e-3}, "forcing.amplitude": {"drum.E2": 3.0}}
    scene = pair.with_values({"forcing": {"frequency": 100.0, "amplitude": {"one.Y": 1.0}}}).with_values(values)
    alone = reduce(scene, named(scene, "shoe one"))
    assert alone.start.velocity == pytest.approx(
        {"Y": 1e-3, "drum.E1": 2e-3 * math.cos(1.5), "drum.E2": -2e-3 * math.sin(1.5)}
    )
    assert alone.forcing is not None
    assert alone.forcing.amplitude == pytest.approx({"drum.E1": 3 * math.sin(1.5), "drum.E2": 3 * math.cos(1.5)})


def test_a_table_of_the_only_shoe_that_goes_by_it_goes_with_that_shoe(pair):
    (law,) = named(pair, "exponential law")
    assert law.shoe == 0
    assert what_counts(named(pair, "shoe one", "exponential law")) == tuple(named(pair, "shoe one"))


class AtRest:
    """In place of a bench: nothing moves, so that only eigenvalues are compared."""

    noise = None

    def __init__(self, scene, *arguments):
        self.scene, self.ran = scene, []
        self.run("whole scene")

    def run(self, label, reductions=()):
        scene = reduce(self.scene, reductions)
        stability = analyse_stability(build_model(scene, coordinates=linear_coordinates(scene)))
        still = ("time", "coordinate"), np.zeros((2, len(stability.coordinates)))
        history = xarray.Dataset(
            dict.fromkeys(("displacement", "velocity"), still), {"coordinate": list(stability.coordinates)}
        )
        result: Any = SimpleNamespace(history=history, stability=stability, findings=None)
        answer = in_brake.answer_in(self.scene, scene, shoes_left_out(reductions), result, cast("Any", None))
        change = change_of(self.ran[0].answer, answer) if self.ran else None
        self.ran.append(Variant(label, tuple(reductions), scene, Ending.COMPLETE, 1.0, 1, answer, change))
        return self.ran[-1]

    def timed_again(self):
        return tuple(self.ran)


def eigenvalues_of(history, findings, stability, linear):
    """Return the answer without what moves."""
    unstable = tuple(mode.label for mode in stability.unstable)
    return SceneAnswer(modes_of(stability), unstable, dict.fromkeys(stability.coordinates, 0.0), (), None, 0.0)


@pytest.mark.thorough
def test_a_stiff_drum_and_the_shoe_that_does_not_squeal_are_spared(pair, monkeypatch):
    def chosen(scene):
        return tuple(named(scene, "shoe one", "shoe other", "elasticity of the drum"))

    monkeypatch.setattr(effects, "reductions_of", chosen)
    monkeypatch.setattr(effects, "describe_truncation", lambda *_: ())
    monkeypatch.setattr(effects, "VariantRuns", AtRest)
    monkeypatch.setattr(in_brake, "answer_of", eigenvalues_of)
    found = study_effects(pair)
    assert [each.effect for each in found.needed] == ["shoe one"]
    assert [each.effect for each in found.spared] == ["shoe other", "elasticity of the drum"]
    assert [variant.label for variant in found.variants[-2:]] == ["elasticity of the drum → rigid", TOGETHER]
    for variant in found.variants[2:]:
        assert variant.change is not None
        assert all(abs(value or 0.0) < 1e-4 for value in astuple(variant.change))
    assert found.reduced_scene == reduce(pair, found.spared)
    assert "shoe one → none: no squeal instead of squeal in one." in " ".join(found.remarks)


@pytest.mark.thorough
def test_one_of_two_shoes_alone_is_seen_along_the_axes_of_the_brake(pair, monkeypatch):
    """With the other shoe left out, and with another that hardly touches: modes of the drum have the same names."""
    iron = pair.with_values({"drum.elastic.young": 120e9, "drum.elastic.density": 7200.0})
    loose = iron.with_values({"shoe.0.contact": {"stiffness": 1.0, "normal_load": 1e-6}})
    alone = reduce(iron, named(iron, "shoe one"))
    kept, own = (analyse_stability(build_model(each, coordinates=coordinates_of(each))) for each in (loose, alone))
    # Every shoe and mode of the drum in turn moves by 1.
    moved = ("time", "coordinate"), np.eye(len(own.coordinates))
    history = xarray.Dataset(dict.fromkeys(("displacement", "velocity"), moved), {"coordinate": list(own.coordinates)})
    seen = []

    def answer_of(history, findings, stability, linear):
        seen.append(history)
        shown = [name for name in own.coordinates if not is_static(name)]
        return SceneAnswer(modes_of(stability), (), dict.fromkeys(shown, 1.0), (), SpectralLine("Y", 1.0, 1.0), 0.0)

    monkeypatch.setattr(in_brake, "answer_of", answer_of)
    found = in_brake.answer_in(iron, alone, (0,), cast("Any", SimpleNamespace(
        history=history, stability=own, findings=None)), cast("Any", None))  # fmt: skip
    assert [mode.name for mode in own.modes] != [label.removeprefix("other.").split()[0] for label in found.modes]
    for label, mode in found.modes.items():
        assert mode.frequency_Hz == pytest.approx(modes_of(kept)[label].frequency_Hz, rel=1e-6)
    assert found.main == SpectralLine("other.Y", 1.0, 1.0)
    brakes = [name for name in coordinates_of(iron) if not is_static(name)]
    assert set(found.amplitude) == {name for name in brakes if not name.startswith("one.")}
    # What is the cosine at the shoe is cos(θ - 1.5) along the axes of the brake.
    waves = [own.coordinates.index(f"drum.E{k}") for k in (1, 2)]
    turned = seen[0]["displacement"].values[np.ix_(waves, waves)]
    wanted = [[math.cos(1.5), math.sin(1.5)], [-math.sin(1.5), math.cos(1.5)]]
    np.testing.assert_allclose(turned, wanted, rtol=1e-12)
    others = [k for k in range(len(own.coordinates)) if k not in waves]
    np.testing.assert_array_equal(seen[0]["velocity"].values[np.ix_(others, others)], np.eye(len(others)))


def test_what_a_shoe_that_is_left_out_does_counts_only_where_it_squeals():
    def answer_with(growth, names):
        modes = {f"{name}.Y": mode_of(1000.0, growth if name == "other" else -50.0) for name in names}
        line = SpectralLine(f"{names[-1]}.Y", 1000.0, 1e-5)
        carriers = tuple(modes)
        unstable = tuple(label for label, mode in modes.items() if mode.growth_rate > 0)
        return SceneAnswer(modes, unstable, dict.fromkeys(modes, 1e-5), carriers, line, 0.0)

    left = answer_with(-50.0, ["one"])
    assert astuple(change_of(answer_with(-50.0, ["one", "other"]), left)) == (0.0, 0.0, 0.0, None)
    assert astuple(change_of(answer_with(50.0, ["one", "other"]), left)) == (math.inf, math.inf, 0.0, None)


def test_one_shoe_stays_and_what_another_has_does_not_count_any_more(pair, monkeypatch):
    own = Reduction("damping of other", "none", {}, shoe=1)
    shoes = [Reduction(f"shoe {name}", "none", {}, shoe=k, leaves_shoe=True) for k, name in enumerate(("one", "other"))]
    changes = {"shoe one": 0.002, "shoe other": 0.001, "damping of other": 0.5}

    class MadeUp:
        noise = None

        def __init__(self, *arguments):
            self.ran = []
            self.run("whole scene")

        def run(self, label, reductions=()):
            change = RelativeChange(sum(changes[each.effect] for each in reductions), None, None, None)
            self.ran.append(Variant(label, tuple(reductions), pair, Ending.COMPLETE, 1.0, 1, None, change))
            return self.ran[-1]

        def timed_again(self):
            return tuple(self.ran)

    monkeypatch.setattr(effects, "VariantRuns", MadeUp)
    monkeypatch.setattr(effects, "reductions_of", lambda scene: (*shoes, own))
    monkeypatch.setattr(effects, "describe_truncation", lambda *_: ())
    found = study_effects(pair)
    assert [each.effect for each in found.needed] == ["shoe one"]
    assert [each.effect for each in found.spared] == ["shoe other"]


# --- the command -----------------------------------------------------------------------------------------------------


@pytest.fixture
def quick_file(quick, tmp_path):
    file = tmp_path / "quick.toml"
    file.write_text(quick.to_toml(), encoding="utf-8")
    return file


def test_the_command_writes_table_figure_and_reduced_scene(drumsqueal, tmp_path, as_kept):
    """Of one damped equation with constant friction: its decay in closed form, which damping makes and nothing else."""
    folder, file = tmp_path / "out", tmp_path / "scene.toml"
    friction = 'friction={law="constant",coefficient=0.4,direction="tangential"}'  # that changes nothing along Y
    scene = brake_along_y(friction, "simulate.duration=0.01").with_values({"support": None})  # which acts along X
    file.write_text(scene.to_toml())
    status, printed, errors = drumsqueal("effects", str(file), "-o", str(folder), "--within", "1", "%")
    assert (status, errors) == (0, "")
    as_kept("effects", "", folder)  # it prints times
    assert {path.name for path in folder.iterdir()} == {"effects.csv", "effects.png", "reduced.toml"}
    assert load_scene(folder / "reduced.toml") == scene.with_values({"friction": None})
    assert "damping → none *" in printed
    rows = list(csv.DictReader((folder / "effects.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["run"] for row in rows][:2] == ["whole scene", "tolerance / 10"]
    assert [row["run"] for row in rows if row["needed"] == "yes"] == ["damping → none"]
    omega, ratio = AlongY(scene).omega, scene.numbers()["damping.ratio"]
    for row in rows:
        decay = 0.0 if row["run"] == "damping → none" else ratio * omega
        assert float(row["growth_rate_Y_1_per_s"]) == pytest.approx(-decay, rel=1e-9, abs=1e-9)
        frequency = np.sqrt(omega**2 - decay**2) / (2 * np.pi)
        assert float(row["frequency_Y_Hz"]) == pytest.approx(frequency, rel=1e-9)
        # Within a period of where the end begins; of 35 samples a period one is 1 - cos(π/35) off the peak at most.
        least, most = 5e-5 * np.exp(-decay * np.array([0.0047, 0.004]))
        assert 0.996 * least < float(row["end_amplitude_Y_m"]) < most
        change = float(row["end_amplitude_Y_m"]) / float(rows[0]["end_amplitude_Y_m"]) - 1
        assert float(row["change_of_amplitude"] or 0) == pytest.approx(change, rel=1e-9, abs=1e-12)


@pytest.mark.thorough
def test_the_command_tells_which_of_many_effects_are_needed(drumsqueal, quick_file, quick, tmp_path):
    folder = tmp_path / "out"
    status, printed, errors = drumsqueal("effects", str(quick_file), "-o", str(folder), "--within", "1", "%")
    assert (status, errors) == (0, "")
    assert "but not damping" in " ".join(printed.split())
    assert load_scene(folder / "reduced.toml") == quick.with_values({"damping": None})
    rows = list(csv.DictReader((folder / "effects.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["run"] for row in rows][:3] == ["whole scene", "tolerance / 10", "separation → bonded"]
    whole = rows[0]
    assert [row["run"] for row in rows if row["needed"] == "no"] == ["damping → none"]
    assert "separation → bonded *" in printed
    modes = {mode.label: mode for mode in analyse_stability(build_model(quick, coordinates=COORDINATES)).modes}
    for label, mode in modes.items():
        assert float(whole[f"frequency_{label}_Hz"]) == mode.frequency_Hz
        assert float(whole[f"growth_rate_{label}_1_per_s"]) == mode.growth_rate
    amplitudes = [f"end_amplitude_{name}" for name in ("X_m", "Y_m", "Tz_rad")]  # all carry a part of the motion
    for row in rows[1:]:
        change = max((float(row[key]) / float(whole[key]) - 1 for key in amplitudes), key=abs)
        assert float(row["change_of_amplitude"]) == pytest.approx(change, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("within", "fraction"), [(("1e-2",), 0.01), (("1", "%"), 0.01), (("2.5%",), 0.025)])
def test_an_accuracy_is_read_as_a_fraction_or_in_per_cent(
    drumsqueal, quick_file, tmp_path, monkeypatch, within, fraction
):
    asked = []

    def study(scene, within, **_):
        asked.append(within)
        raise IntegrationError("enough")

    monkeypatch.setattr(effects, "study_effects", study)
    assert drumsqueal("effects", str(quick_file), "-o", str(tmp_path / "out"), "--within", *within)[0] == 1
    assert asked == [pytest.approx(fraction)]


@pytest.mark.parametrize("within", ["1", "0", "-1 %", "100 %", "much", "1 m", "nan", "²", "1 % %"])
def test_an_accuracy_that_is_none_is_refused(drumsqueal, quick_file, tmp_path, within):
    status, _, errors = drumsqueal("effects", str(quick_file), "-o", str(tmp_path / "out"), "--within", within)
    assert status == 2
    assert errors.startswith(
        f'drumsqueal: --within {within}: write a fraction between 0 and 100 %, such as "1 %" or 0.01'
    )
    assert errors.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_earlier_results_are_kept_unless_told(drumsqueal, quick_file, tmp_path):
    (tmp_path / "reduced.toml").write_text("mine")
    status, _, errors = drumsqueal("effects", str(quick_file), "-o", str(tmp_path))
    assert status == 2
    assert "reduced.toml exists; add --overwrite" in errors
    assert (tmp_path / "reduced.toml").read_text() == "mine"


def test_an_argument_too_many_is_refused(drumsqueal, quick_file, tmp_path):
    status, _, errors = drumsqueal("effects", str(quick_file), "stray", "-o", str(tmp_path / "out"))
    assert (status, errors) == (
        2,
        "drumsqueal: Got unexpected extra argument (stray) (see drumsqueal effects --help)\n",
    )


@pytest.mark.thorough
@pytest.mark.parametrize("fails", ["whole", "interrupted", "disk"])
def test_a_study_that_is_cut_off_keeps_the_runs_made(drumsqueal, quick_file, tmp_path, monkeypatch, fails):
    stream, folder = simulation.transient, tmp_path / "out"
    calls = []

    def cut_off(prepared, since=None):
        calls.append(1)
        if fails == "whole":
            raise IntegrationError("the step size collapsed")
        if fails == "interrupted" and len(calls) == 5:  # the third run, once compiled
            signal.raise_signal(signal.SIGINT)
        yield from stream(prepared)

    monkeypatch.setattr(simulation, "transient", cut_off)
    if fails == "disk":
        monkeypatch.setattr(
            variants.VariantRuns, "timed_again", lambda self: (_ for _ in ()).throw(OSError(28, "No space"))
        )
    status, _, errors = drumsqueal("effects", str(quick_file), "-o", str(folder))
    assert status == 1
    assert errors.count("\n") == 1
    rows = list(csv.DictReader((folder / "effects.csv").read_text(encoding="utf-8").splitlines()))
    if fails == "whole":
        assert "the whole scene failed: the step size collapsed; what was done until then is in" in errors
        assert [row["outcome"] for row in rows] == ["failed: the step size collapsed"]
    elif fails == "interrupted":
        assert "interrupted by the user; what was done until then is in" in errors
        assert [row["run"] for row in rows] == ["whole scene", "tolerance / 10"]
    else:
        assert f"the disk does not take the results ({folder}: No space)" in errors
        assert len(rows) > 4
    assert not (folder / "reduced.toml").exists()


@pytest.mark.thorough
def test_a_full_disk_leaves_the_runs_that_were_written(drumsqueal, quick_file, tmp_path, monkeypatch):
    folder, written = tmp_path / "out", []
    write = Path.write_bytes

    def fill(path, content):
        if path.parent != folder:  # of a compilation that is kept, at some time or other
            return write(path, content)
        written.append(path)
        write(path, content[: len(content) // 2] if len(written) == 4 else content)
        if len(written) == 4:
            raise OSError(28, "No space left on device")
        return len(content)

    monkeypatch.setattr(Path, "write_bytes", fill)
    status, _, errors = drumsqueal("effects", str(quick_file), "-o", str(folder))
    assert (status, errors.count("\n")) == (1, 1)
    told = f"the disk does not take the results ({folder / 'effects.csv'}: No space left on device)"
    assert f"{told}; what was done until then is in" in errors
    rows = list(csv.DictReader((folder / "effects.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 3
    assert [path.name for path in folder.iterdir()] == ["effects.csv"]


@pytest.mark.thorough
def test_numbers_of_the_table_are_finite_or_empty(study):
    for variant in study.variants:
        assert variant.change is None or not any(x is not None and np.isnan(x) for x in astuple(variant.change))


@pytest.mark.thorough
def test_the_findings_read_back_as_what_was_written(study, tmp_path):
    write_json(study, tmp_path / "effects.json")
    assert to_json(read_findings(tmp_path / "effects.json", EffectStudy)) == to_json(study)
