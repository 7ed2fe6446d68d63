"""The measures against scipy and against cases worked out by hand."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet as sb


def test_agrees_with_scipy() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(3000, 3)), rng.normal(size=(1000, 3))
    colors_a = rng.integers(0, 256, (3000, 3), dtype=np.uint8)
    colors_b = rng.integers(0, 256, (1000, 3), dtype=np.uint8)
    found = sb.evaluate(
        sb.PointCloud(a, colors=colors_a), sb.PointCloud(b, colors=colors_b), sigma=0.2
    )
    forward, to_a = cKDTree(a).query(b)
    backward, to_b = cKDTree(b).query(a)
    both = np.r_[forward, backward]

    def rms(x: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.square(x.astype(float)))))

    assert found.rmse_forward == pytest.approx(rms(forward), rel=1e-5)
    assert found.rmse_backward == pytest.approx(rms(backward), rel=1e-5)
    assert found.rmse == max(found.rmse_forward, found.rmse_backward)
    assert found.rmse_pooled == pytest.approx(rms(both), rel=1e-5)
    assert found.mean_backward == pytest.approx(backward.mean(), rel=1e-5)
    for percent in (95, 99):
        exact = np.percentile(backward, percent, method="inverted_cdf")
        assert getattr(found, f"p{percent}_backward") == pytest.approx(exact, rel=1e-5)
    assert found.max_forward == pytest.approx(forward.max(), rel=1e-5)
    difference_forward = colors_a[to_a].astype(float) - colors_b
    difference_backward = colors_b[to_b].astype(float) - colors_a
    assert found.color_rmse_forward == pytest.approx(rms(difference_forward), rel=1e-9)
    assert found.color_rmse_pooled == pytest.approx(
        rms(np.vstack([difference_forward, difference_backward])), rel=1e-9
    )
    assert found.inliers == pytest.approx((backward <= 0.2).mean(), abs=1e-3)
    assert found.outliers == pytest.approx((forward > 0.2).mean(), abs=2e-3)
    diagonal = np.linalg.norm(np.ptp(a, axis=0))
    assert found.psnr_peak == pytest.approx(diagonal, rel=1e-6)
    assert found.d1_psnr == pytest.approx(20 * np.log10(diagonal / found.rmse), rel=1e-6)


def test_plane_distance_ignores_sliding_along_the_surface() -> None:
    x, y = (c.ravel() for c in np.meshgrid(np.arange(30.0), np.arange(30.0)))
    sheet = np.stack([x, y, 0 * x], axis=1)
    moved = np.add(sheet, [0.5, 0.5, 0.25])
    for normals in (None, np.tile([0.0, 0.0, 1.0], (900, 1))):
        found = sb.evaluate(sb.PointCloud(sheet, normals=normals), sb.PointCloud(moved))
        assert found.plane_rmse_pooled == pytest.approx(0.25, rel=1e-6)
        assert found.rmse > 0.7
    assert (
        sb.evaluate(sb.PointCloud(sheet), sb.PointCloud(moved), normal_neighbors=None).d2_psnr
        is None
    )


def test_sigma_by_range() -> None:
    reference = sb.PointCloud([[1.0, 0, 0], [10.0, 0, 0]], ranges=[1.0, 10.0])
    decoded = sb.PointCloud([[1.03, 0, 0], [10.15, 0, 0]])
    sigma = sb.RangeSigma(sigma_scale=2.0, angular_resolution=np.degrees(0.02))
    found = sb.evaluate(reference, decoded, sigma=sigma)
    assert (found.inliers, found.outliers) == (0.5, 0.5)
    with pytest.raises(sb.InvalidInputError, match="ranges or viewpoints"):
        sb.evaluate(decoded, reference, sigma=sigma)


def test_bytes_and_ratio() -> None:
    cloud = sb.PointCloud(np.eye(3))
    found = sb.evaluate(cloud, cloud, bytes=6)
    assert (found.bits_per_point, found.ratio) == (16.0, 6.0)
    colored = sb.PointCloud(np.eye(3), colors=np.zeros((3, 3), np.uint8))
    assert sb.evaluate(colored, colored, bytes=15).ratio == 3.0
    assert sb.evaluate(cloud, cloud).bits_per_point is None
    with pytest.raises(sb.InvalidInputError, match="bytes is -1"):
        sb.evaluate(cloud, cloud, bytes=-1)


def test_the_result_is_frozen_and_readable() -> None:
    cloud = sb.PointCloud(np.eye(3))
    found = sb.evaluate(
        cloud, sb.PointCloud(np.add(np.eye(3), [0, 0, 0.001])), sigma=0.01, bytes=100
    )
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.rmse = 0.0
    assert "rmse 1.00 mm" in repr(found)
    assert "inliers 100.00%" in repr(found)
    back = json.loads(json.dumps(found.as_dict()))
    assert back["rmse"] == found.rmse
    assert back["bits_per_point"] == found.bits_per_point


def test_origins_meet_in_double_precision() -> None:
    world = np.array([[500_000.0, 5_400_000.0, 10.0], [500_001.0, 5_400_000.0, 10.0]])
    a = sb.PointCloud(world)
    b = sb.PointCloud([[0.001, 0, 0], [1.001, 0, 0]], origin=world[0])
    assert sb.evaluate(a, b).rmse == pytest.approx(0.001, rel=1e-3)


def test_refusals() -> None:
    cloud, empty = sb.PointCloud(np.eye(3)), sb.PointCloud(np.zeros((0, 3)))
    with pytest.raises(sb.InvalidInputError, match=r"decoded.*needs at least 1 points"):
        sb.evaluate(cloud, empty)
    with pytest.raises(sb.InvalidInputError, match=r"reference.*needs at least 1 points"):
        sb.evaluate(empty, cloud)
    with pytest.raises(sb.InvalidInputError, match="sigma is 0"):
        sb.evaluate(cloud, cloud, sigma=0.0)


def test_progress_is_told_and_can_stop() -> None:
    cloud = sb.PointCloud(np.random.default_rng(1).normal(size=(1000, 3)))
    seen: list[tuple[str, float]] = []
    sb.evaluate(cloud, cloud, progress=lambda stage, done: seen.append((stage, done)))
    assert seen
    assert all(0 <= done <= 1 for _, done in seen)

    def stop(stage: str, done: float) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        sb.evaluate(cloud, cloud, progress=stop)


def test_threads_change_nothing() -> None:
    rng = np.random.default_rng(4)
    a = sb.PointCloud(rng.normal(size=(20000, 3)))
    b = sb.PointCloud(rng.normal(size=(9000, 3)))
    found = []
    try:
        for threads in (1, 2, 8):
            sb.set_num_threads(threads)
            found.append(sb.evaluate(a, b, sigma=0.1))
    finally:
        sb.set_num_threads(None)
    assert found[0] == found[1] == found[2]
