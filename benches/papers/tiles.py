"""Maps in tiles: what tiles cost, colours at their borders, levels of detail, what a part of a map
reads, and memory.

    python benches/papers/tiles.py [--part overhead|borders|details|query|memory] [--points 10e6]

The hall is the drive of `multi_scan`, 42 scans by their poses. The building has 20 simulated rooms
beside one another. For colours there are simulated rooms, each scanned from four places by a laser
with colours, and the 50 frames of the kitchen, every third pixel.
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
from scipy.spatial import cKDTree
from sessions import frames, joined

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


def scanned(seeds: tuple[int, ...]) -> sb.PointCloud:
    """Rooms beside one another as a laser with colours scans them."""
    points, colors = [], []
    for i, seed in enumerate(seeds):
        cloud = datasets.simulated_room(sensor="lidar", seed=seed).cloud
        points.append(cloud.points + np.array([7.0 * i, 0.0, 0.0]))
        colors.append(cloud.colors)
    return sb.PointCloud(np.concatenate(points), colors=np.concatenate(colors))


SCENES = {
    "hall": hall,
    "building": building,
    "kitchen": room,
    "rooms 0, 1": lambda: scanned((0, 1)),
    "rooms 2, 3": lambda: scanned((2, 3)),
    "rooms 2 to 5": lambda: scanned((2, 3, 4, 5)),
    "kitchen, thinned": lambda: joined(frames()),
}


def tiled(cloud: sb.PointCloud, tile: float | None, **options: object) -> tuple[bytes, float]:
    """The file of a map in tiles, and the CPU seconds."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.sfb"
        began = cpu_seconds()
        sb.learn_patches_tiled(cloud, path, tile=tile, note=" ", **options)
        return path.read_bytes(), cpu_seconds() - began


def overhead(names: list[str]) -> None:
    """Bytes and error by the side of a tile, beside the map without tiles."""
    print_header("scene", "tile (m)", "tiles", "bytes", "more", "rmse (mm)", "colour", "CPU s")
    for name in names:
        cloud = SCENES[name]()
        began = cpu_seconds()
        whole = sb.learn_patches(cloud)
        seconds = cpu_seconds() - began
        size = len(whole.to_bytes())
        row(name, "none", 1, size, size, cloud, whole, seconds)
        pixel = whole.levels[-1].pixel_size
        for tile in (None, 16.0, 8.0, 4.0):
            data, seconds = tiled(cloud, tile, resolution=pixel)
            model = sb.from_bytes(data)
            side = f"{model.tile_side:.3g}" + ("" if tile else " (default)")
            row(name, side, len(model.tiles), len(data), size, cloud, model, seconds)


def row(
    name: str,
    tile: str,
    n: int,
    size: int,
    of: int,
    cloud: sb.PointCloud,
    model: sb.PatchModel | sb.TiledPatchModel,
    seconds: float,
) -> None:
    found = sb.evaluate(cloud, model.decode(as_measured=True), normal_neighbors=None)
    color = "" if found.color_rmse_pooled is None else f"{found.color_rmse_pooled:.2f}"
    more = f"{size / of - 1:+.1%}"
    print_row(name, tile, n, f"{size:,}", more, f"{1e3 * found.rmse:.2f}", color, f"{seconds:.0f}")


def borders(names: list[str], sides: tuple[float, ...]) -> None:
    """How far colours differ between points and those half a pixel further, across borders of tiles
    and inside; grey levels, means over the channels."""
    print_header(
        "scene", "tile (m)", "pixel (m)", "tiles", "bytes", "colour", "pairs", "across", "inside"
    )
    for name in names:
        cloud = SCENES[name]()
        for tile in sides:
            data, _ = tiled(cloud, tile)
            model = sb.from_bytes(data)
            found = sb.evaluate(cloud, model.decode(as_measured=True), normal_neighbors=None)
            across, inside = color_steps(model)
            print_row(
                name,
                f"{model.tile_side:.3g}",
                f"{model.pixel_sizes[-1]:.3g}",
                len(model.tiles),
                f"{len(data):,}",
                f"{found.color_rmse_pooled:.2f}",
                len(across),
                f"{across.mean():.2f}",
                f"{inside.mean():.2f}",
            )


def color_steps(model: sb.TiledPatchModel, n_inside: int = 200_000) -> tuple[np.ndarray, ...]:
    """Differences of colour across borders, and of pairs of `n_inside` points per axis inside."""
    pixel = model.pixel_sizes[-1]
    cloud = model.decode(resolution=0.5 * pixel)
    local = (cloud.points - model.origin) @ model.rotation / pixel
    side = model.tile_side / pixel
    from_corner = local - model.tile_corner / pixel
    cubes = np.floor(from_corner / side)
    tree, colors = cKDTree(local), cloud.colors.astype(float)
    some = np.random.default_rng(0).permutation(len(local))[:n_inside]
    found: dict[bool, list[np.ndarray]] = {True: [], False: []}
    for axis in range(3):
        before_border = np.flatnonzero(from_corner[:, axis] % side > side - 0.6)
        for is_across, chosen in ((True, before_border), (False, some)):
            distance, nearest = tree.query(local[chosen] + 0.5 * np.eye(3)[axis])
            first, second = chosen[distance < 0.2], nearest[distance < 0.2]
            crosses = cubes[first, axis] != cubes[second, axis]
            kept = crosses if is_across else (cubes[first] == cubes[second]).all(axis=1)
            off = np.abs(colors[first[kept]] - colors[second[kept]])
            found[is_across].append(off.mean(axis=1))
    return np.concatenate(found[True]), np.concatenate(found[False])


def details(names: list[str]) -> None:
    """Bytes and error of each level of detail, of maps with two and three."""
    print_header("scene", "levels", "level", "pixel (m)", "bytes", "share", "rmse (mm)", "colour")
    for name in names:
        cloud = SCENES[name]()
        for n in (2, 3):
            data, _ = tiled(cloud, None, details=n)
            for level in range(n):
                model = sb.load(io.BytesIO(data), level=level)
                found = sb.evaluate(cloud, model.decode(), normal_neighbors=None)
                color = found.color_rmse_pooled
                size = int(model.tiles.bytes.sum())
                print_row(
                    name,
                    n,
                    level,
                    f"{model.pixel_sizes[level]:.3g}",
                    f"{size:,}",
                    f"{size / len(data):.1%}",
                    f"{1e3 * found.rmse:.2f}",
                    "" if color is None else f"{color:.2f}",
                )


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
    parts = ("overhead", "borders", "details", "query", "memory")
    parser.add_argument("--part", choices=parts, default="overhead")
    parser.add_argument("--tile", nargs="+", type=float, default=[4.0], help="sides for borders")
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
    if options.part == "borders":
        borders(options.scene, tuple(options.tile))
        return
    {"overhead": overhead, "details": details, "query": query}[options.part](options.scene)


if __name__ == "__main__":
    main()
