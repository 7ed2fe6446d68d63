"""What is written is read again: every attribute that a format holds, in every encoding."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb


def make_cloud(*, utm: bool = False, n_viewpoints: int = 3, n: int = 50, **left_out: bool) -> Any:
    """A cloud with every attribute, or all but those given as False."""
    rng = np.random.default_rng(7)
    points = rng.normal(scale=20, size=(n, 3))
    if utm:
        points += [448_262.123, 5_411_932.678, 512.345]
    else:
        points = points.astype(np.float32)
    normals = rng.normal(size=(n, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    attributes: dict[str, Any] = {
        "colors": rng.integers(0, 256, (n, 3), dtype=np.uint8),
        "intensities": rng.uniform(0, 3000, n).astype(np.float32),
        "normals": normals,
        "ranges": rng.uniform(0.5, 90, n).astype(np.float32),
    }
    viewpoints = points.mean(axis=0) + rng.normal(scale=5, size=(n_viewpoints, 3))
    attributes["viewpoints"] = viewpoints.astype(np.float64)
    index = rng.integers(0, n_viewpoints, n)
    # Tables come back in order of first use.
    _, first = np.unique(index, return_index=True)
    order = index[np.sort(first)]
    rank = np.argsort(order)
    attributes["viewpoints"] = attributes["viewpoints"][order]
    attributes["viewpoint_index"] = rank[index]
    for name in left_out:
        attributes.pop(name)
        if name == "viewpoints":
            attributes.pop("viewpoint_index")
    return sb.PointCloud(points, **attributes)


def assert_same(found: sb.PointCloud, expected: sb.PointCloud) -> None:
    """Attributes equal to the bit; far out, world coordinates to a tenth of a millimetre."""
    assert found.attributes == expected.attributes
    assert len(found) == len(expected)
    if any(expected.origin):
        np.testing.assert_allclose(found.points, expected.points, rtol=0, atol=1e-4)
    else:
        np.testing.assert_array_equal(found.points, expected.points)
    for name in expected.attributes:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)
    if expected.viewpoint_index is not None:
        np.testing.assert_array_equal(found.viewpoint_index, expected.viewpoint_index)


ENCODINGS: list[tuple[str, dict[str, Any]]] = [
    (".ply", {}),
    (".ply", {"ascii": True}),
    (".pcd", {}),
    (".pcd", {"encoding": "ascii"}),
    (".pcd", {"encoding": "binary_compressed"}),
    (".npz", {}),
    (".xyz", {}),
    (".csv", {}),
    (".txt", {"delimiter": ";"}),
]


@pytest.fixture(params=ENCODINGS, ids=lambda p: p[0] + "".join(f"-{v}" for v in p[1].values()))
def encoding(request: pytest.FixtureRequest) -> tuple[str, dict[str, Any]]:
    found: tuple[str, dict[str, Any]] = request.param
    return found


def again(path: Path, cloud: sb.PointCloud, **options: Any) -> sb.PointCloud:
    """The cloud written and read, without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sb.write(path, cloud, **options)
        return sb.read(path)


@pytest.mark.parametrize("utm", [False, True])
def test_keeps_every_attribute(
    tmp_path: Path, encoding: tuple[str, dict[str, Any]], utm: bool
) -> None:
    suffix, options = encoding
    cloud = make_cloud(utm=utm)
    assert_same(again(tmp_path / f"a{suffix}", cloud, **options), cloud)


@pytest.mark.parametrize(
    "left_out", ["colors", "intensities", "normals", "ranges", "viewpoints", "all"]
)
def test_keeps_absence(tmp_path: Path, encoding: tuple[str, dict[str, Any]], left_out: str) -> None:
    suffix, options = encoding
    names = ["colors", "intensities", "normals", "ranges", "viewpoints"]
    cloud = make_cloud(**{name: False for name in names if left_out in (name, "all")})
    found = again(tmp_path / f"a{suffix}", cloud, **options)
    assert_same(found, cloud)


def extra_columns(n: int) -> dict[str, np.ndarray[Any, Any]]:
    """A column of every type, up to the ends of its range."""
    rng = np.random.default_rng(5)
    columns: dict[str, Any] = {}
    for dtype in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8"):
        ends = np.iinfo(dtype)
        column = rng.integers(ends.min, ends.max, n, dtype=dtype, endpoint=True)
        column[:2] = ends.min, ends.max
        columns[f"column_{dtype}"] = column
    columns["amplitude"] = rng.normal(size=n).astype(np.float32)
    columns["gps_time"] = 3e8 + np.arange(n) * 1e-7
    columns["nothing"] = np.full(n, np.nan)
    columns["classification"] = np.arange(n, dtype=np.uint8) % 6
    return columns


EXTRA: list[tuple[str, dict[str, Any]]] = [
    *(known for known in ENCODINGS if known[0] in (".ply", ".pcd", ".npz")),
    (".las", {}),
    (".laz", {}),
    (".e57", {}),
]


@pytest.mark.parametrize(("suffix", "options"), EXTRA)
def test_keeps_extra_columns(tmp_path: Path, suffix: str, options: dict[str, Any]) -> None:
    skip_without(suffix)
    bare = make_cloud(viewpoints=False, ranges=False, intensities=False)
    extra = extra_columns(len(bare))
    if suffix == ".e57":
        extra["column_u8"] >>= np.uint64(1)
    cloud = sb.PointCloud(bare.points, colors=bare.colors, normals=bare.normals, extra=extra)
    found = again(tmp_path / f"a{suffix}", cloud, **options)
    assert sorted(found.attributes) == sorted(cloud.attributes)
    for name, column in extra.items():
        np.testing.assert_array_equal(found[name], column, err_msg=name)
        if (suffix, name) != (".e57", "column_u8"):
            assert found[name].dtype == column.dtype
    if suffix not in (".las", ".laz"):
        assert found.attributes == cloud.attributes


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".e57"])
def test_names_that_a_format_cannot_have_are_changed_and_said(tmp_path: Path, suffix: str) -> None:
    skip_without(suffix)
    ones = np.ones(3, np.float32)
    cloud = sb.PointCloud(
        np.eye(3), intensities=ones, extra={"scan angle": 2 * ones, "scan_angle": 3 * ones}
    )
    with pytest.warns(sb.LostAttributeWarning, match="columns: 'scan angle' is 'scan_angle'") as w:
        sb.write(tmp_path / f"a{suffix}", cloud)
    assert len(w) == 1
    found = sb.read(tmp_path / f"a{suffix}")
    assert [found[name][0] for name in found.extra] == [2, 3]


def test_e57_names_integers_that_it_cannot_hold(tmp_path: Path) -> None:
    pytest.importorskip("pye57")
    cloud = sb.PointCloud(np.eye(3), extra={"key": np.full(3, 2**63, np.uint64)})
    with pytest.warns(sb.LostAttributeWarning, match="do not hold key, which has integers beyond"):
        sb.write(tmp_path / "a.e57", cloud)
    assert sb.read(tmp_path / "a.e57").attributes == []


@pytest.mark.parametrize("viewpoint", [(1.5, -2.25, 0.1), (0.0, 0.0, 0.0)])
def test_keeps_a_single_viewpoint(
    tmp_path: Path, encoding: tuple[str, dict[str, Any]], viewpoint: tuple[float, ...]
) -> None:
    suffix, options = encoding
    cloud = sb.PointCloud(np.eye(3), viewpoints=[viewpoint])
    found = again(tmp_path / f"a{suffix}", cloud, **options)
    assert found.viewpoints is not None
    np.testing.assert_array_equal(found.viewpoints, [viewpoint])


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npz", ".xyz", ".csv", ".las", ".laz", ".e57"])
@pytest.mark.parametrize("n", [0, 1])
def test_tiny_clouds(tmp_path: Path, suffix: str, n: int) -> None:
    skip_without(suffix)
    cloud = sb.PointCloud(np.ones((n, 3)), colors=np.full((n, 3), 7, np.uint8))
    found = again(tmp_path / f"a{suffix}", cloud)
    np.testing.assert_array_equal(found.points, cloud.points)
    assert found.colors is not None
    np.testing.assert_array_equal(found.colors, cloud.colors)


@pytest.mark.parametrize("value", [0, 1])
def test_dark_colors_stay_dark(
    tmp_path: Path, encoding: tuple[str, dict[str, Any]], value: int
) -> None:
    suffix, options = encoding
    cloud = sb.PointCloud(np.eye(3), colors=np.full((3, 3), value, np.uint8))
    found = again(tmp_path / f"a{suffix}", cloud, **options)
    np.testing.assert_array_equal(found.colors, cloud.colors)


def test_npz_keeps_the_very_bits(tmp_path: Path) -> None:
    cloud = make_cloud(utm=True)
    found = again(tmp_path / "a.npz", cloud)
    assert found.origin == cloud.origin
    np.testing.assert_array_equal(found.local_points, cloud.local_points)
    np.testing.assert_array_equal(found.viewpoints, cloud.viewpoints)


UTM = np.array([[448_262.123, 5_411_932.678, 512.345], [448_905.987, 5_412_100.001, 498.0]])


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npz", ".xyz", ".csv", ".las", ".laz", ".e57"])
def test_utm_coordinates_survive_to_the_millimetre(tmp_path: Path, suffix: str) -> None:
    skip_without(suffix)
    found = again(tmp_path / f"a{suffix}", sb.PointCloud(UTM))
    np.testing.assert_allclose(found.points, UTM, rtol=0, atol=0.0005)


def skip_without(suffix: str) -> None:
    """Skips where the package of a format is missing."""
    if suffix in (".las", ".laz"):
        pytest.importorskip("lazrs")
    if suffix == ".e57":
        pytest.importorskip("pye57")


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("utm", [False, True])
def test_las_keeps_all_but_viewpoints(tmp_path: Path, suffix: str, utm: bool) -> None:
    skip_without(suffix)
    cloud = make_cloud(utm=utm)
    intensities = np.arange(len(cloud), dtype=np.float32) * 7
    cloud = sb.PointCloud(
        cloud.local_points,
        colors=cloud.colors,
        intensities=intensities,
        normals=cloud.normals,
        ranges=cloud.ranges,
        viewpoints=cloud.viewpoints,
        viewpoint_index=cloud.viewpoint_index,
        origin=cloud.origin,
    )
    path = tmp_path / f"a{suffix}"
    with pytest.warns(sb.LostAttributeWarning, match="do not hold viewpoints") as warned:
        sb.write(path, cloud)
    assert len(warned) == 1
    assert warned[0].filename == __file__
    found = sb.read(path)
    assert found.attributes == ["colors", "intensities", "normals", "ranges"]
    np.testing.assert_allclose(found.points, cloud.points, rtol=0, atol=1.1e-4)
    for name in found.attributes:
        np.testing.assert_array_equal(getattr(found, name), getattr(cloud, name), err_msg=name)


def test_las_stretches_intensities_and_says_so(tmp_path: Path) -> None:
    pytest.importorskip("laspy")
    cloud = sb.PointCloud(
        np.eye(3), intensities=np.array([0.0, 0.25, 1.0], np.float32), viewpoints=[[0, 0, 0]]
    )
    stretched = "hold viewpoints; .* 0 to 1 were stretched to 0 to 65535"
    with pytest.warns(sb.LostAttributeWarning, match=stretched) as warned:
        sb.write(tmp_path / "a.las", cloud)
    assert len(warned) == 1
    np.testing.assert_array_equal(sb.read(tmp_path / "a.las").intensities, [0, 16384, 65535])


@pytest.mark.parametrize(
    ("given", "read"),
    [
        ([0.0, 100.4, 254.0], [0, 100, 254]),
        ([0.25, 0.5, 1.75], [0, 0, 2]),
        ([99.6, 99.6, 99.6], [100, 100, 100]),
        ([0.5, 1.5, 65535.0], [0, 2, 65535]),
    ],
)
def test_las_rounds_intensities_of_its_own_range(
    given: list[float], read: list[int], tmp_path: Path
) -> None:
    """As models decode them: fractions of what was whole; nothing is stretched or said."""
    pytest.importorskip("laspy")
    cloud = sb.PointCloud(np.eye(3), intensities=np.array(given, np.float32))
    found = again(tmp_path / "a.las", cloud)
    np.testing.assert_array_equal(found.intensities, read)


@pytest.mark.parametrize("given", [[-1.0, 0.0, 100.0], [0.5, 1.0, 65536.0]])
def test_las_stretches_intensities_outside_of_its_range(given: list[float], tmp_path: Path) -> None:
    pytest.importorskip("laspy")
    cloud = sb.PointCloud(np.eye(3), intensities=np.array(given, np.float32))
    with pytest.warns(sb.LostAttributeWarning, match="were stretched to 0 to 65535"):
        sb.write(tmp_path / "a.las", cloud)


def test_las_scale_grows_until_the_cloud_fits(tmp_path: Path) -> None:
    pytest.importorskip("laspy")
    points = np.array([[-3e5, 0, 0], [3e5, 1, 0.0005]])
    found = again(tmp_path / "a.las", sb.PointCloud(points))
    np.testing.assert_allclose(found.points, points, rtol=0, atol=0.02)


@pytest.mark.parametrize("utm", [False, True])
def test_e57_keeps_every_attribute_grouped_by_viewpoint(tmp_path: Path, utm: bool) -> None:
    pytest.importorskip("pye57")
    cloud = make_cloud(utm=utm)
    order = np.argsort(cloud.viewpoint_index, kind="stable")
    cloud = cloud.select(order)
    distances = np.linalg.norm(cloud.points - cloud.viewpoints[cloud.viewpoint_index], axis=1)
    cloud = sb.PointCloud(
        cloud.local_points,
        colors=cloud.colors,
        intensities=cloud.intensities,
        normals=cloud.normals,
        ranges=distances,
        viewpoints=cloud.viewpoints,
        viewpoint_index=cloud.viewpoint_index,
        origin=cloud.origin,
    )
    found = again(tmp_path / "a.e57", cloud)
    assert found.attributes == cloud.attributes
    np.testing.assert_allclose(found.points, cloud.points, rtol=0, atol=1e-4)
    assert found.ranges is not None
    np.testing.assert_allclose(found.ranges, distances, rtol=0, atol=1e-4)
    for name in ("colors", "intensities", "normals", "viewpoints", "viewpoint_index"):
        np.testing.assert_array_equal(getattr(found, name), getattr(cloud, name), err_msg=name)


def test_e57_without_viewpoints_does_not_invent_them(tmp_path: Path) -> None:
    pytest.importorskip("pye57")
    cloud = make_cloud(viewpoints=False, ranges=False)
    found = again(tmp_path / "a.e57", cloud)
    assert_same(found, cloud)


def test_e57_says_that_it_derives_ranges(tmp_path: Path) -> None:
    pytest.importorskip("pye57")
    with pytest.warns(sb.LostAttributeWarning, match="ranges other than"):
        sb.write(tmp_path / "a.e57", make_cloud())
    with pytest.warns(sb.LostAttributeWarning, match="ranges without viewpoints"):
        sb.write(tmp_path / "a.e57", make_cloud(viewpoints=False))


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npz", ".xyz", ".csv", ".las", ".laz", ".e57"])
def test_the_same_cloud_gives_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    skip_without(suffix)
    cloud = make_cloud(viewpoints=False, ranges=False, intensities=False)
    for name in "ab":
        sb.write(tmp_path / f"{name}{suffix}", cloud)
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.pcd"
    sb.write(path, sb.PointCloud(np.eye(3)))
    before = path.read_bytes()
    with pytest.raises(sb.InvalidInputError, match="encoding"):
        sb.write(path, sb.PointCloud(np.eye(3)), encoding="zip")
    with pytest.raises(sb.InvalidTypeError, match="cloud is None"):
        sb.write(path, None)  # type: ignore[arg-type]
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.pcd"]


def test_write_refuses_unknown_suffixes_and_options(tmp_path: Path) -> None:
    cloud = sb.PointCloud(np.eye(3))
    with pytest.raises(sb.InvalidInputError, match=r"'\.stl'.*known are \.ply, \.pcd, .*\.csv"):
        sb.write(tmp_path / "a.stl", cloud)
    with pytest.raises(sb.InvalidInputError, match="does not write"):
        sb.write(tmp_path / "a.bin", cloud)
    with pytest.raises(sb.InvalidInputError, match="unknown option 'text' for ply"):
        sb.write(tmp_path / "a.ply", cloud, text=True)
    with pytest.raises(IsADirectoryError):
        sb.write(tmp_path, cloud, format="ply")
    sb.write(tmp_path / "cloud.data", cloud, format="ply")
    assert len(sb.read(tmp_path / "cloud.data")) == 3
    with pytest.raises(FileNotFoundError):
        sb.write(tmp_path / "missing" / "a.ply", cloud)
