"""Nearest neighbours of a cloud in itself: surfabet beside pykdtree, small_gicp and scipy.

    python benches/peers/neighbours.py [cloud file] [--threads 2] [--rounds 5]

Peers and surfabet run in turn, in one process, with the same number of threads. A ratio is the
peer's time divided by surfabet's of the same round: above 1 surfabet is faster. Builds are timed
apart from queries. Without a file, the fused room of ../shared/data/rgbd_room is used where it is,
thinned to 1 cm, else a generated room.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cloud", nargs="?", type=Path)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=5)
    return parser.parse_args()


OPTIONS = parse()
# Read by pykdtree's OpenMP when it is loaded.
os.environ["OMP_NUM_THREADS"] = str(OPTIONS.threads)

import numpy as np  # noqa: E402
from peer_bench import compare, load, million_points  # noqa: E402

import surfabet as sb  # noqa: E402


def contestants() -> dict[str, tuple[Callable[[], object], Callable[[object, int], object]]]:
    points = million_points(OPTIONS.cloud)
    double = points.astype(np.float64)
    threads = OPTIONS.threads
    found = {
        "surfabet": (lambda: sb.KdTree(points), lambda tree, k: tree.query(points, k)),
    }
    if pykdtree := load("pykdtree.kdtree"):
        found["pykdtree"] = (
            lambda: pykdtree.KDTree(points),
            lambda tree, k: tree.query(points, k),
        )
    if gicp := load("small_gicp"):
        found["small_gicp"] = (
            lambda: gicp.KdTree(double, num_threads=threads),
            lambda tree, k: (
                tree.batch_nearest_neighbor_search(double, num_threads=threads)
                if k == 1
                else tree.batch_knn_search(double, k, num_threads=threads)
            ),
        )
    if scipy := load("scipy.spatial"):
        found["scipy"] = (
            lambda: scipy.cKDTree(double),
            lambda tree, k: tree.query(double, k, workers=threads),
        )
    return found


def main() -> None:
    sb.set_num_threads(OPTIONS.threads)
    entries = contestants()
    trees = {name: build() for name, (build, _) in entries.items()}
    compare("build", {name: build for name, (build, _) in entries.items()}, OPTIONS.rounds)
    for k in (1, 16):
        jobs = {
            name: (lambda query=query, name=name, k=k: query(trees[name], k))
            for name, (_, query) in entries.items()
        }
        compare(f"{k}-NN", jobs, OPTIONS.rounds)


if __name__ == "__main__":
    main()
