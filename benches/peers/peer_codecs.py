"""What the compression scripts of this folder share; the peers are in `surfabet.comparison`.

A peer that is not installed gives None, with a line that tells how to get it.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from peer_bench import ROOM

import surfabet as sb
from surfabet.comparison import coded, own, peers
from surfabet.comparison.coded import Coded, cpu_seconds
from surfabet.comparison.peers import GPCC_GEOMETRY, GpccSetting, gpcc, mpeg, run

__all__ = [
    "GPCC_GEOMETRY",
    "INLIER_DISTANCE",
    "Coded",
    "GesSetting",
    "GpccSetting",
    "cpu_seconds",
    "draco",
    "find_gestm",
    "find_tmc3",
    "gestm",
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


@dataclass(frozen=True)
class GesSetting:
    """Options of GeS-TM, MPEG's test model of solid surfaces: always trisoup."""

    step: float
    """Spacing of the coded grid, metres."""
    node: int
    """Side of trisoup's nodes in voxels, at least 4."""
    thickness: int
    """Of the decoded surface, in 256ths of a voxel to either side."""
    vertex_qp: int
    """Quantiser of vertices along edges; 12 is a voxel, 18 two."""
    qp: int
    """Quantiser of the colour; 4 is nearly lossless, 51 the coarsest."""
    tool: ClassVar[str] = "GeS-TM"

    @property
    def name(self) -> str:
        thickness = 1e3 * self.step * self.thickness / 256
        return (
            f"{1e3 * self.step:g} mm, node {1e3 * self.step * self.node:g} mm,"
            f" thickness {thickness:g} mm, vertex qp {self.vertex_qp}, qp {self.qp}"
        )

    def options(self) -> dict[str, object]:
        """Those of the geometry."""
        # Those of its common test conditions, which are the program's defaults too, but for one
        # slice instead of a limit of points. The thickness decides how it does on noisy surfaces:
        # the conditions have 24 to 40, a tenth of a voxel, for clean ones.
        return {
            "sequenceScale": f"{1e-3 / self.step:.17g}",
            "partitionMethod": 0,
            "enforceLevelLimits": 0,
            "trisoupNodeSize": self.node,
            "trisoupQuantizationQP": self.vertex_qp,
            "trisoupThickness": self.thickness,
        }

    def color(self) -> dict[str, object]:
        """Those of the colour."""
        return {
            "localizedAttributesSlabThickness": 4096,
            "qp": self.qp,
            "qpChromaOffset": 0,
            "bitdepth": 8,
        }


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


def _given(program: Path, name: str) -> Path:
    if (found := shutil.which(program)) is None:
        raise SystemExit(f"{program} is not a program; give the path of {name}")
    return Path(found).resolve()


def find_gestm(given: Path | None) -> Path | None:
    """The encoder of GeS-TM, or None with a line that tells how to get it."""
    if given is not None:
        return _given(given, "gestm")
    if (found := shutil.which("gestm")) is not None:
        return Path(found).resolve()
    print(
        "left out: GeS-TM; build it and put it on the PATH as gestm (its own name is tmc3, like "
        "that of G-PCC), or give --gestm (benches/peers/README.md)",
        file=sys.stderr,
    )
    return None


def gestm(cloud: sb.PointCloud, setting: GesSetting, program: Path) -> Coded:
    """MPEG's codec of solid surfaces, its own decoder's output; points in whole millimetres."""
    return mpeg(cloud, setting.options(), setting.color(), program)


def find_tmc3(given: Path | None) -> Path | None:
    """The encoder of G-PCC's test model, or None with a line that tells how to get it."""
    if given is not None:
        return _given(given, "tmc3")
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
