"""Many places: similarity and poses from an index, kinds of places, the verb `places`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb
from surfabet.cli import main

Array = NDArray[np.float64]


def room(x: float, y: float, z: float = 2.5, shelf: float = 0.0, angle: float = 0.0) -> Array:
    """A box seen from its middle, with a shelf in a corner, in a frame that is turned."""
    random = np.random.default_rng(0)
    faces = []
    for axis, size in enumerate((x, y, z)):
        others = [s for a, s in enumerate((x, y, z)) if a != axis]
        for side in (0.0, size):
            u = random.uniform(0, 1, (2500, 2)) * others
            faces.append(np.insert(u, axis, side, axis=1))
    points = np.concatenate(faces)
    if shelf > 0:
        front = random.uniform(0, 1, (1500, 2)) * [shelf, 1.8]
        points = np.concatenate([points, np.insert(front, 1, 0.4, axis=1)])
        side = random.uniform(0, 1, (800, 2)) * [0.4, 1.8]
        points = np.concatenate([points, np.insert(side, 0, shelf, axis=1)])
    points -= [0.5 * x, 0.5 * y, 1.2]
    s, c = np.sin(angle), np.cos(angle)
    return points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def cloud(points: Array) -> sb.PointCloud:
    return sb.PointCloud(points).seen_from((0, 0, 0))


ROOMS = {"small": (4.0, 3.0), "long": (9.0, 2.0), "hall": (11.0, 8.0)}


@pytest.fixture(scope="module")
def index() -> sb.PlaceIndex:
    rooms = {name: cloud(room(x, y, shelf=1.3)) for name, (x, y) in ROOMS.items()}
    return sb.place_index(rooms)


@pytest.mark.parametrize("name", ROOMS)
def test_a_scan_finds_its_place_and_its_pose(index: sb.PlaceIndex, name: str) -> None:
    angle = 0.7
    found = index.query(cloud(room(*ROOMS[name], shelf=1.3, angle=angle)), verify=1)
    assert found[0].name == name
    assert sorted(match.place for match in found) == [0, 1, 2]
    assert found[0].similarity > found[1].similarity
    # The query's frame is turned by the angle in that of the place.
    pose = found[0].pose
    assert pose is not None
    s, c = np.sin(angle), np.cos(angle)
    assert np.allclose(pose[:3, :3], [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=0.02)
    assert np.abs(pose[:3, 3]).max() < 0.05
    assert all(match.locations is None and match.pose is None for match in found[1:])


def test_another_place_is_similar_at_most_and_has_no_pose(index: sb.PlaceIndex) -> None:
    found = index.query(cloud(room(6.5, 5.0, z=3.4)), verify=3)
    assert len(found) == 3
    assert all(match.pose is None for match in found)
    assert all(match.locations is not None and match.locations.reason for match in found)


def test_models_of_any_method_are_places(index: sb.PlaceIndex) -> None:
    patches = sb.learn_patches(cloud(room(*ROOMS["hall"], shelf=1.3)), resolution=0.1)
    assert index.query(patches, verify=0)[0].name == "hall"
    assert index.query(index.models[1], verify=0)[0].similarity == pytest.approx(1.0)


def test_similarities_are_those_of_pairs(index: sb.PlaceIndex) -> None:
    table = index.similarities
    assert table.shape == (3, 3)
    assert np.array_equal(table, table.T)
    assert np.diag(table) == pytest.approx(1.0)
    assert table[0, 2] == sb.place_similarity(index.models[0], index.models[2])


def test_kinds_are_joined_by_their_words(index: sb.PlaceIndex) -> None:
    models = [*index.models, index.models[1]]
    found = sb.label_places(models)
    assert found.labels[1] == found.labels[3]
    assert found.labels[0] == 0
    assert len(sb.label_places(models, n_kinds=4)) == 4
    assert sb.label_places(models, n_kinds=1).labels.tolist() == [0, 0, 0, 0]
    assert sb.label_places(models, n_kinds=3).labels.tolist() == [0, 1, 2, 1]
    assert len(sb.label_places(models, min_similarity=0.0)) == 1
    assert len(sb.label_places([])) == 0


def test_threads_do_not_change_the_answer(index: sb.PlaceIndex) -> None:
    asked = cloud(room(4.0, 3.0, shelf=1.3, angle=2.0))
    before = sb.get_num_threads()
    answers = []
    try:
        for threads in (1, 3):
            sb.set_num_threads(threads)
            found = index.query(asked, verify=1)
            pose = found[0].pose
            assert pose is not None
            answers.append(([m.similarity for m in found], pose.tobytes()))
    finally:
        sb.set_num_threads(before)
    assert answers[0] == answers[1]


def test_wrong_arguments_are_named(index: sb.PlaceIndex) -> None:
    with pytest.raises(sb.InvalidInputError, match="top is 0"):
        index.query(index.models[0], top=0)
    with pytest.raises(sb.InvalidInputError, match="verify is -1"):
        index.query(index.models[0], verify=-1)
    with pytest.raises(sb.InvalidInputError, match="no places"):
        sb.place_index([]).query(index.models[0])
    with pytest.raises(sb.InvalidInputError, match="n_kinds is 0"):
        sb.label_places(index.models, n_kinds=0)
    with pytest.raises(sb.InvalidInputError, match="min_similarity"):
        sb.label_places(index.models, min_similarity=1.5)


def test_the_verb(index: sb.PlaceIndex, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = []
    for name, model in zip(index.names, index.models, strict=True):
        model.save(tmp_path / f"{name}.sfb")
        files.append(str(tmp_path / f"{name}.sfb"))
    scan = tmp_path / "scan.ply"
    sb.write(scan, sb.PointCloud(room(9.0, 2.0, shelf=1.3, angle=1.0)))
    argv = ["places", *files, "--query", str(scan)]
    assert main([*argv, "--viewpoint", "0", "0", "0", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["places"][0]["place"].endswith("long.sfb")
    assert told["places"][0]["locations"]
    assert main(argv) == 0
    assert "long.sfb" in capsys.readouterr().out.splitlines()[1]
    assert main(["places", *files, "--kinds", "2", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kinds"] == 2
    assert len(told["places"]) == 3
    assert main(["places", files[0]]) == 0
    capsys.readouterr()
    other = tmp_path / "other.ply"
    sb.write(other, sb.PointCloud(room(6.5, 5.0, z=3.4)))
    assert main(["places", *files, "--query", str(other)]) == 1
    assert main(["places"]) == 2
    assert main([*argv, "--kinds", "2"]) == 2
