"""Figures of made-up histories: they are made whenever they can be, say the right numbers, and no text overlaps."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.text import Text

import drumsqueal as ds
from drumsqueal.errors import COMPLETE, Ending, Outcome
from drumsqueal.files.output_folder import FIGURES, figure_file
from drumsqueal.findings.compare import RelativeChange, SceneAnswer
from drumsqueal.findings.history import SIGNALS
from drumsqueal.findings.verdict import rate_text
from drumsqueal.findings.vibration import Vibration, boundary_ratio
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.questions.cycle.answer import limit_amplitudes
from drumsqueal.questions.effects.answer import draw_effects
from drumsqueal.questions.effects.reductions import reductions_of
from drumsqueal.questions.effects.study import EffectStudy, Variant
from drumsqueal.questions.run.figures import drawings, spectra
from drumsqueal.questions.run.figures.contact import _draw_limit, along_arc
from drumsqueal.questions.run.figures.modes import running
from drumsqueal.questions.run.figures.view import View
from drumsqueal.questions.sweep.answer import draw_chance
from drumsqueal.questions.sweep.figure import draw_amplitude, draw_stability
from drumsqueal.questions.sweep.found import study_chance
from drumsqueal.questions.sweep.points import TRENDS, blank, squealing, to_dataset, undecided
from drumsqueal.scene import COORDINATES
from drumsqueal.scene.plan import Plan, grid, sample
from drumsqueal.scene.variation import read_variation
from drumsqueal.terminal import reply, style
from drumsqueal.terminal.style import label_points, new_figure, save_figure, spread

SCENARIOS = Path(__file__).parents[2] / "scenarios"
ALL = {"growth", "spectrogram", "spectra", "phase", "contact", "eigenvalues"}
RATE = 50_000.0
MOTION = {"X": 1e-8, "Y": 6e-8, "Tz": 5e-7, "Tx": 1e-6, "Ty": 5e-7}  # amplitude of each mode at the start (m, rad)
CASES = {
    "growing": ("nominal", 6000, COMPLETE),
    "stable": ("constant_friction", 2500, COMPLETE),
    "short": ("nominal", 500, COMPLETE),
    "spatial": ("out_of_plane", 2000, COMPLETE),
    "cut off": ("nominal", 40, Outcome(Ending.FAILED, "failed: the step size collapsed")),
    "stopping": ("stop", 5200, Outcome(Ending.FAILED, "failed: the step size collapsed")),
}


@cache
def basis(name: str):
    scene = ds.load_scene(SCENARIOS / f"{name}.toml")
    return scene, ds.build_model(scene), ds.analyse_stability(ds.build_model(scene, coordinates=COORDINATES))


def made_up(name: str, samples: int, outcome: Outcome, title: str | None = None, scale: float = 1.0):
    """Result whose history is the exact linear motion, its amplitude bent over at 100 times the start."""
    scene, model, stability = basis(name)
    scene = scene if title is None else scene.model_copy(update={"title": title})
    time = np.arange(samples) / RATE
    state = np.zeros((samples, 12))
    for mode in stability.modes:
        if mode.name in model.names:
            growth = np.exp(mode.growth_rate * time)
            size = MOTION[mode.name] * growth / np.sqrt(1 + (growth / 200) ** 2)
            state += (size * np.exp(1j * mode.eigenvalue.imag * time))[:, None].real * mode.right.real
            state -= (size * np.exp(1j * mode.eigenvalue.imag * time))[:, None].imag * mode.right.imag
    data = {
        key: (("time", "coordinate"), scale * part)
        for key, part in (("displacement", state[:, :6]), ("velocity", state[:, 6:]))
    }
    signals = {key: ("time", np.full(samples, 0.0 if key in ("sticking", "implicit") else 0.5)) for key in SIGNALS}
    coordinates = {"time": time, "coordinate": list(COORDINATES)}
    history = xarray.Dataset(
        data | signals,
        coordinates,
        {"outcome": outcome, "ending": outcome.ending.value, "steps": 1, "rejected_steps": 0, "scene": scene.to_toml()},
    )
    linear = ds.build_model(scene, coordinates=COORDINATES)
    beyond = boundary_ratio(Vibration(history, stability), linear) >= 1
    history["contact_fraction"].values[:] = np.where(beyond, 0.6, 1.0)
    history["slip_reversed_fraction"].values[:] = np.where(beyond, 0.02, 0.0)
    if name == "stop":  # a spell of it, shortly before the end
        history["sticking"].values[-40:-20] = 1.0
    comparison = ds.compare(history, stability, linear)
    return ds.Result(scene, stability, history, comparison), model


def draw_all(result: ds.Result, model: ds.Model) -> dict[str, Figure]:
    made = {name: draw(None) for name, draw in drawings(result, model).items()}
    return {name: figure for name, figure in made.items() if figure is not None}


@cache
def drawn(case: str):
    result, model = made_up(*CASES[case])
    return result, model, draw_all(result, model)


@cache
def texts(figure: Figure) -> list[tuple[str, np.ndarray]]:
    """Every text that is drawn, with its extents (left, bottom, right, top) in pixels."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    found = [*figure.texts, *(text for legend in figure.legends for text in legend.findobj(Text))]
    for axes in figure.axes:
        of_axis = {id(text) for axis in (axes.xaxis, axes.yaxis) for text in axis.findobj(Text)}
        found += [text for text in axes.findobj(Text) if id(text) not in of_axis]
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            found += [tick.label1 for tick in ticks if low <= tick.get_loc() <= high and tick.label1.get_visible()]
            found += [axis.label, axis.get_offset_text()]
    shown = {id(text): text for text in found if text.get_visible() and text.get_text().strip()}
    # An annotation's own extents would take its leader line in.
    return [(text.get_text(), np.array(Text.get_window_extent(text, renderer).extents)) for text in shown.values()]


def overlapping(figure: Figure) -> list[tuple[str, str]]:
    boxes = texts(figure)
    return [
        (one, other)
        for k, (one, a) in enumerate(boxes)
        for other, b in boxes[:k]
        if np.all(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]) > 0.5)
    ]


def outside(figure: Figure) -> list[str]:
    width, height = figure.bbox.width, figure.bbox.height
    return [text for text, (x0, y0, x1, y1) in texts(figure) if min(x0, y0) < -1 or x1 > width + 1 or y1 > height + 1]


def named(figure: Figure, gid: str) -> list[np.ndarray]:
    """Data (2, points) of the lines of that name."""
    return [np.array(line.get_data()) for axes in figure.axes for line in axes.lines if line.get_gid() == gid]


# --- the effects of a scene -----------------------------------------------------------------------------------------


def made_up_study(title: str, times: list[float]) -> EffectStudy:
    """All reductions there are, with changes from nothing to the loss of a mode, one run failed."""
    scene = basis("out_of_plane")[0].with_values({"title": title, "damping": {"ratio": 0.01}, **PROFILES})
    reductions = reductions_of(scene)
    changes = [
        None,
        *(RelativeChange(0.0, 10.0**power, -(10.0 ** (power - 2)), np.inf) for power in np.linspace(-9, 3, 9)),
    ]
    labels = ["whole scene", "tolerance / 10", *map(str, reductions)]
    answer = SceneAnswer({}, (), {}, (), None, 0.0)
    rows = [
        Variant(label, () if k < 2 else (reductions[k - 2],), scene, Ending.COMPLETE, time, 1.0, answer, change)
        for k, (label, time, change) in enumerate(zip(labels, times, changes, strict=True))
    ]
    rows[-1] = replace(rows[-1], answer=None, change=None, outcome=Ending.FAILED, time_per_ms=np.nan)
    rows.append(replace(rows[0], label="together", reductions=reductions[:3], change=rows[1].change))
    return EffectStudy(
        scene=scene, within=0.01, runs=(), variants=tuple(rows), needed=reductions[2:], spared=reductions[:2]
    )


PROFILES = {
    "drum.speed": {"time": [0, 1], "value": [5, 4]},
    "contact.normal_load": {"time": [0, 1], "value": [2000, 2100]},
}


@pytest.mark.thorough(but=["0.005-title1", "12345.0-Squeal"])
@pytest.mark.parametrize("title", ["Squeal", "A title that is rather long for a figure of this width " * 3])
@pytest.mark.parametrize("slowest", [5e-3, 3.0, 12345.0])
def test_effects_are_drawn_without_overlap(title, slowest):
    study = made_up_study(title, [slowest, *np.geomspace(slowest, slowest / 1e4, 9)])
    figure = draw_effects(study)
    assert overlapping(figure) == []
    assert outside(figure) == []
    bars, changes = figure.axes
    lengths = [bar.get_width() for bar in bars.patches if isinstance(bar, Rectangle)]
    np.testing.assert_allclose(lengths, [0.0 if np.isnan(v.time_per_ms) else v.time_per_ms for v in study.variants])
    assert bars.get_xlim()[0] == 0  # a bar begins at nothing
    bold = [text.get_text() for text in bars.get_yticklabels() if text.get_fontweight() == "bold"]
    assert bold == [str(reduction) for reduction in study.needed]
    # Every change stands at its size, or at the end of the axis beyond it.
    frequency = next(line for line in changes.lines if line.get_label() == "onset frequencies")
    wanted = np.array([v.change.onset_frequency for v in study.variants if v.change is not None], dtype=float)
    np.testing.assert_allclose(np.asarray(frequency.get_xdata()), np.clip(wanted, 1e-6, 1e2))


# --- sweeps ---------------------------------------------------------------------------------------------------------

GRID = (
    "drum.speed=1..20x8",
    "damping.ratio=0..0.01x7",
    "contact.normal_load=1000..3000x5",
    "friction.static=0.4..0.6x3",
)


def made_up_sweep(plan: Plan) -> xarray.Dataset:
    """Y grows at half of the points, and so does its motion at some of these."""
    columns = blank(plan, plan.points)
    growth = np.linspace(-50, 50, plan.points)
    columns["outcome"][:] = 0
    columns["largest_growth_rate"][:] = columns["growth_rate"][:, 0] = growth
    columns["frequency"][:, 0] = columns["main_frequency"][:] = 1400.0 + growth
    columns["mode_coordinate"][:, 0] = columns["main_coordinate"][:] = COORDINATES.index("Y")
    columns["unstable"][:, 0] = columns["squeal"][:] = growth > 0
    columns["separation_ratio"][:] = columns["reversal_ratio"][:] = 2.0
    columns["amplitude"][:] = 1e-6 * np.maximum(growth, 1.0)[:, None]
    columns["trend"][:] = np.where((growth > 0) & (growth < 20), TRENDS.index("grows"), TRENDS.index("settled"))
    columns["settled"][:] = columns["trend"] == TRENDS.index("settled")
    return to_dataset(plan, columns, COMPLETE)


def sweep_plan(*ranges: str) -> Plan:
    scene = basis("nominal")[0].with_values({"damping": {"ratio": 0.005}})
    return grid(scene, [read_variation(text, scene) for text in ranges], transient=True)


@pytest.mark.thorough(but=["2"])
@pytest.mark.parametrize("numbers", [1, 2, 3, 4])
def test_maps_of_a_sweep_have_no_text_that_overlaps(numbers):
    plan = sweep_plan(*GRID[:numbers])
    sweep = made_up_sweep(plan)
    amplitude = draw_amplitude(sweep, plan)
    assert amplitude is not None
    stability = draw_stability(sweep, plan)
    assert "by eigenvalues" in stability.get_suptitle()
    for figure in (stability, amplitude):
        assert overlapping(figure) == []
        assert outside(figure) == []
        if numbers == 4:
            told = [text for text, _ in texts(figure)]
            slices = ("load 1000 N", "load 2000 N", "load 3000 N", "static 0.4", "static 0.5", "static 0.6")
            assert all(any(text.endswith(each) for text in told) for each in slices)


def test_the_scene_itself_is_marked_where_it_is_alone():
    # Its load is 2000 N and its friction 0.5: the middle of nine panels.
    plan = sweep_plan(*GRID)
    figure = draw_stability(made_up_sweep(plan), plan)
    crosses = [[line for line in axes.lines if line.get_marker() == "+"] for axes in figure.axes[:9]]
    assert [len(each) for each in crosses] == [0, 0, 0, 0, 1, 0, 0, 0, 0]
    assert np.array(crosses[4][0].get_data()).ravel().tolist() == [5.0, 0.005]


def test_what_has_not_settled_is_drawn_open():
    speed = read_variation("drum.speed=1..20", basis("nominal")[0], points=None)
    for plan in (sweep_plan("drum.speed=1..20x30"), sample(basis("nominal")[0], [speed], 30, transient=True)):
        sweep = made_up_sweep(plan)
        grows = sweep["settled"].values == 0
        figure = draw_amplitude(sweep, plan)
        assert figure is not None
        assert "open: not settled" in figure.get_suptitle()
        for axes in figure.axes:
            (drawn_open,) = (line for line in axes.lines if line.get_markerfacecolor() == "white")
            assert np.size(drawn_open.get_xdata()) == grows.sum()
            assert any(np.size(line.get_xdata()) == (~grows).sum() for line in axes.lines if line.get_marker() == "o")


def test_dots_of_a_map_are_where_the_motion_has_not_settled():
    plan = sweep_plan("drum.speed=1..20x6", "damping.ratio=0..0.01x4")
    sweep = made_up_sweep(plan)
    speeds, ratios = (sweep[key].values for key in sweep["settled"].dims)
    wanted = {(float(speeds[j]), float(ratios[k])) for j, k in np.argwhere(undecided(sweep))}
    assert wanted
    figure = draw_amplitude(sweep, plan)
    assert figure is not None
    dots = [line for axes in figure.axes for line in axes.lines if line.get_marker() == "o"]
    assert dots
    for line in dots:
        assert {(float(x), float(y)) for x, y in np.asarray(line.get_xydata())} == wanted


def test_the_line_of_what_decays_is_not_drawn():
    plan = sweep_plan("drum.speed=1..20x30")
    sweep = made_up_sweep(plan)
    decays, below = sweep["trend"].copy(), sweep["separation_ratio"].copy()
    decays[:10], below[:5], below[12] = TRENDS.index("decays"), 0.3, 0.3
    settled = sweep["settled"].copy()
    settled[5:10] = 0
    sweep = sweep.assign(trend=decays, settled=settled, separation_ratio=below, reversal_ratio=below)
    # Gone: 5 that decay below the edges, and one that has settled there where no mode grows: it decays, but slowly.
    assert np.flatnonzero(~(squealing(sweep) | undecided(sweep))).tolist() == [0, 1, 2, 3, 4, 12]
    grows = np.flatnonzero(sweep["trend"].values == TRENDS.index("grows")).tolist()
    assert np.flatnonzero(undecided(sweep)).tolist() == [5, 6, 7, 8, 9, *grows]
    assert not squealing(sweep)[grows].any()
    figure = draw_amplitude(sweep, plan)
    assert figure is not None
    frequency = figure.axes[1].lines[0].get_ydata()
    assert np.flatnonzero(np.isnan(np.asarray(frequency))).tolist() == [0, 1, 2, 3, 4, 12]
    decayed = {"trend": decays * 0 + TRENDS.index("decays"), "settled": settled * 0 + 1}
    everything = sweep.assign(decayed | {"separation_ratio": below * 0})
    figure = draw_amplitude(everything.assign(reversal_ratio=below * 0), plan)
    assert figure is not None
    assert len(figure.axes) == 1  # there is no frequency to be drawn


@pytest.mark.parametrize("apart", [False, True])
def test_a_mode_that_nowhere_begins_between_two_points_is_not_in_the_legend_of_a_map(apart):
    plan = sweep_plan("drum.speed=1..20x6", "damping.ratio=0..0.01x4")
    sweep = made_up_sweep(plan)
    growth, coordinate = sweep["growth_rate"].copy(), sweep["mode_coordinate"].copy()
    # Tz decays in one corner; it grows in the one next to it, or in that across.
    for place, rate in (((slice(2), slice(2)), -5.0), ((slice(-2, None) if apart else slice(2, 4), slice(2)), 5.0)):
        growth.values[(*place, 1)] = rate
        coordinate.values[(*place, 1)] = COORDINATES.index("Tz")
    figure = draw_stability(sweep.assign(growth_rate=growth, mode_coordinate=coordinate), plan)
    told = [text for text, _ in texts(figure)]
    assert "boundary of squeal, Re λ = 0" in told
    assert ("mode Tz begins" in told) is not apart


def test_a_map_ends_where_its_values_do():
    plan = sweep_plan("drum.speed=1..20x4", "damping.ratio=0..0.01x3")
    sweep = made_up_sweep(plan)
    for figure in (draw_stability(sweep, plan), draw_amplitude(sweep, plan)):
        assert figure is not None
        assert figure.axes[0].get_xlim() == (1, 20)
        assert figure.axes[0].get_ylim() == (0, 0.01)


# --- what is drawn --------------------------------------------------------------------------------------------------


@pytest.mark.thorough(but=["growing", "stopping"])
@pytest.mark.parametrize("case", ["growing", "stable", "short", "spatial", "stopping"])
def test_every_figure_is_made(case):
    # Only where a motion grows and saturates there is a frequency that drifts, and only where the drum stops a ramp.
    besides = {"growing": {"frequency"}, "stopping": {"waterfall"}}
    assert set(drawn(case)[2]) == ALL | besides.get(case, set())


def test_the_growing_history_saturates():
    assert drawn("growing")[0].findings.saturation is not None
    assert drawn("stable")[0].findings.saturation is None


def test_a_record_too_short_for_a_spectrogram_leaves_it_out():
    assert set(drawn("cut off")[2]) == ALL - {"spectrogram"}


@pytest.mark.thorough(but=["15"])
@pytest.mark.parametrize("samples", [2, 15])
def test_next_to_no_samples_leave_the_eigenvalues(samples):
    assert set(draw_all(*made_up("nominal", samples, Outcome(Ending.FAILED, "failed: early")))) == {"eigenvalues"}


def test_no_motion_leaves_the_eigenvalues():
    assert set(draw_all(*made_up("nominal", 500, COMPLETE, scale=0.0))) == {"eigenvalues"}


def test_figures_are_saved_under_their_names(tmp_path, monkeypatch):
    monkeypatch.setattr(style, "DOTS_PER_INCH", 20)  # which takes less time than 200
    result, model, _ = drawn("growing")
    answer = reply.Answer(words=lambda *_: None, figures=drawings(result, model))
    assert answer.draw(tmp_path, None) == []
    assert {path.name for path in tmp_path.iterdir()} == {figure_file(name) for name in FIGURES}
    for path in tmp_path.iterdir():
        assert path.read_bytes().startswith(b"\x89PNG")


def test_what_comes_over_time_is_drawn_over_time():
    _, _, figures = drawn("growing")
    for name in ("growth", "spectrogram", "contact", "frequency"):
        labels = " ".join(axes.get_xlabel() for axes in figures[name].axes)
        assert "Time (ms)" in labels


def test_no_half_of_a_figure_is_left(tmp_path, monkeypatch):
    def write_half(path: Path, content: bytes) -> None:
        with path.open("wb") as file:
            file.write(content[:1000])
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_bytes", write_half)
    with pytest.raises(KeyboardInterrupt):
        save_figure(drawn("growing")[2]["phase"], tmp_path / "phase.png")
    assert list(tmp_path.iterdir()) == []


def test_drawing_leaves_the_global_settings_alone():
    before = dict(matplotlib.rcParams)
    draw_all(*made_up("nominal", 40, COMPLETE))
    assert dict(matplotlib.rcParams) == before


# --- text -----------------------------------------------------------------------------------------------------------


QUICK = [*(f"{case}-{name}" for case in ("growing", "stopping") for name in ALL), "spatial-contact", "cut off-spectra"]


@pytest.mark.thorough(but=QUICK)
@pytest.mark.parametrize("name", sorted(ALL))
@pytest.mark.parametrize("case", sorted(CASES))
def test_no_text_overlaps_or_leaves_the_figure(case, name):
    figure = drawn(case)[2].get(name)
    if figure is None:
        assert (case, name) == ("cut off", "spectrogram")
        return
    assert len(texts(figure)) > 8
    assert overlapping(figure) == []
    assert outside(figure) == []


@pytest.mark.thorough(but=["title2"])  # that of a formula which is none stands with letters that the font lacks
@pytest.mark.parametrize("title", ["", "W" * 1000, "a costly $brake\n\t$ " * 20, r"$\frac{"])
def test_any_title_fits(title):
    figures = draw_all(*made_up("nominal", 40, COMPLETE, title=title))
    for figure in figures.values():
        assert outside(figure) == []
        assert overlapping(figure) == []


@pytest.mark.thorough
@pytest.mark.parametrize(
    "brake", ["Truck simplex 410x180: leading shoe", "Simplex 410 x 180, lining batch 17, worn drum"]
)
def test_a_name_that_leaves_no_room_for_what_is_shown_stands_whole_on_a_line_of_its_own(brake):
    subject = "probability of squeal by eigenvalues 100.0 % (98.7 to 100.0 % at 95 %), 1000 samples"
    figure = new_figure(brake, subject)
    assert figure.get_suptitle() == f"{brake}:\n{subject}"
    assert outside(figure) == []
    assert new_figure(brake, "growth").get_suptitle() == f"{brake}: growth"


def test_a_name_longer_than_a_line_keeps_its_end_which_names_the_shoe():
    title = new_figure("A truck brake of a rather long name " * 6 + ": trailing shoe", "growth").get_suptitle()
    assert title.startswith("A truck brake of a rather long name A truck")
    assert title.endswith(": trailing shoe:\ngrowth")
    assert "…" in title


@pytest.mark.parametrize("rates", [(-179.5, 23.2, 83.8, -5.4), (-20.0, 20.0), (-1.0, -400.0, 300.0), (5.0, -2.0)])
def test_labels_of_eigenvalues_stay_on_the_side_of_zero_that_they_are_on(rates):
    """Where a label reaches into the other half, it seems to be a mode of the other kind."""
    figure = new_figure("Brake", "eigenvalues")
    _, axes = figure.subplots(1, 2)
    width = np.ptp([0.0, *rates])
    axes.set_xlim(min(0.0, *rates) - 0.7 * width, max(0.0, *rates) + 0.7 * width)
    axes.set_ylim(0, 5)
    points = [(rate, 1.0 + k, f"Ty: 1102 Hz, {rate} 1/s", "k") for k, rate in enumerate(rates)]
    made = label_points(axes, points, [])
    assert overlapping(figure) == []  # which draws it
    zero = axes.transData.transform((0.0, 0.0))[0]
    for label in made:
        box = Text.get_window_extent(label)
        assert box.x1 < zero if label.xy[0] < 0 else box.x0 > zero


@pytest.mark.parametrize("slope", [0.0, 0.4, -0.4])
def test_labels_of_points_keep_clear_of_the_lines_in_the_axes(slope):
    figure = new_figure("Brake", "modes")
    axes = figure.subplots()
    x = np.linspace(0.5, 10, 20)
    for height in (2.0, 8.0):  # a line goes on to the right of its point's label, and another one passes below it
        axes.plot(x, height + slope * (x - 5), "o-")
    axes.plot(x, np.where(x < 5, 6.0, np.nan))
    axes.set_xlim(0, 11)
    axes.set_ylim(0, 10)
    points = [(5.0, 2.0, "E14 (2)", "k"), (x[8], 6.0, "E12", "k"), (x[-1], 8 + slope * 5, "E9", "k")]
    made = label_points(axes, points, [])
    assert overlapping(figure) == []
    for label in made:
        box = Text.get_window_extent(label)
        for line in axes.lines:
            fine = np.linspace(0, 11, 2001)
            data = np.column_stack([fine, np.interp(fine, *np.transpose(line.get_xydata()), left=np.nan, right=np.nan)])
            drawn_at = axes.transData.transform(data)
            assert not any(box.contains(*place) for place in drawn_at[np.isfinite(drawn_at).all(axis=1)])


@pytest.mark.parametrize(
    ("rate", "shown"),
    # As many digits of each, whatever they end in: "+83.8" beside "+83.79" looks like a coarser number.
    [(83.797, "+83.80"), (-5.4, "−5.400"), (1234.4, "+1234"), (100.0, "+100.0"), (0.05, "+0.05000"), (1e-9, "0")],
)
def test_a_growth_rate_has_four_digits(rate, shown):
    assert rate_text(rate, 1000.0) == shown


def test_pressure_over_its_mean_has_no_unit():
    figures = {case: drawn(case)[2]["contact"] for case in ("growing", "stable")}
    labels = {case: figure.axes[-1].get_ylabel() for case, figure in figures.items()}
    assert labels["growing"] == "Pressure over steady pressure p₀"
    assert labels["stable"].startswith("Pressure over steady pressure p₀, less 1")


def test_modes_of_one_frequency_do_not_hide_each_other_in_the_histogram():
    plan = sample(basis("nominal")[0], [read_variation("drum.speed=1..20", basis("nominal")[0], points=None)], 40)
    columns = blank(plan, plan.points)
    columns["outcome"][:], columns["squeal"][:], columns["largest_growth_rate"][:] = 0, 1, np.linspace(1, 50, 40)
    for rank, name in enumerate(("X", "Y")):
        columns["growth_rate"][:, rank], columns["unstable"][:, rank] = 10.0, 1
        columns["frequency"][:, rank] = np.linspace(1000, 1100, 40)
        columns["mode_number"][:, rank], columns["mode_coordinate"][:, rank] = rank, COORDINATES.index(name)
    sweep = to_dataset(plan, columns, COMPLETE)
    chances = study_chance(sweep)
    assert chances is not None
    bars = [each for each in draw_chance(sweep, plan, chances).axes[1].patches if isinstance(each, Rectangle)]
    places = {(bar.get_x(), bar.get_y()) for bar in bars if bar.get_height() > 0}
    assert len(places) == sum(bar.get_height() > 0 for bar in bars)  # none begins where another does
    assert sum(bar.get_height() for bar in bars) == pytest.approx(200)  # per cent: each mode in every sample


def test_letters_that_the_font_lacks_become_boxes_without_a_warning(tmp_path, monkeypatch):
    monkeypatch.setattr(style, "DOTS_PER_INCH", 20)  # which takes less time than 200
    figures = draw_all(*made_up("nominal", 40, COMPLETE, title="制动 μ 🚗 $\\frac{"))
    for name, figure in figures.items():
        save_figure(figure, tmp_path / figure_file(name))
    for figure in figures.values():
        assert figure.get_suptitle().startswith("□□ μ □ $\\frac{: ")


def test_an_incomplete_run_is_called_so():
    for figure in drawn("stopping")[2].values():
        assert "incomplete run" in figure.get_suptitle()
    for figure in drawn("growing")[2].values():
        assert "incomplete" not in figure.get_suptitle()


@given(st.lists(st.floats(-1, 2), min_size=1, max_size=12), st.floats(0.001, 0.3))
@settings(derandomize=True)
def test_labels_are_spread_in_order_within_their_limits(positions, gap):
    placed = spread(positions, gap, 0.0, 1.0)
    fits = min(gap, 1.0 / max(len(positions) - 1, 1))
    order = np.argsort(positions, kind="stable")
    assert placed.min() >= -1e-12
    assert placed.max() <= 1 + 1e-12
    assert np.all(np.diff(placed[order]) >= fits - 1e-12)


def test_labels_that_are_far_apart_stay_where_they_are():
    np.testing.assert_allclose(spread([0.9, 0.1, 0.5], 0.2, 0.0, 1.0), [0.9, 0.1, 0.5])
    np.testing.assert_allclose(spread([0.5, 0.5], 0.2, 0.0, 1.0), [0.4, 0.6])


# --- numbers --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [False, True])
def test_speeds_of_which_a_waterfall_has_no_spectrum_are_named(monkeypatch, gap):
    words = spectra.way_words
    within = (4.0, 4.5) if gap else (0.0, 0.0)  # rad/s, at which the drum does not become slower
    monkeypatch.setattr(
        spectra, "way_words",
        lambda instant, keys: "steady" if within[0] < instant.value(keys[0]) < within[1] else words(instant, keys),
    )  # fmt: skip
    result, model, _ = drawn("stopping")
    figure = drawings(result, model)["waterfall"](None)
    assert figure is not None
    assert any(text == "no spectrum" for text, _ in texts(figure)) is gap
    picture = figure.axes[0].images[0]
    missing, (left, right, *_) = np.ma.getmaskarray(np.ma.asarray(picture.get_array()))[0], picture.get_extent()
    speeds = np.linspace(left, right, 2 * missing.size + 1)[1::2]
    # Windows are 0.03 rad/s or so apart.
    assert missing[(speeds > within[0] + 0.1) & (speeds < within[1] - 0.1)].all()
    assert not missing[(speeds < within[0] - 0.1) | (speeds > within[1] + 0.1)].any()


@pytest.mark.thorough(but=["growing", "stable"])
@pytest.mark.parametrize("case", ["growing", "stable", "spatial"])
def test_predicted_lines_are_at_the_eigenvalues(case):
    result, model, figures = drawn(case)
    for mode in result.stability.modes:
        lines = named(figures["spectra"], f"predicted {mode.name}")
        levels = named(figures["spectrogram"], f"predicted {mode.name}")
        points = named(figures["eigenvalues"], f"predicted {mode.name}")
        assert bool(lines) == bool(levels) == (mode.name in model.names)
        assert points
        for line in lines:
            np.testing.assert_allclose(line[0], mode.eigenvalue.imag / (2e3 * np.pi))
        for line in levels:
            np.testing.assert_allclose(line[1], mode.eigenvalue.imag / (2e3 * np.pi))
        for point in points:
            np.testing.assert_allclose(
                point[:, 0],
                [mode.eigenvalue.real, mode.eigenvalue.imag / (2e3 * np.pi)],
            )


def test_campbell_lines_follow_the_speed():
    result, model, figures = drawn("stopping")
    ramp = result.findings.ramp
    assert ramp is not None
    assert {"spectrogram", "waterfall"} <= set(figures)
    for line in ramp.lines:
        (over_time,) = named(figures["spectrogram"], f"predicted {line.mode}")
        (over_speed,) = named(figures["waterfall"], f"predicted {line.mode}")
        np.testing.assert_allclose(over_time[1], np.array(line.frequency_Hz) / 1e3)
        # From 5 rad/s at t = 0 by 50/3 rad/s² down, in the order of the speeds.
        np.testing.assert_allclose(over_speed[0], 5 - np.array(line.time_s[::-1]) / 0.06)
        np.testing.assert_allclose(over_speed[1], np.array(line.frequency_Hz[::-1]) / 1e3)
    (unstable,) = named(figures["waterfall"], "unstable Y")
    assert np.isfinite(unstable[1]).all()
    assert not named(figures["waterfall"], "unstable X")
    assert "waterfall" not in drawn("growing")[2]
    assert model.names == ("X", "Y", "Tz")


@pytest.mark.thorough(but=["growing", "stable"])
@pytest.mark.parametrize("case", ["growing", "stable", "spatial"])
def test_dashed_slope_is_the_predicted_growth_through_the_start(case):
    result, _, figures = drawn(case)
    for mode in result.stability.modes:
        for line in named(figures["growth"], f"predicted {mode.name}"):
            milliseconds, micrometres = line
            slope = np.log(micrometres[1] / micrometres[0]) / (milliseconds[1] - milliseconds[0]) * 1e3
            assert slope == pytest.approx(mode.growth_rate, rel=1e-9, abs=1e-8)
            scale = 1e6 * (0.1 if mode.name.startswith("T") else 1.0)
            # The made-up motion falls short of the exponential by half of (1/200)², and more as it grows.
            assert micrometres[0] == pytest.approx(scale * MOTION[mode.name], rel=2e-3)


def test_the_main_line_is_marked_at_its_frequency_and_named():
    result, _, figures = drawn("growing")
    assert result.findings.saturation is not None
    main = result.findings.saturation.main
    assert main is not None
    (marker,) = named(figures["spectra"], "main line")
    assert marker[0] == pytest.approx([main.frequency_Hz / 1e3])
    assert any(f"▼ {main.frequency_Hz:.0f} Hz" in text for text, _ in texts(figures["spectra"]))


def test_spectra_show_the_same_coordinates_and_the_frequency_its_own_range():
    result, _, figures = drawn("growing")
    rows = figures["spectra"].axes
    first, last = ([line.get_label() for line in axes.lines if line.get_linestyle() == "-"] for axes in rows)
    assert first == last
    assert any("resolution 51 Hz" in text for text, _ in texts(figures["spectra"]))
    drift = result.findings.frequency
    assert drift is not None
    low, high = figures["frequency"].axes[0].get_ylim()
    assert (
        drift.predicted_by_root_of_contact_share_Hz < low < drift.predicted_by_contact_loss_Hz < drift.onset_Hz < high
    )
    crude = f"outside the frame: {drift.predicted_by_root_of_contact_share_Hz:.0f} Hz"
    assert any(text.startswith(crude) for text, _ in texts(figures["frequency"]))


def test_the_slip_limit_is_a_band_where_the_drum_turns_slower_in_between():
    operation = Operation(PiecewiseLinear([0.0, 0.1, 0.2], [5.0, 3.0, 5.0]), Constant(0.0))
    view: Any = SimpleNamespace(
        radius=0.1, time=np.linspace(0.0, 0.2, 101), model=SimpleNamespace(operation=operation)
    )  # fmt: skip
    axes = Figure().subplots()
    _draw_limit(view, axes, slice(None), 0.4)
    assert axes.get_legend_handles_labels()[1] == ["slip limit RΩ, 0.3 to 0.5 m/s"]
    (band,) = axes.patches
    corners = band.get_transform().transform(band.get_path().vertices)
    assert sorted({round(float(y), 9) for _, y in axes.transData.inverted().transform(corners)}) == [0.3, 0.5]


def test_phase_portrait_ends_where_the_record_ends():
    result, model, figures = drawn("growing")
    c = float(model.shoe.centroid)
    displacement, velocity = (result.history[key].values[-1] for key in ("displacement", "velocity"))
    line = next(line for line in figures["phase"].axes[0].lines if str(line.get_label()).endswith("ms"))
    expected = [1e6 * (displacement[1] + (0.1 - c) * displacement[5]), velocity[1] + (0.1 - c) * velocity[5]]
    np.testing.assert_allclose(np.array(line.get_data())[:, -1], expected, rtol=1e-9)


@pytest.mark.parametrize("case", ["growing", "stable"])
def test_contact_image_is_the_pressure_along_the_arc(case):
    result, model, figures = drawn(case)
    axes = figures["contact"].axes[0]
    image = np.asarray(axes.images[0].get_array())
    last = result.history.isel(time=-1)
    kept = list(model.names)
    q, v = (jnp.asarray(last[key].sel(coordinate=kept).values) for key in ("displacement", "velocity"))
    angles = np.deg2rad(np.linspace(-65, 65, len(image)))
    pressure, _ = model.lining.along_arc(model.operation.at(float(last["time"])), q, v, jnp.asarray(angles))
    p0 = 2000 / (0.1 * np.deg2rad(130) * 0.0365)
    touching = np.asarray(pressure) > 0
    shown = image[:, -1] if case == "growing" else 1 + image[:, -1]
    np.testing.assert_allclose(shown[touching], np.asarray(pressure)[touching] / p0, rtol=1e-6)
    np.testing.assert_allclose(axes.images[0].get_extent()[2:], [-65, 65])


def test_a_lining_that_sticks_is_marked():
    figures = drawn("stopping")[2]
    assert any(text == "sticks as a whole" for text, _ in texts(figures["contact"]))
    assert any(text == "sticks" for text, _ in texts(figures["growth"]))
    assert not any("sticks" in text for name in ("contact", "growth") for text, _ in texts(drawn("growing")[2][name]))


def test_the_band_over_three_periods_of_a_periodic_motion_does_not_beat():
    """Slip is reversed for a tenth of a period, and the modulus dips to 0.01; a period has 47.05 samples."""
    rate, frequency = 47.05, 1.0
    time = np.arange(20_000) / rate
    view = cast(View, SimpleNamespace(main_frequency=frequency, vibration=SimpleNamespace(sample_rate=rate), time=time))
    phase = time * frequency % 1
    reversed_slip = np.maximum(0.0, 1 - np.abs(phase - 0.5) / 0.05)
    _, low, _, high = running(view, reversed_slip, slice(None))
    # Three periods have a sample within 1/3 of an interval (0.0071 of a period) of the peak, whose slope is 20.
    assert (low.min(), low.max()) == (0.0, 0.0)
    assert np.ptp(high) < 20 / rate / 2
    dips = np.exp(2j * np.pi * 5 * time) + 0.99 * np.exp(-2j * np.pi * 2 * time)
    _, low, mean, high = running(view, dips, slice(None))
    # Eight points a sample: the modulus, of slope 2π 7, is missed by a sixteenth of an interval at most.
    assert low.max() < 0.01 + 2 * np.pi * 7 / rate / 16
    assert np.ptp(high) < 1e-3
    # A window is three periods to within an interval, one of 141, in which the modulus is 2 at the most.
    assert np.ptp(mean) < 2 / 141


@pytest.mark.parametrize(
    ("amplitudes", "scale"), [([100.0, 120.0], "linear"), ([], "linear"), ([0.3, 16.0, 250.0], "log")]
)
def test_amplitudes_that_lie_far_apart_are_told_apart_and_none_lies_on_zero(amplitudes, scale):
    axes = Figure().subplots()
    rest = limit_amplitudes(axes, amplitudes, 0.25)
    low, high = axes.get_ylim()
    assert axes.get_yscale() == scale
    assert rest == low
    assert all(low < each < high for each in amplitudes)
    if scale == "log":
        labels = dict(
            zip(axes.get_yticks().tolist(), [text.get_text() for text in axes.get_yticklabels()], strict=True)
        )
        assert labels[rest] == "0"
        assert min(amplitudes) >= 2 * rest


@pytest.mark.parametrize("speed", [5.0, -5.0])
def test_contact_is_drawn_with_the_slip_in_the_sense_of_the_drum(nominal, speed):
    # At rest the lining slips by RΩ against the drum whichever way that turns; X of −0.1 µm presses by k_c X cos θ.
    model, angles = ds.build_model(nominal.with_values({"drum.speed": speed})), jnp.array([-1.0, 0.0, 0.5])
    motion = jnp.zeros((1, 6)).at[0, model.names.index("X")].set(-1e-7)
    level, slip, preload = along_arc(model, jnp.zeros(1), motion, angles)
    np.testing.assert_allclose(slip, np.full((1, 3), -0.1 * 5.0), rtol=1e-12)
    wanted = float(preload[0]) - nominal.contact.stiffness * 1e-7 * np.cos([-1.0, 0.0, 0.5])
    np.testing.assert_allclose(level, [wanted], rtol=1e-12)
