"""Range images against the projection written out in numpy."""

from __future__ import annotations

import numpy as np
import pytest

import surfabet as sb

POSE = np.array([[0, -1, 0, 4.0], [1, 0, 0, 5.0], [0, 0, 1, 6.0], [0, 0, 0, 1]])


def test_pinhole_agrees_with_numpy() -> None:
    rng = np.random.default_rng(1)
    local = rng.uniform([-2, -2, 0.5], [2, 2, 5], (4000, 3))
    cloud = sb.PointCloud(local @ POSE[:3, :3].T + POSE[:3, 3])
    image = sb.RangeImage.pinhole(
        cloud, fx=40, fy=50, cx=31.5, cy=24, width=64, height=48, pose=POSE
    )
    u = np.floor(40 * local[:, 0] / local[:, 2] + 31.5 + 0.5).astype(int)
    v = np.floor(50 * local[:, 1] / local[:, 2] + 24 + 0.5).astype(int)
    ranges = np.linalg.norm(local, axis=1)
    expected = np.full((48, 64), np.inf)
    inside = (u >= 0) & (u < 64) & (v >= 0) & (v < 48)
    np.minimum.at(expected, (v[inside], u[inside]), ranges[inside])
    expected[np.isinf(expected)] = 0
    agree = np.isclose(image.ranges, expected, atol=1e-4)
    assert agree.mean() > 0.999  # single precision moves a point on a pixel's edge now and then
    filled = image.index != 2**32 - 1
    np.testing.assert_array_equal(filled, image.ranges > 0)
    np.testing.assert_allclose(image.ranges[filled], ranges[image.index[filled]], atol=1e-4)


def test_pixels_and_points_both_ways() -> None:
    image = sb.RangeImage.spherical(
        sb.PointCloud(np.zeros((0, 3))),
        azimuth_step=np.pi / 180,
        elevation_step=np.pi / 90,
        elevations=[-0.5, 0.5],
        pose=POSE,
    )
    rows, columns = (a.ravel() for a in np.indices(image.shape)[:, :-1])
    ranges = np.linspace(1, 30, len(rows))
    points = image.unproject(rows, columns, ranges)
    pixels, distances = image.project(points)
    np.testing.assert_array_equal(pixels, np.stack([rows, columns], axis=1))
    np.testing.assert_allclose(distances, ranges, rtol=1e-6)
    pixels, distances = image.project(POSE[None, :3, 3] + [0, 0, 5])
    np.testing.assert_array_equal(pixels, [[-1, -1]])
    assert np.isnan(distances).all()


def test_refusals() -> None:
    cloud = sb.PointCloud(np.eye(3))
    with pytest.raises(sb.InvalidInputError, match="rotation"):
        sb.RangeImage.pinhole(cloud, fx=1, fy=1, cx=0, cy=0, width=2, height=2, pose=2 * POSE)
    with pytest.raises(sb.InvalidInputError, match="fx"):
        sb.RangeImage.pinhole(cloud, fx=0, fy=1, cx=0, cy=0, width=2, height=2)
    with pytest.raises(sb.InvalidInputError, match="elevations"):
        sb.RangeImage.spherical(cloud, azimuth_step=0.1, elevation_step=0.1, elevations=[1, 0])
