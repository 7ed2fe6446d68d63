"""Lengths have the unit of the file's coordinate reference system, and are called by it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import surfabet as sb
from surfabet.cli import main
from surfabet.comparison.jobs import all_jobs
from surfabet.comparison.peers import GpccSetting
from surfabet.io._crs import unit_name
from surfabet.learning import in_unit, note_of, unit_in

US_FOOT = 'PROJCS["a",UNIT["US survey foot",0.304800609601219]]'
FOOT = 'PROJCS["a",UNIT["foot",0.3048]]'
METRE = 'PROJCS["a",UNIT["metre",1]]'


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    """A floor and a wall of 60 units, a point every 0.6 of them, with noise."""
    side = 0.6 * np.arange(100)
    flat = np.stack([*np.meshgrid(side, side), np.zeros((100, 100))], axis=-1).reshape(-1, 3)
    noise = np.random.default_rng(0).normal(0, 0.02, (len(flat), 3))
    return np.concatenate([flat + noise, flat[:, [0, 2, 1]] + noise])


@pytest.fixture(scope="module", params=[(US_FOOT, "us-ft"), (FOOT, "ft"), (METRE, "m")])
def scan(
    request: pytest.FixtureRequest, points: np.ndarray, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, str]:
    pytest.importorskip("laspy", reason="pip install 'surfabet[io]'")
    crs, unit = request.param
    path = tmp_path_factory.mktemp("units") / "scan.las"
    sb.write(path, sb.PointCloud(points, crs=crs))
    return path, unit


def said(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert main(arguments) in (None, 0)
    return capsys.readouterr().out


def units_of(text: str) -> set[str]:
    """The units of length behind the numbers of a text."""
    return set(re.findall(r"[0-9] (mm|m|ft|us-ft)\b", text))


def test_the_command_line_names_the_unit(
    scan: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, unit = scan
    model = str(tmp_path / "a.sfb")
    allowed = {"m", "mm"} if unit == "m" else {unit}
    for arguments in (
        ["compress", str(path), model, "--max-error", "2"],
        ["info", model],
        ["evaluate", str(path), model],
        ["verify", str(path), model],
    ):
        found = units_of(said(arguments, capsys))
        assert found, arguments
        assert found <= allowed, arguments
    assert f"extent ({unit})" in said(["info", str(path)], capsys)
    changes = said(["diff", model, model], capsys)
    assert set(re.findall(r"[0-9] (\S+)2\b", changes)) == {unit}
    assert json.loads(said(["diff", model, model, "--json"], capsys))["unit"] == unit
    for arguments in (["evaluate", str(path), model], ["verify", str(path), model]):
        assert json.loads(said([*arguments, "--json"], capsys))["unit"] == unit
    for file in (str(path), model):
        assert json.loads(said(["info", file, "--json"], capsys))["unit"] == unit
    metres = str(tmp_path / "metres.sfb")
    compressed = ["compress", str(path), metres, "--unit", unit, "--json"]
    assert json.loads(said(compressed, capsys))["unit"] == "m"


def test_a_comparison_names_the_unit(
    scan: tuple[Path, str], capsys: pytest.CaptureFixture[str]
) -> None:
    path, unit = scan
    command = ["compare", str(path), "--tools", "patches", "--error", "0.5", "--voxel", "1.5"]
    found = said(command, capsys)
    assert units_of(found) == ({"m", "mm"} if unit == "m" else {unit})
    assert ("smallest under 500 mm" if unit == "m" else f"smallest under 0.5 {unit}") in found
    assert f"bound {'mm' if unit == 'm' else unit}" in found
    settings = [job.setting for job in all_jobs(("laz",), 0.5, 1.0, colored=False, unit=unit)]
    if settings:
        assert settings[1] == (
            "1 mm, 250 mm voxel means" if unit == "m" else f"0.001 {unit}, 0.25 {unit} voxel means"
        )
    name = GpccSetting(0.5, 2, 46, unit).name
    assert name == (
        "500 mm, node 2000 mm, qp 46" if unit == "m" else f"0.5 {unit}, node 2 {unit}, qp 46"
    )


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_the_viewer_names_the_unit(tmp_path: Path) -> None:
    lengths = Path(sb.__file__).parent / "viewer" / "decoder" / "lengths.js"
    notes = [note_of({}, "us-ft"), note_of({"a": (1.0, "2 m")}, "ft"), "", "lengths in <b>x</b>"]
    script = tmp_path / "ask.mjs"
    script.write_text(
        "import { lengthText, middleText, smallText, unitIn } "
        f"from {json.dumps(lengths.as_uri())};\n"
        f"const told = {json.dumps(notes)}.map((note) => {{\n"
        "  const unit = unitIn(note);\n"
        "  const lengths = [0.00123, 0.5, 1.5].map((length) => lengthText(length, unit));\n"
        "  return [unit, ...lengths, middleText(0.5, unit), smallText(0.00123, unit)];\n"
        "});\n"
        "console.log(JSON.stringify(told));\n",
        "utf-8",
    )
    done = subprocess.run(["node", script], capture_output=True, text=True, check=True)
    metres = ["m", "1.2 mm", "50.0 cm", "1.500 m", "50.0 cm", "1.2 mm"]
    assert json.loads(done.stdout) == [
        *(
            [
                unit,
                *(f"{length} {unit}" for length in ("0.00123", "0.5", "1.500", "0.5", "0.00123")),
            ]
            for unit in ("us-ft", "ft")
        ),
        metres,
        # What is no plain name is not put into a page.
        metres,
    ]


def test_measures_are_the_same_numbers_in_every_unit(points: np.ndarray) -> None:
    of_unit = {}
    for crs, unit in ((US_FOOT, "us-ft"), (None, "m")):
        cloud = sb.PointCloud(points, crs=crs)
        other = sb.PointCloud(points + np.array([0, 0, 0.1]))
        quality = sb.evaluate(cloud, other, normal_neighbors=None)
        assert quality.unit == unit
        assert quality.as_dict()["unit"] == unit
        assert units_of(repr(quality)) == ({"mm"} if unit == "m" else {unit})
        assert units_of(repr(cloud)) == {unit}
        of_unit[unit] = quality.rmse
    assert of_unit["us-ft"] == of_unit["m"]


def test_names_of_units() -> None:
    assert [unit_name(crs) for crs in (US_FOOT, FOOT, METRE)] == ["us-ft", "ft", "m"]
    assert unit_name('PROJCS["a",UNIT["ftUS",0.3048006]]') == "us-ft"
    assert unit_name('PROJCS["a",UNIT["chain",20.1168]]') == "chain"
    assert unit_name("no system") == "m"


def test_notes_name_other_units_than_the_metre() -> None:
    chosen = {"resolution": (2.0, "2.25 spacings of 0.9 m"), "n_neurons": (5.0, "of 12 points")}
    assert (
        note_of(chosen, "m") == "resolution 2 (2.25 spacings of 0.9 m), n-neurons 5 (of 12 points)"
    )
    noted = note_of(chosen, "us-ft")
    assert "0.9 us-ft)" in noted
    assert unit_in(noted) == "us-ft"
    assert unit_in(note_of({}, "ft")) == "ft"
    assert unit_in(note_of(chosen, "m")) == unit_in(None) == unit_in("") == "m"
    assert in_unit("3 metres, 4 m", "ft") == "3 metres, 4 ft"
