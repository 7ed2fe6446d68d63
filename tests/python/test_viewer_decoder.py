"""The decoder in JavaScript, a second implementation of docs/format.md, against surfabet's own."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from generated import DATA, chests

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = sorted((ROOT / "tests" / "golden").glob("*.sfb"))
NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(
    NODE is None, reason="node is not installed (apt-get install nodejs)"
)


def node(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [str(NODE), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def decoded(path: Path, folder: Path, *options: object) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the decoder in JavaScript says of a file, and its arrays."""
    out = folder / "decoded"
    done = node(ROOT / "viewer" / "decode.js", path, out, *options)
    assert done.returncode == 0, done.stderr
    about = json.loads((folder / "decoded.json").read_text())
    n = about["points"]
    arrays = {}
    for name in about["columns"]:
        dtype = {"colors": np.uint8, "parts": np.uint32}.get(name, np.float32)
        values = np.fromfile(f"{out}.{name}", dtype)
        arrays[name] = values if name == "parts" else values.reshape(n, 3)
    for i, attribute in enumerate(about["attributes"]):
        labels = attribute.get("labels")
        values = np.fromfile(f"{out}.attribute{i}", np.uint16 if labels else np.float64)
        if labels:
            values = np.array([int(label) for label in labels])[values]
        arrays[attribute["name"]] = values
    return about, arrays


def assert_same(path: Path, folder: Path, resolution: float | None, as_measured: bool) -> None:
    """Points one by one: positions and normals in single precision, bytes of colours to one level.

    Points are told apart by the symbols of the file, so that all of them are the same.
    """
    model = sb.load(path)
    cloud = model.decode(resolution, as_measured=as_measured, normals=True)
    options = ("-" if resolution is None else resolution, "measured" if as_measured else "")
    about, arrays = decoded(path, folder, *options)
    assert about["method"] == model.method.replace("-", "_")
    assert (about["nParts"], about["nPoints"]) == (len(model), model.n_points)
    assert about["keepsThickness"] == model.keeps_thickness
    assert about["note"] == (sb.inspect(path).note or "")
    np.testing.assert_array_equal(about["origin"], cloud.origin)
    assert about["points"] == len(cloud)
    extent = np.abs(cloud.local_points).max()
    np.testing.assert_allclose(arrays["positions"], cloud.local_points, atol=4e-7 * extent, rtol=0)
    np.testing.assert_allclose(arrays["normals"], cloud.normals, atol=4e-6)
    assert arrays["parts"].max() in (len(model) - 1, 2**32 - 1)
    assert ("colors" in arrays) == (cloud.colors is not None)
    if cloud.colors is not None:
        off = np.abs(arrays["colors"].astype(int) - cloud.colors)
        assert off.max() <= 1
        # Means in double and in single precision round differently near a half.
        assert off.any(axis=1).mean() < 0.05
    names = [attribute["name"] for attribute in about["attributes"]]
    assert set(names) == {name for name in cloud.attributes if name not in KNOWN}
    for name in names:
        values = cloud.intensities if name == "intensities" else cloud[name]
        own = np.asarray(values, np.float64)
        if np.issubdtype(np.asarray(values).dtype, np.integer):
            # Of labels of equal weight rounding chooses.
            assert (arrays[name] != own).mean() < 0.005
        else:
            np.testing.assert_allclose(arrays[name], own, atol=2e-6 * (np.abs(own).max() + 1))


KNOWN = {"colors", "normals", "viewpoints", "viewpoint_index"}


@pytest.mark.parametrize("path", GOLDEN, ids=lambda path: path.stem)
def test_golden_files_decode_to_the_same_points(path: Path, tmp_path: Path) -> None:
    model = sb.load(path)
    for as_measured in {False, model.keeps_thickness}:
        assert_same(path, tmp_path, None, as_measured)


def corner(n: int = 6000, **columns: Any) -> sb.PointCloud:
    """Two wavy walls and a floor that meet, far from zero, with a step of noise."""
    rng = np.random.default_rng(3)
    u, v = rng.uniform(0, 2, (2, n))
    wave = 0.05 * np.sin(5 * u) * np.cos(4 * v) + 0.003 * rng.standard_normal(n)
    faces = rng.integers(3, size=n)
    points = np.stack([u, v, wave], axis=1)
    points = np.take_along_axis(points, (np.arange(3) + faces[:, None]) % 3, axis=1)
    values = {name: make(points, faces) for name, make in columns.items()}
    extra = values.pop("extra", {})
    return sb.PointCloud(points + np.array([500_000, 5_000_000, 100]), **values, extra=extra)


def colors(points: Any, _: Any) -> Any:
    return np.clip(128 + 90 * np.sin(6 * points), 0, 255).astype(np.uint8)


def intensities(points: Any, _: Any) -> Any:
    return (points.sum(axis=1) * 7).astype(np.float32)


def classes(points: Any, faces: Any) -> Any:
    return {"class": faces.astype(np.uint8) * 3, "height": points[:, 2] * 100}


def every_attribute() -> Any:
    return corner(colors=colors, intensities=intensities, extra=classes)


def with_instances(**options: Any) -> Any:
    points, shades = chests()
    values = (100 * points[:, 2]).astype(np.float32)
    cloud = sb.PointCloud(points + np.array([3.0, 1.0, 0.0]), colors=shades, intensities=values)
    model = sb.learn_patches(cloud, resolution=0.01, recurrence=True, **options)
    assert model.instances
    return model


Learn = Callable[[], Any]
MODELS: dict[str, Learn] = {
    "patches without attributes": lambda: sb.learn_patches(corner(), resolution=0.05, levels=1),
    "patches of four levels with all attributes": lambda: sb.learn_patches(
        every_attribute(),
        resolution=0.02,
        levels=4,
        attributes=["colors", "intensities", "class", "height"],
    ),
    "patches with fine colours and wide heights": lambda: sb.learn_patches(
        every_attribute(), resolution=0.04, color_step=1, attributes=["colors", "height"]
    ),
    "patches with points beside them": lambda: sb.learn_patches(
        corner(colors=colors), resolution=0.06, max_error=0.02
    ),
    "patches with instances": with_instances,
    "patches with instances and points beside them": lambda: with_instances(max_error=0.006),
    "hscsm on three levels": lambda: sb.learn_hscsm(
        corner(colors=colors), resolution=0.02, levels=3, depth_atoms=8, color_atoms=8
    ),
    "hscsm with intensities": lambda: sb.learn_hscsm(
        corner(intensities=intensities), resolution=0.03, levels=1, patch_pixels=6
    ),
    "planes with intensities": lambda: sb.learn_planes(
        corner(colors=colors, intensities=intensities)
    ),
    "gas with intensities": lambda: sb.learn_gas(
        corner(colors=colors, intensities=intensities), n_neurons=400
    ),
    "alphabet": lambda: sb.learn_alphabet(corner(colors=colors, intensities=intensities)),
    "bic alphabet": lambda: sb.learn_bic_alphabet(corner(), upright="view"),
}


@pytest.mark.parametrize("name", MODELS)
def test_models_of_every_kind_decode_to_the_same_points(name: str, tmp_path: Path) -> None:
    model = MODELS[name]()
    path = tmp_path / "model.sfb"
    model.save(path, note="made by a test")
    coarse = 0.11 if model.method == "bic-alphabet" else 0.047
    assert_same(path, tmp_path, None, False)
    assert_same(path, tmp_path, coarse, model.keeps_thickness)


@pytest.mark.parametrize("details", [1, 2])
def test_maps_in_tiles_decode_to_the_same_points(details: int, tmp_path: Path) -> None:
    path = tmp_path / "map.sfb"
    cloud = corner(colors=colors, intensities=intensities)
    options: dict[str, Any] = {"resolution": 0.02, "tile": 1.28, "max_error": 0.05}
    sb.learn_patches_tiled(cloud, path, details=details, **options)
    model = sb.load(path)
    assert len(model.tiles) > 3
    assert_same(path, tmp_path, None, False)
    assert_same(path, tmp_path, 0.047, True)


@pytest.mark.skipif(not DATA.is_dir(), reason=f"the real scans are not at {DATA}")
@pytest.mark.parametrize("method", ["patches", "hscsm", "planes", "gas", "alphabet"])
def test_real_scans_decode_to_the_same_points(method: str, tmp_path: Path) -> None:
    scan = sb.read(DATA / "indoor_scan" / "room_scan1.pcd", viewpoint=(0, 0, 0))
    options = {"gas": {"n_neurons": 2000}}.get(method, {})
    model = getattr(sb, f"learn_{method}")(scan, **options)
    path = tmp_path / "scan.sfb"
    model.save(path)
    assert_same(path, tmp_path, None, model.keeps_thickness)


def test_lines_are_edges_of_a_gas_and_outlines_of_planes(tmp_path: Path) -> None:
    gas, planes = (ROOT / "tests" / "golden" / f"{name}_0_1.sfb" for name in ("gas", "planes"))
    decoded(gas, tmp_path)
    found = np.fromfile(tmp_path / "decoded.lines", np.float32).reshape(-1, 2, 3)
    model = sb.load(gas)
    np.testing.assert_allclose(
        found, model.neurons.positions[model.edges] - model.origin, atol=1e-5
    )
    decoded(planes, tmp_path)
    sides = np.fromfile(tmp_path / "decoded.lines", np.float32).reshape(-1, 2, 3)
    model = sb.load(planes)
    rings = [ring for i in range(len(model)) for ring in model.polygons(i)]
    around = sum(np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).sum() for ring in rings)
    assert np.linalg.norm(sides[:, 0] - sides[:, 1], axis=1).sum() == pytest.approx(around, 1e-5)


def test_the_stream_of_the_page_has_its_symbols() -> None:
    done = node(ROOT / "viewer" / "check.js", "stream")
    assert done.stdout == "60 symbols\n", done.stderr


def test_damaged_files_are_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "instances.sfb"
    with_instances(color_step=400).save(path)
    done = node(ROOT / "viewer" / "check.js", "hostile", *GOLDEN, path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("are refused") == len(GOLDEN) + 1


def test_files_of_newer_versions_name_the_version(tmp_path: Path) -> None:
    data = bytearray(GOLDEN[0].read_bytes())
    data[4:7] = 2, 3, 7
    path = tmp_path / "newer.sfb"
    path.write_bytes(data)
    done = node(ROOT / "viewer" / "decode.js", path, tmp_path / "out")
    assert done.returncode == 1
    assert "made by a newer version" in done.stderr
    assert "surfabet 3.7" in done.stderr
