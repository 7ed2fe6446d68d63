"""Maps in tiles by processes: a Dask cluster and a pool, workers that are killed, runs that are."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from surfabet import tiling
from test_tiles import OPTIONS, TILE, room

distributed = pytest.importorskip("distributed", reason="pip install 'surfabet[dask]'")
CLUSTER: dict[str, Any] = {
    "threads_per_worker": 1,
    # Any free port.
    "dashboard_address": ":0",
}


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("source") / "room.ply"
    sb.write(path, room().select(np.arange(0, 117_500, 2)))
    return path


@pytest.fixture(scope="module")
def wanted(source: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, int]:
    """The map that this process learns alone, and its tiles."""
    path = tmp_path_factory.mktemp("alone") / "map.sfb"
    report = sb.learn_patches_tiled(source, path, tile=TILE, **OPTIONS)
    return path.read_bytes(), report.n_learned


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Of a real cluster: a scheduler and two processes that work."""
    folder = str(tmp_path_factory.mktemp("cluster"))
    with (
        distributed.LocalCluster(n_workers=2, local_directory=folder, **CLUSTER) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


class Logged(Executor):
    """Hands tiles to another executor, and has each worker note those that it learns; the worker
    with the tile `deadly` kills itself the first time."""

    def __init__(self, inner: Executor, folder: Path, deadly: int | None = None) -> None:
        self.inner, self.log, self.deadly, self.n = inner, folder / "log", deadly, 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.n += 1
        mark = f"{self.log}.killed" if self.n == self.deadly else None
        return self.inner.submit(noted, fn, *args, log=str(self.log), mark=mark)

    def started(self) -> Counter[str]:
        return Counter(self.log.read_text().splitlines())


def noted(fn: Any, job: Any, *, log: str, mark: str | None) -> Any:
    if not job.path.exists():
        with open(log, "a") as file:
            file.write(f"{job.cube}\n")
    if mark is not None and not os.path.exists(mark):
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return fn(job)


def learn(source: Path, path: Path, executor: Executor, workers: int = 2) -> sb.TilingReport:
    return sb.learn_patches_tiled(
        source, path, tile=TILE, executor=executor, workers=workers, **OPTIONS
    )


def test_a_cluster_of_two_writes_the_same_bytes_in_any_order(
    source: Path,
    wanted: tuple[bytes, int],
    client: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    executor = Logged(client.get_executor(pure=False), tmp_path)
    learn(source, tmp_path / "map.sfb", executor)
    assert (tmp_path / "map.sfb").read_bytes() == wanted[0]
    first = executor.log.read_text().splitlines()
    assert len(first) == len(set(first)) == wanted[1]
    executor.log.unlink()
    monkeypatch.setattr(tiling, "sorted", lambda x, **_: list(reversed(list(x))), raising=False)
    learn(source, tmp_path / "back.sfb", executor)
    assert (tmp_path / "back.sfb").read_bytes() == wanted[0]
    assert executor.log.read_text().splitlines()[0] != first[0]


def test_a_cluster_of_one_writes_the_same_bytes(
    source: Path, wanted: tuple[bytes, int], tmp_path: Path
) -> None:
    options = CLUSTER | {"n_workers": 1, "local_directory": str(tmp_path / "cluster")}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        learn(source, tmp_path / "map.sfb", client.get_executor(pure=False), workers=1)
    assert (tmp_path / "map.sfb").read_bytes() == wanted[0]


def test_a_worker_of_a_cluster_that_is_killed_costs_its_tile_once(
    source: Path, wanted: tuple[bytes, int], client: Any, tmp_path: Path
) -> None:
    executor = Logged(client.get_executor(pure=False), tmp_path, deadly=3)
    learn(source, tmp_path / "map.sfb", executor)
    assert Path(f"{executor.log}.killed").exists()
    assert (tmp_path / "map.sfb").read_bytes() == wanted[0]
    started = executor.started()
    assert len(started) == wanted[1]
    assert sorted(started.values()) == [1] * (wanted[1] - 1) + [2]


def test_after_a_worker_of_a_pool_was_killed_the_rest_is_learned_here(
    source: Path, wanted: tuple[bytes, int], tmp_path: Path
) -> None:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        executor = Logged(pool, tmp_path, deadly=3)
        with pytest.warns(RuntimeWarning, match="worker died"):
            learn(source, tmp_path / "map.sfb", executor)
    assert (tmp_path / "map.sfb").read_bytes() == wanted[0]
    assert max(executor.started().values()) == 1


def stuck(fn: Any, job: Any, *, stop: str) -> Any:
    """Tiles after the first three take for ever."""
    if len(list(job.path.parent.glob("*.sfb"))) >= 3:
        Path(stop).touch()
        time.sleep(600)
    return fn(job)


class Stuck(Executor):
    def __init__(self, inner: Executor, stop: str) -> None:
        self.inner, self.stop = inner, stop

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self.inner.submit(stuck, fn, *args, stop=self.stop)


@contextmanager
def workers_of(kind: str, folder: str) -> Iterator[Executor]:
    """A cluster or a pool of two processes."""
    if kind == "pool":
        with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
            yield pool
        return
    with (
        distributed.LocalCluster(n_workers=2, local_directory=folder, **CLUSTER) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client.get_executor(pure=False)


def run_until_stuck(kind: str, source: str, path: str, stop: str) -> None:
    """What the process that is killed does."""
    with workers_of(kind, f"{path}.cluster") as executor:
        learn(Path(source), Path(path), Stuck(executor, stop))


SCRIPT = """
import sys

sys.path.insert(0, {tests!r})
import test_tiles_dask

if __name__ == "__main__":
    test_tiles_dask.run_until_stuck(*{arguments!r})
"""


@pytest.mark.parametrize("kind", ["cluster", "pool"])
def test_a_run_that_was_killed_goes_on_and_ends_with_the_same_bytes(
    kind: str, source: Path, wanted: tuple[bytes, int], client: Any, tmp_path: Path
) -> None:
    path, stop = tmp_path / "map.sfb", tmp_path / "stop"
    arguments = [kind, *map(str, (source, path, stop))]
    script = tmp_path / "run.py"
    script.write_text(SCRIPT.format(tests=str(Path(__file__).parent), arguments=arguments))
    process = subprocess.Popen([sys.executable, str(script)], start_new_session=True)
    try:
        end = time.monotonic() + 120
        while not stop.exists() and process.poll() is None and time.monotonic() < end:
            time.sleep(0.05)
        assert stop.exists()
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert not path.exists()
    done = len(list((tmp_path / "map.sfb.work" / "tiles").glob("*.sfb")))
    assert 3 <= done < wanted[1]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        report = learn(source, path, client.get_executor(pure=False))
    assert report.n_learned == wanted[1] - done
    assert path.read_bytes() == wanted[0]
    assert not (tmp_path / "map.sfb.work").exists()
