"""Octree levels against halved coordinates in numpy."""

from __future__ import annotations

import numpy as np
import pytest

import surfabet as sb


def test_levels_agree_with_numpy() -> None:
    points = np.random.default_rng(1).uniform(0, 5, (3000, 3)).astype(np.float32)
    tree = sb.Octree(sb.PointCloud(points), 0.4)
    assert tree.node_size(tree.depth) == pytest.approx(0.4)
    low = points.min(axis=0).astype(float)
    for level in range(tree.depth + 1):
        size = tree.node_size(level)
        cells, inverse, counts = np.unique(
            np.floor((points - low) / size), axis=0, return_inverse=True, return_counts=True
        )
        inverse = inverse.ravel()
        centers = low + (cells + 0.5) * size
        centroids = np.stack(
            [np.bincount(inverse, points[:, a]) / counts for a in range(3)], axis=1
        )
        found = tree.centers(level)
        assert len(found) == len(cells)
        order = np.lexsort(found.T[::-1].round(4))
        np.testing.assert_allclose(found[order], centers, atol=1e-4)
        np.testing.assert_allclose(tree.centroids(level)[order], centroids, atol=1e-4)
        np.testing.assert_array_equal(tree.counts(level)[order], counts)


def test_thinning_to_a_count() -> None:
    tree = sb.Octree(sb.PointCloud(np.random.default_rng(2).uniform(0, 1, (5000, 3))), 0.01)
    level = tree.level_with_at_most(600)
    assert len(tree.counts(level)) <= 600 < len(tree.counts(level + 1))


def test_refusals() -> None:
    cloud = sb.PointCloud(np.eye(3))
    with pytest.raises(sb.InvalidInputError, match="leaf_size"):
        sb.Octree(cloud, -1.0)
    with pytest.raises(sb.InvalidInputError, match=r"2\^21"):
        sb.Octree(cloud, 1e-9)
    with pytest.raises(sb.InvalidInputError, match="level is 9"):
        sb.Octree(cloud, 1.0).centers(9)
