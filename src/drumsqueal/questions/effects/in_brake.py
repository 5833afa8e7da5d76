"""The answer of one shoe alone as that of the brake that it was taken from: under the brake's names, along its axes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from drumsqueal.coordinates import is_of_drum, is_static
from drumsqueal.findings.answers import SceneAnswer, answer_of
from drumsqueal.physics.elasticity import drum_modes, drum_names
from drumsqueal.physics.model import Model
from drumsqueal.scene import Scene
from drumsqueal.scene.shoes import NamedShoe
from drumsqueal.simulation import Result


def answer_in(brake: Scene, scene: Scene, left_out: Sequence[int], run: Result, linear: Model) -> SceneAnswer:
    """The answer of a run of a scene that leaves out shoes of the brake; `linear` is its model of all coordinates."""
    history, stability = run.history, run.stability
    if scene.several or not brake.several:
        return answer_of(history, run.findings, stability, linear)
    (k,) = (k for k in range(len(brake.shoes)) if k not in left_out)
    shoe = brake.shoes[k]
    assert isinstance(shoe, NamedShoe)
    turn = turn_of_drum(scene, stability.coordinates, shoe.position)
    mine = [history["coordinate"].values.tolist().index(name) for name in stability.coordinates]
    turned = {name: history[name].copy() for name in ("displacement", "velocity")}
    for each in turned.values():
        each[:, mine] = each.values[:, mine] @ turn.T
    return _renamed(answer_of(history.assign(turned), run.findings, stability.turned(turn), linear), brake.prefixes[k])


def along_own_axes(brake: Scene, number: int) -> Scene:
    """The brake with one of its shoes alone, its drum started and forced as it is in the brake: in its modes alone.

    How it yields besides is another under each shoe.
    """
    one, shoe = brake.alone[number], brake.shoes[number]
    assert isinstance(shoe, NamedShoe)
    moved = {".".join(path): table for path, table in one.by_coordinate.items() if any(map(is_of_drum, table))}
    if not moved:
        return one
    names = [name for name in drum_names(one) if not is_static(name)]
    turn, values = turn_of_drum(one, names, shoe.position), {}
    for key, table in moved.items():
        turned = turn.T @ [table.get(name, 0.0) for name in names]
        of_drum = {name: value for name, value in zip(names, turned.tolist(), strict=True) if value != 0}
        values[key] = {name: value for name, value in table.items() if not is_of_drum(name)} | of_drum
    return one.with_values(values)


def turn_of_drum(scene: Scene, names: Sequence[str], position: float) -> NDArray[np.float64]:
    """The matrix (n, n) by which coordinates of a shoe alone become those along axes at which it stands turned (rad).

    A pair of the drum, of n waves, is turned by n times the angle: seen from elsewhere, another sum of both is the
    cosine. A rigid shoe and its own shapes go with it, and how the drum yields besides its modes.
    """
    turn, modes = np.eye(len(names)), drum_modes(scene)
    if modes is None:
        return turn
    of_drum = zip(drum_names(scene), modes.harmonics, modes.wavenumbers, strict=True)
    rows = [(names.index(name), n, wave) for name, n, wave in of_drum if name in names and not is_static(name)]
    k = 0
    while k < len(rows) - 1:
        (one, n, wave), (other, *same) = rows[k : k + 2]
        if n and same == [n, wave]:
            cosine, sine = np.cos(n * position), np.sin(n * position)
            turn[np.ix_([one, other], [one, other])] = [[cosine, -sine], [sine, cosine]]
            k += 1
        k += 1
    return turn


def _renamed(answer: SceneAnswer, prefix: str) -> SceneAnswer:
    """The answer with what the coordinates of its shoe begin with in the brake."""

    def brakes(name: str) -> str:
        return name if is_of_drum(name) else f"{prefix}{name}"

    main = answer.main
    return replace(
        answer,
        modes={brakes(label): mode for label, mode in answer.modes.items()},
        unstable=tuple(map(brakes, answer.unstable)),
        amplitude={brakes(name): size for name, size in answer.amplitude.items()},
        carriers=tuple(map(brakes, answer.carriers)),
        main=main and replace(main, coordinate=brakes(main.coordinate)),
    )
