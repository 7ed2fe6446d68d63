"""Points as plain text: XYZ, TXT, ASC and CSV.

One point per line, separated by white space, commas or semicolons; with semicolons or white space,
numbers may have decimal commas. Columns are named by a first line of names or by a comment
(`# x y z red green blue`, `//X;Y;Z;Rf;Gf;Bf`), or else told by their number and values. A unit in
brackets behind a name (`X [mm]`) is used. Any encoding will do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from surfabet._core import PointCloud
from surfabet.errors import FormatError, wrong_value
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
from surfabet.io._encodings import open_text
from surfabet.io._files import format_error, written_whole
from surfabet.io._guess import guess_names
from surfabet.io._names import LENGTHS, UNIT_COLOR, ColumnName, column_names
from surfabet.io._notes import Notes
from surfabet.io._tables import save_table
from surfabet.io._text_table import TextTable, is_number
from surfabet.io._units import UNITS, metres_per

_COLOR = {"red", "green", "blue", "r", "g", "b", "diffuse_red", "diffuse_green", "diffuse_blue"}
_LEFT_ASIDE = "_"


def _as_integers(column: Column, first: str) -> Column:
    """Values written without a decimal point as integers, which colours of 8 bits are.

    With a decimal point they are too if one is larger than 1, beyond which only integers go.
    """
    if not (column == np.rint(column)).all():
        return column
    if any(c in first for c in ".eEnN") and column.max(initial=0) <= 1:
        return column
    return np.clip(column, -(2.0**53), 2.0**53).astype(np.int64)


def _as_attribute(column: Column) -> Column:
    """Values that a cloud keeps beside its own: integers where all are, of 32 bits if they fit."""
    if not (column == np.rint(column)).all() or np.abs(column).max(initial=0) > 2.0**53:
        return column
    fits = np.abs(column).max(initial=0) < 2**31
    return column.astype(np.int32 if fits else np.int64)


def _typed(name: str, column: Column, first: str) -> Column:
    if name in UNIT_COLOR:
        return column
    if name in _COLOR:
        return _as_integers(column, first)
    return column if name in KNOWN_NAMES else _as_attribute(column)


def _metres(path: Path, column: ColumnName, unit: str | None) -> float:
    """The factor of a column of lengths; what its name says must agree with the given unit."""
    given = 1.0 if unit is None else metres_per(unit)
    if column.unit is None:
        return given
    if column.metres is None:
        raise format_error(
            path,
            f"column {column.written!r:.40} has the unit {column.unit!r:.20}, which is none of "
            f"{', '.join(UNITS)}; name the columns with columns=",
        )
    if unit is not None and column.metres != given:
        requirement = f"left out, since column {column.written!r:.40} of {path} has its own"
        raise wrong_value("unit", unit, requirement)
    return column.metres


def _check_width(
    table: TextTable, words: Sequence[str], names: Sequence[ColumnName], notes: Notes
) -> None:
    path, line = table.lines.path, table.lines.number
    all_ = " ".join(name.written for name in names)
    if len(words) < len(names):
        raise format_error(
            path, f"{len(words)} values for the {len(names)} columns {all_!r:.80}", line=line
        )
    beyond = [word for word in words[len(names) :] if word]
    if not beyond or not is_number(words[len(names) - 1]):
        # The last column may be free text that contains the delimiter.
        return
    if not all(map(is_number, beyond)):
        notes.aside("what stands behind the last column that has a name")
    else:
        raise format_error(
            path,
            f"{len(words)} values for the {len(names)} columns {all_!r:.80}; name all of them with "
            "columns=, the others as _",
            line=line,
        )


def _texts(table: TextTable, names: Sequence[ColumnName]) -> frozenset[int]:
    """The places of columns that clouds need not have and that hold no number in some row."""
    optional = {i for i, name in enumerate(names) if name.name not in KNOWN_NAMES | set(UNIT_COLOR)}
    texts: set[int] = set()
    for words in table.rows():
        texts |= {i for i in optional if i >= len(words) or not is_number(words[i])}
        optional -= texts
        if not optional:
            break
    return frozenset(texts)


def _named_columns(
    table: TextTable,
    names: Sequence[ColumnName],
    unit: str | None,
    notes: Notes,
    texts: frozenset[int],
) -> dict[str, Column]:
    """The columns by name, but those at the places of `texts`."""
    path = table.lines.path
    words = table.layout.words(table.first or "")
    first: dict[str, int] = {}
    for i, name in enumerate(names):
        first.setdefault(name.name, i)
    known = KNOWN_NAMES | set(UNIT_COLOR)
    places = [
        i
        for name, i in first.items()
        if name in known or (i not in texts and name != _LEFT_ASIDE and is_number(words[i]))
    ]
    numbers = table.numbers(places, len(words), notes)
    for i, name in enumerate(names):
        if name.name == _LEFT_ASIDE or i in places:
            continue
        if i == first[name.name]:
            always = "always " if i in texts and is_number(words[i]) else ""
            notes.aside(f"column {name.written!r:.40}, which does not {always}hold numbers")
        else:
            notes.aside(f"column {name.written!r:.40}, another {name.name:.40}")
    columns = {}
    for k, i in enumerate(places):
        key, column = names[i].name, numbers[:, k]
        if key in LENGTHS and (factor := _metres(path, names[i], unit)) != 1:
            column = column * factor
        columns[UNIT_COLOR.get(key, key)] = _typed(key, column, words[i])
    return columns


def _unnamed_columns(
    table: TextTable,
    unit: str | None,
    notes: Notes,
    guess: Callable[[Path, list[Column]], dict[str, Column]],
) -> dict[str, Column]:
    path = table.lines.path
    words = table.layout.words(table.first or "")
    # Lines may end in a delimiter.
    n_columns = len(words) - (words[-1] == "")
    numbers = table.numbers(range(n_columns), len(words), notes)
    columns = guess(path, [_as_integers(numbers[:, i], words[i]) for i in range(n_columns)])
    factor = 1.0 if unit is None else metres_per(unit)
    for name, column in columns.items():
        if name == "label":
            columns[name] = _as_attribute(column)
        elif name not in _COLOR:
            columns[name] = column * factor if name in LENGTHS else column.astype(np.float64)
    return columns


def read_table(
    path: Path,
    notes: Notes,
    *,
    names: Sequence[ColumnName] | None = None,
    delimiter: str | None = None,
    unit: str | None = None,
    guess: Callable[[Path, list[Column]], dict[str, Column]] = guess_names,
    texts: frozenset[int] = frozenset(),
) -> Mapping[str, Column]:
    """The columns of a text file: by `names`, by its header, or as `guess` says.

    With names, those at the places of `texts`, which hold other things than numbers, are left out.
    """
    with open_text(path) as file:
        table = TextTable(path, file, delimiter, named=names is not None)
        header = table.names if names is None else names
        if table.first is None:
            if table.count:
                raise format_error(path, f"the file ends after 0 of {table.count} rows")
            if header is None:
                raise format_error(path, "no points and no column names", line=table.lines.number)
            return {name.name: np.empty(0) for name in header}
        if header is None:
            return _unnamed_columns(table, unit, notes, guess)
        words = table.layout.words(table.first)
        if names is None or len(words) < len(names):
            _check_width(table, words, header, notes)
        try:
            return _named_columns(table, header, unit, notes, texts)
        except FormatError:
            if texts:
                raise
            # One of the other columns may have what is no number in a later row.
            with open_text(path) as again:
                table = TextTable(path, again, delimiter, named=names is not None)
                if not (texts := _texts(table, header)):
                    raise
    return read_table(path, notes, names=names, delimiter=delimiter, unit=unit, texts=texts)


def read_text(
    path: Path,
    *,
    columns: Sequence[str] | None = None,
    delimiter: str | None = None,
    unit: str | None = None,
) -> PointCloud:
    """Reads points from plain text.

    Parameters
    ----------
    path
        The file.
    columns
        The names of the columns, where the file does not tell: x, y, z, red, green, blue,
        intensity, nx, ny, nz, range, vp_x, vp_y, vp_z, label, or any other name for an attribute of
        that name; `_` leaves a column aside, as does a list that is shorter than the rows.
    delimiter
        What stands between the columns. Default: a semicolon if the first line has one; a comma if
        it has one that is no decimal comma; else white space.
    unit
        The unit of the coordinates and ranges: mm, cm, m, km, ft, us-ft or in. Default: what stands
        in brackets behind their names, else metres.

    Returns
    -------
    PointCloud
        What the columns say, in metres. Without names, columns are x y z, then: intensity or label
        (4 columns); colours or normals (6); colours and an intensity or a label, either first (7);
        colours and normals, either first (9). Their values tell which: normals have length 0 or 1;
        colours are integers to 255 or 65535, or lie within 0..1; labels are few integers.

    Raises
    ------
    FormatError
        A line is not a row of numbers, fewer rows follow than the file says, the columns are
        unknown, or their values fit several readings.
    InvalidInputError
        `columns` does not name x, y and z, `delimiter` is not one character, or `unit` is unknown
        or contradicts the file.

    Warns
    -----
    LostAttributeWarning
        A named column does not hold numbers, or more rows follow than the file says.
    DroppedPointsWarning
        Points are not finite, or at exactly 0 0 0 (no returns); the message counts them.
    """
    names = None if columns is None else column_names(list(columns))
    if columns is not None and names is None:
        requirement = "names of columns with x, y and z"
        raise wrong_value("columns", columns, requirement, shown=",".join(columns))
    if delimiter is not None and len(delimiter) != 1:
        raise wrong_value("delimiter", delimiter, "one character")
    if unit is not None:
        metres_per(unit)
    spaces = delimiter is not None and delimiter.isspace() and delimiter != "\t"
    notes = Notes(path)
    found = read_table(path, notes, names=names, delimiter=None if spaces else delimiter, unit=unit)
    return cloud_from_columns(path, found, notes=notes)


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
        raise wrong_value("delimiter", delimiter, "' ', '\\t', ',' or ';'")
    is_csv = path.suffix.lower() == ".csv"
    delimiter = delimiter or ("," if is_csv else " ")
    rows = records(columns_from_cloud(cloud) | viewpoint_columns(cloud))
    header = ("" if is_csv else "# ") + delimiter.join(rows.dtype.names or ())
    with written_whole(path) as temporary, temporary.open("xb") as file:
        file.write(header.encode("utf-8") + b"\n")
        save_table(file, rows, delimiter)
    warn_lost(path, "text", lost_crs(cloud), renamed=written_names(cloud))
