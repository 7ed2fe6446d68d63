"""Mean error against number of representatives (Morell et al., figure of mean errors).

    python benches/papers/gas_mean_error.py [--out FOLDER] [--scans kitchen table pump] [--redraw]

For real scans and 1000 to 50000 representatives: the mean distance from input points to the nearest
representative for growing neural gas (default options) and for the reducers that it is compared
with, all of them asked for the same number. The cells of voxel grid and octree are the smallest
that give no more. Prints a Markdown table; with --out keeps the rows as JSON there and draws them.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from gas_scans import mean_error, scan

import surfabet as sb

COUNTS = [1000, 2000, 5000, 10_000, 20_000, 50_000]

METHODS: dict[str, Callable[[sb.PointCloud, int], np.ndarray]] = {
    "GNG": lambda cloud, n: sb.learn_gas(cloud, n_neurons=n).neurons.positions,
    "voxel grid": lambda cloud, n: sb.voxel_downsample(cloud, count=n).points,
    "octree centroid": lambda cloud, n: sb.octree_downsample(cloud, count=n).points,
    "octree centre": lambda cloud, n: (
        sb.octree_downsample(cloud, count=n, representative="center").points
    ),
    "FPS": lambda cloud, n: sb.farthest_point_downsample(cloud, n).points,
    "random": lambda cloud, n: sb.random_downsample(cloud, n).points,
}


def measure(name: str, most: int) -> list[dict[str, Any]]:
    cloud = scan(name)
    print(f"\n{name}: {len(cloud):,} points; mean error in mm\n")
    print("| representatives | " + " | ".join(METHODS) + " | GNG / voxel grid |")
    print("|" + "---|" * (len(METHODS) + 2), flush=True)
    rows: list[dict[str, Any]] = []
    # More than every third point is no reduction any more.
    for n in (n for n in COUNTS if n <= min(most, len(cloud) // 3)):
        row: dict[str, Any] = {"scan": name, "points": len(cloud), "count": n}
        for method, reduce in METHODS.items():
            representatives = reduce(cloud, n)
            row[method] = [mean_error(cloud, representatives), len(representatives)]
        rows.append(row)
        errors = " | ".join(f"{1e3 * row[method][0]:.2f}" for method in METHODS)
        ratio = row["GNG"][0] / row["voxel grid"][0]
        print(f"| {n:,} | {errors} | {ratio:.3f} |", flush=True)
    return rows


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    scans = list(dict.fromkeys(row["scan"] for row in rows))
    figure, axes = plt.subplots(1, len(scans), figsize=(4.4 * len(scans), 3.8), squeeze=False)
    for axis, name in zip(axes[0], scans, strict=True):
        own = [row for row in rows if row["scan"] == name]
        for method in METHODS:
            x = [row[method][1] for row in own]
            y = [1e3 * row[method][0] for row in own]
            axis.loglog(x, y, marker="o", ms=3, lw=2.2 if method == "GNG" else 1.1, label=method)
        axis.set_title(f"{name}, {own[0]['points']:,} points", fontsize=10)
        axis.set_xlabel("representatives")
        axis.grid(True, which="both", alpha=0.3)
    axes[0][0].set_ylabel("mean error, mm")
    axes[0][-1].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder of rows and plot")
    parser.add_argument("--scans", nargs="+", default=["kitchen", "table", "pump"])
    parser.add_argument("--most", type=int, default=COUNTS[-1], help="largest number")
    parser.add_argument("--redraw", action="store_true", help="measure nothing")
    options = parser.parse_args()
    if options.redraw:
        rows = json.loads((options.out / "gas_mean_error.json").read_text())
    else:
        rows = [row for name in options.scans for row in measure(name, options.most)]
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "gas_mean_error.json").write_text(json.dumps(rows, indent=1))
        draw(rows, options.out / "gas_mean_error.png")


if __name__ == "__main__":
    main()
