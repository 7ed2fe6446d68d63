"""`surfabet view` and `sb.view`: what the page holds, and what is refused."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

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
    assert main(["view", str(cloud), "--out", str(out)]) == 1
    assert "cloud.xyz: not an .sfb file" in capsys.readouterr().err
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
