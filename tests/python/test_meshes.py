"""Meshes: closed along the borders of patches, on the surface, the same in every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb
from generated import chests
from surfabet.cli import main

UTM = np.array([601_234.0, 5_402_345.0, 310.0])


def waves(shift: NDArray[np.float64]) -> sb.PointCloud:
    """A coloured, gently wavy square of 1 m, seen from above, a point every 5 mm."""
    u, v = (side.ravel() for side in np.meshgrid(np.arange(0, 1, 0.005), np.arange(0, 1, 0.005)))
    z = 0.03 * np.sin(5 * u) * np.cos(4 * v)
    colors = np.column_stack([200 * u, 200 * v, 0 * u + 90]).astype(np.uint8)
    points = np.column_stack([u, v, z]) + shift
    cloud = sb.PointCloud(points, colors=colors)
    return cloud.seen_from((points.mean(axis=0) + np.array([0, 0, 2])).tolist())


@pytest.fixture(scope="module")
def model() -> sb.PatchModel:
    return sb.learn_patches(waves(np.zeros(3)), resolution=0.01)


def off_waves(points: NDArray[np.float64]) -> float:
    """Root mean square height above the waves, metres."""
    x, y, z = points.T
    return float(np.sqrt(np.mean((z - 0.03 * np.sin(5 * x) * np.cos(4 * y)) ** 2)))


def edges(mesh: sb.Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Directed edges of all triangles, and how often each edge is met in any direction."""
    triangles = mesh.triangles.astype(np.int64)
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    _, inverse, count = np.unique(
        np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return directed, count[inverse.ravel()]


def test_no_gap_along_the_borders_of_patches(model: sb.PatchModel) -> None:
    assert len(model) > 4
    mesh = model.mesh()
    directed, met = edges(mesh)
    assert met.max() == 2
    # No edge is passed twice in one direction: the surface has one outer side.
    assert len(np.unique(directed, axis=0)) == len(directed)
    open_edges = mesh.vertices[directed[met == 1]].mean(axis=1)
    inside = np.all((open_edges[:, :2] > 0.04) & (open_edges[:, :2] < 0.95), axis=1)
    assert not inside.any()


def test_a_map_in_tiles_has_one_mesh_without_gaps_along_the_borders_of_tiles(
    tmp_path: Path,
) -> None:
    path = tmp_path / "map.sfb"
    sb.learn_patches_tiled(waves(np.zeros(3)), path, resolution=0.01, tile=0.64)
    tiled = sb.load(path)
    assert isinstance(tiled, sb.TiledPatchModel)
    assert len(tiled.tiles.bounds) >= 4
    mesh = tiled.mesh()
    directed, met = edges(mesh)
    assert met.max() == 2
    open_edges = mesh.vertices[directed[met == 1]].mean(axis=1)
    inside = np.all((open_edges[:, :2] > 0.04) & (open_edges[:, :2] < 0.95), axis=1)
    assert not inside.any()
    assert mesh.colors is not None
    assert off_waves(mesh.vertices) < 1.1 * off_waves(tiled.decode().points)
    assert main(["export", str(path), str(tmp_path / "map.ply")]) == 0
    assert len(sb.read(tmp_path / "map.ply")) == len(mesh.vertices)
    part = sb.load(path, box=((0, 0, -1), (0.2, 0.2, 1)))
    assert isinstance(part, sb.TiledPatchModel)
    assert 0 < part.mesh().area < 0.5 * mesh.area


def test_it_is_the_surface_and_faces_the_sensor(model: sb.PatchModel) -> None:
    mesh = model.mesh()
    x, y, _ = mesh.vertices.T
    # As near to the waves as what the model decodes to; shared corners take nothing from that.
    assert off_waves(mesh.vertices) < 1.1 * off_waves(model.decode().points)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    # The area of the waves, by a fine grid of their own.
    u = np.linspace(0, 1, 400)
    slopes = (
        0.15 * np.cos(5 * u[:, None]) * np.cos(4 * u),
        -0.12 * np.sin(5 * u[:, None]) * np.sin(4 * u),
    )
    exact = np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2).mean()
    assert mesh.area == pytest.approx(exact, rel=0.05)
    assert mesh.colors is not None
    shades = np.column_stack([200 * x, 200 * y])
    assert np.sqrt(np.mean((mesh.colors[:, :2] - shades) ** 2)) < 15


def test_formats_hold_the_same(model: sb.PatchModel, tmp_path: Path) -> None:
    mesh = model.mesh()
    assert mesh.colors is not None
    for suffix in (".ply", ".obj"):
        file = tmp_path / f"waves{suffix}"
        assert model.export(file) == file.stat().st_size
        back = sb.read(file)
        np.testing.assert_allclose(back.points, mesh.vertices, atol=1e-6)
        np.testing.assert_array_equal(back.colors, mesh.colors)
    faces = (tmp_path / "waves.obj").read_text().splitlines()[-len(mesh.triangles) :]
    assert faces[0] == "f " + " ".join(str(k + 1) for k in mesh.triangles[0])
    with pytest.raises(sb.InvalidInputError, match="stl"):
        model.export(tmp_path / "waves.stl")


def test_gltf_lies_where_the_map_does(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh", reason="pip install 'surfabet[mesh]'")
    model = sb.learn_patches(waves(UTM), resolution=0.02)
    mesh = model.mesh()
    model.export(tmp_path / "waves.glb")
    scene = trimesh.load(tmp_path / "waves.glb")
    (found,) = scene.dump()
    # y is upwards in glTF.
    world = np.column_stack([found.vertices[:, 0], -found.vertices[:, 2], found.vertices[:, 1]])
    assert len(found.faces) == len(mesh.triangles)
    np.testing.assert_allclose(world.min(axis=0), mesh.vertices.min(axis=0), atol=1e-3)
    np.testing.assert_allclose(world.max(axis=0), mesh.vertices.max(axis=0), atol=1e-3)
    assert found.visual.vertex_colors.shape == (len(world), 4)


def test_gas_and_planes_are_exported_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = waves(np.zeros(3))
    gas = sb.learn_gas(cloud, n_neurons=150)
    mesh = gas.mesh()
    np.testing.assert_array_equal(mesh.vertices, gas.neurons.positions)
    gas.save(tmp_path / "gas.sfb")
    assert main(["export", str(tmp_path / "gas.sfb"), str(tmp_path / "gas.ply")]) == 0
    assert "150 neurons" in capsys.readouterr().out
    assert len(sb.read(tmp_path / "gas.ply")) == 150
    assert main(["export", str(tmp_path / "gas.sfb"), str(tmp_path / "gas.dxf")]) == 2
    assert "planes" in capsys.readouterr().err


def test_instances_are_meshed_where_they_stand_and_face_outwards() -> None:
    points, colors = chests()
    cloud = sb.PointCloud(points, colors=colors)
    model = sb.learn_patches(cloud, resolution=0.01, recurrence=True)
    assert model.instances
    assert any(instance.facing < 0 for instance in model.instances)
    mesh = model.mesh()
    decoded = model.decode(normals=True)
    own = sb.KdTree(decoded)
    off, nearest = (found.ravel() for found in own.query(sb.PointCloud(mesh.vertices)))
    assert np.median(off) < 0.005
    # As much area as all patches have, those of instances too; it faces as decoded points do.
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    area = 0.5 * np.linalg.norm(normals, axis=1).sum()
    given = [model.patches.masks[i.patches].sum(axis=(1, 2)) for i in model.instances]
    levels = [
        np.array([of.pixel_size for of in model.levels])[model.patches.level[i.patches]]
        for i in model.instances
    ]
    copied = sum(float((n * p**2).sum()) for n, p in zip(given, levels, strict=True))
    coded = sum(level.area for level in model.levels)
    assert copied > 0.3 * coded
    assert area > 0.95 * (coded + copied)
    faced = decoded.normals[nearest[mesh.triangles[:, 0]]]
    assert (np.einsum("ij,ij->i", normals, faced) > 0).mean() > 0.9
