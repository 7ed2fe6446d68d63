"""PLY: ASCII and binary of both byte orders.

Read: the element `vertex` with any scalar types; other elements (faces, edges, cameras) and list
properties are left aside. Written: `vertex` with double coordinates where the cloud has an origin,
else float, and `property float intensity`, `property float range`; viewpoints as an element
`viewpoint` (double x, y, z) and a vertex property `viewpoint_index`, which other tools pass over.

Extra columns are properties under their own names, in both directions: CloudCompare's prefix
`scalar_` is part of the name and comes back as it was. PLY has no integers of 64 bits; such columns
are written as int or uint where their values fit, else as double where that is exact, else as the
types int64 and uint64, which some tools read.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from surfabet._core import PointCloud
from surfabet.io._columns import (
    VIEWPOINT_INDEX,
    Column,
    Part,
    cloud_from_columns,
    clouds_of_parts,
    columns_from_cloud,
    lost_crs,
    records,
    warn_lost,
    written_names,
)
from surfabet.io._files import Lines, format_error, remaining, written_whole
from surfabet.io._notes import Notes
from surfabet.io._tables import check_count, load_fields, save_table, typed_columns

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
_NAMES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"}
_NAMES |= {"f4": "float", "f8": "double", "i8": "int64", "u8": "uint64"}
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MOST_HEADER_LINES = 10_000
# A 3D Gaussian splat has the constant term of its colours as a coefficient of this spherical
# harmonic, about a half.
_SPLAT_COLORS = ("f_dc_0", "f_dc_1", "f_dc_2")
_HARMONIC_0 = 0.28209479


@dataclass(frozen=True)
class _Property:
    name: str
    dtype: str
    # The type of the number of values, for lists.
    count_dtype: str | None


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        return any(p.count_dtype for p in self.properties)

    def dtype(self, order: str) -> np.dtype[Any]:
        return np.dtype([(p.name, order + p.dtype) for p in self.properties])


def _parse_property(lines: Lines, words: list[str], element: _Element | None) -> _Property:
    if element is None:
        raise format_error(lines.path, "a property before any element", line=lines.number)
    is_list = len(words) == 5 and words[1] == "list"
    if not is_list and len(words) != 3:
        raise format_error(lines.path, f"a property is {' '.join(words)!r:.80}", line=lines.number)
    for word in words[2:4] if is_list else words[1:2]:
        if word not in _TYPES:
            raise format_error(
                lines.path,
                f"unknown type {word!r:.40}; PLY has {', '.join(sorted(_TYPES))}",
                line=lines.number,
            )
    if is_list:
        count_dtype = _TYPES[words[2]]
        if count_dtype.startswith("f"):
            raise format_error(
                lines.path, "the length of a list must be an integer", line=lines.number
            )
        return _Property(words[4], _TYPES[words[3]], count_dtype)
    if any(p.name == words[2] for p in element.properties):
        raise format_error(
            lines.path, f"property {words[2]!r:.40} appears twice", line=lines.number
        )
    return _Property(words[2], _TYPES[words[1]], None)


def _parse_header(lines: Lines) -> tuple[str, list[_Element]]:
    path = lines.path
    if (lines.text() or "").strip().lower() != "ply":
        raise format_error(path, "not a PLY file: its first line must be 'ply'", line=1)
    order: str | None = None
    elements: list[_Element] = []
    while lines.number < _MOST_HEADER_LINES:
        text = lines.text()
        if text is None:
            raise format_error(path, "the file ends inside the header", line=lines.number)
        words = text.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        match words:
            case ["end_header"]:
                if order is None:
                    raise format_error(path, "the header names no format", line=lines.number)
                return order, elements
            case ["format", name, "1.0"] if name in _BYTE_ORDERS:
                order = _BYTE_ORDERS[name]
            case ["element", name, count]:
                if not (count.isascii() and count.isdigit() and len(count) < 19):
                    raise format_error(
                        path, f"element {name!r:.40} has count {count!r:.40}", line=lines.number
                    )
                if any(e.name == name for e in elements):
                    raise format_error(
                        path, f"element {name!r:.40} appears twice", line=lines.number
                    )
                elements.append(_Element(name, int(count)))
            case ["property", *_]:
                element = elements[-1] if elements else None
                prop = _parse_property(lines, words, element)
                elements[-1].properties.append(prop)
            case _:
                raise format_error(path, f"unknown header line {text!r:.80}", line=lines.number)
    raise format_error(path, f"the header has more than {_MOST_HEADER_LINES} lines")


def _check_room(path: Path, file: BinaryIO, element: _Element, order: str) -> None:
    """Refuses an element whose shortest form is longer than what is left of the file."""
    if order:
        least = element.count * sum(
            np.dtype(p.count_dtype or p.dtype).itemsize for p in element.properties
        )
    else:
        # A digit and a separator each; the last separator may be missing.
        least = element.count * 2 * len(element.properties) - 1
    if least > (left := remaining(file)):
        raise format_error(
            path,
            f"the header promises {element.count} {element.name} of at least {least} bytes, "
            f"but the file has {left} left",
            byte=file.tell(),
        )


def _walk_binary_lists(
    path: Path, file: BinaryIO, element: _Element, order: str
) -> dict[str, Column]:
    """The scalar columns of an element with lists of differing lengths, record by record."""
    data = file.read()
    start = file.tell() - len(data)
    codes = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q"}
    codes |= {"u8": "Q", "f4": "f", "f8": "d"}
    steps = [
        (
            p,
            struct.Struct(order + codes[p.count_dtype or p.dtype]),
            np.dtype(p.dtype).itemsize,
        )
        for p in element.properties
    ]
    values: dict[str, list[float]] = {
        p.name: [] for p in element.properties if p.count_dtype is None
    }
    at = 0
    try:
        for _ in range(element.count):
            for prop, parse, item_size in steps:
                (value,) = parse.unpack_from(data, at)
                at += parse.size
                if prop.count_dtype is None:
                    values[prop.name].append(value)
                elif value < 0 or value * item_size > len(data) - at:
                    raise format_error(
                        path,
                        f"a list {prop.name!r:.40} of {value} values does not fit into the file",
                        byte=start + at - parse.size,
                    )
                else:
                    at += value * item_size
    except struct.error:
        raise format_error(
            path, f"the file ends inside element {element.name!r:.40}", byte=start + len(data)
        ) from None
    file.seek(start + at)
    return {
        p.name: np.array(values[p.name], p.dtype)
        for p in element.properties
        if p.count_dtype is None
    }


def _uniform_lists(file: BinaryIO, element: _Element, order: str) -> Column | None:
    """All records at once if every list is as long as the first one (as of triangles only)."""
    start = file.tell()
    fields: list[tuple[Any, ...]] = []
    lengths: dict[str, int] = {}
    for i, prop in enumerate(element.properties):
        item_size = np.dtype(prop.dtype).itemsize
        if prop.count_dtype is None:
            fields.append((prop.name, order + prop.dtype))
            file.seek(item_size, io.SEEK_CUR)
            continue
        count_dtype = np.dtype(order + prop.count_dtype)
        raw = file.read(count_dtype.itemsize)
        length = int(np.frombuffer(raw, count_dtype)[0]) if len(raw) == count_dtype.itemsize else -1
        if length < 0 or length * item_size > remaining(file):
            file.seek(start)
            return None
        file.seek(length * item_size, io.SEEK_CUR)
        # No name in a header has a space, so these are free.
        lengths[f"count {i}"] = length
        fields += [(f"count {i}", count_dtype), (f"list {i}", order + prop.dtype, (length,))]
    dtype = np.dtype(fields)
    file.seek(start)
    if dtype.itemsize * element.count > remaining(file):
        return None
    rows = np.fromfile(file, dtype, element.count)
    if all((rows[name] == length).all() for name, length in lengths.items()):
        return rows
    file.seek(start)
    return None


def _read_binary(path: Path, file: BinaryIO, element: _Element, order: str) -> dict[str, Column]:
    if element.has_lists:
        rows = _uniform_lists(file, element, order)
        if rows is None:
            return _walk_binary_lists(path, file, element, order)
    else:
        rows = np.fromfile(file, element.dtype(order), element.count)
    return {p.name: rows[p.name] for p in element.properties if p.count_dtype is None}


def _walk_ascii_lists(lines: Lines, element: _Element) -> dict[str, Column]:
    """The scalar columns of an element with lists, one record per line."""
    scalars = [p for p in element.properties if p.count_dtype is None]
    rows = []
    for text in lines.filled(element.count):
        words = text.split()
        row = []
        at = 0
        try:
            for prop in element.properties:
                if prop.count_dtype is None:
                    row.append(float(words[at]))
                    at += 1
                elif (length := int(words[at])) < 0:
                    raise ValueError(f"a list has length {length}")
                else:
                    at += 1 + length
            if at != len(words):
                raise ValueError(f"{len(words)} values where {at} are due")
        except (ValueError, IndexError) as error:
            raise format_error(
                lines.path, f"cannot read element {element.name!r:.40}: {error}", line=lines.number
            ) from None
        rows.append(row)
    check_count(lines, len(rows), element.count)
    table = np.array(rows, np.float64).reshape(len(rows), len(scalars))
    return typed_columns(lines, table, [(p.name, p.dtype) for p in scalars])


def _read_ascii(lines: Lines, element: _Element) -> dict[str, Column]:
    if element.has_lists:
        return _walk_ascii_lists(lines, element)
    return load_fields(lines, element.count, [(p.name, p.dtype) for p in element.properties])


def _splat_colors(columns: dict[str, Column], notes: Notes) -> dict[str, Column]:
    """The columns with colours, if they are those of 3D Gaussians, which is noted."""
    if not columns.keys() >= {*_SPLAT_COLORS, "opacity", "scale_0", "rot_0"}:
        return columns
    notes.remark(
        "a 3D Gaussian splat: its centres are read as points with their base colours, not its "
        "shapes, opacities and reflections, which are kept as columns"
    )
    # The file's own numbers stay as columns, so nothing is lost by 8 bits.
    colors: dict[str, Column] = {
        name: np.rint(
            255 * np.clip(np.nan_to_num(0.5 + _HARMONIC_0 * columns[key].astype(np.float64)), 0, 1)
        ).astype(np.uint8)
        for name, key in zip(("red", "green", "blue"), _SPLAT_COLORS, strict=True)
    }
    return columns if columns.keys() & colors.keys() else columns | colors


def _note_rest(elements: list[_Element], used: set[str], notes: Notes) -> None:
    """Notes which elements and lists of the file are not read."""
    for element in elements:
        if element.name not in used:
            if element.count:
                notes.aside(f"element {element.name} ({element.count:,})")
            continue
        lost = [p.name for p in element.properties if p.count_dtype]
        if element.name == "viewpoint":
            lost = [p.name for p in element.properties if p.name not in ("x", "y", "z")]
        if lost:
            notes.aside(f"lists {', '.join(lost)} of {element.name}")


def read_ply_chunks(path: Path, n: int) -> Iterator[PointCloud] | None:
    """As `read_chunks`; None for what can only be read as a whole: text, lists, viewpoints."""
    with path.open("rb") as file:
        lines = Lines(path, file)
        order, elements = _parse_header(lines)
        first = elements[0] if elements else None
        if not order or first is None or first.name != "vertex" or first.has_lists:
            return None
        if not first.properties or any(e.name == "viewpoint" for e in elements):
            return None
        _check_room(path, file, first, order)
        start = file.tell()
    dtype = first.dtype(order)

    def parts(notes: Notes) -> Iterator[Part]:
        _note_rest(elements, {"vertex"}, notes)
        with path.open("rb") as file:
            file.seek(start)
            for at in range(0, first.count, n):
                rows = np.fromfile(file, dtype, min(n, first.count - at))
                columns = {p.name: rows[p.name] for p in first.properties}
                yield _splat_colors(columns, notes), None

    return clouds_of_parts(path, parts)


def read_ply(path: Path) -> PointCloud:
    """Reads the vertices of a PLY file.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        Positions, and where the file has them: normals (nx, ny, nz), colours (red, green, blue as
        uchar, as ushort, or as floats in 0..1; or rgb or rgba packed in 32 bits), intensity (also
        as reflectance and scalar_Intensity), range and viewpoints. All other properties are extra
        columns by their own names. Of a 3D Gaussian splat the centres are points and the base
        colours are colours.

    Raises
    ------
    FormatError
        The file is not PLY, is truncated or contradicts its own header.

    Warns
    -----
    DroppedPointsWarning
        Points are not finite, or are no returns (exactly 0 0 0).
    LostAttributeWarning
        The file has faces, other elements or lists, which are left aside, colours or normals that
        are 0 everywhere, normals that are no unit vectors, or is a splat.
    """
    with path.open("rb") as file:
        lines = Lines(path, file)
        order, elements = _parse_header(lines)
        wanted = {"vertex", "viewpoint"}
        if not any(e.name == "vertex" for e in elements):
            raise format_error(path, "no element 'vertex' in the header", line=lines.number)
        found: dict[str, dict[str, Column]] = {}
        for element in elements:
            if wanted <= found.keys() or not any(
                e.name in wanted for e in elements[elements.index(element) :]
            ):
                break
            _check_room(path, file, element, order)
            if not element.properties:
                continue
            if order:
                columns = _read_binary(path, file, element, order)
            else:
                columns = _read_ascii(lines, element)
            if element.name in wanted:
                found[element.name] = columns
    if "vertex" not in found:
        raise format_error(path, "the element 'vertex' has no properties")
    table = found.get("viewpoint", {})
    viewpoints = None
    used = {"vertex"}
    if {"x", "y", "z"} <= table.keys() and VIEWPOINT_INDEX in found["vertex"]:
        viewpoints = np.column_stack([table[axis] for axis in "xyz"]).astype(np.float64)
        used.add("viewpoint")
    notes = Notes(path)
    _note_rest(elements, used, notes)
    columns = _splat_colors(found["vertex"], notes)
    return cloud_from_columns(path, columns, viewpoints=viewpoints, notes=notes)


def _in_ply_types(column: Column) -> Column:
    """The column in a type that PLY has, if one of these holds its values exactly."""
    if column.dtype.itemsize < 8 or column.dtype.kind == "f" or len(column) == 0:
        return column
    low, high = int(column.min()), int(column.max())
    for dtype in (np.int32, np.uint32):
        if np.iinfo(dtype).min <= low and high <= np.iinfo(dtype).max:
            return column.astype(dtype)
    if max(-low, high) < 2**63:
        double = column.astype(np.float64)
        if (np.abs(double) < 2**63).all() and (double.astype(column.dtype) == column).all():
            return double
    return column


def _header(order: str, elements: dict[str, Column]) -> bytes:
    lines = ["ply", f"format {order} 1.0", "comment written by surfabet; metres"]
    for element, rows in elements.items():
        lines.append(f"element {element} {len(rows)}")
        for name in rows.dtype.names or ():
            lines.append(f"property {_NAMES[rows.dtype[name].str[1:]]} {name}")
    return "\n".join([*lines, "end_header", ""]).encode("utf-8")


def write_ply(path: Path, cloud: PointCloud, *, ascii: bool = False) -> None:
    """Writes a PLY file, binary little-endian unless told otherwise.

    It holds every attribute, extra columns under their own names, but no reference system.

    Parameters
    ----------
    path
        The file, replaced in one piece.
    cloud
        What to write. Coordinates are written as world coordinates: double where the cloud has an
        origin, else float.
    ascii
        Write text, with as many digits as it takes to read back the same numbers.

    Warns
    -----
    LostAttributeWarning
        The cloud has a coordinate reference system, or a column whose name had to change.
    """
    columns = {name: _in_ply_types(c) for name, c in columns_from_cloud(cloud).items()}
    elements: dict[str, Column] = {}
    if cloud.viewpoints is not None and cloud.viewpoint_index is not None:
        columns[VIEWPOINT_INDEX] = cloud.viewpoint_index
        table = {axis: cloud.viewpoints[:, a] for a, axis in enumerate("xyz")}
        elements["viewpoint"] = records(table)
    elements = {"vertex": records(columns), **elements}
    with written_whole(path) as temporary, temporary.open("xb") as file:
        file.write(_header("ascii" if ascii else "binary_little_endian", elements))
        for rows in elements.values():
            if ascii:
                save_table(file, rows)
            else:
                rows.tofile(file)
    warn_lost(path, "PLY", lost_crs(cloud), renamed=written_names(cloud))
