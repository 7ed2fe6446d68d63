"""E57 (ASTM E2807), the exchange format of terrestrial scanners, through pye57's libE57.

A file holds scans, each with a pose and coordinates in its own frame. We write one scan per
viewpoint, with the viewpoint as its pose, and normals by the registered extension `nor`.
"""

from __future__ import annotations

import hashlib
import os
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.errors import FormatError, LostAttributeWarning
from surfabet.io._columns import Column, build_cloud, warn_lost
from surfabet.io._files import format_error, optional_module, warn, written_whole

_POINTS_AT_A_TIME = 250_000
# E57 may store a constant column in no bytes at all; a scan with fewer than a bit per point is no
# scan.
_MOST_POINTS_PER_BYTE = 8
_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_COLORS = ("colorRed", "colorGreen", "colorBlue")
_NORMALS = ("nor:normalX", "nor:normalY", "nor:normalZ")
_NORMAL_URI = "http://www.libe57.org/E57_NOR_surface_normals.txt"
_INVALID = ("cartesianInvalidState", "sphericalInvalidState")


def _pye57() -> Any:
    return optional_module("pye57", "pye57>=0.4.16", "reading and writing E57 files")


@dataclass
class _Scan:
    """One scan in world coordinates."""

    points: NDArray[np.float64]
    colors: NDArray[np.uint8] | None
    intensities: Column | None
    normals: Column | None
    # Where the scanner stood, if the file says so.
    viewpoint: NDArray[np.float64] | None
    ranges: Column | None


@contextmanager
def _own_errors(path: Path) -> Iterator[None]:
    """What libE57 raises for broken files, as our error."""
    try:
        yield
    except (FormatError, MemoryError):
        raise
    except Exception as error:
        reason = str(error).strip().splitlines()
        raise format_error(
            path, f"cannot be read as E57: {reason[0] if reason else type(error).__name__}"
        ) from error


def _check_header(path: Path) -> None:
    """Holds the sizes in the first 48 bytes against the file."""
    size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(48)
    if not header.startswith(b"ASTM-E57"):
        raise format_error(path, "not an E57 file: it must begin with 'ASTM-E57'", byte=0)
    if len(header) < 48:
        raise format_error(path, "the file ends inside the header", byte=len(header))
    length, xml_at, xml_length, page = np.frombuffer(header, "<u8", 4, 16).tolist()
    if length != size:
        raise format_error(
            path, f"the header says {length} bytes, but the file has {size}", byte=16
        )
    if xml_at > size or xml_length > size - xml_at or page != 1024:
        raise format_error(
            path,
            f"the header says {xml_length} bytes of XML at byte {xml_at}, pages of {page} bytes",
            byte=24,
        )


def _value(node: Any) -> float:
    value = node.scaledValue() if hasattr(node, "scaledValue") else node.value()
    return float(value)


def _vector(structure: Any, names: str) -> NDArray[np.float64]:
    return np.array([_value(structure[name]) for name in names])


def _pose(path: Path, scan: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation (3 x 3) and translation, scan to world."""
    rotation, translation = np.eye(3), np.zeros(3)
    pose = scan["pose"]
    if pose.isDefined("translation"):
        translation = _vector(pose["translation"], "xyz")
    if pose.isDefined("rotation"):
        w, x, y, z = _vector(pose["rotation"], "wxyz")
        length = float(np.sqrt(w * w + x * x + y * y + z * z))
        if not abs(length - 1) < 0.01:
            raise format_error(path, f"a pose has a quaternion of length {length:.4g}, not 1")
        w, x, y, z = w / length, x / length, y / length, z / length
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
    if not np.isfinite(translation).all():
        raise format_error(path, "a pose has a translation that is not finite")
    return rotation, translation


def _read_fields(
    path: Path, libe57: Any, image: Any, points: Any, names: list[str]
) -> dict[str, Column]:
    """The named fields of a scan, a bounded number of points at a time."""
    promised = points.childCount()
    if promised > _MOST_POINTS_PER_BYTE * path.stat().st_size:
        raise format_error(path, f"a scan promises {promised} points, more than the file can hold")
    if promised == 0:
        return {name: np.empty(0) for name in names}
    capacity = min(promised, _POINTS_AT_A_TIME)
    arrays = {name: np.empty(capacity, np.float64) for name in names}
    buffers = libe57.VectorSourceDestBuffer()
    for name, array in arrays.items():
        buffers.append(libe57.SourceDestBuffer(image, name, array, capacity, True, True))
    parts: dict[str, list[Column]] = {name: [] for name in names}
    reader = points.reader(buffers)
    try:
        found = 0
        while n := reader.read():
            found += n
            for name, array in arrays.items():
                single = name not in _CARTESIAN + _SPHERICAL
                parts[name].append(array[:n].astype(np.float32 if single else np.float64))
    finally:
        reader.close()
    if found != promised:
        raise format_error(path, f"a scan ends after {found} of {promised} points")
    return {name: np.concatenate(part) for name, part in parts.items()}


def _colors(scan: Any, fields: Mapping[str, Column]) -> NDArray[np.uint8]:
    """Colours stretched from their stated limits to 0..255."""
    rows = np.stack([fields[name] for name in _COLORS], axis=1)
    high = 255.0
    if scan.isDefined("colorLimits"):
        limits = scan["colorLimits"]
        names = [f"{name}Maximum" for name in _COLORS]
        if all(limits.isDefined(name) for name in names):
            high = max(_value(limits[name]) for name in names)
    if not high > 0:
        high = 255.0
    rows = np.nan_to_num(rows * (255.0 / high), nan=0.0)
    colors: NDArray[np.uint8] = np.clip(np.rint(rows), 0, 255).astype(np.uint8)
    return colors


def _read_scan(path: Path, libe57: Any, image: Any, scan: Any) -> _Scan:
    points = scan["points"]
    prototype = libe57.StructureNode(points.prototype())
    known = [*_CARTESIAN, *_SPHERICAL, *_COLORS, "intensity", *_NORMALS, *_INVALID]
    children = {prototype.get(i).elementName() for i in range(prototype.childCount())}
    present = [name for name in known if name in children]
    is_cartesian = set(_CARTESIAN) <= set(present)
    if not is_cartesian and not set(_SPHERICAL) <= set(present):
        raise format_error(path, "a scan has neither Cartesian nor spherical coordinates")
    unused = _SPHERICAL if is_cartesian else _CARTESIAN
    invalid = _INVALID[0 if is_cartesian else 1]
    names = [n for n in present if n not in unused and (n not in _INVALID or n == invalid)]
    fields = _read_fields(path, libe57, image, points, names)
    if invalid in fields:
        valid = fields.pop(invalid) == 0
        fields = {name: column[valid] for name, column in fields.items()}
    if is_cartesian:
        local = np.stack([fields[name] for name in _CARTESIAN], axis=1)
    else:
        radius, azimuth, elevation = (fields[name] for name in _SPHERICAL)
        level = radius * np.cos(elevation)
        local = np.stack(
            [level * np.cos(azimuth), level * np.sin(azimuth), radius * np.sin(elevation)], axis=1
        )
    has_pose = scan.isDefined("pose")
    rotation, translation = _pose(path, scan) if has_pose else (np.eye(3), np.zeros(3))
    has_sensor = has_pose or not is_cartesian or scan.isDefined("sphericalBounds")
    turned = not np.array_equal(rotation, np.eye(3))
    world = (local @ rotation.T if turned else local) + translation
    normals = None
    if set(_NORMALS) <= fields.keys():
        normals = np.stack([fields[name] for name in _NORMALS], axis=1)
        if turned:
            normals = (normals @ rotation.T).astype(np.float32)
    return _Scan(
        world,
        _colors(scan, fields) if set(_COLORS) <= fields.keys() else None,
        fields.get("intensity"),
        normals,
        translation if has_sensor else None,
        np.sqrt((local * local).sum(axis=1)) if has_sensor else None,
    )


def _joined(path: Path, scans: list[_Scan], name: str) -> Column | None:
    """An attribute of all scans; one that only some have goes, which is said."""
    parts = [getattr(scan, name) for scan in scans]
    present = [part for part in parts if part is not None]
    if len(present) == len(parts):
        return np.concatenate(present)
    if present:
        warn(f"{path}: {name} are left out, since not every scan has them", LostAttributeWarning)
    return None


def read_e57(path: Path) -> PointCloud:
    """Reads all scans of an E57 file into one cloud.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        Positions with the scans' poses applied, from Cartesian or spherical coordinates; points
        marked as invalid are left out, since nothing was measured there. Where every scan has them:
        colours, intensities and normals. Viewpoints (row i is scan i of those with points) and
        ranges are the scans' own origins and the distances to these, if every scan tells its origin
        by a pose, spherical coordinates or spherical bounds. Other fields and images are left
        aside.

    Raises
    ------
    FormatError
        The file is not E57, is truncated or damaged.
    MissingDependencyError
        pye57 is not installed.

    Warns
    -----
    LostAttributeWarning
        An attribute was left out because only some of the scans have it.
    """
    _check_header(path)
    libe57 = _pye57().libe57
    with _own_errors(path), np.errstate(over="ignore", invalid="ignore"):
        image = libe57.ImageFile(os.fspath(path), "r")
        try:
            root = image.root()
            if not root.isDefined("data3D"):
                raise format_error(path, "the file has no scans")
            data = root["data3D"]
            scans = [_read_scan(path, libe57, image, data[i]) for i in range(len(data))]
        finally:
            image.close()
    scans = [scan for scan in scans if len(scan.points)] or scans[:1]
    if not scans:
        raise format_error(path, "the file has no scans")
    origins = [scan.viewpoint for scan in scans if scan.viewpoint is not None]
    ranges = _joined(path, scans, "ranges")
    index = np.repeat(np.arange(len(scans), dtype=np.uint32), [len(s.points) for s in scans])
    return build_cloud(
        path,
        np.concatenate([scan.points for scan in scans]),
        colors=_joined(path, scans, "colors"),
        intensities=_joined(path, scans, "intensities"),
        normals=_joined(path, scans, "normals"),
        ranges=ranges,
        viewpoints=None if ranges is None else np.stack(origins),
        viewpoint_index=None if ranges is None else index,
    )


class _Writer:
    """Builds the tree of nodes of a file."""

    def __init__(self, libe57: Any, path: Path, seed: bytes) -> None:
        self.libe57 = libe57
        self.image = libe57.ImageFile(os.fspath(path), "w")
        self.seed = seed
        self.n_ids = 0
        self.image.extensionsAdd("", libe57.E57_V1_0_URI)

    def guid(self) -> Any:
        """An identifier made from the contents: the same cloud gives the same file."""
        digest = hashlib.sha256(self.seed + self.n_ids.to_bytes(4, "little")).digest()
        self.n_ids += 1
        return self.text(f"{{{uuid.UUID(bytes=digest[:16], version=4)}}}")

    def text(self, value: str) -> Any:
        return self.libe57.StringNode(self.image, value)

    def integer(self, value: int, low: int, high: int) -> Any:
        return self.libe57.IntegerNode(self.image, value, low, high)

    def float(self, value: float) -> Any:
        return self.libe57.FloatNode(self.image, value)

    def structure(self, **children: Any) -> Any:
        node = self.libe57.StructureNode(self.image)
        for name, child in children.items():
            node.set(name, child)
        return node

    def root(self) -> Any:
        """Fills in the root and gives back its list of scans."""
        libe57, root = self.libe57, self.image.root()
        scans = libe57.VectorNode(self.image, True)
        root.set("formatName", self.text("ASTM E57 3D Imaging Data File"))
        root.set("guid", self.guid())
        root.set("versionMajor", libe57.IntegerNode(self.image, libe57.E57_FORMAT_MAJOR))
        root.set("versionMinor", libe57.IntegerNode(self.image, libe57.E57_FORMAT_MINOR))
        root.set("e57LibraryVersion", self.text(libe57.E57_LIBRARY_ID))
        root.set("coordinateMetadata", self.text(""))
        root.set("data3D", scans)
        root.set("images2D", libe57.VectorNode(self.image, True))
        return scans

    def scan(self, columns: Mapping[str, Column], viewpoint: Column | None, name: str) -> Any:
        """The node of a scan without its points."""
        scan = self.structure(guid=self.guid(), name=self.text(name))
        if viewpoint is not None:
            x, y, z = (self.float(float(c)) for c in viewpoint)
            scan.set(
                "pose",
                self.structure(
                    rotation=self.structure(
                        w=self.float(1.0), x=self.float(0.0), y=self.float(0.0), z=self.float(0.0)
                    ),
                    translation=self.structure(x=x, y=y, z=z),
                ),
            )
        if "intensity" in columns and len(columns["intensity"]):
            limits = columns["intensity"]
            scan.set(
                "intensityLimits",
                self.structure(
                    intensityMinimum=self.float(float(limits.min())),
                    intensityMaximum=self.float(float(limits.max())),
                ),
            )
        if _COLORS[0] in columns:
            ends = {"Minimum": 0, "Maximum": 255}
            limits_ = {
                f"{name}{end}": self.integer(value, 0, 255)
                for name in _COLORS
                for end, value in ends.items()
            }
            scan.set("colorLimits", self.structure(**limits_))
        return scan

    def points(self, scans: Any, scan: Any, columns: Mapping[str, Column]) -> None:
        """Adds the scan with its points to the file."""
        libe57 = self.libe57
        prototype = libe57.StructureNode(self.image)
        for name, column in columns.items():
            if column.dtype.kind == "f":
                precision = libe57.E57_DOUBLE if column.dtype == np.float64 else libe57.E57_SINGLE
                node = libe57.FloatNode(self.image, 0.0, precision)
            else:
                node = self.integer(0, 0, 255)
            prototype.set(name, node)
        points = libe57.CompressedVectorNode(
            self.image, prototype, libe57.VectorNode(self.image, True)
        )
        scan.set("points", points)
        scans.append(scan)
        n = len(columns[_CARTESIAN[0]])
        capacity = max(1, min(n, _POINTS_AT_A_TIME))
        arrays = {name: np.empty(capacity, c.dtype) for name, c in columns.items()}
        buffers = libe57.VectorSourceDestBuffer()
        for name, array in arrays.items():
            buffers.append(libe57.SourceDestBuffer(self.image, name, array, capacity, True, True))
        writer = points.writer(buffers)
        for start in range(0, n, capacity):
            count = min(capacity, n - start)
            for name, array in arrays.items():
                array[:count] = columns[name][start : start + count]
            writer.write(count)
        writer.close()


def _columns(cloud: PointCloud, which: Column | slice, shift: Column | None) -> dict[str, Column]:
    if shift is None and not any(cloud.origin):
        points: Column = cloud.local_points[which]
    else:
        points = cloud.points[which] - (0 if shift is None else shift)
    columns = {name: points[:, a] for a, name in enumerate(_CARTESIAN)}
    if (intensities := cloud.intensities) is not None:
        columns["intensity"] = intensities[which]
    if (colors := cloud.colors) is not None:
        columns |= {name: colors[which, a] for a, name in enumerate(_COLORS)}
    if (normals := cloud.normals) is not None:
        columns |= {name: normals[which, a] for a, name in enumerate(_NORMALS)}
    return columns


def _groups(cloud: PointCloud) -> list[tuple[Column | slice, Column | None]]:
    """For each scan to write: its points and its viewpoint."""
    if cloud.viewpoints is None or cloud.viewpoint_index is None or not len(cloud):
        return [(slice(None), None)]
    order = np.argsort(cloud.viewpoint_index, kind="stable")
    used, starts = np.unique(cloud.viewpoint_index[order], return_index=True)
    parts = np.split(order, starts[1:])
    return [(part, cloud.viewpoints[i]) for i, part in zip(used, parts, strict=True)]


def _lost(cloud: PointCloud) -> list[str]:
    if cloud.ranges is None:
        return []
    if cloud.viewpoints is None or cloud.viewpoint_index is None:
        return ["ranges without viewpoints"]
    distances = np.linalg.norm(cloud.points - cloud.viewpoints[cloud.viewpoint_index], axis=1)
    if np.allclose(distances, cloud.ranges, rtol=1e-4, atol=1e-3):
        return []
    return ["ranges other than the distances to the viewpoints"]


def write_e57(path: Path, cloud: PointCloud) -> None:
    """Writes an E57 file with one scan per viewpoint.

    Points are grouped by viewpoint, so their order changes where viewpoints alternate. Coordinates
    are double (float where the cloud has neither origin nor viewpoints), intensities and normals
    float.

    Parameters
    ----------
    path
        The file, replaced in one piece.
    cloud
        What to write.

    Raises
    ------
    MissingDependencyError
        pye57 is not installed.

    Warns
    -----
    LostAttributeWarning
        The cloud has ranges that are not the distances to its viewpoints: E57 derives them.
    """
    libe57 = _pye57().libe57
    seed = hashlib.sha256(np.ascontiguousarray(cloud.local_points).tobytes()).digest()
    with written_whole(path) as temporary:
        writer = _Writer(libe57, temporary, seed)
        try:
            if cloud.normals is not None:
                writer.image.extensionsAdd("nor", _NORMAL_URI)
            scans = writer.root()
            for number, (which, viewpoint) in enumerate(_groups(cloud), 1):
                columns = _columns(cloud, which, viewpoint)
                scan = writer.scan(columns, viewpoint, f"Scan {number}")
                writer.points(scans, scan, columns)
        finally:
            writer.image.close()
    warn_lost(path, "E57", _lost(cloud))
