"""Maps in tiles: what tiles cost, colours at their borders, levels of detail, what a part of a map
reads, and memory.

    python benches/papers/tiles.py [--part overhead|borders|details|query|memory] [--points 1e6]

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
from scipy.spatial import cKDTree
from sessions import frames, joined

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


def memory(sizes: list[int], modes: list[str]) -> None:
    """Bytes, seconds and peak memory of whole processes: of a source that makes its points as they
    are read, only made, learned in memory, and in tiles with 2 GiB; of a file, in tiles. Files are
    written before, and not counted."""
    print_header("points", "learned", "bytes", "per point", "s", "CPU s", "peak (MB)", "tiles")
    for n_points in sizes:
        for mode in modes:
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / f"points.{mode}"
                if mode in WRITERS:
                    WRITERS[mode](file, n_points)
                began = time.perf_counter()
                done = subprocess.run(
                    [sys.executable, __file__, "--one", mode, str(n_points), str(file)],
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


def write_las(file: Path, n_points: int) -> None:
    """The streamed points as a LAS file of 0.1 mm."""
    import laspy

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, 1e-4)
    with laspy.open(file, mode="w", header=header) as writer:
        for cloud in streamed(n_points):
            record = laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header)
            record.x, record.y, record.z = cloud.points.T
            writer.write_points(record)


def write_ply(file: Path, n_points: int) -> None:
    """The streamed points as a binary PLY file of single precision."""
    with file.open("wb") as out:
        head = ["ply", "format binary_little_endian 1.0", f"element vertex {n_points}"]
        out.write(
            "\n".join([*head, *(f"property float {a}" for a in "xyz"), "end_header\n"]).encode()
        )
        for cloud in streamed(n_points):
            out.write(np.asarray(cloud.points, dtype="<f4").tobytes())


WRITERS = {"las": write_las, "ply": write_ply}
MODES = ("stream", "memory", "tiles", *WRITERS)


def one(mode: str, n_points: int, file: Path) -> None:
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
            source = file if mode in WRITERS else streamed(n_points)
            report = sb.learn_patches_tiled(source, path, max_memory=2 << 30)
            n_kept, n_bytes, n_tiles = report.n_kept, report.n_bytes, report.n_tiles
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(n_kept, n_bytes, n_tiles, round(cpu_seconds()), peak)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parts = ("overhead", "borders", "details", "query", "memory")
    parser.add_argument("--part", choices=parts, default="overhead")
    parser.add_argument("--tile", nargs="+", type=float, default=[4.0], help="sides for borders")
    parser.add_argument("--scene", nargs="+", choices=SCENES, default=["hall", "building"])
    parser.add_argument("--points", type=float, nargs="+", default=[1e6, 10e6])
    parser.add_argument(
        "--plan-by-all", action="store_true", help="what tiles share follows from all points"
    )
    parser.add_argument("--learned", nargs="+", choices=MODES, default=MODES[:3])
    parser.add_argument("--one", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one(options.one[0], int(options.one[1]), Path(options.one[2]))
        return
    if options.part == "memory":
        memory([int(n) for n in options.points], options.learned)
        return
    check_data()
    if options.plan_by_all:
        tiling._SAMPLE_POINTS = 1 << 40
    if options.part == "borders":
        borders(options.scene, tuple(options.tile))
        return
    {"overhead": overhead, "details": details, "query": query}[options.part](options.scene)


if __name__ == "__main__":
    main()
