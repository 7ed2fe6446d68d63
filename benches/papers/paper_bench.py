"""What the scripts of this folder share: the real scans and tables in Markdown."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import surfabet as sb

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


def check_data() -> None:
    """Leaves with a word where the scans are not there."""
    if not DATA.is_dir():
        sys.exit(f"{DATA} is not there: this script needs the real scans")


def room() -> sb.PointCloud:
    """The fused RGB-D frames of a real room."""
    return sb.read(DATA / "rgbd_room")


def kinect_frame(name: str = "table") -> sb.PointCloud:
    """One Kinect frame, "table" or "objects"."""
    with warnings.catch_warnings():
        # Pixels without depth are no points.
        warnings.simplefilter("ignore", sb.DroppedPointsWarning)
        return sb.read(DATA / "rgbd_frame" / f"{name}.pcd")


def print_row(*cells: object) -> None:
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def print_header(*cells: object) -> None:
    print_row(*cells)
    print_row(*["---"] * len(cells))
