"""Normals of surfaces whose normals are known."""

from __future__ import annotations

import numpy as np
import pytest

import surfabet as sb


def test_sphere_towards_the_viewpoint() -> None:
    directions = np.random.default_rng(1).normal(size=(5000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cloud = sb.PointCloud(5 * directions + [10, 0, 0], viewpoints=[[10, 0, 0]])
    found = sb.estimate_normals(cloud, neighbors=12)
    assert found.unknown == 0
    assert ((found.cloud.normals * -directions).sum(axis=1) > 0.99).all()
    assert found.curvatures.max() < 0.05


@pytest.mark.parametrize(
    "options", [{}, {"radius": 0.3}, {"neighbors": None, "radius": 0.3}], ids=str
)
def test_noisy_plane_agrees_with_svd(options: dict[str, float]) -> None:
    rng = np.random.default_rng(2)
    points = rng.uniform(-1, 1, (1500, 3)) * [1, 1, 0] + rng.normal(0, 0.01, (1500, 3))
    cloud = sb.PointCloud(points)
    found = sb.estimate_normals(cloud, **options)
    distances = np.linalg.norm(points[:, None] - points[:20], axis=2)
    for i in range(20):
        near = np.argsort(distances[:, i], kind="stable")
        if options.get("neighbors", 16) is not None:
            near = near[:16]
        if "radius" in options:
            near = near[distances[near, i] <= 0.3]
        _, values, axes = np.linalg.svd(points[near] - points[near].mean(axis=0))
        assert abs(axes[2] @ found.cloud.normals[i]) > 0.999
        share = values[2] ** 2 / (values**2).sum()
        assert found.curvatures[i] == pytest.approx(share, rel=1e-2)


def test_line_is_unknown() -> None:
    line = np.linspace(0, 1, 50)[:, None] * [1.0, 2.0, 3.0]
    found = sb.estimate_normals(sb.PointCloud(line), neighbors=5)
    assert found.unknown == 50
    assert not found.cloud.normals.any()


def test_attributes_are_kept_and_refusals_named() -> None:
    cloud = sb.PointCloud(np.eye(3), intensities=[1, 2, 3])
    assert sb.estimate_normals(cloud).cloud.attributes == ["intensities", "normals"]
    with pytest.raises(sb.InvalidInputError, match="at least 3"):
        sb.estimate_normals(cloud, neighbors=2)
    with pytest.raises(sb.InvalidInputError, match="neighbors, radius or both"):
        sb.estimate_normals(cloud, neighbors=None)
    with pytest.raises(sb.InvalidInputError, match="radius"):
        sb.estimate_normals(cloud, radius=0.0)
