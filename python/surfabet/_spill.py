"""Points of a scene on disk, by cubes of the world ("bricks"), so that those of a place are read
without the others."""

from __future__ import annotations

import io
import json
import os
import shutil
import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._core import PointCloud
from surfabet.errors import InvalidInputError

__all__ = ["HALF", "Column", "Figures", "Spill", "SpillWriter", "check_space"]

_POINTS = "points.bin"
_INDEX = "points.npz"
_ABOUT = "points.json"

BYTES_PER_POINT = 110
"""Memory that learning a tile and reading its points take per point of it and around it, bytes:
103 to 108 were measured."""

BYTES_PER_VALUE = 20
"""The same for each number of a point beside its coordinates, and `BYTES_WITH_VALUES` once: 45 were
measured for an intensity, 62 for a colour, 95 for both, 145 with three attributes more."""

BYTES_WITH_VALUES = 25

_ONE_HEADER = threading.Lock()
"""Numpy parses headers with `ast`, which fails at random in two threads at once of Python 3.11."""

HALF = _core.BRICK_HALF
"""Coordinates of bricks about the first one are less, so that three fit a key of 63 bits."""

# Space that is left to others on the disk, bytes.
_RESERVE = 64 << 20

_LABELS = 32
"""Integers of at most so many different values are labels."""


def check_space(folder: Path, n_bytes: int) -> None:
    """Refuses to write `n_bytes` where the disk has no room for them.

    Raises
    ------
    OSError
        The message has both numbers and the folder.
    """
    free = shutil.disk_usage(folder).free
    if n_bytes + _RESERVE > free:
        raise OSError(
            f"{folder}: the points need {n_bytes / 1e9:.2f} GB on disk until the map is written, "
            f"and {free / 1e9:.2f} GB are free; make room or name a folder on another disk with "
            "work="
        )


@dataclass(frozen=True)
class Column:
    """A column that is kept of every point."""

    name: str
    dtype: str
    """Type of numpy."""
    width: int = 1


@dataclass
class Figures:
    """What is known of the numbers of a column over all points so far."""

    n: int = 0
    mean: float = 0.0
    squares: float = 0.0
    """Sum of the squared deviations from the mean."""
    low: float = np.inf
    high: float = -np.inf
    labels: list[int] | None = field(default_factory=list)
    """Different values, while they are integers and few."""

    def add(self, values: NDArray[Any]) -> None:
        """Adds the values of some points."""
        if not np.issubdtype(values.dtype, np.integer):
            self.labels = None
        elif self.labels is not None:
            found = np.union1d(np.unique(values), np.array(self.labels, values.dtype))
            self.labels = found.tolist() if len(found) <= _LABELS else None
        numbers = values.astype(np.float64)
        numbers = numbers[np.isfinite(numbers)]
        if not len(numbers):
            return
        n, mean = len(numbers), float(numbers.mean())
        squares = float(((numbers - mean) ** 2).sum())
        total, apart = self.n + n, mean - self.mean
        self.squares += squares + apart**2 * self.n * n / total
        self.mean += apart * n / total
        self.n = total
        self.low = min(self.low, float(numbers.min()))
        self.high = max(self.high, float(numbers.max()))

    @property
    def deviation(self) -> float:
        """Standard deviation; 0 without numbers."""
        return float(np.sqrt(self.squares / self.n)) if self.n else 0.0


def _columns_of(cloud: PointCloud, names: Sequence[str]) -> list[Column]:
    """The columns of a cloud that learning needs, with the attributes that are kept."""
    columns = [Column("position", "f4", 3)]
    if cloud.colors is not None and "colors" in names:
        columns.append(Column("colors", "u1", 3))
    if cloud.normals is not None:
        columns.append(Column("normals", "f4", 3))
    if cloud.ranges is not None:
        columns.append(Column("ranges", "f4"))
    if cloud.viewpoints is not None:
        columns.append(Column("viewpoint", "u4"))
    others = {"intensities": cloud.intensities, **cloud.extra}
    for name, values in others.items():
        if values is not None and name in names:
            columns.append(Column(f"attribute {name}", values.dtype.str[1:]))
    return columns


def _record(columns: Sequence[Column]) -> np.dtype[Any]:
    """Type of what is written of a point."""
    return np.dtype([(c.name, c.dtype, (c.width,) if c.width > 1 else ()) for c in columns])


class SpillWriter:
    """Writes points chunk by chunk; `finish` makes them a `Spill`."""

    def __init__(
        self,
        folder: Path,
        side: float,
        first: PointCloud,
        names: Sequence[str],
        absent_is_zero: bool = False,
    ) -> None:
        self.folder = folder
        self.names = names
        self.absent_is_zero = absent_is_zero
        self.side = side
        self.columns = _columns_of(first, names)
        self.record = _record(self.columns)
        bounds = first.bounds
        middle = np.zeros(3) if bounds is None else np.mean(bounds, axis=0)
        self.base = np.floor(middle / side).astype(np.int64)
        self._base = self.base.tolist()
        self.figures: dict[str, Figures] = {}
        self.viewpoints: list[NDArray[np.float64]] = []
        self.n_viewpoints = 0
        self.n_points = 0
        self.dropped = 0
        self.too_far = 0
        self.crs = first.crs
        self.lost: list[str] = []
        self.not_kept: list[str] = []
        self._pages: list[NDArray[np.int64]] = []
        self._written = 0
        self._file = (folder / _POINTS).open("wb")

    def close(self) -> None:
        """Closes the file of the points."""
        self._file.close()

    def add(self, cloud: PointCloud) -> None:
        """Adds a chunk.

        Raises
        ------
        OSError
            The disk is full.
        """
        if not len(cloud):
            return
        check_space(self.folder, len(cloud) * self.record.itemsize)
        for name in cloud.attributes:
            if name not in self.names and name not in self.not_kept:
                self.not_kept.append(name)
        known = {column.name for column in self.columns}
        for column in _columns_of(cloud, self.names):
            if column.name not in known:
                self._lose(column.name)
        keys, counts, order, positions = _core.sort_by_bricks(cloud, self.side, self._base)
        if len(order) < len(cloud):
            self.too_far += len(cloud) - len(order)
            cloud = cloud.select(np.sort(order))
            keys, counts, order, positions = _core.sort_by_bricks(cloud, self.side, self._base)
        starts = self._written + np.cumsum(counts) - counts
        self._pages.append(np.column_stack([keys, starts, counts]))
        self._records(cloud, order, positions).tofile(self._file)
        self._written += len(order)
        self.n_points += len(order)

    def _records(
        self, cloud: PointCloud, order: NDArray[np.uint32], positions: NDArray[np.float32]
    ) -> NDArray[Any]:
        """What is written of the points, whose positions are in this order."""
        if len(self.columns) == 1:
            return positions
        records = np.zeros(len(order), self.record)
        records["position"] = positions
        for column in self.columns[1:]:
            values = self._values(cloud, column)
            if values is None:
                if not self.absent_is_zero:
                    self._lose(column.name)
                continue
            records[column.name] = values[order]
            if column.name.startswith("attribute "):
                self.figures.setdefault(column.name, Figures()).add(values)
        return records

    def _lose(self, name: str) -> None:
        """Notes a column that not every chunk has."""
        if name not in self.lost:
            self.lost.append(name)

    def _values(self, cloud: PointCloud, column: Column) -> NDArray[Any] | None:
        name = column.name.removeprefix("attribute ")
        if name == "viewpoint":
            if cloud.viewpoints is None or cloud.viewpoint_index is None:
                return None
            index = cloud.viewpoint_index + np.uint32(self.n_viewpoints)
            self.viewpoints.append(np.array(cloud.viewpoints))
            self.n_viewpoints += len(cloud.viewpoints)
            return index
        named = {"colors": cloud.colors, "normals": cloud.normals, "ranges": cloud.ranges}
        values = named.get(name)
        if values is None:
            values = cloud.intensities if name == "intensities" else cloud.extra.get(name)
        if values is not None and values.dtype.str[1:] != column.dtype:
            return None
        return values

    def finish(self) -> Spill:
        """The points that were written."""
        self.close()
        pages = np.concatenate(self._pages) if self._pages else np.empty((0, 3), np.int64)
        pages = pages[np.argsort(pages[:, 0], kind="stable")]
        viewpoints = np.concatenate(self.viewpoints) if self.viewpoints else np.empty((0, 3))
        with (self.folder / _INDEX).open("wb") as file:
            np.savez(file, pages=pages, viewpoints=viewpoints)
        about = {
            "side": self.side,
            "base": self.base.tolist(),
            "columns": [[c.name, c.dtype, c.width] for c in self.columns],
            "lost": self.lost,
            "not_kept": self.not_kept,
            "n_points": self.n_points,
            "too_far": self.too_far,
            "dropped": self.dropped,
            "crs": self.crs,
            "figures": {
                name: [f.labels, f.low, f.high, f.deviation]
                for name, f in self.figures.items()
                if f.n and name not in self.lost
            },
        }
        partial = self.folder / f"{_ABOUT}.part"
        partial.write_text(json.dumps(about))
        os.replace(partial, self.folder / _ABOUT)
        return Spill.open(self.folder)


@dataclass(frozen=True)
class Spill:
    """Points on disk, by bricks."""

    folder: Path
    side: float
    """Side of a brick, metres."""
    base: NDArray[np.int64]
    """Coordinates of the brick that others are counted from."""
    columns: list[Column]
    lost: list[str]
    """Columns that some chunk did not have."""
    not_kept: list[str]
    """Attributes of the source that no column is of."""
    n_points: int
    too_far: int
    """Points that were left out: a million bricks from the first ones."""
    dropped: int
    """Points that the readers of the source left out."""
    crs: str | None
    figures: dict[str, list[Any]]
    keys: NDArray[np.int64]
    """Bricks with points, growing."""
    counts: NDArray[np.int64]
    """Points of each."""
    pages: NDArray[np.int64]
    """Key, first record and number of records of each page, by key, then in the order written."""
    viewpoints: NDArray[np.float64]

    @staticmethod
    def open(folder: Path) -> Spill:
        """The points that a `SpillWriter` finished in a folder."""
        about = json.loads((folder / _ABOUT).read_text())
        with _ONE_HEADER, np.load(folder / _INDEX) as index:
            pages, viewpoints = index["pages"], index["viewpoints"]
        keys, starts = np.unique(pages[:, 0], return_index=True)
        counts = np.add.reduceat(pages[:, 2], starts) if len(starts) else np.empty(0, np.int64)
        return Spill(
            folder=folder,
            side=about["side"],
            base=np.array(about["base"], np.int64),
            columns=[Column(*column) for column in about["columns"]],
            lost=about["lost"],
            not_kept=about["not_kept"],
            n_points=about["n_points"],
            too_far=about["too_far"],
            dropped=about["dropped"],
            crs=about["crs"],
            figures=about["figures"],
            keys=keys,
            counts=counts,
            pages=pages,
            viewpoints=viewpoints,
        )

    @property
    def bytes_per_point(self) -> int:
        """Memory that a tile is taken to need per point of it and around it, bytes."""
        n_values = sum(column.width for column in self.columns if column.name != "position")
        with_values = BYTES_WITH_VALUES if n_values else 0
        return BYTES_PER_POINT + with_values + BYTES_PER_VALUE * n_values

    @staticmethod
    def is_finished(folder: Path) -> bool:
        """True where `open` finds points."""
        return (folder / _ABOUT).exists()

    def corners(self, bricks: NDArray[np.int64]) -> NDArray[np.float64]:
        """World coordinates of the lower corners of bricks, given by number, (n, 3)."""
        keys = self.keys[bricks]
        mask = (1 << 21) - 1
        places = np.stack([keys >> 42, keys >> 21 & mask, keys & mask], axis=-1) - HALF
        return np.asarray((places + self.base) * self.side, np.float64)

    def read(self, bricks: Iterable[int], origin: Sequence[float]) -> PointCloud:
        """The points of bricks, given by number, about `origin`: brick by brick by key, in each in
        the order of the source."""
        wanted = np.sort(np.fromiter(bricks, np.int64))
        if not len(wanted):
            raise InvalidInputError("no bricks to read")
        size = _record(self.columns).itemsize
        n_of_bricks = self.counts[wanted]
        records = np.empty(int(n_of_bricks.sum()) * size, np.uint8)
        first = np.searchsorted(self.pages[:, 0], self.keys[wanted], side="left")
        last = np.searchsorted(self.pages[:, 0], self.keys[wanted], side="right")
        at = 0
        with (self.folder / _POINTS).open("rb", buffering=0) as file:
            for low, high in zip(first, last, strict=True):
                for _, start, count in self.pages[low:high].tolist():
                    file.seek(start * size)
                    _read_into(file, records[at : at + count * size].data)
                    at += count * size
        corners = self.corners(wanted) - np.array(origin)
        points = _core.cloud_of_records(
            records, size, n_of_bricks.tolist(), corners, [float(c) for c in origin]
        )
        return self._with_columns(points, records.view(_record(self.columns)))

    def _with_columns(self, points: PointCloud, records: NDArray[Any]) -> PointCloud:
        """The points of records with all other columns of these."""
        kept = {c.name for c in self.columns} - set(self.lost)
        if len(kept) == 1:
            return points
        given: dict[str, Any] = {
            name: np.ascontiguousarray(records[name])
            for name in ("colors", "normals", "ranges")
            if name in kept
        }
        extra = {}
        for name in sorted(kept, key=[c.name for c in self.columns].index):
            if name == "attribute intensities":
                given["intensities"] = np.ascontiguousarray(records[name])
            elif name.startswith("attribute "):
                extra[name.removeprefix("attribute ")] = np.ascontiguousarray(records[name])
        if "viewpoint" in kept:
            used, index = np.unique(records["viewpoint"], return_inverse=True)
            given |= {"viewpoints": self.viewpoints[used], "viewpoint_index": index}
        origin = list(points.origin)
        return PointCloud(points.local_points, extra=extra or None, origin=origin, **given)


def _read_into(file: io.FileIO, rest: memoryview) -> None:
    """Fills memory from where a file stands."""
    while rest:
        if not (n := file.readinto(rest)):
            raise OSError(f"{file.name} ends early: remove the folder and start again")
        rest = rest[n:]
