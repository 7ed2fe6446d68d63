"""Named columns of numbers to and from clouds: what PLY, PCD and text files have in common."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet._core import LARGEST_UNSHIFTED, RESERVED_NAMES, PointCloud
from surfabet.errors import InvalidInputError, LostAttributeWarning
from surfabet.io._crs import crs_name
from surfabet.io._files import format_error, warn
from surfabet.io._notes import Notes

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
PACKED_COLOR = ("rgb", "rgba")
_INTENSITY = ("intensity", "scalar_intensity", "reflectance", "remission", "reflectivity", "i")
_RANGE = ("range", "scalar_range")
_VIEWPOINT = ("vp_x",), ("vp_y",), ("vp_z",)
VIEWPOINT_INDEX = "viewpoint_index"

KNOWN_NAMES = frozenset(
    name
    for names in (*_POSITION, *_NORMAL, *_COLOR, PACKED_COLOR, _INTENSITY, _RANGE, *_VIEWPOINT)
    for name in names
) | {VIEWPOINT_INDEX}

# Exported values are rounded, to three decimals and more, and some are wrong; a column of which
# more than this share is beyond a limit is of another kind.
_STRAY = 0.05
_UNIT_TOLERANCE = 0.05
# Steps of 8 bits; more than the rounding of single precision, less than a step of 16 bits.
_SAME_COLOR = 1e-3

DEEP_COLORS = "what colours have beyond 8 bits per channel"
"""What clouds do not keep of deeper colours, for messages."""

# Longer than any descriptor of points in use (640 values); what is longer is padding or an image.
MOST_VALUES = 1024
# Points that are looked at for how many measurements share a place.
_NEAR = 1000


class _Columns:
    """The columns of a file by name; what is taken is no longer there."""

    def __init__(self, columns: Mapping[str, Column]) -> None:
        self.left = dict(columns)

    def key(self, names: Iterable[str]) -> str | None:
        """How the file spells the first of `names` that it has; the exact spelling goes first."""
        for name in names:
            if name in self.left:
                return name
            if (key := next((k for k in self.left if k.lower() == name), None)) is not None:
                return key
        return None

    def keys3(self, names: Iterable[Iterable[str]]) -> list[str] | None:
        found = [key for key in map(self.key, names) if key is not None]
        return found if len(found) == 3 else None

    def take(self, keys: Iterable[str]) -> list[Column]:
        return [self.left.pop(key) for key in keys]


def _stack(columns: Iterable[Column], dtype: Any) -> Column:
    columns = list(columns)
    rows = np.empty((len(columns[0]), len(columns)), dtype)
    with np.errstate(over="ignore", invalid="ignore"):
        for axis, column in enumerate(columns):
            rows[:, axis] = column
    return rows


def _largest_color(rows: Column) -> int | None:
    """What full brightness is in these colours: 1, 255 or 65535; `None` if they are no colours.

    It is the smallest of these that all but a few of the values, zeros aside, are within.
    """
    lit = rows[rows != 0]
    if len(lit) == 0:
        return 255
    integral = rows.dtype.kind != "f" or bool((lit == np.rint(lit)).all())
    if (lit < 0).mean() > _STRAY:
        return None
    limits: tuple[int, ...] = (255, 65535)
    if integral:
        # Integers to 1 are nearly black, unless a file of floats has only full and no light.
        if rows.dtype.kind == "f" and lit.max() <= 1:
            return 1
    else:
        limits = (1, 255)
        if lit.max() > 255 and (lit > 255).mean() > _STRAY:
            limits = (65535,)
    # A lone value past the last limit is no stray colour: the column is another thing.
    if lit.max() > 65535:
        return None
    return next((limit for limit in limits if (lit > limit).mean() <= _STRAY), None)


def note_rounded(values: Column, colors: NDArray[np.uint8], full: float, notes: Notes) -> None:
    """Says that a file has finer colours than 8 bits, where different values became the same one.

    `values` (n, 3) have full brightness at `full`, and became `colors`. So nothing is said of 8
    bits in wider fields, times 256, 257 or over 255.
    """
    for value, color in zip(values.T, colors.T, strict=True):
        # Any one of the values that became a colour stands for the others.
        one = np.zeros(256)
        one[color] = value
        if (np.abs(one[color] - value) > _SAME_COLOR * full / 255).any():
            notes.aside(DEEP_COLORS)
            return


def colors_from(
    path: Path, channels: Iterable[Column], notes: Notes | None = None
) -> NDArray[np.uint8]:
    """Colours of any numeric type as (n, 3) uint8.

    Integers count to 255, or to 65535 if more than a few are larger than 255 (tools stretch by 257,
    or by 256); other numbers to 1, or to 255 or 65535 in the same way. A few values beyond are
    clipped, which is noted, as is what 8 bits do not hold. Values that are not finite become 0.
    """
    channels = list(channels)
    if all(c.dtype == np.uint8 for c in channels):
        return _stack(channels, np.uint8)
    dtype = np.result_type(*channels)
    # Half precision does not reach 65535.
    rows = _stack(channels, np.float32 if dtype == np.float16 else dtype)
    if len(rows) == 0:
        return np.empty((0, 3), np.uint8)
    if rows.dtype.kind == "f":
        rows = np.where(np.isfinite(rows), rows, 0)
    largest = _largest_color(rows)
    if largest is None:
        raise format_error(
            path,
            f"colours lie between {rows.min()} and {rows.max()}; they must lie within 0..1, 0..255 "
            "or 0..65535",
        )
    # Rounding may leave a little more than 1.
    beyond = int(((rows < 0) | (rows > largest * (1 + 1e-6))).sum())
    if beyond and notes is not None:
        notes.remark(f"colour values clipped to 0..{largest}", beyond)
    rows = np.clip(rows, 0, largest)
    colors = _of_8_bits(rows, largest)
    if notes is not None:
        note_rounded(rows, colors, largest, notes)
    return colors


def _of_8_bits(rows: Column, largest: int) -> NDArray[np.uint8]:
    """Values from 0 to 1, 255 or 65535 as colours; those of 16 bits by the factor they have."""
    if largest == 65535:
        values = np.rint(rows).astype(np.uint16)
        if not (values & 255).any():
            return (values >> 8).astype(np.uint8)
        return ((values.astype(np.uint32) + 128) // 257).astype(np.uint8)
    if rows.dtype.kind == "f":
        rows = np.rint(rows * 255 if largest == 1 else rows)
    return rows.astype(np.uint8)


def _unpacked(packed: Column) -> list[Column] | None:
    """Blue, green, red and alpha of colours in the bits of one number of 32 bits.

    The number may be an integer, a float of the same bits, or a float of the integer's value, as
    text files have it.
    """
    if packed.dtype.itemsize < 4:
        return None
    if packed.dtype.kind == "f":
        known = packed[np.isfinite(packed)]
        digits = (known >= 0) & (known < 2**32) & (known == np.rint(known))
        if len(known) and digits.all() and known.max() >= 1:
            packed = np.where(np.isfinite(packed), packed, 0).astype(np.uint32)
        else:
            with np.errstate(over="ignore"):
                packed = packed.astype(np.float32)
    if packed.dtype.itemsize == 8:
        if len(packed) and (packed.min() < 0 or packed.max() >= 2**32):
            return None
        packed = packed.astype(np.uint32)
    bits = np.ascontiguousarray(packed).view(np.uint32)
    return [(bits >> shift).astype(np.uint8) for shift in (0, 8, 16, 24)]


def _single(values: Column | None) -> Column | None:
    return None if values is None else values.astype(np.float32, copy=False)


def _note_beyond_single(intensities: Column, notes: Notes) -> None:
    """Says that intensities are integers with more digits than single precision has."""
    # The limits of 64 bits are no doubles, and would not come back.
    single = np.clip(intensities.astype(np.float32), -(2.0**62), 2.0**62)
    if (single.astype(intensities.dtype) != intensities).any():
        notes.aside("what intensities have beyond single precision")


def no_returns(points: Column) -> NDArray[np.bool_]:
    """Which of (n, 3) points stand for beams that met nothing: those at exactly 0 0 0.

    That is where drivers put them. They are measurements if all points are there, or no more than
    at one of the other places near; a single one is, too, unless all others are farther than a
    kilometre and than their own extent.
    """
    zero: NDArray[np.bool_] = np.zeros(len(points), bool)
    none = zero.copy()
    candidates = np.flatnonzero(points[:, 0] == 0)
    zero[candidates] = (points[candidates, 1:] == 0).all(axis=1)
    found = int(zero.sum())
    if found == 0:
        return none
    others = points[~zero]
    others = others[np.isfinite(others).all(axis=1)].astype(np.float64)
    if len(others) == 0:
        return none
    squares = (others**2).sum(axis=1)
    if found == 1:
        extent = float(np.linalg.norm(others.max(axis=0) - others.min(axis=0)))
        return zero if np.sqrt(squares.min()) > max(LARGEST_UNSHIFTED, extent) else none
    # Rounded coordinates put several measurements at one place.
    near = np.argpartition(squares, min(_NEAR, len(others)) - 1)[:_NEAR]
    _, counts = np.unique(others[near], axis=0, return_counts=True)
    return zero if found > counts.max() else none


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
    extra: Mapping[str, Column] | None = None,
    crs: str | None = None,
    origin: Column | None = None,
    notes: Notes | None = None,
) -> PointCloud:
    """The cloud of a file; says in one warning what of the file it has not.

    Points at exactly 0 0 0 are left out where they are no returns; with an `origin`, `points` are
    a cloud's own and stay as they are.
    """
    notes = Notes(path) if notes is None else notes
    per_point = [colors, intensities, normals, ranges, viewpoint_index]
    extra = dict(extra or {})
    if origin is None and (empty := no_returns(points)).any():
        notes.left_out("at exactly 0 0 0 (no returns)", int(empty.sum()), len(points))
        points = points[~empty]
        per_point = [None if column is None else column[~empty] for column in per_point]
        extra = {name: column[~empty] for name, column in extra.items()}
    colors, intensities, normals, ranges, viewpoint_index = per_point
    if intensities is not None and intensities.dtype.kind in "iu":
        _note_beyond_single(intensities, notes)
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
                extra=extra,
                crs=crs,
                origin=None if origin is None else [float(c) for c in origin],
            )
    except InvalidInputError as error:
        raise format_error(path, str(error)) from error
    if dropped is not None:
        notes.points(dropped)
    notes.warn()
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


def _take_colors(path: Path, columns: _Columns, notes: Notes) -> Column | None:
    colors: Column | None = None
    if (keys := columns.keys3(_COLOR)) is not None:
        colors = colors_from(path, columns.take(keys), notes)
    elif (key := columns.key(PACKED_COLOR)) is not None:
        channels = _unpacked(columns.left[key])
        if channels is None:
            return None
        del columns.left[key]
        *bgr, alpha = channels
        colors = _stack(bgr[::-1], np.uint8)
        if len(alpha) and (alpha != alpha[0]).any():
            add_columns(columns.left, {"alpha": alpha}, notes)
    return colors


def recorded(values: Column | None, what: str, notes: Notes) -> Column | None:
    """The values, or none where they are zero everywhere, which means that there were none."""
    if values is not None and len(values) and not values.any():
        notes.aside(f"{what}, which are 0 everywhere")
        return None
    return values


def is_normals(rows: Column) -> bool:
    """Whether (n, 3) finite numbers have lengths of 0 or 1, up to rounding and a few strays."""
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.sqrt((rows.astype(np.float64) ** 2).sum(axis=1))
    lengths = lengths[np.isfinite(lengths)]
    fits = (np.abs(lengths - 1) <= _UNIT_TOLERANCE) | (lengths <= 1e-6)
    return bool(fits.mean() >= 1 - _STRAY) if len(fits) else True


def _take_normals(columns: _Columns, notes: Notes) -> Column | None:
    if (keys := columns.keys3(_NORMAL)) is None:
        return None
    rows = _stack((columns.left[key] for key in keys), np.float32)
    if not is_normals(rows):
        notes.remark(f"{', '.join(keys)} are no unit vectors and are kept as columns, not normals")
        return None
    columns.take(keys)
    return recorded(rows, "normals", notes)


def _take_intensities(columns: _Columns, notes: Notes) -> Column | None:
    """The first column of this meaning that is not zero everywhere."""
    empty: list[str] = []
    while (key := columns.key(_INTENSITY)) is not None:
        (values,) = columns.take([key])
        if values.any() or len(values) == 0:
            break
        empty.append(key)
    for name in empty:
        notes.aside(f"{name}, which is 0 everywhere")
    return None if key is None else values


def _take_ranges(columns: _Columns) -> Column | None:
    """Distances in metres; drivers write integer ranges in units of their own."""
    if (key := columns.key(_RANGE)) is None:
        return None
    values = columns.left[key]
    if values.dtype.kind != "f" or (values < 0).any():
        return None
    return columns.left.pop(key)


def _extra(columns: _Columns, notes: Notes) -> dict[str, Column]:
    """All other columns under their own names, which must not be those of the cloud itself."""
    extra: dict[str, Column] = {}
    for name, column in columns.left.items():
        free = name
        while free in RESERVED_NAMES or free in extra or not free:
            free += "_"
        if free != name:
            notes.remark(f"column {name!r} is called {free!r} here")
        extra[free] = column
    return extra


def cloud_from_columns(
    path: Path,
    columns: Mapping[str, Column],
    *,
    viewpoints: Column | None = None,
    crs: str | None = None,
    notes: Notes | None = None,
) -> PointCloud:
    """The cloud that columns of equal length describe, found by the names that tools give them.

    `viewpoints` is the (m, 3) table for a column `viewpoint_index`; without such a column it holds
    one row for all points. Columns of other names are kept as extra columns.
    """
    notes = Notes(path) if notes is None else notes
    found = _Columns(columns)
    position = found.keys3(_POSITION)
    if position is None:
        raise format_error(path, f"no columns x, y and z among {sorted(columns) or 'none at all'}")
    axes = found.take(position)
    single = all(c.dtype.kind == "f" and c.dtype.itemsize <= 4 for c in axes)
    points = _stack(axes, np.float32 if single else np.float64)
    index: Column | None = None
    if (keys := found.keys3(_VIEWPOINT)) is not None:
        rows = _stack(found.take(keys), np.float64)
        finite = np.isfinite(points).all(axis=1)
        if not finite.all():
            # The viewpoint of a point that goes does not matter.
            rows[~finite] = rows[np.argmax(finite)] if finite.any() else 0
        viewpoints, index = _table(path, rows)
    elif viewpoints is not None:
        key = found.key([VIEWPOINT_INDEX])
        index = None if key is None else found.left.pop(key)
        if index is None and len(viewpoints) == 1:
            index = np.zeros(len(points), np.uint32)
        elif index is None or index.dtype.kind not in "iu":
            raise format_error(path, f"{len(viewpoints)} viewpoints without a {VIEWPOINT_INDEX}")
    return build_cloud(
        path,
        points,
        colors=_take_colors(path, found, notes),
        normals=_take_normals(found, notes),
        intensities=_take_intensities(found, notes),
        ranges=_take_ranges(found),
        viewpoints=viewpoints if index is not None else None,
        viewpoint_index=index,
        extra=_extra(found, notes),
        crs=crs,
        notes=notes,
    )


def lists_of(name: str, rows: Column, notes: Notes) -> dict[str, Column]:
    """The (n, k) values of a field as columns `name_0`, `name_1`, ...; too many are left aside."""
    if rows.shape[1] > MOST_VALUES:
        notes.aside(f"{name} of {rows.shape[1]:,} values per point")
        return {}
    return {f"{name}_{k}": rows[:, k] for k in range(rows.shape[1])}


def add_columns(
    columns: dict[str, Column], others: Mapping[str, Column], notes: Notes
) -> dict[str, Column]:
    """Adds the others whose names are still free, and says which are not."""
    for name, column in others.items():
        if name in columns:
            notes.aside(f"a second column {name:.40}")
        else:
            columns[name] = column
    return columns


def written_names(cloud: PointCloud) -> dict[str, str]:
    """For each extra column of a cloud its name in files of text headers.

    White space and separators become `_`; names that built-in columns have get one at the end.
    """
    names: dict[str, str] = {}
    taken = {name for names in (*_POSITION, *_VIEWPOINT) for name in names} | {VIEWPOINT_INDEX}
    if cloud.normals is not None:
        taken |= {name for names in _NORMAL for name in names}
    if cloud.colors is not None:
        taken |= {names[0] for names in _COLOR} | set(PACKED_COLOR)
    taken |= {_INTENSITY[0]} if cloud.intensities is not None else set()
    taken |= {_RANGE[0]} if cloud.ranges is not None else set()
    for name in cloud.extra:
        written = re.sub(r"[\s,;\x00-\x1f\x7f]", "_", name)
        while written in taken:
            written += "_"
        taken.add(written)
        names[name] = written
    return names


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
    extra = cloud.extra
    return columns | {written: extra[name] for name, written in written_names(cloud).items()}


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


def lost_crs(cloud: PointCloud) -> list[str]:
    """The coordinate reference system of a cloud, as formats name it that do not hold any."""
    return [] if cloud.crs is None else [f"the coordinate reference system ({crs_name(cloud.crs)})"]


def warn_lost(
    path: Path,
    format_name: str,
    lost: Iterable[str],
    *,
    renamed: Mapping[str, str] | None = None,
    remarks: Iterable[str] = (),
) -> None:
    """One warning for what a file of this format does not hold, or holds under another name."""
    parts = []
    if names := list(lost):
        parts.append(f"{format_name} files do not hold {', '.join(names)}")
    changed = [f"{a!r} is {b!r}" for a, b in (renamed or {}).items() if a != b]
    if changed:
        parts.append(f"renamed columns: {', '.join(changed)}")
    if parts := [*parts, *remarks]:
        warn(f"{path}: {'; '.join(parts)}", LostAttributeWarning)
