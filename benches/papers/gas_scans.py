"""What the scripts on growing neural gas share: real scans, the paper's measure, CPU seconds."""

from __future__ import annotations

import resource
import warnings
from pathlib import Path

import numpy as np

import surfabet as sb

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"

KITCHEN_POINTS = 2_000_000
"""Points of the fused kitchen that are used, drawn at random."""


def scan(name: str) -> sb.PointCloud:
    """A real scan by its short name."""
    if name == "kitchen":
        return sb.random_downsample(sb.read(DATA / "rgbd_room"), KITCHEN_POINTS)
    files = {
        "table": "rgbd_frame/table.pcd",
        "pump": "e57/pumpAVisualReferenceImage.e57",
        "hall": "multi_scan/full0.pcd",
        "street": "outdoor_360/000000.bin",
    }
    with warnings.catch_warnings():
        # Kinect frames have no depth in places.
        warnings.simplefilter("ignore", sb.DroppedPointsWarning)
        return sb.read(DATA / files[name])


def mean_error(cloud: sb.PointCloud, representatives: np.ndarray) -> float:
    """ME of the paper: mean distance from input points to their nearest representative, metres."""
    tree = sb.KdTree(np.asarray(representatives - np.asarray(cloud.origin), np.float32))
    distances, _ = tree.query(cloud.local_points)
    return float(np.mean(distances, dtype=np.float64))


def cpu_seconds() -> float:
    """Seconds that all threads of this process have computed: other load counts little."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime
