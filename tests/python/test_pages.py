"""Start and most tasks, as a new user would do them: every block of each page, in order."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import surfabet as sb
from surfabet import datasets

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(
    r"^(?P<skip><!-- not run: .*? -->\n)?(?P<indent> *)```(?P<language>python|sh)\n"
    r"(?P<code>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
# The page of chairs learns from hundreds of thousands of points in fine detail, for a minute.
PAGES = [
    "start",
    "tasks/bound",
    "tasks/archive",
    "tasks/robot",
    "tasks/floor_plan",
    "tasks/localise",
    "tasks/session",
    "tasks/cluster",
    "plan",
]
NEEDS = {"tasks/cluster": ["distributed", "fsspec"]}


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that pages take as given: a scan of a room, and a survey in UTM with classes."""
    folder = tmp_path_factory.mktemp("inputs")
    room = datasets.simulated_room(n_poses=3).cloud
    sb.write(folder / "room.ply", sb.voxel_downsample(room, 0.02))
    random = np.random.default_rng(0)
    xy = random.uniform(0, 20, (20_000, 2))
    z = 0.3 * np.sin(xy[:, 0]) + random.normal(0, 0.02, len(xy))
    survey = sb.PointCloud(
        np.column_stack([xy, z]) + np.array([601_000, 5_402_000, 300]),
        extra={"classification": (xy[:, 0] > 10).astype(np.uint8) + 2},
    )
    sb.write(folder / "survey.laz", survey)
    return folder


def blocks(page: str) -> list[tuple[str, str]]:
    """Language and code of every block that is run."""
    text = (ROOT / "docs" / f"{page}.md").read_text("utf-8")
    found = []
    for match in BLOCK.finditer(text):
        if match["skip"] is None:
            code = re.sub(rf"^{match['indent']}", "", match["code"], flags=re.MULTILINE)
            found.append((match["language"], code))
    return found


@pytest.mark.parametrize("page", PAGES)
def test_every_block_of_a_page_runs(
    page: str, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in ("laspy", "matplotlib", "shapely", "ezdxf", *NEEDS.get(page, [])):
        pytest.importorskip(package, reason="pip install 'surfabet[all]'")
    for file in inputs.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    command = tmp_path / "bin" / "surfabet"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m surfabet "$@"\n')
    command.chmod(0o755)
    monkeypatch.setenv("PATH", f"{command.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    found = blocks(page)
    assert len(found) >= 2
    for language, code in found:
        if language == "python":
            exec(compile(code, f"docs/{page}.md", "exec"), names)
        else:
            done = subprocess.run(["bash", "-ec", code], capture_output=True, text=True)
            assert done.returncode == 0, f"{code}\n{done.stderr}"


def test_start_runs_all_blocks_but_the_installation() -> None:
    text = (ROOT / "docs" / "start.md").read_text("utf-8")
    assert text.count("```") // 2 == len(blocks("start")) + 1
    assert "pip install '.[all]'" in text
