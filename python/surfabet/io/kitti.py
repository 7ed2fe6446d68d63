"""Scans as bare float32 (`.bin`): KITTI (x y z reflectance), nuScenes (and ring), or x y z alone.

The format has no header, so the numbers must tell how many belong to a point. Two things do: the
columns of the right reading lie where such columns lie, and they differ from each other, while a
wrong number per point mixes them until all look alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.errors import wrong_value
from surfabet.io._columns import Column, cloud_from_columns
from surfabet.io._files import format_error
from surfabet.io._notes import Notes

_LAYOUTS = {
    3: ("x", "y", "z"),
    4: ("x", "y", "z", "intensity"),
    5: ("x", "y", "z", "intensity", "ring"),
}
_FLOAT_SIZE = 4
# Metres; no lidar on a vehicle measures farther.
_FARTHEST = 2_000.0
# Integers read as floats are tinier than any measured number.
_SMALLEST = 1e-30
_MOST_RINGS = 256
# Other numbers per point that are looked for, so that they are not taken for one of the above.
_STRIDES = range(3, 11)
# With fewer numbers than this, columns may look alike by chance.
_ENOUGH = 120
# Numbers that are looked at; the rest is alike.
_LOOKED_AT = 1_000_000
# Columns that differ by this share of the largest difference are as good: those of a multiple of
# the right number differ as much, and a little more by chance.
_AS_GOOD = 0.9


def _is_whole(column: Column) -> bool:
    return bool((column == np.rint(column)).all())


def _fit(values: NDArray[np.float32], stride: int) -> int:
    """How well columns of this many numbers are coordinates, intensities and rings.

    0 if they are not; 1 if they may be; 2 if the last column is as reflectances, intensities or
    rings are and as the coordinates are not.
    """
    rows = values.reshape(-1, stride)
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows) < 0.5 * len(values) / stride:
        return 0
    points = rows[:, :3]
    if (np.abs(points) > _FARTHEST).any():
        return 0
    if ((rows != 0) & (np.abs(rows) < _SMALLEST)).mean() > 0.01:
        return 0
    if stride == 3 or len(rows) == 0:
        return 1
    intensity, last = rows[:, 3], rows[:, -1]
    if intensity.min() < 0 or intensity.max() > 65535:
        return 0
    if stride == 5 and not (_is_whole(last) and last.min() >= 0 and last.max() < _MOST_RINGS):
        return 0
    if _is_whole(last) and last.max() > 0:
        return 1 if _is_whole(points) else 2
    # Reflectances.
    return 2 if last.max() <= 1 and (points.min() < 0 or points.max() > 1) else 1


def _explained(values: NDArray[np.float32], stride: int) -> NDArray[np.float64]:
    """How much columns of this many numbers differ from each other.

    It is the share of the variance between columns in that of all numbers: of the numbers, of their
    logarithms, of whether they are negative, and of whether they are whole.
    """
    rows = values[: len(values) // stride * stride].reshape(-1, stride).astype(np.float64)
    rows = np.clip(np.nan_to_num(rows, nan=0.0), -_FARTHEST, _FARTHEST)
    shares = []
    for kind in (rows, np.log(np.abs(rows) + 1e-3), rows < 0, rows == np.rint(rows)):
        total = kind.var()
        shares.append(kind.mean(axis=0).var() / total if total > 0 else 0.0)
    return np.array(shares)


def _known_stride(values: NDArray[np.float32], n_values: int) -> int | None:
    """The least number of columns that differ as much as any do; `None` where none differ."""
    strides = [stride for stride in _STRIDES if n_values % stride == 0]
    explained = np.array([_explained(values, stride) for stride in strides])
    best = explained.max(axis=0)
    # What chance explains is about the number of columns over that of numbers.
    chance = max(_STRIDES) / len(values)
    best[best <= 5 * chance] = 0
    if not best.any():
        return None
    return strides[int(np.argmax((explained >= _AS_GOOD * best - chance).all(axis=1)))]


def _stride_of(path: Path, values: NDArray[np.float32]) -> int:
    """How many numbers a point has, or an error that says how to name them."""
    remedy = "name the numbers of a point with columns= (--columns), such as x y z intensity"
    divides = [stride for stride in _LAYOUTS if len(values) % stride == 0]
    fitting = {stride: fit for stride in divides if (fit := _fit(values, stride))}
    if not fitting:
        tried = " or ".join(str(stride) for stride in divides)
        raise format_error(
            path,
            f"{tried} floats per point (of 3 x y z, 4 KITTI, 5 nuScenes) are no coordinates to "
            f"{_FARTHEST:g} m with intensities and rings; {remedy}",
            byte=0,
        )
    if len(values) >= _ENOUGH:
        stride = _known_stride(values[:_LOOKED_AT], len(values))
        if stride is not None:
            fitting = {stride: 2} if stride in fitting else {}
    best_fits = [stride for stride, fit in fitting.items() if fit == max(fitting.values())]
    if len(best_fits) != 1:
        raise format_error(path, f"cannot tell how many floats belong to a point; {remedy}", byte=0)
    return best_fits[0]


def _columns(rows: Column, names: Sequence[str]) -> dict[str, Column]:
    """The named columns; rings, which are numbered, as integers."""
    columns = dict(zip(names, rows.T, strict=True))
    ring = columns.get("ring")
    if ring is not None and len(ring) and (ring == np.rint(ring)).all():
        columns["ring"] = ring.astype(np.uint16 if ring.min() >= 0 else np.int32)
    return columns


def read_kitti(path: Path, *, columns: Sequence[str] | None = None) -> PointCloud:
    """Reads a scan of bare floats.

    Parameters
    ----------
    path
        The file.
    columns
        The names of the numbers of a point, where they are not x y z intensity (KITTI), x y z
        intensity ring (nuScenes) or x y z, or where these cannot be told apart.

    Returns
    -------
    PointCloud
        Positions, intensities (of KITTI the reflectance, 0..1), the column ring (uint16), and for
        KITTI and nuScenes ranges and one viewpoint: the sensor is the origin.

    Raises
    ------
    FormatError
        The size is not a whole number of points, the values are no coordinates in metres, or they
        can be read in two ways.
    InvalidInputError
        `columns` does not name x, y and z, or a name is given twice.

    Warns
    -----
    DroppedPointsWarning
        Points are not finite, or are no returns (exactly 0 0 0).
    """
    size = path.stat().st_size
    if columns is not None:
        names = tuple(columns)
        if not {"x", "y", "z"} <= set(names) or len(set(names)) < len(names):
            requirement = "names of columns with x, y and z, and each once"
            raise wrong_value("columns", list(names), requirement)
        sizes = {len(names)}
    else:
        sizes = set(_LAYOUTS)
    if not any(size % (_FLOAT_SIZE * stride) == 0 for stride in sizes):
        counts = ", ".join(str(_FLOAT_SIZE * stride) for stride in sorted(sizes))
        raise format_error(
            path,
            f"{size} bytes are no multiple of {counts} (floats of 4 bytes per point); name the "
            "numbers of a point with columns= (--columns)",
            byte=size - size % _FLOAT_SIZE,
        )
    values = np.fromfile(path, "<f4").astype(np.float32, copy=False)
    if columns is None:
        names = _LAYOUTS[_stride_of(path, values)]
    rows = values.reshape(-1, len(names))
    found = _columns(rows, names)
    # A drive's scans are in the frame of the sensor.
    is_scan = columns is None and len(names) > 3
    if is_scan:
        found["range"] = np.sqrt((rows[:, :3].astype(np.float64) ** 2).sum(axis=1))
    viewpoints = np.zeros((1, 3)) if is_scan else None
    return cloud_from_columns(path, found, viewpoints=viewpoints, notes=Notes(path))
