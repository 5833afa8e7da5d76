"""By how much a prediction changes with further shapes, and what is said of it."""

from types import SimpleNamespace
from typing import Any

import pytest

from drumsqueal.errors import RequestError
from drumsqueal.findings import prediction
from drumsqueal.findings.prediction import ShapeResolution, predict, resolution_in_words, resolution_of
from drumsqueal.physics.model import build_model
from drumsqueal.scene import load_scene
from drumsqueal.solve.linear.modes import analyse_stability


def test_words_of_several_frequencies_are_true_of_each_and_auto_says_where_it_ended():
    found = ShapeResolution(
        up_to_Hz=4e3,
        highest_up_to_Hz=4e3,
        with_up_to_Hz=6.4e3,
        below_Hz=3e3,
        mode="Y",
        growth_rate_1_per_s=0.5,
        frequency_Hz=0.2,
        torque_fraction=0.0,
        verdict_changes=False,
        suffices=True,
        search_ended=False,
    )

    def said(**other):
        (words,) = resolution_in_words(found.model_copy(update=other))
        return words

    assert said().startswith("With shapes up to 6.4 kHz in place of 4 kHz, growth rates of modes below 3 kHz change ")
    assert said().endswith(": up_to = 4 kHz is enough.")
    assert "Raise up_to to 6.4 kHz, or until" in said(suffices=False)
    several = {"highest_up_to_Hz": 8e3}
    assert said(**several).startswith("With shapes up to 6.4 to 12.8 kHz in place of 4 to 8 kHz, growth rates of modes")
    assert said(**several).endswith(": up_to = 4 to 8 kHz is enough.")
    assert "Raise up_to to 6.4 to 12.8 kHz, or until" in said(**several, suffices=False)
    ended = '"auto" looks no further than 6.6 times the highest frequency of rigid bodies.'
    assert said(suffices=False, search_ended=True).endswith(ended)
    assert ended not in said(suffices=False)
    more = said(more_grow_from_Hz=11.59e3)
    assert (
        ": up_to = 4 kHz is enough for these modes. With shapes up to 6.4 kHz more modes grow, from 11.59 kHz " in more
    )
    assert said(mode="", suffices=False) == "No mode is below 3 kHz: raise up_to until some are."


@pytest.mark.parametrize(("ratio", "grow_from"), [(0.0, 11.59e3), (0.002, None)])
def test_modes_that_grow_beyond_those_that_are_kept_are_told(nominal, ratio, grow_from):
    """Friction that falls with the slip speed feeds all modes; the fifth pair of the shoe's own is at 11.6 kHz."""
    elastic = {"young": 210e9, "poisson": 0.3, "up_to": 8e3}
    found = resolution_of(nominal.with_values({"shoe.elastic": elastic, "damping.ratio": ratio}))
    assert isinstance(found, ShapeResolution)
    assert found.suffices
    assert found.more_grow_from_Hz == (None if grow_from is None else pytest.approx(grow_from, rel=1e-3))


def test_what_is_not_found_of_further_shapes_is_said_and_why(nominal, monkeypatch):
    def fails(*_, **__):
        raise RequestError("too many modes")

    monkeypatch.setattr(prediction, "build_model", fails)
    scene = nominal.with_values({"shoe.elastic": {"young": 210e9, "poisson": 0.3, "up_to": 3e3}})
    model: Any = SimpleNamespace()
    found = resolution_of(scene, model, model)
    assert isinstance(found, RequestError)
    assert list(resolution_in_words(found)) == [
        "What shapes up to 1.6 times up_to would change is not known, as they are not found: too many modes"
    ]
    assert predict(analyse_stability(build_model(nominal)), found).resolution is None
    assert resolution_of(nominal, model, model) is None  # nothing bends


@pytest.mark.slow
def test_shapes_up_to_the_frequency_that_auto_finds_are_enough_for_the_simplex_brake():
    """Those of two shoes and a drum are found up to 23 kHz."""
    keys = ("shoe.0.elastic", "shoe.1.elastic", "drum.elastic")
    found = resolution_of(load_scene("simplex", [f'{key}.up_to="auto"' for key in keys]))
    assert isinstance(found, ShapeResolution)
    assert found.suffices
    assert found.up_to_Hz == found.highest_up_to_Hz
