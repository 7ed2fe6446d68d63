"""LAS and LAZ, the exchange formats of airborne and mobile scanning, through laspy (and lazrs)."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.errors import FormatError, InvalidInputError, wrong_value
from surfabet.io._columns import (
    Column,
    add_columns,
    cloud_from_columns,
    lists_of,
    warn_lost,
)
from surfabet.io._crs import (
    crs_of_keys,
    directory_of,
    geotiff_keys,
    parse_directory,
    unit_remark,
)
from surfabet.io._files import format_error, optional_module, written_whole
from surfabet.io._laz import check_chunks
from surfabet.io._notes import Notes

_BYTES_AT_A_TIME = 1 << 24
# LAZ packs real scans to a tenth; a claim of this much more is false.
_LARGEST_COMPRESSION = 5_000
_SMALLEST_HEADER = 227
_LARGEST_INTENSITY = 65_535
_NORMALS = ("NormalX", "NormalY", "NormalZ")
_RANGE = "Range"
_COLORS = ("red", "green", "blue")
# How the standard has colours of 8 bits in fields of 16.
_COLOR_STEP = 256
_WAVEFORM = (
    "wavepacket_index",
    "wavepacket_offset",
    "wavepacket_size",
    "return_point_wave_location",
    "x_t",
    "y_t",
    "z_t",
)
# One of one in all files of single returns.
_RETURNS = ("return_number", "number_of_returns")
_NOISE = {7: "low noise", 18: "high noise"}
_PROJECTION = "LASF_Projection"
# An older library has a name of its own for the record of WKT.
_LIBLAS = "liblas"
_WKT = 2112
_GEOTIFF = (34735, 34736, 34737)
_READ_RECORDS = {
    ("LASF_Spec", 4),
    ("laszip encoded", 22204),
    ("copc", 1),
    ("copc", 1000),
    (_LIBLAS, _WKT),
}
_LONGEST_RECORD = 65_535
# The record of extra dimensions has 192 bytes for each.
_MOST_EXTRA = _LONGEST_RECORD // 192
_LONGEST_NAME = 32
# Degrees per step of the angle in point formats 6 and up.
_ANGLE_STEP = 0.006
# Seconds; times of more are counted from an epoch.
_WEEK = 7 * 24 * 3600


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


def _crs(header: Any) -> str | None:
    """The coordinate reference system: WKT where there is one, else of the GeoTIFF keys."""
    wkt: str | None = None
    data: dict[int, bytes] = {}
    for record in [*header.vlrs, *(header.evlrs or [])]:
        if (user := record.user_id.strip("\0 ")) not in (_PROJECTION, _LIBLAS):
            continue
        if record.record_id == _WKT:
            wkt = bytes(record.record_data_bytes()).decode("utf-8", "replace").strip("\0 ") or wkt
        elif record.record_id in _GEOTIFF and user == _PROJECTION:
            data[record.record_id] = bytes(record.record_data_bytes())
    if wkt is not None or _GEOTIFF[0] not in data:
        return wkt
    return crs_of_keys(parse_directory(*(data.get(number, b"") for number in _GEOTIFF)))


def _note_records(header: Any, notes: Notes) -> None:
    """Notes which of the file's variable records are not read."""
    for record in [*header.vlrs, *(header.evlrs or [])]:
        user = record.user_id.strip("\0 ")
        if (user, record.record_id) in _READ_RECORDS or user == _PROJECTION:
            continue
        notes.aside(f"record {user} {record.record_id}")


def _check_classes(name: str, classes: Sequence[int] | None) -> list[int] | None:
    if classes is None:
        return None
    found = [classes] if isinstance(classes, int) else list(classes)
    for one in found:
        if not (isinstance(one, (int, np.integer)) and 0 <= one <= 255):
            raise wrong_value(name, classes, "integers from 0 to 255")
    return [int(one) for one in found]


LasPoints = tuple[Any, Iterable[Any], int | None]
"""The header of a file, its points in parts, and how many these must be."""


@dataclass(frozen=True)
class LasChoice:
    """Which points of a file are read."""

    keep_noise: bool
    keep_class: list[int] | None
    drop_class: list[int] | None

    @classmethod
    def of(
        cls,
        keep_noise: bool,
        keep_class: Sequence[int] | None,
        drop_class: Sequence[int] | None,
    ) -> LasChoice:
        """By the options of `read_las`, which are checked."""
        return cls(
            keep_noise,
            _check_classes("keep_class", keep_class),
            _check_classes("drop_class", drop_class),
        )

    def mask(self, points: Any, counts: dict[str, int]) -> NDArray[np.bool_] | None:
        """The points to keep, `None` for all; adds to the counts of those left out."""
        left: dict[str, NDArray[np.bool_]] = {}
        classes = np.array(points["classification"])
        if not self.keep_noise:
            left["withheld"] = np.array(points["withheld"]) != 0
            noise = [c for c in _NOISE if c not in (self.keep_class or ())]
            left |= {f"of class {c} ({_NOISE[c]})": classes == c for c in noise}
        if self.drop_class is not None:
            left["of classes in drop_class"] = np.isin(classes, self.drop_class)
        if self.keep_class is not None:
            left["of classes that keep_class does not name"] = ~np.isin(classes, self.keep_class)
        keep = np.ones(len(classes), bool)
        for reason, mask in left.items():
            counts[reason] = counts.get(reason, 0) + int(mask.sum())
            keep &= ~mask
        return None if keep.all() else keep


def _wanted(point_format: Any, notes: Notes) -> dict[str, str]:
    """The columns to read, by the names of their dimensions."""
    names = list(point_format.standard_dimension_names)
    if waveform := [name for name in names if name in _WAVEFORM]:
        notes.aside(f"waveforms ({', '.join(waveform)})")
    wanted = {"x": "x", "y": "y", "z": "z"}
    wanted |= {name: name for name in names if name not in ("X", "Y", "Z", *waveform)}
    for name in point_format.extra_dimension_names:
        if name in wanted:
            notes.aside(f"extra dimension {name}, the name of a standard one")
        else:
            wanted[name] = name
    return wanted


def _without_defaults(columns: dict[str, Column], standard: set[str]) -> dict[str, Column]:
    """The columns without standard dimensions that are there by the point format alone."""
    returns = [columns[name] for name in _RETURNS if name in columns]
    if returns and all((values == 1).all() for values in returns):
        columns = {name: c for name, c in columns.items() if name not in _RETURNS}
    optional = standard - {*_COLORS, *_RETURNS}
    return {name: c for name, c in columns.items() if name not in optional or c.any()}


@contextmanager
def _all_points(path: Path, laspy: Any) -> Iterator[LasPoints]:
    """The header and all points of a file, in parts."""
    # The sequential decoder trusts less of the file than the parallel one.
    with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs) as reader:
        at_a_time = max(1, _BYTES_AT_A_TIME // reader.header.point_format.size)
        yield reader.header, reader.chunk_iterator(at_a_time), reader.header.point_count


def _collected(
    path: Path, points: LasPoints, choice: LasChoice, notes: Notes
) -> tuple[dict[str, Column], str | None]:
    """The columns of the points that were chosen, and the coordinate reference system."""
    parts: dict[str, list[Column]] = {}
    counts: dict[str, int] = {}
    header, chunks, expected = points
    if not np.isfinite([*header.scales, *header.offsets]).all():
        raise format_error(path, "scale or offset are not finite", byte=131)
    wanted = _wanted(header.point_format, notes)
    found = 0
    for chunk in chunks:
        found += len(chunk)
        keep = choice.mask(chunk, counts)
        for name in wanted:
            values = np.array(chunk[name])
            parts.setdefault(name, []).append(values if keep is None else values[keep])
    if expected is not None and found != expected:
        raise format_error(path, f"the file ends after {found} of {expected} points")
    crs = _crs(header)
    _note_records(header, notes)
    standard = set(header.point_format.standard_dimension_names)
    kept = sum(map(len, parts.get("x", [])))
    if kept < found:
        # A point may be counted for several reasons.
        reasons = ", ".join(f"{count:,} {reason}" for reason, count in counts.items() if count)
        if sum(counts.values()) > found - kept:
            reasons += ", some for several of these reasons"
        notes.points(f"left out {found - kept:,} of {found:,} points: {reasons}", found - kept)
    columns: dict[str, Column] = {}
    dark = not any(part.any() for name in _COLORS for part in parts.get(name, []))
    if found and set(_COLORS) <= wanted.keys() and dark:
        notes.aside("colours, which are 0 everywhere")
        wanted = {name: dimension for name, dimension in wanted.items() if name not in _COLORS}
    for name in wanted:
        values = np.concatenate(parts.pop(name, [np.empty(0)]))
        named = lists_of(name, values, notes) if values.ndim == 2 else {name: values}
        add_columns(columns, named, notes)
    return _without_defaults(columns, standard), crs


def read_las_points(
    path: Path,
    open_points: Callable[[Path, Any], AbstractContextManager[LasPoints]],
    choice: LasChoice,
) -> PointCloud:
    """The cloud of the points that `open_points` gives for a file and the package laspy."""
    _check_header(path)
    laspy = _laspy()
    notes = Notes(path)
    with (
        _own_errors(path),
        np.errstate(over="ignore", invalid="ignore"),
        open_points(path, laspy) as points,
    ):
        columns, crs = _collected(path, points, choice, notes)
    if crs is not None and (remark := unit_remark(crs)) is not None:
        notes.remark(remark)
    return cloud_from_columns(path, columns, crs=crs, notes=notes)


def read_las_chunks(path: Path, n: int) -> Iterator[PointCloud]:
    """The points of a file as clouds of at most `n`, in its order; noise and withheld points are
    left out as by `read_las`. A column that is 0 in all points of a chunk is not in its cloud.

    Raises
    ------
    FormatError, MissingDependencyError
        As `read_las`.
    """
    _check_header(path)
    laspy = _laspy()
    choice = LasChoice.of(False, None, None)
    found = 0
    with (
        _own_errors(path),
        np.errstate(over="ignore", invalid="ignore"),
        laspy.open(path, laz_backend=laspy.LazBackend.Lazrs) as reader,
    ):
        for chunk in reader.chunk_iterator(n):
            found += len(chunk)
            notes = Notes(path)
            points = (reader.header, iter([chunk]), None)
            columns, crs = _collected(path, points, choice, notes)
            is_first = found == len(chunk)
            if is_first and crs is not None and (remark := unit_remark(crs)) is not None:
                notes.remark(remark)
            yield cloud_from_columns(path, columns, crs=crs, notes=notes)
        if found != reader.header.point_count:
            total = reader.header.point_count
            raise format_error(path, f"the file ends after {found} of {total} points")


def read_las(
    path: Path,
    *,
    keep_noise: bool = False,
    keep_class: Sequence[int] | None = None,
    drop_class: Sequence[int] | None = None,
) -> PointCloud:
    """Reads a LAS or LAZ file.

    Parameters
    ----------
    path
        The file.
    keep_noise
        Keep points that are marked as withheld and points of the noise classes 7 and 18. They are
        no surface, and are left out otherwise.
    keep_class
        Keep only points of these classes. A noise class that is named is kept.
    drop_class
        Leave out points of these classes.

    Returns
    -------
    PointCloud
        Positions; colours (16 bits, or 8 bits in fields of 16 where hardly any is larger than 255);
        intensity; and from extra dimensions normals (NormalX, NormalY, NormalZ) and range. All
        other dimensions are extra columns by their names: classification, gps_time,
        return_number, number_of_returns, scan_angle (steps of 0.006 degrees) or scan_angle_rank
        (degrees), user_data, point_source_id, nir, the flags synthetic, key_point, withheld,
        overlap, scanner_channel, scan_direction_flag and edge_of_flight_line, and the file's own
        extra dimensions. A standard dimension that is 0 everywhere was not recorded and is not
        there; return numbers are not where all returns are the first of one. `crs` is WKT, or
        `EPSG:n` from GeoTIFF keys. Coordinates are as in the file, whatever the unit of its
        reference system.

    Raises
    ------
    FormatError
        The file is not LAS, is truncated or damaged.
    InvalidInputError
        A class is no integer from 0 to 255.
    MissingDependencyError
        laspy or lazrs is not installed.

    Warns
    -----
    DroppedPointsWarning
        Points were left out: withheld, noise, or of classes that were not wanted.
    LostAttributeWarning
        Coordinates are not in metres, horizontally or vertically (both units are named); colours
        are 0 everywhere; the file has waveforms or records that are left aside.
    """
    return read_las_points(path, _all_points, LasChoice.of(keep_noise, keep_class, drop_class))


def _scale_for(cloud: PointCloud, scale: float) -> float:
    """The scale, made coarser by powers of ten until every coordinate fits in 32 bits."""
    largest = float(np.abs(cloud.local_points).max()) if len(cloud) else 0.0
    while largest > (2**31 - 1) * scale:
        scale *= 10
    return scale


def _stored_intensities(intensities: Column, remarks: list[str]) -> Column:
    """Rounded where 16 bits hold them, as models give fractions of what was whole; else, and where
    they are shares of 1, stretched to 0..65535, which is remarked."""
    if len(intensities) == 0:
        return intensities.astype(np.uint16)
    low, high = float(intensities.min()), float(intensities.max())
    whole = np.rint(intensities)
    fits = low >= 0 and high <= _LARGEST_INTENSITY
    if fits and (high > 1 or (intensities == whole).all()):
        return whole.astype(np.uint16)
    low = min(low, 0.0)
    factor = _LARGEST_INTENSITY / (high - low) if high > low else 1.0
    remarks.append(
        f"LAS files hold intensities as integers of 16 bits; {low:g} to {high:g} were stretched to "
        f"0 to {_LARGEST_INTENSITY}"
    )
    return np.rint((intensities.astype(np.float64) - low) * factor).astype(np.uint16)


def _fits(dimension: Any, values: Column) -> bool:
    """Whether a standard dimension holds these values as they are."""
    if dimension.kind.name == "FloatingPoint" or len(values) == 0:
        return True
    if not (values.min() >= dimension.min and values.max() <= dimension.max):
        return False
    return values.dtype.kind in "iu" or bool((values == np.rint(values)).all())


def _point_format(laspy: Any, cloud: PointCloud) -> Any:
    """The point format that holds what is there: 6 to 8, or 0 to 3 where these must be.

    Formats 0 to 3 have angles in degrees, and only they have GeoTIFF keys.
    """
    extra, has_colors = cloud.extra, cloud.colors is not None
    modern = {"nir", "overlap", "scanner_channel", "scan_angle"}
    has_keys = cloud.crs is not None and geotiff_keys(cloud.crs) is not None
    if ("scan_angle_rank" in extra or has_keys) and not modern & extra.keys():
        legacy = laspy.PointFormat(2 * has_colors + ("gps_time" in extra))
        names = set(legacy.standard_dimension_names) & extra.keys()
        if all(_fits(legacy.dimension_by_name(name), extra[name]) for name in names):
            return legacy
    if "nir" in extra:
        return laspy.PointFormat(8)
    return laspy.PointFormat(7 if has_colors else 6)


@dataclass
class _Fields:
    """What is written beside coordinates, colours and intensities."""

    standard: dict[str, Column]
    own: dict[str, Column]
    renamed: dict[str, str]
    lost: list[str]
    remarks: list[str]


def _fields(cloud: PointCloud, point_format: Any) -> _Fields:
    """Extra columns as standard dimensions of the format where they fit, else as extra ones."""
    fields = _Fields({}, {}, {}, [], [])
    if (normals := cloud.normals) is not None:
        fields.own |= {name: normals[:, a] for a, name in enumerate(_NORMALS)}
    if (ranges := cloud.ranges) is not None:
        fields.own[_RANGE] = ranges
    names = set(point_format.standard_dimension_names)
    free = names - {"X", "Y", "Z", "intensity", *_COLORS, *_WAVEFORM}
    extra = cloud.extra
    for name, values in extra.items():
        if name == "scan_angle_rank" and name not in names and "scan_angle" not in extra:
            angles = np.rint(values.astype(np.float64) / _ANGLE_STEP)
            if _fits(point_format.dimension_by_name("scan_angle"), angles):
                fields.standard["scan_angle"] = angles
                continue
        if name in free and _fits(point_format.dimension_by_name(name), values):
            fields.standard[name] = values
            continue
        written = name.encode("utf-8")[:_LONGEST_NAME].decode("utf-8", "ignore").strip("\0")
        while written in names | {"x", "y", "z", ""} or written in fields.own:
            cut = written.encode("utf-8")[: _LONGEST_NAME - 1].decode("utf-8", "ignore")
            written = cut + "_" if cut + "_" != written else f"column {len(fields.own)}"
        if len(fields.own) == _MOST_EXTRA:
            fields.lost.append(name)
            continue
        fields.renamed[name] = written
        fields.own[written] = values
    return fields


def _projection(laspy: Any, header: Any, crs: str | None) -> list[str]:
    """Adds the records of a coordinate reference system; gives back what cannot be held."""
    if crs is None:
        return []
    keys = geotiff_keys(crs)
    if keys is None:
        wkt = crs.encode("utf-8") + b"\0"
        if len(wkt) > _LONGEST_RECORD:
            return [f"a coordinate reference system of {len(wkt):,} bytes of WKT"]
        records = {_WKT: wkt}
    else:
        records = dict(zip(_GEOTIFF, directory_of(keys), strict=True))
    # Formats 6 and up must say that they have WKT, whether they have or not.
    header.global_encoding.wkt = keys is None or header.point_format.id >= 6
    for number, data in records.items():
        if data:
            header.vlrs.append(laspy.VLR(_PROJECTION, number, "", data))
    return []


def _points(laspy: Any, header: Any, cloud: PointCloud, fields: _Fields) -> Any:
    """The record of all points."""
    points = laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header)
    for axis, name in enumerate("XYZ"):
        local = cloud.local_points[:, axis].astype(np.float64)
        points[name] = np.rint(local / header.scales[axis]).astype(np.int32)
    one = np.ones(len(cloud), np.uint8)
    standard: dict[str, Column] = {"return_number": one, "number_of_returns": one} | fields.standard
    if (intensities := cloud.intensities) is not None:
        standard["intensity"] = _stored_intensities(intensities, fields.remarks)
    if (colors := cloud.colors) is not None:
        standard |= {
            name: colors[:, a].astype(np.uint16) * _COLOR_STEP for a, name in enumerate(_COLORS)
        }
    for name, column in standard.items():
        dtype = np.dtype(header.point_format.dimension_by_name(name).dtype or np.uint8)
        points[name] = column.astype(dtype)
    for name, column in fields.own.items():
        points[name] = column
    return points


def write_las(path: Path, cloud: PointCloud, *, scale: float = 1e-4) -> None:
    """Writes a LAS 1.4 file, compressed (LAZ) if the suffix is `.laz`.

    Parameters
    ----------
    path
        The file, replaced in one piece.
    cloud
        What to write. Offsets are the cloud's origin. Colours are stretched to 16 bits (times 256),
        normals and ranges are float32 extra dimensions (NormalX, NormalY, NormalZ, Range).
        Intensities from 0 to 65535 are rounded to integers, as those of decoded models are none;
        fractions of at most 1 and what lies outside are stretched to 0..65535, with a warning.
        Extra columns with the name of a standard dimension that holds their values become it, all
        others extra dimensions of their own type. The point format is 6, 7 (colours) or 8 (nir);
        with a column scan_angle_rank, in whole degrees, or with a reference system given by a
        code, it is 0 to 3 if these hold all columns. The coordinate reference system is written as
        WKT, or as GeoTIFF keys where it is a code.
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
        The cloud has viewpoints or more than 341 extra columns, which LAS cannot hold, columns
        whose names are taken or have more than 32 bytes and were changed, or intensities that had
        to be stretched.
    """
    if not (np.isfinite(scale) and scale > 0):
        raise wrong_value("scale", scale, "a positive number of metres")
    laspy = _laspy()
    point_format = _point_format(laspy, cloud)
    fields = _fields(cloud, point_format)
    header = laspy.LasHeader(version="1.4", point_format=point_format)
    header.offsets = np.array(cloud.origin)
    header.scales = np.full(3, _scale_for(cloud, scale))
    header.generating_software = "surfabet"
    header.creation_date = None
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name=name, type=c.dtype) for name, c in fields.own.items()]
    )
    times = fields.standard.get("gps_time")
    if times is not None and len(times) and not 0 <= times.min() <= times.max() <= _WEEK:
        header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    lost = [*fields.lost, *_projection(laspy, header, cloud.crs)]
    points = _points(laspy, header, cloud, fields)
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
        lost.insert(0, "viewpoints")
    warn_lost(path, "LAS", lost, renamed=fields.renamed, remarks=fields.remarks)
