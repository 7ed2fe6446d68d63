"""Where a scan was taken: exact poses, refusals, places that look alike, the verb `locate`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb
from surfabet import datasets
from surfabet.cli import main
from surfabet.errors import InvalidInputError

Array = NDArray[np.float64]
Boxes = list[tuple[Array, Array]]

# Rooms of two sizes, with shelves that tell their corners apart. x0, y0, z0 to x1, y1, z1.
ROOM: Boxes = [
    (np.array([0.0, 0.0, 0.0]), np.array([7.0, 5.0, 3.0])),
    (np.array([0.0, 0.0, 0.0]), np.array([1.0, 2.0, 1.5])),
    (np.array([5.5, 4.2, 0.0]), np.array([7.0, 5.0, 2.2])),
    (np.array([2.5, 4.5, 0.0]), np.array([3.2, 5.0, 3.0])),
]


def moved(boxes: Boxes, shift: tuple[float, float, float]) -> Boxes:
    return [(low + shift, high + shift) for low, high in boxes]


def cast(boxes: Boxes, origin: Array, directions: Array) -> Array:
    """First hits of rays from inside the first box: its walls, or the outside of the others."""
    with np.errstate(divide="ignore"):
        low, high = boxes[0]
        exits = np.where(directions > 0, (high - origin) / directions, (low - origin) / directions)
        distance = exits.min(axis=1)
        for low, high in boxes[1:]:
            a, b = (low - origin) / directions, (high - origin) / directions
            near, far = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
            hit = (near < far) & (near > 0)
            distance = np.where(hit, np.minimum(distance, near), distance)
    return origin + distance[:, None] * directions


def rays(step: float) -> Array:
    azimuth, elevation = np.meshgrid(
        np.deg2rad(np.arange(0, 360, step) + 0.1), np.deg2rad(np.arange(-70, 70, step) + 0.05)
    )
    a, e = azimuth.ravel(), elevation.ravel()
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)


def pose_of(x: float, y: float, z: float, yaw: float, pitch: float = 0.0) -> Array:
    s, c = np.sin(yaw), np.cos(yaw)
    sp, cp = np.sin(pitch), np.cos(pitch)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array(
        [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]
    )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, (x, y, z)
    return pose


def scan(boxes: Boxes, pose: Array, *, step: float = 1.0, seed: int = 0) -> sb.PointCloud:
    """A scan with 5 mm of noise, in the frame of the sensor."""
    directions = rays(step)
    hits = cast(boxes, pose[:3, 3], directions @ pose[:3, :3].T)
    local = (hits - pose[:3, 3]) @ pose[:3, :3]
    noise = np.random.default_rng(seed).normal(0, 0.005, (len(local), 1))
    return sb.PointCloud(local + noise * directions)


def map_cloud(rooms: list[Boxes]) -> sb.PointCloud:
    """Two scans in every room, in the world."""
    parts = []
    for i, boxes in enumerate(rooms):
        corner = boxes[0][0]
        for x, y in ((2.0, 2.8), (4.8, 2.2)):
            pose = pose_of(corner[0] + x, corner[1] + y, corner[2] + 1.2, 0.3)
            points = scan(boxes, pose, step=0.7, seed=i + 10).points
            parts.append(points @ pose[:3, :3].T + pose[:3, 3])
    return sb.PointCloud(np.concatenate(parts))


@pytest.fixture(scope="module")
def room() -> sb.PatchModel:
    return sb.learn_patches(map_cloud([ROOM]), resolution=0.06)


def errors(found: sb.Location, pose: Array) -> tuple[float, float]:
    """Metres and degrees."""
    turn = found.pose[:3, :3].T @ pose[:3, :3]
    cosine = np.clip((np.trace(turn) - 1) / 2, -1, 1)
    return float(np.linalg.norm(found.pose[:3, 3] - pose[:3, 3])), float(
        np.rad2deg(np.arccos(cosine))
    )


POSES = [pose_of(1.8, 3.5, 1.1, 2.0), pose_of(5.0, 1.0, 1.4, -1.0, 0.3), pose_of(3.5, 2.5, 1, 0)]


@pytest.mark.parametrize("pose", POSES)
def test_a_scan_is_found_where_it_was_taken(room: sb.PatchModel, pose: Array) -> None:
    found = room.locate(scan(ROOM, pose))
    assert len(found) == 1
    assert found.reason is None
    away, turned = errors(found[0], pose)
    assert away < 0.03
    assert turned < 0.3
    assert found[0].probability > 0.9
    assert found[0].explained > 0.9
    assert found[0].contradicted < 0.05
    eigenvalues = np.linalg.eigvalsh(found[0].covariance)
    assert (eigenvalues > 0).all()
    assert np.sqrt(eigenvalues.max()) < 0.05


@pytest.mark.parametrize("method", ["alphabet", "planes"])
def test_models_of_other_methods_are_maps_too(method: str) -> None:
    cloud = map_cloud([ROOM])
    model = {"alphabet": sb.learn_alphabet, "planes": sb.learn_planes}[method](cloud)
    away, turned = errors(model.locate(scan(ROOM, POSES[0]))[0], POSES[0])
    assert away < 0.05
    assert turned < 0.5


def test_a_prior_gives_the_same_pose(room: sb.PatchModel) -> None:
    pose = POSES[0]
    query = scan(ROOM, pose)
    near = pose_of(2.2, 3.2, 1.2, 2.1)
    found = room.locate(query, prior=near, radius=1.0)
    assert errors(found[0], pose)[0] < 0.03
    # As x, y, z and yaw in degrees.
    again = room.locate(query, prior=(2.2, 3.2, 1.2, np.rad2deg(2.1)), radius=1.0)
    assert np.allclose(again[0].pose, found[0].pose, atol=1e-6)
    # The true place is further away than it may be.
    assert not room.locate(query, prior=pose_of(5.5, 2.0, 1.2, 2.0), radius=0.5)


def test_a_scan_from_elsewhere_is_refused(room: sb.PatchModel) -> None:
    elsewhere = [(np.array([0.0, 0.0, 0.0]), np.array([14.0, 3.0, 6.0]))]
    found = room.locate(scan(elsewhere, pose_of(4.0, 1.5, 1.5, 0.5)))
    assert len(found) == 0
    assert found.reason
    assert all(place.probability == 0 for place in found.rejected)
    assert found.refusal in ("unexplained", "contradicted", "no place")
    assert not found.is_ambiguous
    assert found.n_places == 0


def test_a_view_that_fits_in_many_rooms_is_ambiguous(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Seven equal rooms: more than a narrow view may fit."""
    rooms = [moved(ROOM, (9.0 * i, 0.0, 0.0)) for i in range(7)]
    model = sb.learn_patches(map_cloud(rooms), resolution=0.08)
    pose = POSES[2]
    points = np.asarray(scan(ROOM, pose).points)
    view = sb.PointCloud(points[np.abs(np.arctan2(points[:, 1], points[:, 0])) < np.pi / 4])
    found = model.locate(view, top=7)
    assert len(found) == 0
    assert found.refusal == "alike"
    assert found.is_ambiguous
    assert found.n_places >= 7
    shares = [place.probability for place in found.rejected]
    assert len(shares) == 7
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] > 0.02
    assert sum(shares) <= 1 + 1e-9
    for i in range(7):
        there = pose.copy()
        there[0, 3] += 9.0 * i
        assert min(errors(place, there)[0] for place in found.rejected) < 0.1
    # As few as are asked for, and still how many there are.
    few = model.locate(view, top=2)
    assert len(few.rejected) == 2
    assert few.n_places == found.n_places
    model.save(tmp_path / "map.sfb")
    sb.write(tmp_path / "view.ply", view)
    files = [str(tmp_path / "map.sfb"), str(tmp_path / "view.ply")]
    assert main(["locate", *files, "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert answer["refusal"] == "alike"
    assert answer["is_ambiguous"]
    assert answer["n_places"] == found.n_places
    assert answer["free_along"] == answer["free_about"] == []
    assert main(["locate", *files]) == 1
    assert "probability" in capsys.readouterr().out


def test_a_narrow_view_must_fit_better_than_its_mirror_image() -> None:
    """Of a room that is the same in a mirror a view may be of either side, but for a pillar."""
    shelves = [(np.array([0.0, y, 0.0]), np.array([1.2, y + 1.0, 1.5])) for y in (0.0, 4.0)]
    window = (np.array([0.0, 2.1, 0.0]), np.array([0.4, 2.9, 0.9]))
    even = [ROOM[0], *shelves, window]
    pillar = (np.array([2.0, 0.8, 0.0]), np.array([2.4, 1.2, 3.0]))
    pose = pose_of(4.0, 2.2, 1.2, np.pi)
    for boxes, is_told in ((even, False), ([*even, pillar], True)):
        model = sb.learn_patches(map_cloud([boxes]), resolution=0.06)
        points = np.asarray(scan(boxes, pose).points)
        view = points[np.abs(np.arctan2(points[:, 1], points[:, 0])) < np.pi / 4]
        found = model.locate(sb.PointCloud(view))
        places = found if is_told else found.rejected
        assert found.refusal == (None if is_told else "mirrored")
        assert found.is_ambiguous or is_told
        away, turned = errors(places[0], pose)
        assert away < 0.05
        assert turned < 0.5
        assert places[0].probability > 0.8
        assert not model.locate(sb.PointCloud(view * [1, -1, 1]))
        # A prior says where it was.
        assert errors(model.locate(sb.PointCloud(view), prior=pose)[0], pose)[0] < 0.05


def test_a_mirrored_scan_is_refused(room: sb.PatchModel) -> None:
    points = scan(ROOM, POSES[0]).points * [1, -1, 1]
    found = room.locate(sb.PointCloud(points))
    assert len(found) == 0


def test_equal_rooms_are_all_named() -> None:
    rooms = [ROOM, moved(ROOM, (9.0, 0.0, 0.0)), [ROOM[0], ROOM[2]]]
    rooms[2] = moved(rooms[2], (0.0, 8.0, 0.0))
    model = sb.learn_patches(map_cloud(rooms), resolution=0.06)
    pose = POSES[0]
    found = model.locate(scan(ROOM, pose))
    assert found.is_ambiguous
    assert found.refusal is None
    assert found.n_places == len(found)
    # One of them is given, and how many there are.
    first = model.locate(scan(ROOM, pose), top=1)
    assert len(first) == 1
    assert first.is_ambiguous
    assert first.n_places == found.n_places
    for shift in (0.0, 9.0):
        there = pose.copy()
        there[0, 3] += shift
        assert min(errors(place, there)[0] for place in found) < 0.05
    assert abs(sum(place.probability for place in found[:2]) - 1) < 0.1
    assert min(place.probability for place in found[:2]) > 0.2


def test_a_corridor_without_ends_is_refused_with_its_direction() -> None:
    """Rays of 8 m reach neither end: every place along it explains the scan; a prior decides."""
    corridor = [(np.array([0.0, 0.0, 0.0]), np.array([40.0, 2.0, 2.5]))]

    def near(pose: Array, seed: int) -> Array:
        points = np.asarray(scan(corridor, pose, step=0.8, seed=seed).points)
        return points[np.linalg.norm(points, axis=1) < 8]

    parts = []
    for i, x in enumerate(range(8, 33, 4)):
        pose = pose_of(x, 1.1, 1.2, 0.2)
        parts.append(near(pose, i) @ pose[:3, :3].T + pose[:3, 3])
    model = sb.learn_patches(sb.PointCloud(np.concatenate(parts)), resolution=0.08)
    pose = pose_of(19.0, 0.9, 1.1, 2.0)
    query = sb.PointCloud(near(pose, 50))
    found = model.locate(query)
    assert len(found) == 0
    assert "(1.00, 0.00, " in str(found.reason).replace("-", "")
    assert found.refusal == "loose"
    assert found.is_ambiguous
    assert found.free_along.shape == (1, 3)
    assert found.free_along[0, 0] > 0.99
    assert found.free_about.shape == (0, 3)
    assert found.rejected[0].probability > 0
    # A prior holds what the surfaces do not fix, and the covariance says so.
    for shift in (0.0, 0.4, -0.3):
        prior = pose.copy()
        prior[0, 3] += shift
        held = model.locate(query, prior=prior, radius=0.5)
        assert len(held) == 1
        assert not held.is_ambiguous
        away = np.abs(held[0].pose[:3, 3] - prior[:3, 3])
        assert away[0] < 0.02
        assert away[1:].max() < 0.03
        # Evenly as far as the radius: its square over three.
        assert abs(held[0].covariance[0, 0] / (0.5**2 / 3) - 1) < 0.01
        assert held[0].covariance[1, 1] < 0.01
        assert held.free_along.shape == (1, 3)
        assert held.free_along[0, 0] > 0.99


def is_held(
    found: sb.Locations, prior: Array, along: list[int], about: list[int], radius: float
) -> None:
    """The only place is that of the prior along and about these axes, as uncertain as the prior."""
    assert len(found) == 1
    turn = prior[:3, :3].T @ found[0].pose[:3, :3]
    away = np.abs(found[0].pose[:3, 3] - prior[:3, 3])
    deviations = np.sqrt(np.diag(found[0].covariance))
    assert found.free_along.shape == (len(along), 3)
    assert found.free_about.shape == (len(about), 3)
    for axis in along:
        assert away[axis] < 0.02
        assert np.linalg.norm(found.free_along[:, axis]) > 0.99
        assert abs(deviations[axis] / (radius / np.sqrt(3)) - 1) < 0.01
    for axis in about:
        assert found.free_about[0, axis] > 0.99
        assert abs(deviations[3 + axis] / (np.deg2rad(20) / np.sqrt(3)) - 1) < 0.02
        # What is left of the turn to the prior is not about the axis.
        left = np.array([turn[2, 1], turn[0, 2], turn[1, 0]]) / 2
        assert abs((prior[:3, :3] @ left)[axis]) < 0.01
    assert all(deviations[a] < 0.1 for a in range(3) if a not in along)
    assert all(deviations[3 + a] < 0.01 for a in range(3) if a not in about)


def test_a_prior_as_wide_as_a_corridor_holds_the_middle_of_it() -> None:
    """Ends of the map explain a scan of the middle as well; they are the same place moved along."""
    corridor = [(np.array([0.0, 0.0, 0.0]), np.array([20.0, 2.0, 2.5]))]

    def near(pose: Array, seed: int, reach: float) -> Array:
        points = np.asarray(scan(corridor, pose, step=0.8, seed=seed).points)
        return points[np.linalg.norm(points, axis=1) < reach]

    poses = [pose_of(x, 1.1, 1.2, 0.2) for x in range(2, 19, 2)]
    parts = [near(p, i, 8) @ p[:3, :3].T + p[:3, 3] for i, p in enumerate(poses)]
    model = sb.learn_patches(sb.PointCloud(np.concatenate(parts)), resolution=0.08)
    pose = pose_of(8.5, 0.9, 1.1, 2.0)
    query = sb.PointCloud(near(pose, 50, 6))
    for radius, shift in ((5.0, 0.6), (10.0, 0.0), (10.0, 0.6)):
        prior = pose.copy()
        prior[0, 3] += shift
        is_held(model.locate(query, prior=prior, radius=radius), prior, [0], [], radius)
    # A scan that sees the end is fixed by it.
    pose = pose_of(16.5, 0.9, 1.1, 2.0)
    prior = pose.copy()
    prior[0, 3] += 0.4
    found = model.locate(sb.PointCloud(near(pose, 51, 6)), prior=prior)
    assert len(found) == 1
    assert errors(found[0], pose)[0] < 0.05
    assert len(found.free_along) == 0
    assert found[0].covariance[0, 0] < 0.05**2


def test_a_prior_holds_what_a_floor_leaves_free() -> None:
    rng = np.random.default_rng(1)

    def floor(n: int, size: float, height: float) -> Array:
        xy = rng.uniform(-size, size, (n, 2))
        return np.column_stack([xy, height + rng.normal(0, 0.005, n)])

    model = sb.learn_patches(sb.PointCloud(floor(60_000, 10.0, 0.0)), resolution=0.08)
    query = sb.PointCloud(floor(20_000, 4.0, -1.2))
    for radius, height in ((0.5, 1.2), (3.0, 1.3)):
        prior = pose_of(1.0, 2.0, height, 0.4)
        found = model.locate(query, prior=prior, radius=radius)
        is_held(found, prior, [0, 1], [2], radius)
        assert abs(found[0].pose[2, 3] - 1.2) < 0.01


def test_a_prior_holds_what_a_tunnel_leaves_free() -> None:
    """Along and about the axis; a turn about it moves a sensor beside it."""

    def near(pose: Array, seed: int) -> Array:
        directions, origin = rays(1.5), pose[:3, 3]
        turned = directions @ pose[:3, :3].T
        a = np.maximum((turned[:, 1:] ** 2).sum(axis=1), 1e-9)
        b = turned[:, 1:] @ origin[1:]
        distance = (np.sqrt(b * b - a * (origin[1:] @ origin[1:] - 1.5**2)) - b) / a
        noisy = distance + np.random.default_rng(seed).normal(0, 0.005, len(a))
        return (directions * noisy[:, None])[distance < 6]

    poses = [pose_of(x, 0.2, -0.4, 0.2) for x in range(0, 31, 2)]
    parts = [near(p, i) @ p[:3, :3].T + p[:3, 3] for i, p in enumerate(poses)]
    model = sb.learn_patches(sb.PointCloud(np.concatenate(parts)), resolution=0.08)
    pose = pose_of(15.0, -0.1, -0.3, 1.0)
    cosine, sine = np.cos(0.1), np.sin(0.1)
    rolled = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    prior = pose.copy()
    prior[0, 3] += 0.4
    prior[:3, :3] = rolled @ pose[:3, :3]
    found = model.locate(sb.PointCloud(near(pose, 50)), prior=prior, radius=4)
    is_held(found, prior, [0], [0], 4.0)
    # The sensor stays as far from the axis, turned about it with the scan.
    there = rolled[1:, 1:] @ pose[1:3, 3]
    assert np.linalg.norm(found[0].pose[1:3, 3] - there) < 0.03


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_corridor_that_is_the_same_from_both_ends_is_ambiguous(seed: int) -> None:
    """One scan is the map; from the other end the same is seen after half a turn, but for doors."""
    scene = datasets.make_room(seed=seed, kind="corridor", size=(16.0, 2.2, 2.6))
    poses = scene.default_lidar_poses(2)
    seen = datasets.scan_lidar(
        scene,
        poses,
        elevation_limits=(-45, 45),
        elevation_step=0.7,
        azimuth_step=0.7,
        random_state=seed,
    )
    model = sb.learn_patches(seen.frames[0].cloud, resolution=0.08)
    pose = np.asarray(seen.frames[1].true_pose)
    points = (np.asarray(seen.frames[1].cloud.points) - pose[:3, 3]) @ pose[:3, :3]
    found = model.locate(sb.PointCloud(points))
    assert len(found) == 0 or min(errors(place, pose)[0] for place in found) < 0.1


def test_threads_do_not_change_the_answer(room: sb.PatchModel) -> None:
    query = scan(ROOM, POSES[1])
    found = []
    before = sb.get_num_threads()
    try:
        for threads in (1, 2, 8):
            sb.set_num_threads(threads)
            again = sb.from_bytes(room.to_bytes()).locate(query)
            found.append([(place.pose.tobytes(), place.score) for place in again])
    finally:
        sb.set_num_threads(before)
    assert found[0] == found[1] == found[2]


def test_large_coordinates_keep_their_millimetres() -> None:
    far = np.array([500_000.0, 5_400_000.0, 100.0])
    model = sb.learn_patches(sb.PointCloud(map_cloud([ROOM]).points + far), resolution=0.06)
    there = POSES[0].copy()
    there[:3, 3] += far
    assert errors(model.locate(scan(ROOM, POSES[0]))[0], there)[0] < 0.03


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"top": 0}, "top"),
        ({"prior": np.eye(4), "radius": 0.0}, "radius"),
        ({"prior": np.eye(4), "angle": -1.0}, "angle"),
        ({"prior": np.eye(4), "radius": 0.001}, r"radius is 0.001, but must be at least 0.05 m"),
        ({"prior": np.eye(4), "angle": 0.01}, r"angle is 0.01\w* degrees, .* at least 1 deg"),
        ({"prior": (0.0, 0.0, 0.0, np.inf)}, "prior is .*inf.*, but must be finite numbers"),
        ({"prior": np.eye(3)}, "prior"),
    ],
)
def test_wrong_options_are_named(
    room: sb.PatchModel, options: dict[str, object], message: str
) -> None:
    with pytest.raises(sb.InvalidInputError, match=message):
        room.locate(scan(ROOM, POSES[0], step=6), **options)  # type: ignore[arg-type]


def test_too_few_points_are_no_scan(room: sb.PatchModel) -> None:
    found = room.locate(sb.PointCloud(np.eye(3) * 2))
    assert len(found) == 0
    assert found.reason == "the scan has points in 3 voxels only, and at least 30 are needed"
    assert room.locate(sb.PointCloud(np.zeros((0, 3)))).reason == "the scan has no points"


def test_a_refusal_names_where_it_looked(room: sb.PatchModel) -> None:
    found = room.locate(scan(ROOM, POSES[0], step=6), prior=[500.0, 0.0, 0.0, 0.0], radius=2)
    assert len(found) == 0
    assert str(found.reason).endswith("(within 2 m and 20 degrees of the prior)")


def test_the_command_line(
    room: sb.PatchModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, cloud, other = tmp_path / "map.sfb", tmp_path / "scan.ply", tmp_path / "other.ply"
    room.save(file)
    sb.write(cloud, scan(ROOM, POSES[0]))
    assert main(["locate", str(file), str(cloud), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert np.abs(np.array(answer["locations"][0]["pose"]) - POSES[0]).max() < 0.03
    assert main(["locate", str(file), str(cloud), "--prior", "2", "3.3", "1", "110"]) == 0
    assert "probability" in capsys.readouterr().out
    sb.write(other, sb.PointCloud(scan(ROOM, POSES[0]).points * [2, 0.5, 2]))
    assert main(["locate", str(file), str(other)]) == 1
    assert "no place" in capsys.readouterr().out
    assert main(["locate", str(file), str(cloud), "--radius", "1"]) == 2


def test_a_model_without_surface_is_refused() -> None:
    scattered = np.random.default_rng(0).uniform(0, 5, (400, 3))
    model = sb.learn_planes(sb.PointCloud(scattered))
    assert len(model) == 0
    with pytest.raises(sb.InvalidInputError):
        model.localizer()


def test_places_are_within_radius_and_angle_of_the_prior(room: sb.PatchModel) -> None:
    """Refinement may take a place farther: to what the prior says it is not."""
    query = scan(ROOM, POSES[0])
    near = POSES[0].copy()
    near[:3, 3] += (0.18, 0.24, 0.0)
    turned = POSES[0] @ pose_of(0.0, 0.0, 0.0, np.deg2rad(10))
    for prior, limits, is_allowed in (
        (near, {"radius": 0.35}, True),
        (near, {"radius": 0.25}, False),
        (turned, {"angle": 12.0}, True),
        (turned, {"angle": 8.0}, False),
    ):
        found = room.locate(query, prior=prior, **limits)
        assert bool(found) == is_allowed
        for place in (*found, *found.rejected):
            away, angle = errors(place, prior)
            assert away <= limits.get("radius", 1.0) + 1e-6
            assert angle <= limits.get("angle", 20.0) + 1e-6


def test_a_prior_that_says_little_bounds_the_search_by_the_map(room: sb.PatchModel) -> None:
    """Further from the map than the scan reaches none of it falls on the map."""
    pose = POSES[0]
    query = scan(ROOM, pose)
    wide = room.locate(query, prior=pose, radius=1e9)
    assert errors(wide[0], pose)[0] < 0.03
    away = pose.copy()
    away[0, 3] += 1e6
    assert not room.locate(query, prior=away, radius=1e3)
    with pytest.raises(InvalidInputError, match="prior is"):
        room.locate(query, prior=(0.0, 0.0, np.nan, 0.0))
