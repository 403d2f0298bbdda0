"""A sweep on a Dask cluster: a scheduler and two workers started here, one of them killed midway, nothing lost.

    python scripts/dask_sweep.py

Where a cluster is running already, `distributed.Client("tcp://address:8786")` takes the place of `cluster()`. What is
needed on every machine of it: this package, and distributed
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import prup_pin


@contextmanager
def cluster(workers: int = 2, patience: float = 120.0) -> Iterator[tuple[Any, list[subprocess.Popen]]]:
    """Start a scheduler and workers on this machine; yield a client and the workers' processes."""
    from distributed import Client

    processes: list[subprocess.Popen] = []
    with TemporaryDirectory() as folder:
        place = Path(folder) / "scheduler.json"

        def start(command: str, *options: str) -> subprocess.Popen:
            arguments = [sys.executable, "-m", "distributed.cli.dask_" + command, "--scheduler-file", str(place)]
            process = subprocess.Popen(
                [*arguments, *options], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            processes.append(process)
            return process

        try:
            start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
            end = monotonic() + patience
            while not place.exists():
                if monotonic() > end:
                    raise TimeoutError("the scheduler did not start")
                sleep(0.05)
            started = [
                start("worker", "--nthreads", "1", "--no-nanny", "--no-dashboard", "--name", str(index))
                for index in range(workers)
            ]
            with Client(scheduler_file=str(place), timeout=patience) as client:
                client.wait_for_workers(workers, timeout=patience)
                yield client, started
        finally:
            for process in reversed(processes):
                with suppress(ProcessLookupError):
                    process.kill()
                process.wait()


def main() -> None:
    robot = prup_pin.load("3prup")
    asked: dict[str, Any] = {
        "z": np.linspace(0.25, 0.45, 9),
        "theta": np.linspace(-0.5, 0.5, 81),
        "phi": np.linspace(-0.5, 0.5, 81),
        "quantities": ["C", "extremes"],
        "force": 300,
        "moment": 100,
    }
    killed = False
    with cluster() as (client, workers):
        print(f"{client}")

        def progress(done: int, total: int) -> None:
            nonlocal killed
            print(f"{done:8d} of {total} poses, {len(client.scheduler_info(n_workers=-1)['workers'])} workers")
            if not killed and done > total / 4:
                killed = True
                workers[0].kill()
                print("         worker 0 was killed")

        there = robot.sweep(**asked, executor=client.get_executor(retries=3), progress=progress)
    here = robot.sweep(**asked)
    same = (there.status == here.status).all() and all(
        np.array_equal(there[name], here[name], equal_nan=True) for name in here
    )
    print(f"{there!r}\nthe same bits as in one process: {same}")
    if not same:
        sys.exit(1)


if __name__ == "__main__":
    main()
