"""The result of a run as plain data for summary.json, and of the eigenvalue problem for `stability --json`."""

from typing import Any

import numpy as np

from drumsqueal.findings.compare import Comparison
from drumsqueal.findings.frequency import FrequencyDrift
from drumsqueal.findings.history import versions
from drumsqueal.findings.saturation import Saturation
from drumsqueal.findings.sticking import Sticking, find_sticking
from drumsqueal.simulation import Prepared, Result
from drumsqueal.solve.linear.modes import Stability

MOST_INSTANTS = 100  # of the frequency over time


def describe_stability(stability: Stability) -> dict[str, Any]:
    """Eigenvalues (1/s), modes, steady state (m, rad) and range of the steady pressure (Pa)."""
    return {
        "eigenvalues": [[value.real, value.imag] for value in stability.eigenvalues.tolist()],
        "modes": [
            {
                "name": mode.name,
                "frequency_Hz": mode.frequency_Hz,
                "growth_rate_1_per_s": mode.growth_rate,
                "damping_ratio": mode.damping_ratio,
                "unstable": mode.unstable,
            }
            for mode in stability.modes
        ],
        "steady_state": dict(zip(stability.coordinates, stability.steady_state.tolist(), strict=True)),
        "pressure_range_Pa": list(stability.pressure_range),
    }


def summarise(result: Result) -> dict[str, Any]:
    """Everything a run found, in numbers and words; None where something could not be told."""
    saturation = result.comparison.saturation
    return summarise_prediction(result, result.outcome) | {
        "verdict": result.comparison.verdict,
        "growth": _growth(result.comparison),
        "saturation": None if saturation is None else _saturation(saturation),
        "frequency": None if result.comparison.frequency is None else _frequency(result.comparison.frequency),
        "accuracy": energy_balance(result) | _quadrature(result.comparison),
        "held_though_they_would_move": list(result.held),
        "integration": {
            **{key: int(result.history.attrs[key]) for key in ("steps", "rejected_steps")},
            "implicit_share": float(result.history["implicit"].mean()),
        },
        "sticking": _sticking(find_sticking(result.history)),
        "lining_temperature": _temperature(result),
    }


def summarise_prediction(source: Prepared | Result, outcome: str) -> dict[str, Any]:
    """The same of a run that has computed no samples: None for all but the prediction."""
    return {
        "title": source.scene.title,
        "outcome": outcome,
        "verdict": None,
        "prediction": describe_stability(source.stability),
        "growth": None,
        "saturation": None,
        "frequency": None,
        "accuracy": None,
        "integration": None,
        "sticking": None,
        "lining_temperature": None,
        "held_though_they_would_move": None,
        "model": {key: list(words) for key, words in source.inventory._asdict().items()},
        "scene": source.scene.model_dump(mode="json"),
        "versions": versions(),
    }


def _sticking(sticking: Sticking) -> dict[str, Any]:
    return {
        "share": sticking.share,
        "spells": len(sticking.spells),
        "first_s": sticking.spells[0][0] if sticking.spells else None,
        "to_the_end_from_s": sticking.spells[-1][0] if sticking.to_the_end else None,
    }


def _temperature(result: Result) -> dict[str, float] | None:
    """The largest rise and that at the end (K); None without [temperature]."""
    if result.scene.temperature is None:
        return None
    rise = result.history["lining_temperature"].values
    return {"largest_K": float(rise.max()), "end_K": float(rise[-1])}


def energy_balance(result: Result) -> dict[str, float]:
    """Largest error of the energy balance (J), over the largest kinetic energy and over the work of friction.

    Of a small motion the former is large: friction turns hundreds of watts, and their round-off is in the balance.
    """
    error = float(np.abs(result.history["energy_balance_error"].values).max())
    kinetic = float(result.history["kinetic_energy"].values.max())
    work = float(result.history["friction_power"].integrate("time"))
    return {
        "energy_balance_error_J": error,
        "energy_balance_error_over_kinetic_energy": error / kinetic if kinetic > 0 else 0.0,
        "energy_balance_error_over_friction_work": error / work if work > 0 else 0.0,
    }


def _quadrature(comparison: Comparison) -> dict[str, float | None]:
    error = comparison.quadrature
    return {"quadrature_error_over_normal_force": None if error is None else error.fraction}


def _growth(comparison: Comparison) -> dict[str, Any]:
    return {
        "linear_until_s": comparison.growth_end_s,
        "edge_reached_s": comparison.edge_reached_s,
        "modes": [
            {
                "name": mode.name,
                "label": mode.label,
                "unstable": mode.unstable,
                "predicted_frequency_Hz": mode.predicted_frequency_Hz,
                "measured_frequency_Hz": mode.measured_frequency_Hz,
                "frequency_error": mode.frequency_error,
                "frequency_resolution_Hz": mode.frequency_resolution_Hz,
                "frequency_from_phase_Hz": mode.phase_frequency_Hz,
                "predicted_growth_rate_1_per_s": mode.predicted_growth_rate,
                "measured_growth_rate_1_per_s": mode.measured_growth and mode.measured_growth.rate_1_per_s,
                "growth_rate_standard_error_1_per_s": mode.measured_growth and mode.measured_growth.standard_error,
                "growth_rate_error": mode.growth_error,
                "note": mode.note,
            }
            for mode in comparison.modes
        ],
    }


def _saturation(saturation: Saturation) -> dict[str, Any]:
    return saturation._asdict() | {
        "regime": saturation.regime._asdict(),
        "lines": [line._asdict() for line in saturation.lines],
        "main": saturation.main and saturation.main._asdict(),
    }


def _frequency(drift: FrequencyDrift) -> dict[str, Any]:
    """The shift, what explains how much of it, and the frequency over time."""
    every = max(1, -(-drift.ridge.time_s.size // MOST_INSTANTS))
    return {
        "mode": drift.mode,
        "coordinate": drift.coordinate,
        "onset_Hz": drift.onset_Hz,
        "saturated_Hz": drift.saturated_Hz,
        "shift": drift.shift,
        "predicted_by_contact_loss_Hz": drift.softening.contact_loss_Hz,
        "predicted_by_contact_loss_shift": drift.contact_loss_shift,
        "predicted_with_friction_Hz": drift.softening.with_friction_Hz,
        "predicted_with_friction_shift": drift.predicted_shift,
        "predicted_by_root_of_contact_share_Hz": drift.softening.by_share_Hz,
        "over_time": {
            "time_s": drift.ridge.time_s[::every].tolist(),
            "frequency_Hz": drift.ridge.frequency_Hz[::every].tolist(),
        },
    }
