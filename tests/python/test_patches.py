"""Patches from Python: arrays, both decodes, bounds, command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet as sb
from generated import DATA, WITHOUT_DATA, kinect_frame, write_organised_pcd
from surfabet.cli import main

PIXEL = 0.01
NOISE = 0.006


def corner(noise: float = NOISE) -> sb.PointCloud:
    """Floor and two walls of one metre, a colour each, with noise along the normal."""
    rng = np.random.default_rng(3)
    u, v = (a.ravel() for a in np.meshgrid(np.arange(0, 1, 0.004), np.arange(0, 1, 0.004)))
    points, colors = [], []
    for axis, color in enumerate([(200, 60, 40), (40, 180, 60), (60, 60, 200)]):
        p = np.zeros((u.size, 3))
        p[:, axis] = noise * rng.standard_normal(u.size)
        p[:, (axis + 1) % 3], p[:, (axis + 2) % 3] = u, v
        points.append(p)
        colors.append(np.tile(np.array(color, np.uint8), (u.size, 1)))
    return sb.PointCloud(np.concatenate(points), colors=np.concatenate(colors))


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return corner()


@pytest.fixture(scope="module")
def model(cloud: sb.PointCloud) -> sb.PatchModel:
    return sb.learn_patches(cloud, resolution=PIXEL)


def test_patches_as_arrays_rebuild_the_surface(model):
    patches = model.patches
    m = len(model)
    assert len(patches) == m == sum(level.patches for level in model.levels)
    assert patches.poses.shape == (m, 4, 4)
    assert patches.masks.shape == (m, 8, 8)
    assert patches.coefficients.shape == (m, 21)
    assert patches.sigma.shape == (m,)
    rotations = patches.poses[:, :3, :3]
    identity = np.broadcast_to(np.eye(3), (m, 3, 3))
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), identity, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(rotations), 1, atol=1e-9)
    # Depth at every set pixel's middle by the guide's formulas, put into the world.
    x = (np.arange(8) - 3.5) / 4
    shape = [np.ones(8), np.sqrt(3) * x]
    shape += [np.sqrt(2) * np.cos(k * np.pi * (x + 1) / 2) for k in range(2, 6)]
    degrees = [(o - j, j) for o in range(6) for j in range(o + 1)]
    basis = np.array([np.outer(shape[j], shape[i]) for i, j in degrees])
    depth = np.einsum("mk,krc->mrc", patches.coefficients, basis)
    row, column = np.broadcast_arrays(x[:, None], x[None, :])
    half = patches.size[:, None, None] / 2
    local = np.stack([half * column, half * row, depth, np.ones_like(depth)], axis=-1)
    world = np.einsum("mij,mrcj->mrci", patches.poses, local)[patches.masks][:, :3]
    decoded = cKDTree(model.decode(resolution=0.002).points)
    assert decoded.query(world)[0].max() < 0.003


def test_sigma_is_that_of_the_noise(model):
    weight = model.patches.masks.sum(axis=(1, 2)) * model.patches.size**2
    sigma = np.average(model.patches.sigma, weights=weight)
    # Rounded to quarter pixels, which are 24 percent of this one, and to the thin side by a step,
    # since errors of decoded points count double.
    assert 0.64 < sigma / NOISE < 1


def test_filled_is_nearer_to_the_scan_and_thin_nearer_to_the_truth(cloud, model):
    thin, filled = model.decode(0.005), model.decode(0.005, as_measured=True)
    assert len(filled) > len(thin)
    assert sb.evaluate(cloud, filled).rmse_backward < sb.evaluate(cloud, thin).rmse_backward
    truth = np.abs(thin.points).min(axis=1)
    # A patch of 8 cm with one plane is the mean of 400 points, which leaves 0.05 of the noise;
    # coarser ones leave less, and steps of the depth add to it.
    assert 0.03 * NOISE < np.sqrt((truth**2).mean()) < 0.1 * NOISE


def test_depths_are_rounded_to_the_step(cloud):
    """Constant, tilts and cosines are multiples of the step; a step of one sixteenth is finer."""
    for step in (0.0625, 1.0):
        patches = sb.learn_patches(cloud, resolution=0.02, depth_step=step).patches
        steps = patches.coefficients / (0.02 * step)
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)


def test_compress_verify_and_decompress(cloud, tmp_path, capsys):
    rng = np.random.default_rng(0)
    strays = sb.PointCloud(
        np.concatenate([cloud.points, rng.uniform(0.2, 0.8, (40, 3))]),
        colors=np.concatenate([cloud.colors, np.full((40, 3), 9, np.uint8)]),
    )
    ply, sfb, out = tmp_path / "in.ply", tmp_path / "m.sfb", tmp_path / "out.ply"
    sb.write(ply, strays)
    arguments = ["--resolution", "0.02", "--max-error", "0.05", "--quiet"]
    assert main(["compress", str(ply), str(sfb), *arguments]) == 0
    capsys.readouterr()
    assert main(["verify", str(ply), str(sfb), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["kept"]
    assert found["max_error"] == 0.05
    assert found["largest"] <= 0.05
    exact = cKDTree(sb.load(sfb).decode(as_measured=True).points).query(strays.points)[0].max()
    assert abs(found["largest"] - exact) < 1e-6
    assert main(["verify", str(ply), str(sfb), "--max-error", "0.001"]) == 1
    assert "NOT kept" in capsys.readouterr().out
    assert main(["decompress", str(sfb), str(out), "--as-measured", "--quiet"]) == 0
    assert len(sb.read(out)) == len(sb.load(sfb).decode(as_measured=True))


def test_verify_checks_the_bound_forward_too(cloud, tmp_path, capsys):
    ply, sfb = tmp_path / "in.ply", tmp_path / "m.sfb"
    sb.write(ply, cloud)
    command = ["compress", str(ply), str(sfb), "--resolution", "0.02", "--quiet"]
    assert main([*command, "--max-error-forward", "0.015"]) == 0
    assert sb.load(sfb).max_error_forward == 0.015
    assert sb.load(sfb).max_error is None
    capsys.readouterr()
    assert main(["verify", str(ply), str(sfb), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["kept"]
    assert found["max_error"] is None
    assert found["max_error_forward"] == 0.015
    largest = [
        cKDTree(cloud.points).query(sb.load(sfb).decode(as_measured=kind).points)[0].max()
        for kind in (True, False)
    ]
    assert abs(found["largest_forward"] - max(largest)) < 1e-6
    assert found["largest_forward"] <= 0.015
    assert main(["verify", str(ply), str(sfb), "--max-error-forward", "0.001"]) == 1
    assert "NOT kept" in capsys.readouterr().out


def test_what_only_one_method_has_is_refused_by_name(cloud, tmp_path, capsys):
    ply, sfb = tmp_path / "in.ply", tmp_path / "m.sfb"
    sb.write(ply, cloud)
    command = ["compress", str(ply), str(sfb), "--resolution", "0.05", "--no-evaluate", "-q"]
    assert main(command) == 0
    assert main(["verify", str(ply), str(sfb)]) == 2
    assert "--max-error" in capsys.readouterr().err
    assert main([*command, "--vocabulary", str(sfb)]) == 2
    assert main([*command, "--model", "hscsm"]) == 0
    assert main(["verify", str(ply), str(sfb)]) == 2
    assert "hscsm" in capsys.readouterr().err
    assert main(["decompress", str(sfb), str(tmp_path / "o.ply"), "--as-measured"]) == 2
    assert "--as-measured is true, but must be false" in capsys.readouterr().err


def test_a_frame_of_structured_light_takes_few_bytes(tmp_path):
    """Twin of the test below: noise that grows with depth, gaps, and steps of the depth."""
    write_organised_pcd(tmp_path / "frame.pcd", kinect_frame(), width=240)
    with pytest.warns(sb.DroppedPointsWarning, match="of 43200 points"):
        frame = sb.read(tmp_path / "frame.pcd")
    model = sb.learn_patches(frame, resolution=0.01, rate=0.05)
    quality = sb.evaluate(frame, model.decode(as_measured=True), normal_neighbors=None)
    # As the real one: less than two bits a point, and nearer than a pixel.
    assert len(model.to_bytes()) < len(frame) / 4
    assert quality.rmse_pooled < 0.01
    assert quality.color_rmse_pooled < 15.2


@pytest.mark.skipif(not DATA.is_dir(), reason=WITHOUT_DATA)
@pytest.mark.filterwarnings("ignore::surfabet.DroppedPointsWarning")
def test_a_real_frame_takes_less_than_sixty_kilobytes():
    frame = sb.read(DATA / "rgbd_frame" / "table.pcd")
    model = sb.learn_patches(frame, resolution=0.003, rate=0.05)
    assert len(model.to_bytes()) < 60_000
    quality = sb.evaluate(frame, model.decode(as_measured=True), normal_neighbors=None)
    assert quality.rmse_pooled < 0.002
    assert quality.color_rmse_pooled < 15.2


GOLDEN = Path(__file__).parents[1] / "golden"


@pytest.mark.parametrize("name", ["patches_near_points", "patches_point_patterns"])
def test_points_beside_patches_of_all_kinds_stay_readable(name: str):
    """The listings are of the versions that wrote them: a floor, a line and points around."""
    model = sb.load(GOLDEN / f"{name}.sfb")
    assert model.to_bytes() == (GOLDEN / f"{name}.sfb").read_bytes()
    assert model.info["extra points"] > 60
    decoded = model.decode(0.1, as_measured=True)
    listed = np.loadtxt(GOLDEN / f"{name}.txt")
    np.testing.assert_allclose(decoded.points, listed, atol=2e-5)


@pytest.mark.parametrize("name", ["patches_beside", "patches_estimates"])
def test_files_with_attributes_of_all_kinds_stay_readable(name: str):
    """Listings of the versions that wrote them: positions, colours, intensities, heights."""
    model = sb.load(GOLDEN / f"{name}.sfb")
    assert model.to_bytes() == (GOLDEN / f"{name}.sfb").read_bytes()
    decoded = model.decode(0.2)
    listed = np.loadtxt(GOLDEN / f"{name}.txt")
    np.testing.assert_allclose(decoded.points - model.origin, listed[:, :3], atol=2e-5)
    np.testing.assert_allclose(decoded.colors, listed[:, 3:6], atol=1)
    np.testing.assert_allclose(decoded.intensities, listed[:, 6], rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(decoded.extra["height"], listed[:, 7], rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("share", [0.1, 0.2, 0.4, 0.5])
def test_a_floor_in_pixels_finer_than_its_spacing_is_one_layer(share: float) -> None:
    """Patches lie on it, of single points too; what no patch shows stands within a pixel."""
    spacing = 0.1
    places = spacing * np.stack(np.meshgrid(np.arange(50), np.arange(40)), axis=-1).reshape(-1, 2)
    floor = np.column_stack([places, np.zeros(len(places))])
    model = sb.learn_patches(sb.PointCloud(floor), resolution=share * spacing)
    heights = np.abs(model.decode().points[:, 2])
    assert np.count_nonzero(heights) == model.report.figures["extra points"]
    assert heights.max() <= share * spacing
