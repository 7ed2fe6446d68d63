"""Normals of raw, voxel-grid and GNG clouds of a noisy simulated room, against the true ones.

    python benches/papers/gas_normals.py [--noise 0 0.005 0.01 0.02] [--counts 5000 10000 20000]

The room is seen by a simulated depth camera with exact depths; Gaussian noise of the standard
deviation given is added to every point along all axes. Normals are fitted to the 12 nearest points
(`estimate_normals`) of the noisy cloud, of the voxel grid's means and of the neurons, all of one
number; the neurons' own normals, which the model stores, stand beside them. The true normal is that
of the nearest true surface point, the error the angle between both lines, in degrees: mean and
share above 15 degrees. Prints a Markdown table.
"""

from __future__ import annotations

import argparse

import numpy as np

import surfabet as sb
from surfabet import datasets

NEIGHBORS = 12
LARGE = 15.0
POINTS = 400_000


def errors(points: np.ndarray, normals: np.ndarray, tree: sb.KdTree, truth: np.ndarray) -> str:
    known = np.linalg.norm(normals, axis=1) > 0.5
    _, nearest = tree.query(points[known].astype(np.float32))
    cosines = np.abs(np.einsum("ij,ij->i", normals[known], truth[nearest.ravel()]))
    degrees = np.degrees(np.arccos(np.clip(cosines, 0, 1)))
    return f"{degrees.mean():.2f} / {100 * (degrees > LARGE).mean():.1f} %"


def estimated(points: np.ndarray, tree: sb.KdTree, truth: np.ndarray) -> str:
    cloud = sb.estimate_normals(sb.PointCloud(points), neighbors=NEIGHBORS).cloud
    assert cloud.normals is not None
    return errors(points, cloud.normals, tree, truth)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.005, 0.01, 0.02])
    parser.add_argument("--counts", type=int, nargs="+", default=[5000, 10_000, 20_000])
    options = parser.parse_args()
    scan = datasets.scan_rgbd(datasets.make_room(seed=1), depth_noise=0.0, n_frames=12)
    rng = np.random.default_rng(0)
    chosen = rng.choice(len(scan.cloud), POINTS, replace=False)
    exact = scan.ground_truth.points[chosen].astype(np.float64)
    truth = scan.ground_truth.normals[chosen]
    tree = sb.KdTree(exact.astype(np.float32))
    print(f"{POINTS:,} points; mean error in degrees / share above {LARGE:g} degrees\n")
    print("| noise mm | points | raw | voxel grid | GNG | GNG, stored |")
    print("|---|---|---|---|---|---|")
    for noise in options.noise:
        points = exact + noise * rng.standard_normal(exact.shape)
        cloud = sb.PointCloud(points)
        raw = estimated(points, tree, truth)
        for count in options.counts:
            voxels = sb.voxel_downsample(cloud, count=count).points
            neurons = sb.learn_gas(cloud, n_neurons=count).neurons
            stored = errors(neurons.positions, neurons.normals, tree, truth)
            grid, gas = (estimated(p, tree, truth) for p in (voxels, neurons.positions))
            print(
                f"| {1e3 * noise:g} | {count:,} | {raw} | {grid} | {gas} | {stored} |", flush=True
            )


if __name__ == "__main__":
    main()
