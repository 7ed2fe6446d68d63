"""PTX: scans as text, each a grid of cells with the pose of its scanner.

A scan begins with the numbers of columns and rows, the scanner's position and its three axes, and
a matrix of four rows that row vectors are multiplied with from the left. Then follow the cells,
column by column: x y z intensity, or these and red green blue. A cell without a return has the
scanner's own position, (0, 0, 0).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.io._columns import build_cloud, colors_from
from surfabet.io._encodings import open_text
from surfabet.io._files import Lines, format_error, remaining
from surfabet.io._notes import Notes
from surfabet.io._tables import check_count, load_table, parse_rows

# `0 0 0 0` with the end of its line.
_SHORTEST_ROW = 8


@dataclass(frozen=True)
class _Scan:
    """What the sensor got back, in the world."""

    points: NDArray[np.float64]
    intensities: NDArray[np.float64]
    colors: NDArray[np.float64] | None
    ranges: NDArray[np.float64]
    center: NDArray[np.float64]
    n_cells: int


def _size(lines: Lines, what: str) -> int | None:
    """The number that a line holds alone; `None` at the end of the file."""
    word = next(lines.filled(1), None)
    if word is None:
        return None
    if not (word := word.strip()).isdecimal():
        raise format_error(
            lines.path, f"expected the number of {what}, found {word!r:.60}", line=lines.number
        )
    return int(word[:18])


def _cells(lines: Lines, n_cells: int) -> NDArray[np.float64]:
    """The cells of a scan, four or seven values each."""
    rows = lines.filled(n_cells)
    first = next(rows, None)
    if first is None:
        check_count(lines, 0, n_cells)
        return np.empty((0, 4))
    n_values = len(first.split())
    if n_values not in (4, 7):
        raise format_error(
            lines.path, f"cells have 4 or 7 values, not {n_values}", line=lines.number
        )
    cells = parse_rows(lines, itertools.chain([first], rows), n_values)
    check_count(lines, len(cells), n_cells)
    return cells


def _scan(lines: Lines, n_cells: int) -> _Scan:
    # Position and axes of the scanner say again what the matrix says.
    load_table(lines, 4, 3)
    matrix = load_table(lines, 4, 4)
    turn, center = matrix[:3, :3], matrix[3, :3]
    if not np.isfinite(matrix).all() or (matrix[:, 3] != [0, 0, 0, 1]).any():
        raise format_error(
            lines.path, "the matrix above is not a finite pose for row vectors", line=lines.number
        )
    cells = _cells(lines, n_cells)
    seen = cells[(cells[:, :3] != 0).any(axis=1)]
    local = seen[:, :3]
    return _Scan(
        local[:, :1] * turn[0] + local[:, 1:2] * turn[1] + local[:, 2:] * turn[2] + center,
        seen[:, 3],
        seen[:, 4:] if cells.shape[1] == 7 else None,
        np.sqrt((local**2).sum(axis=1)),
        center,
        n_cells,
    )


def _scans(path: Path) -> Iterator[_Scan]:
    with open_text(path) as file:
        lines = Lines(path, file)
        while (n_columns := _size(lines, "columns")) is not None:
            n_rows = _size(lines, "rows")
            n_cells = n_columns * (n_rows or 0)
            if n_rows is None or n_cells * _SHORTEST_ROW > remaining(file) + 1:
                raise format_error(
                    path,
                    f"a grid of {n_columns} x {n_rows or 0} cells does not fit the "
                    f"{remaining(file)} bytes that follow",
                    line=lines.number,
                )
            yield _scan(lines, n_cells)


def read_ptx(path: Path) -> PointCloud:
    """Reads a PTX file.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        All scans in world coordinates, one after the other, each in the order of its cells, with
        intensities, ranges (metres), viewpoints (row i is scan i), and colours where every scan has
        them.

    Raises
    ------
    FormatError
        A header is broken, a line is not a row of numbers, or the file ends before its last cell.

    Warns
    -----
    DroppedPointsWarning
        Cells without a return were left out, or points that are not finite; the message counts
        them.
    LostAttributeWarning
        Only some scans have colours, which were left aside.
    """
    scans = list(_scans(path))
    if not scans:
        raise format_error(path, "the file holds no scan", byte=0)
    notes = Notes(path)
    counts = [len(scan.points) for scan in scans]
    n_empty = sum(scan.n_cells for scan in scans) - sum(counts)
    if n_empty:
        notes.points(
            f"left out {n_empty:,} of {n_empty + sum(counts):,} cells, which had no return"
        )
    rgb = [scan.colors for scan in scans if scan.colors is not None]
    colors = None
    if len(rgb) == len(scans):
        colors = _colors(path, np.concatenate(rgb), notes)
    elif rgb:
        notes.aside(f"colours, which only {len(rgb)} of {len(scans)} scans have")
    return build_cloud(
        path,
        np.concatenate([scan.points for scan in scans]),
        colors=colors,
        intensities=np.concatenate([scan.intensities for scan in scans]),
        ranges=np.concatenate([scan.ranges for scan in scans]),
        viewpoints=np.stack([scan.center for scan in scans]),
        viewpoint_index=np.repeat(np.arange(len(scans), dtype=np.uint32), counts),
        notes=notes,
    )


def _colors(path: Path, rows: NDArray[np.float64], notes: Notes) -> NDArray[np.uint8]:
    """Colours of 0 to 255, which PTX files write as integers."""
    red, green, blue = rows.T
    if (rows == np.rint(rows)).all() and np.abs(rows).max(initial=0) < 2**31:
        red, green, blue = rows.T.astype(np.int64)
    return colors_from(path, (red, green, blue), notes)
