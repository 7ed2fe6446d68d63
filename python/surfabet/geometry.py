"""Neighbours, normals, voxel grids, octrees and range images of point clouds.

The classes are documented where they are defined; all of them are immutable, exact and independent
of the number of threads. Their `progress` is a callable of stage and fraction, called from the
calling thread.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._checks import check_choice, check_cloud, check_integer, check_number
from surfabet._core import KdTree, Octree, PointCloud, RangeImage, VoxelGrid
from surfabet._progress import Progress, progress_callback
from surfabet.errors import InvalidInputError

__all__ = [
    "KdTree",
    "NormalEstimate",
    "Octree",
    "RangeImage",
    "VoxelGrid",
    "estimate_normals",
    "farthest_point_downsample",
    "octree_downsample",
    "random_downsample",
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
    if neighbors is not None:
        check_integer("neighbors", neighbors, 3)
    if radius is not None:
        check_number("radius", radius, "a positive number of metres", above=0.0)
    with progress_callback(progress) as callback:
        return NormalEstimate(*_core.estimate_normals(cloud, neighbors, radius, callback))


def voxel_downsample(
    cloud: PointCloud,
    size: float | None = None,
    *,
    count: int | None = None,
    weights: ArrayLike | None = None,
    progress: Progress = None,
) -> PointCloud:
    """One point per occupied cube with edges of `size` metres: the mean in every attribute.

    Cubes are aligned to the world's axes and origin; points come out in their order (x, then y,
    then z). Normals are averaged as directions, unknown ranges are left out, and the viewpoint is
    the one with the most weight; so is an integer of an extra column, which labels or counts.

    Parameters
    ----------
    cloud
        The points.
    size
        Edge length in metres.
    count
        Instead of a size, the most points to keep: the smallest size found that gives no more,
        which seldom is below 99.5 percent of them.
    weights
        (n,) positive numbers; without them all points count the same.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For a size that is not positive or too small to number the cubes, both size and count or
        neither, a count that no size gives, or weights that are not positive.
    """
    _check_one_of(size, count)
    with progress_callback(progress) as callback:
        if size is not None:
            grid = VoxelGrid(cloud, size, progress=callback)
        else:
            assert count is not None
            grid = VoxelGrid.with_at_most(cloud, count, progress=callback)
        return grid.means(weights, progress=callback)


def octree_downsample(
    cloud: PointCloud,
    size: float | None = None,
    *,
    count: int | None = None,
    representative: Literal["centroid", "center"] = "centroid",
    progress: Progress = None,
) -> PointCloud:
    """One point per occupied leaf of an octree that starts at the cloud's own lower corner.

    Parameters
    ----------
    cloud
        The points; only positions are kept.
    size
        Edge length of the leaves in metres.
    count
        Instead of a size, the most points to keep: the smallest size found that gives no more.
    representative
        The mean of a leaf's points, or its centre.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For a size that is not positive or takes more than 21 levels, both size and count or
        neither, or another representative.
    """
    check_choice("representative", representative, ("centroid", "center"))
    _check_one_of(size, count)
    with progress_callback(progress) as callback:
        if size is not None:
            tree = Octree(cloud, size, progress=callback)
        else:
            assert count is not None
            tree = Octree.with_at_most(cloud, count, progress=callback)
    return PointCloud(tree.centers() if representative == "center" else tree.centroids())


def _check_one_of(size: float | None, count: int | None) -> None:
    if size is not None:
        check_number("size", size, "a positive number of metres", above=0.0)
    if count is not None:
        check_integer("count", count, 1)
    if (size is None) == (count is None):
        raise InvalidInputError(f"size is {size} and count is {count}; give one of both")


def random_downsample(cloud: PointCloud, count: int, *, random_state: int = 0) -> PointCloud:
    """`count` points drawn at random without repetition, in the order of the cloud.

    Raises
    ------
    InvalidInputError
        For more points than there are.
    """
    check_cloud("cloud", cloud)
    check_integer("count", count, 0)
    check_integer("random_state", random_state, 0)
    return _core.random_downsample(cloud, count, random_state)


def farthest_point_downsample(
    cloud: PointCloud,
    count: int,
    *,
    start: int = 0,
    progress: Progress = None,
) -> PointCloud:
    """`count` points, each the farthest from all before it, beginning with point `start`.

    Raises
    ------
    InvalidInputError
        For more points than there are, or a start that is none.
    """
    check_cloud("cloud", cloud)
    check_integer("count", count, 0)
    check_integer("start", start, 0)
    with progress_callback(progress) as callback:
        return _core.farthest_point_downsample(cloud, count, start, callback)
