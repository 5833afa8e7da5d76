"""The parts of checks, of the paper's statements, of sounds and of reductions, against sums written out."""

import base64
import io
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy

from drumsqueal.errors import IntegrationError
from drumsqueal.physics.effects.pressure import Unilateral
from drumsqueal.questions import check
from drumsqueal.questions.check import PredictedGrowth, _contents, estimate, first_boundary_time
from drumsqueal.questions.commands.onset import example
from drumsqueal.questions.effects.reductions import (
    BendingBody,
    Reduction,
    _modes,
    fewest_modes,
    reductions_of,
    what_counts,
)
from drumsqueal.questions.effects.reductions import reduce as reduced
from drumsqueal.questions.report import answer as run_page
from drumsqueal.scene import load_scene
from drumsqueal.simulation import check_transient, start_of, steady_at_start
from drumsqueal.solve.linear.family import EigenvalueSet

RNG = np.random.default_rng(15)

# --- check -----------------------------------------------------------------------------------------------------------


def prepared(**more: Any) -> Any:
    start = SimpleNamespace(displacement={"Y": 2e-6}, velocity={"X": 3e-3})
    simulate = SimpleNamespace(duration=2.0, sample_rate=1024.0, tolerance=1e-6, solver="auto")
    scene = SimpleNamespace(start=start, simulate=simulate, alone=())
    stability = SimpleNamespace(coordinates=("X", "Y", "Z"), time=0.0, steady_state=np.array([4.0, 5.0, 6.0]))
    known: dict[str, Any] = {
        "scene": scene,
        "model": SimpleNamespace(names=("Y", "X")),
        "linear": None,
        "stability": stability,
    }
    return SimpleNamespace(**(known | more))


def test_a_mode_that_grows_reaches_the_boundary_by_its_growth_rate(monkeypatch):
    monkeypatch.setattr(check, "while_sliding", lambda linear: (None, 0.0))
    monkeypatch.setattr(
        check, "boundary_ratios", lambda model, q, v: (np.abs(q).sum(axis=1).max(), 0.1 * np.abs(v).max())
    )
    right, left = (RNG.normal(size=6) + 1j * RNG.normal(size=6) for _ in range(2))
    mode: Any = SimpleNamespace(label="X", frequency_Hz=50.0, growth_rate=8.0, left=left, right=right)
    found = check._growth(prepared(), mode)
    state = np.array([0, 2e-6, 0, 3e-3, 0, 0])
    turns = np.exp(2j * np.pi * np.arange(64) / 64)
    shape = np.real(turns[:, None] * right)
    reach = max(np.abs(shape[:, :3]).sum(axis=1).max(), 0.1 * np.abs(shape[:, 3:]).max())
    fraction = 2 * abs(left.conj() @ state) * reach
    wanted: Any = pytest.approx(fraction), pytest.approx(math.log(1 / fraction) / 8.0)
    assert found == PredictedGrowth("X", 50.0, 8.0, *wanted)
    mode.left = left * 10 / fraction
    assert check._growth(prepared(), mode).edge_time == 0.0
    mode.left = left * 0.9e-12 / fraction
    assert check._growth(prepared(), mode).edge_time is None
    of = prepared()
    of.stability.unstable = (mode, mode)
    growing = (found, PredictedGrowth("Y", 1.0, 1.0, 0.0, None))
    np.testing.assert_allclose(check._at_the_boundaries(of, growing), np.real(right)[[1, 0, 4, 3]] / reach)
    assert first_boundary_time((found, growing[1]), (0.5, 0.2)) == found.edge_time
    assert first_boundary_time((found,), (0.5, 1.0)) == 0.0
    assert first_boundary_time((growing[1],), (0.5, 0.2)) is None


def test_derived_numbers_are_those_of_the_shoe_the_load_and_the_speed(monkeypatch):
    monkeypatch.setattr(check, "_friction_at", lambda law, speed: (0.5 - 0.1 * speed, -0.1))
    law = Unilateral(2e9)
    contact = SimpleNamespace(law=law, friction=SimpleNamespace(law=None))
    inertia = SimpleNamespace(X=3.0, Tx=0.1, Ty=0.2, Tz=0.3)
    shoe = SimpleNamespace(outer_radius=0.1, centroid=0.07, half_angle=0.6, area=0.005, inertia=inertia)
    operation = SimpleNamespace(at=lambda t: SimpleNamespace(drum_speed=-7.0))
    model: Any = SimpleNamespace(lining=contact, shoe=shoe, operation=operation)
    found = {name: value for name, value, _, _ in check._numbers_of(model, 4e5, pushed=False)}
    assert found == pytest.approx(
        {
            "arc length": 0.12,
            "lining area": 0.005,
            "mass": 3.0,
            "centre of gravity": 0.07,
            "moment of inertia I1": 0.1,
            "moment of inertia I2": 0.2,
            "moment of inertia I3": 0.3,
            "mean pressure p0": 4e5,
            "lifting displacement": 2e-4,
            "lifting rotation": 2e-4 / (0.07 * math.sin(0.6)),
            "sliding speed": 0.7,
            "reversing rotation": 0.7 / (0.1 - 0.07 * math.cos(0.6)),
            "friction coefficient": 0.43,
            "slope of friction": -0.1,
        }
    )
    pushed = {name: value for name, value, _, _ in check._numbers_of(model, 4e5, pushed=True)}
    assert set(found) - set(pushed) == {"mean pressure p0", "lifting rotation"}
    shoe.half_angle = 2.0
    wide = {name: value for name, value, _, _ in check._numbers_of(model, 4e5, pushed=False)}
    assert wide["lifting rotation"] == pytest.approx(2e-4 / 0.07)


def test_a_run_takes_what_its_pieces_take_below_and_beyond_the_boundary(monkeypatch):
    chunk = check.CHUNK_SAMPLES
    asked: list[tuple[list[float], int]] = []

    def timed(prepared, state, samples, progress):
        asked.append((state.tolist(), samples))
        far = state[0] > 1.0
        return (0.05 + samples * (0.01 if far else 0.001), 100.0 + samples * (7.0 if far else 4.0))

    monkeypatch.setattr(check, "_timed", timed)
    of = prepared()
    boundary = np.array([1.0, 2.0, 3.0, 4.0])
    found = estimate(of, 0.5, boundary)
    # 0.5 of 2 s at the pace of the start, for pieces up to a whole chunk; then at that of 1.5 times the boundary, of
    # which 100 samples take 1.05 s, and the others as many more as those took after 20.
    near = np.array([0.05 + chunk * 0.001, 100 + 4.0 * chunk])
    far = np.array([0.05 + chunk * 0.01, 100 + 7.0 * chunk])
    assert found == pytest.approx(tuple(2.0 * 1024 / chunk * (0.25 * near + 0.75 * far)))
    states = {tuple(state) for state, _ in asked}
    assert states == {(2e-6, 0.0, 0.0, 3e-3), (1.5, 3.0, 4.5, 6.0)}
    assert {samples for state, samples in asked if state[0] > 1} == {4, 20, 100}
    assert sum(samples == 4 for state, samples in asked if state[0] > 1) == 3
    asked.clear()
    assert estimate(of, None, boundary) == pytest.approx(tuple(2.0 * 1024 / chunk * near))
    assert estimate(of, 9.0, boundary) == pytest.approx(tuple(2.0 * 1024 / chunk * near))
    assert estimate(of, 0.5, 0 * boundary) == pytest.approx(tuple(2.0 * 1024 / chunk * near))

    def fails(*given):
        raise IntegrationError("so")

    monkeypatch.setattr(check, "_timed", fails)
    assert estimate(of, None, boundary) is None


def test_a_mesh_holds_elements_volumes_and_masses_by_set():
    points, volumes, masses = RNG.normal(size=(7, 3)), np.arange(1.0, 5.0), np.array([2.0, 5.0, 1.0, 8.0])
    mesh: Any = SimpleNamespace(
        volumes=volumes,
        points=points,
        counts={"tet": 4},
        notes=("so",),
        point_masses=np.array([0.0, 1.5, 0.0, 2.0, 0.0, 0.0, 0.0]),
        element_sets={"b": np.array([1, 3]), "a": np.array([0])},
    )
    found = _contents("shoe", "file", mesh, masses)
    assert (found.whole.elements, found.whole.volume_m3, found.whole.mass_kg) == (4, 10.0, 16.0)
    assert {name: (each.elements, each.volume_m3, each.mass_kg) for name, each in found.sets.items()} == {
        "a": (1, 1.0, 2.0),
        "b": (2, 6.0, 13.0),
    }
    assert (found.point_masses, found.point_masses_kg) == (2, 3.5)
    assert found.lowest_m == tuple(points.min(axis=0))
    assert found.highest_m == tuple(points.max(axis=0))


# --- where a run starts ----------------------------------------------------------------------------------------------


def test_a_transient_starts_over_its_own_coordinates_about_the_steady_sliding_of_then():
    of = prepared()
    displacement, velocity = start_of(of.scene, ("X", "Z", "Y"))
    assert (displacement.tolist(), velocity.tolist()) == ([0.0, 0.0, 2e-6], [3e-3, 0.0, 0.0])
    assert steady_at_start(of).tolist() == [5.0, 4.0]
    of.stability.time = 0.1
    assert steady_at_start(of).tolist() == [0.0, 0.0]


def test_samples_that_fold_are_refused_with_the_rate_that_would_do():
    from drumsqueal.scene import SceneError

    of = prepared()
    of.stability.highest_frequency_Hz = 512.0
    check_transient(of)
    of.stability.highest_frequency_Hz = 512.1
    with pytest.raises(SceneError, match=r"512.1 Hz, which would be aliased; take at least 1024.2 Hz$"):
        check_transient(of)


# --- the paper -------------------------------------------------------------------------------------------------------


paper = example()
AXIS = {axis.figure: axis for axis in paper.AXES}


def curve(values: np.ndarray, **spectrum: Any) -> Any:
    names = ("X", "Y", "Z", "Tx", "Ty", "Tz")
    return paper.Curve(AXIS["7"], values, 5.0, SimpleNamespace(names=names, **spectrum))


def test_axes_are_shown_in_their_units():
    assert AXIS["9"].shown(math.pi / 2, 1.0) == pytest.approx(90.0)
    assert AXIS["10"].shown(0.1, 0.1) == pytest.approx(100.0)
    assert AXIS["5"].shown(np.array([1.0, 4.0]), 8.0) == pytest.approx([12.5, 50.0])
    assert [axis.figure for axis in paper.AXES] == ["5", "6", "7", "8", "9", "10", "11"]


def test_the_power_of_the_speed_is_that_of_the_damping_over_a_factor():
    values = np.geomspace(1.0, 20.0, 9)
    damping = np.zeros((9, 6, 6))
    factor = 1 / values**0.3
    damping[:, 3, 3] = 7.0 * values**-1.4
    assert paper.exponent(curve(-values, damping=damping), "Tx", 1.0) == pytest.approx(-1.4)
    assert paper.exponent(curve(values, damping=damping), "Tx", factor) == pytest.approx(-1.1)
    assert paper.exponent(curve(values, damping=damping), "Ty", 1.0) == math.inf


def test_the_motion_of_a_lining_is_shared_among_its_three_directions():
    values = np.array([2.0, 5.0, 9.0])
    eigenvalues = np.arange(18.0).reshape(3, 6) + 3j
    right = np.zeros((3, 12, 6), dtype=complex)
    right[1, :6] = np.eye(6)[:, ::-1]
    shoe: Any = SimpleNamespace(
        half_angle=0.6,
        width=0.04,
        displacement=lambda q, angle, z: (q["X"] * np.cos(angle), q["X"] * np.sin(angle) + 0 * z, 1j * q["X"] * z),
    )
    given = curve(values, eigenvalues=eigenvalues, right=right, of=lambda name: eigenvalues[:, 5])
    found = paper.lining_motion(given, shoe, "X")
    squares = np.array([0.5 + math.sin(1.2) / 2.4, 0.5 - math.sin(1.2) / 2.4, 0.02**2 / 3])
    np.testing.assert_allclose(found, squares / squares.sum())


def test_frequencies_are_apart_by_their_difference_over_the_higher():
    np.testing.assert_allclose(paper.distance(np.array([3.0, 5.0, 0.0]), np.array([4.0, 2.0, 0.0])), [0.25, 0.6, 0.0])
    frequencies = {
        "X": np.array([10.0, 12.0, 20.0]),
        "Y": np.array([30.0, 15.0, 40.0]),
        "Tz": np.array([90.0, 80.0, 21.0]),
    }
    given: Any = SimpleNamespace(frequency_Hz=frequencies.__getitem__, shown=np.array([0.0, 50.0, 100.0]))
    gap, pair, place = paper.closest(given)
    assert (gap, pair, place) == (pytest.approx(1 / 21), "X and Tz", 100.0)


def test_all_numbers_but_one_stay_along_each_figure(monkeypatch):
    monkeypatch.setattr(paper, "POINTS", 3)
    asked: dict[str, Any] = {}

    def spectra_of(scene, numbers):
        asked.update(numbers)
        rows = np.arange(6.0)
        return EigenvalueSet(("X",), *(rows + 10 * k for k in range(len(EigenvalueSet._fields) - 1)))  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(paper, "spectra_of", spectra_of)
    scene: Any = SimpleNamespace(numbers=lambda: {"a": 2.0, "b": 5.0, "c": 7.0, "list": (1.0, 2.0)})
    axes = [paper.Axis("1", "b", 0.0, 1.0, "", "", 0, ()), paper.Axis("2", "a", 0.5, 1.5, "", "", 0, ())]
    found = paper.curves_along(scene, axes)
    assert {key: values.tolist() for key, values in asked.items()} == {
        "a": [2, 2, 2, 1, 2, 3], "b": [0, 2.5, 5, 5, 5, 5], "c": [7] * 6
    }  # fmt: skip
    assert found["2"].values.tolist() == [1.0, 2.0, 3.0]
    assert (found["2"].nominal, found["1"].nominal) == (2.0, 5.0)
    assert found["2"].spectrum[1].tolist() == [3.0, 4.0, 5.0]


# --- sounds ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("end", "since", "played"),
    [
        (0.9, 0.5, (0.0, 0.9)),
        (3.0, None, (0.0, 1.0)),
        (3.0, 0.5, (0.0, 0.7)),
        (3.0, 1.5, (0.7, 1.7)),
        (3.0, 2.95, (2.0, 3.0)),
    ],
)
def test_a_second_of_a_record_is_played_up_to_some_of_what_follows_the_growth(end, since, played):
    assert run_page._played(end, since) == pytest.approx(played)


def test_a_motion_is_repeated_where_it_is_most_like_its_beginning():
    rate, fade = run_page.CD_RATE, round(0.01 * run_page.CD_RATE)
    time = np.arange(round(0.1 * rate)) / rate
    whole, times = run_page._repeated(np.sin(2 * np.pi * 100 * time), 0.5)
    step = (whole.size - fade) // times  # of whole periods of 441 samples, as long as the fade
    assert (step % 441, step >= 2205, whole.size) == (0, True, times * step + fade)
    assert times == math.ceil((0.5 * rate - fade) / step)
    wanted = np.sin(2 * np.pi * 100 * np.arange(whole.size) / rate)[fade:-fade]
    np.testing.assert_allclose(whole[fade:-fade], wanted, atol=1e-9)
    np.testing.assert_allclose(whole[fade // 4], np.sin(np.pi / 2) * (fade // 4) / (fade - 1), rtol=1e-3)
    assert whole[0] == whole[-1] == 0.0
    heard = run_page._heard(np.sin(2 * np.pi * 100 * np.arange(2000) / 8000), 8000.0)
    assert heard.size == int(1999 / 8000 * rate) + 1
    middle = slice(heard.size // 4, 3 * heard.size // 4)
    np.testing.assert_allclose(heard[middle], np.sin(2 * np.pi * 100 * np.arange(heard.size) / rate)[middle], atol=1e-3)


# --- reductions ------------------------------------------------------------------------------------------------------


class Bends(BendingBody):
    """A body with modes of these frequencies, and two more shapes."""

    frequencies = [100.0, 210.0, 210.0, 330.0, 480.0]  # noqa: RUF012  # pyright: ignore[reportAssignmentType]


DRUM = tuple(f"drum.E{k}" for k in range(1, 6))
BODY = Bends("the drum", "drum", None, "drum.elastic", (*DRUM, "drum.S6", "drum.S7"))  # pyright: ignore[reportArgumentType]


def test_modes_are_kept_below_a_round_frequency_and_pairs_stay_together():
    found = _modes(BODY, [100.0, 210.0, 330.0, 480.0], 2)
    assert (found.effect, found.becomes) == ("drum modes", "3 below 0.3 kHz")
    assert dict(found.values) == {"drum.elastic.up_to": 300.0}
    assert found.without == ("drum.E4", "drum.E5", "drum.S6", "drum.S7")  # with three modes it yields otherwise besides
    assert dict(_modes(BODY, [100.0, 210.0, 330.0, 480.0], 1).values) == {"drum.elastic.up_to": 200.0}
    assert dict(_modes(BODY, [100.0, 101.0, 330.0], 1).values) == {"drum.elastic.up_to": 100.5}
    tried = []

    def suffices(least: int):
        def of(reduction: Reduction) -> bool:
            kept = 7 - len(reduction.without)
            tried.append(kept)
            return kept >= least

        return of

    enough = fewest_modes(BODY, suffices(2))
    assert enough is not None
    assert enough.becomes == "3 below 0.3 kHz"
    assert fewest_modes(BODY, suffices(5)) is None
    one = fewest_modes(BODY, suffices(0))
    assert one is not None
    assert one.without == BODY.shapes[1:]


def test_each_effect_of_a_scene_is_left_out_by_its_own_values(nominal):
    def named(scene) -> dict[str, Any]:
        return {each.effect: (each.becomes, dict(each.values)) for each in reductions_of(scene)}

    found = named(nominal)
    sliding = nominal.friction.at(nominal.shoe.outer_radius * nominal.drum.speed)
    assert found["separation"] == ("bonded", {"contact.separation": False})
    assert found["exponential law"] == (
        f"μ {sliding:.4g}",
        {"friction": {"law": "constant", "coefficient": sliding, "direction": nominal.friction.direction}},
    )
    assert found["support springs"] == ("none", {"support": None})
    backwards = nominal.with_values(
        {
            "drum.speed": {"time": [1.0, 2.0], "value": [-4.0, -8.0]},
            "contact.normal_load": {"time": [0.0, 2.0], "value": [100.0, 900.0]},
        }
    )
    found = named(backwards)
    assert found["speed profile"] == ("-4 rad/s", {"drum.speed": -4.0})
    assert found["load profile"] == ("100 N", {"contact.normal_load": 100.0})
    assert found["exponential law"][1]["friction"]["coefficient"] == pytest.approx(nominal.friction.at(0.1 * 4.0))
    constant = nominal.with_values({"friction": {"law": "constant", "coefficient": 0.3}, "damping": {"ratio": 0.02}})
    found = named(constant)
    assert found["friction"] == ("none", {"friction": None})
    assert found["damping"] == ("none", {"damping": None})
    leading = load_scene("leading_shoe")
    found = {each.effect: each for each in reductions_of(leading)}
    springs = [each for each in found if each.startswith("spring")]
    places = sorted(place for each in springs for place in found[each].springs)
    assert places == list(range(len(leading.shoe.spring)))
    left = reduced(leading, [found[springs[0]]])
    assert len(left.shoe.spring) == len(leading.shoe.spring) - len(found[springs[0]].springs)


def test_what_is_reduced_of_a_shoe_that_is_left_out_does_not_count():
    shoe = Reduction("shoe a", "none", {}, shoe=0, leaves_shoe=True)
    own, other, all_ = (Reduction(name, "none", {}, shoe=k) for name, k in (("x", 0), ("y", 1), ("z", None)))
    assert what_counts([shoe, own, other, all_]) == (shoe, other, all_)
    assert what_counts([own, other, all_], (1,)) == (own, all_)
    assert str(own) == "x → none"


def wave_of(uri: str) -> tuple[int, np.ndarray]:
    data = base64.b64decode(uri.removeprefix("data:audio/wav;base64,"))
    return scipy.io.wavfile.read(io.BytesIO(data))


@pytest.mark.filterwarnings("ignore:Chunk")  # of the texts in it, which SciPy passes over
def test_sounds_are_the_record_and_what_it_leads_to_at_its_speed_and_slower(monkeypatch):
    """A record of 0.3 s that begins at 5 s: a tone of 600 Hz, and from 0.15 s on one of 882 Hz, thrice as loud."""
    rate = 8000.0
    time = np.arange(2401) / rate
    velocity = np.where(time < 0.15, 0.01 * np.sin(2 * np.pi * 600 * time), 0.03 * np.sin(2 * np.pi * 882 * time))
    history: Any = SimpleNamespace(
        sample_rate=rate, data={"time": SimpleNamespace(values=5.0 + time)}, scene=SimpleNamespace(title="so")
    )
    asked = []
    for name, seconds in (("RECORD_S", 0.1), ("AFTER_S", 0.02), ("REPEATED_S", 0.12)):
        monkeypatch.setattr(run_page, name, seconds)
    monkeypatch.setattr(run_page, "default_signal", lambda history: "signal")
    monkeypatch.setattr(
        run_page, "make_channels", lambda *given: asked.append(given) or [SimpleNamespace(values=velocity)]
    )
    saturation: Any = SimpleNamespace(start_s=0.15, main=SimpleNamespace(frequency_Hz=882.0))
    found = run_page.clips(history, saturation, settles=True)
    assert asked == [(history, ["signal"], slice(None))]
    assert [each.heading for each in found] == [
        "The record", "The record, 4 times slower", "After growth", "After growth, 4 times slower"
    ]  # fmt: skip
    assert [each.tone for each in found[:2]] == ["", ""]
    assert "tone of 882 Hz, 220 Hz where it is slower" in found[2].tone
    assert found[0].text.startswith("From 0.07 to 0.17 s, 0.1 s at most of a record of 0.3 s, at its own speed")
    for each, times in zip(found, (1, 4, 1, 4), strict=True):
        own, samples = wave_of(each.uri)
        assert own == run_page.CD_RATE // times
        assert each.seconds == pytest.approx(samples.size / own)
    own, samples = wave_of(found[0].uri)
    assert turns_of(samples[: int(0.075 * own)], own) == pytest.approx(600.0, abs=15.0)
    assert turns_of(samples[int(0.085 * own) :], own) == pytest.approx(882.0, abs=70.0)
    for each in found[2:]:
        own, samples = wave_of(each.uri)
        assert turns_of(samples, own) * run_page.CD_RATE / own == pytest.approx(882.0, abs=10.0)
        assert 0.12 <= each.seconds < 0.12 + 0.13 * run_page.CD_RATE / own
    found = run_page.clips(history, saturation, settles=False)
    assert [each.heading for each in found] == ["The record", "The record, 4 times slower"]
    history.data["time"].values = 5.0 + time / 4
    history.sample_rate = 4 * rate
    whole = run_page.clips(history, None, settles=True)
    assert [each.heading for each in whole] == ["The record", "The record, 4 times slower"]
    assert whole[0].text.startswith("The whole record, 0.075 s, at its own speed: as it was")
    assert whole[0].seconds == pytest.approx(0.075, abs=1e-3)
    velocity *= 0.0
    assert run_page.clips(history, saturation, settles=True) == []


def turns_of(samples: np.ndarray, rate: int) -> float:
    """How often a tone turns upwards in a second."""
    return np.count_nonzero((samples[:-1] < 0) & (samples[1:] >= 0)) * rate / samples.size
