"""How near a gas comes to k-means, which seeks the least error and nothing else.

    python benches/papers/gas_limit.py [--clouds table objects ...] [--counts 1000 5000 20000]
        [--restarts 5 3 2]

At equal counts: the gas, default and published, and Lloyd's algorithm over all points from several
starts by k-means++ (scikit-learn's, greedy, on a sample of 40 points per centre), each until the
squared error falls by less than 1e-4 of itself or for 100 rounds. Of the starts the least counts,
by mean and by root mean square each. Errors are in millimetres, over the points learned from and
over the other half. Nearest centres come from SciPy's tree, so that nothing of surfabet is in the
bound. Prints a Markdown table with the CPU seconds of each.
"""

from __future__ import annotations

import argparse

import numpy as np
from gas_held_out import CLOUDS, halves
from gas_scans import cpu_seconds
from scipy.spatial import cKDTree
from sklearn.cluster import kmeans_plusplus

import surfabet as sb

ROUNDS = 100
TOLERANCE = 1e-4
POINTS_PER_CENTER = 40


def errors(points: np.ndarray, centers: np.ndarray) -> np.ndarray:
    distances = 1e3 * cKDTree(centers).query(points)[0]
    return np.array([distances.mean(), np.sqrt((distances**2).mean())])


def lloyd(points: np.ndarray, n: int, seed: int) -> np.ndarray:
    """Centres of k-means from a start of its own."""
    rng = np.random.default_rng(seed)
    sample = points[rng.permutation(len(points))[: POINTS_PER_CENTER * n]]
    centers, _ = kmeans_plusplus(sample.astype(np.float32), n, random_state=seed)
    centers = centers.astype(np.float64)
    before = np.inf
    for _ in range(ROUNDS):
        distances, nearest = cKDTree(centers).query(points)
        counts = np.bincount(nearest, minlength=n)
        filled = counts > 0
        sums = np.stack([np.bincount(nearest, points[:, a], n) for a in range(3)], axis=1)
        centers[filled] = sums[filled] / counts[filled, None]
        error = float((distances**2).sum())
        if before - error < TOLERANCE * before:
            break
        before = error
    return centers


def row(
    first: str, both: tuple[sb.PointCloud, sb.PointCloud], found: list[np.ndarray], began: float
) -> np.ndarray:
    """Prints the least errors of some sets of centres over both halves, and gives them."""
    used = cpu_seconds() - began
    scores = [[errors(half.points, centers) for half in both] for centers in found]
    least = np.min(np.array(scores), axis=0).ravel()
    cells = " | ".join(f"{error:.3f}" for error in least)
    print(f"{first} | {cells} | {used:.1f} |", flush=True)
    return least


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--clouds", nargs="+", default=["table", "objects", "fragment 0"])
    parser.add_argument("--counts", type=int, nargs="+", default=[1000, 5000, 20_000])
    parser.add_argument("--restarts", type=int, nargs="+", default=[5, 3, 2])
    options = parser.parse_args()
    sb.set_num_threads(1)
    print("| cloud | count | method | mean | rms | mean, other half | rms, other half | CPU s |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for name in options.clouds:
        both = halves(CLOUDS[name](), 0)
        one = both[0]
        for count, restarts in zip(options.counts, options.restarts, strict=True):
            if count > len(one) // 5:
                continue
            first = f"| {name} | {count:,}"
            began = cpu_seconds()
            starts = [lloyd(one.points, count, seed) for seed in range(restarts)]
            bound = row(f"{first} | k-means, least of {restarts} starts", both, starts, began)
            for method, published in (("gas", False), ("gas, published", True)):
                began = cpu_seconds()
                model = sb.learn_gas(one, n_neurons=count, published=published)
                found = row(f"{first} | {method}", both, [model.neurons.positions], began)
                ratios = " | ".join(f"{ratio:.3f}" for ratio in found / bound)
                print(f"{first} | {method} / k-means | {ratios} | |", flush=True)


if __name__ == "__main__":
    main()
