"""Options of the command line for what is read, `info` of clouds and bags, degenerate clouds."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from surfabet.cli import main
from surfabet.cli._options import READ_OPTIONS, in_own_words
from surfabet.io import formats

POINTS = np.array([[0.5, -1.25, 2.0], [3.0, 4.5, -6.75], [10.0, 0.0, 0.125]])


def convert(path: Path, *options: str) -> sb.PointCloud:
    """What `convert` makes of a file."""
    output = path.with_name("converted.npz")
    assert main(["convert", str(path), str(output), "--quiet", *options]) == 0
    return sb.read(output)


def refused(arguments: Sequence[str], capsys: pytest.CaptureFixture[str], code: int = 2) -> str:
    """The one line that a command prints which is refused."""
    assert main(list(arguments)) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    *warnings, error = captured.err.splitlines()
    assert all(line.startswith("surfabet: warning: ") for line in warnings)
    assert error.startswith("surfabet: error: ")
    return error


def test_columns_and_delimiter(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("".join(f"9|{x}|{y}|{z}|7|1|2|3\n" for x, y, z in POINTS))
    columns = "_,x,y,z,intensity,red,green,blue"
    cloud = convert(path, "--columns", columns, "--delimiter", "|")
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.intensities, [7, 7, 7])
    np.testing.assert_array_equal(cloud.colors, [[1, 2, 3]] * 3)
    path.write_text("".join(f"{x}\t{y}\t{z}\n" for x, y, z in POINTS))
    np.testing.assert_array_equal(convert(path, "--delimiter", "tab").points, POINTS)


def test_format(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.dat"
    path.write_text("".join(f"{x} {y} {z}\n" for x, y, z in POINTS))
    output = str(tmp_path / "a.ply")
    assert "name the format with --format" in refused(["convert", str(path), output], capsys, 1)
    np.testing.assert_array_equal(convert(path, "--format", "xyz").points, POINTS)
    error = refused(["convert", str(path), output, "--format", "obj3"], capsys)
    assert "--format is 'obj3', but must be one of ply, pcd" in error


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("ft", 0.3048), ("us-ft", 1200 / 3937)])
def test_unit(tmp_path: Path, unit: str, metres: float) -> None:
    sb.write(tmp_path / "a.ply", sb.PointCloud(POINTS))
    cloud = convert(tmp_path / "a.ply", "--unit", unit)
    np.testing.assert_allclose(cloud.points, POINTS * metres, rtol=1e-6)


def test_an_unknown_unit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sb.write(tmp_path / "a.ply", sb.PointCloud(POINTS))
    arguments = ["convert", str(tmp_path / "a.ply"), str(tmp_path / "b.ply"), "--unit", "yd"]
    assert "--unit is 'yd', but must be one of mm, cm, m" in refused(arguments, capsys)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--depth-max", "3"], "--depth-max: not for the format ply of"),
        (["--depth-max", "3", "--columns", "x,y,z"], "--columns, --depth-max: not for the format"),
        (["--columns", "x,y,z"], "but for xyz"),
        (["--topic", "/points"], "but for bag, mcap"),
        (["--frame-stride", "1"], "but for rgbd"),
    ],
)
def test_options_of_other_formats_are_refused(
    tmp_path: Path, options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    sb.write(tmp_path / "a.ply", sb.PointCloud(POINTS))
    arguments = ["convert", str(tmp_path / "a.ply"), str(tmp_path / "b.ply"), *options]
    assert said in refused(arguments, capsys)
    assert not (tmp_path / "b.ply").exists()


def test_every_option_of_a_reader_has_one_here() -> None:
    # `fused` gives lists of clouds, and regions of COPC have options of their own.
    here = set(READ_OPTIONS.__dataclass_fields__) | {"depth_limits"}
    for known in formats():
        assert set(known.read_options) - {"fused"} <= here, known.name


@pytest.mark.parametrize(
    ("message", "own"),
    [
        (
            "name them in a first line or with columns=",
            "name them in a first line or with --columns",
        ),
        ("read it with format='xyz' and columns=", "read it with --format xyz and --columns"),
        (
            "outside depth_limits=(0.3, 4) metres",
            "outside --depth-min 0.3 and --depth-max 4 metres",
        ),
        ("give intrinsics=(fx, fy, cx, cy)", "give --intrinsics FX FY CX CY"),
        ("name one with topic=: /a, /b", "name one with --topic: /a, /b"),
        ("within max_time_difference=0.02 s", "within --max-time-difference 0.02 s"),
        ("with poses='none'", "with --poses none"),
        ("units: x=1", "units: x=1"),
    ],
)
def test_messages_name_the_options_of_the_command_line(message: str, own: str) -> None:
    assert in_own_words(message) == own


def test_refusals_name_the_options_of_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.txt"
    path.write_text("1 2 3 4 5\n")
    error = refused(["convert", str(path), str(tmp_path / "a.ply")], capsys, 1)
    assert error.endswith("name them in a first line or with --columns")


# Info


def info(path: Path, capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    assert main(["info", str(path), "--json", *options]) == 0
    said = json.loads(capsys.readouterr().out)
    assert isinstance(said, dict)
    return said


def test_info_of_a_cloud(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.ply"
    sb.write(path, sb.PointCloud(POINTS, intensities=[1, 2, 3]))
    said = info(path, capsys)
    assert said["format"] == "ply"
    assert said["n_points"] == 3
    assert said["attributes"] == ["intensities"]
    assert said["bounds"] == [[0.5, -1.25, -6.75], [10.0, 4.5, 2.0]]
    assert said["bytes"] == path.stat().st_size
    scaled = info(path, capsys, "--unit", "cm")["bounds"]
    np.testing.assert_allclose(scaled, np.array(said["bounds"]) / 100, rtol=1e-6)
    assert main(["info", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "ply, " in shown
    assert "3 points (positions, intensities)" in shown
    assert "-6.750" in shown


def test_info_of_an_empty_cloud(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sb.write(tmp_path / "a.ply", sb.PointCloud(np.empty((0, 3))))
    assert info(tmp_path / "a.ply", capsys)["n_points"] == 0
    assert main(["info", str(tmp_path / "a.ply")]) == 0


def test_info_of_a_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("rosbags")
    path = tmp_path / "a.mcap"
    sb.write(path, sb.PointCloud(POINTS), topic="/map")
    said = info(path, capsys)
    topic = {"name": "/map", "type": "sensor_msgs/msg/PointCloud2", "count": 1}
    assert said["topics"] == [topic]
    assert info(path, capsys, "--topic", "/map")["n_points"] == 3
    assert main(["info", str(path)]) == 0
    assert "/map" in capsys.readouterr().out
    np.testing.assert_array_equal(convert(path, "--message", "0").points, POINTS)
    arguments = ["convert", str(path), str(tmp_path / "a.ply"), "--topic", "/scan"]
    capsys.readouterr()
    error = refused(arguments, capsys)
    assert "--topic is '/scan', but must be one with PointCloud2 messages: /map" in error


def test_info_of_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "No such file" in refused(["info", str(tmp_path / "a.ply")], capsys, 1)
    assert "no RGB-D frames in this folder" in refused(["info", str(tmp_path)], capsys, 1)


# Degenerate clouds

MODELS = ["patches", "hscsm", "alphabet", "bic-alphabet", "planes", "gas"]
CLOUDS = {
    "none": np.empty((0, 3)),
    "one": POINTS[:1],
    "two": POINTS[:2],
    "one place": np.repeat(POINTS[:1], 50, axis=0),
    "line": np.linspace(0, 1, 200)[:, None] * [[1.0, 2.0, 3.0]],
}


@pytest.mark.parametrize("name", CLOUDS)
@pytest.mark.parametrize("model", MODELS)
def test_degenerate_clouds_give_a_whole_model_or_none(
    tmp_path: Path, name: str, model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    source, output = tmp_path / "a.ply", tmp_path / "a.sfb"
    sb.write(source, sb.PointCloud(CLOUDS[name]))
    arguments = [
        "compress",
        str(source),
        str(output),
        "--model",
        model,
        "--viewpoint",
        "0",
        "0",
        "0",
    ]
    code = main(arguments)
    captured = capsys.readouterr()
    if code == 1:
        # Nothing is left behind, and one line says why.
        assert sorted(tmp_path.iterdir()) == [source]
        assert captured.out == ""
        assert captured.err.splitlines()[-1].startswith("surfabet: error: ")
        return
    assert code == 0
    for verb in (
        ["decompress", str(output), str(tmp_path / "again.ply")],
        ["info", str(output)],
        ["evaluate", str(source), str(output)],
    ):
        assert main(verb) == 0, verb
    assert len(sb.read(tmp_path / "again.ply")) > 0


def test_a_model_of_nothing_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "a.ply"
    sb.write(source, sb.PointCloud(CLOUDS["line"]))
    for options in ([], ["--no-evaluate"]):
        arguments = [
            "compress",
            str(source),
            str(tmp_path / "a.sfb"),
            "--model",
            "planes",
            *options,
        ]
        error = refused(arguments, capsys, 1)
        assert "--model planes found no surface in 200 points to describe" in error
        assert sorted(tmp_path.iterdir()) == [source]


def _rmse(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> float:
    capsys.readouterr()
    assert main(["evaluate", *map(str, arguments), "--json"]) == 0
    return float(json.loads(capsys.readouterr().out)["rmse_pooled"])


def test_evaluate_reads_both_clouds_by_its_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points = np.random.default_rng(5).uniform(0, 2, (300, 3)).astype(np.float32)
    metres, millimetres = tmp_path / "m.ply", tmp_path / "mm.ply"
    sb.write(metres, sb.PointCloud(points))
    sb.write(millimetres, sb.PointCloud(points * 1000))
    assert _rmse(capsys, millimetres, millimetres, "--unit", "mm") == 0
    shifted = tmp_path / "shifted.ply"
    sb.write(shifted, sb.PointCloud(points * 1000 + 1))
    assert _rmse(capsys, millimetres, shifted, "--unit", "mm") < 0.002
    # The second in a unit of its own.
    own = ("--unit", "mm", "--decoded.unit", "m")
    assert _rmse(capsys, millimetres, metres, *own) < 1e-6
    assert _rmse(capsys, millimetres, metres, "--unit", "mm") > 0.1


def test_evaluate_passes_over_options_that_one_format_has_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points = np.random.default_rng(5).uniform(0, 2, (300, 3)).astype(np.float32)
    text, ply = tmp_path / "a.dat", tmp_path / "b.ply"
    rows = np.column_stack([points, np.arange(300), np.arange(300) % 7])
    text.write_text("\n".join(" ".join(map(repr, row)) for row in rows.tolist()))
    sb.write(ply, sb.PointCloud(points))
    options = ("--format", "xyz", "--columns", "x,y,z,_,ring")
    for pair in ((text, text), (text, ply), (ply, text)):
        assert _rmse(capsys, *pair, *options) < 1e-6
    assert main(["evaluate", str(text), str(ply), *options, "--keep-noise"]) == 2
    assert "--keep-noise: not for the format" in capsys.readouterr().err
    own = ("--decoded.format", "xyz", "--decoded.columns", "x,y,z,_,_")
    assert _rmse(capsys, ply, text, *own) < 1e-6
    # Those of the first are not for the second then.
    assert main(["evaluate", str(text), str(text), *options, "--decoded.unit", "m"]) == 1
