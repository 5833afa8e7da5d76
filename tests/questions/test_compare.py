"""Tones in noise, lines paired one to one, and a measured record beside a history."""

import csv
import json

import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st

import drumsqueal as package
from drumsqueal.errors import COMPLETE, RequestError
from drumsqueal.files.history_file import read_history
from drumsqueal.files.output_folder import to_json, write_json
from drumsqueal.findings.history import MOTION, SIGNALS
from drumsqueal.findings.schema import read_findings
from drumsqueal.findings.signals.sound import level_dB, level_reference
from drumsqueal.findings.signals.spectra import Spectrum, amplitude_spectrum, find_harmonics, find_tones, spectral_peaks
from drumsqueal.questions.compare.answer import draw_comparison
from drumsqueal.questions.compare.measured import read_measured
from drumsqueal.questions.compare.record import Measured
from drumsqueal.questions.compare.study import (
    WIDEST,
    MeasuredComparison,
    Spectral,
    _largest,
    common_unit,
    compare_measured,
    fraction_covered,
    match_lines,
)
from drumsqueal.scene import COORDINATES

RATE = 25_600.0


def tones(parts, duration=3.0, rate=RATE, noise=0.0, offset=0.0, samples=None):
    """Sines of (frequency, amplitude) with white noise, and an offset, sampled at a rate."""
    random, time = np.random.default_rng(11), np.arange(samples or round(duration * rate)) / rate
    waves = sum(a * np.sin(2 * np.pi * f * time + k) for k, (f, a) in enumerate(parts))
    return time, waves + noise * random.normal(size=time.size) + offset


# Tones


def test_noise_alone_shows_no_tone():
    random = np.random.default_rng(5)
    # One record in a thousand may; of these 200 one at most, with a probability of 98 %.
    found = [find_tones(random.normal(size=8192), RATE, segment=(0.04, 0.32)[k % 2]) for k in range(200)]
    assert sum(each.peaks.frequency_Hz.size > 0 for each in found) <= 1


def test_tones_are_found_in_noise_within_the_error_of_estimation():
    parts, noise = [(1079.3, 1.0), (7301.7, 0.03)], 0.5
    time, signal = tones(parts, noise=noise, offset=40.0)
    found = find_tones(signal, RATE, segment=0.2)
    assert found.segments == 29
    # The best there is scatters by √6 σ/(π A T √n) for n samples in T (Rife & Boorstyn 1974); averaged segments are
    # worse by their number, some √2 by the window, and four times that is allowed for.
    bound = [np.sqrt(6) * noise / (np.pi * a * 0.2 * np.sqrt(time.size)) * 4 * np.sqrt(2) for _, a in parts]
    errors = np.abs(found.peaks.frequency_Hz - [f for f, _ in parts])
    assert (errors < bound).all(), (errors, bound)
    floor = 2 * noise * np.sqrt(1.5 / (0.2 * RATE))  # rms of noise in the Hann window
    np.testing.assert_allclose(found.peaks.amplitude, [a for _, a in parts], atol=floor)


def test_what_rises_above_the_threshold_without_a_peak_is_no_tone():
    # A flank that the threshold crosses: the bin beside is higher, and below the threshold there.
    frequency = np.arange(2000.0)
    amplitude = 0.5 * np.exp(-frequency / 500) + np.exp(-((frequency - 1500.3) ** 2) / 8)
    threshold = np.where(frequency < 700, 0.2, 0.05)
    found = spectral_peaks(Spectrum(frequency, amplitude, 4.0), count=9, floor=1e-4, threshold=threshold)
    assert found.frequency_Hz == pytest.approx([1500.3], abs=0.01)
    assert found.amplitude == pytest.approx([1 + 0.5 * np.exp(-3.0)], rel=0.01)


def test_a_history_beside_its_own_part_is_paired_however_many_segments_it_has():
    # Harmonics of 1028.85 Hz over a floor at round-off, where an averaged spectrum crosses its threshold often.
    time = np.arange(150_000) / 50e3
    signal = np.sum([0.5 / k**2 * np.sin(2 * np.pi * 1028.8539 * k * time) for k in range(1, 9)], axis=0)
    for segment in (1.0, 0.9, 0.7, 0.5):
        found = find_tones(signal[64_000:], 50e3, segment=segment, lowest=20.0)
        assert found.peaks.frequency_Hz[:2] == pytest.approx([1028.8539, 2057.7078], abs=1e-3)
        assert found.peaks.amplitude[0] == pytest.approx(0.5, rel=1e-3)


def test_of_one_segment_it_is_the_amplitude_spectrum():
    _, signal = tones([(1000.0, 1.0)], duration=0.2)
    found = find_tones(signal, RATE, segment=1.0)
    np.testing.assert_allclose(found.spectrum.amplitude, amplitude_spectrum(signal, RATE).amplitude, rtol=1e-12)
    assert found.segments == 1
    assert found.spectrum.resolution_Hz == pytest.approx(1.5 / 0.2)


@pytest.mark.parametrize(("segment", "hum"), [(1.0, 7.0), (0.16, 12.0)])  # the latter's flank reaches beyond 20 Hz
def test_what_is_slower_than_asked_is_no_tone_and_hides_none(segment, hum):
    _, signal = tones([(hum, 20.0), (1000.0, 1.0), (2000.0, 0.03)], duration=2.0, noise=0.05)
    found = find_tones(signal, RATE, segment=segment, lowest=20.0)
    assert found.peaks.frequency_Hz == pytest.approx([1000.0, 2000.0], abs=0.5)  # the noise, on the fainter one


# Pairs


def test_pairs_are_one_to_one_and_none_is_forced():
    first, second, third, fourth = match_lines([1010.0, 1020.0, 3000.0, 990.0], [1000.0, 2000.0])
    assert first is not None
    assert (first.reference, first.paired) == (0, True)
    assert first.difference == pytest.approx(0.01)
    assert second is not None and not second.paired  # noqa: PT018 (taken by a stronger line)
    assert third is not None
    assert (third.reference, third.paired) == (1, False)
    assert fourth is not None and not fourth.paired  # noqa: PT018
    assert match_lines([1000.0], []) == [None]


def test_a_strong_line_goes_with_a_strong_one_rather_than_with_a_faint_one_nearer_by():
    pairs = match_lines([7150.0], [7050.0, 7290.0], levels=([0.0], [-38.0, -17.0]))
    assert [match.reference for match in pairs if match] == [1]


@given(
    lines=st.lists(st.floats(100.0, 1e4), min_size=1, max_size=8, unique=True),
    references=st.lists(st.floats(100.0, 1e4), min_size=1, max_size=8, unique=True),
)
@settings(derandomize=True, max_examples=200)
def test_every_pair_is_within_the_bound_and_no_reference_is_taken_twice(lines, references):
    matches = [match for match in match_lines(lines, references) if match is not None]
    assert len(matches) == len(lines)
    taken = [match.reference for match in matches if match.paired]
    assert len(set(taken)) == len(taken)
    for line, match in zip(lines, matches, strict=True):
        assert match.difference == pytest.approx(line / references[match.reference] - 1)
        if match.paired:
            assert abs(match.difference) <= WIDEST
        else:  # every reference that would do has gone to another line
            near = [k for k, f in enumerate(references) if abs(line / f - 1) <= WIDEST]
            assert set(near) <= set(taken)


def test_the_fraction_covered_is_that_of_a_line_anywhere():
    references = np.array([1000.0, 1010.0, 3000.0])
    anywhere = np.random.default_rng(2).uniform(20.0, 5000.0, 20_000)
    hits = np.mean(np.abs(anywhere[:, None] / references - 1).min(axis=1) <= WIDEST)
    # Three standard errors of a share of 20 000.
    assert fraction_covered(references, 20.0, 5000.0) == pytest.approx(hits, abs=3 * np.sqrt(0.25 / 20_000))
    assert fraction_covered([], 20.0, 5000.0) == 0.0


# The comparison


LINES = [(1051.7, 2e-2), (2103.4, 5e-3), (7211.9, 8e-3)]  # of the velocity of Y in m/s, after the first edge
BOUNDARY, END = 0.1, 0.5  # s


@pytest.fixture(scope="module")
def history(nominal, tmp_path_factory):
    """A history of the nominal brake whose motion is made up, so that its lines are known."""
    time = np.arange(round(END * 50_000) + 1) / 50_000
    data = {name: (("time", "coordinate"), np.zeros((time.size, 6))) for name in MOTION}
    data |= {name: (("time",), np.zeros(time.size)) for name in SIGNALS}
    data["velocity"][1][:, 1] = tones(LINES, END, 50_000.0, samples=time.size)[1]
    data["contact_fraction"][1][:] = np.where(time < BOUNDARY, 1.0, 0.7)
    attributes = {"scene": nominal.to_toml(), "outcome": str(COMPLETE)}
    coordinates = {"time": time, "coordinate": list(COORDINATES)}
    path = tmp_path_factory.mktemp("run") / "history.nc"
    xarray.Dataset(data, coordinates, attributes).to_netcdf(path, engine="h5netcdf")
    return path


@pytest.fixture(scope="module")
def simulated(history):
    """Time and velocity of Y."""
    saved = read_history(history)
    return saved.data["time"].values, saved.data["velocity"].sel(coordinate="Y").values


@pytest.fixture(scope="module")
def measured(simulated):
    """The velocity of Y as if it had been measured in a unit that is not known."""
    return recorded(*simulated)


def recorded(time, signal, unit=""):
    """A record as it is read, without a file: those are read in tests of their own, and by the commands below."""
    return Measured("v", unit, 1 / time[1], 0.0, signal, ())


def csv_file(path, columns, header):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.17g")
    return path


def test_the_saturated_part_and_its_lines_are_those_that_were_put_in(history, simulated, tmp_path):
    found = compare_measured(history, read_measured(csv_file(tmp_path / "v", simulated, "time,v")), "velocity_Y")
    assert found.simulated.saturated
    # The last 60 % of what follows the edge.
    assert (found.simulated.from_s, found.simulated.until_s) == pytest.approx(
        (END - 0.6 * (END - BOUNDARY), END), abs=1e-4
    )
    strongest = sorted(LINES, key=lambda line: -line[1])
    # The vertex of a parabola in steps of an eighth of a bin of 4 Hz; neighbours 100 bins away pull by less.
    assert found.simulated.frequency_Hz == pytest.approx([f for f, _ in strongest], abs=2e-3)
    assert found.simulated.amplitude == pytest.approx([a for _, a in strongest], rel=1e-3)
    # Each covers 5 % to either side, of what lies between 20 Hz and the end of the last one's.
    covered, highest = sum(0.1 * f for f, _ in LINES), 1.05 * max(f for f, _ in LINES)
    assert found.chance_of_a_pair == pytest.approx(covered / (highest - 20.0), rel=1e-5)


def test_the_findings_read_back_as_what_was_written(history, measured, tmp_path):
    found = compare_measured(history, measured, "velocity_Y")
    write_json(found, tmp_path / "compare.json")
    assert to_json(read_findings(tmp_path / "compare.json", MeasuredComparison)) == to_json(found)


def test_relative_levels_are_to_the_largest_line_that_both_can_hold():
    records = []
    for rate, parts in ((8000.0, [(1000.0, 1.0)]), (RATE, [(1000.0, 0.5), (6000.0, 2.0)])):
        found = find_tones(tones(parts, 0.5, rate)[1], rate, segment=0.5)
        spectrum = {"resolution_Hz": found.spectrum.resolution_Hz, "segments": found.segments}
        records.append(Spectral(from_s=0.0, until_s=0.5, sample_rate_Hz=rate, tones=found, **spectrum))
    assert _largest(*records) == pytest.approx((1.0, 0.5), rel=1e-3)


def test_the_figure_has_the_lines_at_their_levels(history, simulated):
    figure = draw_comparison(compare_measured(history, recorded(*simulated, unit="m/s"), "velocity_Y"))
    upper, lower = figure.axes
    curves = [curve for curve in upper.lines if str(curve.get_label()).startswith(("measured", "simulated"))]
    assert len(curves) == 2
    for curve in curves:
        x, y = (np.asarray(values) for values in curve.get_data())
        for frequency, amplitude in LINES:
            near = np.abs(x - frequency / 1e3) < 0.02
            # A bin's eighth beside the peak is lower by less than 0.02 dB. 1 nm/s rms is 0 dB.
            assert y[near].max() == pytest.approx(20 * np.log10(amplitude / np.sqrt(2) / 1e-9), abs=0.03)
    assert upper.get_ylabel() == "Velocity, rms (dB re 1 nm/s)"
    (label,) = [text for text in upper.texts if text.get_text().endswith("×")]  # 2103.4 Hz is 2 × 1051.7
    assert label.get_text() == "2×"
    assert str(upper.lines[1].get_label()).endswith("2×, 3× …: harmonics of 1051.7 Hz")
    pairs = [curve.get_data() for curve in lower.lines if curve.get_marker() == "o"]
    assert len(pairs) == 3
    assert all(abs(np.asarray(y)[0]) < 1e-3 for _, y in pairs)  # per cent: the whole record and its saturated part


@pytest.mark.parametrize("factor", [1e-6, 1e3])
def test_both_spectra_are_seen_however_far_apart_their_levels_are(history, simulated, factor):
    time, velocity = simulated
    record = recorded(time, factor * velocity, "m/s")
    upper, _ = draw_comparison(compare_measured(history, record, "velocity_Y")).axes
    lowest, highest = upper.get_ylim()
    for curve in upper.lines[:2]:  # 120 dB below, and 60 dB above
        top = np.asarray(curve.get_data()[1]).max()
        assert lowest + 30 < top < highest


@pytest.mark.parametrize("to", ["csv", "uff58"])
def test_a_history_compared_with_its_own_export_differs_by_nothing(drumsqueal, history, tmp_path, to):
    file, folder, part = tmp_path / f"a.{to[:3]}", tmp_path / "out", ["--from", "0.26 s", "--until", "0.5 s"]
    names = ["--signals", "velocity_X,velocity_Y"]
    assert drumsqueal("export", str(history), "--to", to, "-o", str(file), *names, *part)[0] == 0
    chosen = ["--signal", "velocity_Y", "--channel", "velocity_Y"]
    status, _, error = drumsqueal("compare", str(history), str(file), "-o", str(folder), *chosen)
    assert (status, error) == (0, "")
    found = json.loads((folder / "compare.json").read_text())
    assert found["amplitudes_in"] == "m/s"
    assert len(found["lines"]) == 3
    for line in found["lines"]:
        assert line["simulated_is_pair"]
        # The same samples, at a rate known to 12 digits; the interval in UFF58 is written with six, here 2.00000e-5.
        assert line["over_simulated"] == pytest.approx(0.0, abs=1e-9)
        assert line["level_over_simulated_dB"] == pytest.approx(0.0, abs=1e-6)


def test_a_history_compared_with_its_own_sound_has_the_same_lines(drumsqueal, history, tmp_path):
    file, folder = tmp_path / "a.wav", tmp_path / "out"
    arguments = ["--signals", "velocity_Y", "--rate", "48 kHz", "--from", "0.26 s"]
    assert drumsqueal("export", str(history), "--to", "wav", "-o", str(file), *arguments)[0] == 0
    assert drumsqueal("compare", str(history), str(file), "-o", str(folder), "--signal", "velocity_Y")[0] == 0
    found = json.loads((folder / "compare.json").read_text())
    assert found["amplitudes_in"] is None
    for line in found["lines"][:3]:
        assert abs(line["over_simulated"] * line["measured_Hz"]) < 1e-2  # Hz; interpolated at either rate
        assert line["level_over_simulated_dB"] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("unit", "order"), [("m/s^2", 1), ("m", -1)])
def test_other_rates_of_change_are_compared_line_by_line(history, unit, order):
    parts = [(f, a * (2 * np.pi * f) ** order) for f, a in LINES]
    found = compare_measured(history, recorded(*tones(parts), unit), "velocity_Y")
    assert found.amplitudes_in == unit
    assert any("line by line" in told for told in found.notes)
    assert len(found.lines) == 3
    for line in found.lines:
        assert line.over_simulated is not None
        assert abs(line.over_simulated) * line.measured_Hz < 1e-2
        assert line.level_over_simulated_dB == pytest.approx(0.0, abs=0.01)


def test_a_record_of_no_quantity_is_compared_by_relative_levels(history):
    error, gain, noise = 0.013, 250.0, 0.2
    parts = [(f * (1 + error), gain * a) for f, a in LINES]
    record = recorded(*tones([*parts, (9123.4, 2.0)], noise=noise, offset=5.0))
    found = compare_measured(history, record, "velocity_Y")
    assert found.amplitudes_in is None
    assert found.rms_of_0_dB["measured"] == pytest.approx(gain * LINES[0][1] / np.sqrt(2), rel=0.01)
    by_frequency = {round(line.measured_Hz): line for line in found.lines}
    assert sorted(by_frequency) == sorted(round(f) for f in [*(f for f, _ in parts), 9123.4])
    for f, a in parts:
        line = by_frequency[round(f)]
        assert line.simulated_is_pair
        # Noise moves a line by some √6 σ/(π A T √n) = 0.01 Hz at most here, four times that is allowed for.
        assert line.over_simulated == pytest.approx(error, abs=0.04 / f)
        # Of an amplitude it is σ √(3/n), 1 % of the faintest.
        assert line.level_over_simulated_dB == pytest.approx(
            0.0, abs=20 * np.log10(1 + 5 * noise * np.sqrt(3 / 76_800) / a)
        )
    stray = by_frequency[9123]
    assert stray.simulated_is_pair is False
    assert stray.level_over_simulated_dB is None


def test_what_the_record_cannot_hold_is_named(history):
    found = compare_measured(history, recorded(*tones([(950.0, 1.0)], rate=4000.0)), "velocity_Y")
    assert {mode.label for mode in found.modes if mode.not_measurable} == {"X", "Tz"}
    assert {round(line.frequency_Hz) for line in found.simulated.lines if line.not_measurable} == {2103, 7212}
    missed = [round(line.frequency_Hz) for line in found.simulated_alone if not line.not_measurable]
    assert missed == [1052]  # 950 Hz is 9.7 % off


def test_simulated_lines_are_those_of_the_quantity_that_was_measured(history):
    # The third is 46 dB below the strongest as a velocity, and 29 dB below it as an acceleration.
    high = (7800.0, 1e-4)
    saved = read_history(history)
    time = saved.data["time"].values
    data = saved.data.copy(deep=True)
    data["velocity"][:, 1] += high[1] * np.sin(2 * np.pi * high[0] * time)
    parts = [(f, a * 2 * np.pi * f) for f, a in (*LINES, high)]
    found = compare_measured(saved._replace(data=data), recorded(*tones(parts), "m/s^2"), "velocity_Y")
    assert len(found.lines) == len(found.simulated.frequency_Hz) == 4
    assert all(line.simulated_is_pair for line in found.lines)
    assert list(found.simulated.amplitude) == sorted(found.simulated.amplitude, reverse=True)
    record = recorded(*tones([*LINES, high]), "m/s")
    assert len(compare_measured(saved._replace(data=data), record, "velocity_Y").simulated.frequency_Hz) == 3


@pytest.mark.parametrize("order", [-1, 1, 2])
def test_tones_of_a_rate_of_change_are_those_of_what_it_is(order):
    parts, noise = [(1000.0, 1.0), (4000.0, 0.3)], 0.01
    found = find_tones(tones(parts, noise=noise)[1], RATE, segment=0.2, order=order)
    wanted = sorted(((2 * np.pi * f) ** order * a for f, a in parts), reverse=True)
    assert found.peaks.amplitude == pytest.approx(wanted, rel=0.01)  # of the fainter, noise is 0.2 %
    at = np.argmin(np.abs(found.spectrum.frequency_Hz - 1000.0))
    assert found.spectrum.amplitude[at] == pytest.approx((2e3 * np.pi) ** order, rel=0.01)
    plain = find_tones(tones(parts, noise=noise)[1], RATE, segment=0.2)
    np.testing.assert_allclose(found.threshold[at] / plain.threshold[at], (2e3 * np.pi) ** order, rtol=1e-3)
    assert np.isfinite(found.spectrum.amplitude).all()


@pytest.mark.parametrize(
    ("rate", "told"),
    [
        (
            "30 Hz",
            "'pressure': its sample rate, 30 Hz, is too low for sound, from 20 Hz on; take a faster record",
        ),
        (
            "200 Hz",
            "'pressure': a sample rate of 200 Hz is too low for every mode and every simulated line; take a faster",
        ),
        ("50 Hz", "'pressure': 12 samples in 0.24 s, as long as the shorter record, are too few at 50 Hz"),
        ("1e6 Hz", "history.nc: 15 samples in 0.0003 s, as long as the shorter record, are too few at 50000 Hz"),
    ],
)
def test_records_that_have_no_spectrum_in_common_are_refused(drumsqueal, history, tmp_path, rate, told):
    file = csv_file(tmp_path / "a.csv", [tones([(1000.0, 1.0)], samples=300)[1]], "pressure")
    folder = tmp_path / "out"
    arguments = ["compare", str(history), str(file), "--rate", rate, "--signal", "velocity_Y", "-o", str(folder)]
    status, out, error = drumsqueal(*arguments)
    assert (status, out, error.count("\n")) == (2, "", 1)
    assert told in error
    assert not folder.exists()


def test_units_in_common():
    assert common_unit("m/s", "m/s^2") == ("m/s^2", 1)
    assert common_unit("m/s", "m") == ("m", -1)
    assert common_unit("rad", "rad/s^2") == ("rad/s^2", 2)
    assert common_unit("N*m", "N*m") == ("N*m", 0)
    assert (
        common_unit("m/s", "rad/s") == common_unit("m/s", "") == common_unit("", "m") == common_unit("", "") == ("", 0)
    )


def test_signals_that_cannot_be_compared_are_refused(history, measured):
    for signal, told in (
        ("velocity", "there are several such, velocity_X"),
        ("velocity_Q", "--signal velocity_Q: there is no such signal; did you mean velocity_"),
        ("velocity_Z", "velocity_Z does not move"),
    ):
        with pytest.raises(RequestError, match=told):
            compare_measured(history, measured, signal)


def test_a_friction_law_that_is_not_in_the_history_is_refused(history, measured):
    given = read_history(history)
    given.data.attrs["friction_law"] = "mine, given in Python"
    with pytest.raises(RequestError, match="its friction law was given in Python"):
        package.compare_measured(given, measured)


# The command


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A record with one line, 5 % below the strongest simulated one; nothing may change it."""
    return csv_file(
        tmp_path_factory.mktemp("rig") / "rig.csv",
        tones([(1000.0, 20.0)], noise=1.0, samples=25_601),
        "time (s),v (mm/s)",
    )


def test_the_command_writes_table_summary_and_figure(drumsqueal, history, rig, tmp_path, as_kept):
    folder = tmp_path / "out"
    arguments = ["compare", str(history.parent), str(rig), "-o", str(folder)]
    status, out, error = drumsqueal(*arguments, "--signal", "velocity_Y", "--from", "0.5 s", "--within", "3%")
    assert (status, error) == (0, "")
    as_kept("compare", out, folder)
    assert {path.name for path in folder.iterdir()} == {"compare.csv", "compare.json", "compare.png"}
    found = json.loads((folder / "compare.json").read_text())
    assert found["verdict"].startswith("The strongest measured line, 1000.0 Hz,")
    assert " ".join(found["verdict"].split()) in " ".join(out.split())
    assert found["measured"]["from_s"] == pytest.approx(0.5)
    assert found["pairs_within"] == 0.03
    rows = list(csv.DictReader((folder / "compare.csv").read_text().splitlines()))
    assert float(rows[0]["measured_Hz"]) == pytest.approx(1000.0, abs=0.05)
    assert {row["line"] for row in rows[len(found["lines"]) :]} <= {
        f"{kind}, not {what}" for kind in ("simulated", "predicted") for what in ("measured", "measurable")
    }
    before = (folder / "compare.csv").read_bytes()
    status, out, error = drumsqueal(*arguments)
    assert (status, out) == (2, "")
    assert "exists; add --overwrite" in error
    assert (folder / "compare.csv").read_bytes() == before


def test_a_record_without_a_line_is_told(drumsqueal, history, tmp_path):
    file = csv_file(tmp_path / "noise.csv", tones([(1000.0, 0.0)], 1.0, noise=1.0), "time,x")
    status, out, error = drumsqueal(
        "compare", str(history), str(file), "-o", str(tmp_path / "out"), "--signal", "velocity_Y"
    )
    assert (status, error) == (0, "")
    assert "No line of the measured record stands out of its noise." in " ".join(out.split())
    assert "Measured lines" not in out  # nor an empty table
    assert "in parentheses" not in out


def test_a_harmonic_is_named_and_is_no_mode(drumsqueal, history, tmp_path):
    # The strongest line is the double of another, and near the unstable Y nonetheless: 2 × 712 Hz, and 1424.3 Hz.
    file = csv_file(tmp_path / "rig.csv", tones([(712.0, 5.0), (1424.0, 20.0)], 1.0, noise=0.1), "time (s),v (mm/s)")
    arguments = ["compare", str(history), str(file), "-o", str(tmp_path / "out"), "--signal", "velocity_Y"]
    status, out, error = drumsqueal(*arguments)
    assert (status, error) == (0, "")
    (row,) = [row.split() for row in out.splitlines() if row.strip().startswith("1424.0")]
    assert row[-4:] == ["2", "×", "712.00", "-"]
    told = " ".join(out.split())
    assert "1424.0 Hz, the 2nd harmonic of 712.0 Hz, is not simulated; its fundamental, 712.0 Hz, lies 50 %" in told
    assert "Of 2 measured lines, 1 of them a harmonic, none has a simulated one" in told
    assert "levels are those of rms values, in dB re 1 nm/s (ISO 1683)" in told
    found = json.loads((tmp_path / "out" / "compare.json").read_text())
    strongest = found["lines"][0]
    assert (strongest["harmonic_order"], strongest["nearest_mode"]) == (2, None)
    assert strongest["fundamental_Hz"] == pytest.approx(712.0, abs=0.01)
    assert strongest["level_dB"] == pytest.approx(20 * np.log10(20e-3 / np.sqrt(2) / 1e-9), abs=0.01)
    assert found["rms_of_0_dB"] == {"measured": 1e-9, "simulated": 1e-9}


def test_the_harmonic_of_a_line_that_is_simulated_alone_is_named(drumsqueal, history, tmp_path):
    file = csv_file(tmp_path / "rig.csv", tones([(2090.0, 20.0)], 1.0, noise=0.1), "time (s),v (mm/s)")
    arguments = ["compare", str(history), str(file), "-o", str(tmp_path / "out"), "--signal", "velocity_Y"]
    told = " ".join(drumsqueal(*arguments)[1].split())
    assert "(2 × 1051.70) -" in told
    assert (
        "2090.0 Hz, lies 0.64 % below the simulated 2103.4 Hz, the 2nd harmonic of 1051.7 Hz; "
        "its fundamental is not measured. Of 1 measured line, 1 of them a harmonic, 1 has" in told
    )


def test_a_line_is_no_harmonic_where_the_fundamental_was_measured_and_it_is_no_multiple_of_it(history):
    # The simulated pair of 2103.4 Hz is a harmonic of 1051.7 Hz, whose own pair is 1045 Hz: half of 2090.
    record = recorded(*tones([(1045.0, 2e-2), (2103.4, 5e-3)]), "m/s")
    found = compare_measured(history, record, "velocity_Y")
    assert [line.harmonic_order for line in found.lines] == [None, None]
    assert all(line.simulated_is_pair for line in found.lines)
    assert all(line.nearest_mode is not None for line in found.lines)


def test_every_heading_of_the_table_is_another(drumsqueal, history, rig, tmp_path):
    out = drumsqueal("compare", str(history), str(rig), "-o", str(tmp_path / "out"), "--signal", "velocity_Y")[1]
    lines = out.splitlines()
    rule = next(k for k, line in enumerate(lines) if "──" in line)
    words = " ".join(lines[rule - 3 : rule]).split()
    assert {"measured", "simulated", "mode", "harmonic,", "dB", "nm/s", "Δf", "ΔL"} <= set(words)
    assert "apart" not in words


def test_relative_levels_tell_what_0_dB_is(history):
    for unit, told in (("Pa", "measured 0.7071 Pa rms, 91.0 dB re 20 µPa (ISO 1683); "), ("", "rms without a unit; ")):
        found = compare_measured(history, recorded(*tones([(1051.7, 1.0)]), unit), "velocity_Y")
        # 2e-2 m/s, the strongest of the simulated lines: 20 lg(2e-2/√2/1e-9) dB.
        assert told + "simulated 0.01414 m/s rms, 143.0 dB re 1 nm/s (ISO 1683)" in found.notes[0]


def test_harmonics_are_multiples_of_lines_that_stand_on_their_own():
    #      fundamental, 2 ×, 3 × off by a little, 2.5 ×, a faint one, the double of that, 4 × the first, 5 × too far
    # off, a stronger fundamental, and what is 9 × the first and 6 × that one
    lines = [1000.0, 2000.0, 3000.4, 2500.0, 700.0, 1400.0, 4000.0, 5000.6, 1500.0, 9000.0]
    amplitude = [1.0, 3.0, 0.1, 0.2, 0.004, 0.05, 0.1, 0.1, 2.0, 0.1]
    order = np.argsort(-np.array(amplitude))
    found = find_harmonics(np.array(lines)[order], np.array(amplitude)[order], 1.0)
    named = {lines[order[k]]: each and (each.order, lines[order[each.fundamental]]) for k, each in enumerate(found)}
    # 1400 Hz is 22 dB above 700 Hz, of which it might be the double; 4000 Hz is of 1000 Hz, not of its harmonic.
    assert named == {
        1000.0: None,
        2000.0: (2, 1000.0),
        3000.4: (2, 1500.0),
        2500.0: None,
        700.0: None,
        1400.0: None,
        4000.0: (4, 1000.0),
        5000.6: None,
        1500.0: None,
        9000.0: (6, 1500.0),
    }
    # Of two it is the stronger, be it the slower or the faster one.
    two = find_harmonics(np.array([1000.0, 1500.0, 3000.0]), np.array([2.0, 1.0, 0.1]), 1.0)
    assert two == [None, None, (3, 0)]
    # With a resolution of 60 Hz, 1000 Hz is less than 20 of them.
    assert find_harmonics(np.array([1000.0, 2000.0]), np.array([1.0, 1.0]), 60.0) == [None, None]


def test_levels_are_of_rms_values_over_the_reference_of_the_standard():
    # A sine with the rms value of 1 mm/s, 1 m/s², 1 µm, 1 Pa, 1 N; the last two have none in ISO 1683.
    for unit, rms, wanted in (
        ("m/s", 1e-3, 120.0), ("m/s^2", 1.0, 120.0), ("m", 1e-6, 120.0), ("Pa", 1.0, 93.979), ("N", 1.0, 120.0),
        ("rad/s", 1e-3, -60.0), ("N*m", 10.0, 20.0),
    ):  # fmt: skip
        assert float(level_dB(np.sqrt(2) * rms, level_reference(unit).rms)) == pytest.approx(wanted, abs=1e-3)
    assert level_reference("N*m").written == "1 N*m"
    assert level_reference("m").written == "1 pm (ISO 1683)"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["HISTORY", "none.csv"], "none.csv: there is no such file"),
        (["none.nc", "RIG"], "none.nc: there is no such file"),
        (["RIG", "RIG"], "this is not a history of drumsqueal"),
        (["HISTORY", "HISTORY"], "this is an HDF5 or NetCDF file; CSV, UFF58 and WAV are read"),
        (["HISTORY", "RIG", "--signal", "nothing"], "--signal nothing: there is no such signal"),
        (["HISTORY", "RIG", "--channel", "2"], "--channel 2: there is no such channel"),
        (["HISTORY", "RIG", "--rate", "5 m"], "--rate 5 m: write a rate"),
        (["HISTORY", "RIG", "--rate", "0"], "--rate 0: write a rate"),
        (["HISTORY", "RIG", "--from", "now"], "--from now: write a time"),
        (["HISTORY", "RIG", "--until", "0.0001"], "0 to 0.0001 s hold 3 samples, at least 64 are needed"),
        (["HISTORY", "RIG", "--from", "-1"], "--from -1 s: RIG has 0 to 1 s; take a time within it"),
        (["HISTORY", "RIG", "--until", "99"], "--until 99 s: RIG has 0 to 1 s; take a time within it"),
        (["HISTORY", "RIG", "--unit", "volt"], "--unit volt: this unit is not known; write one such as"),
        (["HISTORY", "RIG", "--unit", "furlong"], "or made of length m, cm, mm, µm, nm, pm, in, ft; time s, ms, min;"),
        (["HISTORY", "RIG", "--within", "2"], "--within 2: write a fraction"),
        (["HISTORY"], "Missing argument 'MEASURED'"),
    ],
)
def test_wrong_requests_are_told_in_one_line_and_write_nothing(drumsqueal, history, rig, tmp_path, arguments, told):
    names = {"HISTORY": str(history), "RIG": str(rig)}
    folder = tmp_path / "out"
    status, out, error = drumsqueal("compare", *(names.get(a, a) for a in arguments), "-o", str(folder))
    assert (status, out) == (2, "")
    assert told.replace("RIG", str(rig)) in error
    assert error.count("\n") == 1
    assert not folder.exists()


@pytest.mark.parametrize(
    ("part", "told"),
    [
        (["--from", "-1"], "--from -1 s: WHAT has 0 to 0.5 s; take a time within it"),
        (["--until", "99"], "--until 99 s: WHAT has 0 to 0.5 s; take a time within it"),
        (["--from", "0.3", "--until", "0.2"], "--from 0.3 s is not before --until 0.2 s; WHAT has 0 to 0.5 s"),
    ],
)
def test_a_part_beyond_the_record_is_refused_in_the_same_words_everywhere(drumsqueal, history, tmp_path, part, told):
    file = csv_file(tmp_path / "rig.csv", tones([(100.0, 1.0)], rate=1000.0, samples=501), "time,v")
    for what, arguments in (
        ("the history", ["export", str(history), "--to", "csv", "-o", str(tmp_path / "a.csv")]),
        ("the history", ["animate", str(history), "-o", str(tmp_path / "a.gif")]),
        (str(file), ["compare", str(history), str(file), "-o", str(tmp_path / "out")]),
    ):
        status, out, error = drumsqueal(*arguments, *part)
        assert (status, out) == (2, "")
        assert told.replace("WHAT", what) in error


def test_the_measured_file_is_never_replaced(drumsqueal, history, tmp_path):
    file = csv_file(tmp_path / "compare.csv", tones([(1000.0, 1.0)], 0.1), "time,v")
    before = file.read_bytes()
    status, _, error = drumsqueal("compare", str(history), str(file), "-o", str(tmp_path), "--overwrite")
    assert status == 2
    assert f"{file} would replace {file}, which is read or written, too" in error
    (tmp_path / "sub").mkdir()
    other = tmp_path / "sub" / ".." / "compare.csv"
    for arguments in (
        [str(other), "-o", str(tmp_path)],  # by another name
        [str(file), "-o", str(tmp_path / "out"), "--json", str(other)],
        [str(file), "-o", str(tmp_path / "out"), "--json", str(history)],
        [str(file), "-o", str(tmp_path / "sub"), "--json", str(tmp_path / "sub" / "compare.csv")],
    ):
        status, out, error = drumsqueal("compare", str(history), *arguments, "--overwrite")
        assert (status, out, error.count("\n")) == (2, "", 1)
        assert "which is read or written, too; name another with " in error
        assert file.read_bytes() == before
    assert read_history(history).complete
    assert not (tmp_path / "out").exists()


def test_swapped_arguments_are_recognised(drumsqueal, history, rig, tmp_path):
    status, _, errors = drumsqueal("compare", str(rig), str(history), "-o", str(tmp_path / "out"))
    assert (status, errors.count("\n")) == (2, 1)
    assert f"the history comes first; write drumsqueal compare {history} {rig}" in errors
