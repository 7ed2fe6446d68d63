"""Compact 3D models of point clouds, learned from what recurs in them."""

from __future__ import annotations

from surfabet._core import PointCloud, __version__, get_num_threads, set_num_threads
from surfabet.errors import (
    DroppedPointsWarning,
    FormatError,
    InvalidInputError,
    LostAttributeWarning,
    MissingDependencyError,
)
from surfabet.files import FileInfo, from_bytes, inspect, load
from surfabet.io import read, write
from surfabet.geometry import (
    KdTree,
    NormalEstimate,
    Octree,
    RangeImage,
    VoxelGrid,
    estimate_normals,
    voxel_downsample,
)
from surfabet.metrics import Quality, RangeSigma, evaluate
from surfabet.patches import LearningReport, PatchLevel, PatchModel, learn_patches

__all__ = [
    "FileInfo",
    "from_bytes",
    "inspect",
    "load",
    "LearningReport",
    "PatchLevel",
    "PatchModel",
    "learn_patches",
    "DroppedPointsWarning",
    "FormatError",
    "InvalidInputError",
    "KdTree",
    "LostAttributeWarning",
    "MissingDependencyError",
    "NormalEstimate",
    "Octree",
    "PointCloud",
    "Quality",
    "RangeImage",
    "RangeSigma",
    "VoxelGrid",
    "__version__",
    "estimate_normals",
    "evaluate",
    "get_num_threads",
    "read",
    "set_num_threads",
    "write",
    "voxel_downsample",
]
