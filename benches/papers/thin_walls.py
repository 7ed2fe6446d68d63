"""Both faces of thin walls: what is decoded between them, and whose colour it has.

    python benches/papers/thin_walls.py

Walls of 4 x 2.5 m, one face red and one blue, turned by 0.3 rad about the vertical. Faces are told
apart by normals, by viewpoints, or by nothing but their distance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from paper_bench import print_header, print_row

import surfabet as sb

WALLS = [
    (30_000, 0.03, 0.001),
    (30_000, 0.03, 0.003),
    (200_000, 0.03, 0.001),
    (8_000, 0.03, 0.001),
    (30_000, 0.02, 0.001),
    (30_000, 0.05, 0.005),
    (100_000, 0.03, 0.006),
]
"""Points per face, thickness and noise, metres."""
TURNED = 0.3


def wall(n: int, gap: float, noise: float, seen: str) -> tuple[sb.PointCloud, NDArray[np.float64]]:
    """A wall, and the direction across it."""
    rng = np.random.default_rng(0)
    back = np.arange(2 * n) % 2 == 1
    points = rng.uniform(0, (4, 1, 2.5), (2 * n, 3))
    points[:, 1] = np.where(back, gap, 0) + rng.normal(0, noise, 2 * n)
    normals = np.zeros((2 * n, 3))
    normals[:, 1] = np.where(back, 1, -1)
    colors = np.where(back[:, None], (30, 30, 220), (220, 30, 30)).astype(np.uint8)
    c, s = np.cos(TURNED), np.sin(TURNED)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    sides = {
        "normals": {"normals": normals @ turn.T},
        "viewpoints": {"viewpoints": (points + 2 * normals) @ turn.T},
        "nothing": {},
    }
    return sb.PointCloud(points @ turn.T, colors=colors, **sides[seen]), turn[:, 1]


def main() -> None:
    """Prints a row per wall and way to tell its faces apart."""
    print_header(
        "faces by", "points per face", "thickness, cm", "noise, mm", "gap found, cm", "pixel, cm",
        "bytes", "decoded in the middle half", "as measured", "other face's colour",
    )  # fmt: skip
    for seen in ("normals", "viewpoints", "nothing"):
        for n, gap, noise in WALLS:
            cloud, across = wall(n, gap, noise, seen)
            found = sb.survey(cloud).layer_gap
            model = sb.learn_patches(cloud)
            between = []
            for as_measured in (True, False):
                decoded = model.decode(as_measured=as_measured)
                off = decoded.points @ across - 0.5 * gap
                between.append(np.mean(np.abs(off) < 0.25 * gap))
            assert decoded.colors is not None
            is_red = decoded.colors[:, 0].astype(int) > decoded.colors[:, 2]
            print_row(
                seen,
                f"{n:,}",
                f"{100 * gap:g}",
                f"{1000 * noise:g}",
                "-" if found is None else f"{100 * found:.2f}",
                f"{100 * model.report.chosen['resolution'][0]:.2f}",
                f"{len(model.to_bytes()):,}",
                f"{between[1]:.2%}",
                f"{between[0]:.2%}",
                f"{np.mean(is_red != (off < 0)):.2%}",
            )


if __name__ == "__main__":
    main()
