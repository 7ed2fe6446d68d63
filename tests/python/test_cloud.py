"""Clouds are built from numpy without surprises and looked at without copies."""

from __future__ import annotations

import copy
import gc
import pickle

import numpy as np
import pytest

import surfabet as sb

POINTS = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [-6.0, 7.0, 8.5]])


@pytest.mark.parametrize(
    "points",
    [
        POINTS,
        POINTS.astype(np.float32),
        POINTS.astype(np.float16),
        POINTS.astype(">f8"),
        POINTS.astype(">f4"),
        np.asfortranarray(POINTS),
        np.repeat(POINTS, 2, axis=0)[::2],
        np.hstack([POINTS, POINTS])[:, :3],
        POINTS[::-1][::-1],
        POINTS.tolist(),
    ],
    ids=["f64", "f32", "f16", "be8", "be4", "fortran", "strided", "columns", "reversed", "list"],
)
def test_same_points_from_any_layout(points: object) -> None:
    cloud = sb.PointCloud(points)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.points.dtype == np.float64
    assert cloud.local_points.dtype == np.float32
    assert len(cloud) == 3


def test_integers_and_read_only_arrays() -> None:
    points = np.arange(6).reshape(2, 3)
    points.flags.writeable = False
    np.testing.assert_array_equal(sb.PointCloud(points).points, points)


def test_input_is_copied() -> None:
    points = POINTS.copy()
    cloud = sb.PointCloud(points)
    points[:] = 99.0
    np.testing.assert_array_equal(cloud.points, POINTS)


@pytest.mark.parametrize("shape", [(3,), (3, 2), (3, 4), (1, 3, 3)])
def test_wrong_shapes_are_named(shape: tuple[int, ...]) -> None:
    expected = r"points is an array of the shape .*one of the shape \(n, 3\)"
    with pytest.raises(sb.InvalidInputError, match=expected):
        sb.PointCloud(np.zeros(shape))


@pytest.mark.parametrize("dtype", ["complex128", "S3", "object", "bool"])
def test_wrong_types_are_named(dtype: str) -> None:
    with pytest.raises(TypeError, match=r"points is an array of .*, but must be an"):
        sb.PointCloud(np.zeros((2, 3)).astype(dtype))


def test_nan_points_are_dropped_with_a_warning() -> None:
    points = np.vstack([POINTS, [[np.nan, 0, 0], [0, np.inf, 0]]])
    with pytest.warns(sb.DroppedPointsWarning, match="dropped 2 of 5 points"):
        cloud = sb.PointCloud(points, intensities=np.arange(5))
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.intensities, [0, 1, 2])


def test_views_are_read_only_and_keep_their_owner() -> None:
    cloud = sb.PointCloud(
        POINTS, colors=np.full((3, 3), 7, np.uint8), ranges=[1.0, 2.0, 3.0], viewpoints=[[0, 0, 0]]
    )
    views = [cloud.local_points, cloud.colors, cloud.ranges, cloud.viewpoints]
    copies = [np.array(v) for v in views]
    for view in views:
        assert view is not None
        with pytest.raises(ValueError, match="read-only"):
            view[0] = 1
        with pytest.raises(ValueError, match="WRITEABLE"):
            view.flags.writeable = True
    del cloud
    gc.collect()
    np.zeros((1000, 1000))
    for view, kept in zip(views, copies, strict=True):
        np.testing.assert_array_equal(view, kept)


def test_colors_of_any_depth() -> None:
    eight = np.array([[0, 128, 255]] * 3, np.uint8)
    sixteen = eight.astype(np.uint16) * 257
    for colors in (eight, sixteen, eight / 255.0):
        np.testing.assert_array_equal(sb.PointCloud(POINTS, colors=colors).colors, eight)
    with pytest.raises(sb.InvalidInputError, match="floats from 0 to 1"):
        sb.PointCloud(POINTS, colors=eight.astype(float))


def test_columns_of_another_length_are_refused() -> None:
    with pytest.raises(sb.InvalidInputError, match="ranges has 2 values for 3 points"):
        sb.PointCloud(POINTS, ranges=[1.0, 2.0])
    with pytest.raises(sb.InvalidInputError, match="viewpoint 3 is out of range"):
        sb.PointCloud(POINTS, viewpoints=np.zeros((2, 3)), viewpoint_index=[0, 1, 3])
    with pytest.raises(sb.InvalidInputError, match="viewpoints is an array of 2 positions"):
        sb.PointCloud(POINTS, viewpoints=np.zeros((2, 3)))


def test_utm_coordinates_survive() -> None:
    world = np.add(POINTS, [448_262.123, 5_411_932.678, 512.345])
    cloud = sb.PointCloud(world)
    np.testing.assert_allclose(cloud.points, world, atol=1e-6)
    assert np.abs(cloud.local_points).max() < 10


def test_a_pickled_cloud_is_the_same_to_the_bit() -> None:
    rng = np.random.default_rng(0)
    n = 50
    cloud = sb.PointCloud(
        # Also coordinates so small that their sum with the origin has no place for all digits.
        (rng.normal(size=(n, 3)) * 10.0 ** rng.integers(-9, 3, (n, 1))).astype(np.float32),
        origin=[500_000.123, 5_400_000.7, 210.0],
        colors=rng.integers(0, 256, (n, 3), np.uint8),
        intensities=rng.random(n, np.float32),
        normals=np.tile(np.float32([0, 0, 1]), (n, 1)),
        ranges=rng.random(n, np.float32),
        viewpoints=rng.random((2, 3)),
        viewpoint_index=rng.integers(0, 2, n).astype(np.uint32),
        extra={"label": rng.integers(0, 9, n).astype(np.int16)},
        crs="EPSG:25832",
    )
    for again in (pickle.loads(pickle.dumps(cloud)), copy.copy(cloud), copy.deepcopy(cloud)):
        assert again.attributes == cloud.attributes
        assert (again.origin, again.crs) == (cloud.origin, cloud.crs)
        for name in ("local_points", "viewpoint_index", *cloud.attributes):
            if name != "crs":
                assert again[name].dtype == cloud[name].dtype
                np.testing.assert_array_equal(again[name], cloud[name])
    bare = pickle.loads(pickle.dumps(sb.PointCloud(np.zeros((0, 3)))))
    assert len(bare) == 0


def test_columns_go_by_names_and_points_by_select() -> None:
    cloud = sb.PointCloud(np.zeros((2, 3)))
    with pytest.raises(TypeError, match=r"name is 0, but must be the name of a column.* select"):
        cloud[0]  # type: ignore[index]


def test_select_and_concat() -> None:
    cloud = sb.PointCloud(POINTS, intensities=[1, 2, 3])
    np.testing.assert_array_equal(cloud.select([2, 0]).points, POINTS[[2, 0]])
    np.testing.assert_array_equal(cloud.select([True, False, True]).intensities, [1, 3])
    with pytest.raises(sb.InvalidInputError, match="out of range"):
        cloud.select([3])
    with pytest.raises(sb.InvalidInputError, match="which is a mask of 2 values"):
        cloud.select([True, False])
    joined, lost = sb.PointCloud.concat([cloud, sb.PointCloud(POINTS + 10.0)])
    np.testing.assert_allclose(joined.points, np.vstack([POINTS, POINTS + 10.0]))
    assert lost == ["intensities"]


def test_empty() -> None:
    cloud = sb.PointCloud(np.zeros((0, 3)))
    assert len(cloud) == 0
    assert cloud.bounds is None
    assert cloud.points.shape == (0, 3)
    assert "0 points" in repr(cloud)


@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_extra_columns_keep_their_type(dtype: str, order: str) -> None:
    kind = np.dtype(dtype)
    ends = np.finfo(kind) if kind.kind == "f" else np.iinfo(kind)
    values = np.array([ends.min, 1, ends.max], order + dtype)
    cloud = sb.PointCloud(POINTS, extra={"any name": np.repeat(values, 2)[::2]})
    assert cloud["any name"].dtype == kind
    np.testing.assert_array_equal(cloud["any name"], values)
    np.testing.assert_array_equal(cloud.select([2, 0])["any name"], values[[2, 0]])


def test_extra_columns_by_name_in_order() -> None:
    time = np.array([3e8, 3e8 + 1e-7, 3e8 + 2e-7])
    extra = {"label": [7, 8, 9], "gps_time": time, "valid": [True, False, True], "half": [0.5] * 3}
    cloud = sb.PointCloud(POINTS, colors=np.zeros((3, 3), np.uint8), ranges=[1, 2, 3], extra=extra)
    assert cloud.attributes == ["colors", "ranges", "label", "gps_time", "valid", "half"]
    assert list(cloud.extra) == ["label", "gps_time", "valid", "half"]
    assert [c.dtype for c in cloud.extra.values()] == [np.int64, np.float64, np.uint8, np.float64]
    np.testing.assert_array_equal(cloud.extra["gps_time"], time)
    np.testing.assert_array_equal(cloud["ranges"], [1, 2, 3])
    np.testing.assert_array_equal(cloud["points"], POINTS)
    assert "label, gps_time" in repr(cloud)
    with pytest.raises(ValueError, match="read-only"):
        cloud["label"][0] = 1
    for name in ["normals", "viewpoint_index", "no such", "bounds"]:
        with pytest.raises(KeyError, match="it has points, colors, ranges, label"):
            cloud[name]
    half = sb.PointCloud(POINTS, extra={"half": np.ones(3, np.float16)})
    assert half["half"].dtype == np.float32


def test_extra_columns_follow_their_points() -> None:
    points = np.vstack([POINTS[:1], [[np.nan, 0, 0]], POINTS[1:]])
    with pytest.warns(sb.DroppedPointsWarning, match="dropped 1 of 4"):
        cloud = sb.PointCloud(points, extra={"a": np.arange(4), "b": [1.0, 2.0, np.nan, 4.0]})
    np.testing.assert_array_equal(cloud["a"], [0, 2, 3])
    np.testing.assert_array_equal(cloud["b"], [1.0, np.nan, 4.0])
    seen = cloud.seen_from([0, 0, 0])
    assert seen.attributes == ["ranges", "viewpoints", "a", "b"]
    joined, lost = sb.PointCloud.concat([cloud, sb.PointCloud(POINTS, extra={"a": np.arange(3)})])
    np.testing.assert_array_equal(joined["a"], [0, 2, 3, 0, 1, 2])
    assert lost == ["b"]
    _, lost = sb.PointCloud.concat([cloud, sb.PointCloud(POINTS, extra={"a": np.ones(3)})])
    assert lost == ["a", "b"]
    small = sb.voxel_downsample(cloud, 100.0)
    assert small["a"].dtype == np.int64
    assert small.attributes == ["a", "b"]


@pytest.mark.parametrize(
    ("extra", "error", "message"),
    [
        ({"a": [1, 2]}, sb.InvalidInputError, 'extra "a" has 2 values for 3 points'),
        (
            {"a": [[1], [2], [3]]},
            sb.InvalidInputError,
            r'extra "a" is an array of the shape \(3, 1\)',
        ),
        ({"a": ["x", "y", "z"]}, TypeError, 'extra "a" is an array of <U1, but'),
        ({"": [1, 2, 3]}, sb.InvalidInputError, 'extra is ""'),
        ({"ranges": [1, 2, 3]}, sb.InvalidInputError, 'extra is "ranges".*none of points'),
        ([1, 2, 3], TypeError, "extra"),
    ],
)
def test_wrong_extra_columns_are_named(extra: object, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        sb.PointCloud(POINTS, extra=extra)


def test_the_reference_system_is_kept_where_it_is_known_for_all() -> None:
    cloud = sb.PointCloud(POINTS, crs="EPSG:25832")
    assert cloud.crs == "EPSG:25832"
    assert sb.PointCloud(POINTS).crs is None
    assert cloud.attributes == []
    assert cloud.select([0]).crs == "EPSG:25832"
    assert cloud.seen_from([0, 0, 0]).crs == "EPSG:25832"
    assert sb.PointCloud.concat([cloud, cloud])[0].crs == "EPSG:25832"
    joined, lost = sb.PointCloud.concat([cloud, sb.PointCloud(POINTS)])
    assert (joined.crs, lost) == (None, ["crs"])


def test_a_model_names_the_columns_that_it_does_not_keep() -> None:
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(0, 1, (500, 2)), np.zeros(500)])
    cloud = sb.PointCloud(points, extra={"classification": np.ones(500, np.uint8)}, crs="EPSG:1")
    assert sb.learn_gas(cloud, n_neurons=20).report.not_kept == ("classification", "crs")
