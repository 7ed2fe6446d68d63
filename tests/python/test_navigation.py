"""Where a robot can stand on a map, on floors whose answer is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import surfabet as sb

SIZE = 4.0
ROBOT = {"radius": 0.2, "height": 1.0, "max_step": 0.05, "max_slope": 15.0}


def sheet(low: list[float], high: list[float], spacing: float = 0.02) -> NDArray[np.float64]:
    """Points of a rectangle along two axes, (n, 3)."""
    ends = zip(low, high, strict=True)
    sides = [np.arange(a, b + 1e-9, spacing) for a, b in ends]
    return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3)


def floor_with_wall(door: float, lintel: float = 2.0) -> NDArray[np.float64]:
    """A floor of 4 x 4 m, a wall across it at x = 2, and in it a door up to `lintel`."""
    half = 0.5 * door
    return np.concatenate(
        [
            sheet([0, 0, 0], [SIZE, SIZE, 0]),
            sheet([2, 0, 0], [2, 2 - half, 2]),
            sheet([2, 2 + half, 0], [2, SIZE, 2]),
            sheet([2, 2 - half, lintel], [2, 2 + half, lintel + 0.2]),
        ]
    )


def navigation(points: NDArray[np.float64], **options: Any) -> sb.NavigationGraph:
    model = sb.learn_gas(sb.PointCloud(points), n_neurons=1500)
    return model.navigation(**{**ROBOT, **options})


START, GOAL = (0.6, 0.6, 0.0), (3.4, 0.6, 0.0)


def test_through_a_door_that_is_wide_enough() -> None:
    graph = navigation(floor_with_wall(door=0.8))
    path = graph.path(START, GOAL)
    assert path is not None
    # Through the door, and never nearer to the wall than the robot is wide.
    crossing = path[np.abs(path[:, 0] - 2).argmin()]
    assert abs(crossing[1] - 2) < 0.2
    wall = np.array([[2, y] for y in np.arange(0, SIZE, 0.01) if abs(y - 2) > 0.4])
    assert cKDTree(wall).query(path[:, :2])[0].min() > ROBOT["radius"]
    assert np.abs(path[:, 2]).max() < 0.02
    # At least as long as the straight ways around the corner of the door, and not much longer.
    corner = np.array([2, 2 - 0.4 + 0.2])
    shortest = sum(np.linalg.norm(corner - end[:2]) for end in (np.array(START), np.array(GOAL)))
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert 0.95 * shortest < length < 1.25 * shortest


@pytest.mark.parametrize(("door", "lintel"), [(0.3, 2.0), (0.8, 0.8)])
def test_not_through_a_door_that_is_narrow_or_low(door: float, lintel: float) -> None:
    graph = navigation(floor_with_wall(door, lintel))
    assert graph.path(START, GOAL) is None
    near = graph.components()[
        [np.linalg.norm(graph.positions - end, axis=1).argmin() for end in (START, GOAL)]
    ]
    assert near[0] != near[1]


@pytest.mark.parametrize(("rise", "passes"), [(0.03, True), (0.15, False)])
def test_steps_are_climbed_up_to_the_largest(rise: float, passes: bool) -> None:
    points = np.concatenate(
        [
            sheet([0, 0, 0], [2, SIZE, 0]),
            sheet([2, 0, rise], [SIZE, SIZE, rise]),
            sheet([2, 0, 0], [2, SIZE, rise], 0.01),
        ]
    )
    path = navigation(points).path(START, (3.4, 0.6, rise))
    assert (path is not None) == passes
    assert navigation(points, max_step=0.25).path(START, (3.4, 0.6, rise)) is not None


@pytest.mark.parametrize(("degrees", "passes"), [(10, True), (25, False)])
def test_slopes_are_driven_up_to_the_steepest(degrees: float, passes: bool) -> None:
    floor = sheet([0, 0, 0], [SIZE, 2, 0])
    floor[:, 2] = np.tan(np.radians(degrees)) * np.clip(floor[:, 0] - 1, 0, 2)
    top = float(floor[:, 2].max())
    graph = navigation(floor)
    path = graph.path((0.5, 1, 0), (3.5, 1, top))
    assert (path is not None) == passes
    if path is not None:
        assert np.linalg.norm(np.diff(path[:, [0, 2]], axis=0), axis=1).sum() > 2.9


def test_the_frame_and_the_direction_upwards_change_nothing() -> None:
    points = floor_with_wall(door=0.8)
    usual = navigation(points).path(START, GOAL)
    turned = points[:, [2, 0, 1]] + [500_000.0, 4_000_000.0, 100.0]
    far = navigation(turned, up=(3, 0, 0))
    ends = [np.array(end)[[2, 0, 1]] + [500_000.0, 4_000_000.0, 100.0] for end in (START, GOAL)]
    path = far.path(*ends)
    assert usual is not None
    assert path is not None
    lengths = [np.linalg.norm(np.diff(p, axis=0), axis=1).sum() for p in (usual, path)]
    assert lengths[1] == pytest.approx(lengths[0], rel=0.1)


def test_the_same_on_any_number_of_threads() -> None:
    model = sb.learn_gas(sb.PointCloud(floor_with_wall(door=0.8)), n_neurons=1500)
    before = sb.get_num_threads()
    try:
        found = []
        for n in (1, 2, 8):
            sb.set_num_threads(n)
            found.append(model.navigation(**ROBOT))
    finally:
        sb.set_num_threads(before)
    for other in found[1:]:
        np.testing.assert_array_equal(other.positions, found[0].positions)
        np.testing.assert_array_equal(other.edges, found[0].edges)
        np.testing.assert_array_equal(other.neurons, found[0].neurons)


def test_nodes_know_their_neurons_and_edges_their_nodes() -> None:
    model = sb.learn_gas(sb.PointCloud(floor_with_wall(door=0.8)), n_neurons=1500)
    graph = model.navigation(**ROBOT)
    neurons = model.neurons.positions
    for node in range(0, len(graph), 97):
        nearest = np.linalg.norm(neurons - graph.positions[node], axis=1)
        assert nearest[graph.neurons[node]] == pytest.approx(nearest.min(), abs=1e-6)
    assert np.all(graph.edges[:, 0] < graph.edges[:, 1])
    assert graph.edges.max() < len(graph)
    assert repr(graph).startswith(f"NavigationGraph({len(graph):,} nodes")


def test_nowhere_to_stand() -> None:
    wall = sheet([0, 0, 0], [0, 2, 2])
    graph = navigation(wall)
    assert len(graph) == 0
    assert graph.edges.shape == (0, 2)
    with pytest.raises(sb.InvalidInputError, match=r"start is .* within 1 m of a place"):
        graph.path((0, 0, 0), (0, 1, 0))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"radius": 0}, "radius is 0, but must be a positive number of metres"),
        ({"height": np.nan}, "height is nan, but must be a positive"),
        (
            {"max_step": 1.0},
            "max_step is 1, but must be a number of metres from 0 to below the height",
        ),
        ({"max_slope": 80}, "max_slope is 80, but must be a number of degrees from 0 to below 80"),
        ({"up": (0, 0, 0)}, r"up is \[0\.0, 0\.0, 0\.0\], but must be a direction"),
        ({"up": (0, 1)}, r"up is \(0, 1\), but must be three numbers"),
        ({"radius": 1e-7}, "points, more than the limit"),
    ],
)
def test_wrong_robots(options: dict[str, Any], message: str) -> None:
    model = sb.learn_gas(sb.PointCloud(sheet([0, 0, 0], [1, 1, 0])), n_neurons=50)
    with pytest.raises(sb.InvalidInputError, match=message):
        model.navigation(**options)


def test_wrong_ends() -> None:
    graph = navigation(floor_with_wall(door=0.8))
    with pytest.raises(sb.InvalidInputError, match=r"goal is .* within 1 m of a place"):
        graph.path(START, (50, 0, 0))
    with pytest.raises(sb.InvalidInputError, match="start is 'here', but must be three numbers"):
        graph.path("here", GOAL)
