"""Planes of real laser scans, as in the paper's experiment II, beside Open3D's plane finders.

    python benches/papers/planes_scans.py [--scans room hall street] [--out FOLDER]

From 10 random patches, as in the paper, and from the data: iterations until stable, patches, share
of points that support one, and of those within three standard deviations of it, mean distance to
the plane, seconds. `detect_planar_patches` and repeated `segment_plane` are run and
scored as in `planes_room.py`, with the noise that was measured (a third of the grid size). No true
planes are known here. Prints a Markdown table; `--out` draws each scan coloured by patch.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from alphabet_scans import at_origin, distinct
from paper_bench import DATA, check_data, print_header, print_row
from planes_room import OUTLIER, fit_error, planar_patches, ransac

import surfabet as sb

SCANS = {
    "room": ("indoor_scan/room_scan1.pcd", 0.5),
    "hall": ("multi_scan/full0.pcd", 0.5),
    "street": ("outdoor_360/000000.bin", 2.5),
}


def scan(name: str) -> np.ndarray:
    """Distinct points of a scan, without the robot's own body, (n, 3)."""
    path, nearest = SCANS[name]
    return distinct(at_origin(sb.read(DATA / path).points), nearest)


def draw(points: np.ndarray, labels: np.ndarray, path: Path) -> None:
    """From above and from the side, every patch in a colour of its own."""
    colors = plt.get_cmap("hsv")(
        np.random.default_rng(0).permutation(labels.max() + 1) / (labels.max() + 1)
    )
    shade = np.where((labels == OUTLIER)[:, None], (0.85, 0.85, 0.85, 1.0), colors[labels])
    figure, axes = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
    low, high = np.percentile(points, [1, 99], axis=0)
    for ax, (a, b) in zip(axes, [(0, 1), (0, 2)], strict=True):
        ax.scatter(points[:, a], points[:, b], s=0.3, c=shade, linewidths=0)
        ax.set(xlim=(low[a], high[a]), ylim=(low[b], high[b]), aspect="equal")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scans", nargs="+", default=list(SCANS), choices=list(SCANS))
    parser.add_argument("--out", type=Path, help="folder of the pictures")
    options = parser.parse_args()
    check_data()
    print_header(
        "scan",
        "finder",
        "iterations",
        "planes",
        "on a plane",
        "within 3 sigma",
        "mean mm",
        "seconds",
    )
    for name in options.scans:
        points = scan(name)
        sensors = np.zeros_like(points)
        cloud = at_origin(points)

        def row(finder: str, iterations: object, labels: np.ndarray, seconds: float) -> None:
            near, mean = fit_error(points, labels, sigma)  # noqa: B023
            print_row(
                name,  # noqa: B023
                finder,
                iterations,
                len(set(labels) - {OUTLIER}),
                f"{np.mean(labels != OUTLIER):.3f}",
                f"{near:.3f}",
                f"{1000 * mean:.1f}",
                f"{seconds:.1f}",
            )

        for finder, start in [("surfabet", 0), ("surfabet, 10 random patches", 10)]:
            began = time.perf_counter()
            model = sb.learn_planes(cloud, initial_patches=start)
            seconds = time.perf_counter() - began
            if start == 0:
                sigma = model.grid_size / 3
            assert model.labels is not None
            row(finder, model.report.iterations, model.labels, seconds)
            if options.out is not None and start == 10:
                draw(points, model.labels, options.out / f"planes_{name}.png")
        for finder, find in [("detect_planar_patches", planar_patches), ("segment_plane", ransac)]:
            began = time.perf_counter()
            labels = find(points, sensors, sigma)
            row(finder, "", labels, time.perf_counter() - began)


if __name__ == "__main__":
    main()
