"""Histories, exports, sweeps and figures of a body with more coordinates than a rigid shoe: names decide, not places.

The free modes are made up: what is tested is that all that is told of them stands under their names.
"""

import csv
from typing import Any, cast

import numpy as np
import pytest
import xarray
from matplotlib.text import Annotation

from drumsqueal.errors import COMPLETE
from drumsqueal.files.history_file import read_history
from drumsqueal.files.output_folder import find_format
from drumsqueal.findings.history import to_dataset
from drumsqueal.findings.vibration import Vibration
from drumsqueal.physics import composition
from drumsqueal.physics.composition import coordinates_of, kept_coordinates, linear_coordinates, plane_of
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.inventory import take_inventory
from drumsqueal.questions.effects.reductions import reduce, reductions_of
from drumsqueal.questions.export.export import Part, export_history
from drumsqueal.questions.export.signals import make_channels
from drumsqueal.questions.sweep import points
from drumsqueal.questions.sweep.answer import draw_chance
from drumsqueal.questions.sweep.figure import draw_stability, modes_along
from drumsqueal.questions.sweep.found import study_chance, summarise
from drumsqueal.scene import COORDINATES
from drumsqueal.scene.plan import grid, sample
from drumsqueal.scene.variation import read_variation
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.terminal import style
from test_figures import outside, overlapping

FREE = tuple(f"E{k}" for k in range(1, 13))
SYMMETRIC = FREE[::2]


@pytest.fixture
def bending(nominal, monkeypatch):
    """A scene whose shoe is said to have twelve free modes."""
    monkeypatch.setattr(composition, "elastic_names", lambda _, *, symmetric=False: SYMMETRIC if symmetric else FREE)
    return nominal


def test_what_a_scene_keeps_goes_by_all_names_of_its_body(bending):
    plane = ("X", "Y", "Tz", *SYMMETRIC)
    assert coordinates_of(bending) == linear_coordinates(bending) == (*COORDINATES, *FREE)
    assert kept_coordinates(bending) == plane_of(bending) == plane
    tilted = bending.with_values({"start.displacement.Tx": 1e-7})
    assert kept_coordinates(tilted) == (*COORDINATES, *FREE)
    (left_out, *_) = take_inventory(bending).leaves_out
    assert left_out == f"coordinates Z, Tx, Ty, {', '.join(FREE[1::2])} (nothing moves them)"
    space = next(each for each in reductions_of(tilted) if each.effect == "space")
    assert kept_coordinates(reduce(tilted, [space])) == plane


# --- histories ------------------------------------------------------------------------------------------------------


def made_up_chunk(scene, kept):
    """The displacement of each coordinate is its place among those kept, to begin with; the velocity ten times it."""
    time = np.arange(20) / scene.simulate.sample_rate
    ones, moved = cast("Any", np.ones(20)), np.arange(1.0, len(kept) + 1) * (1 + time)[:, None]
    observed = Observation.of_rows([ones] * Observation.width(1))
    return Chunk(time, moved, 10 * moved, observed, ones, ones, ones, 1, 0, 1.0, ones, None)


@pytest.fixture
def saved(bending, tmp_path):
    kept = kept_coordinates(bending)
    data = to_dataset([made_up_chunk(bending, kept)], bending, kept, COMPLETE)
    data.to_netcdf(tmp_path / "history.nc", engine="h5netcdf")
    return read_history(tmp_path / "history.nc")


def test_a_history_has_the_rigid_coordinates_first_and_all_free_modes_behind(saved):
    assert saved.coordinates == (*COORDINATES, *FREE)
    at_first = dict(zip(saved.coordinates, saved.data["displacement"].values[0].tolist(), strict=True))
    kept = ("X", "Y", "Tz", *SYMMETRIC)
    assert at_first == {name: kept.index(name) + 1.0 if name in kept else 0.0 for name in saved.coordinates}
    assert saved.data["velocity"].attrs["units"] == "m/s (X, Y, Z), rad/s (Tx, Ty, Tz), m kg^0.5/s (E1 to E12)"


@pytest.mark.parametrize("names", [("E1", *COORDINATES), (*COORDINATES, "E2", "E1"), (*COORDINATES[:5], "E1")])
def test_a_history_in_another_order_is_none(saved, names, tmp_path):
    other = saved.data.isel(coordinate=slice(len(names))).assign_coords(coordinate=list(names))
    other.to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(Exception, match="this is not a history of drumsqueal"):
        read_history(tmp_path / "other.nc")


def test_free_modes_go_out_under_their_names_and_with_their_units(saved, tmp_path):
    part = Part(("displacement", "velocity_E3", "velocity_E2"))
    done = export_history(saved, tmp_path / "out.csv", find_format("csv"), part)
    assert done.signals["displacement_E11"] == "m kg^0.5"
    assert done.signals["velocity_E3"] == "m kg^0.5/s"
    with (tmp_path / "out.csv").open() as file:
        heading, first, *_ = csv.reader(file)
    row = dict(zip(heading, map(float, first), strict=True))
    assert row["displacement_E3 (m kg^0.5)"] == 5.0
    assert row["velocity_E3 (m kg^0.5/s)"] == 50.0
    assert row["velocity_E2 (m kg^0.5/s)"] == 0.0  # rests, and comes where it is asked for by name
    (channel,) = make_channels(saved, ["displacement_E3"], slice(None))
    assert (channel.point, channel.direction) == (0, 0)  # of a universal file: of no point, and no length
    assert channel.quantity != "displacement"
    with pytest.raises(Exception, match="displacement_E13: there is no such signal"):
        export_history(saved, tmp_path / "none.csv", find_format("csv"), Part(("displacement_E13",)))


# --- sweeps ---------------------------------------------------------------------------------------------------------


def made_up_sweep(plan):
    """Modes of which each grows more than the one before, the last five at every point; each with its own frequency."""
    names, columns = points.names_of(plan), points.blank(plan, plan.points)
    rank = np.arange(len(names))
    columns["growth_rate"][:] = rank - 12.5
    columns["frequency"][:] = 1000.0 + 500 * rank
    columns["mode_coordinate"][:] = rank
    columns["unstable"][:] = rank > 12.5
    columns["largest_growth_rate"][:] = rank[-1] - 12.5
    columns["squeal"][:], columns["outcome"][:], columns["divergence_rate"][:] = 1, 0, 0.0
    return points.to_dataset(plan, columns, COMPLETE)


def test_a_sweep_counts_modes_by_the_names_of_its_scenes(bending):
    plan = grid(bending, [read_variation("drum.speed=1..20x4", bending)], transient=True)
    sweep = made_up_sweep(plan)
    assert points.names_in(sweep) == points.names_in(sweep, "main_coordinate") == (*COORDINATES, *FREE)
    assert sweep["amplitude"].attrs["units"].endswith("m kg^0.5 (E1 to E12)")
    assert sweep["amplitude"].sizes["coordinate"] == sweep.sizes["mode"] == 18
    sweep = made_up_sweep(grid(bending, plan.variations))
    modes = summarise(sweep, grid(bending, plan.variations)).modes
    assert {name: mode.frequency_there_Hz for name, mode in modes.items()} == {
        name: 1000.0 + 500 * place for place, name in enumerate((*COORDINATES, *FREE)) if place > 12.5
    }


@pytest.mark.parametrize("apart", ["mode_in_plane", "mode_number"])
def test_lines_do_not_join_modes_of_other_planes_or_shapes(bending, apart):
    """Two modes of one name cross within the first step: by eigenvalues alone each would take the other's line."""
    variation = read_variation("drum.speed=1..4x4", bending)
    plan = grid(bending, [variation])
    sweep = made_up_sweep(plan)
    for field, value in (
        ("frequency", np.nan),
        ("growth_rate", np.nan),
        ("mode_coordinate", -1),
        ("mode_in_plane", -1),
    ):
        sweep[field][:] = value
    hertz = ((5900.0, 6100.0, 6300.0, 6500.0), (6100.0, 5900.0, 5700.0, 5500.0))
    for rank, values in enumerate(hertz):
        sweep["frequency"][:, rank], sweep["growth_rate"][:, rank] = np.array(values), 4.0 - 8 * rank
        sweep["mode_coordinate"][:, rank] = points.names_in(sweep).index("E3")
        sweep[apart][:, rank] = 1 - rank
    _, lower = draw_stability(sweep, plan).axes
    drawn = {tuple(np.round(np.asarray(line.get_ydata(), float), 6)) for line in lower.lines}
    assert set(hertz) <= drawn


@pytest.mark.parametrize(
    ("hertz", "shapes", "lines"),
    [
        # Shapes change places while nothing else does: the numbers of both stand, at the points before, too.
        ([[100, 110]] * 4, [[0, 1], [0, 1], [-1, -1], [1, 0]], [(100, 100, 100, 110), (110, 110, 110, 100)]),
        # A mode of no known shape gets the number of a shape that is there at the same point, at once or afterwards.
        ([[100, None], [100, None], [100, 400]], [[0, -1], [-1, -1], [-1, 0]], [(100, 100, 400), (None, None, 100)]),
        ([[100, 200], [100, 200]], [[-1, 0], [0, -1]], [(200, 100), (100, None), (None, 200)]),
        # One that is joined to a shape later on is of this shape all along.
        ([[100, 200], [100, 200]], [[-1, 1], [0, 1]], [(100, 100), (200, 200)]),
    ],
)
def test_every_eigenvalue_of_a_sweep_is_on_one_line(hertz, shapes, lines):
    frequency = np.array(hertz, float)
    named = np.where(np.isfinite(frequency), 0, -1)
    columns = {"frequency": frequency, "growth_rate": 0 * frequency, "mode_number": np.array(shapes)}
    columns |= {"mode_coordinate": named, "mode_in_plane": named - 1}
    sweep = xarray.Dataset({name: (("speed", "mode"), values) for name, values in columns.items()})
    sweep["mode_coordinate"].attrs["flag_meanings"] = "none X"
    found = [eigenvalues.imag / (2 * np.pi) for _, eigenvalues in modes_along(sweep)]
    wanted = np.array(lines, float)
    # A rounding of 2 π.
    assert sorted(map(str, np.round(found, 9).tolist())) == sorted(map(str, wanted.tolist()))


def test_lines_of_modes_end_where_the_modes_do_and_names_tell_neighbours_apart(bending):
    """X and E1 cross within the first step, where eigenvalues alone join them the wrong way; E3 is there at two points.

    Without its ending the line of E3 would go on at 0 Hz, or to what is left over.
    """
    variation = read_variation("drum.speed=1..4x4", bending)
    plan = grid(bending, [variation])
    sweep = made_up_sweep(plan)
    names = points.names_in(sweep)
    hertz = {"X": (6040, 5780, 5540, 5300), "E1": (5920, 6090, 6250, 6400), "E3": (9000, 9500, np.nan, np.nan)}
    for field, value in (("frequency", np.nan), ("growth_rate", np.nan), ("mode_coordinate", -1)):
        sweep[field][:] = value
    for rank, (name, values) in enumerate(hertz.items()):
        sweep["frequency"][:, rank] = np.array(values)
        sweep["growth_rate"][:, rank] = np.where(np.isnan(values), np.nan, 4.0 if name == "X" else -600.0)
        sweep["mode_coordinate"][:, rank] = np.where(np.isnan(values), -1, names.index(name))
    upper, lower = draw_stability(sweep, plan).axes
    lines = {line: np.asarray(line.get_ydata(), float) for line in lower.lines if line.get_linewidth() < 1}
    for name, values in hertz.items():
        (line,) = (line for line, drawn in lines.items() if abs(drawn[0] - values[0]) < 1)
        np.testing.assert_allclose(lines[line], values, rtol=1e-12)
        assert line.get_color() == style.COLOUR[name]
    assert {text.get_text() for text in upper.texts} == {"X"}  # the others decay faster than the axis shows
    (ended,) = (cast("Annotation", text) for text in lower.texts if text.get_text() == "E3")
    assert ended.xy == pytest.approx((2.0, 9500.0))


def test_a_file_counts_as_many_coordinates_as_a_whole_brake_has(nominal, monkeypatch):
    many = tuple(f"E{k}" for k in range(1, 301))
    monkeypatch.setattr(composition, "elastic_names", lambda _, *, symmetric=False: many)
    plan = grid(nominal, [read_variation("drum.speed=1..4x4", nominal)], transient=True)
    columns = points.blank(plan, 4)
    last = len(COORDINATES) + len(many) - 1
    columns["main_coordinate"][:] = columns["mode_coordinate"][:] = last
    sweep = points.to_dataset(plan, columns, COMPLETE)
    assert {int(sweep[name].values.max()) for name in ("mode", "mode_coordinate", "main_coordinate")} == {last}
    flags = sweep["mode_coordinate"].attrs["flag_values"]
    assert (flags[-1], flags.dtype) == (last, sweep["mode_coordinate"].dtype)


def test_figures_of_many_modes_name_them(bending):
    variation = read_variation("drum.speed=1..20x40", bending)
    plan = grid(bending, [variation])
    figure = draw_stability(made_up_sweep(plan), plan)
    upper, lower = figure.axes
    assert [text.get_text() for text in lower.texts] == [*COORDINATES, *FREE]
    assert len({line.get_color() for line in upper.lines}) > 12
    random = sample(bending, [variation], 40)
    sweep = made_up_sweep(random)
    sweep["unstable"][:] = 1
    chances = study_chance(sweep)
    assert chances is not None
    for drawn in (figure, draw_chance(sweep, random, chances)):
        assert overlapping(drawn) == []
        assert outside(drawn) == []


def test_of_more_modes_than_there_is_room_for_the_least_stable_are_named(bending, monkeypatch):
    """Two more free modes than have room, three modes of the largest coordinate E12; the last of all ends early."""
    free = tuple(f"E{k}" for k in range(1, 15))
    monkeypatch.setattr(composition, "elastic_names", lambda _, *, symmetric=False: free)
    plan = grid(bending, [read_variation("drum.speed=1..20x4", bending)])
    sweep = made_up_sweep(plan)
    names = points.names_in(sweep)
    sweep["mode_coordinate"][:, -2:] = names.index("E12")
    for field in ("frequency", "growth_rate"):
        sweep[field][2:, -1] = np.nan
    figure = draw_stability(sweep, plan)
    _, lower = figure.axes
    shown = [*names[-12:-2], "E12 (2)", "E12 (3)"]
    assert [text.get_text() for text in lower.texts] == shown
    assert "the 12 least stable modes" in lower.get_title(loc="left")
    assert len({cast("Annotation", text).get_color() for text in lower.texts[-3:]}) == 3
    assert overlapping(figure) == []
    assert outside(figure) == []


def test_free_modes_have_colours_of_their_own():
    colours = [style.COLOUR[name] for name in (*COORDINATES, *FREE[:8])]
    colours += [style.COLOUR[f"{name} (2)"] for name in (*COORDINATES, *FREE[:8])]
    assert len({*colours}) == len(colours)
    with pytest.raises(KeyError):
        style.COLOUR["Q"]


def test_the_spectra_shown_are_of_what_moves_most(saved):
    class Still:
        coordinates, steady_state = saved.coordinates, np.zeros(18)

    vibration = Vibration(saved.data, Still())  # pyright: ignore[reportArgumentType]
    assert [name for name, _ in vibration.spectra(slice(None))] == ["X", "Y", "Tz", *SYMMETRIC]
    assert [name for name, _ in vibration.spectra(slice(None), ("Y", "E4", "E5"))] == ["Y", "E5"]
