"""Batches of a sweep on a cluster of Dask: worker processes here, or those of a scheduler elsewhere.

A worker imports this before JAX, whose environment must be prepared first.
"""

from __future__ import annotations

import logging
import queue
import re
import signal
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from drumsqueal.compilation import cores, prepare_environment
from drumsqueal.errors import IntegrationError, RequestError, missing_extra

if TYPE_CHECKING:
    from distributed import Client, Future

    from drumsqueal.progress import Progress
    from drumsqueal.questions.sweep.file import Source
    from drumsqueal.questions.sweep.points import Columns, Points
    from drumsqueal.terminal.reply import Reply

LOCAL = "local"
# Without a dashboard; what else the scheduler tells there has any free port, as the usual one has room for one cluster.
ANY_PORT: Any = {"dashboard_address": None, "scheduler_kwargs": {"dashboard_address": "127.0.0.1:0"}}
PATIENCE = 20  # s to wait for a scheduler, for its first worker, and for one that is lost to come back
_LOST = "the scheduler of the cluster was lost"
_LOOK = 0.1  # s between two looks for Ctrl-C
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://\S+:[0-9]+")


@contextmanager
def source_of(cluster: str | None, reply: Reply) -> Iterator[Source]:
    """Where batches are computed: in this process, or for the time of a block by the workers of a cluster.

    Raises RequestError for what is neither "local" nor an address, and where the extra is not installed.
    """
    if cluster is None:
        from drumsqueal.questions.sweep.file import here

        yield here
        return
    _check_cluster(cluster)
    with ExitStack() as stack:
        with reply.progress() as progress:
            workers = stack.enter_context(_connected(cluster, progress))
        yield workers.results


def _check_cluster(name: str) -> None:
    if name != LOCAL and not _ADDRESS.fullmatch(name):
        raise RequestError(f"--cluster {name}: write local, or the address of a scheduler such as tcp://host:8786")
    try:
        import distributed  # noqa: F401 (is it there?)
    except ImportError:
        raise missing_extra(f"--cluster {name}", "cluster") from None


class Cluster:
    """A scheduler with workers, as a source of the results of batches."""

    def __init__(self, client: Client) -> None:
        """Take up a client that is connected."""
        self._client = client
        self._lost_since: float | None = None

    def results(
        self, plan: Points, left: list[tuple[int, int]], look: Callable[[], None] = lambda: None
    ) -> Iterator[tuple[int, Columns]]:
        """The first point of each batch, and its results, as they come; `look` is called while they are awaited.

        What a worker has not finished when it is lost, another one does. Raises IntegrationError where a batch fails,
        where it ends the processes of three workers, and where the scheduler is lost.
        """
        from drumsqueal.findings.history import versions

        run, wanted = uuid.uuid4().hex, versions()
        waiting, out, ready = list(reversed(left)), {}, queue.SimpleQueue()
        try:
            while waiting or out:
                workers: Any = self._client.nthreads()  # typed for its asynchronous use, too
                while waiting and len(out) < 2 * max(sum(workers.values()), 1):  # batches for each thread of a worker
                    first, stop = waiting.pop()
                    key = f"drumsqueal-{run}-{first}"
                    out[first] = self._client.submit(work, plan, first, stop, wanted, key=key, pure=False)
                    out[first].add_done_callback(lambda _, first=first: ready.put(first))
                first = self._next(ready, look)
                yield first, self._result(out.pop(first), first, look)
        finally:
            self._client.cancel(list(out.values()))

    def _next(self, ready: queue.SimpleQueue, look: Callable[[], None]) -> int:
        while True:
            look()
            try:
                return ready.get(timeout=_LOOK)
            except queue.Empty:
                self._look_for_scheduler()

    def _look_for_scheduler(self) -> None:
        if self._client.status == "running":
            self._lost_since = None
            return
        now = time.monotonic()
        self._lost_since = self._lost_since or now
        if now - self._lost_since > PATIENCE or self._client.status == "closed":
            raise IntegrationError(_LOST)

    def _result(self, future: Future, first: int, look: Callable[[], None]) -> Columns:
        while future.status == "lost":  # with its worker, before it was fetched: another one computes it
            look()
            self._look_for_scheduler()
            time.sleep(_LOOK)
        if future.status == "finished":
            try:
                return future.result()
            except (OSError, CancelledError):
                raise IntegrationError(_LOST) from None
        if future.status != "error":
            raise IntegrationError(_LOST)
        error: Any = future.exception()
        if type(error).__name__ == "KilledWorker":
            cause = "each time a worker took up the batch, its process ended"
            raise IntegrationError(f"{cause} (points from number {first} on); is there enough memory?")
        raise IntegrationError(f"a worker of the cluster failed, {type(error).__name__}: {error}")


@contextmanager
def _connected(name: str, progress: Progress) -> Iterator[Cluster]:
    """Connect with the scheduler at an address, or start one here with a worker for each processor.

    Raises RequestError where no scheduler answers, or where it has no workers.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # one line of ours says what is wrong
    import distributed
    from distributed.comm.core import CommClosedError

    with ExitStack() as stack:
        if name == LOCAL:
            with _without_interrupts():
                how = ANY_PORT | {"threads_per_worker": 1, "silence_logs": logging.CRITICAL}
                address = stack.enter_context(distributed.LocalCluster(n_workers=cores(), **how))
        else:
            address = name
        try:
            client = stack.enter_context(distributed.Client(address, timeout=PATIENCE, set_as_default=False))
        except (OSError, TimeoutError, ValueError, CommClosedError):
            raise RequestError(
                f"--cluster {name}: no scheduler answers there; start one with: dask scheduler"
            ) from None
        since = time.monotonic()
        while not client.nthreads():
            progress("waiting for workers", 0, None)
            if time.monotonic() - since > PATIENCE:
                cure = f"the scheduler has no workers; start some with: dask worker {name}"
                raise RequestError(f"--cluster {name}: {cure}")
            time.sleep(_LOOK)
        yield Cluster(client)


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Processes that are started within a block do not hear Ctrl-C: the one that started them ends them."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


# One batch at a time in a process, with all its threads: two programs at once would wait for each other's threads.
_one_at_a_time = threading.Lock()


def work(plan: Points, first: int, stop: int, wanted: dict[str, str]) -> Columns:
    """Compute the points of a plan from number `first` to `stop`, with the same versions as whoever asks."""
    with _one_at_a_time:
        prepare_environment()
        from distributed import get_worker

        from drumsqueal.findings.history import versions
        from drumsqueal.questions.sweep.study import compute

        own = versions()
        other = [f"{name} {own[name]} instead of {wanted[name]}" for name in wanted if own[name] != wanted[name]]
        if other:
            raise RequestError(f"its versions differ ({', '.join(other)}); install the same versions")
        return compute(plan, first, stop, threads=get_worker().state.nthreads)
