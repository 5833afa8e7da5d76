"""What eigenvalues and one transient leave open: whether a large disturbance leads to squeal, or to another one."""

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from drumsqueal.physics.composition import moved_coordinates
from drumsqueal.scene import Profile, Scene
from drumsqueal.scene.quantities import RPM, printable
from drumsqueal.scene.shipped import written
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.modes import Stability

AROUND = (0.9, 1.1)  # times the drum's speed: the range in which the study looks, with the speed itself in its middle
VALUES = 3


def bistable_words(
    scene: Scene, stability: Stability, file: Path, settings: Sequence[str], *, squeals: bool = False
) -> str | None:
    """The sentence for a scene, which may squeal from its own start; None where nothing presses, where `onset` does not
    take the scene, and for shoes that share a drum that bends, where it does not end in reasonable time.

    `file` and `settings` (those of --set) are given to the command that finds out.
    """
    speed = scene.drum.speed
    if stability.divergence is not None or scene.forcing is not None or scene.several:
        return None
    if isinstance(speed, Profile) or any(isinstance(each, Profile) for each in scene.schedules().values()):
        return None
    if not moved_coordinates(scene):
        return None
    if not (scene.rubs and scene.pressed):
        return None
    given = [part for each in settings for part in ("--set", each)]
    rpm = math.isclose(speed / RPM, float(f"{speed / RPM:.4g}"), rel_tol=1e-9)  # where that is a round number
    ends = tuple(each * speed for each in AROUND)
    range_ = Variation("drum.speed", "rad/s", ends, "rpm" if rpm else "rad/s", RPM if rpm else 1.0)
    first, last = range_.listed(range_.first), range_.listed(range_.last)
    along = f"drum.speed={first:.10g}..{last:.10g} {range_.given} x {VALUES}"
    command = shlex.join(["drumsqueal", "onset", written(file), *given, "--along", along])
    if squeals or stability.unstable:
        return f"Other disturbances may lead to another squeal; which there are, and what leads to each: {command}"
    return (
        "A large disturbance may still lead to sustained squeal (the bistable, subcritical range); "
        f"to find out: {command}"
    )


def print_bistable(
    console: Console, scene: Scene, stability: Stability, file: Path, settings: Sequence[str], *, squeals: bool = False
) -> None:
    """Print the sentence, where there is one."""
    sentence = bistable_words(scene, stability, file, settings, squeals=squeals)
    if sentence is not None:
        console.print(printable(sentence), soft_wrap=True)
