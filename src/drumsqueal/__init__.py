"""drumsqueal: friction-induced vibration of a drum-brake shoe in time, beside the eigenvalues that predict it."""

from drumsqueal import precision as precision  # first: it switches double precision on
from drumsqueal.comparison import Comparison, compare
from drumsqueal.integrate import IntegrationError
from drumsqueal.model import Model, build_model
from drumsqueal.modes import Mode, Stability, analyse_stability, growth_rate
from drumsqueal.run import Result, run
from drumsqueal.scene import Scene, SceneError, load_scene, scene_from_dict
from drumsqueal.steady import SteadyStateError

__all__ = [
    "Comparison",
    "IntegrationError",
    "Mode",
    "Model",
    "Result",
    "Scene",
    "SceneError",
    "Stability",
    "SteadyStateError",
    "analyse_stability",
    "build_model",
    "compare",
    "growth_rate",
    "load_scene",
    "run",
    "scene_from_dict",
]
