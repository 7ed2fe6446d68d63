"""The paper's alphabet from Python: arrays, report, another scene."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet as sb
from generated import DATA, WITHOUT_DATA, rotating_scan

RADIUS = 0.15
ROOM_RESOLUTION = 0.972
"""Angle between beams of the real scanner, degrees."""
# Of a scanner that would leave about as many points as `corner` has at that distance.
OPTIONS: dict[str, Any] = {"angular_resolution": 0.86}


def corner(seed: int) -> sb.PointCloud:
    """Floor and two walls of one metre with a bump, seen from one place, with 1 mm of noise."""
    rng = np.random.default_rng(seed)
    points = []
    for axis in range(3):
        p = rng.uniform(0, 1, (4000, 3))
        bump = 0.05 * np.exp(-((p - 0.4) ** 2).sum(axis=1, where=np.arange(3) != axis) / 0.005)
        p[:, axis] = bump + 0.001 * rng.standard_normal(len(p))
        points.append(p)
    cloud = np.concatenate(points).astype(np.float32)
    index = np.zeros(len(cloud), np.uint32)
    return sb.PointCloud(cloud, viewpoints=[[1.5, 1.5, 1.5]], viewpoint_index=index)


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return corner(0)


@pytest.fixture(scope="module")
def model(cloud: sb.PointCloud) -> sb.BicAlphabetModel:
    return sb.learn_bic_alphabet(cloud, radius=RADIUS, iterations=60, **OPTIONS)


def test_decoding_places_words_at_their_poses(model: sb.BicAlphabetModel) -> None:
    words, poses, ids = model.alphabet.points, model.poses, model.words
    assert len(words) == len(model.alphabet)
    assert len(poses) == len(ids) == len(model)
    np.testing.assert_array_equal(model.counts, np.bincount(ids, minlength=len(words)))
    rotations = poses[:, :3, :3]
    np.testing.assert_allclose(
        rotations @ rotations.transpose(0, 2, 1),
        np.broadcast_to(np.eye(3), rotations.shape),
        atol=1e-6,
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1, atol=1e-6)
    placed = np.concatenate(
        [words[w] @ pose[:3, :3].T + pose[:3, 3] for w, pose in zip(ids, poses, strict=True)]
    )
    decoded = model.decode().points
    epsilon = 0.2 * RADIUS
    # Every decoded point is one of a word's, they keep epsilon, and every other is near one.
    assert cKDTree(placed).query(decoded)[0].max() < 1e-5
    tree = cKDTree(decoded)
    assert tree.query(decoded, k=2)[0][:, 1].min() >= epsilon - 1e-6
    assert tree.query(placed)[0].max() < epsilon + 1e-5


def test_the_report_tells_the_paper_s_measures(model: sb.BicAlphabetModel) -> None:
    report = model.report
    figures = report.figures
    trace = report.objectives["bic"]
    assert len(trace) == report.iterations == 60
    assert all(b <= a for a, b in itertools.pairwise(trace))
    points = sum(len(p) for p in model.alphabet.points)
    assert figures["paper bytes reduced"] == 12 * points + 28 * len(model)
    assert figures["paper bytes"] > figures["paper bytes reduced"]
    assert figures["inliers"] > 0.9
    # Words reach over the rims of walls of one metre by up to their radius of 15 cm.
    assert figures["outliers"] < 0.2
    assert report.not_kept == ("viewpoints",)


def test_descriptors_are_heights_over_a_disc(model: sb.BicAlphabetModel) -> None:
    images = model.alphabet.descriptors
    assert images.shape == (len(model.alphabet), 8, 8)
    assert np.isnan(images[:, 0, 0]).all()
    assert np.isfinite(images[:, 4, 4]).all()
    assert np.nanmax(np.abs(images)) <= RADIUS + 1e-6


def test_another_scene_in_the_same_words(model: sb.BicAlphabetModel) -> None:
    other = model.alphabet.describe(corner(1), **OPTIONS)
    assert other.shares_vocabulary
    assert not model.shares_vocabulary
    assert other.alphabet.hash == model.alphabet.hash
    assert other.report.figures["inliers"] > 0.85
    with pytest.raises(TypeError, match="radius"):
        model.alphabet.describe(corner(1), radius=0.1)  # type: ignore[call-arg]


def test_decoded_points_keep_their_spacing(model: sb.BicAlphabetModel) -> None:
    coarse = model.decode(0.08).points
    assert len(coarse) < len(model.decode())
    assert cKDTree(coarse).query(coarse, k=2)[0][:, 1].min() >= 0.08 - 1e-6


def check_a_room(points: list[np.ndarray]) -> dict[str, float]:
    """Words of the first scan explain it and the second as well as the paper's did."""
    scans = [
        sb.PointCloud(p, viewpoints=np.zeros((1, 3)), viewpoint_index=np.zeros(len(p), np.uint32))
        for p in points
    ]
    # Seeds spread by half a point about 98 percent.
    chosen: dict[str, Any] = {
        "min_range": 0.5,
        "angular_resolution": ROOM_RESOLUTION,
        "random_state": 1,
    }
    model = sb.learn_bic_alphabet(scans[0], **chosen)
    figures = model.report.figures
    assert figures["inliers"] >= 0.97
    assert figures["outliers"] <= 0.06
    rebuilt = model.alphabet.describe(scans[1], **chosen).report.figures
    assert rebuilt["inliers"] >= 0.97
    assert rebuilt["outliers"] <= 0.05
    return figures


def test_the_paper_s_figures_on_a_generated_room() -> None:
    """Twin of the test below: the same room from two places."""
    first, second = rotating_scan(), rotating_scan((0.6, 0.4, 0.0), seed=1)
    figures = check_a_room([first, second])
    far = np.unique(first, axis=0)
    assert figures["distinct points"] == (np.linalg.norm(far, axis=1) >= 0.5).sum()


@pytest.mark.skipif(not DATA.is_dir(), reason=WITHOUT_DATA)
def test_the_paper_s_figures_on_a_real_room() -> None:
    scans = [sb.read(DATA / "indoor_scan" / f"room_scan{number}.pcd") for number in (1, 2)]
    figures = check_a_room([scan.points.astype(np.float32) for scan in scans])
    # Of 56 159, 11 186 are nearer than half a metre; some 18 of them by a rounding error.
    assert 44_900 < figures["distinct points"] < 45_000
