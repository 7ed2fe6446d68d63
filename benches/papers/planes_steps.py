"""Planes of steps and layers: stairs, louvres, shelves, sheets, walls near each other, kerbs.

    python benches/papers/planes_steps.py [--shapes stairs ...] [--seeds 3]

Each shape is rectangles with points by their areas, every point moved by Gaussian noise along each
axis. Planes count and are right as in `planes_room.py`. Medians over the seeds; `rms` is the root
mean square distance of points from the planes that they are on. Prints a Markdown table.
"""

from __future__ import annotations

import argparse

import numpy as np
from paper_bench import print_header, print_row
from planes_room import Score

import surfabet as sb

Face = tuple[list[float], list[float], list[float]]


def stairs() -> list[Face]:
    """Ten steps of 17 x 28 cm, 1 m wide."""
    return [
        face
        for k in range(10)
        for face in (
            ([0.28 * k, 0, 0.17 * k], [0, 0, 0.17], [0, 1, 0]),
            ([0.28 * k, 0, 0.17 * (k + 1)], [0.28, 0, 0], [0, 1, 0]),
        )
    ]


def sheet() -> list[Face]:
    """A folded sheet: ten waves of 20 cm, 5 cm high, 2 m wide."""
    return [
        face
        for k in range(10)
        for face in (
            ([0.2 * k, 0, 0], [0.1, 0, 0.05], [0, 2, 0]),
            ([0.2 * k + 0.1, 0, 0.05], [0.1, 0, -0.05], [0, 2, 0]),
        )
    ]


def louvres() -> list[Face]:
    """Twelve slats of 1 m x 10 cm, 8.5 cm apart."""
    return [([0, 0, 0.12 * k], [1, 0, 0], [0, 0.07, 0.07]) for k in range(12)]


def shelf() -> list[Face]:
    """Seven boards of 2 cm, 30 cm apart, with sides and a back."""
    boards = [
        face
        for k in range(7)
        for face in (
            ([0, 0, 0.3 * k], [1, 0, 0], [0, 0.35, 0]),
            ([0, 0, 0.3 * k + 0.02], [1, 0, 0], [0, 0.35, 0]),
            ([0, 0, 0.3 * k], [1, 0, 0], [0, 0, 0.02]),
        )
    ]
    back = ([0, 0.35, 0], [1, 0, 0], [0, 0, 1.82])
    return [*boards, back, *(([x, 0, 0], [0, 0.35, 0], [0, 0, 1.82]) for x in (0, 1))]


def walls() -> list[Face]:
    """Two walls of 4 x 2.5 m, 10 cm apart."""
    return [([0, y, 0], [4, 0, 0], [0, 0, 2.5]) for y in (0, 0.1)]


def kerb() -> list[Face]:
    """A road and a pavement 10 cm above it."""
    return [
        ([-4, 0, 0], [4, 0, 0], [0, 8, 0]),
        ([0, 0, 0], [0, 8, 0], [0, 0, 0.1]),
        ([0, 0, 0.1], [1.5, 0, 0], [0, 8, 0]),
    ]


SHAPES = {
    "stairs": (stairs, 200_000, (5, 12, 16, 20, 30)),
    "sheet": (sheet, 100_000, (5, 10, 15)),
    "louvres": (louvres, 100_000, (8, 15)),
    "shelf": (shelf, 150_000, (3, 6)),
    "walls": (walls, 100_000, (5, 15, 25)),
    "kerb": (kerb, 100_000, (5, 12, 30)),
}


def sampled(faces: list[Face], n: int, sigma: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points, and the face that each is on."""
    rng = np.random.default_rng(seed)
    corners, u, v = (np.array([f[k] for f in faces], float) for k in range(3))
    areas = np.linalg.norm(np.cross(u, v), axis=1)
    on = rng.choice(len(faces), n, p=areas / areas.sum())
    points = corners[on] + rng.random((n, 1)) * u[on] + rng.random((n, 1)) * v[on]
    return points + sigma * rng.standard_normal((n, 3)), on


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shapes", nargs="+", default=list(SHAPES), choices=list(SHAPES))
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    print_header("shape", "noise mm", "planes (true)", "precision", "recall", "rms mm")
    for name in options.shapes:
        faces, n, noises = SHAPES[name]
        for noise in noises:
            rows = []
            for seed in range(options.seeds):
                points, on = sampled(faces(), n, noise / 1000, seed)
                model = sb.learn_planes(sb.PointCloud(points))
                score = Score(model.labels, on, points, noise / 1000)
                kept = model.labels >= 0
                own = model.labels[kept]
                off = points[kept] - model.planes.centers[own]
                heights = np.einsum("ij,ij->i", off, model.planes.normals[own])
                rms = 1000 * np.sqrt((heights**2).mean()) if kept.any() else np.nan
                rows.append((score.found, score.true, score.precision, score.recall, rms))
            found, true, precision, recall, rms = np.median(rows, axis=0)
            print_row(
                name,
                noise,
                f"{found:.0f} ({true:.0f})",
                f"{precision:.2f}",
                f"{recall:.2f}",
                f"{rms:.1f}",
            )


if __name__ == "__main__":
    main()
