"""Folders of RGB-D frames with known poses: 7-Scenes-like layouts and the TUM RGB-D benchmark's.

Depth is measured along the optical axis; colour and depth images are taken pixel by pixel, as
registered cameras give them. A depth of 0 or of the largest 16-bit value is no measurement.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet._core import LARGEST_UNSHIFTED, PointCloud, get_num_threads
from surfabet.errors import DroppedPointsWarning, FormatError, InvalidInputError
from surfabet.io._columns import build_cloud
from surfabet.io._files import format_error, optional_module, warn

_NO_MEASUREMENT = 65535
# Images larger than this on a side are no depth cameras'.
_LARGEST_SIDE = 1 << 13
_TUM_INTRINSICS = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}
_TUM_DEFAULT = (525.0, 525.0, 319.5, 239.5)


@dataclass(frozen=True)
class _Frame:
    depth: Path
    color: Path | None
    # Camera to world, 4 x 4.
    pose: NDArray[np.float64]


@dataclass(frozen=True)
class _Camera:
    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True)
class _Points:
    """What one frame sees, about the common origin."""

    positions: NDArray[np.float32]
    colors: NDArray[np.uint8] | None
    ranges: NDArray[np.float32]


def _numbers(path: Path) -> NDArray[np.float64]:
    """A small text file as a matrix."""
    try:
        text = path.read_text(encoding="ascii")
    except UnicodeDecodeError as error:
        raise format_error(path, "not a text of numbers", byte=error.start) from None
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.replace(",", " ").split()
        if not words:
            continue
        try:
            rows.append([float(word) for word in words])
        except ValueError:
            raise format_error(path, f"not numbers: {line!r:.60}", line=number) from None
        if len(rows[-1]) != len(rows[0]):
            raise format_error(path, "rows of differing lengths", line=number)
    return np.array(rows)


def _check_pose(path: Path, pose: NDArray[np.float64], line: int | None = None) -> None:
    rotation = pose[:3, :3]
    if not np.isfinite(pose).all():
        return
    orthogonal = np.abs(rotation @ rotation.T - np.eye(3)).max() < 0.01
    if not orthogonal or np.linalg.det(rotation) < 0 or (pose[3] != [0, 0, 0, 1]).any():
        raise format_error(path, "the pose is not a rotation and a translation", line=line)


def _check_intrinsics(given: ArrayLike) -> _Camera:
    values = np.asarray(given, np.float64)
    if values.shape in ((3, 3), (4, 4)):
        values = values[[0, 1, 0, 1], [0, 1, 2, 2]]
    if values.shape != (4,) or not np.isfinite(values).all() or (values[:2] <= 0).any():
        raise InvalidInputError(
            "intrinsics must be (fx, fy, cx, cy) in pixels or a 3 x 3 matrix, fx and fy positive"
        )
    return _Camera(*(float(v) for v in values))


def _find_frames(folder: Path) -> list[_Frame]:
    frames = []
    depths = sorted(folder.glob("frame-*.depth.png"))
    stems = [path.name.removesuffix(".depth.png") for path in depths]
    images = {path.name for path in folder.glob("*.color.*")}
    for depth, stem in zip(depths, stems, strict=True):
        pose_path = folder / f"{stem}.pose.txt"
        if not pose_path.exists():
            raise format_error(folder, f"{depth.name} has no pose {pose_path.name} beside it")
        pose = _numbers(pose_path)
        if pose.shape != (4, 4):
            raise format_error(pose_path, f"a pose has 4 x 4 numbers, not {pose.shape}")
        _check_pose(pose_path, pose)
        color = next((n for n in (f"{stem}.color.jpg", f"{stem}.color.png") if n in images), None)
        if images and color is None:
            raise format_error(folder, f"{depth.name} has no {stem}.color.jpg or .png beside it")
        frames.append(_Frame(depth, folder / color if color else None, pose))
    return frames


def _read_list(path: Path, n_columns: int) -> tuple[NDArray[np.float64], list[list[str]]]:
    """Time stamps, in ascending order, and the other words of each line of a TUM list."""
    rows = []
    with path.open("r", encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            words = line.replace(",", " ").split()
            if not words or words[0].startswith("#"):
                continue
            try:
                if len(words) != n_columns:
                    raise ValueError
                stamp = float(words[0])
                if not np.isfinite(stamp):
                    raise ValueError
            except ValueError:
                raise format_error(
                    path,
                    f"expected a time stamp and {n_columns - 1} more values, found {line!r:.60}",
                    line=number,
                ) from None
            rows.append((stamp, [*words[1:], str(number)]))
    rows.sort(key=lambda row: row[0])
    return np.array([stamp for stamp, _ in rows]), [words for _, words in rows]


def _nearest(stamps: NDArray[np.float64], stamp: float, most: float) -> int | None:
    """The entry nearest in time, if it is near enough."""
    if len(stamps) == 0:
        return None
    after = int(np.searchsorted(stamps, stamp))
    either = [i for i in (after - 1, after) if 0 <= i < len(stamps)]
    near = min(either, key=lambda i: abs(stamps[i] - stamp))
    return near if abs(stamps[near] - stamp) <= most else None


def _pose_from_quaternion(path: Path, words: list[str]) -> NDArray[np.float64]:
    line = int(words[-1])
    try:
        tx, ty, tz, x, y, z, w = (float(word) for word in words[:7])
    except ValueError:
        raise format_error(path, "a pose must be seven numbers", line=line) from None
    length = np.sqrt(x * x + y * y + z * z + w * w)
    pose = np.full((4, 4), np.nan)
    if not np.isfinite([tx, ty, tz, length]).all():
        return pose
    if abs(length - 1) > 0.01:
        raise format_error(path, f"the quaternion has length {length:.4g}, not 1", line=line)
    x, y, z, w = x / length, y / length, z / length, w / length
    pose[:] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), tx],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), ty],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), tz],
        [0, 0, 0, 1],
    ]
    return pose


def _find_tum_frames(folder: Path, max_time_difference: float) -> list[_Frame]:
    depth_stamps, depths = _read_list(folder / "depth.txt", 2)
    color_stamps, colors = _read_list(folder / "rgb.txt", 2)
    truth = folder / "groundtruth.txt"
    pose_stamps, poses = _read_list(truth, 8)
    frames = []
    for stamp, (depth, _) in zip(depth_stamps, depths, strict=True):
        color = _nearest(color_stamps, stamp, max_time_difference)
        pose = _nearest(pose_stamps, stamp, max_time_difference)
        if color is None or pose is None:
            continue
        frames.append(
            _Frame(
                _inside(folder, depth),
                _inside(folder, colors[color][0]),
                _pose_from_quaternion(truth, poses[pose]),
            )
        )
    return frames


def _inside(folder: Path, name: str) -> Path:
    """A file that a list names; lists must not reach out of their folder."""
    path = folder / name
    if ".." in Path(name).parts or Path(name).is_absolute() or "\0" in name:
        raise format_error(folder, f"a list names {name!r:.60}, which is outside the folder")
    return path


def _load_image(
    pillow: Any, path: Path, modes: tuple[str, ...], convert: str | None
) -> NDArray[Any]:
    try:
        with pillow.open(path) as image:
            if max(image.size) > _LARGEST_SIDE:
                raise format_error(path, f"an image of {image.size} pixels is too large")
            if image.mode not in modes:
                raise format_error(
                    path, f"the image has mode {image.mode}; expected {' or '.join(modes)}"
                )
            return np.asarray(image.convert(convert) if convert else image)
    except FileNotFoundError:
        raise format_error(path, "the image is missing") from None
    except FormatError:
        raise
    except Exception as error:
        # Pillow raises OSError, SyntaxError, ValueError and more for broken images.
        raise format_error(path, f"cannot decode the image: {error}") from error


class _Projector:
    """Turns frames into points."""

    def __init__(
        self,
        camera: _Camera,
        depth_scale: float,
        depth_limits: tuple[float, float],
        pixel_stride: int,
        origin: NDArray[np.float64],
    ) -> None:
        self.pillow = optional_module("PIL.Image", "pillow>=10", "reading RGB-D folders")
        self.camera = camera
        self.depth_scale = depth_scale
        self.pixel_stride = pixel_stride
        self.origin = origin
        # In the unit of the images, so that the limits are sharp; both are included.
        nearest, farthest = (limit * depth_scale for limit in depth_limits)
        self.nearest = max(1, math.ceil(min(nearest, _NO_MEASUREMENT)))
        self.farthest = min(_NO_MEASUREMENT - 1, math.floor(min(farthest, _NO_MEASUREMENT)))

    def rays(
        self, height: int, width: int
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.float32]]:
        """x/z by column, y/z by row, and length/z, of the rays through the pixels that are read."""
        camera, stride = self.camera, self.pixel_stride
        x = (np.arange(0, width, stride) - camera.cx) / camera.fx
        y = (np.arange(0, height, stride) - camera.cy) / camera.fy
        length = np.sqrt(x**2 + (y**2 + 1)[:, None])
        return x, y, length.astype(np.float32)

    def points(self, frame: _Frame) -> _Points:
        depth = _load_image(self.pillow, frame.depth, ("I;16", "I;16L", "I;16B", "I", "L"), None)
        height, width = depth.shape
        stride = self.pixel_stride
        depth = depth[::stride, ::stride]
        # Taking rows by index is six times as fast as by mask.
        seen = np.flatnonzero((depth >= self.nearest) & (depth <= self.farthest))
        z = depth.astype(np.float32)
        z /= np.float32(self.depth_scale)
        x, y, length = self.rays(height, width)
        rotation = frame.pose[:3, :3]
        shift = (frame.pose[:3, 3] - self.origin).astype(np.float32)
        # A ray turned into the world is a sum of a part by column and a part by row. Element by
        # element: unlike a matrix product, the same on every machine and thread.
        by_column = (rotation[:, :1] * x).astype(np.float32)
        by_row = (rotation[:, 1:2] * y + rotation[:, 2:]).astype(np.float32)
        positions = np.empty((*depth.shape, 3), np.float32)
        for axis in range(3):
            plane = by_row[axis][:, None] + by_column[axis]
            plane *= z
            plane += shift[axis]
            positions[:, :, axis] = plane
        colors = None
        if frame.color is not None:
            image = _load_image(self.pillow, frame.color, ("RGB", "RGBA", "L", "P"), "RGB")
            if image.shape[:2] != (height, width):
                raise format_error(
                    frame.color,
                    f"the colour image has {image.shape[1]} x {image.shape[0]} pixels, the depth "
                    f"image {width} x {height}; resample one to the other first",
                )
            colors = image[::stride, ::stride].reshape(-1, 3).take(seen, axis=0)
        length *= z
        return _Points(
            positions.reshape(-1, 3).take(seen, axis=0), colors, length.ravel().take(seen)
        )


def _decode(projector: _Projector, frames: Sequence[_Frame]) -> Iterator[_Points]:
    """The frames' points in order, decoded by threads (Pillow and numpy release the GIL)."""
    n_threads = max(1, min(get_num_threads(), len(frames), (os.cpu_count() or 1) * 2))
    with ThreadPoolExecutor(n_threads) as pool:
        try:
            # Eagerly: what has been decoded and not fused yet is never more than the cloud itself.
            yield from pool.map(projector.points, frames)
        finally:
            pool.shutdown(cancel_futures=True)


def _join(parts: list[Any]) -> Any:
    """One array of all parts, which are let go."""
    joined = np.concatenate(parts)
    parts.clear()
    return joined


def _fuse(folder: Path, frames: Sequence[_Frame], projector: _Projector) -> PointCloud:
    positions: list[NDArray[np.float32]] = []
    colors: list[NDArray[np.uint8]] = []
    ranges: list[NDArray[np.float32]] = []
    for points in _decode(projector, frames):
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


def _separate(folder: Path, frames: Sequence[_Frame], projector: _Projector) -> list[PointCloud]:
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
        for frame, points in zip(frames, _decode(projector, frames), strict=True)
    ]


def _positive_int(name: str, value: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise InvalidInputError(f"{name} is {value!r}, but must be an integer of at least 1")
    return int(value)


def _positive(name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0):
        raise InvalidInputError(f"{name} is {value!r}, but must be a positive number")
    return float(value)


def is_rgbd(folder: Path) -> bool:
    """Whether a folder has one of the layouts read here."""
    return (folder / "depth.txt").exists() or any(folder.glob("frame-*.depth.png"))


@overload
def read_rgbd(
    path: str | os.PathLike[str],
    *,
    intrinsics: ArrayLike | None = ...,
    depth_scale: float | None = ...,
    depth_limits: tuple[float, float] = ...,
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
    depth_limits: tuple[float, float] = ...,
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
    depth_limits: tuple[float, float] = (0.3, 4.0),
    frame_stride: int = 1,
    pixel_stride: int = 1,
    max_time_difference: float = 0.02,
    fused: bool = True,
) -> PointCloud | list[PointCloud]:
    """Reads a folder of RGB-D frames with poses into one cloud or one per frame, in the world.

    Two layouts are known. *Frames*: `frame-NNNNNN.depth.png` (16 bit), `.color.jpg` or `.color.png`
    (optional) and `.pose.txt` (4 x 4, camera to world, metres), with `camera-intrinsics.txt` (3 x
    3). *TUM*: `rgb.txt`, `depth.txt` and `groundtruth.txt`; each depth image is taken with the
    colour image and the pose nearest in time, and left out without both.

    Parameters
    ----------
    path
        The folder.
    intrinsics
        (fx, fy, cx, cy) in pixels, or the camera matrix. Default: the folder's
        `camera-intrinsics.txt`; for TUM the published ones of Freiburg 1, 2 or 3 if the folder's
        name tells which, else (525, 525, 319.5, 239.5). Lens distortion is not modelled.
    depth_scale
        Units of the depth images per metre. Default: 1000, for TUM 5000.
    depth_limits
        Nearest and farthest depth to keep, metres, both included. The default of 0.3 to 4 m is
        where structured-light cameras measure well.
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
        rows and columns, whatever the number of threads. Frames whose pose is not finite (tracking
        was lost) are left out with a warning.

    Raises
    ------
    FormatError
        The folder has neither layout, or one of its files is missing or broken.
    InvalidInputError
        An option is out of its domain, or the folder needs `intrinsics`.
    MissingDependencyError
        Pillow is not installed.
    """
    folder = Path(path)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} is not a folder")
    frame_stride = _positive_int("frame_stride", frame_stride)
    pixel_stride = _positive_int("pixel_stride", pixel_stride)
    _positive("max_time_difference", max_time_difference)
    nearest, farthest = depth_limits
    if not 0 <= nearest < farthest:
        raise InvalidInputError(
            f"depth_limits are {depth_limits}, but must be two ascending distances in metres"
        )
    is_tum = (folder / "depth.txt").exists()
    if is_tum:
        for name in ("rgb.txt", "groundtruth.txt"):
            if not (folder / name).exists():
                raise format_error(folder, f"depth.txt is there, but {name} is missing")
        frames = _find_tum_frames(folder, max_time_difference)
    else:
        frames = _find_frames(folder)
    if not frames:
        raise format_error(
            folder,
            "no depth image has a colour image and a pose near it in time; see max_time_difference"
            if is_tum
            else "no RGB-D frames: expected frame-*.depth.png with .pose.txt, or rgb.txt, "
            "depth.txt and groundtruth.txt",
        )
    frames = frames[::frame_stride]
    tracked = [frame for frame in frames if np.isfinite(frame.pose).all()]
    if len(tracked) < len(frames):
        warn(
            f"{folder}: left out {len(frames) - len(tracked)} of {len(frames)} frames whose "
            "pose is not finite",
            DroppedPointsWarning,
        )
    if not tracked:
        raise format_error(folder, "no frame has a finite pose")
    if depth_scale is None:
        depth_scale = 5000 if is_tum else 1000
    projector = _Projector(
        _camera_of(folder, intrinsics, is_tum),
        _positive("depth_scale", depth_scale),
        (nearest, farthest),
        pixel_stride,
        _origin_of(tracked),
    )
    if fused:
        return _fuse(folder, tracked, projector)
    return _separate(folder, tracked, projector)


def _camera_of(folder: Path, intrinsics: ArrayLike | None, is_tum: bool) -> _Camera:
    if intrinsics is not None:
        return _check_intrinsics(intrinsics)
    if is_tum:
        name = re.search("freiburg[123]", str(folder.resolve()))
        return _Camera(*(_TUM_INTRINSICS[name.group()] if name else _TUM_DEFAULT))
    file = folder / "camera-intrinsics.txt"
    if not file.exists():
        raise InvalidInputError(
            f"{folder} has no camera-intrinsics.txt; give intrinsics=(fx, fy, cx, cy)"
        )
    try:
        return _check_intrinsics(_numbers(file))
    except InvalidInputError as error:
        raise format_error(file, str(error)) from None


def _origin_of(frames: Iterable[_Frame]) -> NDArray[np.float64]:
    centers = np.stack([frame.pose[:3, 3] for frame in frames])
    if np.abs(centers).max() <= LARGEST_UNSHIFTED:
        return np.zeros(3)
    return np.asarray(np.round(centers.mean(axis=0)))
