"""The layout of ScanNet, as its reader exports it.

`depth/N.png`, `color/N.jpg` (optional), `pose/N.txt`, and in `intrinsic/` the matrices of both
cameras. Colour and depth images have sizes of their own.
"""

from __future__ import annotations

from pathlib import Path

from surfabet.io.rgbd._frames import Listing, camera_from_file, pose_from_file
from surfabet.io.rgbd._images import color_images, depth_images

HINT = "depth/, color/ and pose/"


def is_here(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / "depth").is_dir() and (folder / "pose").is_dir()


def find_frames(folder: Path) -> Listing:
    """The frames by their numbers."""
    cameras = [folder / "intrinsic" / f"intrinsic_{name}.txt" for name in ("depth", "color")]
    camera, color_camera = (camera_from_file(p) if p.exists() else None for p in cameras)
    depths = {path.stem: path for path in depth_images(folder / "depth")}
    colors = {path.stem: path for path in color_images(folder / "color")}
    poses = {path.stem: path for path in (folder / "pose").glob("*.txt")}
    listing = Listing(folder, camera, 1000, color_camera, colored=bool(colors))
    # Numbers are not padded.
    for stem in sorted(depths.keys() | poses.keys(), key=lambda s: (len(s), s)):
        pose = pose_from_file(folder / "pose" / f"{stem}.txt")
        listing.add(stem, depths.get(stem), colors.get(stem), pose)
    return listing
