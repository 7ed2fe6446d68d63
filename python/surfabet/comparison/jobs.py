"""What is compared: tools with their settings, and the tools that are not here."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from surfabet._core import PointCloud
from surfabet._methods import METHODS
from surfabet.comparison import own, peers
from surfabet.comparison.coded import Coded
from surfabet.errors import wrong_value
from surfabet.io._units import small_lengths

__all__ = ["TOOLS", "Job", "all_jobs", "missing"]

QUALITIES = ("small", "balanced", "fine")

STEPS = (0.5, 1.0, 2.0)
"""Steps of grids as multiples of the resolution that the cloud asks for."""

TRISOUP_STEPS = (0.5, 0.7, 1.0)
"""The same for trisoup, whose nodes are eight times larger: it is used for coarser models."""

OCTREE_QP, TRISOUP_QP = 34, 46
"""Colours of G-PCC: where its curves are lowest on the room (docs/benchmarks/patches.md)."""


@dataclass(frozen=True)
class Job:
    """One tool with one setting."""

    tool: str
    """As `TOOLS` names it."""
    label: str
    """The tool for people."""
    setting: str
    """The setting for people."""
    coder: str
    """As `CODERS` names it."""
    arguments: dict[str, Any] = field(default_factory=dict)
    """What the coder is called with; plain numbers and strings."""

    @property
    def ours(self) -> bool:
        """Whether it is a model of surfabet."""
        return self.coder == "model"


def _gpcc(cloud: PointCloud, *, step: float, node_log2: int, qp: int) -> Coded:
    setting = peers.GpccSetting(step, node_log2, qp)
    return peers.gpcc(cloud, setting, peers.find_tmc3())


CODERS: dict[str, Callable[..., Coded | list[Coded]]] = {
    "model": own.model,
    "draco": peers.draco,
    "draco_defaults": peers.draco_defaults,
    "laz": peers.laz,
    "octomap": peers.octomap,
    "voxel_zstd": peers.voxel_zstd,
    "open3d_planes": peers.open3d_planes,
    "gpcc": _gpcc,
}
"""What codes a cloud."""

_MODULES = {
    "draco": ("DracoPy", "DracoPy"),
    "laz": ("lazrs", "laspy[lazrs]"),
    "octomap": ("pyoctomap", "pyoctomap"),
    "open3d-planes": ("open3d", "open3d"),
}
"""The module that a tool needs, and the package that has it."""

TOOLS = (*METHODS, "draco", "laz", "copc", "octomap", "voxel-zstd", "open3d-planes", "gpcc")
"""All tools that can be compared."""


def missing(tool: str) -> str | None:
    """How to get a tool that is not here; None for those that are."""
    if tool in _MODULES:
        module, package = _MODULES[tool]
        absent = importlib.util.find_spec(module) is None
        return f"pip install '{package}'" if absent else None
    if tool == "voxel-zstd":
        modules = ("compression", "backports")
        if not any(_has_zstd(module) for module in modules):
            return "pip install backports.zstd"
    if tool == "gpcc" and shutil.which("tmc3") is None:
        return "build tmc3 of github.com/MPEGGroup/mpeg-pcc-tmc13 and put it on the PATH"
    if tool == "copc":
        return (
            "no Python package here writes COPC: laspy only reads it; its points take what LAZ has"
        )
    return None


def _has_zstd(parent: str) -> bool:
    try:
        return importlib.util.find_spec(f"{parent}.zstd") is not None
    except ImportError:
        return False


def all_jobs(
    tools: Sequence[str], resolution: float, max_error: float, *, colored: bool, unit: str
) -> Iterator[Job]:
    """All jobs of these tools.

    Parameters
    ----------
    tools
        Names of `TOOLS`.
    resolution
        Of the cloud: grids have half of it, it, and twice it.
    max_error
        The bound that patches are given in a row of their own.
    colored
        Whether the cloud has colours, and settings of colours are named.
    unit
        What lengths of the cloud are in, for settings.

    Raises
    ------
    InvalidInputError
        For an unknown tool.
    """
    for tool in tools:
        if tool not in TOOLS:
            raise wrong_value("tools", tools, f"of {', '.join(TOOLS)}")
        if missing(tool) is None:
            yield from _jobs_of(tool, resolution, max_error, colored, unit)


def _jobs_of(
    tool: str, resolution: float, max_error: float, colored: bool, unit: str
) -> Iterator[Job]:
    color = ", 5-bit colour" if colored else ""
    steps = [_rounded(factor * resolution) for factor in STEPS]
    if tool in METHODS:
        for quality in QUALITIES:
            options = {"method": tool, "quality": quality}
            yield Job(tool, f"surfabet {tool}", quality, "model", options)
        if tool == "patches":
            bounded = {"method": tool, "max_error": max_error}
            setting = f"within {_length(max_error, unit)}"
            yield Job(tool, f"surfabet {tool}", setting, "model", bounded)
    elif tool == "draco":
        yield Job(tool, "Draco", "defaults, all points", "draco_defaults")
        for step in steps:
            setting = f"level 10, {_length(step, unit)} grid{color}"
            yield Job(tool, "Draco", setting, "draco", {"step": step})
    elif tool == "laz":
        grid = _length(0.001, unit)
        yield Job(tool, "LAZ", f"{grid}, all points", "laz", {"step": None})
        for step in steps:
            yield Job(
                tool, "LAZ", f"{grid}, {_length(step, unit)} voxel means", "laz", {"step": step}
            )
    elif tool == "octomap":
        for step in steps:
            yield Job(
                tool, "OctoMap", f"occupied leaves, {_length(step, unit)}", tool, {"step": step}
            )
    elif tool == "voxel-zstd":
        for step in steps:
            setting = f"{_length(step, unit)}{color}"
            yield Job(tool, "voxel grid + zstd", setting, "voxel_zstd", {"step": step})
    elif tool == "open3d-planes":
        arguments = {"spacing": _rounded(resolution / 2)}
        yield Job(tool, "Open3D planes", "defaults", "open3d_planes", arguments)
    elif tool == "gpcc":
        trisoup = [_rounded(factor * resolution) for factor in TRISOUP_STEPS]
        yield from _gpcc_jobs(steps, trisoup, colored, unit)


def _gpcc_jobs(
    octree: list[float], trisoup: list[float], colored: bool, unit: str
) -> Iterator[Job]:
    settings = [peers.GpccSetting(step, 0, OCTREE_QP, unit) for step in octree]
    settings += [peers.GpccSetting(step, 3, TRISOUP_QP, unit) for step in trisoup]
    for of in settings:
        arguments = {"step": of.step, "node_log2": of.node_log2, "qp": of.qp}
        name, transform = of.name, " + RAHT"
        if not colored:
            name = name.rpartition(", ")[0]
            transform = ""
        yield Job("gpcc", of.tool.removesuffix(" + RAHT") + transform, name, "gpcc", arguments)


def _rounded(length: float) -> float:
    """To two digits, as a person would give it."""
    return float(f"{length:.2g}")


def _length(length: float, unit: str) -> str:
    if length >= 1:
        return f"{length:g} {unit}"
    factor, small = small_lengths(unit)
    return f"{factor * length:g} {small}"
