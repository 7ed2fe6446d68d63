"""Four walls under noise: the paper's experiment I.

    python benches/papers/planes_walls.py [--noise 1 2 ... 25] [--seeds 20] [--out FOLDER]

7000 points on four walls of height 300: two of length 450 and, between them, a corner of two of
length 150. Every point is moved by Gaussian noise of the standard deviation given along each axis.
`learn_planes` starts from 3 random patches, other ones with every seed, and keeps patches whatever
they look like (`min_purity=0, min_fill=0, max_bend=inf`): there is nothing but walls here.

A result counts as found if there are exactly four patches, one nearest to the middle of each wall.
Its error is the sum of the four angles between normals of patches and walls, in degrees. Beside it:
the least-squares planes of the points of each wall, which nobody can do better than, and classical
EM (`fit_planes_em`) from the planes of the same 3 patches, each wall with the plane that most of
its points belong to.
Prints a Markdown table of medians over the seeds, and with `--out` draws the plot.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from paper_bench import print_header, print_row

import surfabet as sb

HEIGHT = 300.0
WALLS = [
    (np.array([0.0, 150.0]), np.array([0.0, 1.0]), 450.0),
    (np.array([0.0, 150.0]), np.array([1.0, 0.0]), 150.0),
    (np.array([150.0, 0.0]), np.array([0.0, 1.0]), 150.0),
    (np.array([150.0, 0.0]), np.array([1.0, 0.0]), 450.0),
]
NORMALS = np.array([[along[1], along[0], 0.0] for _, along, _ in WALLS])
MIDDLES = np.array([[*(start + 0.5 * n * along), 0.5 * HEIGHT] for start, along, n in WALLS])
POINTS = 7000


def walls(noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Noisy points (n, 3) and the wall that each is on."""
    rng = np.random.default_rng(seed)
    lengths = np.array([n for _, _, n in WALLS])
    wall = rng.choice(4, POINTS, p=lengths / lengths.sum())
    along = rng.random(POINTS) * lengths[wall]
    starts = np.array([start for start, _, _ in WALLS])
    directions = np.array([direction for _, direction, _ in WALLS])
    flat = starts[wall] + along[:, None] * directions[wall]
    points = np.column_stack([flat, HEIGHT * rng.random(POINTS)])
    return points + noise * rng.standard_normal(points.shape), wall


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(min(abs(float(a @ b)), 1.0))))


def least_squares(points: np.ndarray, wall: np.ndarray) -> float:
    total = 0.0
    for k in range(4):
        own = points[wall == k]
        _, axes = np.linalg.eigh(np.cov(own.T))
        total += angle(axes[:, 0], NORMALS[k])
    return total


def split_and_merge(points: np.ndarray, seed: int) -> tuple[int, float | None]:
    """Number of patches, and the sum of angular errors if these are the four walls."""
    model = sb.learn_planes(
        sb.PointCloud(points),
        initial_patches=3,
        min_purity=0.0,
        min_fill=0.0,
        max_bend=float("inf"),
        random_state=seed,
    )
    planes = model.planes
    if len(planes) != 4:
        return len(planes), None
    nearest = np.linalg.norm(planes.centers[:, None] - MIDDLES, axis=2).argmin(axis=1)
    if len(set(nearest)) != 4:
        return 4, None
    return 4, sum(angle(n, NORMALS[k]) for n, k in zip(planes.normals, nearest, strict=True))


def classical(points: np.ndarray, wall: np.ndarray, seed: int) -> float:
    cloud = sb.PointCloud(points)
    fitted = sb.fit_planes_em(cloud, *sb.random_planes(cloud, 3, random_state=seed))
    most = [np.bincount(fitted.labels[wall == k], minlength=3).argmax() for k in range(4)]
    return sum(angle(fitted.normals[m], NORMALS[k]) for k, m in enumerate(most))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--noise", type=float, nargs="+", default=list(range(1, 26)))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--out", type=Path, help="folder of the plot")
    options = parser.parse_args()
    print_header(
        "noise", "four walls found", "patches", "sum of errors", "least squares", "ratio", "EM"
    )
    rows = []
    for noise in options.noise:
        counts, sums, limits, plain = [], [], [], []
        for seed in range(options.seeds):
            points, wall = walls(noise, seed)
            count, error = split_and_merge(points, seed)
            counts.append(count)
            if error is not None:
                sums.append(error)
            limits.append(least_squares(points, wall))
            plain.append(classical(points, wall, seed))
        found = np.median(sums) if sums else np.nan
        limit = np.median(limits)
        rows.append(
            (noise, len(sums) / options.seeds, np.median(counts), found, limit, np.median(plain))
        )
        print_row(
            f"{noise:g}",
            f"{len(sums)} of {options.seeds}",
            f"{min(counts)} to {max(counts)}",
            f"{found:.2f}",
            f"{limit:.2f}",
            f"{found / limit:.2f}",
            f"{np.median(plain):.0f}",
        )
    if options.out is not None:
        draw(np.array(rows), options.out / "planes_walls.png")


def draw(rows: np.ndarray, path: Path) -> None:
    figure, (errors, counts) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    errors.semilogy(rows[:, 0], rows[:, 3], "o-", label="split and merge, where four were found")
    errors.semilogy(rows[:, 0], rows[:, 4], "k--", label="least squares, walls known")
    errors.semilogy(rows[:, 0], rows[:, 5], "x-", color="0.6", label="classical EM, 3 planes")
    errors.set(xlabel="noise", ylabel="sum of angular errors, degrees")
    errors.legend(fontsize=8)
    counts.plot(rows[:, 0], 100 * rows[:, 1], "o-")
    counts.set(xlabel="noise", ylabel="seeds with the four walls, %", ylim=(0, 105))
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
