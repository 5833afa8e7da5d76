"""What a worker of a cluster does. Imported there before JAX is, whose environment must be prepared first."""

import threading
from typing import Any

from drumsqueal.compilation import prepare_environment
from drumsqueal.errors import RequestError

# One batch at a time in a process, with all its threads: two programs at once would wait for each other's threads.
_one_at_a_time = threading.Lock()


def work(plan: Any, first: int, stop: int, versions: dict[str, str]) -> Any:
    """Compute the points of a plan from number `first` to `stop`, with the same versions as whoever asks."""
    with _one_at_a_time:
        prepare_environment()
        from distributed import get_worker

        from drumsqueal.findings.history import versions as versions_here
        from drumsqueal.questions.sweep.study import compute

        here = versions_here()
        other = [
            f"{name} {here[name]} instead of {versions[name]}" for name in versions if here[name] != versions[name]
        ]
        if other:
            raise RequestError(f"its versions differ ({', '.join(other)}); install the same versions")
        return compute(plan, first, stop, threads=get_worker().state.nthreads)
