"""Checks of LAZ files that lazrs does not make: it allocates whatever size a file claims.

LAZ 1.4 stores a chunk of points as: the first point as it is; the number of points; the size of
each layer; the layers. A size is 32 bits, there are ten layers and more, and a failed allocation
ends the process. So the chunks are walked here first, which costs a few reads each.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from surfabet.io._files import format_error

_LAYERED = 3
# Layers by type of item; the extra bytes of a point (type 14) have one each.
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
_EXTRA_BYTES = 14
_VARIABLE = 0xFFFF_FFFF
_RECORD_HEADER = 54


@dataclass(frozen=True)
class _Coding:
    """The record `laszip encoded`, as far as it matters here."""

    chunk_size: int
    point_size: int
    n_layers: int


def _find_coding(
    path: Path, file: BinaryIO, header_size: int, points_at: int, n_records: int
) -> _Coding | None:
    """How a layered file is coded; `None` for the older coding, which has no sizes."""
    at = header_size
    for _ in range(n_records):
        file.seek(at)
        header = file.read(_RECORD_HEADER)
        if len(header) < _RECORD_HEADER or at + _RECORD_HEADER > points_at:
            raise format_error(path, "the variable records do not end before the points", byte=at)
        (record_id, length) = struct.unpack_from("<HH", header, 18)
        if header[2:18].rstrip(b"\0") == b"laszip encoded" and record_id == 22204:
            data = file.read(length)
            if len(data) < 34:
                raise format_error(path, "the LAZ record is too short", byte=at)
            compressor, chunk_size, n_items = (
                struct.unpack_from(code, data, offset)[0]
                for code, offset in (("<H", 0), ("<I", 12), ("<H", 32))
            )
            if len(data) < 34 + 6 * n_items:
                raise format_error(
                    path, f"the LAZ record is too short for {n_items} items", byte=at
                )
            if compressor != _LAYERED:
                return None
            items = [struct.unpack_from("<HH", data, 34 + 6 * i) for i in range(n_items)]
            n_layers = sum(
                size if type_ == _EXTRA_BYTES else _LAYERS.get(type_, 0) for type_, size in items
            )
            return _Coding(chunk_size, sum(size for _, size in items), n_layers)
        at += _RECORD_HEADER + length
    raise format_error(path, "a LAZ file without the record 'laszip encoded'", byte=header_size)


def check_chunks(
    path: Path, *, header_size: int, points_at: int, n_records: int, n_points: int
) -> None:
    """Refuses a file whose chunks do not lie one after the other between header and chunk table."""
    with path.open("rb") as file:
        coding = _find_coding(path, file, header_size, points_at, n_records)
        if coding is None or n_points == 0:
            return
        size = path.stat().st_size
        file.seek(points_at)
        (table_at,) = struct.unpack("<q", file.read(8).ljust(8, b"\0"))
        if table_at == -1:
            # Written to a stream: the place of the table is at the end.
            file.seek(max(size - 8, 0))
            (table_at,) = struct.unpack("<q", file.read(8).ljust(8, b"\0"))
        if not points_at + 8 <= table_at <= size - 8:
            raise format_error(
                path, f"the header has the chunk table at {table_at}", byte=points_at
            )
        file.seek(table_at)
        _, n_chunks = struct.unpack("<II", file.read(8))
        expected = -(-n_points // max(coding.chunk_size, 1))
        if coding.chunk_size != _VARIABLE and n_chunks != expected:
            raise format_error(
                path,
                f"{n_points} points in chunks of {coding.chunk_size} make {expected} chunks, but "
                f"the chunk table has {n_chunks}",
                byte=table_at + 4,
            )
        at = points_at + 8
        head = coding.point_size + 4 + 4 * coding.n_layers
        for chunk in range(n_chunks):
            if at + head > table_at:
                raise format_error(path, f"chunk {chunk} of {n_chunks} is missing", byte=at)
            file.seek(at + coding.point_size + 4)
            at += head + sum(struct.unpack(f"<{coding.n_layers}I", file.read(4 * coding.n_layers)))
            if at > table_at:
                raise format_error(
                    path,
                    f"chunk {chunk} reaches into the chunk table by {at - table_at} bytes",
                    byte=at,
                )
        if at != table_at:
            raise format_error(path, f"{table_at - at} bytes before the chunk table", byte=at)
