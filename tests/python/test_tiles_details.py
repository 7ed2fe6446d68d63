"""Levels of detail of maps in tiles: the coarsest stands first and is read alone."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from surfabet.cli import main
from surfabet.errors import InvalidInputError
from test_format import sections
from test_tiles import OPTIONS, PIXEL, TILE, TILED, room, same

NAMES = ["colors", "intensities", "label"]


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return room()


@pytest.fixture(scope="module")
def path(cloud: sb.PointCloud, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("details") / "room.sfb"
    options: dict[str, Any] = {"tile": TILE, "attributes": NAMES, **OPTIONS}
    report = sb.learn_patches_tiled(cloud, path, details=2, **options)
    assert report.n_kept == len(cloud)
    return path


def loaded(path: Path, **part: Any) -> sb.TiledPatchModel:
    model = sb.load(path, **part)
    assert isinstance(model, sb.TiledPatchModel)
    return model


class Front(io.BytesIO):
    """Counts the bytes that are read, and how far into the file they reach."""

    n_read = 0
    end = 0

    def read(self, size: int | None = -1) -> bytes:
        data = super().read(size)
        self.n_read += len(data)
        self.end = max(self.end, self.tell())
        return data


def test_the_first_bytes_of_the_file_are_the_coarsest_level(path: Path) -> None:
    data = path.read_bytes()
    fine = loaded(path)
    n_fine = int(fine.tiles.bytes.sum())
    file = Front(data)
    coarse = sb.load(file, level=0)
    n_coarse = int(coarse.tiles.bytes.sum())
    assert len(sections(data, TILED)["TILE"]) == n_coarse + n_fine
    # Nothing of the fine tiles; of the rest at most what is read first a second time.
    assert file.end <= len(data) - n_fine
    assert file.n_read <= len(data) - n_fine + 512
    assert 0 < n_coarse < 0.5 * n_fine
    # A box of it likewise.
    middle = coarse.decode().points.mean(axis=0)
    box = (middle - 0.5, middle + 0.5)
    file = Front(data)
    part = sb.load(file, level=0, box=box)
    assert file.end <= len(data) - n_fine
    assert same(part.decode(), coarse.decode(box=box))
    assert same(part.decode(), fine.decode(level=0, box=box))


def test_each_level_is_a_map_of_the_whole(path: Path, cloud: sb.PointCloud) -> None:
    model = loaded(path)
    assert model.pixel_sizes == pytest.approx((4 * PIXEL, PIXEL))
    coarse, fine = model.decode(level=0), model.decode(level=1)
    assert same(fine, model.decode())
    assert 4 * len(coarse) < len(fine)
    errors = [sb.evaluate(cloud, again).rmse for again in (coarse, fine)]
    # A surface is decoded at half of its pixels.
    assert errors[1] < errors[0] < 2 * PIXEL
    for again in (coarse, fine):
        assert set(again.attributes) >= set(NAMES)
    # Points are counted once per level.
    assert loaded(path, level=0).n_points == model.n_points == len(cloud)
    info = model.info
    assert info["levels of detail"] == 2
    assert info["level 0: resolution (m)"] == pytest.approx(4 * PIXEL)


@pytest.mark.parametrize("level", [0, 1])
def test_a_level_does_not_replace_the_map_with_the_others(
    path: Path, tmp_path: Path, level: int
) -> None:
    copy = tmp_path / "map.sfb"
    copy.write_bytes(path.read_bytes())
    one = loaded(copy, level=level)
    n = sum(len(loaded(path, level=k).tiles) for k in (0, 1))
    with pytest.raises(InvalidInputError, match=f"only {len(one.tiles)} of {n} tiles were loaded"):
        one.save(copy)
    assert copy.read_bytes() == path.read_bytes()


def test_one_level_is_as_without_the_option(cloud: sb.PointCloud, tmp_path: Path) -> None:
    options: dict[str, Any] = {"tile": TILE, "note": "none", **OPTIONS}
    for name, details in (("a", {}), ("b", {"details": 1})):
        sb.learn_patches_tiled(cloud, tmp_path / name, **details, **options)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_updates_and_merges_keep_all_levels(path: Path, cloud: sb.PointCloud) -> None:
    model = loaded(path)
    scan = room(1)
    scan = scan.select(scan.points[:, 0] > 4999 + 3)
    updated = model.update(scan)
    assert updated.pixel_sizes == model.pixel_sizes
    assert updated.n_points == len(cloud) + len(scan)
    same_cubes: list[set[tuple[int, ...]]] = []
    for level in (0, 1):
        before, after = (levels(m, level) for m in (model, updated))
        assert set(before) <= set(after)
        kept = {cube for cube in before if after[cube] == before[cube]}
        assert 0 < len(kept) < len(before)
        same_cubes.append(kept)
        again = updated.decode(level=level)
        assert sb.evaluate(cloud, again).rmse < (2 * PIXEL if level == 0 else PIXEL)
    # A tile that is learned again is so at all levels.
    assert same_cubes[0] == same_cubes[1]
    assert sb.merge_tiles([model, model]).to_bytes() == model.to_bytes()
    merged = sb.merge_tiles([model, model.update(scan, alone=True)])
    assert merged.pixel_sizes == model.pixel_sizes
    for part in ({"level": 0}, {"box": ([4999, -201, 39], [5001, -199, 41])}):
        with pytest.raises(InvalidInputError, match="loaded with one level of detail"):
            loaded(path, **part).update(scan)


def levels(model: sb.TiledPatchModel, level: int) -> dict[tuple[int, ...], bytes]:
    """The bytes of the tiles of a level, by their cubes."""
    data = model.to_bytes()
    tiles = loaded_bytes(data, level).tiles
    whole = sections(data, TILED)["TILE"]
    sizes = tiles.bytes.astype(np.int64)
    first = 0 if level == 0 else len(whole) - int(sizes.sum())
    ends = first + np.cumsum(sizes)
    return {
        tuple(cube): whole[end - size : end]
        for cube, size, end in zip(tiles.cubes.tolist(), sizes, ends, strict=True)
    }


def loaded_bytes(data: bytes, level: int) -> sb.TiledPatchModel:
    model = sb.load(io.BytesIO(data), level=level)
    assert isinstance(model, sb.TiledPatchModel)
    return model


def test_levels_are_one_to_three(cloud: sb.PointCloud, tmp_path: Path) -> None:
    for details in (0, 4, True, 1.5):
        with pytest.raises(InvalidInputError, match=r"details is .* from 1 to 3"):
            sb.learn_patches_tiled(cloud, tmp_path / "map.sfb", details=details)  # type: ignore[arg-type]
    sb.learn_patches_tiled(cloud, tmp_path / "map.sfb", details=3, **OPTIONS)
    model = loaded(tmp_path / "map.sfb")
    assert model.pixel_sizes == pytest.approx((16 * PIXEL, 4 * PIXEL, PIXEL))
    with pytest.raises(InvalidInputError, match="level is 3, but must be from 0 to 2"):
        model.decode(level=3)


def test_the_command_line_writes_and_reads_levels(
    cloud: sb.PointCloud, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, path, part = (str(tmp_path / name) for name in ("room.ply", "map.sfb", "part.ply"))
    sb.write(source, cloud)
    options = ["--tile", "1.28", "--resolution", "0.02", "--details", "2"]
    assert main(["compress", source, path, *options]) in (None, 0)
    assert main(["decompress", path, part, "--level", "0"]) in (None, 0)
    assert len(sb.read(part)) == len(loaded(Path(path)).decode(level=0))
    capsys.readouterr()
    assert main(["compress", source, path, "--details", "2"]) not in (None, 0)
    assert "--details: needs --tile" in capsys.readouterr().err
