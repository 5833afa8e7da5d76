"""Animations: geometry of the section, what is marked along the arc, times and sizes of frames, files as read back."""

import shutil
import signal
import subprocess
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray
from matplotlib.animation import FFMpegWriter
from matplotlib.patches import FancyArrowPatch
from PIL import Image, ImageSequence

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.brake import placed
from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.model import build_model
from drumsqueal.questions.animate import animation
from drumsqueal.questions.animate.animation import PIXELS, MovingSection, write_animation
from drumsqueal.questions.animate.playback import REVERSED, SEPARATED, STUCK, TOUCHING, play_history, play_mode
from drumsqueal.questions.animate.section import (
    largest_displacement,
    lining_parts,
    moved,
    on_circle,
    shoe_outline,
)
from drumsqueal.scene import COORDINATES, load_scene
from drumsqueal.simulation import prepare

SCENARIOS = Path(__file__).parents[2] / "scenarios"
RATE, FREQUENCY, LIFTS, REVERSES = 50e3, 1000.0, 2e-5, 1.0  # beyond p0/k_c = 6.9 µm, and beyond RΩ = 0.5 m/s


def made_up(scene, displacement: dict, samples: int = 1001, **signals) -> xarray.Dataset:
    """A history of harmonic coordinates of one frequency: name to complex amplitude."""
    time = np.arange(samples) / RATE
    turning = np.exp(2j * np.pi * FREQUENCY * time)
    moved, rate = np.zeros((samples, 6)), np.zeros((samples, 6))
    for name, size in displacement.items():
        moved[:, COORDINATES.index(name)] = (size * turning).real
        rate[:, COORDINATES.index(name)] = (2j * np.pi * FREQUENCY * size * turning).real
    data: dict = {"displacement": (("time", "coordinate"), moved), "velocity": (("time", "coordinate"), rate)}
    data["sticking"] = ("time", signals.get("sticking", np.zeros(samples)))
    return xarray.Dataset(
        data, {"time": time, "coordinate": list(COORDINATES)}, {"outcome": "complete", "ending": "complete"}
    )


@pytest.fixture(scope="module")
def shoe(nominal):
    return build_model(nominal, coordinates=IN_PLANE).shoe


@pytest.fixture(scope="module")
def lifting(nominal):
    """Y lifts off one end and then the other; Tz is fast enough to slip backwards."""
    spin = REVERSES / (0.1 * 2 * np.pi * FREQUENCY)
    return made_up(nominal, {"Y": LIFTS, "Tz": 1j * spin})


@pytest.fixture(scope="module")
def stability(nominal):
    return prepare(nominal).stability


# --- geometry -------------------------------------------------------------------------------------------------------


def test_the_outline_is_the_annular_sector(shoe):
    outline = shoe_outline(placed(shoe)[0])
    np.testing.assert_array_equal(outline[0], outline[-1])
    radii, angles = np.hypot(*outline.T), np.arctan2(outline[:, 1], outline[:, 0])
    assert set(np.round(radii, 9)) == {80.0, 100.0}  # mm
    assert np.rad2deg([angles.min(), angles.max()]) == pytest.approx([-65, 65])
    x, y = outline[:-1].T
    area = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
    # A polygon of 60 chords an arc of 130° is smaller than the sector by (Δθ)²/6 = 2.4e-4.
    assert area == pytest.approx(np.deg2rad(130) / 2 * (100**2 - 80**2), rel=3e-4)


def test_a_small_motion_is_the_exact_one_of_a_rigid_body(shoe):
    X, Y, turn = 3e-4, -2e-4, 1e-4
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    gravity = 1e3 * np.array([float(shoe.centroid), 0.0])
    place = shoe_outline(placed(shoe)[0])
    exact = (place - gravity) @ rotation.T + gravity + 1e3 * np.array([X, Y])
    # What is linear in the rotation lacks its square, times an arm of up to 97 mm: 97 × 1e-8 / 2 mm.
    motion = {"X": X, "Y": Y, "Tz": turn}
    np.testing.assert_allclose(place + moved(place, placed(shoe)[0], motion), exact, rtol=0, atol=5e-7)


def test_the_lining_moves_as_the_model_says(shoe):
    """Radial and tangential displacement of physics: A cos θ + B sin θ and R Tz − A sin θ + B cos θ, on a line z."""
    rng = np.random.default_rng(1)
    q, z, theta = rng.normal(size=6), 0.01, np.linspace(-1.1, 1.1, 7)
    c, A = float(shoe.centroid), q[0] + z * q[4]
    B = q[1] - z * q[3] - c * q[5]
    place = on_circle(0.1, theta)
    along_line = moved(place, placed(shoe)[0], dict(zip(COORDINATES, q, strict=True)), z) / 1e3
    e_r = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    e_t = np.stack([-np.sin(theta), np.cos(theta)], axis=-1)
    np.testing.assert_allclose(np.sum(along_line * e_r, axis=-1), A * np.cos(theta) + B * np.sin(theta), atol=1e-13)
    wanted = 0.1 * q[5] - A * np.sin(theta) + B * np.cos(theta)
    np.testing.assert_allclose(np.sum(along_line * e_t, axis=-1), wanted, atol=1e-13)


def test_the_largest_displacement_is_that_of_the_furthest_point(shoe):
    motions = np.random.default_rng(2).normal(size=(20, 3)) * [1e-5, 1e-5, 1e-4]
    place = shoe_outline(placed(shoe)[0])
    names = ("X", "Y", "Tz")
    moves = (moved(place, placed(shoe)[0], dict(zip(names, motion, strict=True))) for motion in motions)
    wanted = max(np.hypot(*each.T).max() for each in moves) / 1e3
    assert largest_displacement(placed(shoe), dict(zip(names, motions.T, strict=True))) == pytest.approx(
        wanted, rel=1e-9
    )


def test_parts_of_the_lining_fill_it(shoe):
    parts = lining_parts(placed(shoe)[0], np.linspace(-1.0, 1.0, 41), (0.0, 0.004))
    assert parts.shape == (40, 4, 2)
    np.testing.assert_array_equal(parts[1:, 0], parts[:-1, 1])  # each begins where the one before ends
    np.testing.assert_allclose(np.hypot(*np.moveaxis(parts, -1, 0)), [[100, 100, 96, 96]] * 40)


# --- a history ------------------------------------------------------------------------------------------------------


def test_the_last_three_periods_of_the_main_line_are_shown(nominal, lifting):
    shown = play_history(lifting, nominal)
    # In a record of 20 periods the peak of the spectrum is good to 0.3 %.
    np.testing.assert_allclose(shown.time[[0, -1]], [17e-3, 20e-3], rtol=0, atol=0.01e-3)
    assert shown.time.size == 150
    np.testing.assert_allclose(np.diff(shown.time), np.diff(shown.time)[0], rtol=1e-9)
    assert "of real time" in shown.notes[0]
    assert float(shown.notes[0].split("1/")[1].split()[0]) == pytest.approx(0.04 / np.diff(shown.time)[0], rel=1e-3)


def test_frames_are_the_motion_at_their_times(nominal, lifting):
    shown = play_history(lifting, nominal, start=0.01, end=0.0123)
    exact = LIFTS * np.cos(2 * np.pi * FREQUENCY * shown.time)
    # A quintic spline through 50 samples a period is good to (2π/50)^6/6 or so: 1e-6.
    np.testing.assert_allclose(shown.motion["Y"], exact, rtol=0, atol=1e-6 * LIFTS)
    np.testing.assert_allclose(
        shown.curves["Y"], 1e6 * LIFTS * np.cos(2 * np.pi * FREQUENCY * shown.curve_time), atol=1e-4
    )


def test_separated_pressed_and_reversed_parts_are_those_of_the_model(nominal, lifting):
    """By the gap and the slip speed at each part, written out; and their shares, by the model's own integrals."""
    shown = play_history(lifting, nominal)
    model = build_model(nominal, coordinates=IN_PLANE)
    c, theta = float(model.shoe.centroid), (shown.arcs[0].edges[1:] + shown.arcs[0].edges[:-1]) / 2
    p0, k = 2000 / (0.1 * np.deg2rad(130) * 0.0365), 0.35e11
    phase = np.exp(2j * np.pi * FREQUENCY * shown.time)
    spin = 1j * REVERSES / (0.1 * 2 * np.pi * FREQUENCY)
    Y, Tz = (LIFTS * phase)[:, None], (spin * phase)[:, None]
    level = p0 + k * ((Y - c * Tz) * np.sin(theta)).real
    slip = (2j * np.pi * FREQUENCY * (0.1 * Tz + (Y - c * Tz) * np.cos(theta))).real - 0.1 * 5
    wanted = np.where(level < 0, SEPARATED, np.where(slip > 0, REVERSED, TOUCHING))
    # Interpolated, a value that is zero to 1e-6 may fall on either side.
    sure = (np.abs(level) > 1e-4 * p0) & (np.abs(slip) > 1e-4)
    np.testing.assert_array_equal(shown.arcs[0].state[sure], wanted[sure])
    assert {TOUCHING, SEPARATED, REVERSED} == set(np.unique(shown.arcs[0].state))
    np.testing.assert_allclose(shown.arcs[0].pressure, np.maximum(level, 0), rtol=0, atol=1e-4 * p0)
    assert not shown.arcs[0].change
    # 130 parts tell an edge to half a part, and there are at most two edges.
    observe = jax.jit(lambda q, v: model.observe(0.0, q, v))
    for frame in range(0, 150, 13):
        velocity = np.array([0.0, *np.real(2j * np.pi * FREQUENCY * np.stack([Y, Tz])[:, frame, 0])])
        seen = observe(jnp.asarray([shown.motion[name][frame] for name in IN_PLANE]), jnp.asarray(velocity))
        state = shown.arcs[0].state[frame]
        assert np.mean(state != SEPARATED) == pytest.approx(float(seen.contact_fraction), abs=1 / 130)
        assert np.mean(state == REVERSED) == pytest.approx(float(seen.slip_reversed_fraction), abs=1.5 / 130)


def test_pressure_is_that_of_the_whole_displacement_where_the_steady_one_is_not_zero(nominal, lifting):
    scene = nominal.with_values({"steady.state": "self-consistent"})
    shown = play_history(lifting, scene)
    assert np.abs(prepare(scene).stability.steady_state).max() > 1e-7
    c, theta = float(build_model(scene).shoe.centroid), (shown.arcs[0].edges[1:] + shown.arcs[0].edges[:-1]) / 2
    p0, k = 2000 / (0.1 * np.deg2rad(130) * 0.0365), 0.35e11
    turning = np.exp(2j * np.pi * FREQUENCY * shown.time)
    spin = 1j * REVERSES / (0.1 * 2 * np.pi * FREQUENCY)
    level = p0 + k * (((LIFTS - c * spin) * turning)[:, None] * np.sin(theta)).real
    np.testing.assert_allclose(shown.arcs[0].pressure, np.maximum(level, 0), rtol=0, atol=1e-4 * p0)


def test_what_sticks_is_marked_where_it_touches(nominal):
    sticking = np.zeros(1001)
    sticking[900:] = 1
    shown = play_history(made_up(nominal, {"Y": LIFTS}, sticking=sticking), nominal, start=0.017, end=0.02)
    late = shown.time > 0.018
    touches = shown.arcs[0].state != SEPARATED
    assert (shown.arcs[0].state[late] == STUCK)[touches[late]].all()
    assert not (shown.arcs[0].state[~late] == STUCK).any()


def test_a_bonded_lining_never_lifts_off(nominal, lifting):
    shown = play_history(lifting, nominal.with_values({"contact.separation": False}))
    assert SEPARATED not in shown.arcs[0].state
    assert shown.arcs[0].pressure.min() < 0


@pytest.mark.thorough
def test_the_displacement_is_the_vibration_from_steady_sliding(nominal):
    scene = nominal.with_values({"steady.state": "self-consistent"})
    history = made_up(scene, {"Y": 1e-7})
    history["displacement"].values[:] += [-3.055e-7, 7.591e-6, 0, 0, 0, 1.161e-5]  # as `stability` prints it
    shown = play_history(history, scene)
    # Printed with four digits: to within half of 1e-9 m.
    np.testing.assert_allclose(shown.motion["Y"], 1e-7 * np.cos(2 * np.pi * FREQUENCY * shown.time), atol=6e-10)
    # Pressure is that of the whole displacement: 0.094 to 1.87 times p0 along the arc.
    assert shown.arcs[0].pressure.max() / shown.arcs[0].pressure.min() > 10


def test_the_magnification_draws_the_largest_as_stated(nominal, lifting, shoe):
    shown = play_history(lifting, nominal)
    place = shoe_outline(placed(shoe)[0])
    frames = ({name: values[k] for name, values in shown.motion.items()} for k in range(shown.time.size))
    drawn = shown.magnification * max(np.hypot(*moved(place, placed(shoe)[0], motion).T).max() for motion in frames)
    assert 0.9 * 0.3 * 20 <= drawn <= 0.3 * 20  # mm; the factor has two digits, and is rounded down
    assert f"magnified {shown.magnification:g} times" in shown.notes[1]
    assert play_history(lifting, nominal, magnification=7.0).magnification == 7


@pytest.mark.thorough
def test_the_drum_turns_as_far_as_the_displacement_is_magnified(nominal, lifting):
    shown = play_history(lifting, nominal, magnification=20.0)
    assert shown.drum_turn is not None
    np.testing.assert_allclose(shown.drum_turn, 20 * 5.0 * (shown.time - shown.time[0]), rtol=1e-9)
    # Never so far from frame to frame that it would seem to turn back.
    shown = play_history(made_up(nominal, {"Y": 1e-9}), nominal)
    assert shown.drum_turn is not None
    assert np.diff(shown.drum_turn).max() == pytest.approx(np.deg2rad(5) / 3)
    slowing = nominal.with_values({"drum.speed": {"time": [0.0, 0.02], "value": [5.0, 1.0]}})
    shown = play_history(lifting, slowing, start=0.0, end=0.02, magnification=1.0)
    assert shown.drum_turn is not None
    assert shown.drum_turn[-1] == pytest.approx(0.02 * 3.0, rel=1e-9)


def test_a_drum_that_turns_backwards_is_drawn_so(nominal, lifting):
    shown = play_history(lifting, nominal.with_values({"drum.speed": -5.0}), start=0.01, end=0.0123)
    assert shown.drum_sense == -1
    assert shown.drum_turn is not None
    assert (np.diff(shown.drum_turn) < 0).all()
    assert play_history(lifting, nominal, start=0.01, end=0.0123).drum_sense == 1


def test_motion_out_of_the_plane_shows_both_faces():
    scene = load_scene(SCENARIOS / "out_of_plane.toml")
    shown = play_history(made_up(scene, {"Y": 1e-5, "Tx": 2e-4, "Z": 1e-5}), scene)
    assert shown.faces is not None
    front, back = shown.faces
    half = 0.0365 / 2
    turn = np.cos(2 * np.pi * FREQUENCY * shown.time)
    for face, side in ((front, 1), (back, -1)):
        assert face == pytest.approx(side * half)
        middle = moved(np.array([1e3 * float(shown.parts[0].shoe.centroid), 0.0]), shown.parts[0], shown.motion, face)
        np.testing.assert_allclose(middle[:, 1] / 1e3, (1e-5 - side * half * 2e-4) * turn, atol=1e-10)
    assert "Section at mid-width" in shown.notes[-1]
    assert "Z, along the drum's axis, is not drawn" in shown.notes[-1]
    assert [len(lines) for lines in MovingSection(shown)._face_lines] == [2]


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"start": 0.03}, "the history has 0 to 0.02 s"),
        ({"start": 0.01, "end": 0.01}, "is not before --until"),
        ({"start": 0.0, "end": 1.0}, "the history has 0 to 0.02 s"),
        ({"slow": 10.0}, "8 a period are needed"),
        ({"slow": 1e9}, "750 are the most"),
        ({"magnification": 1e6}, "take at most"),
    ],
)
def test_what_cannot_be_shown_is_refused(nominal, lifting, asked, told):
    with pytest.raises(RequestError, match=told):
        play_history(lifting, nominal, **asked)


def test_too_many_periods_no_motion_and_too_few_samples_are_refused(nominal):
    with pytest.raises(RequestError, match="nothing moves"):
        play_history(made_up(nominal, {}), nominal)
    with pytest.raises(RequestError, match="7 samples"):
        play_history(made_up(nominal, {"Y": 1e-6}, samples=7), nominal)
    with pytest.raises(RequestError, match="750 frames show 93"):
        play_history(made_up(nominal, {"Y": 1e-6}, samples=6001), nominal, start=0.0, end=0.12)


# --- a mode ---------------------------------------------------------------------------------------------------------


def test_a_mode_is_played_with_its_phases(nominal, stability):
    mode = next(mode for mode in stability.modes if mode.label == "Y")
    shown = play_mode(nominal, stability, mode)
    assert shown.time.size == 50
    assert 50 * np.diff(shown.time)[0] == pytest.approx(1 / mode.frequency_Hz)  # the loop closes
    # Each coordinate is as large and as late as its part of the eigenvector, seen through its first harmonic.
    motion = np.stack([shown.motion[name] for name in IN_PLANE], axis=1)
    first = 2 * np.mean(motion * np.exp(-2j * np.pi * np.arange(50) / 50)[:, None], axis=0)
    wanted = mode.right[[0, 1, 5]]
    np.testing.assert_allclose(first, wanted, rtol=0, atol=1e-12)
    assert abs(np.angle(wanted[0])) > 1e-3  # X is not in phase
    largest = largest_displacement(shown.parts, shown.motion)
    assert shown.magnification * largest == pytest.approx(0.3 * 0.02)
    assert shown.drum_turn is None
    assert shown.arcs[0].change
    assert np.abs(shown.arcs[0].pressure).max() == 1
    assert f"{mode.frequency_Hz:.6g} Hz" in shown.notes[0]


def test_the_pressure_of_a_mode_follows_the_gap(nominal, stability):
    shown = play_mode(nominal, stability, stability.modes[-1])
    theta = (shown.arcs[0].edges[1:] + shown.arcs[0].edges[:-1]) / 2
    c = float(shown.parts[0].shoe.centroid)
    X, Y, Tz = (shown.motion[name][:, None] for name in IN_PLANE)
    gap = X * np.cos(theta) + (Y - c * Tz) * np.sin(theta)
    np.testing.assert_allclose(shown.arcs[0].pressure, gap / np.abs(gap).max(), rtol=0, atol=1e-9)


def test_a_mode_out_of_the_plane_is_seen_at_the_front_face(nominal, stability):
    mode = next(mode for mode in stability.modes if mode.label == "Tx")
    shown = play_mode(nominal, stability, mode, slow=300)
    assert shown.faces is not None
    assert shown.z == shown.faces[0] == pytest.approx(0.0365 / 2)
    assert np.abs(shown.arcs[0].pressure).max() == 1
    assert shown.time.size == round(300 * 25 / mode.frequency_Hz)


# --- pictures and files ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def section(nominal, lifting):
    return MovingSection(play_history(lifting, nominal, start=0.0185, slow=400))


def test_a_frame_drawn_over_what_stands_still_is_the_whole_figure(section):
    for frame in (0, 7):
        fast = section.image(frame)
        assert fast.shape == (PIXELS[1], PIXELS[0], 3)
        content = BytesIO()
        section.figure.savefig(content, format="png", dpi=section.figure.dpi)  # saving draws everything anew
        whole = np.asarray(Image.open(content).convert("RGB")).astype(int)
        # Saving draws some overlapping lines in another order.
        assert np.mean(np.abs(whole - fast).max(axis=-1) > 30) < 2e-3


def test_the_section_is_seen_with_x_to_the_right_and_the_drum_turning_against_the_clock(section):
    (axes,) = [axes for axes in section.figure.axes if any(text.get_text() == "65°" for text in axes.texts)]
    places = {text.get_text(): text.get_position() for text in axes.texts}
    assert places["65°"][1] > 50 > -50 > places["−65°"][1]  # mm
    assert places["0°"] == pytest.approx((100 + 1.9 * 10, 0), abs=1e-9)
    arrows = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    along_x, along_y, turning = (np.asarray(arrow.get_path().vertices)[[0, 2]] for arrow in arrows)  # ends
    assert along_x[1, 0] > 20
    assert along_y[1, 1] > 20
    assert places["x"][0] > 20
    assert places["y"][1] > 20
    assert np.all(turning[:, 0] < -50)
    assert turning[0, 1] > 0 > turning[1, 1]  # on the left, downwards


def test_no_note_and_no_label_leaves_the_frame_or_overlaps(section):
    from test_figures import outside, overlapping

    assert overlapping(section.figure) == []
    assert outside(section.figure) == []


def test_a_gif_has_all_frames_at_their_rate(section, tmp_path):
    path = tmp_path / "a.gif"
    write_animation(path, section.image, section.frames, 25)
    with Image.open(path) as image:
        assert image.info["loop"] == 0  # for ever
        frames = [(frame.convert("RGB").copy(), frame.info["duration"]) for frame in ImageSequence.Iterator(image)]
    assert len(frames) == section.frames == round(0.0015 * 400 * 25) + 1
    assert {duration for _, duration in frames} == {40}
    for one, other in pairwise(frames):
        assert np.any(np.asarray(one[0]) != np.asarray(other[0]))
    # What is read back is the frame, but for colours of a palette of 256.
    for k in (0, 7, section.frames - 1):
        error = np.abs(np.asarray(frames[k][0]).astype(int) - section.image(k)).max(axis=-1)
        assert np.percentile(error, 99) < 24
    assert [file.name for file in tmp_path.iterdir()] == ["a.gif"]


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="needs ffmpeg")
def test_an_mp4_has_all_frames_at_their_rate(section, tmp_path):
    path = tmp_path / "a.mp4"
    write_animation(path, section.image, section.frames, 25)
    raw = subprocess.run(
        [FFMpegWriter.bin_path(), "-loglevel", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True, check=True,
    ).stdout  # fmt: skip
    frames = np.frombuffer(raw, dtype=np.uint8).reshape(-1, PIXELS[1], PIXELS[0], 3)
    assert len(frames) == section.frames
    # Compressed, the picture is the same but for the edges of colours, which are stored at half the resolution.
    assert np.mean(np.abs(frames[5].astype(int) - section.image(5))) < 4


def test_no_half_of_an_animation_is_left(section, tmp_path):
    def stopped(frame: int):
        if frame > 3:
            raise KeyboardInterrupt
        return section.image(frame)

    there = tmp_path / "there.gif"
    there.write_text("mine")
    for name in ("there.gif", "new.gif", *(["new.mp4"] if FFMpegWriter.isAvailable() else [])):
        with pytest.raises(KeyboardInterrupt):
            write_animation(tmp_path / name, stopped, section.frames, 25)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["mine"]


# --- the command ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def file(nominal, tmp_path_factory):
    """What a run leaves, but for signals that animations do not look at."""
    from drumsqueal.findings.history import SIGNALS

    scene = nominal.with_values({"simulate.duration": 0.02})
    history = made_up(scene, {"Y": LIFTS})
    for name in SIGNALS:
        history[name] = ("time", np.zeros(1001))
    history.attrs |= {"scene": scene.to_toml()}
    path = tmp_path_factory.mktemp("run") / "history.nc"
    history.to_netcdf(path, engine="h5netcdf")
    return path


def test_the_command_writes_a_history_beside_it_and_says_what_it_shows(drumsqueal, file):
    arguments = ("animate", str(file.parent), "--from", "18 ms", "--slow", "400")
    status, printed, errors = drumsqueal(*arguments)
    assert (status, errors) == (0, "")
    assert "18 to 20 ms, 2 periods of" in printed
    assert "at 1/400 of real time" in printed
    assert "magnified" in printed
    with Image.open(file.with_suffix(".gif")) as image:
        assert getattr(image, "n_frames", 0) == 21
        assert image.size == PIXELS
    status, _, errors = drumsqueal(*arguments)
    assert (status, errors.count("\n")) == (2, 1)
    assert "exists; add --overwrite" in errors
    file.with_suffix(".gif").unlink()


def test_ctrl_c_between_two_frames_leaves_what_was_there(drumsqueal, file, tmp_path, monkeypatch):
    draw, shown = MovingSection.image, []

    def pressed(self, frame):
        shown.append(frame)
        if len(shown) == 3:
            signal.raise_signal(signal.SIGINT)
        return draw(self, frame)

    there = tmp_path / "there.gif"
    there.write_text("mine")
    monkeypatch.setattr(MovingSection, "image", pressed)
    status, _, errors = drumsqueal("animate", str(file), "--slow", "500", "-o", str(there), "--overwrite")
    assert status == 1
    assert errors.endswith("interrupted before anything was written\n")
    assert len(shown) == 3
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]


def test_the_command_writes_a_mode(drumsqueal, tmp_path):
    path = tmp_path / "mode.gif"
    scene = str(SCENARIOS / "nominal.toml")
    status, printed, errors = drumsqueal("animate", scene, "--mode", "Tz", "--slow", "2400", "-o", str(path))
    assert (status, errors) == (0, "")
    assert "7398.71 Hz" in printed
    assert printed.endswith(f"Results are in {path}\n")
    with Image.open(path) as image:
        assert getattr(image, "n_frames", 0) == 8  # a period of 7399 Hz, 2400 times slower, takes 0.32 s


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("nowhere.nc",), "there is no such file"),
        ((str(SCENARIOS / "nominal.toml"),), "is a scene: name one of its modes with --mode"),
        ((str(SCENARIOS / "nominal.toml"), "--mode", "Q"), "the scene has no such mode; it has Tx, Ty, Y, X, Tz"),
        ((str(SCENARIOS / "nominal.toml"), "--mode", "Y", "--until", "1 s"), "--until is for histories"),
        (("HISTORY", "-o", "a.webm"), "an animation ends in .gif or .mp4"),
        (("HISTORY", "--slow", "-3"), "write auto, or a positive number"),
        (("HISTORY", "--magnify", "nan"), "write auto, or a positive number"),
        (("HISTORY", "--from", "3 m"), "is not a unit of time"),
        (("HISTORY", "--from", "1 s"), "the history has 0 to 0.02 s"),
        (("HISTORY", "--set", "drum.speed=3"), "--set changes a scene"),
        (("HISTORY", "-o", "no folder/a.gif"), "there is no folder"),
        (("HISTORY", "-o", ""), "the name of the file is empty"),
    ],
)
def test_a_wrong_request_gets_one_line_and_status_2(drumsqueal, file, monkeypatch, tmp_path, arguments, told):
    monkeypatch.chdir(tmp_path)
    status, printed, errors = drumsqueal("animate", *(str(file) if word == "HISTORY" else word for word in arguments))
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert told in errors
    assert list(tmp_path.iterdir()) == []


def test_without_ffmpeg_an_mp4_is_refused(drumsqueal, file, monkeypatch, tmp_path):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
    status, printed, errors = drumsqueal("animate", str(file), "-o", str(tmp_path / "a.mp4"))
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert "save as .gif, or install ffmpeg" in errors


@pytest.fixture
def without_frames(monkeypatch):
    """Animations are empty files."""
    monkeypatch.setattr(animation, "write_animation", lambda path, *_: path.touch())


@pytest.mark.usefixtures("without_frames")
def test_a_mode_of_the_scene_of_a_run_goes_into_its_folder(drumsqueal, file, tmp_path):
    shutil.copy(file, tmp_path / "history.nc")
    status, printed, errors = drumsqueal("animate", str(tmp_path), "--mode", "Tz", "--slow", "2400")
    assert (status, errors) == (0, "")
    assert "7398.71 Hz" in printed
    assert (tmp_path / "mode-Tz.gif").exists()
    assert "exists; add --overwrite" in drumsqueal("animate", str(tmp_path), "--mode", "Tz")[2]
    assert "--set changes a scene" in drumsqueal("animate", str(tmp_path), "--mode", "X", "--set", "drum.speed=3")[2]


@pytest.mark.usefixtures("without_frames")
def test_a_mode_of_a_scene_goes_where_the_results_of_scenes_go(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert drumsqueal("animate", "nominal", "--mode", "Q")[0] == 2
    assert not (tmp_path / "out").exists()
    assert drumsqueal("animate", "nominal", "--mode", "Tz", "--slow", "2400", "--quiet") == (0, "", "")
    assert (tmp_path / "out" / "nominal-Tz.gif").exists()
