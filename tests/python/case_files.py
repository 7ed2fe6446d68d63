"""Small files as other tools write them, made here, for the tests of readers."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb

CASES = Path(__file__).parents[2].parent / "shared" / "cases"
"""Files of the same kinds, where they are."""
WITHOUT_CASES = f"the files are not at {CASES}; files of the same kinds are generated"

Reader = Callable[[bytes], sb.PointCloud]


def strict_reader(path: Path) -> Reader:
    """What reads bytes as the file `path`, with every warning an error."""

    def read(data: bytes) -> sb.PointCloud:
        path.write_bytes(data)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return sb.read(path)

    return read


UTM = np.array([500_000.0, 5_400_000.0, 100.0])


class Room:
    """A corner of a room of 4 x 3 x 2.5 m with noise: points, colours, normals, intensities."""

    def __init__(self, n: int = 600, seed: int = 3) -> None:
        rng = np.random.default_rng(seed)
        size = np.array([4.0, 3.0, 2.5])
        points = rng.uniform(0, 1, (n, 3)) * size
        wall = rng.integers(0, 3, n)
        points[np.arange(n), wall] = rng.normal(0, 0.002, n)
        self.points = points.astype(np.float32)
        self.normals = np.eye(3, dtype=np.float32)[wall]
        self.colors = rng.integers(20, 250, (n, 3)).astype(np.uint8)
        self.intensities = rng.uniform(0.2, 0.9, n).astype(np.float32)

    def columns(self) -> dict[str, NDArray[Any]]:
        """The coordinates by name."""
        return dict(zip("xyz", self.points.T, strict=True))

    def rgb(self) -> dict[str, NDArray[Any]]:
        """The colours by name."""
        return dict(zip(("red", "green", "blue"), self.colors.T, strict=True))


def records(columns: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
    """The columns as packed rows."""
    rows = np.empty(
        len(next(iter(columns.values()))),
        [(name, c.dtype, c.shape[1:]) for name, c in columns.items()],
    )
    for name, column in columns.items():
        rows[name] = column
    return rows


_PLY = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"}
_PLY |= {"f4": "float", "f8": "double", "i8": "int64", "u8": "uint64"}


def ply(
    columns: Mapping[str, NDArray[Any]],
    *,
    lines: Iterable[bytes] = (),
    rows: Iterable[str] | None = None,
) -> bytes:
    """A PLY file: binary, or text where `rows` are given; `lines` come behind the format."""
    format_name = "binary_little_endian" if rows is None else "ascii"
    table = records(columns)
    header = [b"ply", f"format {format_name} 1.0".encode(), *lines]
    header.append(f"element vertex {len(table)}".encode())
    for name in table.dtype.names or ():
        header.append(f"property {_PLY[table.dtype[name].str[1:]]} {name}".encode())
    body = table.tobytes() if rows is None else "".join(f"{row}\n" for row in rows).encode()
    return b"\n".join([*header, b"end_header\n"]) + body


def pcd(
    columns: Mapping[str, NDArray[Any]],
    *,
    viewpoint: str = "0 0 0 1 0 0 0",
    rows: Iterable[str] | None = None,
) -> bytes:
    """A PCD file: binary, or text where `rows` are given."""
    table = records(columns)
    fields = [table.dtype[name] for name in columns]
    bases = [f.base for f in fields]
    counts = [f.shape[0] if f.shape else 1 for f in fields]
    header = [
        "VERSION 0.7",
        f"FIELDS {' '.join(columns)}",
        f"SIZE {' '.join(str(b.itemsize) for b in bases)}",
        f"TYPE {' '.join(b.kind.upper() for b in bases)}",
        f"COUNT {' '.join(map(str, counts))}",
        f"WIDTH {len(table)}",
        "HEIGHT 1",
        f"VIEWPOINT {viewpoint}",
        f"POINTS {len(table)}",
        f"DATA {'binary' if rows is None else 'ascii'}\n",
    ]
    body = table.tobytes() if rows is None else "".join(f"{row}\n" for row in rows).encode()
    return "\n".join(header).encode() + body


_SINGLE = {"return_number": 1, "number_of_returns": 1}


def las(
    path: Path,
    points: NDArray[Any],
    dimensions: Mapping[str, Any],
    *,
    point_format: int = 3,
    extra: Mapping[str, NDArray[Any]] | None = None,
    records: Iterable[tuple[int, bytes]] = (),
) -> Path:
    """A LAS or LAZ file by laspy, of single returns unless the dimensions say otherwise.

    `records` are those of the user LASF_Projection.
    """
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    header = laspy.LasHeader(point_format=point_format, version="1.4")
    header.offsets, header.scales = np.floor(points.min(axis=0)), np.full(3, 0.001)
    for name, column in (extra or {}).items():
        header.add_extra_dim(laspy.ExtraBytesParams(name, column.dtype))
    for number, data in records:
        header.vlrs.append(laspy.VLR("LASF_Projection", number, "", data))
    file = laspy.LasData(header)
    file.x, file.y, file.z = points.T.astype(np.float64)
    for name, values in {**_SINGLE, **dimensions, **(extra or {})}.items():
        file[name] = np.broadcast_to(values, len(points))
    file.write(str(path))
    return path


def e57(
    path: Path,
    columns: Mapping[str, NDArray[Any]],
    *,
    bounds: Mapping[str, tuple[int, int]] | None = None,
    quaternion: tuple[float, float, float, float] | None = None,
    crs: str = "",
) -> Path:
    """An E57 file of one scan by libE57; fields of integers have `bounds`."""
    libe57 = pytest.importorskip("pye57").libe57
    image = libe57.ImageFile(str(path), "w")
    image.extensionsAdd("", libe57.E57_V1_0_URI)
    root, scan = image.root(), libe57.StructureNode(image)
    scans = libe57.VectorNode(image, True)
    root.set("formatName", libe57.StringNode(image, "ASTM E57 3D Imaging Data File"))
    root.set("guid", libe57.StringNode(image, "{0}"))
    root.set("versionMajor", libe57.IntegerNode(image, 1))
    root.set("versionMinor", libe57.IntegerNode(image, 0))
    root.set("coordinateMetadata", libe57.StringNode(image, crs))
    root.set("data3D", scans)
    scan.set("guid", libe57.StringNode(image, "{1}"))
    if quaternion is not None:
        pose, rotation = libe57.StructureNode(image), libe57.StructureNode(image)
        for name, value in zip("wxyz", quaternion, strict=True):
            rotation.set(name, libe57.FloatNode(image, value))
        pose.set("rotation", rotation)
        scan.set("pose", pose)
    prototype = libe57.StructureNode(image)
    buffers = libe57.VectorSourceDestBuffer()
    n = len(next(iter(columns.values())))
    kept = []
    for name, column in columns.items():
        if bounds is not None and name in bounds:
            low, high = bounds[name]
            prototype.set(name, libe57.IntegerNode(image, low, low, high))
        else:
            prototype.set(name, libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE))
        kept.append(np.ascontiguousarray(column, np.float64))
        buffers.append(libe57.SourceDestBuffer(image, name, kept[-1], n, True, True))
    points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    scan.set("points", points)
    scans.append(scan)
    writer = points.writer(buffers)
    writer.write(n)
    writer.close()
    image.close()
    return path


def peak_memory() -> int:
    """Most memory that this process has held, kibibytes; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # macOS counts bytes.
    return peak // 1024 if sys.platform == "darwin" else peak
