"""Finding what looks like an example, comparing places, and the verb `find`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb
from surfabet.cli import main

PLACES = [(-1.0, -0.9, 0.2), (1.0, -0.7, 1.4), (0.1, 1.1, 3.7)]


def placed(place: tuple[float, float, float], points: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, yaw = place
    s, c = np.sin(yaw), np.cos(yaw)
    return points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + [x, y, 0]


def rectangle(
    corner: tuple[float, float, float],
    right: tuple[float, float, float],
    up: tuple[float, float, float],
) -> NDArray[np.float64]:
    n, m = (round(np.linalg.norm(v) / 0.015) for v in (right, up))
    s, t = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(m) + 0.5) / m)
    return corner + s.reshape(-1, 1) * np.array(right) + t.reshape(-1, 1) * np.array(up)


@pytest.fixture(scope="module")
def model() -> sb.AlphabetModel:
    """Three seats with a back and one arm on a floor."""
    floor = rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    cloud = sb.PointCloud(np.concatenate([floor, *(placed(p, thing()) for p in PLACES)]))
    return sb.learn_alphabet(cloud, sigma_scale=1.0, noise=0.008)


def test_equal_things_are_found_with_their_poses(model: sb.AlphabetModel) -> None:
    x, y, _ = PLACES[0]
    found = model.find(point=(x, y, 0.6), radius=0.52)
    assert found[0].score == 1.0
    assert np.allclose(found[0].pose, np.eye(4))
    assert len(found) == 3
    probe = np.array([[0.25, -0.25, 0.45], [-0.25, 0.25, 0.45], [-0.25, -0.25, 0.95]])
    start = np.column_stack([placed(PLACES[0], probe), np.ones(3)])
    for place in PLACES:
        off = [np.abs((start @ f.pose.T)[:, :3] - placed(place, probe)).max() for f in found]
        assert min(off) < 0.03
    for f in found:
        assert np.allclose(f.center, (f.pose @ [x, y, 0.6, 1])[:3])


def thing() -> NDArray[np.float64]:
    """A seat with a back and one arm, so that it looks the same in no other direction."""
    corner = (-0.25, -0.25, 0.45)
    return np.concatenate(
        [
            rectangle(corner, (0.5, 0, 0), (0, 0.5, 0)),
            rectangle(corner, (0.5, 0, 0), (0, 0, 0.5)),
            rectangle(corner, (0, 0.4, 0), (0, 0, 0.2)),
        ]
    )


def example_of(points: NDArray[np.float64]) -> sb.AlphabetModel:
    return sb.learn_alphabet(sb.PointCloud(points), sigma_scale=1.0, noise=0.008)


def test_an_example_of_another_scene_is_found_with_poses(model: sb.AlphabetModel) -> None:
    # In a world of its own: turned and far away.
    lift = np.array([0, 0, 3.0])
    there = placed((40.0, -7.0, 2.0), thing()) + lift
    found = model.find(example_of(there))
    assert len(found) == 3
    probe = np.array([[0.25, -0.25, 0.45], [-0.25, 0.25, 0.45], [-0.25, -0.25, 0.95]])
    start = np.column_stack([placed((40.0, -7.0, 2.0), probe) + lift, np.ones(3)])
    for place in PLACES:
        off = [np.abs((start @ f.pose.T)[:, :3] - placed(place, probe)).max() for f in found]
        assert min(off) < 0.06
    points = model.decode(0.02).points
    for f in found:
        inside = f.mask(points)
        assert inside.any()
        assert np.linalg.norm(points[inside][:, :2] - f.center[:2], axis=1).max() < 0.6


def test_an_example_of_another_size_is_found_with_its_sizes(model: sb.AlphabetModel) -> None:
    larger = thing() * [1.08, 1.08, 1.0]
    found = model.find(example_of(larger))
    assert len(found) == 3
    for f in found:
        # Sizes are held a little at those of the example: they come out between it and the truth.
        level, upright = f.sizes
        assert 1 / 1.08 - 0.02 < level < 0.98
        assert upright == pytest.approx(1.0, abs=0.05)
    rigid = model.find(example_of(larger), size_tolerance=0.0)
    assert all(f.sizes == (1.0, 1.0) for f in rigid)
    assert max(f.score for f in rigid) < max(f.score for f in found)


def test_of_several_examples_the_best_is_named(model: sb.AlphabetModel) -> None:
    pole = np.concatenate(
        [
            rectangle((0, 0, 0), (0.1, 0, 0), (0, 0, 1.5)),
            rectangle((0, 0, 0), (0, 0.1, 0), (0, 0, 1.5)),
        ]
    )
    found = model.find([example_of(pole), example_of(thing())])
    assert len(found) == 3
    assert {f.example for f in found} == {1}
    with pytest.raises(sb.InvalidInputError, match="example is empty, but must be at least"):
        model.find([])
    with pytest.raises(sb.InvalidTypeError, match=r"example\[0\] is a PointCloud"):
        model.find([sb.PointCloud(pole)])  # type: ignore[list-item]


def test_doors_in_a_wall_are_found_by_their_colour() -> None:
    wall = rectangle((0, 0, 0), (6, 0, 0), (0, 0, 2))
    doors = [0.7, 2.9, 4.6]
    x, z = wall[:, 0], wall[:, 2]
    on_door = np.any([(x > d) & (x < d + 0.8) & (z < 1.6) for d in doors], axis=0)
    colors = np.where(on_door[:, None], (170, 150, 110), (204, 200, 196)).astype(np.uint8)
    wall[:, 1] += 0.012 * on_door
    model = sb.learn_alphabet(sb.PointCloud(wall, colors=colors), sigma_scale=1.0, noise=0.004)
    box = ((doors[1], -0.1, 0.0), (doors[1] + 0.8, 0.1, 1.6))
    found = model.find(box=box)
    assert sorted(f.center[0] - 0.4 for f in found) == pytest.approx(doors, abs=0.2)
    assert found[0].score == 1.0
    # By shape alone the wall is full of doors.
    assert len(model.find(box=box, color_tolerance=None)) > 3
    with pytest.raises(sb.InvalidInputError, match="color_tolerance is 0"):
        model.find(box=box, color_tolerance=0.0)


def test_a_door_flush_with_its_wall_is_found_by_an_example_of_another_scene() -> None:
    """Words across its edges mix both colours; a part of a wall of its paint is no door."""
    size, paint, plaster = (0.8, 1.6), (170, 150, 110), (204, 200, 196)
    doors = [0.7, 2.9, 4.6]
    wall = rectangle((0, 0, 0), (6, 0, 0), (0, 0, 2))
    x, z = wall[:, 0], wall[:, 2]
    on_door = np.any([(x > d) & (x < d + size[0]) & (z < size[1]) for d in doors], axis=0)
    colors = np.where(on_door[:, None], paint, plaster).astype(np.uint8)

    def learned(points: NDArray[np.float64], colors: NDArray[np.uint8]) -> sb.AlphabetModel:
        cloud = sb.PointCloud(points, colors=colors)
        return sb.learn_alphabet(cloud, sigma_scale=1.0, noise=0.004, scales=2)

    scene = learned(wall, colors)
    leaf = rectangle((9, 9, 1), (0, size[0], 0), (0, 0, size[1]))
    door, plain = (
        learned(leaf, np.tile(np.uint8(paint), (len(leaf), 1))) for paint in (paint, plaster)
    )
    found = scene.find([door], color_tolerance=5)
    middles = sorted((f.pose @ [9, 9 + size[0] / 2, 1 + size[1] / 2, 1])[0] for f in found)
    assert middles == pytest.approx([d + size[0] / 2 for d in doors], abs=0.1)
    assert all(abs(size - 1) <= 0.1 for f in found for size in f.sizes)
    # Between the doors the wall is as wide as one, and goes on above.
    assert scene.find([plain], color_tolerance=5) == []
    bare = learned(wall, np.tile(np.uint8(paint), (len(wall), 1)))
    assert bare.find([door], color_tolerance=5) == []


def test_a_box_and_a_ball_are_refused_together(model: sb.AlphabetModel) -> None:
    with pytest.raises(sb.InvalidInputError, match=r"box is .* left out beside point and radius"):
        model.find(point=(0, 0, 0), radius=1.0, box=((0, 0, 0), (1, 1, 1)))
    with pytest.raises(sb.InvalidInputError, match="nothing says what to look for"):
        model.find()
    with pytest.raises(sb.InvalidInputError, match="radius is None"):
        model.find(point=(0, 0, 0))
    with pytest.raises(sb.InvalidInputError, match=r"point is .*three coordinates"):
        model.find(point=(0, 0), radius=1.0)
    with pytest.raises(sb.InvalidInputError, match="region"):
        model.find(point=(90, 0, 0), radius=1.0)


def test_words_by_share_of_area(model: sb.AlphabetModel) -> None:
    histogram = model.word_histogram()
    assert histogram.shares.sum() == pytest.approx(1.0)
    assert set(histogram.words) <= set(range(len(model.alphabet)))
    assert set(histogram.radii) <= set(model.alphabet.radii)
    # 16 of 17.9 square metres are floor.
    assert histogram.shares[histogram.inclinations == 3].sum() > 0.7


def test_a_model_is_like_itself(model: sb.AlphabetModel) -> None:
    assert sb.place_similarity(model, model) == pytest.approx(1.0)
    line = np.column_stack([np.linspace(0, 9, 3000), np.zeros(3000), np.zeros(3000)])
    other = sb.learn_alphabet(sb.PointCloud(line))
    assert sb.place_similarity(model, other) == sb.place_similarity(other, model)
    assert 0.0 <= sb.place_similarity(model, other) < 0.9


def test_the_verb(
    model: sb.AlphabetModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "seats.sfb"
    model.save(file)
    x, y, _ = PLACES[0]
    argv = ["find", str(file), "--point", str(x), str(y), "0.6", "--radius", "0.52"]
    assert main([*argv, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told["found"]) == 3
    assert told["found"][0]["score"] == 1.0
    assert main(argv) == 0
    assert len(capsys.readouterr().out.splitlines()) == 4
    assert main(["find", str(file), "--point", "0", "0", "0"]) == 2
    assert main(["find", str(file)]) == 2
    chair = tmp_path / "chair.sfb"
    example_of(thing()).save(chair)
    assert main(["find", str(file), "--example", str(chair), str(chair), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told["found"]) == 3
    assert told["found"][0]["example"] == str(chair)
    sb.learn_gas(sb.PointCloud(thing()), n_neurons=50).save(chair)
    assert main(["find", str(file), "--example", str(chair)]) == 2


def test_what_recurs_is_a_class(
    model: sb.AlphabetModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    classes = sb.recurring(model)
    assert len(classes[0]) == 3
    middles = np.array([f.center[:2] for f in classes[0].places])
    for x, y, _ in PLACES:
        assert np.linalg.norm(middles - [x, y], axis=1).min() < 0.25
    assert set(classes.labels) == {-1, *range(len(classes))}
    assert set(classes.things[classes.labels == 0]) == {0, 1, 2}
    # The floor is no part of it.
    level = model.occurrences.poses[:, 2, 3] < 0.1
    assert (classes.labels[level] != 0).all()
    assert all(len(of_class) >= 4 for of_class in sb.recurring(model, min_count=4))
    with pytest.raises(sb.InvalidInputError, match="min_size"):
        sb.recurring(model, min_size=3.0)
    file, picture = tmp_path / "seats.sfb", tmp_path / "classes.png"
    model.save(file)
    assert main(["recurring", str(file), "--picture", str(picture), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [len(c["places"]) for c in told["classes"]] == [len(c) for c in classes]
    assert picture.stat().st_size > 1000
    assert main(["recurring", str(file)]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1 + len(classes)


def test_one_of_a_row_is_a_class() -> None:
    """Three equal shelves side by side hang together over more than `max_size`, one does not."""
    width, depth, height = 0.8, 0.3, 1.2
    shelf = np.concatenate(
        [
            *(rectangle((0.025, 0, z), (0.75, 0, 0), (0, depth, 0)) for z in (0.1, 0.5, 0.8, 1.2)),
            *(rectangle((x, 0, 0), (0, depth, 0), (0, 0, height)) for x in (0.01, 0.79)),
            # What tells left from right.
            rectangle((0.15, 0.1, 0.5), (0.2, 0, 0), (0, 0, 0.2)),
            rectangle((0.5, 0.05, 0.8), (0, 0.2, 0), (0, 0, 0.25)),
        ]
    )
    row = [shelf + np.array([k * width, 0, 0]) for k in range(3)]
    floor = rectangle((-1, -2, 0), (4.4, 0, 0), (0, 4, 0))
    cloud = sb.PointCloud(np.concatenate([floor, *row]))
    classes = sb.recurring(sb.learn_alphabet(cloud, sigma_scale=1.0, noise=0.008))
    low, high = classes[0].box
    assert np.allclose(high - low, [width, depth, height], atol=0.06)
    middles = np.array([place.center for place in classes[0].places])
    middles = middles[np.argsort(middles[:, 0])]
    assert np.allclose(middles, [[0.4 + k * width, 0.15, 0.6] for k in range(3)], atol=0.05)


def boxes_in_a_room() -> tuple[sb.PointCloud, NDArray[np.bool_]]:
    """Six boxes by two lasers, which see floor and walls in pieces; which points are of boxes."""
    low = [(-1.2, -0.8), (0.0, -0.9), (1.1, -0.7)]
    tall = [(-1.3, 0.8), (-0.2, 1.0), (1.2, 0.9)]
    boxes = [((x - 0.3, y - 0.2, 0), (x + 0.3, y + 0.2, 0.4)) for x, y in low]
    boxes += [((x - 0.15, y - 0.15, 0), (x + 0.15, y + 0.15, 0.9)) for x, y in tall]
    room = np.array([[-2.5, -2, 0], [2.5, 2, 2.5]])
    azimuth, elevation = np.meshgrid(np.arange(0.01, 360, 0.5), np.arange(-74.99, 60, 0.5))
    a, e = np.deg2rad(azimuth.ravel()), np.deg2rad(elevation.ravel())
    rays = np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    rng = np.random.default_rng(0)
    points, is_box = [], []
    for origin in np.array([[-2, 0, 1.2], [2, 0.1, 1.3]]):
        distance = np.maximum(*((corner - origin) / rays for corner in room)).min(axis=1)
        hit = np.zeros(len(rays), bool)
        for box in boxes:
            at = [(np.array(corner) - origin) / rays for corner in box]
            near, far = np.minimum(*at).max(axis=1), np.maximum(*at).min(axis=1)
            closer = (near < far) & (near > 0) & (near < distance)
            distance, hit = np.where(closer, near, distance), hit | closer
        points.append(origin + rays * (distance + rng.normal(0, 0.004, len(rays)))[:, None])
        is_box.append(hit)
    return sb.PointCloud(np.concatenate(points)), np.concatenate(is_box)


def test_bare_pieces_of_walls_and_floors_are_no_class() -> None:
    cloud, is_box = boxes_in_a_room()
    points = np.asarray(cloud.points)
    classes = sb.recurring(sb.learn_alphabet(cloud, radius=0.1, sigma_scale=1.5))
    assert len(classes[0]) >= 3
    for of_class in classes:
        for place in of_class.places:
            assert is_box[place.mask(points, margin=0.0)].mean() > 0.5
        # Boxes are around what stands on the floor, without it.
        low, high = of_class.box
        assert low[2] > 0
        assert np.linalg.norm(high - low) < 1.1


def test_samples_too_close_are_refused_before_they_are_taken(model: sb.AlphabetModel) -> None:
    with pytest.raises(sb.InvalidInputError, match=r"resolution is 0\.0002, .*at least 0\.00\d m"):
        sb.recurring(model, resolution=2e-4)


def test_nothing_else_recurs(model: sb.AlphabetModel) -> None:
    assert len(sb.recurring(model)) == 1
