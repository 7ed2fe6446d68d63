"""Patches in tiles: maps of which only what is needed is read."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.model import MAX_POINTS, Box, Model, corners

__all__ = ["TiledPatchModel", "Tiles", "merge_tiles"]


@dataclass(frozen=True, slots=True)
class Tiles:
    """The n tiles of a model as arrays, in the order of the file."""

    cubes: NDArray[np.int64]
    """Place of each tile among the cubes of the lattice, (n, 3)."""
    bounds: NDArray[np.float64]
    """Lower and upper corner of the box around what each tile decodes to, world coordinates,
    (n, 2, 3), metres."""
    points: NDArray[np.uint64]
    """Points that each tile was learned from, (n,)."""
    bytes: NDArray[np.uint64]
    """Size of each tile in the file, (n,)."""

    def __len__(self) -> int:
        return len(self.points)


@final
class TiledPatchModel(Model[_core.TiledPatchModel]):
    """A cloud as surface patches in tiles, with thickness and attributes; immutable.

    Made by `learn_patches_tiled` and `surfabet.load`. Its tiles are cubes of one lattice, and are
    decoded one after another when they are asked for, so that a box of a large map takes little
    time and memory. It decodes like a `PatchModel`; fragments, attributes and normals of points
    beside the patches are those of each tile by itself.
    """

    __slots__ = ()

    def decode(
        self,
        resolution: float | None = None,
        *,
        as_measured: bool = False,
        normals: bool = False,
        box: Box | None = None,
        level: int | None = None,
        max_points: int = MAX_POINTS,
        progress: Progress = None,
    ) -> PointCloud:
        """As `Model.decode`, at a level of detail.

        Parameters
        ----------
        resolution, as_measured, normals, box, max_points, progress
            As for any model. With `box` only the tiles that meet it are decoded.
        level
            Level of detail, 0 the coarsest; by default the one that was loaded, else the finest.

        Raises
        ------
        InvalidInputError
            As `Model.decode`, and for a level that was not loaded.
        FormatError
            When a tile of a file is damaged.
        """
        with progress_callback(progress) as callback:
            return self._core.decode_level(
                resolution=resolution,
                as_measured=as_measured,
                normals=normals,
                region=corners(box),
                level=_level(level),
                max_points=max_points,
                progress=callback,
            )

    def save(self, path: str | os.PathLike[str], *, note: str = "") -> int:
        """As `Model.save`. Of a model that was loaded with a box, the tiles that were read are
        written, whole."""
        return self._core.save_tiles(os.fspath(path), note)

    @property
    def tiles(self) -> Tiles:
        """The tiles that are here, of the level of detail that is decoded."""
        return Tiles(
            cubes=self._core.tile_cubes(),
            bounds=self._core.tile_bounds().reshape(-1, 2, 3),
            points=self._core.tile_points(),
            bytes=self._core.tile_bytes(),
        )

    @property
    def tile_side(self) -> float:
        """Side of a tile, metres."""
        return self._core.tile_side

    @property
    def pixel_sizes(self) -> tuple[float, ...]:
        """Side of the finest pixels of each level of detail, coarsest first, metres."""
        return tuple(self._core.pixel_sizes)

    @property
    def attributes(self) -> tuple[str, ...]:
        """Names of the attributes that the model keeps: `"colors"`, `"intensities"` and others."""
        return (*(("colors",) if self.has_color else ()), *self._core.attribute_names)

    @property
    def max_error(self) -> float | None:
        """Largest distance of any input point to the cloud decoded as measured at the default
        spacing, metres; None when no bound was asked for."""
        return self._core.max_error

    @property
    def max_error_forward(self) -> float | None:
        """Bound on the distance of decoded points to the input, metres; None where none was asked.

        It holds for the model decoded at its default spacing, as measured or as a surface.
        """
        return self._core.max_error_forward

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Lattice to world, (3, 3): the scene's own axes as columns."""
        return np.array(self._core.rotation)

    def __repr__(self) -> str:
        tiles = len(self.tiles)
        return (
            f"TiledPatchModel({self.n_points} points as {len(self)} patches in {tiles} "
            f"tile{'' if tiles == 1 else 's'} of {self.tile_side:g} m with pixels of "
            f"{self.pixel_sizes[-1]:g} m" + (", coloured" if self.has_color else "") + ")"
        )


def _level(level: int | None) -> int | None:
    from surfabet.errors import InvalidInputError

    if level is not None and (isinstance(level, bool) or not isinstance(level, int) or level < 0):
        raise InvalidInputError(
            f"level is {level!r}, but must be an integer of at least 0",
            argument="level",
            value=repr(level),
            requirement="an integer of at least 0",
        )
    return level


def merge_tiles(models: Sequence[TiledPatchModel]) -> TiledPatchModel:
    """The model of all tiles of some models that share one plan, in any order.

    Raises
    ------
    InvalidInputError
        Without models, and for models of different lattices.
    FormatError
        Two of them have a tile at one place.
    """
    return TiledPatchModel(_core.merge_tiles([model._core for model in models]))


def open_tiled(
    source: Any, *, box: Box | None, level: int | None, max_items: int, max_bytes: int
) -> TiledPatchModel | None:
    """The model in tiles of a path or of a seekable binary object; None for a file without
    tiles."""
    options: dict[str, Any] = {
        "region": corners(box),
        "level": _level(level),
        "max_items": max_items,
        "max_bytes": max_bytes,
    }
    if isinstance(source, str | os.PathLike):
        core = _core.open_tiles(os.fspath(source), **options)
    else:
        size = source.seek(0, os.SEEK_END)

        def read(offset: int, length: int) -> bytes:
            source.seek(offset)
            data: bytes = source.read(length)
            return data

        core = _core.open_tiles_of(read, size, **options)
    return None if core is None else TiledPatchModel(core)
