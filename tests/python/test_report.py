"""Pictures: the pinhole camera, what hides what, and cameras that see the cloud."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb
from surfabet.report import Camera, choose_camera, draw_comparison, render

RED, BLUE = (255, 0, 0), (0, 0, 255)


def looking_along_x() -> Camera:
    return Camera(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), 90.0)


def draw(
    points: list[tuple[float, float, float]], rgb: list[tuple[int, int, int]]
) -> NDArray[np.uint8]:
    cloud = sb.PointCloud(np.array(points))
    return render(
        cloud, looking_along_x(), np.array(rgb, np.uint8), spacing=0.0, width=100, height=80
    )


def drawn(picture: NDArray[np.uint8]) -> list[tuple[int, int]]:
    return [(int(r), int(c)) for r, c in np.argwhere((picture != 255).any(axis=2))]


def test_axes_of_the_picture() -> None:
    # 90 degrees over 100 pixels: focal length 50 pixels. Looking along +x, +y is left, +z is up.
    assert drawn(draw([(2.0, 0.5, 0.25)], [RED])) == [(40 - 7, 50 - 13)]


def test_nearest_is_in_front_in_either_order() -> None:
    near, far = (1.0, 0.0, 0.0), (3.0, 0.0, 0.0)
    for points, rgb in (([near, far], [RED, BLUE]), ([far, near], [BLUE, RED])):
        picture = draw(points, rgb)
        assert drawn(picture) == [(40, 50)]
        assert tuple(picture[40, 50]) == RED


def test_points_behind_or_aside_are_not_drawn() -> None:
    picture = draw([(-1.0, 0, 0), (1.0, 5.0, 0), (0.0, 0.0, 0.0)], [RED] * 3)
    assert drawn(picture) == []


def test_map_coordinates_keep_their_detail() -> None:
    shift = np.array([5e5, 5e6, 100.0])
    points = np.array([[2.0, 0.01, 0.0], [2.0, -0.01, 0.0]])
    rgb = np.array([RED, BLUE], np.uint8)
    camera = looking_along_x()
    moved = Camera(camera.eye + shift, camera.target + shift, camera.up, 1.5)
    camera = Camera(camera.eye, camera.target, camera.up, 1.5)
    pictures = [
        render(sb.PointCloud(p), c, rgb, spacing=0.001)
        for p, c in ((points, camera), (points + shift, moved))
    ]
    assert len(drawn(pictures[0])) >= 2
    np.testing.assert_array_equal(*pictures)


def test_half_spaces_cut_away() -> None:
    camera = Camera(
        np.zeros(3),
        np.array([1.0, 0, 0]),
        np.array([0, 0, 1.0]),
        90.0,
        keep=((np.array([-1.0, 0, 0]), -2.0),),
    )
    cloud = sb.PointCloud(np.array([[1.0, 0, 0], [3.0, 0, 0]]))
    picture = render(cloud, camera, np.array([RED, BLUE], np.uint8), spacing=0.0)
    assert tuple(picture[360, 480]) == BLUE


def room() -> NDArray[np.float64]:
    """The six faces of a room of 4 x 3 x 2.5 m, and a crate of 0.5 m on its floor."""
    random = np.random.default_rng(1)

    def box(size: NDArray[np.float64], n: int) -> NDArray[np.float64]:
        points = random.uniform(0, 1, (n, 3))
        face = random.integers(0, 3, n)
        points[np.arange(n), face] = random.integers(0, 2, n)
        return points * size

    crate = box(np.array([0.5, 0.5, 0.5]), 5_000) + np.array([1.7, 1.2, 0])
    return np.concatenate([box(np.array([4, 3, 2.5]), 50_000), crate])


def test_a_closed_room_is_opened_to_show_its_inside() -> None:
    points = room()
    cloud = sb.PointCloud(points)
    is_crate = np.arange(len(points)) >= 50_000
    rgb = np.where(is_crate[:, None], RED, BLUE).astype(np.uint8)
    picture = render(cloud, choose_camera(cloud), rgb, spacing=0.03)
    assert ((picture[..., 0] > 50) & (picture[..., 2] < 50)).sum() > 1_000


def test_a_sensor_that_moved_inside_looks_from_its_place() -> None:
    points = room()
    eyes = np.linspace([1.0, 1.0, 1.2], [3.0, 2.0, 1.3], 20)
    index = np.arange(len(points), dtype=np.uint32) % 20
    camera = choose_camera(sb.PointCloud(points, viewpoints=eyes, viewpoint_index=index))
    assert np.linalg.norm(eyes - camera.eye, axis=1).min() < 1e-9
    np.testing.assert_array_equal(camera.up, [0, 0, 1])


@pytest.mark.parametrize("up", [(0, 0, 1), (0, -1, 0), (1, 0, 0)])
def test_camera_sees_the_whole_of_an_open_cloud(up: tuple[float, float, float]) -> None:
    points = np.random.default_rng(2).normal(0, 1, (2_000, 3)) * [3, 1, 2] + [100, 0, -20]
    camera = choose_camera(sb.PointCloud(points), up=up)
    rotation = camera.rotation()
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)
    x, y, z = rotation @ (points - camera.eye).T
    half = np.tan(np.radians(camera.field_of_view / 2))
    seen = (z > 0) & (np.abs(x) < half * z) & (np.abs(y) < 0.75 * half * z)
    # The farthest half per cent on each side of the box may be left out.
    assert seen.mean() > 0.95
    # What is higher is drawn higher: rows count downwards.
    assert rotation[1] @ np.array(up) < 0


def test_a_flat_cloud_is_not_cut_away() -> None:
    grid = np.stack(np.meshgrid(np.arange(50.0), np.arange(50.0), [0.0]), -1).reshape(-1, 3)
    assert choose_camera(sb.PointCloud(grid)).keep == ()


@pytest.mark.parametrize("points", [[[1.0, 2, 3]], [[1.0, 2, 3]] * 5, [[0.0, 0, 0], [1, 1, 1]]])
def test_tiny_clouds_are_drawn(points: list[list[float]], tmp_path: Path) -> None:
    cloud = sb.PointCloud(np.array(points))
    draw_comparison(tmp_path / "tiny.png", cloud, cloud, sb.evaluate(cloud, cloud, sigma=0.1))
    assert (tmp_path / "tiny.png").stat().st_size > 0


def test_empty_clouds_and_wrong_axes_are_refused() -> None:
    with pytest.raises(sb.InvalidInputError, match="empty"):
        choose_camera(sb.PointCloud(np.empty((0, 3))))
    with pytest.raises(sb.InvalidInputError, match="axis"):
        choose_camera(sb.PointCloud(np.eye(3)), up=(1, 1, 0))
