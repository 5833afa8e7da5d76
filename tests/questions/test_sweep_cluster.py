"""A sweep on a cluster of Dask: the same in every bit, also where a worker is killed in the middle of it."""

import os
import signal
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import xarray
from distributed import Client, LocalCluster

from drumsqueal.errors import IntegrationError
from drumsqueal.findings import history
from drumsqueal.interrupts import AGAIN, HEARD
from drumsqueal.questions.sweep import cluster as module
from drumsqueal.questions.sweep import study
from drumsqueal.questions.sweep.cluster import ANY_PORT, Cluster
from drumsqueal.questions.sweep.points import blank
from drumsqueal.scene import load_scene
from drumsqueal.scene.plan import Plan, grid
from drumsqueal.scene.variation import read_variation
from processes import PATIENCE, PRESS, communicate, posix, start, wait_until, watched

USUAL_PORT = 8787  # of the page on which a scheduler tells how it does
SCENARIOS = Path(__file__).parents[2] / "scenarios"


@pytest.fixture
def plan(monkeypatch) -> Plan:
    scene = load_scene(SCENARIOS / "damped.toml")
    monkeypatch.setattr(study, "BATCH", 4)
    monkeypatch.setattr(module, "prepare_environment", lambda: None)  # the workers are threads of this process
    return grid(scene, [read_variation("drum.speed=1..40x22", scene)])


@pytest.fixture
def local():
    how = ANY_PORT | {"processes": False, "threads_per_worker": 2}
    with socket.socket() as taken:
        with suppress(OSError):  # another cluster has it
            taken.bind(("127.0.0.1", USUAL_PORT))
            taken.listen()
        with LocalCluster(n_workers=2, **how) as local:
            yield local


@pytest.fixture
def client(local):
    with Client(local, set_as_default=False) as client:
        yield client


@pytest.fixture
def cluster(client) -> Cluster:
    return Cluster(client)


def test_a_cluster_computes_every_batch_once_and_the_same(plan, cluster):
    batches, columns, seen = study.batches(plan), blank(plan, plan.points), []
    for first, results in cluster.results(plan, batches):
        seen.append(first)
        for name, values in results.items():
            columns[name][first : first + len(values)] = values
    assert sorted(seen) == [first for first, _ in batches]
    here = study.compute(plan, 0, plan.points)
    for name, values in columns.items():
        assert values.tobytes() == here[name].tobytes(), name


def test_results_that_are_lost_with_their_worker_are_computed_again(plan, local, client, cluster, monkeypatch):
    goes_on, compute = threading.Event(), study.compute
    monkeypatch.setattr(study, "compute", lambda *all_, **named: goes_on.wait(PATIENCE) and compute(*all_, **named))
    goes_on.set()
    stream = cluster.results(plan, study.batches(plan))
    seen, futures = [next(stream)[0]], client.futures
    wait_until(lambda: all(each.status == "finished" for each in list(futures.values())))  # and waits to be fetched
    goes_on.clear()  # what is lost is not there again before that has been seen
    holder = next(places[0] for key, places in client.who_has().items() if key in futures and places)
    local.sync(next(worker for worker in local.workers.values() if worker.address == holder).close)
    wait_until(lambda: any(each.status != "finished" for each in list(futures.values())))
    goes_on.set()
    seen += [first for first, _ in stream]
    assert sorted(seen) == [first for first, _ in study.batches(plan)]


def test_a_batch_that_fails_ends_the_sweep_with_the_reason(plan, cluster, monkeypatch):
    monkeypatch.setattr(study, "compute", lambda *_, **__: 1 / 0)
    with pytest.raises(IntegrationError, match="a worker of the cluster failed, ZeroDivisionError"):
        list(cluster.results(plan, study.batches(plan)))


def test_a_worker_of_another_version_is_refused(plan, cluster, monkeypatch):
    own = history.versions()
    asked = [own | {"scipy": "0.1"}]  # who asks is the first who looks
    monkeypatch.setattr(history, "versions", lambda: asked.pop() if asked else own)
    with pytest.raises(IntegrationError, match=r"its versions differ \(scipy .* instead of 0.1\)"):
        list(cluster.results(plan, study.batches(plan)))


# What a worker does as it starts, to stop at its tenth batch of 79 until there is a file.
STOPPING = """
import time
from pathlib import Path

def dask_setup(worker):
    from drumsqueal.questions.sweep import cluster
    prepare, taken = cluster.prepare_environment, []

    def prepare_and_stop():
        taken.append(1)
        while len(taken) == 10 and not Path({go!r}).exists():
            time.sleep(0.02)
        prepare()

    cluster.prepare_environment = prepare_and_stop
"""


@posix
@pytest.mark.slow
def test_a_worker_that_is_killed_costs_nothing(cache, drumsqueal, tmp_path):
    arguments = ("sweep", str(SCENARIOS / "uncertain.toml"), "--random", "20000")
    whole, cut, stopping, go = (tmp_path / name for name in ("whole", "cut", "stopping.py", "go"))
    stopping.write_text(STOPPING.format(go=str(go)))
    assert drumsqueal(*arguments, "-o", str(whole))[0] == 0
    address, environment = tmp_path / "scheduler.json", os.environ | {"XDG_CACHE_HOME": str(cache)}
    environment = {name: value for name, value in environment.items() if not name.startswith(("JAX_", "EQX_", "TF_"))}

    def dask(*words: str) -> subprocess.Popen:
        command = [sys.executable, "-m", "dask", *words]
        return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    scheduler = dask(
        "scheduler", "--port", "0", "--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(address)
    )
    workers = []
    try:
        wait_until(address.exists, scheduler)
        with Client(scheduler_file=str(address), set_as_default=False) as client:
            place = str(client.scheduler_info()["address"])
            # Without a nanny, so that the process which is killed is not started again.
            how = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--preload", str(stopping))
            workers = [dask("worker", place, *how) for _ in range(2)]
            client.wait_for_workers(2, timeout=PATIENCE)
            process = start(cache, *arguments, "-o", str(cut), "--cluster", place)
            wait_until(lambda: fraction(cut) > 0.1, process)
            workers[0].send_signal(signal.SIGKILL)
            assert fraction(cut) < 0.9
            go.touch()
            _, errors = communicate(process)
            assert (process.returncode, errors) == (0, "")
            assert len(client.scheduler_info()["workers"]) == 1
        assert (cut / "sweep.nc").read_bytes() == (whole / "sweep.nc").read_bytes()
    finally:
        for each in (*workers, scheduler):
            each.kill()
            each.wait()


@posix
@pytest.mark.slow
def test_control_c_on_a_cluster_keeps_what_is_there(cache, drumsqueal, tmp_path):
    arguments = ("sweep", str(SCENARIOS / "uncertain.toml"), "--random", "20000")
    pressed = watched("drumsqueal.questions.sweep.file:SweepFile", "write", PRESS)
    process = start(cache, *arguments, "-o", str(tmp_path), "--cluster", "local", code=pressed)
    _, errors = communicate(process)
    heard, told = errors.splitlines()
    assert (process.returncode, heard) == (1, HEARD + AGAIN)
    assert "interrupted by the user; " in told
    assert "--resume continues from there" in told
    assert 0 < fraction(tmp_path) < 1


def fraction(folder: Path) -> float:
    """Of the points that are computed."""
    if not (folder / "sweep.nc").exists():
        return 0.0
    with xarray.open_dataset(folder / "sweep.nc", engine="h5netcdf") as there:
        return float(np.mean(there["outcome"].values != 1))
