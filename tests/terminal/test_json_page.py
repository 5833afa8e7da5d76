"""docs/json.md lists what every command writes as JSON: the page against the models that write it."""

import re

import pytest
from pydantic import BaseModel

import json_reference
from drumsqueal.command_line import GROUPS
from drumsqueal.findings.brake import PredictionOfBrake
from drumsqueal.findings.compare import RunFindings
from drumsqueal.questions.accuracy.study import AccuracyStudy
from drumsqueal.questions.animate.animation import Animation
from drumsqueal.questions.check import Check
from drumsqueal.questions.compare.study import MeasuredComparison
from drumsqueal.questions.cycle.study import CycleBranches, CycleStudy
from drumsqueal.questions.effects.study import EffectStudy
from drumsqueal.questions.export.export import Exported
from drumsqueal.questions.fit.study import Fit
from drumsqueal.questions.motion.study import MotionStudy
from drumsqueal.questions.onset.found import OnsetStudy
from drumsqueal.questions.report.answer import Page
from drumsqueal.questions.sensitivity.study import SensitivityStudy
from drumsqueal.questions.sweep.found import SweepStudy
from drumsqueal.questions.sweep.matrix_cells import NoiseMatrix

PAGE = json_reference.PAGE.read_text(encoding="utf-8")
MODELS: dict[str, type[BaseModel]] = {
    "run": RunFindings,
    "stability": PredictionOfBrake,
    "check": Check,
    "motion": MotionStudy,
    "onset": OnsetStudy,
    "cycle": CycleStudy,
    "cycle --along": CycleBranches,
    "sweep": SweepStudy,
    "matrix": NoiseMatrix,
    "sensitivity": SensitivityStudy,
    "effects": EffectStudy,
    "accuracy": AccuracyStudy,
    "compare": MeasuredComparison,
    "fit": Fit,
    "animate": Animation,
    "export": Exported,
    "report": Page,
}


def test_every_command_that_answers_has_a_model_here():
    commands = {name for group in GROUPS.values() for name in group}
    assert {name.partition(" ")[0] for name in MODELS} == commands - {"scenes", "paper"}  # see test_paper.py


@pytest.mark.parametrize("command", MODELS)
def test_the_page_names_every_key_of_every_command(command):
    section = re.search(rf"^### {re.escape(command)}\n(.*?)(?=^###|\Z)", PAGE, flags=re.M | re.S)
    assert section is not None
    keys = re.findall(r"`(\w+)`", section[1].partition("Keys: ")[2].partition("\n\n")[0])
    model = MODELS[command]
    assert f"`{model.__module__}.{model.__name__}`" in section[1]
    assert keys == list(model.model_json_schema(mode="serialization")["properties"])


def test_the_keys_and_what_they_mean_are_those_of_the_models():
    assert json_reference.page(PAGE) == PAGE, "run docs/_make/json_reference.py"
    # Of a part that two commands have, the second names the first.
    assert (
        "- `brake`: A shoe in steady sliding as a brake, by the drum's speed, the load and the forces at `time_s`:"
        in PAGE
    )
    assert PAGE.count("as of run.") > 3
    # A meaning beside a field, and one below a property.
    assert "`growth_rate_1_per_s` (Re λ; positive grows)" in PAGE
