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
    """Points away from their sensor, each once; all where no sensor is known."""
    points = np.asarray(cloud.points, np.float32)
    if cloud.viewpoints is None:
        return np.unique(points, axis=0)
    assert cloud.viewpoint_index is not None
    away = np.linalg.norm(cloud.points - cloud.viewpoints[cloud.viewpoint_index], axis=1)
    return np.unique(points[away >= min_range], axis=0)


def sparsified(points: NDArray[np.float32], epsilon: float) -> NDArray[np.float32]:
    """Points of which no two are nearer than epsilon and each other is near one (eq. 3).

    Which they are is drawn. In each round the points whose number is the lowest within epsilon are
    kept, and their neighbours are dropped.
    """
    starts, distances, near = sb.KdTree(points).query_radius(points, epsilon)
    near = np.where(distances < epsilon, near, np.repeat(np.arange(len(points)), np.diff(starts)))
    number = np.random.default_rng(0).permutation(len(points)).astype(np.int64)
    drawn = number.copy()
    kept = np.zeros(len(points), bool)
    while (number < len(points)).any():
        lowest = np.minimum.reduceat(number[near], starts[:-1])
        new = (number < len(points)) & (lowest == number)
        kept |= new
        number[np.unique(near[np.repeat(new, np.diff(starts))])] = len(points)
    return points[kept][np.argsort(drawn[kept])]


def octree_cells(file: bytes) -> tuple[NDArray[np.int64], float]:
    """Lowest corner of every occupied cell of an OctoMap (`.bt`) in cells, and their side, metres.

    After the header a node has two bytes: two bits for each of its eight children, 1 a free leaf,
    2 an occupied one, 3 a node, whose own bytes follow, first child first. A leaf above the lowest
    of 16 levels stands for all cells below it.
    """
    head, _, body = file.partition(b"data\n")
    side = float(next(line for line in head.split(b"\n") if line.startswith(b"res")).split()[1])
    leaves = []
    at = 0
    nodes = [(0, 0, 0, 16)]
    while nodes:
        x, y, z, level = nodes.pop()
        bits = int.from_bytes(body[at : at + 2], "little")
        at += 2
        half = 1 << (level - 1)
        inner = []
        for child in range(8):
            kind = bits >> 2 * child & 3
            corner = (
                x + half * (child & 1),
                y + half * (child >> 1 & 1),
                z + half * (child >> 2 & 1),
            )
            if kind == 2:
                leaves.append((*corner, half))
            elif kind == 3:
                inner.append((*corner, level - 1))
        nodes.extend(reversed(inner))
    assert at == len(body), "bytes are left"
    found = np.array(leaves, np.int64)
    cells = []
    for size in np.unique(found[:, 3]):
        corners = found[found[:, 3] == size, :3]
        inside = np.stack(np.meshgrid(*[np.arange(size)] * 3), axis=-1).reshape(-1, 3)
        cells.append((corners[:, None] + inside).reshape(-1, 3))
    return np.concatenate(cells) - (1 << 15), side


def corridor() -> sb.PointCloud:
    """The map of building 079, the paper's corridor, as the middles of the octree's cells.

    Where the sensor stood is not known.
    """
    cells, side = octree_cells((DATA / "octomap" / "geb079.bt").read_bytes())
    return sb.PointCloud(((cells + 0.5) * side).astype(np.float32))
