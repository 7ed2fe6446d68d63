"""Neighbours, normals, voxel grids, octrees and range images of point clouds.

The classes are documented where they are defined; all of them are immutable, exact and independent
of the number of threads. Their `progress` is a callable of stage and fraction, called from the
calling thread.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._core import KdTree, Octree, PointCloud, RangeImage, VoxelGrid
from surfabet._progress import Progress, progress_callback

__all__ = [
    "KdTree",
    "NormalEstimate",
    "Octree",
    "RangeImage",
    "VoxelGrid",
    "estimate_normals",
    "voxel_downsample",
]


class NormalEstimate(NamedTuple):
    """What `estimate_normals` found."""

    cloud: PointCloud
    """The cloud with its normals, (n, 3) unit vectors, zero where unknown."""
    curvatures: NDArray[np.float32]
    """(n,) share of the variance along the normal, 0 on a plane and at most 1/3."""
    unknown: int
    """How many normals are unknown: fewer than three neighbours, or all of them on a line."""


def estimate_normals(
    cloud: PointCloud,
    *,
    neighbors: int | None = 16,
    radius: float | None = None,
    progress: Progress = None,
) -> NormalEstimate:
    """Fit a plane to the neighbours of each point, the point itself included.

    A normal points to where its point was measured from where the cloud knows, else so that its
    largest component is positive.

    Parameters
    ----------
    cloud
        The points.
    neighbors
        How many nearest points; with `radius`, at most that many. None takes all within `radius`.
    radius
        Largest distance of a neighbour in metres.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For fewer than three neighbours, a radius that is not positive, or neither of both.
    """
    with progress_callback(progress) as callback:
        return NormalEstimate(*_core.estimate_normals(cloud, neighbors, radius, callback))


def voxel_downsample(
    cloud: PointCloud,
    size: float,
    *,
    weights: ArrayLike | None = None,
    progress: Progress = None,
) -> PointCloud:
    """One point per occupied cube with edges of `size` metres: the mean in every attribute.

    Cubes are aligned to the world's axes and origin; points come out in their order (x, then y,
    then z). Normals are averaged as directions, unknown ranges are left out, and the viewpoint is
    the one with the most weight.

    Parameters
    ----------
    cloud
        The points.
    size
        Edge length in metres.
    weights
        (n,) positive numbers; without them all points count the same.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For a size that is not positive or too small to number the cubes, or weights that are not
        positive.
    """
    with progress_callback(progress) as callback:
        return VoxelGrid(cloud, size, progress=callback).means(weights, progress=callback)
