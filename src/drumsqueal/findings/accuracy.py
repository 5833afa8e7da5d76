"""How accurate a run is: its energy balance, and its contact forces against those of another, finer rule.

The energy balance does not show the error of the forces, because it takes them and its friction power from the same
quadrature.
"""

import dataclasses
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.findings.history import memory_of
from drumsqueal.findings.schema import Finding
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.effects.several import Contacts
from drumsqueal.physics.model import Model
from drumsqueal.physics.quadrature.area import AreaSurface
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.independent import TANH_SINH, IndependentSurface
from drumsqueal.programs import compiled

if TYPE_CHECKING:
    import xarray

INSTANTS = 32  # at which it is looked at: half of them evenly spread, half where most of the slip is reversed
# A rule that shares nothing with that of the plane; in space the same kind of rule with other nodes, and far more.
IN_PLANE = IndependentSurface(TANH_SINH, spatial=False, panels=32)
IN_SPACE = AreaSurface(along=24, across=12, turning=24, sections=5, always_split=True)


class Accuracy(Finding):
    """Largest error of the energy balance (J, and relative), and of the contact forces by a finer quadrature.

    Of a small motion the error over the kinetic energy is large: friction turns hundreds of watts, and their round-off
    is in the balance.
    """

    energy_balance_error_J: float
    energy_balance_error_over_kinetic_energy: float
    energy_balance_error_over_friction_work: float
    quadrature_error_over_normal_force: float | None = None


def measure_accuracy(history: "xarray.Dataset", quadrature_error: float | None) -> Accuracy:
    """Read the balance of energy off a history; `quadrature_error` is that of its contact forces."""
    error = float(np.abs(history["energy_balance_error"].values).max())
    kinetic = float(history["kinetic_energy"].values.max())
    work = float(history["friction_power"].integrate("time"))
    return Accuracy(
        energy_balance_error_J=error,
        energy_balance_error_over_kinetic_energy=error / kinetic if kinetic > 0 else 0.0,
        energy_balance_error_over_friction_work=error / work if work > 0 else 0.0,
        quadrature_error_over_normal_force=quadrature_error,
    )


def estimate_quadrature_error(history: "xarray.Dataset", model: Model) -> float | None:
    """Estimate the largest error of normal force, and of brake torque over R, over the largest normal force.

    It is to be well below the run's relative tolerance. `model` is that of the transient.

    None where the lining never slips or nothing presses it.
    """
    if not isinstance(model.contact, Contact | Contacts):
        return None
    recorded = np.isfinite(history["normal_force"].values)  # not so beyond where a run was cut off
    slips = np.flatnonzero((history["sticking"].values == 0) & recorded)
    if slips.size == 0:
        return None
    most_reversed = slips[np.argsort(-history["slip_reversed_fraction"].values[slips], kind="stable")]
    spread = np.linspace(0, slips.size - 1, INSTANTS // 2).astype(int)
    instants = np.concatenate([slips[spread], np.resize(most_reversed[: INSTANTS // 2], INSTANTS - INSTANTS // 2)])
    motion = (
        history[name].isel(time=instants).sel(coordinate=list(model.names)).values
        for name in ("displacement", "velocity")
    )
    finer = dataclasses.replace(model, contact=model.contact.mapped(_finer))
    memory = memory_of(history.isel(time=instants), model.remembered)
    found = _observe(finer, history["time"].values[instants], *motion, memory)
    largest = float(np.max(np.asarray(found.normal_force)))
    if not largest > 0:
        return None
    radius = float(model.contact.radius)
    errors = (
        np.abs(history[name].values[instants] - np.asarray(getattr(found, name))) / reach
        for name, reach in (("normal_force", 1.0), ("brake_torque", radius))
    )
    return float(max(error.max() for error in errors)) / largest


def _finer(contact: Contact) -> Contact:
    if isinstance(contact.surface, Cells):
        # Twice as many along and across, of a lining that bends: errors fall by some hundred.
        return contact.on_cells(2, 2)
    return dataclasses.replace(contact, surface=IN_SPACE if contact.surface.spatial else IN_PLANE)


@compiled
def _observe(model: Model, times: Array, displacement: Array, velocity: Array, memory: Array | None) -> Observation:
    states = jax.tree.map(jnp.asarray, (times, displacement, velocity, memory))
    return jax.lax.map(lambda state: model.observe(*state), states)
