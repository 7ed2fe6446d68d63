"""NPZ and NPY, numpy's own files: NPZ keeps a cloud exactly.

NPZ holds arrays by the names of `PointCloud`: `local_points` (float32, relative to `origin`),
`origin`, `colors`, `intensities`, `normals`, `ranges`, `viewpoints`, `viewpoint_index`, the text
`crs`, and extra columns by their own names. Read are also archives of others: `points`, `xyz`,
`pos` or `coords` (world coordinates, as (n, 3) or structured) or `x`, `y` and `z`, with `rgb`,
`normal`, `intensity` and the like; and archives of a single array, which is taken as NPY.

NPY holds one array: of shape (n, 3), (n, 4), (n, 6), (n, 7) or (n, 9) with columns as in text
files, or structured, with fields by name.
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from surfabet._core import PointCloud
from surfabet.errors import FormatError
from surfabet.io._columns import (
    Column,
    add_columns,
    build_cloud,
    cloud_from_columns,
    lists_of,
)
from surfabet.io._files import format_error, written_whole
from surfabet.io._guess import guess_names
from surfabet.io._notes import Notes

_ATTRIBUTES = ("colors", "intensities", "normals", "ranges", "viewpoints", "viewpoint_index")
# What others call an array of points, and columns that go with it: (n, 3) ones by three names.
_POINTS = (
    "points",
    "xyz",
    "pos",
    "positions",
    "coords",
    "coord",
    "pts",
    "vertices",
    "pointcloud",
    "point_cloud",
    "pc",
    "arr_0",
)
_TRIPLES = {
    "colors": ("red", "green", "blue"),
    "color": ("red", "green", "blue"),
    "rgb": ("red", "green", "blue"),
    "rgba": ("red", "green", "blue", "alpha"),
    "normals": ("nx", "ny", "nz"),
    "normal": ("nx", "ny", "nz"),
}
_NEEDED = frozenset({"local_points", "origin", "x", "y", "z", *_POINTS, *_ATTRIBUTES})
_SINGLES = {"intensities": "intensity", "ranges": "range"}
# Deflate cannot do better, so a larger claim is false.
_LARGEST_DEFLATION = 1100
_MOST_MEMBERS = 1000


def _load_array(path: Path, name: str, file: IO[bytes], size: int) -> Column | None:
    """The array in `size` bytes of NPY, `None` for Python objects; errors call it `name`."""
    try:
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        elif version == (2, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_2_0(file)
        else:
            raise ValueError(f"version {version} is neither (1, 0) nor (2, 0)")
    except Exception as error:
        # The header is a Python literal, which fails in as many ways as Python does.
        raise format_error(path, f"{name} has no NPY header: {error}", byte=0) from error
    if dtype.hasobject:
        return None
    start = file.tell()
    expected = math.prod(shape) * dtype.itemsize
    if any(n < 0 for n in shape) or expected != size - start:
        raise format_error(
            path,
            f"{name} is by its header {dtype} of shape {shape}, {expected} bytes, "
            f"but has {size - start}",
            byte=start,
        )
    data = bytearray(expected)
    if file.readinto(data) != expected:  # type: ignore[attr-defined]
        raise format_error(path, f"the file ends inside {name}", byte=start)
    array: Column = np.frombuffer(data, dtype, math.prod(shape)) if expected else np.empty(0, dtype)
    array = array.reshape(shape[::-1]).T if fortran else array.reshape(shape)
    return array


def _objects(path: Path, name: str) -> FormatError:
    return format_error(path, f"{name} holds Python objects, which are not read", byte=0)


def _columns_of(path: Path, array: Column, notes: Notes) -> dict[str, Column]:
    """The columns of an array of points, by row or structured."""
    if array.dtype.names:
        columns: dict[str, Column] = {}
        for field in array.dtype.names:
            rows = array[field].reshape(array.size, math.prod(array.dtype[field].shape))
            if field in _POINTS and rows.shape[1] == 3 and rows.dtype.kind in "fiu":
                named = dict(zip("xyz", _native(rows).T, strict=True))
            else:
                named = _named(field, rows, notes)
            add_columns(columns, named, notes)
        return columns
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        raise format_error(
            path,
            f"the array has shape {array.shape} and dtype {array.dtype}; a cloud is (n, 3) or more "
            "columns of numbers, or structured with fields x, y and z",
        )
    remedy = "name them by the fields of a structured array"
    return guess_names(path, list(_native(array).T), remedy)


def _native(array: Column) -> Column:
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def _named(name: str, rows: Column, notes: Notes) -> dict[str, Column]:
    """The columns of an (n, k) array by the names that they go by in other files."""
    if rows.dtype.kind not in "fiub":
        notes.aside(f"{name} of dtype {rows.dtype}")
        return {}
    rows = _native(rows)
    names = _TRIPLES.get(name.lower(), ())
    if names and rows.shape[1] in (3, 4):
        last = "alpha" if "red" in names else f"{name}_3"
        return dict(zip((*names[:3], last)[: rows.shape[1]], rows.T, strict=True))
    if rows.shape[1] == 1:
        return {_SINGLES.get(name.lower(), name): rows[:, 0]}
    return lists_of(name, rows, notes)


def read_npy(path: Path) -> PointCloud:
    """Reads a NPY file: one array of points by row, or a structured one.

    Parameters
    ----------
    path
        The file. Columns of plain arrays are x y z, then as in text files: intensity or label (4
        columns); colours or normals (6); colours and an intensity or a label, either first (7);
        colours and normals, either first (9). Their values tell which.

    Returns
    -------
    PointCloud
        What the columns say.

    Raises
    ------
    FormatError
        The file is not NPY, is truncated, or its array is no cloud.
    """
    with path.open("rb") as file:
        array = _load_array(path, "the array", file, path.stat().st_size)
    if array is None:
        raise _objects(path, "the array")
    notes = Notes(path)
    return cloud_from_columns(path, _columns_of(path, array, notes), notes=notes)


def _load_members(path: Path, notes: Notes) -> dict[str, Column]:
    file_size = path.stat().st_size
    arrays: dict[str, Column] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            if len(members) > _MOST_MEMBERS:
                raise format_error(path, f"the archive has more than {_MOST_MEMBERS} members")
            for member in members:
                if not member.filename.endswith(".npy"):
                    notes.aside(repr(member.filename[:60]))
                    continue
                if (
                    member.compress_size > file_size
                    or member.file_size > member.compress_size * _LARGEST_DEFLATION
                ):
                    raise format_error(
                        path,
                        f"{member.filename!r:.60} is by its header {member.file_size} bytes, "
                        "more than the file can hold",
                        byte=member.header_offset,
                    )
                with archive.open(member) as file:
                    name = member.filename.removesuffix(".npy")
                    array = _load_array(path, f"array {name!r:.60}", file, member.file_size)
                if array is not None:
                    arrays[name] = array
                elif name in _NEEDED or len(members) == 1:
                    raise _objects(path, f"array {name!r:.60}")
                else:
                    notes.aside(f"array {name} of Python objects")
    except FormatError:
        raise
    except Exception as error:
        # zipfile raises BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError and
        # more.
        raise format_error(path, f"not a readable NPZ archive: {error}") from error
    return arrays


def _check_own(path: Path, arrays: dict[str, Column], n_points: int) -> None:
    """Refuses arrays of a cloud that do not have one row per point."""
    shapes = {"local_points": (None, 3), "origin": (3,), "viewpoints": (-1, 3)}
    shapes |= {"colors": (None, 3), "normals": (None, 3)}
    for name in ("local_points", "origin", *_ATTRIBUTES):
        if (array := arrays.get(name)) is None:
            continue
        expected = shapes.get(name, (None,))
        per_point = expected[0] is None
        if (
            array.ndim != len(expected)
            or (per_point and len(array) != n_points)
            or (expected[-1] is not None and array.shape[-1] != expected[-1])
            or array.dtype.kind not in "fiu"
        ):
            raise format_error(
                path, f"{name} has shape {array.shape} and dtype {array.dtype}, which does not fit"
            )


def _text(arrays: dict[str, Column], name: str) -> str | None:
    """The text in an array of one string, if there is such an array."""
    array = arrays.get(name)
    if array is None or array.size != 1 or array.dtype.kind != "U":
        return None
    del arrays[name]
    return str(array.reshape(-1)[0])


def _per_point(arrays: dict[str, Column], n_points: int, notes: Notes) -> dict[str, Column]:
    """The columns of all arrays that have a row per point; says which have not."""
    columns: dict[str, Column] = {}
    for name, array in arrays.items():
        if array.ndim in (1, 2) and len(array) == n_points and not array.dtype.names:
            rows = array.reshape(n_points, math.prod(array.shape[1:]))
            add_columns(columns, _named(name, rows, notes), notes)
        else:
            notes.aside(f"array {name} of shape {array.shape} and dtype {array.dtype}")
    return columns


def _own_cloud(path: Path, arrays: dict[str, Column], notes: Notes) -> PointCloud:
    """The cloud that `write_npz` wrote, as it was."""
    points = arrays["local_points"]
    _check_own(path, arrays, len(points))
    origin = arrays.pop("origin", np.zeros(3))
    crs = _text(arrays, "crs")
    del arrays["local_points"]
    own: dict[str, Any] = {
        name: _native(arrays.pop(name)) for name in _ATTRIBUTES if name in arrays
    }
    extra: dict[str, Column] = {}
    for name, array in arrays.items():
        if array.shape == (len(points),) and array.dtype.kind in "fiub":
            extra[name] = _native(array)
        else:
            notes.aside(f"array {name} of shape {array.shape} and dtype {array.dtype}")
    return build_cloud(path, points, origin=origin, **own, extra=extra, crs=crs, notes=notes)


def read_npz(path: Path) -> PointCloud:
    """Reads a NPZ file, as `write_npz` or `numpy.savez` make them.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        Exactly the cloud that was written. Of other archives the points, and the arrays with a
        value or a row per point: colours, normals, intensities and ranges by the names that tools
        give them, all others as extra columns.

    Raises
    ------
    FormatError
        The file is not NPZ, is damaged, or has no array of points.

    Warns
    -----
    DroppedPointsWarning
        Points are not finite, or are no returns (exactly 0 0 0).
    LostAttributeWarning
        Arrays are left aside since they have no number per point; colours or normals are 0
        everywhere.
    """
    notes = Notes(path)
    arrays = _load_members(path, notes)
    if "local_points" in arrays:
        return _own_cloud(path, arrays, notes)
    crs = _text(arrays, "crs")
    key = next((name for name in _POINTS if name in arrays), None)
    if key is None and len(arrays) == 1:
        (key,) = arrays
    if key is None:
        if not {"x", "y", "z"} <= arrays.keys():
            raise format_error(
                path,
                "neither an array points nor local_points, nor any of "
                f"{', '.join(_POINTS[1:])}, nor x, y and z, among "
                f"{', '.join(arrays) or 'none at all':.200}",
            )
        columns: dict[str, Column] = {}
        n_points = len(arrays["x"].reshape(-1))
    else:
        points = arrays.pop(key)
        columns = _columns_of(path, points, notes)
        n_points = len(points)
    _check_own(path, arrays, n_points)
    viewpoints = arrays.pop("viewpoints", None)
    origin = arrays.pop("origin", None)
    if origin is not None:
        notes.aside("origin, since there are no local_points")
    add_columns(columns, _per_point(arrays, n_points, notes), notes)
    return cloud_from_columns(path, columns, viewpoints=viewpoints, crs=crs, notes=notes)


def write_npz(path: Path, cloud: PointCloud) -> None:
    """Writes a NPZ file without compression; it holds every attribute exactly.

    Parameters
    ----------
    path
        The file, replaced in one piece.
    cloud
        What to write.
    """
    arrays: dict[str, Column] = {
        "local_points": cloud.local_points,
        "origin": np.array(cloud.origin),
    }
    for name in _ATTRIBUTES:
        if (array := getattr(cloud, name)) is not None:
            arrays[name] = array
    if cloud.crs is not None:
        arrays["crs"] = np.array(cloud.crs)
    with written_whole(path) as temporary, zipfile.ZipFile(temporary, "x") as archive:
        for name, array in (arrays | cloud.extra).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, array, allow_pickle=False)
