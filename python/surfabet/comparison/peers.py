"""Other tools: each takes a cloud, and gives its bytes and the cloud that a user gets from them.

Grids go through the world's zero. Where numbers are single precision, they are relative to a corner
of the cloud. A tool that is not installed is a `MissingDependencyError` that says how to get it.
"""

from __future__ import annotations

import importlib
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.comparison.coded import Coded, cpu_seconds
from surfabet.errors import InvalidInputError, MissingDependencyError
from surfabet.geometry import voxel_downsample
from surfabet.io import read, write
from surfabet.io._packed import zstd_module
from surfabet.io._units import small_lengths

__all__ = [
    "GPCC_GEOMETRY",
    "GpccSetting",
    "draco",
    "draco_defaults",
    "find_tmc3",
    "gpcc",
    "laz",
    "mpeg",
    "octomap",
    "open3d_planes",
    "run",
    "voxel_zstd",
]

HALF_DIAGONAL = float(np.sqrt(3) / 2)
"""Of a cell of side one: how far a point can be from its centre."""

_OCTOMAP_CELLS = 1 << 15
"""OctoMap numbers cells from minus this to below this."""

_ZSTD_LEVEL = 19
"""The highest that takes no more memory for decoding."""

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
    unit: str = "m"
    """What lengths are in, for the name."""

    @property
    def tool(self) -> str:
        return "G-PCC trisoup + RAHT" if self.node_log2 else "G-PCC octree + RAHT"

    @property
    def name(self) -> str:
        factor, unit = small_lengths(self.unit)
        step = factor * self.step
        node = f", node {step * 2**self.node_log2:g} {unit}" if self.node_log2 else ""
        return f"{step:g} {unit}{node}, qp {self.qp}"

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


def _peer(name: str, tool: str, package: str | None = None) -> Any:
    """The module of a tool."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingDependencyError(
            f"{tool} needs the package {name}: pip install '{package or name}'"
        ) from error


def _cells(cloud: PointCloud, step: float) -> tuple[NDArray[np.int64], PointCloud]:
    """Cells (n, 3) of a grid through the world's zero that hold points; their mean points."""
    means = voxel_downsample(cloud, step)
    return np.floor(means.points / step).astype(np.int64), means


def _centers(cells: NDArray[np.int64], step: float, colors: NDArray[np.uint8] | None) -> PointCloud:
    return PointCloud((cells + 0.5) * step, colors=colors)


def _coarser(colors: NDArray[np.uint8], bits: int) -> NDArray[np.uint8]:
    """The highest bits of colours, as small numbers."""
    coarse: NDArray[np.uint8] = colors >> np.uint8(8 - bits)
    return coarse


def _finer(colors: NDArray[np.uint8], bits: int) -> NDArray[np.uint8]:
    """The middle of what has these highest bits."""
    drop = 8 - bits
    middle = (1 << drop) >> 1
    back: NDArray[np.uint8] = (colors.astype(np.uint8) << np.uint8(drop)) | np.uint8(middle)
    return back


def draco(cloud: PointCloud, step: float, color_bits: int = 5) -> Coded:
    """Draco's kd-tree coder at its best level on the cells of a grid, with mean colours."""
    peer = _peer("DracoPy", "Draco")
    began = cpu_seconds()
    cells, means = _cells(cloud, step)
    # Cell centres, which the quantiser's grid holds exactly.
    low = cells.min(axis=0)
    points = (cells - low + 0.5) * step
    bits = max(1, int(np.ceil(np.log2(int((cells - low).max()) + 1))))
    options = {
        "quantization_bits": bits,
        "quantization_range": ((1 << bits) - 1) * step,
        "quantization_origin": np.full(3, 0.5 * step),
        "compression_level": 10,
    }
    colors = means.colors
    coarse = {} if colors is None else {"colors": _coarser(colors, color_bits)}
    data = peer.encode(points, **coarse, **options)
    encoded = cpu_seconds()
    back = peer.decode(data)
    kept = None if colors is None else _finer(np.asarray(back.colors)[:, :3], color_bits)
    decoded = PointCloud(np.asarray(back.points, np.float64) + low * step, colors=kept)
    seconds = cpu_seconds() - encoded
    geometry = len(peer.encode(points, **options))
    bound = HALF_DIAGONAL * step
    return Coded(len(data), geometry, encoded - began, seconds, decoded, bound=bound)


def draco_defaults(cloud: PointCloud) -> Coded:
    """Draco on all points with nothing but the defaults of its Python package."""
    peer = _peer("DracoPy", "Draco")
    began = cpu_seconds()
    low = cloud.points.min(axis=0)
    colored = {} if cloud.colors is None else {"colors": cloud.colors}
    data = peer.encode(cloud.points - low, **colored)
    encoded = cpu_seconds()
    back = peer.decode(data)
    colors = None if cloud.colors is None else np.asarray(back.colors)[:, :3].astype(np.uint8)
    decoded = PointCloud(np.asarray(back.points, np.float64) + low, colors=colors)
    return Coded(len(data), None, encoded - began, cpu_seconds() - encoded, decoded)


def octomap(cloud: PointCloud, step: float) -> Coded:
    """A pruned ColorOcTree of the occupied leaves alone: no free space, no ray casting.

    Its geometry is the bytes of OctoMap's binary tree (`.bt`) of the same leaves, and these are all
    bytes of a cloud without colours.
    """
    peer = _peer("pyoctomap", "OctoMap")
    cells, means = _cells(cloud, step)
    # A tree reaches so far around zero only; clouds in map coordinates are moved there.
    shift = np.zeros(3, np.int64)
    if np.abs(cells).max() >= _OCTOMAP_CELLS:
        shift = (cells.min(axis=0) + cells.max(axis=0)) // 2
    if np.ptp(cells, axis=0).max() >= 2 * _OCTOMAP_CELLS - 2:
        raise InvalidInputError(
            f"OctoMap has {2 * _OCTOMAP_CELLS} cells along an axis, but the cloud has "
            f"{np.ptp(cells, axis=0).max()} of {step:g} m"
        )
    points = (cells - shift + 0.5) * step
    bare = peer.OcTree(step)
    for point in points:
        bare.updateNode(point, True, True)
    bare.updateInnerOccupancy()
    with tempfile.TemporaryDirectory() as folder:
        full, binary = Path(folder) / "room.ot", Path(folder) / "room.bt"
        # Prunes; a colour tree's would have the binding's own colours behind it.
        bare.writeBinary(str(binary))
        size = geometry = binary.stat().st_size
        colors = means.colors
        if colors is not None:
            tree = peer.ColorOcTree(step)
            for point, color in zip(points, colors.tolist(), strict=True):
                tree.updateNode(point, True, True)
                tree.setNodeColor(point, *color)
            tree.updateInnerOccupancy()
            tree.prune()
            tree.write(str(full))
            size = full.stat().st_size
            colors = _pruned_colors(cells - shift, colors)
    decoded = _centers(cells, step, colors)
    return Coded(size, geometry, None, None, decoded, bound=HALF_DIAGONAL * step)


def _pruned_colors(cells: NDArray[np.int64], colors: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours of leaves after pruning: eight equal children become one node of their mean."""
    found = colors.astype(np.int64)
    # Nodes that are complete at this level: their cell and which of them holds each point.
    nodes, node_of = np.unique(cells, axis=0, return_inverse=True)
    holds = node_of.ravel()
    inside = np.arange(len(cells))
    values = np.zeros((len(nodes), 3), np.int64)
    values[holds] = found
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
        found[inside] = values[holds]
    return found.astype(np.uint8)


def laz(cloud: PointCloud, step: float | None) -> Coded:
    """Voxel means, or all points without a step, as LAZ with coordinates of a millimetre."""
    laspy = _peer("laspy", "LAZ", "laspy[lazrs]")
    _peer("lazrs", "LAZ", "laspy[lazrs]")
    scale = 1e-3

    def packed(path: Path, points: NDArray[np.float64], colors: NDArray[np.uint8] | None) -> int:
        # Colours in the high bytes alone: low bytes that repeat them cost half as much again.
        header = laspy.LasHeader(version="1.2", point_format=0 if colors is None else 2)
        header.scales = np.full(3, scale)
        # Of whole metres: coordinates are 32-bit numbers of steps from here.
        header.offsets = np.zeros(3) if np.abs(points).max() < 1e6 else np.floor(points.min(axis=0))
        las = laspy.LasData(header)
        las.xyz = points
        if colors is not None:
            las.red, las.green, las.blue = colors.T.astype(np.uint16) << 8
        las.write(str(path))
        return path.stat().st_size

    with tempfile.TemporaryDirectory() as folder:
        path, bare = Path(folder) / "room.laz", Path(folder) / "bare.laz"
        began = cpu_seconds()
        means = cloud if step is None else voxel_downsample(cloud, step)
        points = means.points
        size = packed(path, points, means.colors)
        encoded = cpu_seconds()
        decoded = read(path)
        seconds = cpu_seconds() - encoded
        geometry = size if means.colors is None else packed(bare, points, None)
    # A mean can be in any corner of its cell, and a point in the opposite one.
    bound = HALF_DIAGONAL * (scale + 2 * (step or 0))
    return Coded(size, geometry, encoded - began, seconds, decoded, bound=bound)


def voxel_zstd(cloud: PointCloud, step: float, color_bits: int = 5) -> Coded:
    """Cells of a grid with mean colours, sorted, as differences, packed by zstd.

    Columns of x, y and z hold the difference to the row before, as bytes by significance; colours
    follow channel by channel.
    """
    zstd = zstd_module()
    began = cpu_seconds()
    cells, means = _cells(cloud, step)
    order = np.lexsort(cells.T[::-1])
    cells = cells[order]
    low = cells.min(axis=0)
    steps = np.diff(cells - low, axis=0, prepend=0).astype("<i4")
    # One plane of bytes after the other: those of high significance are nearly all alike.
    raw = np.ascontiguousarray(steps.T).view(np.uint8).reshape(3, -1, 4).transpose(0, 2, 1)
    geometry = zstd.compress(raw.tobytes(), level=_ZSTD_LEVEL)
    colors = b""
    if means.colors is not None:
        coarse = _coarser(means.colors[order], color_bits)
        colors = zstd.compress(np.ascontiguousarray(coarse.T).tobytes(), level=_ZSTD_LEVEL)
    encoded = cpu_seconds()
    planes = np.frombuffer(zstd.decompress(geometry), np.uint8).reshape(3, 4, -1)
    columns = np.ascontiguousarray(planes.transpose(0, 2, 1)).view("<i4")[..., 0]
    kept = None
    if colors:
        channels = np.frombuffer(zstd.decompress(colors), np.uint8).reshape(3, -1)
        kept = _finer(channels.T, color_bits)
    decoded = _centers(np.cumsum(columns.T, axis=0, dtype=np.int64) + low, step, kept)
    seconds = cpu_seconds() - encoded
    # The corner as three 64-bit numbers, the step and the count.
    head = 5 * 8
    size = head + len(geometry) + len(colors)
    bound = HALF_DIAGONAL * step
    return Coded(size, head + len(geometry), encoded - began, seconds, decoded, bound=bound)


def open3d_planes(cloud: PointCloud, spacing: float) -> Coded:
    """Planar patches of Open3D at its defaults, decoded as filled rectangles.

    It has no file of them: eight single-precision numbers each (centre, rotation, both sides) are
    counted. They have no colours.
    """
    peer = _peer("open3d", "planes of Open3D")
    began = cpu_seconds()
    points = peer.geometry.PointCloud(peer.utility.Vector3dVector(cloud.local_points))
    points.estimate_normals()
    boxes = points.detect_planar_patches()
    encoded = cpu_seconds()
    parts = []
    for box in boxes:
        sides = np.asarray(box.extent)
        first, second = np.sort(np.argsort(sides)[1:])
        axes = np.asarray(box.R)
        across, along = (
            np.arange(-sides[side] / 2, sides[side] / 2 + spacing / 2, spacing)
            for side in (first, second)
        )
        u, v = (grid.ravel()[:, None] for grid in np.meshgrid(across, along))
        parts.append(np.asarray(box.center) + u * axes[:, first] + v * axes[:, second])
    if not parts:
        raise InvalidInputError("Open3D found no planar patch")
    decoded = PointCloud(np.concatenate(parts) + np.asarray(cloud.origin))
    size = 32 * len(boxes)
    return Coded(size, size, encoded - began, cpu_seconds() - encoded, decoded)


def find_tmc3() -> Path:
    """The encoder of G-PCC's test model on the PATH."""
    if (found := shutil.which("tmc3")) is None:
        raise MissingDependencyError(
            "G-PCC needs its test model: build tmc3 of github.com/MPEGGroup/mpeg-pcc-tmc13 and put "
            "it on the PATH"
        )
    return Path(found).resolve()


def gpcc(cloud: PointCloud, setting: GpccSetting, tmc3: Path) -> Coded:
    """MPEG's geometry-based codec, its own decoder's output; points in whole millimetres."""
    # The octree rounds to its grid and the millimetre before it; trisoup bounds nothing.
    bound = None if setting.node_log2 else HALF_DIAGONAL * (setting.step + 1e-3)
    return replace(mpeg(cloud, setting.options(), setting.color(), tmc3), bound=bound)


def mpeg(
    cloud: PointCloud, options: Mapping[str, object], color: Mapping[str, object], program: Path
) -> Coded:
    """What MPEG's test models make of points in whole millimetres, by their own decoders.

    `options` are those of the geometry, `color` those of the colour, where the cloud has one.
    """
    millimetres = np.rint(cloud.points * 1e3).astype(np.int64)
    low = millimetres.min(axis=0)
    colored = cloud.colors is not None
    # The attribute ends the options of the colour, so it has to be the last.
    settings = {**options, **color, "attribute": "color"} if colored else options
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source, stream, back = (folder / n for n in ("in.ply", "cloud.bin", "out.ply"))
        # An origin of zero keeps coordinates of four bytes, the only ones that these programs read.
        whole = (millimetres - low).astype(np.float32)
        write(source, PointCloud(whole, colors=cloud.colors, origin=(0, 0, 0)))
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
        again = read(back)
    decoded = PointCloud((again.points + low) / 1e3, colors=again.colors if colored else None)
    # Headers count as geometry.
    return Coded(size, size - colors, encoded - began, seconds, decoded)


def run(*command: Path | str) -> str:
    """What a program prints.

    Raises
    ------
    InvalidInputError
        With all of it where the program fails.
    """
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        raise InvalidInputError(f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}")
    return done.stdout
