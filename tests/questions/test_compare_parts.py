"""What a measured record is compared with, line by line, and how signals go out, against numbers put in by hand."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import RequestError
from drumsqueal.files import universal
from drumsqueal.findings.signals.sound import level_reference
from drumsqueal.findings.signals.spectra import Peaks, Spectrum, Tones
from drumsqueal.physics.bodies.brake import Placed, Share, turned
from drumsqueal.questions.compare import measured as reader
from drumsqueal.questions.compare import study
from drumsqueal.questions.compare.measured import _by_type, _sampling, _whole, _windowed
from drumsqueal.questions.compare.record import Asked, Measured, UnevenError, even_sampling
from drumsqueal.questions.compare.study import (
    ComparedMode,
    MeasuredLine,
    MeasuredRecord,
    SimulatedLine,
    SimulatedRecord,
    fraction_covered,
    match_lines,
)
from drumsqueal.questions.export import uff58
from drumsqueal.questions.export.signals import Channel, Channels, distinct


def tones(frequency: list[float], amplitude: list[float]) -> Tones:
    grid = np.arange(0.0, 3000.0, 10.0)
    spectrum = Spectrum(grid, np.where(grid < 1500, 0.25, 8.0), 10.0)
    return Tones(spectrum, np.zeros(grid.size), 3, Peaks(np.array(frequency), np.array(amplitude)))


def records(theirs: Tones, ours: Tones, rates=(4000.0, 6000.0)) -> tuple[MeasuredRecord, SimulatedRecord]:
    known: dict[str, Any] = {"from_s": 0.0, "until_s": 1.0, "resolution_Hz": 10.0, "segments": 3}
    there = MeasuredRecord(
        **known, sample_rate_Hz=rates[0], tones=theirs, file="f", channel="c", quantity="velocity", unit="m/s"
    )
    lines = tuple(
        SimulatedLine(frequency_Hz=f, amplitude=a, not_measurable=f >= rates[0] / 2)
        for f, a in np.transpose(ours.peaks).tolist()
    )
    here = SimulatedRecord(
        **known, sample_rate_Hz=rates[1], tones=ours, file="g", signal="s", saturated=True, lines=lines
    )
    return there, here


def test_the_largest_line_is_the_largest_that_both_can_hold():
    there, here = records(tones([100.0, 2100.0], [3.0, 9.0]), tones([1990.0, 2010.0], [2.0, 7.0]))
    assert study._largest(there, here) == (3.0, 2.0)
    there, here = records(tones([2100.0], [9.0]), tones([], []), (2800.0, 6000.0))
    assert study._largest(there, here) == (0.25, 0.25)  # of the spectrum up to 1400 Hz
    there, here = records(tones([], []), tones([], []))
    assert study._largest(there, here) == (8.0, 8.0)


def mode(label: str, frequency: float) -> ComparedMode:
    return ComparedMode(
        label=label, frequency_Hz=frequency, growth_rate_1_per_s=1.0, unstable=True, not_measurable=False
    )


def test_measured_lines_are_compared_with_simulated_ones_and_with_modes():
    there, here = records(
        tones([1000.0, 2000.0, 300.0], [4.0, 0.5, 0.4]),
        tones([1020.0, 310.0, 330.0], [2.0, 0.3, 0.1]),
        (9000.0, 9000.0),
    )
    references = {"measured": 0.01, "simulated": 0.1}
    first, second, third = study._compared_lines(
        there, here, (mode("Y", 950.0), mode("X", 1200.0), mode("Tz", 305.0)), references, 0.05
    )
    assert (first.measured_Hz, first.amplitude, first.unit, first.rms_of_0_dB) == (1000.0, 4.0, "m/s", 0.01)
    # Levels are of rms values.
    assert first.level_dB == pytest.approx(20 * math.log10(4.0 / math.sqrt(2) / 0.01))
    assert (first.nearest_simulated_Hz, first.simulated_is_pair) == (1020.0, True)
    assert first.over_simulated == pytest.approx(1000 / 1020 - 1)
    ours = 20 * math.log10(2.0 / math.sqrt(2) / 0.1)
    assert first.level_over_simulated_dB == pytest.approx(first.level_dB - ours)
    assert (first.nearest_mode, first.nearest_mode_Hz, first.mode_is_pair) == ("Y", 950.0, False)
    assert first.over_mode == pytest.approx(1000 / 950 - 1)
    # The second is the first's harmonic and compared with no mode, and with no line that is near.
    assert (second.harmonic_order, second.fundamental_Hz, second.fundamental_is_simulated) == (2, 1000.0, False)
    assert (second.nearest_mode, second.simulated_is_pair, second.level_over_simulated_dB) == (None, False, None)
    assert (third.nearest_simulated_Hz, third.nearest_mode, third.mode_is_pair) == (310.0, "Tz", True)
    comparison: Any = SimpleNamespace(lines=(first, second, third), simulated=here)
    assert [each.frequency_Hz for each in study.MeasuredComparison.simulated_alone.fget(comparison)] == [330.0]  # pyright: ignore[reportOptionalCall]


def test_a_harmonic_may_be_known_by_its_simulated_pair_alone():
    there, here = records(tones([1002.0], [1.0]), tones([500.0, 1000.0], [5.0, 1.0]), (9000.0, 9000.0))
    (line,) = study._compared_lines(there, here, (), {"measured": 1.0, "simulated": 1.0}, 0.05)
    assert (line.harmonic_order, line.fundamental_Hz, line.fundamental_is_simulated) == (2, 500.0, True)
    both, _ = records(tones([1002.0, 501.0], [1.0, 0.5]), tones([], []), (9000.0, 9000.0))
    first, _ = study._compared_lines(both, here, (), {"measured": 1.0, "simulated": 1.0}, 0.05)
    assert (first.harmonic_order, first.fundamental_Hz, first.fundamental_is_simulated) == (2, 501.0, False)


def record(values: np.ndarray, rate: float = 1000.0, start: float = 2.0) -> Measured:
    return Measured("mic", "", rate, start, values, ())


def test_segments_are_as_long_as_the_shorter_record_and_a_second_at_most():
    long, short = record(np.zeros(3000)), record(np.zeros(400), 500.0)
    assert study._segment(long, short, Path("x")) == 0.8
    assert study._segment(long, long, Path("x")) == 1.0
    for rate in (40.0, 39.0):
        with pytest.raises(RequestError, match="too low for sound"):
            study._segment(record(np.zeros(3000), rate), long, Path("x"))
    brief = record(np.zeros(76), 5000.0)
    assert study._segment(brief, record(np.zeros(3000), 1020.0), Path("x")) == pytest.approx(0.0152)
    with pytest.raises(RequestError, match=r"15 samples in 0.0152 s"):
        study._segment(brief, record(np.zeros(3000), 1000.0), Path("x"))
    seen = study._spectral(record(np.sin(np.arange(1200.0)), 600.0), 0.5)
    assert (seen["from_s"], seen["until_s"], seen["sample_rate_Hz"]) == (2.0, 2.0 + 1199 / 600, 600.0)


def test_times_are_even_to_a_hundredth_or_to_their_last_digit():
    interval = 0.02 / np.sqrt(3)  # of which no few digits are all
    time = 5.0 + interval * np.arange(200)
    assert even_sampling(time) == pytest.approx((1 / interval, 5.0))
    gaps = time.copy()
    gaps[[0, 1, 50]] = np.nan
    assert even_sampling(gaps) == pytest.approx((1 / interval, 5.0), rel=1e-9)
    for size, even in ((0.0095, True), (0.0105, False)):
        off = time + interval * size * np.where(np.arange(200) == 100, 1.0, 0.0) / (1 - 1 / 200)
        if even:
            assert even_sampling(off).rate == pytest.approx(1 / interval, rel=1e-5)
        else:
            with pytest.raises(UnevenError):
                even_sampling(off)
    assert even_sampling(np.round(np.arange(500) / 300.0, 3)).rate == pytest.approx(300.0, rel=1e-4)


def test_a_part_of_a_record_has_both_of_its_ends():
    values = np.arange(1000.0)
    found = _windowed(Path("x"), record(values), 2.1, 2.3)
    np.testing.assert_array_equal(found.values, values[100:301])
    assert found.start_s == pytest.approx(2.1)
    found = _windowed(Path("x"), record(values), 2.1005, 2.2995)
    np.testing.assert_array_equal(found.values, values[101:300])
    found = _windowed(Path("x"), record(values), 2.1000004, 2.2999996)
    np.testing.assert_array_equal(found.values, values[100:301])
    assert _windowed(Path("x"), record(values), None, None).values.size == 1000
    with pytest.raises(RequestError, match="hold 63 samples"):
        _windowed(Path("x"), record(values), 2.1, 2.162)
    assert _windowed(Path("x"), record(values), 2.1, 2.163).values.size == 64
    assert _whole(Path("x"), found).values.size == 201


@pytest.mark.parametrize(
    ("kind", "values", "wanted"),
    [
        ("uint8", [0, 64, 128, 255], [-1, -0.5, 0, 127 / 128]),
        ("int16", [-(2**15), 2**14, 0, 7], [-1, 0.5, 0, 7 / 2**15]),
        ("int32", [-(2**31), 2**30, 0, 7], [-1, 0.5, 0, 7 / 2**31]),
        ("float32", [-2.0, 0.5, 0, 7], [-2, 0.5, 0, 7]),
    ],
)
def test_full_scale_of_a_sound_is_one(tmp_path, kind, values, wanted):
    import scipy.io.wavfile

    path = tmp_path / "a.wav"
    data = np.stack([np.zeros(4), values], axis=1).astype(kind)
    scipy.io.wavfile.write(path, 8000, data)
    found = reader.read_wav(Asked(path, "2", None, None))
    np.testing.assert_allclose(found.values, wanted)
    assert (found.sample_rate, found.start_s, found.name, found.unit) == (8000.0, 0.0, "channel 2", "")
    assert reader.read_wav(Asked(path, "2", 100.0, None)).sample_rate == 100.0


def test_units_of_a_universal_file_are_by_its_system_and_quantity():
    own = {"units_code": 9, "length": 1000.0, "force": 4.0}
    assert universal.units_of(own) == (1e-3, 0.25)
    assert universal.units_of(own | {"length": 0.0}) is None
    assert universal.units_of({"units_code": 7, "length": 3.0, "force": 4.0}) == (0.0254, 4.4482216152605)
    assert universal.units_of({"units_code": 99}) is None
    assert (universal.type_of("velocity"), universal.type_of("force"), universal.type_of("torque")) == (11, 9, 1)

    def unit(kind: int, direction: int = 1) -> tuple[str, float] | None:
        found = _by_type({"ordinate_spec_data_type": kind, "rsp_dir": direction, "units": (1e-3, 1e3)})
        return None if found is None else (found.si, pytest.approx(found.factor))  # pyright: ignore[reportReturnType]

    assert [unit(kind) for kind in (8, 11, 12, 9, 15, 1)] == [
        ("m", 1e-3), ("m/s", 1e-3), ("m/s^2", 1e-3), ("N", 1e3), ("Pa", 1e9), None
    ]  # fmt: skip
    assert [unit(kind, -5) for kind in (8, 11, 13, 15)] == [("rad", 1.0), ("rad/s", 1.0), ("N*m", 1.0), ("Pa", 1e9)]
    assert _by_type({"ordinate_spec_data_type": 8, "units": None}) is None
    even = {"abscissa_inc": 4.0, "abscissa_spacing": 1, "abscissa_min": 7.0}
    assert _sampling(Path("x"), even, 1e-3) == (250.0, pytest.approx(7e-3))
    uneven = {"abscissa_inc": 4.0, "abscissa_spacing": 0, "num_pts": 100, "x": np.append(7 + 4.0 * np.arange(100), 0)}
    assert _sampling(Path("x"), uneven, 1e-3) == pytest.approx((250.0, 7e-3))


# --- what goes out ---------------------------------------------------------------------------------------------------


def shoe(half: float = 0.6) -> Any:
    return SimpleNamespace(half_angle=half, outer_radius=0.1, centroid=0.07, width=0.04, thickness=0.015)


def test_the_points_of_a_shoe_are_on_its_lining_and_those_of_one_that_bends_on_its_sections():
    points, lines = uff58._geometry_of_one(shoe(), bends=False)
    assert points == {
        1: (0.07, 0.0, 0.0),
        2: pytest.approx((0.1, 0.0, 0.0)),
        3: pytest.approx((0.1 * math.cos(0.6), -0.1 * math.sin(0.6), 0.0)),
        4: pytest.approx((0.1 * math.cos(0.6), 0.1 * math.sin(0.6), 0.0)),
    }
    assert lines == [("shoe", (3, 2, 4, 1, 3))]
    points, lines = uff58._geometry_of_one(shoe(), bends=True)
    assert len(points) == 4 + 17 * 6
    frame = [(0.1, -0.02), (0.1, 0.0), (0.1, 0.02), (0.085, 0.02), (0.085, 0.0), (0.085, -0.02)]
    for row, angle in enumerate(np.linspace(-0.6, 0.6, 17)):
        for k, (r, z) in enumerate(frame):
            assert points[101 + 6 * row + k] == pytest.approx((r * math.cos(angle), r * math.sin(angle), z))
        first = 101 + 6 * row
        name, line = lines[1 + row]
        assert (name, line) == (f"section at {math.degrees(angle):.4g} deg", (*range(first, first + 6), first))
    assert lines[18:] == [(f"along the shoe {k + 1}", tuple(range(101 + k, 101 + 102, 6))) for k in range(6)]


def test_shoes_of_a_brake_are_turned_to_their_places_and_have_numbers_of_their_own():
    part = Placed(Share("second.", (0,), 2, 1), shoe(), 2.0)
    points, lines = uff58._geometry(part, bends=False)
    x, y = 0.1 * math.cos(0.6), 0.1 * math.sin(0.6)
    wanted = (x * math.cos(2) - y * math.sin(2), x * math.sin(2) + y * math.cos(2), 0.0)
    assert points[10_004] == pytest.approx(wanted)
    assert lines == [("second: shoe", tuple(10_000 + k for k in (3, 2, 4, 1, 3)))]
    assert turned(x, y, 2.0) == pytest.approx(wanted[:2])
    drum: Any = SimpleNamespace(offset=0.01, width=0.06)
    points, lines = uff58._drum_geometry(0.1, drum)
    assert len(points) == 144
    for k, z in ((0, -0.02), (1, 0.04)):
        for j in (0, 1, 71):
            angle = 2 * math.pi * j / 72
            assert points[1001 + 72 * k + j] == pytest.approx((0.1 * math.cos(angle), 0.1 * math.sin(angle), z))
    assert lines[1] == ("drum at z = 40 mm", (*range(1073, 1145), 1073))
    # Axes of its own, and directions of its points: r, θ, z on the lining.
    first = Placed(Share("first.", (1,), 2, 0), shoe(), 0.0)
    assert uff58._own_systems([first, part]) == {0: 1, 1: 3}
    np.testing.assert_allclose(
        uff58._axes(0.3), [[math.cos(0.3), math.sin(0.3), 0], [-math.sin(0.3), math.cos(0.3), 0], [0, 0, 1]]
    )
    given = uff58._nodes(
        {1: (1.0, 2.0, 3.0), 2: (4.0, 5.0, 6.0), 10_001: (7.0, 8.0, 9.0), 101: (0.0, 0.0, 0.0)}, [first, part]
    )
    assert [given[axis].tolist() for axis in "xyz"] == [[1, 4, 7, 0], [2, 5, 8, 0], [3, 6, 9, 0]]
    assert (given["node_nums"].tolist(), given["disp_cs"].tolist()) == ([1, 2, 10_001, 101], [1, 2, 3, 1])
    systems = uff58._coordinate_systems([first, part])
    np.testing.assert_allclose(systems["CS_matrices"][2], np.vstack([uff58._axes(2.0), np.zeros(3)]))
    assert systems["CS_sys_labels"] == [1, 2, 3]


def test_a_signal_goes_out_with_its_place_its_units_and_its_times(nominal):
    channel = Channel("brake_torque", "torque", "moment", "N m", "so", np.arange(4.0), 0, 0, (1, 1))
    moving = Channel("velocity_Y", "vel_Y", "velocity", "m/s", "so", np.arange(4.0), 1, 2, (1, 0))
    texts = {"title": "t", "outcome": "o", "source": "s", "versions": "v", "scene": ""}
    channels = Channels(3.0, 8.0, (channel, moving), texts, nominal)
    np.testing.assert_array_equal(channels.time, [3.0, 3.125, 3.25, 3.375])
    found = uff58._function(channels, channel, 5, "torque")
    assert [
        found[key] for key in ("ver_num", "rsp_node", "rsp_dir", "ordinate_len_unit_exp", "ordinate_force_unit_exp")
    ] == [5, 0, 0, 1, 1]
    np.testing.assert_array_equal(found["x"], channels.time)
    found = uff58._function(channels, moving, 6, "vel_Y")
    assert [found[key] for key in ("rsp_node", "rsp_dir", "ordinate_len_unit_exp", "ordinate_spec_data_type")] == [
        1,
        2,
        0,
        11,
    ]
    assert found["abscissa_spec_data_type"] == 17
    units = uff58._units()
    assert (units["units_code"], units["length"], units["force"], units["temp_offset"]) == (1, 1.0, 1.0, 273.15)
    assert distinct(["abc", "abc", "abcdefghijk", "abcdefghijkl"], 10) == ["abc", "abc_2", "abcdefgh_3", "abcdefgh_4"]
    assert uff58._fitted("Größe\tµ", 7) == "Groe"


# --- words -----------------------------------------------------------------------------------------------------------


def measured(frequency: float, **more: Any) -> MeasuredLine:
    known: dict[str, Any] = {"amplitude": 2.0, "unit": "m/s", "level_dB": 60.0, "rms_of_0_dB": 1e-9}
    return MeasuredLine(measured_Hz=frequency, **(known | more))


def comparison(*lines: MeasuredLine, **more: Any) -> Any:
    simulated = [SimulatedLine(frequency_Hz=f, amplitude=1.0, not_measurable=f > 2500) for f in (1010.0, 404.0, 2600.0)]
    modes = [
        ComparedMode(label=n, frequency_Hz=f, growth_rate_1_per_s=0.0, unstable=u, not_measurable=f > 2500)
        for n, f, u in (("X", 500.0, True), ("Y", 990.0, False), ("Z", 1100.0, True), ("Tz", 2700.0, True))
    ]
    known: dict[str, Any] = {
        "lines": lines, "modes": tuple(modes), "simulated": SimpleNamespace(lines=simulated), "pairs_within": 0.05,
        "amplitudes_in": "m/s", "chance_of_a_pair": 0.124, "measured": SimpleNamespace(sample_rate_Hz=5000.0),
    }  # fmt: skip
    return study.MeasuredComparison.model_construct(**(known | more))


PAIRED = {"nearest_simulated_Hz": 1010.0, "over_simulated": -0.0099, "simulated_is_pair": True}
ALONE = {"nearest_simulated_Hz": 1010.0, "over_simulated": 0.6, "simulated_is_pair": False, "mode_is_pair": False}


def test_what_has_no_pair_and_what_cannot_be_measured_is_listed():
    found = study.describe_unpaired(comparison(measured(1000.0, **PAIRED), measured(1600.0, **ALONE)))
    assert found == [
        "Measured, not simulated: 1600.0 Hz", "Simulated, not measured: 404.0 Hz",
        "Not measurable, at or above 2500 Hz: Tz 2700 Hz, the simulated 2600 Hz",
    ]  # fmt: skip
    many = study._list([float(k) for k in range(1, 15)])
    assert many == f"{', '.join(f'{k}.0' for k in range(1, 13))} and 2 more"
    assert study._list([1.0] * 12).count("1.0") == 12
    notes = study.describe_table(comparison(measured(1000.0, **PAIRED), measured(1600.0, **ALONE)))
    assert "in parentheses: the nearest, but no pair (more than 5 % off, or taken by a stronger line)" in notes
    assert "n × f" not in notes
    assert notes.endswith(
        "what is 40 dB or more below the strongest of its record is not listed, simulated or measured"
    )
    paired = measured(1000.0, **PAIRED, harmonic_order=2, fundamental_Hz=500.0, fundamental_is_simulated=True)
    notes = study.describe_table(comparison(paired))
    assert "parentheses" not in notes
    assert "n × f: a harmonic of the line at f, and so of no mode; (n × f): of a simulated line" in notes


def test_the_verdict_tells_where_the_strongest_line_lies():
    one, other = measured(1000.0, **PAIRED), measured(1600.0, **ALONE)
    assert study.describe_verdict(comparison(one, other)) == (
        "The strongest measured line, 1000.0 Hz, lies 0.99 % below the simulated 1010.0 Hz, the strongest one too; "
        "9.1 % below the nearest unstable mode, Z at 1100.0 Hz. Of 2 measured lines 1 has a simulated one, 0.99 % "
        "apart at most; by chance a line would have one with a probability of 12 %."
    )
    both = measured(404.0, nearest_simulated_Hz=404.0, over_simulated=5e-6, simulated_is_pair=True)
    said = study.describe_verdict(comparison(both, one))
    assert said.startswith(
        "The strongest measured line, 404.0 Hz, lies at the simulated 404.0 Hz; 19 % below the nearest"
    )
    assert "Of 2 measured lines 2 have a simulated one, 0.99 % apart at most;" in said
    said = study.describe_verdict(comparison(other, modes=()))
    assert said.startswith(
        "The strongest measured line, 1600.0 Hz, is not simulated; no mode is unstable. Of 1 measured"
    )
    assert "line none has a simulated one within 5 %;" in said
    harmonic = measured(1000.0, **PAIRED, harmonic_order=2, fundamental_Hz=500.0, fundamental_is_simulated=False)
    said = study.describe_verdict(comparison(harmonic, other))
    assert (
        "1000.0 Hz, the 2nd harmonic of 500.0 Hz, lies 0.99 % below the simulated 1010.0 Hz, the strongest one" in said
    )
    assert "its fundamental, 500.0 Hz, lies at the nearest unstable mode, X at 500.0 Hz." in said
    assert "Of 2 measured lines, 1 of them a harmonic, 1 has" in said
    harmonic = harmonic.model_copy(update={"fundamental_is_simulated": True})
    said = study.describe_verdict(comparison(harmonic, harmonic))
    assert "lies 0.99 % below the simulated 1010.0 Hz, the 2nd harmonic of 500.0 Hz, the strongest one too" in said
    assert "its fundamental is not measured" in said
    assert "2 of them harmonics, 2 have" in said
    assert "cannot be compared: the simulation has no line" in study.describe_verdict(comparison(measured(7.0)))
    assert study.describe_verdict(comparison()).startswith("No line of the measured record")
    assert [study._ordinal(k) for k in (1, 2, 3, 4, 10, 11, 12, 13, 20, 21, 112)] == [
        "1st", "2nd", "3rd", "4th", "10th", "11th", "12th", "13th", "20th", "21st", "112th"
    ]  # fmt: skip


def test_a_record_and_its_levels_are_told_with_their_units():
    part: Any = SimpleNamespace(from_s=1.0, until_s=2.5, sample_rate_Hz=8000.0, resolution_Hz=1.5, segments=4)
    assert study.describe_record(part) == "1 to 2.5 s at 8000 Hz, resolution 1.5 Hz, mean of 4 segments"
    part.segments = 1
    assert study.describe_record(part).endswith("resolution 1.5 Hz")
    apart = study.describe_levels(("m/s", ""), "", (2.0, 3.0))
    assert apart == (
        f"0 dB is the largest line of each record: measured {2 / math.sqrt(2):.4g} m/s rms, "
        f"{20 * math.log10(2 / math.sqrt(2) / 1e-9):.1f} dB re {level_reference('m/s').written}; "
        f"simulated {3 / math.sqrt(2):.4g} rms without a unit"
    )
    assert study.describe_levels(("m/s", "m/s"), "m/s", (2.0, 3.0)).startswith(
        "levels are those of rms values, in dB re "
    )
    assert study.zero_level(comparison()) == level_reference("m/s").amount
    assert study.zero_level(comparison(amplitudes_in=None)) == ""
    saved: Any = SimpleNamespace(complete=False, outcome="so")
    notes = study.describe_simulation(saved, "m/s^2", 1, saturated=False)
    assert [each[:24] for each in notes] == [
        "the run is incomplete (s",
        "the simulated motion rea",
        "the simulated signal is ",
    ]
    assert notes[2] == "the simulated signal is differentiated to acceleration, line by line"
    saved.complete = True
    assert study.describe_simulation(saved, "m/s", 0, saturated=True) == []
    assert "integrated" in study.describe_simulation(saved, "m", -1, saturated=True)[0]


def test_a_line_goes_with_the_reference_that_is_nearest_in_frequency_and_level():
    """A hundredth of frequency counts as 8 dB of level, 1/0.05 and 1/40 dB, wherever pairs may lie."""
    lines, references = [1000.0, 500.0], [1010.0, 1040.0, 2000.0]
    apart = 1000 / np.array(references) - 1
    for level, best in ((50.0 - 22.7, 0), (50.0 - 23.0, 1)):  # the second is farther off by what counts as 22.85 dB
        found = match_lines(lines, references, widest=0.1, levels=([50.0, 0.0], [level, 50.0, 50.0]))
        assert (abs(apart[1]) - abs(apart[0])) * 40 / 0.05 == pytest.approx(22.85, abs=0.01)
        assert found[0] is not None
        assert (found[0].reference, found[0].paired) == (best, True)
        assert found[0].difference == pytest.approx(apart[found[0].reference])
        # What lies beyond is no pair, and is compared with the nearest in any case.
        assert found[1] is not None
        assert (found[1].reference, found[1].paired) == (0, False)
    one, other, third = match_lines([1000.0, 1001.0, 1002.0], [1010.0, 1030.0], widest=0.02)  # pyright: ignore[reportGeneralTypeIssues]
    assert [(each.reference, each.paired) for each in (one, other, third)] == [(0, True), (0, False), (0, False)]  # pyright: ignore[reportOptionalMemberAccess]
    assert match_lines([1.0, 2.0], []) == [None, None]
    # What is compared with a line that is no pair leaves it to those that may be one.
    far, near = match_lines([900.0, 1005.0], [1010.0], widest=0.02)  # pyright: ignore[reportGeneralTypeIssues]
    assert [(each.reference, each.paired) for each in (far, near)] == [(0, False), (0, True)]  # pyright: ignore[reportOptionalMemberAccess]
    # From 100 to 200 Hz: 5 % about 100, 104 and 150 Hz cover 100 to 109.2 and 142.5 to 157.5 Hz.
    assert fraction_covered([150.0, 104.0, 100.0], 100.0, 200.0) == pytest.approx((9.2 + 15.0) / 100)
    assert fraction_covered([205.0], 100.0, 200.0) == pytest.approx((200 - 205 * 0.95) / 100)
    assert fraction_covered([150.0], 200.0, 200.0) == 0.0
