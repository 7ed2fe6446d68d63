"""The layout of 7-Scenes and its kind: a depth image, a colour image and a pose per frame.

`frame-NNNNNN.depth.png` (or .tiff, .pfm, .npy), `.color.jpg` or `.color.png` (optional),
`.pose.txt`, and one `camera-intrinsics.txt`.
"""

from __future__ import annotations

from pathlib import Path

from surfabet.io.rgbd._frames import Listing, camera_from_file, pose_from_file
from surfabet.io.rgbd._images import DEPTH_SUFFIXES

HINT = "frame-*.depth.png with .pose.txt"
_INTRINSICS = "camera-intrinsics.txt"


def _depths(folder: Path) -> dict[str, Path]:
    return {
        path.name.removesuffix(f".depth{path.suffix}"): path
        for path in folder.glob("frame-*.depth.*")
        if path.suffix.lower() in DEPTH_SUFFIXES
    }


def is_here(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return any(folder.glob("frame-*.depth.*"))


def find_frames(folder: Path) -> Listing:
    """The frames by their numbers."""
    intrinsics = folder / _INTRINSICS
    camera = camera_from_file(intrinsics) if intrinsics.exists() else None
    depths = _depths(folder)
    colors = {path.name for path in folder.glob("*.color.*")}
    posed = {path.name.removesuffix(".pose.txt") for path in folder.glob("frame-*.pose.txt")}
    listing = Listing(folder, camera, depth_scale=1000, colored=bool(colors))
    for stem in sorted(depths.keys() | posed):
        names = (f"{stem}.color.jpg", f"{stem}.color.png")
        color = next((folder / name for name in names if name in colors), None)
        pose = pose_from_file(folder / f"{stem}.pose.txt")
        listing.add(stem, depths.get(stem), color, pose)
    return listing
