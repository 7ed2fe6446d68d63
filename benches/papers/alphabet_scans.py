"""What the scripts on alphabets share: the paper's kinds of scans, each point with its sensor."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from paper_bench import DATA

import surfabet as sb

ROOM_RESOLUTION = 0.972
"""Degrees between beams of the room's scanner: the finer of its two resolutions."""
HALL_SCANS = (0, 10, 20, 30, 40, 50)
"""Three of the six stand at one place."""


def at_origin(points: NDArray[Any]) -> sb.PointCloud:
    """A scan whose sensor stands at the origin."""
    points = np.ascontiguousarray(points, np.float32)
    index = np.zeros(len(points), np.uint32)
    return sb.PointCloud(points, viewpoints=np.zeros((1, 3)), viewpoint_index=index)


def room(number: int) -> sb.PointCloud:
    """One of two scans of a room, 1 or 2."""
    return at_origin(sb.read(DATA / "indoor_scan" / f"room_scan{number}.pcd").points)


def gathered(scans: list[NDArray[Any]], places: list[NDArray[Any]]) -> sb.PointCloud:
    index = np.repeat(np.arange(len(scans)), [len(s) for s in scans])
    return sb.PointCloud(
        np.concatenate(scans).astype(np.float32),
        viewpoints=np.array(places),
        viewpoint_index=index.astype(np.uint32),
    )


def hall(n: int = len(HALL_SCANS)) -> sb.PointCloud:
    """The first n scans in one frame; scan K has pose K of the list, four rows each."""
    folder = DATA / "multi_scan"
    rows = np.loadtxt(folder / "alidarPose.csv", delimiter=",", usecols=range(4))
    poses = rows.reshape(-1, 4, 4)
    scans, places = [], []
    for k in HALL_SCANS[:n]:
        points = sb.read(folder / f"full{k}.pcd").points
        points = points[(np.abs(points) > 0).any(axis=1)]
        # The last element of the last row is a time stamp.
        rotation, shift = poses[k, :3, :3], poses[k, :3, 3]
        scans.append(points @ rotation.T + shift)
        places.append(shift)
    return gathered(scans, places)


def street() -> sb.PointCloud:
    """Three scans that are not registered and stand 400 m apart here."""
    scans, places = [], []
    for i, name in enumerate(("000000", "000002", "000004")):
        place = np.array([0.0, 400.0 * (i - 1), 0.0])
        scans.append(sb.read(DATA / "outdoor_360" / f"{name}.bin").points + place)
        places.append(place)
    return gathered(scans, places)


def distinct(cloud: sb.PointCloud, min_range: float) -> NDArray[np.float32]:
    """Points away from their sensor, each once."""
    points = np.asarray(cloud.points, np.float32)
    assert cloud.viewpoints is not None
    assert cloud.viewpoint_index is not None
    away = np.linalg.norm(cloud.points - cloud.viewpoints[cloud.viewpoint_index], axis=1)
    return np.unique(points[away >= min_range], axis=0)
