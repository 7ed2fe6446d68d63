"""Text, NPZ, NPY, KITTI, LAS and E57 files of others, and how formats are told apart."""

from __future__ import annotations

import io
import struct
import sys
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb

POINTS = np.array([[0.5, -1.25, 2.0], [3.0, 4.5, -6.75], [10.0, 0.0, 0.125]])


def read(path: Path, data: bytes, **options: Any) -> sb.PointCloud:
    """Reads bytes as a file of this name, with every warning an error."""
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return sb.read(path, **options)


# Text


@pytest.mark.parametrize(
    "text",
    [
        "0.5 -1.25 2\n3 4.5 -6.75\n10 0 0.125\n",
        "0.5\t-1.25\t2\r\n3\t4.5\t-6.75\r\n\r\n10\t0\t0.125\r\n",
        "0.5,-1.25,2\n3,4.5,-6.75\n10,0,0.125",
        "0.5; -1.25; 2\n3; 4.5; -6.75\n10; 0; 0.125\n",
        "0.5,-1.25,2,\n3,4.5,-6.75,\n10,0,0.125,\n",
        "x,y,z\n0.5,-1.25,2\n3,4.5,-6.75\n10,0,0.125\n",
        '"Z","Y","X"\n2,-1.25,0.5\n-6.75,4.5,3\n0.125,0,10\n',
        "//X Y Z\n0.5 -1.25 2\n# a comment\n3 4.5 -6.75\n10 0 0.125\n",
        "% free text\n\n  0.5 -1.25 2 \n3 4.5 -6.75\n// end\n10 0 0.125\n",
        "\ufeffx y z\n0.5 -1.25 2\n3 4.5 -6.75\n10 0 0.125\n",
    ],
)
@pytest.mark.parametrize("suffix", [".xyz", ".csv"])
def test_text_of_every_kind(tmp_path: Path, text: str, suffix: str) -> None:
    cloud = read(tmp_path / f"a{suffix}", text.encode())
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.attributes == []


@pytest.mark.parametrize(
    ("rows", "attributes"),
    [
        (["0 0 0 0.5"], {"intensities": [0.5]}),
        (["0 0 0 10 20 30"], {"colors": [[10, 20, 30]]}),
        (["0 0 0 0.0 0.5 1.0"], {"colors": [[0, 128, 255]]}),
        (["0 0 0 0.6 0 0.8"], {"normals": [[0.6, 0, 0.8]]}),
        (["0 0 0 0 0 1", "0 0 0 0 -1 0"], {"normals": [[0, 0, 1], [0, -1, 0]]}),
        (["0 0 0 0.25 10 20 30"], {"intensities": [0.25], "colors": [[10, 20, 30]]}),
        (["0 0 0 10 20 30 0.25"], {"intensities": [0.25], "colors": [[10, 20, 30]]}),
        (["0 0 0 10 20 30 0 0 1"], {"colors": [[10, 20, 30]], "normals": [[0, 0, 1]]}),
        (["0 0 0 0 0 -1 10 20 30"], {"colors": [[10, 20, 30]], "normals": [[0, 0, -1]]}),
    ],
)
def test_columns_by_number_and_values(
    tmp_path: Path, rows: list[str], attributes: dict[str, Any]
) -> None:
    cloud = read(tmp_path / "a.txt", "\n".join(rows).encode())
    assert set(cloud.attributes) == set(attributes)
    for name, expected in attributes.items():
        np.testing.assert_array_equal(getattr(cloud, name), np.array(expected, np.float32))


def test_columns_by_name(tmp_path: Path) -> None:
    data = b"7 1 2 3 0.5 9\n8 4 5 6 0.25 9\n"
    names = ["label", "x", "y", "z", "intensity"]
    cloud = read(tmp_path / "a.txt", data, columns=names)
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(cloud.intensities, [0.5, 0.25])
    with pytest.raises(sb.InvalidInputError, match="must be names of columns with x, y and z"):
        sb.read(tmp_path / "a.txt", columns=["x", "y"])
    with pytest.raises(sb.InvalidInputError, match="must be one character"):
        sb.read(tmp_path / "a.txt", delimiter="ab")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "byte 0: the file is empty"),
        (b"\n\n", "line 2: no points and no column names"),
        (b"1 2\n", "cannot tell what 2 columns mean"),
        (b"1 2 3 4 5\n", "cannot tell what 5 columns mean"),
        (b"1 2 3\n4 5\n", "line 2: cannot read a row of 3 numbers"),
        (b"# c\n1 2 3\n\n4 5 six\n", "line 4: cannot read a row of 3 numbers.*'six'"),
        (b"hello world\n1 2 3\n", "line 1: neither numbers nor column names.*'hello world'"),
        (b"x,y,w\n1,2,3\n", "line 1: neither numbers nor column names"),
        (b"x,y,z,red\n1,2,3\n", "line 2: 3 values for the 4 columns"),
        (b"x,y,z\n1,2,3\n1,,3\n", "line 3: cannot read a row"),
        (b"x y z r g b\n1 2 3 4 5 70000\n", "colours lie between 4 and 70000"),
        (b"1" * 70_000, "line 1: the line is longer than 65536 bytes"),
        (bytes(range(256)), "line "),
    ],
)
def test_broken_text(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(sb.FormatError, match=message):
        read(tmp_path / "a.xyz", data)


# NPY and NPZ


@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f8", ">f8", "<i4", ">i2"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_of_any_type_and_order(tmp_path: Path, dtype: str, order: Any) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.asarray(POINTS, dtype=dtype, order=order))
    expected = np.trunc(POINTS) if "i" in dtype else POINTS
    np.testing.assert_array_equal(sb.read(path).points, expected)


def test_structured_npy(tmp_path: Path) -> None:
    fields = [("x", ">f8"), ("y", "<f8"), ("z", "<f4"), ("rgb", "u1", 3), ("intensity", "<u2")]
    rows = np.zeros(3, fields)
    for axis, name in enumerate("xyz"):
        rows[name] = POINTS[:, axis]
    rows["intensity"] = [1, 2, 3]
    np.save(tmp_path / "a.npy", rows)
    cloud = sb.read(tmp_path / "a.npy")
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.intensities, [1, 2, 3])


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_npz_of_others(tmp_path: Path, save: Any) -> None:
    path = tmp_path / "a.npz"
    save(path, points=POINTS, colors=np.eye(3, dtype=np.uint8), comment=np.array(["x"]))
    with pytest.warns(sb.LostAttributeWarning, match="left aside: array comment of shape"):
        cloud = sb.read(path)
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.colors, np.eye(3))
    save(path, POINTS)
    np.testing.assert_array_equal(sb.read(path).points, POINTS)


def npy(array: np.ndarray[Any, Any], **options: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, **options)
    return buffer.getvalue()


def npz(**members: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return buffer.getvalue()


def claim(shape: str) -> bytes:
    """NPY that claims a shape, with 24 bytes of data."""
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode() + bytes(24)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.npy", npy(np.zeros(3)), r"the array has shape \(3,\) and dtype float64"),
        ("a.npy", npy(np.zeros((3, 2))), "cannot tell what 2 columns mean"),
        ("a.npy", npy(np.zeros((3, 3), complex)), "dtype complex128"),
        ("a.npy", npy(np.array([[{}] * 3]), allow_pickle=True), "holds Python objects"),
        ("a.npy", npy(POINTS)[:-1], "72 bytes, but has 71"),
        ("a.npy", npy(POINTS) + b"x", "72 bytes, but has 73"),
        ("a.npy", npy(POINTS)[:50], "has no NPY header"),
        ("a.npy", claim("(1000000000000, 3)"), "24000000000000 bytes, but has 24"),
        ("a.npy", claim("(-1, -3)"), "of shape"),
        ("a.npy", claim("(" * 40), "has no NPY header"),
        ("a.npy", claim("(1, 3.0)"), "has no NPY header"),
        ("a.npz", npz(points=npy(POINTS))[:-5], "not a readable NPZ archive"),
        ("a.npz", npz(xs=npy(POINTS), ys=npy(POINTS)), "neither an array points nor local_points"),
        ("a.npz", npz(points=npy(POINTS), colors=npy(np.eye(2))), r"colors has shape \(2, 2\)"),
        ("a.npz", npz(points=npy(POINTS), ranges=npy(np.zeros(4))), r"ranges has shape \(4,\)"),
        ("a.npz", npz(points=claim("(10000000000, 3)")), "but has 24"),
        (
            "a.npz",
            npz(local_points=npy(POINTS), origin=npy(np.array([np.nan, 0, 0]))),
            "origin is .* must be three finite",
        ),
        (
            "a.npz",
            npz(
                points=npy(POINTS), viewpoints=npy(POINTS), viewpoint_index=npy(np.array([0, 9, 1]))
            ),
            "viewpoint 9 is out of range",
        ),
    ],
)
def test_broken_numpy_files(tmp_path: Path, name: str, data: bytes, message: str) -> None:
    with pytest.raises(sb.FormatError, match=message):
        read(tmp_path / name, data)


# KITTI


def test_kitti(tmp_path: Path) -> None:
    rows = np.column_stack([POINTS, [0.1, 0.2, 0.3]]).astype("<f4")
    cloud = read(tmp_path / "000000.bin", rows.tobytes())
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.intensities, rows[:, 3])
    np.testing.assert_array_equal(cloud.viewpoints, [[0, 0, 0]])
    assert cloud.ranges is not None
    np.testing.assert_allclose(cloud.ranges, np.linalg.norm(POINTS, axis=1), rtol=1e-7)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (bytes(33), "byte 32: 33 bytes are no multiple of 12, 16, 20.*columns="),
        (struct.pack("<8f", 1, 2, 3, 4, 1e20, 0, 0, 0), "4 floats per point.*columns="),
    ],
)
def test_broken_kitti(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(sb.FormatError, match=message):
        read(tmp_path / "a.bin", data)


# LAS


FAR = np.array([1000.0, 2000.0, 0.0])


def las_file(path: Path, colors: np.ndarray[Any, Any]) -> Path:
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=2, version="1.2")
    header.scales, header.offsets = np.full(3, 0.001), FAR
    file = laspy.LasData(header)
    file.xyz = POINTS + FAR
    file.red, file.green, file.blue = colors.T.astype(np.uint16)
    file.intensity = np.array([5, 60_000, 0], np.uint16)
    file.write(path)
    return path


@pytest.mark.parametrize("factor", [1, 256, 257])
def test_las_colors_of_8_and_16_bits(tmp_path: Path, factor: int) -> None:
    colors = np.array([[0, 1, 255], [7, 8, 9], [100, 200, 30]])
    cloud = sb.read(las_file(tmp_path / "a.las", colors * factor))
    np.testing.assert_allclose(cloud.points, POINTS + FAR, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(cloud.intensities, [5, 60_000, 0])
    np.testing.assert_array_equal(cloud.colors, colors)


@pytest.mark.parametrize("unit", [("metre", 1.0), ("foot", 0.3048)])
def test_las_keeps_the_coordinate_system_and_names_its_unit(
    tmp_path: Path, unit: tuple[str, float]
) -> None:
    path = las_file(tmp_path / "a.las", np.full((3, 3), 9))
    laspy = pytest.importorskip("laspy")
    name, metres = unit
    wkt = (
        'PROJCS["Lambert_Conformal_Conic",GEOGCS["GCS",UNIT["Degree",0.0174532925199433]],'
        f'PROJECTION["Lambert_Conformal_Conic"],UNIT["{name}",{metres}]]'
    )
    file = laspy.read(path)
    file.header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
    file.write(path)
    if metres == 1:
        cloud = read(path, path.read_bytes())
    else:
        told = r"Lambert_Conformal_Conic\): foot \(0.3048 m\) horizontally, foot"
        with pytest.warns(sb.LostAttributeWarning, match=told):
            cloud = sb.read(path)
    assert cloud.crs == wkt
    # Coordinates stay as they are, whatever the unit.
    np.testing.assert_allclose(cloud.points, laspy.read(path).xyz, rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    ("offset", "patch", "message"),
    [
        (94, b"\x10\x00", "byte 94: the header has 16 bytes"),
        (96, b"\xff\xff\xff\x7f", "byte 94: the header has 227 bytes and points begin at"),
        (100, b"\xff\xff\xff\x7f", "byte 100: 2147483647 variable records do not fit"),
        (105, b"\x00\x00", "byte 105: the header promises 3 points of 0 bytes"),
        (107, b"\xff\xff\xff\xff", "byte 105: the header promises 4294967295 points of 26 bytes"),
    ],
)
def test_las_sizes_are_held_against_the_file(
    tmp_path: Path, offset: int, patch: bytes, message: str
) -> None:
    path = las_file(tmp_path / "a.las", np.zeros((3, 3)))
    data = bytearray(path.read_bytes())
    data[offset : offset + len(patch)] = patch
    with pytest.raises(sb.FormatError, match=message):
        read(path, bytes(data))


# E57


def test_e57_poses_spherical_coordinates_and_invalid_points(tmp_path: Path) -> None:
    libe57 = pytest.importorskip("pye57").libe57
    path = tmp_path / "a.e57"
    radius = np.array([1.0, 2.0, 5.0, 9.0])
    azimuth = np.array([0.0, np.pi / 2, -2.0, 1.0])
    elevation = np.array([0.0, 0.0, 0.7, 1.0])
    state = np.array([0, 0, 0, 2], np.int8)
    intensity = np.array([1.0, 2.0, 3.0, 4.0])
    image = libe57.ImageFile(str(path), "w")
    image.extensionsAdd("", libe57.E57_V1_0_URI)
    root = image.root()
    scans = libe57.VectorNode(image, True)
    root.set("data3D", scans)
    scan = libe57.StructureNode(image)
    # A quarter turn about z, then a shift.
    pose, turn, shift = (libe57.StructureNode(image) for _ in range(3))
    for name, value in zip("wxyz", [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], strict=True):
        turn.set(name, libe57.FloatNode(image, value))
    for name, value in zip("xyz", [100.0, 200.0, 300.0], strict=True):
        shift.set(name, libe57.FloatNode(image, value))
    pose.set("rotation", turn)
    pose.set("translation", shift)
    scan.set("pose", pose)
    columns = {
        "sphericalRange": radius,
        "sphericalAzimuth": azimuth,
        "sphericalElevation": elevation,
        "sphericalInvalidState": state,
        "intensity": intensity,
    }
    prototype = libe57.StructureNode(image)
    buffers = libe57.VectorSourceDestBuffer()
    for name, column in columns.items():
        node = (
            libe57.IntegerNode(image, 0, 0, 2)
            if column.dtype == np.int8
            else libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE)
        )
        prototype.set(name, node)
        buffers.append(libe57.SourceDestBuffer(image, name, column, 4, True, True))
    points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    scan.set("points", points)
    scans.append(scan)
    writer = points.writer(buffers)
    writer.write(4)
    writer.close()
    image.close()

    with pytest.warns(sb.DroppedPointsWarning, match="left out 1 of 4 points that are marked as"):
        cloud = sb.read(path)
    # Local (1, 0, 0) turns to (0, 1, 0); local (0, 2, 0) to (-2, 0, 0).
    c, s = np.cos(0.7), np.sin(0.7)
    third = [-5 * c * np.sin(-2.0), 5 * c * np.cos(-2.0), 5 * s]
    expected = np.array([[0, 1, 0], [-2, 0, 0], third]) + np.array([100, 200, 300])
    np.testing.assert_allclose(cloud.points, expected, rtol=0, atol=2e-5)
    np.testing.assert_array_equal(cloud.intensities, [1, 2, 3])
    np.testing.assert_array_equal(cloud.viewpoints, [[100, 200, 300]])
    np.testing.assert_allclose(cloud.ranges, [1, 2, 5], rtol=1e-6)  # type: ignore[arg-type]


def test_pye57_reads_what_we_write(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57")
    path = tmp_path / "a.e57"
    colors = np.eye(3, dtype=np.uint8) * 200
    cloud = sb.PointCloud(
        POINTS, colors=colors, viewpoints=[[1, 2, 3], [4, 5, 6]], viewpoint_index=[0, 1, 1]
    )
    sb.write(path, cloud)
    with pye57.E57(str(path)) as file:
        assert file.scan_count == 2
        first, second = (file.read_scan(i, colors=True, ignore_missing_fields=True) for i in (0, 1))
        header = file.get_header(1)
        np.testing.assert_array_equal(header.translation, [4, 5, 6])
    for axis, name in enumerate(("cartesianX", "cartesianY", "cartesianZ")):
        np.testing.assert_allclose(first[name], POINTS[:1, axis])
        np.testing.assert_allclose(second[name], POINTS[1:, axis])
    np.testing.assert_array_equal(second["colorBlue"], [0, 200])


# How formats are told apart


def test_formats_are_told_by_suffix_and_first_bytes(tmp_path: Path) -> None:
    cloud = sb.PointCloud(POINTS)
    sb.write(tmp_path / "a.pcd", cloud)
    data = (tmp_path / "a.pcd").read_bytes()
    np.testing.assert_array_equal(read(tmp_path / "a", data).points, POINTS)
    np.testing.assert_array_equal(read(tmp_path / "A.PCD", data).points, POINTS)
    with pytest.raises(
        sb.FormatError, match="the suffix says ply, but the first bytes say pcd; rename the file"
    ):
        read(tmp_path / "a.ply", data)
    np.testing.assert_array_equal(read(tmp_path / "a.ply", data, format="pcd").points, POINTS)
    with pytest.raises(
        sb.FormatError, match=r"unknown suffix '.stl'; known are .ply, .pcd"
    ) as told:
        read(tmp_path / "a.stl", b"v 1 2 3\n")
    assert str(told.value).count(".asc,") == 1
    with pytest.raises(sb.InvalidInputError, match="format is 'stl', but must be one of ply, pcd"):
        read(tmp_path / "a.stl", b"v 1 2 3\n", format="stl")
    with pytest.raises(
        sb.InvalidInputError, match="is a file, which the format rgbd does not read"
    ):
        read(tmp_path / "a.obj", b"v 1 2 3\n", format="rgbd")


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".las", ".e57", ".npz", ".npy", ".xyz", ".bin"])
def test_missing_and_empty_files(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    with pytest.raises(FileNotFoundError, match=f"a{suffix}"):
        sb.read(path)
    with pytest.raises(sb.FormatError, match="byte 0: the file is empty"):
        read(path, b"")


@pytest.mark.parametrize(
    ("suffix", "package"), [(".las", "laspy"), (".laz", "lazrs"), (".e57", "pye57")]
)
def test_missing_packages_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(sb.MissingDependencyError, match=f"the package {package}: pip install"):
        sb.write(tmp_path / f"a{suffix}", sb.PointCloud(POINTS))


def test_a_viewpoint_can_be_given(tmp_path: Path) -> None:
    path = tmp_path / "a.xyz"
    cloud = read(path, b"1 2 3\n4 5 6\n", viewpoint=(1, 2, 0))
    np.testing.assert_array_equal(cloud.viewpoints, [[1, 2, 0]])
    np.testing.assert_allclose(cloud.ranges, [3, np.sqrt(54)])  # type: ignore[arg-type]
    sb.write(tmp_path / "b.ply", cloud)
    again = sb.read(tmp_path / "b.ply", viewpoint=(9, 9, 9))
    np.testing.assert_array_equal(again.viewpoints, [[1, 2, 0]])
    with pytest.raises(sb.InvalidInputError, match="viewpoint"):
        sb.read(path, viewpoint=(1, 2))
