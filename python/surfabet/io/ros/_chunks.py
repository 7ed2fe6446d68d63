"""Bounds of what the packed parts of a bag grow to, which the package rosbags does not check.

A chunk that says that it grows beyond what scans pack to is refused before it is read. Where it may
say less than is true, zstd's blocks are counted, of which each holds at most 128 KiB, and chunks of
bzip2 and lz4 are unpacked by decoders that stop.
"""

from __future__ import annotations

import bz2
import importlib
import io
import re
import sqlite3
import struct
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, BinaryIO

from surfabet.io._files import format_error
from surfabet.io._packed import FREE_BYTES, LARGEST_RATIO, is_bomb, parts_of, zstd_module

_MCAP = b"\x89MCAP0\r\n"
_CHUNK, _FOOTER = 0x06, 0x02
_ZSTD = b"\x28\xb5\x2f\xfd"
_SKIPPABLE = 0x184D2A50
_LARGEST_BLOCK = 1 << 17
_BY_MESSAGE = re.compile(r"compression_mode:\s*[\"']?message", re.IGNORECASE)


def _refuse(path: Path, at: int, packed: int, unpacked: int) -> None:
    if is_bomb(packed, unpacked):
        raise format_error(
            path,
            f"{packed:,} packed bytes grow to {unpacked:,} or more, as those of no scan do; "
            "if it is one, write the bag without compression",
            byte=at,
        )


def zstd_bound(file: BinaryIO, length: int) -> int:
    """The most bytes that the next `length` ones, zstd's frames, can grow to.

    Blocks are counted without unpacking them (RFC 8878, section 3.1).
    """
    end = file.tell() + length
    bound = 0
    while file.tell() + 4 <= end:
        magic = file.read(4)
        (number,) = struct.unpack("<I", magic)
        if number & ~0xF == _SKIPPABLE:
            file.seek(struct.unpack("<I", file.read(4).ljust(4, b"\0"))[0], io.SEEK_CUR)
            continue
        if magic != _ZSTD:
            break
        descriptor = file.read(1).ljust(1, b"\0")[0]
        single = descriptor >> 5 & 1
        sizes = (1 if single else 0, 2, 4, 8)
        file.seek(
            (0 if single else 1) + (0, 1, 2, 4)[descriptor & 3] + sizes[descriptor >> 6],
            io.SEEK_CUR,
        )
        last = 0
        while not last and file.tell() + 3 <= end:
            header = int.from_bytes(file.read(3), "little")
            last, kind, size = header & 1, header >> 1 & 3, header >> 3
            # Raw, run, compressed.
            bound += size if kind < 2 else _LARGEST_BLOCK
            file.seek(1 if kind == 1 else size, io.SEEK_CUR)
        file.seek(4 * (descriptor >> 2 & 1), io.SEEK_CUR)
    return bound


def _check_zstd(path: Path, file: BinaryIO, length: int) -> None:
    """Refuses `length` bytes of zstd that grow too much."""
    at = file.tell()
    if not is_bomb(length, zstd_bound(file, length)):
        return
    # Short blocks hold less than they may, so all are unpacked here, one after the other.
    file.seek(at)
    data, total = io.BytesIO(file.read(length)), 0
    for part in parts_of(data, zstd_module().ZstdDecompressor):
        total += len(part)
        _refuse(path, at, length, total)


def _mcap_chunks(path: Path, file: BinaryIO) -> Iterator[tuple[int, int]]:
    """Place and length of the packed records of each chunk, which are checked."""
    size = path.stat().st_size
    file.seek(len(_MCAP))
    while len(head := file.read(9)) == 9:
        kind, length = struct.unpack("<BQ", head)
        start = file.tell()
        if kind == _FOOTER or length > size - start:
            return
        if kind == _CHUNK and length >= 40:
            unpacked = struct.unpack("<16xQ4x", file.read(28))[0]
            (name_length,) = struct.unpack("<I", file.read(4))
            compression = file.read(min(name_length, 16))
            file.seek(start + 32 + name_length)
            (packed,) = struct.unpack("<Q", file.read(8).ljust(8, b"\0"))
            at = file.tell()
            if packed > size - at:
                raise format_error(
                    path, f"a chunk of {packed:,} bytes does not fit into the file", byte=start
                )
            _refuse(path, start, packed, unpacked)
            if compression == b"zstd":
                _check_zstd(path, file, packed)
            yield at, packed
        file.seek(start + length)


def _check_mcap(path: Path) -> set[tuple[int, int]]:
    with path.open("rb") as file:
        return set(_mcap_chunks(path, file))


def _check_messages(path: Path) -> None:
    """Refuses a database with a packed message that grows too much."""
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as database:
        for (data,) in database.execute("SELECT data FROM messages"):
            if isinstance(data, bytes) and data.startswith(_ZSTD):
                _check_zstd(path, io.BytesIO(data), len(data))


def check_files(path: Path) -> None:
    """Checks what is packed in the files of a bag, before the package unpacks it."""
    files = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())
    metadata = path / "metadata.yaml"
    by_message = path.is_dir() and _BY_MESSAGE.search(metadata.read_text("utf-8", "replace"))
    for one in files:
        with one.open("rb") as file:
            start = file.read(len(_MCAP))
            if start.startswith(_ZSTD):
                file.seek(0)
                _check_zstd(one, file, one.stat().st_size)
        if start == _MCAP:
            _check_mcap(one)
        elif by_message and one.suffix == ".db3":
            _check_messages(one)


def _bounded(path: Path, otherwise: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """What unpacks a chunk of ROS 1 as long as it does not grow too much."""

    def unpack(data: bytes) -> bytes:
        if data.startswith(b"BZh"):
            decoder: Any = bz2.BZ2Decompressor()
        elif data.startswith(b"\x04\x22\x4d\x18"):
            decoder = importlib.import_module("lz4.frame").LZ4FrameDecompressor()
        else:
            return otherwise(data)
        limit = max(FREE_BYTES, LARGEST_RATIO * len(data))
        unpacked: bytes = decoder.decompress(data, limit + 1)
        _refuse(path, 0, len(data), len(unpacked))
        if not decoder.eof:
            raise format_error(path, "a chunk ends inside its packed data")
        return unpacked

    return unpack


def bound_chunks(path: Path, reader: Any) -> None:
    """Checks the chunks that the index of an open bag names, and bounds those of ROS 1."""
    for part in reader.readers:
        for at, chunk in getattr(part, "chunks", {}).items():
            part.chunks[at] = chunk._replace(decompressor=_bounded(path, chunk.decompressor))
        whole: Any = getattr(part, "storage", None)
        for storage in getattr(whole, "storages", (whole,)):
            if not (chunks := getattr(storage, "chunks", ())):
                continue
            known = _check_mcap(Path(storage.path))
            for chunk in chunks:
                at = chunk.chunk_start_offset + 9 + 40 + len(chunk.compression)
                if (at, chunk.compressed_size) not in known:
                    raise format_error(
                        path, "the index names a chunk that is none", byte=chunk.chunk_start_offset
                    )
