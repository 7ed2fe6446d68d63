"""PCD, the format of the Point Cloud Library: ASCII, binary and LZF-compressed.

Fields are found by name: x y z, normal_x normal_y normal_z, intensity, packed rgb or rgba, range,
and vp_x vp_y vp_z (the sensor position of each point). `VIEWPOINT` becomes the viewpoint of all
points unless it is the default `0 0 0 1 0 0 0`, which every tool writes when it knows nothing.
All other fields are extra columns; a field of several values becomes a column for each, `name_0`,
`name_1`, and so on.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

from surfabet._core import PointCloud, lzf_compress, lzf_decompress
from surfabet.errors import InvalidInputError, wrong_value
from surfabet.io._columns import (
    PACKED_COLOR,
    Column,
    Part,
    add_columns,
    cloud_from_columns,
    clouds_of_parts,
    columns_from_cloud,
    lists_of,
    lost_crs,
    records,
    viewpoint_columns,
    warn_lost,
    written_names,
)
from surfabet.io._files import Lines, format_error, remaining, written_whole
from surfabet.io._notes import Notes
from surfabet.io._tables import load_fields, plain_numbers, save_table

Encoding = Literal["binary", "ascii", "binary_compressed"]
_ENCODINGS = ("ascii", "binary", "binary_compressed")
_TYPES = {"I": "i", "U": "u", "F": "f"}
_SIZES = {"I": (1, 2, 4, 8), "U": (1, 2, 4, 8), "F": (4, 8)}
_MOST_HEADER_LINES = 1_000
_LARGEST_COUNT = 1 << 20
_LARGEST_N_POINTS = 10**15
_LARGEST_COMPRESSED = 2**31 - 1


@dataclass(frozen=True)
class _Field:
    name: str
    dtype: str
    count: int


@dataclass(frozen=True)
class _Header:
    fields: list[_Field]
    n_points: int
    viewpoint: tuple[float, float, float] | None
    encoding: str

    @property
    def dtype(self) -> np.dtype[Any]:
        # Padding is called "_" any number of times, so fields go by their place.
        return np.dtype(
            [
                (str(i), "<" + f.dtype, (f.count,)) if f.count != 1 else (str(i), "<" + f.dtype)
                for i, f in enumerate(self.fields)
            ]
        )

    @property
    def viewpoints(self) -> Column | None:
        """The sensor's position as a table."""
        return None if self.viewpoint is None else np.array([self.viewpoint])

    def columns(self, by_place: dict[str, Column], notes: Notes) -> dict[str, Column]:
        """A column per value of each field, but of padding; the first field of each name."""
        columns: dict[str, Column] = {}
        for i, f in enumerate(self.fields):
            if f.name == "_" or f.count == 0:
                continue
            values = by_place[str(i)].reshape(-1, f.count)
            named = {f.name: values[:, 0]} if f.count == 1 else lists_of(f.name, values, notes)
            add_columns(columns, named, notes)
        return columns


def _integers(lines: Lines, name: str, words: list[str], most: int) -> list[int]:
    for word in words:
        if not (word.isascii() and word.isdigit() and len(word) < 19 and int(word) <= most):
            raise format_error(
                lines.path,
                f"{name} is {word!r:.40}; it must be an integer from 0 to {most}",
                line=lines.number,
            )
    return [int(word) for word in words]


def _viewpoint(lines: Lines, words: list[str], notes: Notes) -> tuple[float, float, float] | None:
    try:
        x, y, z, *rotation = (float(plain_numbers(word)) for word in words)
        if len(rotation) != 4:
            raise ValueError
    except ValueError:
        raise format_error(
            lines.path,
            "VIEWPOINT must be seven numbers (position and quaternion)",
            line=lines.number,
        ) from None
    if not np.isfinite([x, y, z]).all():
        notes.aside("VIEWPOINT, which is not finite")
        return None
    if rotation[1:] != [0, 0, 0]:
        notes.aside("the orientation in VIEWPOINT")
    return None if [x, y, z, *rotation] == [0, 0, 0, 1, 0, 0, 0] else (x, y, z)


def _read_entries(lines: Lines) -> dict[str, tuple[list[str], int]]:
    """The header's lines by their first word, with their line numbers, up to and with DATA."""
    entries: dict[str, tuple[list[str], int]] = {}
    while lines.number < _MOST_HEADER_LINES:
        text = lines.text()
        if text is None:
            raise format_error(lines.path, "the file ends inside the header", line=lines.number)
        words = text.split()
        if not words or words[0].startswith("#"):
            continue
        name = "FIELDS" if words[0] == "COLUMNS" else words[0]
        if name not in _ENTRIES:
            raise format_error(
                lines.path,
                f"not a PCD header: unknown entry {name!r:.40}; known are {', '.join(_ENTRIES)}",
                line=lines.number,
            )
        entries[name] = words[1:], lines.number
        if name == "DATA":
            return entries
    raise format_error(lines.path, f"the header has more than {_MOST_HEADER_LINES} lines")


_ENTRIES = (
    "VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"
)  # fmt: skip


def _parse_header(lines: Lines, notes: Notes) -> _Header:
    path = lines.path
    entries = _read_entries(lines)

    def words(name: str, how_many: int, default: list[str] | None = None) -> list[str]:
        found, line = entries.get(name, (default, lines.number))
        if found is None:
            raise format_error(path, f"the header has no {name}", line=line)
        if len(found) != how_many:
            raise format_error(
                path, f"{name} has {len(found)} values where {how_many} are due", line=line
            )
        return found

    names = entries.get("FIELDS", ([], 0))[0]
    n = len(names)
    types = words("TYPE", n)
    sizes = _integers(lines, "SIZE", words("SIZE", n), 8)
    counts = _integers(lines, "COUNT", words("COUNT", n, ["1"] * n), _LARGEST_COUNT)
    for type_, size in zip(types, sizes, strict=True):
        if type_ not in _TYPES or size not in _SIZES[type_]:
            raise format_error(
                path,
                f"no type {type_!r:.40} of size {size} in PCD; it has I and U of 1, 2, 4 or 8 "
                "bytes and F of 4 or 8",
                line=entries["TYPE"][1],
            )
    by_points = entries["POINTS"][0] if "POINTS" in entries else None
    (width,) = _integers(lines, "WIDTH", words("WIDTH", 1, by_points), _LARGEST_N_POINTS)
    (height,) = _integers(lines, "HEIGHT", words("HEIGHT", 1, ["1"]), _LARGEST_N_POINTS)
    product = [str(width * height)]
    (n_points,) = _integers(lines, "POINTS", words("POINTS", 1, product), _LARGEST_N_POINTS)
    if n_points != width * height:
        raise format_error(
            path,
            f"POINTS is {n_points}, but WIDTH x HEIGHT is {width} x {height}",
            line=lines.number,
        )
    viewpoint = None
    if "VIEWPOINT" in entries:
        viewpoint = _viewpoint(lines, entries["VIEWPOINT"][0], notes)
    (encoding,) = words("DATA", 1)
    if encoding not in _ENCODINGS:
        raise format_error(
            path,
            f"DATA is {encoding!r:.40}; known are {', '.join(_ENCODINGS)}",
            line=lines.number,
        )
    fields = [
        _Field(name, f"{_TYPES[type_]}{size}", count)
        for name, type_, size, count in zip(names, types, sizes, counts, strict=True)
    ]
    return _Header(fields, n_points, viewpoint, encoding)


def _check_room(path: Path, file: BinaryIO, what: str, needed: int) -> None:
    if needed > (left := remaining(file)):
        raise format_error(
            path, f"{what} {needed} bytes, but the file has {left} left", byte=file.tell()
        )


def _check_body(lines: Lines, header: _Header) -> None:
    """Refuses a file that is too short for the points that its header promises."""
    n, needed = header.n_points, header.n_points * header.dtype.itemsize
    if n and header.encoding == "binary":
        _check_room(lines.path, lines.file, f"{n} points take", needed)
    elif n and header.encoding == "ascii":
        least = n * 2 * sum(f.count for f in header.fields) - 1
        _check_room(lines.path, lines.file, f"{n} points take at least", least)


def _read_ascii(lines: Lines, header: _Header, start: int, n: int) -> dict[str, Column]:
    """The next `n` points, of which the first is number `start`."""
    names: list[tuple[str, str]] = []
    for i, f in enumerate(header.fields):
        # Packed colours stand there as the digits of their integer, which no float holds, or as
        # those of the float of the same bits.
        is_packed = f.name.lower() in PACKED_COLOR and f.dtype == "f4"
        dtype = "f8" if is_packed else f.dtype
        names += [(f"{i} {k}", dtype) for k in range(f.count)]
    columns = load_fields(lines, n, names, empty=0, before=start, total=header.n_points)
    return {
        str(i): np.stack([columns[f"{i} {k}"] for k in range(f.count)], axis=1)
        if f.count
        else np.empty((n, 0))
        for i, f in enumerate(header.fields)
    }


def _read_binary(file: BinaryIO, header: _Header, n: int) -> dict[str, Column]:
    dtype = header.dtype
    rows = np.fromfile(file, dtype, n)
    return {name: rows[name] for name in dtype.names or ()}


def _read_compressed(path: Path, file: BinaryIO, header: _Header) -> dict[str, Column]:
    size = header.n_points * header.dtype.itemsize
    start = file.tell()
    _check_room(path, file, "the sizes of compressed data take", 8)
    packed_size, unpacked_size = struct.unpack("<II", file.read(8))
    if unpacked_size != size:
        raise format_error(
            path,
            f"by its header the compressed data expands to {unpacked_size} bytes, but "
            f"{header.n_points} points take {size}",
            byte=start + 4,
        )
    _check_room(path, file, "the compressed data takes", packed_size)
    try:
        data = lzf_decompress(file.read(packed_size), size)
    except InvalidInputError as error:
        raise format_error(path, str(error), byte=start + 8) from None
    columns: dict[str, Column] = {}
    at = 0
    for i, f in enumerate(header.fields):
        n_values = header.n_points * f.count
        column = np.frombuffer(data, "<" + f.dtype, n_values, at)
        at += column.nbytes
        columns[str(i)] = column
    return columns


def _checked_header(lines: Lines, notes: Notes) -> _Header:
    """The header of a file that has what it promises."""
    header = _parse_header(lines, notes)
    if header.n_points and not sum(f.count for f in header.fields):
        raise format_error(lines.path, "the header names no fields", line=lines.number)
    _check_body(lines, header)
    return header


def read_pcd_chunks(path: Path, n: int) -> Iterator[PointCloud] | None:
    """As `read_chunks`; None for a file that is packed by LZF, which is one block."""
    with path.open("rb") as file:
        header = _checked_header(Lines(path, file), Notes(path))
    if header.encoding == "binary_compressed":
        return None
    return clouds_of_parts(path, lambda notes: _parts(path, n, notes))


def _parts(path: Path, n: int, notes: Notes) -> Iterator[Part]:
    """The columns of a file, at most `n` points at a time."""
    with path.open("rb") as file:
        lines = Lines(path, file)
        header = _checked_header(lines, notes)
        for start in range(0, header.n_points, n):
            count = min(n, header.n_points - start)
            if header.encoding == "ascii":
                by_place = _read_ascii(lines, header, start, count)
            else:
                by_place = _read_binary(file, header, count)
            yield header.columns(by_place, notes), header.viewpoints


def read_pcd(path: Path) -> PointCloud:
    """Reads a PCD file.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        Positions, and where the file has them: normals, colours, intensity, range (if
        floating-point) and viewpoints. Points with NaN coordinates, which fill the gaps of
        organised clouds, and points at exactly 0 0 0, where drivers put beams that met nothing, are
        dropped with a warning that counts them. All other fields are extra columns.

    Raises
    ------
    FormatError
        The file is not PCD, is truncated or contradicts its own header.

    Warns
    -----
    DroppedPointsWarning
        Points were left out.
    LostAttributeWarning
        VIEWPOINT is not finite or has an orientation, colours or normals are 0 everywhere, normals
        are no unit vectors, two fields have the same name, or a field has more than 1024 values.
    """
    notes = Notes(path)
    with path.open("rb") as file:
        lines = Lines(path, file)
        header = _checked_header(lines, notes)
        if header.n_points == 0:
            by_place = {
                str(i): np.empty((0, f.count), f.dtype) for i, f in enumerate(header.fields)
            }
        elif header.encoding == "ascii":
            by_place = _read_ascii(lines, header, 0, header.n_points)
        elif header.encoding == "binary":
            by_place = _read_binary(file, header, header.n_points)
        else:
            by_place = _read_compressed(path, file, header)
    columns = header.columns(by_place, notes)
    return cloud_from_columns(path, columns, viewpoints=header.viewpoints, notes=notes)


def _write_columns(cloud: PointCloud) -> tuple[dict[str, Column], str]:
    columns = columns_from_cloud(cloud)
    if cloud.normals is not None:
        columns |= {f"normal_{axis}": columns.pop(f"n{axis}") for axis in "xyz"}
    if cloud.colors is not None:
        red, green, blue = (columns.pop(c).astype(np.uint32) for c in ("red", "green", "blue"))
        columns["rgb"] = red << 16 | green << 8 | blue
    table = cloud.viewpoints
    if table is not None and len(table) == 1 and table.any():
        return columns, " ".join(repr(float(c)) for c in table[0]) + " 1 0 0 0"
    return columns | viewpoint_columns(cloud), "0 0 0 1 0 0 0"


def write_pcd(path: Path, cloud: PointCloud, *, encoding: Encoding = "binary") -> None:
    """Writes a PCD file, version 0.7.

    It holds every attribute, extra columns in their own types, but no reference system.

    Parameters
    ----------
    path
        The file, replaced in one piece.
    cloud
        What to write. World coordinates are doubles (F 8) where the cloud has an origin, else
        floats. One viewpoint goes into `VIEWPOINT`, several (or one at exactly 0 0 0, which means
        "unknown" there) into the fields vp_x, vp_y and vp_z.
    encoding
        "binary", "ascii" or "binary_compressed" (LZF, at most 2^31 - 1 bytes of points).

    Raises
    ------
    InvalidInputError
        The encoding is unknown, or the points are too many for "binary_compressed".

    Warns
    -----
    LostAttributeWarning
        The cloud has a coordinate reference system, or a column whose name had to change.
    """
    if encoding not in _ENCODINGS:
        raise wrong_value("encoding", encoding, f"one of {', '.join(_ENCODINGS)}")
    columns, viewpoint = _write_columns(cloud)
    rows = records(columns)
    if encoding == "binary_compressed" and rows.nbytes > _LARGEST_COMPRESSED:
        raise InvalidInputError(
            f"{rows.nbytes} bytes of points are more than the {_LARGEST_COMPRESSED} that "
            "binary_compressed can hold; use encoding='binary'"
        )
    types = [rows.dtype[name] for name in columns]
    header = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(columns)}",
        f"SIZE {' '.join(str(t.itemsize) for t in types)}",
        f"TYPE {' '.join(t.kind.upper() for t in types)}",
        f"COUNT {' '.join('1' for _ in types)}",
        f"WIDTH {len(rows)}",
        "HEIGHT 1",
        f"VIEWPOINT {viewpoint}",
        f"POINTS {len(rows)}",
        f"DATA {encoding}",
        "",
    ]
    with written_whole(path) as temporary, temporary.open("xb") as file:
        file.write("\n".join(header).encode("utf-8"))
        if encoding == "ascii":
            save_table(file, rows)
        elif encoding == "binary":
            rows.tofile(file)
        else:
            data = b"".join(rows[name].tobytes() for name in columns)
            packed = lzf_compress(data)
            file.write(struct.pack("<II", len(packed), len(data)) + packed)
    warn_lost(path, "PCD", lost_crs(cloud), renamed=written_names(cloud))
