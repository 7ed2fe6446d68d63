"""Clouds as COPC files, to compare queries with: by pdal where it is, else by the package copclib.

copclib writes the cells of an octree that it is given. They are filled here as by untwine and pdal:
each cell has a grid of 128 places a side, and takes one point for each; what is left goes to the
cells below.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import surfabet as sb

PLACES = 128
SCALE = 0.001
RECORD = np.dtype("3<i4,<u2,u1,u1,u1,u1,<i2,<u2,<f8")
RECORD.names = (
    *("place", "intensity", "returns", "flags", "class", "user", "angle", "source", "time"),
)
"""Point format 6."""


def writer() -> str | None:
    """What can write COPC here; None for nothing."""
    if shutil.which("pdal"):
        return "pdal"
    return "copclib" if importlib.util.find_spec("copclib") else None


def copc(cloud: sb.PointCloud) -> bytes:
    """The file of a cloud."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.copc.laz"
        if writer() == "pdal":
            sb.write(path.with_name("a.las"), sb.PointCloud(cloud.points))
            subprocess.run(["pdal", "translate", path.with_name("a.las"), path], check=True)
        else:
            _by_copclib(cloud.points, path)
        return path.read_bytes()


def _by_copclib(points: np.ndarray, path: Path) -> None:
    import copclib

    low, high = points.min(axis=0), points.max(axis=0)
    side = float((high - low).max()) * 1.0001
    vector = copclib.Vector3
    offset = np.floor(low)
    config = copclib.CopcConfigWriter(6, vector(SCALE, SCALE, SCALE), vector(*offset))
    info = config.copc_info
    info.center_x, info.center_y, info.center_z = (low + side / 2).tolist()
    info.halfsize, info.spacing = side / 2, side / PLACES
    config.las_header.min, config.las_header.max = vector(*low), vector(*high)
    file = copclib.FileWriter(str(path), config)
    left = np.random.default_rng(0).permutation(len(points))
    level = 0
    while len(left):
        cell = np.floor((points[left] - low) * (2**level / side)).astype(np.int64)
        place = np.floor((points[left] - low) * (PLACES * 2**level / side)).astype(np.int64)
        _, first = np.unique(place @ [1 << 42, 1 << 21, 1], return_index=True)
        # Points are at least a scale apart or are the same ones.
        is_last = side / (PLACES * 2**level) < SCALE
        taken = np.arange(len(left)) if is_last else first
        _add(copclib, file, level, cell[taken], points[left[taken]] - offset)
        left = np.delete(left, taken)
        level += 1
    file.Close()


def _add(copclib: Any, file: Any, level: int, cells: np.ndarray, points: np.ndarray) -> None:
    """Writes points by their cells."""
    order = np.lexsort(cells.T)
    cells, points = cells[order], points[order]
    starts = np.flatnonzero(np.r_[True, (cells[1:] != cells[:-1]).any(axis=1)])
    for start, end in zip(starts, [*starts[1:], len(cells)], strict=True):
        rows = np.zeros(end - start, RECORD)
        rows["place"] = np.rint(points[start:end] / SCALE)
        rows["returns"] = 0x11
        key = copclib.VoxelKey(level, *map(int, cells[start]))
        file.AddNode(key, copclib.VectorChar(rows.view(np.int8)))
