"""Alphabets from Python: arrays, qualitys, real and generated scans, command line."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet as sb
from generated import DATA, WITHOUT_DATA, rotating_scan
from surfabet.cli import main

ALPHA = 0.03
"""Angle between beams of the simulated scanner, radians."""
ROOM_RESOLUTION = 0.972
"""That of the real one, degrees."""
OPTIONS = {"radius": 0.1, "angular_resolution": np.degrees(ALPHA), "noise": 0.0}


def box_room(turn: float = 0.0) -> sb.PointCloud:
    """A box of 4 x 3 x 2.4 m with a step in its floor, seen from its middle; red where x is low."""
    beams = np.stack(
        np.meshgrid(np.arange(-1.5, 1.5, ALPHA), np.arange(-np.pi, np.pi, ALPHA)), -1
    ).reshape(-1, 2)
    flat = np.cos(beams[:, 0])
    rays = np.column_stack(
        [flat * np.cos(beams[:, 1] + turn), flat * np.sin(beams[:, 1] + turn), np.sin(beams[:, 0])]
    )
    with np.errstate(divide="ignore"):
        reach = np.min(np.array([2.0, 1.5, 1.2]) / np.abs(rays), axis=1)
    points = (rays * reach[:, None]).astype(np.float32)
    points[(points[:, 2] < -1.19) & (points[:, 1] > 0.5), 2] += 0.15
    colors = np.where(points[:, :1] < 0, (200, 40, 30), (30, 60, 200)).astype(np.uint8)
    return sb.PointCloud(
        points,
        colors=colors,
        intensities=np.abs(points[:, 0]).astype(np.float32),
        viewpoints=np.zeros((1, 3)),
        viewpoint_index=np.zeros(len(points), np.uint32),
    )


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return box_room()


@pytest.fixture(scope="module")
def model(cloud: sb.PointCloud) -> sb.AlphabetModel:
    return sb.learn_alphabet(cloud, **OPTIONS)


def test_the_scene_is_explained_within_sigma(cloud, model):
    quality = sb.evaluate(cloud, model.decode(), sigma=model.sigma, normal_neighbors=None)
    assert quality.inliers > 0.98
    assert quality.outliers < 0.05
    assert len(model.to_bytes()) < 2000
    # The same by an independent search.
    decoded = model.decode().points
    away = cKDTree(decoded).query(cloud.points)[0]
    sigma = 3 * np.tan(ALPHA / 2) * np.linalg.norm(cloud.points, axis=1)
    assert np.mean(away <= sigma) == pytest.approx(quality.inliers, abs=1e-3)


def test_occurrences_as_arrays_rebuild_the_cloud(model):
    found = model.occurrences
    m = len(model)
    assert len(found) == m
    rotations = found.poses[:, :3, :3]
    identity = np.broadcast_to(np.eye(3), (m, 3, 3))
    np.testing.assert_allclose(rotations.transpose(0, 2, 1) @ rotations, identity, atol=1e-9)
    towards = -np.einsum("ij,ij->i", found.poses[:, :3, 2], found.poses[:, :3, 3])
    assert (towards > 0).all()
    assert set(found.radii) <= set(model.alphabet.radii)
    np.testing.assert_array_equal(model.counts, np.bincount(found.words, minlength=1))
    heights = model.alphabet.heights
    assert heights.shape == (len(model.alphabet), 8, 8)
    assert (heights[0] == 0).all()
    # The middle of every plane is a point of the model when samples are fine enough.
    planes = found.poses[found.words == 0, :3, 3]
    away = cKDTree(model.decode(resolution=0.01).points).query(planes)[0]
    assert away.max() < 0.0075


def test_colours_intensities_and_viewpoints_come_back(cloud, model):
    decoded = model.decode(normals=True)
    near = cKDTree(cloud.points).query(decoded.points)[1]
    # Words of 1.6 m that reach over the border between the colours have a mixture.
    away_from_the_border = np.abs(decoded.points[:, 0]) > 1.7
    off = np.abs(decoded.colors.astype(int) - cloud.colors[near].astype(int)).max(axis=1)
    assert np.mean(off[away_from_the_border] <= 8) > 0.95
    assert decoded.intensities.min() >= 0
    np.testing.assert_allclose(decoded.viewpoints, np.zeros((1, 3)), atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(decoded.normals, axis=1), 1, atol=1e-6)
    assert model.report.not_kept == ()


def test_quality_sets_what_points_are_worth(cloud):
    small, fine = (
        sb.learn_alphabet(cloud, quality=quality, **OPTIONS).to_bytes()
        for quality in ("small", "fine")
    )
    assert len(small) < len(fine)
    bits = {"inlier_bits": 4, "outlier_bits": 4}
    assert sb.learn_alphabet(cloud, **bits, **OPTIONS).to_bytes() == small


def test_command_line(tmp_path, capsys, cloud):
    scan, other = tmp_path / "scan.npz", tmp_path / "other.npz"
    sb.write(scan, cloud)
    sb.write(other, box_room(0.4))
    first, second = tmp_path / "a.sfb", tmp_path / "b.sfb"
    own = ["--model", "alphabet", "--angular-resolution", "1.7", "--noise", "0"]
    assert main(["compress", str(scan), str(first), *own, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["quality"]["inliers"] > 0.9
    # The model follows from the vocabulary.
    words = ["--vocabulary", str(first)]
    assert main(["compress", str(other), str(second), *own[2:], *words]) == 0
    capsys.readouterr()
    assert main(["info", str(second)]) == 0
    assert sb.load(first).alphabet.hash in capsys.readouterr().out
    assert main(["decompress", str(second), str(tmp_path / "c.ply")]) == 2
    assert "hold" in capsys.readouterr().err
    assert main(["decompress", str(second), str(tmp_path / "c.ply"), *words]) == 0
    picture = tmp_path / "words.png"
    assert main(["info", str(first), "--picture", str(picture), "--quiet"]) == 0
    assert picture.read_bytes()[1:4] == b"PNG"
    for wrong in (["--levels", "2"], ["--random-state", "1"], ["--n-neurons", "5"]):
        assert main(["compress", str(scan), str(first), "--model", "alphabet", *wrong]) == 2
    assert main(["compress", str(scan), str(second), "--radius", "0.2", *words]) == 2
    assert main(["compress", str(scan), str(second), "--model", "hscsm", *words]) == 2
    assert "--vocabulary: is of --model alphabet" in capsys.readouterr().err


def check_a_room(scan, size, inliers, outliers):
    """Learns all but the robot's own points; the size and what is explained within sigma."""
    model = sb.learn_alphabet(scan, angular_resolution=ROOM_RESOLUTION, noise=0.0, min_range=0.5)
    far = scan.select(np.flatnonzero(scan.ranges >= 0.5))
    quality = sb.evaluate(far, model.decode(), sigma=model.sigma, normal_neighbors=None)
    assert len(model.to_bytes()) <= size
    assert quality.inliers >= inliers
    assert quality.outliers <= outliers
    return model


def test_a_rotating_scan_keeps_its_size_and_its_points(tmp_path):
    """Twin of the test below: every other beam twice, and points of the robot itself."""
    points = rotating_scan()
    sb.write(tmp_path / "scan.pcd", sb.PointCloud(points))
    scan = sb.read(tmp_path / "scan.pcd", viewpoint=(0, 0, 0))
    model = check_a_room(scan, 600, 0.95, 0.07)
    distinct, first = np.unique(points, axis=0, return_index=True)
    far = np.linalg.norm(points, axis=1) >= 0.5
    duplicates = far.sum() - np.isin(np.flatnonzero(far), first).sum()
    assert model.report.figures["duplicates"] == duplicates > 5000
    assert len(distinct) < len(points)


@pytest.mark.skipif(not DATA.is_dir(), reason=WITHOUT_DATA)
def test_a_real_scan_keeps_its_size_and_its_points():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scan = sb.read(DATA / "indoor_scan" / "room_scan1.pcd", viewpoint=(0, 0, 0))
    model = check_a_room(scan, 2300, 0.95, 0.07)
    assert model.report.figures["duplicates"] > 40_000
