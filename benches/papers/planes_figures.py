"""Figures 4, 7 and 8 of the paper on planes: EM without splits, and patches after iterations.

    python benches/papers/planes_figures.py --out FOLDER [--figures 4 7 8] [--published]

4   Four walls with noise of 2, seen from above. Classical EM (`fit_planes_em`) from one and from
    two planes, and `learn_planes` from as many patches at the same places.
7   Walls with noise of 2, 15 and 23 from 3 random patches: these, and the patches after 1, 2, 4 and
    6 iterations and at the end.
8   A street from 10 random patches: points by the patch that they support after 1, 4 and 8
    iterations and at the end.

Patches after an iteration are those of a run that ends there (`max_iterations`), so what the method
does at its end, such as leaving out what is no surface (street), is done there too. Prints a
Markdown row for each panel: patches, share of the points that support one, mean distance.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from alphabet_scans import at_origin, distinct
from matplotlib.axes import Axes
from paper_bench import DATA, check_data, print_header, print_row
from planes_walls import Walls

import surfabet as sb

WALLS = Walls([450.0, 150.0, 150.0, 450.0], 90.0)
N_POINTS = 7000
# More iterations than any run takes.
TO_THE_END = 100
SHADES = plt.get_cmap("tab20")


def learned(cloud: sb.PointCloud, iterations: int, options: dict[str, object]) -> sb.PlaneModel:
    return sb.learn_planes(cloud, max_iterations=iterations, **options)


def told(figure: str, panel: str, model: sb.PlaneModel, cloud: sb.PointCloud) -> None:
    """Prints the row of a panel."""
    planes, labels = model.planes, model.labels
    on = labels >= 0
    offsets = np.einsum("ij,ij->i", cloud.points[on], planes.normals[labels[on]])
    mean = float(np.abs(offsets - planes.offsets[labels[on]]).mean()) if on.any() else np.nan
    print_row(
        figure, panel, model.report.iterations, len(planes), f"{on.mean():.3f}", f"{mean:.3g}"
    )


def points_of(axes: Axes, points: np.ndarray, labels: np.ndarray | None, size: float) -> None:
    """Points from above, each in the colour of its patch."""
    shade = np.full((len(points), 4), 0.8)
    if labels is not None:
        shade[labels >= 0] = SHADES(labels[labels >= 0] % SHADES.N)
    axes.scatter(points[:, 0], points[:, 1], s=size, c=shade, linewidths=0, rasterized=True)
    axes.set(aspect="equal", xticks=[], yticks=[])


def lines_of(axes: Axes, centers: np.ndarray, normals: np.ndarray) -> None:
    """Planes where they cut the height of their centres."""
    limits = axes.get_xlim(), axes.get_ylim()
    for center, normal in zip(centers, normals, strict=True):
        along = np.array([-normal[1], normal[0]])
        if np.linalg.norm(along) > 0.2:
            axes.axline(center[:2], center[:2] + along, color="k", lw=1)
        else:
            axes.plot(*center[:2], "kx")
    axes.set(xlim=limits[0], ylim=limits[1])


def outlines_of(axes: Axes, model: sb.PlaneModel) -> None:
    """What the patches cover, from above."""
    for patch in range(len(model)):
        for polygon in model.polygons(patch):
            closed = np.vstack([polygon, polygon[:1]])
            axes.plot(closed[:, 0], closed[:, 1], "k", lw=1)


def figure4(out: Path, options: dict[str, object]) -> None:
    cloud = sb.PointCloud(WALLS.sample(N_POINTS, 2.0, 0)[0])
    figure, axes = plt.subplots(2, 2, figsize=(7, 5), layout="constrained")
    for row, n in zip(axes, (1, 2), strict=True):
        fit = sb.fit_planes_em(cloud, *sb.random_planes(cloud, n))
        points_of(row[0], cloud.points, fit.labels, 1)
        lines_of(row[0], fit.centers, fit.normals)
        row[0].set_title(f"EM from {n}: deviation {fit.standard_deviation:.0f}")
        cells = (len(fit.log_likelihood), n, "1.000")
        print_row("4", f"EM from {n}", *cells, f"deviation {fit.standard_deviation:.3g}")
        model = learned(cloud, TO_THE_END, options | {"initial_patches": n})
        points_of(row[1], cloud.points, model.labels, 1)
        outlines_of(row[1], model)
        row[1].set_title(f"split and merge from {n}: {len(model)} patches")
        told("4", f"split and merge from {n}", model, cloud)
    figure.savefig(out / "planes_figure4.png", dpi=110)
    plt.close(figure)


def figure7(out: Path, options: dict[str, object]) -> None:
    stages = [1, 2, 4, 6, TO_THE_END]
    figure, axes = plt.subplots(3, 6, figsize=(13, 5), layout="constrained")
    for row, noise in zip(axes, (2.0, 15.0, 23.0), strict=True):
        cloud = sb.PointCloud(WALLS.sample(N_POINTS, noise, 0)[0])
        points_of(row[0], cloud.points, None, 0.5)
        lines_of(row[0], *sb.random_planes(cloud, 3))
        row[0].set(title="first", ylabel=f"noise {noise:g}")
        for panel, iterations in zip(row[1:], stages, strict=True):
            model = learned(cloud, iterations, options | {"initial_patches": 3})
            points_of(panel, cloud.points, model.labels, 0.5)
            outlines_of(panel, model)
            panel.set_title(f"{model.report.iterations}: {len(model)} patches")
            told("7", f"noise {noise:g}, at most {iterations}", model, cloud)
    figure.savefig(out / "planes_figure7.png", dpi=110)
    plt.close(figure)


def figure8(out: Path, options: dict[str, object]) -> None:
    # Without the car's roof, as in planes_scans.py.
    street = at_origin(sb.read(DATA / "outdoor_360" / "000000.bin").points)
    points = distinct(street, 2.5)
    cloud = at_origin(points)
    low, high = np.percentile(points, [2, 98], axis=0)
    figure, axes = plt.subplots(2, 2, figsize=(9, 7), layout="constrained")
    for panel, iterations in zip(axes.ravel(), (1, 4, 8, TO_THE_END), strict=True):
        model = learned(cloud, iterations, options | {"initial_patches": 10})
        points_of(panel, cloud.points, model.labels, 0.3)
        panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        share = 100 * (model.labels >= 0).mean()
        panel.set_title(
            f"{model.report.iterations}: {len(model)} patches, {share:.0f} % of the points"
        )
        told("8", f"street, at most {iterations}", model, cloud)
    figure.savefig(out / "planes_figure8.png", dpi=80)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of the pictures")
    parser.add_argument("--figures", type=int, nargs="+", default=[4, 7, 8], choices=[4, 7, 8])
    parser.add_argument("--published", action="store_true", help="the method as printed")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    check_data()
    # Walls: there is nothing else; the street: what is no surface is left out.
    street = {"published": True} if options.published else {}
    walls = street or {"min_probability": 0.0}
    print_header("figure", "panel", "iterations", "patches", "on a patch", "mean distance")
    if 4 in options.figures:
        figure4(options.out, walls)
    if 7 in options.figures:
        figure7(options.out, walls)
    if 8 in options.figures:
        figure8(options.out, street)


if __name__ == "__main__":
    main()
