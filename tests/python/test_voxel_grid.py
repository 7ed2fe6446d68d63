"""Voxel means against numpy."""

from __future__ import annotations

import numpy as np
import pytest

import surfabet as sb


@pytest.mark.parametrize("offset", [0.0, 5_400_000.0])
@pytest.mark.parametrize("weighted", [False, True])
def test_means_agree_with_numpy(offset: float, weighted: bool) -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-3, 3, (4000, 3)) + offset
    colors = rng.integers(0, 256, (4000, 3), dtype=np.uint8)
    weights = rng.uniform(0.5, 2, 4000).astype(np.float32) if weighted else np.ones(4000)
    cloud = sb.PointCloud(points, colors=colors, intensities=np.arange(4000))
    grid = sb.VoxelGrid(cloud, 0.7)
    cells, inverse = np.unique(
        np.floor(cloud.points / 0.7).astype(np.int64), axis=0, return_inverse=True
    )
    inverse = inverse.ravel()
    np.testing.assert_array_equal(grid.cells, cells)
    np.testing.assert_array_equal(grid.voxel_of_points, inverse)
    np.testing.assert_array_equal(grid.counts, np.bincount(inverse))

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(inverse, values * weights) / np.bincount(inverse, weights)

    means = grid.means(weights if weighted else None)
    for axis in range(3):
        np.testing.assert_allclose(means.points[:, axis], mean(cloud.points[:, axis]), atol=1e-5)
        off = means.colors[:, axis] - mean(colors[:, axis].astype(float))
        assert np.abs(off).max() <= 0.5 + 1e-6
    np.testing.assert_allclose(means.intensities, mean(np.arange(4000.0)), rtol=1e-5)


def test_order_of_points_does_not_matter() -> None:
    points = np.random.default_rng(3).integers(-8, 8, (5000, 3)) / 4.0
    one = sb.voxel_downsample(sb.PointCloud(points), 0.5)
    other = sb.voxel_downsample(sb.PointCloud(points[::-1]), 0.5)
    np.testing.assert_allclose(one.points, other.points, atol=1e-6)


def test_refusals() -> None:
    cloud = sb.PointCloud(np.eye(3))
    with pytest.raises(sb.InvalidInputError, match="size is 0"):
        sb.voxel_downsample(cloud, 0.0)
    with pytest.raises(sb.InvalidInputError, match=r"2\^32"):
        sb.voxel_downsample(cloud, 1e-12)
    with pytest.raises(sb.InvalidInputError, match="weights has 1 values"):
        sb.voxel_downsample(cloud, 1.0, weights=[1.0])


def test_empty() -> None:
    assert len(sb.voxel_downsample(sb.PointCloud(np.zeros((0, 3))), 1.0)) == 0
