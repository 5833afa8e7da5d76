"""The file of a sweep, filled batch by batch from where the batches are computed: in this process, or on a cluster."""

from collections.abc import Callable, Iterator
from contextlib import closing

import xarray

from drumsqueal.progress import Progress
from drumsqueal.questions.sweep.basin import number_motions, starts_alone
from drumsqueal.questions.sweep.file import SweepFile
from drumsqueal.questions.sweep.points import Columns, Points
from drumsqueal.questions.sweep.study import batches, compute

Batches = list[tuple[int, int]]  # the first point of each, and the one after the last
Source = Callable[[Points, Batches, Callable[[], None]], Iterator[tuple[int, Columns]]]


def here(plan: Points, left: Batches, look: Callable[[], None]) -> Iterator[tuple[int, Columns]]:
    """Compute the batches in this process: the first point of each, and its results."""
    for first, stop in left:
        yield first, compute(plan, first, stop, look=look)


def fill_file(file: SweepFile, plan: Points, source: Source, progress: Progress) -> xarray.Dataset:
    """Compute what is missing, each batch once, and return all of it; the starts are numbered by where they lead."""
    computed = file.computed()
    left = {first: stop for first, stop in batches(plan) if not computed[first:stop].all()}

    def look() -> None:
        progress("sweeping", plan.points - sum(stop - first for first, stop in left.items()), plan.points)

    look()
    with closing(source(plan, list(left.items()), look)) as stream:  # pyright: ignore[reportArgumentType]
        for first, columns in stream:
            file.write(first, columns)
            del left[first]
            look()
    data = file.read()
    if plan.starts:
        numbers = number_motions(data, of_one_brake=starts_alone(plan))
        file.note("attractor", numbers)
        data["attractor"].values = numbers.reshape(plan.shape)
    return data
