"""Packed bags: what is honest is read, what grows beyond what scans do is refused unread."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import surfabet as sb
from case_files import peak_memory
from surfabet.io import _packed
from test_io_ros import CLOUD, ONE, POINTS, ROS1, ROS2, TWO, read, rosbag1, rosbag2, xyz

zstd = pytest.importorskip("backports.zstd")
chunks = pytest.importorskip("surfabet.io.ros._chunks")

KINDS = ("bag-bz2", "bag-lz4", "mcap-storage", "db3-message", "db3-file", "mcap-file")
REFUSED = "as those of no scan do"


def write(folder: Path, kind: str, message: Any) -> Path:
    """A packed bag of one message."""
    storage, _, how = kind.partition("-")
    if storage == "bag":
        path = folder / "a.bag"
        writer = rosbag1.Writer(path)
        writer.set_compression(getattr(rosbag1.Writer.CompressionFormat, how.upper()))
        with writer:
            connection = writer.add_connection("/points", CLOUD, typestore=ROS1)
            writer.write(connection, 1, ROS1.serialize_ros1(message, CLOUD))
        return path
    path = folder / "bag"
    plugin = rosbag2.StoragePlugin.SQLITE3 if storage == "db3" else rosbag2.StoragePlugin.MCAP
    writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    writer.set_compression(
        getattr(rosbag2.CompressionMode, how.upper()), rosbag2.CompressionFormat.ZSTD
    )
    with writer:
        connection = writer.add_connection("/points", CLOUD, typestore=ROS2)
        writer.write(connection, 1, ROS2.serialize_cdr(message, CLOUD))
    return path


def message(kind: str, points: np.ndarray = POINTS) -> Any:
    return (ONE if kind.startswith("bag") else TWO).cloud(1.0, "lidar", xyz(points))


@pytest.mark.parametrize("kind", KINDS)
def test_honest_bags_are_read(kind: str, tmp_path: Path) -> None:
    path = write(tmp_path, kind, message(kind))
    np.testing.assert_array_equal(read(path).points, POINTS)


@pytest.mark.parametrize("kind", KINDS)
def test_honest_bags_are_read_by_counting_what_they_hold(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With no free bytes, blocks that hold less than they may are unpacked to be counted."""
    path = write(tmp_path, kind, message(kind))
    monkeypatch.setattr(_packed, "FREE_BYTES", 1 << 13)
    monkeypatch.setattr(chunks, "FREE_BYTES", 1 << 13)
    np.testing.assert_array_equal(read(path).points, POINTS)


@pytest.mark.parametrize("kind", KINDS)
def test_bombs_are_refused(kind: str, tmp_path: Path) -> None:
    path = write(tmp_path, kind, message(kind, np.zeros((7_000_000, 3))))
    before = peak_memory()
    with pytest.raises(sb.FormatError, match=REFUSED):
        sb.read(path)
    # Writing took more than reading may.
    assert peak_memory() - before < 100_000


def _mcap(tmp_path: Path, change: Callable[[bytearray, int, int], None]) -> Path:
    """A packed MCAP file with a change at its chunk and the chunk's index."""
    folder = write(tmp_path, "mcap-storage", message("mcap"))
    data = bytearray(next(folder.glob("*.mcap")).read_bytes())
    (size,) = struct.unpack_from("<Q", data, 9)
    chunk = 8 + 9 + size
    assert data[chunk] == 0x06
    # The record of the index ends with the sizes, packed and not.
    unpacked = bytes(data[chunk + 9 + 16 : chunk + 9 + 24])
    index = data.rindex(unpacked)
    change(data, chunk + 9 + 16, index)
    path = tmp_path / "changed.mcap"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(("size", "refused"), [(1 << 26, False), ((1 << 26) + 1, True)])
def test_a_chunk_that_says_it_is_large_is_not_unpacked(
    size: int, refused: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def change(data: bytearray, header: int, index: int) -> None:
        for at in (header, index):
            struct.pack_into("<Q", data, at, size)

    path = _mcap(tmp_path, change)
    with pytest.raises(sb.FormatError) as error:
        sb.read(path)
    # What is small enough is unpacked, and found to be another size.
    assert (REFUSED in str(error.value)) == refused
    assert ("size mismatch" in str(error.value)) != refused


def test_a_chunk_that_says_it_is_small(tmp_path: Path) -> None:
    folder = write(tmp_path, "mcap-storage", message("mcap", np.zeros((7_000_000, 3))))
    path = next(folder.glob("*.mcap"))
    data = bytearray(path.read_bytes())
    (size,) = struct.unpack_from("<Q", data, 9)
    header = 8 + 9 + size + 9 + 16
    index = data.rindex(bytes(data[header : header + 8]))
    for at in (header, index):
        struct.pack_into("<Q", data, at, 1000)
    path.write_bytes(data)
    with pytest.raises(sb.FormatError, match=REFUSED):
        sb.read(path)


def test_an_index_that_names_another_chunk(tmp_path: Path) -> None:
    def change(data: bytearray, header: int, index: int) -> None:
        (packed,) = struct.unpack_from("<Q", data, index - 8)
        struct.pack_into("<Q", data, index - 8, packed - 1)

    with pytest.raises(sb.FormatError, match="the index names a chunk that is none"):
        sb.read(_mcap(tmp_path, change))


def test_a_chunk_longer_than_the_file(tmp_path: Path) -> None:
    def change(data: bytearray, header: int, index: int) -> None:
        (length,) = struct.unpack_from("<I", data, header + 12)
        struct.pack_into("<Q", data, header + 16 + length, 1 << 40)

    with pytest.raises(sb.FormatError, match="does not fit into the file"):
        sb.read(_mcap(tmp_path, change))


@settings(max_examples=60, deadline=None)
@given(
    parts=st.lists(st.tuples(st.integers(0, 300_000), st.integers(0, 3)), max_size=4),
    level=st.integers(1, 6),
    checksum=st.booleans(),
    streamed=st.booleans(),
)
def test_blocks_bound_what_frames_grow_to(
    parts: list[tuple[int, int]], level: int, checksum: bool, streamed: bool
) -> None:
    """Never less than the truth, and of full blocks not more than a block per frame above it."""
    rng = np.random.default_rng(0)
    options = {
        zstd.CompressionParameter.compression_level: level,
        zstd.CompressionParameter.checksum_flag: int(checksum),
    }
    packed, total, n_frames = b"", 0, 0
    for size, kind in parts:
        data = bytes(size) if kind == 0 else rng.integers(0, 4**kind, size).astype("u1").tobytes()
        if streamed:
            compressor = zstd.ZstdCompressor(options=options)
            packed += compressor.compress(data) + compressor.flush()
        else:
            packed += zstd.compress(data, options=options)
        # A frame that readers pass over.
        packed += struct.pack("<II", 0x184D2A53, 5) + b"hello"
        total, n_frames = total + size, n_frames + 1
    bound = chunks.zstd_bound(io.BytesIO(packed), len(packed))
    assert zstd.decompress(packed) == zstd.decompress(packed) if packed else True
    assert total <= bound <= 2 * total + n_frames * (1 << 17)


def test_blocks_of_anything_end() -> None:
    rng = np.random.default_rng(1)
    whole = zstd.compress(rng.integers(0, 9, 400_000).astype("u1").tobytes())
    for _ in range(300):
        data = bytearray(whole[: rng.integers(0, len(whole))])
        for _ in range(rng.integers(0, 3)):
            if data:
                data[rng.integers(0, len(data))] = rng.integers(0, 256)
        assert chunks.zstd_bound(io.BytesIO(bytes(data)), len(data)) >= 0
