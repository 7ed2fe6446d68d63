"""Comparing tools: errors that geometry allows, bounds that hold, and what is said of the rest."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from surfabet import comparison
from surfabet.cli import main
from surfabet.comparison import jobs, peers
from surfabet.comparison.coded import Coded

UTM = np.array([601_234.0, 5_402_345.0, 310.0])


@pytest.fixture(scope="module")
def corner() -> sb.PointCloud:
    """A coloured floor and a wall of 1 x 1 m, a point per centimetre with 1 mm of noise."""
    random = np.random.default_rng(3)
    u, v = (side.ravel() for side in np.meshgrid(np.arange(0, 1, 0.01), np.arange(0, 1, 0.01)))
    points = np.concatenate([np.stack([u, v, 0 * u], 1), np.stack([0 * u, u, v], 1)])
    colors = np.clip(points * 200 + 20, 0, 255).astype(np.uint8)
    return sb.PointCloud(points + random.normal(0, 0.001, points.shape), colors=colors)


def moved(cloud: sb.PointCloud, by: np.ndarray) -> sb.PointCloud:
    return sb.PointCloud(cloud.points + by, colors=cloud.colors)


def coded(name: str, cloud: sb.PointCloud) -> Coded:
    tool = name.split("_")[0].replace("voxel", "voxel-zstd")
    if (how := jobs.missing(tool)) is not None:
        pytest.skip(f"{tool} is not installed: {how}")
    maker: Any = getattr(peers, name)
    made = maker(cloud) if name == "draco_defaults" else maker(cloud, 0.02)
    assert isinstance(made, Coded)
    return made


@pytest.mark.parametrize("name", ["draco", "laz", "octomap", "voxel_zstd"])
@pytest.mark.parametrize("by", [np.zeros(3), UTM], ids=["near", "utm"])
@pytest.mark.parametrize("colored", [True, False])
def test_grids_keep_their_bound(
    name: str, by: np.ndarray, colored: bool, corner: sb.PointCloud
) -> None:
    cloud = moved(corner, by)
    if not colored:
        cloud = sb.PointCloud(cloud.points)
    made = coded(name, cloud)
    assert made.bound is not None
    quality = sb.evaluate(cloud, made.decoded, normal_neighbors=None)
    # Means and centres of cells of 2 cm; coordinates near UTM have 0.1 mm in the reference.
    assert quality.max_backward <= made.bound + 2e-4
    assert quality.max_forward <= made.bound + 2e-4
    assert (quality.color_rmse_pooled is None) == (not colored)
    if colored:
        # Five bits are off by 4, and colours differ by 4 from one side of a cell to another.
        assert quality.color_rmse_pooled is not None
        assert quality.color_rmse_pooled < 8
    assert made.geometry_bytes is not None
    assert made.geometry_bytes <= made.bytes


def test_zstd_of_a_grid_is_the_cells_that_hold_points(corner: sb.PointCloud) -> None:
    made = coded("voxel_zstd", corner)
    cells = np.unique(np.floor(corner.points / 0.02).astype(int), axis=0)
    back = np.floor(made.decoded.points / 0.02).astype(int)
    np.testing.assert_array_equal(np.unique(back, axis=0), cells)
    assert len(back) == len(cells)


def test_draco_at_its_defaults_keeps_all_points(corner: sb.PointCloud) -> None:
    made = coded("draco_defaults", moved(corner, UTM))
    assert len(made.decoded) == len(corner)


@pytest.fixture(scope="module")
def found(corner: sb.PointCloud) -> comparison.Comparison:
    return comparison.compare(
        corner, tools=["patches", "planes", "laz", "copc"], max_error=0.03, pictures=True
    )


def test_all_qualities_surface_and_as_measured(found: comparison.Comparison) -> None:
    told = [(row.setting, row.kind) for row in found.rows if row.tool == "patches"]
    settings = ["small", "balanced", "fine", "within 30 mm"]
    kinds = ["surface", "as measured"]
    assert told == [(setting, kind) for setting in settings for kind in kinds]
    assert not found.failed
    assert list(found.missing) == ["copc"]
    assert all(len(row.pictures) == 3 for row in found.rows)
    assert all(row.memory is None or row.memory > 0 for row in found.rows)


def test_rows_are_what_evaluate_says(found: comparison.Comparison, corner: sb.PointCloud) -> None:
    model = sb.learn_patches(corner, quality="small")
    row = next(r for r in found.rows if (r.setting, r.kind) == ("small", "surface"))
    quality = sb.evaluate(corner, model.decode())
    assert row.n_bytes == len(model.to_bytes())
    assert (row.rmse_forward, row.rmse_backward) == (quality.rmse_forward, quality.rmse_backward)
    assert row.color_rmse_forward == quality.color_rmse_forward


def test_the_row_to_take(found: comparison.Comparison) -> None:
    best = found.best
    for row in found.rows:
        if row.rmse <= found.error:
            assert best["smallest"] is not None
            assert best["smallest"].n_bytes <= row.n_bytes
    assert best["bounded"] is not None
    assert best["bounded"].bound is not None
    assert best["bounded"].bound <= 0.03
    assert best["bounded"].max_backward <= 0.03
    assert best["planes"] is not None
    assert best["planes"].tool == "planes"
    strict = replace(found, error=1e-9, max_error=1e-9)
    assert strict.best | {"planes": None} == dict.fromkeys(["smallest", "bounded", "planes"])
    assert strict.best["planes"] is not None
    assert replace(found, rows=()).best["planes"] is None


def test_unknown_tools_and_wrong_errors_are_refused(corner: sb.PointCloud) -> None:
    with pytest.raises(sb.InvalidInputError, match=r"zip.*draco"):
        comparison.compare(corner, tools=["zip"])
    with pytest.raises(sb.InvalidInputError, match="error is 0"):
        comparison.compare(corner, error=0)
    with pytest.raises(sb.InvalidInputError, match="max_error is nan"):
        comparison.compare(corner, max_error=float("nan"))
    with pytest.raises(sb.InvalidInputError, match="empty"):
        comparison.compare(sb.PointCloud(np.empty((0, 3))))


def test_a_tool_that_fails_is_named_with_the_reason() -> None:
    single = sb.PointCloud(np.random.default_rng(0).random((50, 3)))
    result = comparison.compare(single, tools=["planes"])
    assert set(result.failed) | {f"{row.label}, {row.setting}" for row in result.rows} == {
        f"surfabet planes, {quality}" for quality in ("small", "balanced", "fine")
    }
    assert all("no surface" in why for why in result.failed.values())


def test_command_line(
    corner: sb.PointCloud, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ply, page = tmp_path / "corner.ply", tmp_path / "report.html"
    sb.write(ply, corner)
    assert main(["compare", str(ply), "--tools", "planes,copc", "--html", str(page)]) == 0
    told = capsys.readouterr().out
    assert "planes only: surfabet planes" in told
    assert "not installed: copc" in told
    text = page.read_text("utf-8")
    assert "http" not in text.replace("http://www.w3.org", "").replace(
        "http://purl.org", ""
    ).replace("https://matplotlib.org", "").replace("http://creativecommons.org", "")
    assert text.count("data:image/webp") >= 4
    assert sorted(path.name for path in tmp_path.iterdir()) == ["corner.ply", "report.html"]

    assert main(["compare", str(ply), "--tools", "planes", "--voxel", "0.02", "--json"]) == 0
    value = json.loads(capsys.readouterr().out)
    assert value["n_points"] < len(corner)
    assert value["best"]["planes"] in {
        f"{row['label']}, {row['setting']}, {row['kind']}" for row in value["rows"]
    }


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--tools", "patches,zip"], "--tools: there is no zip"),
        (["--tools", ","], "--tools: is empty"),
        (["--error", "0"], "--error"),
        (["--html", "report.pdf"], ".html"),
    ],
)
def test_usage_errors(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", str(tmp_path / "none.ply"), *arguments]) == 2
    assert said in capsys.readouterr().err
