"""Maps in tiles: what tiles cost, what a part of a map reads, and memory.

    python benches/papers/tiles.py [--part overhead|query|memory] [--points 10e6]

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
from collections.abc import Iterator
from pathlib import Path

import locate
import numpy as np
from gas_scans import cpu_seconds
from paper_bench import check_data, print_header, print_row, room

import surfabet as sb
from surfabet import datasets

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
    """Bytes and error by the side of a tile, beside the map without tiles and beside one tile with
    what all tiles share."""
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


def query(names: list[str]) -> None:
    """Bytes that boxes about random points read, against those of the tiles that meet them."""
    print_header(
        "scene", "tile (m)", "box (m)", "bytes of the file", "read", "of the tiles", "points"
    )
    for name in names:
        cloud = SCENES[name]()
        for tile in (8.0, 4.0):
            data, _ = tiled(cloud, tile)
            model = sb.from_bytes(data)
            rng = np.random.default_rng(0)
            for side in (1.0, 4.0):
                read, needed, points = 0, 0, 0
                for at in rng.integers(0, len(cloud), 20):
                    middle = cloud.points[at]
                    box = (middle - side / 2, middle + side / 2)
                    file = Counting(data)
                    part = sb.load(file, box=box)
                    read += file.n_read
                    needed += int(part.tiles.bytes.sum())
                    points += len(part.decode())
                cells = (f"{len(data):,}", f"{read / 20:,.0f}", f"{read / needed:.2f}")
                print_row(name, f"{model.tile_side:.3g}", side, *cells, f"{points / 20:,.0f}")


def memory(n_points: int) -> None:
    """Peak memory and CPU seconds of a source that makes its points as they are read."""
    print_header("points", "max_memory (MB)", "peak (MB)", "bytes", "tiles", "CPU s")
    for limit in (1 << 30, 2 << 30):
        done = subprocess.run(
            [sys.executable, __file__, "--one", str(n_points), str(limit)],
            capture_output=True,
            text=True,
            check=True,
        )
        print_row(*done.stdout.split())


def streamed(n_points: int) -> Iterator[sb.PointCloud]:
    """Rooms along a corridor, one after another, until there are so many points."""
    found, i = 0, 0
    while found < n_points:
        points = room_points(i % 8, 0.01)[: n_points - found]
        yield sb.PointCloud(points + np.array([7.0 * (i % 16), 6.0 * (i // 16), 0.0]))
        found += len(points)
        i += 1


def one(n_points: int, limit: int) -> None:
    """A run in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.sfb"
        report = sb.learn_patches_tiled(streamed(n_points), path, max_memory=limit)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    numbers = (f"{report.n_kept:,}", limit >> 20, peak, f"{report.n_bytes:,}", report.n_tiles)
    print(*numbers, f"{cpu_seconds():.0f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--part", choices=("overhead", "query", "memory"), default="overhead")
    parser.add_argument("--scene", nargs="+", choices=SCENES, default=["hall", "building"])
    parser.add_argument("--points", type=float, default=10e6)
    parser.add_argument("--one", nargs=2, type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one(*options.one)
        return
    if options.part == "memory":
        memory(int(options.points))
        return
    check_data()
    {"overhead": overhead, "query": query}[options.part](options.scene)


if __name__ == "__main__":
    main()
