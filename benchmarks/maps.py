"""Maps of eight million poses: seconds and memory for each index; a map that was ended goes on.

Every index over 200 x 200 x 200 poses, in this process. Then one of them on a local cluster of two
workers, of which one is killed in the middle; and by a process that is killed in the middle, and
resumed. Each time the result must be the same to the last bit.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from measuring import quick

import pteron
from pteron.indices import indices_of
from pteron.maps import Grid, Map, cores, map_index, pose_grid

_MACHINES = ("quadrupteron", "delta")
_INDEX = "condition"

_DYING = """\
import os, signal
from pteron.maps import map_index, pose_grid
def progress(share):
    if share >= 0.5:
        os.kill(os.getpid(), signal.SIGKILL)
grid = pose_grid("{robot}", {held}, points={points})
map_index("{robot}", "{index}", grid, out="{store}", progress=progress)
"""


def main() -> None:
    """Print the table of all indices, then what the killings have cost."""
    points = 20 if quick() else 200
    for name in _MACHINES[: 1 if quick() else None]:
        robot = pteron.load(name)
        held = {"phi": 0.0} if robot.platform.turns else {}
        grid = pose_grid(robot, held, points=points)
        print(f"{name}: {grid.size} poses, {cores()} processors")
        print(f"{'':<24}{'compiling':>10}{'seconds':>9}{'ns a pose':>11}{'in reach':>10}")
        names = indices_of(robot)
        for index in names[: 2 if quick() else None]:
            first, found, _ = timed(robot, index, grid)
            seconds, again, processor = timed(robot, index, grid)
            expect_alike(found, again)
            print(
                f"{index:<24}{max(first - seconds, 0.0):>10.2f}{seconds:>9.2f}"
                f"{1e9 * processor / grid.size:>11.0f}{found.share:>10.1%}"
            )
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        print(f"most memory of this process, so far: {peak:.0f} MB\n")

    robot = pteron.load(_MACHINES[0])
    held = {"phi": 0.0}
    # More than one chunk in the short form too.
    points = 52 if quick() else points
    grid = pose_grid(robot, held, points=points)
    seconds, plain, _ = timed(robot, _INDEX, grid)
    print(f"{robot.name}, {_INDEX}, {grid.size} poses in {len(grid.regions())} chunks")
    print(f"{'in this process':<54}{seconds:>7.2f} s")
    with tempfile.TemporaryDirectory() as folder:
        begin = perf_counter()
        streamed = map_index(robot, _INDEX, grid, out=Path(folder, "streamed.zarr"))
        print(f"{'streamed to Zarr':<54}{perf_counter() - begin:>7.2f} s")
        expect_alike(plain, streamed)

        if not quick():  # the tests kill a worker too
            a_worker_dies(robot, grid, plain, Path(folder, "cluster.zarr"))

        store = Path(folder, "client.zarr")
        code = _DYING.format(
            robot=robot.name, held=held, points=points, index=_INDEX, store=store.as_posix()
        )
        run = subprocess.run([sys.executable, "-c", code], check=False)
        if run.returncode != -signal.SIGKILL:
            sys.exit("the process that was to be killed has ended by itself")
        there: list[float] = []
        begin = perf_counter()
        resumed = map_index(robot, _INDEX, grid, out=store, progress=there.append)
        print(
            f"{f'resumed after a killing, {there[0]:.0%} of the chunks being there':<54}"
            f"{perf_counter() - begin:>7.2f} s"
        )
        expect_alike(plain, resumed)
    print("All are the same to the last bit.")


def a_worker_dies(robot: pteron.Manipulator, grid: Grid, plain: Map, store: Path) -> None:
    """Print how long two workers take, of which one is killed in the middle."""
    killed: list[int] = []

    def progress(share: float) -> None:
        if not killed and share >= 0.5:
            killed.append(a_worker())
            os.kill(killed[0], signal.SIGKILL)

    begin = perf_counter()
    shared = map_index(robot, _INDEX, grid, out=store, workers=2, progress=progress)
    print(
        f"{'two workers, one of them killed in the middle':<54}"
        f"{perf_counter() - begin:>7.2f} s, with their start"
    )
    expect_alike(plain, shared)


def timed(robot: pteron.Manipulator, index: str, grid: Grid) -> tuple[float, Map, float]:
    """Return the seconds of a map, the map, and the seconds of all processors."""
    begin, work = perf_counter(), process_time()
    found = map_index(robot, index, grid)
    return perf_counter() - begin, found, process_time() - work


def expect_alike(one: Map, other: Map) -> None:
    """End with an error if two maps differ in a bit."""
    same = (one.status == other.status).all() and all(
        np.array_equal(values, other.values[name], equal_nan=True)
        for name, values in one.values.items()
    )
    if not same:
        sys.exit("two maps of the same poses differ")


def a_worker() -> int:
    """Return the number of a process that computes for this one."""
    import psutil  # type: ignore[import-untyped]  # comes with dask.distributed

    children = psutil.Process().children(recursive=True)
    workers = [child for child in children if "spawn_main" in " ".join(child.cmdline())]
    return int(max(workers, key=lambda child: child.cpu_times().user).pid)


if __name__ == "__main__":
    main()
