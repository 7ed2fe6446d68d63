"""What appeared and vanished between maps: against the simulator, which knows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from surfabet import datasets
from surfabet.cli import main
from surfabet.errors import InvalidInputError, InvalidTypeError


def learned(scene: datasets.Scene, seed: int) -> tuple[sb.PatchModel, Any]:
    poses = scene.default_poses(12)
    scan = datasets.scan_rgbd(scene, poses, width=200, height=150, random_state=seed)
    return sb.learn_patches(scan.cloud, resolution=0.03), poses[:, :3, 3]


@pytest.fixture(scope="module")
def scenes() -> tuple[datasets.Scene, datasets.Scene, int]:
    """A room with a chair, and without."""
    scene = datasets.make_room(seed=3)
    chairs = [thing.id for thing in scene.instances if thing.class_name == "chair"]
    return scene, scene.rearranged({chairs[0]: None}), chairs[0]


@pytest.fixture(scope="module")
def maps(scenes: Any) -> Any:
    return learned(scenes[0], 1), learned(scenes[1], 2)


@pytest.mark.parametrize("viewpoints", [False, True])
def test_a_chair_that_went_vanished_and_came_back_appeared(
    scenes: Any, maps: Any, viewpoints: bool
) -> None:
    (a, from_a), (b, from_b) = maps
    sensors = (from_a, from_b) if viewpoints else (None, None)
    found = sb.diff(a, b, viewpoints=sensors)
    low, high = (np.array(corner) for corner in scenes[0].instances[scenes[2]].bounds)
    assert len(found) >= 1
    for change in found:
        assert change.kind == "vanished"
        assert (change.box[0] > low - 0.1).all()
        assert (change.box[1] < high + 0.1).all()
        assert change.area >= 0.05
    back = sb.diff(b, a, viewpoints=sensors[::-1])
    assert {change.kind for change in back} == {"appeared"}
    assert [c.area for c in back] == pytest.approx([c.area for c in found], rel=0.3)
    assert "vanished" in repr(found)


def test_the_cloud_shows_the_changes(maps: Any) -> None:
    (a, _), (b, _) = maps
    found = sb.diff(a, b)
    cloud, groups = found.cloud, found.cloud["group"]
    for i, change in enumerate(found):
        own = cloud.points[groups == i]
        assert len(own) == change.n_points
        assert np.allclose(own.min(axis=0), change.box[0], atol=1e-4)
        assert np.allclose(own.max(axis=0), change.box[1], atol=1e-4)
        assert (cloud["change"][groups == i] == 2).all()
    assert (groups[cloud["change"] == 0] == -1).all()
    assert (cloud["change"] != 2).sum() == len(b.decode())
    assert [c.area for c in found] == sorted((c.area for c in found), reverse=True)


def test_a_map_is_like_itself_and_like_another_of_the_same_room(scenes: Any, maps: Any) -> None:
    (a, _), _ = maps
    assert len(sb.diff(a, a)) == 0
    again, _ = learned(scenes[0], 9)
    assert len(sb.diff(a, again)) == 0


def test_unseen_is_not_vanished(scenes: Any, maps: Any) -> None:
    """Half of a room was not scanned the second time: it did not vanish."""
    (a, _), _ = maps
    scan = datasets.scan_rgbd(scenes[0], scenes[0].default_poses(12), width=200, height=150)
    cloud = scan.cloud.select(scan.cloud.points[:, 0] < 0)
    found = sb.diff(a, sb.learn_patches(cloud, resolution=0.03))
    assert sum(change.area for change in found) < 0.02 * found.unseen[0]
    assert found.unseen[0] > 5


def test_maps_of_other_methods_and_in_tiles(
    scenes: Any, maps: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (a, _), _ = maps
    scan = datasets.scan_rgbd(
        scenes[1], scenes[1].default_poses(12), width=200, height=150, random_state=2
    )
    path = tmp_path / "b.sfb"
    sb.learn_patches_tiled(scan.cloud, path, tile=2.0, resolution=0.03)
    found = sb.diff(a, sb.load(path))
    assert {change.kind for change in found} == {"vanished"}
    planes = sb.learn_planes(scan.cloud)
    assert all(isinstance(change.area, float) for change in sb.diff(a, planes))
    a.save(tmp_path / "a.sfb")
    out = tmp_path / "changes.ply"
    arguments = ["diff", str(tmp_path / "a.sfb"), str(path)]
    assert main([*arguments, "--out", str(out), "--json"]) in (None, 0)
    told = json.loads(capsys.readouterr().out)
    assert [change["kind"] for change in told["changes"]] == ["vanished"] * len(found)
    assert len(sb.read(out)) == len(found.cloud)
    assert main(arguments) in (None, 0)
    assert "0 appeared" in capsys.readouterr().out
    assert main([*arguments, "--box", "0", "0", "0", "1", "1", "1"]) == 2
    assert "has no tiles" in capsys.readouterr().err
    (tmp_path / "poses.txt").write_text("1 2\n")
    assert main([*arguments, "--viewpoints-a", str(tmp_path / "poses.txt")]) == 2
    assert "--viewpoints-a" in capsys.readouterr().err
    missing = str(tmp_path / "missing.txt")
    assert main([*arguments, "--viewpoints-b", missing]) == 2
    said = capsys.readouterr().err
    assert "--viewpoints-b" in said
    assert "missing.txt: No such file or directory" in said.replace("\n", "")


def test_what_options_must_be(maps: Any) -> None:
    (a, _), (b, _) = maps
    with pytest.raises(InvalidInputError, match=r"tolerance is 0\.0001, but must be at least"):
        sb.diff(a, b, tolerance=1e-4)
    with pytest.raises(InvalidTypeError, match="b is a PointCloud"):
        sb.diff(a, b.decode())  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="tolerance is -1"):
        sb.diff(a, b, tolerance=-1.0)
    with pytest.raises(InvalidInputError, match="min_area is 0"):
        sb.diff(a, b, min_area=0.0)
    with pytest.raises(InvalidInputError, match="viewpoints"):
        sb.diff(a, b, viewpoints=(None,))
    with pytest.raises(InvalidInputError, match="viewpoints"):
        sb.diff(a, b, viewpoints=([[np.nan, 0, 0]], None))
