"""Folders of RGB-D frames with known poses, in four layouts; a file per layout.

Depth is measured along the optical axis; colours are taken pixel by pixel, as registered cameras
give them, from images of another size at the scaled pixel. A depth of 0 or of the largest 16-bit
value is no measurement.
"""

from __future__ import annotations

import errno
import os
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet._checks import check_flag, check_integer, check_number, real_array
from surfabet._core import LARGEST_UNSHIFTED, PointCloud, get_num_threads
from surfabet.errors import InvalidInputError, wrong_type, wrong_value
from surfabet.io._columns import DEEP_COLORS, build_cloud
from surfabet.io._files import existing, format_error, path_of
from surfabet.io._notes import HeldNotes, Notes
from surfabet.io.rgbd import _open3d, _scannet, _seven_scenes, _tum
from surfabet.io.rgbd._frames import Camera, Frame, Listing, check_intrinsics
from surfabet.io.rgbd._images import has_deep_colors
from surfabet.io.rgbd._projector import Points, Projector

DEFAULT_DEPTH_LIMITS = (0.3, 4.0)
"""Metres within which structured-light cameras measure well."""

_TIME_DIFFERENCE = 0.02

LAYOUTS = ", or ".join(layout.HINT for layout in (_seven_scenes, _tum, _scannet, _open3d))
"""What folders of RGB-D frames hold, for messages."""


@dataclass
class _Tally:
    """Pixels that measured, by where they lie to the limits of depth."""

    n_seen: int = 0
    n_nearer: int = 0
    n_farther: int = 0

    def of(self, points: Points) -> Points:
        """Counts the points of a frame and gives them back."""
        self.n_seen += len(points.positions)
        self.n_nearer += points.n_nearer
        self.n_farther += points.n_farther
        return points

    @property
    def n_lost(self) -> int:
        """Pixels outside of the limits."""
        return self.n_nearer + self.n_farther

    def losses(self, limits: tuple[float, float]) -> str | None:
        """What the limits left out; `None` for nothing."""
        if self.n_lost == 0:
            return None
        return (
            f"left out {self.n_lost:,} of {self.n_lost + self.n_seen:,} pixels outside "
            f"depth_limits=({limits[0]:g}, {limits[1]:g}) metres: {self.n_nearer:,} nearer, "
            f"{self.n_farther:,} farther"
        )


def _decode(
    projector: Projector, frames: Sequence[Frame], tally: _Tally, ahead: int | None = None
) -> Iterator[Points]:
    """The frames' points in order, decoded by threads (Pillow and numpy release the GIL).

    At most `ahead` frames per thread are decoded before they are asked for, or all of them.
    """
    n_threads = max(1, min(get_num_threads(), len(frames), (os.cpu_count() or 1) * 2))
    window = len(frames) if ahead is None else ahead * n_threads
    waiting: deque[Future[Points]] = deque()
    with ThreadPoolExecutor(n_threads) as pool:
        try:
            for frame in frames:
                waiting.append(pool.submit(projector.points, frame))
                if len(waiting) >= window:
                    yield tally.of(waiting.popleft().result())
            while waiting:
                yield tally.of(waiting.popleft().result())
        finally:
            pool.shutdown(cancel_futures=True)


def _join(parts: list[Any]) -> Any:
    """One array of all parts, which are let go."""
    joined = np.concatenate(parts)
    parts.clear()
    return joined


def _fuse(folder: Path, frames: Sequence[Frame], projector: Projector, tally: _Tally) -> PointCloud:
    positions: list[NDArray[np.float32]] = []
    colors: list[NDArray[np.uint8]] = []
    ranges: list[NDArray[np.float32]] = []
    for points in _decode(projector, frames, tally):
        positions.append(points.positions)
        ranges.append(points.ranges)
        if points.colors is not None:
            colors.append(points.colors)
    counts = [len(part) for part in positions]
    viewpoint_index = np.repeat(np.arange(len(frames), dtype=np.uint32), counts)
    return build_cloud(
        folder,
        _join(positions),
        colors=_join(colors) if colors else None,
        ranges=_join(ranges),
        viewpoints=np.stack([frame.pose[:3, 3] for frame in frames]),
        viewpoint_index=viewpoint_index,
        origin=projector.origin,
    )


def _separate(frames: Sequence[Frame], projector: Projector, tally: _Tally) -> list[PointCloud]:
    return [
        build_cloud(
            frame.depth,
            points.positions,
            colors=points.colors,
            ranges=points.ranges,
            viewpoints=frame.pose[None, :3, 3],
            viewpoint_index=np.zeros(len(points.positions), np.uint32),
            origin=projector.origin,
        )
        for frame, points in zip(frames, _decode(projector, frames, tally), strict=True)
    ]


def _limits(depth_limits: tuple[float, float]) -> tuple[float, float]:
    """The least and the largest depth, which may be infinite."""
    requirement = "two ascending distances in metres"
    limits = real_array(depth_limits)
    if limits is None:
        raise wrong_type("depth_limits", depth_limits, requirement)
    if limits.shape != (2,) or not 0 <= limits[0] < limits[1]:
        raise wrong_value("depth_limits", depth_limits, requirement)
    return float(limits[0]), float(limits[1])


def is_rgbd(folder: Path) -> bool:
    """Whether a folder has one of the layouts read here."""
    layouts = (_seven_scenes, _tum, _scannet, _open3d)
    return any(layout.is_here(folder) for layout in layouts)


@overload
def read_rgbd(
    path: str | os.PathLike[str],
    *,
    intrinsics: ArrayLike | None = ...,
    depth_scale: float | None = ...,
    depth_limits: tuple[float, float] | None = ...,
    frame_stride: int = ...,
    pixel_stride: int = ...,
    max_time_difference: float = ...,
    fused: Literal[True] = ...,
) -> PointCloud: ...
@overload
def read_rgbd(
    path: str | os.PathLike[str],
    *,
    intrinsics: ArrayLike | None = ...,
    depth_scale: float | None = ...,
    depth_limits: tuple[float, float] | None = ...,
    frame_stride: int = ...,
    pixel_stride: int = ...,
    max_time_difference: float = ...,
    fused: Literal[False],
) -> list[PointCloud]: ...
def read_rgbd(
    path: str | os.PathLike[str],
    *,
    intrinsics: ArrayLike | None = None,
    depth_scale: float | None = None,
    depth_limits: tuple[float, float] | None = None,
    frame_stride: int = 1,
    pixel_stride: int = 1,
    max_time_difference: float = _TIME_DIFFERENCE,
    fused: bool = True,
) -> PointCloud | list[PointCloud]:
    """Reads a folder of RGB-D frames with poses into one cloud or one per frame, in the world.

    Four layouts are known. *7-Scenes*: `frame-NNNNNN.depth.png`, `.color.jpg` or `.color.png`
    (optional) and `.pose.txt` (4 x 4, camera to world, metres), with `camera-intrinsics.txt` (3 x
    3). *TUM*: `rgb.txt` and `depth.txt`, or `associations.txt`, and `groundtruth.txt`; each depth
    image is taken with the colour image and the pose nearest in time. *ScanNet*: `depth/N.png`,
    `color/N.jpg`, `pose/N.txt` and `intrinsic/intrinsic_depth.txt`. *Open3D and Redwood*: `depth/`,
    `color/`, `trajectory.log` and `camera_intrinsic.json`.

    Depth images are PNG, TIFF, PFM or NPY; real numbers are metres. Colour images of another size
    are looked up at the scaled pixel, or by `intrinsic/intrinsic_color.txt`.

    Parameters
    ----------
    path
        The folder.
    intrinsics
        (fx, fy, cx, cy) in pixels, or the camera matrix; a negative fy for images whose rows go
        up. Default: the folder's; for TUM the published ones of Freiburg 1, 2 or 3 if the folder's
        name tells which, else (525, 525, 319.5, 239.5). Lens distortion is not modelled.
    depth_scale
        Steps of the depth images per metre. Default: 1000, for TUM 5000, and 1 for images of real
        numbers.
    depth_limits
        Nearest and farthest depth to keep, metres, both included. Default: 0.3 to 4 m, where
        structured-light cameras measure well; a warning says how many pixels that leaves out.
    frame_stride, pixel_stride
        Take every n-th frame, and every n-th pixel of every n-th row.
    max_time_difference
        Seconds between a depth image and its colour image or pose (TUM only).
    fused
        One cloud of all frames, or a list of one cloud per frame.

    Returns
    -------
    PointCloud or list of PointCloud
        Positions, colours, ranges (distance from the camera centre, metres) and viewpoints (the
        camera centres; fused, row i is frame i of those read). Points are in the order of frames,
        rows and columns, whatever the number of threads.

    Raises
    ------
    FormatError
        The folder has none of the layouts, a list or an image in it is broken, or no frame has all
        its parts.
    InvalidInputError
        An option is out of its domain, or the folder needs `intrinsics`.
    MissingDependencyError
        Pillow is not installed.

    Warns
    -----
    DroppedPointsWarning
        Frames without a depth image, a colour image or a pose that is finite and a rotation were
        left out, or pixels outside the default limits of depth; the message counts them.
    """
    folder = existing(path_of("path", path))
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
    frame_stride = check_integer("frame_stride", frame_stride, 1)
    pixel_stride = check_integer("pixel_stride", pixel_stride, 1)
    check_number("max_time_difference", max_time_difference, "a positive number", above=0.0)
    check_flag("fused", fused)
    limits = DEFAULT_DEPTH_LIMITS if depth_limits is None else _limits(depth_limits)
    scale = depth_scale
    if scale is not None:
        scale = check_number("depth_scale", scale, "a positive number", above=0.0)
    listing = _find_frames(folder, max_time_difference)
    frames, lost = _usable(listing, frame_stride)
    projector = Projector(
        _camera_of(listing, intrinsics),
        None if intrinsics is not None else listing.color_camera,
        (scale or listing.depth_scale, scale or 1.0),
        limits,
        pixel_stride,
        _origin_of(frames),
    )
    tally = _Tally()
    clouds: PointCloud | list[PointCloud]
    if fused:
        clouds = _fuse(folder, frames, projector, tally)
    else:
        clouds = _separate(frames, projector, tally)
    notes = Notes(folder)
    # Limits that were asked for leave out what was asked for.
    _note(notes, frames, lost, None if depth_limits is not None else (tally, limits))
    notes.warn()
    return clouds


def read_rgbd_chunks(folder: Path, n: int) -> Iterator[PointCloud]:
    """The frames of a folder as clouds of at most `n` points, with the points of `read_rgbd` in its
    order; a few frames are in memory at a time.

    Raises
    ------
    FormatError, InvalidInputError, MissingDependencyError
        As `read_rgbd`.
    """
    listing = _find_frames(folder, _TIME_DIFFERENCE)
    frames, lost = _usable(listing, 1)
    projector = Projector(
        _camera_of(listing, None),
        listing.color_camera,
        (listing.depth_scale, 1.0),
        DEFAULT_DEPTH_LIMITS,
        1,
        _origin_of(frames),
    )
    tally, notes = _Tally(), HeldNotes(folder)
    decoded = _decode(projector, frames, tally, ahead=1)
    for frame, points in zip(frames, decoded, strict=True):
        for start in range(0, len(points.positions), n):
            part = slice(start, start + n)
            positions = points.positions[part]
            yield build_cloud(
                folder,
                positions,
                colors=None if points.colors is None else points.colors[part],
                ranges=points.ranges[part],
                viewpoints=frame.pose[None, :3, 3],
                viewpoint_index=np.zeros(len(positions), np.uint32),
                origin=projector.origin,
                notes=notes,
            )
    _note(notes, frames, lost, (tally, DEFAULT_DEPTH_LIMITS))
    notes.release()


def _usable(listing: Listing, stride: int) -> tuple[list[Frame], str | None]:
    """The frames that have all their parts, and what is noted of the others."""
    frames = listing.usable(stride)
    lost = listing.losses(len(frames))
    if not frames:
        raise format_error(listing.folder, lost or f"no RGB-D frames: expected {LAYOUTS}")
    return frames, lost


def _note(
    notes: Notes,
    frames: Iterable[Frame],
    lost: str | None,
    seen: tuple[_Tally, tuple[float, float]] | None,
) -> None:
    """Notes frames that were lost, pixels outside of the limits, and what colours are not kept."""
    if lost is not None:
        notes.points(lost)
    if seen is not None and (beyond := seen[0].losses(seen[1])) is not None:
        notes.points(beyond, seen[0].n_lost)
    if any(frame.color is not None and has_deep_colors(frame.color) for frame in frames):
        notes.aside(DEEP_COLORS)


def _find_frames(folder: Path, max_time_difference: float) -> Listing:
    if _seven_scenes.is_here(folder):
        return _seven_scenes.find_frames(folder)
    if _tum.is_here(folder):
        return _tum.find_frames(folder, max_time_difference)
    if _scannet.is_here(folder):
        return _scannet.find_frames(folder)
    if _open3d.is_here(folder):
        return _open3d.find_frames(folder)
    raise format_error(folder, f"no RGB-D frames: expected {LAYOUTS}")


def _camera_of(listing: Listing, intrinsics: ArrayLike | None) -> Camera:
    if intrinsics is not None:
        return check_intrinsics(intrinsics)
    if listing.camera is None:
        raise InvalidInputError(
            f"{listing.folder} does not say what its camera is; give intrinsics=(fx, fy, cx, cy)"
        )
    return listing.camera


def _origin_of(frames: Iterable[Frame]) -> NDArray[np.float64]:
    centers = np.stack([frame.pose[:3, 3] for frame in frames])
    if np.abs(centers).max() <= LARGEST_UNSHIFTED:
        return np.zeros(3)
    return np.asarray(np.round(centers.mean(axis=0)))
