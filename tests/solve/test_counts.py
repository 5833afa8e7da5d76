"""What the shipped scenes cost, in counts: steps, those of them that were refused, and evaluations of the forces."""

from pathlib import Path

import numpy as np
import pytest

from drumsqueal.scene import load_scene
from drumsqueal.simulation import prepare, transient

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("*.toml"))
# Beyond the contact boundaries round-off, which differs between processors and programs, moves a step here and there:
# so much of all steps.
SCATTER = 0.03
COUNTS = {
    "constant_friction": (7363, 2, 95729),
    "damped": (41940, 8837, 545260),
    "elastic_drum": (13939, 1889, 181222),
    "leading_shoe": (3908, 138, 50808),
    "nominal": (84469, 22926, 1098137),
    "out_of_plane": (3029, 5, 39381),
    "ramp": (173010, 41427, 2249340),
    "rocking": (23314, 5412, 303092),
    "self_consistent": (72091, 17287, 937223),
    "simplex": (18693, 2400, 243019),
    "stop": (53621, 11385, 507341),
    "trailing_shoe": (3834, 125, 49846),
    "uncertain": (41940, 8837, 545260),
}


LONG = {"elastic_drum", "rocking", "simplex", "stop"}  # a minute and more
SCENES = [pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * (path.stem in LONG)) for path in SCENARIOS]


@pytest.mark.thorough
@pytest.mark.parametrize("path", SCENES)
def test_shipped_scenes_take_as_many_steps_as_they_did(path):
    chunks = list(transient(prepare(load_scene(path))))
    found = tuple(
        np.nansum([getattr(each, name) for each in chunks]) for name in ("steps", "rejected_steps", "evaluations")
    )
    steps, rejected, evaluations = COUNTS[path.stem]
    assert found[0] == pytest.approx(steps, rel=SCATTER)
    assert found[1] == pytest.approx(rejected, abs=SCATTER * steps)
    assert found[2] == pytest.approx(evaluations, rel=SCATTER)
