"""The scan simulator: its truth is exact, its noise is the one asked for, its files can be read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet
from surfabet import datasets
from surfabet.errors import InvalidInputError

SMALL = {"width": 160, "height": 120}
IDEAL = {
    "depth_noise": 0.0,
    "max_incidence": 90.0,
    "dropout": 0.0,
    "color_noise": 0.0,
    "depth_limits": (0.0, 50.0),
}


@pytest.fixture(scope="module")
def room() -> datasets.Scene:
    return datasets.make_room()


def test_ideal_clouds_lie_on_the_surface(room: datasets.Scene) -> None:
    scan = datasets.scan_rgbd(room, n_frames=4, **SMALL, **IDEAL)
    assert len(scan.cloud) == len(scan.ground_truth) > 70_000
    assert room.distance(scan.cloud.points).max() < 1e-5
    assert room.distance(scan.ground_truth.points).max() < 1e-5
    laser = datasets.scan_lidar(
        room, n_scans=2, azimuth_step=2, elevation_step=2, range_noise=0, dropout=0
    )
    assert room.distance(laser.cloud.points).max() < 1e-5
    assert set(laser.cloud.attributes) >= {"colors", "intensities", "ranges", "viewpoints"}


def test_truth_belongs_to_its_points(room: datasets.Scene) -> None:
    scan = datasets.scan_rgbd(room, n_frames=3, **SMALL)
    truth = scan.ground_truth
    np.testing.assert_allclose(np.linalg.norm(truth.normals, axis=1), 1.0, atol=1e-6)
    surfaces = room.surfaces
    np.testing.assert_array_equal(
        truth.instances, np.array([s.instance for s in surfaces])[truth.surfaces]
    )
    plane = np.array([s.kind == "plane" for s in surfaces])[truth.surfaces]
    direction = np.array([s.direction for s in surfaces])[truth.surfaces][plane]
    offset = np.array([s.offset for s in surfaces])[truth.surfaces][plane]
    np.testing.assert_allclose(truth.normals[plane], direction, atol=1e-6)
    residual = np.einsum("ij,ij->i", truth.points[plane].astype(float), direction) - offset
    assert np.abs(residual).max() < 1e-5


def test_ranges_and_viewpoints_are_those_of_the_sensor(room: datasets.Scene) -> None:
    scan = datasets.scan_rgbd(room, n_frames=3, translation_std=0.01, rotation_std=0.2, **SMALL)
    viewpoints, index = scan.cloud.viewpoints, scan.cloud.viewpoint_index
    assert viewpoints is not None
    assert index is not None
    np.testing.assert_allclose(viewpoints, [f.pose[:3, 3] for f in scan.frames])
    distance = np.linalg.norm(scan.cloud.points - viewpoints[index], axis=1)
    np.testing.assert_allclose(distance, scan.cloud.ranges, atol=1e-5)
    for frame in scan.frames:
        assert not np.allclose(frame.pose, frame.true_pose)
        assert frame.depth is not None
        assert (frame.depth > 0).sum() == len(frame.cloud)


def test_points_are_their_pixels_moved_by_the_pose(room: datasets.Scene) -> None:
    frame = datasets.scan_rgbd(room, n_frames=1, rotation_std=1.0, **SMALL).frames[0]
    assert frame.depth is not None
    assert frame.intrinsics is not None
    v, u = np.nonzero(frame.depth)
    z = frame.depth[v, u].astype(float)
    local = (np.linalg.inv(frame.intrinsics) @ np.stack([u * z, v * z, z])).T
    world = local @ frame.pose[:3, :3].T + frame.pose[:3, 3]
    np.testing.assert_allclose(world, frame.cloud.points, atol=1e-5)


def test_noise_grows_as_the_model_of_nguyen(room: datasets.Scene) -> None:
    options = {**IDEAL, "depth_limits": (0.2, 50.0)}
    exact = datasets.scan_rgbd(room, n_frames=6, **SMALL, **options)
    noisy = datasets.scan_rgbd(room, n_frames=6, **SMALL, **{**options, "depth_noise": 1.0})
    truth = exact.ground_truth
    assert exact.cloud.viewpoints is not None
    rays = truth.points - exact.cloud.viewpoints[exact.cloud.viewpoint_index]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    facing = -np.einsum("ij,ij->i", rays, truth.normals) > 0.5
    z = np.concatenate([f.depth[f.depth > 0] for f in exact.frames]).astype(float)
    error = np.concatenate([f.depth[f.depth > 0] for f in noisy.frames]) - z
    theta = np.arccos(np.clip(-np.einsum("ij,ij->i", rays, truth.normals), 0, 1))
    for near in np.arange(1.0, 3.5, 0.5):
        ring = facing & (z >= near) & (z < near + 0.5)
        sigma = 0.0012 + 0.0019 * (z[ring] - 0.4) ** 2
        sigma += 0.0001 / np.sqrt(z[ring]) * (theta[ring] / (np.pi / 2 - theta[ring])) ** 2
        normed = error[ring] / sigma
        assert abs(normed.std() - 1) < 5 / np.sqrt(2 * ring.sum())
        assert abs(normed.mean()) < 5 / np.sqrt(ring.sum())


def test_distance_agrees_with_dense_samples(room: datasets.Scene) -> None:
    points, truth = room.sample_surface(0.02)
    assert len(points) == len(truth) > 200_000
    low, high = (np.array(corner) for corner in room.interior)
    query = np.random.default_rng(0).uniform(low - 0.1, high + 0.1, (2000, 3))
    exact = room.distance(query)
    sampled = cKDTree(points).query(query)[0]
    assert (exact <= sampled + 2e-5).all()
    assert (sampled <= exact + 0.04).all()
    distances, closest, normals, instances, surfaces = room.closest_points(query)
    np.testing.assert_array_equal(distances, exact)
    np.testing.assert_allclose(np.linalg.norm(query - closest, axis=1), exact, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    owner = np.array([s.instance for s in room.surfaces])
    np.testing.assert_array_equal(owner[surfaces], instances)


def test_what_a_camera_sees_is_visible(room: datasets.Scene) -> None:
    scan = datasets.scan_rgbd(room, n_frames=1, **SMALL, **IDEAL)
    _, closest, normals, _, _ = room.closest_points(scan.ground_truth.points[::50])
    seen = room.visible(closest, normals, scan.frames[0].true_pose[None, :3, 3])
    assert seen.mean() > 0.99
    assert not room.visible(closest, -normals, scan.frames[0].true_pose[None, :3, 3]).any()


@pytest.mark.parametrize("name", ["chair", "shelf", "door", "cupboard"])
def test_congruent_instances_are_the_same_in_their_own_frame(
    room: datasets.Scene, name: str
) -> None:
    same = [i for i in room.instances if i.class_name == name]
    assert len(same) >= 3
    assert len({i.model for i in same}) == 1
    points, truth = room.sample_surface(0.01)

    def local(instance: datasets.Instance) -> np.ndarray:
        own = points[truth.instances == instance.id]
        return (own - instance.pose[:3, 3]) @ instance.pose[:3, :3]

    first = local(same[0])
    for other in same[1:]:
        distance = cKDTree(first).query(local(other))[0]
        # Contacts with the floor or a neighbour may cover a few samples of one copy.
        assert np.mean(distance < 1e-6) > 0.98
        assert not np.allclose(other.pose, same[0].pose)


def test_results_depend_on_the_seed_and_not_on_threads() -> None:
    def demo(seed: int, threads: int) -> datasets.SimulatedScan:
        surfabet.set_num_threads(threads)
        try:
            room = datasets.make_room(seed=seed)
            return datasets.scan_rgbd(
                room, n_frames=2, translation_std=0.01, random_state=seed, **SMALL
            )
        finally:
            surfabet.set_num_threads(None)

    one, two, other = demo(1, 1), demo(1, 2), demo(2, 2)
    np.testing.assert_array_equal(one.cloud.points, two.cloud.points)
    np.testing.assert_array_equal(one.cloud.colors, two.cloud.colors)
    np.testing.assert_array_equal(one.ground_truth.surfaces, two.ground_truth.surfaces)
    assert len(one.cloud) != len(other.cloud)


@pytest.mark.parametrize("color_format", ["jpg", "png"])
def test_a_written_folder_holds_the_frames(
    room: datasets.Scene, tmp_path: Path, color_format: str
) -> None:
    image = pytest.importorskip("PIL.Image")
    scan = datasets.scan_rgbd(room, n_frames=2, **SMALL, **IDEAL)
    datasets.write_rgbd_folder(tmp_path, scan.frames, color_format=color_format)  # type: ignore[arg-type]
    assert len(list(tmp_path.iterdir())) == 7
    intrinsics = np.loadtxt(tmp_path / "camera-intrinsics.txt")
    for number, frame in enumerate(scan.frames):
        stem = tmp_path / f"frame-{number:06d}"
        depth = np.asarray(image.open(f"{stem}.depth.png")) / 1000.0
        color = np.asarray(image.open(f"{stem}.color.{color_format}"))
        pose = np.loadtxt(f"{stem}.pose.txt")
        np.testing.assert_array_equal(pose, frame.pose)
        assert np.abs(color.astype(int) - frame.color).mean() < (
            3 if color_format == "jpg" else 1e-9
        )
        v, u = np.nonzero(depth)
        z = depth[v, u]
        local = (np.linalg.inv(intrinsics) @ np.stack([u * z, v * z, z])).T
        world = local @ pose[:3, :3].T + pose[:3, 3]
        # Rounding moves a point along its ray by half a millimetre of depth at most.
        slope = np.linalg.norm(local, axis=1) / z
        assert (room.distance(world) <= 0.0005 * slope + 1e-5).all()


def test_wrong_arguments_are_named(room: datasets.Scene, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="poses is 0"):
        datasets.scan_rgbd(room, np.zeros((0, 4, 4)))
    with pytest.raises(InvalidInputError, match=r"shape \(4, 4\)"):
        datasets.scan_rgbd(room, np.eye(4))
    with pytest.raises(InvalidInputError, match="rigid"):
        datasets.scan_lidar(room, 2 * np.eye(4)[None])
    with pytest.raises(InvalidInputError, match="n_chairs is 100"):
        datasets.make_room(n_chairs=100)
    with pytest.raises(InvalidInputError, match=r"size is \(5, 5\), but must be three numbers"):
        datasets.make_room(size=(5, 5))
    with pytest.raises(InvalidInputError, match="azimuth_step is 0"):
        datasets.scan_lidar(room, azimuth_step=0)
    with pytest.raises(InvalidInputError, match="sensor is 'sonar'"):
        datasets.simulated_room(sensor="sonar")  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="frames is empty"):
        datasets.write_rgbd_folder(tmp_path, [])
    laser = datasets.scan_lidar(room, n_scans=1, azimuth_step=10, elevation_step=10)
    with pytest.raises(InvalidInputError, match="turn of a laser"):
        datasets.write_rgbd_folder(tmp_path, laser.frames)
    with pytest.raises(InvalidInputError, match="finite"):
        room.closest_points([[np.nan, 0, 0]])


def test_progress_is_reported_and_its_exception_stops_the_work(room: datasets.Scene) -> None:
    def stop(stage: str, fraction: float) -> None:
        raise RuntimeError(f"{stage} {fraction}")

    with pytest.raises(RuntimeError, match="scanning"):
        datasets.scan_rgbd(room, n_frames=200, progress=stop)
