"""PLY files made by hand, as other tools write them, and broken ones."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import surfabet as sb
from case_files import Reader, strict_reader

POINTS = np.array([[0.5, -1.25, 2.0], [3.0, 4.5, -6.75], [10.0, 0.0, 0.125]])
CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"}
CODES |= {"float": "f", "double": "d", "int8": "b", "uint16": "H", "float32": "f", "float64": "d"}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


@pytest.fixture
def read(tmp_path: Path) -> Reader:
    return strict_reader(tmp_path / "a.ply")


def read_aloud(folder: Path, data: bytes) -> sb.PointCloud:
    """Reads bytes as a PLY file."""
    (folder / "a.ply").write_bytes(data)
    return sb.read(folder / "a.ply")


def header(*lines: str, format: str = "ascii", end: str = "\n") -> bytes:
    return (end.join(["ply", f"format {format} 1.0", *lines, "end_header"]) + end).encode()


XYZ = ("property float x", "property float y", "property float z")


@pytest.mark.parametrize("format", ORDERS)
@pytest.mark.parametrize(
    "scalar", ["float", "double", "float32", "float64", "int", "short", "char"]
)
def test_binary_of_both_byte_orders_and_any_type(read: Reader, format: str, scalar: str) -> None:
    points = POINTS if scalar.startswith(("f", "d")) else np.trunc(POINTS)
    code = ORDERS[format] + 3 * CODES[scalar]
    rows = [r if "f" in code or "d" in code else [int(c) for c in r] for r in points.tolist()]
    data = b"".join(struct.pack(code, *row) for row in rows)
    lines = ["element vertex 3", *(f"property {scalar} {axis}" for axis in "xyz")]
    cloud = read(header(*lines, format=format) + data)
    np.testing.assert_array_equal(cloud.points, points)
    assert cloud.attributes == []


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_ascii_with_comments_and_either_line_end(read: Reader, end: str) -> None:
    lines = [
        "comment a b c",
        "obj_info 1",
        "element vertex 3",
        *XYZ,
        "comment",
        "property int label",
    ]
    body = "".join(" ".join(map(str, [*row, 7])) + end for row in POINTS.tolist())
    cloud = read(header(*lines, end=end) + body.encode())
    np.testing.assert_array_equal(cloud.points, POINTS)


def test_a_file_as_open3d_writes_it(read: Reader) -> None:
    normals = np.eye(3)
    lines = ["comment Created by Open3D", "element vertex 3"]
    lines += [f"property double {n}" for n in ("x", "y", "z", "nx", "ny", "nz")]
    lines += [f"property uchar {n}" for n in ("red", "green", "blue")]
    data = b"".join(
        struct.pack("<6d3B", *p, *n, i, 100, 255)
        for i, (p, n) in enumerate(zip(POINTS, normals, strict=True))
    )
    cloud = read(header(*lines, format="binary_little_endian") + data)
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.normals, normals)
    np.testing.assert_array_equal(cloud.colors, [[0, 100, 255], [1, 100, 255], [2, 100, 255]])


@pytest.mark.parametrize(
    ("scalar", "values", "expected"),
    [
        ("uchar", (0, 128, 255), (0, 128, 255)),
        ("ushort", (0, 257 * 128, 65535), (0, 128, 255)),
        ("ushort", (0, 128, 255), (0, 128, 255)),
        ("float", (0.0, 0.5, 1.0), (0, 128, 255)),
        ("double", (0.0, 128.0, 255.0), (0, 128, 255)),
    ],
)
def test_colors_of_any_type(
    read: Reader, scalar: str, values: tuple[float, ...], expected: tuple[int, ...]
) -> None:
    lines = ["element vertex 1", *XYZ]
    lines += [f"property {scalar} {name}" for name in ("red", "green", "blue")]
    cloud = read(header(*lines) + f"1 2 3 {' '.join(map(str, values))}\n".encode())
    np.testing.assert_array_equal(cloud.colors, [expected])


@pytest.mark.parametrize("name", ["intensity", "reflectance", "scalar_Intensity"])
def test_intensity_by_its_usual_names(read: Reader, name: str) -> None:
    cloud = read(header("element vertex 1", *XYZ, f"property float {name}") + b"1 2 3 0.25\n")
    np.testing.assert_array_equal(cloud.intensities, [0.25])


FACES = ("element face 2", "property list uchar int vertex_indices", "property uchar flag")


@pytest.mark.parametrize("lengths", [(3, 3), (3, 4)])
@pytest.mark.parametrize("faces_first", [False, True])
@pytest.mark.parametrize("format", ["ascii", *ORDERS])
def test_faces_are_left_aside(
    tmp_path: Path, format: str, faces_first: bool, lengths: tuple[int, int]
) -> None:
    faces = [[n, *range(n), 9] for n in lengths]
    if format == "ascii":
        vertices = b"".join((" ".join(map(str, p)) + "\n").encode() for p in POINTS.tolist())
        face_data = b"".join((" ".join(map(str, f)) + "\n").encode() for f in faces)
    else:
        order = ORDERS[format]
        vertices = b"".join(struct.pack(order + "3f", *p) for p in POINTS)
        face_data = b"".join(struct.pack(f"{order}B{f[0]}iB", *f) for f in faces)
    vertex = ("element vertex 3", *XYZ)
    if faces_first:
        data = header(*FACES, *vertex, format=format) + face_data + vertices
    else:
        data = header(*vertex, *FACES, format=format) + vertices + face_data
    with pytest.warns(sb.LostAttributeWarning, match=r"left aside: element face \(2\)$"):
        cloud = read_aloud(tmp_path, data)
    np.testing.assert_array_equal(cloud.points, POINTS)


@pytest.mark.parametrize("lengths", [(2, 2, 2), (0, 3, 1)])
@pytest.mark.parametrize("format", ["ascii", *ORDERS])
def test_lists_inside_vertices_are_left_aside(
    tmp_path: Path, format: str, lengths: tuple[int, ...]
) -> None:
    lines = ["element vertex 3", XYZ[0], "property list ushort double extra", *XYZ[1:]]
    data = header(*lines, format=format)
    for (x, y, z), n in zip(POINTS.tolist(), lengths, strict=True):
        values = [0.5] * n
        if format == "ascii":
            data += (" ".join(map(str, [x, n, *values, y, z])) + "\n").encode()
        else:
            data += struct.pack(f"{ORDERS[format]}fH{n}d2f", x, n, *values, y, z)
    with pytest.warns(sb.LostAttributeWarning, match=r"left aside: lists extra of vertex$"):
        cloud = read_aloud(tmp_path, data)
    np.testing.assert_array_equal(cloud.points, POINTS)


def test_nan_points_are_dropped_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(header("element vertex 3", *XYZ) + b"1 2 3\nnan 0 0\n0 inf 0\n")
    with pytest.warns(sb.DroppedPointsWarning, match="dropped 2 of 3 points") as warned:
        cloud = sb.read(path)
    assert len(cloud) == 1
    assert str(path) in str(warned[0].message)
    assert warned[0].filename == __file__


BINARY = {"format": "binary_little_endian"}
VERTEX = header("element vertex 3", *XYZ, **BINARY)
BROKEN = {
    "not ply": (b"plyx\n", r"line 1: not a PLY file"),
    "no end": (b"ply\nformat ascii 1.0\n", "line 2: the file ends inside the header"),
    "no format": (b"ply\nend_header\n", "line 2: the header names no format"),
    "unknown format": (b"ply\nformat utf8 1.0\n", "line 2: unknown header line 'format utf8 1.0'"),
    "version": (b"ply\nformat ascii 2.0\n", "line 2: unknown header line"),
    "unknown line": (header("banana 3"), "line 3: unknown header line 'banana 3'"),
    "orphan": (header("property float x"), "line 3: a property before any element"),
    "type": (header("element vertex 1", "property half x"), "line 4: unknown type 'half'"),
    "words": (header("element vertex 1", "property float"), "line 4: a property is"),
    "twice": (header("element vertex 1", XYZ[0], XYZ[0]), "line 5: property 'x' appears twice"),
    "two vertex": (
        header("element vertex 1", "element vertex 2"),
        "line 4: element 'vertex' appears",
    ),
    "negative": (header("element vertex -3", *XYZ), "line 3: element 'vertex' has count '-3'"),
    "fraction": (header("element vertex 3.5", *XYZ), "line 3: element 'vertex' has count"),
    "astronomic": (header("element vertex " + "9" * 40), "line 3: element 'vertex' has count"),
    "float list": (
        header("element face 1", "property list float int v"),
        "line 4: the length of a list must be an integer",
    ),
    "no vertex": (header("element face 0", "property float x"), "no element 'vertex'"),
    "no properties": (header("element vertex 3"), "'vertex' has no properties"),
    "no z": (header("element vertex 0", *XYZ[:2]), "no columns x, y and z"),
    "billions": (
        header("element vertex 1000000000000", *XYZ, **BINARY) + bytes(36),
        r"byte \d+: the header promises 1000000000000 vertex of at least 12000000000000 bytes, "
        "but the file has 36 left",
    ),
    "billions of text": (
        header("element vertex 1000000000000", *XYZ) + b"1 2 3\n",
        "the header promises 1000000000000 vertex of at least",
    ),
    "truncated": (VERTEX + bytes(35), f"byte {len(VERTEX)}: the header promises 3 vertex"),
    "too few rows": (
        header("element vertex 3", *XYZ) + b"1 2 3\n4 5 6000000000000\n",
        "line 9: the file ends after 2 of 3 rows",
    ),
    "not a number": (
        header("element vertex 3", *XYZ) + b"1 2 3\n\n4 5 six\n7 8 9\n",
        "line 10: cannot read a row of 3 numbers: could not convert string 'six' to float64$",
    ),
    "too many values": (
        header("element vertex 2", *XYZ) + b"1 2 3\n4 5 6 7\n",
        "line 9: cannot read a row of 3 numbers: the number of columns changed from 3 to 4$",
    ),
    "one too many each": (header("element vertex 1", *XYZ) + b"1 2 3 4\n", "line 8: rows have 4"),
    "color out of range": (
        header("element vertex 1", *XYZ, "property uchar red") + b"1 2 3 300\n",
        "line 9: column 'red' has values that are not integers from 0 to 255",
    ),
    "negative list": (
        header("element face 1", "property list char int v", "element vertex 1", *XYZ, **BINARY)
        + bytes([255])
        + bytes(12),
        r"byte \d+: a list 'v' of -1 values",
    ),
    "endless list": (
        header("element face 1", "property list uint int v", "element vertex 1", *XYZ, **BINARY)
        + bytes([255] * 4)
        + bytes(12),
        r"byte \d+: a list 'v' of 4294967295 values does not fit",
    ),
    "endless ascii list": (
        header("element face 1", "property list uint int v", "element vertex 1", *XYZ)
        + b"4294967295 1 2\n1 2 3\n",
        "line 10: cannot read element 'face'",
    ),
    "long line": (b"ply\ncomment " + b"x" * 100_000, "line 2: the line is longer than 65536 bytes"),
    "long header": (b"ply\n" + b"comment\n" * 20_000, "the header has more than 10000 lines"),
    "binary header": (b"ply\nformat ascii 1.0\n\xff\x02\n", "line 3: the header holds bytes"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files_are_named_with_the_place(tmp_path: Path, case: str) -> None:
    data, message = BROKEN[case]
    path = tmp_path / "broken.ply"
    path.write_bytes(data)
    with pytest.raises(sb.FormatError, match=message) as raised:
        sb.read(path, format="ply")
    assert str(path) in str(raised.value)
