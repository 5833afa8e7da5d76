"""Blocks of a long mesh's nodes in the order in which they are eliminated, so that its factors have few entries.

Halves that only a thin cut separates do not fill each other in, and nor do their halves. Cuts are across the longest
extent along the arc, the radius and z; those between elements, which hold the fewest nodes, are looked for.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]

SMALLEST = 60  # nodes that are not divided further
CUTS = (0.4, 0.44, 0.47, 0.5, 0.53, 0.56, 0.6)  # where the nodes may be divided: the thinnest cut is taken
SAME = 1e-6  # of the extent: nodes no further apart are of one layer


def elimination_blocks(points: NDArray[np.float64], graph: Any) -> list[Indices]:
    """An order of points in blocks, by their places (n, 3) and the sparse matrix (n, n) of which touches which."""
    r = np.hypot(points[:, 0], points[:, 1])
    places = np.stack([np.mean(r) * np.arctan2(points[:, 1], points[:, 0]), r, points[:, 2]], axis=1)
    blocks = _divided(np.arange(len(points)), places, graph, np.full(len(points), -1, dtype=np.int8))
    return [block for block in blocks if len(block)]


def _divided(nodes: Indices, places: Any, graph: Any, side: Any) -> list[Indices]:
    """Two halves, each divided in turn, and last the cut: what of the first half touches the second."""
    best = None
    if len(nodes) > SMALLEST:
        along = places[nodes][:, np.argmax(np.ptp(places[nodes], axis=0))]
        for cut in np.unique(np.quantile(along, CUTS, method="nearest")):
            first = along <= cut + SAME * np.ptp(along)
            touches = _touching(nodes, first, graph, side)
            if not first.all() and not touches.all() and (best is None or touches.sum() < best[1].sum()):
                best = first, touches
    if best is None:
        return [nodes]
    first, touches = nodes[best[0]], best[1]
    halves = (first[~touches], nodes[~best[0]])
    return [*(part for half in halves for part in _divided(half, places, graph, side)), first[touches]]


def _touching(nodes: Indices, first: Any, graph: Any, side: Any) -> Any:
    """Which nodes of the first half touch one of the second. `side` is -1 everywhere, and again so afterwards."""
    side[nodes] = first
    rows = graph[nodes[first]]
    found = np.zeros(rows.shape[0], dtype=bool)
    found[np.repeat(np.arange(len(found)), np.diff(rows.indptr))[side[rows.indices] == 0]] = True
    side[nodes] = -1
    return found
