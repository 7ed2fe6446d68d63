"""Learning maps that are larger than memory: points go to disk by place, tiles are learned one by
one, in any order and by any number of workers, and put together."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._checks import check_integer, check_number
from surfabet._core import PointCloud
from surfabet._note import checked_note
from surfabet._progress import Progress, ProgressCallback, progress_callback
from surfabet._spill import HALF, Spill, SpillWriter, check_space
from surfabet.errors import (
    DroppedPointsWarning,
    InvalidInputError,
    LostAttributeWarning,
    wrong_type,
    wrong_value,
)
from surfabet.io._crs import unit_name
from surfabet.io._files import is_same_file, path_of
from surfabet.io._notes import counted
from surfabet.io.chunks import Chunks, chunks_of
from surfabet.learning import note_of
from surfabet.survey import survey
from surfabet.tiles import merge_tiles, open_tiled

__all__ = ["TileJob", "TilingReport", "learn_patches_tiled", "learn_tile"]

BASE_MEMORY = 224 << 20
"""Memory beside that of the points of tiles: interpreter, packages, and what reading leaves."""

LEAST_MEMORY = 288 << 20
"""Least memory that may be asked for, bytes: a chunk of coloured points takes 261 MiB in all while
it is read and sorted."""

_BRICK_SPACINGS = 150
"""Side of a brick in spacings of the points: a thirtieth of a tile with the default pixels. Whole
bricks are read about a tile and its margin."""

_SAMPLE_POINTS = 3_000_000
"""Points that what all tiles share is measured of, about."""

_STRAY_POINTS = 1000
"""Bricks that stand far off are no part of the scene when they have fewer points."""

_MANIFEST = "manifest.json"
_WINDOW = 2
"""Tiles that wait for each worker."""

_POLL = 0.1
"""Seconds between looks for signals."""


@dataclass(frozen=True)
class TilingReport:
    """How a map in tiles came about."""

    n_points: int
    """Points of the source: `n_kept`, `left_out` and `dropped` together."""
    n_kept: int
    """Points of all tiles."""
    left_out: int
    """Points far from all others, which are no part of the map."""
    dropped: int
    """Points that readers leave out, as those with NaN coordinates and beams that met nothing."""
    n_tiles: int
    n_learned: int
    """Cubes that this run learned, also those that turned out to have no tile; the others were
    there from a run that was stopped."""
    tile: float
    """Side of a tile, metres."""
    n_bytes: int
    """Size of the file."""
    chosen: dict[str, tuple[float, str]]
    """Options that follow from the data, and why."""
    not_kept: tuple[str, ...]
    """Attributes of the source that the map does not keep; `attributes` names what to keep."""
    unit: str
    """Unit of the lengths: `m`, or the one of the source's coordinate reference system."""


_Tiles = tuple[float | None, int]
"""Side of a tile in metres, and number of levels of detail."""


@dataclass(frozen=True)
class TileJob:
    """One tile to learn: all that a worker needs to know."""

    work: str
    """Folder with the points, which the worker can read and write."""
    cube: tuple[int, int, int]
    bricks: tuple[int, ...]
    plan: Mapping[str, Any]
    options: Mapping[str, Any]

    @property
    def path(self) -> Path:
        """The file of the tile."""
        x, y, z = self.cube
        return Path(self.work) / "tiles" / f"{x}_{y}_{z}.sfb"


def learn_tile(
    cloud: PointCloud,
    cube: tuple[int, int, int],
    plan: Mapping[str, Any],
    options: Mapping[str, Any],
    *,
    progress: ProgressCallback | None = None,
    stop: _core.Stop | None = None,
) -> bytes | None:
    """The tile in a cube as the bytes of a file of its own, from points among which are all within
    `plan["margin"]` metres of it; None where no point lies in it.

    The bytes depend on the arguments alone: on no other tile, and not on the number of threads.
    `surfabet.merge_tiles` puts tiles together, in any order. On a thread that signals do not reach,
    `stop` ends the work from another one, with a KeyboardInterrupt.
    """
    return _core.learn_tile(cloud, cube, dict(plan), options, progress=progress, stop=stop)


def run_job(job: TileJob, stop: _core.Stop | None = None) -> str:
    """Learns a tile and writes it; gives the path of its file. A cube without points has an empty
    one."""
    if job.path.exists():
        # Clusters run a task again when its result was lost with the worker that held it.
        return str(job.path)
    cloud = Spill.open(Path(job.work)).read(job.bricks, job.plan["origin"])
    data = learn_tile(cloud, job.cube, job.plan, job.options, stop=stop) or b""
    job.path.parent.mkdir(exist_ok=True)
    # A thread of an executor that broke may still be at the same tile.
    partial = job.path.with_suffix(f".{os.getpid()}-{threading.get_ident()}.part")
    partial.write_bytes(data)
    os.replace(partial, job.path)
    return str(job.path)


def learn_patches_tiled(
    source: Any,
    path: str | os.PathLike[str],
    *,
    tile: float | None = None,
    details: int = 1,
    max_memory: int = 2 << 30,
    executor: Executor | None = None,
    workers: int = 1,
    work: str | os.PathLike[str] | None = None,
    note: str = "",
    progress: Progress = None,
    **options: Any,
) -> TilingReport:
    """Learns surface patches in tiles and writes them to a file; the scene may be larger than the
    memory.

    The points are read once, in chunks, and written to disk by place. What all tiles share (axes,
    size of pixels, rounding) follows from a sample. Then each tile is learned from its points and
    those around it, so that surfaces go on across borders. A run that was stopped goes on where it
    was when it is started again with the same arguments.

    Parameters
    ----------
    source
        A file or folder that `surfabet.read` reads, several of these in one frame, a `PointCloud`,
        or an iterable of clouds. LAS, LAZ, COPC, binary PLY, PCD, E57, RGB-D frames and ROS bags
        are read in chunks, other files as a whole, one after another.
    path
        The model file to write (`.sfb`); an existing one is replaced when the new one is complete.
    tile
        Side of a tile, metres; rounded to whole squares of the coarsest patches. By default 1536
        pixels, or less where the memory asks for it.
    details
        Number of levels of detail, 1 to 3. Each but the last, the finest, has pixels four times as
        large as the next; they stand in the file before it, and `surfabet.load(path, level=0)`
        reads the coarsest alone. With more than one, sides of tiles are rounded to squares of the
        coarsest.
    max_memory
        Memory that all workers may take together, bytes. Tiles are made small enough for it.
    executor
        Learns the tiles: any `concurrent.futures.Executor`, such as a `ProcessPoolExecutor`, or
        what `dask.distributed.Client.get_executor(pure=False)` gives. Its workers need to see the
        folder `work`. By default they are learned here on all threads, several at once where the
        memory is enough for them.
    workers
        Number of workers of the executor, for the share of the memory that each may take.
    work
        Folder for the points and for tiles that are done, by default beside `path`, called like it
        with `.work` behind. It is removed when the file is complete; after an error or Ctrl-C it
        stays, and the next run with the same arguments goes on from it, unless the source is no
        file.
    note
        A line for people, kept with the file; by default what the data chose.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.
    **options
        Those of `learn_patches`.

    Returns
    -------
    TilingReport
        Counts of points and tiles. The bytes of the file are the same for any number of workers and
        any order.

    Raises
    ------
    InvalidInputError
        For options outside their range, a source without points, and a `max_memory` that is not
        enough for the smallest tiles.
    OSError
        The source cannot be read, or the disk is full.

    Warns
    -----
    DroppedPointsWarning
        Points were left out; the message counts them.
    LostAttributeWarning
        Some part of the source lacks an attribute that another one has.

    Examples
    --------
    >>> import numpy as np, surfabet as sb, tempfile, os
    >>> u, v = np.meshgrid(np.arange(0, 4, 0.01), np.arange(0, 1, 0.01))
    >>> wall = sb.PointCloud(np.stack([u.ravel(), 0 * u.ravel(), v.ravel()], axis=1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "wall.sfb")
    ...     report = sb.learn_patches_tiled(wall, path, tile=1.0, resolution=0.02)
    ...     part = sb.load(path, box=([1, -1, 0], [2, 1, 1])).decode()
    >>> report.n_kept == len(wall), bool(part.points[:, 0].min() >= 1)
    (True, True)
    """
    _core.check_options("patches", options)
    _check_recurrence(options)
    path = path_of("path", path)
    if isinstance(source, str | os.PathLike) and is_same_file(source, path):
        raise wrong_value(
            "path", str(path), "another file than the source, which would be replaced"
        )
    if tile is not None:
        tile = check_number("tile", tile, "a positive number of metres", above=0.0)
    details = check_integer("details", details, 1, 3)
    max_memory = checked_memory(max_memory)
    workers = check_integer("workers", workers, 1)
    if executor is not None and not isinstance(executor, Executor):
        raise wrong_type("executor", executor, "a concurrent.futures.Executor")
    note = checked_note(note)
    folder = Path(f"{path}.work") if work is None else path_of("work", work)
    chunks = chunks_of(source)
    identity = _identity(chunks, (tile, details), max_memory, workers, options)
    with (
        progress_callback(progress) as callback,
        _work_folder(folder, identity, chunks.is_repeatable) as work_folder,
    ):
        report_progress: ProgressCallback = callback or (lambda stage, fraction: None)
        spill = _spilled(chunks, work_folder, tile, options, report_progress)
        plan, jobs, left_out = _planned(
            spill, work_folder, (tile, details), max_memory // workers, options, report_progress
        )
        here = _Here(spill, max_memory)
        n_learned = _learn(jobs, executor, workers, here, report_progress)
        report = _written(path, spill, plan, jobs, note, left_out, n_learned)
    _warn(spill, report)
    return report


def _check_recurrence(options: Mapping[str, Any]) -> None:
    if options.get("recurrence"):
        requirement = (
            "False for a map in tiles, which are read one by one and hold nothing of one another"
        )
        raise wrong_value("recurrence", True, requirement)


def checked_memory(max_memory: int) -> int:
    if (found := check_integer("max_memory", max_memory, 0)) < LEAST_MEMORY:
        raise wrong_value("max_memory", max_memory, f"a number of bytes, {LEAST_MEMORY} or more")
    return found


def _identity(
    chunks: Chunks, tiles: _Tiles, max_memory: int, workers: int, options: Mapping[str, Any]
) -> str:
    """What a run must share with one that was stopped to go on from it."""
    named = {
        "version": _core.__version__,
        "source": chunks.identity,
        "tile": tiles[0],
        "details": tiles[1],
        "max_memory": max_memory,
        "workers": workers,
        "options": {name: repr(value) for name, value in sorted(options.items())},
    }
    return hashlib.sha256(json.dumps(named).encode()).hexdigest()


@contextmanager
def _work_folder(folder: Path, identity: str, is_repeatable: bool) -> Iterator[Path]:
    """The folder of a run, with what one with the same arguments left in it."""
    if not is_repeatable:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=folder.name, dir=folder.parent) as temporary:
            yield Path(temporary)
        return
    manifest = folder / _MANIFEST
    if folder.exists() and not manifest.exists() and any(folder.iterdir()):
        raise InvalidInputError(
            f"{folder} holds other things than a run that was stopped; name another folder with "
            "work=",
            argument="work",
            value=repr(str(folder)),
            requirement="a folder that is new, empty, or of a run that was stopped",
        )
    known = json.loads(manifest.read_text()) if manifest.exists() else {}
    if known.get("identity") != identity:
        if folder.exists():
            shutil.rmtree(folder)
        folder.mkdir(parents=True)
        _write_json(manifest, {"identity": identity})
    try:
        yield folder
    except InvalidInputError:
        # Nothing to go on from: the arguments have to change.
        shutil.rmtree(folder)
        raise
    shutil.rmtree(folder)


def _write_json(path: Path, content: Any) -> None:
    partial = path.with_suffix(".part")
    partial.write_text(json.dumps(content))
    os.replace(partial, path)


def _spilled(
    chunks: Chunks,
    folder: Path,
    tile: float | None,
    options: Mapping[str, Any],
    report_progress: ProgressCallback,
) -> Spill:
    """All points on disk: those that are there already, or else from the source."""
    if Spill.is_finished(folder):
        return Spill.open(folder)
    return spilled(chunks, folder, tile, options.get("attributes"), report_progress)


def spilled(
    chunks: Chunks,
    folder: Path,
    tile: float | None,
    attributes: Sequence[str] | None,
    report_progress: ProgressCallback,
) -> Spill:
    """All points of a source on disk, with the attributes that are to be kept."""
    with counted() as dropped:
        writer = _written_points(chunks, folder, tile, attributes, report_progress)
    writer.dropped = dropped.n
    return writer.finish()


def _written_points(
    chunks: Chunks,
    folder: Path,
    tile: float | None,
    named: Sequence[str] | None,
    report_progress: ProgressCallback,
) -> SpillWriter:
    """All points of the source on disk: a chunk is written while the source makes the next one."""
    writer: SpillWriter | None = None
    n_read = 0
    try:
        with ThreadPoolExecutor(1) as aside:
            written: Future[None] | None = None
            for cloud in chunks:
                if writer is None:
                    if not len(cloud):
                        continue
                    writer = _writer_of(cloud, chunks, folder, tile, named)
                if written is not None:
                    written.result()
                written = aside.submit(writer.add, cloud)
                n_read += len(cloud)
                known = chunks.n_points
                report_progress("read points", 0.3 * min(1.0, n_read / known) if known else 0.0)
            if written is not None:
                written.result()
        if writer is None:
            raise InvalidInputError("the source has no points; a map needs at least one")
        return writer
    finally:
        if writer is not None:
            writer.close()


def _writer_of(
    first: PointCloud,
    chunks: Chunks,
    folder: Path,
    tile: float | None,
    named: Sequence[str] | None,
) -> SpillWriter:
    """A writer of the points of chunks like the first one with points."""
    spacing = survey(first).spacing or 0.01
    names = ("colors", "intensities") if named is None else tuple(named)
    side = _BRICK_SPACINGS * spacing
    if tile is not None:
        # Tiles that are too small are refused later, by the size of pixels.
        side = min(side, max(0.25 * tile, spacing))
    writer = SpillWriter(folder, side, first, names, chunks.absent_is_zero)
    if chunks.n_points is not None:
        check_space(folder, chunks.n_points * writer.record.itemsize)
    return writer


def _planned(
    spill: Spill,
    folder: Path,
    tiles: _Tiles,
    memory: int,
    options: Mapping[str, Any],
    report_progress: ProgressCallback,
) -> tuple[dict[str, Any], list[TileJob], int]:
    """What all tiles share, the tiles, and the number of points that are far from all others."""
    if not len(spill.keys):
        raise InvalidInputError(
            f"all {spill.too_far:,} points of the source are further than "
            f"{spill.side * HALF:.4g} m from the middle of its first part, and no map in tiles "
            "reaches so far; learn the parts of the source as maps of their own"
        )
    bricks, left_out = scene_of(spill, bool(options.get("keep_outliers", False)))
    known = folder / "plan.json"
    if known.exists():
        plan = json.loads(known.read_text())
        plan["attributes"] = [tuple(attribute) for attribute in plan["attributes"]]
        plan["bounds"] = plan["bounds"] and tuple(plan["bounds"])
    else:
        report_progress("plan tiles", 0.3)
        plan = _plan(spill, bricks, tiles, memory, options)
        _write_json(known, plan)
    jobs = [
        TileJob(str(folder), cube, tuple(members), plan, dict(options))
        for cube, members in sorted(members_of(spill, bricks, plan).items())
    ]
    return plan, jobs, left_out


def scene_of(spill: Spill, keep_outliers: bool) -> tuple[NDArray[np.int64], int]:
    """The bricks of the scene, and the number of points of all others: small groups so far from
    the rest that they would make the scene many times as large."""
    bricks = np.arange(len(spill.keys))
    if keep_outliers or len(bricks) < 3:
        return bricks, 0
    strays = survey(PointCloud(spill.corners(bricks))).strays
    far = np.zeros(len(bricks), bool)
    far[strays] = True
    far &= spill.counts < _STRAY_POINTS
    return bricks[~far], int(spill.counts[far].sum())


def _plan(
    spill: Spill,
    bricks: NDArray[np.int64],
    tiles: _Tiles,
    memory: int,
    options: Mapping[str, Any],
) -> dict[str, Any]:
    low = spill.corners(bricks)
    bounds = (low.min(axis=0), low.max(axis=0) + spill.side)
    origin = np.rint((bounds[0] + bounds[1]) / 2)
    most = min(_SAMPLE_POINTS, (memory - BASE_MEMORY) // spill.bytes_per_point)
    # At random: every n-th one would be those of one height in places.
    mixed = np.random.default_rng(0).permutation(bricks)
    n_sampled = int(np.searchsorted(np.cumsum(spill.counts[mixed]), most, side="right"))
    sample = spill.read(mixed[: max(1, n_sampled)].tolist(), origin.tolist())
    if len(sample) > 2 * most:
        # One brick may have more points than the memory: then it is a sample of its own.
        sample = sample.select(np.arange(2 * most))
    ranges = []
    for name, (labels, least, largest, deviation) in spill.figures.items():
        kind = next(column.dtype for column in spill.columns if column.name == name)
        dtype = f"{kind[0]}{8 * int(kind[1:])}"
        ranges.append((name.removeprefix("attribute "), dtype, labels, least, largest, deviation))
    is_all = len(sample) == int(spill.counts[bricks].sum())
    if is_all and (one := sample.bounds) is not None and one[0] == one[1]:
        # A brick is large beside a single place, and pixels would follow from it.
        bounds = (np.array(one[0]), np.array(one[1]))
    box = (bounds[0].tolist(), bounds[1].tolist())
    plan = _core.plan_tiles(sample, box, ranges, *tiles, dict(options), progress=None)
    del sample
    return _fitting(spill, bricks, plan, tiles[0], memory)


def _fitting(
    spill: Spill,
    bricks: NDArray[np.int64],
    plan: dict[str, Any],
    tile: float | None,
    memory: int,
) -> dict[str, Any]:
    """The plan with tiles that are small enough for the memory."""
    while True:
        members = members_of(spill, bricks, plan)
        largest = max(int(spill.counts[of].sum()) for of in members.values())
        need = BASE_MEMORY + spill.bytes_per_point * largest
        side = plan["side"] * plan["pixel_size"]
        if need <= memory:
            return plan
        if tile is not None:
            raise InvalidInputError(
                f"tile is {tile:g}, but a tile of {side:.3g} m with {largest:,} points in it and "
                f"around it takes {need / 1e9:.2f} GB of memory; give a smaller tile, or a "
                f"max_memory of {need / 1e9:.2f}e9 bytes for each worker",
                argument="tile",
                value=repr(tile),
                requirement=f"smaller: with {largest:,} points in it and around it a tile takes "
                f"{need / 1e9:.2f} GB, more than the {memory / 1e9:.2f} GB that there are for it",
            )
        try:
            smaller = _core.plan_with_side(plan, 0.5 * side)
        except InvalidInputError:
            smaller = plan
        if 2 * smaller["margin"] >= side or smaller is plan or 2 * spill.side > side:
            raise InvalidInputError(
                f"max_memory leaves {memory / 1e9:.2f} GB for each worker, and the smallest tiles, "
                f"of {side:.3g} m, take {need / 1e9:.2f} GB; give more, or a coarser resolution",
                argument="max_memory",
                value=f"{memory}",
                requirement=f"at least {need} bytes for each worker",
            )
        plan = smaller


def members_of(
    spill: Spill, bricks: NDArray[np.int64], plan: Mapping[str, Any]
) -> dict[tuple[int, int, int], list[int]]:
    """The bricks that may hold points in the margin of each tile, for all tiles with points."""
    pixel, side = plan["pixel_size"], plan["side"]
    w, x, y, z = np.array(plan["quaternion"], float) / np.linalg.norm(plan["quaternion"])
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    middle = (spill.corners(bricks) + 0.5 * spill.side - np.array(plan["origin"])) @ rotation
    # A pixel more than rounding to single precision takes.
    half = 0.5 * spill.side * np.abs(rotation).sum(axis=0) + pixel
    offset = np.array(plan["offset"])

    def cubes(reach: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        low = np.floor(((middle - reach) / pixel - offset) / side).astype(np.int64)
        high = np.floor(((middle + reach) / pixel - offset) / side).astype(np.int64)
        return low, high

    def places(low: Iterable[int], high: Iterable[int]) -> Iterator[tuple[int, int, int]]:
        (a, b, c), (d, e, f) = low, high
        for i in range(int(a), int(d) + 1):
            for j in range(int(b), int(e) + 1):
                for k in range(int(c), int(f) + 1):
                    yield i, j, k

    members: dict[tuple[int, int, int], list[int]] = {}
    for low, high in zip(*cubes(half), strict=True):
        for cube in places(low, high):
            members.setdefault(cube, [])
    for brick, low, high in zip(bricks, *cubes(half + plan["margin"]), strict=True):
        for cube in places(low, high):
            if cube in members:
                members[cube].append(int(brick))
    return members


class _Here:
    """Learns tiles on the threads of this process, several at once as far as the memory goes: what
    one of them does on one thread leaves the others to the next."""

    def __init__(self, spill: Spill, memory: int) -> None:
        self._counts = spill.counts
        self._bytes_per_point = spill.bytes_per_point
        self._memory = memory

    def _need(self, job: TileJob) -> int:
        """Memory that a tile is taken to need beside that of all, bytes."""
        return self._bytes_per_point * int(self._counts[list(job.bricks)].sum())

    def learn(self, jobs: Iterable[TileJob], after_each: Callable[[], None]) -> None:
        """Learns tiles, the largest first, so that none is left over at the end; `after_each` is
        called after each.

        Ctrl-C and errors reach this thread; the others then leave their tiles as they are.
        """
        rest = sorted(((self._need(job), job) for job in jobs), key=lambda n: (-n[0], n[1].cube))
        begun: dict[Future[str], int] = {}
        stop = _core.Stop()
        with ThreadPoolExecutor(_core.get_num_threads()) as threads:
            try:
                while rest or begun:
                    while (at := self._next(rest, begun)) is not None:
                        need, job = rest.pop(at)
                        begun[threads.submit(run_job, job, stop)] = need
                    # With a limit, since a signal does not end every wait.
                    finished, _ = wait(begun, timeout=_POLL, return_when=FIRST_COMPLETED)
                    for future in finished:
                        del begun[future]
                        future.result()
                        after_each()
            finally:
                stop.set()

    def _next(self, rest: list[tuple[int, TileJob]], begun: Mapping[Any, int]) -> int | None:
        """Where in `rest`, needs and tiles, the first is that can be learned beside those begun."""
        if len(begun) >= _core.get_num_threads():
            return None
        room = self._memory - BASE_MEMORY - sum(begun.values())
        return next((at for at, (need, _) in enumerate(rest) if not begun or need <= room), None)


def _learn(
    jobs: list[TileJob],
    executor: Executor | None,
    workers: int,
    here: _Here,
    report_progress: ProgressCallback,
) -> int:
    """Learns the tiles that are not there yet; gives their number."""
    missing = [job for job in jobs if not job.path.exists()]
    done = len(jobs) - len(missing)

    def report() -> None:
        report_progress(
            f"learn tiles ({done} of {len(jobs)})", 0.3 + 0.7 * done / max(1, len(jobs))
        )

    def count_one() -> None:
        nonlocal done
        done += 1
        report()

    report()
    if executor is not None:
        try:
            for _ in _learned_by(missing, executor, workers):
                count_one()
        except BrokenExecutor:
            warnings.warn(
                "a worker died and its executor with it; the rest of the tiles is learned here",
                RuntimeWarning,
                stacklevel=3,
            )
    here.learn([job for job in missing if not job.path.exists()], count_one)
    return len(missing)


def _learned_by(jobs: list[TileJob], executor: Executor, workers: int) -> Iterator[TileJob]:
    """Tiles as they are learned, a few waiting for each worker. One whose worker died is learned
    once more."""
    waiting: dict[Future[str], tuple[TileJob, int]] = {}
    rest = iter(jobs)
    limit = _WINDOW * workers
    try:
        while True:
            while len(waiting) < limit and (job := next(rest, None)) is not None:
                waiting[executor.submit(run_job, job)] = (job, 0)
            if not waiting:
                return
            finished, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in finished:
                job, tries = waiting.pop(future)
                try:
                    future.result()
                except (BrokenExecutor, InvalidInputError, OSError):
                    raise
                except Exception:
                    if tries > 0:
                        raise
                    waiting[executor.submit(run_job, job)] = (job, tries + 1)
                    continue
                yield job
    finally:
        for future in waiting:
            future.cancel()


def _written(
    path: Path,
    spill: Spill,
    plan: Mapping[str, Any],
    jobs: list[TileJob],
    note: str,
    left_out: int,
    n_learned: int,
) -> TilingReport:
    """Puts the tiles together."""
    models = []
    for job in jobs:
        if not job.path.stat().st_size:
            continue
        model = open_tiled(job.path, box=None, level=None, max_items=1 << 40, max_bytes=1 << 40)
        if model is None:
            raise OSError(f"{job.path} is no tile: remove the folder and start again")
        models.append(model)
    if not models:
        raise InvalidInputError("the source has no points that are near others")
    model = merge_tiles(models)
    chosen = {option: (value, why) for option, value, why in plan["chosen"]}
    unit = "m" if spill.crs is None else unit_name(spill.crs)
    path.parent.mkdir(parents=True, exist_ok=True)
    n_bytes = model.save(path, note=note or note_of(chosen, unit))
    return TilingReport(
        n_points=spill.n_points + spill.too_far + spill.dropped,
        n_kept=model.n_points,
        left_out=left_out + spill.too_far,
        dropped=spill.dropped,
        n_tiles=len(model.tiles),
        n_learned=n_learned,
        tile=model.tile_side,
        n_bytes=n_bytes,
        chosen=chosen,
        not_kept=tuple(spill.not_kept),
        unit=unit,
    )


def _warn(spill: Spill, report: TilingReport) -> None:
    if report.left_out:
        warnings.warn(
            f"{report.left_out:,} points are far from all others and no part of the map; "
            "keep_outliers=True keeps them",
            DroppedPointsWarning,
            stacklevel=3,
        )
    names = sorted(name.removeprefix("attribute ") for name in spill.lost)
    if names:
        warnings.warn(
            f"some parts of the source have no {', '.join(names)}, which the map does not keep",
            LostAttributeWarning,
            stacklevel=3,
        )
