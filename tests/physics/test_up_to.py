"""Up to which frequency motion is resolved: what it means that growth rates stay, and how "auto" is found."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import drums
from drumsqueal.errors import RequestError
from drumsqueal.physics import composition, elasticity, inventory
from drumsqueal.physics.basis import kept_shapes
from drumsqueal.physics.elasticity import MORE, MOST_STEPS, compare, is_cut_short, pair_nearest, resolved, up_to_of
from drumsqueal.questions.effects import reductions
from drumsqueal.scene import load_scene
from drumsqueal.scene.mesh import ShoeModes

STEEL = {"young": 210e9, "poisson": 0.3}
FIRST = 1000.0  # Hz: the highest frequency of rigid bodies, as it is stood in for


def two_bent(nominal, drum="auto"):
    """Return two of the paper's shoes opposite each other, one of them thinner, that bend in a drum that bends."""
    scene = drums.several(nominal, {"first": 0.0, "second": np.pi}, {**drums.CUP, "up_to": drum})
    return scene.with_values({f"shoe.{k}.elastic": STEEL for k in range(2)} | {"shoe.1.thickness": 0.015})


@pytest.fixture
def searched(monkeypatch):
    """Stand in for eigenvalues by those of a function of the scene with frequencies in it; return what was seen."""
    seen: list[Any] = []

    def stand_in(eigenvalues):
        def kept(scene):
            seen.append(scene)
            return SimpleNamespace(eigenvalues=np.array(eigenvalues(scene), dtype=complex))

        monkeypatch.setattr(elasticity, "_highest_of_rigid", lambda _: FIRST)
        monkeypatch.setattr(elasticity, "kept_shapes", kept)
        monkeypatch.setattr(elasticity, "_find_up_to", elasticity.once(elasticity._find_up_to.__wrapped__))
        return seen

    return stand_in


def test_growth_rates_stay_where_none_changes_by_more_than_one_or_one_per_cent():
    own = [-5 + 100j, 300 + 200j, 1 + 900j]
    assert compare(own, [302.9 + 201j, 9 + 899j, -5.9 + 99j], 500.0) == ({0: 2, 1: 0}, 1, True)
    assert compare(own, [303.1 + 201j, 1 + 899j, -5.0 + 99j], 500.0) == ({0: 2, 1: 0}, 1, False)
    assert compare(own, [300.0 + 201j, 1 + 899j, -6.1 + 99j], 500.0) == ({0: 2, 1: 0}, 0, False)
    assert compare(own, own[1:], 250.0) == ({1: 0, 0: 1}, 0, False)  # 900 rad/s stands where 100 was
    assert compare(own, own[1:2], 250.0) == ({1: 0}, 1, False)  # one is lost
    assert compare(own, own, 50.0) == ({}, None, True)


def test_two_eigenvalues_are_never_the_same_one_of_others():
    """Though that is the nearest of both."""
    assert pair_nearest([100j, 104j], [103j, 120j]) == {0: 0, 1: 1}


def test_of_several_shoes_the_whole_brake_is_looked_at_and_each_shoe_alone_has_its_frequency(nominal, searched):
    scene = two_bent(nominal)
    # A mode that grows settles with shapes up to 1600 Hz of all of them.
    seen = searched(lambda one: [min(one.drum.elastic.up_to, MORE * FIRST) + 6000j])
    whole = resolved(scene)
    assert all(each.several for each in seen)
    bodies: Any = (*whole.shoes, whole.drum)
    for body in bodies:
        assert body.elastic.up_to == MORE * FIRST
    for one in whole.alone:
        assert up_to_of(one, "shoe") == up_to_of(one, "drum") == MORE * FIRST
    assert [each.drum.elastic.up_to / FIRST for each in seen] == pytest.approx([1, MORE, MORE**2])
    assert not is_cut_short(scene)


def test_whatever_asks_for_shapes_of_a_shoe_asks_with_the_frequency_of_the_whole_brake(nominal, searched, monkeypatch):
    scene, asked = two_bent(nominal), []
    searched(lambda one: [100 + 100j])

    def names(one, **_):
        asked.append(one.shoe.elastic.up_to)
        return ()

    for module in (composition, elasticity, reductions, inventory):
        for name in ("elastic_names", "shoe_modes", "symmetric_modes", "drum_names", "elastic_frequencies"):
            if hasattr(module, name):
                of_drum = name == "drum_names"
                monkeypatch.setattr(module, name, (lambda _: ("drum.E1",)) if of_drum else names)
    monkeypatch.setattr(elasticity, "numbers_of_shoe", lambda *_: {})
    for module in (elasticity, inventory):
        monkeypatch.setattr(module, "drum_modes", lambda _: None)
    for ask in (
        composition.coordinates_of,
        composition.plane_of,
        composition.compose,
        elasticity.numbers_of,
        reductions.bodies_of,
        inventory.take_inventory,
        lambda scene: list(inventory.bending_in_words(scene)),
    ):
        asked.clear()
        ask(scene)
        assert asked
        assert set(asked) == {FIRST}


def test_what_grows_next_to_the_highest_of_rigid_bodies_counts_from_the_start(nominal, searched):
    """And further up only what is resolved."""
    scene = two_bent(nominal)
    for times, steps in ((1.5, 1), (1.7, 0)):
        high = 2 * np.pi * times * FIRST
        searched(lambda one, high=high: [50 + 100j, min(one.drum.elastic.up_to, 1.6 * FIRST) + high * 1j])
        assert up_to_of(scene, "drum") == pytest.approx(MORE**steps * FIRST)


@pytest.mark.parametrize("end", ["steps", "shapes"])
def test_auto_ends_where_growth_rates_never_stay_or_shapes_are_not_found(nominal, searched, end):
    def eigenvalues(one):
        if end == "shapes" and one.drum.elastic.up_to > 2 * FIRST:
            raise RequestError("too many")
        return [one.drum.elastic.up_to + 100j]

    scene = two_bent(nominal)
    searched(eigenvalues)
    assert up_to_of(scene, "drum") == pytest.approx(MORE ** (MOST_STEPS if end == "steps" else 1) * FIRST)
    assert is_cut_short(scene)
    assert not is_cut_short(scene.with_values(dict.fromkeys(("shoe.0.elastic", "shoe.1.elastic", "drum.elastic"))))


def test_modal_results_limit_their_own_body_alone(nominal, searched, monkeypatch):
    monkeypatch.setattr(ShoeModes, "read", lambda self: SimpleNamespace(frequencies=np.array([0.0, 700.0])))
    modes = ShoeModes.model_construct(file="modes.npz", unit="m", mass_unit="kg", sha256=None)

    def given(scene):
        return scene.model_copy(update={"shoe": scene.shoe.model_copy(update={"modes": modes})})

    bent = nominal.with_values({"shoe.elastic": STEEL, "drum.elastic": drums.CUP})
    seen = searched(lambda one: [min(one.drum.elastic.up_to, MORE * FIRST) + 6000j])
    scene = given(bent)
    assert (up_to_of(scene, "shoe"), up_to_of(scene, "drum")) == (700.0, MORE * FIRST)
    assert {each.shoe.elastic.up_to for each in seen} == {700.0}
    seen.clear()
    assert up_to_of(given(bent.with_values({"drum.elastic": None})), "shoe") == 700.0
    assert up_to_of(given(bent.with_values({"drum.elastic.up_to": 900.0})), "drum") == 900.0
    assert seen == []  # nothing is to be found


@pytest.mark.thorough
def test_a_rigid_shoe_beside_one_that_bends_needs_no_drum_that_bends_for_the_search():
    """That such shoes do not feel each other is said where a model is built."""
    scene = load_scene("simplex", ["shoe.0.elastic=none", "drum.elastic=none", 'shoe.1.elastic.up_to="3 kHz"'])
    kept = kept_shapes(scene)
    rigid, bending, drum = (kept.sums(body).shape[0] for body in (0, 1, -1))
    assert (rigid, drum) == (0, 0)
    assert bending > 0
