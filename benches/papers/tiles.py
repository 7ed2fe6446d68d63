"""Maps in tiles: what tiles cost, what a part of a map reads, and memory.

    python benches/papers/tiles.py [--part overhead|query|memory] [--points 1e6 10e6]

The hall is the drive of `multi_scan`, 42 scans by their poses. The building has 20 simulated rooms
beside one another.
"""

from __future__ import annotations

import argparse
import io
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import copc_file
import locate
import numpy as np
from gas_scans import cpu_seconds
from paper_bench import check_data, print_header, print_row, room

import surfabet as sb
from surfabet import datasets, tiling

ROOMS = (5, 4)


def hall() -> sb.PointCloud:
    """All scans of the drive in one frame."""
    scans, poses = locate.drive()
    parts = [scans[k] @ poses[k][:3, :3].T + poses[k][:3, 3] for k in sorted(scans)]
    return sb.PointCloud(np.concatenate(parts))


def building(rooms: tuple[int, int] = ROOMS, spacing: float = 0.02) -> sb.PointCloud:
    """Rooms beside one another, sampled on their true surfaces with noise of 3 mm."""
    parts = []
    for i in range(rooms[0]):
        for j in range(rooms[1]):
            points = room_points(i * rooms[1] + j, spacing)
            parts.append(points + np.array([7.0 * i, 6.0 * j, 0.0]))
    return sb.PointCloud(np.concatenate(parts))


def room_points(seed: int, spacing: float) -> np.ndarray:
    """Points of a simulated room."""
    scene = datasets.make_room(seed=seed)
    points, _ = scene.sample_surface(spacing)
    noise = np.random.default_rng(seed).normal(scale=0.003, size=points.shape)
    return np.asarray(points + noise)


SCENES = {"hall": hall, "building": building, "kitchen": room}


def tiled(cloud: sb.PointCloud, tile: float | None, **options: object) -> tuple[bytes, float]:
    """The file of a map in tiles, and the CPU seconds."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.sfb"
        began = cpu_seconds()
        sb.learn_patches_tiled(cloud, path, tile=tile, note=" ", **options)
        return path.read_bytes(), cpu_seconds() - began


def overhead(names: list[str]) -> None:
    """Bytes and error by the side of a tile, beside the map without tiles and beside one tile."""
    print_header(
        "scene", "tile (m)", "tiles", "bytes", "to none", "to the first", "rmse (mm)", "CPU s"
    )
    for name in names:
        cloud = SCENES[name]()
        cloud = cloud.select(np.setdiff1d(np.arange(len(cloud)), sb.survey(cloud).strays))
        began = cpu_seconds()
        whole = sb.learn_patches(cloud)
        seconds = cpu_seconds() - began
        size = len(whole.to_bytes())
        row(name, "none", 1, size, (size, None), cloud, whole, seconds)
        pixel = whole.levels[-1].pixel_size
        first = None
        for tile in (4096 * pixel, 16.0, 8.0, 4.0):
            data, seconds = tiled(cloud, tile, resolution=pixel, max_memory=6 << 30)
            first = first or len(data)
            model = sb.from_bytes(data)
            side = f"{model.tile_side:.3g}"
            row(name, side, len(model.tiles), len(data), (size, first), cloud, model, seconds)


def row(
    name: str,
    tile: str,
    n: int,
    size: int,
    of: tuple[int, int | None],
    cloud: sb.PointCloud,
    model: sb.PatchModel | sb.TiledPatchModel,
    seconds: float,
) -> None:
    found = sb.evaluate(cloud, model.decode(as_measured=True), normal_neighbors=None)
    more = ["" if other is None else f"{size / other - 1:+.1%}" for other in of]
    print_row(name, tile, n, f"{size:,}", *more, f"{1e3 * found.rmse:.2f}", f"{seconds:.0f}")


class Counting(io.BytesIO):
    """Counts the bytes that are read."""

    n_read = 0

    def read(self, size: int | None = -1) -> bytes:
        data = super().read(size)
        self.n_read += len(data)
        return data

    def readinto(self, buffer: Any) -> int:
        n = super().readinto(buffer)
        self.n_read += n
        return n


Box = tuple[np.ndarray, np.ndarray]
N_BOXES = 20


def query(names: list[str]) -> None:
    """What boxes about random points read, of maps and of COPC files at the spacing that maps
    decode to: bytes, milliseconds of the process and points, on average."""
    if copc_file.writer() is None:
        print("COPC files are left out: neither pdal nor copclib is there", file=sys.stderr)
    print_header(
        "scene", "box (m)", "file", "spacing (m)", "bytes of the file", "bytes read", "ms", "points"
    )
    for name in names:
        cloud = SCENES[name]()
        cloud = cloud.select(np.setdiff1d(np.arange(len(cloud)), sb.survey(cloud).strays))
        at = np.random.default_rng(0).integers(0, len(cloud), N_BOXES)
        files: dict[str, tuple[bytes, Callable[[io.BytesIO, Box], int]]] = {}
        for tile in (8.0, 4.0):
            data, _ = tiled(cloud, tile)
            files[f"tiles of {tile:g} m"] = data, of_map
        pixel = sb.from_bytes(data).pixel_sizes[-1]
        if copc_file.writer() is not None:
            whole = copc_file.copc(cloud)
            files[f"COPC ({copc_file.writer()})"] = whole, partial(of_copc, spacing=pixel / 2)
        for side in (1.0, 4.0):
            half = np.full(3, side / 2)
            boxes = [(cloud.points[i] - half, cloud.points[i] + half) for i in at]
            for kind, (data, points_in) in files.items():
                asked(name, side, kind, pixel / 2, data, points_in, boxes)


def asked(
    name: str,
    side: float,
    kind: str,
    spacing: float,
    data: bytes,
    points_in: Callable[[io.BytesIO, Box], int],
    boxes: list[Box],
) -> None:
    """A row of what boxes read of a file."""
    sources = [Counting(data) for _ in boxes]
    points_in(Counting(data), boxes[0])
    began = time.process_time()
    n_points = sum(points_in(source, box) for source, box in zip(sources, boxes, strict=True))
    milliseconds = 1000 * (time.process_time() - began) / len(boxes)
    n_read = sum(source.n_read for source in sources) / len(boxes)
    cells = (f"{len(data):,}", f"{n_read:,.0f}", f"{milliseconds:.1f}")
    print_row(name, side, kind, f"{spacing:.3g}", *cells, f"{n_points / len(boxes):,.0f}")


def of_map(file: io.BytesIO, box: Box) -> int:
    """Points of a map in a box."""
    return len(sb.load(file, box=box).decode())


def of_copc(file: io.BytesIO, box: Box, spacing: float) -> int:
    """Points of a COPC file in a box, at a spacing."""
    from laspy.copc import Bounds, CopcReader

    return len(CopcReader(file).query(bounds=Bounds(*box), resolution=spacing))


MODES = ("stream", "memory", "tiles")


def memory(sizes: list[int], modes: list[str]) -> None:
    """Bytes, seconds and peak memory of whole processes, of a source that makes its points as they
    are read: only made, learned in memory, and in tiles with 2 GiB."""
    print_header("points", "learned", "bytes", "per point", "s", "CPU s", "peak (MB)", "tiles")
    for n_points in sizes:
        for mode in modes:
            began = time.perf_counter()
            done = subprocess.run(
                [sys.executable, __file__, "--one", mode, str(n_points)],
                capture_output=True,
                text=True,
                check=True,
            )
            seconds = time.perf_counter() - began
            n_kept, n_bytes, tiles, cpu, peak = map(int, done.stdout.split())
            per_point = f"{n_bytes / n_kept:.4f}" if n_bytes else ""
            cells = (f"{n_bytes:,}", per_point, f"{seconds:.0f}", cpu, peak, tiles)
            print_row(f"{n_kept:,}", mode, *cells)


def streamed(n_points: int) -> Iterator[sb.PointCloud]:
    """Rooms along a corridor, one after another, until there are so many points."""
    found, i = 0, 0
    while found < n_points:
        points = room_points(i % 8, 0.01)[: n_points - found]
        yield sb.PointCloud(points + np.array([7.0 * (i % 16), 6.0 * (i // 16), 0.0]))
        found += len(points)
        i += 1


def one(mode: str, n_points: int) -> None:
    """A run in a process of its own."""
    n_bytes = n_tiles = 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.sfb"
        if mode == "stream":
            n_kept = sum(map(len, streamed(n_points)))
        elif mode == "memory":
            cloud = sb.PointCloud(np.concatenate([c.local_points for c in streamed(n_points)]))
            n_kept = len(cloud)
            n_bytes = sb.learn_patches(cloud).save(path)
        else:
            report = sb.learn_patches_tiled(streamed(n_points), path, max_memory=2 << 30)
            n_kept, n_bytes, n_tiles = report.n_kept, report.n_bytes, report.n_tiles
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(n_kept, n_bytes, n_tiles, round(cpu_seconds()), peak)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--part", choices=("overhead", "query", "memory"), default="overhead")
    parser.add_argument("--scene", nargs="+", choices=SCENES, default=["hall", "building"])
    parser.add_argument("--points", type=float, nargs="+", default=[1e6, 10e6])
    parser.add_argument(
        "--plan-by-all", action="store_true", help="what tiles share follows from all points"
    )
    parser.add_argument("--learned", nargs="+", choices=MODES, default=list(MODES))
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one(options.one[0], int(options.one[1]))
        return
    if options.part == "memory":
        memory([int(n) for n in options.points], options.learned)
        return
    check_data()
    if options.plan_by_all:
        tiling._SAMPLE_POINTS = 1 << 40
    {"overhead": overhead, "query": query}[options.part](options.scene)


if __name__ == "__main__":
    main()
