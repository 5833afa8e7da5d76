"""One duration (s, the argument) of the damped scene in a process of its own: prints seconds and peak memory."""

import json
import resource
import sys
import time
from pathlib import Path

SCENE = Path(__file__).parents[3] / "scenarios" / "damped.toml"


def memory_MiB(peak: bool) -> float:
    """Resident memory of this process; `getrusage`, where there is no other, may tell that of the one it came from."""
    status = Path("/proc/self/status")
    if status.exists():
        name = "VmHWM:" if peak else "VmRSS:"
        (line,) = [line for line in status.read_text().splitlines() if line.startswith(name)]
        return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """A first chunk loads the programs; then the whole transient."""
    from drumsqueal.compilation import prepare_environment

    prepare_environment()  # before JAX is imported
    from drumsqueal.scene import load_scene
    from drumsqueal.simulation import prepare, transient

    prepared = prepare(load_scene(SCENE).with_values({"simulate.duration": float(sys.argv[1])}))
    next(transient(prepared))
    size, before = memory_MiB(peak=False), time.perf_counter()
    for _ in transient(prepared):
        pass
    seconds = time.perf_counter() - before
    found = {"seconds": seconds, "peak_MiB": memory_MiB(peak=True), "grown_MiB": memory_MiB(peak=False) - size}
    print(json.dumps(found))  # noqa: T201


if __name__ == "__main__":
    main()
