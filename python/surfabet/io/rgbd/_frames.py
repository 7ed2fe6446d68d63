"""What all layouts have in common: frames, cameras, poses, and what of a folder cannot be used."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet._checks import real_array
from surfabet.errors import InvalidInputError, wrong_type, wrong_value
from surfabet.io._files import format_error

# Rotations of tracked cameras are off by parts in ten thousand.
_ROTATION_TOLERANCE = 0.01
_NAMES_SHOWN = 3


@dataclass(frozen=True)
class Frame:
    """A depth image, the colour image taken with it, and where the camera was."""

    depth: Path
    color: Path | None
    # Camera to world, 4 x 4.
    pose: NDArray[np.float64]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera: pixels = focal lengths * tangents + centre."""

    fx: float
    fy: float
    cx: float
    cy: float
    # Width and height of the images that this is for; `None` where nothing says.
    size: tuple[int, int] | None = None


@dataclass
class Listing:
    """The frames that a folder lists, before any image is opened."""

    folder: Path
    # Of the depth images; `None` if the folder does not say.
    camera: Camera | None
    # Steps per metre of integer depth images.
    depth_scale: float
    # Of colour images that are not registered pixel by pixel.
    color_camera: Camera | None = None
    # Whether frames have colour images.
    colored: bool = False
    candidates: list[tuple[str, Path | None, Path | None, NDArray[np.float64] | None]] = field(
        default_factory=list
    )
    lost: dict[str, list[str]] = field(default_factory=dict)

    def add(
        self,
        name: str,
        depth: Path | None,
        color: Path | None,
        pose: NDArray[np.float64] | None,
    ) -> None:
        """A frame, of which parts may be missing."""
        self.candidates.append((name, depth, color, pose))

    def lose(self, reason: str, name: str) -> None:
        """Notes a frame that cannot be used."""
        self.lost.setdefault(reason, []).append(name)

    def usable(self, stride: int) -> list[Frame]:
        """Every `stride`-th frame that has all its parts; the others are noted."""
        frames = []
        for name, depth, color, pose in self.candidates[::stride]:
            if depth is None or not depth.is_file():
                self.lose("without a depth image", name)
            elif self.colored and (color is None or not color.is_file()):
                self.lose("without a colour image", name)
            elif pose is None:
                self.lose("without a pose", name)
            elif not np.isfinite(pose).all():
                self.lose("with a pose that is not finite", name)
            elif not _is_rigid(pose):
                self.lose("with a pose that is not a rotation and a translation", name)
            else:
                frames.append(Frame(depth, color if self.colored else None, pose))
        return frames

    def losses(self, n_used: int) -> str | None:
        """What was left out and why; `None` for nothing."""
        n_lost = sum(map(len, self.lost.values()))
        if n_lost == 0:
            return None
        reasons = []
        for reason, names in self.lost.items():
            shown = ", ".join(names[:_NAMES_SHOWN]) + (", ..." if len(names) > _NAMES_SHOWN else "")
            reasons.append(f"{len(names)} {reason} ({shown})")
        return f"left out {n_lost} of {n_used + n_lost} frames: {'; '.join(reasons)}"


def _is_rigid(pose: NDArray[np.float64]) -> bool:
    rotation = pose[:3, :3]
    orthogonal = np.abs(rotation @ rotation.T - np.eye(3)).max() < _ROTATION_TOLERANCE
    return bool(orthogonal and np.linalg.det(rotation) > 0 and (pose[3] == [0, 0, 0, 1]).all())


def check_intrinsics(given: ArrayLike) -> Camera:
    """The camera of (fx, fy, cx, cy) or of a matrix.

    A negative fy, as of the ICL-NUIM renderings, is for images whose rows go up.
    """
    requirement = "(fx, fy, cx, cy) in pixels or a 3 x 3 matrix, fx positive and fy not 0"
    values = real_array(given)
    if values is None:
        raise wrong_type("intrinsics", given, requirement)
    if values.shape in ((3, 3), (4, 4)):
        values = values[[0, 1, 0, 1], [0, 1, 2, 2]]
    if values.shape != (4,) or not np.isfinite(values).all() or values[0] <= 0 or values[1] == 0:
        raise wrong_value("intrinsics", np.asarray(given).tolist(), requirement)
    fx, fy, cx, cy = (float(v) for v in values)
    return Camera(fx, fy, cx, cy)


def camera_from_file(path: Path) -> Camera:
    """The camera of a text file that holds its matrix."""
    try:
        return check_intrinsics(numbers(path))
    except InvalidInputError as error:
        raise format_error(path, str(error)) from None


def numbers(path: Path) -> NDArray[np.float64]:
    """A small text file as a matrix."""
    try:
        text = path.read_text(encoding="ascii")
    except UnicodeDecodeError as error:
        raise format_error(path, "not a text of numbers", byte=error.start) from None
    rows: list[list[float]] = []
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


def pose_from_file(path: Path) -> NDArray[np.float64] | None:
    """The 4 x 4 numbers of a file; `None` if there is no such file."""
    if not path.is_file():
        return None
    pose = numbers(path)
    if pose.shape != (4, 4):
        raise format_error(path, f"a pose has 4 x 4 numbers, not {pose.shape}")
    return pose
