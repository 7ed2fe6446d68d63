"""E57 (ASTM E2807), the exchange format of terrestrial scanners, through pye57's libE57.

A file holds scans, each with a pose and coordinates in its own frame. We write one scan per
viewpoint, with the viewpoint as its pose, normals by the registered extension `nor`, and extra
columns by the fields of the standard where they have its names, else by an extension of our own.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import re
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet._core import RESERVED_NAMES, KdTree, PointCloud
from surfabet.errors import FormatError
from surfabet.io._columns import (
    Column,
    NoReturnFacts,
    add_columns,
    build_cloud,
    colors_from,
    is_normals,
    no_returns,
    note_rounded,
    recorded,
    warn_lost,
)
from surfabet.io._crs import unit_remark
from surfabet.io._files import format_error, optional_module, written_whole
from surfabet.io._notes import HeldNotes, Notes

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
# Full brightness in 8, 10, 12, 14 and 16 bits.
_FULL_LIGHTS = (255.0, 1023.0, 4095.0, 16383.0, 65535.0)
_COLOR_INVALID, _INTENSITY_INVALID = "isColorInvalid", "isIntensityInvalid"
# Fields of the standard that extra columns are written to, and what these must be.
_STANDARD_INTEGERS = ("rowIndex", "columnIndex", "returnIndex", "returnCount", "isTimeStampInvalid")
_STANDARD_FLOATS = ("timeStamp",)
_ATTRIBUTES = {
    "colors": "colours",
    "intensities": "intensities",
    "normals": "normals",
    "ranges": "ranges",
}
_PREFIX = "surfabet"
_PREFIX_URI = "urn:surfabet:columns"


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
    extra: dict[str, Column]


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


def _pose(path: Path, scan: Any, notes: Notes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation (3 x 3) and translation, scan to world."""
    rotation, translation = np.eye(3), np.zeros(3)
    pose = scan["pose"]
    if pose.isDefined("translation"):
        translation = _vector(pose["translation"], "xyz")
    if pose.isDefined("rotation"):
        quaternion = _vector(pose["rotation"], "wxyz")
        length = float(np.sqrt((quaternion**2).sum()))
        if length == 0:
            notes.remark("a pose has the quaternion 0 0 0 0 and was taken as not turned")
            quaternion, length = np.array([1.0, 0.0, 0.0, 0.0]), 1.0
        elif not abs(length - 1) < 0.01:
            raise format_error(path, f"a pose has a quaternion of length {length:.4g}, not 1")
        w, x, y, z = quaternion / length
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


def _column_type(libe57: Any, node: Any) -> np.dtype[Any] | None:
    """The type of a field's values in a cloud; `None` for what is no number."""
    if isinstance(node, libe57.IntegerNode):
        low, high = node.minimum(), node.maximum()
        for name in ("u1", "i1", "u2", "i2", "u4", "i4", "i8"):
            limits = np.iinfo(name)
            if limits.min <= low and high <= limits.max:
                return np.dtype(name)
    if isinstance(node, libe57.FloatNode) and node.precision() == libe57.E57_SINGLE:
        return np.dtype(np.float32)
    is_number = isinstance(node, (libe57.FloatNode, libe57.ScaledIntegerNode))
    return np.dtype(np.float64) if is_number else None


def _read_fields(
    path: Path, libe57: Any, image: Any, points: Any, types: Mapping[str, np.dtype[Any]]
) -> dict[str, Column]:
    """The named fields of a scan in these types, a bounded number of points at a time."""
    promised = points.childCount()
    if promised > _MOST_POINTS_PER_BYTE * path.stat().st_size:
        raise format_error(path, f"a scan promises {promised} points, more than the file can hold")
    if promised == 0:
        return {name: np.empty(0, dtype) for name, dtype in types.items()}
    capacity = min(promised, _POINTS_AT_A_TIME)
    arrays = {
        name: np.empty(capacity, np.longlong if dtype == np.int64 else np.float64)
        for name, dtype in types.items()
    }
    buffers = libe57.VectorSourceDestBuffer()
    for name, array in arrays.items():
        buffers.append(libe57.SourceDestBuffer(image, name, array, capacity, True, True))
    parts: dict[str, list[Column]] = {name: [] for name in types}
    reader = points.reader(buffers)
    try:
        found = 0
        while n := reader.read():
            found += n
            for name, array in arrays.items():
                parts[name].append(array[:n].astype(types[name]))
    finally:
        reader.close()
    if found != promised:
        raise format_error(path, f"a scan ends after {found} of {promised} points")
    return {name: np.concatenate(part) for name, part in parts.items()}


def _full_light(scan: Any, nodes: Mapping[str, Any]) -> float | None:
    """The value of full brightness that the file states: its limits, else the fields' bounds."""
    if scan.isDefined("colorLimits"):
        limits = scan["colorLimits"]
        names = [f"{name}Maximum" for name in _COLORS]
        if all(limits.isDefined(name) for name in names):
            return max(_value(limits[name]) for name in names)
    channels = [nodes[name] for name in _COLORS]
    if all(hasattr(node, "scaledMaximum") for node in channels):
        high = max(float(node.scaledMaximum()) for node in channels)
    else:
        high = max(float(node.maximum()) for node in channels)
    # Bounds are those of the values in some files; these have the bits that it takes.
    return next((full for full in (1.0, *_FULL_LIGHTS) if high <= full), None)


def _colors(
    path: Path, full: float | None, fields: Mapping[str, Column], notes: Notes
) -> NDArray[np.uint8] | None:
    """Colours stretched from the stated range to 0..255; by their values where it cannot be."""
    rows = np.stack([fields[name] for name in _COLORS], axis=1)
    rows = np.nan_to_num(rows, nan=0.0, posinf=0.0, neginf=0.0)
    largest = rows.max(initial=0)
    # A range that the values leave or never come near is wrong.
    if full is not None and full > 0 and largest <= full and (full <= 255 or largest > 255):
        rows = np.maximum(rows, 0)
        colors = np.rint(rows * (255 / full)).astype(np.uint8)
        note_rounded(rows, colors, full, notes)
    else:
        colors = colors_from(path, list(rows.T), notes)
    return recorded(colors, "colours", notes)


def _fill_invalid(
    points: NDArray[np.float64], values: Column, invalid: NDArray[np.bool_], what: str, notes: Notes
) -> Column | None:
    """The values, those marked as invalid taken from the nearest point whose own is valid."""
    if not invalid.any():
        return values
    if invalid.all():
        notes.aside(f"{what}, which are invalid everywhere")
        return None
    local = (points - points[np.argmin(invalid)]).astype(np.float32)
    _, nearest = KdTree(local[~invalid]).query(local[invalid])
    filled = values.copy()
    filled[invalid] = values[~invalid][nearest.reshape(-1)]
    notes.remark(
        f"points without valid {what} of their own got those of the nearest point that has",
        int(invalid.sum()),
    )
    return filled


def _by_own_name(fields: Mapping[str, Column], extended: bool, notes: Notes) -> dict[str, Column]:
    """The fields by the names of columns, without the prefix of our own extension."""
    columns: dict[str, Column] = {}
    for name, column in fields.items():
        own = name.removeprefix(f"{_PREFIX}:") if extended else name
        add_columns(columns, {own: column}, notes)
    return columns


def _wanted(
    path: Path, libe57: Any, nodes: Mapping[str, Any], is_cartesian: bool, notes: Notes
) -> dict[str, np.dtype[Any]]:
    """The fields to read of a scan with their types."""
    # The same points in other coordinates; a part of these is something else.
    others = (*_SPHERICAL, _INVALID[1]) if is_cartesian else (*_CARTESIAN, _INVALID[0])
    unused = others if set(others[:3]) <= nodes.keys() else ()
    types: dict[str, np.dtype[Any]] = {}
    for name, node in nodes.items():
        if name in unused:
            continue
        dtype = _column_type(libe57, node)
        if dtype is None:
            notes.aside(f"field {name}, which holds no numbers")
        elif name in (*_CARTESIAN, *_SPHERICAL, *_COLORS):
            types[name] = np.dtype(np.float64)
        elif name in _NORMALS or (name == "intensity" and dtype.kind == "f"):
            types[name] = np.dtype(np.float32)
        else:
            types[name] = dtype
    return types


def _local(fields: dict[str, Column], is_cartesian: bool) -> NDArray[np.float64]:
    """Takes the coordinates in the scanner's frame out of the fields."""
    if is_cartesian:
        return np.stack([fields.pop(name) for name in _CARTESIAN], axis=1)
    radius, azimuth, elevation = (fields.pop(name) for name in _SPHERICAL)
    level = radius * np.cos(elevation)
    return np.stack(
        [level * np.cos(azimuth), level * np.sin(azimuth), radius * np.sin(elevation)], axis=1
    )


def _measured(
    fields: dict[str, Column], is_cartesian: bool, notes: Notes
) -> tuple[NDArray[np.float64], dict[str, Column]]:
    """Coordinates and fields of the points at which anything was measured."""
    invalid = _INVALID[0 if is_cartesian else 1]
    if invalid in fields:
        valid = fields.pop(invalid) == 0
        notes.left_out("that are marked as invalid", int((~valid).sum()), len(valid))
        fields = {name: column[valid] for name, column in fields.items()}
    local = _local(fields, is_cartesian)
    empty = no_returns(local)
    notes.left_out(
        "at exactly 0 0 0 (no returns) in the frame of the scanner", int(empty.sum()), len(local)
    )
    if empty.any():
        local = local[~empty]
        fields = {name: column[~empty] for name, column in fields.items()}
    return local, fields


def _read_scan(path: Path, libe57: Any, image: Any, scan: Any, notes: Notes) -> _Scan:
    points = scan["points"]
    prototype = libe57.StructureNode(points.prototype())
    names = [prototype.get(i).elementName() for i in range(prototype.childCount())]
    nodes = {name: prototype[name] for name in names}
    is_cartesian = set(_CARTESIAN) <= set(names)
    if not is_cartesian and not set(_SPHERICAL) <= set(names):
        raise format_error(path, "a scan has neither Cartesian nor spherical coordinates")
    types = _wanted(path, libe57, nodes, is_cartesian, notes)
    fields = _read_fields(path, libe57, image, points, types)
    local, fields = _measured(fields, is_cartesian, notes)
    has_pose = scan.isDefined("pose")
    rotation, translation = _pose(path, scan, notes) if has_pose else (np.eye(3), np.zeros(3))
    has_sensor = has_pose or not is_cartesian or scan.isDefined("sphericalBounds")
    turned = not np.array_equal(rotation, np.eye(3))
    world = (local @ rotation.T if turned else local) + translation

    colors: Column | None = None
    if set(_COLORS) <= fields.keys():
        invalid = fields.pop(_COLOR_INVALID, np.zeros(len(local))) != 0
        colors = _colors(path, _full_light(scan, nodes), fields, notes)
        if colors is not None:
            colors = _fill_invalid(world, colors, invalid, "colours", notes)
        fields = {name: c for name, c in fields.items() if name not in _COLORS}
    intensities = fields.pop("intensity", None)
    if intensities is not None:
        invalid = fields.pop(_INTENSITY_INVALID, np.zeros(len(local))) != 0
        intensities = _fill_invalid(world, intensities, invalid, "intensities", notes)
    normals: Column | None = None
    if set(_NORMALS) <= fields.keys():
        normals = np.stack([fields[name] for name in _NORMALS], axis=1)
        if is_normals(normals):
            normals = (normals @ rotation.T).astype(np.float32) if turned else normals
            normals = recorded(normals, "normals", notes)
            fields = {name: c for name, c in fields.items() if name not in _NORMALS}
        else:
            normals = None
            notes.remark("the normals of a scan are no unit vectors and are kept as columns")
    extensions = {image.extensionsUri(i) for i in range(image.extensionsCount())}
    return _Scan(
        world,
        colors,
        intensities,
        normals,
        translation if has_sensor else None,
        np.sqrt((local * local).sum(axis=1)) if has_sensor else None,
        _by_own_name(fields, _PREFIX_URI in extensions, notes),
    )


def _joined(parts: Sequence[Column | None], name: str, notes: Notes) -> Column | None:
    """An attribute of all scans; one that only some have goes, which is noted."""
    present = [part for part in parts if part is not None]
    if len(present) == len(parts):
        return np.concatenate(present)
    if present:
        notes.aside(f"{name}, since only {len(present)} of {len(parts)} scans have them")
    return None


def _joined_extra(scans: list[_Scan], notes: Notes) -> dict[str, Column]:
    """The extra columns that all scans have."""
    extra: dict[str, Column] = {}
    for name in dict.fromkeys(name for scan in scans for name in scan.extra):
        column = _joined([scan.extra.get(name) for scan in scans], name, notes)
        if column is not None:
            free = name
            while free in RESERVED_NAMES or free in extra:
                free += "_"
            extra[free] = column
    return extra


@dataclass(frozen=True)
class _File:
    """An open file."""

    path: Path
    libe57: Any
    image: Any
    data: Any
    crs: str | None

    @property
    def n_scans(self) -> int:
        return len(self.data)

    def scan(self, number: int, notes: Notes) -> _Scan:
        """One of the scans."""
        return _read_scan(self.path, self.libe57, self.image, self.data[number], notes)


@contextmanager
def _opened(path: Path, notes: Notes) -> Iterator[_File]:
    """The file, to read its scans; notes what else it holds."""
    _check_header(path)
    libe57 = _pye57().libe57
    with _own_errors(path), np.errstate(over="ignore", invalid="ignore"):
        image = libe57.ImageFile(os.fspath(path), "r")
        try:
            root = image.root()
            if not root.isDefined("data3D"):
                raise format_error(path, "the file has no scans")
            crs = _crs(root, notes)
            if root.isDefined("images2D") and (n_images := root["images2D"].childCount()):
                notes.aside(f"images ({n_images:,})")
            yield _File(path, libe57, image, root["data3D"], crs)
        finally:
            image.close()


def _crs(root: Any, notes: Notes) -> str | None:
    """The coordinate reference system, whose units are noted."""
    if not root.isDefined("coordinateMetadata"):
        return None
    crs = str(root["coordinateMetadata"].value()).strip()
    if crs and (remark := unit_remark(crs)) is not None:
        notes.remark(remark)
    return crs or None


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
        marked as invalid are left out and counted, since nothing was measured there. Where every
        scan has them: colours, intensities and normals; all other fields with numbers are extra
        columns by their names, such as timeStamp (seconds since the scan's start), rowIndex and
        columnIndex.
        Colours are stretched from the limits that the file states, or from the bounds of their
        fields. Points whose colour or intensity is marked as invalid get that of the nearest point
        with a valid one. Viewpoints (row i is scan i of those with points) and ranges are the
        scans' own origins and the distances to these, if every scan tells its origin by a pose,
        spherical coordinates or spherical bounds. `crs` is the file's coordinateMetadata.

    Raises
    ------
    FormatError
        The file is not E57, is truncated or damaged.
    MissingDependencyError
        pye57 is not installed.

    Warns
    -----
    DroppedPointsWarning
        Points are not finite, marked as invalid, or no returns (exactly 0 0 0 in the scanner's
        frame).
    LostAttributeWarning
        An attribute was left out because only some of the scans have it; images and texts are left
        aside; colours or intensities were filled; a pose has the quaternion 0 0 0 0; coordinates
        are not in metres.
    """
    notes = Notes(path)
    with _opened(path, notes) as file:
        scans = [file.scan(i, notes) for i in range(file.n_scans)]
    scans = [scan for scan in scans if len(scan.points)] or scans[:1]
    if not scans:
        raise format_error(path, "the file has no scans")
    origins = [scan.viewpoint for scan in scans if scan.viewpoint is not None]
    ranges = _joined([scan.ranges for scan in scans], "ranges", notes)
    index = np.repeat(np.arange(len(scans), dtype=np.uint32), [len(s.points) for s in scans])
    return build_cloud(
        path,
        np.concatenate([scan.points for scan in scans]),
        colors=_joined([scan.colors for scan in scans], "colours", notes),
        intensities=_joined([scan.intensities for scan in scans], "intensities", notes),
        normals=_joined([scan.normals for scan in scans], "normals", notes),
        ranges=ranges,
        viewpoints=None if ranges is None else np.stack(origins),
        viewpoint_index=None if ranges is None else index,
        extra=_joined_extra(scans, notes),
        crs=file.crs,
        notes=notes,
    )


@dataclass
class _Common:
    """What is known of all scans with points."""

    n_scans: int = 0
    n_with: dict[str, int] = dataclasses.field(default_factory=dict)
    """How many scans have an attribute."""
    types: dict[str, np.dtype[Any]] = dataclasses.field(default_factory=dict)
    """Of extra columns, wide enough for all scans."""
    facts: NoReturnFacts = dataclasses.field(default_factory=NoReturnFacts)

    def add(self, scan: _Scan) -> None:
        """Adds a scan, if it has points."""
        if not len(scan.points):
            return
        self.n_scans += 1
        self.facts.add(scan.points)
        has = {what: getattr(scan, name) is not None for name, what in _ATTRIBUTES.items()}
        for what in (*(what for what in has if has[what]), *scan.extra):
            self.n_with[what] = self.n_with.get(what, 0) + 1
        for name, column in scan.extra.items():
            self.types[name] = np.result_type(self.types.get(name, column.dtype), column.dtype)

    def note(self, notes: Notes) -> None:
        """Notes which attributes go, since only some scans have them."""
        for what, n in self.n_with.items():
            if n < self.n_scans:
                notes.aside(f"{what}, since only {n} of {self.n_scans} scans have them")

    def given(self, scan: _Scan, part: slice) -> dict[str, Any]:
        """The attributes that all scans have of a part of one."""
        given: dict[str, Any] = {}
        for name, what in _ATTRIBUTES.items():
            if self.n_with.get(what, 0) == self.n_scans:
                given[name] = getattr(scan, name)[part]
        if "ranges" in given and scan.viewpoint is not None:
            given["viewpoints"] = scan.viewpoint[None]
            given["viewpoint_index"] = np.zeros(len(given["ranges"]), np.uint32)
        extra: dict[str, Column] = {}
        for name, dtype in self.types.items():
            if self.n_with[name] == self.n_scans:
                free = name
                while free in RESERVED_NAMES or free in extra:
                    free += "_"
                extra[free] = scan.extra[name][part].astype(dtype, copy=False)
        return given | {"extra": extra}


def read_e57_chunks(path: Path, n: int) -> Iterator[PointCloud]:
    """The scans of a file as clouds of at most `n` points, with the points and attributes of
    `read_e57` in its order; one scan is in memory at a time.

    A file of several scans is read twice: first for what all of them have.

    Raises
    ------
    FormatError, MissingDependencyError
        As `read_e57`.
    """
    notes, common = HeldNotes(path), _Common()
    with _opened(path, HeldNotes(path)) as file:
        n_scans, crs = file.n_scans, file.crs
        if not n_scans:
            raise format_error(path, "the file has no scans")
        for i in range(n_scans if n_scans > 1 else 0):
            common.add(file.scan(i, HeldNotes(path)))
    for i in range(n_scans):
        # A bounded time in the package's hands: what is done with a cloud is none of its errors.
        with _opened(path, notes) as file:
            scan = file.scan(i, notes)
        if n_scans == 1:
            common.add(scan)
        for start in range(0, len(scan.points), n):
            part = slice(start, start + n)
            given = common.given(scan, part)
            yield build_cloud(
                path, scan.points[part], crs=crs, notes=notes, facts=common.facts, **given
            )
    common.note(notes)
    notes.release()


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

    def root(self, crs: str | None) -> Any:
        """Fills in the root and gives back its list of scans."""
        libe57, root = self.libe57, self.image.root()
        scans = libe57.VectorNode(self.image, True)
        root.set("formatName", self.text("ASTM E57 3D Imaging Data File"))
        root.set("guid", self.guid())
        root.set("versionMajor", libe57.IntegerNode(self.image, libe57.E57_FORMAT_MAJOR))
        root.set("versionMinor", libe57.IntegerNode(self.image, libe57.E57_FORMAT_MINOR))
        root.set("e57LibraryVersion", self.text(libe57.E57_LIBRARY_ID))
        root.set("coordinateMetadata", self.text(crs or ""))
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
                # Its bounds are 64 bits with a sign.
                low, high = np.iinfo(column.dtype).min, np.iinfo(column.dtype).max
                node = self.integer(0, int(low), int(min(high, 2**63 - 1)))
            prototype.set(name, node)
        points = libe57.CompressedVectorNode(
            self.image, prototype, libe57.VectorNode(self.image, True)
        )
        scan.set("points", points)
        scans.append(scan)
        n = len(columns[_CARTESIAN[0]])
        capacity = max(1, min(n, _POINTS_AT_A_TIME))
        # Of integers of more than 16 bits the library takes C's `long long` as they are.
        wide = (np.int32, np.uint32, np.int64, np.uint64)
        arrays = {
            name: np.empty(capacity, np.longlong if c.dtype in wide else c.dtype)
            for name, c in columns.items()
        }
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


def _extra_names(cloud: PointCloud) -> tuple[dict[str, str], list[str]]:
    """The field of each extra column, and the columns that no field holds.

    Columns with names of the standard are its fields where their type is that of these.
    """
    names: dict[str, str] = {}
    lost: list[str] = []
    for name, values in cloud.extra.items():
        if values.dtype == np.uint64 and len(values) and values.max() > 2**63 - 1:
            lost.append(f"{name}, which has integers beyond 2^63 - 1")
            continue
        kind = values.dtype.kind
        if (name in _STANDARD_FLOATS and kind == "f") or (
            name in _STANDARD_INTEGERS and kind in "iu"
        ):
            names[name] = name
            continue
        local = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
        local = local if re.match("[A-Za-z_]", local) else f"_{local}"
        while f"{_PREFIX}:{local}" in names.values():
            local += "_"
        names[name] = f"{_PREFIX}:{local}"
    return names, lost


def _columns(
    cloud: PointCloud, which: Column | slice, shift: Column | None, names: Mapping[str, str]
) -> dict[str, Column]:
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
    extra = cloud.extra
    for name, field in names.items():
        columns[field] = extra[name][which]
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
    float. Extra columns keep their types, unsigned integers of 64 bits with a sign.

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
        The cloud has ranges that are not the distances to its viewpoints: E57 derives them;
        integers beyond 2^63 - 1; or columns with names that no field can have, which were changed.
    """
    libe57 = _pye57().libe57
    seed = hashlib.sha256(np.ascontiguousarray(cloud.local_points).tobytes()).digest()
    with written_whole(path) as temporary:
        writer = _Writer(libe57, temporary, seed)
        try:
            if cloud.normals is not None:
                writer.image.extensionsAdd("nor", _NORMAL_URI)
            names, lost = _extra_names(cloud)
            if any(field.startswith(f"{_PREFIX}:") for field in names.values()):
                writer.image.extensionsAdd(_PREFIX, _PREFIX_URI)
            scans = writer.root(cloud.crs)
            for number, (which, viewpoint) in enumerate(_groups(cloud), 1):
                columns = _columns(cloud, which, viewpoint, names)
                scan = writer.scan(columns, viewpoint, f"Scan {number}")
                writer.points(scans, scan, columns)
        finally:
            writer.image.close()
    renamed = {name: field.removeprefix(f"{_PREFIX}:") for name, field in names.items()}
    warn_lost(path, "E57", [*_lost(cloud), *lost], renamed=renamed)
