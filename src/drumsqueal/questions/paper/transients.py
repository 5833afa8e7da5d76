"""Transients at some points of the paper's figures: growth measured below the edges, and the motion it grows into."""

from collections.abc import Callable
from typing import NamedTuple

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.compare import Comparison
from drumsqueal.findings.history import COMPLETE
from drumsqueal.physics.model import build_model
from drumsqueal.questions.paper.curves import AXES, constant_friction
from drumsqueal.questions.sensitivity.decay import KICK, kicked
from drumsqueal.scene import COORDINATES, Scene
from drumsqueal.simulation import prepare, run_whole
from drumsqueal.solve.linear.modes import analyse_stability

MORE = 1.05  # times the damping with which the last mode neither grows nor decays

OnPoint = Callable[[str, int, int], None]


class Point(NamedTuple):
    """One transient: the figure it belongs to, the value (SI) of the number varied, and what it did.

    `comparison` is None where the integration failed, and `outcome` then says why.
    """

    figure: str
    key: str
    value: float
    scene: Scene
    comparison: Comparison | None
    outcome: str


def paper_transients(scene: Scene, on_point: OnPoint) -> tuple[dict[str, tuple[Point, ...]], tuple[Point, Point]]:
    """Transients by figure, and two that start beyond the contact boundary of a brake that is linearly stable.

    One is stable by constant friction, the other by structural damping, whose ratio is then the point's value.

    A scene that several figures share is run once. `on_point` is told what is run, its number and how many there are.
    Raises SceneError for a value that makes no brake, and KeyboardInterrupt between two chunks.
    """
    own = scene.numbers()
    wanted = []
    for axis in AXES:
        for share in axis.transients:
            value = float(own[axis.key]) * share  # pyright: ignore[reportArgumentType] (checked by check_brake)
            changes = {axis.key: value} if share != 1 else {}
            if axis.figure == "6":
                changes |= constant_friction(scene)
            wanted.append((axis, value, scene.with_values(changes)))
    runs: dict[str, tuple[Comparison | None, str]] = {}
    ratio = damping_needed(scene)
    kick = kicked(scene.with_values(constant_friction(scene)))
    damped = kicked(scene.with_values({"damping": {"ratio": ratio}}))
    scenes = {each.to_toml(): each for each in (*(each for *_, each in wanted), kick, damped)}
    for number, (text, each) in enumerate(scenes.items()):
        on_point(f"transient {number + 1} of {len(scenes)}", number, len(scenes))
        runs[text] = _run(each)
    points = [Point(axis.figure, axis.key, value, each, *runs[each.to_toml()]) for axis, value, each in wanted]
    by_figure = {axis.figure: tuple(point for point in points if point.figure == axis.figure) for axis in AXES}
    kicks = (
        Point("6", "start", KICK, kick, *runs[kick.to_toml()]),
        Point("5", "damping.ratio", ratio, damped, *runs[damped.to_toml()]),
    )
    return by_figure, kicks


def damping_needed(scene: Scene) -> float:
    """Structural damping ratio that makes every mode of a brake decay, by a twentieth more than the least."""
    known = 0.0 if scene.damping is None else float(scene.damping.ratio)
    modes = analyse_stability(build_model(scene, coordinates=COORDINATES)).modes
    return known + MORE * max(0.0, *(mode.growth_rate / abs(mode.eigenvalue) for mode in modes))


def _run(scene: Scene) -> tuple[Comparison | None, str]:
    try:
        return run_whole(prepare(scene)).comparison, COMPLETE
    except IntegrationError as error:
        return None, f"failed: {error}"
