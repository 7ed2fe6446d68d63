"""Named columns of numbers to and from clouds: what PLY, PCD and text files have in common."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.errors import DroppedPointsWarning, InvalidInputError, LostAttributeWarning
from surfabet.io._files import format_error, warn

Column = NDArray[Any]

# The first name is the one that we write; the others are what point cloud tools write, in lower
# case.
_POSITION = ("x",), ("y",), ("z",)
_NORMAL = (
    ("nx", "normal_x", "normalx"),
    ("ny", "normal_y", "normaly"),
    ("nz", "normal_z", "normalz"),
)
_COLOR = (
    ("red", "r", "diffuse_red"),
    ("green", "g", "diffuse_green"),
    ("blue", "b", "diffuse_blue"),
)
_INTENSITY = ("intensity", "scalar_intensity", "reflectance", "remission", "reflectivity", "i")
_RANGE = ("range", "scalar_range")
_VIEWPOINT = ("vp_x",), ("vp_y",), ("vp_z",)
VIEWPOINT_INDEX = "viewpoint_index"

KNOWN_NAMES = frozenset(
    name
    for names in (*_POSITION, *_NORMAL, *_COLOR, _INTENSITY, _RANGE, *_VIEWPOINT)
    for name in names
) | {VIEWPOINT_INDEX}


def _pick(columns: Mapping[str, Column], names: Iterable[str]) -> Column | None:
    return next((columns[name] for name in names if name in columns), None)


def _pick3(
    columns: Mapping[str, Column], names: Iterable[Iterable[str]]
) -> tuple[Column, Column, Column] | None:
    found = [column for column in (_pick(columns, n) for n in names) if column is not None]
    return (found[0], found[1], found[2]) if len(found) == 3 else None


def _stack(columns: tuple[Column, Column, Column], dtype: Any) -> Column:
    rows = np.empty((len(columns[0]), 3), dtype)
    with np.errstate(over="ignore", invalid="ignore"):
        for axis, column in enumerate(columns):
            rows[:, axis] = column
    return rows


def colors_from(path: Path, channels: tuple[Column, Column, Column]) -> NDArray[np.uint8]:
    """Colours of any numeric type as (n, 3) uint8.

    Integers count to 255, or to 65535 if any is larger than 255 (tools stretch by 257, or by 256);
    floating-point values to 1, or to 255 if any is larger than 1. Values that are not finite become
    0.
    """
    if all(c.dtype == np.uint8 for c in channels):
        return _stack(channels, np.uint8)
    rows = _stack(channels, np.result_type(*channels))
    if len(rows) == 0:
        return np.empty((0, 3), np.uint8)
    floating = rows.dtype.kind == "f"
    if floating:
        rows = np.where(np.isfinite(rows), rows, 0)
    low, high = rows.min(), rows.max()
    if low < 0 or high > (255 if floating else 65535):
        raise format_error(
            path, f"colours lie between {low} and {high}; they must lie within 0..1 or 0..255"
        )
    if floating:
        scale = 255 if high <= 1 else 1
        rows = np.rint(rows * scale)
    elif high > 255 and not (rows & 255).any():
        rows = rows >> 8
    elif high > 255:
        rows = (rows.astype(np.uint32) + 128) // 257
    return rows.astype(np.uint8)


def _single(values: Column | None) -> Column | None:
    return None if values is None else values.astype(np.float32, copy=False)


def build_cloud(
    path: Path,
    points: Column,
    *,
    colors: Column | None = None,
    intensities: Column | None = None,
    normals: Column | None = None,
    ranges: Column | None = None,
    viewpoints: Column | None = None,
    viewpoint_index: Column | None = None,
    origin: Column | None = None,
) -> PointCloud:
    """The cloud of a file; says in one warning what of it was not finite and had to go."""
    try:
        # What overflows single precision is not finite.
        with np.errstate(over="ignore", invalid="ignore"):
            cloud, dropped = PointCloud.checked(
                points,
                colors=colors,
                intensities=_single(intensities),
                normals=_single(normals),
                ranges=_single(ranges),
                viewpoints=viewpoints,
                viewpoint_index=viewpoint_index,
                origin=None if origin is None else [float(c) for c in origin],
            )
    except InvalidInputError as error:
        raise format_error(path, str(error)) from error
    if dropped is not None:
        warn(f"{path}: {dropped}", DroppedPointsWarning)
    return cloud


def _table(path: Path, rows: Column) -> tuple[Column | None, Column | None]:
    """The distinct rows in order of their first appearance, and the row of each point."""
    if len(rows) == 0:
        return None, None
    if not np.isfinite(rows).all():
        raise format_error(path, "a viewpoint (vp_x, vp_y, vp_z) is not finite")
    if (rows == rows[0]).all():
        return rows[:1], np.zeros(len(rows), np.uint32)
    distinct, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), np.uint32)
    rank[order] = np.arange(len(order), dtype=np.uint32)
    return distinct[order], rank[inverse.reshape(-1)]


def cloud_from_columns(
    path: Path, columns: Mapping[str, Column], *, viewpoints: Column | None = None
) -> PointCloud:
    """The cloud that columns of equal length describe, found by the names that tools give them.

    `viewpoints` is the (m, 3) table for a column `viewpoint_index`; without such a column it holds
    one row for all points. Columns of other names are left aside.
    """
    columns = {name.lower(): column for name, column in reversed(list(columns.items()))}
    position = _pick3(columns, _POSITION)
    if position is None:
        raise format_error(path, f"no columns x, y and z among {sorted(columns) or 'none at all'}")
    single = all(c.dtype.kind == "f" and c.dtype.itemsize <= 4 for c in position)
    points = _stack(position, np.float32 if single else np.float64)

    color = _pick3(columns, _COLOR)
    normal = _pick3(columns, _NORMAL)
    ranges = _pick(columns, _RANGE)
    index = columns.get(VIEWPOINT_INDEX)
    viewpoint = _pick3(columns, _VIEWPOINT)
    if viewpoint is not None:
        rows = _stack(viewpoint, np.float64)
        finite = np.isfinite(points).all(axis=1)
        if not finite.all():
            # The viewpoint of a point that goes does not matter.
            rows[~finite] = rows[np.argmax(finite)] if finite.any() else 0
        viewpoints, index = _table(path, rows)
    elif viewpoints is None:
        index = None
    elif index is None and len(viewpoints) == 1:
        index = np.zeros(len(points), np.uint32)
    elif index is None or index.dtype.kind not in "iu":
        raise format_error(path, f"{len(viewpoints)} viewpoints without a {VIEWPOINT_INDEX}")
    return build_cloud(
        path,
        points,
        colors=None if color is None else colors_from(path, color),
        intensities=_pick(columns, _INTENSITY),
        normals=None if normal is None else _stack(normal, np.float32),
        # Drivers write integer ranges in units of their own.
        ranges=ranges if ranges is not None and ranges.dtype.kind == "f" else None,
        viewpoints=viewpoints if index is not None else None,
        viewpoint_index=index,
    )


def columns_from_cloud(cloud: PointCloud) -> dict[str, Column]:
    """The columns of a cloud without its viewpoints, under the names that we write.

    World coordinates are float64 where the cloud has an origin, else its own float32.
    """
    points: Column = cloud.points if any(cloud.origin) else cloud.local_points
    columns: dict[str, Column] = {name: points[:, a] for a, (name,) in enumerate(_POSITION)}
    if (normals := cloud.normals) is not None:
        columns |= {names[0]: normals[:, a] for a, names in enumerate(_NORMAL)}
    if (colors := cloud.colors) is not None:
        columns |= {names[0]: colors[:, a] for a, names in enumerate(_COLOR)}
    if (intensities := cloud.intensities) is not None:
        columns[_INTENSITY[0]] = intensities
    if (ranges := cloud.ranges) is not None:
        columns[_RANGE[0]] = ranges
    return columns


def viewpoint_columns(cloud: PointCloud) -> dict[str, Column]:
    """One sensor position per point, for formats without tables; float32 where that is exact."""
    if cloud.viewpoints is None or cloud.viewpoint_index is None:
        return {}
    table: Column = cloud.viewpoints
    if (table == table.astype(np.float32)).all():
        table = table.astype(np.float32)
    rows = table[cloud.viewpoint_index]
    return {name: rows[:, a] for a, (name,) in enumerate(_VIEWPOINT)}


def records(columns: Mapping[str, Column]) -> Column:
    """The columns as one packed little-endian structured array."""
    dtype = np.dtype([(name, c.dtype.newbyteorder("<")) for name, c in columns.items()])
    rows = np.empty(len(next(iter(columns.values()))), dtype)
    for name, column in columns.items():
        rows[name] = column
    return rows


def warn_lost(path: Path, format_name: str, lost: Iterable[str]) -> None:
    """One line for what a file of this format does not hold."""
    if names := list(lost):
        warn(f"{path}: {format_name} files do not hold {', '.join(names)}", LostAttributeWarning)
