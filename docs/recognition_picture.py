"""Draws chairs that are found by examples of other rooms: python docs/recognition_picture.py

Needs surfabet with its extra `report`. Writes `recognition_find.png` into docs/pictures, or into
the folder that is given.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import surfabet as sb
from surfabet import datasets

LEARNING = {"radius": 0.1, "sigma_scale": 1.5, "angular_resolution": 0.5, "noise": 0.005}
SCENE, LIBRARY, PER_ROOM = 8, (0, 1), 2


def scan(seed: int, variation: float) -> datasets.SimulatedScan:
    scene = datasets.make_room(seed=seed, variation=variation)
    return datasets.scan_lidar(scene, n_scans=6, random_state=seed)


def chairs() -> list[sb.AlphabetModel]:
    """Examples: the points of single chairs of other rooms."""
    examples = []
    for seed in LIBRARY:
        seen = scan(seed, 0.1)
        kind = [i for i in seen.scene.instances if i.class_name == "chair"]
        for instance in kind[:PER_ROOM]:
            points = seen.cloud.select(seen.ground_truth.instances == instance.id)
            examples.append(sb.learn_alphabet(points, **LEARNING))
    return examples


def draw_found(path: Path) -> None:
    """The scan from above, cut below the ceiling, with the points of each find in a colour."""
    seen = scan(SCENE, 0.1)
    model = sb.learn_alphabet(seen.cloud, **LEARNING)
    examples = chairs()
    found = model.find(examples, color_tolerance=None)
    points = np.asarray(seen.cloud.points)
    shown = np.flatnonzero((points[:, 2] > 0.05) & (points[:, 2] < 1.6))[::7]
    figure = Figure(figsize=(10, 5.2), layout="constrained")
    axes = figure.subplots(1, 2, width_ratios=(2.2, 1))
    below = shown[np.argsort(points[shown, 2])]
    axes[0].scatter(*points[below, :2].T, c="0.8", s=0.2, linewidths=0)
    for k, place in enumerate(found):
        of_it = shown[place.mask(points[shown])]
        axes[0].scatter(*points[of_it, :2].T, color=f"C{k % 10}", s=0.6, linewidths=0)
        axes[0].annotate(f"{place.score:.2f}", place.center[:2], fontsize=8, ha="center")
    size = f"{len(model.to_bytes()):,}"
    title = f"room {SCENE}, {size} bytes: places like one of {len(examples)} examples, and scores"
    axes[0].set_title(title, fontsize=9)
    example = np.asarray(examples[found[0].example].decode().points)
    turned = example - example.mean(axis=0)
    axes[1].scatter(turned[:, 0] + 0.5 * turned[:, 1], turned[:, 2], c="C0", s=1, linewidths=0)
    axes[1].set_title("example of the best find", fontsize=9)
    for one in axes:
        one.set_aspect("equal")
        one.set_axis_off()
    figure.savefig(path, dpi=90)
    kind = [i for i in seen.scene.instances if i.class_name == "chair"]
    print(f"{len(found)} places; the room has {len(kind)} chairs")


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "pictures")
    draw_found(folder / "recognition_find.png")


if __name__ == "__main__":
    main()
