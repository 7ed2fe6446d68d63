"""Scans that are larger than memory into a map in tiles: their points go to disk by place, and
tiles are learned one by one."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from surfabet import _core
from surfabet._core import PointCloud
from surfabet._progress import ProgressCallback
from surfabet._spill import Spill
from surfabet.errors import InvalidInputError
from surfabet.io._files import path_of
from surfabet.io.chunks import Chunks, chunks_of
from surfabet.tiling import (
    BASE_MEMORY,
    checked_memory,
    members_of,
    scene_of,
    spilled,
)

__all__ = ["ScanOnDisk", "scan_on_disk"]


class ScanOnDisk:
    """The points of a scan by place, and what all tiles that they touch share."""

    def __init__(
        self, core: _core.TiledPatchModel, spill: Spill, mean_weight: float, max_memory: int
    ) -> None:
        self._core = core
        self._spill = spill
        self._mean_weight = mean_weight
        self._max_memory = max_memory
        self._plan = core.tile_plan()
        self._bricks, left_out = scene_of(spill, keep_outliers=False)
        self.left_out = left_out + spill.too_far
        """Points far from all others."""
        self.lost = sorted(name.removeprefix("attribute ") for name in spill.lost)
        """Columns that some part of the scan does not have."""

    @property
    def n_points(self) -> int:
        """Points that go into the map."""
        return int(self._spill.counts[self._bricks].sum())

    @property
    def bounds(self) -> tuple[Any, Any]:
        """A box about the points, to the side of a brick."""
        low = self._spill.corners(self._bricks)
        return low.min(axis=0), low.max(axis=0) + self._spill.side

    def update(self, *, alone: bool, report_progress: ProgressCallback) -> _core.TiledPatchModel:
        """The map with the scan; with `alone` what the scan shows by itself.

        Raises
        ------
        InvalidInputError
            As `TiledPatchModel.update`, and where a tile does not fit the memory.
        """
        plan = {**self._plan, "margin": self._plan["scan_margin"]}
        members = sorted(members_of(self._spill, self._bricks, plan).items())
        for cube, bricks in members:
            self._check(cube, bricks, alone)
        tiles = []
        for i, (cube, bricks) in enumerate(members):
            report_progress(f"learn tiles ({i} of {len(members)})", 0.3 + 0.7 * i / len(members))
            points = self._spill.read(bricks, plan["origin"])
            tile = self._core.updated_tile(
                points, cube, mean_weight=self._mean_weight, alone=alone, progress=None
            )
            if tile is not None:
                tiles.append(tile)
        return self._core.with_tiles(tiles, alone=alone)

    def _check(self, cube: tuple[int, int, int], bricks: list[int], alone: bool) -> None:
        """Refuses a tile that does not fit the memory."""
        n_new = int(self._spill.counts[bricks].sum())
        side = self._plan["side"] * self._plan["pixel_size"]
        # Of the tiles around as much as of this one, by the area within the margin.
        about = (1 + 2 * self._plan["margin"] / side) ** 2
        n_known = 0 if alone else int(about * self._core.remembered_points(cube))
        need = BASE_MEMORY + self._spill.bytes_per_point * (n_new + n_known)
        if need > self._max_memory:
            raise InvalidInputError(
                f"max_memory is {self._max_memory / 1e9:.2f}e9 bytes, but a tile of {side:.3g} m "
                f"of the map with {n_new:,} points of the scan in it and around it takes "
                f"{need / 1e9:.2f}e9; give as much, or the scan in several parts",
                argument="max_memory",
                value=f"{self._max_memory}",
                requirement=f"at least {need} bytes",
            )


class _Weighed:
    """Chunks as they are read, and the sum of the weights of their points."""

    def __init__(self, core: _core.TiledPatchModel, chunks: Chunks) -> None:
        self._core, self._chunks = core, chunks
        self.weight, self.n_points = 0.0, 0

    def chunks(self) -> Chunks:
        return replace(self._chunks, start=self._read)

    def _read(self) -> Iterator[PointCloud]:
        for cloud in self._chunks:
            self.weight += self._core.scan_weight(cloud)
            self.n_points += len(cloud)
            yield cloud


@contextmanager
def scan_on_disk(
    core: _core.TiledPatchModel,
    source: Any,
    max_memory: int,
    work: str | os.PathLike[str] | None,
    report_progress: ProgressCallback,
) -> Iterator[ScanOnDisk]:
    """A scan that any reader gives in chunks, in a new folder within `work` until the context ends.

    Raises
    ------
    InvalidInputError
        For a source without points, and a map that cannot be learned on.
    OSError
        The source cannot be read, or the disk is full.
    """
    max_memory = checked_memory(max_memory)
    work = None if work is None else path_of("work", work)
    names = (["colors"] if core.has_color else []) + list(core.attribute_names)
    weighed = _Weighed(core, chunks_of(source))
    with tempfile.TemporaryDirectory(prefix="surfabet-", dir=work) as folder:
        spill = spilled(weighed.chunks(), Path(folder), core.tile_side, names, report_progress)
        yield ScanOnDisk(core, spill, weighed.weight / weighed.n_points, max_memory)
