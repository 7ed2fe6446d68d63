"""Four walls under noise: the paper's experiment I.

    python benches/papers/planes_walls.py [--noise 1 2 ... 25] [--seeds 20] [--out FOLDER]
                                          [--lengths 450 150 150 450] [--angle 90] [--points 7000]

Points on four walls of height 300, one after the other: two long ones and, between them, a corner
of two short ones. Every point is moved by Gaussian noise of the standard deviation given along each
axis. `learn_planes` starts from 3 random patches, other ones with every seed, and keeps patches
whatever they look like (`min_probability=0`): there is nothing but walls here.

A result counts as found if there are exactly four patches, each within 10 degrees of another wall.
Its error is the sum of the four angles between normals of patches and walls, in degrees. Beside it:

- the Cramer-Rao bound: no unbiased method can have smaller variances. It is that of a mixture of
  four rectangles blurred by the noise, of which planes, outlines, shares and the noise are unknown,
  from the scores of 100,000 points; the median sum of errors is that of normal errors with this
  covariance
- the least-squares planes of the points of each wall, as if it were known which point is on which
- the method as printed in the paper (`published=True`) from the same 3 patches
- classical EM (`fit_planes_em`) from the planes of the same 3 patches, each wall with the plane
  that most of its points belong to

Prints a Markdown table of medians over the seeds, and with `--out` draws the plot.
"""

from __future__ import annotations

import argparse
import time
from math import erf
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from paper_bench import print_header, print_row

import surfabet as sb

HEIGHT = 300.0
NEAR = 10.0
ERF = np.vectorize(erf)


class Walls:
    """Four vertical walls, one after the other."""

    def __init__(self, lengths: list[float], angle: float) -> None:
        """Walls of these lengths with this angle between neighbours, degrees."""
        turn = np.radians(180.0 - angle)
        headings = -np.pi / 2 + np.array([0.0, turn, 0.0, turn])
        self.lengths = np.array(lengths)
        self.along = np.column_stack([np.cos(headings), np.sin(headings), np.zeros(4)])
        ends = np.cumsum(self.lengths[:, None] * self.along, axis=0)
        self.starts = np.concatenate([np.zeros((1, 3)), ends[:-1]])
        self.normals = np.cross(self.along, [0.0, 0.0, 1.0])
        self.middles = self.starts + 0.5 * self.lengths[:, None] * self.along
        self.middles[:, 2] = 0.5 * HEIGHT

    def sample(self, n: int, noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Noisy points (n, 3) and the wall that each is on."""
        rng = np.random.default_rng(seed)
        wall = rng.choice(4, n, p=self.lengths / self.lengths.sum())
        along = rng.random(n) * self.lengths[wall]
        points = self.starts[wall] + along[:, None] * self.along[wall]
        points[:, 2] = HEIGHT * rng.random(n)
        return points + noise * rng.standard_normal(points.shape), wall

    def bound(self, n: int, noise: float) -> float:
        """Median sum of errors at the Cramer-Rao bound, degrees."""
        points, _ = self.sample(100_000, noise, 1)
        logs, scores = zip(*(self.scores(points, k, noise) for k in range(4)), strict=True)
        shares = np.exp(np.array(logs)) * (self.lengths / self.lengths.sum())[:, None]
        shares /= shares.sum(axis=0)
        by_wall = [p[:, None] * s[:, :-1] for p, s in zip(shares, scores, strict=True)]
        by_noise = sum(p * s[:, -1] for p, s in zip(shares, scores, strict=True))
        by_weight = (shares[:3] - (self.lengths / self.lengths.sum())[:3, None]).T
        score = np.column_stack([*by_wall, by_noise, by_weight])
        # Scaled, since parameters have different units. In each of the three corners a longer wall
        # and a shorter neighbour have the same density to first order, so that three directions of
        # edges and shares have no information. Planes have no part in them: left out by the
        # pseudoinverse, they change no bound of theirs.
        information = score.T @ score / len(points) * n
        scale = np.sqrt(np.diag(information))
        scaled = information / np.outer(scale, scale)
        covariance = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True) / np.outer(scale, scale)
        tilts = np.concatenate([[8 * k, 8 * k + 1] for k in range(4)])
        rng = np.random.default_rng(0)
        errors = rng.multivariate_normal(np.zeros(8), covariance[np.ix_(tilts, tilts)], 20_000)
        return float(np.degrees(np.median(np.linalg.norm(errors.reshape(-1, 4, 2), axis=2).sum(1))))

    def scores(self, points: np.ndarray, k: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
        """Logarithm of the density of a wall, and its derivatives by two tilts, the turn in the
        plane, the offset, four edges and the noise."""
        d = points - self.middles[k]
        x, y, z = d @ self.along[k], d[:, 2], d @ self.normals[k]
        log = -0.5 * (z / noise) ** 2 - np.log(noise)
        by_noise = z**2 / noise**3 - 1 / noise
        by, edges = [], []
        for t, half in ((x, 0.5 * self.lengths[k]), (y, 0.5 * HEIGHT)):
            low, high = (t + half) / noise, (t - half) / noise
            mass = np.maximum(0.5 * (ERF(low / 2**0.5) - ERF(high / 2**0.5)), 1e-15)
            bell = [np.exp(-0.5 * v**2) / (2 * np.pi) ** 0.5 / (noise * mass) for v in (low, high)]
            log += np.log(mass / (2 * half))
            by.append(bell[0] - bell[1])
            edges += [0.5 / half - bell[0], bell[1] - 0.5 / half]
            by_noise += high * bell[1] - low * bell[0]
        by_z = -z / noise**2
        turns = [by[1] * z - by_z * y, by_z * x - by[0] * z, by[0] * y - by[1] * x]
        return log, np.column_stack([*turns, -by_z, *edges, by_noise])


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(min(abs(float(a @ b)), 1.0))))


def least_squares(walls: Walls, points: np.ndarray, wall: np.ndarray) -> float:
    total = 0.0
    for k in range(4):
        _, axes = np.linalg.eigh(np.cov(points[wall == k].T))
        total += angle(axes[:, 0], walls.normals[k])
    return total


def split_and_merge(
    walls: Walls, points: np.ndarray, seed: int, **options: object
) -> tuple[int, float | None]:
    """Number of patches, and the sum of angular errors if these are the four walls."""
    planes = sb.learn_planes(
        sb.PointCloud(points), initial_patches=3, random_state=seed, **options
    ).planes
    if len(planes) != 4:
        return len(planes), None
    far = np.linalg.norm(planes.centers[:, None] - walls.middles, axis=2)
    nearest = far.argmin(axis=1)
    errors = [angle(n, walls.normals[k]) for n, k in zip(planes.normals, nearest, strict=True)]
    found = len(set(nearest)) == 4 and max(errors) <= NEAR
    return 4, sum(errors) if found else None


def classical(walls: Walls, points: np.ndarray, wall: np.ndarray, seed: int) -> float:
    cloud = sb.PointCloud(points)
    fitted = sb.fit_planes_em(cloud, *sb.random_planes(cloud, 3, random_state=seed))
    most = [np.bincount(fitted.labels[wall == k], minlength=3).argmax() for k in range(4)]
    return sum(angle(fitted.normals[m], walls.normals[k]) for k, m in enumerate(most))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--noise", type=float, nargs="+", default=list(range(1, 26)))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--lengths", type=float, nargs=4, default=[450.0, 150.0, 150.0, 450.0])
    parser.add_argument("--angle", type=float, default=90.0, help="between walls, degrees")
    parser.add_argument("--points", type=int, default=7000)
    parser.add_argument("--fast", action="store_true", help="leave the other methods out")
    parser.add_argument("--out", type=Path, help="folder of the plot")
    options = parser.parse_args()
    walls = Walls(options.lengths, options.angle)
    print_header(
        "noise",
        "four walls found",
        "patches",
        "sum of errors",
        "bound",
        "ratio",
        "least squares",
        "as printed: found",
        "patches",
        "sum of errors",
        "classical EM",
        "seconds",
    )
    kept = {"min_probability": 0.0}
    rows = []
    for noise in options.noise:
        counts, sums, limits, plain, took, printed = [], [], [], [], [], []
        for seed in range(options.first_seed, options.first_seed + options.seeds):
            points, wall = walls.sample(options.points, noise, seed)
            began = time.perf_counter()
            count, error = split_and_merge(walls, points, seed, **kept)
            took.append(time.perf_counter() - began)
            counts.append(count)
            if error is not None:
                sums.append(error)
            limits.append(least_squares(walls, points, wall))
            if not options.fast:
                printed.append(split_and_merge(walls, points, seed, published=True))
                plain.append(classical(walls, points, wall, seed))
        found = float(np.median(sums)) if sums else np.nan
        bound = walls.bound(options.points, noise)
        ends = [n for n, _ in printed] or [0]
        printed_sums = [error for _, error in printed if error is not None]
        printed_error = float(np.median(printed_sums)) if printed_sums else np.nan
        em = float(np.median(plain)) if plain else np.nan
        rows.append((noise, len(sums) / options.seeds, found, bound, em, printed_error))
        print_row(
            f"{noise:g}",
            f"{len(sums)} of {options.seeds}",
            f"{min(counts)} to {max(counts)}",
            f"{found:.2f}",
            f"{bound:.2f}",
            f"{found / bound:.2f}",
            f"{np.median(limits):.2f}",
            f"{len(printed_sums)} of {len(printed)}",
            f"{min(ends)} to {max(ends)}",
            f"{printed_error:.2f}",
            f"{em:.0f}",
            f"{np.median(took):.2f}",
        )
    if options.out is not None:
        draw(np.array(rows), options.out / "planes_walls.png")


def draw(rows: np.ndarray, path: Path) -> None:
    figure, (errors, counts) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    errors.semilogy(rows[:, 0], rows[:, 2], "o-", label="default, where four were found")
    errors.semilogy(rows[:, 0], rows[:, 3], "k--", label="Cramer-Rao bound")
    errors.semilogy(rows[:, 0], rows[:, 5], "s", label="as printed, where four were found")
    errors.semilogy(rows[:, 0], rows[:, 4], "x-", color="0.6", label="classical EM, 3 planes")
    errors.set(xlabel="noise", ylabel="sum of angular errors, degrees")
    errors.legend(fontsize=8)
    counts.plot(rows[:, 0], 100 * rows[:, 1], "o-")
    counts.set(xlabel="noise", ylabel="seeds with the four walls, %", ylim=(0, 105))
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
