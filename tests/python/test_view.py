"""`surfabet view` and `sb.view`: what the page holds, and what is refused."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet as sb
from surfabet.cli import main
from surfabet.view import VIEWER, page_of

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
MODEL = GOLDEN / "patches_0_1.sfb"


def script(page: str, name: str) -> str:
    found = re.search(rf'<script id="{name}" type="text/plain">([^<]*)</script>', page)
    assert found is not None
    return found[1]


def test_the_page_holds_the_file_and_loads_nothing_else(tmp_path: Path) -> None:
    page = sb.view(MODEL, tmp_path / "page.html")
    text = page.read_text("utf-8")
    assert base64.b64decode(script(text, "model")) == MODEL.read_bytes()
    sources = [
        zlib.decompress(base64.b64decode(script(text, id))).decode() for id in ("decoder", "page")
    ]
    for source in (text, *sources):
        assert not re.search(r"""(src|href)\s*=\s*["']|https?:|import\(|\bfetch\(""", source)
        assert not re.search(r"^(import|export)\b", source, re.MULTILINE)
    assert "<title>patches_0_1.sfb</title>" in text


def test_a_file_of_40_kb_is_a_page_of_at_most_150_kb() -> None:
    noise = np.random.default_rng(0).bytes(40_000)
    assert len(page_of(noise, "kitchen.sfb").encode()) <= 150_000


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_the_scripts_of_the_page_parse_and_the_decoder_opens_the_file(tmp_path: Path) -> None:
    text = page_of(MODEL.read_bytes(), "room.sfb")
    for name in ("decoder", "page"):
        source = zlib.decompress(base64.b64decode(script(text, name))).decode()
        (tmp_path / f"{name}.js").write_text(source, "utf-8")
        subprocess.run(["node", "--check", tmp_path / f"{name}.js"], check=True)
    (tmp_path / "ask.js").write_text(
        (tmp_path / "decoder.js").read_text("utf-8")
        + 'const bytes = new Uint8Array(require("fs").readFileSync(process.argv[2]));\n'
        'console.log(JSON.stringify(surfabetWorker.handle({ id: 1, kind: "open", bytes })));\n',
        "utf-8",
    )
    done = subprocess.run(
        ["node", tmp_path / "ask.js", MODEL], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout)["result"]["nParts"] == len(sb.load(MODEL))


def test_titles_are_text_and_models_need_no_file(tmp_path: Path) -> None:
    model = sb.load(MODEL)
    page = sb.view(model, tmp_path / "page.html", title="<b>room & hall</b>")
    text = page.read_text("utf-8")
    assert "<title>&lt;b&gt;room &amp; hall&lt;/b&gt;</title>" in text
    assert base64.b64decode(script(text, "model")) == model.to_bytes()


def test_the_page_is_opened_only_when_nobody_named_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda uri: not opened.append(uri))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    sb.view(MODEL, tmp_path / "page.html")
    assert opened == []
    page = sb.view(MODEL)
    assert opened == [page.as_uri()]
    assert page.parent == tmp_path
    sb.view(MODEL, tmp_path / "page.html", open=True)
    assert len(opened) == 2


def test_the_command_writes_or_opens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("webbrowser.open", lambda uri: True)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    out = tmp_path / "room.html"
    assert main(["view", str(MODEL), "--out", str(out)]) == 0
    assert "open it in a web browser" in capsys.readouterr().out
    assert main(["view", str(MODEL), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["opened"] is True
    assert Path(told["page"]).read_text("utf-8").count("patches_0_1.sfb") == 1
    assert told["bytes"] == Path(told["page"]).stat().st_size


def test_what_is_no_model_is_refused_before_a_page_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = tmp_path / "cloud.xyz"
    cloud.write_text("0 0 0\n")
    out = tmp_path / "page.html"
    assert main(["view", str(cloud), "--out", str(out)]) == 2
    assert "cloud.xyz: is a cloud (xyz), not a model" in capsys.readouterr().err
    (tmp_path / "noise.sfb").write_bytes(b"\0" * 99)
    assert main(["view", str(tmp_path / "noise.sfb"), "--out", str(out)]) == 1
    assert "noise.sfb: not an .sfb file" in capsys.readouterr().err
    assert main(["view", str(MODEL), "--out", str(tmp_path / "page.txt")]) == 2
    assert ".html" in capsys.readouterr().err
    assert main(["view", str(tmp_path)]) == 2
    assert "is a folder" in capsys.readouterr().err
    assert not out.exists()


def test_a_model_without_its_vocabulary_is_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    u, v = rng.uniform(0, 1, (2, 4000))
    points = np.stack([u, v, 0.02 * np.sin(9 * u)], axis=1)
    first = sb.learn_hscsm(sb.PointCloud(points), resolution=0.03, levels=1)
    second = first.dictionary.describe(sb.PointCloud(points + np.array([0, 0, 1])))
    assert second.shares_vocabulary
    with pytest.raises(sb.InvalidInputError, match="does not hold its vocabulary"):
        sb.view(second, tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


def test_every_module_of_the_page_is_there() -> None:
    assert (VIEWER / "README.md").exists()
    assert {path.name for path in (VIEWER / "page").iterdir()} >= {
        "page.html",
        "style.css",
        "app.js",
    }


def read_field(page: str) -> tuple[dict[str, Any], dict[tuple[int, int, int], float]]:
    """The distances in a page: the header, and metres by cell."""
    data = zlib.decompress(base64.b64decode(script(page, "against")))
    header, _, rest = data.partition(b"\n")
    about = json.loads(header)
    nx, ny, _ = about["dimensions"]
    codes, key, at, found = rest[-about["count"] :], 0, 0, {}
    for code in codes:
        shift = 0
        while True:
            key += (rest[at] & 127) << shift
            shift += 7
            at += 1
            if rest[at - 1] < 128:
                break
        value = about["least"] * about["ratio"] ** (code - 1) if code else 0.0
        found[(key % nx, key // nx % ny, key // nx // ny)] = value
    assert at + len(codes) == len(rest)
    return about, found


def test_distances_to_a_second_cloud_are_in_the_page(tmp_path: Path) -> None:
    model = sb.load(MODEL)
    decoded = model.decode()
    below = sb.PointCloud(decoded.points - np.array([0, 0, 0.03]))
    text = sb.view(model, tmp_path / "page.html", against=below).read_text("utf-8")
    about, field = read_field(text)
    assert about["name"] == "the second cloud"
    exact = cKDTree(below.points).query(decoded.points)[0]
    local = decoded.points - model.origin - about["low"]
    cells = [tuple(cell) for cell in np.floor(local / about["side"]).astype(int).tolist()]
    assert set(cells) == set(field)
    sums: dict[tuple[int, ...], list[float]] = {}
    for cell, distance in zip(cells, exact, strict=True):
        sums.setdefault(cell, []).append(float(distance))
    for cell, distances in sums.items():
        mean = float(np.mean(distances))
        if mean < about["least"]:
            assert field[cell] == 0  # type: ignore[index]
        else:
            assert field[cell] == pytest.approx(mean, rel=about["ratio"] - 1)  # type: ignore[index]
    assert about["ratio"] < 1.1


def test_fields_of_large_and_far_reaching_maps_are_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("surfabet._distance_field.MOST_CELLS", 200)
    side = np.arange(0, 2, 0.02)
    floor = np.stack([*np.meshgrid(side, side), np.zeros((100, 100))], axis=-1).reshape(-1, 3)
    far = floor + 3e5
    model = sb.learn_gas(sb.PointCloud(np.concatenate([floor, far])), n_neurons=200)
    near = sb.PointCloud(floor)
    about, field = read_field(
        sb.view(model, tmp_path / "page.html", against=near).read_text("utf-8")
    )
    assert 0 < len(field) <= 200
    assert np.prod(np.array(about["dimensions"], float)) < 2**53
    assert max(field.values()) == pytest.approx(3e5 * 3**0.5, rel=0.05)


def test_the_command_takes_a_second_cloud(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud, out = tmp_path / "again.ply", tmp_path / "page.html"
    sb.write(cloud, sb.load(MODEL).decode())
    assert main(["view", str(MODEL), "--out", str(out), "--against", str(cloud)]) == 0
    about, field = read_field(out.read_text("utf-8"))
    assert about["name"] == "again.ply"
    assert max(field.values()) < 1e-4
    capsys.readouterr()
    cloud.write_text(
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n"
    )
    assert main(["view", str(MODEL), "--out", str(out), "--against", str(cloud)]) == 2
    assert (
        "--against is again.ply, which has no points, but must be a cloud with points"
        in capsys.readouterr().err
    )
    missing = str(tmp_path / "missing.ply")
    assert main(["view", str(MODEL), "--out", str(out), "--against", missing]) == 1
    assert "missing.ply" in capsys.readouterr().err
