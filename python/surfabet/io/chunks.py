"""Clouds chunk by chunk, for scenes that are larger than the memory."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from surfabet._core import PointCloud
from surfabet.errors import InvalidInputError
from surfabet.io.las import read_las_chunks
from surfabet.io.ply import read_ply_chunks

__all__ = ["CHUNK", "Chunks", "chunks_of"]

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
    raise InvalidInputError(
        f"source is {source!r}, but must be a cloud, a path, several of these, or an iterable of "
        "clouds",
        argument="source",
        value=repr(source),
        requirement="a cloud, a path, several of these, or an iterable of clouds",
    )


def _clouds(source: Iterable[Any]) -> Iterator[PointCloud]:
    for i, cloud in enumerate(source):
        if not isinstance(cloud, PointCloud):
            raise InvalidInputError(f"item {i} of source is {cloud!r}, but must be a PointCloud")
        yield cloud


def _of_files(paths: list[Path]) -> Chunks:
    identity: list[list[Any]] = []
    counts: list[int | None] = []
    for path in paths:
        if not path.exists():
            raise FileNotFoundError(f"there is no file {path}")
        found = sorted(path.rglob("*")) if path.is_dir() else [path]
        for file in found:
            about = file.stat()
            identity.append([str(file.resolve()), about.st_size, about.st_mtime_ns])
        counts.append(_count(path))
    known = [count for count in counts if count is not None]
    n_points = sum(known) if len(known) == len(counts) else None
    # LAS has the same fields in all records of a file.
    is_las = len(paths) == 1 and n_points is not None
    return Chunks(lambda: _read(paths), n_points, True, is_las, identity)


def _count(path: Path) -> int | None:
    """Points of a file, where its header tells them."""
    from surfabet.io import detect

    if path.is_dir() or detect(path).name not in ("las", "copc"):
        return None
    import struct

    with path.open("rb") as file:
        header = file.read(375)
    if len(header) >= 255 and header[25] >= 4:
        return int(struct.unpack_from("<Q", header, 247)[0])
    return int(struct.unpack_from("<I", header, 107)[0]) if len(header) > 111 else None


def _read(paths: list[Path]) -> Iterator[PointCloud]:
    from surfabet.io import detect, read

    for path in paths:
        name = "" if path.is_dir() else detect(path).name
        chunks: Iterable[PointCloud] | None = None
        if name in ("las", "copc"):
            chunks = read_las_chunks(path, CHUNK)
        elif name == "ply":
            chunks = read_ply_chunks(path, CHUNK)
        if chunks is not None:
            yield from chunks
        else:
            cloud = read(path)
            for start in range(0, len(cloud), CHUNK):
                yield cloud.select(np.arange(start, min(start + CHUNK, len(cloud))))
