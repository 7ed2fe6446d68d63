"""Compact 3D models of point clouds, learned from what recurs in them."""

from __future__ import annotations

from surfabet._core import PointCloud, __version__, get_num_threads, set_num_threads
from surfabet.alphabet import (
    Alphabet,
    AlphabetModel,
    FoundOccurrence,
    Occurrences,
    WordShares,
    learn_alphabet,
    place_similarity,
)
from surfabet.errors import (
    DroppedPointsWarning,
    FormatError,
    InvalidInputError,
    LostAttributeWarning,
    MissingDependencyError,
)
from surfabet.files import FileInfo, from_bytes, inspect, load
from surfabet.geometry import (
    KdTree,
    NormalEstimate,
    Octree,
    RangeImage,
    VoxelGrid,
    estimate_normals,
    voxel_downsample,
)
from surfabet.hscsm import PatchDictionary, Patches, PatchLevel, PatchModel
from surfabet.io import read, write
from surfabet.lattice import LatticeLevel, LatticeModel, LatticePatches
from surfabet.learning import LearningReport
from surfabet.metrics import Quality, RangeSigma, evaluate
from surfabet.patches import learn_patches

__all__ = [
    "Alphabet",
    "AlphabetModel",
    "DroppedPointsWarning",
    "FileInfo",
    "FormatError",
    "FoundOccurrence",
    "InvalidInputError",
    "KdTree",
    "LatticeLevel",
    "LatticeModel",
    "LatticePatches",
    "LearningReport",
    "LostAttributeWarning",
    "MissingDependencyError",
    "NormalEstimate",
    "Occurrences",
    "Octree",
    "PatchDictionary",
    "PatchLevel",
    "PatchModel",
    "Patches",
    "PointCloud",
    "Quality",
    "RangeImage",
    "RangeSigma",
    "VoxelGrid",
    "WordShares",
    "__version__",
    "estimate_normals",
    "evaluate",
    "from_bytes",
    "get_num_threads",
    "inspect",
    "learn_alphabet",
    "learn_patches",
    "load",
    "place_similarity",
    "read",
    "set_num_threads",
    "voxel_downsample",
    "write",
]
