"""What transients start from: small starts and disturbances along modes, against sums written out."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.dynamics import ensemble
from drumsqueal.dynamics.ensemble import Family, Start, directions, go_on, surface_speed
from drumsqueal.findings.kinds import Kind
from drumsqueal.physics.bodies.brake import Share
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.several import Contacts
from drumsqueal.questions.onset.found import _between, _bracket, _tried
from drumsqueal.questions.sensitivity import disturbing
from drumsqueal.questions.sensitivity.disturbing import BrakeVariant, Origin, _both_ways, _case, _random_starts

MOVING, NAMES = ("X", "Tz"), ("Tz", "Y", "X")
MASS = np.array([2.0, 0.3])
RNG = np.random.default_rng(8)
SHAPES = RNG.normal(size=(3, 6)) + 1j * RNG.normal(size=(3, 6))
BOUNDARIES = np.array([[2.0, 11.0], [3.0, 0.5]])  # of lift-off and slip reversal (rows), of two shoes


def mode(k: int, name: str) -> Any:
    return SimpleNamespace(name=name, label=f"{name} {k}", right=SHAPES[k], frequency_Hz=9.0)


MODES = (mode(0, "X"), mode(1, "Y"), mode(2, "Tz"))
POINT: Any = SimpleNamespace(value=4.0, vibrations=MODES)


@pytest.fixture
def family(monkeypatch) -> Family:
    """Models whose shoes reach their boundaries at sums of |vibration| and of |velocity|."""

    def ratios(model, vibration, velocity):
        lost, back = np.abs(vibration).sum(axis=1).max(), np.abs(velocity).sum(axis=1).max()
        return np.array([[lost], [back]]) / BOUNDARIES

    monkeypatch.setattr(ensemble, "boundary_ratios_by_shoe", ratios)
    monkeypatch.setattr(ensemble, "surface_speed", lambda model, velocity: float(np.abs(velocity).max()))
    return Family(lambda value: SimpleNamespace(mass=MASS, value=value), MOVING, NAMES)  # pyright: ignore[reportArgumentType]


def reached(k: int) -> tuple[np.ndarray, list[float]]:
    """Displacement and velocity of a mode, X before Tz, and the fractions of the boundaries of what takes part."""
    shape = np.array([SHAPES[k][[2, 0]], SHAPES[k][[5, 3]]])
    turns = np.exp(2j * np.pi * np.arange(32) / 32)
    sizes = [max(np.abs((turn * part).real).sum() for turn in turns) for part in shape]
    found = [[size / limit for limit in row] for size, row in zip(sizes, BOUNDARIES, strict=True)]
    return shape, [each for row in found for each in row if each >= 0.1 * max(row)]


def test_a_mode_reaches_the_boundaries_of_the_shoes_that_take_part(family, monkeypatch):
    for k in range(3):
        shape, fractions = family.reach(MODES[k], family.model_at(1.0))
        np.testing.assert_array_equal(shape, reached(k)[0])
        assert fractions == pytest.approx(reached(k)[1])
    monkeypatch.setitem(globals(), "BOUNDARIES", np.array([[2.0, 21.0], [3.0, 0.29]]))
    assert len(family.reach(MODES[0], family.model_at(1.0))[1]) == 2  # a twentieth of the other shoe is not enough
    monkeypatch.setitem(globals(), "BOUNDARIES", np.full((2, 2), np.inf))
    assert family.reach(MODES[0], family.model_at(1.0))[1] == []
    assert not directions(POINT, family)
    assert not family.small_start(POINT, family.model_at(1.0)).velocity.any()


def test_a_small_start_has_every_mode_that_moves_at_its_share_of_a_tenth(family):
    assert family.vibrations(POINT) == [MODES[0], MODES[2]]
    for size in (0.1, 0.03):
        start = family.small_start(POINT, family.model_at(1.0), *(() if size == 0.1 else (size,)))
        wanted = sum(size / 2 / max(reached(k)[1]) * reached(k)[0].real for k in (0, 2))  # pyright: ignore[reportAttributeAccessIssue]
        assert start.name == "small"
        np.testing.assert_allclose([start.vibration, start.velocity], wanted)
    alone: Any = SimpleNamespace(vibrations=MODES[1:2])
    assert not np.any(family.small_start(alone, family.model_at(1.0))[1:3])


def test_disturbances_along_a_mode_are_doubled_from_a_tenth_of_the_nearer_boundary_to_thrice_the_farther(family):
    found = directions(POINT, family)
    assert [each.name for each in found] == [
        f"disturbance {mode} {way}" for mode in ("X 0", "Tz 2") for way in ("forwards", "backwards")
    ]
    for each, k, sign in zip(found, (0, 0, 2, 2), (1, -1, 1, -1), strict=True):
        shape, fractions = reached(k)
        phases = [(np.exp(2j * np.pi * j / 64) * shape[1]).real for j in range(64)]
        fastest = max(phases, key=lambda v: v**2 @ MASS)
        joule = 1 / math.sqrt(fastest**2 @ MASS / 2)
        nearer, farther = joule * max(fractions), joule * min(fractions)
        assert each.boundary_ratio == pytest.approx(nearer)
        assert (each.sizes[0], each.sizes[-1]) == pytest.approx((0.1 / nearer, 3 / farther))
        ratios = np.diff(np.log2(each.sizes))
        assert np.ptp(ratios) < 1e-9
        assert ratios.max() <= 1.0 < ratios.max() * len(each.sizes[1:]) / (len(each.sizes) - 2)
        start = each.start(1.7)
        assert start.disturbance is not None
        sure = sign * np.sign(fastest @ start.velocity)  # two phases half a turn apart are as fast
        np.testing.assert_allclose(sure * start.velocity, sign * 1.7 * joule * fastest)
        assert sure == 1
        np.testing.assert_array_equal(start.vibration, [0.0, 0.0])
        assert start.name == f"{each.name} {1.7 * nearer:.4g}"
        disturbance = start.disturbance
        assert (disturbance.mode, disturbance.forwards, disturbance.energy_J) == (
            each.mode.label,
            sign > 0,
            pytest.approx(1.7**2),
        )
        assert disturbance.velocity == pytest.approx(dict(zip(MOVING, start.velocity, strict=True)))
        assert disturbance.speed_m_per_s == pytest.approx(np.abs(start.velocity).max())
        assert disturbance.boundary_ratio == pytest.approx(1.7 * nearer)
        assert MASS @ start.velocity**2 / 2 == pytest.approx(disturbance.energy_J)
    assert [each.forwards for each in directions(POINT, family, (1,))] == [True, True]


def test_disturbances_of_all_modes_at_once_have_sizes_and_phases_of_their_own(family):
    starts = _random_starts(family, POINT)
    generator = np.random.default_rng(disturbing.SEED)
    for number, each in enumerate(starts, start=1):
        limits = [(0.1 / max(reached(k)[1]), 3.0 / min(reached(k)[1])) for k in (0, 2)]
        sizes = [low * (high / low) ** generator.random() for low, high in limits]
        turns = generator.random(2)
        wanted = sum(
            s * (np.exp(2j * np.pi * t) * reached(k)[0]).real for s, t, k in zip(sizes, turns, (0, 2), strict=True)
        )
        assert (each.kind, each.start.name) == (Origin.RANDOM, f"random {number}")
        np.testing.assert_allclose([each.start.vibration, each.start.velocity], wanted)
    assert len(starts) == 32


def test_both_ways_but_for_the_largest_forwards(family):
    found = [each.start for each in _both_ways(family, POINT)]
    wanted = [
        (each, size)
        for each in directions(POINT, family)
        for size in each.sizes
        if not (each.forwards and size == each.sizes[-1])
    ]
    assert len(found) == len(wanted)
    for start, (each, size) in zip(found, wanted, strict=True):
        np.testing.assert_array_equal(start.velocity, each.start(size).velocity)


def body_of(seed: int) -> Any:
    def over_drum(v, angle, across):
        assert (angle.shape, across.shape) == ((181,), (2, 1))
        assert (angle[0], angle[-1], across[0, 0], across[1, 0]) == (-0.6, 0.6, -0.02, 0.02)
        return v["X"] * np.cos(angle) + 0 * across, v["Tz"] * np.sin(angle) * (1 + seed * across), v["X"] * across

    return SimpleNamespace(half_angle=0.6, width=0.04, over_drum=over_drum)


def test_the_fastest_point_of_a_surface_is_the_fastest_of_any_shoe():
    def contact_of(seed: int) -> Any:
        contact = Contact.__new__(Contact)
        object.__setattr__(contact, "body", body_of(seed))
        return contact

    one: Any = SimpleNamespace(contact=contact_of(1), names=("X", "Tz"))
    angle = np.linspace(-0.6, 0.6, 181)
    velocity = np.array([3.0, 7.0])
    squares = [(3 * np.cos(angle)) ** 2 + (7 * np.sin(angle) * (1 + z)) ** 2 + (3 * z) ** 2 for z in (-0.02, 0.02)]
    assert surface_speed(one, velocity) == pytest.approx(np.sqrt(np.max(squares)))
    other: Any = SimpleNamespace(contact=contact_of(3), names=("X", "Tz"))
    sides = [(Share("a.", (2, 0), 3, 0), one), (Share("b.", (1, 0), 3, 1), other)]
    both: Any = SimpleNamespace(contact=Contacts.__new__(Contacts), sides=sides)
    found = surface_speed(both, np.array([7.0, 2.0, 3.0]))
    assert found == pytest.approx(max(surface_speed(one, velocity), surface_speed(other, np.array([2.0, 7.0]))))
    block: Any = SimpleNamespace(contact=SimpleNamespace(slides=(False, True)))
    assert surface_speed(block, np.array([5.0, -4.0])) == 4.0


def test_a_motion_goes_on_at_another_value_as_large_or_some_times_larger():
    motion: Any = SimpleNamespace(state=np.array([[1.0, 2.0], [3.0, 4.0]]))
    assert go_on(7.25, motion).name == "from 7.25"
    found = go_on(7.25, motion, 1.5)
    assert (found.name, found.from_value) == ("1.5 times from 7.25", 7.25)
    np.testing.assert_array_equal([found.vibration, found.velocity], [[1.5, 3.0], [4.5, 6.0]])


class Same:
    """A motion that is the same as those of its name."""

    def __init__(self, name: str) -> None:
        self.name = name

    def same(self, other: "Same") -> bool:
        return self.name == other.name

    like = same


def led_to(**sizes: tuple[float, ...]) -> dict[float, Any]:
    leads = {"decays": Kind.DECAYS, "undecided": Kind.UNDECIDED}
    return {
        size: SimpleNamespace(leads_to=leads.get(name, Kind.SQUEALS), motion=None if name in leads else Same(name))
        for name, each in sizes.items()
        for size in each
    }


def test_the_smallest_disturbance_lies_between_the_largest_that_leads_elsewhere_and_the_smallest_that_leads_there():
    led = led_to(decays=(1.0, 2.0, 8.5), loud=(8.0, 9.0), quiet=(3.0, 5.0), undecided=(7.0,))
    motion: Any = Same
    assert _bracket(led, motion("loud")) == (5.0, 8.0)
    assert _bracket(led, motion("quiet")) == (2.0, 3.0)
    assert _bracket(led, motion("none")) == (9.0, math.inf)
    assert _bracket(led_to(loud=(4.0,)), motion("loud")) == (0.0, 4.0)
    assert _between(1.0, 1.0199) == _between(1.0, math.inf) == []
    assert _between(2.0, 32.0) == pytest.approx([4.0, 8.0, 16.0])
    assert _between(0.0, 8.0) == [8.0 / 2**k for k in range(1, 11)]
    assert _tried(led, 8.0 * (1 + 0.9e-9))
    assert not _tried(led, 8.0 * (1 + 1.1e-9))


def test_squeal_of_the_same_point_may_go_on_and_one_of_another_that_is_unlike():
    def trial(name: str, **at: float) -> Any:
        return SimpleNamespace(at=at, motion=Same(name))

    here, alike, other, more = trial("loud", speed=1.0), trial("loud"), trial("quiet"), trial("third", speed=2.0)
    found = _case(3, BrakeVariant({"load": 5.0, "speed": 9.0}, (here, alike, other, more)), {"speed": 1.0})  # pyright: ignore[reportArgumentType]
    assert (found.brake, found.numbers, found.at) == (3, {"load": 5.0, "speed": 1.0}, {"speed": 1.0})
    assert found.carried == (here, other)
    assert found.likeliest
    assert not _case(3, BrakeVariant({}, (alike, here)), {"speed": 1.0}).likeliest  # pyright: ignore[reportArgumentType]
    assert not _case(3, BrakeVariant({}), {}).likeliest


def test_a_trial_says_from_what_it_was_started(monkeypatch):
    monkeypatch.setattr(disturbing, "surface_speed", lambda model, velocity: 2 * float(velocity[0]))
    model: Any = SimpleNamespace(names=MOVING, mass=MASS)
    response: Any = SimpleNamespace(leads_to=Kind.DECAYS, simulated_s=5.0, motion=None)
    disturbed = disturbing.Disturbed(Origin.MODE, Start("disturbance", np.zeros(2), np.array([3.0, 4.0])))
    found = disturbing._trial(disturbed, {"speed": 1.0}, response, model)
    assert (found.at, found.start, found.kind) == ({"speed": 1.0}, "disturbance", Origin.MODE)
    assert (found.displacement, found.velocity) == ({"X": 0.0, "Tz": 0.0}, {"X": 3.0, "Tz": 4.0})
    assert (found.energy_J, found.speed_m_per_s) == (pytest.approx(2 * 9 / 2 + 0.3 * 16 / 2), 6.0)
    assert (found.leads_to, found.simulated_s) == (Kind.DECAYS, 5.0)
    displaced = disturbing.Disturbed(Origin.OWN, Start("own", np.array([0.0, 1.0]), np.array([3.0, 4.0])))
    found = disturbing._trial(displaced, {}, response, model)
    assert (found.energy_J, found.speed_m_per_s, found.displacement["Tz"]) == (None, None, 1.0)
