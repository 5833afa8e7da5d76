"""A cycle as a table on the terminal, as plain data, and in one sentence."""

from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.findings.departure import unit_of
from drumsqueal.findings.history import versions
from drumsqueal.questions.cycle.orbit import Cycle
from drumsqueal.questions.cycle.search import Search
from drumsqueal.scene.quantities import percent
from drumsqueal.terminal.tables import print_table


def print_search(console: Console, search: Search) -> None:
    """Print amplitudes, multipliers, how exact they are, the other cycles, and the verdict."""
    cycle = search.cycle
    table = Table(title="Cycle", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("coordinate")
    table.add_column("half peak\nto peak", justify="right")
    for name, amplitude in cycle.amplitude.items():
        table.add_row(name, f"{1e6 * amplitude:.6g} {unit_of(name, 'µ')}")
    print_table(console, table)
    table = Table(title="Floquet multipliers", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("modulus", "angle\ndegrees"):
        table.add_column(heading, justify="right")
    for value in cycle.multipliers:
        if value.imag >= 0:
            table.add_row(f"{abs(value):.6f}", f"{'±' if value.imag else ''}{np.degrees(np.angle(value)):.2f}")
    print_table(console, table)
    console.print(_exactness(cycle), style="dim")
    console.print(f"Found from: {search.origin}. The transient {search.transient}.", style="dim")
    for other in search.others:
        console.print(f"Beside it: {_briefly(other)}.", style="dim")
    console.print(verdict(search), style="bold")


def verdict(search: Search) -> str:
    """What the cycle is, and what a disturbance does on it."""
    cycle = search.cycle
    texture = (
        f"with {percent(cycle.contact_fraction)} of the lining in contact and the slip reversed on "
        f"{percent(cycle.slip_reversed_fraction)} of it on average"
    )
    return f"{_briefly(cycle)[0].upper()}{_briefly(cycle)[1:]}, {texture}: {_disturbed(cycle)}."


def _briefly(cycle: Cycle) -> str:
    name = max(cycle.names, key=lambda name: _kinetic(cycle, name))
    amplitude = f"{1e6 * cycle.amplitude[name]:.4g} {unit_of(name, 'µ')} in {name}"
    kind = "a neutral" if cycle.neutral else "a stable" if cycle.stable else "an unstable"
    return f"{kind} cycle at {cycle.frequency_Hz:.7g} Hz, {amplitude}"


def _kinetic(cycle: Cycle, name: str) -> float:
    """Mean kinetic energy of a coordinate (J)."""
    k = cycle.names.index(name)
    return float(np.mean(cycle.samples.velocity[:, k] ** 2) * np.asarray(cycle.model.mass)[k] / 2)


def _disturbed(cycle: Cycle) -> str:
    factor = f"{cycle.largest:.4g} times its size"
    if cycle.neutral:
        return "a small disturbance neither grows nor dies out, to what can be told"
    if cycle.stable:
        return f"a small disturbance shrinks to {factor} in a period"
    turning = "turning" if cycle.multipliers[0].imag else "reversing" if cycle.multipliers[0].real < 0 else "steadily"
    return f"a small disturbance grows to {factor} in a period, {turning}, in {_directions(cycle)}"


def _directions(cycle: Cycle) -> str:
    count = cycle.unstable_directions
    return "one direction" if count == 1 else f"{count} directions"


def _exactness(cycle: Cycle) -> str:
    return (
        f"Closed to {cycle.residual:.1e} of the motion; the multiplier along the cycle, which is 1, is off by "
        f"{cycle.unit_error:.1e}"
    )


def search_data(search: Search) -> dict[str, Any]:
    """The cycle, where it came from, the other cycles and the scene, in SI."""
    return {
        "title": search.scene.title,
        "verdict": verdict(search),
        **cycle_data(search.cycle),
        "found_from": search.origin,
        "transient": search.transient,
        "others": [cycle_data(other) for other in search.others],
        "scene": search.scene.model_dump(mode="json"),
        "versions": versions(),
    }


def cycle_data(cycle: Cycle) -> dict[str, Any]:
    """One cycle in SI; multipliers as [re, im], the largest first, without the one that is 1 by itself."""
    n = len(cycle.names)
    return {
        "period_s": cycle.period_s,
        "frequency_Hz": cycle.frequency_Hz,
        "stable": cycle.stable,
        "neutral": cycle.neutral,
        "amplitude": dict(cycle.amplitude),
        "multipliers": [[value.real, value.imag] for value in cycle.multipliers.tolist()],
        "unit_multiplier_error": cycle.unit_error,
        "tangent_error": cycle.tangent_error,
        "residual": cycle.residual,
        "contact_fraction": cycle.contact_fraction,
        "slip_reversed_fraction": cycle.slip_reversed_fraction,
        "displacement": dict(zip(cycle.names, cycle.state[:n].tolist(), strict=True)),
        "velocity": dict(zip(cycle.names, cycle.state[n:].tolist(), strict=True)),
    }
