"""Patches in tiles: maps of which only what is needed is read."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._checks import check_flag, check_integer, check_items
from surfabet._core import PointCloud
from surfabet._note import note_of_source
from surfabet._progress import Progress, progress_callback
from surfabet.errors import (
    DroppedPointsWarning,
    FrameWarning,
    InvalidInputError,
    wrong_type,
    wrong_value,
)
from surfabet.io._files import is_same_file
from surfabet.model import MAX_POINTS, Box, corners, decode_options, path_of_model
from surfabet.patches import LatticeModel

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


@dataclass(frozen=True, slots=True)
class _PartOf:
    """The file that a part of a map was read from."""

    path: Path
    n_read: int
    """Tiles that were read, of all levels of detail."""
    n_tiles: int
    """Tiles that it has."""

    def check(self, target: Path) -> None:
        """Refuses to write over the file when it has tiles that were not read.

        Raises
        ------
        InvalidInputError
            With their number and what to do.
        """
        if self.n_read < self.n_tiles and is_same_file(target, self.path):
            requirement = (
                f"another file than the one of which only {self.n_read} of {self.n_tiles} tiles "
                "were loaded, since the others would be lost; or load the whole map"
            )
            raise wrong_value("path", str(target), requirement)


@final
class TiledPatchModel(LatticeModel[_core.TiledPatchModel]):
    """A cloud as surface patches in tiles, with thickness and attributes; immutable.

    Made by `learn_patches_tiled`, `update`, `surfabet.merge_tiles` and `surfabet.load`. Its tiles
    are cubes of one lattice, and are decoded one after another when they are asked for, so that a
    box of a large map takes little time and memory. It decodes like a `PatchModel`; fragments,
    attributes and normals of points beside the patches are those of each tile by itself.
    """

    __slots__ = ("_read_from",)

    def __init__(
        self,
        core: _core.TiledPatchModel,
        note: str = "",
        read_from: tuple[_PartOf, ...] = (),
    ) -> None:
        super().__init__(core, note)
        self._read_from = read_from

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
        options = decode_options(resolution, as_measured, normals, box, max_points)
        with progress_callback(progress) as callback:
            return self._core.decode_level(**options, level=_level(level), progress=callback)

    def update(
        self,
        cloud: Any,
        *,
        alone: bool = False,
        max_memory: int | None = None,
        work: str | os.PathLike[str] | None = None,
        progress: Progress = None,
    ) -> TiledPatchModel:
        """The map with what another scan of the same world shows; this one stays as it is.

        Tiles that no point of the scan lies in keep their bytes. The others are learned from the
        scan and from what the map holds there, decoded with its thickness and weighed by the number
        of points that it was learned from. Points outside of all tiles make new ones. Axes, pixels,
        rounding and options are those of the map. What is no longer there stays in the map; see
        `surfabet.diff`.

        Parameters
        ----------
        cloud
            The scan, in the frame of the map: a `PointCloud`, or with `max_memory` any source of
            `learn_patches_tiled`. It needs the attributes that the map keeps, and viewpoints or
            normals when the map was learned with some.
        alone
            Give only what the scan shows, learned by the plan of the map: a map of its own, to be
            put together with others by `surfabet.merge_tiles`.
        max_memory
            Memory that this may take, bytes: the points of the scan go to disk, and tiles are
            learned one by one. By default all points are in memory.
        work
            Folder for the points when `max_memory` is given, by default that of temporary files;
            they are removed at the end.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Returns
        -------
        TiledPatchModel
            The same for the same arguments, whatever the number of threads; with `max_memory`
            points are added up in another order than without. Of a map that was
            loaded with a box it has the tiles that were read and those of the scan, the latter
            without what the file holds there: update the whole map to save it in its place.

        Raises
        ------
        InvalidInputError
            For a scan without what it needs, or without points, or so far from the map that one
            lattice cannot hold both; for a map of an older file, which does not say how its tiles
            were learned, for one that was loaded with one of several levels of detail, and for one
            with `max_error` or `max_error_forward`, which cannot be kept without the points.

        Warns
        -----
        DroppedPointsWarning
            Points far from all others of the scan are no part of the map.
        FrameWarning
            More than a tile lies between the scan and the map, which are perhaps not in one frame.
        """
        check_flag("alone", alone)
        if max_memory is None and work is not None:
            raise wrong_value("work", str(work), "given together with max_memory, or not at all")
        if max_memory is None and not isinstance(cloud, PointCloud):
            raise wrong_type("cloud", cloud, "a PointCloud, or with max_memory another source")
        with progress_callback(progress) as callback:
            if max_memory is None:
                apart = _distance(self, cloud.bounds)
                with _named_apart(apart, self.tile_side):
                    core, _, left_out = self._core.update(cloud, alone=alone, progress=callback)
            else:
                # Imported here: it stands on this module.
                from surfabet._updating import scan_on_disk

                report_progress = callback or (lambda stage, fraction: None)
                with scan_on_disk(self._core, cloud, max_memory, work, report_progress) as scan:
                    apart, left_out = _distance(self, scan.bounds), scan.left_out
                    with _named_apart(apart, self.tile_side):
                        core = scan.update(alone=alone, report_progress=report_progress)
        if apart > self.tile_side:
            warnings.warn(f"the scan {_lies_apart(apart)}", FrameWarning, stacklevel=2)
        if left_out:
            warnings.warn(
                f"{left_out:,} points are far from all others and no part of the map",
                DroppedPointsWarning,
                stacklevel=2,
            )
        return TiledPatchModel(core, self._note, self._read_from)

    def save(self, path: str | os.PathLike[str], *, note: str | None = None) -> int:
        """As `Model.save`. Of a model that was loaded with a box, the tiles that were read are
        written, whole.

        Raises
        ------
        InvalidInputError
            As `Model.save`, and for the file that a part was loaded from, which would lose its
            other tiles.
        """
        target = path_of_model(path)
        for part in self._read_from:
            part.check(target)
        return self._core.save_tiles(str(target), self._note_or(note))

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
    def tile_corner(self) -> NDArray[np.float64]:
        """Lowest corner of the cube (0, 0, 0), (3,), metres along the axes of the lattice from
        `origin`."""
        return np.array(self._core.tile_corner)

    @property
    def pixel_sizes(self) -> tuple[float, ...]:
        """Side of the finest pixels of each level of detail, coarsest first, metres."""
        return tuple(self._core.pixel_sizes)

    def __repr__(self) -> str:
        tiles = len(self.tiles)
        return (
            f"TiledPatchModel({self.n_points} points as {len(self)} patches in {tiles} "
            f"tile{'' if tiles == 1 else 's'} of {self.tile_side:g} m with pixels of "
            f"{self.pixel_sizes[-1]:g} m" + (", coloured" if self.has_color else "") + ")"
        )


@contextmanager
def _named_apart(apart: float, side: float) -> Iterator[None]:
    """Names the distance of a scan from its map where no map of these pixels is as large as both,
    and they are more than a tile apart."""
    try:
        yield
    except InvalidInputError as error:
        if apart <= side or error.argument != "resolution":
            raise
        raise InvalidInputError(
            f"cloud {_lies_apart(apart)}: one lattice cannot hold both",
            argument="cloud",
            value=f"{apart:,.0f} m from the map",
            requirement="so near to the map that one lattice holds both",
        ) from None


def _distance(model: TiledPatchModel, bounds: tuple[Any, Any] | None) -> float:
    """Distance between the boxes about a map and about a cloud, metres."""
    tiles = model.tiles.bounds
    if bounds is None or not len(tiles):
        return 0.0
    low, high = tiles[:, 0].min(axis=0), tiles[:, 1].max(axis=0)
    gap = np.maximum(np.array(bounds[0]) - high, low - np.array(bounds[1]))
    return float(np.linalg.norm(np.maximum(gap, 0)))


def _lies_apart(distance: float) -> str:
    return (
        f"lies {distance:,.0f} m from the map; if it is in a frame of its own, put it into that of "
        "the map first, by the pose that locate finds or the sensor gives"
    )


def _level(level: int | None) -> int | None:
    return None if level is None else check_integer("level", level, 0)


def merge_tiles(
    models: Sequence[TiledPatchModel | str | os.PathLike[str]], *, progress: Progress = None
) -> TiledPatchModel:
    """The model of all tiles of some models, or files of such, that share one plan, in any order.

    A tile that one of them has, or that is the same in all that have it, keeps its bytes. Where
    tiles of several differ, one is learned from what they hold, weighed by their numbers of points:
    nothing is stored twice. The note is that of all models, or where these differ that of the
    first.

    Raises
    ------
    InvalidInputError
        Without models, for others than maps in tiles, and for models of different plans, with what
        differs. Where tiles of several differ, for models that cannot be learned on, as
        `TiledPatchModel.update`.
    OSError
        A file cannot be read, or, as a `FormatError`, is no model.
    """
    given = check_items("models", models, "a list of maps in tiles or of their paths")
    maps = [_map_of(f"models[{number}]", model) for number, model in enumerate(given)]
    if not maps:
        raise wrong_value("models", given, "one map in tiles or more", shown="empty")
    with progress_callback(progress) as callback:
        cores = [map_._core for map_ in maps]
        try:
            read_from = tuple(part for map_ in maps for part in map_._read_from)
            core = _core.merge_tiles(cores, progress=callback)
            return TiledPatchModel(core, maps[0]._note, read_from)
        except InvalidInputError as error:
            if not (old := [i for i, core in enumerate(cores) if not core.has_plan]):
                raise
            which = ", ".join(map(str, old))
            raise InvalidInputError(
                f"models[{which}] does not say how its tiles were learned, since it was made "
                "before maps kept that: learn it again from its scans, or decode it as measured "
                "and add that to another with update",
                argument="models",
                value=f"maps without a plan at {which}",
                requirement="maps that say how their tiles were learned",
            ) from error


def _map_of(name: str, model: object) -> TiledPatchModel:
    """The map in tiles that an argument is, or that its file holds."""
    if isinstance(model, TiledPatchModel):
        return model
    requirement = "a TiledPatchModel or the path of one"
    if not isinstance(model, str | os.PathLike):
        raise wrong_type(name, model, requirement)
    # The module of files knows all models, and so needs this one.
    from surfabet.files import load

    read = load(model)
    if not isinstance(read, TiledPatchModel):
        raise wrong_value(name, str(model), requirement)
    return read


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
    begin = b""
    is_path = isinstance(source, str | os.PathLike)
    if is_path:
        core = _core.open_tiles(os.fspath(source), **options)
    else:
        size = source.seek(0, os.SEEK_END)

        def read(offset: int, length: int) -> bytes:
            nonlocal begin
            source.seek(offset)
            data: bytes = source.read(length)
            if offset == 0:
                begin = data
            return data

        core = _core.open_tiles_of(read, size, **options)
    if core is None:
        return None
    is_part = is_path and (box is not None or level is not None)
    parts = (_PartOf(Path(source), *core.tile_counts),) if is_part else ()
    return TiledPatchModel(core, note_of_source(source, begin), parts)
