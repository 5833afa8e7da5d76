"""drumsqueal: when does a drum brake squeal, how, and do eigenvalues and nonlinear transient agree?

`load_scene` reads a scene and `run` runs it. `study_onset` finds where along a parameter it squeals, `study_accuracy`
how large its errors are, and `study_effects` which effects it needs. `build_model`, `analyse_stability` and
`growth_rate` are the linear analysis, for any parameters. `integrate_many` integrates many models at once,
`sweep_parameters` many scenes. `read_measured` and `compare_measured` compare a measured record with a history.
`help(drumsqueal.run)` describes `run`.

The names below are imported when they are first used: reading a scene does not load JAX, and the command line can
prepare its environment first.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drumsqueal.errors import CycleError, IntegrationError, SteadyStateError
    from drumsqueal.findings.compare import RunFindings, compare
    from drumsqueal.physics.laws.custom_friction import TabulatedLaw
    from drumsqueal.physics.laws.friction_law import ConstantLaw, ExponentialLaw, FrictionLaw, StepLaw, friction_law
    from drumsqueal.physics.model import Model, build_model
    from drumsqueal.physics.small_bodies import block_on_belt, disc_on_plate, sprung_block_on_belt
    from drumsqueal.questions.accuracy.study import AccuracyStudy, study_accuracy
    from drumsqueal.questions.animate.animation import save_animation
    from drumsqueal.questions.animate.playback import Playback, play_history, play_mode
    from drumsqueal.questions.compare.measured.reader import read_measured
    from drumsqueal.questions.compare.measured.record import Measured
    from drumsqueal.questions.compare.study import MeasuredComparison, compare_measured
    from drumsqueal.questions.cycle.branches import follow_cycles
    from drumsqueal.questions.cycle.diagram import CycleBranches, Diagram
    from drumsqueal.questions.cycle.search import CycleSearch, CycleStudy, find_cycle
    from drumsqueal.questions.effects.study import EffectStudy, study_effects
    from drumsqueal.questions.motion.study import MotionStudy, SettledMotion, study_motion
    from drumsqueal.questions.onset.found import Onset, OnsetStudy
    from drumsqueal.questions.onset.study import study_onset
    from drumsqueal.questions.paper.study import PaperStudy, study_paper
    from drumsqueal.questions.sensitivity.quieting import Quieting, quieten
    from drumsqueal.questions.sensitivity.study import SensitivityStudy, study_sensitivity
    from drumsqueal.questions.sweep.study import sweep_parameters
    from drumsqueal.scene import Scene, SceneError, load_scene, scene_from_dict
    from drumsqueal.scene.seo_kang import seo_kang_brake
    from drumsqueal.scene.variation import Variation
    from drumsqueal.simulation import Result, run
    from drumsqueal.solve.linear.modes import Mode, Stability, analyse_stability, growth_rate
    from drumsqueal.solve.motion import Motion, integrate
    from drumsqueal.solve.transient.batch import integrate_many

_HOMES = {
    "solve.transient.batch": ("integrate_many",),
    "findings.compare": ("RunFindings", "compare"),
    "physics.laws.custom_friction": ("TabulatedLaw",),
    "physics.laws.friction_law": ("ConstantLaw", "ExponentialLaw", "FrictionLaw", "StepLaw", "friction_law"),
    "errors": ("CycleError", "IntegrationError", "SteadyStateError"),
    "questions.compare.measured.reader": ("read_measured",),
    "questions.compare.measured.record": ("Measured",),
    "questions.animate.animation": ("save_animation",),
    "questions.animate.playback": ("Playback", "play_history", "play_mode"),
    "physics.model": ("Model", "build_model"),
    "physics.small_bodies": ("block_on_belt", "disc_on_plate", "sprung_block_on_belt"),
    "solve.motion": ("Motion", "integrate"),
    "solve.linear.modes": ("Mode", "Stability", "analyse_stability", "growth_rate"),
    "scene": ("Scene", "SceneError", "load_scene", "scene_from_dict"),
    "simulation": ("Result", "run"),
    "questions.accuracy.study": ("AccuracyStudy", "study_accuracy"),
    "questions.cycle.branches": ("follow_cycles",),
    "questions.cycle.diagram": ("CycleBranches", "Diagram"),
    "questions.cycle.search": ("CycleSearch", "CycleStudy", "find_cycle"),
    "questions.effects.study": ("EffectStudy", "study_effects"),
    "questions.compare.study": ("MeasuredComparison", "compare_measured"),
    "questions.motion.study": ("MotionStudy", "SettledMotion", "study_motion"),
    "questions.onset.found": ("Onset", "OnsetStudy"),
    "questions.onset.study": ("study_onset",),
    "questions.paper.study": ("PaperStudy", "study_paper"),
    "questions.sensitivity.quieting": ("Quieting", "quieten"),
    "questions.sensitivity.study": ("SensitivityStudy", "study_sensitivity"),
    "scene.seo_kang": ("seo_kang_brake",),
    "scene.variation": ("Variation",),
    "questions.sweep.study": ("sweep_parameters",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "AccuracyStudy",
    "ConstantLaw",
    "CycleBranches",
    "CycleError",
    "CycleSearch",
    "CycleStudy",
    "Diagram",
    "EffectStudy",
    "ExponentialLaw",
    "FrictionLaw",
    "IntegrationError",
    "Measured",
    "MeasuredComparison",
    "Mode",
    "Model",
    "Motion",
    "MotionStudy",
    "Onset",
    "OnsetStudy",
    "PaperStudy",
    "Playback",
    "Quieting",
    "Result",
    "RunFindings",
    "Scene",
    "SceneError",
    "SensitivityStudy",
    "SettledMotion",
    "Stability",
    "SteadyStateError",
    "StepLaw",
    "TabulatedLaw",
    "Variation",
    "analyse_stability",
    "block_on_belt",
    "build_model",
    "compare",
    "compare_measured",
    "disc_on_plate",
    "find_cycle",
    "follow_cycles",
    "friction_law",
    "growth_rate",
    "integrate",
    "integrate_many",
    "load_scene",
    "play_history",
    "play_mode",
    "quieten",
    "read_measured",
    "run",
    "save_animation",
    "scene_from_dict",
    "seo_kang_brake",
    "sprung_block_on_belt",
    "study_accuracy",
    "study_effects",
    "study_motion",
    "study_onset",
    "study_paper",
    "study_sensitivity",
    "sweep_parameters",
]


def __getattr__(name: str) -> Any:
    """Import a public name from its module."""
    if name not in _HOME:
        raise AttributeError(f"module 'drumsqueal' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"drumsqueal.{_HOME[name]}"), name)
    globals()[name] = value
    return value
