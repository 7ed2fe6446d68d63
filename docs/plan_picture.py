"""Draws a floor plan beside the true one: python docs/plan_picture.py [FILE]

Needs surfabet with its extra `plan`. Prints how far the walls are off.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import surfabet as sb
from surfabet import datasets, plan

SIZE = (5.4, 4.4, 2.6)
NOISE = 0.005


def main() -> None:
    path = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "pictures/plan.png")
    scan = datasets.scan_lidar(
        datasets.make_room(size=SIZE),
        elevation_limits=(-80, 80),
        elevation_step=0.7,
        azimuth_step=0.7,
        range_noise=NOISE,
    )
    model = sb.learn_planes(scan.cloud)
    drawn = plan.floor_plan(model)
    x, y = SIZE[0] / 2, SIZE[1] / 2
    off = []
    for wall in drawn.walls[:4]:
        axis = int(np.argmax(np.abs(wall.normal)))
        truth = -np.sign(wall.normal[axis]) * (x, y)[axis]
        off += [abs(end[axis] - truth) for end in (wall.start, wall.end)]
    area = SIZE[0] * SIZE[1]
    print(f"{len(model.to_bytes()):,} bytes; ends of walls off by at most {1e3 * max(off):.1f} mm,")
    print(f"{1e3 * np.mean(off):.1f} mm on average; {drawn.rooms[0].area:.2f} m2 of {area:.2f} m2")

    figure = Figure(figsize=(10, 4.3), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    left.add_patch(Rectangle((-x, -y), 2 * x, 2 * y, facecolor="#eef3fa", edgecolor="black"))
    left.set_title(f"true: {area:.2f} m², windows and furniture left out", fontsize=9)
    drawn.draw(right)
    right.set_title(f"from {len(scan.cloud):,} points, {1e3 * NOISE:g} mm of noise", fontsize=9)
    for axes in (left, right):
        axes.set_aspect("equal")
        axes.margins(0.05)
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    main()
