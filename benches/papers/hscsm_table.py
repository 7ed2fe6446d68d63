"""Table I and figure 5 of HSCSM (Ruhnke, Bo, Fox, Burgard, ICRA 2014) on our scans.

    python benches/papers/hscsm_table.py [--out FOLDER] [--only room|frame|plots|hierarchy]
        [--scenes table,objects,demo,room] [--threads 2]

Prints the table's rows in Markdown for the real room (fused RGB-D frames) and one Kinect frame:
OctoMap, SCSM (one level) and HSCSM, each as published and by our defaults. Errors are pooled
over both directions, as in the paper, and against the raw input; models are decoded at half of
their finest pixel, OctoMap at its leaves' centres. Its tree holds occupied leaves only. All bytes
count; seconds are those of the processor. With --out, the two plots of figure 5 for the frame are
written there: area per level and error against the largest deviation of depth, and of colour.

--only hierarchy asks what the hierarchy is worth: for each scene SCSM over several pixels, HSCSM of
the pixel that the data give, and HSCSM without one of its parts after the other. A row says how
many bytes SCSM would take at its pooled error of depth, between the pixels that were run.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import paper_bench
from paper_bench import check_data, kinect_frame, print_header, print_row

import surfabet as sb

# As in the paper: dictionary sizes and 10 x 10 pixels of 3 mm for the frame; 5 x 5 pixels of 1 cm
# for the room, beside our own 8 x 8.
FRAME: dict[str, Any] = {
    "resolution": 0.003,
    "patch_pixels": 10,
}
# Dictionaries of the paper's frame; those of its rooms, 500 and 3500, are what `published` has.
FRAME_ATOMS: dict[str, Any] = {"depth_atoms": 100, "color_atoms": 200}
ONE: dict[str, Any] = {"levels": 1}
PUBLISHED: dict[str, Any] = {"published": True}
FRAME_LEVELS: dict[str, Any] = {"levels": 4}
ROOM: dict[str, Any] = {"resolution": 0.01, "patch_pixels": 5}
# Thresholds by default: depth, the finest pixel divided by the square root of three; colour, 60.
LEVELS: dict[str, Any] = {"levels": 3}


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder for the plots of figure 5")
    parser.add_argument("--only", choices=["room", "frame", "plots", "hierarchy"])
    parser.add_argument("--scenes", default="table,objects,demo,room", help="of the hierarchy")
    parser.add_argument("--threads", type=int, default=2)
    return parser.parse_args()


def errors(cloud: sb.PointCloud, decoded: sb.PointCloud) -> str:
    q = sb.evaluate(cloud, decoded, normal_neighbors=None)
    return f"{1e3 * q.rmse_pooled:.2f} / {q.color_rmse_pooled:.1f}"


def octomap(name: str, cloud: sb.PointCloud, step: float) -> None:
    try:
        import pyoctomap
    except ImportError as error:
        print(f"OctoMap is left out ({error}); pip install pyoctomap", file=sys.stderr)
        return
    began = time.process_time()
    voxels = sb.voxel_downsample(cloud, step)
    tree = pyoctomap.ColorOcTree(step)
    points, colors = voxels.points, voxels.colors
    assert colors is not None
    for point, color in zip(points, colors, strict=True):
        tree.updateNode(point, True, True)
        tree.setNodeColor(point, *map(int, color))
    tree.updateInnerOccupancy()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.ot"
        tree.write(str(path))
        size = path.stat().st_size
    seconds = time.process_time() - began
    centers = (np.floor(points / step) + 0.5) * step
    decoded = sb.PointCloud(centers, colors=colors)
    cells = ("- / -", "-", f"{100 * step:g}", "-", f"{size:,}", errors(cloud, decoded))
    print_row(name, "OctoMap", *cells, f"{seconds:.1f}")


def model_row(name: str, method: str, cloud: sb.PointCloud, options: dict[str, Any]) -> None:
    began = time.process_time()
    model = sb.learn_hscsm(cloud, **options)
    size = len(model.to_bytes())
    seconds = time.process_time() - began
    levels = model.levels

    def each(values: list[object]) -> str:
        return " / ".join(map(str, values))

    print_row(
        name,
        method,
        f"{each([x.depth_entries for x in levels])}; {each([x.color_entries for x in levels])}",
        each([f"{x.pixels * x.pixel_size:g}" for x in levels]),
        each([f"{100 * x.pixel_size:g}" for x in levels]),
        each([x.patches for x in levels]),
        f"{size:,}",
        errors(cloud, model.decode()),
        f"{seconds:.1f}",
    )


def table(name: str, cloud: sb.PointCloud, rows: list[tuple[str, dict[str, Any]]], step: float):
    print(f"\n{name}: {len(cloud):,} points, {15 * len(cloud):,} bytes raw\n")
    print_header(
        "data",
        "method",
        "dictionary entries (depth; RGB)",
        "patch size (m)",
        "pixel (cm)",
        "patches",
        "bytes",
        "RMSE (mm / RGB)",
        "CPU seconds",
    )
    octomap(name, cloud, step)
    for method, options in rows:
        model_row(name, method, cloud, options)


def room() -> None:
    coarse = {**ROOM, "resolution": 0.015}
    rows: list[tuple[str, dict[str, Any]]] = [
        ("SCSM", {**ROOM, **ONE}),
        ("HSCSM", {**ROOM, **LEVELS}),
        # Coarser pixels are the other way to trade error for size.
        ("SCSM", {**coarse, **ONE}),
        ("HSCSM", {**coarse, **LEVELS}),
        ("SCSM, published", {**ROOM, **ONE, **PUBLISHED}),
        ("HSCSM, published", {**ROOM, **LEVELS, **PUBLISHED}),
    ]
    table("room", paper_bench.room(), rows, 0.01)


def frame() -> None:
    rows = [
        ("SCSM", {**FRAME, **ONE}),
        ("SCSM", {**FRAME, **ONE, "resolution": 0.004}),
        ("SCSM", {**FRAME, **ONE, "resolution": 0.006}),
        ("HSCSM", {**FRAME, **FRAME_LEVELS}),
        ("SCSM, published", {**FRAME, **FRAME_ATOMS, **ONE, **PUBLISHED}),
        ("HSCSM, published", {**FRAME, **FRAME_ATOMS, **FRAME_LEVELS, **PUBLISHED}),
    ]
    table("frame", kinect_frame(), rows, 0.003)


def scene(name: str) -> sb.PointCloud:
    if name == "room":
        return paper_bench.room()
    if name == "demo":
        from surfabet import datasets

        return datasets.load_demo().cloud
    return kinect_frame(name)


def hierarchy(scenes: list[str]) -> None:
    """What the hierarchy is worth, on each of `scenes`."""
    print_header("scene", "method", "pixel (mm)", "patches", "bytes", "RMSE (mm / RGB)", "SCSM")
    for name in scenes:
        cloud = scene(name)
        curve: list[tuple[float, float]] = []
        pixel = 0.0
        for factor in (1.0, 0.85, 1.2, 1.5):
            given = {"resolution": factor * pixel} if pixel else {}
            model = sb.learn_hscsm(cloud, **ONE, **given)
            pixel = pixel or model.levels[0].pixel_size
            size, error = hierarchy_row(name, "SCSM", cloud, model, [])
            curve.append((np.log(error), np.log(size)))
        curve.sort()
        rows: list[tuple[str, dict[str, Any]]] = [
            ("HSCSM", {}),
            ("two levels", {"levels": 2}),
            ("four levels", {"levels": 4}),
            ("masks as published", {"fine_masks": False}),
            ("a dictionary per level", {"one_dictionary": False}),
            ("both", {"fine_masks": False, "one_dictionary": False}),
        ]
        for method, options in rows:
            model = sb.learn_hscsm(cloud, **options)
            hierarchy_row(name, method, cloud, model, curve)


def hierarchy_row(
    name: str,
    method: str,
    cloud: sb.PointCloud,
    model: sb.HscsmModel,
    curve: list[tuple[float, float]],
) -> tuple[int, float]:
    size = len(model.to_bytes())
    q = sb.evaluate(cloud, model.decode(), normal_neighbors=None)
    # Bytes of SCSM at this error, along lines in logarithms; beyond its pixels nothing is said.
    at = np.log(q.rmse_pooled)
    known = curve and curve[0][0] <= at <= curve[-1][0]
    scsm = np.exp(np.interp(at, *np.transpose(curve))) if known else None
    print_row(
        name,
        method,
        f"{1e3 * model.levels[-1].pixel_size:.3g}",
        " / ".join(str(level.patches) for level in model.levels),
        f"{size:,}",
        f"{1e3 * q.rmse_pooled:.3f} / {q.color_rmse_pooled:.2f}",
        f"{scsm:,.0f} ({100 * (size / scsm - 1):+.1f} %)" if scsm else "",
    )
    return size, q.rmse_pooled


def plots(out: Path) -> None:
    """Figure 5: one threshold varies, the other is too large to matter."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    cloud = kinect_frame()
    out.mkdir(parents=True, exist_ok=True)
    sweeps = [
        ("depth", "largest deviation of depth (mm)", 1e3, [0.5, 1, 1.5, 2, 3, 4, 6, 10, 20]),
        ("color", "largest deviation of colour", 1.0, [5, 10, 15, 20, 30, 40, 60, 100]),
    ]
    for name, label, scale, values in sweeps:
        areas, rmse, sizes = [], [], []
        for value in values:
            thresholds = {"max_depth_deviation": 0.02, "max_color_deviation": 100.0}
            thresholds[f"max_{name}_deviation"] = value / scale
            model = sb.learn_hscsm(cloud, **{**FRAME, **FRAME_ATOMS, **FRAME_LEVELS, **thresholds})
            q = sb.evaluate(cloud, model.decode(), normal_neighbors=None)
            areas.append([level.area for level in model.levels])
            error = 1e3 * q.rmse_pooled if name == "depth" else q.color_rmse_pooled
            rmse.append(error)
            sizes.append(len(model.to_bytes()) / 1e3)
            cells = " / ".join(f"{area:.2f}" for area in areas[-1])
            print_row(name, value, cells, f"{error:.2f}", f"{sizes[-1]:.0f} kB")
        figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
        for j, area in enumerate(np.transpose(areas)):
            size = 100 * FRAME["resolution"] * FRAME["patch_pixels"] * 2 ** (3 - j)
            axes.plot(values, area, marker="o", label=f"patches of {size:g} cm")
        axes.set(xscale="log", xlabel=label, ylabel="area (m2)")
        figure.legend(loc="outside upper center", ncols=2)
        right = axes.twinx()
        right.plot(values, rmse, "k--", label="RMSE")
        right.set_ylabel("RMSE, pooled (mm)" if name == "depth" else "RMSE of colour, pooled")
        figure.savefig(out / f"figure5_{name}.png", dpi=120)
        plt.close(figure)


def main() -> None:
    options = parse()
    sb.set_num_threads(options.threads)
    check_data()
    if options.only in (None, "frame"):
        frame()
    if options.only in (None, "room"):
        room()
    if options.only == "hierarchy":
        hierarchy(options.scenes.split(","))
    if options.only == "plots" or (options.only is None and options.out):
        if options.out is None:
            sys.exit("--only plots needs --out FOLDER")
        print("\nthreshold | value | area per level, coarsest first (m2) | RMSE | bytes")
        plots(options.out)


if __name__ == "__main__":
    main()
