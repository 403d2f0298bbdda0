"""A fleet on a Dask cluster, one of two workers killed midway: the same bits as in one process; its time by devices.

    python scripts/dask_fleet.py [--devices 8] [--times 5 10 20 40] [--docs]

Arms of one drawing are drawn by a simulator of their own (tests/reference/concealed/fleet.py). `--times` asks fleets of
so many devices in one process, each from nothing, and prints the processor time of each. `--docs` writes the table
into docs/life.md.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import re
import sys
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from _project import ROOT
from _scattered import robot_file
from dask_sweep import cluster

from prup_pin.life.fleet import Device, Fleet, devices_of, fleet
from prup_pin.recordings import read_recording
from tests.reference.concealed.fleet import draw_fleet, write

ROBOT, POSES = "elastic_arm", 6


def drawn(folder: Path, count: int) -> list[Device]:
    """Return so many devices of one drawing, by their recordings in a folder."""
    paths = write(draw_fleet(1, ROBOT, POSES, count), folder, folder / "sealed", str(robot_file(ROBOT)))
    return devices_of([read_recording(path) for path in paths])


def kept_bytes(folder: Path) -> dict[str, bytes]:
    """Return what devices answered and their models, by file."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def same(one: Fleet, other: Fleet) -> bool:
    """Return whether two answers are the same to the bit, but for remarks."""
    names = [item.name for item in fields(Fleet) if item.name not in ("own", "remarks")]
    alike = all(repr(getattr(one, name)) == repr(getattr(other, name)) for name in names)
    return alike and one.own.tobytes() == other.own.tobytes()


def with_a_worker_killed(count: int) -> bool:
    """Ask a fleet by two workers of which one is killed, and in one process; return whether both are the same."""
    killed = False
    with TemporaryDirectory() as folder:
        devices = drawn(Path(folder), count)
        with cluster() as (client, workers):

            def progress(done: int, total: int) -> None:
                nonlocal killed
                print(f"{done:4d} of {total} devices, {len(client.scheduler_info(n_workers=-1)['workers'])} workers")
                if not killed and done >= total / 4:
                    killed = True
                    workers[0].kill()
                    print("     worker 0 was killed")

            there = fleet(
                devices, Path(folder) / "there", robot_name=str(robot_file(ROBOT)),
                executor=client.get_executor(retries=3), tell=progress,
            )  # fmt: skip
        here = fleet(devices, Path(folder) / "here", robot_name=str(robot_file(ROBOT)))
        bits = same(there, here) and kept_bytes(Path(folder) / "there") == kept_bytes(Path(folder) / "here")
    print(f"{' '.join(there.remarks) or 'every device came back from a worker'}")
    print(f"the same bits as in one process: {bits}")
    return bits


def times(counts: Sequence[int]) -> str:
    """Return a table of processor seconds by devices, and the power of their number with which they grow."""
    rows, seconds = [], []
    for count in counts:
        with TemporaryDirectory() as folder:
            devices = drawn(Path(folder), count)
            begun = process_time()
            fleet(devices, Path(folder) / "fleet", robot_name=str(robot_file(ROBOT)))
            asked = process_time()
            fleet(devices, Path(folder) / "fleet", robot_name=str(robot_file(ROBOT)))  # what is kept is put together
            together = process_time() - asked
        seconds.append(asked - begun)
        rows.append(f"| {count} | {asked - begun:.1f} | {together:.2f} | {(asked - begun) / count:.2f} |")
    power = np.polyfit(np.log(counts), np.log(seconds), 1)[0]
    head = "| devices | processor seconds | of these, all together | by device |\n|---|---|---|---|\n"
    return head + "\n".join(rows) + f"\n\nTime grows with the number of devices to the power of {power:.2f}.\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--devices", type=int, default=8, help="of the fleet that is asked twice; 0: of none")
    parser.add_argument("--times", type=int, nargs="*", default=[5, 10, 20, 40], help="sizes of fleets to time")
    parser.add_argument("--docs", action="store_true", help="write the table of times into docs/life.md")
    options = parser.parse_args()
    good = not options.devices or with_a_worker_killed(options.devices)
    if options.times:
        table = times(options.times)
        print(table)
        if options.docs:
            page = ROOT / "docs" / "life.md"
            text = page.read_text(encoding="utf-8")
            mark = r"(<!-- times -->\n\n).*?(\n<!-- /times -->)"
            page.write_text(re.sub(mark, lambda m: m[1] + table + m[2], text, flags=re.DOTALL), encoding="utf-8")
    if not good:
        sys.exit(1)


if __name__ == "__main__":
    main()
