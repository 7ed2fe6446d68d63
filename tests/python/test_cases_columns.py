"""Columns of other tools' files are read for what they are: nothing is invented, nothing is lost
without a word."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import case_files as made
import surfabet as sb
from case_files import CASES, UTM, WITHOUT_CASES, Room

ROOM = Room()
N = len(ROOM.points)


def told(path: Path, **options: Any) -> tuple[sb.PointCloud, str]:
    """The cloud, and the one warning that reading it gave, or an empty text."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        cloud = sb.read(path, **options)
    assert len(caught) <= 1
    return cloud, str(caught[0].message) if caught else ""


def read(path: Path, data: bytes, **options: Any) -> tuple[sb.PointCloud, str]:
    path.write_bytes(data)
    return told(path, **options)


def assert_room(cloud: sb.PointCloud, *, colors: bool = True) -> None:
    np.testing.assert_allclose(cloud.points, ROOM.points, rtol=0, atol=1e-5)
    if colors:
        np.testing.assert_array_equal(cloud.colors, ROOM.colors)


# PLY


def test_ply_scalar_fields_keep_their_names(tmp_path: Path) -> None:
    time = np.linspace(0, 1, N, dtype=np.float32)
    columns = ROOM.columns() | ROOM.rgb() | {"scalar_Intensity": ROOM.intensities}
    columns |= {"scalar_GPSTime": time, "scalar_Original cloud index".replace(" ", "_"): time}
    cloud, said = read(tmp_path / "a.ply", made.ply(columns))
    assert_room(cloud)
    assert said == ""
    assert cloud.attributes == [
        "colors", "intensities", "scalar_GPSTime", "scalar_Original_cloud_index"
    ]  # fmt: skip
    np.testing.assert_array_equal(cloud["scalar_GPSTime"], time)


def test_a_splat_is_read_as_points_and_named(tmp_path: Path) -> None:
    zero = np.zeros(N, np.float32)
    columns = ROOM.columns() | {name: zero for name in ("nx", "ny", "nz")}
    for k in range(3):
        columns[f"f_dc_{k}"] = ((ROOM.colors[:, k] / 255 - 0.5) / 0.2820948).astype(np.float32)
    columns |= {"opacity": zero + 2, "scale_0": zero - 4, "rot_0": zero + 1}
    cloud, said = read(tmp_path / "a.ply", made.ply(columns))
    assert_room(cloud)
    assert "3D Gaussian splat" in said
    assert cloud.normals is None
    assert cloud["opacity"][0] == 2


@pytest.mark.parametrize("name", ["rgb", "rgba"])
@pytest.mark.parametrize("dtype", ["u4", "i4", "f4"])
def test_packed_colors(tmp_path: Path, name: str, dtype: str) -> None:
    red, green, blue = ROOM.colors.T.astype(np.uint32)
    alpha = 0 if dtype == "f4" else 255
    packed = (np.uint32(alpha) << np.uint32(24)) | red << 16 | green << 8 | blue
    cloud, said = read(tmp_path / "a.ply", made.ply(ROOM.columns() | {name: packed.view(dtype)}))
    assert_room(cloud)
    assert (cloud.attributes, said) == (["colors"], "")
    cloud, _ = read(tmp_path / "a.pcd", made.pcd(ROOM.columns() | {name: packed.view(dtype)}))
    assert_room(cloud)


def test_alpha_that_differs_is_kept(tmp_path: Path) -> None:
    alpha = np.arange(N, dtype=np.uint32) % 256
    red, green, blue = ROOM.colors.T.astype(np.uint32)
    packed = alpha << 24 | red << 16 | green << 8 | blue
    cloud, _ = read(tmp_path / "a.ply", made.ply(ROOM.columns() | {"rgba": packed}))
    assert_room(cloud)
    np.testing.assert_array_equal(cloud["alpha"], alpha)


@pytest.mark.parametrize(
    "line", ["comment exported from Jörg".encode("latin-1"), "comment Größe".encode()]
)
def test_comments_in_any_encoding(tmp_path: Path, line: bytes) -> None:
    cloud, said = read(tmp_path / "a.ply", made.ply(ROOM.columns() | ROOM.rgb(), lines=[line]))
    assert_room(cloud)
    assert said == ""


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_a_byte_order_mark_is_passed_over(tmp_path: Path, suffix: str) -> None:
    data = {".ply": made.ply, ".pcd": made.pcd}[suffix](ROOM.columns())
    cloud, said = read(tmp_path / f"a{suffix}", b"\xef\xbb\xbf" + data)
    assert_room(cloud, colors=False)
    assert said == ""


def test_numbers_as_c_prints_them(tmp_path: Path) -> None:
    rows = ["0x1.8p+1 -0X1p-2 1", "-nan(ind) 0 0", "0 1.#QNAN 0", "0 0 1.#IND", "-1.#INF 0 0"]
    columns = {axis: np.zeros(5, np.float32) for axis in "xyz"}
    cloud, said = read(tmp_path / "a.ply", made.ply(columns, rows=rows))
    np.testing.assert_array_equal(cloud.points, [[3, -0.25, 1]])
    assert "dropped 4 of 5 points" in said


def test_integers_of_64_bits_in_text(tmp_path: Path) -> None:
    stamps = np.array([1_700_000_000_123_456_789, 2**63 - 1, -(2**53) - 1])
    columns = {axis: np.arange(1, 4).astype(np.float32) for axis in "xyz"} | {"stamp": stamps}
    rows = [f"{i} {i} {i} {stamp}" for i, stamp in enumerate(stamps, 1)]
    for suffix, make in ((".ply", made.ply), (".pcd", made.pcd)):
        cloud, _ = read(tmp_path / f"a{suffix}", make(columns, rows=rows))
        assert cloud["stamp"].dtype == np.int64
        np.testing.assert_array_equal(cloud["stamp"], stamps)


def test_normals_are_unit_vectors_or_columns(tmp_path: Path) -> None:
    names = ("nx", "ny", "nz")
    unit = dict(zip(names, ROOM.normals.T * np.float32(0.98), strict=True))
    cloud, said = read(tmp_path / "a.ply", made.ply(ROOM.columns() | unit))
    assert (cloud.attributes, said) == (["normals"], "")
    long = {name: column * np.float32(60_000) for name, column in unit.items()}
    cloud, said = read(tmp_path / "a.ply", made.ply(ROOM.columns() | long))
    assert cloud.attributes == [*names]
    assert "nx, ny, nz are no unit vectors" in said


def test_names_of_the_cloud_itself_are_not_taken(tmp_path: Path) -> None:
    columns = ROOM.columns() | {"points": ROOM.intensities, "Range": np.arange(N, dtype=np.int32)}
    cloud, said = read(tmp_path / "a.ply", made.ply(columns))
    assert cloud.attributes == ["points_", "Range"]
    assert "column 'points' is called 'points_' here" in said


# PCD


def test_pcd_fields_of_any_type_and_count(tmp_path: Path) -> None:
    ring = (np.arange(N) % 32).astype(np.uint16)
    time = 1.7e9 + np.arange(N) * 1e-5
    signature = np.arange(N * 33, dtype=np.float32).reshape(N, 33)
    columns = ROOM.columns() | {"intensity": ROOM.intensities, "ring": ring, "timestamp": time}
    cloud, said = read(tmp_path / "a.pcd", made.pcd(columns | {"fpfh": signature}))
    assert cloud.attributes[:3] == ["intensities", "ring", "timestamp"]
    np.testing.assert_array_equal(cloud["ring"], ring)
    np.testing.assert_array_equal(cloud["timestamp"], time)
    np.testing.assert_array_equal(cloud["fpfh_32"], signature[:, 32])
    assert said == ""


def with_no_returns(points: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    points = points.copy()
    empty = np.random.default_rng(4).permutation(N)[: N // 3]
    points[empty] = 0
    points[empty[0]] = -0.0
    return points


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npz", ".npy", ".xyz", ".e57", ".bin"])
def test_points_at_exactly_zero_are_no_returns(tmp_path: Path, suffix: str) -> None:
    points = with_no_returns(ROOM.points)
    path = tmp_path / f"a{suffix}"
    columns = dict(zip("xyz", points.T, strict=True))
    match suffix:
        case ".ply" | ".pcd":
            path.write_bytes((made.ply if suffix == ".ply" else made.pcd)(columns))
        case ".npz":
            np.savez(path, points=points)
        case ".npy":
            np.save(path, points)
        case ".xyz":
            np.savetxt(path, points, fmt="%.9g")
        case ".bin":
            points[points != 0] -= np.float32(1.5)
            np.column_stack([points, ROOM.intensities]).astype("<f4").tofile(path)
        case _:
            made.e57(path, {f"cartesian{axis.upper()}": c for axis, c in columns.items()})
    cloud, said = told(path)
    assert f"left out {N // 3} of {N} points" in said
    assert "0 0 0 (no returns)" in said
    kept = points[(points != 0).any(axis=1)]
    np.testing.assert_allclose(cloud.points, kept, rtol=0, atol=1e-6)


def test_a_point_at_zero_may_be_a_measurement(tmp_path: Path) -> None:
    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * 3), axis=-1).reshape(-1, 3)
    # On a grid of millimetres a dense scan through the origin has several points at one place.
    rounded = np.random.default_rng(2).integers(-2, 3, (2000, 3)) * 1e-3
    for points in (grid, np.zeros((4, 3)), rounded):
        np.save(tmp_path / "a.npy", points)
        cloud, said = told(tmp_path / "a.npy")
        assert (len(cloud), said) == (len(points), "")
    # Nobody measures one point a thousand kilometres away from all others.
    np.save(tmp_path / "a.npy", np.vstack([grid + UTM, np.zeros((1, 3))]))
    cloud, said = told(tmp_path / "a.npy")
    assert len(cloud) == len(grid)
    assert "left out 1 of 28 points" in said


@pytest.mark.parametrize(
    "text", ["nan nan nan nan nan nan nan", "nan 0 0 1 0 0 0", "inf 0 0 1 0 0 0"]
)
def test_a_viewpoint_that_is_not_finite_is_left_aside(tmp_path: Path, text: str) -> None:
    cloud, said = read(tmp_path / "a.pcd", made.pcd(ROOM.columns(), viewpoint=text))
    assert_room(cloud, colors=False)
    assert cloud.viewpoints is None
    assert "VIEWPOINT, which is not finite" in said


@pytest.mark.parametrize("alpha", [0, 255])
def test_packed_colors_as_digits_of_a_float(tmp_path: Path, alpha: int) -> None:
    red, green, blue = ROOM.colors.T.astype(np.uint64)
    packed = np.uint64(alpha << 24) | red << np.uint64(16) | green << np.uint64(8) | blue
    columns = ROOM.columns() | {"rgb": np.zeros(N, np.float32)}
    rows = [f"{x} {y} {z} {c}" for (x, y, z), c in zip(ROOM.points, packed, strict=True)]
    cloud, _ = read(tmp_path / "a.pcd", made.pcd(columns, rows=rows))
    assert_room(cloud)
    columns = {name: np.append(c, c[:1]) for name, c in columns.items()}
    cloud, said = read(tmp_path / "a.pcd", made.pcd(columns, rows=[*rows, "nan nan nan nan"]))
    assert_room(cloud)
    assert "dropped 1 of" in said


# LAS and LAZ


@pytest.mark.parametrize("modern", [False, True])
def test_angles_in_degrees(tmp_path: Path, modern: bool) -> None:
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    degrees = (np.arange(N) % 181 - 90).astype(np.int8)
    extra = {"scan_angle_rank": degrees, "classification": np.full(N, 40 if modern else 6)}
    sb.write(tmp_path / "a.laz", sb.PointCloud(ROOM.points, extra=extra))
    found = laspy.read(tmp_path / "a.laz")
    if modern:
        np.testing.assert_allclose(found.scan_angle * 0.006, degrees, rtol=0, atol=0.003)
    else:
        np.testing.assert_array_equal(found.scan_angle_rank, degrees)
    np.testing.assert_array_equal(found.classification, extra["classification"])


def test_waveforms_are_left_aside(tmp_path: Path) -> None:
    fields = {"intensity": 7, "wavepacket_index": 1, "classification": 2}
    cloud, said = told(made.las(tmp_path / "a.las", ROOM.points, fields, point_format=9))
    assert cloud.attributes == ["intensities", "classification"]
    assert "left aside: waveforms (wavepacket_index, wavepacket_offset," in said


def rgb16(factor: int = 256) -> dict[str, Any]:
    return {name: c.astype(np.uint16) * factor for name, c in ROOM.rgb().items()}


FIELDS: dict[str, Any] = {
    "intensity": np.arange(N, dtype=np.uint16),
    "classification": np.where(np.arange(N) % 2, 2, 6).astype(np.uint8),
    "gps_time": 3e8 + np.arange(N) * 1e-4,
    "return_number": (1 + np.arange(N) % 2).astype(np.uint8),
    "number_of_returns": np.uint8(2),
    "point_source_id": np.uint16(7),
    "user_data": (np.arange(N) % 4).astype(np.uint8),
    "edge_of_flight_line": (np.arange(N) % 2).astype(np.uint8),
}


@pytest.mark.parametrize(
    ("point_format", "more"),
    [
        (1, {}),
        (3, {"scan_angle_rank": (np.arange(N) % 30 - 15).astype(np.int8)}),
        (6, {"scan_angle": (np.arange(N) % 9000 - 4500).astype(np.int16), "overlap": np.uint8(1)}),
        (7, {"scanner_channel": (np.arange(N) % 4).astype(np.uint8)}),
        (8, {"nir": np.uint16(9000)}),
    ],
)
def test_laz_to_laz_keeps_every_field(
    tmp_path: Path, point_format: int, more: dict[str, Any]
) -> None:
    laspy = pytest.importorskip("laspy")
    fields = FIELDS | more | (rgb16() if point_format not in (1, 6) else {})
    extra = {"Deviation": np.arange(N, dtype=np.uint16), "Amplitude": ROOM.intensities}
    points = ROOM.points + UTM
    path = made.las(tmp_path / "a.laz", points, fields, point_format=point_format, extra=extra)
    cloud, said = told(path)
    assert said == ""
    again = tmp_path / "b.laz"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sb.write(again, cloud)
    old, new = laspy.read(path), laspy.read(again)
    np.testing.assert_allclose(new.xyz, old.xyz, rtol=0, atol=1e-4)
    for name in (*fields, *extra):
        np.testing.assert_array_equal(np.array(new[name]), np.array(old[name]), err_msg=name)
        assert np.array(new[name]).dtype == np.array(old[name]).dtype
    assert new.header.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD


def test_what_is_no_standard_dimension_becomes_an_extra_one(tmp_path: Path) -> None:
    pytest.importorskip("lazrs")
    extra = {
        "classification": np.arange(N) / 7,
        "nir": np.arange(N) - 5,
        "x": np.ones(N),
        "a name of more than thirty-two bytes, 1": np.ones(N, np.uint8),
        "a name of more than thirty-two bytes, 2": np.ones(N, np.uint8),
    }
    cloud = sb.PointCloud(ROOM.points, extra=extra)
    with pytest.warns(sb.LostAttributeWarning, match="renamed columns: 'classification' is") as w:
        sb.write(tmp_path / "a.laz", cloud)
    assert len(w) == 1
    again, _ = told(tmp_path / "a.laz")
    np.testing.assert_array_equal(again["classification_"], extra["classification"])
    np.testing.assert_array_equal(again["nir_"], extra["nir"])
    assert len(again.extra) == 5


NOISE = {
    "withheld": (np.arange(N) % 50 == 0).astype(np.uint8),
    "classification": np.select(
        [np.arange(N) % 50 == 0, np.arange(N) % 50 == 1, np.arange(N) % 50 == 2], [2, 7, 18], 2
    ).astype(np.uint8),
}


@pytest.mark.parametrize("point_format", [1, 6])
def test_withheld_and_noise_are_left_out_and_counted(tmp_path: Path, point_format: int) -> None:
    path = made.las(tmp_path / "a.laz", ROOM.points, NOISE, point_format=point_format)
    cloud, said = told(path)
    twelve = N // 50
    assert len(cloud) == N - 3 * twelve
    assert f"left out {3 * twelve} of {N} points: {twelve} withheld, {twelve} of class 7" in said
    assert f"{twelve} of class 18 (high noise)" in said
    assert cloud.attributes == ["classification"]
    cloud, said = told(path, keep_noise=True)
    assert (len(cloud), said) == (N, "")
    np.testing.assert_array_equal(cloud["withheld"], NOISE["withheld"])


def test_classes_are_kept_and_dropped_on_request(tmp_path: Path) -> None:
    path = made.las(tmp_path / "a.laz", ROOM.points, NOISE)
    twelve = N // 50
    assert len(told(path, keep_class=[7])[0]) == twelve
    assert len(told(path, keep_class=[2, 18])[0]) == N - 2 * twelve
    cloud, said = told(path, drop_class=[2])
    assert len(cloud) == 0
    assert "of classes in drop_class" in said
    assert len(told(path, keep_noise=True, drop_class=[2, 7])[0]) == twelve
    for option in ("keep_class", "drop_class"):
        for wrong in ([256], [-1], [2.5]):
            with pytest.raises(sb.InvalidInputError, match=f"{option} is .*from 0 to 255"):
                sb.read(path, **{option: wrong})


def test_dark_fields_are_no_colors(tmp_path: Path) -> None:
    path = made.las(tmp_path / "a.las", ROOM.points, {"intensity": 5, "red": 0})
    cloud, said = told(path)
    assert cloud.attributes == ["intensities"]
    assert re.fullmatch(".*a.las: left aside: colours, which are 0 everywhere", said)


@pytest.mark.parametrize("n_high", [1, N // 40])
def test_a_few_high_values_do_not_make_16_bits(tmp_path: Path, n_high: int) -> None:
    fields = rgb16(1)
    for name, value in (("red", 256), ("green", 300), ("blue", 280)):
        fields[name][:n_high] = value
    cloud, said = told(made.las(tmp_path / "a.las", ROOM.points, fields))
    assert cloud.colors is not None
    np.testing.assert_array_equal(cloud.colors[n_high:], ROOM.colors[n_high:])
    assert (cloud.colors[:n_high] == 255).all()
    assert f"colour values clipped to 0..255: {3 * n_high}" in said


@pytest.mark.parametrize("factor", [1, 256, 257])
def test_colors_of_8_bits_in_fields_of_16(tmp_path: Path, factor: int) -> None:
    cloud, said = told(made.las(tmp_path / "a.las", ROOM.points, rgb16(factor)))
    assert said == ""
    np.testing.assert_array_equal(cloud.colors, ROOM.colors)


def test_the_real_intensity_and_normals_of_extra_dimensions(tmp_path: Path) -> None:
    extra = {"Intensity": np.zeros(N, np.float32), "Range": np.ones(N)}
    extra |= dict(zip(("normal_x", "normal_y", "normal_z"), ROOM.normals.T, strict=True))
    real = np.arange(N, dtype=np.uint16)
    cloud, _ = told(made.las(tmp_path / "a.las", ROOM.points, {"intensity": real}, extra=extra))
    np.testing.assert_array_equal(cloud.intensities, real)
    np.testing.assert_array_equal(cloud.normals, ROOM.normals)
    np.testing.assert_array_equal(cloud.ranges, np.ones(N))
    # Where the standard one holds nothing, the extra one is meant.
    extra["Intensity"] = ROOM.intensities
    cloud, _ = told(made.las(tmp_path / "a.las", ROOM.points, {}, extra=extra))
    np.testing.assert_array_equal(cloud.intensities, ROOM.intensities)


def wkt(horizontal: str, vertical: str | None) -> str:
    system = (
        'PROJCS["some zone",GEOGCS["G",DATUM["D",SPHEROID["S",6378137,298.25]],'
        'PRIMEM["P",0],UNIT["degree",0.0174532925199433]],PROJECTION["T"],'
        f"UNIT[{horizontal}]]"
    )
    if vertical is None:
        return system
    return f'COMPD_CS["both",{system},VERT_CS["heights",VERT_DATUM["V",2005],UNIT[{vertical}]]]'


METRE, US_FOOT = '"metre",1', '"US survey foot",0.304800609601219'


@pytest.mark.parametrize(
    ("horizontal", "vertical", "said"),
    [
        (METRE, None, ""),
        (METRE, METRE, ""),
        (METRE, US_FOOT, "metre horizontally, US survey foot (0.3048006096 m) vertically"),
        (US_FOOT, METRE, "US survey foot (0.3048006096 m) horizontally, metre vertically"),
        ('"foot",0.3048', None, "foot (0.3048 m) horizontally, foot (0.3048 m) vertically"),
    ],
)
def test_units_are_named_horizontally_and_vertically(
    tmp_path: Path, horizontal: str, vertical: str | None, said: str
) -> None:
    text = wkt(horizontal, vertical)
    record = (2112, text.encode() + b"\0")
    path = made.las(tmp_path / "a.laz", ROOM.points + UTM, {}, point_format=6, records=[record])
    cloud, found = told(path)
    assert found.endswith(said)
    assert cloud.crs == text
    again = tmp_path / "b.laz"
    sb.write(again, cloud)
    assert told(again)[0].crs == text
    path = tmp_path / "a.e57"
    made.e57(path, {f"cartesian{a.upper()}": c for a, c in ROOM.columns().items()}, crs=text)
    cloud, found = told(path)
    assert found.endswith(said)
    assert cloud.crs == text


GEOTIFF = [
    ({1024: 1, 1025: 1, 3072: 25832}, "EPSG:25832", ""),
    ({1024: 1, 3072: 25832, 4096: 7837, 3076: 9001, 4099: 9001}, "EPSG:25832+7837", ""),
    ({1024: 2, 2048: 4326}, "EPSG:4326", "degree horizontally, an unknown unit vertically"),
    (
        {1024: 1, 3072: 26910, 4099: 9003},
        None,
        "an unknown unit horizontally, US survey foot (0.3048006096 m) vertically",
    ),
    (
        {1024: 1, 3072: 2229, 3073: "NAD83 / California zone 5 (ftUS)"},
        None,
        "US survey foot (0.3048006096 m) horizontally, US survey foot (0.3048006096 m) vertically",
    ),
    ({1024: 1, 3072: 32767, 3073: "local zone", 3080: 9.0, 3076: 9001}, None, ""),
]


@pytest.mark.parametrize(("keys", "crs", "said"), GEOTIFF)
def test_geotiff_keys_are_kept(
    tmp_path: Path, keys: dict[int, Any], crs: str | None, said: str
) -> None:
    from surfabet.io._crs import directory_of, parse_directory

    numbers = (34735, 34736, 34737)
    records = [(n, d) for n, d in zip(numbers, directory_of(keys), strict=True) if d]
    path = made.las(tmp_path / "a.laz", ROOM.points + UTM, {}, point_format=1, records=records)
    cloud, found = told(path)
    assert found.endswith(said)
    if crs is not None:
        assert cloud.crs == crs
    sb.write(tmp_path / "b.laz", cloud)
    assert told(tmp_path / "b.laz")[0].crs == cloud.crs
    laspy = pytest.importorskip("laspy")
    data = {v.record_id: v.record_data_bytes() for v in laspy.read(tmp_path / "b.laz").vlrs}
    written = parse_directory(*(data.get(n, b"") for n in numbers))
    implied = {1024, 1025, 3073, 3076, 4099} if crs is not None else set()
    assert {k: v for k, v in written.items() if k not in implied} == {
        k: v for k, v in keys.items() if k not in implied
    }


def test_damaged_geotiff_keys_do_not_matter() -> None:
    from surfabet.io._crs import directory_of, parse_directory

    keys = {1024: 1, 3072: 25832, 3073: "zone", 3080: 9.0}
    directory, doubles, texts = directory_of(keys)
    assert parse_directory(directory, doubles, texts) == keys
    for end in range(len(directory)):
        assert parse_directory(directory[:end], b"", b"").items() <= keys.items()


def test_formats_without_a_reference_system_name_it(tmp_path: Path) -> None:
    cloud = sb.PointCloud(ROOM.points, crs=wkt(METRE, None))
    for suffix in (".ply", ".pcd", ".xyz"):
        with pytest.warns(sb.LostAttributeWarning, match=r"reference system \(some zone\)"):
            sb.write(tmp_path / f"a{suffix}", cloud)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sb.write(tmp_path / "a.npz", cloud)
    assert sb.read(tmp_path / "a.npz").crs == cloud.crs


# E57


def e57_columns() -> dict[str, Any]:
    return {f"cartesian{axis.upper()}": c for axis, c in ROOM.columns().items()}


def e57_colors(factor: int = 1) -> dict[str, Any]:
    names = ("colorRed", "colorGreen", "colorBlue")
    return {n: c.astype(np.int64) * factor for n, c in zip(names, ROOM.colors.T, strict=True)}


def test_e57_fields_are_kept(tmp_path: Path) -> None:
    time = np.arange(N) * 1e-5
    row = np.arange(N) % 17
    columns = e57_columns() | {"timeStamp": time, "rowIndex": row, "returnIndex": row % 2}
    bounds = {"rowIndex": (0, 2000), "returnIndex": (0, 3)}
    cloud, said = told(made.e57(tmp_path / "a.e57", columns, bounds=bounds))
    assert (cloud.attributes, said) == (["timeStamp", "rowIndex", "returnIndex"], "")
    assert cloud["rowIndex"].dtype == np.uint16
    np.testing.assert_array_equal(cloud["timeStamp"], time)
    sb.write(tmp_path / "b.e57", cloud)
    again, _ = told(tmp_path / "b.e57")
    for name, column in cloud.extra.items():
        np.testing.assert_array_equal(again[name], column)
        assert again[name].dtype == column.dtype


@pytest.mark.parametrize("bounded", ["type", "values", "not"])
@pytest.mark.parametrize(("high", "factor"), [(255, 1), (65535, 257), (65535, 256), (65535, 1)])
def test_e57_colors_by_the_bounds_of_their_fields(
    tmp_path: Path, bounded: str, high: int, factor: int
) -> None:
    colors = e57_colors(factor)
    bounds = {}
    if bounded != "not":
        bounds = {n: (0, high if bounded == "type" else int(c.max())) for n, c in colors.items()}
    path = made.e57(tmp_path / "a.e57", e57_columns() | colors, bounds=bounds)
    cloud, _ = told(path)
    assert cloud.colors is not None
    difference = cloud.colors.astype(int) - ROOM.colors
    assert np.abs(difference).max() <= 1


def test_e57_invalid_colors_come_from_the_nearest_point(tmp_path: Path) -> None:
    invalid = (np.arange(N) % 4 == 0).astype(np.int64)
    columns = e57_columns() | e57_colors() | {"isColorInvalid": invalid}
    columns |= {"intensity": ROOM.intensities, "isIntensityInvalid": invalid}
    for name in ("colorRed", "colorGreen", "colorBlue"):
        columns[name] = np.where(invalid, 0, columns[name])
    bounds = {name: (0, 255) for name in e57_colors()}
    bounds |= {"isColorInvalid": (0, 1), "isIntensityInvalid": (0, 1)}
    cloud, said = told(made.e57(tmp_path / "a.e57", columns, bounds=bounds))
    assert "points without valid colours of their own got those of the nearest point" in said
    assert said.endswith(f": {N // 4}")
    assert "points without valid intensities of their own" in said
    distances = np.linalg.norm(ROOM.points[:, None] - ROOM.points[None], axis=2)
    distances[:, invalid == 1] = np.inf
    nearest = np.where(invalid, distances.argmin(axis=1), np.arange(N))
    np.testing.assert_array_equal(cloud.colors, ROOM.colors[nearest])
    np.testing.assert_array_equal(cloud.intensities, ROOM.intensities[nearest])


def test_e57_colors_that_are_all_invalid_are_none(tmp_path: Path) -> None:
    columns = e57_columns() | e57_colors() | {"isColorInvalid": np.ones(N, np.int64)}
    bounds = {name: (0, 255) for name in e57_colors()} | {"isColorInvalid": (0, 1)}
    cloud, said = told(made.e57(tmp_path / "a.e57", columns, bounds=bounds))
    assert cloud.attributes == []
    assert "colours, which are invalid everywhere" in said


def test_e57_quaternion_of_zeros_does_not_turn(tmp_path: Path) -> None:
    path = made.e57(tmp_path / "a.e57", e57_columns(), quaternion=(0, 0, 0, 0))
    cloud, said = told(path)
    assert_room(cloud, colors=False)
    assert "quaternion 0 0 0 0" in said
    path = made.e57(tmp_path / "a.e57", e57_columns(), quaternion=(0.5, 0, 0, 0))
    with pytest.raises(sb.FormatError, match=r"quaternion of length 0\.5"):
        sb.read(path)


# NPZ, NPY


@pytest.mark.parametrize("points", ["xyz", "pos", "points", "coords"])
@pytest.mark.parametrize("colors", ["rgb", "colors", "color"])
@pytest.mark.parametrize("scale", [1, 255.0])
def test_npz_by_other_names(tmp_path: Path, points: str, colors: str, scale: float) -> None:
    rgb = ROOM.colors if scale == 1 else ROOM.colors / scale
    arrays = {points: ROOM.points, colors: rgb, "label": np.arange(N) % 5, "image": np.eye(3)}
    np.savez(tmp_path / "a.npz", **arrays)
    cloud, said = told(tmp_path / "a.npz")
    assert_room(cloud)
    np.testing.assert_array_equal(cloud["label"], arrays["label"])
    assert said.endswith("left aside: array image of shape (3, 3) and dtype float64")


def test_npz_with_structured_points(tmp_path: Path) -> None:
    rows = made.records(ROOM.columns() | ROOM.rgb() | {"label": np.arange(N)})
    np.savez(tmp_path / "a.npz", points=rows, weight=ROOM.intensities)
    cloud, said = told(tmp_path / "a.npz")
    assert_room(cloud)
    assert (cloud.attributes, said) == (["colors", "label", "weight"], "")


def test_npz_by_axes(tmp_path: Path) -> None:
    objects = np.array([{}], dtype=object)
    np.savez(tmp_path / "a.npz", **ROOM.columns(), intensity=ROOM.intensities, other=objects)
    cloud, said = told(tmp_path / "a.npz")
    assert_room(cloud, colors=False)
    np.testing.assert_array_equal(cloud.intensities, ROOM.intensities)
    assert said.endswith("left aside: array other of Python objects")


def test_empty_arrays(tmp_path: Path) -> None:
    rows = made.records({"xyz": ROOM.points, "rgb": ROOM.colors, "label": np.arange(N)})
    np.savez(tmp_path / "a.npz", points=rows[:0], weight=np.empty(0), feature=np.empty((0, 2)))
    cloud, _ = told(tmp_path / "a.npz")
    assert len(cloud) == 0
    assert cloud.attributes == ["colors", "label", "weight", "feature_0", "feature_1"]


def test_structured_arrays_with_triples(tmp_path: Path) -> None:
    columns = {"xyz": ROOM.points, "rgb": ROOM.colors, "normal": ROOM.normals}
    np.save(tmp_path / "a.npy", made.records(columns | {"label": np.arange(N)}))
    cloud, said = told(tmp_path / "a.npy")
    assert_room(cloud)
    assert (cloud.attributes, said) == (["colors", "normals", "label"], "")
    np.savez(tmp_path / "a.npz", ROOM.points, np.arange(N))
    assert_room(told(tmp_path / "a.npz")[0], colors=False)


# Precision

BEYOND = "what colours have beyond 8 bits per channel"
FINE = ROOM.colors.astype(np.uint16) * 256 + np.arange(N, dtype=np.uint16)[:, None] % 251


def _scaled(factor: float, dtype: Any) -> dict[str, np.ndarray]:
    rows = (ROOM.colors.astype(np.float64) * factor).astype(dtype)
    return dict(zip(("red", "green", "blue"), rows.T, strict=True))


@pytest.mark.parametrize(
    "colors",
    [
        _scaled(1, np.uint8),
        _scaled(1, np.uint16),
        _scaled(256, np.uint16),
        _scaled(257, np.uint16),
        _scaled(1 / 255, np.float32),
        _scaled(1 / 255, np.float64),
        _scaled(1, np.float32),
        _scaled(257, np.float32),
    ],
)
def test_colors_of_8_bits_are_told_in_any_field(colors: Any, tmp_path: Path) -> None:
    cloud, said = read(tmp_path / "a.ply", made.ply(ROOM.columns() | colors))
    assert said == ""
    np.testing.assert_allclose(cloud.colors, ROOM.colors, rtol=0, atol=1)


@pytest.mark.parametrize("dtype", [np.uint16, np.int32, np.float32, np.float64])
@pytest.mark.parametrize("divisor", [1, 65535])
def test_finer_colors_are_told(dtype: Any, divisor: int, tmp_path: Path) -> None:
    if divisor > 1 and np.dtype(dtype).kind != "f":
        return
    rgb = dict(zip(("red", "green", "blue"), (FINE / divisor).astype(dtype).T, strict=True))
    cloud, said = read(tmp_path / "a.ply", made.ply(ROOM.columns() | rgb))
    assert BEYOND in said
    np.testing.assert_allclose(cloud.colors, FINE / 257, rtol=0, atol=0.51)


def test_finer_colors_are_told_of_every_format(tmp_path: Path) -> None:
    rgb = dict(zip(("red", "green", "blue"), FINE.T, strict=True))
    _, said = told(made.las(tmp_path / "a.las", ROOM.points, rgb))
    assert BEYOND in said
    coarse = {name: values // 256 * 256 for name, values in rgb.items()}
    _, said = told(made.las(tmp_path / "b.las", ROOM.points, coarse))
    assert said == ""
    fields = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), ROOM.points.T, strict=True))
    for full, expected in ((65535, True), (255, False)):
        values = FINE if full == 65535 else FINE // 256
        names = ("colorRed", "colorGreen", "colorBlue")
        columns = fields | dict(zip(names, values.T, strict=True))
        bounds = dict.fromkeys(names, (0, full))
        _, said = told(made.e57(tmp_path / f"{full}.e57", columns, bounds=bounds))
        assert (BEYOND in said) == expected
    rows = np.column_stack([ROOM.points, FINE]).tolist()
    text = "\n".join(["x y z r g b", *(" ".join(map(repr, row)) for row in rows)])
    assert BEYOND in read(tmp_path / "a.txt", text.encode())[1]
    np.savez(tmp_path / "a.npz", xyz=ROOM.points, rgb=FINE)
    assert BEYOND in told(tmp_path / "a.npz")[1]


@pytest.mark.parametrize(("largest", "lost"), [(2**24, False), (2**24 + 1, True)])
def test_integers_beyond_single_precision_are_told(
    largest: int, lost: bool, tmp_path: Path
) -> None:
    intensity = np.full(N, largest, np.uint32)
    _, said = read(tmp_path / "a.ply", made.ply(ROOM.columns() | {"intensity": intensity}))
    assert ("what intensities have beyond single precision" in said) == lost


# OBJ


@pytest.mark.parametrize("scale", [1, 255.0])
def test_obj_vertices_with_colors(tmp_path: Path, scale: float) -> None:
    colors = ROOM.colors / scale if scale != 1 else ROOM.colors
    rows = np.column_stack([ROOM.points, colors]).tolist()
    lines = ["# made by hand", "o room", *("v " + " ".join(map(repr, row)) for row in rows)]
    lines += ["f 1 2 3", "f 1 \\", " 3 4"]
    cloud, said = read(tmp_path / "a.obj", "\n".join(lines).encode())
    assert_room(cloud)
    assert said.endswith("left aside: o (1), faces (2)")


def test_obj_normals_that_belong_to_the_vertices(tmp_path: Path) -> None:
    body = b"v 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nvn 0 1 0\nvn 1 0 0\n"
    cloud, said = read(tmp_path / "a.obj", body + b"f 1//1 2//2 3//3\n")
    np.testing.assert_array_equal(cloud.normals, [[0, 0, 1], [0, 1, 0], [1, 0, 0]])
    assert said.endswith("left aside: faces (1)")
    cloud, said = read(tmp_path / "a.obj", body + b"f 1//2 2//2 3//2\n")
    assert cloud.normals is None
    assert said.endswith("left aside: normals (3), faces (1)")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"# nothing\n", "no vertices"),
        (b"v 1 2\n", "line 1: a vertex has 2 values"),
        (b"v 1 2 3\nv 1 2 3 4\n", "line 2: "),
        (b"v 1 2 three\n", "cannot read a row of 3 numbers"),
        (b"v 1 2 3\nhello\n", "line 2: unknown statement 'hello'"),
    ],
)
def test_broken_obj(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(sb.FormatError, match=message):
        read(tmp_path / "a.obj", data)


# Bare floats

RNG = np.random.default_rng(8)
SCAN = RNG.normal(0, [15, 15, 1], (N, 3))
BARE = {
    "kitti": ([SCAN, RNG.uniform(0, 1, N)], ["intensities", "ranges", "viewpoints"]),
    "kitti, 0 to 255": ([SCAN, RNG.uniform(0, 255, N)], ["intensities", "ranges", "viewpoints"]),
    "nuscenes": (
        [SCAN, RNG.integers(0, 256, N), RNG.integers(0, 32, N)],
        ["intensities", "ranges", "viewpoints", "ring"],
    ),
    "xyz": ([SCAN], []),
}


@pytest.mark.parametrize("kind", BARE)
@pytest.mark.parametrize("n", [60, N])
def test_bare_floats_are_told_by_their_values(tmp_path: Path, kind: str, n: int) -> None:
    parts, attributes = BARE[kind]
    rows = np.column_stack(parts)[:n].astype("<f4")
    cloud, said = read(tmp_path / "a.bin", rows.tobytes())
    np.testing.assert_array_equal(cloud.local_points, rows[:, :3])
    assert (cloud.attributes, said) == (attributes, "")
    if "ring" in attributes:
        np.testing.assert_array_equal(cloud["ring"], rows[:, 4])


@pytest.mark.parametrize(
    "rows",
    [
        RNG.uniform(0, 1, (N, 3)),
        np.column_stack([SCAN, RNG.uniform(0, 1, (N, 3))]),
        np.column_stack(
            [SCAN, RNG.integers(0, 99, N), RNG.integers(0, 32, N), RNG.uniform(size=N)]
        ),
        RNG.normal(0, 1e6, (N, 4)),
    ],
    ids=["a cube", "six columns", "xyz, intensity, ring, time", "too far"],
)
def test_bare_floats_of_other_kinds_are_refused(tmp_path: Path, rows: np.ndarray[Any, Any]) -> None:
    with pytest.raises(sb.FormatError, match=r"columns= \(--columns\)"):
        read(tmp_path / "a.bin", rows.astype("<f4").tobytes())


def test_bare_floats_by_name(tmp_path: Path) -> None:
    rows = np.column_stack([SCAN, RNG.uniform(0, 1, (N, 3))]).astype("<f4")
    names = ["x", "y", "z", "a", "intensity", "b"]
    cloud, _ = read(tmp_path / "a.bin", rows.tobytes(), columns=names)
    np.testing.assert_array_equal(cloud.local_points, rows[:, :3])
    np.testing.assert_array_equal(cloud["b"], rows[:, 5])
    assert cloud.attributes == ["intensities", "a", "b"]
    with pytest.raises(sb.FormatError, match="no multiple of 28"):
        read(tmp_path / "a.bin", rows[:-1].tobytes(), columns=[*names, "c"])
    for wrong in (["x", "y"], ["x", "y", "z", "x"]):
        with pytest.raises(sb.InvalidInputError, match=r"names of columns with x, y and z, and"):
            sb.read(tmp_path / "a.bin", columns=wrong)


# Columns without names


def test_unnamed_labels_and_colors(tmp_path: Path) -> None:
    label = np.arange(N) % 7

    def save(*columns: Any) -> tuple[sb.PointCloud, str]:
        np.save(tmp_path / "a.npy", np.column_stack([ROOM.points.astype(float), *columns]))
        return told(tmp_path / "a.npy")

    assert save(label)[0].attributes == ["label"]
    assert save(ROOM.intensities)[0].attributes == ["intensities"]
    for columns in ([ROOM.colors, label], [label, ROOM.colors]):
        cloud, _ = save(*columns)
        assert_room(cloud)
        np.testing.assert_array_equal(cloud["label"], label)
    cloud, _ = save(ROOM.colors.astype(int) * 256)
    assert_room(cloud)
    with pytest.raises(
        sb.FormatError,
        match=r"7 columns mean: x y z intensity.*; name them by the fields of a structured array",
    ):
        save(ROOM.colors, ROOM.colors[:, 0])
    with pytest.raises(sb.FormatError, match="cannot tell what 6 columns mean"):
        save(ROOM.normals * 60_000.5)


# The files themselves, where they are

RIGHT: dict[str, tuple[list[str], str]] = {
    "las_attributes/a.laz": (["colors", "intensities", "classification", "gps_time"], ""),
    "las_nir_pf8/a.laz": (["colors", "intensities", "nir"], ""),
    "las_withheld_noise/a.laz": (["colors", "intensities"], "60 withheld"),
    "las_rgb_zero/a.las": (["intensities"], "colours, which are 0 everywhere"),
    "las_rgb8_one_high/a.las": (["colors", "intensities"], "colour values clipped to 0..255: 3"),
    "las_extra_intensity/a.las": (["colors", "intensities", "normals", "ranges"], ""),
    "las_metre_h_ft_v/a.las": ([], "metre horizontally, US survey foot"),
    "ply_cc/a.ply": (["colors", "intensities", "scalar_GPSTime", "scalar_Classification"], ""),
    "ply_splat/point_cloud.ply": (["colors", "opacity"], "splat"),
    "ply_rgba_packed/a.ply": (["colors"], ""),
    "ply_comment_latin1/a.ply": (["colors"], ""),
    "ply_bom/a.ply": (["colors"], ""),
    "ply_ascii_hexfloat_nan/a.ply": ([], "dropped 300 of 3000"),
    "pcd_timestamp_ros2/a.pcd": (["intensities", "ring", "timestamp"], ""),
    "pcd_ouster_zeros/a.pcd": (["intensities", "ring", "range"], "left out 1,000 of 3,000"),
    "pcd_vp_nan/a.pcd": ([], "VIEWPOINT"),
    "pcd_rgb_F_intdigits_ascii/a.pcd": (["colors"], ""),
    "e57_timestamps/a.e57": (["timeStamp", "returnIndex"], ""),
    "e57_crs/a.e57": ([], ""),
    "e57_rgb16_nolimits/a.e57": (["colors"], ""),
    "e57_color_invalid/a.e57": (["colors", "intensities"], "points without valid colours"),
    "e57_zero_quaternion/a.e57": (["colors"], "quaternion 0 0 0 0"),
    "npz_pyntcloud/a.npz": (["colors"], ""),
    "npz_xyz_rgb/a.npz": (["colors"], ""),
    "bin_xyz3/scan.bin": ([], ""),
    "bin_nuscenes/scan.pcd.bin": (["intensities", "ring"], ""),
}


@pytest.mark.skipif(not CASES.is_dir(), reason=WITHOUT_CASES)
@pytest.mark.parametrize("name", RIGHT)
def test_files_of_others(name: str) -> None:
    attributes, said = RIGHT[name]
    pytest.importorskip("laspy" if name.startswith("las") else "pye57")
    cloud, found = told(CASES / name)
    assert said in found
    assert bool(said) == bool(found)
    assert set(attributes) <= set(cloud.attributes)
    assert "colors" in attributes or cloud.colors is None
    if cloud.colors is not None and not name.startswith("las_withheld"):
        mean = cloud.colors.mean(axis=0)
        np.testing.assert_allclose(mean, [140.5, 136.9, 132.6], rtol=0, atol=0.5)


# The warning


def test_points_and_columns_that_are_left_out_are_one_warning(tmp_path: Path) -> None:
    path = made.las(tmp_path / "a.las", ROOM.points, {"withheld": np.arange(N) == 0, "red": 0})
    for category in (sb.DroppedPointsWarning, sb.LostAttributeWarning, sb.IncompleteReadWarning):
        with pytest.warns(category, match="1 withheld; left aside: colours") as caught:
            sb.read(path)
        assert len(caught) == 1
        assert caught[0].filename == __file__


def test_a_long_list_of_names_is_cut_and_counted(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", points=ROOM.points, **{f"a{k}": np.eye(2) for k in range(30)})
    _, said = told(tmp_path / "a.npz")
    assert said.count("array a") == 12
    assert said.endswith(", 18 more")
