"""What users quote of a transient: measured growth rate and onset frequency, and frequency and size at the end."""

import math
from dataclasses import fields

from drumsqueal.findings.answers import Change, answer_of
from drumsqueal.physics.model import Model
from drumsqueal.simulation import Result

SMALLEST = 1e-300  # keeps zero off the denominator
NONE = Change(None, None, None, None)
NAMES = tuple(field.name for field in fields(Change))


def features_of(result: Result, model: Model) -> dict[str, float]:
    """Measured features by name; `model` is the one over the coordinates of the eigenvalues."""
    found = {}
    for mode in result.findings.modes:
        if mode.measured_growth is not None:
            found[f"growth_rate {mode.label}"] = mode.measured_growth.rate_1_per_s
        if mode.measured_frequency_Hz is not None:
            found[f"onset_frequency {mode.label}"] = mode.measured_frequency_Hz
    answer = answer_of(result, model)
    found |= {f"amplitude {name}": answer.amplitude[name] for name in answer.carriers}
    if answer.main is not None:
        found["main_frequency"] = answer.main.frequency_Hz
    return found


def feature_errors(best: dict[str, float], found: dict[str, float], duration: float) -> Change:
    """Errors of features against the best ones, of a record of that duration (s).

    A growth rate is measured against itself or, where that is more, against one e-fold over the record: the rate of a
    mode that neither grows nor decays has no relative error. None where the best ones lack the quantity, infinite where
    only the others do.
    """
    errors: dict[str, list[float]] = {}
    for name, value in best.items():
        there = found.get(name)
        least = 1 / duration if name.startswith("growth_rate") else SMALLEST
        error = math.inf if there is None else abs(there - value) / max(abs(value), least)
        errors.setdefault(name.split()[0], []).append(error)
    return Change(*(max(errors[field], default=None) if field in errors else None for field in NAMES))
