"""Eigenvalues of many scenes: one compiled program for all that call for the same effects, with other numbers in it.

Side by side (`jax.vmap`) every scene would take all ways of the contact integral: one after the other within the
program they take a three-hundredth of that time. A scene's result does not depend on which others go with it, not in
a bit: the program always takes BLOCK of them.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import jax
import numpy as np
from jax import Array

from drumsqueal.errors import SteadyStateError
from drumsqueal.physics.composition import Composition, compose, linear_coordinates
from drumsqueal.physics.model import assemble, build_model
from drumsqueal.scene import Scene
from drumsqueal.solve.linear.modes import AboutSteady, Stability, about_steady, analyse_stability, stability_of
from drumsqueal.solve.linear.steady import linear_model

BLOCK = 32  # scenes that a program takes; the last block is filled up with its last scene


def analyse_many(scenes: Sequence[Scene]) -> list[Stability | SteadyStateError]:
    """Steady sliding and complex eigenvalues of each scene, or the error that says why it has none.

    Over the coordinates of the eigenvalue problem, as in `drumsqueal stability`.
    """
    results: dict[int, Stability | SteadyStateError] = {}
    groups: dict[tuple, list[int]] = {}
    for index, scene in enumerate(scenes):
        if isinstance(scene.drum.speed, float) and (scene.drum.speed != 0 or scene.friction is None):
            groups.setdefault(_kind(scene), []).append(index)
        else:  # at rest, now or always: which moment counts is another question
            results[index] = _or_error(analyse_stability, build_model(scene, coordinates=linear_coordinates(scene)))
    for (composition, _), members in groups.items():
        for first in range(0, len(members), BLOCK):
            block = members[first : first + BLOCK]
            results.update(zip(block, _together(composition, [scenes[i] for i in block]), strict=True))
    return [results[index] for index in range(len(scenes))]


def _kind(scene: Scene) -> tuple[Composition, tuple]:
    """What is static in the program of a scene: its composition, and the lengths of its profiles."""
    # Forces do not change the linear model; which ones act would only ask for further programs.
    composition = compose(scene)._replace(coordinates=linear_coordinates(scene), forced=())
    return composition, tuple((key, np.shape(value)) for key, value in scene.numbers().items())


def _or_error(analyse: Callable[..., Stability], *arguments: Any) -> Stability | SteadyStateError:
    try:
        return analyse(*arguments)
    except SteadyStateError as error:
        return error


def _together(composition: Composition, scenes: list[Scene]) -> list[Stability | SteadyStateError]:
    filled = [scene.numbers() for scene in scenes + scenes[-1:] * (BLOCK - len(scenes))]
    stacked = {key: np.array([numbers[key] for numbers in filled]) for key in filled[0]}
    found = jax.tree.map(np.asarray, _about_many(stacked, composition))
    each = [jax.tree.map(lambda values, k=k: values[k], found) for k in range(len(scenes))]
    return [_or_error(stability_of, composition.coordinates, one) for one in each]


@partial(jax.jit, static_argnums=1)
def _about_many(numbers: Mapping[str, np.ndarray], composition: Composition) -> AboutSteady:
    def one(numbers: Mapping[str, Array]) -> AboutSteady:
        model = assemble(composition, numbers)
        return about_steady(model, *linear_model(model))

    return jax.lax.map(one, numbers)
