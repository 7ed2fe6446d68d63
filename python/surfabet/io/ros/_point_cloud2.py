"""The message `sensor_msgs/PointCloud2` to and from columns."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from surfabet.io._columns import MOST_VALUES, Column, records
from surfabet.io._files import format_error
from surfabet.io._notes import Notes

TYPE = "sensor_msgs/msg/PointCloud2"
# `sensor_msgs/PointField`.
_DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def _fields(path: Path, message: Any, notes: Notes) -> dict[str, tuple[str, int]]:
    """Type and place of each field; those of several values count as one field per value."""
    order = ">" if message.is_bigendian else "<"
    fields: dict[str, tuple[str, int]] = {}
    for field in message.fields:
        type_ = _DATATYPES.get(field.datatype)
        if type_ is None:
            notes.aside(f"{field.name!r:.40} (type {field.datatype})")
            continue
        # Some drivers write 0 for one.
        count, size = max(1, field.count), np.dtype(type_).itemsize
        if field.offset + count * size > message.point_step:
            raise format_error(
                path,
                f"field {field.name!r:.40} reaches to byte {field.offset + count * size} of points "
                f"of {message.point_step} bytes",
            )
        # Padding has no name.
        if not field.name:
            continue
        if count > MOST_VALUES:
            notes.aside(f"{field.name} of {count:,} values per point")
            continue
        for i in range(count):
            name = field.name if count == 1 else f"{field.name}_{i}"
            if name in fields:
                notes.aside(f"a second column {name:.40}")
            fields.setdefault(name, (order + type_, field.offset + i * size))
    return fields


def decode(path: Path, message: Any, notes: Notes) -> dict[str, Column]:
    """The fields of a message as columns of native byte order, row by row."""
    fields = _fields(path, message, notes)
    width, height, point_step = message.width, message.height, message.point_step
    n_points = width * height
    # Where rows lie one after the other, drivers may leave out how long they are.
    packed = height == 1 or len(message.data) == n_points * point_step
    row_step = width * point_step if packed else message.row_step
    needed = (height - 1) * row_step + width * point_step
    if n_points and (row_step < width * point_step or needed > len(message.data)):
        raise format_error(
            path,
            f"a message of {width} x {height} points of {point_step} bytes, in rows of {row_step}, "
            f"has {len(message.data)} bytes",
        )
    data = np.ascontiguousarray(message.data, np.uint8)
    columns = {}
    for name, (type_, offset) in fields.items():
        if n_points == 0:
            columns[name] = np.empty(0, type_[1:])
            continue
        strides = (row_step, point_step)
        values: Column = np.ndarray((height, width), type_, data, offset, strides)
        columns[name] = values.astype(type_[1:]).reshape(-1)
    return columns


def encode(columns: Mapping[str, Column], typestore: Any, frame: str) -> Any:
    """The message that columns make, packed and little-endian; those of 64-bit integers must go."""
    types: Any = typestore.types
    rows = records(columns)
    codes = {type_: code for code, type_ in _DATATYPES.items()}
    fields = []
    for name, column in columns.items():
        code = codes[column.dtype.newbyteorder("=").str[1:]]
        offset = rows.dtype.fields[name][1]  # type: ignore[index]
        fields.append(types["sensor_msgs/msg/PointField"](name, offset, code, 1))
    stamp = types["builtin_interfaces/msg/Time"](0, 0)
    return types[TYPE](
        types["std_msgs/msg/Header"](stamp, frame),
        1,
        len(rows),
        fields,
        False,
        rows.dtype.itemsize,
        rows.nbytes,
        rows.view(np.uint8) if len(rows) else np.empty(0, np.uint8),
        True,
    )


def can_encode(column: Column) -> bool:
    """Whether the message has the column's type."""
    return column.dtype.newbyteorder("=").str[1:] in _DATATYPES.values()
