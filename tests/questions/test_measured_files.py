"""Measured files as others write them are read to the last digit; what cannot be read is refused in one line."""

import re
import struct
import tracemalloc
import warnings

import numpy as np
import pytest
import pyuff
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import wavfile

from drumsqueal.errors import RequestError
from drumsqueal.files.universal import SYSTEMS, type_of, units_of
from drumsqueal.questions.compare.measured import _wav_of, read_measured
from drumsqueal.questions.compare.record import UnevenError, even_sampling, parse_unit

RATE, COUNT = 51_200.0, 400
TIME = np.arange(COUNT) / RATE
VALUES = np.sin(2 * np.pi * 1000.0 * TIME) + 0.5 * np.random.default_rng(1).normal(size=COUNT) + 3.0


def lines_of(columns, separator=",", comma=False):
    rows = [separator.join(map(repr, row)) for row in np.column_stack(columns).tolist()]
    return [row.replace(".", ",") if comma else row for row in rows]


def write(path, header, columns, separator=",", comma=False, encoding="utf-8"):
    path.write_bytes(("\n".join([*header, *lines_of(columns, separator, comma)]) + "\n").encode(encoding))
    return path


@pytest.fixture
def file(tmp_path):
    return tmp_path / "measured.txt"


HEADERS = {
    "none": [],
    "names with units": ["{time} [s]{sep}v (mm/s)"],
    "names, then units": ["{time}{sep}v", "s{sep}mm/s"],
    "lines before": ["Measurement 7", "Date: 2026-03-01", "", "{time} (s){sep}v (mm/s)"],
    "comments": ["# made by hand", "# {time} (s){sep}v (mm/s)"],
    "quoted": ['"{time} (s)"{sep}"v (mm/s)"'],
}


@pytest.mark.thorough
@given(
    separator=st.sampled_from([",", ";", "\t", " ", "   "]),
    comma=st.booleans(),
    header=st.sampled_from(sorted(HEADERS)),
    time=st.sampled_from(["time", "t", "Zeit", "Temps"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    values=st.lists(st.floats(-1e9, 1e9).filter(lambda x: x == 0 or abs(x) > 1e-9), min_size=64, max_size=80),
)
@settings(derandomize=True, max_examples=100)
def test_a_table_is_read_as_it_was_written(tmp_path_factory, separator, comma, header, time, encoding, values):
    if np.ptp(values) == 0:
        values[0] += 1.0
    comma = comma and separator != ","
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    written = [line.format(time=time, sep=separator) for line in HEADERS[header]]
    write(path, written, [TIME[: len(values)], values], separator, comma, encoding)
    found = read_measured(path)
    factor = 1.0 if header == "none" else 1e-3
    np.testing.assert_array_equal(found.values, np.array(values) * factor)
    assert found.sample_rate == pytest.approx(RATE, rel=1e-12)
    assert (found.unit, found.quantity) == (("", "") if header == "none" else ("m/s", "velocity"))
    assert found.name == ("column 2" if header == "none" else "v")


def test_channels_are_chosen_by_name_or_number(file):
    write(file, ["time (s),left (g),right (g)"], [TIME, VALUES, 2 * VALUES])
    for asked in ("right", "RIGHT", "2"):
        found = read_measured(file, asked)
        assert found.name == "right"
        np.testing.assert_allclose(found.values, 2 * 9.80665 * VALUES, rtol=1e-15)
    for asked, told in ((None, "2 channels, 1 'left', 2 'right'; choose"), ("3", "no such channel"), ("x", "no such")):
        with pytest.raises(RequestError, match=told):
            read_measured(file, asked)


@pytest.mark.parametrize("bom", ["", "\ufeff"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", ";\n"])
def test_line_ends_and_trailing_separators(file, bom, end):
    file.write_bytes((bom + end.join(["t;v", *lines_of([TIME, VALUES], ";")]) + end).encode())
    np.testing.assert_array_equal(read_measured(file).values, VALUES)


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("letter", ["D", "d"])
def test_exponents_of_fortran_are_read(file, comma, letter):
    columns = [[f"{each:.12E}".replace("E", letter) for each in column] for column in (TIME, VALUES)]
    rows = [("; " if comma else ", ").join(row) for row in zip(*columns, strict=True)]
    text = "\n".join(rows).replace(".", ",") if comma else "\n".join(rows)
    file.write_text(f"t [s]{';' if comma else ','}mic 1D2\n{text}\n")
    found = read_measured(file)
    np.testing.assert_allclose(found.values, VALUES, rtol=1e-12)
    assert found.name == "mic 1D2"


def test_a_single_column_with_decimal_commas_is_not_two(file):
    write(file, ["pressure"], [np.arange(100) + 0.5], comma=True)
    np.testing.assert_array_equal(read_measured(file, rate=1e3).values, np.arange(100) + 0.5)


def test_a_table_without_a_time_column_takes_a_rate(file):
    write(file, ["a,b"], [VALUES, VALUES**2])
    with pytest.raises(RequestError, match="neither a time column nor a sample rate"):
        read_measured(file, "b")
    found = read_measured(file, "b", rate=RATE)
    assert (found.sample_rate, found.start_s) == (RATE, 0.0)
    np.testing.assert_array_equal(found.values, VALUES**2)


def test_a_count_of_the_rows_is_no_time(file):
    write(file, [], [np.arange(1.0, COUNT + 1), VALUES])
    with pytest.raises(RequestError, match="neither a time column"):
        read_measured(file)
    write(file, ["sample,x"], [np.arange(COUNT), VALUES])
    np.testing.assert_array_equal(read_measured(file, "x", rate=RATE).values, VALUES)


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("µs", 1e6), ("min", 1 / 60)])
def test_times_in_other_units(file, unit, factor):
    write(file, [f"Zeit [{unit}];v [mm/s]"], [TIME * factor, VALUES], ";", encoding="latin-1")
    assert read_measured(file).sample_rate == pytest.approx(RATE, rel=1e-12)
    write(file, [f"time_{unit},v"], [TIME * factor, VALUES])
    assert read_measured(file).sample_rate == pytest.approx(RATE, rel=1e-12)


@pytest.mark.parametrize(
    "header", ["Zeit/ms\tv/(mm/s)", "t / ms\tv/mm/s", "Time, ms\tv, mm/s", "TIME MS\tv [mm/s]", "t_ms\tv in mm/s"]
)
def test_units_beside_names_however_they_are_written(file, header):
    write(file, [header], [1e3 * TIME, VALUES], "\t", comma=True)
    found = read_measured(file)
    assert found.sample_rate == pytest.approx(RATE, rel=1e-12)
    assert (found.name, found.unit) == ("v", "m/s")


def test_names_without_units_stay_whole(file):
    write(file, ["time (s);left/right;Vib g;front, left"], [TIME, VALUES, VALUES, VALUES], ";")
    with pytest.raises(RequestError, match="1 'left/right', 2 'Vib g', 3 'front, left'"):
        read_measured(file)


def test_letters_of_windows_are_read(file):
    write(file, ["Zeit [s];Träger – oben [m/s²]"], [TIME, VALUES], ";", comma=True, encoding="cp1252")
    found = read_measured(file)
    assert (found.name, found.unit) == ("Träger – oben", "m/s^2")


def test_a_count_of_the_rows_is_no_channel(file):
    write(file, ["Date:\t2026", "Axis:\ts"], [np.arange(1.0, COUNT + 1), TIME, VALUES], "\t")
    np.testing.assert_array_equal(read_measured(file).values, VALUES)


def test_times_of_the_clock_are_refused_with_the_cure(file):
    file.write_text("Time;v\n" + "".join(f"00:00:{t:09.6f};{v}\n" for t, v in zip(TIME, VALUES, strict=True)))
    with pytest.raises(RequestError, match="times in seconds, not as dates or clocks"):
        read_measured(file)


def test_an_unknown_unit_of_time_is_refused(file):
    write(file, ["time (h),v"], [TIME, VALUES])
    with pytest.raises(RequestError, match="unit of time 'h' is not known"):
        read_measured(file)


def test_times_that_were_rounded_are_even(file):
    rows = [f"{t:.6g},{v!r}" for t, v in zip((5 + TIME).tolist(), VALUES.tolist(), strict=True)]
    file.write_text("\n".join(["time,v", *rows]))
    # Five digits after the point: half of one over the length of the record, in the worst of cases.
    assert read_measured(file).sample_rate == pytest.approx(RATE, rel=5e-6 / TIME[-1])


def test_jitter_is_taken_up_to_a_bound():
    random = np.random.default_rng(3)
    jitter = random.uniform(-1.0, 1.0, COUNT)
    assert even_sampling(TIME + 0.009 / RATE * jitter).rate == pytest.approx(RATE, rel=1e-4)
    with pytest.raises(UnevenError, match="intervals off its place"):
        even_sampling(TIME + 0.02 / RATE * jitter)
    for lost in (100, slice(100, 300)):
        with pytest.raises(UnevenError, match=r"s are missing between .*; cut the file there"):
            even_sampling(np.delete(TIME, lost))
    with pytest.raises(UnevenError, match="intervals off"):  # two gaps
        even_sampling(np.delete(TIME, [100, 300]))
    with pytest.raises(UnevenError, match="do not increase"):
        even_sampling(TIME[::-1])
    with pytest.raises(UnevenError, match="too coarse"):
        even_sampling(np.round(TIME, 3))


def test_a_line_that_is_missing_or_stands_twice_is_none_of_rounding():
    """Where the interval is one unit of the last digit, too."""
    times = np.array([round(k * 1e-4, 4) for k in range(1000)])
    with pytest.raises(UnevenError, match=r"^0\.0001 s are missing between 0\.0499 and 0\.0501 s"):
        even_sampling(np.delete(times, 500))
    with pytest.raises(UnevenError, match=r"^the time 0\.05 s is followed by 0\.05 s; put each line in its place"):
        even_sampling(np.insert(times, 500, times[500]))
    with pytest.raises(UnevenError, match=r"^the time 0\.0501 s is followed by 0\.05 s"):
        even_sampling(times[[*range(500), 501, 500, *range(502, 1000)]])


@pytest.mark.parametrize("missing", [slice(0, 3), slice(100, 120), slice(COUNT - 2, COUNT)])
def test_a_record_begins_where_its_first_sample_is_whether_that_has_a_time_or_not(missing):
    times = 5.0 + TIME
    times[missing] = np.nan
    found = even_sampling(times)
    assert found.start == pytest.approx(5.0, abs=1e-12)  # round-off of 5 s
    assert found.rate == pytest.approx(RATE, rel=1e-9)
    with pytest.raises(UnevenError, match="fewer than two times"):
        even_sampling(np.array([np.nan, 5.0, np.nan]))


def test_where_a_part_is_missing_no_rate_is_advised_that_would_join_what_is_left(file):
    rows = lines_of([TIME, VALUES])
    file.write_text("\n".join(["time,v", *rows[:100], *rows[200:]]))
    gap = f"{100 / RATE:.4g} s are missing between {TIME[99]:.9g} and {TIME[200]:.9g} s"
    with pytest.raises(RequestError) as refused:
        read_measured(file)
    assert str(refused.value).endswith(f"{gap}; cut the file there, or resample it evenly")


def test_uneven_times_are_refused_unless_a_rate_is_given(file):
    write(file, ["time,v"], [TIME**1.1, VALUES])
    with pytest.raises(RequestError, match=r"not evenly spaced, at .* s a time lies .* intervals off its place"):
        read_measured(file)
    found = read_measured(file, rate=1e4)
    assert found.sample_rate == 1e4
    assert "the sample rate is that of --rate, not of the column 'time'" in found.remarks
    np.testing.assert_array_equal(found.values, VALUES)


@pytest.mark.parametrize("hole", ["", "NaN", "n/a", "-"])
def test_what_is_missing_is_told(file, hole):
    rows = lines_of([TIME, VALUES])
    for k in (50, 51, 390):
        rows[k] = f"{float(TIME[k])!r},{hole}"
    file.write_text("\n".join(["time (s),v (m/s)", *rows]))
    found = read_measured(file)
    np.testing.assert_array_equal(found.values, VALUES[52:390])
    assert found.start_s == pytest.approx(TIME[52])
    (told,) = found.remarks
    assert told.startswith(
        "3 of 400 samples are missing, the first at 0.000976562 s: the longest stretch without a gap is taken"
    )


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("0.1,overload", "line 201: 'overload' is not a number"),
        ("0.1", "line 201: there are 1 columns"),
        ("0.1,1_0", "not a n"),
    ],
)
def test_a_row_that_is_none_is_refused_with_its_line(file, line, told):
    rows = lines_of([TIME, VALUES])
    rows[199] = line
    file.write_text("\n".join(["time (s),v (m/s)", *rows]))
    with pytest.raises(RequestError, match=told):
        read_measured(file)


def test_a_last_line_that_was_cut_off_is_left_away(file):
    rows = lines_of([TIME, VALUES])
    file.write_text("\n".join(["time (s),v (m/s)", *rows[:-1], "0.00"]))
    found = read_measured(file)
    np.testing.assert_array_equal(found.values, VALUES[:-1])
    assert found.remarks == ("the last line, 401, is incomplete and left out",)


def test_commas_that_stand_for_two_things_are_refused(file):
    file.write_text("time,v\n" + "".join(f"0,{k:03d},1,{k % 7}\n" for k in range(100)))
    with pytest.raises(RequestError, match="commas stand for two things"):
        read_measured(file)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "is empty"),
        (b"nothing but words\nand more of them\n", "no table of numbers"),
        (b"\x89HDF\r\n\x1a\n" + bytes(100), "HDF5 or NetCDF file; CSV, UFF58 and WAV are read"),
        (b"PK\x03\x04" + bytes(100), "a zip archive, as spreadsheets are"),
        (bytes(range(256)) * 4, "unknown format"),
        (b"time,v\n0,1\n1e-3,2\n2e-3,1\n", "3 samples are too few"),
        (b"time,v\n0,1\n", "1 sample is too few; at least 64 are needed"),
        (b"time\n" + b"".join(b"%g\n" % (k / 1e3) for k in range(100)), "no column next to the time"),
        (b"time,v\n" + b"".join(b"%g,%de200\n" % (k / 1e3, k) for k in range(100)), "'v' is 9.9e.201 without a unit"),
        (b"time,v (m)\n" + b"".join(b"%g,%de-200\n" % (k / 1e3, k) for k in range(100)), "'v' is 9.9e-199 m at the"),
        (b"time,v\n" + b"".join(b"%g,1\n" % (k / 1e3) for k in range(100)), "'v' is constant"),
        (b"RIFF\x10\x00\x00\x00WAVEjunk", "damaged"),
        (b"    -1\n    58\nNONE\n", "damaged or cut short|cut short"),
    ],
)
def test_what_is_no_measured_file_is_refused(file, content, told):
    file.write_bytes(content)
    with pytest.raises(RequestError, match=told) as caught:
        read_measured(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


def test_files_that_are_not_there_are_refused(tmp_path):
    with pytest.raises(RequestError, match="there is no such file"):
        read_measured(tmp_path / "none.csv")
    with pytest.raises(RequestError, match="is a folder"):
        read_measured(tmp_path)


def test_a_part_is_taken_by_its_times(file):
    write(file, ["time (s),v"], [TIME + 1.0, VALUES])
    found = read_measured(file, first=1.0 + 100 / RATE, last=1.0 + 299 / RATE)
    np.testing.assert_array_equal(found.values, VALUES[100:300])
    assert found.start_s == pytest.approx(1.0 + 100 / RATE, rel=1e-12)
    with pytest.raises(RequestError, match=r"--from 2 s: .* has 1 to 1.00779297 s; take a time"):
        read_measured(file, first=2.0)


@pytest.mark.parametrize(
    ("text", "si", "factor"),
    [
        ("mm/s", "m/s", 1e-3),
        ("g", "m/s^2", 9.80665),
        ("m/s2", "m/s^2", 1.0),
        ("m/s²", "m/s^2", 1.0),
        ("m s^-2", "m/s^2", 1.0),
        ("µm", "m", 1e-6),
        ("deg/s", "rad/s", np.pi / 180),
        ("Nm", "N*m", 1.0),
        ("Pa", "Pa", 1.0),
        ("in/s²", "m/s^2", 0.0254),
        ("um", "m", 1e-6),
        ("mil", "m", 2.54e-5),  # not of a turn
        ("50 mil", "m", 50 * 2.54e-5),  # of a calibration
    ],
)
def test_units(text, si, factor):
    found = parse_unit(text)
    assert found is not None
    assert found.si == si
    assert found.factor == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize("text", ["V", "EU", "dB", "", "9**9", "-1 m", "0 m", "s", "kg", "nan m", "furlong", "mil/s"])
def test_what_is_no_unit_of_a_known_quantity(text):
    assert parse_unit(text) is None


def test_a_unit_that_is_given_goes_before_that_of_the_file(file):
    write(file, ["time (s),v (V)"], [TIME, VALUES])
    assert "the unit 'V' is not known" in read_measured(file).remarks
    found = read_measured(file, unit="50 mm/s")
    assert (found.unit, found.quantity, found.remarks) == ("m/s", "velocity", ())
    np.testing.assert_allclose(found.values, 0.05 * VALUES, rtol=1e-15)


@pytest.mark.parametrize(
    ("own", "given", "told"),
    [
        ("m/s", "mm/s", ("the unit is that of --unit, mm/s, although the file states m/s",)),
        ("m/s", "g", ("the unit is that of --unit, g, although the file states m/s",)),
        ("m/s", "1000 mm/s", ()),
        ("g", "9.81 m/s²", ()),  # 0.03 % off
    ],
)
def test_a_unit_that_contradicts_the_file_is_told(file, own, given, told):
    write(file, [f"time (s),v ({own})"], [TIME, VALUES])
    assert read_measured(file, unit=given).remarks == told
    if own == "m/s":
        write_uff(file, units(1, 1.0), data_set())
        assert read_measured(file, unit=given).remarks == told


# WAV


@pytest.mark.parametrize(("kind", "scale"), [("u1", 2**7), ("i2", 2**15), ("i4", 2**31), ("f4", 1), ("f8", 1)])
def test_wav_of_each_kind(file, kind, scale):
    shape = 0.4 * np.sin(2 * np.pi * 1000.0 * TIME)
    data = np.column_stack([shape, -shape])
    stored = data if kind[0] == "f" else np.round(data * scale) + (128 if kind == "u1" else 0)
    wavfile.write(file, 51_200, stored.astype(kind))
    found = read_measured(file, "2")
    assert (found.sample_rate, found.unit, found.name) == (RATE, "", "channel 2")
    # Half a step of the samples; single precision keeps 24 bits.
    np.testing.assert_allclose(found.values, -shape, atol=0.51 / scale if kind[0] != "f" else 3e-8)


def test_wav_of_24_bits(file):
    shape = np.round(0.4 * 2**23 * np.sin(2 * np.pi * 1000.0 * TIME)).astype(int)
    body = b"".join(int(value).to_bytes(3, "little", signed=True) for value in shape)
    form = struct.pack("<4sIHHIIHH", b"fmt ", 16, 1, 1, 51_200, 3 * 51_200, 3, 24)
    data = struct.pack("<4sI", b"data", len(body)) + body
    file.write_bytes(struct.pack("<4sI4s", b"RIFF", 4 + len(form) + len(data), b"WAVE") + form + data)
    np.testing.assert_array_equal(read_measured(file).values, shape / 2**23)


def test_wav_that_is_cut_short_or_clipped(file):
    wavfile.write(file, 51_200, np.clip(40_000 * np.sin(2 * np.pi * 1000 * TIME), -32_768, 32_767).astype("i2"))
    assert "samples are at full scale" in read_measured(file).remarks[0]
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(RequestError, match="cut short"):
        read_measured(file)


def chunk(name, content, stated=None, order="<"):
    size = len(content) if stated is None else stated
    return struct.pack(f"{order}4sI", name, size & 0xFFFFFFFF) + content + bytes(len(content) % 2)


def wav(*chunks, stated=None, form=b"RIFF", order="<"):
    body = b"WAVE" + b"".join(chunks)
    return struct.pack(f"{order}4sI", form, (len(body) if stated is None else stated) & 0xFFFFFFFF) + body


STORED = np.round(2**14 * np.sin(2 * np.pi * 1000.0 * TIME)).astype("<i2")
PCM = struct.pack("<HHIIHH", 1, 1, 51_200, 2 * 51_200, 2, 16)
# Of any 16 bit PCM; Microsoft's identifier of it ends in the code of the older header.
EXTENSIBLE = struct.pack("<HHIIHHHHIH14s", 0xFFFE, 1, 51_200, 2 * 51_200, 2, 16, 22, 16, 4, 1,
                         bytes.fromhex("000000001000800000aa00389b71"))  # fmt: skip
SIZES = {"FFFFFFFF": (0xFFFFFFFF, 0xFFFFFFFF), "none": (0, 0), "the header's": (36, 0), "of 2 GB": (2**31, 2**31 - 256)}


@pytest.mark.parametrize("form", [PCM, EXTENSIBLE], ids=["PCM", "extensible"])
@pytest.mark.parametrize("sizes", SIZES)
@pytest.mark.parametrize("torn", [b"", b"\x01"], ids=["whole", "torn"])
def test_a_wav_of_a_stream_is_read_to_its_end_and_that_is_told(file, form, sizes, torn):
    whole, stated = SIZES[sizes]
    others = chunk(b"bext", b"odd"), chunk(b"LIST", b"INFOx"), chunk(b"fact", bytes(4))
    data = chunk(b"data", STORED.tobytes(), stated) + torn
    file.write_bytes(wav(chunk(b"fmt ", form), *others, data, stated=whole))
    found = read_measured(file)
    np.testing.assert_array_equal(found.values, STORED / 2**15)
    assert found.sample_rate == RATE
    (told,) = found.remarks
    assert told.startswith(f"the file states {stated} bytes of samples")
    assert told.endswith("it is read to its end, 800 bytes")


def test_a_stream_is_not_copied_to_state_its_sizes(file):
    samples = bytes(2**22)
    file.write_bytes(wav(chunk(b"fmt ", PCM), chunk(b"data", samples, -1), stated=-1))
    tracemalloc.start()
    try:
        found = _wav_of(file, np.memmap(file, np.uint8, "r").data)
        assert tracemalloc.get_traced_memory()[1] < 2**16  # of chunks and words; the samples are 4 MiB
    finally:
        tracemalloc.stop()
    assert (found.at, found.size, found.stated) == (44, 2**22, 2**32 - 1)


@pytest.mark.parametrize(("whole", "long"), [(872, 800), (0, 800), (0, 0), (2**64 - 1, 2**64 - 1)])
def test_rf64_states_its_sizes_elsewhere(file, whole, long):
    sizes = chunk(b"ds64", struct.pack("<QQQI", whole, long, 400, 0))
    file.write_bytes(wav(sizes, chunk(b"fmt ", PCM), chunk(b"data", STORED.tobytes(), -1), stated=-1, form=b"RF64"))
    found = read_measured(file)
    np.testing.assert_array_equal(found.values, STORED / 2**15)
    assert len(found.remarks) == (long != 800)


def test_a_stream_of_the_other_byte_order(file):
    form, data = struct.pack(">HHIIHH", 1, 1, 51_200, 2 * 51_200, 2, 16), STORED.astype(">i2").tobytes()
    chunks = chunk(b"fmt ", form, order=">"), chunk(b"data", data, -1, ">")
    file.write_bytes(wav(*chunks, stated=-1, form=b"RIFX", order=">"))
    np.testing.assert_array_equal(read_measured(file).values, STORED / 2**15)


@pytest.mark.parametrize(
    ("chunks", "stated", "told"),
    [
        ([chunk(b"fmt ", PCM), chunk(b"data", b""), chunk(b"LIST", STORED.tobytes())], None, "0 samples are too few"),
        ([chunk(b"fmt ", PCM), chunk(b"data", STORED.tobytes(), 900)], None, "cut short"),
        ([chunk(b"fmt ", PCM), chunk(b"data", STORED.tobytes(), 900)], 0, "cut short"),
        ([chunk(b"data", STORED.tobytes())], None, "lacks a chunk fmt or data"),
        ([chunk(b"fmt ", PCM)], 0, "lacks a chunk fmt or data"),
    ],
)
def test_a_wav_that_states_what_it_does_not_hold_is_refused(file, chunks, stated, told):
    file.write_bytes(wav(*chunks, stated=stated))
    with pytest.raises(RequestError, match=told):
        read_measured(file)


@pytest.mark.parametrize("stated", [-1, None], ids=["stream", "whole"])
@pytest.mark.parametrize(
    ("form", "told"),
    [
        ((1, 1, 51_200, 0, 0, 16), "1 channels, 16 bits a sample and 0 bytes for one sample of all channels"),
        ((1, 0, 51_200, 0, 2, 16), "states 0 channels"),
        ((3, 1, 51_200, 0, 4, 0), "0 bits a sample"),
        ((1, 4, 51_200, 0, 2, 16), "4 channels, 16 bits a sample and 2 bytes"),
        ((1, 1, 0, 0, 2, 16), "a sample rate of 0 Hz; give --rate"),
    ],
)
def test_a_wav_whose_header_is_damaged_is_refused_in_plain_words(file, form, told, stated):
    head = chunk(b"fmt ", struct.pack("<HHIIHH", *form))
    file.write_bytes(wav(head, chunk(b"data", STORED.tobytes(), stated), stated=stated))
    with pytest.raises(RequestError, match=told):
        read_measured(file)


def test_a_wav_that_ends_within_its_sizes_is_refused(file):
    file.write_bytes(wav(chunk(b"fmt ", PCM), chunk(b"ds64", b""), chunk(b"data", b"\0\0"), form=b"RF64"))
    with pytest.raises(RequestError, match="this WAV file is damaged"):
        read_measured(file)


# UFF58


def data_set(values: np.ndarray = VALUES, **more):
    return pyuff.prepare_58(
        **{
            "binary": 0,
            "id1": "velocity of the shoe",
            "id2": "NONE", "id3": "NONE", "id4": "NONE", "id5": "NONE",
            "func_type": 1, "ver_num": 1, "load_case_id": 0,
            "rsp_ent_name": "NONE", "rsp_node": 1, "rsp_dir": 1, "ref_ent_name": "NONE", "ref_node": 0, "ref_dir": 0,
            "abscissa_spacing": 1, "z_axis_value": 0.0, "abscissa_spec_data_type": 17,
            "ordinate_spec_data_type": 11, "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0,
            "data": values, "x": TIME[: len(values)], "ordinate_axis_units_lab": "NONE",
        } | more
    )  # fmt: skip


def units(code, length):
    return pyuff.prepare_164(
        units_code=code, units_description="units", temp_mode=1, length=length, force=1.0, temp=1.0, temp_offset=273.15
    )


def write_uff(path, *data_sets):
    path.unlink(missing_ok=True)
    with warnings.catch_warnings():  # pyuff leaves files open that it writes
        warnings.simplefilter("ignore", ResourceWarning)
        pyuff.UFF(str(path)).write_sets(list(data_sets), "overwrite")


@pytest.mark.parametrize(("beyond", "told"), [(0.0, 0), (1.0, 1)])
def test_samples_beyond_those_that_are_stated_are_told_unless_they_fill_up_a_line(file, beyond, told):
    write_uff(file, units(1, 1.0), data_set(np.append(VALUES, [beyond]), x=np.arange(COUNT + 1) / RATE))
    text = file.read_text()
    assert text.count(f"{COUNT + 1:10d}") == 1
    file.write_text(text.replace(f"{COUNT + 1:10d}", f"{COUNT:10d}"))
    found = read_measured(file)
    np.testing.assert_allclose(found.values, VALUES, rtol=1e-11)  # of twelve digits
    assert [remark.startswith("it states 400 samples and holds 401") for remark in found.remarks] == [True] * told


@pytest.mark.parametrize("binary", [0, 1])
def test_uff58_is_read(file, binary):
    write_uff(file, units(5, 1000.0), data_set(binary=binary), data_set(2 * VALUES, binary=binary, id1="other: x"))
    for asked in ("other", "other: x", "2"):
        found = read_measured(file, asked)
        # Twelve digits as text; the interval has six.
        np.testing.assert_allclose(found.values, 2e-3 * VALUES, rtol=1e-11)
        assert found.sample_rate == pytest.approx(RATE, rel=5e-6)
        assert (found.unit, found.name) == ("m/s", "other: x")
    with pytest.raises(RequestError, match="2 channels, 1 'velocity of the shoe', 2 'other: x'"):
        read_measured(file)


@pytest.mark.parametrize(
    ("system", "label", "kind", "wanted"),
    [
        (units(1, 1.0), "NONE", 11, ("m/s", 1.0)),
        (units(1, 3.28083989501312334), "NONE", 11, ("m/s", 1.0)),  # as some write it
        (units(9, 1000.0), "NONE", 8, ("m", 1e-3)),
        (units(7, 39.37), "NONE", 12, ("m/s^2", 0.0254)),
        # Pounds are 0.45359237 kg under standard gravity, 9.80665 m/s²; poundals without it.
        (units(2, 3.28), "NONE", 9, ("N", 0.45359237 * 9.80665)),
        (units(3, 1.0), "NONE", 13, ("N", 9.80665)),
        (units(4, 3.28), "NONE", 9, ("N", 0.45359237 * 0.3048)),
        (units(6, 100.0), "NONE", 15, ("Pa", 1e2)),
        (units(7, 39.37), "NONE", 15, ("Pa", 0.45359237 * 9.80665 / 0.0254**2)),
        (units(8, 1000.0), "NONE", 15, ("Pa", 9.80665e6)),
        (None, "mm/s", 11, ("m/s", 1e-3)),
        (None, "NONE", 11, ("", 1.0)),
        (None, "V", 0, ("", 1.0)),
        (units(1, 1.0), "g", 12, ("", 1.0)),  # they disagree
    ],
)
def test_the_units_of_uff58(file, system, label, kind, wanted):
    sets = [data_set(ordinate_spec_data_type=kind, ordinate_axis_units_lab=label)]
    write_uff(file, *([system] if system else []), *sets)
    found = read_measured(file)
    assert found.unit == wanted[0]
    np.testing.assert_allclose(found.values, wanted[1] * VALUES, rtol=1e-11)
    assert bool(found.remarks) == (label in ("g", "V"))


@pytest.mark.parametrize(
    ("kind", "direction", "wanted"),
    [
        (8, 6, ("rad", 1.0)),
        (11, -4, ("rad/s", 1.0)),
        (12, 5, ("rad/s^2", 1.0)),
        (9, 6, ("N*m", 1e-6)),
        (15, 6, ("Pa", 1e3)),
    ],
)
def test_about_an_axis_it_is_angles_and_torques(file, kind, direction, wanted):
    write_uff(file, units(5, 1000.0), data_set(ordinate_spec_data_type=kind, rsp_dir=direction))  # mm and mN
    found = read_measured(file)
    assert found.unit == wanted[0]
    np.testing.assert_allclose(found.values, wanted[1] * VALUES, rtol=1e-11)


def test_millimetres_and_newtons_are_a_system_of_units(file):
    write_uff(file, units(1, 1000.0), data_set(ordinate_spec_data_type=15))
    line = b"%10d%20s"
    file.write_bytes(file.read_bytes().replace(line % (1, b"units"), line % (10, b"units"), 1))  # pyuff writes no 10
    found = read_measured(file)
    np.testing.assert_allclose(found.values, 1e6 * VALUES, rtol=1e-11)  # N/mm²


def test_the_systems_of_units_are_those_of_dataset_164():
    # By the international foot and pound, and standard gravity: lbf = 0.45359237 kg · 9.80665 m/s², pdl = lb ft/s².
    foot, inch, pound, gravity = 0.3048, 0.0254, 0.45359237, 9.80665
    known = {
        1: (1.0, 1.0), 2: (foot, pound * gravity), 3: (1.0, gravity), 4: (foot, pound * foot), 5: (1e-3, 1e-3),
        6: (1e-2, 1e-2), 7: (inch, pound * gravity), 8: (1e-3, gravity), 10: (1e-3, 1.0),
    }  # fmt: skip
    assert SYSTEMS.keys() == known.keys()
    for code, units in known.items():
        assert units_of({"units_code": code}) == pytest.approx(units, rel=1e-11)
    assert units_of({"units_code": 9, "length": 1000.0, "force": 0.001}) == pytest.approx((1e-3, 1e3))
    assert units_of({"units_code": 9, "length": 0.0, "force": 1.0}) is None
    assert [type_of(quantity) for quantity in ("displacement", "velocity", "acceleration", "force", "pressure")] == [
        8, 11, 12, 9, 15,
    ]  # fmt: skip


def test_uff58_begins_when_it_says(file):
    write_uff(file, data_set(x=2.5 + TIME))
    found = read_measured(file, first=2.502)
    assert 0 <= found.start_s - 2.502 < 1 / RATE  # the first sample from then on
    assert found.values.size == VALUES.size - np.ceil(0.002 * RATE)


def test_uff58_with_times_of_its_own(file):
    write_uff(file, data_set(abscissa_spacing=0))
    found = read_measured(file)
    assert found.sample_rate == pytest.approx(RATE, rel=1e-4)  # six digits a time, of an interval of 2e-5 s
    np.testing.assert_allclose(found.values, VALUES, rtol=1e-11)


def test_spectra_in_uff58_are_refused(file):
    write_uff(file, data_set(VALUES + 1j * VALUES, func_type=4, abscissa_spec_data_type=18))
    with pytest.raises(RequestError, match="is complex; export the time record"):
        read_measured(file)
    write_uff(file, data_set(func_type=2, abscissa_spec_data_type=18))
    with pytest.raises(RequestError, match="not over time"):
        read_measured(file)


@pytest.mark.parametrize("binary", [0, 1])
def test_uff58_of_one_data_set_is_read(file, binary):
    write_uff(file, units(1, 1.0), data_set(binary=binary))
    assert read_measured(file).values == pytest.approx(VALUES, rel=1e-11)


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("kept", [0.5, 0.97])
def test_uff58_that_is_cut_short_is_refused(file, binary, kept):
    write_uff(file, units(1, 1.0), data_set(binary=binary))
    whole = file.read_bytes()
    file.write_bytes(whole[: round(kept * len(whole))])
    with pytest.raises(RequestError, match="cut short"):
        read_measured(file)


def test_uff_without_data_sets_58_is_refused(file):
    write_uff(file, units(1, 1.0))
    with pytest.raises(RequestError, match=r"no data set 58 .* but 164"):
        read_measured(file)


# UFF58 as others write it


def by_hand(*, name="front", form=2, spacing=1, start=0.0, step=1 / RATE, axis=("Time", "s"), unit="NONE", kind=58):
    """The lines of a data set 58 before its numbers, in the columns of the definition; a velocity in time."""
    ids = [name, "NONE", "NONE", "NONE", "NONE"]
    dof = f"{1:5d}{1:10d}{0:5d}{0:10d} {'NONE':10s}{1:10d}{1:4d} {'NONE':10s}{0:10d}{0:4d}"
    line = f"{form:10d}{COUNT:10d}{spacing:10d}{start:13.5E}{step:13.5E}{0.0:13.5E}"
    about = [(17, *axis), (11, "Velocity", unit), (0, "NONE", "NONE"), (0, "NONE", "NONE")]
    return [f"{kind:>6}", *ids, dof, line, *(f"{code:10d}{0:5d}{0:5d}{0:5d} {a:20s} {b:20s}" for code, a, b in about)]


def system(code, length, force=1.0):
    return [f"{164:6d}", f"{code:10d}{'':20s}{1:10d}", f"{length:25.17E}{force:25.17E}{1.0:25.17E}", f"{273.15:25.17E}"]


def rows(values, columns=4, layout="{:20.12E}"):
    written = [layout.format(value) for value in np.asarray(values).tolist()]
    return ["".join(written[k : k + columns]) for k in range(0, len(written), columns)]


def universal(*sets, mark="    -1"):
    return "\n".join([line for each in sets for line in (mark, *each, mark)]) + "\n"


def in_d(text):
    return re.sub(r"(?<=\d)E(?=[+-]\d)", "D", text)


PADDED = "    -1".ljust(80)
SPELLINGS = {
    "as defined": lambda text: text,
    "blanks": lambda text: "\n".join(line.ljust(80) for line in text.split("\n")[:-1]),
    "a few blanks": lambda text: text.replace("    -1\n", "    -1   \n"),
    "CR LF": lambda text: text.replace("\n", "\r\n"),
    "CR": lambda text: text.replace("\n", "\r"),
    "a byte order mark": lambda text: "\ufeff" + text,
    "the end of a file of DOS": lambda text: text + "\x1a",
    "D exponents": in_d,
    "d exponents": lambda text: in_d(text).replace("D+", "d+").replace("D-", "d-"),
    "e exponents": lambda text: in_d(text).replace("D", "e"),
}


@pytest.mark.parametrize("spelling", SPELLINGS)
@pytest.mark.parametrize("form", ["even", "uneven", "uneven, wider"])
def test_uff58_is_read_however_its_lines_are_filled(file, form, spelling):
    if form == "even":
        sets = [by_hand(form=4) + rows(VALUES)]
    else:  # by the definition times have six digits, and others write thirteen
        layout = "{:13.5E}" if form == "uneven" else "{:20.12E}"
        pairs = [layout.format(t) + f"{v:20.12E}" for t, v in zip(TIME.tolist(), VALUES.tolist(), strict=True)]
        sets = [by_hand(form=4, spacing=0, step=0.0) + ["".join(pairs[k : k + 2]) for k in range(0, COUNT, 2)]]
    text = SPELLINGS[spelling](universal(system(9, 1000.0), *sets))
    file.write_bytes(text.encode())
    found = read_measured(file)
    np.testing.assert_allclose(found.values, 1e-3 * VALUES, rtol=1e-12)  # 13 digits
    assert found.sample_rate == pytest.approx(RATE, rel=1e-4 if form == "uneven" else 5e-6)
    assert (found.name, found.unit) == ("front", "m/s")
    file.write_bytes(text.lstrip("\ufeff").encode("utf-16"))
    np.testing.assert_array_equal(read_measured(file).values, found.values)


@pytest.mark.parametrize("mark", ["    -1", PADDED])
def test_no_record_is_lost_without_a_word(file, mark):
    sets = [by_hand(name=name) + rows(VALUES, 6, "{:13.5E}") for name in ("front", "rear")]
    whole = universal(*sets, mark=mark)
    file.write_text(whole)
    with pytest.raises(RequestError, match="2 channels, 1 'front', 2 'rear'; choose"):
        read_measured(file)
    lines = whole.splitlines(keepends=True)
    marks = [k for k, line in enumerate(lines) if line.strip() == "-1"]
    for k in marks[1:]:
        file.write_text("\n" + "".join(lines[:k] + lines[k + 1 :]))  # the first dataset goes on to line 82 at least
        with pytest.raises(RequestError, match=r"cut short, or lacks a mark -1 from line 83 on"):
            read_measured(file)
    file.write_text(whole + universal(by_hand(name="third"), mark=mark).partition("\n")[2] + mark + "\n" + whole)
    with pytest.raises(RequestError, match="cut short, or lacks a mark"):  # of which there is an even number
        read_measured(file)


def test_numbers_that_fill_their_columns_are_told_apart(file):
    values = np.where(np.arange(COUNT) % 7 == 3, 1e-101, -1.0 - np.arange(COUNT) / 1000)
    # As the C library of Windows wrote exponents, and as Fortran writes one of three digits.
    written = ["-1.00000e+000".replace("1.00000", f"{-v:.5f}") if v < 0 else "  1.00000-101" for v in values.tolist()]
    lines = ["".join(written[k : k + 6]) for k in range(0, COUNT, 6)]
    file.write_text(universal(by_hand() + lines))
    np.testing.assert_allclose(read_measured(file).values, values, rtol=1e-15)


@pytest.mark.parametrize(
    ("order", "wanted"),
    [
        (["mm", "front", "m", "rear"], (1e-3, 1.0)),
        (["front", "rear", "mm"], (1e-3, 1e-3)),  # one behind the records
        (["front", "mm", "rear"], (1e-3, 1e-3)),
        (["front", "mm", "rear", "mm"], (1e-3, 1e-3)),
        (["front", "mm", "rear", "m"], (None, 1e-3)),
    ],
)
def test_units_hold_from_where_they_stand(file, order, wanted):
    sets = {"mm": system(10, 1000.0), "m": system(1, 1.0)}
    sets |= {name: by_hand(name=name, form=4) + rows(VALUES) for name in ("front", "rear")}
    file.write_text(universal(*(sets[each] for each in order)))
    for name, factor in zip(("front", "rear"), wanted, strict=True):
        found = read_measured(file, name)
        np.testing.assert_allclose(found.values, (factor or 1.0) * VALUES, rtol=1e-12)
        assert (found.unit, bool(found.remarks)) == (("m/s", False) if factor else ("", True))


@pytest.mark.parametrize("spacing", [0, 1])
@pytest.mark.parametrize(
    ("axis", "factor"),
    [
        (("Time", "ms"), 1e3),
        (("NONE", "us"), 1e6),
        (("NONE", "µs"), 1e6),
        (("NONE", "MSEC"), 1e3),
        (("Time [ms]", "NONE"), 1e3),
        (("Time (ms)", ""), 1e3),
        (("TIME, MS", "NONE"), 1e3),
        (("t/us", "NONE"), 1e6),
        (("Elapsed_time_ns", "NONE"), 1e9),
        (("ms", "NONE"), 1e3),
        (("Time in milliseconds", "NONE"), 1e3),
        (("Time (relative)", "s"), 1.0),
        (("Time", "NONE"), 1.0),
    ],
)
def test_the_unit_of_the_times_is_heeded_wherever_it_stands(file, axis, factor, spacing):
    numbers = VALUES if spacing else np.column_stack([factor * TIME, VALUES]).ravel()
    head = by_hand(form=4, spacing=spacing, step=factor / RATE, start=factor * 0.25, axis=axis)
    file.write_text(universal(head + rows(numbers)), encoding="utf-8")
    found = read_measured(file)
    assert found.sample_rate == pytest.approx(RATE, rel=5e-6)
    assert found.start_s == pytest.approx(0.25 if spacing else 0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("axis", "told"),
    [
        (("Frequency", "kHz"), "unit of time 'kHz' is not known"),
        (("Frequency (kHz)", "NONE"), "unit of time 'kHz' is not known"),
        (("Time", "rev"), "unit of time 'rev' is not known"),
        (("Time [ms]", "s"), r"labelled 'Time \[ms\]' and their unit 's'; give --rate"),
    ],
)
def test_a_unit_of_time_that_is_none_is_refused_unless_a_rate_is_given(file, axis, told):
    file.write_text(universal(by_hand(form=4, axis=axis) + rows(VALUES)))
    with pytest.raises(RequestError, match=told):
        read_measured(file)
    assert read_measured(file, rate=1e4).sample_rate == 1e4


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8"])
def test_letters_of_windows_are_read_in_uff58(file, encoding):
    head = by_hand(name="Träger 5.3D2 – oben", form=4, unit="mm/s²")
    head[9] = head[9].replace("  11", "  12", 1)
    file.write_bytes(universal(head + rows(VALUES)).encode(encoding))
    found = read_measured(file)
    assert (found.name, found.unit) == ("Träger 5.3D2 – oben", "m/s^2")
    np.testing.assert_allclose(found.values, 1e-3 * VALUES, rtol=1e-12)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("states", [True, False])
def test_binary_numbers_that_look_like_a_mark_are_numbers(file, order, end, states):
    size = 8 * COUNT if states else 0
    line = f"{58:6d}b{1 if order == '<' else 2:6d}{2:6d}{11:12d}{size:12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    numbers = np.array(VALUES, dtype=f"{order}f8").tobytes()
    if states:  # eight bytes of a number, and the first of the next
        numbers = numbers[:80] + b"\n    -1\n\x00\x00\x00\x00\x00\x00\x00\x40" + numbers[96:]
    sets = []
    for name in ("a", "b"):
        head = ["    -1", line, *by_hand(name=name, form=4, unit="µm/s")[1:]]
        sets += ["".join(each + end for each in head).encode("cp1252"), numbers, (PADDED + end).encode()]
    file.write_bytes(b"".join(sets))
    found = read_measured(file, "b")
    np.testing.assert_array_equal(found.values, np.frombuffer(numbers, dtype=f"{order}f8") * 1e-6)
    assert found.unit == "m/s"


def test_complex_numbers_and_damaged_ones_are_refused_by_name(file):
    file.write_text(universal(by_hand(form=5) + rows(np.repeat(VALUES, 2), 6, "{:13.5E}")))
    with pytest.raises(RequestError, match="'front' is complex; export the time record"):
        read_measured(file)
    lines = rows(VALUES, 6, "{:13.5E}")
    file.write_text(universal(system(1, 1.0), [*by_hand(), *lines[:9], lines[9].replace(".", "?", 1), *lines[10:]]))
    with pytest.raises(RequestError, match=r"txt, line 7: dataset 2 of the file, which begins there, of type 58, is"):
        read_measured(file)
    file.write_text(universal(by_hand() + lines[:-1]))
    with pytest.raises(RequestError, match="'front' holds 396 of its 400 samples; it is cut short"):
        read_measured(file)
