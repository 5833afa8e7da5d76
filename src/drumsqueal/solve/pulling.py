"""A bonded contact that pulls, which no dry contact does: how hard, and what to do about it."""

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from drumsqueal.physics.block import PointContact
from drumsqueal.physics.effects.pressure import Bonded, level_under
from drumsqueal.physics.model import Model


def smallest_force(model: Model, displacement: ArrayLike) -> float:
    """Smallest normal force (N) of a block that cannot lift off, by the load at t = 0; infinite of any other contact.

    Displacements (..., n) in m are measured from q = 0.
    """
    if not _can_pull(model):
        return np.inf
    into, _ = model.body.surface()
    depth = np.asarray(displacement) @ into.T
    law = model.contact.law
    level = float(level_under(law, model.operation.at(0.0).preload)) + float(law.stiffness) * np.min(depth)
    return float(law.pressure(jnp.asarray(level)))


def smallest_recorded(model: Model, force: ArrayLike) -> float:
    """The same of recorded normal forces (k,) in N."""
    return float(np.min(force)) if _can_pull(model) else np.inf


def _can_pull(model: Model) -> bool:
    # A shoe without separation says so among what its scene leaves out.
    contact = model.contact
    return isinstance(contact, PointContact) and isinstance(contact.law, Bonded) and float(contact.law.stiffness) > 0


def pulling(smallest: float) -> str:
    """That the contact pulls, by the smallest normal force (N); empty where it does not."""
    if not smallest < 0:
        return ""
    # 1e30 N; only what grows without bound comes so far
    fell = f"fell to {smallest:.3g} N" if smallest > -1e30 else "falls without bound"
    return f"the contact pulls: the normal force {fell}; use separation=True".replace("-", "−")


def pulling_sentence(smallest: float) -> str:
    """The same as a sentence after others; empty where the contact does not pull."""
    words = pulling(smallest)
    return f" {words[0].upper()}{words[1:]}." if words else ""
