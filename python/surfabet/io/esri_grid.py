"""ESRI ASCII grids: heights on a raster of square cells, rows from north to south.

Read as a surface: a point at the centre of every cell that has a height.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.io._columns import build_cloud
from surfabet.io._encodings import open_text
from surfabet.io._files import Lines, format_error, remaining
from surfabet.io._notes import Notes

_KEYS = {
    "ncols",
    "nrows",
    "xllcorner",
    "xllcenter",
    "yllcorner",
    "yllcenter",
    "cellsize",
    "nodata_value",
}
# What the format has where the header does not say.
_DEFAULT_NO_DATA = -9999.0


def _header(lines: Lines) -> dict[str, float]:
    """The keys and values above the rows; the file is left at the first row."""
    header: dict[str, float] = {}
    while True:
        start = lines.file.tell()
        text = lines.text()
        words = (text or "").split()
        if text is None or (words and words[0].lower() not in _KEYS):
            lines.file.seek(start)
            return header
        if not words:
            continue
        try:
            (value,) = words[1:]
            header[words[0].lower()] = float(value)
        except ValueError:
            raise format_error(
                lines.path,
                f"{words[0]} must have one number, found {text!r:.60}",
                line=lines.number,
            ) from None


def _corner(path: Path, header: dict[str, float], axis: str) -> float:
    """The centre of the lowest or leftmost cells."""
    if (center := header.get(f"{axis}llcenter")) is not None:
        return center
    if (corner := header.get(f"{axis}llcorner")) is not None:
        return corner + header["cellsize"] / 2
    raise format_error(path, f"the header has neither {axis}llcorner nor {axis}llcenter")


def _heights(path: Path, file: BinaryIO, n_rows: int, n_columns: int) -> NDArray[np.float64]:
    # A digit and a space per cell.
    if n_rows * n_columns * 2 > remaining(file) + 1:
        raise format_error(
            path,
            f"{n_columns} x {n_rows} cells do not fit the {remaining(file)} bytes that follow",
            byte=file.tell(),
        )
    with warnings.catch_warnings():
        # numpy's way to say that it met something else than a number.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromfile(file, np.float64, n_rows * n_columns, sep=" ")
        except (DeprecationWarning, ValueError):
            raise format_error(path, "a height is not a number") from None
    if len(values) < n_rows * n_columns:
        raise format_error(
            path, f"the file ends after {len(values)} of {n_rows * n_columns} heights"
        )
    return values.reshape(n_rows, n_columns)


def read_esri_grid(path: Path) -> PointCloud:
    """Reads an ESRI ASCII grid.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        The centres of the cells with their heights, row by row from the north, each row from the
        west; in the unit of the file.

    Raises
    ------
    FormatError
        The header lacks a key, a height is not a number, or heights are missing.

    Warns
    -----
    DroppedPointsWarning
        Cells without a height were left out; the message counts them.
    """
    with open_text(path) as file:
        header = _header(Lines(path, file))
        for key in ("ncols", "nrows", "cellsize"):
            value = header.get(key)
            whole = key == "cellsize" or (value is not None and value == np.rint(value))
            if value is None or not (0 < value < 2**31) or not whole:
                raise format_error(
                    path, f"the header has {key} {value}, but needs a positive number", byte=0
                )
        n_rows, n_columns = int(header["nrows"]), int(header["ncols"])
        heights = _heights(path, file, n_rows, n_columns)
    x = _corner(path, header, "x") + header["cellsize"] * np.arange(n_columns)
    y = _corner(path, header, "y") + header["cellsize"] * np.arange(n_rows)[::-1]
    has_height = heights != header.get("nodata_value", _DEFAULT_NO_DATA)
    rows, columns = np.nonzero(has_height)
    notes = Notes(path)
    if n_empty := heights.size - len(rows):
        notes.points(f"left out {n_empty:,} of {heights.size:,} cells, which have no height")
    return build_cloud(
        path, np.column_stack([x[columns], y[rows], heights[has_height]]), notes=notes
    )
