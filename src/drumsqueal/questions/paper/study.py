"""Does the brake of Seo & Kang (2023) do what the paper says? Its Figures 4 to 11, with transients laid over them."""

from collections.abc import Callable, Mapping, Sequence

from pydantic import Field

from drumsqueal.findings.schema import Findings, Held
from drumsqueal.physics.model import build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.paper.curves import Curve, FrictionCurve, check_brake, friction_curve, paper_curves
from drumsqueal.questions.paper.statement import Statement
from drumsqueal.questions.paper.statements import check_statements
from drumsqueal.questions.paper.transients import Point, disturbed_points, points_of_figures, run_points
from drumsqueal.scene import Scene
from drumsqueal.scene.seo_kang import seo_kang_brake


class PaperStudy(Findings):
    """The paper's statements checked, and by figure ("5" to "11") the eigenvalues and transients that they rest on.

    `disturbed` are two transients that start beyond the contact boundary of a brake that is linearly stable, one by
    constant friction and one by damping.
    """

    printed_by = "drumsqueal.questions.paper.answer.print_study"
    statements: tuple[Statement, ...]
    friction: FrictionCurve | None = Held
    curves: Mapping[str, Curve] = Field(default={}, exclude=True)
    points: Mapping[str, tuple[Point, ...]] = Field(default={}, exclude=True)
    disturbed: tuple[Point, ...] = Field(default=(), exclude=True)


def study_paper(
    scene: Scene | None = None,
    *,
    progress: Progress = silent,
    keep: Callable[[PaperStudy], None] = lambda _: None,
) -> PaperStudy:
    """Recompute the paper's figures and check what it states: `study_paper().statements`.

    Another scene than the paper's is compared with the same statements. `keep` takes the curves, before the transients
    are run. Raises RequestError and SceneError for a scene that cannot be varied so.
    """
    scene = seo_kang_brake() if scene is None else scene
    check_brake(scene)
    progress("eigenvalues", 0, None)
    curves, friction, shoe = paper_curves(scene), friction_curve(scene), build_model(scene).shoe

    def checked(points: Sequence[Point]) -> PaperStudy:
        *of_figures, constant, damped = points
        by_figure = {name: tuple(each for each in of_figures if each.figure == name) for name in curves}
        statements = check_statements(shoe, friction, curves, by_figure, (constant, damped))
        return PaperStudy(
            scene=scene,
            statements=statements,
            friction=friction,
            curves=curves,
            points=by_figure,
            disturbed=(constant, damped),
        )

    points = [*points_of_figures(scene), *disturbed_points(scene)]
    keep(checked(points))
    return checked(run_points(points, progress))
