"""What is there to gain below the edges, where nothing separates and no slip reverses?

Run it with `python tests/benchmarks/regimes.py`. First, one evaluation of the forces in the plane as it is, and with
the choice that is made in space: to look at each evaluation whether there is an edge, and to split only then. Second,
the share of the time that the nominal scene spends before its first edge: an exact solution of the linear part could
spare no more than that.
"""

import dataclasses
import time
from pathlib import Path

import drumsqueal.precision  # noqa: F401 (double precision, before JAX computes)

# isort: split
import jax
import jax.numpy as jnp
import numpy as np
from evaluation import ROUNDS, SIZES, STATES, Contender, contenders, error_of, evaluate
from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.effects.contact import Contact
from drumsqueal.quadrature.arc import ArcSurface
from drumsqueal.quadrature.smooth import ALONG, is_smooth
from drumsqueal.scene import load_scene
from drumsqueal.simulation import prepare, transient

SCENE = Path(__file__).parents[2] / "scenarios" / "nominal.toml"


class ChoosingContact(Contact):
    """In the plane, the arc in one piece where it has no edge."""

    def _integrated(self, levels, integral):
        edges = self.law.edges(levels.pressure)

        def split():
            return integral(self.surface.nodes(self.shoe, edges, levels.slip, None))

        def whole():
            return integral(ArcSurface(ALONG).nodes(self.shoe, None, None))

        return jax.lax.cond(is_smooth(self.shoe, edges, levels.slip, None), whole, split)


def choosing(contender: Contender) -> Contender:
    """The same contender with the choice."""
    contact = contender.model.contact
    fields = {field.name: getattr(contact, field.name) for field in dataclasses.fields(contact)}
    return contender._replace(model=dataclasses.replace(contender.model, contact=ChoosingContact(**fields)))


def fastest(everyone: list[Contender]) -> list[float]:
    """Seconds an evaluation, the fastest of rounds in which all take turns; compiled beforehand."""
    times = jnp.asarray(300)
    best = [np.inf] * len(everyone)
    for round_number in range(ROUNDS + 1):
        for k, each in enumerate(everyone):
            before = time.perf_counter()
            jax.block_until_ready(evaluate(each.model, each.q, each.v, times))
            if round_number:
                best[k] = min(best[k], (time.perf_counter() - before) / int(times) / STATES)
    return best


def share_before_the_edge() -> tuple[float, float]:
    """First edge (s) of the nominal scene, and the share of the computing time until then, the least of three runs."""
    prepared = prepare(load_scene(SCENE))
    shares, edge = [], 0.0
    for _ in range(4):  # the first one compiles
        ends, seconds, before = [], [], time.perf_counter()
        for chunk in transient(prepared):
            now = time.perf_counter()
            ends.append(float(chunk.time[-1]))
            seconds.append(now - before)
            touched = (chunk.observation.contact_fraction < 1 - 1e-12) | (chunk.observation.slip_reversed_fraction > 0)
            if not edge and touched.any():
                edge = float(chunk.time[np.argmax(touched)])
            before = time.perf_counter()
        shares.append(sum(s for s, end in zip(seconds, ends, strict=True) if end <= edge) / sum(seconds))
    return edge, min(shares[1:])


def main() -> None:
    """Print both."""
    plane = [each for each in contenders() if each.coordinates == "3"]
    everyone = [*plane, *map(choosing, plane)]
    table = Table(title="One evaluation in the plane", box=box.SIMPLE_HEAD)
    for heading in ("motion", "choice", "time µs", "ratio", "error"):
        table.add_column(heading, justify="left" if heading in ("motion", "choice") else "right")
    best = fastest(everyone)
    for k, regime in enumerate(SIZES):
        split, chosen = best[k], best[k + len(plane)]
        for seconds, choice in ((split, "none"), (chosen, "edges or not")):
            error = error_of(everyone[k if choice == "none" else k + len(plane)], plane[k].model)
            table.add_row(regime, choice, f"{1e6 * seconds:.3g}", f"{seconds / split:.2f}", f"{error:.1e}")
    console = Console()
    console.print(table)
    edge, share = share_before_the_edge()
    console.print(
        f"The nominal scene reaches its first edge at {edge:.4f} s and has spent {share:.1%} of its time by then"
    )


if __name__ == "__main__":
    main()
