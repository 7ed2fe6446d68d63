"""Files that are read are not replaced by what is made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import surfabet as sb
from surfabet.cli import main
from surfabet.errors import InvalidInputError


def strip() -> sb.PointCloud:
    """A wall of 4 x 1 m."""
    u, v = np.meshgrid(np.arange(0, 4, 0.02), np.arange(0, 1, 0.02))
    return sb.PointCloud(np.stack([u.ravel(), 0 * u.ravel(), v.ravel()], axis=1))


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    path = tmp_path / "scan.ply"
    sb.write(path, strip())
    return path


@pytest.fixture
def map_(scan: Path) -> Path:
    path = scan.parent / "map.sfb"
    sb.learn_patches_tiled(scan, path, tile=1.0, resolution=0.01)
    return path


def test_a_scan_is_not_replaced_by_its_map(scan: Path) -> None:
    before = scan.read_bytes()
    for name in (scan, scan.parent / ".." / scan.parent.name / scan.name):
        with pytest.raises(InvalidInputError, match=r"path is .* another file than the source"):
            sb.learn_patches_tiled(scan, name)
    assert scan.read_bytes() == before


def test_a_model_is_not_saved_over_what_is_none(scan: Path, map_: Path) -> None:
    before = scan.read_bytes()
    for model in (sb.learn_patches(strip()), sb.load(map_)):
        with pytest.raises(
            InvalidInputError, match=r"path is .*scan\.ply', but must be a new file"
        ):
            model.save(scan)
    assert scan.read_bytes() == before
    # An empty file, as tempfile makes it, and a model are.
    target = scan.parent / "new.sfb"
    target.touch()
    for _ in range(2):
        sb.learn_patches(strip()).save(target)
    assert len(sb.load(target)) > 0


def test_a_part_is_not_saved_over_its_map_by_way_of_a_merge(map_: Path) -> None:
    before = map_.read_bytes()
    part = sb.load(map_, box=((0, -1, 0), (0.5, 1, 1)))
    assert isinstance(part, sb.TiledPatchModel)
    merged = sb.merge_tiles([part])
    with pytest.raises(InvalidInputError, match="the others would be lost"):
        merged.save(map_)
    assert map_.read_bytes() == before
    merged.save(map_.parent / "part.sfb")
    whole = sb.load(map_)
    assert isinstance(whole, sb.TiledPatchModel)
    # A whole map may be.
    sb.merge_tiles([whole]).save(map_)
    assert sb.load(map_) == whole


def test_a_page_replaces_neither_the_model_nor_the_scan(scan: Path, map_: Path) -> None:
    before = scan.read_bytes(), map_.read_bytes()
    with pytest.raises(InvalidInputError, match="another file than those that are read"):
        sb.view(map_, map_)
    with pytest.raises(InvalidInputError, match="another file than those that are read"):
        sb.view(map_, scan, against=scan)
    assert (scan.read_bytes(), map_.read_bytes()) == before


def test_what_a_scan_shows_alone_does_not_replace_the_map(
    scan: Path, map_: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = map_.read_bytes()
    assert main(["append", str(map_), str(scan), "--alone", "--out", str(map_)]) == 2
    assert "--alone: needs --out with another file" in capsys.readouterr().err
    assert map_.read_bytes() == before


@pytest.mark.parametrize("name", ["resolution", "max_error", "max_error_forward"])
def test_lengths_that_no_file_can_have_are_refused(name: str, scan: Path) -> None:
    options = {"resolution": 1e4, name: 1e7}
    refused = f"^{name} is 10000000, but must be a number from 1e-8 to 1e5 metres"
    with pytest.raises(InvalidInputError, match=refused):
        sb.learn_patches(strip(), **options)
    with pytest.raises(InvalidInputError, match=refused):
        sb.learn_patches_tiled(scan, scan.parent / "far.sfb", **options)
    # The largest that may be.
    data = sb.learn_patches(strip(), **{"resolution": 1e4, name: 1e5}).to_bytes()
    assert sb.from_bytes(data).to_bytes() == data


def test_a_bound_that_is_kept_needs_no_advice(
    scan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(scan.parent / "bounded.sfb")
    assert main(["compress", str(scan), out, "--max-error", "0.3"]) in (None, 0)
    assert "keep more" not in capsys.readouterr().err


@pytest.mark.parametrize("options", [{}, {"max_error": 0.3}])
def test_models_without_points_beside_the_patches_equal_what_is_read(
    options: dict[str, float],
) -> None:
    model = sb.learn_patches(strip(), resolution=0.05, **options)
    assert model.n_extra_points == 0
    assert sb.from_bytes(model.to_bytes()) == model
