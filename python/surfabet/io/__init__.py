"""Point cloud files: a module per format, `read` and `write` for all of them."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from surfabet._checks import check_text, check_vector
from surfabet._core import PointCloud
from surfabet.errors import InvalidInputError, LostAttributeWarning, wrong_type, wrong_value
from surfabet.io._files import existing, format_error, path_of, warn
from surfabet.io._packed import first_bytes, unpacked, unpacked_name
from surfabet.io._units import UNITS, metres_per, scaled
from surfabet.io.copc import has_copc_mark, read_copc
from surfabet.io.e57 import read_e57, write_e57
from surfabet.io.esri_grid import read_esri_grid
from surfabet.io.kitti import read_kitti
from surfabet.io.las import read_las, write_las
from surfabet.io.npz import read_npy, read_npz, write_npz
from surfabet.io.obj import read_obj
from surfabet.io.pcd import read_pcd, write_pcd
from surfabet.io.ply import read_ply, write_ply
from surfabet.io.pts import read_pts
from surfabet.io.ptx import read_ptx
from surfabet.io.rgbd import LAYOUTS, is_rgbd, read_rgbd
from surfabet.io.ros import Topic, is_bag, list_topics, read_bag, write_mcap
from surfabet.io.text import read_text, write_text

__all__ = [
    "UNITS",
    "Format",
    "Topic",
    "detect",
    "formats",
    "list_topics",
    "named_format",
    "read",
    "read_bag",
    "read_rgbd",
    "write",
]


@dataclass(frozen=True)
class Format:
    """A file format: how its files are called and begin, and what reads and writes them."""

    name: str
    """Short name, as in `read(path, format=name)`."""
    suffixes: tuple[str, ...]
    """Endings of its file names, in lower case."""
    magic: tuple[bytes, ...]
    """The bytes that its files begin with; none for formats without a mark."""
    reader: Callable[..., PointCloud] | None
    """Takes a `Path` and the format's options; `None` where we only write."""
    writer: Callable[..., None] | None
    """Takes a `Path`, a cloud and the format's options; `None` where we only read."""

    @property
    def read_options(self) -> tuple[str, ...]:
        """The names of the reader's own options."""
        return _options(self.reader)

    @property
    def write_options(self) -> tuple[str, ...]:
        """The names of the writer's own options."""
        return _options(self.writer)


def _options(function: Callable[..., Any] | None) -> tuple[str, ...]:
    if function is None:
        return ()
    parameters = inspect.signature(function).parameters.values()
    return tuple(p.name for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY)


_FORMATS = (
    Format("ply", (".ply",), (b"ply\n", b"ply\r"), read_ply, write_ply),
    Format("pcd", (".pcd",), (b"# .PCD", b"VERSION", b"FIELDS"), read_pcd, write_pcd),
    Format("las", (".las", ".laz"), (b"LASF",), read_las, write_las),
    Format("copc", (), (), read_copc, None),
    Format("e57", (".e57",), (b"ASTM-E57",), read_e57, write_e57),
    Format("npz", (".npz",), (b"PK\x03\x04",), read_npz, write_npz),
    Format("npy", (".npy",), (b"\x93NUMPY",), read_npy, None),
    Format("xyz", (".xyz", ".txt", ".asc", ".csv"), (), read_text, write_text),
    Format("obj", (".obj",), (), read_obj, None),
    Format("pts", (".pts",), (), read_pts, None),
    Format("ptx", (".ptx",), (), read_ptx, None),
    Format("esri_grid", (".asc", ".grd"), (b"ncols", b"NCOLS"), read_esri_grid, None),
    Format("kitti", (".bin",), (), read_kitti, None),
    Format("rgbd", (), (), read_rgbd, None),
    Format("bag", (".bag", ".db3"), (b"#ROSBAG V2.0", b"SQLite format 3\0"), read_bag, None),
    Format("mcap", (".mcap",), (b"\x89MCAP0\r\n",), read_bag, write_mcap),
)


def formats() -> tuple[Format, ...]:
    """The known formats."""
    return _FORMATS


def named_format(name: str) -> Format:
    """The format of that name.

    Raises
    ------
    InvalidInputError
        There is none.
    """
    requirement = f"one of {', '.join(known.name for known in _FORMATS)}"
    check_text("format", name, requirement)
    for known in _FORMATS:
        if known.name == name.lower():
            return known
    raise wrong_value("format", name, requirement)


def _suffixes(which: str) -> str:
    found = (s for known in _FORMATS if getattr(known, which) for s in known.suffixes)
    # Several formats have one suffix.
    return ", ".join(dict.fromkeys(found))


def detect(path: str | os.PathLike[str]) -> Format:
    """The format of an existing file or folder, by its suffix and by its first bytes.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        It is none of the known formats, or its name says another than its first bytes.
    """
    path = existing(path_of("path", path))
    if path.is_dir():
        if is_bag(path):
            return named_format("bag")
        if not is_rgbd(path):
            raise format_error(
                path,
                f"no RGB-D frames in this folder: expected {LAYOUTS}; nor a ROS bag",
            )
        return named_format("rgbd")
    start = first_bytes(path)
    if not start:
        raise format_error(path, "the file is empty", byte=0)
    suffix = Path(unpacked_name(path)).suffix
    alike = [f for f in _FORMATS if suffix.lower() in f.suffixes]
    marked = next((f for f in _FORMATS if start.startswith(f.magic)), None)
    if marked is not None and marked.name == "las" and has_copc_mark(start):
        return named_format("copc")
    named = marked if marked in alike else next(iter(alike), None)
    if named is None and marked is None:
        raise format_error(
            path,
            f"unknown suffix {suffix!r}; known are {_suffixes('reader')}, and folders of "
            "RGB-D frames; name the format with format=",
        )
    if named is None or marked is named:
        assert marked is not None
        return marked
    if marked is not None:
        raise format_error(
            path,
            f"the suffix says {named.name}, but the first bytes say {marked.name}; rename the "
            f"file or read it with format={marked.name!r}",
            byte=0,
        )
    return named


def _check_options(known: tuple[str, ...], name: str, options: dict[str, Any]) -> None:
    for option in options:
        if option not in known:
            owners = ", ".join(f.name for f in _FORMATS if option in f.read_options)
            raise InvalidInputError(
                f"unknown option {option!r} for {name}; known are {', '.join(known) or 'none'}"
                + (f"; {owners} has it" if owners else "")
            )


def read(
    path: str | os.PathLike[str],
    format: str | None = None,
    *,
    viewpoint: Sequence[float] | None = None,
    unit: str | None = None,
    **options: Any,
) -> PointCloud:
    """Reads a point cloud from a file, or from a folder of RGB-D frames.

    A file that is packed by gzip, bzip2, xz or zstd, under any name, is unpacked into a temporary
    one.

    Parameters
    ----------
    path
        The file or folder.
    format
        The name of the format; by default the suffix and the first bytes of the file tell it.
    viewpoint
        Where the sensor stood (x, y, z in world coordinates), for single scans whose file does not
        say; it gives them a viewpoint and ranges.
    unit
        The unit of the file's lengths, for files that do not say: mm, cm, m, km, ft, us-ft or in.
        Points, ranges and viewpoints are scaled to metres; a coordinate reference system is left
        aside then, with a warning.
    **options
        Options of the format's reader, such as `frame_stride` for RGB-D folders: see `formats()`
        and the readers' own documentation.

    Returns
    -------
    PointCloud
        What the file holds, in world coordinates, metres unless the file says otherwise.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        The file is not what it claims to be: truncated, corrupt or of another format, or packed
        and growing to more than 200 times its size. The message names the file and the byte or
        line.
    InvalidInputError
        An unknown format or option.
    MissingDependencyError
        The format needs a package that is not installed; the message says which.

    Warns
    -----
    DroppedPointsWarning
        Points or attributes that are not finite were left out; the message counts them.
    """
    if isinstance(path, str) and not path:
        # A Path of it would be the folder where the process runs.
        raise wrong_value("path", path, "the name of a file or folder")
    path = existing(path_of("path", path))
    if unit is not None:
        check_text("unit", unit, f"one of {', '.join(UNITS)}")
    if viewpoint is not None:
        check_vector("viewpoint", viewpoint, "three finite coordinates")
    chosen = detect(path) if format is None else named_format(format)
    if chosen.reader is None:
        raise InvalidInputError(f"surfabet writes {chosen.name} files, but does not read them")
    folders = {"rgbd": True, "bag": path.is_dir()}
    if path.is_dir() != folders.get(chosen.name, False):
        what = "a folder" if path.is_dir() else "a file"
        raise InvalidInputError(f"{path} is {what}, which the format {chosen.name} does not read")
    _check_options(chosen.read_options, chosen.name, options)
    factor = 1.0 if unit is None else metres_per(unit)
    if unit is not None and "unit" in chosen.read_options:
        # Its files may have units of their own, which then must agree.
        options["unit"], factor = unit, 1.0
    if options.get("fused") is False:
        raise InvalidInputError(
            "read() gives one cloud; surfabet.io.read_rgbd gives one per frame, and "
            "surfabet.io.read_bag one per message"
        )
    with unpacked(path) as there:
        cloud = chosen.reader(there, **options)
    if factor != 1:
        if cloud.crs is not None:
            warn(
                f"{path}: coordinates are in metres now, and no longer in the file's coordinate "
                "reference system, which is left aside",
                LostAttributeWarning,
            )
        cloud = scaled(cloud, factor)
    return cloud if viewpoint is None else cloud.seen_from(viewpoint)


def write(
    path: str | os.PathLike[str], cloud: PointCloud, format: str | None = None, **options: Any
) -> None:
    """Writes a point cloud to a file, replacing an old one only when the new one is complete.

    Parameters
    ----------
    path
        The file. Its suffix tells the format.
    cloud
        What to write, in world coordinates.
    format
        The name of the format, where the suffix is another.
    **options
        Options of the format's writer, such as `ascii=True` for PLY: see `formats()` and the
        writers' own documentation.

    Raises
    ------
    InvalidInputError
        An unknown suffix, format or option.
    MissingDependencyError
        The format needs a package that is not installed; the message says which.

    Warns
    -----
    LostAttributeWarning
        The format cannot hold an attribute of the cloud; the message names it.
    """
    path = path_of("path", path)
    if not isinstance(cloud, PointCloud):
        raise wrong_type("cloud", cloud, "a PointCloud")
    if format is not None:
        chosen = named_format(format)
    else:
        found = next((f for f in _FORMATS if path.suffix.lower() in f.suffixes), None)
        if found is None:
            raise InvalidInputError(
                f"unknown suffix {path.suffix!r} of {path}; known are {_suffixes('writer')}"
            )
        chosen = found
    if chosen.writer is None:
        raise InvalidInputError(
            f"surfabet reads {chosen.name}, but does not write it; known are {_suffixes('writer')}"
        )
    _check_options(chosen.write_options, chosen.name, options)
    chosen.writer(path, cloud, **options)
