"""Maps that go on: what a scan does not touch stays, and what it shows is in the map once."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet as sb
from surfabet import _updating
from surfabet.cli import main
from surfabet.errors import DroppedPointsWarning, InvalidInputError, InvalidTypeError
from test_format import Fields, sections
from test_tiles import OPTIONS, PIXEL, TILE, TILED, cropped, same
from test_tiles import room as room_of_tiles

EAST = 2.0
"""The room is 4 m long; in its own frame the east begins here."""


def room(seed: int = 0) -> sb.PointCloud:
    """The room of the tests of tiles, with both labels in the west and in the east."""
    cloud = room_of_tiles(seed)
    turn = np.deg2rad(17)
    y = (cloud.points - [5000.0, -200.0, 40.0]) @ [-np.sin(turn), np.cos(turn), 0.0]
    return sb.PointCloud(
        cloud.points,
        colors=cloud.colors,
        intensities=cloud.intensities,
        extra={"label": (y > 1.5).astype(np.uint8)},
    )


def local_x(cloud: sb.PointCloud) -> Any:
    """Where points lie along the room."""
    turn = np.deg2rad(17)
    return (cloud.points - [5000.0, -200.0, 40.0]) @ [np.cos(turn), np.sin(turn), 0.0]


def part(cloud: sb.PointCloud, low: float, high: float) -> sb.PointCloud:
    x = local_x(cloud)
    return cloud.select((x >= low) & (x < high))


def learned(cloud: sb.PointCloud, path: Path, **options: Any) -> sb.TiledPatchModel:
    names = ["colors", "intensities", "label"]
    given = {"tile": TILE, "attributes": names, **OPTIONS, **options}
    sb.learn_patches_tiled(cloud, path, **given)
    model = sb.load(path)
    assert isinstance(model, sb.TiledPatchModel)
    return model


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return room()


@pytest.fixture(scope="module")
def whole(cloud: sb.PointCloud, tmp_path_factory: pytest.TempPathFactory) -> sb.TiledPatchModel:
    return learned(cloud, tmp_path_factory.mktemp("sessions") / "whole.sfb")


@pytest.fixture(scope="module")
def west(cloud: sb.PointCloud, tmp_path_factory: pytest.TempPathFactory) -> sb.TiledPatchModel:
    return learned(part(cloud, -1, EAST), tmp_path_factory.mktemp("sessions") / "west.sfb")


def tiles(model: sb.TiledPatchModel) -> dict[tuple[int, ...], bytes]:
    """The bytes of each tile, by its cube."""
    data = sections(model.to_bytes(), TILED)["TILE"]
    ends = np.cumsum(model.tiles.bytes.astype(np.int64))
    starts = ends - model.tiles.bytes.astype(np.int64)
    return {
        tuple(cube): data[a:b]
        for cube, a, b in zip(model.tiles.cubes.tolist(), starts, ends, strict=True)
    }


def test_tiles_without_new_points_keep_their_bytes(
    whole: sb.TiledPatchModel, cloud: sb.PointCloud
) -> None:
    scan = part(room(1), 3.2, 5)
    before, after = tiles(whole), tiles(updated := whole.update(scan))
    changed = {cube for cube in before if after[cube] != before[cube]}
    assert 0 < len(changed) < len(before)
    assert set(before) <= set(after)
    # The sum of the points is that of both, and each point counts for one tile.
    assert updated.n_points == len(cloud) + len(scan)
    grown = {
        tuple(cube): int(n)
        for cube, n in zip(updated.tiles.cubes.tolist(), updated.tiles.points, strict=True)
    }
    for cube, n in zip(whole.tiles.cubes.tolist(), whole.tiles.points, strict=True):
        assert (grown[tuple(cube)] > n) == (tuple(cube) in changed)
    # This one stays as it is.
    assert tiles(whole) == before


def test_sessions_are_as_near_and_small_as_all_at_once(
    west: sb.TiledPatchModel, cloud: sb.PointCloud, tmp_path: Path
) -> None:
    model = west
    for low in (2.0, 3.0):
        model = model.update(part(cloud, low, 3.0 if low < 3 else 5.0))
    assert model.n_points == len(cloud)
    at_once = west.update(cloud, alone=True)
    assert at_once.n_points == len(cloud)
    for as_measured in (False, True):
        errors = [
            sb.evaluate(cloud, m.decode(as_measured=as_measured), normal_neighbors=None)
            for m in (model, at_once)
        ]
        assert errors[0].rmse <= 1.1 * errors[1].rmse
        assert errors[0].color_rmse_pooled <= 1.1 * errors[1].color_rmse_pooled
    assert len(model.to_bytes()) <= 1.1 * len(at_once.to_bytes())


def test_a_second_pass_adds_little(cloud: sb.PointCloud, tmp_path: Path) -> None:
    """Without points beside the patches, which are other ones in each scan."""
    whole = learned(cloud, tmp_path / "map.sfb", completeness=0.0)
    second = room(1)
    both, alone = whole.update(second), whole.update(second, alone=True)
    added = len(both.to_bytes()) - len(whole.to_bytes())
    assert added <= 0.1 * len(alone.to_bytes())
    truth = sb.evaluate(cloud, both.decode(), normal_neighbors=None)
    assert truth.rmse <= 1.1 * sb.evaluate(cloud, whole.decode(), normal_neighbors=None).rmse


def test_old_points_count_as_many_as_they_were(tmp_path: Path) -> None:
    """A plane that was measured at two heights lies between them, by the numbers of points."""
    rng = np.random.default_rng(5)

    def plane(height: float, n: int) -> sb.PointCloud:
        points = np.column_stack([rng.uniform(0, 1.2, (n, 2)), np.full(n, height)])
        return sb.PointCloud(points + [0, 0, 1e-4] * rng.standard_normal((n, 3)))

    def height(model: sb.TiledPatchModel) -> float:
        points = model.decode().points
        inner = ((points[:, :2] > 0.3) & (points[:, :2] < 0.9)).all(axis=1)
        return float(points[inner, 2].mean())

    options: dict[str, Any] = {"resolution": PIXEL, "depth_step": 0.0625, "completeness": 0.0}
    path = tmp_path / "plane.sfb"
    for n_old, n_new in ((90_000, 30_000), (30_000, 90_000)):
        sb.learn_patches_tiled(plane(0.0, n_old), path, **options)
        model = sb.load(path)
        found = height(model.update(plane(0.008, n_new)))
        wanted = 0.008 * n_new / (n_old + n_new)
        assert found == pytest.approx(wanted, abs=0.0015)


def test_updates_are_the_same_on_any_number_of_threads(
    west: sb.TiledPatchModel, cloud: sb.PointCloud
) -> None:
    scan = part(cloud, EAST, 3)
    once = west.update(scan).to_bytes()
    n = sb.get_num_threads()
    try:
        sb.set_num_threads(1)
        assert west.update(scan).to_bytes() == once
    finally:
        sb.set_num_threads(n)


def test_maps_of_one_plan_are_put_together(west: sb.TiledPatchModel, cloud: sb.PointCloud) -> None:
    east = west.update(part(cloud, EAST, 5), alone=True)
    shared = set(tiles(east)) & set(tiles(west))
    assert shared
    merged = sb.merge_tiles([west, east])
    assert merged.n_points == len(cloud)
    assert set(tiles(merged)) == set(tiles(west)) | set(tiles(east))
    for model in (west, east):
        for cube, data in tiles(model).items():
            assert (tiles(merged)[cube] == data) == (cube not in shared)
    again = sb.evaluate(cloud, merged.decode(), normal_neighbors=None)
    at_once = sb.evaluate(cloud, west.update(cloud, alone=True).decode(), normal_neighbors=None)
    assert again.rmse <= 1.1 * at_once.rmse
    # The order makes no difference to what is in one of them alone, and copies are one.
    assert sb.merge_tiles([west, west, west]) == west
    assert sb.merge_tiles([merged, west.update(part(cloud, 3.9, 5))]).n_points > 0


def test_merged_maps_are_the_same_on_any_number_of_threads(
    west: sb.TiledPatchModel, cloud: sb.PointCloud
) -> None:
    other = west.update(part(room(1), -1, EAST + 0.5), alone=True)
    before = sb.get_num_threads()
    made, seen = [], []
    try:
        for threads in (1, 2, 3):
            sb.set_num_threads(threads)
            merged = sb.merge_tiles([west, other], progress=lambda _, done: seen.append(done))
            made.append(merged.to_bytes())
    finally:
        sb.set_num_threads(before)
    assert made[0] == made[1] == made[2]
    assert len(set(seen)) > 1
    assert max(seen) == 1


def test_a_box_of_an_updated_map_is_the_whole_cropped(
    west: sb.TiledPatchModel, cloud: sb.PointCloud, tmp_path: Path
) -> None:
    path = tmp_path / "map.sfb"
    model = west.update(part(cloud, EAST, 3))
    model.save(path)
    box = ([5000.5, -200, 39], [5002.5, -197, 42])
    wanted = cropped(model.decode(), box)
    assert len(wanted) > 100
    assert same(sb.load(path, box=box).decode(), wanted)


def test_what_maps_and_scans_must_be(
    west: sb.TiledPatchModel, cloud: sb.PointCloud, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=r"cloud is .*one without colors"):
        west.update(sb.PointCloud(cloud.points))
    with pytest.raises(InvalidInputError, match="empty"):
        west.update(cloud.select(np.zeros(0, int)))
    columns = {name: getattr(cloud, name) for name in ("colors", "intensities")}
    for label, what in ((cloud["label"] + 5, "in label"), (cloud["label"] * 1.0, "type f64")):
        with pytest.raises(InvalidInputError, match=f"cloud is one with .*{what}"):
            west.update(sb.PointCloud(cloud.points, **columns, extra={"label": label}))
    other = learned(cloud, tmp_path / "other.sfb", resolution=0.03, tile=1.92)
    with pytest.raises(InvalidInputError, match=r"models is .*pixels of 0\.02 and 0\.03 m"):
        sb.merge_tiles([west, other])
    turned = learned(part(cloud, 1, 5), tmp_path / "turned.sfb")
    with pytest.raises(InvalidInputError, match=r"models is .*one plan"):
        sb.merge_tiles([west, turned])
    bounded = learned(cloud, tmp_path / "bounded.sfb", max_error=0.02)
    with pytest.raises(InvalidInputError, match=r"model is .*max_error"):
        bounded.update(cloud)
    far = np.concatenate([cloud.points[:5000], [[9_000_000.0, 0.0, 0.0]]])
    names = {name: np.resize(cloud[name], (5001, *cloud[name].shape[1:])) for name in ("colors",)}
    scan = sb.PointCloud(
        far,
        **names,
        intensities=np.resize(cloud.intensities, 5001),
        extra={"label": np.resize(cloud["label"], 5001)},
    )
    with pytest.warns(DroppedPointsWarning, match="1 points are far"):
        assert west.update(scan).n_points == west.n_points + 5000


def test_files_without_the_plan_are_read_but_not_learned_on(
    west: sb.TiledPatchModel, cloud: sb.PointCloud
) -> None:
    """A file as it was before: the section `plan` left out of the table."""
    data = west.to_bytes()
    found = sections(data, TILED)
    assert list(found) == ["META", "TIDX", "plan", "TILE"]
    old = sb.from_bytes(without_section(data, "plan"))
    assert same(old.decode(), west.decode())
    with pytest.raises(InvalidInputError, match="how its tiles were learned"):
        old.update(cloud)


def test_maps_without_the_plan_are_named_when_they_are_merged(
    west: sb.TiledPatchModel, cloud: sb.PointCloud
) -> None:
    old = sb.from_bytes(without_section(west.to_bytes(), "plan"))
    with pytest.raises(InvalidInputError, match=r"models\[1\] does not say .* learn it again"):
        sb.merge_tiles([west, old])


def moved(cloud: sb.PointCloud, shift: list[float]) -> sb.PointCloud:
    return sb.PointCloud(
        cloud.points + shift,
        colors=cloud.colors,
        intensities=cloud.intensities,
        extra={"label": cloud["label"]},
    )


def test_scans_in_another_frame_are_told_by_their_distance(
    west: sb.TiledPatchModel, cloud: sb.PointCloud
) -> None:
    bounds = west.tiles.bounds
    near = moved(cloud, [bounds[:, 1, 0].max() - cloud.points[:, 0].min() + 0.9 * TILE, 0, 0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        west.update(near)
    apart = 300 - np.ptp(bounds[..., 0])
    with pytest.warns(sb.FrameWarning, match=r"lies (29\d) m from the map; .* locate") as warned:
        west.update(moved(cloud, [300.0, 0, 0]))
    (said,) = (str(one.message) for one in warned if one.category is sb.FrameWarning)
    assert abs(int(said.split()[3]) - apart) < 5
    with pytest.raises(InvalidInputError, match=r"cloud lies 999,99\d m from the map.*hold both"):
        west.update(moved(cloud, [1e6, 0, 0]))


def test_a_part_does_not_replace_the_map_that_it_is_of(
    west: sb.TiledPatchModel, cloud: sb.PointCloud, tmp_path: Path
) -> None:
    path = tmp_path / "map.sfb"
    west.save(path)
    data = path.read_bytes()
    low, high = west.tiles.bounds[0]
    part_of = sb.load(path, box=(low, (low + high) / 2))
    assert isinstance(part_of, sb.TiledPatchModel)
    assert len(part_of.tiles) < len(west.tiles)
    (tmp_path / "link.sfb").symlink_to(path)
    for target in (path, str(path), tmp_path / "link.sfb"):
        with pytest.raises(InvalidInputError, match=r"another file .* of 12 tiles were loaded"):
            part_of.save(target)
        with pytest.raises(InvalidInputError, match="tiles were loaded"):
            part_of.update(part(cloud, 0, EAST)).save(target)
    assert path.read_bytes() == data
    part_of.save(tmp_path / "part.sfb")
    assert len(sb.load(tmp_path / "part.sfb").tiles) == len(part_of.tiles)
    # A box about all of it leaves nothing out.
    sb.load(path, box=([-1e5] * 3, [1e5] * 3)).save(path)
    assert sb.load(path) == west


def test_the_plan_is_as_the_page_has_it(west: sb.TiledPatchModel) -> None:
    """5.7: what the map remembers of how it was learned."""
    fields = Fields(sections(west.to_bytes(), TILED)["plan"])
    density, tolerance, gap = (fields.f64() for _ in range(3))
    assert density > 1
    assert 0 < tolerance < 0.1
    assert gap == 0
    assert (fields.varint(), fields.varint()) == (0, 0)
    assert [fields.f64() for _ in range(4)] == [1.4, 0.99, 0.15, 0.15]
    assert fields.varint() == 3
    assert fields.at == len(fields.data)


def without_section(data: bytes, tag: str) -> bytes:
    from test_tiles import crc32c, varint

    head = data[:8] + varint(TILED)
    parts = {name: part for name, part in sections(data, TILED).items() if name != tag}
    head += varint(len(parts))
    for name, part in parts.items():
        head += name.encode() + varint(len(part)) + crc32c(part).to_bytes(4, "little")
    head += crc32c(head).to_bytes(4, "little")
    return head + b"".join(parts.values())


def test_the_note_stays_with_a_map(
    west: sb.TiledPatchModel, cloud: sb.PointCloud, tmp_path: Path
) -> None:
    path, other = tmp_path / "map.sfb", tmp_path / "other.sfb"
    note = "CRS: EPSG:2994; lengths in ft"
    west.save(path, note=note)
    data = path.read_bytes()
    with path.open("rb") as file:
        for read in (sb.load(path), sb.load(file), sb.from_bytes(data)):
            assert read == west
            assert read.note == note
            assert read.to_bytes() == data
    whole = sb.load(path)
    assert isinstance(whole, sb.TiledPatchModel)
    assert west.to_bytes(note=note) == data
    whole.save(other)
    assert other.read_bytes() == data
    sb.load(path, box=whole.tiles.bounds[0]).save(other)
    assert sb.inspect(other).note == note
    whole.save(other, note="")
    assert sb.inspect(other).note is None
    east = whole.update(part(cloud, EAST, 5), alone=True)
    assert east.note == note
    assert sb.merge_tiles([whole, east]).note == note
    east.save(other, note="the east")
    renamed = sb.load(other)
    assert isinstance(renamed, sb.TiledPatchModel)
    assert sb.merge_tiles([whole, renamed]).note == note
    assert sb.merge_tiles([renamed, whole]).note == "the east"


def test_the_command_line_adds_and_merges(
    west: sb.TiledPatchModel,
    cloud: sb.PointCloud,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path, scan, east, out = (
        str(tmp_path / name) for name in ("map.sfb", "scan.ply", "east.sfb", "out.sfb")
    )
    west.save(path, note="the west")
    sb.write(scan, part(cloud, EAST, 5))
    scanned = sb.read(scan)
    if "label" not in scanned.attributes:
        pytest.fail("PLY lost a column")
    assert main(["append", path, scan, "--alone", "--out", east]) in (None, 0)
    assert main(["append", path, scan, "--alone"]) == 2
    assert "--alone" in capsys.readouterr().err
    assert main(["merge", path, east, "--out", out]) in (None, 0)
    assert sb.load(out) == sb.merge_tiles([west, sb.load(east)])
    assert sb.inspect(out).note == "the west"
    assert main(["append", path, scan]) in (None, 0)
    assert sb.load(path) == west.update(scanned)
    assert sb.inspect(path).note == "the west"
    plain = str(tmp_path / "plain.sfb")
    sb.learn_patches(part(cloud, 0, 1), resolution=0.05).save(plain)
    assert main(["append", plain, scan]) == 2
    assert "has no tiles" in capsys.readouterr().err
    assert main(["merge", path, "--out", out]) == 2
    assert main(["merge", path, east]) == 2
    assert "--out: is required" in capsys.readouterr().err


def test_new_surface_is_in_the_map_once(west: sb.TiledPatchModel, cloud: sb.PointCloud) -> None:
    at_once = west.update(cloud, alone=True).decode()
    model = west.update(part(cloud, EAST, 5)).decode()
    assert abs(len(model) - len(at_once)) <= 0.03 * len(at_once)
    distance, _ = cKDTree(at_once.points).query(model.points)
    assert np.quantile(distance, 0.99) < 2 * PIXEL


def test_what_is_no_map_in_tiles_is_named() -> None:
    with pytest.raises(InvalidInputError, match="models is empty"):
        sb.merge_tiles([])
    with pytest.raises(InvalidTypeError, match=r"models\[0\] is "):
        sb.merge_tiles([5])  # type: ignore[list-item]
    with pytest.raises(FileNotFoundError, match=r"no\.sfb"):
        sb.merge_tiles(["no.sfb"])


def test_maps_in_tiles_refuse_recurrence(tmp_path: Path) -> None:
    cloud = sb.PointCloud(np.random.default_rng(0).uniform(0, 1, (1000, 3)))
    with pytest.raises(InvalidInputError, match="recurrence is True"):
        sb.learn_patches_tiled(cloud, tmp_path / "map.sfb", recurrence=True)
    assert not list(tmp_path.iterdir())


def test_what_a_scan_does_not_come_near_stays_symbol_for_symbol(
    cloud: sb.PointCloud, tmp_path: Path
) -> None:
    """In one tile: squares of patches are 1.28 m wide, and points matter within 0.32 m of them."""
    model = learned(cloud, tmp_path / "map.sfb", attributes=[], completeness=0.0, tile=10.24)
    assert len(model.tiles) == 1
    updated = model.update(part(room(1), 3.2, 5))
    before, after = model.decode(as_measured=True), updated.decode(as_measured=True)

    def rows(cloud: sb.PointCloud, low: float, high: float) -> Any:
        points = part(cloud, low, high).points
        return points[np.lexsort(points.T)]

    assert len(rows(before, -1, 1.5)) > 10_000
    assert np.array_equal(rows(before, -1, 1.5), rows(after, -1, 1.5))
    assert not np.array_equal(rows(before, 3.2, 5), rows(after, 3.2, 5))


def test_a_scan_on_disk_makes_the_map_of_one_in_memory(
    whole: sb.TiledPatchModel, cloud: sb.PointCloud, tmp_path: Path
) -> None:
    scan = part(room(1), 2.2, 5)
    path, work = tmp_path / "scan.ply", tmp_path / "work"
    sb.write(path, scan)
    work.mkdir()
    memory = 300 << 20
    updated = whole.update(path, max_memory=memory, work=work)
    wanted = whole.update(scan)
    assert updated.n_points == wanted.n_points == len(cloud) + len(scan)
    # Points are added up in another order.
    touched = {cube for cube, data in tiles(wanted).items() if tiles(whole).get(cube) != data}
    assert 0 < len(touched) < len(tiles(whole))
    assert set(tiles(updated)) == set(tiles(wanted))
    for cube, data in tiles(whole).items():
        assert (tiles(updated)[cube] == data) == (cube not in touched)
    assert abs(len(updated.to_bytes()) - len(wanted.to_bytes())) < 0.02 * len(wanted.to_bytes())
    distance, _ = cKDTree(wanted.decode().points).query(updated.decode().points)
    assert np.quantile(distance, 0.99) < PIXEL
    halves = (part(scan, 2.2, 3.1), part(scan, 3.1, 5))
    assert whole.update(iter(halves), max_memory=memory).n_points == wanted.n_points
    # What goes to disk is gone at the end.
    assert list(work.iterdir()) == []
    alone = whole.update(path, alone=True, max_memory=memory)
    assert alone.n_points == len(scan)
    assert set(tiles(alone)) == set(tiles(whole.update(scan, alone=True)))


def test_a_scan_on_disk_weighs_points_by_all_of_its_ranges(tmp_path: Path) -> None:
    """A point of the map counts as one of the whole scan does, not as those around it do."""
    u, v = np.meshgrid(np.arange(0, 2.4, 0.005), np.arange(0, 1.2, 0.005))
    flat = np.column_stack([u.ravel(), v.ravel(), np.zeros(u.size)])
    options: dict[str, Any] = {"resolution": PIXEL, "depth_step": 0.0625, "completeness": 0.0}
    sb.learn_patches_tiled(sb.PointCloud(flat), tmp_path / "map.sfb", tile=TILE, **options)
    model = sb.load(tmp_path / "map.sfb")
    ranges = np.where(flat[:, 0] < 1.2, 1.0, 4.0).astype(np.float32)
    scan = sb.PointCloud(flat + np.array([0, 0, 0.008]), ranges=ranges)
    one, other = (
        m.decode() for m in (model.update(scan), model.update(scan, max_memory=300 << 20))
    )
    for low, high in ((0.2, 1.0), (1.4, 2.2)):
        heights = [
            cloud.points[(cloud.points[:, 0] > low) & (cloud.points[:, 0] < high), 2].mean()
            for cloud in (one, other)
        ]
        assert heights[1] == pytest.approx(heights[0], abs=2e-4)


def wall_of_greys(seed: int, greys: Any, ranges: Any) -> sb.PointCloud:
    """A wall of 2 m with 40,000 points, with ranges by their places and greys by their ranges."""
    rng = np.random.default_rng(seed)
    n = 40_000
    points = np.column_stack(
        [rng.uniform(0, 2, n), rng.uniform(0, 1.5, n), rng.normal(0, 0.002, n)]
    )
    of_points = ranges(points)
    grey = np.broadcast_to(greys(of_points), n).astype(np.uint8)
    return sb.PointCloud(points, colors=np.stack([grey] * 3, axis=1), ranges=of_points)


def test_colours_are_means_of_points_whatever_their_ranges() -> None:
    def ranges(points: Any) -> Any:
        return np.where(np.arange(len(points)) % 2 == 0, 1.0, 4.0)

    # Half of the points are 60, seen from 1 m, half 180, from 4 m: near ones do not count for more.
    wall = wall_of_greys(0, lambda r: np.where(r > 2, 180, 60), ranges)
    decoded = sb.learn_patches(wall, resolution=0.02, color_step=4).decode()
    assert decoded.colors is not None
    assert decoded.colors.mean() == pytest.approx(120, abs=2)


def test_a_scan_changes_colours_alike_near_and_far(tmp_path: Path) -> None:
    def ranges(points: Any) -> Any:
        return 1 + 1.5 * points[:, 0]

    first, second = (
        wall_of_greys(seed, lambda _, g=grey: g, ranges) for seed, grey in ((1, 60), (2, 180))
    )
    path = tmp_path / "wall.sfb"
    sb.learn_patches_tiled(first, path, resolution=0.02, color_step=4, note=" ")
    model = sb.load(path)
    assert isinstance(model, sb.TiledPatchModel)
    decoded = model.update(second).decode()
    assert decoded.colors is not None
    quarters = np.floor(decoded.points[:, 0] / 0.5).clip(0, 3)
    means = [decoded.colors[quarters == q].mean() for q in range(4)]
    assert means == pytest.approx([120] * 4, abs=6)
    assert np.ptp(means) < 3


def test_what_a_scan_on_disk_needs(
    whole: sb.TiledPatchModel, cloud: sb.PointCloud, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InvalidInputError, match="max_memory is 1000"):
        whole.update(cloud, max_memory=1000)
    with monkeypatch.context() as patch:
        patch.setattr(_updating, "BASE_MEMORY", 287 << 20)
        with pytest.raises(InvalidInputError, match=r"max_memory is 0\.30e9 bytes, but a tile of"):
            whole.update(cloud, max_memory=288 << 20)
    with pytest.raises(InvalidInputError, match="the source has no points"):
        whole.update([cloud.select(np.zeros(0, int))], max_memory=300 << 20)
    with pytest.raises(InvalidInputError, match="cloud is one without colors"):
        whole.update([sb.PointCloud(cloud.points)], max_memory=300 << 20)
    with pytest.raises(InvalidInputError, match="work is"):
        whole.update(cloud, work="somewhere")
    with pytest.raises(InvalidTypeError, match="with max_memory another source"):
        whole.update("scan.ply")


def test_the_command_line_adds_scans_on_disk(
    whole: sb.TiledPatchModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, scan = str(tmp_path / "map.sfb"), str(tmp_path / "scan.ply")
    whole.save(path)
    sb.write(scan, part(room(1), 2.2, 5))
    out = str(tmp_path / "out.sfb")
    assert main(["append", path, scan, "--out", out, "--max-memory", "300M"]) in (None, 0)
    assert sb.load(out) == whole.update(scan, max_memory=300 << 20)
    for wrong, said in (
        (["--work", str(tmp_path)], "--work: needs --max-memory"),
        (["--max-memory", "much"], "--max-memory much"),
        (["--max-memory", "300M", "--unit", "mm"], "not together with --max-memory"),
    ):
        assert main(["append", path, scan, *wrong]) == 2
        assert said in capsys.readouterr().err
    assert main(["append", path, path, "--max-memory", "300M", "--out", out]) == 2
    assert "is a model" in capsys.readouterr().err
