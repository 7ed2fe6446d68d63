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
from surfabet.io import read, write

__all__ = [
    "DroppedPointsWarning",
    "FormatError",
    "InvalidInputError",
    "LostAttributeWarning",
    "MissingDependencyError",
    "PointCloud",
    "__version__",
    "get_num_threads",
    "read",
    "set_num_threads",
    "write",
]
