"""Contenders take turns, so that a noisy machine slows them alike. The fastest round counts, for noise only adds."""

import time
from collections.abc import Callable, Hashable, Mapping
from statistics import median
from typing import Any

PATIENCE = 5.0  # s; what takes longer is not repeated


def take_turns(
    calls: Mapping[Any, Callable[[], Any]],
    rounds: int,
    due: Callable[[Any, Mapping[Any, list[float]]], bool] = lambda key, seconds: not sum(seconds[key]) > PATIENCE,
) -> tuple[dict[Any, list[float]], dict[Any, Any]]:
    """Seconds of each call in each round in which it is `due`, and what it returned last. What compiles has done so."""
    seconds: dict[Hashable, list[float]] = {key: [] for key in calls}
    results = {}
    for _ in range(rounds):
        for key, call in calls.items():
            if due(key, seconds):
                before = time.perf_counter()
                results[key] = call()
                seconds[key].append(time.perf_counter() - before)
    return seconds, results


def scatter(seconds: list[float]) -> float:
    """Median over fastest: how far a round may be off."""
    return median(seconds) / min(seconds)
