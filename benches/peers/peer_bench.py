"""What the scripts of this folder share: a cloud of a million points, and timing in turn."""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np

import surfabet as sb

ROOM = Path(__file__).resolve().parents[3] / "shared" / "data" / "rgbd_room"


def load(name: str) -> ModuleType | None:
    """The peer's module, or None with a line that tells how to get it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        print(
            f"{name} is left out ({error}); pip install -r benches/peers/requirements.txt",
            file=sys.stderr,
        )
        return None


def million_points(path: Path | None) -> np.ndarray:
    """(n, 3) float32 points: of a file, of the real room thinned to 1 cm, or of a generated one."""
    read = getattr(sb, "read", None)
    if path is None and read is not None and ROOM.is_dir():
        path = ROOM
    if path is not None:
        if read is None:
            sys.exit("this build of surfabet reads no files: run without a cloud")
        cloud = read(path)
        if len(cloud) > 2_000_000:
            cloud = sb.voxel_downsample(cloud, 0.01)
    else:
        cloud = generated_room(1_000_000)
    print(f"{path or 'generated room'}: {len(cloud)} points")
    return np.array(cloud.local_points)


def generated_room(n: int) -> sb.PointCloud:
    """Walls, floor and ceiling of a 5 x 4 x 2.5 m room, a centimetre thick, face by face."""
    rng = np.random.default_rng(1)
    size = np.array([5.0, 4.0, 2.5])
    points = rng.uniform(0, size, (n, 3))
    for face, part in enumerate(np.array_split(np.arange(n), 6)):
        axis = face // 2
        points[part, axis] = face % 2 * size[axis] + rng.uniform(-0.01, 0.01, len(part))
    return sb.PointCloud(points.astype(np.float32))


def compare(title: str, jobs: dict[str, Callable[[], object]], rounds: int) -> None:
    """Runs all jobs once per round and prints their times and the ratios to surfabet's."""
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, job in jobs.items():
            begin = time.perf_counter()
            job()
            seconds[name].append(time.perf_counter() - begin)
    own = np.array(seconds["surfabet"])
    print(f"\n{title}, {rounds} rounds")
    print(f"{'':<14}{'best s':>9}{'median s':>10}{'ratio: median':>15}{'min':>7}{'max':>7}")
    for name, times in seconds.items():
        taken = np.array(times)
        ratio = taken / own
        print(
            f"{name:<14}{taken.min():>9.3f}{np.median(taken):>10.3f}"
            f"{np.median(ratio):>15.2f}{ratio.min():>7.2f}{ratio.max():>7.2f}"
        )
