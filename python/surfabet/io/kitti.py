"""KITTI `.bin`: Velodyne scans as bare float32, x y z reflectance, in the sensor's own frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfabet._core import PointCloud
from surfabet.io._columns import build_cloud
from surfabet.io._files import format_error

_RECORD_SIZE = 16
# The format has no mark, so that any bytes pass; no lidar measures this far, and random bytes do at
# once.
_FARTHEST = 100_000.0


def read_kitti(path: Path) -> PointCloud:
    """Reads a KITTI scan.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        Positions, intensities (the reflectance, 0..1), ranges and one viewpoint: the sensor is the
        origin.

    Raises
    ------
    FormatError
        The size is not a multiple of 16 bytes, or the values are no coordinates in metres.
    """
    size = path.stat().st_size
    if size % _RECORD_SIZE:
        raise format_error(
            path,
            f"{size} bytes are no multiple of {_RECORD_SIZE} (four floats per point)",
            byte=size - size % _RECORD_SIZE,
        )
    rows = np.fromfile(path, "<f4").reshape(-1, 4)
    points = rows[:, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        far = (np.isfinite(points) & (np.abs(points) > _FARTHEST)).any(axis=1)
        ranges = np.sqrt((points.astype(np.float64) ** 2).sum(axis=1))
    if far.any():
        at = int(far.argmax())
        raise format_error(
            path,
            f"not a KITTI scan: point {at} lies at {points[at].tolist()} metres",
            byte=at * _RECORD_SIZE,
        )
    return build_cloud(
        path,
        points,
        intensities=rows[:, 3],
        ranges=ranges,
        viewpoints=np.zeros((1, 3)),
        viewpoint_index=np.zeros(len(points), np.uint32),
    )
