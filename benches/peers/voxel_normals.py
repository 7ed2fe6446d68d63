"""Voxel means and normals: surfabet beside Open3D.

    python benches/peers/voxel_normals.py [cloud file] [--threads 2] [--rounds 5] [--voxel 0.02]

Both run in turn, in one process, with the same number of threads. A ratio is Open3D's time divided
by surfabet's of the same round: above 1 surfabet is faster. Clouds are as in neighbours.py.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cloud", nargs="?", type=Path)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--voxel", type=float, default=0.02, help="edge length in metres")
    parser.add_argument("--neighbors", type=int, default=16)
    return parser.parse_args()


OPTIONS = parse()
# Read by Open3D's OpenMP when it is loaded.
os.environ["OMP_NUM_THREADS"] = str(OPTIONS.threads)

from peer_bench import compare, load, million_points  # noqa: E402

import surfabet as sb  # noqa: E402


def main() -> None:
    sb.set_num_threads(OPTIONS.threads)
    points = million_points(OPTIONS.cloud)
    cloud = sb.PointCloud(points)
    voxel, neighbors = OPTIONS.voxel, OPTIONS.neighbors
    down = {"surfabet": lambda: sb.voxel_downsample(cloud, voxel)}
    normals = {"surfabet": lambda: sb.estimate_normals(cloud, neighbors=neighbors)}
    if open3d := load("open3d"):
        peer = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(float)))
        search = open3d.geometry.KDTreeSearchParamKNN(neighbors)

        def estimate() -> None:
            # Normals that are there already would be used as a start.
            peer.normals = open3d.utility.Vector3dVector()
            peer.estimate_normals(search)

        down["Open3D"] = lambda: peer.voxel_down_sample(voxel)
        normals["Open3D"] = estimate
    compare(f"voxel means, {voxel} m", down, OPTIONS.rounds)
    compare(f"normals, {neighbors} neighbours", normals, OPTIONS.rounds)


if __name__ == "__main__":
    main()
