"""Up to which frequency motion of shoes and drum is resolved: as written, or until growth rates stay as they are."""

from typing import Any

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.physics.basis import kept_shapes, once, one_side
from drumsqueal.scene import Scene

# Motion is resolved where growth rates stay as they are, to 1/s or to a fraction, which experiments cannot tell apart,
# with shapes up to so many times the frequency, which are some so many times as many of a plate.
MORE, CLOSE, CLOSE_FRACTION = 1.6, 1.0, 0.01
MOST_STEPS = 4


def up_to_of(scene: Scene, body: str) -> float:
    """Up to which frequency (Hz) motion of the "shoe" or the "drum" is resolved."""
    return resolved(scene).elastic_table(body)[1].up_to


def resolved(scene: Scene) -> Scene:
    """The scene with frequencies (Hz) in place of those that are to be found."""
    return _with_up_to(scene, _found_up_to(scene)) if _open_tables(scene) else scene


@once
def _found_up_to(scene: Scene) -> float:
    """The least frequency (Hz) with which eigenvalues stay as they are with half as many again, found step by step.

    From the highest frequency of rigid bodies on the lining on, without damping and with a coefficient of friction as
    high as linings have, so that it is the same for all of them. Modal results are taken as far as they go.
    """
    given = [shoe.modes.read().frequencies.max() for shoe in scene.shoes if shoe.modes and shoe.elastic]
    if given:
        return float(min(given))
    up_to = _highest_of_rigid(scene)
    before = kept_shapes(_with_up_to(scene, up_to)).eigenvalues
    before = before[before.imag <= 2 * np.pi * MORE * up_to]
    for _ in range(MOST_STEPS):
        after = kept_shapes(_with_up_to(scene, MORE * up_to)).eigenvalues
        after = after[(after.imag > 0) & (after.imag <= 2 * np.pi * MORE * up_to)]
        growing = before[before.real > CLOSE].imag
        compared = before[before.imag <= (np.max(growing) if growing.size else 2 * np.pi * up_to)]
        known: Any = np.append(after, np.inf)  # nothing is near where nothing is found
        nearest = known[np.argmin(np.abs(compared[:, None] - known), axis=1)]
        change = np.abs(nearest.real - compared.real)
        if np.all(change <= np.maximum(CLOSE, CLOSE_FRACTION * np.abs(compared.real))):
            break
        up_to, before = MORE * up_to, after
    return up_to


def _open_tables(scene: Scene) -> list[str]:
    """Keys of the tables whose frequency is to be found."""
    tables = [(scene.key_of(k, "shoe.elastic"), shoe.elastic) for k, shoe in enumerate(scene.shoes)]
    return [key for key, table in [*tables, scene.elastic_table("drum")] if table and table.up_to == "auto"]


def _with_up_to(scene: Scene, up_to: float) -> Scene:
    """The scene with a frequency (Hz) in place of each that is to be found."""
    return scene.with_values({f"{key}.up_to": up_to for key in _open_tables(scene)})


def _highest_of_rigid(scene: Scene) -> float:
    """The highest frequency (Hz) of rigid shoes on a rigid drum, in full contact. Raises RequestError where it is 0."""
    found = []
    for one in scene.alone:
        rigid = one.model_copy(update={"shoe": one.shoe.model_copy(update={"elastic": None})})
        side, _ = one_side(rigid, 0.0, None)
        scale = 1 / np.sqrt(side.mass)
        found.append(np.linalg.eigvalsh(scale[:, None] * side.stiffness * scale)[-1])
    if max(found) <= 0:
        raise RequestError(
            'up_to = "auto" begins at the highest frequency of rigid bodies, and nothing holds a shoe here: write a '
            "frequency, or a contact stiffness above 0"
        )
    return float(np.sqrt(max(found)) / (2 * np.pi))
