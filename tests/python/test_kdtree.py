"""The k-d tree against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet as sb


@pytest.fixture
def points() -> np.ndarray:
    rng = np.random.default_rng(1)
    flat = rng.uniform(-2, 2, (3000, 3)) * [1, 1, 0]
    return np.vstack([flat, rng.normal(size=(2000, 3)), np.zeros((40, 3))]).astype(np.float32)


@pytest.mark.parametrize("k", [1, 2, 16, 100])
def test_nearest_agree_with_scipy(points: np.ndarray, k: int) -> None:
    queries = np.random.default_rng(2).uniform(-3, 3, (500, 3)).astype(np.float32)
    distances, index = sb.KdTree(points).query(queries, k)
    expected, _ = cKDTree(points).query(queries, k)
    np.testing.assert_allclose(distances, expected.reshape(500, k), rtol=1e-5)
    own = np.linalg.norm(points[index] - queries[:, None], axis=2)
    np.testing.assert_allclose(own, distances, rtol=1e-5)


def test_radius_agrees_with_scipy(points: np.ndarray) -> None:
    queries = points[::50]
    starts, distances, index = sb.KdTree(points).query_radius(queries, 0.3)
    expected = cKDTree(points).query_ball_point(queries.astype(float), 0.3)
    assert starts[0] == 0
    assert starts[-1] == len(index) == len(distances)
    for i, row in enumerate(expected):
        found = slice(starts[i], starts[i + 1])
        assert set(index[found]) == set(row)
        assert (np.diff(distances[found]) >= 0).all()


def test_ties_come_by_index() -> None:
    _, index = sb.KdTree(np.zeros((100, 3))).query(np.ones((1, 3)), 5)
    np.testing.assert_array_equal(index, [[0, 1, 2, 3, 4]])


def test_utm_coordinates() -> None:
    world = np.array([[448_262.0, 5_411_932.0, 5.0], [448_262.002, 5_411_932.0, 5.0]])
    for tree in (sb.KdTree(world), sb.KdTree(sb.PointCloud(world))):
        distances, index = tree.query(np.add(world[1:], [0.001, 0, 0]), 2)
        np.testing.assert_array_equal(index, [[1, 0]])
        np.testing.assert_allclose(distances, [[0.001, 0.003]], atol=1e-5)


def test_fewer_points_than_asked_for() -> None:
    distances, _ = sb.KdTree(np.zeros((3, 3))).query(np.zeros((2, 3)), 10)
    assert distances.shape == (2, 3)


def test_refusals() -> None:
    with pytest.raises(sb.InvalidInputError, match="finite"):
        sb.KdTree([[0.0, np.nan, 0.0]])
    with pytest.raises(sb.InvalidInputError, match="at least 1 points"):
        sb.KdTree(np.zeros((0, 3))).query(np.zeros((1, 3)))
    with pytest.raises(sb.InvalidInputError, match="k is 0"):
        sb.KdTree(np.zeros((1, 3))).query(np.zeros((1, 3)), 0)
    with pytest.raises(sb.InvalidInputError, match="radius"):
        sb.KdTree(np.zeros((1, 3))).query_radius(np.zeros((1, 3)), -1.0)


def test_threads_change_nothing(points: np.ndarray) -> None:
    found = []
    try:
        for threads in (1, 2, 8):
            sb.set_num_threads(threads)
            found.append(sb.KdTree(points).query(points, 12))
    finally:
        sb.set_num_threads(None)
    for distances, index in found[1:]:
        np.testing.assert_array_equal(distances, found[0][0])
        np.testing.assert_array_equal(index, found[0][1])
