"""Named columns of numbers to and from clouds: what PLY, PCD and text files have in common."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet._core import LARGEST_UNSHIFTED, RESERVED_NAMES, PointCloud
from surfabet.errors import InvalidInputError, LostAttributeWarning
from surfabet.io._crs import crs_name
from surfabet.io._files import format_error, warn
from surfabet.io._notes import HeldNotes, Notes

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
_FULL_LIGHTS = (1, 255, 65535)

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


@dataclass
class ColorFacts:
    """What is known of all numbers that stand for colours."""

    is_float: bool = False
    n_lit: int = 0
    """Values other than 0."""
    low: float = np.inf
    high: float = -np.inf
    is_integral: bool = True
    n_negative: int = 0
    n_beyond: dict[int, int] = field(default_factory=lambda: dict.fromkeys(_FULL_LIGHTS, 0))
    """Values beyond full brightness, for each that it may be."""
    has_low_bits: bool = False
    """Whether colours of 16 bits are more than 8 bits times 256."""

    def add(self, rows: Column) -> None:
        """Adds the colours of some points, finite numbers, (n, 3)."""
        lit = rows[rows != 0]
        self.is_float = self.is_float or rows.dtype.kind == "f"
        if len(rows):
            self.low = min(self.low, float(rows.min()))
            self.high = max(self.high, float(rows.max()))
        self.n_lit += len(lit)
        if rows.dtype.kind == "f":
            self.is_integral = self.is_integral and bool((lit == np.rint(lit)).all())
        self.n_negative += int((lit < 0).sum())
        for limit in _FULL_LIGHTS:
            self.n_beyond[limit] += int((lit > limit).sum())
        if not self.has_low_bits:
            whole = np.rint(np.clip(lit, 0, 65535)).astype(np.uint16)
            self.has_low_bits = bool((whole & 255).any())

    def largest(self) -> int | None:
        """What full brightness is: 1, 255 or 65535; `None` if these are no colours.

        It is the smallest of these that all but a few of the values, zeros aside, are within.
        """
        if self.n_lit == 0:
            return 255

        def is_few(n: int) -> bool:
            return n / self.n_lit <= _STRAY

        if not is_few(self.n_negative):
            return None
        limits: tuple[int, ...] = (255, 65535)
        if self.is_integral:
            # Integers to 1 are nearly black, unless a file of floats has only full and no light.
            if self.is_float and self.high <= 1:
                return 1
        else:
            limits = (1, 255)
            if not is_few(self.n_beyond[255]):
                limits = (65535,)
        # A lone value past the last limit is no stray colour: the column is another thing.
        if self.high > 65535:
            return None
        return next((limit for limit in limits if is_few(self.n_beyond[limit])), None)


def note_rounded(values: Column, colors: NDArray[np.uint8], full: float, notes: Notes) -> None:
    """Says that a file has finer colours than 8 bits, where different values became the same one.

    `values` (n, 3) have full brightness at `full`, and became `colors`. So nothing is noted of 8
    bits in wider fields, times 256, 257 or over 255.
    """
    for value, color in zip(values.T, colors.T, strict=True):
        # Any one of the values that became a colour stands for the others.
        one = np.zeros(256)
        one[color] = value
        if (np.abs(one[color] - value) > _SAME_COLOR * full / 255).any():
            notes.aside(DEEP_COLORS)
            return


def _color_rows(channels: Sequence[Column]) -> Column:
    """Colours that are not all of 8 bits as rows of finite numbers."""
    dtype = np.result_type(*channels)
    # Half precision does not reach 65535.
    rows = _stack(channels, np.float32 if dtype == np.float16 else dtype)
    return np.where(np.isfinite(rows), rows, 0) if rows.dtype.kind == "f" else rows


def colors_from(
    path: Path,
    channels: Iterable[Column],
    notes: Notes | None = None,
    facts: ColorFacts | None = None,
) -> NDArray[np.uint8]:
    """Colours of any numeric type as (n, 3) uint8; `facts` are of all points where these are not.

    Integers count to 255, or to 65535 if more than a few are larger than 255 (tools stretch by 257,
    or by 256); other numbers to 1, or to 255 or 65535 in the same way. A few values beyond are
    clipped, which is noted, as is what 8 bits do not hold. Values that are not finite become 0.
    """
    channels = list(channels)
    if all(c.dtype == np.uint8 for c in channels):
        return _stack(channels, np.uint8)
    rows = _color_rows(channels)
    if len(rows) == 0:
        return np.empty((0, 3), np.uint8)
    if facts is None:
        facts = ColorFacts()
        facts.add(rows)
    largest = facts.largest()
    if largest is None:
        raise format_error(
            path,
            f"colours lie between {facts.low:g} and {facts.high:g}; they must lie within 0..1, "
            "0..255 or 0..65535",
        )
    # Rounding may leave a little more than 1.
    beyond = int(((rows < 0) | (rows > largest * (1 + 1e-6))).sum())
    if beyond and notes is not None:
        notes.remark(f"colour values clipped to 0..{largest}", beyond)
    rows = np.clip(rows, 0, largest)
    colors = _of_8_bits(rows, largest, facts.has_low_bits)
    if notes is not None:
        note_rounded(rows, colors, largest, notes)
    return colors


def _of_8_bits(rows: Column, largest: int, has_low_bits: bool) -> NDArray[np.uint8]:
    """Values from 0 to 1, 255 or 65535 as colours; those of 16 bits by the factor they have."""
    if largest == 65535:
        values = np.rint(rows).astype(np.uint16)
        if not has_low_bits:
            return (values >> 8).astype(np.uint8)
        return ((values.astype(np.uint32) + 128) // 257).astype(np.uint8)
    if rows.dtype.kind == "f":
        rows = np.rint(rows * 255 if largest == 1 else rows)
    return rows.astype(np.uint8)


@dataclass
class _PackedFacts:
    """What is known of all numbers that hold colours in 32 bits."""

    is_digits: bool = True
    """Of floats: whether all are integers of 32 bits by their value."""
    low: float = np.inf
    high: float = -np.inf
    alpha: list[set[int]] = field(default_factory=lambda: [set(), set()])
    """Some of the different values of alpha, of the bits of floats and of their values."""

    def add(self, packed: Column) -> None:
        """Adds the numbers of some points."""
        if packed.dtype.itemsize < 4:
            return
        known = packed
        if packed.dtype.kind == "f":
            known = packed[np.isfinite(packed)]
            digits = (known >= 0) & (known < 2**32) & (known == np.rint(known))
            self.is_digits = self.is_digits and bool(digits.all())
        if len(known):
            self.low = min(self.low, float(known.min()))
            self.high = max(self.high, float(known.max()))
        for by_value, found in zip((False, True), self.alpha, strict=True):
            # Two different ones say all that is asked.
            if len(found) < 2 and (self.is_digits or not by_value):
                alpha = _bits(packed, by_value) >> 24
                found |= {int(alpha.min()), int(alpha.max())} if len(alpha) else set()

    @property
    def by_value(self) -> bool:
        """Whether floats have the value of the integer, not its bits."""
        return self.is_digits and self.high >= 1

    def are_colors(self, dtype: np.dtype[Any]) -> bool:
        """Whether numbers of this type fit 32 bits."""
        if dtype.kind == "f" or dtype.itemsize <= 4:
            return dtype.itemsize >= 4
        return not (self.low < 0 or self.high >= 2**32)

    def has_alpha(self, dtype: np.dtype[Any]) -> bool:
        """Whether alpha is not the same everywhere."""
        return len(self.alpha[dtype.kind == "f" and self.by_value]) > 1


def _bits(packed: Column, by_value: bool) -> NDArray[np.uint32]:
    """The 32 bits of numbers: integers, floats of the same bits, or, as text files have them,
    floats of the integer's value."""
    if packed.dtype.kind == "f" and not by_value:
        with np.errstate(over="ignore"):
            packed = packed.astype(np.float32)
    elif packed.dtype.kind == "f":
        packed = np.where(np.isfinite(packed), packed, 0)
    if packed.dtype.itemsize == 8 or by_value:
        packed = packed.astype(np.uint32)
    return np.ascontiguousarray(packed).view(np.uint32)


def _single(values: Column | None) -> Column | None:
    return None if values is None else values.astype(np.float32, copy=False)


def _note_beyond_single(intensities: Column, notes: Notes) -> None:
    """Says that intensities are integers with more digits than single precision has."""
    # The limits of 64 bits are no doubles, and would not come back.
    single = np.clip(intensities.astype(np.float32), -(2.0**62), 2.0**62)
    if (single.astype(intensities.dtype) != intensities).any():
        notes.aside("what intensities have beyond single precision")


@dataclass
class NoReturnFacts:
    """What tells whether points at exactly 0 0 0 stand for beams that met nothing."""

    n_zero: int = 0
    low: NDArray[np.float64] = field(default_factory=lambda: np.full(3, np.inf))
    high: NDArray[np.float64] = field(default_factory=lambda: np.full(3, -np.inf))
    near: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    """The nearest of the others."""
    near_squares: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """Squares of their distances from 0 0 0."""

    def add(self, points: Column) -> None:
        """Adds some points, (n, 3)."""
        zero = _at_zero(points)
        self.n_zero += int(np.count_nonzero(zero))
        # Column by column: of rows of three numbers numpy reduces one at a time.
        axes = [points[:, axis] for axis in range(3)]
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.add.reduce([axis.astype(np.float64) ** 2 for axis in axes])
        measured = np.isfinite(squares) & ~zero
        if not measured.all():
            axes, squares = [axis[measured] for axis in axes], squares[measured]
        if not len(squares):
            return
        self.low = np.minimum(self.low, [float(axis.min()) for axis in axes])
        self.high = np.maximum(self.high, [float(axis.max()) for axis in axes])
        limit = self.near_squares.max() if len(self.near) == _NEAR else np.inf
        nearer = np.flatnonzero(squares < limit)
        if len(nearer) > _NEAR:
            nearer = nearer[np.argpartition(squares[nearer], _NEAR - 1)[:_NEAR]]
        rows = np.stack([axis[nearer] for axis in axes], axis=1).astype(np.float64)
        near = np.concatenate([self.near, rows])
        near_squares = np.concatenate([self.near_squares, squares[nearer]])
        kept = np.argpartition(near_squares, min(_NEAR, len(near)) - 1)[:_NEAR]
        self.near, self.near_squares = near[kept], near_squares[kept]

    @property
    def are_none(self) -> bool:
        """Whether the points at 0 0 0 are no measurements."""
        if self.n_zero == 0 or len(self.near) == 0:
            return False
        if self.n_zero == 1:
            extent = float(np.linalg.norm(self.high - self.low))
            nearest = float(np.sqrt(self.near_squares.min()))
            return nearest > max(LARGEST_UNSHIFTED, extent)
        # Rounded coordinates put several measurements at one place.
        _, counts = np.unique(self.near, axis=0, return_counts=True)
        return bool(self.n_zero > counts.max())


def _at_zero(points: Column) -> NDArray[np.bool_]:
    """Which of (n, 3) points lie at exactly 0 0 0."""
    zero: NDArray[np.bool_] = np.zeros(len(points), bool)
    candidates = np.flatnonzero(points[:, 0] == 0)
    zero[candidates] = (points[candidates, 1:] == 0).all(axis=1)
    return zero


def no_returns(points: Column, facts: NoReturnFacts | None = None) -> NDArray[np.bool_]:
    """Which of (n, 3) points stand for beams that met nothing: those at exactly 0 0 0.

    That is where drivers put them. They are measurements if all points are there, or no more than
    at one of the other places near; a single one is, too, unless all others are farther than a
    kilometre and than their own extent. `facts` are of all points where these are a part.
    """
    zero = _at_zero(points)
    if facts is None and zero.any():
        facts = NoReturnFacts()
        facts.add(points)
    return zero if facts is not None and facts.are_none else np.zeros(len(points), bool)


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
    facts: NoReturnFacts | None = None,
) -> PointCloud:
    """The cloud of a file; says in one warning what of the file it has not.

    Points at exactly 0 0 0 are left out where they are no returns; with an `origin`, `points` are
    a cloud's own and stay as they are. `facts` are of all points where these are a part.
    """
    notes = Notes(path) if notes is None else notes
    per_point = [colors, intensities, normals, ranges, viewpoint_index]
    extra = dict(extra or {})
    if origin is None:
        empty = no_returns(points, facts)
        notes.left_out("at exactly 0 0 0 (no returns)", int(empty.sum()), len(points))
        if empty.any():
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
    notes.not_finite(len(points) - len(cloud), len(points), dropped)
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


def recorded(values: Column | None, what: str, notes: Notes) -> Column | None:
    """The values, or none where they are zero everywhere, which means that there were none."""
    if values is not None and len(values) and not values.any():
        notes.aside(f"{what}, which are 0 everywhere")
        return None
    return values


@dataclass
class _NormalFacts:
    """What is known of all vectors that may be normals."""

    n_finite: int = 0
    n_unit: int = 0
    is_zero: bool = True

    def add(self, rows: Column) -> None:
        """Adds the vectors of some points, (n, 3)."""
        self.is_zero = self.is_zero and not rows.any()
        with np.errstate(over="ignore", invalid="ignore"):
            lengths = np.sqrt((rows.astype(np.float64) ** 2).sum(axis=1))
        lengths = lengths[np.isfinite(lengths)]
        fits = (np.abs(lengths - 1) <= _UNIT_TOLERANCE) | (lengths <= 1e-6)
        self.n_finite += len(fits)
        self.n_unit += int(fits.sum())

    @property
    def are_normals(self) -> bool:
        """Whether they have lengths of 0 or 1, up to rounding and a few strays."""
        return self.n_finite == 0 or self.n_unit / self.n_finite >= 1 - _STRAY


def is_normals(rows: Column) -> bool:
    """Whether (n, 3) finite numbers have lengths of 0 or 1, up to rounding and a few strays."""
    facts = _NormalFacts()
    facts.add(rows)
    return facts.are_normals


@dataclass
class Facts:
    """What is known of all points of a file, by which the columns of each part are read alike."""

    n: int = 0
    zero: set[str] = field(default_factory=set)
    """Columns that may be intensities and are 0 so far."""
    negative: set[str] = field(default_factory=set)
    """Columns that may be ranges and are less than 0 somewhere."""
    colors: ColorFacts = field(default_factory=ColorFacts)
    packed: _PackedFacts = field(default_factory=_PackedFacts)
    normals: _NormalFacts = field(default_factory=_NormalFacts)
    no_returns: NoReturnFacts | None = None
    """Needed of parts only: a whole file is asked when it has a point at 0 0 0."""

    @classmethod
    def of(cls, parts: Iterable[Mapping[str, Column]]) -> Facts:
        """Of all parts of a file."""
        facts = cls(no_returns=NoReturnFacts())
        for columns in parts:
            facts.add(columns)
        return facts

    def add(self, columns: Mapping[str, Column]) -> None:
        """Adds the columns of some points, which all parts have."""
        found = _Columns(columns)
        first = self.n == 0
        if (position := found.keys3(_POSITION)) is not None:
            points = _points(found.take(position))
            self.n += len(points)
            if self.no_returns is not None:
                self.no_returns.add(points)
        for name, values in found.left.items():
            if name.lower() in _INTENSITY and (first or name in self.zero):
                (self.zero.discard if values.any() else self.zero.add)(name)
            if name.lower() in _RANGE and values.dtype.kind == "f" and (values < 0).any():
                self.negative.add(name)
        if (keys := found.keys3(_COLOR)) is not None:
            channels = [found.left[key] for key in keys]
            if any(channel.dtype != np.uint8 for channel in channels):
                self.colors.add(_color_rows(channels))
        elif (key := found.key(PACKED_COLOR)) is not None:
            self.packed.add(found.left[key])
        if (keys := found.keys3(_NORMAL)) is not None:
            self.normals.add(_stack((found.left[key] for key in keys), np.float32))


def _points(axes: list[Column]) -> Column:
    """Coordinates as rows, in single precision if the file has them so."""
    single = all(c.dtype.kind == "f" and c.dtype.itemsize <= 4 for c in axes)
    return _stack(axes, np.float32 if single else np.float64)


def _take_colors(path: Path, columns: _Columns, facts: Facts, notes: Notes) -> Column | None:
    colors: Column | None = None
    if (keys := columns.keys3(_COLOR)) is not None:
        colors = colors_from(path, columns.take(keys), notes, facts.colors)
    elif (key := columns.key(PACKED_COLOR)) is not None:
        packed = columns.left[key]
        if not facts.packed.are_colors(packed.dtype):
            return None
        del columns.left[key]
        bits = _bits(packed, packed.dtype.kind == "f" and facts.packed.by_value)
        blue, green, red, alpha = ((bits >> shift).astype(np.uint8) for shift in (0, 8, 16, 24))
        colors = _stack([red, green, blue], np.uint8)
        if facts.packed.has_alpha(packed.dtype):
            add_columns(columns.left, {"alpha": alpha}, notes)
    return colors


def _take_normals(columns: _Columns, facts: _NormalFacts, notes: Notes) -> Column | None:
    if (keys := columns.keys3(_NORMAL)) is None:
        return None
    if not facts.are_normals:
        notes.remark(f"{', '.join(keys)} are no unit vectors and are kept as columns, not normals")
        return None
    rows = _stack(columns.take(keys), np.float32)
    if facts.is_zero and len(rows):
        notes.aside("normals, which are 0 everywhere")
        return None
    return rows


def _take_intensities(columns: _Columns, facts: Facts, notes: Notes) -> Column | None:
    """The first column of this meaning that is not zero everywhere."""
    empty: list[str] = []
    while (key := columns.key(_INTENSITY)) is not None:
        (values,) = columns.take([key])
        if facts.n == 0 or key not in facts.zero:
            break
        empty.append(key)
    for name in empty:
        notes.aside(f"{name}, which is 0 everywhere")
    return None if key is None else values


def _take_ranges(columns: _Columns, facts: Facts) -> Column | None:
    """Distances in metres; drivers write integer ranges in units of their own."""
    if (key := columns.key(_RANGE)) is None:
        return None
    if columns.left[key].dtype.kind != "f" or key in facts.negative:
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
    facts: Facts | None = None,
) -> PointCloud:
    """The cloud that columns of equal length describe, found by the names that tools give them.

    `viewpoints` is the (m, 3) table for a column `viewpoint_index`; without such a column it holds
    one row for all points. Columns of other names are kept as extra columns. `facts` are of all
    points where these are a part.
    """
    notes = Notes(path) if notes is None else notes
    if facts is None:
        facts = Facts()
        facts.add(columns)
    found = _Columns(columns)
    position = found.keys3(_POSITION)
    if position is None:
        raise format_error(path, f"no columns x, y and z among {sorted(columns) or 'none at all'}")
    points = _points(found.take(position))
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
        colors=_take_colors(path, found, facts, notes),
        normals=_take_normals(found, facts.normals, notes),
        intensities=_take_intensities(found, facts, notes),
        ranges=_take_ranges(found, facts),
        viewpoints=viewpoints if index is not None else None,
        viewpoint_index=index,
        extra=_extra(found, notes),
        crs=crs,
        notes=notes,
        facts=facts.no_returns,
    )


Part = tuple[Mapping[str, Column], Column | None]
"""Columns of some points of a file, and the table of their viewpoints where it is known."""


def clouds_of_parts(
    path: Path, parts: Callable[[Notes], Iterator[Part]], notes: HeldNotes | None = None
) -> Iterator[PointCloud]:
    """The clouds of the parts of a file, which are read twice: first for what is known of all.

    What is to say, also what `notes` have, is said at the end.
    """
    notes = HeldNotes(path) if notes is None else notes
    facts = Facts.of(columns for columns, _ in parts(HeldNotes(path)))
    for columns, viewpoints in parts(notes):
        yield cloud_from_columns(path, columns, viewpoints=viewpoints, notes=notes, facts=facts)
    notes.release()


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
