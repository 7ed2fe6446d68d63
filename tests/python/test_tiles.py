"""Maps in tiles: a part of one is the same part of the whole, and workers make no difference."""

from __future__ import annotations

import io
import threading
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

import surfabet as sb
from surfabet import tiling
from surfabet._spill import Spill
from surfabet.cli import main
from surfabet.errors import FormatError, InvalidInputError
from test_format import Fields, sections

TILED = 1 << 1 | 1 << 3 | 1 << 7 | 1 << 12 | 1 << 13 | 1 << 15
"""Features of the page: lattice, attributes, tiles, whole numbers, borders, points by patterns."""
GOLDEN = Path(__file__).parents[1] / "golden"

PIXEL = 0.02
TILE = 1.28
OPTIONS: dict[str, Any] = {"resolution": PIXEL, "levels": 2}


def room(seed: int = 0) -> sb.PointCloud:
    """Floor, walls and a box of a room of 4 x 3 m, turned and far from zero, with noise of 3 mm,
    colours that change with the place, intensities and labels."""
    rng = np.random.default_rng(seed)

    def square(corner: Any, a: Any, b: Any, n: int) -> Any:
        s = rng.random((n, 2))
        normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
        at = np.array(corner, float) + s[:, :1] * np.array(a, float) + s[:, 1:] * np.array(b, float)
        return at + 0.003 * rng.standard_normal((n, 1)) * normal

    parts = [
        square([0, 0, 0], [4, 0, 0], [0, 3, 0], 60_000),
        square([0, 0, 0], [4, 0, 0], [0, 0, 1.4], 28_000),
        square([0, 0, 0], [0, 3, 0], [0, 0, 1.4], 21_000),
        square([1.2, 1, 0.7], [1, 0, 0], [0, 1, 0], 5_000),
        square([1.2, 1, 0], [1, 0, 0], [0, 0, 0.7], 3_500),
    ]
    local = np.concatenate(parts)
    waves = np.sin(local @ np.array([[3.0, 1, 0], [0, 2.5, 1], [1, 0, 4]]))
    turn = np.deg2rad(17)
    rotation = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    order = rng.permutation(len(local))
    return sb.PointCloud(
        (local @ rotation.T + [5000.0, -200.0, 40.0])[order],
        colors=(127 + 100 * waves).astype(np.uint8)[order],
        intensities=(100 + 50 * waves[:, 0]).astype(np.float32)[order],
        extra={"label": (local[:, 0] > 2).astype(np.uint8)[order]},
    )


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return room()


@pytest.fixture(scope="module")
def path(cloud: sb.PointCloud, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tiles") / "room.sfb"
    names = ["colors", "intensities", "label"]
    report = sb.learn_patches_tiled(cloud, path, tile=TILE, attributes=names, **OPTIONS)
    assert report.n_points == report.n_kept == len(cloud)
    return path


@pytest.fixture(scope="module")
def model(path: Path) -> sb.TiledPatchModel:
    model = sb.load(path)
    assert isinstance(model, sb.TiledPatchModel)
    return model


def same(a: sb.PointCloud, b: sb.PointCloud) -> bool:
    return a.attributes == b.attributes and all(
        np.array_equal(a[name], b[name]) for name in ["points", *a.attributes]
    )


def cropped(cloud: sb.PointCloud, box: Any) -> sb.PointCloud:
    low, high = np.array(box)
    return cloud.select(((cloud.points >= low) & (cloud.points <= high)).all(axis=1))


def test_points_and_bytes_add_up(model: sb.TiledPatchModel, cloud: sb.PointCloud) -> None:
    tiles = model.tiles
    assert len(tiles) >= 9
    assert model.n_points == tiles.points.sum() == len(cloud)
    assert abs(model.tile_side - TILE) <= 0.5 * 16 * PIXEL
    assert model.to_bytes() == sb.from_bytes(model.to_bytes()).to_bytes()
    assert set(model.attributes) == {"colors", "intensities", "label"}
    info = model.info
    assert info["tiles"] == len(tiles)
    assert info["patches"] == len(model)
    assert "tiles" in repr(model)


def test_a_map_in_tiles_is_as_near_as_one_without(
    model: sb.TiledPatchModel, cloud: sb.PointCloud
) -> None:
    whole = sb.learn_patches(cloud, **OPTIONS)
    for as_measured in (False, True):
        tiled, one = (m.decode(as_measured=as_measured) for m in (model, whole))
        a, b = sb.evaluate(cloud, tiled), sb.evaluate(cloud, one)
        assert a.rmse <= 1.05 * b.rmse
        # Nothing is there twice, and nothing is missing. How thick a patch is, which layers fill,
        # follows from prices that each tile learns by itself.
        assert abs(len(tiled) - len(one)) <= (0.06 if as_measured else 0.03) * len(one)


def test_labels_and_intensities_come_back(model: sb.TiledPatchModel, cloud: sb.PointCloud) -> None:
    again = model.decode()
    _, nearest = cKDTree(cloud.points).query(again.points)
    assert (again["label"] == cloud["label"][nearest]).mean() > 0.97
    assert again["label"].dtype == np.uint8
    off = again.intensities - cloud.intensities[nearest]
    assert np.sqrt((off**2).mean()) < 12


@st.composite
def boxes(draw: st.DrawFn) -> Any:
    corner = np.array([4999.0, -201.0, 39.5])
    low = corner + [draw(st.floats(0, size)) for size in (5.0, 6.0, 2.0)]
    return low, low + [draw(st.floats(0, 4.0)) for _ in range(3)]


@settings(max_examples=8, deadline=None)
@given(box=boxes(), as_measured=st.booleans(), normals=st.booleans())
def test_a_box_is_the_whole_cropped_point_for_point(
    model: sb.TiledPatchModel, path: Path, box: Any, as_measured: bool, normals: bool
) -> None:
    options: dict[str, Any] = {"as_measured": as_measured, "normals": normals, "resolution": 0.03}
    wanted = cropped(model.decode(**options), box)
    assert same(model.decode(box=box, **options), wanted)
    part = sb.load(path, box=box)
    assert same(part.decode(**options), wanted)
    # And again of what was written of the part, whose tiles may come in another order.
    if len(part.tiles):
        again = sb.from_bytes(part.to_bytes()).decode(box=box, **options)
        order = [np.lexsort(cloud.points.T) for cloud in (again, wanted)]
        assert np.array_equal(again.points[order[0]], wanted.points[order[1]])


def test_boxes_of_models_without_tiles(cloud: sb.PointCloud) -> None:
    box = ([5000, -200, 39.9], [5001, -199, 41])
    for one in (sb.learn_patches(cloud, **OPTIONS), sb.learn_gas(cloud, n_neurons=500)):
        whole = one.decode(normals=True)
        part = one.decode(box=box, normals=True)
        assert 0 < len(part) < len(whole)
        assert same(part, cropped(whole, box))
        # A limit is for what is decoded.
    patches = sb.learn_patches(cloud, **OPTIONS)
    n = len(patches.decode(box=box))
    assert len(patches.decode(box=box, max_points=20 * n)) == n


class Counting(io.BytesIO):
    """Counts the bytes that are read."""

    n_read = 0

    def read(self, size: int | None = -1) -> bytes:
        data = super().read(size)
        self.n_read += len(data)
        return data


def meeting(model: sb.TiledPatchModel, box: Any) -> int:
    """Bytes of the tiles whose boxes meet a box."""
    low, high = np.array(box)
    bounds = model.tiles.bounds
    meets = ((bounds[:, 0] <= high) & (bounds[:, 1] >= low)).all(axis=1)
    return int(model.tiles.bytes[meets].sum())


@pytest.fixture(scope="module")
def detailed(cloud: sb.PointCloud, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map whose tiles have many bytes, as those of large maps have."""
    path = tmp_path_factory.mktemp("tiles") / "detailed.sfb"
    sb.learn_patches_tiled(cloud, path, tile=TILE, color_step=1, color_rate=0.001, **OPTIONS)
    return path


def test_little_more_is_read_than_the_tiles_that_meet_the_box(detailed: Path) -> None:
    model, data = sb.load(detailed), detailed.read_bytes()
    middle = model.decode().points.mean(axis=0)
    for half in (0.1, 0.5, 1.0):
        box = (middle - half, middle + half)
        file = Counting(data)
        part = sb.load(file, box=box)
        assert same(part.decode(), model.decode(box=box))
        assert file.n_read <= 1.2 * meeting(model, box)


class RangeHandler(SimpleHTTPRequestHandler):
    """Serves parts of files, and counts what it sent."""

    sent = 0

    def do_GET(self) -> None:
        data = Path(self.directory, self.path.lstrip("/")).read_bytes()
        given = self.headers.get("Range")
        if given is None:
            self.send_response(200)
            part = data
        else:
            start, _, end = given.removeprefix("bytes=").partition("-")
            part = data[int(start) : int(end) + 1]
            self.send_response(206)
            self.send_header("Content-Range", f"bytes {start}-{end}/{len(data)}")
        type(self).sent += len(part)
        self.send_header("Content-Length", str(len(part)))
        self.send_header("Accept-Ranges", "bytes")
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, *_: Any) -> None:
        pass


def test_a_box_is_read_over_http(detailed: Path) -> None:
    pytest.importorskip("fsspec")
    pytest.importorskip("aiohttp")
    path, model = detailed, sb.load(detailed)

    def handler(*args: Any) -> RangeHandler:
        return RangeHandler(*args, directory=str(path.parent))

    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        url = f"http://127.0.0.1:{server.server_address[1]}/{path.name}"
        middle = model.decode().points.mean(axis=0)
        box = (middle - 0.5, middle + 0.5)
        RangeHandler.sent = 0
        part = sb.load(url, box=box)
        assert RangeHandler.sent <= 1.2 * meeting(model, box)
        assert same(part.decode(), model.decode(box=box))
        assert sb.load(url) == model
        with pytest.raises(OSError, match=r"nothing\.sfb"):
            sb.load(url.replace(path.name, "nothing.sfb"))
    finally:
        server.shutdown()
        server.server_close()


def test_what_boxes_and_levels_must_be(
    model: sb.TiledPatchModel, path: Path, cloud: sb.PointCloud, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match="nowhere above"):
        model.decode(box=([1, 0, 0], [0, 1, 1]))
    with pytest.raises(InvalidInputError, match=r"box is .*must be two corners"):
        sb.load(path, box=([1, 0], [0, 1]))
    with pytest.raises(InvalidInputError, match="level is 1, but must be from 0 to 0"):
        sb.load(path, level=1)
    with pytest.raises(InvalidInputError, match="level is -1"):
        model.decode(level=-1)
    assert same(model.decode(level=0), model.decode())
    one = tmp_path / "one.sfb"
    sb.learn_patches(cloud, **OPTIONS).save(one)
    with pytest.raises(InvalidInputError, match=r"box is .* the file has no tiles"):
        sb.load(one, box=([0, 0, 0], [1, 1, 1]))
    assert len(model.decode(box=([0, 0, 0], [1, 1, 1]))) == 0
    assert model.decode(box=([0, 0, 0], [1, 1, 1])).colors is not None
    everywhere = ([-np.inf] * 3, [np.inf] * 3)
    assert same(model.decode(box=everywhere), model.decode())


def across(model: sb.TiledPatchModel, again: sb.PointCloud) -> tuple[Any, Any]:
    """Steps of depth (m), of colour and of intensity from points on the floor of the room to the
    nearest ones half a pixel further along an axis of the lattice: over borders of tiles, and
    inside."""
    local = (again.points - model.origin) @ model.rotation
    cubes = np.floor(local / PIXEL).astype(int)
    vertical = int(np.argmax(np.abs(model.rotation[2])))
    floor = np.abs(again.points[:, 2] - 40.0) < 0.01
    own = np.flatnonzero(floor)
    tree = cKDTree(local[own])
    side = round(model.tile_side / PIXEL)
    bounds = model.tiles
    assert len(bounds) > 1
    found: dict[bool, list[Any]] = {True: [], False: []}
    for axis in [a for a in range(3) if a != vertical]:
        step = np.zeros(3)
        step[axis] = 0.5 * PIXEL
        distance, nearest = tree.query(local[own] + step)
        near = distance < 0.2 * PIXEL
        first, second = own[near], own[nearest[near]]
        # The borders are where most points change their tile: known by the corner of the cubes.
        offset = round(model.tile_corner[axis] / PIXEL)
        crosses = (cubes[first, axis] - offset) // side != (cubes[second, axis] - offset) // side
        depth = np.abs(local[first, vertical] - local[second, vertical])
        color = np.abs(again.colors[first].astype(float) - again.colors[second]).mean(axis=1)
        intensity = np.abs(again.intensities[first] - again.intensities[second])
        for which in (True, False):
            chosen = crosses == which
            steps = np.column_stack([depth, color, intensity])
            found[which].append(steps[chosen])
    return tuple(np.concatenate(found[which]) for which in (True, False))


class Page(Fields):
    """Fields of the page that the other reader does not need."""

    def signed(self) -> int:
        code = self.varint()
        return code >> 1 if code % 2 == 0 else -(code >> 1) - 1

    def doubles(self, n: int) -> list[float]:
        return [self.f64() for _ in range(n)]


def read_details(fields: Any) -> list[dict[str, Any]]:
    """The levels of detail of the page (5.7), of a file with attributes."""
    details = []
    for _ in range(fields.varint()):
        detail: dict[str, Any] = {"n_points": fields.varint(), "start": fields.at}
        fields.doubles(3)
        [fields.signed() for _ in range(4)]
        detail["pixel"], detail["levels"] = fields.doubles(1)[0], fields.varint()
        fields.varint()
        assert fields.varint() == 0
        [fields.varint() for _ in range(2)]
        assert fields.varint() == 0
        fields.doubles(2)
        detail["attributes"] = fields.varint()
        for _ in range(detail["attributes"]):
            [fields.varint() for _ in range(fields.varint())]
            fields.varint()
            labels = fields.varint()
            if labels:
                [fields.signed() for _ in range(labels)]
            else:
                fields.doubles(3)
        details.append(detail)
    return details


def test_surfaces_go_on_across_borders(model: sb.TiledPatchModel) -> None:
    borders, inside = across(model, model.decode(resolution=0.5 * PIXEL))
    assert len(borders) > 200
    assert np.quantile(borders[:, 0], 0.99) <= max(0.005, 1.1 * np.quantile(inside[:, 0], 0.99))
    # Colours and intensities, which change with the place: half a pixel further by so much.
    for column in (1, 2):
        assert 0.5 < borders[:, column].mean() / inside[:, column].mean() <= 2.5


def test_maps_from_before_corrections_at_borders_stay_as_they_were(tmp_path: Path) -> None:
    """Its listing is of the version that wrote it: positions, colours, intensities."""
    data = (GOLDEN / "patches_tiles.sfb").read_bytes()
    model = sb.from_bytes(data)
    assert isinstance(model, sb.TiledPatchModel)
    assert model.to_bytes() == data
    decoded = model.decode(0.2)
    listed = np.loadtxt(GOLDEN / "patches_tiles.txt")
    np.testing.assert_allclose(decoded.points - model.origin, listed[:, :3], atol=2e-5)
    np.testing.assert_allclose(decoded.colors, listed[:, 3:6], atol=1)
    np.testing.assert_allclose(decoded.intensities, listed[:, 6], rtol=1e-4, atol=1e-3)
    # Put together again they are what they were; learned on, they have tiles of today, with colours
    # that are coded as theirs, without estimates.
    assert sb.merge_tiles([model, model]) == model
    updated = model.update(model.decode(as_measured=True))
    assert sections(updated.to_bytes(), TILED & ~(1 << 12 | 1 << 15) | 1 << 11)
    assert len(updated.decode()) > 0.9 * len(model.decode())
    both = sb.merge_tiles([model, updated])
    assert both.n_points >= model.n_points
    assert sb.from_bytes(both.to_bytes()) == both


def test_a_tile_decodes_alone(model: sb.TiledPatchModel) -> None:
    """The index and the tiles as the page has them (5.7): what a tile decodes to follows from the
    header, its entry and its bytes."""
    data = model.to_bytes()
    found = sections(data, TILED)
    assert list(found) == ["META", "TIDX", "plan", "TILE"]
    meta = Page(found["META"])
    (detail,) = read_details(meta)
    side = meta.varint()
    assert side * detail["pixel"] == pytest.approx(model.tile_side)
    corner = [meta.varint() * detail["pixel"] for _ in range(3)]
    assert corner == pytest.approx(model.tile_corner.tolist())
    assert meta.at == len(found["META"])
    index = Page(found["TIDX"])
    n = index.varint()
    low = [index.signed() for _ in range(3)]
    place, offset, clouds = -1, 0, []
    for i in range(n):
        place += index.varint() + 1
        cube = [sum((place >> 3 * b + a & 1) << b for b in range(21)) for a in range(3)]
        assert model.tiles.cubes[i].tolist() == [c + at for c, at in zip(cube, low, strict=True)]
        n_points, size = index.varint(), index.varint()
        checksum = index.bytes(4)
        box = index.at
        [index.signed() for _ in range(3)]
        [index.varint() for _ in range(3)]
        tile = found["TILE"][offset : offset + size]
        offset += size
        assert (n_points, size) == (model.tiles.points[i], model.tiles.bytes[i])
        assert int.from_bytes(checksum, "little") == crc32c(tile)
        entry = b"".join(signed(c) for c in model.tiles.cubes[i].tolist()) + varint(0)
        entry += varint(n_points) + varint(size) + checksum + found["TIDX"][box : index.at]
        own = varint(1) + varint(n_points) + found["META"][detail["start"] :]
        parts = {"META": own, "TIDX": varint(1) + entry, "TILE": tile}
        clouds.append(together(parts).decode())
    assert offset == len(found["TILE"])
    assert index.at == len(found["TIDX"])
    whole = model.decode()
    points = np.concatenate([c.local_points for c in clouds])
    assert np.array_equal(points, whole.local_points)
    assert np.array_equal(np.concatenate([c.colors for c in clouds]), whole.colors)


def crc32c(data: bytes) -> int:
    """The checksum of the page."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def varint(value: int) -> bytes:
    out = bytearray()
    while value >= 128:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


def signed(value: int) -> bytes:
    return varint(2 * value if value >= 0 else -2 * value - 1)


def together(parts: dict[str, bytes]) -> Any:
    """The model of a file of these sections, put together by the page."""
    head = b"\x89SFB\x01\x00\x01\x02" + varint(TILED) + varint(len(parts))
    for tag, part in parts.items():
        head += tag.encode() + varint(len(part)) + crc32c(part).to_bytes(4, "little")
    head += crc32c(head).to_bytes(4, "little")
    return sb.from_bytes(head + b"".join(parts.values()))


def test_damaged_files_are_named(path: Path) -> None:
    data = path.read_bytes()
    for cut in (3, 40, 300, len(data) // 2, len(data) - 1):
        with pytest.raises(FormatError):
            sb.from_bytes(data[:cut])
    with pytest.raises(FormatError):
        sb.from_bytes(data + b"\0")
    rng = np.random.default_rng(0)
    for at in [*range(0, 400, 7), *rng.integers(0, len(data), 60).tolist()]:
        flipped = bytearray(data)
        flipped[at] ^= 1 << int(rng.integers(8))
        try:
            sb.from_bytes(bytes(flipped)).decode()
        except FormatError:
            continue
        # What is skipped: the note, and the checksum of all tiles, which each has for itself.
        assert sb.from_bytes(bytes(flipped)) == sb.from_bytes(data)


def test_the_same_bytes_for_any_workers_and_order(
    cloud: sb.PointCloud, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for n in (0, 1, 2, 8):
        path = tmp_path / f"{n}.sfb"
        options: dict[str, Any] = {"tile": TILE, **OPTIONS}
        if n == 0:
            sb.learn_patches_tiled(cloud, path, **options)
        else:
            with ThreadPoolExecutor(n) as executor:
                sb.learn_patches_tiled(cloud, path, executor=executor, workers=n, **options)
        found.append(path.read_bytes())
    assert found[0] == found[1]
    # Workers share the memory, which here is enough for all.
    assert found[1] == found[2] == found[3]
    monkeypatch.setattr(tiling, "sorted", lambda x, **_: list(reversed(list(x))), raising=False)
    sb.learn_patches_tiled(cloud, tmp_path / "back.sfb", tile=TILE, **OPTIONS)
    assert (tmp_path / "back.sfb").read_bytes() == found[0]


def test_tiles_are_put_together_in_any_order(
    cloud: sb.PointCloud, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learn, made = tiling.learn_tile, []

    def kept(*args: Any, **kwargs: Any) -> Any:
        made.append(learn(*args, **kwargs))
        return made[-1]

    monkeypatch.setattr(tiling, "learn_tile", kept)
    sb.learn_patches_tiled(cloud, tmp_path / "map.sfb", tile=TILE, **OPTIONS)
    model = sb.load(tmp_path / "map.sfb")
    tiles = [sb.from_bytes(data) for data in made if data is not None]
    assert sb.merge_tiles(tiles) == sb.merge_tiles(tiles[::-1]) == model
    # Associative.
    halves = [sb.merge_tiles(tiles[i::2]) for i in (1, 0)]
    assert sb.merge_tiles(halves).to_bytes() == model.to_bytes()
    # What is the same in several is there once.
    assert sb.merge_tiles([halves[0], model]) == model
    # Files are as good as what they hold.
    paths = [tmp_path / "first.sfb", tmp_path / "second.sfb"]
    for half, path in zip(halves, paths, strict=True):
        half.save(path)
    assert sb.merge_tiles([paths[0], str(paths[1])]).to_bytes() == model.to_bytes()
    assert sb.merge_tiles([halves[0], paths[1]]) == model
    with pytest.raises(InvalidInputError, match="empty"):
        sb.merge_tiles([])
    other = tmp_path / "other.sfb"
    sb.learn_patches_tiled(cloud, other, tile=2.0, resolution=0.03)
    with pytest.raises(InvalidInputError, match=r"models is .*made with one plan"):
        sb.merge_tiles([halves[0], sb.load(other)])
    with pytest.raises(FileNotFoundError, match=r"none\.sfb"):
        sb.merge_tiles([halves[0], tmp_path / "none.sfb"])
    sb.learn_patches(cloud, resolution=0.1).save(other)
    with pytest.raises(InvalidInputError, match=r"^models\[1\] is .*other\.sfb', but must be a"):
        sb.merge_tiles([halves[0], other])
    with pytest.raises(sb.InvalidTypeError, match=r"^models\[0\] is 3, but must be a TiledPatch"):
        sb.merge_tiles([3])  # type: ignore[list-item]


class Dies(ThreadPoolExecutor):
    """Some of its workers die, each with one tile."""

    def __init__(self, which: tuple[int, ...], error: type[Exception]) -> None:
        super().__init__(1)
        self.which, self.error, self.n = which, error, 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.n += 1
        if self.n in self.which:
            future: Future[Any] = Future()
            future.set_exception(self.error("lost"))
            return future
        return super().submit(fn, *args, **kwargs)


def test_the_tile_of_a_worker_that_died_is_learned_once_more(
    cloud: sb.PointCloud, tmp_path: Path
) -> None:
    whole = tmp_path / "whole.sfb"
    sb.learn_patches_tiled(cloud, whole, tile=TILE, **OPTIONS)
    path = tmp_path / "map.sfb"
    with Dies((2, 5), RuntimeError) as executor:
        sb.learn_patches_tiled(cloud, path, tile=TILE, executor=executor, **OPTIONS)
    assert path.read_bytes() == whole.read_bytes()
    with Dies((3,), BrokenExecutor) as executor, pytest.warns(RuntimeWarning, match="worker died"):
        sb.learn_patches_tiled(cloud, path, tile=TILE, executor=executor, **OPTIONS)
    assert path.read_bytes() == whole.read_bytes()
    with Dies((3, 4), RuntimeError) as executor, pytest.raises(RuntimeError, match="lost"):
        sb.learn_patches_tiled(cloud, path, tile=TILE, executor=executor, **OPTIONS)


class Killed(BaseException):
    """Stands for a signal."""


def test_a_run_that_was_stopped_goes_on(
    cloud: sb.PointCloud, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "room.ply"
    sb.write(source, cloud)
    whole = tmp_path / "whole.sfb"
    first = sb.learn_patches_tiled(source, whole, tile=TILE, **OPTIONS)
    assert first.n_learned >= first.n_tiles
    path = tmp_path / "map.sfb"
    learn, calls = tiling.learn_tile, []

    def dies(*args: Any, **kwargs: Any) -> Any:
        calls.append(args[1])
        if len(calls) == 12:
            raise Killed
        return learn(*args, **kwargs)

    monkeypatch.setattr(tiling, "learn_tile", dies)
    with pytest.raises(Killed):
        sb.learn_patches_tiled(source, path, tile=TILE, **OPTIONS)
    assert not path.exists()
    assert (tmp_path / "map.sfb.work" / "manifest.json").exists()
    monkeypatch.setattr(tiling, "learn_tile", learn)
    done = len(list((tmp_path / "map.sfb.work" / "tiles").glob("*.sfb")))
    # But for the tiles of the other threads.
    assert 11 - (sb.get_num_threads() - 1) <= done < 12
    second = sb.learn_patches_tiled(source, path, tile=TILE, **OPTIONS)
    assert second.n_learned == first.n_learned - done
    assert path.read_bytes() == whole.read_bytes()
    assert not (tmp_path / "map.sfb.work").exists()


def test_other_arguments_start_anew(
    cloud: sb.PointCloud, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "room.ply"
    sb.write(source, cloud)
    path = tmp_path / "map.sfb"

    def dies(*_: Any, **__: Any) -> Any:
        raise Killed

    with monkeypatch.context() as patched:
        patched.setattr(tiling, "learn_tile", dies)
        with pytest.raises(Killed):
            sb.learn_patches_tiled(source, path, tile=TILE, **OPTIONS)
    report = sb.learn_patches_tiled(source, path, tile=2 * TILE, **OPTIONS)
    assert report.n_learned >= report.n_tiles
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.txt").write_text("keep me")
    with pytest.raises(InvalidInputError, match="holds other things"):
        sb.learn_patches_tiled(source, path, work=other, **OPTIONS)
    assert (other / "thesis.txt").read_text() == "keep me"


def test_chunks_make_no_difference_beyond_their_order(cloud: sb.PointCloud, tmp_path: Path) -> None:
    thirds = [cloud.select(np.arange(i, len(cloud), 3)) for i in range(3)]
    report = sb.learn_patches_tiled(iter(thirds), tmp_path / "map.sfb", tile=TILE, **OPTIONS)
    assert report.n_points == report.n_kept == len(cloud)
    again = sb.load(tmp_path / "map.sfb").decode(as_measured=True)
    assert sb.evaluate(cloud, again).rmse < 0.01


def test_attributes_that_some_parts_lack_are_named(cloud: sb.PointCloud, tmp_path: Path) -> None:
    bare = sb.PointCloud(cloud.points[:1000])
    with pytest.warns(sb.LostAttributeWarning, match="colors, intensities"):
        sb.learn_patches_tiled(iter([cloud, bare]), tmp_path / "a.sfb", **OPTIONS)
    assert not sb.load(tmp_path / "a.sfb").has_color


def test_normals_ranges_and_viewpoints_are_named_as_not_kept(tmp_path: Path) -> None:
    """They are used, for the sides of surfaces, but are not in the map; as without tiles."""
    x, y = (side.ravel() for side in np.meshgrid(np.arange(0, 1.3, 0.02), np.arange(0, 1.3, 0.02)))
    floor = np.stack([x, y, 0 * x], axis=1)
    up = np.tile(np.float32([0, 0, 1]), (len(floor), 1))
    cloud = sb.PointCloud(floor, normals=up).seen_from([0.5, 0.5, 1.0])
    report = sb.learn_patches_tiled(cloud, tmp_path / "map.sfb", tile=1.28, resolution=0.02)
    assert set(report.not_kept) == {"normals", "ranges", "viewpoints"}
    assert set(report.not_kept) == set(sb.learn_patches(cloud, resolution=0.02).report.not_kept)


def test_the_command_line_tells_the_side_and_where_to_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    x, y = (side.ravel() for side in np.meshgrid(np.arange(0, 1.3, 0.02), np.arange(0, 1.3, 0.02)))
    source, path = tmp_path / "floor.ply", tmp_path / "map.sfb"
    sb.write(source, sb.PointCloud(np.stack([x, y, 0 * x], axis=1)))
    arguments = ["compress", str(source), str(path), "--resolution", "0.02", "--tile"]

    def stopped(job: tiling.TileJob, stop: Any = None) -> str:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(tiling, "run_job", stopped)
        assert main([*arguments, "1.3"]) == 130
    told = capsys.readouterr().err
    assert f"{path}.work keeps what is done; the same command goes on from there" in told
    assert Path(f"{path}.work").is_dir()
    assert main([*arguments, "1.3"]) == 0
    assert not Path(f"{path}.work").exists()
    assert "tile 1.3 rounded to 1.28 m" in capsys.readouterr().out
    assert main([*arguments, "1.28"]) == 0
    assert "rounded" not in capsys.readouterr().out


def test_points_far_from_all_others_are_named(cloud: sb.PointCloud, tmp_path: Path) -> None:
    far = sb.PointCloud([[90_000.0, 0.0, 0.0]])
    everything = iter([sb.PointCloud(cloud.points), far])
    path = tmp_path / "map.sfb"
    with pytest.warns(sb.DroppedPointsWarning, match="1 points are far"):
        report = sb.learn_patches_tiled(everything, path, tile=TILE, **OPTIONS)
    assert report.n_points == len(cloud) + 1
    assert report.n_kept == len(cloud)
    assert report.left_out == 1


def test_a_bound_holds_across_borders(tmp_path: Path) -> None:
    cloud = sb.PointCloud(room(3).points[::4])
    bound = 0.015
    path = tmp_path / "map.sfb"
    sb.learn_patches_tiled(cloud, path, tile=TILE, max_error=bound, **OPTIONS)
    model = sb.load(path)
    assert model.max_error == bound
    again = model.decode(as_measured=True)
    distance, _ = cKDTree(again.points).query(cloud.points)
    assert distance.max() <= bound


def test_what_tiles_and_memory_must_be(cloud: sb.PointCloud, tmp_path: Path) -> None:
    path = tmp_path / "map.sfb"
    with pytest.raises(InvalidInputError, match=r"tile is 0\.1, but must be from 1\.28"):
        sb.learn_patches_tiled(cloud, path, tile=0.1, **OPTIONS)
    # So small that no point would be within a million of its parts.
    with pytest.raises(InvalidInputError, match=r"tile is 0\.000001, but must be from 1\.28"):
        sb.learn_patches_tiled(cloud, path, tile=1e-6, **OPTIONS)
    with pytest.raises(InvalidInputError, match="max_memory is 1000"):
        sb.learn_patches_tiled(cloud, path, max_memory=1000, **OPTIONS)
    with pytest.raises(InvalidInputError, match="levels is 9"):
        sb.learn_patches_tiled(cloud, path, levels=9)
    with pytest.raises(InvalidInputError, match="no points"):
        sb.learn_patches_tiled(iter([]), path, **OPTIONS)
    with pytest.raises(InvalidInputError, match="source is 3, but must be a cloud"):
        sb.learn_patches_tiled(3, path, **OPTIONS)
    with pytest.raises(FileNotFoundError):
        sb.learn_patches_tiled(tmp_path / "nothing.las", path)
    assert [p for p in tmp_path.iterdir() if p != path] == []


@pytest.mark.parametrize("n", [1, 50])
def test_points_at_one_place_are_a_map_as_without_tiles(n: int, tmp_path: Path) -> None:
    one = sb.PointCloud([[1.25, 2.5, 3.75]] * n)
    report = sb.learn_patches_tiled(one, tmp_path / "one.sfb", tile=2.0)
    assert (report.n_kept, report.n_tiles) == (n, 1)
    assert report.chosen == sb.learn_patches(one).report.chosen
    decoded = sb.load(tmp_path / "one.sfb").decode()
    assert np.linalg.norm(decoded.points - one.points[0], axis=1).max() < 4 * 0.01


def test_a_source_that_is_out_of_reach_is_named(tmp_path: Path) -> None:
    """Two dense groups 1400 km apart, with nothing in the middle between them."""
    group = 0.01 * np.random.default_rng(0).random((1000, 3))
    apart = sb.PointCloud(np.concatenate([group - 4e5, group + 4e5]))
    with pytest.raises(InvalidInputError, match="all 2,000 points of the source are further than"):
        sb.learn_patches_tiled(apart, tmp_path / "map.sfb")


def test_tiles_are_made_small_enough_for_the_memory(
    cloud: sb.PointCloud, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tiling, "BASE_MEMORY", 1 << 20)
    monkeypatch.setattr(tiling, "LEAST_MEMORY", 1 << 20)
    monkeypatch.setattr(tiling, "_BRICK_SPACINGS", 20)
    monkeypatch.setattr(Spill, "bytes_per_point", 200)
    most = (1 << 20) + 200 * 105_000
    path = tmp_path / "map.sfb"
    report = sb.learn_patches_tiled(cloud, path, max_memory=most, **OPTIONS)
    assert report.tile < 1536 * PIXEL
    assert report.n_kept == len(cloud)
    with pytest.raises(InvalidInputError, match=r"tile is 30, but a tile of .* takes"):
        sb.learn_patches_tiled(cloud, path, tile=30, max_memory=most, **OPTIONS)


def test_the_command_line_learns_and_reads_parts(
    cloud: sb.PointCloud, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, path, part = (str(tmp_path / name) for name in ("room.ply", "map.sfb", "part.ply"))
    sb.write(source, cloud)
    assert main(["compress", source, path, "--tile", "1.28", "--resolution", "0.02"]) in (None, 0)
    assert "tiles of 1.28 m" in capsys.readouterr().out
    corners = ["5000", "-200", "39.9", "5001", "-199", "41"]
    assert main(["decompress", path, part, "--box", *corners]) in (None, 0)
    box = ([5000, -200, 39.9], [5001, -199, 41])
    assert len(sb.read(part)) == len(sb.load(path).decode(box=box)) > 0
    capsys.readouterr()
    assert main(["info", path]) in (None, 0)
    out = capsys.readouterr().out
    assert "index of the tiles" in out
    assert "side of a tile (m)" in out
    assert main(["evaluate", source, path]) in (None, 0)


def wall(path: Path, crs: str = "") -> Path:
    """A LAS file of a wall, with classes, in the units of a reference system."""
    laspy = pytest.importorskip("laspy")
    u, v = np.meshgrid(np.arange(0, 2, 0.01), np.arange(0, 1, 0.01))
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, 0.001)
    if crs:
        header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", crs.encode() + b"\0"))
    data = laspy.LasData(header)
    data.x, data.y, data.z = u.ravel(), 1 + 0 * u.ravel(), v.ravel()
    data.classification = np.full(u.size, 6)
    data.return_number = data.number_of_returns = np.ones(u.size, np.uint8)
    data.write(str(path))
    return path


FOOT = 'PROJCS["a",UNIT["US survey foot",0.304800609601219]]'


@pytest.mark.parametrize(("crs", "unit"), [("", "m"), (FOOT, "us-ft")])
def test_the_command_line_names_units_and_what_is_not_kept(
    crs: str, unit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("lazrs")
    source, path = str(wall(tmp_path / "a.las", crs)), str(tmp_path / "a.sfb")
    arguments = ["compress", source, path, "--tile", "1.28", "--resolution", "0.02"]
    assert main(arguments) in (None, 0)
    told = capsys.readouterr()
    assert f"of 1.28 {unit}," in told.out
    said = " ".join(told.err.split())
    assert "does not keep classification" in said
    assert ("US survey foot" in said) == bool(crs)
    assert main([*arguments, "--attributes", "classification"]) in (None, 0)
    assert "does not keep" not in capsys.readouterr().err
    report = sb.learn_patches_tiled(source, path, tile=1.28, resolution=0.02)
    assert (report.not_kept, report.unit) == (("classification",), unit)
