"""LAS and LAZ, the exchange formats of airborne and mobile scanning, through laspy (and lazrs)."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from surfabet._core import PointCloud
from surfabet.errors import FormatError, InvalidInputError, LostAttributeWarning
from surfabet.io._columns import (
    KNOWN_NAMES,
    Column,
    cloud_from_columns,
    warn_lost,
)
from surfabet.io._files import format_error, optional_module, warn, written_whole
from surfabet.io._laz import check_chunks

_BYTES_AT_A_TIME = 1 << 24
# LAZ packs real scans to a tenth; a claim of this much more is false.
_LARGEST_COMPRESSION = 5_000
_SMALLEST_HEADER = 227
_LARGEST_INTENSITY = 65_535
_NORMALS = ("NormalX", "NormalY", "NormalZ")
_RANGE = "Range"


def _laspy() -> Any:
    optional_module("lazrs", "laspy[lazrs]>=2.5", "reading and writing LAZ files")
    return optional_module("laspy", "laspy[lazrs]>=2.5", "reading and writing LAS and LAZ files")


def _check_extended(path: Path, start: int, count: int) -> None:
    """Walks the extended records, whose lengths are 64 bits wide."""
    size = path.stat().st_size
    at = start
    with path.open("rb") as file:
        for number in range(count):
            file.seek(min(at, size))
            header = file.read(60)
            length = struct.unpack_from("<Q", header, 20)[0] if len(header) == 60 else size
            if at + 60 + length > size:
                raise format_error(
                    path, f"extended record {number} of {count} does not fit into the file", byte=at
                )
            at += 60 + length


def _check_header(path: Path) -> None:
    """Holds the sizes in the header against the size of the file, before anything is allocated."""
    size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(375)
    if not header.startswith(b"LASF"):
        raise format_error(path, "not a LAS file: it must begin with 'LASF'", byte=0)
    if len(header) < _SMALLEST_HEADER:
        raise format_error(path, "the file ends inside the header", byte=len(header))
    minor = header[25]
    header_size, points_at, n_records = struct.unpack_from("<HII", header, 94)
    format_id, record_size, n_points = struct.unpack_from("<BHI", header, 104)
    if header_size < _SMALLEST_HEADER or not header_size <= points_at <= size:
        raise format_error(
            path,
            f"the header has {header_size} bytes and points begin at {points_at} of {size} bytes",
            byte=94,
        )
    if n_records * 54 > points_at - header_size:
        raise format_error(path, f"{n_records} variable records do not fit in front", byte=100)
    if minor >= 4:
        if header_size < 375 or len(header) < 375:
            raise format_error(path, f"a header of {header_size} bytes is none of LAS 1.4", byte=94)
        extended_at, n_extended, n_points_64 = struct.unpack_from("<QIQ", header, 235)
        n_points = n_points_64 or n_points
        _check_extended(path, extended_at, n_extended)
    room = size - points_at
    if format_id & 0xC0:
        room *= _LARGEST_COMPRESSION
    if record_size == 0 or n_points * record_size > room:
        raise format_error(
            path,
            f"the header promises {n_points} points of {record_size} bytes, but the file has "
            f"{size - points_at} bytes left for them",
            byte=105,
        )
    if format_id & 0xC0:
        check_chunks(
            path,
            header_size=header_size,
            points_at=points_at,
            n_records=n_records,
            n_points=n_points,
        )


@contextmanager
def _own_errors(path: Path) -> Iterator[None]:
    """What laspy and lazrs raise for broken files, as our error."""
    try:
        yield
    except (FormatError, InvalidInputError, MemoryError):
        raise
    except Exception as error:
        raise format_error(path, f"cannot be read as LAS or LAZ: {error}") from error
    except BaseException as error:
        # A panic in lazrs arrives as a BaseException of its own.
        if type(error).__name__ != "PanicException":
            raise
        raise format_error(path, f"corrupt compressed points: {error}") from error


def _linear_unit(text: str) -> str | None:
    """The unit of the coordinates where WKT gives another one than the metre."""
    units = re.findall(r'UNIT\["([^"]{1,60})",\s*([0-9.eE+-]{1,40})', text)
    if not units:
        return None
    name, factor = units[-1]
    try:
        in_metres = float(factor)
    except ValueError:
        return None
    # Degrees are 0.017 radians; a system without a linear unit has no other.
    return None if in_metres == 1 else f"{name} ({in_metres:g})"


def _crs(header: Any) -> str | None:
    """The name of the coordinate reference system, with its unit if that is not the metre."""
    wkt = name = None
    for record in [*header.vlrs, *(header.evlrs or [])]:
        kind = type(record).__name__
        if kind == "WktCoordinateSystemVlr":
            wkt = str(record.string)
        elif kind == "GeoAsciiParamsVlr":
            name = "".join(record.strings).split("|")[0].strip("\0 ") or name
        elif kind == "GeoKeyDirectoryVlr":
            name = name or "GeoTIFF keys"
    if wkt and (found := re.search(r'(?:PROJCS|PROJCRS|COMPD_CS|GEOGCS)\["([^"]{1,120})"', wkt)):
        name = found.group(1)
    if name is None:
        return None
    unit = _linear_unit(wkt or "")
    return f"{name}, unit {unit}" if unit else name


def _read_chunks(path: Path, laspy: Any) -> tuple[dict[str, Column], str | None]:
    parts: dict[str, list[Column]] = {}
    # The sequential decoder trusts less of the file than the parallel one.
    with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs) as reader:
        header = reader.header
        if not np.isfinite([*header.scales, *header.offsets]).all():
            raise format_error(path, "scale or offset are not finite", byte=131)
        at_a_time = max(1, _BYTES_AT_A_TIME // header.point_format.size)
        names = set(header.point_format.dimension_names)
        # Lower-case names of what a cloud can hold, and the names in the file.
        extra = {
            name.lower(): name
            for name in header.point_format.extra_dimension_names
            if name.lower() in KNOWN_NAMES - {"x", "y", "z", "viewpoint_index"}
        }
        wanted = {name: name for name in ("x", "y", "z", "intensity")} | extra
        if {"red", "green", "blue"} <= names:
            wanted |= {name: name for name in ("red", "green", "blue")}
        for points in reader.chunk_iterator(at_a_time):
            for name, dimension in wanted.items():
                parts.setdefault(name, []).append(np.array(points[dimension]))
        found = sum(len(part) for part in parts.get("x", []))
        if found != header.point_count:
            raise format_error(path, f"the file ends after {found} of {header.point_count} points")
        crs = _crs(header)
        columns = {name: np.concatenate(parts.pop(name, [np.empty(0)])) for name in wanted}
    return columns, crs


def read_las(path: Path) -> PointCloud:
    """Reads a LAS or LAZ file.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        Positions; colours (16 bits, or 8 bits in fields of 16 where none is larger than 255);
        intensity, unless it is 0 everywhere, which means that it was not recorded; and from extra
        dimensions normals (NormalX, NormalY, NormalZ) and range. Other dimensions are left aside.
        Coordinates are as in the file, whatever the unit of its coordinate reference system.

    Raises
    ------
    FormatError
        The file is not LAS, is truncated or damaged.
    MissingDependencyError
        laspy or lazrs is not installed.

    Warns
    -----
    LostAttributeWarning
        The file has a coordinate reference system; the message names it, and its unit if not
        metres.
    """
    _check_header(path)
    laspy = _laspy()
    with _own_errors(path), np.errstate(over="ignore", invalid="ignore"):
        columns, crs = _read_chunks(path, laspy)
    if not columns["intensity"].any():
        del columns["intensity"]
    cloud = cloud_from_columns(path, columns)
    if crs is not None:
        warn(
            f"{path}: coordinates are kept as they are, but not their reference system ({crs})",
            LostAttributeWarning,
        )
    return cloud


def _scale_for(cloud: PointCloud, scale: float) -> float:
    """The scale, made coarser by powers of ten until every coordinate fits in 32 bits."""
    largest = float(np.abs(cloud.local_points).max()) if len(cloud) else 0.0
    while largest > (2**31 - 1) * scale:
        scale *= 10
    return scale


def _stored_intensities(path: Path, intensities: Column) -> Column:
    """As they are where 16 bits hold them, else stretched to 0..65535, which is said."""
    if len(intensities) == 0:
        return intensities.astype(np.uint16)
    low, high = float(intensities.min()), float(intensities.max())
    fits = low >= 0 and high <= _LARGEST_INTENSITY
    if fits and (intensities == np.rint(intensities)).all():
        return intensities.astype(np.uint16)
    low = min(low, 0.0)
    factor = _LARGEST_INTENSITY / (high - low) if high > low else 1.0
    warn(
        f"{path}: LAS files hold intensities as integers of 16 bits; {low:g} to {high:g} were "
        f"stretched to 0 to {_LARGEST_INTENSITY}",
        LostAttributeWarning,
    )
    return np.rint((intensities.astype(np.float64) - low) * factor).astype(np.uint16)


def write_las(path: Path, cloud: PointCloud, *, scale: float = 1e-4) -> None:
    """Writes a LAS 1.4 file, compressed (LAZ) if the suffix is `.laz`.

    Parameters
    ----------
    path
        The file, replaced in one piece.
    cloud
        What to write. Offsets are the cloud's origin. Colours are stretched to 16 bits (times 257),
        normals and ranges are float32 extra dimensions (NormalX, NormalY, NormalZ, Range).
        Intensities that are not integers from 0 to 65535 are stretched to these, with a warning.
    scale
        Metres per unit of the integer coordinates. It is made coarser by powers of ten where the
        cloud does not fit: the default of 0.1 mm holds 214 km to each side of the origin.

    Raises
    ------
    InvalidInputError
        `scale` is not positive.
    MissingDependencyError
        laspy or lazrs is not installed.

    Warns
    -----
    LostAttributeWarning
        The cloud has viewpoints, which LAS cannot hold, or intensities that had to be stretched.
    """
    if not (np.isfinite(scale) and scale > 0):
        raise InvalidInputError(f"scale is {scale}, but must be a positive length in metres")
    laspy = _laspy()
    header = laspy.LasHeader(version="1.4", point_format=7 if cloud.colors is not None else 6)
    header.offsets = np.array(cloud.origin)
    header.scales = np.full(3, _scale_for(cloud, scale))
    header.generating_software = "surfabet"
    header.creation_date = None
    extra: dict[str, Column] = {}
    if (normals := cloud.normals) is not None:
        extra |= {name: normals[:, a] for a, name in enumerate(_NORMALS)}
    if (ranges := cloud.ranges) is not None:
        extra[_RANGE] = ranges
    header.add_extra_dims([laspy.ExtraBytesParams(name=name, type=np.float32) for name in extra])
    points = laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header)
    for axis, name in enumerate("XYZ"):
        local = cloud.local_points[:, axis].astype(np.float64)
        points[name] = np.rint(local / header.scales[axis]).astype(np.int32)
    points["return_number"] = np.ones(len(cloud), np.uint8)
    points["number_of_returns"] = np.ones(len(cloud), np.uint8)
    if (intensities := cloud.intensities) is not None:
        points["intensity"] = _stored_intensities(path, intensities)
    if (colors := cloud.colors) is not None:
        for axis, name in enumerate(("red", "green", "blue")):
            points[name] = colors[:, axis].astype(np.uint16) * 257
    for name, column in extra.items():
        points[name] = column
    with written_whole(path) as temporary:
        compress = path.suffix.lower() == ".laz"
        with laspy.open(
            os.fspath(temporary),
            mode="w",
            header=header,
            do_compress=compress,
            laz_backend=laspy.LazBackend.LazrsParallel if compress else None,
        ) as writer:
            writer.write_points(points)
    if cloud.viewpoints is not None:
        warn_lost(path, "LAS", ["viewpoints"])
