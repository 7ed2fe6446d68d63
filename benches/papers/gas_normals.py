"""Normals from raw, voxel-grid and GNG clouds of a noisy simulated room, at fixed places of it.

    python benches/papers/gas_normals.py [--noise 0.005 0.01 0.02] [--counts 5000 10000 20000]
        [--rooms 1 2]

The room is seen by a simulated depth camera with exact depths; Gaussian noise of the standard
deviation given is added to every point along all axes. Scored are the same points of the true
surface for all clouds, drawn evenly by area (one of the exact points per cell of 2 cm, then at
random). At each the normal is that of the plane through all points of a cloud within one radius,
the same for raw, voxel grid and neurons: the median distance to the twelfth nearest of the voxel
grid's means. Where fewer than three are within it, the three nearest are taken. Last, the normal
that the model stores with the nearest neuron. The error is the angle between both lines in degrees:
mean, and share above 15 degrees. Prints a Markdown table.
"""

from __future__ import annotations

import argparse

import numpy as np

import surfabet as sb
from surfabet import datasets

NEIGHBORS = 12
LARGE = 15.0
POINTS = 400_000
SAMPLES = 5000
CELL = 0.02


def told(normals: np.ndarray, truth: np.ndarray) -> str:
    cosines = np.abs(np.einsum("ij,ij->i", normals, truth))
    degrees = np.degrees(np.arccos(np.clip(cosines, 0, 1)))
    return f"{degrees.mean():.2f} / {100 * (degrees > LARGE).mean():.1f} %"


def planes(points: np.ndarray, places: np.ndarray, radius: float) -> np.ndarray:
    """Normal of the plane through the points within the radius of each place."""
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    normals = np.empty_like(places)
    for i, (place, near) in enumerate(
        zip(places, tree.query_ball_point(places, radius), strict=True)
    ):
        chosen = near if len(near) >= 3 else tree.query(place, 3)[1]
        around = points[chosen] - points[chosen].mean(axis=0)
        normals[i] = np.linalg.eigh(around.T @ around)[1][:, 0]
    return normals


def fixed_samples(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Numbers of exact points, evenly spread over the surface."""
    cells = np.floor(points / CELL).astype(np.int64)
    order = rng.permutation(len(points))
    _, first = np.unique(cells[order], axis=0, return_index=True)
    return rng.permutation(order[first])[:SAMPLES]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.005, 0.01, 0.02])
    parser.add_argument("--counts", type=int, nargs="+", default=[5000, 10_000, 20_000])
    parser.add_argument("--rooms", type=int, nargs="+", default=[1, 2])
    options = parser.parse_args()
    print(f"{POINTS:,} points; mean error in degrees / share above {LARGE:g} degrees\n")
    print("| room | noise mm | points | radius mm | raw | voxel grid | GNG | GNG, stored |")
    print("|---|---|---|---|---|---|---|---|")
    for seed in options.rooms:
        scan = datasets.scan_rgbd(datasets.make_room(seed=seed), depth_noise=0.0, n_frames=12)
        rng = np.random.default_rng(seed)
        chosen = rng.choice(len(scan.cloud), POINTS, replace=False)
        exact = scan.ground_truth.points[chosen].astype(np.float64)
        samples = fixed_samples(exact, rng)
        places = exact[samples]
        truth = scan.ground_truth.normals[chosen][samples]
        for noise in options.noise:
            points = exact + noise * rng.standard_normal(exact.shape)
            cloud = sb.PointCloud(points)
            for count in options.counts:
                voxels = sb.voxel_downsample(cloud, count=count).points
                tree = sb.KdTree(voxels.astype(np.float32))
                far = tree.query(places.astype(np.float32), NEIGHBORS)[0][:, -1]
                radius = float(np.median(far))
                neurons = sb.learn_gas(cloud, n_neurons=count).neurons
                cells = [
                    told(planes(p, places, radius), truth)
                    for p in (points, voxels, neurons.positions)
                ]
                nearest = sb.KdTree(neurons.positions.astype(np.float32)).query(
                    places.astype(np.float32)
                )[1]
                cells.append(told(neurons.normals[nearest.ravel()], truth))
                first = f"| {seed} | {1e3 * noise:g} | {count:,} | {1e3 * radius:.0f} | "
                print(first + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
