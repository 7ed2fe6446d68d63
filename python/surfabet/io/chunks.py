"""Clouds chunk by chunk, for scenes that are larger than the memory."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from surfabet._core import PointCloud
from surfabet.errors import wrong_type
from surfabet.io._files import existing
from surfabet.io._packed import first_bytes, unpacked
from surfabet.io.e57 import read_e57_chunks
from surfabet.io.las import read_las_chunks
from surfabet.io.pcd import read_pcd_chunks
from surfabet.io.ply import read_ply_chunks
from surfabet.io.rgbd import read_rgbd_chunks
from surfabet.io.ros import read_bag_chunks

__all__ = ["CHUNK", "Chunks", "chunks_of", "read_chunks"]

CHUNK = 2_000_000
"""Points of a chunk, at most."""


@dataclass(frozen=True)
class Chunks:
    """A source of points, chunk by chunk."""

    start: Callable[[], Iterator[PointCloud]]
    n_points: int | None
    """Points of all chunks, where it is known before."""
    is_repeatable: bool
    """Whether a second run reads the same."""
    absent_is_zero: bool
    """Whether a column that a chunk does not have is 0 there."""
    identity: list[list[Any]]
    """What tells the source from another: paths, sizes and times of files."""

    def __iter__(self) -> Iterator[PointCloud]:
        return self.start()


def chunks_of(source: Any) -> Chunks:
    """The chunks of a cloud, of a file or folder, of several, or of an iterable of clouds.

    Raises
    ------
    InvalidInputError
        It is none of these.
    FileNotFoundError
        A path leads nowhere.
    """
    if isinstance(source, PointCloud):
        return Chunks(lambda: iter([source]), len(source), False, False, [])
    if isinstance(source, str | os.PathLike):
        source = [source]
    if isinstance(source, Sequence) and all(isinstance(p, str | os.PathLike) for p in source):
        return _of_files([Path(p) for p in source])
    if isinstance(source, Iterable):
        return Chunks(lambda: _clouds(source), None, False, False, [])
    raise wrong_type(
        "source", source, "a cloud, a path, several of these, or an iterable of clouds"
    )


def _clouds(source: Iterable[Any]) -> Iterator[PointCloud]:
    for i, cloud in enumerate(source):
        if not isinstance(cloud, PointCloud):
            raise wrong_type(f"source[{i}]", cloud, "a PointCloud")
        yield cloud


def _of_files(paths: list[Path]) -> Chunks:
    identity: list[list[Any]] = []
    for path in paths:
        found = sorted(existing(path).rglob("*")) if path.is_dir() else [path]
        for file in found:
            about = file.stat()
            identity.append([str(file.resolve()), about.st_size, about.st_mtime_ns])
    counts = [_las_count(path) for path in paths]
    known = [count for count in counts if count is not None]
    n_points = sum(known) if len(known) == len(counts) else None
    # LAS has the same fields in all records of a file.
    is_las = len(paths) == 1 and n_points is not None
    return Chunks(lambda: _read_all(paths), n_points, True, is_las, identity)


def _las_count(path: Path) -> int | None:
    """Points of a LAS file by its header; None for others."""
    from surfabet.io import detect

    if path.is_dir() or detect(path).name not in ("las", "copc"):
        return None
    header = first_bytes(path)
    if len(header) >= 255 and header[25] >= 4:
        return int(struct.unpack_from("<Q", header, 247)[0])
    return int(struct.unpack_from("<I", header, 107)[0]) if len(header) > 111 else None


def _read_all(paths: list[Path]) -> Iterator[PointCloud]:
    for path in paths:
        yield from read_chunks(path)


# Each takes a file and a number of points, and gives what `read` does as clouds of at most so many;
# None for a file that can only be read as a whole.
_READERS: dict[str, Callable[[Path, int], Iterator[PointCloud] | None]] = {
    "las": read_las_chunks,
    "copc": read_las_chunks,
    "ply": read_ply_chunks,
    "pcd": read_pcd_chunks,
    "e57": read_e57_chunks,
    "rgbd": read_rgbd_chunks,
    "bag": read_bag_chunks,
    "mcap": read_bag_chunks,
}


def read_chunks(path: Path, n: int = CHUNK) -> Iterator[PointCloud]:
    """The points of a file or folder as clouds of at most `n`, with what `surfabet.read` gives in
    its order.

    Where a file can only be read as a whole, that is in memory while its chunks are given. Of LAS a
    column that is 0 in all points of a chunk is not in its cloud.

    Raises
    ------
    FormatError, MissingDependencyError
        As `surfabet.read`.

    Warns
    -----
    DroppedPointsWarning, LostAttributeWarning
        As `surfabet.read`, after the last chunk.
    """
    from surfabet.io import detect, read

    reader = _READERS.get(detect(path).name)
    with unpacked(path) as there:
        chunks = None if reader is None else reader(there, n)
        if chunks is None:
            cloud = read(path)
            chunks = (
                cloud.select(np.arange(start, min(start + n, len(cloud))))
                for start in range(0, len(cloud), n)
            )
        yield from chunks
