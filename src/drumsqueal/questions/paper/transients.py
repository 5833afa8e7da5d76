"""Transients at some points of the paper's figures: growth measured below the contact boundary, and the motion that it
grows into."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.growth_phase import ModeComparison
from drumsqueal.findings.saturation import Saturation
from drumsqueal.physics.model import build_model
from drumsqueal.progress import Progress
from drumsqueal.questions.paper.curves import AXES, constant_friction
from drumsqueal.questions.sensitivity.decay import DISTURBANCE, disturbed
from drumsqueal.scene import COORDINATES, Scene
from drumsqueal.simulation import prepare, run_whole
from drumsqueal.solve.linear.modes import analyse_stability

MORE = 1.05  # times the damping with which the last mode neither grows nor decays
NOT_RUN = "the transient was not run"


@dataclass(frozen=True)
class Point:
    """One transient: the figure it belongs to, the value (SI) of the number varied, and what it did.

    `comparison` is None where there is no transient, and `why_not` then says why.
    """

    figure: str
    key: str
    value: float
    scene: Scene
    comparison: RunFindings | None = None
    why_not: str = NOT_RUN

    @property
    def modes(self) -> tuple[ModeComparison, ...]:
        """What was measured of each mode."""
        return () if self.comparison is None else self.comparison.modes

    @property
    def saturation(self) -> Saturation | None:
        """The saturated motion."""
        return None if self.comparison is None else self.comparison.saturation


def points_of_figures(scene: Scene) -> list[Point]:
    """The points of all figures, not yet run. Raises SceneError for a value that makes no brake."""
    own, points = scene.numbers(), []
    for axis in AXES:
        for fraction in axis.transients:
            value = float(own[axis.key]) * fraction  # pyright: ignore[reportArgumentType] (checked by check_brake)
            changes = {axis.key: value} if fraction != 1 else {}
            if axis.figure == "6":
                changes |= constant_friction(scene)
            points.append(Point(axis.figure, axis.key, value, scene.with_values(changes)))
    return points


def disturbed_points(scene: Scene) -> tuple[Point, Point]:
    """Two starts beyond the contact boundary of a brake that is linearly stable, not yet run.

    One is stable by constant friction, the other by structural damping, a twentieth more than the least that makes
    every mode decay; its ratio is then the point's value.
    """
    modes = analyse_stability(build_model(scene, coordinates=COORDINATES)).modes
    known = 0.0 if scene.damping is None else float(scene.damping.ratio)
    ratio = known + MORE * max(0.0, *(mode.growth_rate / abs(mode.eigenvalue) for mode in modes))
    constant = disturbed(scene.with_values(constant_friction(scene)))
    damped = disturbed(scene.with_values({"damping": {"ratio": ratio}}))
    return Point("6", "start", DISTURBANCE, constant), Point("5", "damping.ratio", ratio, damped)


def run_points(points: Sequence[Point], progress: Progress) -> list[Point]:
    """Run the transients of points, a scene that several share once. Raises SceneError for one that cannot be run."""
    scenes = {point.scene.to_toml(): point.scene for point in points}
    ran: dict[str, RunFindings | str] = {}
    for number, (text, scene) in enumerate(scenes.items()):

        def show(_: str, reached: float, duration: float | None, number: int = number) -> None:
            progress(f"transient {number + 1} of {len(scenes)}", number + reached / (duration or 1.0), len(scenes))

        show("", 0, None)
        try:
            ran[text] = run_whole(prepare(scene), show).findings
        except IntegrationError as error:
            ran[text] = f"failed: {error}"
    results = [(point, ran[point.scene.to_toml()]) for point in points]
    return [
        replace(point, why_not=result) if isinstance(result, str) else replace(point, comparison=result, why_not="")
        for point, result in results
    ]
