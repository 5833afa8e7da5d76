"""What decides the paper's statements, on curves that are made up, against numbers found by looking at all pairs."""

import csv
import io
import itertools
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import IntegrationError
from drumsqueal.questions.commands.onset import example
from drumsqueal.scene import COORDINATES
from drumsqueal.solve.linear.family import EigenvalueSet

paper = example()
AXES, Point, check_statements = paper.AXES, paper.Point, paper.check_statements
AXIS = {axis.figure: axis for axis in AXES}
COUNT = 13
UNSTABLE, OTHERS = ("X", "Y", "Tz"), ("Z", "Tx", "Ty")
RNG = np.random.default_rng(12)
MASS = np.array([1.2, 1.3, 1.4, 0.02, 0.03, 0.04])
NOMINAL = {axis.key: 3.0 + k for k, axis in enumerate(AXES)} | {"drum.speed": -5.0}


def made_up(figure: str, rates, frequencies, *, damping=None, mixed: float = 0.0) -> Any:
    """Modes of one coordinate each, with rates (1/s) and frequencies (Hz) of the fraction s of the scene's value."""
    axis = AXIS[figure]
    s = np.linspace(axis.low, axis.high, COUNT)
    own = np.array([rates[name](s) + 2j * np.pi * (frequencies[name](s) + 0 * s) for name in COORDINATES]).T
    right = np.zeros((COUNT, 12, 12), dtype=complex)
    right[:, :6, :6] = right[:, :6, 6:] = np.eye(6) + mixed * np.ones((6, 6))
    values = np.concatenate([own, own.conj()], axis=1)
    return paper.Curve(
        axis,
        NOMINAL[axis.key] * s,
        NOMINAL[axis.key],
        EigenvalueSet(COORDINATES, np.tile(MASS, (COUNT, 1)), damping, values, right, own),  # pyright: ignore[reportArgumentType]
    )


def lines(*numbers: float, bow: float = 0.0) -> dict[str, Any]:
    """Straight lines in s from six pairs of numbers, and a bow."""
    pairs = zip(COORDINATES, numbers[::2], numbers[1::2], strict=True)
    return {name: lambda s, a=a, b=b: a + b * s + bow * a * s**2 for name, a, b in pairs}


def pairs(values: np.ndarray) -> float:
    """The largest rise from one entry to a later one."""
    return max(b - a for a, b in itertools.combinations(values.tolist(), 2))


@pytest.fixture
def figures() -> dict[str, Any]:
    speed = np.linspace(0.1, 3.0, COUNT)
    damping = np.zeros((COUNT, 6, 6))
    for k, power in zip((2, 3, 4), (-1.02, -0.9, -1.1), strict=True):
        damping[:, k, k] = 0.7 * speed**power
    f5 = lines(100, 300, 0, 500, 40, -10, 0, 900, 0, 700, 50, 420)  # in the order of X, Y, Z, Tx, Ty, Tz
    return {
        "5": made_up("5", lines(2, 30, 1, 70, -1, -2, -3, -1, -2, -5, 0.5, 9), f5),
        "6": made_up("6", lines(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 4), lines(*(x + 3 for x in (
            100, 300, 0, 500, 40, -10, 0, 900, 0, 720, 50, 420)))),
        "7": made_up("7", lines(90, -8, 50, -6, -9, 2.5, -12, 3, -7, 2, 40, -5, bow=0.01),
            lines(100, 1, 200, 2, 40, 1, 300, 3, 400, 4, 500, 5), damping=damping, mixed=1e-3),
        "8": made_up("8", lines(1, 30, 2, 70, -1, -2, -3, -1, -2, -5, 0.5, 9, bow=0.02), f5),
        "9": made_up("9", lines(20, 3, 90, -60, -1, -2, -3, -1, -2, -5, 40, -7), f5),
        "10": made_up("10", lines(20, -3, 90, -60, -1, -2, -3, -1, -2, -5, 40, -7), f5),
        "11": made_up("11", lines(20, -3, 90, -60, -1, -2, -3, -1, -2, -5, 40, 2), f5),
    }  # fmt: skip


def rates(curve: Any, names=UNSTABLE) -> list[np.ndarray]:
    return [curve.spectrum.own[:, COORDINATES.index(name)].real for name in names]


def frequency(curve: Any, name: str) -> np.ndarray:
    return curve.spectrum.own[:, COORDINATES.index(name)].imag / (2 * np.pi)


def bow(x: np.ndarray, y: np.ndarray) -> float:
    return float(np.abs(y - np.polyval(np.polyfit(x, y, 1), x)).max())


def measured_point(figure: str, value: float, *errors: float, **saturated: Any) -> Any:
    growth = SimpleNamespace(rate_1_per_s=-4.0, standard_error=0.08)
    modes = [
        SimpleNamespace(
            label=f"m{k}", unstable=error > 0, growth_rate_error=error or None, measured_growth=growth,
            measured_frequency_Hz=70.0 + k, note=f"note {k}",
        )
        for k, error in enumerate(errors)
    ]  # fmt: skip
    saturation = None
    if saturated:
        saturation = SimpleNamespace(
            contact_fraction=0.6, frequency_shift=-0.03, nearest_mode="Y", regime=SimpleNamespace(kind="periodic"),
            main=SimpleNamespace(frequency_Hz=950.0, coordinate="Tz", amplitude=3e-4),
        )  # fmt: skip
    found: Any = SimpleNamespace(modes=tuple(modes), saturation=saturation, motion_ratio=0.2, edge_reached_s=None)
    return Point(figure, AXIS[figure].key, value, "scene", found, "")


@pytest.fixture
def friction() -> Any:
    speed = np.linspace(0.5, 15.0, COUNT)
    return paper.FrictionCurve(speed, 0.3 + 0.2 * np.exp(-0.1 * speed), -0.02 * np.exp(-0.1 * speed), 5.0)


SHOE: Any = SimpleNamespace(
    half_angle=0.9,
    width=0.04,
    displacement=lambda q, angle, z: (
        q["X"] * np.cos(angle) + 0.3 * q["Z"] + 0 * z,
        -q["X"] * np.sin(angle) + q["Y"] * np.cos(angle) + 0.2 * q["Tz"] + 0.01 * q["Tx"] + 0 * z,
        q["Z"] + 0.1 * q["Tx"] * np.sin(angle) + z * q["Ty"] + 0.02 * q["Tz"] + 0 * angle,
    ),
)


def test_the_axes_cover_the_scene_s_own_value():
    for axis in AXES:
        assert axis.low < 1 <= axis.high
        assert 1.0 in axis.transients


def test_each_statement_is_decided_by_its_number(figures, friction):
    points = {
        "5": (measured_point("5", 1.0, 0.0, -0.5, 2e-3), measured_point("5", 2.0, 1e-3, saturated=True)),
        "9": (measured_point("9", 1.0, 3e-3), Point("9", "shoe.arc_angle", 2.0, "scene")),
    }
    constant, damped = measured_point("6", 3.0), measured_point("5", 0.02, saturated=True)
    found = check_statements(SHOE, friction, figures, points, (constant, damped))
    five, six, seven, eight, nine = (figures[name] for name in "56789")
    f5 = {name: frequency(five, name) for name in COORDINATES}
    f6 = {name: frequency(six, name) for name in COORDINATES}
    relative = {name: max(abs(f5[name] - f6[name]) / np.maximum(np.maximum(f5[name], f6[name]), 1e-300)) for name in f5}
    size = np.abs(seven.values)
    order = np.argsort(size)
    change = {name: each[-1] - each[0] for name, each in zip(UNSTABLE, rates(nine), strict=True)}
    fractions = {name: change[name] / abs(each[0]) for name, each in zip(UNSTABLE, rates(nine), strict=True)}
    narrow = np.linspace(2.0, 5.0, COUNT)
    slopes = np.interp(narrow, friction.speed, friction.slope)
    powers = [
        [np.polyfit(np.log(size), np.log(seven.spectrum.damping[:, k, k] / over), 1)[0] for k in (2, 3, 4)]
        for over in (1.0, friction.coefficient)
    ]
    k = int(np.argmin(abs(seven.values - seven.nominal)))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    shares = {}
    for name in COORDINATES:
        q = dict(zip(COORDINATES, seven.spectrum.right[k, :6, COORDINATES.index(name)], strict=True))
        squares = np.zeros(3)
        for a, wa in zip(0.9 * nodes, weights, strict=True):
            for z, wz in zip(0.02 * nodes, weights, strict=True):
                squares += wa * wz * np.abs(SHOE.displacement(q, a, z)) ** 2
        shares[name] = squares / squares.sum()
    energy = MASS * (np.eye(6) + 1e-3) ** 2
    wanted: dict[str, list[float]] = {
        "The coefficient of friction falls": [friction.slope.max()],
        "Every frequency rises": [
            max(pairs(-f5[name]) for name in COORDINATES), max(pairs(-f5[name]) for name in COORDINATES if name != "Z")
        ],
        "Without contact stiffness X and Tz": [1.0],  # Z oscillates, too
        "With contact stiffness every mode": [30.0],
        "With contact stiffness X, Y and Tz": [min(each[1:].min() for each in rates(five))],
        "No other mode is unstable": [max(each[1:].max() for each in rates(five, OTHERS))],
        "The unstable modes do not couple": [min(
            min(abs(f5[a] - f5[b]) / np.maximum(f5[a], f5[b])) for a, b in itertools.combinations(UNSTABLE, 2)
        )],
        "With constant friction (μ": [2.0 * COUNT],
        "With constant friction the frequencies": [
            max(abs(f5[name] - f6[name]).max() for name in f5) / max(each.max() for each in f5.values()),
            max(relative.values()),
        ],
        "The slope μt": [
            bow(friction.speed, friction.slope) / 0.02 / math.exp(-0.05), bow(narrow, slopes) / max(-slopes)
        ],
        "The slower the drum": [max(pairs(each[order]) for each in rates(seven))],
        "Friction across": [max(
            energy[j, [2, 3, 4]].sum() / energy[j].sum() for j in (0, 1, 5)
        )],
        "Friction damping makes": [max(each.max() for each in rates(seven, OTHERS))],
        "At low speeds": [
            np.diff(np.max([each[order] for each in rates(seven, OTHERS)], axis=0)).min(),
            max(each[size <= 5.0 + 1e-9].max() for each in rates(seven, OTHERS)),
        ],
        "Friction damping is": [max(abs(p + 1) for p in each) for each in powers],
        "X, Y and Tz move": [
            min(shares[name][1] for name in UNSTABLE),
            min(shares[name][1] / shares[name][1:].sum() for name in UNSTABLE),
        ],
        "Z, Tx and Ty move": [
            min(shares[name][2] for name in OTHERS), min(shares[name][2] / shares[name][1:].sum() for name in OTHERS)
        ],
        "The growth rates of X": [max(bow(eight.values, each) / max(abs(each)) for each in rates(eight))],
        "A larger arc angle lowers the growth rate of Y": [fractions["Y"]],
        "A larger arc angle changes": [
            max(abs(change["X"]), abs(change["Tz"])) / abs(change["Y"]),
            max(abs(fractions["X"] / fractions["Y"]), abs(fractions["Tz"] / fractions["Y"])),
        ],
        "A larger arc angle lowers the growth rates": [max(pairs(each) for each in rates(nine))],
        "A larger radius": [max(pairs(each) for each in rates(figures["10"]))],
        "A larger width": [max(pairs(each) for each in rates(figures["11"]))],
        "Near steady sliding": [3e-3],
        "The squealing frequency": [0.03],
        "Without linear instability": [0.2, 0.4],
    }  # fmt: skip
    assert len(found) == len(wanted) == 26
    for each, (says, numbers) in zip(found, wanted.items(), strict=True):
        assert each.statement.startswith(says)
        assert [reading.value for reading in each.readings] == pytest.approx(numbers, rel=1e-6, abs=1e-9), says
    # Which side of its limit the number has to be on, statement by statement.
    bounds = "< << < > > < > < << << < < < >< << >> >> < < << < < < < > <<"
    assert " ".join("".join(reading.condition[0] for reading in each.readings) for each in found) == bounds
    detail = {each.statement: [reading.detail for reading in each.readings] for each in found}
    assert detail["Near steady sliding the motion grows as its eigenvalue says"] == [
        "m0, shoe.arc_angle 1, measured to ± 0.02; 3 measured"
    ]
    not_run: Any = Point("5", "a", 1.0, SHOE)
    none = check_statements(SHOE, friction, figures, {"5": (not_run,)}, (not_run, not_run))
    assert [each.verdict for each in none[-3:]] == [paper.Verdict.NOT_DECIDED] * 3


def test_points_lie_at_fractions_of_the_scene_s_own_numbers(nominal):
    points = paper.points_of_figures(nominal)
    own = nominal.numbers()
    assert [(each.figure, each.value) for each in points] == [
        (axis.figure, pytest.approx(own[axis.key] * fraction)) for axis in AXES for fraction in axis.transients
    ]
    for each in points:
        assert each.scene.numbers()[each.key] == pytest.approx(each.value)
        changed = {key for key, value in each.scene.numbers().items() if own.get(key) != value}
        assert changed - {"friction.coefficient"} <= {each.key}
        assert (each.scene.friction != nominal.friction) == (each.figure == "6")
        if each.figure == "6":
            assert each.scene.numbers()["friction.coefficient"] == paper.CONSTANT_FRICTION
        assert (each.why_not, each.modes, each.saturation) == ("the transient was not run", (), None)


def test_two_stable_brakes_are_disturbed_one_by_constant_friction_one_by_damping(nominal, monkeypatch):
    modes = [
        SimpleNamespace(growth_rate=rate, eigenvalue=rate + 1j * w) for rate, w in ((-5, 9.0), (40, 3e3), (20, 1e3))
    ]
    monkeypatch.setattr(paper, "analyse_stability", lambda model: SimpleNamespace(modes=modes))
    monkeypatch.setattr(paper, "build_model", lambda scene, coordinates: None)
    monkeypatch.setattr(paper, "disturbed", lambda scene: scene)
    least = 20 / math.hypot(20, 1e3)
    for known in (0.0, 0.03):
        scene = nominal.with_values({"damping": {"ratio": known}}) if known else nominal
        constant, damped = paper.disturbed_points(scene)
        assert (constant.figure, constant.key, constant.value) == ("6", "start", paper.DISTURBANCE)
        assert constant.scene.numbers()["friction.coefficient"] == 0.4
        assert (damped.figure, damped.key) == ("5", "damping.ratio")
        assert damped.value == pytest.approx(known + 1.05 * least)
        assert damped.scene.damping.ratio == damped.value  # pyright: ignore[reportOptionalMemberAccess]
    modes[1].growth_rate = modes[2].growth_rate = -1.0
    assert paper.disturbed_points(nominal)[1].value == 0.0


def test_scenes_that_several_points_share_are_run_once(monkeypatch):
    ran, seen = [], []

    def run(scene, show):
        show("x", 0.5, 2.0)
        ran.append(scene.name)
        if scene.name == "bad":
            raise IntegrationError("failed: so")
        outcome = "failed: later" if scene.name == "two" else "complete"
        return SimpleNamespace(findings=SimpleNamespace(of=scene.name, outcome=outcome))

    monkeypatch.setattr(paper, "run", run)

    def scene(name: str) -> Any:
        return SimpleNamespace(name=name, to_toml=lambda: name)

    points = [Point("5", "a", float(k), scene(name)) for k, name in enumerate(("one", "bad", "one", "two"))]
    done = paper.run_points(points, lambda *given: seen.append(given))
    assert ran == ["one", "bad", "two"]
    assert [(each.value, getattr(each.comparison, "of", None), each.why_not) for each in done] == [
        (0.0, "one", ""), (1.0, None, "failed: so"), (2.0, "one", ""), (3.0, None, "failed: later"),
    ]  # fmt: skip
    assert seen == [each for k in range(3) for each in (
        (f"transient {k + 1} of 3", k + 0.0, 3), (f"transient {k + 1} of 3", k + 0.25, 3)
    )]  # fmt: skip


def test_figure_6_has_constant_friction_and_all_others_the_scene_s_own(nominal, monkeypatch):
    asked = []
    monkeypatch.setattr(
        paper, "curves_along", lambda scene, axes: asked.append(scene) or {axis.figure: (scene, axis) for axis in axes}
    )
    found = paper.paper_curves(nominal)
    assert list(found) == ["5", "6", "7", "8", "9", "10", "11"]
    assert [axis.figure for _, axis in found.values()] == list(found)  # pyright: ignore[reportGeneralTypeIssues]
    for figure, (scene, _) in found.items():  # pyright: ignore[reportGeneralTypeIssues]
        own = scene == nominal
        assert own == (figure != "6")
        assert own or scene.numbers()["friction.coefficient"] == 0.4
    assert len(asked) == 2


def test_the_friction_curve_goes_over_the_speeds_of_figure_7(nominal):
    """0.3 + 0.2 e^(−R Ω) of the paper's brake on a drum that turns backwards, of another radius."""
    scene = nominal.with_values({"drum.speed": -4.0, "shoe.outer_radius": 0.12})
    found = paper.friction_curve(scene)
    speed = 4.0 * np.linspace(0.1, 3.0, 121)
    np.testing.assert_allclose(found.speed, speed)
    np.testing.assert_allclose(found.coefficient, 0.3 + 0.2 * np.exp(-0.12 * speed))
    np.testing.assert_allclose(found.slope, -0.2 * np.exp(-0.12 * speed))
    assert found.own_speed == 4.0


def test_the_study_keeps_its_curves_and_gives_each_figure_its_points(nominal, monkeypatch):
    points = [Point(figure, "a", value, nominal) for figure, value in (("5", 1.0), ("7", 2.0), ("5", 3.0))]
    ends = (Point("6", "start", 3.0, nominal), Point("5", "damping.ratio", 0.1, nominal))
    given, kept = [], []
    shoe = object()
    monkeypatch.setattr(paper, "paper_curves", lambda scene: {"5": "five", "6": "six", "7": "seven"})
    monkeypatch.setattr(paper, "friction_curve", lambda scene: None)
    monkeypatch.setattr(paper, "build_model", lambda scene: SimpleNamespace(shoe=shoe))
    monkeypatch.setattr(paper, "check_statements", lambda *of: given.append(of) or ())
    monkeypatch.setattr(paper, "points_of_figures", lambda scene: points)
    monkeypatch.setattr(paper, "disturbed_points", lambda scene: ends)
    monkeypatch.setattr(paper, "run_points", lambda points, progress: [replace(p, value=10 * p.value) for p in points])
    found = paper.study(nominal, keep=kept.append)
    for of, times in zip((*kept, found), (1, 10), strict=True):
        assert {figure: [each.value / times for each in those] for figure, those in of.points.items()} == {
            "5": [1.0, 3.0], "6": [], "7": [2.0]
        }  # fmt: skip
        assert [each.value / times for each in of.disturbed] == [3.0, 0.1]
    assert given[0][0] is shoe
    assert given[1][-1] == found.disturbed


def test_the_table_has_every_number_of_the_figures(figures, friction):
    points = dict.fromkeys(figures, ()) | {
        "5": (measured_point("5", 1.0, 0.1, 0.2, saturated=True), Point("5", "contact.stiffness", 2.0, "s")),
        "9": (measured_point("9", 7.0),),
    }  # fmt: skip
    of: Any = SimpleNamespace(friction=friction, curves=figures, points=points)
    rows = list(csv.DictReader(io.StringIO(paper.paper_table(of))))
    law = [row for row in rows if row["source"] == "friction law"]
    np.testing.assert_allclose([float(row["value_SI"]) for row in law], friction.speed)
    np.testing.assert_allclose([float(row["friction_coefficient"]) for row in law], friction.coefficient)
    np.testing.assert_allclose([float(row["friction_slope_s_per_m"]) for row in law], friction.slope)
    for figure, curve in figures.items():
        for name in COORDINATES:
            mine = [r for r in rows if (r["figure"], r["source"], r["mode"]) == (figure, "eigenvalue", name)]
            assert {row["varied"] for row in mine} == {curve.axis.key}
            own = curve.spectrum.own[:, COORDINATES.index(name)]
            np.testing.assert_allclose([float(row["value_SI"]) for row in mine], curve.values)
            np.testing.assert_allclose([float(row["frequency_Hz"]) for row in mine], own.imag / (2 * np.pi))
            np.testing.assert_allclose([float(row["growth_rate_1_per_s"]) for row in mine], own.real, atol=1e-12)
    run = [row for row in rows if row["source"] == "transient"]
    assert [(row["figure"], row["value_SI"], row["mode"], row["note"]) for row in run] == [
        ("5", "1.0", "m0", "note 0"), ("5", "1.0", "m1", "note 1"), ("5", "2.0", "", "the transient was not run")
    ]  # fmt: skip
    assert (run[1]["frequency_Hz"], run[1]["growth_rate_1_per_s"], run[1]["standard_error_1_per_s"]) == (
        "71.0", "-4.0", "0.08"
    )  # fmt: skip
    one, other = (row for row in rows if row["source"] == "saturated motion")
    assert [one[key] for key in ("mode", "frequency_Hz", "amplitude_of", "amplitude_SI", "note")] == [
        "Y", "950.0", "Tz", "0.0003", "periodic"
    ]  # fmt: skip
    assert (other["figure"], other["note"]) == ("9", "neither lift-off nor slip reversal")
