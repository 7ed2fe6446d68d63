"""What the compression scripts of this folder share: peers that code a cloud, and one measure.

Every peer takes a coloured cloud and gives back its bytes and the cloud that a user gets from them.
A peer that is not installed gives None, with a line that tells how to get it.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from peer_bench import ROOM, load

import surfabet as sb

INLIER_DISTANCE = 0.02
"""Metres within which a point counts as an inlier."""


@dataclass(frozen=True)
class Coded:
    """What a tool made of a cloud."""

    bytes: int
    """All bytes."""
    geometry_bytes: int | None
    """Those of the geometry, where it can be told apart."""
    encode_seconds: float | None
    """Of all cores; None where only the binding's loop would be timed."""
    decode_seconds: float | None
    decoded: sb.PointCloud


GPCC_GEOMETRY = {
    "mergeDuplicatedPoints": 1,
    "partitionMethod": 0,
    "enforceLevelLimits": 0,
    "neighbourAvailBoundaryLog2": 8,
    "intra_pred_max_node_size_log2": 6,
    "planarEnabled": 1,
}
"""Options of G-PCC's geometry that the octree and trisoup share."""


@dataclass(frozen=True)
class GpccSetting:
    """Options of G-PCC's test model: octree where `node_log2` is 0, else trisoup."""

    step: float
    """Spacing of the coded grid, metres."""
    node_log2: int
    """Trisoup's nodes are `step` times two to this power."""
    qp: int
    """Quantiser of the colour; 4 is nearly lossless, 51 the coarsest."""

    @property
    def tool(self) -> str:
        return "G-PCC trisoup + RAHT" if self.node_log2 else "G-PCC octree + RAHT"

    @property
    def name(self) -> str:
        node = f", node {1e3 * self.step * 2**self.node_log2:g} mm" if self.node_log2 else ""
        return f"{1e3 * self.step:g} mm{node}, qp {self.qp}"

    def options(self) -> dict[str, object]:
        """Those of the geometry."""
        # Those of MPEG's common test conditions, except where another choice was better on the
        # room: one slice instead of slices of a million points, every voxel of trisoup's triangles
        # instead of so many as a slice may have, and one bit instead of two for its vertices.
        common = {
            # The input is in millimetres. All digits, as it becomes a fraction of small integers.
            "positionQuantizationScale": f"{1e-3 / self.step:.17g}",
            **GPCC_GEOMETRY,
            "trisoupNodeSizeLog2": self.node_log2,
        }
        if not self.node_log2:
            return common | {"maxNumQtBtBeforeOt": 4}
        return common | {
            "trisoup_sampling_value": 1,
            "trisoupQuantizationBits": 1,
            "inferredDirectCodingMode": 0,
        }

    def color(self) -> dict[str, object]:
        """Those of the colour."""
        return {"transformType": 0, "qp": self.qp, "qpChromaOffset": -2, "bitdepth": 8}


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


def cpu_seconds() -> float:
    """Seconds of this process and of those it waited for, on all cores."""
    return sum(os.times()[:4])


def room_reference() -> sb.PointCloud:
    """The room of `ROOM` as the notes compare on it: all frames, one mean per 5 mm voxel."""
    return sb.voxel_downsample(sb.read(ROOM), 0.005)


def centers(cloud: sb.PointCloud, step: float) -> tuple[np.ndarray, sb.PointCloud]:
    """Cells (n, 3) of a grid through the world's origin that hold points; their mean points."""
    means = sb.voxel_downsample(cloud, step)
    return np.floor(means.points / step).astype(np.int64), means


def surfabet_patches(cloud: sb.PointCloud, resolution: float) -> tuple[Coded, Coded]:
    """Our patches through their file format: decoded as a thin surface, and as measured.

    Both at half a pixel, but not coarser than 5 mm: the spacing costs no bytes.
    """
    spacing = min(0.5 * resolution, 0.005)
    began = cpu_seconds()
    data = sb.learn_patches(cloud, resolution=resolution, completeness=0).to_bytes()
    encode_seconds = cpu_seconds() - began
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.sfb"
        path.write_bytes(data)
        sections = sb.inspect(path).sections
    geometry = sum(size for name, size in sections.items() if "colour" not in name)

    def decoded(as_measured: bool) -> Coded:
        began = cpu_seconds()
        points = sb.from_bytes(data).decode(spacing, as_measured=as_measured)
        return Coded(len(data), geometry, encode_seconds, cpu_seconds() - began, points)

    return decoded(False), decoded(True)


def draco(cloud: sb.PointCloud, step: float, color_bits: int = 5) -> Coded | None:
    """Draco's kd-tree coder at its best level on the cells of a grid, with mean colours."""
    if not (peer := load("DracoPy")):
        return None
    began = cpu_seconds()
    cells, means = centers(cloud, step)
    # Cell centres, which the quantiser's grid holds exactly.
    points = (cells + 0.5) * step
    low = points.min(axis=0)
    extent = int((cells.max(axis=0) - cells.min(axis=0)).max()) + 1
    bits = int(np.ceil(np.log2(extent)))
    drop = 8 - color_bits
    options = {
        "quantization_bits": bits,
        "quantization_range": ((1 << bits) - 1) * step,
        "quantization_origin": low,
        "compression_level": 10,
    }
    data = peer.encode(points, colors=means.colors >> drop, **options)
    encoded = cpu_seconds()
    back = peer.decode(data)
    colors = np.asarray(back.colors)[:, :3].astype(np.uint8) << drop
    if drop:
        colors += 1 << (drop - 1)
    decoded = sb.PointCloud(np.asarray(back.points), colors=colors)
    seconds = cpu_seconds() - encoded
    geometry = len(peer.encode(points, **options))
    return Coded(len(data), geometry, encoded - began, seconds, decoded)


def octomap(cloud: sb.PointCloud, step: float) -> Coded | None:
    """A pruned ColorOcTree of the occupied leaves alone: no free space, no ray casting.

    Its geometry is the bytes of OctoMap's binary tree (`.bt`) of the same leaves.
    """
    if not (peer := load("pyoctomap")):
        return None
    cells, means = centers(cloud, step)
    points = (cells + 0.5) * step
    tree, bare = peer.ColorOcTree(step), peer.OcTree(step)
    for point, color in zip(points, means.colors.tolist(), strict=True):
        tree.updateNode(point, True, True)
        tree.setNodeColor(point, *color)
        bare.updateNode(point, True, True)
    tree.updateInnerOccupancy()
    tree.prune()
    bare.updateInnerOccupancy()
    with tempfile.TemporaryDirectory() as folder:
        full, binary = Path(folder) / "room.ot", Path(folder) / "room.bt"
        tree.write(str(full))
        # Prunes; a colour tree's would have the binding's own colours behind it.
        bare.writeBinary(str(binary))
        size, geometry = full.stat().st_size, binary.stat().st_size
    decoded = sb.PointCloud(points, colors=_pruned_colors(cells, means.colors))
    return Coded(size, geometry, None, None, decoded)


def _pruned_colors(cells: np.ndarray, colors: np.ndarray) -> np.ndarray:
    """Colours of leaves after pruning: eight equal children become one node of their mean."""
    colors = colors.astype(np.int64)
    # Nodes that are complete at this level: their cell and which of them holds each point.
    nodes, node_of = np.unique(cells, axis=0, return_inverse=True)
    holds = node_of.ravel()
    inside = np.arange(len(cells))
    values = np.zeros((len(nodes), 3), np.int64)
    values[holds] = colors
    while len(inside):
        parents, parent_of, counts = np.unique(
            nodes >> 1, axis=0, return_inverse=True, return_counts=True
        )
        parent_of = parent_of.ravel()
        sums = np.zeros((len(parents), 3), np.int64)
        np.add.at(sums, parent_of, values)
        full = counts == 8
        kept = full[parent_of[holds]]
        inside, holds = inside[kept], parent_of[holds[kept]]
        rank = np.cumsum(full) - 1
        holds = rank[holds]
        nodes, values = parents[full], sums[full] // 8
        colors[inside] = values[holds]
    return colors.astype(np.uint8)


def laz(cloud: sb.PointCloud, step: float) -> Coded | None:
    """Voxel means as LAZ with coordinates of a millimetre."""
    if not ((laspy := load("laspy")) and load("lazrs")):
        return None

    def write(path: Path, points: np.ndarray, colors: np.ndarray | None) -> int:
        # Colours in the high bytes alone: low bytes that repeat them cost half as much again.
        header = laspy.LasHeader(version="1.2", point_format=0 if colors is None else 2)
        header.scales, header.offsets = np.full(3, 1e-3), np.zeros(3)
        las = laspy.LasData(header)
        las.xyz = points
        if colors is not None:
            las.red, las.green, las.blue = colors.T.astype(np.uint16) << 8
        las.write(str(path))
        return path.stat().st_size

    with tempfile.TemporaryDirectory() as folder:
        path, bare = Path(folder) / "room.laz", Path(folder) / "bare.laz"
        began = cpu_seconds()
        means = sb.voxel_downsample(cloud, step)
        points = means.points
        size = write(path, points, means.colors)
        encoded = cpu_seconds()
        decoded = sb.read(path)
        seconds = cpu_seconds() - encoded
        return Coded(size, write(bare, points, None), encoded - began, seconds, decoded)


def find_program(given: Path | None, names: Sequence[str], advice: str) -> Path | None:
    """A program that was given or is on the PATH, or None with a line that tells how to get it."""
    if given is not None:
        if (found := shutil.which(given)) is None:
            raise SystemExit(f"{given} is not a program; give the path of {names[0]}")
        return Path(found).resolve()
    found = next((path for name in names if (path := shutil.which(name))), None)
    if found is None:
        print(f"{advice} (benches/peers/README.md)", file=sys.stderr)
        return None
    return Path(found).resolve()


def find_tmc3(given: Path | None) -> Path | None:
    """The encoder of G-PCC's test model, or None with a line that tells how to get it."""
    advice = (
        "G-PCC is left out: build tmc3 of github.com/MPEGGroup/mpeg-pcc-tmc13 and put it on the "
        "PATH, or give --tmc3"
    )
    return find_program(given, ["tmc3"], advice)


def find_gestm(given: Path | None) -> Path | None:
    """The encoder of GeS-TM, or None with a line that tells how to get it."""
    advice = (
        "GeS-TM is left out: build it and put it on the PATH as gestm (its own name is tmc3, like "
        "that of G-PCC), or give --gestm"
    )
    return find_program(given, ["gestm"], advice)


def mpeg(
    cloud: sb.PointCloud, options: Mapping[str, object], color: Mapping[str, object], program: Path
) -> Coded:
    """What MPEG's test models make of points in whole millimetres, by their own decoders.

    `options` are those of the geometry, `color` those of its one attribute.
    """
    millimetres = np.rint(cloud.points * 1e3).astype(np.int64)
    low = millimetres.min(axis=0)
    # The attribute ends the options of the colour, so it has to be the last.
    settings = {**options, **color, "attribute": "color"}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source, stream, back = (folder / n for n in ("in.ply", "cloud.bin", "out.ply"))
        # An origin of zero keeps coordinates of four bytes, the only ones that tmc3 reads.
        whole = (millimetres - low).astype(np.float32)
        sb.write(source, sb.PointCloud(whole, colors=cloud.colors, origin=(0, 0, 0)))
        began = cpu_seconds()
        log = run(
            program,
            "--mode=0",
            f"--uncompressedDataPath={source}",
            f"--compressedStreamPath={stream}",
            *(f"--{option}={value}" for option, value in settings.items()),
        )
        encoded = cpu_seconds()
        run(
            program,
            "--mode=1",
            f"--compressedStreamPath={stream}",
            f"--reconstructedDataPath={back}",
        )
        seconds = cpu_seconds() - encoded
        size = stream.stat().st_size
        colors = sum(int(n) for n in re.findall(r"colors bitstream size (\d+) B", log))
        again = sb.read(back)
    decoded = sb.PointCloud((again.points + low) / 1e3, colors=again.colors)
    # Headers count as geometry.
    return Coded(size, size - colors, encoded - began, seconds, decoded)


def gpcc(cloud: sb.PointCloud, setting: GpccSetting, tmc3: Path) -> Coded:
    """MPEG's geometry-based codec, its own decoder's output; points in whole millimetres."""
    return mpeg(cloud, setting.options(), setting.color(), tmc3)


def gestm(cloud: sb.PointCloud, setting: GesSetting, program: Path) -> Coded:
    """MPEG's codec of solid surfaces, its own decoder's output; points in whole millimetres."""
    return mpeg(cloud, setting.options(), setting.color(), program)


def run(*command: Path | str) -> str:
    """What a program prints; leaves with all of it where it fails."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}")
    return done.stdout


def measured(reference: sb.PointCloud, coded: Coded) -> dict[str, Any]:
    """Bytes, seconds and errors of what a tool made, by name; metres, 0 to 255 for colours."""
    q = sb.evaluate(reference, coded.decoded, sigma=INLIER_DISTANCE, normal_neighbors=None)
    assert q.color_rmse_forward is not None
    assert q.color_rmse_backward is not None
    sizes = {
        field.name: getattr(coded, field.name)
        for field in dataclasses.fields(coded)
        if field.name != "decoded"
    }
    return sizes | {
        "points": q.decoded_points,
        "rmse": q.rmse,
        "rmse_forward": q.rmse_forward,
        "rmse_backward": q.rmse_backward,
        "rmse_pooled": q.rmse_pooled,
        "p99_forward": q.p99_forward,
        "p99_backward": q.p99_backward,
        "inliers": q.inliers,
        "outliers": q.outliers,
        "color_rmse": max(q.color_rmse_forward, q.color_rmse_backward),
        "color_rmse_forward": q.color_rmse_forward,
        "color_rmse_backward": q.color_rmse_backward,
        "color_rmse_pooled": q.color_rmse_pooled,
    }


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
