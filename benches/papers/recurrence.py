"""What recurrence saves: copies of a room, buildings of rooms, real scans, with it and without.

    python benches/papers/recurrence.py [--scene NAME ...] [--seed 0] [--options quality=fine ...]

Errors are of the model decoded as measured at its own spacing, in millimetres; colour is pooled
over both directions. Times are CPU seconds of learning.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator

import numpy as np
from gas_scans import cpu_seconds
from paper_bench import DATA, print_header, print_row, room

import surfabet as sb
from surfabet import datasets

N_COPIES = 6
ROOMS = (5, 4)


def scan(seed: int, sensor: str, noise: int) -> sb.PointCloud:
    """A simulated room; `noise` is the seed of the sensor's."""
    scene = datasets.make_room(seed=seed)
    errors = {"translation_std": 0.003, "rotation_std": 0.1, "random_state": noise}
    if sensor == "kinect":
        return datasets.scan_rgbd(scene, n_frames=8, width=320, height=240, **errors).cloud
    return datasets.scan_lidar(scene, n_scans=2, **errors).cloud


def beside(clouds: Iterator[tuple[sb.PointCloud, tuple[float, float, float]]]) -> sb.PointCloud:
    """Clouds one beside another, each shifted."""
    points, colors = [], []
    for cloud, shift in clouds:
        points.append(cloud.points + np.array(shift))
        colors.append(cloud.colors)
    return sb.PointCloud(np.concatenate(points), colors=np.concatenate(colors))


def copies(seed: int, sensor: str, own_noise: bool) -> sb.PointCloud:
    """Copies of a room at shifts that are no whole number of pixels."""
    first = scan(seed, sensor, 0)
    clouds = (scan(seed, sensor, k) if own_noise and k else first for k in range(N_COPIES))
    return beside((cloud, (6.2137 * k, 0.0, 0.0)) for k, cloud in enumerate(clouds))


def building(seed: int, sensor: str, n_kinds: int) -> sb.PointCloud:
    """20 rooms of so many kinds, the first of `seed`, each scanned with its own noise."""

    def rooms() -> Iterator[tuple[sb.PointCloud, tuple[float, float, float]]]:
        for k in range(ROOMS[0] * ROOMS[1]):
            i, j = divmod(k, ROOMS[1])
            yield scan(seed + k % n_kinds, sensor, k), (6.2137 * i, 5.1713 * j, 0.0)

    return beside(rooms())


SCENES: dict[str, Callable[[int], sb.PointCloud]] = {
    "one room, Kinect": lambda seed: scan(seed, "kinect", 0),
    "six copies, Kinect": lambda seed: copies(seed, "kinect", False),
    "six scans, Kinect": lambda seed: copies(seed, "kinect", True),
    "one room, laser": lambda seed: scan(seed, "laser", 0),
    "six copies, laser": lambda seed: copies(seed, "laser", False),
    "six scans, laser": lambda seed: copies(seed, "laser", True),
    "20 rooms of 5 kinds, Kinect": lambda seed: building(seed, "kinect", 5),
    "20 rooms of 5 kinds, laser": lambda seed: building(seed, "laser", 5),
    "20 different rooms, Kinect": lambda seed: building(seed, "kinect", 20),
    "20 different rooms, laser": lambda seed: building(seed, "laser", 20),
    "kitchen": lambda _: room(),
    "room_scan1": lambda _: sb.read(DATA / "indoor_scan" / "room_scan1.pcd"),
}


def row(name: str, cloud: sb.PointCloud, recurrence: bool, **options: object) -> None:
    began = cpu_seconds()
    model = sb.learn_patches(cloud, recurrence=recurrence, **options)
    seconds = cpu_seconds() - began
    found = sb.evaluate(cloud, model.decode(as_measured=True), normal_neighbors=None)
    color = "" if found.color_rmse_pooled is None else f"{found.color_rmse_pooled:.2f}"
    copied = model.report.figures["patches of instances"]
    print_row(
        name,
        "yes" if recurrence else "no",
        f"{len(cloud):,}",
        f"{len(model.to_bytes()):,}",
        f"{1e3 * found.rmse_forward:.2f} / {1e3 * found.rmse_backward:.2f}",
        f"{1e3 * found.rmse_pooled:.2f}",
        color,
        model.report.figures["instances"],
        f"{copied / max(1, copied + len(model)):.0%}",
        f"{seconds:.1f}",
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", nargs="*", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--seed", type=int, default=0, help="of the first simulated room")
    parser.add_argument("--options", nargs="*", default=[], help="of learn_patches: name=value")
    arguments = parser.parse_args()
    options: dict[str, object] = {}
    for option in arguments.options:
        name, value = option.split("=")
        options[name] = float(value) if value.replace(".", "").isdigit() else value
    print_header(
        "scene",
        "recurrence",
        "points",
        "bytes",
        "rmse (mm)",
        "pooled",
        "colour",
        "instances",
        "of patches",
        "CPU s",
    )
    for name in arguments.scene:
        cloud = SCENES[name](arguments.seed)
        for recurrence in (False, True):
            row(name, cloud, recurrence, **options)


if __name__ == "__main__":
    main()
