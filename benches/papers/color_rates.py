"""Bytes and error of colour by step: what a change of the colour coder is worth.

    python benches/papers/color_rates.py --json before.json      with the earlier state
    python benches/papers/color_rates.py --before before.json    with this one

The earlier state is a build of it on PYTHONPATH. The scan, thinned to means of cubes of half a
pixel, is compared with the model decoded as measured: the error is the root mean square over
channels, 0 to 255, of both directions, each counting half. With `--before`, the change is that of
the bytes at equal error: the mean over the earlier steps of the ratio of bytes, where the logarithm
of the bytes is interpolated linearly in the error between this state's steps, and beyond them from
the nearest two.
"""

from __future__ import annotations

import argparse
import json
import math
import warnings
from collections.abc import Callable
from pathlib import Path

from paper_bench import DATA, check_data

import surfabet as sb
from surfabet import datasets

STEPS = [60, 90, 135]

# Bytes and error of colour at each step.
Curve = list[tuple[float, float]]


def simulated(seed: int) -> sb.PointCloud:
    """Frames of a Kinect in a simulated room."""
    return datasets.simulated_room(seed=seed).cloud


# Name, how it is read, and the side of a pixel in metres.
SCANS: dict[str, tuple[Callable[[], sb.PointCloud], float | None]] = {
    "table": (lambda: sb.read(DATA / "rgbd_frame" / "table.pcd"), 0.006),
    "objects": (lambda: sb.read(DATA / "rgbd_frame" / "objects.pcd"), 0.006),
    "kitchen": (lambda: sb.read(DATA / "rgbd_room"), 0.01),
    "demo": (lambda: datasets.load_demo().cloud, None),
    **{f"room {seed}": (lambda seed=seed: simulated(seed), 0.01) for seed in range(8, 12)},
}


def curve(cloud: sb.PointCloud, resolution: float | None) -> Curve:
    """Bytes and error at each of the steps."""
    found = []
    for step in STEPS:
        model = sb.learn_patches(cloud, resolution=resolution, color_step=step)
        (color,) = (a for a in model.report.attributes if a.name == "colors")
        thinned = sb.voxel_downsample(cloud, 0.5 * model.levels[-1].pixel_size)
        quality = sb.evaluate(thinned, model.decode(as_measured=True), normal_neighbors=None)
        both = quality.color_rmse_forward, quality.color_rmse_backward
        found.append((color.bytes, math.hypot(*both) / math.sqrt(2)))
    return found


def bytes_at(curve: Curve, error: float) -> float:
    """Bytes of a curve at this error."""
    points = sorted((e, math.log(n)) for n, e in curve)
    after = next((i for i, (e, _) in enumerate(points) if e >= error), len(points) - 1)
    (low, a), (high, b) = points[max(after, 1) - 1], points[max(after, 1)]
    return math.exp(a + (b - a) * (error - low) / (high - low))


def change(before: Curve, now: Curve) -> float:
    """Mean change of the bytes at equal error, per cent."""
    logs = [math.log(bytes_at(now, error) / n) for n, error in before]
    return 100 * (math.exp(sum(logs) / len(logs)) - 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scans", nargs="+", choices=SCANS, default=list(SCANS))
    parser.add_argument("--json", type=Path, help="file that the curves are written to")
    parser.add_argument("--before", type=Path, help="curves of an earlier state")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    check_data()
    before = json.loads(options.before.read_text()) if options.before else {}
    curves = {}
    print("| scan | bytes at steps of " + ", ".join(map(str, STEPS)) + " | error | change |")
    print("|---|---|---|---|")
    for name in options.scans:
        read, resolution = SCANS[name]
        curves[name] = now = curve(read(), resolution)
        sizes = ", ".join(f"{n:,.0f}" for n, _ in now)
        errors = ", ".join(f"{e:.2f}" for _, e in now)
        changed = f"{change(before[name], now):+.1f} %" if name in before else ""
        print(f"| {name} | {sizes} | {errors} | {changed} |", flush=True)
    if options.json:
        options.json.write_text(json.dumps(curves))


if __name__ == "__main__":
    main()
