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
from surfabet.errors import InvalidInputError
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
_ENOUGH = 600
# Numbers that are looked at; the rest is alike.
_LOOKED_AT = 1_000_000
# Columns that explain this share of what the best number per point explains are as good: a multiple
# of the right number explains no less.
_AS_GOOD = 0.8


def _fits(values: NDArray[np.float32], stride: int) -> bool:
    """Whether columns of this many numbers lie where coordinates, intensities and rings lie."""
    rows = values.reshape(-1, stride)
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows) < 0.5 * len(values) / stride:
        return False
    if (np.abs(rows[:, :3]) > _FARTHEST).any():
        return False
    if ((rows != 0) & (np.abs(rows) < _SMALLEST)).mean() > 0.01:
        return False
    if stride >= 4 and len(rows) and (rows[:, 3].min() < 0 or rows[:, 3].max() > 65535):
        return False
    ring = rows[:, 4] if stride >= 5 else rows[:, :0]
    return not ((ring != np.rint(ring)) | (ring < 0) | (ring >= _MOST_RINGS)).any()


def _explained(values: NDArray[np.float32], stride: int) -> float:
    """How much columns of this many numbers differ from each other.

    It is the share of the variance between columns in that of all numbers, of the numbers
    themselves or of their logarithms, whichever is larger.
    """
    rows = values[: len(values) // stride * stride].reshape(-1, stride).astype(np.float64)
    rows = np.clip(np.nan_to_num(rows, nan=0.0), -_FARTHEST, _FARTHEST)
    shares = []
    for numbers in (rows, np.log(np.abs(rows) + 1e-3)):
        total = numbers.var()
        shares.append(float(numbers.mean(axis=0).var() / total) if total > 0 else 0.0)
    # What columns of chance have.
    return max(shares) - (stride - 1) / len(values)


def _stride_of(path: Path, values: NDArray[np.float32]) -> int:
    """How many numbers a point has, or an error that says how to name them."""
    remedy = "name the numbers of a point with columns= (--columns), such as x y z intensity"
    divides = [stride for stride in _LAYOUTS if len(values) % stride == 0]
    fitting = [stride for stride in divides if _fits(values, stride)]
    if not fitting:
        tried = " or ".join(str(stride) for stride in divides)
        raise format_error(
            path,
            f"{tried} floats per point (of 3 x y z, 4 KITTI, 5 nuScenes) are no coordinates to "
            f"{_FARTHEST:g} m with intensities and rings; {remedy}",
            byte=0,
        )
    looked_at = values[:_LOOKED_AT]
    if len(looked_at) >= _ENOUGH:
        explained = {s: _explained(looked_at, s) for s in _STRIDES if len(values) % s == 0}
        best = max(explained.values())
        told = min(s for s, share in explained.items() if share >= _AS_GOOD * best)
        # What chance explains is a few times the number of columns over that of numbers.
        if best > 10 * max(_STRIDES) / len(looked_at):
            fitting = [told] if told in fitting else []
    if len(fitting) > 1 and 3 in fitting:
        # Any numbers can be coordinates.
        fitting.remove(3)
    if len(fitting) != 1:
        raise format_error(path, f"cannot tell how many floats belong to a point; {remedy}", byte=0)
    return fitting[0]


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
            raise InvalidInputError(
                f"columns are {list(names)}, but must name x, y and z, and each once"
            )
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
