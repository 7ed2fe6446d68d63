"""Floor plans against exact rooms: two that share a wall, and simulated ones with furniture."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb
from surfabet import datasets, plan
from surfabet.cli import main

pytest.importorskip("shapely", reason="pip install 'surfabet[plan]'")
NOISE = 0.004
HEIGHT = 2.5
UTM = np.array([601_234.0, 5_402_345.0, 310.0])


def sheet(
    origin: list[float], u: list[float], v: list[float], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Points of a parallelogram, about 1,100 per square metre, with noise across it."""
    first, second = np.array(u, float), np.array(v, float)
    normal = np.cross(first, second)
    n = int(1100 * np.linalg.norm(normal))
    a, b = rng.uniform(0, 1, (2, n, 1))
    across = normal / np.linalg.norm(normal) * rng.normal(0, NOISE, (n, 1))
    return np.array(origin, float) + a * first + b * second + across


def two_rooms() -> tuple[sb.PointCloud, list[float]]:
    """Rooms of 4 x 3 and 2.5 x 3 m side by side along x, a wall of 0.2 m with a door between them.

    The larger has a window in y = 0. Every point is seen from the middle of its room.
    """
    rng = np.random.default_rng(5)
    parts, eyes = [], []
    for number, (x0, x1) in enumerate([(0.0, 4.0), (4.2, 6.7)]):
        w = x1 - x0
        room = [
            sheet([x0, 0, 0], [w, 0, 0], [0, 3, 0], rng),
            sheet([x0, 0, HEIGHT], [w, 0, 0], [0, 3, 0], rng),
            *(sheet([x0, y, 0], [w, 0, 0], [0, 0, HEIGHT], rng) for y in (0, 3)),
            *(sheet([x, 0, 0], [0, 3, 0], [0, 0, HEIGHT], rng) for x in (x0, x1)),
        ]
        points = np.concatenate(room)
        shared = np.abs(points[:, 0] - (x1 if number == 0 else x0)) < 0.05
        door = shared & (points[:, 1] > 1) & (points[:, 1] < 1.9) & (points[:, 2] < 2.05)
        window = np.abs(points[:, 1]) < 0.05
        window &= (points[:, 0] > 1) & (points[:, 0] < 2.5)
        window &= (points[:, 2] > 0.9) & (points[:, 2] < 2.1)
        points = points[~(door | window)]
        parts.append(points)
        eyes.append(np.full(len(points), number))
    middles = np.array([[2, 1.5, 1.5], [5.5, 1.5, 1.5]])
    cloud = sb.PointCloud(
        np.concatenate(parts), viewpoints=middles, viewpoint_index=np.concatenate(eyes)
    )
    return cloud, [12.0, 7.5]


@pytest.fixture(scope="module")
def scan() -> sb.PointCloud:
    return two_rooms()[0]


@pytest.fixture(scope="module")
def model(scan: sb.PointCloud) -> sb.PlaneModel:
    return sb.learn_planes(scan)


@pytest.fixture(scope="module")
def drawn(model: sb.PlaneModel) -> plan.FloorPlan:
    return plan.floor_plan(model)


def off_by(wall: plan.Wall, walls: list[tuple[int, float]]) -> float:
    """How far both ends of a face are from the nearest of some lines x = or y = so much."""
    return min(max(abs(wall.start[axis] - at), abs(wall.end[axis] - at)) for axis, at in walls)


def test_walls_are_where_they_are(drawn: plan.FloorPlan) -> None:
    truth = [(0, 0.0), (0, 4.0), (0, 4.2), (0, 6.7), (1, 0.0), (1, 3.0)]
    assert len(drawn.walls) in (6, 8)
    assert max(off_by(wall, truth) for wall in drawn.walls) < NOISE / 2
    assert drawn.floor == pytest.approx(0, abs=NOISE / 2)
    assert drawn.ceiling == pytest.approx(HEIGHT, abs=NOISE / 2)


def test_the_shared_wall_has_its_thickness(drawn: plan.FloorPlan) -> None:
    thick = [wall for wall in drawn.walls if wall.thickness is not None]
    assert sorted(round(float(wall.start[0]), 1) for wall in thick) == [4.0, 4.2]
    for wall in thick:
        assert wall.thickness == pytest.approx(0.2, abs=NOISE)
        # Into its room, away from the other face.
        assert wall.normal[0] * (wall.start[0] - 4.1) > 0


def test_rooms_have_their_areas(drawn: plan.FloorPlan) -> None:
    assert [room.area for room in drawn.rooms] == pytest.approx(two_rooms()[1], rel=0.004)
    assert drawn.area == pytest.approx(19.5, rel=0.004)
    for room in drawn.rooms:
        x, y = room.outline.T
        signed = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        assert signed == pytest.approx(room.area)
        assert len(room.outline) == 4


def test_openings(drawn: plan.FloorPlan) -> None:
    found = [(opening, wall) for wall in drawn.walls for opening in wall.openings]
    doors = [opening for opening, wall in found if opening.kind == "door"]
    windows = [opening for opening, wall in found if opening.kind == "window"]
    assert (len(doors), len(windows), len(found)) == (2, 1, 3)
    tile = 0.06
    for door in doors:
        assert sorted([door.start[1], door.end[1]]) == pytest.approx([1.0, 1.9], abs=tile)
        assert (door.bottom, door.top) == pytest.approx((0, 2.05), abs=tile)
    assert sorted([windows[0].start[0], windows[0].end[0]]) == pytest.approx([1, 2.5], abs=tile)
    assert (windows[0].bottom, windows[0].top) == pytest.approx((0.9, 2.1), abs=tile)
    for wall in drawn.walls:
        pieces = wall.pieces()
        assert len(pieces) == 1 + len(wall.openings)
        length = sum(float(np.linalg.norm(b - a)) for a, b in pieces)
        assert length + sum(o.width for o in wall.openings) == pytest.approx(wall.length)


def test_map_coordinates_survive(scan: sb.PointCloud, drawn: plan.FloorPlan) -> None:
    far = sb.PointCloud(
        scan.points + UTM,
        viewpoints=scan.viewpoints + UTM,
        viewpoint_index=scan.viewpoint_index,
    )
    there = plan.floor_plan(sb.learn_planes(far))
    assert there.floor == pytest.approx(UTM[2], abs=NOISE / 2)
    truth = [(0, x + UTM[0]) for x in (0.0, 4.0, 4.2, 6.7)]
    truth += [(1, y + UTM[1]) for y in (0.0, 3.0)]
    assert max(off_by(wall, truth) for wall in there.walls) < NOISE / 2
    assert [room.area for room in there.rooms] == pytest.approx([12.0, 7.5], rel=0.004)


def test_another_vertical(scan: sb.PointCloud, drawn: plan.FloorPlan) -> None:
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    turned = sb.PointCloud(
        scan.points @ turn.T,
        viewpoints=scan.viewpoints @ turn.T,
        viewpoint_index=scan.viewpoint_index,
    )
    model = sb.learn_planes(turned)
    found = plan.floor_plan(model, up=turn @ [0, 0, 1])
    assert [room.area for room in found.rooms] == pytest.approx([12.0, 7.5], rel=0.004)
    with pytest.raises(sb.InvalidInputError, match="up is"):
        plan.floor_plan(model, up=(0, 0, 0))


@pytest.mark.parametrize(("seed", "size"), [(0, (5.4, 4.4, 2.6)), (3, (7.0, 5.0, 2.8))])
def test_simulated_rooms_with_furniture(seed: int, size: tuple[float, float, float]) -> None:
    noise = 0.005
    room = datasets.make_room(seed=seed, size=size)
    scan = datasets.scan_lidar(
        room,
        elevation_limits=(-80, 80),
        elevation_step=0.7,
        azimuth_step=0.7,
        range_noise=noise,
        random_state=seed,
    )
    drawn = plan.floor_plan(sb.learn_planes(scan.cloud))
    x, y = size[0] / 2, size[1] / 2
    # The four walls are the longest faces; a pillar in a corner has short ones.
    for wall in drawn.walls[:4]:
        assert off_by(wall, [(0, -x), (0, x), (1, -y), (1, y)]) < noise
    sides = sorted(wall.length for wall in drawn.walls[:4])
    assert sides == pytest.approx(sorted([size[0], size[0], size[1], size[1]]), abs=2 * noise)
    assert drawn.rooms[0].area == pytest.approx(size[0] * size[1], rel=0.01)
    assert len(drawn.rooms) == 1
    assert drawn.ceiling == pytest.approx(size[2], abs=noise)
    found = [opening.kind for wall in drawn.walls for opening in wall.openings]
    # Two windows and the door that stands open; doors that are closed are part of the wall.
    assert sorted(found) == ["door", "window", "window"]


def test_files(
    model: sb.PlaneModel,
    drawn: plan.FloorPlan,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    sfb = tmp_path / "walls.sfb"
    model.save(sfb)
    assert main(["plan", str(sfb), str(tmp_path / "plan.dxf"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [room["area"] for room in told["rooms"]] == [room.area for room in drawn.rooms]
    drawing = ezdxf.readfile(tmp_path / "plan.dxf")
    assert drawing.units == 6
    lines = drawing.modelspace().query('LINE[layer=="WALLS"]')
    sides = [(line.dxf.start, line.dxf.end) for line in lines]
    ends = {tuple(np.round([*end][:2], 9) + 0.0) for pair in sides for end in pair}
    for wall in drawn.walls:
        assert {tuple(np.round(p, 9) + 0.0) for piece in wall.pieces() for p in piece} <= ends
    assert len(drawing.modelspace().query('LWPOLYLINE[layer=="ROOMS"]')) == 2

    for suffix, start in ((".svg", b"<?xml"), (".pdf", b"%PDF")):
        file = tmp_path / f"plan{suffix}"
        assert main(["plan", str(sfb), str(file)]) == 0
        assert file.read_bytes().startswith(start)
    assert "room 1: 12.0" in capsys.readouterr().out
    svg = (tmp_path / "plan.svg").read_text("utf-8")
    assert "m²" in svg
    assert "1 : 50" in svg
    # The same plan gives the same file.
    before = (tmp_path / "plan.svg").read_bytes()
    drawn.save(tmp_path / "plan.svg")
    assert (tmp_path / "plan.svg").read_bytes() == before


def test_where_no_room_is_large_enough_no_area_is_told(
    model: sb.PlaneModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model.save(tmp_path / "walls.sfb")
    words = ["plan", str(tmp_path / "walls.sfb"), str(tmp_path / "plan.svg"), "--min-room-area"]
    assert main([*words, "13"]) == 0
    told = capsys.readouterr().out
    assert ", no rooms, " in told
    assert "m2" not in told
    assert main([*words, "10"]) == 0
    assert ", 1 room of 12.0" in capsys.readouterr().out


def test_a_floor_without_walls_names_the_heights_that_there_are(
    model: sb.PlaneModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert plan.floor_plan(model, floor=0.1).rooms
    with pytest.raises(ValueError, match=r"^floor is 7\.0, but must be .* level surfaces are at"):
        plan.floor_plan(model, floor=7.0)
    model.save(tmp_path / "walls.sfb")
    out = tmp_path / "plan.svg"
    assert main(["plan", str(tmp_path / "walls.sfb"), str(out), "--floor", "7"]) == 2
    assert "--floor" in capsys.readouterr().err
    assert not out.exists()


def test_what_has_no_walls_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(0)
    flat = sb.learn_planes(sb.PointCloud(sheet([0, 0, 0], [3, 0, 0], [0, 3, 0], rng)))
    flat.save(tmp_path / "floor.sfb")
    assert main(["plan", str(tmp_path / "floor.sfb"), str(tmp_path / "plan.dxf")]) == 1
    assert "no walls" in capsys.readouterr().err
    assert not (tmp_path / "plan.dxf").exists()
    assert main(["plan", str(tmp_path / "floor.sfb"), str(tmp_path / "plan.dwg")]) == 2
    assert ".dxf" in capsys.readouterr().err
