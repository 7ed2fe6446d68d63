"""The layout of the TUM RGB-D benchmark: lists of images and poses by time.

`rgb.txt`, `depth.txt` and `groundtruth.txt`, or `associations.txt` in place of the first two. The
renderings of ICL-NUIM have it too, with poses in `*.gt.freiburg`.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surfabet.io._files import format_error
from surfabet.io.rgbd._frames import Camera, Listing

HINT = "rgb.txt, depth.txt and groundtruth.txt"
# What the benchmark published for its three cameras, and for the default of the driver.
_INTRINSICS = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}
_DEFAULT_INTRINSICS = (525.0, 525.0, 319.5, 239.5)
_ASSOCIATIONS = ("associations.txt", "association.txt", "associate.txt", "associated.txt")


def _associations(folder: Path) -> Path | None:
    return next((folder / n for n in _ASSOCIATIONS if (folder / n).exists()), None)


def is_here(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / "depth.txt").exists() or _associations(folder) is not None


def _read_list(
    path: Path, n_columns: tuple[int, ...]
) -> tuple[NDArray[np.float64], list[list[str]]]:
    """Time stamps, in ascending order, and the other words of each line."""
    rows = []
    with path.open("r", encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            words = line.replace(",", " ").split()
            if not words or words[0].startswith("#"):
                continue
            try:
                if len(words) not in n_columns:
                    raise ValueError
                stamp = float(words[0])
                if not np.isfinite(stamp):
                    raise ValueError
            except ValueError:
                raise format_error(
                    path,
                    f"expected a time stamp and {n_columns[0] - 1} more values, found {line!r:.60}",
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


def _pose(path: Path, words: list[str]) -> NDArray[np.float64]:
    """The pose of seven words; not finite for a quaternion without a direction."""
    try:
        tx, ty, tz, x, y, z, w = (float(word) for word in words[:7])
    except ValueError:
        raise format_error(path, "a pose must be seven numbers", line=int(words[-1])) from None
    length = np.sqrt(x * x + y * y + z * z + w * w)
    pose = np.full((4, 4), np.nan)
    if not np.isfinite([tx, ty, tz, length]).all() or abs(length - 1) > 0.01:
        return pose
    x, y, z, w = x / length, y / length, z / length, w / length
    pose[:] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), tx],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), ty],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), tz],
        [0, 0, 0, 1],
    ]
    return pose


def _inside(folder: Path, name: str) -> Path:
    """A file that a list names; lists must not reach out of their folder."""
    path = folder / name
    if ".." in Path(name).parts or Path(name).is_absolute() or "\0" in name:
        raise format_error(folder, f"a list names {name!r:.60}, which is outside the folder")
    return path


def _pairs(
    folder: Path, listing: Listing, max_time_difference: float
) -> list[tuple[float, str, str]]:
    """Time stamp and name of each depth image, and the name of its colour image."""
    if not (folder / "depth.txt").exists():
        path = _associations(folder)
        assert path is not None
        stamps, rows = _read_list(path, (4, 12))
        pairs = []
        for stamp, (first, second_stamp, second, *_) in zip(stamps, rows, strict=True):
            # Either may come first, as the program was called that wrote the list.
            if "depth" in first:
                pairs.append((float(stamp), first, second))
            else:
                pairs.append((float(second_stamp), second, first))
        return pairs
    stamps, depths = _read_list(folder / "depth.txt", (2,))
    color_stamps, colors = _read_list(folder / "rgb.txt", (2,))
    pairs = []
    for stamp, (depth, _) in zip(stamps, depths, strict=True):
        color = _nearest(color_stamps, stamp, max_time_difference)
        if color is None:
            listing.lose(_too_far("colour image", max_time_difference), depth)
        else:
            pairs.append((float(stamp), depth, colors[color][0]))
    return pairs


def _too_far(what: str, seconds: float) -> str:
    return f"without a {what} within max_time_difference={seconds:g} s"


def _truth(folder: Path) -> Path:
    """The list of poses, which ICL-NUIM calls after its rooms."""
    if (path := folder / "groundtruth.txt").exists():
        return path
    others = list(folder.glob("*.gt.freiburg"))
    if len(others) != 1:
        raise format_error(folder, "the images are listed, but groundtruth.txt is missing")
    return others[0]


def find_frames(folder: Path, max_time_difference: float) -> Listing:
    """Each depth image with the colour image and the pose nearest in time."""
    truth = _truth(folder)
    if (folder / "depth.txt").exists() and not (folder / "rgb.txt").exists():
        raise format_error(folder, "depth.txt is there, but rgb.txt is missing")
    known = re.search("freiburg[123]", str(folder.resolve()))
    camera = Camera(*(_INTRINSICS[known.group()] if known else _DEFAULT_INTRINSICS))
    listing = Listing(folder, camera, depth_scale=5000, colored=True)
    pose_stamps, poses = _read_list(truth, (8,))
    for stamp, depth, color in _pairs(folder, listing, max_time_difference):
        pose = _nearest(pose_stamps, stamp, max_time_difference)
        if pose is None:
            listing.lose(_too_far("pose", max_time_difference), depth)
            continue
        listing.add(
            depth, _inside(folder, depth), _inside(folder, color), _pose(truth, poses[pose])
        )
    return listing
