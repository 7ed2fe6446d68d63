"""How points of maps in tiles flow: a chunk is written while the next is read, several tiles are
learned at once, and errors and Ctrl-C end all of it."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from surfabet import _spill, tiling
from surfabet._spill import Spill, SpillWriter
from test_tiles import OPTIONS, TILE, room

N_CHUNKS = 5
PATIENCE = 60.0
"""Seconds after which something that has to happen did not."""


@pytest.fixture(scope="module")
def chunks() -> list[sb.PointCloud]:
    cloud = room(seed=3)
    return [cloud.select(np.arange(i, len(cloud), N_CHUNKS)) for i in range(N_CHUNKS)]


@pytest.fixture(scope="module")
def wanted(chunks: list[sb.PointCloud], tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("flow") / "map.sfb"
    sb.learn_patches_tiled(iter(chunks), path, tile=TILE, **OPTIONS)
    return path.read_bytes()


@pytest.fixture
def two_threads() -> Iterator[None]:
    sb.set_num_threads(2)
    yield
    sb.set_num_threads(None)


def threads() -> set[str]:
    """Threads of executors that are left."""
    return {t.name for t in threading.enumerate() if "ThreadPoolExecutor" in t.name}


def test_a_chunk_is_written_while_the_next_is_made_and_no_more_wait(
    chunks: list[sb.PointCloud], wanted: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = [threading.Event() for _ in range(N_CHUNKS + 1)]
    add, n_added, most = SpillWriter.add, 0, 0

    def source() -> Iterator[sb.PointCloud]:
        nonlocal most
        for i, cloud in enumerate(chunks):
            asked[i].set()
            most = max(most, i - n_added)
            yield cloud
        asked[-1].set()

    def patient(writer: SpillWriter, cloud: sb.PointCloud) -> None:
        nonlocal n_added
        assert asked[n_added + 1].wait(PATIENCE)
        add(writer, cloud)
        n_added += 1

    monkeypatch.setattr(SpillWriter, "add", patient)
    sb.learn_patches_tiled(source(), tmp_path / "map.sfb", tile=TILE, **OPTIONS)
    assert (tmp_path / "map.sfb").read_bytes() == wanted
    assert most == 1


def test_a_slow_source_gives_the_same_bytes(
    chunks: list[sb.PointCloud], wanted: bytes, tmp_path: Path
) -> None:
    def source() -> Iterator[sb.PointCloud]:
        for cloud in chunks:
            time.sleep(0.2)
            yield cloud

    sb.learn_patches_tiled(source(), tmp_path / "map.sfb", tile=TILE, **OPTIONS)
    assert (tmp_path / "map.sfb").read_bytes() == wanted


@pytest.mark.parametrize("after", [0, 1, 3])
def test_an_error_of_the_source_leaves_nothing(
    after: int, chunks: list[sb.PointCloud], tmp_path: Path
) -> None:
    def source() -> Iterator[sb.PointCloud]:
        yield from chunks[:after]
        raise RuntimeError("the sensor is gone")

    with pytest.raises(RuntimeError, match="the sensor is gone"):
        sb.learn_patches_tiled(source(), tmp_path / "map.sfb", tile=TILE, **OPTIONS)
    assert not list(tmp_path.iterdir())
    assert not threads()


@pytest.mark.parametrize("at", [0, 2, N_CHUNKS - 1])
def test_an_error_of_the_disk_is_told(
    at: int, chunks: list[sb.PointCloud], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add, calls = SpillWriter.add, []

    def full(writer: SpillWriter, cloud: sb.PointCloud) -> None:
        calls.append(cloud)
        if len(calls) == at + 1:
            raise OSError("the disk is full")
        add(writer, cloud)

    monkeypatch.setattr(SpillWriter, "add", full)
    with pytest.raises(OSError, match="the disk is full"):
        sb.learn_patches_tiled(iter(chunks), tmp_path / "map.sfb", tile=TILE, **OPTIONS)
    assert len(calls) == at + 1
    assert not list(tmp_path.iterdir())
    assert not threads()


def at_once(
    source: Any, path: Path, monkeypatch: pytest.MonkeyPatch, **options: Any
) -> tuple[int, int, int]:
    """The most tiles that were learned at once, the most points of these, and of one."""
    learn, lock, begun = tiling.learn_tile, threading.Lock(), {}
    most = n_points = largest = 0

    def counted(cloud: sb.PointCloud, cube: Any, *rest: Any, **given: Any) -> bytes | None:
        nonlocal most, n_points, largest
        with lock:
            begun[cube] = len(cloud)
            most, n_points = max(most, len(begun)), max(n_points, sum(begun.values()))
            largest = max(largest, len(cloud))
        time.sleep(0.05)
        data = learn(cloud, cube, *rest, **given)
        with lock:
            del begun[cube]
        return data

    monkeypatch.setattr(tiling, "learn_tile", counted)
    sb.learn_patches_tiled(source, path, tile=TILE, **OPTIONS, **options)
    return most, n_points, largest


@pytest.mark.usefixtures("two_threads")
def test_tiles_are_learned_at_once_as_far_as_the_memory_goes(
    chunks: list[sb.PointCloud], wanted: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "map.sfb"
    with monkeypatch.context() as patched:
        most, n_points, largest = at_once(iter(chunks), path, patched)
        assert most == 2
        assert path.read_bytes() == wanted
    monkeypatch.setattr(tiling, "BASE_MEMORY", 1 << 20)
    monkeypatch.setattr(tiling, "LEAST_MEMORY", 1 << 20)
    monkeypatch.setattr(Spill, "bytes_per_point", _spill.BYTES_PER_POINT)
    # Both sides of what those two tiles take.
    need = (1 << 20) + _spill.BYTES_PER_POINT * n_points
    for memory in (need, need - 1):
        with monkeypatch.context() as patched:
            _, found, _ = at_once(iter(chunks), path, patched, max_memory=memory)
            assert (1 << 20) + _spill.BYTES_PER_POINT * found <= memory
            assert path.read_bytes() == wanted
    # As much as the largest one takes.
    memory = (1 << 20) + _spill.BYTES_PER_POINT * largest
    _, found, _ = at_once(iter(chunks), path, monkeypatch, max_memory=memory)
    assert found == largest


def test_what_is_kept_beside_coordinates_takes_memory_too(tmp_path: Path) -> None:
    """Three numbers of a colour, one of an intensity, none of what is not kept."""
    needs = []
    for name, given in {
        "bare": {},
        "colors": {"colors": np.zeros((1, 3), np.uint8)},
        "both": {"colors": np.zeros((1, 3), np.uint8), "intensities": np.zeros(1, np.float32)},
        "other": {"extra": {"label": np.zeros(1, np.uint8)}},
    }.items():
        (tmp_path / name).mkdir()
        cloud = sb.PointCloud(np.zeros((1, 3)), **given)
        writer = SpillWriter(tmp_path / name, 1.0, cloud, ("colors", "intensities"))
        writer.add(cloud)
        needs.append(writer.finish().bytes_per_point - _spill.BYTES_PER_POINT)
        writer.close()
    once, each = _spill.BYTES_WITH_VALUES, _spill.BYTES_PER_VALUE
    assert needs == [0, once + 3 * each, once + 4 * each, 0]


@pytest.mark.usefixtures("two_threads")
def test_a_small_tile_is_learned_beside_a_large_one(
    chunks: list[sb.PointCloud], wanted: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where two of the largest do not fit, the first that does is next."""
    _, _, largest = at_once(iter(chunks), tmp_path / "map.sfb", monkeypatch)
    monkeypatch.setattr(tiling, "BASE_MEMORY", 1 << 20)
    monkeypatch.setattr(tiling, "LEAST_MEMORY", 1 << 20)
    monkeypatch.setattr(Spill, "bytes_per_point", _spill.BYTES_PER_POINT)
    memory = (1 << 20) + _spill.BYTES_PER_POINT * int(1.3 * largest)
    path = tmp_path / "again.sfb"
    most, found, _ = at_once(iter(chunks), path, monkeypatch, max_memory=memory)
    assert most == 2
    assert largest < found <= 1.3 * largest
    assert path.read_bytes() == wanted


@pytest.mark.usefixtures("two_threads")
def test_one_thread_learns_one_tile_at_a_time(
    chunks: list[sb.PointCloud], wanted: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sb.set_num_threads(1)
    try:
        most, _, _ = at_once(iter(chunks), tmp_path / "map.sfb", monkeypatch)
    finally:
        sb.set_num_threads(None)
    assert most == 1
    assert (tmp_path / "map.sfb").read_bytes() == wanted


@pytest.mark.usefixtures("two_threads")
def test_ctrl_c_ends_all_tiles_and_the_next_run_goes_on(
    chunks: list[sb.PointCloud], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, path, whole = (tmp_path / name for name in ("room.ply", "map.sfb", "whole.sfb"))
    sb.write(source, room(seed=3))
    first = sb.learn_patches_tiled(source, whole, tile=TILE, **OPTIONS)
    learn, begun = tiling.learn_tile, threading.Barrier(2)
    sent: list[float] = []
    n_begun = 0

    def interrupt() -> None:
        sent.append(time.process_time())
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    def endless(*args: Any, **given: Any) -> bytes | None:
        nonlocal n_begun
        n_begun += 1
        if n_begun <= 3:
            return learn(*args, **given)
        # Two threads, each again and again at a tile, until they are stopped.
        if begun.wait(PATIENCE) == 0:
            threading.Thread(target=interrupt).start()
        while True:
            learn(*args, **given)

    monkeypatch.setattr(tiling, "learn_tile", endless)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            sb.learn_patches_tiled(source, path, tile=TILE, **OPTIONS)
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.process_time() - sent[0] < 2 * (sb.get_num_threads() + 1)
    assert not threads()
    assert not path.exists()
    kept = list((tmp_path / "map.sfb.work" / "tiles").glob("*"))
    assert [file.suffix for file in kept] == [".sfb"] * 3
    monkeypatch.setattr(tiling, "learn_tile", learn)
    second = sb.learn_patches_tiled(source, path, tile=TILE, **OPTIONS)
    assert second.n_learned == first.n_learned - 3
    assert path.read_bytes() == whole.read_bytes()


def test_what_asks_a_tile_to_stop_is_heard_on_any_thread(tmp_path: Path) -> None:
    cloud = room()
    plan: dict[str, Any] = {}
    monkey = pytest.MonkeyPatch()
    with monkey.context() as patched:
        learn = tiling.learn_tile

        def seen(cloud: sb.PointCloud, cube: Any, of: Any, options: Any, **given: Any) -> Any:
            plan.update(of)
            return learn(cloud, cube, of, options, **given)

        patched.setattr(tiling, "learn_tile", seen)
        sb.learn_patches_tiled(cloud, tmp_path / "map.sfb", **OPTIONS)
    stop = sb._core.Stop()
    stop.set()
    with ThreadPoolExecutor(1) as other, pytest.raises(KeyboardInterrupt):
        other.submit(tiling.learn_tile, cloud, (0, 0, 0), plan, OPTIONS, stop=stop).result()


def test_points_on_disk_are_those_of_the_source_brick_by_brick(tmp_path: Path) -> None:
    """With all columns, in chunks, about an origin far from zero; bricks by the floors of numpy."""
    rng = np.random.default_rng(0)
    n, side, origin = 3000, 0.7, [5e5, -3e6, 120.0]
    whole = sb.PointCloud(
        rng.normal(scale=2.0, size=(n, 3)).astype(np.float32),
        origin=origin,
        colors=rng.integers(0, 256, (n, 3)).astype(np.uint8),
        intensities=rng.random(n).astype(np.float32),
        normals=np.tile(np.float32([0, 0.6, 0.8]), (n, 1)),
        ranges=rng.random(n).astype(np.float32) + 1,
        viewpoints=rng.random((4, 3)),
        viewpoint_index=rng.integers(0, 4, n),
        extra={"label": rng.integers(0, 9, n).astype(np.int16)},
    )
    parts = [whole.select(np.arange(k, n, 2)) for k in range(2)]
    names = ["colors", "intensities", "label"]
    writer = SpillWriter(tmp_path, side, parts[0], names)
    for part in parts:
        writer.add(part)
    spill = writer.finish()
    assert spill.n_points == n

    order = np.r_[np.arange(0, n, 2), np.arange(1, n, 2)]
    bricks = np.floor(whole.points[order] / side)
    different, of_points = np.unique(bricks, axis=0, return_inverse=True)
    assert np.array_equal(spill.corners(np.arange(len(spill.keys))), different * side)
    assert np.array_equal(spill.counts, np.bincount(of_points.ravel()))
    order = order[np.argsort(of_points.ravel(), kind="stable")]
    for chosen in (np.arange(len(spill.keys)), np.array([7, 2, 11])):
        here = np.isin(np.repeat(np.arange(len(spill.keys)), spill.counts), chosen)
        read = Spill.open(tmp_path).read(chosen.tolist(), origin)
        source = whole.select(order[here])
        # Twice rounded to single precision, by 2e-8 m in a brick and 5e-7 at 9 m.
        assert np.abs(read.local_points - source.local_points).max() < 1e-6
        for name in [*names, "normals", "ranges"]:
            assert np.array_equal(read[name], source[name]), name
        seen = [c.viewpoints[c.viewpoint_index] for c in (read, source)]
        assert np.array_equal(seen[0], seen[1])


def test_points_that_end_early_are_told(chunks: list[sb.PointCloud], tmp_path: Path) -> None:
    writer = SpillWriter(tmp_path, 0.5, chunks[0], ["colors"])
    writer.add(chunks[0])
    spill = writer.finish()
    file = tmp_path / "points.bin"
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(OSError, match=r"points\.bin ends early"):
        spill.read(range(len(spill.keys)), [0.0, 0.0, 0.0])


def test_threads_open_the_same_points_at_once(chunks: list[sb.PointCloud], tmp_path: Path) -> None:
    # Switching threads as often as can be: headers of numpy's files failed to parse now and then.
    before = sys.getswitchinterval()
    writer = SpillWriter(tmp_path, 0.5, chunks[0], [])
    writer.add(chunks[0])
    n_points = writer.finish().n_points
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(8) as threads:
            opened = list(threads.map(Spill.open, [tmp_path] * 400))
    finally:
        sys.setswitchinterval(before)
    assert [spill.n_points for spill in opened] == [n_points] * 400
