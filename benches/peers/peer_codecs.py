"""What the compression scripts of this folder share; the peers are in `surfabet.comparison`.

A peer that is not installed gives None, with a line that tells how to get it.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from peer_bench import ROOM

import surfabet as sb
from surfabet.comparison import coded, own, peers
from surfabet.comparison.coded import Coded, cpu_seconds
from surfabet.comparison.peers import GPCC_GEOMETRY, GpccSetting, gpcc, run

__all__ = [
    "GPCC_GEOMETRY",
    "INLIER_DISTANCE",
    "Coded",
    "GpccSetting",
    "cpu_seconds",
    "draco",
    "find_tmc3",
    "gpcc",
    "laz",
    "measured",
    "number",
    "octomap",
    "room_reference",
    "run",
    "surfabet_patches",
    "table",
    "write_json",
]

INLIER_DISTANCE = 0.02
"""Metres within which a point counts as an inlier."""


def room_reference() -> sb.PointCloud:
    """The room of `ROOM` as the notes compare on it: all frames, one mean per 5 mm voxel."""
    return sb.voxel_downsample(sb.read(ROOM), 0.005)


def surfabet_patches(cloud: sb.PointCloud, resolution: float) -> tuple[Coded, Coded]:
    """Our patches through their file format: decoded as a thin surface, and as measured.

    Both at half a pixel, but not coarser than 5 mm: the spacing costs no bytes.
    """
    spacing = min(0.5 * resolution, 0.005)
    surface, measured = own.model(
        cloud, method="patches", spacing=spacing, resolution=resolution, completeness=0
    )
    return surface, measured


def _if_installed(peer: Callable[..., Coded], *arguments: Any) -> Coded | None:
    try:
        return peer(*arguments)
    except sb.MissingDependencyError as error:
        print(f"left out: {error}", file=sys.stderr)
        return None


def draco(cloud: sb.PointCloud, step: float, color_bits: int = 5) -> Coded | None:
    """Draco's kd-tree coder at its best level on the cells of a grid, with mean colours."""
    return _if_installed(peers.draco, cloud, step, color_bits)


def octomap(cloud: sb.PointCloud, step: float) -> Coded | None:
    """A pruned ColorOcTree of the occupied leaves alone: no free space, no ray casting."""
    return _if_installed(peers.octomap, cloud, step)


def laz(cloud: sb.PointCloud, step: float) -> Coded | None:
    """Voxel means as LAZ with coordinates of a millimetre."""
    return _if_installed(peers.laz, cloud, step)


def find_tmc3(given: Path | None) -> Path | None:
    """The encoder of G-PCC's test model, or None with a line that tells how to get it."""
    if given is not None:
        if (found := shutil.which(given)) is None:
            raise SystemExit(f"{given} is not a program; give the path of tmc3")
        return Path(found).resolve()
    try:
        return peers.find_tmc3()
    except sb.MissingDependencyError as error:
        print(f"left out: {error}, or give --tmc3", file=sys.stderr)
        return None


def measured(reference: sb.PointCloud, made: Coded) -> dict[str, Any]:
    """Bytes, seconds and errors of what a tool made, by name; metres, 0 to 255 for colours."""
    return {"bytes": made.bytes} | coded.measured(reference, made, INLIER_DISTANCE)


def table(header: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def number(value: float | None, digits: int = 0, scale: float = 1.0) -> str:
    """A number for a table, a dash for none."""
    return "-" if value is None else f"{value * scale:,.{digits}f}"


def write_json(path: Path, content: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
