"""Does the brake of Seo & Kang (2023) do what the paper says? Its Figures 4 to 11, with transients laid over them."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from drumsqueal.interrupts import noted_interrupts, stop_if_interrupted
from drumsqueal.physics.model import build_model
from drumsqueal.questions.paper.curves import Curve, FrictionCurve, check_brake, friction_curve, paper_curves
from drumsqueal.questions.paper.statement import Statement
from drumsqueal.questions.paper.statements import check_statements
from drumsqueal.questions.paper.transients import OnPoint, Point, paper_transients
from drumsqueal.scene import Scene
from drumsqueal.scene.seo_kang import seo_kang_brake

OnCurves = Callable[[FrictionCurve, Mapping[str, Curve]], None]


class PaperStudy(NamedTuple):
    """The friction curve, eigenvalues and transients by figure ("5" to "11"), and the paper's statements checked.

    `kicks` are the transients from beyond the contact boundary, linearly stable by constant friction and by damping.
    """

    scene: Scene
    friction: FrictionCurve
    curves: Mapping[str, Curve]
    points: Mapping[str, tuple[Point, ...]]
    kicks: tuple[Point, Point]
    statements: tuple[Statement, ...]


def study_paper(
    scene: Scene | None = None, *, on_curves: OnCurves | None = None, on_point: OnPoint | None = None
) -> PaperStudy:
    """Recompute the paper's figures and check what it states: `study_paper().statements`.

    Another scene than the paper's is held against the same statements. `on_curves` is given the curves before the
    transients begin; `on_point` is told what is computed, its number and how many there are. Raises RequestError and
    SceneError for a scene that cannot be varied so, KeyboardInterrupt between two chunks of a transient.
    """
    scene = seo_kang_brake() if scene is None else scene
    check_brake(scene)
    told = on_point or (lambda *_: None)
    with noted_interrupts():
        told("eigenvalues", 0, 1)
        curves = paper_curves(scene)
        stop_if_interrupted()
        friction = friction_curve(scene)
        if on_curves is not None:
            on_curves(friction, curves)
        points, kicks = paper_transients(scene, told)
    statements = check_statements(build_model(scene).shoe, friction, curves, points, kicks)
    return PaperStudy(scene, friction, curves, points, kicks, statements)
