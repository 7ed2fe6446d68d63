"""Compact 3D models of point clouds, learned from what recurs in them."""

from __future__ import annotations

import os

from surfabet import _interrupt  # noqa: F401 - first: Ctrl-C while the others are imported
from surfabet._core import PointCloud, __version__, get_num_threads, note_fork, set_num_threads
from surfabet.alphabet import (
    Alphabet,
    AlphabetModel,
    FoundOccurrence,
    Occurrences,
    WordShares,
    learn_alphabet,
    place_similarity,
)
from surfabet.bic_alphabet import BicAlphabet, BicAlphabetModel, learn_bic_alphabet
from surfabet.diff import Change, Changes, diff
from surfabet.errors import (
    DroppedPointsWarning,
    FormatError,
    FrameWarning,
    IncompleteModelWarning,
    IncompleteReadWarning,
    InvalidInputError,
    InvalidTypeError,
    LostAttributeWarning,
    MissingDependencyError,
    UnitWarning,
)
from surfabet.files import FileInfo, from_bytes, inspect, load
from surfabet.gas import GasModel, Neurons, learn_gas
from surfabet.geometry import (
    KdTree,
    NormalEstimate,
    Octree,
    RangeImage,
    VoxelGrid,
    estimate_normals,
    farthest_point_downsample,
    octree_downsample,
    random_downsample,
    voxel_downsample,
)
from surfabet.hscsm import HscsmDictionary, HscsmModel, Patches, PatchLevel, learn_hscsm
from surfabet.io import read, write
from surfabet.learning import AttributeFigures, LearningReport
from surfabet.locate import Localizer, Location, Locations
from surfabet.meshes import Mesh
from surfabet.metrics import AttributeErrors, Quality, RangeSigma, evaluate
from surfabet.navigation import NavigationGraph
from surfabet.patches import (
    LatticeInstance,
    LatticeLevel,
    LatticePatches,
    PatchModel,
    learn_patches,
)
from surfabet.places import PlaceIndex, PlaceKinds, PlaceMatch, label_places, place_index
from surfabet.planes import (
    PlaneFit,
    PlaneMesh,
    PlaneModel,
    Planes,
    fit_planes_em,
    learn_planes,
    random_planes,
)
from surfabet.recurring import RecurringClass, RecurringClasses, recurring
from surfabet.survey import Survey, survey
from surfabet.tiles import TiledPatchModel, Tiles, merge_tiles
from surfabet.tiling import TilingReport, learn_patches_tiled
from surfabet.view import view

if hasattr(os, "register_at_fork"):
    # A forked process has none of the threads of its parent.
    os.register_at_fork(after_in_child=note_fork)

__all__ = [
    "Alphabet",
    "AlphabetModel",
    "AttributeErrors",
    "AttributeFigures",
    "BicAlphabet",
    "BicAlphabetModel",
    "Change",
    "Changes",
    "DroppedPointsWarning",
    "FileInfo",
    "FormatError",
    "FoundOccurrence",
    "FrameWarning",
    "GasModel",
    "HscsmDictionary",
    "HscsmModel",
    "IncompleteModelWarning",
    "IncompleteReadWarning",
    "InvalidInputError",
    "InvalidTypeError",
    "KdTree",
    "LatticeInstance",
    "LatticeLevel",
    "LatticePatches",
    "LearningReport",
    "Localizer",
    "Location",
    "Locations",
    "LostAttributeWarning",
    "Mesh",
    "MissingDependencyError",
    "NavigationGraph",
    "Neurons",
    "NormalEstimate",
    "Occurrences",
    "Octree",
    "PatchLevel",
    "PatchModel",
    "Patches",
    "PlaceIndex",
    "PlaceKinds",
    "PlaceMatch",
    "PlaneFit",
    "PlaneMesh",
    "PlaneModel",
    "Planes",
    "PointCloud",
    "Quality",
    "RangeImage",
    "RangeSigma",
    "RecurringClass",
    "RecurringClasses",
    "Survey",
    "TiledPatchModel",
    "Tiles",
    "TilingReport",
    "UnitWarning",
    "VoxelGrid",
    "WordShares",
    "__version__",
    "diff",
    "estimate_normals",
    "evaluate",
    "farthest_point_downsample",
    "fit_planes_em",
    "from_bytes",
    "get_num_threads",
    "inspect",
    "label_places",
    "learn_alphabet",
    "learn_bic_alphabet",
    "learn_gas",
    "learn_hscsm",
    "learn_patches",
    "learn_patches_tiled",
    "learn_planes",
    "load",
    "merge_tiles",
    "octree_downsample",
    "place_index",
    "place_similarity",
    "random_downsample",
    "random_planes",
    "read",
    "recurring",
    "set_num_threads",
    "survey",
    "view",
    "voxel_downsample",
    "write",
]
