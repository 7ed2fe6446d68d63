"""COPC: LAZ files whose points lie in an octree; a region or the coarse levels can be read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet._core import PointCloud
from surfabet.errors import wrong_value
from surfabet.io._files import format_error
from surfabet.io.las import LasChoice, LasPoints, read_las, read_las_points

# The user id of the first variable record, behind its reserved bytes.
_MARK_AT, _MARK = 375 + 2, b"copc\0"
_ENTRY = np.dtype(
    [
        ("key", "<i4", 4),
        ("offset", "<u8"),
        ("size", "<i4"),
        ("count", "<i4"),
    ]
)
# The count of an entry that is on a page of its own.
_ON_A_PAGE = -1


def has_copc_mark(start: bytes) -> bool:
    """Whether a LAS file that begins with these bytes is COPC."""
    return start[_MARK_AT:].startswith(_MARK)


def is_copc(path: Path) -> bool:
    """Whether a LAS file is COPC."""
    with path.open("rb") as file:
        return has_copc_mark(file.read(_MARK_AT + len(_MARK)))


def _check_hierarchy(path: Path, info: Any, n_points: int) -> None:
    """Walks all pages of the octree, so that no page is read twice and no count is false."""
    size = path.stat().st_size
    pages = [(int(info.hierarchy_root_offset), int(info.hierarchy_root_size), None)]
    seen: set[int] = set()
    total = 0
    with path.open("rb") as file:
        while pages:
            at, length, key = pages.pop()
            if at in seen or length <= 0 or length % _ENTRY.itemsize or at + length > size:
                raise format_error(
                    path, f"a page of the octree of {length} bytes is no page", byte=at
                )
            seen.add(at)
            file.seek(at)
            entries = np.frombuffer(file.read(length), _ENTRY)
            here = entries["count"] != _ON_A_PAGE
            if key is not None and not (entries["key"][here] == key).all(axis=1).any():
                raise format_error(path, "a page of the octree lacks its first cell", byte=at)
            chunks = entries[here & (entries["count"] != 0)]
            if (chunks["count"] < 0).any() or (chunks["size"] < 0).any():
                raise format_error(path, "a cell of the octree has a negative size", byte=at)
            ends = chunks["offset"].astype(np.float64) + chunks["size"]
            total += int(chunks["count"].sum(dtype=np.int64))
            if total > n_points or (ends > size).any():
                raise format_error(path, "the octree has more points than the file", byte=at)
            pages += [(int(e["offset"]), int(e["size"]), e["key"]) for e in entries[~here]]


def _check_box(box: Sequence[ArrayLike]) -> NDArray[np.float64]:
    """Lower and upper corner, (2, 3)."""
    try:
        corners = np.array(box, np.float64)
    except (TypeError, ValueError):
        corners = np.empty(0)
    if corners.shape != (2, 3) or not (corners[0] <= corners[1]).all():
        requirement = "two corners (x, y, z), the lower one first"
        raise wrong_value("box", box, requirement, shown=f"{box!r:.80}")
    return corners


def read_copc(
    path: Path,
    *,
    box: tuple[ArrayLike, ArrayLike] | None = None,
    level: int | None = None,
    keep_noise: bool = False,
    keep_class: Sequence[int] | None = None,
    drop_class: Sequence[int] | None = None,
) -> PointCloud:
    """Reads a COPC file, or a part of it; only the octree's cells that are needed are decoded.

    Parameters
    ----------
    path
        The file.
    box
        Lower and upper corner, (x, y, z) in the file's coordinates: only points in it, its faces
        included. Default: all.
    level
        Only the points of the octree's levels 0 (the coarsest) to this one. Default: all.
    keep_noise, keep_class, drop_class
        As for LAS.

    Returns
    -------
    PointCloud
        As of LAS; points are in the order of the file.

    Raises
    ------
    FormatError
        The file is not COPC, is truncated or damaged.
    InvalidInputError
        `box` is not two corners, `level` is negative, or a class is none.
    MissingDependencyError
        laspy or lazrs is not installed.

    Warns
    -----
    DroppedPointsWarning, LostAttributeWarning
        As for LAS.
    """
    if box is None and level is None:
        return read_las(path, keep_noise=keep_noise, keep_class=keep_class, drop_class=drop_class)
    corners = None if box is None else _check_box(box)
    if level is not None and (isinstance(level, bool) or level < 0):
        raise wrong_value("level", level, "an integer of at least 0")
    if not is_copc(path):
        raise format_error(path, "not a COPC file, of which box and level could be read")

    @contextmanager
    def chosen(path: Path, laspy: Any) -> Iterator[LasPoints]:
        """The header, and the points of the region and levels."""
        levels = None if level is None else range(level + 1)
        with laspy.CopcReader.open(path) as reader:
            header = reader.header
            _check_hierarchy(path, reader.copc_info, header.point_count)
            if corners is None:
                yield header, [reader.query(level=levels)], None
            elif (corners[0] > header.maxs).any() or (corners[1] < header.mins).any():
                yield header, [], None
            else:
                # Coordinates far outside are none that the file's integers have.
                low, high = (np.clip(corner, header.mins, header.maxs) for corner in corners)
                yield header, [reader.query(bounds=laspy.Bounds(low, high), level=levels)], None

    return read_las_points(path, chosen, LasChoice.of(keep_noise, keep_class, drop_class))
