"""Text files as other programs write them: PTS, PTX, grids, headers, commas, encodings.

Each kind is made here from one small room, whose points, colours and intensities are known; the
files of `../shared/cases`, where they are, have the same room at full size.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb

CASES = Path(__file__).parents[2].parent / "shared" / "cases"

RNG = np.random.default_rng(7)
N = 200
POINTS: NDArray[np.float64] = RNG.integers(0, 4000, (N, 3)) / 1000
COLORS: NDArray[np.int64] = RNG.integers(0, 256, (N, 3))
COLORS[0] = [159, 121, 85]
INTENSITY: NDArray[np.float64] = RNG.integers(1, 1000, N) / 1000
LABELS: NDArray[np.int64] = np.arange(N) % 5


def rows(*columns: NDArray[Any], separator: str = " ", end: str = "\n") -> str:
    """Numbers with the digits that read back the same."""
    table = np.column_stack([np.asarray(c, object).reshape(len(c), -1) for c in columns])
    return end.join(separator.join(map(str, row)) for row in table.tolist()) + end


def read(path: Path, text: str | bytes, **options: Any) -> sb.PointCloud:
    """Reads a file of this text, with every warning an error."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return sb.read(path, **options)


def check(
    cloud: sb.PointCloud,
    *,
    colors: bool = False,
    intensities: NDArray[Any] | None = None,
    shift: tuple[float, float, float] = (0, 0, 0),
) -> None:
    """The room, with what the file had and nothing else."""
    np.testing.assert_allclose(cloud.points, POINTS + shift, rtol=0, atol=2e-6)
    expected = (["colors"] if colors else []) + (["intensities"] if intensities is not None else [])
    known = ("colors", "intensities", "normals")
    assert [name for name in cloud.attributes if name in known] == expected
    if colors:
        np.testing.assert_array_equal(cloud.colors, COLORS)
    if intensities is not None:
        np.testing.assert_allclose(cloud.intensities, intensities, rtol=1e-6)


# Columns without names


def test_labels_behind_colours(tmp_path: Path) -> None:
    cloud = read(tmp_path / "a.txt", rows(POINTS, COLORS, LABELS))
    check(cloud, colors=True)
    np.testing.assert_array_equal(cloud["label"], LABELS)
    assert cloud["label"].dtype == np.int32


def test_labels_before_colours(tmp_path: Path) -> None:
    cloud = read(tmp_path / "a.txt", rows(POINTS, LABELS, COLORS))
    check(cloud, colors=True)
    np.testing.assert_array_equal(cloud["label"], LABELS)


def test_labels_behind_positions_are_no_intensities(tmp_path: Path) -> None:
    cloud = read(tmp_path / "a.txt", rows(POINTS, LABELS))
    check(cloud)
    np.testing.assert_array_equal(cloud["label"], LABELS)


@pytest.mark.parametrize("factor", [256, 257])
def test_colours_of_16_bits(tmp_path: Path, factor: int) -> None:
    check(read(tmp_path / "a.txt", rows(POINTS, COLORS * factor)), colors=True)


def test_normals_must_have_length_one(tmp_path: Path) -> None:
    angle = np.linspace(0, 6, N)
    normals = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]).round(3)
    cloud = read(tmp_path / "a.txt", rows(POINTS, normals))
    np.testing.assert_allclose(cloud.normals, normals, atol=1e-3)
    normals[0] = 0
    assert read(tmp_path / "a.txt", rows(POINTS, normals)).normals is not None
    # A tenth off is no rounding, and all of them are no strays.
    normals *= 1.1
    with pytest.raises(sb.FormatError, match=r"cannot tell what 6 columns mean.*columns="):
        read(tmp_path / "a.txt", rows(POINTS, normals))


@pytest.mark.parametrize(
    ("columns", "readings"),
    [
        # 8-bit intensities could be a channel, and the other way round.
        ((POINTS, COLORS, COLORS[:, 0]), "7 columns mean: x y z intensity red green blue or"),
        # Forty values in 200 points: labels of instances or weak intensities.
        ((POINTS, np.arange(N) % 40), "4 columns mean: x y z intensity or x y z label"),
        ((POINTS, COLORS * 300), "6 columns mean: known are"),
        ((POINTS, COLORS - 1), "6 columns mean: known are"),
        ((POINTS, COLORS, LABELS, LABELS), "8 columns mean"),
    ],
)
def test_what_fits_twice_or_never_is_refused(
    tmp_path: Path, columns: tuple[NDArray[Any], ...], readings: str
) -> None:
    with pytest.raises(sb.FormatError, match=rf"{readings}.*columns="):
        read(tmp_path / "a.txt", rows(*columns))


def test_columns_settle_what_values_cannot(tmp_path: Path) -> None:
    text = rows(POINTS, COLORS, COLORS[:, 0])
    names = ["x", "y", "z", "red", "green", "blue", "intensity"]
    cloud = read(tmp_path / "a.txt", text, columns=names)
    check(cloud, colors=True, intensities=COLORS[:, 0])
    check(read(tmp_path / "a.txt", text, columns=[*names[:3], *"_" * 4]))
    check(read(tmp_path / "a.txt", text, columns=[*names[:6], "_"]), colors=True)


def test_columns_may_follow_prose(tmp_path: Path) -> None:
    text = "Scan of a room\nby somebody\n" + rows(POINTS, INTENSITY)
    with pytest.raises(sb.FormatError, match=r"line 1: neither numbers nor .*columns="):
        read(tmp_path / "a.txt", text)
    cloud = read(tmp_path / "a.txt", text, columns=["x", "y", "z", "intensity"])
    check(cloud, intensities=INTENSITY)


# Names


@pytest.mark.parametrize(
    "header",
    [
        "//X;Y;Z;Rf;Gf;Bf;Intensity",
        "//X Y Z Rf Gf Bf Intensity",
        f"//X;Y;Z;Rf;Gf;Bf;Intensity\n{N}",
    ],
)
def test_cloudcompare(tmp_path: Path, header: str) -> None:
    separator = ";" if ";" in header else " "
    body = rows(POINTS, COLORS / 255, INTENSITY, separator=separator)
    check(read(tmp_path / "a.txt", f"{header}\n{body}"), colors=True, intensities=INTENSITY)


def test_colours_of_0_and_1_by_either_name(tmp_path: Path) -> None:
    def first(header: str, row: str) -> list[int]:
        colors = read(tmp_path / "a.txt", f"{header}\n{row}\n").colors
        assert colors is not None
        return [int(c) for c in colors[0]]

    assert first("//X Y Z Rf Gf Bf", "0 0 0 1 0 1") == [255, 0, 255]
    assert first("//X Y Z R G B", "0 0 0 1 0 1") == [1, 0, 1]
    assert first("//X Y Z R G B", "0 0 0 1.0 0.0 1.0") == [255, 0, 255]
    assert first("//X Y Z R G B", "0 0 0 1.0 0.0 255.0") == [1, 0, 255]


def test_named_colours_of_16_bits_as_floats(tmp_path: Path) -> None:
    body = rows(POINTS, COLORS * 256.0, separator=",")
    check(read(tmp_path / "a.csv", '"X","Y","Z","Red","Green","Blue"\n' + body), colors=True)


@pytest.mark.parametrize(
    "header",
    [
        "Easting,Northing,Elevation",
        "POINT_X,POINT_Y,POINT_Z",
        "Points:0,Points:1,Points:2",
        '"Points_m_XYZ:0","Points_m_XYZ:1","Points_m_XYZ:2"',
        "E,N,Z",
        "e,n,h",
        "E [m],N [m],H [m]",
        "X [m],Y [m],Z [m]",
        "Rechtswert,Hochwert,Höhe",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_positions_by_other_names(tmp_path: Path, header: str, encoding: str) -> None:
    shift = (500_000, 5_400_000, 100)
    text = header + "\n" + rows((POINTS + shift).round(3), separator=",")
    check(read(tmp_path / "a.csv", text.encode(encoding)), shift=shift)


def test_surveyed_points_with_codes(tmp_path: Path) -> None:
    # Point, northing, easting, elevation and a description, which may hold the delimiter.
    lines = [f"{i},{y},{x},{z},TREE, OAK" for i, (x, y, z) in enumerate(POINTS)]
    (tmp_path / "a.csv").write_text("P,N,E,Z,D\n" + "\n".join(lines))
    with pytest.warns(sb.LostAttributeWarning, match="left aside: column 'D', which does not h"):
        check(sb.read(tmp_path / "a.csv"))


def test_named_columns_that_are_no_numbers_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("name,x,y,z\na b,0.5,-1.25,2\n,3,4.5,-6.75\n")
    with pytest.warns(sb.LostAttributeWarning, match="left aside: column 'name', which does"):
        cloud = sb.read(path)
    np.testing.assert_array_equal(cloud.points, [[0.5, -1.25, 2], [3, 4.5, -6.75]])
    # A number in the first row and none in a later one.
    path.write_text("x,y,z,time\n0.5,-1.25,2,7\n3,4.5,-6.75,n/a\n")
    with pytest.warns(sb.LostAttributeWarning, match="'time'"):
        np.testing.assert_array_equal(sb.read(path).points, cloud.points)


def test_all_other_columns_of_numbers_are_kept(tmp_path: Path) -> None:
    times = 1.7e9 + np.arange(N) / 8
    header = "x,y,z,Label,Original cloud index,time [s],rgb\n"
    bits = COLORS @ [1 << 16, 1 << 8, 1]
    body = rows(POINTS, LABELS, np.arange(N) + 2**33, times, bits, separator=",")
    cloud = read(tmp_path / "a.csv", header + body)
    check(cloud, colors=True)
    assert sorted(cloud.extra) == ["Original cloud index", "label", "time [s]"]
    np.testing.assert_array_equal(cloud["label"], LABELS)
    np.testing.assert_array_equal(cloud["Original cloud index"], np.arange(N) + 2**33)
    np.testing.assert_array_equal(cloud["time [s]"], times)


@pytest.mark.parametrize("decimals", [",", "."])
def test_semicolons_and_decimal_commas(tmp_path: Path, decimals: str) -> None:
    for separator in ("; ", ";", "\t", " "):
        body = rows(POINTS, COLORS, separator=separator).replace(".", decimals)
        header = separator.join("XYZRGB")
        check(read(tmp_path / "a.csv", f"{header}\n{body}"), colors=True)


def test_a_second_column_of_a_name_is_named(tmp_path: Path) -> None:
    # LidarView writes positions twice.
    path = tmp_path / "a.csv"
    header = '"Points_m_XYZ:0","Points_m_XYZ:1","Points_m_XYZ:2","X","Y","Z","distance_m"\n'
    path.write_text(header + rows(POINTS, POINTS, INTENSITY, separator=","))
    with pytest.warns(sb.LostAttributeWarning, match=r"column 'X', another x, column 'Y', another"):
        cloud = sb.read(path)
    check(cloud)
    np.testing.assert_allclose(cloud.ranges, INTENSITY, rtol=1e-6)  # type: ignore[arg-type]


@pytest.mark.parametrize("end", ["", ";"])
def test_lines_that_end_in_a_delimiter(tmp_path: Path, end: str) -> None:
    body = rows(POINTS, COLORS, separator=";", end=f"{end}\n")
    for header in ("X;Y;Z;R;G;B\n", "X;Y;Z;R;G;B;\n", "sep=;\nX;Y;Z;R;G;B\n"):
        check(read(tmp_path / "a.csv", header + body), colors=True)


def test_more_values_than_names_are_refused(tmp_path: Path) -> None:
    # Commas between the columns and in the numbers.
    text = "X,Y,Z\n" + "1,5,2,5,3,5\n" * 3
    with pytest.raises(sb.FormatError, match=r"line 2: 6 values for the 3 columns 'X Y Z'; name"):
        read(tmp_path / "a.csv", text)


# Units


@pytest.mark.parametrize(
    ("header", "metres"),
    [
        ("X [mm],Y [mm],Z [mm],Range(m)", 0.001),
        ("x(mm),y(mm),z(mm),range[m]", 0.001),
        ("X (ft),Y (ft),Z (ft),Range (m)", 0.3048),
        ("X [US survey feet],Y [US survey feet],Z [US survey feet],Range", 1200 / 3937),
        ("x,y,z,range", 1.0),
    ],
)
def test_units_in_brackets(tmp_path: Path, header: str, metres: float) -> None:
    written = (POINTS / metres).round(9)
    for separator in (",", " "):
        names = header.replace(",", separator)
        text = f"{names}\n" + rows(written, INTENSITY, separator=separator)
        cloud = read(tmp_path / "a.txt", text)
        check(cloud)
        np.testing.assert_allclose(cloud.ranges, INTENSITY, rtol=1e-6)  # type: ignore[arg-type]


def test_a_unit_that_contradicts_the_file_is_refused(tmp_path: Path) -> None:
    text = "X [mm],Y [mm],Z [mm]\n" + rows(POINTS * 1000, separator=",")
    check(read(tmp_path / "a.csv", text, unit="mm"))
    with pytest.raises(sb.InvalidInputError, match=r"unit is 'cm', .* since column 'X \[mm\]'"):
        read(tmp_path / "a.csv", text, unit="cm")
    with pytest.raises(sb.FormatError, match=r"column 'X \(deg\)' has the unit 'deg', which is no"):
        read(tmp_path / "a.csv", text.replace("[mm]", "(deg)"))


@pytest.mark.parametrize(
    ("unit", "metres"),
    [("mm", 1e-3), ("cm", 1e-2), ("m", 1), ("km", 1e3), ("ft", 0.3048), ("in", 0.0254)],
)
def test_a_given_unit_scales_all_lengths(tmp_path: Path, unit: str, metres: float) -> None:
    for suffix in (".xyz", ".ply"):
        path = tmp_path / f"a{suffix}"
        where = np.array([[500.0, 200, 100]])
        cloud = sb.PointCloud(
            POINTS + where,
            colors=COLORS.astype(np.uint8),
            ranges=INTENSITY,
            viewpoints=where,
            viewpoint_index=np.zeros(N, np.uint32),
        )
        sb.write(path, cloud)
        again = sb.read(path, unit=unit)
        np.testing.assert_allclose(again.points, cloud.points * metres, rtol=1e-6)
        np.testing.assert_allclose(again.ranges, INTENSITY * metres, rtol=1e-6)  # type: ignore[arg-type]
        np.testing.assert_allclose(again.viewpoints, where * metres, rtol=1e-12)  # type: ignore[arg-type]
        np.testing.assert_array_equal(again.colors, cloud.colors)
    with pytest.raises(sb.InvalidInputError, match=r"unit is 'yd', but must be one of mm, cm, m"):
        sb.read(path, unit="yd")


# Encodings, ends of lines, blemishes


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_ends_of_lines(tmp_path: Path, encoding: str, end: str) -> None:
    text = f"X Y Z Intensity{end}" + rows(POINTS, INTENSITY, end=end)
    check(read(tmp_path / "a.txt", text.encode(encoding)), intensities=INTENSITY)


@pytest.mark.parametrize(
    "comment", ["# gemessen in Köln".encode("latin-1"), "# 点云数据".encode("gbk"), b"# \xff\x00"]
)
def test_comments_of_any_encoding(tmp_path: Path, comment: bytes) -> None:
    check(read(tmp_path / "a.txt", comment + b"\n" + rows(POINTS).encode()))


@pytest.mark.parametrize("word", ["-nan(ind)", "1.#QNAN", "-1.#IND00", "nan", "1.#INF", "1,#QNAN"])
def test_points_that_are_no_numbers_are_counted(tmp_path: Path, word: str) -> None:
    separator = ";" if "," in word else " "
    text = rows(POINTS, separator=separator) + separator.join([word] * 3) + "\n"
    if "," in word:
        text = text.replace(".", ",")
    (tmp_path / "a.txt").write_text(text)
    with pytest.warns(sb.DroppedPointsWarning, match="1 "):
        check(sb.read(tmp_path / "a.txt"))


def test_quoted_numbers(tmp_path: Path) -> None:
    lines = [",".join(f'"{c}"' for c in row) for row in POINTS.tolist()]
    check(read(tmp_path / "a.csv", '"X","Y","Z"\n' + "\n".join(lines)))


# PTS


LEICA = np.rint(INTENSITY * 4095 - 2048).astype(int)


@pytest.mark.parametrize("suffix", [".pts", ".txt"])
def test_pts(tmp_path: Path, suffix: str) -> None:
    text = f"{N}\n" + rows(POINTS, LEICA, COLORS)
    check(read(tmp_path / f"a{suffix}", text), colors=True, intensities=LEICA)


def test_pts_intensities_come_before_colours(tmp_path: Path) -> None:
    # By their values alone these would fit twice.
    text = f"{N}\n" + rows(POINTS, COLORS[:, 1], COLORS)
    check(read(tmp_path / "a.pts", text), colors=True, intensities=COLORS[:, 1])
    check(read(tmp_path / "a.pts", f"{N}\n" + rows(POINTS, LABELS)), intensities=LABELS)
    check(read(tmp_path / "a.pts", f"{N}\n" + rows(POINTS, COLORS)), colors=True)
    check(read(tmp_path / "a.pts", rows(POINTS)))
    with pytest.raises(sb.FormatError, match="rows of PTS have 3, 4, 6 or 7 values, not 5"):
        read(tmp_path / "a.pts", "1\n1 2 3 4 5\n")


def test_pts_of_several_scans_and_wrong_counts(tmp_path: Path) -> None:
    path = tmp_path / "a.pts"
    lines = rows(POINTS).splitlines(keepends=True)
    check(read(path, "".join(["150\n", *lines[:150], "50\n", *lines[150:]])))
    with pytest.raises(sb.FormatError, match="the file ends after 200 of 201 rows"):
        read(path, "201\n" + "".join(lines))
    path.write_text("199\n" + "".join(lines))
    with pytest.warns(UserWarning, match="has 200 rows, but says 199; all are read"):
        check(sb.read(path))
    with pytest.raises(sb.FormatError, match=r"two lines with a single number.*format='ptx'"):
        read(tmp_path / "a.txt", "2\n3\n1 2 3\n")


# PTX


def ptx_scan(
    columns: int, matrix: NDArray[np.float64], cells: NDArray[Any], position: str = "0 0 0"
) -> str:
    head = [str(columns), str(len(cells) // columns), position, "1 0 0", "0 1 0", "0 0 1"]
    body = [" ".join(map(str, row)) for row in [*matrix.tolist(), *cells.tolist()]]
    return "\n".join([*head, *body]) + "\n"


def test_ptx_of_several_scans_with_poses(tmp_path: Path) -> None:
    cells = np.column_stack([POINTS, INTENSITY, COLORS]).astype(object)
    cells[:, 4:] = COLORS
    cells[[3, 150], :3] = 0
    # A quarter turn about z, for row vectors, and a shift far away.
    turned = np.array([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [5e5, 5.4e6, 100, 1.0]])
    shifted = np.eye(4)
    shifted[3, :3] = [5e5, 5.4e6, 0]
    text = ptx_scan(10, shifted, cells[:100]) + ptx_scan(4, turned, cells[100:])
    path = tmp_path / "a.ptx"
    path.write_text(text)
    with pytest.warns(sb.DroppedPointsWarning, match="left out 2 of 200 cells"):
        cloud = sb.read(path)
    seen = np.delete(np.arange(N), [3, 150])
    expected = POINTS + shifted[3, :3]
    x, y, z = POINTS[100:].T
    expected[100:] = np.column_stack([5e5 - y, 5.4e6 + x, 100 + z])
    np.testing.assert_allclose(cloud.points, expected[seen], rtol=0, atol=1e-3)
    np.testing.assert_array_equal(cloud.colors, COLORS[seen])
    np.testing.assert_allclose(cloud.intensities, INTENSITY[seen], rtol=1e-6)  # type: ignore[arg-type]
    np.testing.assert_allclose(
        cloud.ranges,  # type: ignore[arg-type]
        np.linalg.norm(POINTS, axis=1)[seen],
        rtol=1e-6,
    )
    np.testing.assert_array_equal(cloud.viewpoints, [[5e5, 5.4e6, 0], [5e5, 5.4e6, 100]])
    np.testing.assert_array_equal(cloud.viewpoint_index, seen >= 100)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda s: s.replace("10\n20\n", "10\n2000000\n", 1), "line 2: a grid of 10 x 2000000"),
        (lambda s: s.replace("10\n20\n", "ten\n20\n", 1), "line 1: expected the number of columns"),
        (lambda s: s[: s.rindex("\n", 0, -9)], "the file ends after 199 of 200 rows"),
        (lambda s: s.replace("0.0 0.0 0.0 1.0", "0.0 0.0 0.0 2.0"), "line 10: the matrix above"),
        (lambda s: s + "7", "a grid of 7 x 0 cells does not fit"),
        (lambda s: s.replace("1 0 0\n", "1 0\n", 1), "line 4: cannot read a row of 3 numbers"),
    ],
)
def test_broken_ptx(tmp_path: Path, edit: Callable[[str], str], message: str) -> None:
    text = ptx_scan(10, np.eye(4), np.column_stack([POINTS, INTENSITY]))
    check(read(tmp_path / "a.ptx", text), intensities=INTENSITY)
    with pytest.raises(sb.FormatError, match=message):
        read(tmp_path / "a.ptx", edit(text))


# ESRI grids


GRID = """ncols 3
nrows 2
xllcorner 500000
yllcorner 5400000
cellsize 2
NODATA_value -9999
1.5 2.5 -9999
3.5 4.5 5.5
"""


@pytest.mark.parametrize("suffix", [".asc", ".grd", ".txt"])
def test_esri_grid(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_text(GRID)
    format_ = "esri_grid" if suffix == ".txt" else None
    with pytest.warns(sb.DroppedPointsWarning, match="left out 1 of 6 cells, which have no height"):
        cloud = sb.read(path, format=format_)
    # Cells count from the north-west, the corner is the south-western one.
    expected = np.array([[1, 3, 1.5], [3, 3, 2.5], [1, 1, 3.5], [3, 1, 4.5], [5, 1, 5.5]])
    expected += np.array([500_000, 5_400_000, 0])
    np.testing.assert_allclose(cloud.points, expected, rtol=0, atol=1e-6)
    path.write_text(GRID.replace("corner", "center").replace("-9999\n3", "9\n3"))
    np.testing.assert_allclose(sb.read(path, format=format_).points[0], [500_000, 5_400_002, 1.5])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("ncols 3", "ncols 30000000", "30000000 x 2 cells do not fit the"),
        ("ncols 3", "ncols 3.5", r"the header has ncols 3\.5"),
        ("ncols 3", "ncols -3", "the header has ncols -3"),
        ("cellsize 2\n", "", "the header has cellsize None"),
        ("cellsize 2", "cellsize two", "line 5: cellsize must have one number"),
        ("xllcorner 500000\n", "", "neither xllcorner nor xllcenter"),
        ("4.5", "four", "not a number|ends after"),
        (" 5.5", "", "ends after 5 of 6 heights"),
    ],
)
def test_broken_esri_grid(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(sb.FormatError, match=message):
        read(tmp_path / "a.asc", GRID.replace(old, new))


# Altered files


def altered_files() -> list[tuple[str, bytes]]:
    few = slice(0, 10)
    cells = np.column_stack([POINTS[few], INTENSITY[few]])
    return [
        ("a.pts", f"10\n{rows(POINTS[few], LEICA[few], COLORS[few])}".encode()),
        ("a.ptx", ptx_scan(5, np.eye(4), cells).encode()),
        ("a.asc", GRID.encode()),
        ("a.txt", f"X [mm];Y [mm];Z [mm]\n{rows(POINTS[few], separator=';')}".encode("utf-16")),
        ("a.csv", f"x,y,z,label\r{rows(POINTS[few], LABELS[few], separator=',')}".encode()),
    ]


@pytest.mark.parametrize(("name", "data"), altered_files())
def test_altered_files_give_a_cloud_or_an_error_that_names_them(
    tmp_path: Path, name: str, data: bytes
) -> None:
    path = tmp_path / name
    rng = np.random.default_rng(0)
    for _ in range(150):
        changed = bytearray(data)
        for at in rng.integers(0, len(data), 3):
            changed[at] = rng.choice(np.frombuffer(b"\0\t\n\r ,;.-0159enx\x7f\xff", np.uint8))
        path.write_bytes(changed[: rng.integers(1, 2 * len(data))])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                sb.read(path)
            except sb.FormatError as error:
                assert str(path) in str(error)  # noqa: PT017


# The files of others


def mean_color(cloud: sb.PointCloud) -> NDArray[np.float64]:
    assert cloud.colors is not None
    return np.asarray(cloud.colors, np.float64).mean(axis=0)


@pytest.mark.parametrize(
    ("name", "colors", "intensity"),
    [
        ("txt_xyzrgbl", True, None),
        ("txt_rgb16_unnamed", True, None),
        ("txt_xyzl", False, None),
        ("txt_rgb16_named_float", True, None),
        ("cc_ascii_count", True, 0.536),
        ("cc_ascii_rf", True, 0.536),
        ("pts_leica", True, 0.536 * 4095 - 2048),
        ("pts_as_txt", True, 0.536 * 4095 - 2048),
        ("fmt_ptx", True, 0.536),
        ("csv_easting", False, 0.536 * 255),
        ("csv_decimal_comma", True, None),
        ("xyz_utf16", False, None),
    ],
)
def test_cases(name: str, colors: bool, intensity: float | None) -> None:
    folder = CASES / name
    if not folder.is_dir():
        pytest.skip(f"the cases are not at {CASES}; the same kinds are generated above")
    (path,) = folder.iterdir()
    cloud = sb.read(path)
    shift = (500_000, 5_400_000, 0) if name == "csv_easting" else (0, 0, 0)
    low, high = cloud.bounds or ([], [])
    assert len(cloud) == 3000
    np.testing.assert_allclose(low, np.add([-0.006, -0.006, -0.006], shift), rtol=0, atol=1.1e-3)
    np.testing.assert_allclose(high, np.add([3.998, 2.999, 2.499], shift), rtol=0, atol=1.1e-3)
    assert cloud.normals is None
    assert list(cloud.extra) == (["label"] if name in ("txt_xyzrgbl", "txt_xyzl") else [])
    assert (cloud.colors is not None) == colors
    if colors:
        np.testing.assert_allclose(mean_color(cloud), [140.5, 136.9, 132.6], rtol=0, atol=0.1)
        np.testing.assert_array_equal(cloud.colors[0], [159, 121, 85])  # type: ignore[index]
    assert (cloud.intensities is not None) == (intensity is not None)
    if intensity is not None:
        found = float(np.mean(cloud.intensities))  # type: ignore[arg-type]
        assert found == pytest.approx(intensity, rel=0.01)
