"""Which of several squeals a record is, and how the fit of one is reported in the units of the scene's file."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import RequestError
from drumsqueal.questions.compare.record import Measured
from drumsqueal.questions.fit import squeal as squeal_module
from drumsqueal.questions.fit import study as study_module
from drumsqueal.questions.fit.estimate import Estimate, Scale
from drumsqueal.questions.fit.record import RecordKind, RecordLine, RecordReading
from drumsqueal.questions.fit.squeal import (
    ChosenFit,
    Fitted,
    Overtones,
    SimulatedSqueal,
    Varied,
    check_fundamental,
    fit_squeals,
    overtones,
)
from drumsqueal.questions.fit.study import _report, _Result
from drumsqueal.scene import load_with_tables
from drumsqueal.scene.variation import Written

NOMINAL = Path(__file__).parents[2] / "scenarios" / "nominal.toml"
RATE = 8000.0


def line(f: float, size: float = 1.0) -> RecordLine:
    return RecordLine(
        frequency_Hz=f, frequency_uncertainty_Hz=0.1, growth_rate_1_per_s=None, growth_rate_uncertainty_1_per_s=None,
        amplitude=size,
    )  # fmt: skip


def squeal(
    *frequencies: float, size: float = 1.0, values: Any = None, unstable: tuple[float, ...] = ()
) -> SimulatedSqueal:
    scene: Any = SimpleNamespace(simulate=SimpleNamespace(sample_rate=RATE, duration=0.4))
    return SimulatedSqueal(
        tuple(line(f, size) for f in frequencies), np.zeros(3) if values is None else values, scene, unstable
    )


def estimate_of(x: Any, chi: float = 1.0, **more: Any) -> Estimate:
    x = np.atleast_1d(np.array(x, dtype=float))
    known: dict[str, Any] = {
        "covariance": np.eye(x.size) * 0.01, "open": np.zeros((0, x.size)), "determined": np.ones(x.size, dtype=bool),
        "chi_square": chi, "freedom": 1, "factor_95": 2.0,
    }  # fmt: skip
    return Estimate(x, **(known | more))


def fitted(
    x: Any = 0.1, chi: float = 1.0, before: Any = (100.0,), wanted: Any = 0.2, of: SimulatedSqueal | None = None,
    apart: float | None = None,
) -> Fitted:  # fmt: skip
    before, after = np.array(before, dtype=float), of or squeal(110.0)
    wanted = np.atleast_1d(np.array(wanted, dtype=float))
    return Fitted(estimate_of(x, chi), (line(120.0),), before, before * 1.1, after, after, wanted, 7, apart)


def test_an_attempt_meets_its_lines_within_three_times_their_uncertainty_and_is_heard_within_two_decibels():
    assert [fitted(chi=chi).met for chi in (8.9, 9.1)] == [True, False]
    assert fitted(chi=5.0).miss == 5.0
    assert [squeal_module._is_heard(fitted(apart=apart)) for apart in (None, 0.0, 1.9, 2.1)] == [
        False,
        True,
        True,
        False,
    ]
    known = fitted(wanted=(0.3, -0.4), before=(100.0, 900.0))
    # On half of the way, of length 0.5, the line of 100 Hz has come half as far to 120 Hz in its logarithm.
    assert known.shift(np.array([0.15, 0.2])) == pytest.approx(math.sqrt(1.2))
    assert known.shift(np.array([0.0, 0.0])) == 1.0
    assert fitted(wanted=(0.0, 0.0)).shift(np.array([0.3, 0.4])) == 1.0


def test_the_best_attempt_meets_its_lines_is_heard_and_changes_the_least():
    far, near, heard, missed = fitted(-0.5), fitted(0.2), fitted(-0.4, apart=1.0), fitted(0.01, chi=50.0)
    assert squeal_module._best([far, heard, near]) is heard
    assert squeal_module._best([far, near]) is near
    assert squeal_module._best([fitted(0.01, chi=60.0), missed, fitted(0.0, chi=55.0)]) is missed
    assert squeal_module._best([fitted((0.3, 0.4)), fitted((0.45, 0.0))]).estimate.x.tolist() == [0.45, 0.0]


@pytest.mark.parametrize(
    ("best", "other", "likely"),
    [
        # Costs (x/0.5)² of 0.04 and 4.0 or 4.1: less than 4 apart, or more, but never by how much the best is worse.
        ((0.1, None), (1.0, None), True), ((0.1, None), (1.01, None), False), ((1.5, None), (0.1, None), True),
        ((0.1, 1.0), (0.2, 3.9), True), ((0.1, 1.0), (0.2, 4.1), False), ((0.1, 3.0), (0.2, 4.1), True),
        ((0.1, None), (0.2, 9.0), True), ((0.1, 1.0), (0.2, None), True),
    ],
)  # fmt: skip
def test_another_fit_is_as_likely_by_its_overtones_and_the_change_of_the_numbers(best, other, likely):
    one, two = (fitted(x, apart=apart) for x, apart in (best, other))
    assert squeal_module._as_likely(two, one) == likely


def test_squeals_are_one_in_frequency_and_amplitude(monkeypatch):
    one = line(100.0, 2.0)
    for other, same in (
        (line(100.09, 2.0), True), (line(99.91, 2.0), True), (line(100.11, 2.0), False), (line(99.89, 2.0), False),
        (line(100.0, 2.058), True), (line(100.0, 1.942), True), (line(100.0, 2.064), False), (line(100.0, 1.94), False),
    ):  # fmt: skip
        assert squeal_module.is_same(one, other) == same
    a, b, c = squeal(100.0, 250.0), squeal(100.05, 400.0), squeal(100.0, size=1.5)
    monkeypatch.setattr(squeal_module, "scenes_that_squeal", lambda scene, progress: scene)
    monkeypatch.setattr(squeal_module, "settled", lambda scene, *_: scene)
    run: Any = SimpleNamespace(signal="", progress=None)
    assert squeal_module._squeals([a, None, b, c, a], run) == [a, c]  # pyright: ignore[reportArgumentType]


def test_squeals_are_fitted_by_the_line_that_is_nearest_to_the_strongest_one():
    far, near, out, below = squeal(131.0, 60.0), squeal(500.0, 104.0), squeal(135.1, 74.0), squeal(74.2)
    assert squeal_module._near([far, near, out, below], [line(100.0), line(135.0)]) == [near, far, below]


def test_lines_before_are_those_of_the_squeal_that_has_one_nearest_to_the_first():
    one, two = squeal(90.0, 205.0, 330.0), squeal(120.0, 199.0, 280.0)
    found = squeal_module._lines_before(np.array([103.0, 300.0]), [one, two])
    assert found.tolist() == [90.0, 330.0]  # ln 103/90 is 0.135, ln 120/103 0.153; ln 330/300 is 0.095
    assert squeal_module._lines_before(np.array([106.0, 300.0]), [one, two]).tolist() == [120.0, 280.0]


def tone(*sizes: float, f: float = 160.0, count: int = 4000, noise: float = 0.0) -> np.ndarray:
    time = np.arange(count) / RATE
    made = sum(size * np.sin(2 * np.pi * n * f * time + n) for n, size in enumerate(sizes, start=1) if size)
    return made + noise * np.random.default_rng(4).normal(size=count)


def test_overtones_are_levels_of_multiples_of_a_line_over_what_lies_beside_them():
    found = overtones(tone(2.0, 0.2, 0.0, 0.02, 0.5, noise=1e-3), RATE, 160.3)
    np.testing.assert_allclose(found.level[[0, 2, 3]], 20 * np.log10([0.1, 0.01, 0.25]), atol=0.1)
    # Of noise of rms s in a Hann window the squared amplitude is 6 s²/N in the mean, of which ln 2 is the median.
    floor = 20 * math.log10(1e-3 / 2 * math.sqrt(6 * math.log(2) / 4000))
    # Its median over some 45 bins scatters by 1 dB.
    np.testing.assert_allclose(found.noise, floor, atol=4)
    assert np.mean(found.noise) == pytest.approx(floor, abs=1.5)
    assert found.level[1] < floor + 15
    # A multiple beyond half the sample rate, less two resolutions, has none.
    for f, known in ((799.0 - 6.1, 4), (799.9, 3), (1400.0, 1), (1900.0, 1), (2100.0, 0)):
        found = overtones(tone(1.0, f=f, noise=1e-3), RATE, f)
        assert np.isfinite(found.level).tolist() == [True] * known + [False] * (4 - known), f
        assert np.isfinite(found.noise).sum() == known


def test_a_line_counts_within_two_resolutions_and_noise_from_four_to_a_third_of_the_line():
    """A resolution of 4000 samples at 8 kHz is 3 Hz: a line 5 Hz beside an overtone is one, one 7 Hz beside is none."""
    time = np.arange(4000) / RATE
    for off, heard in ((4.5, True), (12.5, False)):
        found = overtones(tone(1.0, noise=1e-4) + 0.3 * np.sin(2 * np.pi * (320 + off) * time), RATE, 160.0)
        assert (found.level[0] > 20 * math.log10(0.3) - 0.5) == heard
        assert heard or found.level[0] < 20 * math.log10(0.3) - 20
    quiet = overtones(tone(1.0, noise=1e-4), RATE, 160.0).noise
    rng = np.random.default_rng(8)
    for low, high, raised in ((60.0, 75.0, False), (10.0, 55.0, True)):
        band = sum(
            0.01 * np.sin(2 * np.pi * f * time + rng.uniform(0, 6)) for f in np.arange(320 + low, 320 + high, 1.0)
        )
        band = band + sum(0.01 * np.sin(2 * np.pi * f * time) for f in np.arange(320 - high, 320 - low, 1.0))
        found = overtones(tone(1.0, noise=1e-4) + band, RATE, 160.0)
        assert (found.noise[0] > quiet[0] + 20) == raised


def test_overtones_are_apart_by_those_that_stand_out_of_the_measured_noise_in_either():
    def known(*level: float, noise: float = -60.0) -> Overtones:
        return Overtones(np.array(level), np.full(len(level), noise))

    # The floor is 12 dB above noise: −30 against −33, −50 (which counts as −48) against −40, and two that are below.
    measured, simulated = known(-30.0, -50.0, -49.0, np.nan), known(-33.0, -40.0, -70.0, -20.0, noise=0.0)
    assert squeal_module.overtones_apart(measured, simulated) == pytest.approx(math.sqrt((3**2 + 8**2) / 2))
    assert squeal_module.overtones_apart(known(-47.9), known(-90.0)) == pytest.approx(0.1)
    assert squeal_module.overtones_apart(known(-48.1), known(-48.1)) is None
    assert squeal_module.overtones_apart(known(-30.0), known(np.nan)) is None


def choice(
    squeals: tuple[float, ...], later: tuple[float, ...] = (), apart: float | None = None, **more: Any
) -> ChosenFit:
    known: dict[str, Any] = {"fitted": fitted(apart=apart), "rivals": (), "transients": 3}
    return ChosenFit(**(known | more), squeals=squeals, later=later)


def test_it_is_known_which_squeal_a_record_is_where_it_is_alone_or_sounds_like_it():
    for squeals, later, apart, known in (
        ((1.0,), (), 9.0, True), ((1.0,), (2.0,), 9.0, True), ((1.0, 2.0), (), 4.1, False), ((1.0, 2.0), (), 3.9, True),
        ((1.0,), (1.0, 2.0), 4.1, False), ((1.0, 2.0), (), None, True),
    ):  # fmt: skip
        assert choice(squeals, later, apart).known == known


# --- one search, and a second one -------------------------------------------------------------------------------------


class Search:
    """Squeals of a scene by its one number x, and where the fit of each ends."""

    def __init__(self, monkeypatch, squeals: Any, fits: Any, apart: Any = None) -> None:
        self.squeals, self.fits, self.apart = squeals, fits, apart or {}
        self.began: list[tuple[float, float]] = []
        self.checked: list[tuple[float, ...]] = []
        self.asked: list[Any] = []
        monkeypatch.setattr(squeal_module, "scenes_that_squeal", lambda here, progress: [(here, k) for k in range(9)])
        monkeypatch.setattr(squeal_module, "settled", self.settled)
        monkeypatch.setattr(squeal_module, "fit_squeal", self.fit)
        monkeypatch.setattr(squeal_module, "overtones", self.overtones)
        monkeypatch.setattr(squeal_module, "overtones_apart", lambda theirs, ours: self.apart.get(ours))
        monkeypatch.setattr(squeal_module, "check_fundamental", self.check)
        self.reading = RecordReading(
            kind=RecordKind.SATURATED, reason="", from_s=0.0, until_s=1.0, lines=(line(120.0), line(300.0)),
            values=np.arange(5.0),
        )  # fmt: skip

    def settled(self, scene, signal, progress):
        assert signal == "so"
        here, k = scene if isinstance(scene, tuple) else (scene, 0)
        found = self.squeals(here)
        return found[k] if k < len(found) else None

    def check(self, reading, squeals):
        assert reading is self.reading
        self.checked.append(tuple(each.lines[0].frequency_Hz for each in squeals))

    def fit(self, run, measured, of, x):
        self.began.append((of.lines[0].frequency_Hz, float(x[0])))
        assert measured == self.reading.lines
        begun = {"begun": of, "before": np.array([of.lines[0].frequency_Hz])}
        return self.fits[of.lines[0].frequency_Hz]._replace(**begun)

    def overtones(self, values, rate, line):
        self.asked.append((values.size, rate, line))
        return None if rate == 6000.0 else round(line / 1.1, 3)

    def run(self) -> ChosenFit:
        run = Varied(lambda scene, x: float(x[0]), Scale.of(("a",), [2.0]), "so", lambda *_: None)  # pyright: ignore[reportArgumentType]
        return fit_squeals(0.0, run, self.reading, 6000.0)  # pyright: ignore[reportArgumentType]


def test_the_nearest_squeal_that_meets_lines_and_overtones_is_taken_at_once(monkeypatch):
    squeals = [squeal(130.0), squeal(118.0), squeal(130.05), squeal(400.0)]
    fits = {118.0: fitted(0.3, before=(118.0,)), 130.0: fitted(-0.1, chi=2.0, before=(130.0,))}
    search = Search(monkeypatch, lambda x: squeals, fits, {118.0: 1.5})
    found = search.run()
    assert [f for f, _ in search.began] == [118.0]
    assert search.checked == [(130.0,), (130.0, 118.0, 400.0)]  # its own squeal first, then each of all once
    assert (found.squeals, found.later, found.rivals, found.transients) == ((130.0, 118.0, 400.0), (), (), 7)
    assert (found.fitted.before.tolist(), found.fitted.apart_dB) == ([118.0], 1.5)
    assert search.asked == [(5, 6000.0, 120.0), (3, RATE, pytest.approx(118.0 * 1.1))]
    assert [each.frequency_Hz for each in found.fitted.used] == [120.0]


def test_of_squeals_that_meet_the_lines_the_others_are_rivals_where_they_are_as_likely(monkeypatch):
    squeals = [squeal(118.0), squeal(126.0), squeal(133.0)]
    fits = {118.0: fitted(0.3), 126.0: fitted(-0.1), 133.0: fitted(1.2)}
    found = Search(monkeypatch, lambda x: squeals, fits).run()
    assert found.fitted.estimate.x.tolist() == [-0.1]
    assert [each.before.tolist() for each in found.rivals] == [[118.0]]  # 1.2 costs 5.76
    assert (found.transients, found.later, found.fitted.apart_dB) == (21, (), None)


def test_where_no_fit_meets_the_lines_the_search_begins_anew_where_the_best_would_have_gone(monkeypatch):
    """From 118 and 126 Hz; the latter comes nearest, and would meet 120 Hz at x = 0.8. There are squeals there at
    half of that, or beyond; the scene's own line of each is by as much lower as that of the best."""

    def squeals(x):
        return [squeal(118.0), squeal(126.0)] if x == 0 else [squeal(121.0), squeal(131.0), squeal(500.0)]

    fits = {
        118.0: fitted(0.3, chi=40.0, wanted=0.9), 126.0: fitted(0.1, chi=30.0, wanted=-0.8),
        121.0: fitted(-0.6, chi=2.0),
        131.0: fitted(-0.7, chi=3.0),
    }  # fmt: skip
    search = Search(monkeypatch, squeals, fits)
    found = search.run()
    # The search goes no farther than 0.5 at once.
    assert search.began == [(118.0, 0.0), (126.0, 0.0), (121.0, -0.5), (131.0, -0.5)]
    assert found.fitted.estimate.x.tolist() == [-0.6]
    assert (found.squeals, found.later, found.transients) == ((118.0, 126.0), (121.0, 131.0, 500.0), 28)
    shift = (120.0 / 126.0) ** (0.5 / 0.8)
    before = [min((118.0, 126.0), key=lambda own: abs(math.log(own * shift / f))) for f in (121.0, 131.0)]
    assert found.fitted.before.tolist() == [before[0]]
    assert [each.before.tolist() for each in found.rivals] == [[before[1]]]
    # Where the second search meets them neither, the one that misses by least is taken, of both searches.
    for chi, taken in ((31.0, 126.0), (29.0, 126.0)):
        search.fits |= {121.0: fitted(-0.6, chi=chi), 131.0: fitted(-0.7, chi=99.0)}
        found = search.run()
        assert (found.fitted.estimate.chi_square, found.rivals) == (min(chi, 30.0), ())
        assert found.fitted.before.tolist() == [taken]


def test_a_scene_that_squeals_nowhere_near_the_record_is_refused(monkeypatch):
    search = Search(monkeypatch, lambda x: [squeal(500.0), squeal(710.4)], {})
    with pytest.raises(
        RequestError, match=r"squeals at 500, 710 Hz, and no line of the record \(120, 300 Hz\) is near"
    ):
        search.run()
    scene: Any = SimpleNamespace(simulate=SimpleNamespace(duration=0.4))
    assert squeal_module._unlike(scene, search.reading.lines, ()).endswith("large disturbances, within 0.4 s; " + (
        "change numbers so that it does (drumsqueal onset finds where), or take the record with --as linear"
    ))  # fmt: skip


def test_a_record_of_a_harmonic_without_its_fundamental_is_refused():
    values = tone(2.0, 0.5, f=1200.0, count=1600)
    own = squeal(1200.0, values=values)

    def check(*lines: float, left_out: tuple[float, ...] = (), of: SimulatedSqueal = own) -> None:
        reading = RecordReading(
            kind=RecordKind.SATURATED, reason="", from_s=0.0, until_s=1.0, lines=tuple(map(line, lines)),
            left_out_Hz=left_out,
        )  # fmt: skip
        check_fundamental(reading, [squeal(5000.0, values=tone(1.0, f=3000.0, count=1600)), of])

    with pytest.raises(RequestError, match=r"2410 Hz, is near 2400 Hz, 2 times the 1200 Hz at which the scene squeals"):
        check(2410.0)
    check(2410.0, 1255.0)  # the fundamental is there, within 5 %, or was left out
    check(2410.0, left_out=(1145.0,))
    for heard in (1265.0, 1135.0):
        with pytest.raises(RequestError, match="the record has no line there"):
            check(2410.0, heard)
    check(2530.0)  # a line farther than 5 % from the harmonic is another one
    with pytest.raises(RequestError, match="is near 2400 Hz"):
        check(2510.0)
    # A line of the squeal or a mode that grows is nearer, or is the harmonic itself.
    check(2410.0, of=own._replace(lines=(line(1200.0), line(2412.0))))
    check(2410.0, of=own._replace(unstable_Hz=(2399.0,)))
    with pytest.raises(RequestError, match="is near 2400 Hz"):
        check(2410.0, of=own._replace(lines=(line(1200.0), line(2440.0))))


# --- the report ------------------------------------------------------------------------------------------------------


@pytest.fixture
def report(nominal, monkeypatch):
    """Report a width of 36.5 mm in mm and a friction coefficient, of which the record determines what is asked."""
    monkeypatch.setattr(study_module, "describe_fit", lambda fit: f"verdict of {len(fit.numbers)}")
    monkeypatch.setattr(study_module, "describe_notes", lambda fit: ("a note",))
    keys = ("shoe.width", "friction.static")
    numbers = {key: nominal.numbers()[key] for key in keys}
    written = Written(nominal, load_with_tables(NOMINAL)[1])

    def made(x: Any, *, determined: Any = (True, True), **more: Any) -> Any:
        scale = Scale.of(keys, list(numbers.values()))
        covariance = np.diag([0.01**2, 0.02**2])
        found = estimate_of(x, 3.0, covariance=covariance, determined=np.array(determined), **more)
        reading = RecordReading(kind=RecordKind.SATURATED, reason="why", from_s=0.25, until_s=0.75, lines=())
        result = _Result(found, (), 5, "or else", 9, ("more",))
        measured = Measured("mic", "Pa", RATE, 2.0, np.zeros(3), ("remark",))
        return _report(nominal, keys, scale, reading, result, measured, "file.csv", written), numbers

    return made


def test_a_fitted_number_is_reported_in_the_unit_of_the_file_with_its_uncertainty(report):
    found, numbers = report((0.1, -0.05))
    width, static = found.numbers
    before, after = numbers["shoe.width"], numbers["shoe.width"] * math.exp(0.1)
    assert (width.key, width.unit, width.determined, width.at_bound) == ("shoe.width", "mm", True, False)
    assert (width.scene_value, width.scene_value_SI) == (pytest.approx(1e3 * before), before)
    assert width.fitted_value_SI == pytest.approx(after)
    assert width.fitted_value == pytest.approx(1e3 * after, rel=5e-3)
    assert width.fitted_value == float(f"{1e3 * after:.3g}")  # two digits for 2 %, and one more
    assert width.standard_uncertainty == pytest.approx(1e3 * after * 0.01)
    assert width.uncertainty == pytest.approx(1e3 * after * 0.01 * 2.0)
    assert width.uncertainty_SI == pytest.approx(after * 0.01 * 2.0)
    assert (static.key, static.unit) == ("friction.static", "")
    assert (
        static.uncertainty
        == static.uncertainty_SI
        == pytest.approx(numbers["friction.static"] * math.exp(-0.05) * 0.04)
    )
    assert static.relative_change == pytest.approx(math.exp(-0.05) - 1)
    assert (found.verdict, found.notes) == ("verdict of 2", ("a note", "more", "remark"))
    assert (found.file, found.channel, found.record_kind, found.reason) == (
        "file.csv",
        "mic",
        RecordKind.SATURATED,
        "why",
    )
    assert (found.from_s, found.until_s, found.sample_rate_Hz) == (0.25, 0.75, RATE)
    assert (found.observations, found.ambiguous, found.transients, found.freedom) == (5, "or else", 9, 1)
    assert (found.chi_square_per_freedom, found.missed, found.open_combinations, found.fixed) == (3.0, False, (), ())
    assert found.fitted_scene.shoe.width == pytest.approx(1e-3 * width.fitted_value)
    assert found.fitted_scene.friction.static == static.fitted_value


def test_a_number_that_is_not_determined_has_no_uncertainty_and_stays_but_for_more_than_round_off(report):
    found, numbers = report((0.9e-5, 0.1), determined=(False, True), open=np.array([[1.0, 0.0]]))
    width = found.numbers[0]
    assert (width.determined, width.uncertainty, width.standard_uncertainty, width.uncertainty_SI) == (False,) + (
        None,
    ) * 3
    assert width.fitted_value == width.scene_value  # to a hundred thousandth
    assert width.fitted_value_SI != width.scene_value_SI
    assert found.fitted_scene.shoe.width == numbers["shoe.width"]
    assert found.open_combinations == ({"shoe.width": 1.0, "friction.static": 0.0},)
    found, numbers = report((1.1e-4, 0.1), determined=(False, True))
    assert found.numbers[0].fitted_value == float(f"{1e3 * numbers['shoe.width'] * math.exp(1.1e-4):.6g}")
    bound, _ = report((math.log(20), 0.1))
    assert [each.at_bound for each in bound.numbers] == [True, False]
    same, _ = report((0.0, 0.1))
    assert same.numbers[0].fitted_value == same.numbers[0].scene_value
    assert same.numbers[0].uncertainty is not None
