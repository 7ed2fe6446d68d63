"""NPZ and NPY, numpy's own files: NPZ keeps a cloud exactly.

NPZ holds arrays by the names of `PointCloud`: `local_points` (float32, relative to `origin`),
`origin`, `colors`, `intensities`, `normals`, `ranges`, `viewpoints` and `viewpoint_index`. Read are
also `points` (world coordinates) in place of the first two, and archives of a single array, which
is taken as NPY.

NPY holds one array: of shape (n, 3), (n, 4), (n, 6), (n, 7) or (n, 9) with columns as in text
files, or structured, with fields by name.
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO

import numpy as np

from surfabet._core import PointCloud
from surfabet.errors import FormatError
from surfabet.io._columns import Column, build_cloud, cloud_from_columns
from surfabet.io._files import format_error, written_whole
from surfabet.io._guess import guess_names

_ATTRIBUTES = ("colors", "intensities", "normals", "ranges", "viewpoints", "viewpoint_index")
# Deflate cannot do better, so a larger claim is false.
_LARGEST_DEFLATION = 1100
_MOST_MEMBERS = 1000


def _load_array(path: Path, name: str, file: IO[bytes], size: int) -> Column:
    """The array in `size` bytes of NPY; `name` says in errors which one it is."""
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
        raise format_error(path, f"{name} holds Python objects, which are not read", byte=0)
    start = file.tell()
    expected = math.prod(shape) * dtype.itemsize
    if any(n < 0 for n in shape) or expected != size - start:
        raise format_error(
            path,
            f"{name} is said to be {dtype} of shape {shape}, {expected} bytes, "
            f"but has {size - start}",
            byte=start,
        )
    data = bytearray(expected)
    if file.readinto(data) != expected:  # type: ignore[attr-defined]
        raise format_error(path, f"the file ends inside {name}", byte=start)
    array: Column = np.frombuffer(data, dtype, math.prod(shape)) if expected else np.empty(0, dtype)
    array = array.reshape(shape[::-1]).T if fortran else array.reshape(shape)
    return array


def _cloud_from_array(path: Path, array: Column) -> PointCloud:
    if array.dtype.names:
        columns: dict[str, Column] = {}
        for field in array.dtype.names:
            column = array[field]
            if column.ndim == 1 and column.dtype.kind in "fiu":
                columns[field] = column.astype(column.dtype.newbyteorder("="))
        return cloud_from_columns(path, columns)
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        raise format_error(
            path,
            f"the array has shape {array.shape} and dtype {array.dtype}; a cloud is (n, 3) or more "
            "columns of numbers, or structured with fields x, y and z",
        )
    array = array.astype(array.dtype.newbyteorder("="), copy=False)
    return cloud_from_columns(path, guess_names(path, list(array.T)))


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
    return _cloud_from_array(path, array)


def _load_members(path: Path) -> dict[str, Column]:
    file_size = path.stat().st_size
    arrays: dict[str, Column] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            if len(members) > _MOST_MEMBERS:
                raise format_error(path, f"the archive has more than {_MOST_MEMBERS} members")
            wanted = {f"{name}.npy" for name in ("local_points", "points", "origin", *_ATTRIBUTES)}
            for member in members:
                if member.filename not in wanted and len(members) > 1:
                    continue
                if (
                    member.compress_size > file_size
                    or member.file_size > member.compress_size * _LARGEST_DEFLATION
                ):
                    raise format_error(
                        path,
                        f"{member.filename!r:.60} is said to be {member.file_size} bytes, "
                        "more than the file can hold",
                        byte=member.header_offset,
                    )
                with archive.open(member) as file:
                    name = member.filename.removesuffix(".npy")
                    arrays[name] = _load_array(path, f"array {name!r:.60}", file, member.file_size)
    except FormatError:
        raise
    except Exception as error:
        # zipfile raises BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError and
        # more.
        raise format_error(path, f"not a readable NPZ archive: {error}") from error
    return arrays


def read_npz(path: Path) -> PointCloud:
    """Reads a NPZ file, as `write_npz` or `numpy.savez` make them.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        Exactly the cloud that was written. Arrays of other names are left aside.

    Raises
    ------
    FormatError
        The file is not NPZ, is damaged, or has no array `points` or `local_points`.
    """
    arrays = _load_members(path)
    if len(arrays) == 1 and "points" not in arrays:
        return _cloud_from_array(path, next(iter(arrays.values())))
    points = arrays.get("local_points", arrays.get("points"))
    if points is None:
        raise format_error(path, "the archive has neither an array points nor local_points")
    columns = {name: arrays.get(name) for name in _ATTRIBUTES}
    origin = arrays.get("origin") if "local_points" in arrays else None
    shapes = {"points": (None, 3), "colors": (None, 3), "normals": (None, 3), "viewpoints": (-1, 3)}
    for name, array in {"points": points, "origin": origin, **columns}.items():
        expected = (3,) if name == "origin" else shapes.get(name, (None,))
        if array is None:
            continue
        per_point = expected[0] is None
        if (
            array.ndim != len(expected)
            or array.shape[-1] != (expected[-1] or len(points))
            or (per_point and len(array) != len(points))
            or array.dtype.kind not in "fiu"
        ):
            raise format_error(
                path, f"{name} has shape {array.shape} and dtype {array.dtype}, which does not fit"
            )
    native = {
        name: array if array is None else array.astype(array.dtype.newbyteorder("="), copy=False)
        for name, array in columns.items()
    }
    return build_cloud(path, points, origin=origin, **native)


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
    with written_whole(path) as temporary, temporary.open("xb") as file:
        np.savez(file, allow_pickle=False, **arrays)
