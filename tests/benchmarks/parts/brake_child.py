"""The simplex brake of one size in a process of its own: prints its size, seconds and peak memory.

Arguments: modes up to (Hz), times the cells along and across each lining. Run it as a module, `parts.brake_child`.
"""

import json
import sys
import time
from typing import Any

from .long_child import memory_MiB
from .scenes import SCENARIOS

SAMPLES = 4e-5  # s: some samples, of a transient that is only compiled
# m, by which all coordinates together move the lining: next to steady sliding, where 3 % of a lining is off already,
# and with linings lifted off.
AMPLITUDES = {"steady": 1e-10, "beyond": 1e-5}
STATES, ROUNDS, LEAST = 8, 5, 0.2  # s that a round takes at least


def main() -> None:
    """Compile the transient and an evaluation, then time the evaluation."""
    from drumsqueal.compilation import prepare_environment

    prepare_environment()  # before JAX is imported
    from dataclasses import replace

    from drumsqueal.scene import load_scene
    from drumsqueal.simulation import prepare

    from .bending import first_samples

    up_to, along, across = float(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    bodies = ("shoe.0.elastic", "shoe.1.elastic", "drum.elastic")
    scene = load_scene(SCENARIOS / "simplex.toml").with_values({f"{each}.up_to": up_to for each in bodies})
    prepared = prepare(scene.with_values({"simulate.duration": SAMPLES}))
    lined: Any = prepared.model.contact
    contacts = lined.mapped(lambda contact: contact.on_cells(along, across))
    prepared = prepared._replace(model=replace(prepared.model, contact=contacts))
    compiling = first_samples(prepared)
    found = {
        "coordinates": len(prepared.model.names),
        "points": sum(contact.surface.count for contact in contacts.each),
        "compiling_s": compiling,
        "peak_MiB": memory_MiB(peak=True),
        "evaluation_s": {motion: _evaluations(prepared.model, size) for motion, size in AMPLITUDES.items()},
    }
    print(json.dumps(found))  # noqa: T201


def _evaluations(model: Any, size: float) -> list[float]:
    """Seconds of an evaluation, a round each, at seeded states about steady sliding."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    from drumsqueal.solve.linear.steady import steady_sliding

    from .evaluation import evaluate

    rng, n = np.random.default_rng(0), len(model.names)
    lever = np.array([model.body.characteristic_lengths()[name] for name in model.names])
    steady = np.asarray(steady_sliding(model))
    phase = rng.uniform(0, 2 * np.pi, (STATES, n))
    amplitude = size / lever / np.sqrt(n)
    q, v = jnp.asarray(steady + amplitude * np.sin(phase)), jnp.asarray(2e4 * amplitude * np.cos(phase))

    def seconds(times: int) -> float:
        before = time.perf_counter()
        jax.block_until_ready(evaluate(model, q, v, jnp.asarray(times)))
        return (time.perf_counter() - before) / (times * STATES)

    seconds(1)
    times = max(1, round(LEAST / (STATES * seconds(1))))
    return [seconds(times) for _ in range(ROUNDS)]


if __name__ == "__main__":
    main()
