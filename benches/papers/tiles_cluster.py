"""Tiles learned by a Dask cluster of this machine: workers, one that is killed, a run that is.

    python benches/papers/tiles_cluster.py [--rooms 2 2] [--tile 3]

Needs surfabet with its extra `dask`. Per row: tiles that were learned, times that a tile was begun,
whether the file has the bytes that one process alone writes, and seconds of wall time, without
those until the cluster stands.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from distributed import Client, LocalCluster
from paper_bench import print_header, print_row
from tiles import building

import surfabet as sb


class Noted(Executor):
    """Hands tiles to a cluster whose workers note each that they begin; the worker that begins tile
    number `deadly` is killed, once."""

    def __init__(self, inner: Executor, log: Path, deadly: int | None = None) -> None:
        self.inner, self.log, self.deadly, self.n = inner, log, deadly, 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.n += 1
        mark = f"{self.log}.killed" if self.n == self.deadly else None
        return self.inner.submit(noted, fn, *args, log=str(self.log), mark=mark)


def noted(fn: Any, job: Any, *, log: str, mark: str | None) -> Any:
    """What a worker does with a tile."""
    if not job.path.exists():
        with open(log, "a") as file:
            file.write(f"{job.cube}\n")
    if mark is not None and not os.path.exists(mark):
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return fn(job)


@contextmanager
def cluster(workers: int, folder: Path) -> Iterator[Executor]:
    """An executor of so many processes."""
    options = {"threads_per_worker": 1, "dashboard_address": ":0", "local_directory": str(folder)}
    with LocalCluster(n_workers=workers, **options) as made, Client(made) as client:
        yield client.get_executor(pure=False)


def learn(folder: Path, tile: float, executor: Executor | None, workers: int) -> sb.TilingReport:
    options = {"executor": executor, "workers": workers, "max_memory": 4 << 30}
    return sb.learn_patches_tiled(folder / "scene.ply", folder / "map.sfb", tile=tile, **options)


def row(folder: Path, name: str, tile: float, workers: int, deadly: int | None = None) -> None:
    log = folder / "log"
    log.write_text("")
    with cluster(workers, folder / "cluster") as executor:
        began = time.perf_counter()
        report = learn(folder, tile, Noted(executor, log, deadly), workers)
        seconds = time.perf_counter() - began
    same = (folder / "map.sfb").read_bytes() == (folder / "alone.sfb").read_bytes()
    begun = len(log.read_text().splitlines())
    print_row(name, report.n_learned, begun, "yes" if same else "NO", f"{seconds:.1f}")


def killed_half_way(folder: Path, tile: float) -> None:
    """A run of two workers that is killed with them when half of the tiles are learned."""

    def tell(stage: str, _: float) -> None:
        found = re.match(r"learn tiles \((\d+) of (\d+)\)", stage)
        if found and 2 * int(found[1]) >= int(found[2]):
            os.killpg(0, signal.SIGKILL)

    with cluster(2, folder / "cluster") as executor:
        sb.learn_patches_tiled(
            folder / "scene.ply",
            folder / "map.sfb",
            tile=tile,
            executor=executor,
            workers=2,
            max_memory=4 << 30,
            progress=tell,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rooms", nargs=2, type=int, default=[2, 2])
    parser.add_argument("--tile", type=float, default=3.0)
    parser.add_argument("--killed", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.killed:
        killed_half_way(options.killed, options.tile)
        return
    with tempfile.TemporaryDirectory() as made:
        folder, tile = Path(made), options.tile
        cloud = building(tuple(options.rooms))
        sb.write(folder / "scene.ply", cloud)
        print(f"{len(cloud):,} points")
        print_header("learned by", "tiles", "begun", "same bytes", "seconds")
        began = time.perf_counter()
        report = learn(folder, tile, None, 1)
        seconds = time.perf_counter() - began
        (folder / "map.sfb").rename(folder / "alone.sfb")
        print_row("one process, all threads", report.n_learned, "", "", f"{seconds:.1f}")
        row(folder, "Dask, 1 worker", tile, 1)
        row(folder, "Dask, 2 workers", tile, 2)
        row(folder, "Dask, 2 workers, one killed", tile, 2, deadly=5)
        run = [sys.executable, __file__, "--killed", str(folder), "--tile", str(tile)]
        assert subprocess.run(run, start_new_session=True).returncode == -signal.SIGKILL
        row(folder, "Dask, 2 workers, after a run that was killed", tile, 2)


if __name__ == "__main__":
    main()
