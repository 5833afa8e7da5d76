"""What is heard in a cell of a noise matrix, window by window, and what is put down of it."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.dynamics.attractor import SMALL_START
from drumsqueal.dynamics.ensemble import Start
from drumsqueal.questions.sweep import matrix_cells as c
from drumsqueal.questions.sweep.matrix_cells import CellFound, in_rows, shown_axes
from drumsqueal.questions.sweep.matrix_plan import MatrixPlan, Procedure, _clash
from drumsqueal.questions.sweep.points import COMPUTED, FAILED, NONE, NOT_SETTLED, STILL_FALLS, CellVerdict

RATE = 2000.0
MASS = np.array([2.0, 0.03, 3.0, 0.05, 1.0])
NAMES = ("a.X", "a.Tz", "b.Y", "b.Tz", "drum.E1")


def model(speeds=((0.0, 1.0), (-8.0, -4.0))) -> Any:
    def at(time):
        return np.interp(time, *speeds), None

    operation = SimpleNamespace(
        drum_speed=SimpleNamespace(value=np.array(speeds[1]), at=at),
        at=lambda time: SimpleNamespace(time=time, drum_speed=at(time)[0]),
    )
    return SimpleNamespace(names=NAMES, mass=MASS, operation=operation)


def start(name: str = SMALL_START, mode: str | None = None) -> Start:
    return Start(name, np.zeros(5), np.zeros(5), disturbance=None if mode is None else SimpleNamespace(mode=mode))  # pyright: ignore[reportArgumentType]


def test_the_rms_velocity_is_over_the_mass_of_all_shoes():
    assert c._rms(model(), 10.0) == pytest.approx(math.sqrt(20.0 / 5.0))
    block: Any = SimpleNamespace(names=("Tz",), mass=np.array([0.4]))
    assert c._rms(block, 10.0) == pytest.approx(math.sqrt(20.0 / 0.4))


def test_the_drum_turns_where_it_is_never_slower_than_a_fiftieth_of_its_fastest():
    turning = model(((0.0, 1.0, 2.0), (-8.0, -0.1, 0.5)))
    at = [float(np.interp(v, [-8.0, -0.1], [0.0, 1.0])) for v in (-0.17, -0.15)]
    assert [c._turns(turning, t) for t in at] == [True, False]
    assert c._turns(turning, np.array([0.0, 0.5]))
    assert not c._turns(turning, np.array([0.0, 1.0]))
    assert not c._turns(turning, np.array([0.0, np.inf]))


@pytest.fixture
def heard(monkeypatch):
    """Hear a window in which the second shoe's Y moves at 300 Hz, with an envelope, beyond a boundary at some times."""

    def hear(envelope, beyond, slowest: float = 10.0, least: float = 0.0):
        time = 0.2 + np.arange(100) / RATE
        velocity = np.zeros((100, 5))
        velocity[:, 2] = envelope(time) * np.cos(2 * np.pi * 300 * time)
        asked = []

        def fractions(of, q, v, moments):
            np.testing.assert_array_equal(v["b.Y"], velocity[:, 2])
            np.testing.assert_array_equal(moments.time, time)
            return np.stack([[beyond(time), 0 * time], [0 * time, 0 * time]])

        monkeypatch.setattr(c, "boundary_fractions", fractions)
        monkeypatch.setattr(c, "least_energy", lambda of: least)
        found, falls = c._heard(model(), start(), time, 0 * velocity, velocity, lambda t: asked.append(t) or slowest)
        assert all(t == time[50] for t in asked)
        return found, falls, velocity, time

    return hear


def test_a_window_has_the_mean_energy_and_the_speed_of_its_middle(heard):
    found, falls, velocity, time = heard(lambda t: 1 + 0 * t, lambda t: np.where(t > 0.24, 0.91, 0.0))
    assert not falls
    assert found.velocity == pytest.approx(math.sqrt(3 * np.mean(velocity[:, 2] ** 2) / 5))
    assert found.frequency == pytest.approx(300.0, abs=1.0)
    assert (found.time, found.speed) == (time[50], pytest.approx(np.interp(time[50], [0, 1], [-8, -4])))
    assert heard(lambda t: 1 + 0 * t, lambda t: 0.89 + 0 * t)[:2] == (None, False)
    energy = 3 * np.mean(velocity[:, 2] ** 2) / 2
    assert heard(lambda t: 1 + 0 * t, lambda t: 1 + 0 * t, least=2.01 * energy)[:2] == (None, False)
    assert heard(lambda t: 1 + 0 * t, lambda t: 1 + 0 * t, least=1.99 * energy)[0] is not None


def test_what_falls_relative_to_the_drum_half_as_fast_as_the_slowest_mode_is_no_squeal(heard):
    # As fast as the speed, a motion stays as it is; at 5 1/s it falls as a mode of 10 1/s may.
    def at(rate):
        return lambda t: np.interp(t, [0, 1], [8, 4]) * np.exp(rate * (t - 0.2))

    always = lambda t: 1 + 0 * t  # noqa: E731
    assert heard(at(-4.0), always)[0] is not None
    assert heard(at(-6.5), always)[:2] == (None, True)
    assert heard(at(-6.5), lambda t: np.where(t < 0.224, 1.0, 0.0))[:2] == (None, False)
    assert heard(at(-6.5), lambda t: np.where(t > 0.2245, 1.0, 0.0))[:2] == (None, True)
    assert heard(at(-6.5), always, slowest=0.0)[0] is not None


def loudest(
    velocity: float, frequency: float = 300.0, name: str = SMALL_START, mode: str | None = None
) -> c.LoudestSqueal:
    return c.LoudestSqueal(start(name, mode), velocity, frequency, 0.3, -5.0)


def test_the_loudest_squeal_is_put_down_and_whether_a_large_disturbance_alone_leads_there():
    keys = ("velocity", "frequency", "time", "speed", "after", "small_velocity", "small_frequency", "along")

    def noted(*found: c.LoudestSqueal, settled: bool = True) -> list[float]:
        columns = {key: np.full(3, NONE if key in ("after", "along") else np.nan) for key in keys}
        c._note(columns, 1, found, ("X", "Y", "Tz"), settled=settled)
        assert all(columns[key][k] == NONE or np.isnan(columns[key][k]) for key in keys for k in (0, 2))
        return [float(columns[key][1]) for key in keys]

    small, large = loudest(2.0), loudest(3.0, 400.0, "disturbance", "Tz (2)")
    assert noted(small, large) == [3.0, 400.0, 0.3, -5.0, 0, 2.0, 300.0, 2]
    assert noted(small, large, settled=False) == [2.0, 300.0, 0.3, -5.0, 0, 2.0, 300.0, NONE]
    np.testing.assert_array_equal(noted(large), [3.0, 400.0, 0.3, -5.0, 1, np.nan, np.nan, 2])
    # A large disturbance that leads to the same squeal is none to speak of: within 5 % and 0.5 %.
    for velocity, frequency, along in ((2.09, 301.4, NONE), (2.12, 300.0, 0), (2.09, 301.6, 0)):
        assert noted(small, loudest(velocity, frequency, "disturbance", "X"))[-1] == along
    np.testing.assert_array_equal(noted(), [np.nan] * 4 + [NONE, np.nan, np.nan, NONE])
    assert noted(loudest(3.0, 400.0, "disturbance", "E9"))[-1] == NONE


def test_a_procedure_is_heard_in_windows_of_which_the_last_ends_with_it(monkeypatch):
    seen: list[tuple[str, float, float]] = []
    starts = [start(), start("disturbance", "X")]
    simulate = SimpleNamespace(sample_rate=RATE, duration=0.26, tolerance=1e-5, solver="auto")
    family = SimpleNamespace(shown=lambda q: q * 2)
    cell: Any = SimpleNamespace(
        starts=starts, scene=SimpleNamespace(simulate=simulate), model=model(), family=family,
        stability=SimpleNamespace(steady_state=np.arange(5.0)), linear=None,
    )  # fmt: skip
    loud, falling, lost = (
        {(SMALL_START, 0.1): 5.0, ("disturbance", 0.15): 7.0, (SMALL_START, 0.05): 3.0},
        [False],
        [np.inf],
    )

    def hear(of, began, time, vibration, velocity, slowest):
        assert time.shape == (len(vibration),) == (len(velocity),)
        np.testing.assert_allclose(vibration[:, 0], time)
        seen.append((began.name, round(float(time[0]), 4), round(float(time[-1]), 4)))
        size = loud.get((began.name, round(float(time[0]), 4)))
        return (None if size is None else c.LoudestSqueal(began, size, 1.0)), falling[0]

    def integrate_many(models, steady, vibration, velocity, **how):
        assert how == {"duration": 0.26, "sample_rate": RATE, "tolerance": 1e-5, "solver": "auto", "threads": 3}
        np.testing.assert_array_equal(steady, [np.arange(5.0) * 2] * 2)
        for first in range(0, 521, 70):
            time = np.arange(first, min(first + 70, 521)) / RATE
            motion = np.repeat(time[None, :, None], 5, axis=2).repeat(2, axis=0)
            broken = motion.copy()
            broken[1, time > lost[0]] = np.nan
            yield SimpleNamespace(time=time, vibration=motion, velocity=broken)

    monkeypatch.setattr(c, "_heard", hear)
    monkeypatch.setattr(c, "integrate_many", integrate_many)
    found, outcome = c._through(cell, 3, lambda *_: None)
    assert ([each.velocity for each in found], outcome) == ([5.0, 7.0], COMPUTED)
    windows = [(0.0, 0.0495), (0.05, 0.0995), (0.1, 0.1495), (0.15, 0.1995), (0.2, 0.2495), (0.2105, 0.26)]
    for name in (SMALL_START, "disturbance"):
        assert [each[1:] for each in seen if each[0] == name] == windows
    # A motion that is lost while the drum turns has failed; where nothing squeals one may still fall.
    lost[0] = 0.12
    assert c._through(cell, 3, lambda *_: None)[1] == FAILED
    lost[0], falling[0] = np.inf, True
    assert c._through(cell, 3, lambda *_: None)[1] == COMPUTED
    loud.clear()
    assert c._through(cell, 3, lambda *_: None) == ([], STILL_FALLS)


def test_at_constant_speed_a_cell_has_the_squeals_that_last(monkeypatch):
    leads: list[tuple[str, Any]] = []

    def find_attractors(*given, **how):
        for name, led in leads:
            motion = SimpleNamespace(kinetic_energy_J=10.0, frequency_Hz=None) if led is c.Kind.SQUEALS else None
            yield SimpleNamespace(start=name, leads_to=led, motion=motion)

    monkeypatch.setattr(c, "find_attractors", find_attractors)
    monkeypatch.setattr(c, "round_of", lambda *given: 1.0)
    simulate = SimpleNamespace(sample_rate=RATE, tolerance=1e-5, solver="auto")
    cell: Any = SimpleNamespace(
        starts=[start(), start("disturbance")], model=model(), point=None, family=None, stability=None,
        scene=SimpleNamespace(simulate=simulate),
    )  # fmt: skip
    for small, large, squeals, outcome in (
        (c.Kind.DECAYS, c.Kind.SQUEALS, 1, COMPUTED),
        (c.Kind.DECAYS, c.Kind.DECAYS, 0, COMPUTED),
        (c.Kind.DECAYS, c.Kind.UNDECIDED, 0, NOT_SETTLED),
        (c.Kind.GROWS, c.Kind.DECAYS, 0, NOT_SETTLED),
        (c.Kind.RUNS_AWAY, c.Kind.SQUEALS, 1, COMPUTED),
        (c.Kind.FAILED, c.Kind.SQUEALS, 1, FAILED),
    ):
        leads[:] = [(SMALL_START, small), ("disturbance", large)]
        found, became = c._lasting(cell, None, lambda *_: None)
        assert (len(found), became) == (squeals, outcome)
    assert found[0].velocity == pytest.approx(2.0)
    assert math.isnan(found[0].frequency)


def test_a_procedure_multiplies_speed_and_every_load_of_its_scene(nominal):
    stop = Procedure("stop", (0.0, 1.0, 3.0), (1.0, 0.5, 0.1), (2.0, 1.0, 0.5))
    scene = stop.over(nominal)
    speed, load = nominal.drum.speed, nominal.contact.normal_load
    assert scene.simulate.duration == 3.0
    assert (scene.drum.speed.time, scene.contact.normal_load.time) == ((0.0, 1.0, 3.0),) * 2  # pyright: ignore[reportAttributeAccessIssue]
    assert scene.drum.speed.value == pytest.approx((speed, 0.5 * speed, 0.1 * speed))  # pyright: ignore[reportAttributeAccessIssue]
    assert scene.contact.normal_load.value == pytest.approx((2 * load, load, 0.5 * load))  # pyright: ignore[reportAttributeAccessIssue]
    assert Procedure("drag").over(nominal) is nominal
    assert Procedure("slower", (0.0, 1.0), (1.0, 0.5)).over(nominal).contact.normal_load == load


def plan(nominal) -> MatrixPlan:
    axes = {
        "friction.static": {"0.4": {"friction.static": 0.4}, "0.5": {"friction.static": 0.5}},
        "scene": {"one": {"number": 0}, "two": {"number": 1}, "three": {"number": 0}},
        "procedure": {"drag": {"number": 1}, "stop": {"number": 0}},
    }
    other = nominal.with_values({"drum.speed": 3.0})
    return MatrixPlan("so", (nominal, other), axes, (Procedure("stop", (0.0, 1.0), (1.0, 0.0)), Procedure("drag")))


def test_cells_run_through_all_levels_the_last_axis_fastest(nominal):
    of = plan(nominal)
    assert (of.shape, of.points, of.keys) == ((2, 3, 2), 12, ("friction.static", "scene", "procedure"))
    labels = [tuple(of.levels(k).values()) for k in range(12)]
    assert labels[:3] == [("0.4", "one", "drag"), ("0.4", "one", "stop"), ("0.4", "two", "drag")]
    assert labels[7] == ("0.5", "one", "stop")
    scene, procedure = of.scene_at(9)
    assert (scene.friction.static, scene.drum.speed, procedure.name) == (0.5, 3.0, "stop")  # pyright: ignore[reportAttributeAccessIssue, reportOptionalMemberAccess]
    assert of.scene_at(4)[0].drum.speed == nominal.drum.speed
    assert [
        _clash(*pair) for pair in (("a.b", "a.b"), ("a", "a.b"), ("a.b", "a"), ("a.b", "a.bc"), ("shoe", "shoe.width"))
    ] == [True, True, True, False, False]


def test_the_first_axis_with_several_levels_is_across_and_the_others_down():
    def cell(**levels: str) -> CellFound:
        return CellFound.model_construct(levels=levels, verdict=CellVerdict.QUIET)

    cells = [cell(scene=s, mu=m, hot=h) for s in "ab" for m in ("x",) for h in "123"]
    found: Any = SimpleNamespace(axes={"scene": ["a", "b"], "mu": ["x"], "hot": ["1", "2", "3"]}, cells=cells)
    assert shown_axes(found) == ("hot", ["scene"])
    columns, rows = in_rows(found)
    assert columns == ["1", "2", "3"]
    assert [(label, [each.levels["hot"] for each in mine]) for label, mine in rows] == [
        ("a", list("123")),
        ("b", list("123")),
    ]
    found.axes = {"scene": ["a", "b"], "mu": ["x"], "hot": ["1"]}
    assert shown_axes(found) == ("scene", [])
    found.axes = {"scene": ["a"], "mu": ["x"]}
    assert shown_axes(found) == ("scene", [])


def test_a_cell_is_started_from_a_small_disturbance_and_the_largest_along_each_mode(monkeypatch):
    def ways(point, family, signs):
        assert (point, signs) == ("point", (1,))
        return [
            SimpleNamespace(sizes=(1.0, 2.0, size), start=lambda size, n=n: (n, size))
            for n, size in (("X", 4.0), ("Y", 9.0))
        ]

    monkeypatch.setattr(c, "directions", ways)
    family: Any = SimpleNamespace(small_start=lambda point, model: ("small", point, model))
    cell = c.Cell(None, "model", None, None, family, "point")  # pyright: ignore[reportArgumentType]
    assert cell.starts == [("small", "point", "model"), ("X", 4.0), ("Y", 9.0)]
