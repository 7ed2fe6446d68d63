"""Points as plain text: XYZ, TXT, ASC and CSV.

One point per line, separated by white space, commas or semicolons. Columns are named by a first
line of names or by a comment (`# x y z red green blue`, `//X Y Z R G B`), or else told by their
number and values.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from surfabet._core import PointCloud
from surfabet.errors import InvalidInputError
from surfabet.io._columns import (
    KNOWN_NAMES,
    Column,
    cloud_from_columns,
    columns_from_cloud,
    lost_crs,
    records,
    viewpoint_columns,
    warn_lost,
    written_names,
)
from surfabet.io._files import Lines, format_error, written_whole
from surfabet.io._tables import name_columns, parse_rows, save_table

_COMMENTS = ("#", "//", "%")
_BYTE_ORDER_MARK = "\u00ef\u00bb\u00bf"  # of UTF-8, as latin-1 shows it
_POSITION = {"x", "y", "z"}


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _names(words: Sequence[str]) -> list[str] | None:
    """The words as column names if they name a position."""
    names = [word.strip().strip("\"'").lower() for word in words]
    return names if names and set(names) >= _POSITION else None


def _delimiter_of(text: str) -> str | None:
    return next((d for d in (",", ";") if d in text), None)


def _split(text: str, delimiter: str | None) -> list[str]:
    return [word.strip() for word in text.split(delimiter)]


class _Body:
    """The rows of a text file; what precedes them has been looked at for names."""

    def __init__(self, lines: Lines, delimiter: str | None) -> None:
        self.lines = lines
        self.names: list[str] | None = None
        self.delimiter = delimiter
        self.first: str | None = None
        for text in self._texts():
            if text.startswith(_COMMENTS):
                words = text.lstrip("#/%").strip()
                self.names = _names(_split(words, delimiter or _delimiter_of(words))) or self.names
                continue
            self.delimiter = delimiter or _delimiter_of(text)
            words_ = _split(text, self.delimiter)
            if self.names is None and not any(map(_is_number, words_)):
                self.names = _names(words_)
                if self.names is None:
                    raise format_error(
                        lines.path,
                        f"neither numbers nor column names with x, y and z: {text!r:.60}",
                        line=lines.number,
                    )
                continue
            self.first = text
            break

    def _texts(self) -> Iterator[str]:
        while (line := self.lines.next()) is not None:
            text = line.decode("latin-1")
            if self.lines.number == 1:
                text = text.removeprefix(_BYTE_ORDER_MARK)
            if text and not text.isspace():
                yield text.strip()

    def rows(self) -> Iterator[str]:
        if self.first is not None:
            yield self.first
        for text in self._texts():
            if not text.startswith(_COMMENTS):
                yield text


def _as_integers(column: Column, first: str) -> Column:
    """Colours written without a decimal point count to 255, even if none is larger than 1."""
    if any(c in first for c in ".eEnN") or not (column == np.rint(column)).all():
        return column
    return np.clip(column, -(2.0**53), 2.0**53).astype(np.int64)


def read_text(
    path: Path, *, columns: Sequence[str] | None = None, delimiter: str | None = None
) -> PointCloud:
    """Reads points from plain text.

    Parameters
    ----------
    path
        The file.
    columns
        The names of the columns, where the file does not tell: x, y, z, red, green, blue,
        intensity, nx, ny, nz, range, vp_x, vp_y, vp_z; any other name leaves a column aside.
    delimiter
        What stands between the columns. Default: a comma or semicolon if the first line has one,
        else white space.

    Returns
    -------
    PointCloud
        What the columns say. Without names, columns are x y z, then: intensity (4 columns); colours
        or normals (6); intensity and colours, either first (7); colours and normals, either first
        (9). Colours are told from normals by their values.

    Raises
    ------
    FormatError
        A line is not a row of numbers, or the columns are unknown.
    InvalidInputError
        `columns` does not name x, y and z, or `delimiter` is not one character.
    """
    if columns is not None and _names(columns) is None:
        raise InvalidInputError(f"columns are {list(columns)}, but must name x, y and z")
    if delimiter is not None and len(delimiter) != 1:
        raise InvalidInputError(f"delimiter is {delimiter!r}, but must be one character")
    with path.open("rb") as file:
        body = _Body(Lines(path, file), delimiter)
        names = body.names if columns is None else _names(columns)
        if body.first is None:
            if names is None:
                raise format_error(path, "no points and no column names", line=body.lines.number)
            return cloud_from_columns(path, {name: np.empty(0) for name in names})
        words = _split(body.first, body.delimiter)
        if names is not None and len(words) < len(names):
            raise format_error(
                path,
                f"{len(words)} values for the {len(names)} columns {' '.join(names)!r:.80}",
                line=body.lines.number,
            )
        # Columns that no cloud has may hold anything, and lines may end in a delimiter.
        taken = [i for i, word in enumerate(words) if names is None or names[i : i + 1]]
        if names is not None:
            taken = [i for i in taken if names[i] in KNOWN_NAMES]
        elif words[-1] == "":
            taken.pop()
        table = parse_rows(
            body.lines,
            body.rows(),
            len(taken),
            body.delimiter,
            None if len(taken) == len(words) else taken,
        )
    found = [_as_integers(table[:, k], words[i]) for k, i in enumerate(taken)]
    if names is None:
        named = name_columns(path, found)
    else:
        named = {}
        for k, i in enumerate(taken):
            named.setdefault(names[i], found[k])
    for name in set(named) - _COLOR_NAMES:
        named[name] = named[name].astype(np.float64)
    return cloud_from_columns(path, named)


_COLOR_NAMES = {
    "red",
    "green",
    "blue",
    "r",
    "g",
    "b",
    "diffuse_red",
    "diffuse_green",
    "diffuse_blue",
}


def write_text(path: Path, cloud: PointCloud, *, delimiter: str | None = None) -> None:
    """Writes points as text; it holds every attribute, but no reference system.

    The columns are x y z, and where the cloud has them nx ny nz, red green blue, intensity, range,
    then the extra columns, then vp_x vp_y vp_z, named by a comment in the first line, or in CSV
    files by a header line. Numbers have as many digits as it takes to read back the same ones.

    Parameters
    ----------
    path
        The file, replaced in one piece.
    cloud
        What to write, in world coordinates.
    delimiter
        What stands between the columns. Default: a comma for `.csv`, else a space.

    Raises
    ------
    InvalidInputError
        `delimiter` is none of space, tab, comma and semicolon.

    Warns
    -----
    LostAttributeWarning
        The cloud has a coordinate reference system, or a column whose name had to change.
    """
    if delimiter not in (None, " ", "\t", ",", ";"):
        raise InvalidInputError(f"delimiter is {delimiter!r}, but must be ' ', '\\t', ',' or ';'")
    is_csv = path.suffix.lower() == ".csv"
    delimiter = delimiter or ("," if is_csv else " ")
    rows = records(columns_from_cloud(cloud) | viewpoint_columns(cloud))
    header = ("" if is_csv else "# ") + delimiter.join(rows.dtype.names or ())
    with written_whole(path) as temporary, temporary.open("xb") as file:
        file.write(header.encode("utf-8") + b"\n")
        save_table(file, rows, delimiter)
    warn_lost(path, "text", lost_crs(cloud), renamed=written_names(cloud))
