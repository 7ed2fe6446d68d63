"""The layout of Redwood and of Open3D's reconstruction: images in folders, a list of poses.

`depth/`, `color/` (or `rgb/`, `image/`), `trajectory.log` and `camera_intrinsic.json`.
"""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surfabet.errors import InvalidInputError
from surfabet.io._files import Lines, format_error
from surfabet.io._tables import parse_rows
from surfabet.io.rgbd._frames import Camera, Listing, check_intrinsics
from surfabet.io.rgbd._images import color_images, depth_images

HINT = "depth/, color/ and trajectory.log"
_INTRINSICS = ("camera_intrinsic.json", "intrinsic.json", "camera_primesense.json")
_COLOR_FOLDERS = ("color", "rgb", "image")


def is_here(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / "depth").is_dir() and (folder / "trajectory.log").exists()


def _camera(folder: Path) -> Camera | None:
    path = next((folder / n for n in _INTRINSICS if (folder / n).exists()), None)
    if path is None:
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        # Column by column.
        matrix = np.reshape(np.array(content["intrinsic_matrix"], np.float64), (3, 3)).T
        size = int(content["width"]), int(content["height"])
        camera = check_intrinsics(matrix)
    except InvalidInputError as error:
        raise format_error(path, str(error)) from None
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise format_error(
            path, f"no width, height and intrinsic_matrix of nine numbers: {error!r:.80}"
        ) from None
    return Camera(camera.fx, camera.fy, camera.cx, camera.cy, size)


def _trajectory(path: Path) -> list[tuple[int, NDArray[np.float64]]]:
    """Frames and their poses: blocks of a line of three integers and four rows of a matrix."""
    poses = []
    with path.open("rb") as file:
        lines = Lines(path, file)
        while (head := next(lines.filled(1), None)) is not None:
            words = head.split()
            if len(words) != 3 or not words[0].isdecimal():
                raise format_error(
                    path, f"expected three integers, found {head!r:.60}", line=lines.number
                )
            pose = parse_rows(lines, lines.filled(4), 4)
            if len(pose) < 4:
                raise format_error(path, "the file ends within a pose", line=lines.number)
            poses.append((int(words[0][:18]), pose))
    return poses


def find_frames(folder: Path) -> Listing:
    """The frames in the order of their images' names."""
    depths = sorted(depth_images(folder / "depth"))
    color_folder = next((n for n in _COLOR_FOLDERS if (folder / n).is_dir()), None)
    colors = [] if color_folder is None else sorted(color_images(folder / color_folder))
    path = folder / "trajectory.log"
    trajectory = _trajectory(path)
    by_stem = {color.stem: color for color in colors}
    if not by_stem.keys() & {depth.stem for depth in depths}:
        # Names hold times of their own.
        if colors and len(colors) != len(depths):
            raise format_error(
                folder, f"{len(colors)} colour images for {len(depths)} depth images"
            )
        by_stem = {depth.stem: color for depth, color in zip(depths, colors, strict=False)}
    numbers = [number for number, _ in trajectory]
    in_order = all(a < b for a, b in itertools.pairwise(numbers))
    listing = Listing(folder, _camera(folder), depth_scale=1000, colored=bool(colors))
    posed = {n if in_order else i: pose for i, (n, pose) in enumerate(trajectory)}
    if beyond := [n for n in posed if n >= len(depths)]:
        raise format_error(
            path, f"frame {beyond[0]} has a pose, but there are {len(depths)} depth images"
        )
    for i, depth in enumerate(depths):
        listing.add(depth.name, depth, by_stem.get(depth.stem), posed.get(i))
    return listing
