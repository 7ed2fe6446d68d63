"""PTS: scans as text of Leica's Cyclone and others; a line with the number of points before each.

The columns have no names: x y z, then an intensity, colours, or both in this order. Leica's
intensities go from -2048 to 2047, and are kept as they are.
"""

from __future__ import annotations

from pathlib import Path

from surfabet._core import PointCloud
from surfabet.io._columns import Column, cloud_from_columns
from surfabet.io._files import format_error
from surfabet.io._notes import Notes
from surfabet.io.text import read_table

_POSITION = ("x", "y", "z")
_COLOR = ("red", "green", "blue")
_COLUMNS = {
    3: _POSITION,
    4: (*_POSITION, "intensity"),
    6: (*_POSITION, *_COLOR),
    7: (*_POSITION, "intensity", *_COLOR),
}


def _name_columns(path: Path, columns: list[Column]) -> dict[str, Column]:
    if (names := _COLUMNS.get(len(columns))) is None:
        raise format_error(
            path,
            f"rows of PTS have 3, 4, 6 or 7 values, not {len(columns)}; read it with format='xyz' "
            "and columns=",
        )
    return dict(zip(names, columns, strict=True))


def read_pts(path: Path) -> PointCloud:
    """Reads a PTS file.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        All scans of the file one after the other, with intensities and colours where it has them.

    Raises
    ------
    FormatError
        A line is not a row of numbers, rows have none of the known numbers of values, or fewer rows
        follow than the file says.

    Warns
    -----
    LostAttributeWarning
        More rows follow than the file says; all are read.
    """
    notes = Notes(path)
    columns = read_table(path, notes, guess=_name_columns)
    return cloud_from_columns(path, columns, notes=notes)
