"""The paper's alphabet from the compiled module: arrays, report, files, another scene, threads."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet as sb
from surfabet import _core
from surfabet.errors import FormatError, InvalidInputError

DATA = Path(__file__).parents[2].parent / "shared" / "data"
RADIUS = 0.15
READ: dict[str, Any] = {
    "max_items": 10**6,
    "max_bytes": 10**8,
    "dictionary": None,
    "alphabet": None,
}
ROOM_RESOLUTION = np.radians(0.972)


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


def learn(cloud: sb.PointCloud, **changes: Any) -> _core.BicAlphabetModel:
    # Of a scanner that would leave about as many points at that distance.
    defaults = {"radius": RADIUS, "iterations": 60, "angular_resolution": 0.015}
    none = {"alphabet": None, "progress": None}
    return _core.learn_bic(cloud, **{**_core.bic_defaults(), **defaults, **none, **changes})


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return corner(0)


@pytest.fixture(scope="module")
def model(cloud: sb.PointCloud) -> _core.BicAlphabetModel:
    return learn(cloud)


def test_decoding_places_words_at_their_poses(model: _core.BicAlphabetModel) -> None:
    words, poses, ids = model.alphabet.points(), model.poses(), model.word_ids
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
    decoded = model.decode(max_points=1_000_000, progress=None).points
    # Every decoded point is one of a word's, they keep epsilon, and every other is near one.
    assert cKDTree(placed).query(decoded)[0].max() < 1e-5
    tree = cKDTree(decoded)
    assert tree.query(decoded, k=2)[0][:, 1].min() >= model.epsilon - 1e-6
    thinned_twice = 2 * model.epsilon
    assert tree.query(placed)[0].max() < thinned_twice


def test_the_report_tells_the_paper_s_measures(model: _core.BicAlphabetModel) -> None:
    report = model.report_dict
    figures = report["figures"]
    trace = report["objectives"]["bic"]
    assert len(trace) == report["iterations"] == 60
    assert all(b <= a for a, b in itertools.pairwise(trace))
    points = sum(len(p) for p in model.alphabet.points())
    assert figures["paper bytes reduced"] == 12 * points + 28 * len(model)
    assert figures["paper bytes"] > figures["paper bytes reduced"]
    assert figures["inliers"] > 0.9
    assert figures["outliers"] < 0.2
    assert report["not_kept"] == ["viewpoints"]


def test_descriptors_are_heights_over_a_disc(model: _core.BicAlphabetModel) -> None:
    images = model.alphabet.descriptors()
    assert images.shape == (len(model.alphabet), 8, 8)
    assert np.isnan(images[:, 0, 0]).all()
    assert np.isfinite(images[:, 4, 4]).all()
    assert np.nanmax(np.abs(images)) <= RADIUS + 1e-6


def test_files_come_back_with_and_without_their_words(
    model: _core.BicAlphabetModel, tmp_path: Path
) -> None:
    data = model.to_bytes()
    assert model.save(str(tmp_path / "a.sfb")) == len(data)
    again = _core.load(str(tmp_path / "a.sfb"), bic_alphabet=None, **READ)
    assert isinstance(again, _core.BicAlphabetModel)
    first, second = (m.decode(max_points=10**6, progress=None).points for m in (model, again))
    np.testing.assert_array_equal(first, second)
    shared = model.sharing_alphabet(True)
    assert shared.shares_alphabet
    assert len(shared.to_bytes()) < len(data)
    back = _core.from_bytes(shared.to_bytes(), bic_alphabet=model.alphabet, **READ)
    assert isinstance(back, _core.BicAlphabetModel)
    assert back.alphabet.hash == model.alphabet.hash
    assert back.to_bytes() == shared.to_bytes()
    with pytest.raises(FormatError, match=model.alphabet.hash):
        _core.from_bytes(shared.to_bytes(), bic_alphabet=None, **READ)


def test_another_scene_in_the_same_words(model: _core.BicAlphabetModel) -> None:
    other = learn(corner(1), alphabet=model.alphabet)
    assert other.alphabet.hash == model.alphabet.hash
    assert other.report_dict["figures"]["inliers"] > 0.85
    with pytest.raises(InvalidInputError, match="radius"):
        learn(corner(1), alphabet=model.alphabet, radius=0.1)


def test_wrong_options_are_named(cloud: sb.PointCloud) -> None:
    with pytest.raises(InvalidInputError, match="upright"):
        learn(cloud, upright="sideways")
    with pytest.raises(InvalidInputError, match="floor"):
        learn(cloud, floor=1.0)


@pytest.mark.skipif(not DATA.is_dir(), reason="the real scans are not there")
def test_the_paper_s_figures_on_a_real_room() -> None:
    scans = []
    for number in (1, 2):
        points = sb.read(DATA / "indoor_scan" / f"room_scan{number}.pcd").points.astype(np.float32)
        index = np.zeros(len(points), np.uint32)
        scans.append(sb.PointCloud(points, viewpoints=np.zeros((1, 3)), viewpoint_index=index))
    chosen: dict[str, Any] = {
        "radius": 0.1,
        "min_range": 0.5,
        "angular_resolution": ROOM_RESOLUTION,
        "iterations": 500,
        # Seeds spread by half a point about 98 percent.
        "random_state": 1,
    }
    model = learn(scans[0], **chosen)
    figures = model.report_dict["figures"]
    assert 44_900 < figures["distinct points"] < 45_000
    assert figures["inliers"] >= 0.97
    assert figures["outliers"] <= 0.06
    rebuilt = learn(scans[1], **chosen, alphabet=model.alphabet).report_dict["figures"]
    assert rebuilt["inliers"] >= 0.97
    assert rebuilt["outliers"] <= 0.05
