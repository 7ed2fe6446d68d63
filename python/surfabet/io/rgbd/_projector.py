"""From the pixels of a frame to points in the world."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet.io._files import format_error, optional_module
from surfabet.io.rgbd._frames import Camera, Frame
from surfabet.io.rgbd._images import load_color, load_depth

# What sensors of 16 bits write besides 0 for no measurement.
_NO_MEASUREMENT = 65535
# Images of one camera, cropped to even numbers of pixels, differ by up to a percent.
_ASPECT_TOLERANCE = 0.02


@dataclass(frozen=True)
class Points:
    """What one frame sees, about the common origin."""

    positions: NDArray[np.float32]
    colors: NDArray[np.uint8] | None
    ranges: NDArray[np.float32]
    # Pixels that measured, but outside the limits.
    n_nearer: int
    n_farther: int


class Projector:
    """Turns frames into points."""

    def __init__(
        self,
        camera: Camera,
        color_camera: Camera | None,
        scales: tuple[float, float],
        depth_limits: tuple[float, float],
        pixel_stride: int,
        origin: NDArray[np.float64],
    ) -> None:
        """`scales` are the steps per metre of images of integers and of real numbers."""
        self.pillow = optional_module("PIL.Image", "pillow>=10", "reading RGB-D folders")
        self.camera = camera
        self.color_camera = color_camera
        self.integer_scale, self.real_scale = scales
        self.depth_limits = depth_limits
        self.pixel_stride = pixel_stride
        self.origin = origin

    def _rays(
        self, height: int, width: int
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.float32]]:
        """x/z by column, y/z by row, and length/z, of the rays through the pixels that are read."""
        camera, stride = self.camera, self.pixel_stride
        x = (np.arange(0, width, stride) - camera.cx) / camera.fx
        y = (np.arange(0, height, stride) - camera.cy) / camera.fy
        length = np.sqrt(x**2 + (y**2 + 1)[:, None])
        return x, y, length.astype(np.float32)

    def _depths(self, depth: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[Any], int, int]:
        """Metres, the pixels within the limits, and the numbers of those before and behind."""
        nearest, farthest = self.depth_limits
        z = depth.astype(np.float32)
        if depth.dtype.kind == "f":
            z /= np.float32(self.real_scale)
            measured = (z > 0) & (z < np.inf)
            nearer, farther = measured & (z < nearest), measured & (z > farthest)
            seen = measured & (z >= nearest) & (z <= farthest)
        else:
            scale = self.integer_scale
            # In the unit of the images, so that the limits are sharp; both are included.
            low = max(1, math.ceil(min(nearest * scale, _NO_MEASUREMENT)))
            high = min(_NO_MEASUREMENT - 1, math.floor(min(farthest * scale, _NO_MEASUREMENT)))
            z /= np.float32(scale)
            nearer = (depth > 0) & (depth < low)
            farther = (depth > high) & (depth < _NO_MEASUREMENT)
            seen = (depth >= low) & (depth <= high)
        # Taking rows by index is six times as fast as by mask.
        return z, np.flatnonzero(seen), int(nearer.sum()), int(farther.sum())

    def points(self, frame: Frame) -> Points:
        """The frame's points in the order of rows and columns."""
        image = load_depth(self.pillow, frame.depth)
        height, width = image.shape
        if self.camera.size not in (None, (width, height)):
            raise format_error(
                frame.depth,
                f"the image has {width} x {height} pixels, but the folder's intrinsics are for "
                f"{self.camera.size}; give intrinsics=",
            )
        stride = self.pixel_stride
        z, seen, n_nearer, n_farther = self._depths(image[::stride, ::stride])
        x, y, length = self._rays(height, width)
        rotation = frame.pose[:3, :3]
        shift = (frame.pose[:3, 3] - self.origin).astype(np.float32)
        # A ray turned into the world is a sum of a part by column and a part by row. Element by
        # element: unlike a matrix product, the same on every machine and thread.
        by_column = (rotation[:, :1] * x).astype(np.float32)
        by_row = (rotation[:, 1:2] * y + rotation[:, 2:]).astype(np.float32)
        positions = np.empty((*z.shape, 3), np.float32)
        for axis in range(3):
            plane = by_row[axis][:, None] + by_column[axis]
            plane *= z
            plane += shift[axis]
            positions[:, :, axis] = plane
        colors = None
        if frame.color is not None:
            colors = self._colors(frame.color, height, width).take(seen, axis=0)
        length *= z
        return Points(
            positions.reshape(-1, 3).take(seen, axis=0),
            colors,
            length.ravel().take(seen),
            n_nearer,
            n_farther,
        )

    def _colors(self, path: Path, height: int, width: int) -> NDArray[np.uint8]:
        """The colour of each pixel that is read, one after the other."""
        image = load_color(self.pillow, path)
        stride = self.pixel_stride
        if image.shape[:2] == (height, width) and self.color_camera is None:
            return image[::stride, ::stride].reshape(-1, 3)
        rows = np.arange(0, height, stride)
        columns = np.arange(0, width, stride)
        color_height, color_width = image.shape[:2]
        if (color := self.color_camera) is not None:
            depth = self.camera
            rows = np.rint((rows - depth.cy) * (color.fy / depth.fy) + color.cy).astype(int)
            columns = np.rint((columns - depth.cx) * (color.fx / depth.fx) + color.cx).astype(int)
        elif abs(color_width * height / (color_height * width) - 1) > _ASPECT_TOLERANCE:
            raise format_error(
                path,
                f"the colour image has {color_width} x {color_height} pixels, the depth image "
                f"{width} x {height}, which is not the same view; register one to the other first",
            )
        else:
            # Between the middles of pixels.
            rows = (2 * rows + 1) * color_height // (2 * height)
            columns = (2 * columns + 1) * color_width // (2 * width)
        rows = rows.clip(0, color_height - 1)
        columns = columns.clip(0, color_width - 1)
        looked_up: NDArray[np.uint8] = image[rows[:, None], columns]
        return looked_up.reshape(-1, 3)
