"""The search for the smallest change that makes a brake quiet, on borders of stability and of quiet that are planes."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.dynamics.attractor import SteadyResponse, VelocityPerturbation
from drumsqueal.errors import RequestError
from drumsqueal.findings.kinds import Kind
from drumsqueal.questions.sensitivity import answer as words
from drumsqueal.questions.sensitivity import quieting, study
from drumsqueal.questions.sensitivity.disturbing import BrakeVariant, Decay, DisturbedSqueal, Origin, Trial
from drumsqueal.questions.sensitivity.quieting import (
    FURTHER,
    PRECISION,
    Alone,
    LineSearch,
    Quietening,
    Quieting,
    search,
)
from drumsqueal.questions.sensitivity.stabilising import SLACK, Caution, Change, numbers_of
from drumsqueal.questions.sensitivity.study import SensitivityStudy, study_sensitivity
from drumsqueal.scene.variation import Written

KEYS = ("shoe.width", "friction.static", "contact.stiffness")
WAYS = np.array([3.0, -5.0, 1.0])  # 1/s that a change by a factor of e takes from the growth rate
ROUNDING = 0.02  # of a change: what few digits add to it


class Border:
    """Growth rates g − w·x and quiet from n·x = 1 on, of the logarithms x of three numbers of a scene."""

    def __init__(self, scene, growth: float, quiet_at: float = 1.0, ways=WAYS) -> None:
        self.numbers = numbers_of(scene)
        self.before = np.array([self.numbers[key] for key in KEYS])
        self.growth, self.quiet_at, self.normal, self.ways = growth, quiet_at, np.array([0.8, -0.3, 0.0]), ways
        self.judged: list[tuple[str, bool, dict[str, float], tuple[Any, ...]]] = []

    def sizes(self, numbers) -> np.ndarray:
        """Logarithms, and below a tenth their tangent."""
        ratios = np.array([numbers.get(key, self.numbers[key]) / self.numbers[key] for key in KEYS])
        return np.where(ratios < 0.1, np.log(0.1) - 1 + 10 * ratios, np.log(np.maximum(ratios, 0.1)))

    def rate(self, x: np.ndarray) -> float:
        return float(self.growth - self.ways @ x)

    def state_matrix(self, values):
        numbers = dict(zip(self.numbers, values, strict=True))
        rate, slopes = self.rate(self.sizes(numbers)), np.zeros((len(values), 2, 2))
        for key, way, before in zip(KEYS, self.ways, self.before, strict=True):
            slopes[list(self.numbers).index(key)] = -way / max(numbers[key], 0.1 * before) * np.eye(2)
        return np.array([[rate, -400.0], [400.0, rate]]), slopes

    def judge(self, brakes, what):
        self.judged += [(what, each.thorough, each.numbers, each.carried) for each in brakes]
        return [self.found(self.sizes(brake.numbers)) for brake in brakes]

    def found(self, x: np.ndarray) -> DisturbedSqueal:
        point: Any = SimpleNamespace(reason="", unstable=self.rate(x) > 0)
        quiet = self.normal @ x >= self.quiet_at
        trial = Trial(
            start="", kind=Origin.OWN, displacement={}, velocity={}, energy_J=None, speed_m_per_s=None,
            leads_to=Kind.DECAYS if quiet else Kind.FAILED, simulated_s=0.1,
        )  # fmt: skip
        return DisturbedSqueal.of((point,), (trial,))


@pytest.fixture
def searched(nominal, monkeypatch):
    """The search of a border, and the scene that it is in; the fastest mode needs 130 kHz in a stiff one."""

    def made(border: Border, *, disturbed: bool = True, margin: float = 1.0) -> Quietening:
        scenes: list[Any] = []

        def prepare(scene):
            scenes.append(scene)
            return SimpleNamespace(stability=SimpleNamespace(highest_frequency_Hz=65e3))

        monkeypatch.setattr(quieting, "prepare", prepare)
        monkeypatch.setattr(quieting, "Disturber", lambda scene, progress, points: border if disturbed else None)
        return Quietening(nominal, KEYS, margin=margin, state_matrix=border.state_matrix)

    return made


def changes_of(found: Quieting, border: Border) -> np.ndarray:
    changed = {each.key: each.after for each in found.changes}
    for each in found.changes:
        assert each.before == border.numbers[each.key]
    assert {key: found.scene.numbers()[key] for key in changed} == pytest.approx(changed)
    assert found.norm_of_logarithms == pytest.approx(np.linalg.norm(border.sizes(changed)))
    assert found.norm_of_relative_changes == pytest.approx(math.hypot(*(each.relative for each in found.changes)))
    assert found.largest_growth_rate_1_per_s == pytest.approx(border.rate(border.sizes(changed)), abs=1e-9)
    assert found.scene.simulate.sample_rate == 150e3  # a multiple of 50 kHz, from 2 × 65 kHz on
    assert "150000" in found.scene_file
    return border.sizes(changed)


@pytest.mark.parametrize("growth", [2.0, 0.3])
def test_what_cannot_squeal_changes_the_least_that_makes_every_mode_decay(nominal, searched, growth):
    border = Border(nominal, growth)
    for margin in (1.0, 0.4):
        of = searched(border, disturbed=False, margin=margin)
        assert of.squeal() is None
        found = of.together((), (), quiet=True)
        x = changes_of(found, border)
        # The nearest place of the plane w·x = g + margin, w/|w|² times that; 0.1 of the largest change is left out.
        wanted = WAYS * (growth + margin) / (WAYS @ WAYS)
        np.testing.assert_allclose(x, wanted, rtol=0.1)
        least = (growth + margin) / np.linalg.norm(WAYS)
        assert least * (1 - SLACK) <= np.linalg.norm(x) <= least * (1 + 2 * ROUNDING)
        assert (found.found, found.quiet, found.disturbances) == (True, None, ())
        assert (found.succeeded, found.motions) == (True, ())


def test_a_number_that_would_change_by_little_stays_as_it_is(nominal, searched):
    ways = np.array([3.0, -0.2, 1.0])
    border = Border(nominal, 2.0, ways=ways)
    found = searched(border, disturbed=False).together((), (), quiet=True)
    x = changes_of(found, border)
    assert {each.key for each in found.changes} == {"shoe.width", "contact.stiffness"}
    np.testing.assert_allclose(x[[0, 2]], 3.0 / (ways @ ways) * ways[[0, 2]], rtol=0.04)


def test_where_no_change_makes_every_mode_decay_it_is_the_one_with_least_growth(nominal, searched):
    border = Border(nominal, 500.0)
    of = searched(border)
    found = of.together((), (), quiet=False)
    x = changes_of(found, border)
    assert (found.found, found.quiet, found.succeeded) == (False, None, False)
    np.testing.assert_allclose(x, np.where(WAYS > 0, of._problem.high, of._problem.low), rtol=1e-3)


def alone_of(border: Border, of: Quietening) -> tuple[Alone, ...]:
    """What each number alone has to be changed by, as far as that is known."""
    rows = []
    for key, before, part in zip(KEYS, border.before, border.normal, strict=True):
        after = before * math.exp(1.03 * border.quiet_at / part) if part else None
        change = None if after is None else Change.of(of._problem.written, key, float(before), after)
        rows.append(Alone(key=key, lowest=0.0, highest=math.inf, quiet=change))
    return tuple(rows)


@pytest.mark.parametrize("known", [True, False])
def test_all_numbers_together_change_the_least_that_is_quiet(nominal, searched, known):
    """Quiet is the plane n·x = 1, its nearest place n/|n|²; every mode decays long before."""
    border = Border(nominal, -3.0)
    of = searched(border)
    found = of.together(alone_of(border, of) if known else (), (), quiet=False)
    x = changes_of(found, border)
    assert (found.found, found.quiet, found.succeeded) == (True, True, True)
    least = 1 / np.linalg.norm(border.normal)
    assert border.normal @ x >= 1
    assert np.linalg.norm(x) <= (1.06 if known else 1.3) * least
    # What is found was tried from every disturbance, and brakes a little further out with the likeliest ones.
    proofs = [each for each in border.judged if each[0] == "proof"]
    thorough = [border.sizes(numbers) for _, whole, numbers, _ in proofs if whole]
    assert any(np.allclose(x, each) for each in thorough)
    if known:
        further = [border.sizes(numbers) for _, whole, numbers, _ in proofs if not whole]
        for times in FURTHER:
            assert any(np.allclose(each, times * x, rtol=2.1 * ROUNDING, atol=0.02) for each in further)


def test_a_brake_that_no_change_makes_quiet_is_made_stable(nominal, searched):
    border = Border(nominal, 2.0, quiet_at=1e3)
    found = searched(border).together((), (), quiet=False)
    x = changes_of(found, border)
    assert (found.found, found.quiet, found.succeeded) == (True, False, False)
    assert np.linalg.norm(x) == pytest.approx(3.0 / np.linalg.norm(WAYS), rel=2 * ROUNDING)
    # Brakes whose modes decay by 1, 1.6, 1.6² … 1/s are tried up to what bounds allow.
    tried = [border.rate(border.sizes(numbers)) for what, _, numbers, _ in border.judged if what == "all numbers"]
    steps = [1.6**k for k in range(16)]
    assert len(tried) >= 4
    for rate, step in zip(tried, steps, strict=False):
        assert -step * (1 + 0.1) - 0.1 <= rate <= -step * (1 - SLACK)


def test_a_brake_that_is_stable_already_is_tried_with_faster_and_faster_modes(nominal, searched):
    border = Border(nominal, -2.0, quiet_at=0.5)
    line = searched(border)._by_margin(())
    positions = []
    while line.position is not None:
        positions.append(line.position)
        line.take(())
    assert positions[:4] == pytest.approx([2 * 1.6**k for k in (1, 2, 3, 4)])
    assert line.numbers_at(3.2) is not None
    unstable = searched(Border(nominal, 2.0))._by_margin(())
    assert (unstable.position, unstable.squeals_at) == (1.0, pytest.approx(1 - PRECISION))
    assert searched(Border(nominal, -2.0))._by_margin(()).squeals_at == pytest.approx(2 * (1 - PRECISION))


def test_a_quiet_brake_changes_nothing(nominal, searched):
    found = searched(Border(nominal, -3.0)).together((), (), quiet=True)
    assert (found.changes, found.found, found.quiet) == ((), True, None)
    assert found.largest_growth_rate_1_per_s == pytest.approx(-3.0)


def test_what_a_brake_does_when_it_is_disturbed(nominal, searched, monkeypatch):
    border = Border(nominal, -3.0)
    asked = []
    judged = lambda x: lambda *given, **how: asked.append((given, how)) or [border.found(x)]  # noqa: E731
    monkeypatch.setattr(border, "judge", judged(np.ones(3)))
    found = searched(border).squeal()
    assert found is not None
    assert (found.steady_sliding_stable, found.quiet, found.motions) == (True, False, ())
    assert len(found.disturbances) == 1
    assert asked == [(([BrakeVariant({})], "disturbances"), {"until_squeal": False})]
    monkeypatch.setattr(border, "judge", judged(np.array([9.0, 0, 0])))
    assert searched(border).squeal().quiet  # pyright: ignore[reportOptionalMemberAccess]
    border.growth = 30.0
    assert not searched(border).squeal().steady_sliding_stable  # pyright: ignore[reportOptionalMemberAccess]


# --- lines -----------------------------------------------------------------------------------------------------------


class Judge:
    """Quiet from 1.5 on; what squeals below is carried on."""

    def __init__(self, squeals=lambda x, thorough: x < 1.5) -> None:
        self.squeals, self.asked = squeals, []

    def judge(self, brakes, what):
        self.asked += [(each.numbers["x"], each.thorough, each.carried) for each in brakes]
        found = [(each.numbers["x"], self.squeals(each.numbers["x"], each.thorough)) for each in brakes]
        return [SimpleNamespace(quiet=not squeals, squealing=(f"at {x:g}",) if squeals else ()) for x, squeals in found]


def test_a_line_is_halved_to_where_it_is_quiet_and_proven_there():
    judge, seen, first = Judge(), [], object()
    line = LineSearch(lambda x: {"x": x}, [0.5, 1.0, 2.0, 4.0], 0.25, (first,), farthest=1.7)  # pyright: ignore[reportArgumentType]
    search([line], judge, lambda *given: seen.append(given), "so")  # pyright: ignore[reportArgumentType]
    # Between 1 and 2: 1.5 is quiet, and 1.25 … 1.46875 squeal, which is within 4 % of 1.5.
    last = 1.46875
    tried = [(x, False) for x in (0.5, 1.0, 2.0, 1.5, 1.25, 1.375, 1.4375, last)] + [(1.5, True), (1.1 * 1.5, False)]
    assert [(x, thorough) for x, thorough, _ in judge.asked] == tried
    assert [carried for *_, carried in judge.asked[-2:]] == [(f"at {last:g}", first)] * 2
    assert (line.quiet_at, line.squeals_at, line.position) == (1.5, last, None)
    assert 1.5 - line.squeals_at <= PRECISION * 1.5
    assert seen[0] == ("so", 0, 1)
    assert seen[-1] == ("so", 1, 1)


def test_what_a_proof_shows_to_squeal_is_gone_on_from_further_out():
    judge = Judge(lambda x, thorough: x < (2.2 if thorough else 0.9))
    line = LineSearch(lambda x: {"x": x}, [1.0, 2.0, 3.0], 0.8)
    search([line], judge, lambda *_: None, "so")  # pyright: ignore[reportArgumentType]
    assert line.quiet_at is not None
    assert 2.2 <= line.quiet_at <= 3.0
    loose = LineSearch(lambda x: {"x": x}, [1.0, 2.0, 3.0], 0.8, proven=False)
    search([loose], judge, lambda *_: None, "so")  # pyright: ignore[reportArgumentType]
    assert loose.quiet_at is not None
    assert 0.9 <= loose.quiet_at <= 0.9 * (1 + PRECISION)
    given = LineSearch(lambda x: {"x": x}, [1.0, 2.0, 3.0], 0.8)
    search([given], judge, lambda *_: None, "so", given_up=lambda line: line.squeals_at >= 1.0)  # pyright: ignore[reportArgumentType]
    assert given.quiet_at is None


# --- the study -------------------------------------------------------------------------------------------------------


def a_study(scene, **more: Any) -> SensitivityStudy:
    modes = [
        SimpleNamespace(label=label, name=label[:1], growth_rate_1_per_s=rate, unstable=rate > 0)
        for label, rate in (("X", -3.0), ("Y", -1.0), ("Y (2)", -2.0))
    ]
    known: dict[str, Any] = {
        "scene": scene, "modes": tuple(modes), "numbers": (), "divergence_rate_1_per_s": None, "state_matrix": "matrix",
        "operating": SimpleNamespace(points=({}, {"drum.speed": 9.0})), "until_stable": False, "squeal": None,
        "alone": (), "quiet": None, "round_off_1_per_s": 0.1, "largest_deviation_from_central_differences": 0.0,
    }  # fmt: skip
    return SensitivityStudy.model_construct(**(known | more))


def row(key: str, *growth: float) -> Any:
    return SimpleNamespace(key=key, growth_per_percent_1_per_s=growth)


def test_modes_that_matter_are_the_unstable_ones_or_those_that_squeal_or_the_least_stable(nominal):
    rows = (row("a", 0.3, -0.05, 0.0), row("b", 0.0, 0.2, 0.4), row("c", -0.5, 0.09, -0.6), row("d", 0.1, 0.1, 0.1))
    of = a_study(nominal, numbers=rows)
    assert (words.modes_that_matter(of), of.relevant) == ("the least stable mode", (1,))
    assert [each.key for each in of.in_order().numbers] == ["b", "d", "c", "a"]
    squeal: Any = SimpleNamespace(motions=(SimpleNamespace(line_of="Y"),), steady_sliding_stable=True, quiet=False)
    of = of.model_copy(update={"squeal": squeal})
    assert (words.modes_that_matter(of), of.relevant) == ("the modes that squeal", (1, 2))
    assert [each.key for each in of.in_order().numbers] == ["c", "b", "d", "a"]
    of.modes[0].unstable = True
    assert (words.modes_that_matter(of), of.relevant) == ("the unstable mode", (0,))
    assert [each.key for each in of.in_order().numbers] == ["c", "a", "d", "b"]
    assert [each.key for each in of.effective] == ["a", "b", "c"]  # by more than 0.1 1/s


@pytest.mark.parametrize(
    ("change", "stable", "none_needed"),
    [
        ({}, True, True),
        ({"divergence_rate_1_per_s": 2.0}, False, False),
        ({"squeal": SimpleNamespace(motions=(), steady_sliding_stable=False, quiet=False)}, False, False),
        ({"squeal": SimpleNamespace(motions=(), steady_sliding_stable=True, quiet=False)}, True, False),
        ({"squeal": SimpleNamespace(motions=(), steady_sliding_stable=True, quiet=True)}, True, True),
    ],
)
def test_no_change_is_needed_where_nothing_grows_and_every_disturbance_decays(nominal, change, stable, none_needed):
    of = a_study(nominal, **change)
    assert (of.stable, of.needs_no_change) == (stable, none_needed)
    of.modes[2].unstable = True
    assert (of.stable, of.needs_no_change) == (False, False)


@pytest.mark.parametrize("until_stable", [False, True])
@pytest.mark.parametrize(("quiet", "found"), [(None, True), (True, True), (False, True), (False, False)])
def test_a_study_goes_on_until_the_brake_is_quiet_and_keeps_what_is_known(
    nominal, monkeypatch, until_stable, quiet, found
):
    known, made, kept = [], {}, []
    squeal = None if quiet is None else DisturbedSqueal.model_construct(
        steady_sliding_stable=True, quiet=quiet, motions=(), disturbances=(), squealing_="carried"
    )  # fmt: skip
    answer = Quieting.model_construct(found=found, scene="changed", transients=())

    class Search:
        def __init__(self, scene, keys, **more):
            made.update(more, scene=scene, keys=keys)

        def squeal(self):
            return squeal

        def alone(self, carried):
            known.append(("alone", carried))
            return ("each",)

        def together(self, alone, carried, *, quiet):
            known.append(("together", alone, carried, quiet))
            return answer

    first = a_study(nominal)
    first.modes[0].unstable = quiet is None
    decay = Decay(outcome=Kind.DECAYS)
    checked = []
    monkeypatch.setattr(study, "Quietening", Search)
    monkeypatch.setattr(study, "_prepare", lambda scene: SimpleNamespace(stability=SimpleNamespace(time=0.25)))
    monkeypatch.setattr(study, "_check_load", lambda scene, time: checked.append(time))
    monkeypatch.setattr(study, "check_points", lambda *given: checked.append(given))
    monkeypatch.setattr(study, "_differentiate", lambda scene, tables, at, progress: first)
    monkeypatch.setattr(study, "nonlinear_decay", lambda scene, progress: decay if scene == "changed" else None)
    monkeypatch.setattr(DisturbedSqueal, "squealing", ("loud",))
    done = study_sensitivity(
        nominal, until_stable=until_stable, keys=("a",), at=("at",), tables={"t": 1}, keep=kept.append  # pyright: ignore[reportArgumentType]
    )  # fmt: skip
    if not until_stable:
        assert (done, kept, known, checked, made) == (first, [], [], [], {})
        return
    assert checked == [0.25, (nominal, ("at",), ("a",))]
    progress = made.pop("progress")
    assert made == {
        "scene": nominal, "keys": ("a",), "points": ({}, {"drum.speed": 9.0}), "tables": {"t": 1},
        "state_matrix": "matrix",
    }  # fmt: skip
    assert callable(progress)
    assert done.until_stable
    assert done.squeal is squeal
    assert (kept[0].until_stable, kept[0].squeal) == (True, None)
    if quiet:
        assert (len(kept), known, done.alone, done.quiet) == (1, [], (), None)
        return
    carried = () if quiet is None else ("loud",)
    assert known == [("alone", carried), ("together", ("each",), carried, quiet is None)]
    assert [(each.squeal, each.alone, each.quiet) for each in kept[1:]] == [
        (squeal, (), None), (squeal, ("each",), None), (squeal, ("each",), answer)
    ]  # fmt: skip
    assert done.quiet is not None
    assert done.quiet.transients == ((decay,) if found else ())


@pytest.mark.parametrize("one_end", [False, True])
def test_differences_by_modes_found_anew_are_taken_one_per_cent_to_either_side(monkeypatch, one_end):
    """Two modes whose eigenvalues are 3 p² and 5 p of a number p that shapes them, beside one that has no place.

    Where one of them is at one end alone, that one is half of the difference.
    """
    own = {"shoe.width": 0.2, "shoe.lost": 0.0, "shoe.swapped": 2.0, "shoe.beyond": 3.0, "a": 7.0}
    asked = []

    class Scene(SimpleNamespace):
        def numbers(self):
            return own

        def as_one(self, key):
            return ("shoe.width", "shoe.1.width") if key.endswith("width") else (key,)

        def with_values(self, values):
            if "shoe.beyond" in values:
                raise RequestError("so")
            asked.append(values)
            return values

    keys = ("shoe.width", "shoe.1.width", "shoe.lost", "shoe.swapped", "shoe.beyond")
    monkeypatch.setattr(study, "shaping_numbers", lambda scene: keys)
    monkeypatch.setattr(study, "prepare", lambda end: SimpleNamespace(stability=end))

    def followed(end, own):
        assert own is here
        p = next(iter(end.values()))
        lost = "shoe.swapped" in end or (one_end and p > 0.2)
        return np.array([3 * p**2 + 1j * p, complex(np.nan, np.nan) if lost else 5 * p])

    monkeypatch.setattr(study, "_followed_to", followed)
    here: Any = SimpleNamespace(modes=[SimpleNamespace(eigenvalue=each) for each in (3 * 0.2**2 + 0.2j, 1.0)])
    (found,) = study._by_free_modes(here, Scene(), lambda *_: None)  # pyright: ignore[reportArgumentType]
    assert (found.key, found.value_SI) == ("shoe.width", 0.2)
    assert found.growth_per_SI == pytest.approx((6 * 0.2, 5.0))
    assert found.frequency_Hz_per_SI == pytest.approx((1 / math.tau, 0.0))
    assert found.growth_per_percent_1_per_s == pytest.approx((0.01 * 0.2 * 1.2, 0.01 * 0.2 * 5))
    assert found.growth_per_percent_by_differences_1_per_s == pytest.approx(found.growth_per_percent_1_per_s)
    widths = [tuple(each.values()) for each in asked if "shoe.width" in each]
    assert widths == [pytest.approx((0.202, 0.202)), pytest.approx((0.198, 0.198))]


# --- each number alone -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("disturbed", [True, False])
def test_each_number_alone_is_changed_to_where_the_brake_is_stable_and_to_where_it_is_quiet(
    nominal, searched, disturbed
):
    """Growth falls below −1 1/s at w x = 3: at 1, −0.6 and 3; quiet is 0.8 x = 1 and −0.3 x = 1, at 1.25 and −3.3."""
    border = Border(nominal, 2.0)
    of = searched(border, disturbed=disturbed)
    asked: list[Any] = []
    of._progress = lambda *given: asked.append(given)
    found = {each.key: each for each in of.alone(())}
    width, static, stiffness = (found[key] for key in KEYS)
    assert [each[:2] for each in asked if each[0] == "each number alone"][:6] == [
        ("each number alone", k) for k in range(6)
    ]
    assert width.stable.logarithm == pytest.approx(1.0, rel=2 * ROUNDING)  # pyright: ignore[reportOptionalMemberAccess]
    assert static.stable.logarithm == pytest.approx(-0.6, rel=2 * ROUNDING)  # pyright: ignore[reportOptionalMemberAccess]
    assert stiffness.stable is None  # by a factor of ten at most, which is 2.3
    assert (stiffness.quiet, stiffness.change) == (None, None)
    limits = of._problem.limits
    assert {key: (each.lowest, each.highest) for key, each in found.items()} == limits
    if disturbed:
        assert 1.25 <= width.quiet.logarithm <= 1.25 * (1 + PRECISION) * (1 + ROUNDING)  # pyright: ignore[reportOptionalMemberAccess]
        assert width.change is width.quiet
        assert static.quiet is None or static.quiet.logarithm <= -3.3 / 1.1
        assert list(found) == ["shoe.width", "friction.static", "contact.stiffness"]
    else:
        assert (width.quiet, static.quiet, width.change) == (None, None, width.stable)
        assert list(found) == ["friction.static", "shoe.width", "contact.stiffness"]  # by the size of the change


def test_a_number_of_a_stable_brake_changes_the_way_in_which_its_modes_decay_faster(nominal, searched):
    border = Border(nominal, -3.0)
    of = searched(border)
    found = {each.key: each for each in of.alone(())}
    assert all(each.stable is None for each in found.values())
    assert 1.25 <= found["shoe.width"].quiet.logarithm <= 1.25 * (1 + PRECISION) * (1 + ROUNDING)  # pyright: ignore[reportOptionalMemberAccess]
    assert found["contact.stiffness"].quiet is None
    sizes = np.array([border.sizes(numbers) for *_, numbers, _ in border.judged])
    moved = [sizes[:, k][np.abs(sizes[:, k]) > 1e-9] for k in range(3)]
    assert [set(np.sign(each)) for each in moved] == [{1.0}, {-1.0}, {1.0}]


# --- sentences -------------------------------------------------------------------------------------------------------


def a_trial(energy: float | None, leads: Kind = Kind.DECAYS, kind: Origin = Origin.MODE, **more: Any) -> Trial:
    disturbance = None
    if energy is not None:
        disturbance = VelocityPerturbation(
            mode=more.pop("mode", "X"), forwards=True, velocity={}, speed_m_per_s=2 * energy, energy_J=energy,
            boundary_ratio=1.0,
        )  # fmt: skip
    motion = None
    if leads is Kind.SQUEALS:
        motion = SteadyResponse(
            start="", amplitude={"Y": 2e-5}, rms={"Y": 1e-5}, frequency_Hz=more.pop("frequency", 950.0), line_of="Y",
            kinetic_energy_J=more.pop("loud", 1.0), share_of_contact_loss=1.0, share_of_slip_reversal=1.0, drift=0.0,
        )  # fmt: skip
    return Trial(
        kind=kind, disturbance=disturbance, displacement={}, velocity={}, energy_J=energy, speed_m_per_s=None,
        leads_to=leads, simulated_s=1.0, motion=motion, start=more.pop("start", "its start"), **more,
    )  # fmt: skip


def squeal_of(*trials: Trial, stable: bool = True) -> DisturbedSqueal:
    motions = tuple(each.motion for each in trials if each.motion is not None)
    return DisturbedSqueal(steady_sliding_stable=stable, quiet=False, motions=motions, disturbances=trials)


def test_what_a_brake_does_after_a_disturbance_is_told_with_the_smallest_that_starts_it(nominal):
    decays, squeals = a_trial(1.0), a_trial(2.0, Kind.SQUEALS)
    shown = "squeal at 950 Hz, Y ±20 µm"
    assert words.squeal_words(squeal_of(decays, squeals), nominal) == (
        "As it is, steady sliding is stable, but squeals after a large disturbance. A velocity along mode X of 2 J "
        f"(4 m/s of the lining's surface) leads to {shown}; 1 J in the same way decays."
    )
    high = a_trial(5.0, Kind.SQUEALS, frequency=2000.0, loud=9.0, at={"drum.speed": 7.0})
    said = words.squeal_words(squeal_of(squeals, high), nominal)
    assert said.endswith(
        f"leads to {shown}. Other disturbances lead to squeal at 2000 Hz, Y ±20 µm at drum.speed = 7 rad/s (from a "
        "velocity along mode X of 5 J (10 m/s of the lining's surface))."
    )
    kinds = {
        Origin.EARLIER: "from its start, before the change", Origin.OWN: "from its start",
        Origin.RANDOM: "from a disturbance of all modes at once, its start",
    }  # fmt: skip
    for kind, start in kinds.items():
        said = words.squeal_words(squeal_of(a_trial(None, Kind.SQUEALS, kind)), nominal)
        assert said.endswith(f"large disturbance. Disturbances lead to {shown} ({start}).")
    many = [a_trial(None, Kind.SQUEALS, Origin.OWN, frequency=100.0 * k) for k in range(1, 6)]
    said = words.squeal_words(squeal_of(*many, stable=False), nominal)
    assert said.startswith("As it is, the brake squeals: squeal at 100 Hz")
    assert said.count("squeal at") == 3
    assert said.endswith("; and 2 more.")
    left = words.squeal_words(squeal_of(decays, a_trial(3.0, Kind.FAILED), a_trial(4.0, Kind.UNDECIDED)), nominal)
    assert "2 of the 3 tried do not decay either (failed, undecided)" in left
    unstable = words.squeal_words(squeal_of(decays, stable=False), nominal)
    assert unstable == "As it is, steady sliding is unstable; none of the 1 disturbances tried settles to squeal."


def test_disturbances_that_were_tried_are_counted_by_their_kinds():
    trials = [a_trial(1.0), a_trial(0.02, mode="Y"), a_trial(30.0)]
    trials += [a_trial(None, kind=Origin.RANDOM)] * 3 + [a_trial(None, kind=Origin.EARLIER)] * 2
    first = "its own start; a displacement of three compressions; each mode three times beyond both contact boundaries"
    assert words.tried_words([]) == first
    assert words.tried_words(trials) == (
        f"{first}; velocities along X, Y, both ways, from 0.02 J to 3e+01 J; 3 random ones of all modes at once; "
        "2 from the squeal that there was before"
    )


def a_quieting(nominal, **more: Any) -> Quieting:
    written = Written(nominal)
    numbers = {"shoe.width": 0.05, "friction.static": 0.4, "contact.stiffness": 0.1e11, "shoe.density": 7900.0}
    own = nominal.numbers()
    changes = tuple(Change.of(written, key, own[key], after) for key, after in numbers.items())
    known: dict[str, Any] = {
        "found": True, "quiet": True, "changes": changes, "norm_of_relative_changes": 1.0, "scene": nominal,
        "largest_growth_rate_1_per_s": -2.5, "disturbances": (a_trial(1.0),),
    }  # fmt: skip
    return Quieting(**(known | more))


def test_the_changes_that_make_a_brake_quiet_are_named_the_largest_first(nominal, monkeypatch):
    monkeypatch.setattr(words, "where", lambda operating: "here")
    monkeypatch.setattr(words, "where_else", lambda operating: " and there")
    operating: Any = None
    said = words.quiet_sentence(a_quieting(nominal, cautions=(Caution.WIDE,)), operating)
    assert said.startswith(
        "Quiet at here and there with contact.stiffness changed from 3.5e+10 to 1e+10 N/m^3, shoe.width changed from "
        "0.0365 to 0.05 m, friction.static changed from 0.5 to 0.4 and 1 smaller change: every growth rate is "
        "-2.5 1/s or below. The lining is then wider than the radius of the drum. None of the 1 disturbances tried "
        "squeals: its own start; "
    ), said
    assert said.endswith("At other speeds and loads it may squeal.")
    endings = {
        "not settled": (Decay(outcome=Kind.UNDECIDED, start="x", duration_s=3.0), ""),
        "squeals": (
            Decay(outcome=Kind.SQUEALS, start="x", kind=Kind.PERIODIC, frequency_Hz=70.0),
            " From x the transient keeps squealing: its motion is periodic, mostly at 70 Hz.",
        ),
        "failed": (Decay(outcome=Kind.FAILED, start="x", reason="so"), " From x the transient failed: so."),
    }
    for decay, told in endings.values():
        found = words.quiet_sentence(a_quieting(nominal, transients=(decay,)), operating)
        assert found.endswith(f"it may squeal.{told}")
    stable = words.quiet_sentence(a_quieting(nominal, quiet=None, changes=()), operating)
    assert stable == "Stable at here and there with nothing changed: every growth rate is -2.5 1/s or below."
    waits = words.quiet_sentence(a_quieting(nominal, quiet=None, transients=(endings["not settled"][0],)), operating)
    assert waits.endswith("From x the transient has not settled within 3.0 s; run it for longer.")


def test_why_a_search_has_no_result_is_told(nominal):
    alone = tuple(Alone(key=key, lowest=0.0, highest=1.0) for key in KEYS)

    def said(**more: Any) -> str:
        return words.not_found(a_study(nominal, alone=alone, quiet=a_quieting(nominal, **more)))

    names = ", ".join(KEYS)
    assert said(found=False, largest_growth_rate_1_per_s=3.25) == (
        f"no change of {names} within the bounds was found that brings every growth rate to -1 1/s or below; the "
        "largest growth rate can be brought down to +3.25 1/s"
    )
    start = f"no change of {names} within the bounds was found after which no disturbance squeals; with "
    left = said(quiet=False, disturbances=(a_trial(1.0), a_trial(2.0, Kind.SQUEALS)))
    assert left.startswith(f"{start}contact.stiffness changed from")
    assert "every mode decays, but there is still squeal at 950 Hz" in left
    assert said(quiet=False).endswith("every mode decays, but the brake has not been shown to be quiet")
    rows = (
        alone[0].model_copy(update={"cautions": (Caution.WIDE,)}),
        alone[1].model_copy(update={"cautions": (Caution.WIDE, Caution.RISING)}),
    )
    assert words.cautions_of(rows) == (
        f"{KEYS[0]}, {KEYS[1]}: {Caution.WIDE}.", f"{KEYS[1]}: {Caution.RISING}."
    )  # fmt: skip
    of = a_study(nominal)
    assert words.modes_that_matter(of) == "the least stable mode"
    of.modes[0].unstable = True
    assert words.modes_that_matter(of) == "the unstable mode"
    of.modes[1].unstable = True
    assert words.modes_that_matter(of) == "the unstable modes"
