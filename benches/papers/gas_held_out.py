"""Mean error on points that were not learned from, of gas, voxel grid and random points.

    python benches/papers/gas_held_out.py [--clouds NAME ...] [--counts 1000 5000 20000] [--seeds 2]

Each cloud is parted at random into halves: representatives come from one, errors are those of the
other, mean distance to the nearest representative (the paper's ME) and root mean square, in
millimetres. Columns: the default gas, the gas as published, the voxel grid's means, as many random
points. Clouds: scans of several kinds, fused fragments (averaged in cells, smooth and of even
density) and simulated rooms. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from gas_scans import DATA, scan

import surfabet as sb
from surfabet import datasets

MOST_POINTS = 1_000_000
"""Larger clouds are thinned to this number at random."""


def fragment(first: int) -> sb.PointCloud:
    """Five frames of the kitchen fused and averaged in cells of 1 cm, as fragments are."""
    parts = [room_frame(first + 20 * i) for i in range(5)]
    return sb.voxel_downsample(sb.PointCloud(np.concatenate(parts)), 0.01)


def room_frame(number: int) -> np.ndarray:
    from PIL import Image

    folder = DATA / "rgbd_room"
    pose = np.loadtxt(folder / f"frame-{number:06d}.pose.txt")
    fx, _, cx, _, fy, cy = np.loadtxt(folder / "camera-intrinsics.txt").ravel()[:6]
    depth = np.asarray(Image.open(folder / f"frame-{number:06d}.depth.png"), float) / 1000
    v, u = np.nonzero((depth > 0.3) & (depth < 4))
    z = depth[v, u]
    points = np.stack([(u - cx) * z / fx, (v - cy) * z / fy, z], axis=1)
    return points @ pose[:3, :3].T + pose[:3, 3]


def simulated(seed: int) -> sb.PointCloud:
    return datasets.scan_rgbd(datasets.make_room(seed=seed), n_frames=12).cloud


CLOUDS: dict[str, Callable[[], sb.PointCloud]] = {
    "table": lambda: scan("table"),
    "pump": lambda: scan("pump"),
    "kitchen": lambda: scan("kitchen"),
    "objects": lambda: sb.read(DATA / "rgbd_frame" / "objects.pcd"),
    "hall": lambda: scan("hall"),
    "hall, 60": lambda: sb.read(DATA / "multi_scan" / "full60.pcd"),
    "street": lambda: scan("street"),
    "room": lambda: sb.read(DATA / "indoor_scan" / "room_scan1.pcd"),
    "terrain": lambda: sb.read(DATA / "georeferenced" / "autzen_trim.laz"),
    "fragment 0": lambda: fragment(0),
    "fragment 400": lambda: fragment(400),
    "simulated room": lambda: simulated(3),
}
"""The first three are those of the other tables."""

METHODS: dict[str, Callable[[sb.PointCloud, int], np.ndarray]] = {
    "gas": lambda cloud, n: sb.learn_gas(cloud, n_neurons=n).neurons.positions,
    "gas, published": lambda cloud, n: (
        sb.learn_gas(cloud, n_neurons=n, published=True).neurons.positions
    ),
    "voxel grid": lambda cloud, n: sb.voxel_downsample(cloud, count=n).points,
    "random": lambda cloud, n: sb.random_downsample(cloud, n).points,
}


def halves(cloud: sb.PointCloud, seed: int) -> tuple[sb.PointCloud, sb.PointCloud]:
    """The cloud without attributes, parted at random."""
    points = cloud.points - cloud.points.mean(axis=0)
    order = np.random.default_rng(seed).permutation(len(points))[:MOST_POINTS]
    half = len(order) // 2
    return sb.PointCloud(points[order[:half]]), sb.PointCloud(points[order[half:]])


def errors(cloud: sb.PointCloud, representatives: np.ndarray) -> np.ndarray:
    """Mean and root mean squared distance to the nearest representative, millimetres."""
    local = representatives - np.asarray(cloud.origin)
    distances = sb.KdTree(np.asarray(local, np.float32)).query(cloud.local_points)[0]
    distances = 1e3 * np.asarray(distances, np.float64)
    return np.array([distances.mean(), np.sqrt((distances**2).mean())])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--clouds", nargs="+", default=list(CLOUDS))
    parser.add_argument("--counts", type=int, nargs="+", default=[1000, 5000, 20_000])
    parser.add_argument("--seeds", type=int, default=1)
    options = parser.parse_args()
    print("Mean error / root mean square in mm, on the other half of the points\n")
    titles = ["cloud", "points learned from", "representatives", *METHODS]
    print("| " + " | ".join([*titles, "gas / voxel grid"]) + " |")
    print("|" + "---|" * (len(titles) + 1), flush=True)
    for name in options.clouds:
        cloud = CLOUDS[name]()
        for count in options.counts:
            if count > min(len(cloud), MOST_POINTS) // 10:
                # Fewer than five points of a half for each.
                continue
            found = {method: np.zeros(2) for method in METHODS}
            learned = 0
            for seed in range(options.seeds):
                one, other = halves(cloud, seed)
                learned = len(one)
                for method, reduce in METHODS.items():
                    found[method] += errors(other, reduce(one, count)) / options.seeds
            cells = [f"{mean:.2f} / {rms:.2f}" for mean, rms in found.values()]
            ratio = found["gas"] / found["voxel grid"]
            first = f"| {name} | {learned:,} | {count:,} | "
            print(first + " | ".join(cells) + f" | {ratio[0]:.3f} |", flush=True)


if __name__ == "__main__":
    main()
