"""Planes: a cloud as planar patches with tiles, by EM with split and merge.

Walls, floors, roofs and other flat surfaces become rectangles, cut into tiles of which those count
that points support. How many there are is found out, not given.

Lakaemper and Latecki: Extended EM for Planar Approximation of 3D Data, ICRA 2006.
"""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._checks import check_integer, check_number
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.errors import IncompleteModelWarning
from surfabet.io._files import export
from surfabet.io.polygons import WRITERS, Surface
from surfabet.model import Model

__all__ = [
    "PlaneFit",
    "PlaneMesh",
    "PlaneModel",
    "Planes",
    "fit_planes_em",
    "learn_planes",
    "random_planes",
]


@dataclass(frozen=True, slots=True)
class Planes:
    """All n patches of a model as arrays; those that most points support come first."""

    centers: NDArray[np.float64]
    """World positions of the rectangles' middles, (n, 3), metres."""
    axes: NDArray[np.float64]
    """Orthonormal axes as rows, (n, 3, 3): along the rectangle's first side, along its second, and
    the normal, towards where the surface was seen from if the scan knew."""
    extents: NDArray[np.float64]
    """Sides of the rectangles along the first two axes, (n, 2), metres."""
    standard_deviations: NDArray[np.float64]
    """Standard deviation of the supporting points about the plane, (n,), metres."""
    counts: NDArray[np.float64]
    """Points that support each patch, (n,), to a quarter of a doubling."""
    areas: NDArray[np.float64]
    """Areas of the supported tiles, (n,), square metres."""
    tile_edges: NDArray[np.float64]
    """Sides of the tiles, (n,), metres: the grid size, or it times a power of two."""
    supported: list[NDArray[np.bool_]]
    """For each patch, which tiles are supported: tiles along the first axis are columns, along the
    second rows. The last column and row may be narrower than the others."""
    colors: list[NDArray[np.uint8]] | None
    """For each patch the mean colours of its supported tiles, (k, 3), row by row; None without."""
    intensities: list[NDArray[np.float32]] | None
    """For each patch the mean intensities of its supported tiles, (k,), row by row; None
    without."""
    planar: NDArray[np.bool_]
    """Whether the points are as near to the plane as the grid size lets expect, (n,): a standard
    deviation of half the grid size at most."""

    @property
    def normals(self) -> NDArray[np.float64]:
        """Unit normals, (n, 3)."""
        return self.axes[:, 2]

    @property
    def offsets(self) -> NDArray[np.float64]:
        """Distances of the planes from the world's zero along their normals, (n,), metres."""
        offsets: NDArray[np.float64] = np.einsum("ij,ij->i", self.centers, self.normals)
        return offsets

    def __len__(self) -> int:
        return len(self.centers)


@dataclass(frozen=True, slots=True)
class PlaneMesh:
    """The supported tiles of a model as triangles."""

    vertices: NDArray[np.float64]
    """World positions, (m, 3), metres."""
    triangles: NDArray[np.uint32]
    """Rows of three vertices, (t, 3), anticlockwise seen from where the normal points."""
    patches: NDArray[np.uint32]
    """The patch of each triangle, (t,)."""


@final
class PlaneModel(Model[_core.PlaneModel]):
    """A cloud as planar patches with tiles; immutable.

    Made by `learn_planes` and `surfabet.load`. It decodes to its supported tiles, at a spacing of
    half the grid size by default.
    """

    __slots__ = ()

    def segment(self, cloud: PointCloud, *, progress: Progress = None) -> NDArray[np.int32]:
        """The patch that each point of any cloud supports, (n,); -1 for outliers.

        It is the closest whose supported tiles are within the grid size. Where the cloud knows
        viewpoints, or has oriented normals, only patches seen from the same side count. For the
        cloud that the model was learned from these are its `labels`.

        Raises
        ------
        InvalidInputError
            For an empty cloud.
        """
        with progress_callback(progress) as callback:
            return self._core.segment(cloud, progress=callback)

    def project(self, cloud: PointCloud, *, progress: Progress = None) -> PointCloud:
        """The points of a cloud that support a patch, moved onto it; outliers are left out.

        Attributes stay with their points.

        Raises
        ------
        InvalidInputError
            For an empty cloud.
        """
        with progress_callback(progress) as callback:
            return self._core.project(cloud, progress=callback)

    def polygons(self, patch: int) -> list[NDArray[np.float64]]:
        """Closed polygons around the supported area of a patch, each (k, 3), in the world, metres.

        The last corner is not the first again. Seen from where the normal points, outlines run
        anticlockwise and holes clockwise. Tiles that touch at a corner only are not joined there.

        Raises
        ------
        InvalidInputError
            When there is no such patch.
        """
        check_integer("patch", patch, 0, len(self) - 1)
        return self._core.polygons(patch)

    def mesh(self) -> PlaneMesh:
        """The supported tiles of all patches as triangles, as few as rectangles of tiles allow."""
        return PlaneMesh(*self._core.mesh())

    def export(self, path: str | os.PathLike[str]) -> int:
        """Writes the patches for other programs and returns the size of the file in bytes.

        Coordinates are the world's, in double precision, so that georeferenced ones survive. An
        existing file is replaced only when the new one is complete.

        Parameters
        ----------
        path
            Its ending tells the format. `.ply`: triangles, binary, with the patch of each and its
            mean colour. `.obj`: an object per patch, with its triangles as faces and the polygons
            around it as closed lines. `.dxf`: a layer per patch, with its triangles as 3D faces and
            the polygons as closed 3D polylines; needs the package ezdxf. `.glb`: glTF, triangles in
            the mean colours of their patches; needs trimesh.

        Raises
        ------
        InvalidInputError
            For another ending.
        MissingDependencyError
            For `.dxf` without ezdxf: `pip install 'surfabet[io]'`.
        OSError
            When the file cannot be written.
        """
        mesh, colors = self.mesh(), self._core.colors()
        surface = Surface(
            vertices=mesh.vertices,
            triangles=mesh.triangles,
            parts=mesh.patches,
            n_parts=len(self),
            polygons=self._core.polygons,
            colors=None if colors is None else _means(colors),
        )
        return export(path, surface, WRITERS)

    @property
    def planes(self) -> Planes:
        """All patches as arrays."""
        deviations = self._core.standard_deviations()
        return Planes(
            centers=self._core.centers(),
            axes=self._core.axes(),
            extents=self._core.extents(),
            standard_deviations=deviations,
            counts=self._core.counts(),
            areas=self._core.areas(),
            tile_edges=self._core.tile_edges(),
            supported=self._core.supported(),
            colors=self._core.colors(),
            intensities=self._core.intensities(),
            planar=deviations <= 0.5 * self.grid_size,
        )

    @property
    def labels(self) -> NDArray[np.int32] | None:
        """The patch that each input point supports, (n_points,); -1 for outliers. None for a model
        that was loaded: `segment` gives the labels of any cloud."""
        return self._core.labels

    @property
    def grid_size(self) -> float:
        """Grid size (G), metres: side of the smallest tiles, and how far a point may be from a
        patch that it supports."""
        return self._core.grid_size

    @property
    def n_outliers(self) -> int:
        """Input points that support no patch."""
        return self._core.n_outliers

    def __repr__(self) -> str:
        outliers = self.n_outliers / self.n_points
        return (
            f"PlaneModel({self.n_points} points as {len(self)} planes, {outliers:.1%} outliers, "
            f"grid size {self.grid_size:.3g} m" + (", coloured" if self.has_color else "") + ")"
        )


def _means(colors: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    means = [np.rint(tiles.mean(axis=0)) for tiles in colors]
    return np.array(means, np.uint8).reshape(-1, 3)


def learn_planes(
    cloud: PointCloud,
    *,
    weights: ArrayLike | None = None,
    quality: Literal["small", "balanced", "fine"] = "balanced",
    initial_patches: int = 0,
    published: bool = False,
    min_grid_size: float | None = None,
    weight_at_grid_size: float = 0.01,
    split_threshold: float = 0.6666666666666666,
    merge_tolerance: float = 1.25,
    em_steps: int = 2,
    new_patches_every: int = 5,
    max_iterations: int = 30,
    tolerance: float = 0.01,
    min_points: int | None = None,
    min_probability: float = 0.6,
    color_step: int = 8,
    attribute_step: float = 0.125,
    keep_outliers: bool = False,
    random_state: int = 0,
    progress: Progress = None,
) -> PlaneModel:
    """Learns planar patches: as many as the scan has, by EM with split and merge.

    Viewpoints, where the cloud knows them, tell both sides of a thin wall apart; so do normals, if
    they are oriented. A cloud without anything flat gives a model without patches. Results depend
    on input, options and seed alone, not on the number of threads.

    Parameters
    ----------
    cloud
        The scan.
    weights
        By how much each point counts, (n,), not negative; one if None.
    quality
        Small files or fine detail. Sets `min_grid_size`, unless that is given: 'small' doubles it,
        'fine' halves it. 'small', 'balanced' or 'fine'; by default balanced.
    initial_patches
        Number of patches to start from, placed at random. With 0 they are taken from the data:
        cells that are flat. An integer from 0 to 2^20; by default 0.
    published
        The method as printed in the paper, from random patches (10 where `initial_patches` is 0),
        without what was added to it. Options that it does not know, from `merge_tolerance` to
        `min_probability`, do not count then. True or False; by default False.
    min_grid_size
        Grid size (G, section II-E) that the learned one does not fall below. Flat is what is flat
        at this size. A number from 1e-9 to 1e9 metres; by default the median spacing of the points,
        or three times their noise where that is more.
    weight_at_grid_size
        Weight of a point at distance G before normalisation (W, eq. 2). Points further than G from
        all patches support none. A number above 0 and below 1; by default 0.01.
    split_threshold
        A patch is split where its density falls below this share of the mean (section II-C). A
        number from 0 to below 1; by default 0.6667.
    merge_tolerance
        Factor by which points of either of two patches may be further from their common plane than
        from their own for the two to merge (section II-D). With infinity only the paper's two
        conditions hold. A number of at least 1; by default 1.25.
    em_steps
        Passes of E-step, M-step and trimming before each split and each merge (EMPF, section II-A).
        An integer from 1 to 10000; by default 2.
    new_patches_every
        Iterations after which patches are added where many points support none (section II-B). An
        integer from 1 to 10000; by default 5.
    max_iterations
        Most iterations of EMPF, split, EMPF, merge. An integer from 1 to 10000; by default 30.
    tolerance
        Learning ends when the mean distance of points to their patches and the share of points that
        support one change by less than this share. A positive number; by default 0.01.
    min_points
        Points that a patch needs. An integer from 3 to below 2^32; by default one in 4000 of all
        points, at least 30.
    min_probability
        Least probability that a patch is one surface, from what the likelihood loses without it,
        how its points spread about its plane, whether it is bent, how much of its rectangle is
        filled, what is beside it, and its size. Patches in the middle of clutter, across a corner
        or along something bent have less; with 0 all are kept. Of patches with 16 times
        `min_points` a third of it is asked. A number from 0 to 1; by default 0.6.
    color_step
        Rounding of the colours of tiles. An integer from 1 to 64 grey levels; by default 8.
    attribute_step
        Rounding of the mean intensities of tiles, as a share of their standard deviation. A number
        from 0.001 to 100 standard deviations; by default 0.125.
    keep_outliers
        Keeps points that are far from all others. Otherwise those of which a few would make the
        scene many times as large as it is are left out, and counted in the report. True or False;
        by default False.
    random_state
        Seed of the patches that are placed at random. An integer from 0 to below 2^64; by default
        0.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For an empty scan, or weights or options outside their range.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> points = np.random.default_rng(0).random((3000, 3))
    >>> points[:1500, 0], points[1500:, 2] = 0, 0
    >>> model = sb.learn_planes(sb.PointCloud(points))
    >>> len(model), np.abs(model.planes.normals).round(3).max(axis=1)
    (2, array([1., 1.]))
    """
    options = {
        "quality": quality,
        "initial_patches": initial_patches,
        "published": published,
        "min_grid_size": min_grid_size,
        "weight_at_grid_size": weight_at_grid_size,
        "split_threshold": split_threshold,
        "merge_tolerance": merge_tolerance,
        "em_steps": em_steps,
        "new_patches_every": new_patches_every,
        "max_iterations": max_iterations,
        "tolerance": tolerance,
        "min_points": min_points,
        "min_probability": min_probability,
        "color_step": color_step,
        "attribute_step": attribute_step,
        "keep_outliers": keep_outliers,
        "random_state": random_state,
    }
    with progress_callback(progress) as callback:
        learned = _core.learn_planes(cloud, options, weights=weights, progress=callback)
    model = PlaneModel(learned)
    _warn_of_points_left_out(model)
    return model


_MOSTLY_NONE = 0.5
"""Share of the points on no plane from which there is a warning; of scans of a room, a hall and a
street it is 17 to 28 percent."""

_WORTH_SAYING = 0.2
"""Share of the points on patches that were left out from which there is a warning; of scans of a
room, a hall and a street it is 6 to 15 percent."""


def _warn_of_points_left_out(model: PlaneModel) -> None:
    """Says when much of the scan was on patches that are probably no surface, or most of it on no
    plane at all."""
    figures = model.report.figures
    n_points, n_patches = figures["points"], figures.get("patches left out", 0)
    n_lost = figures.get("points of patches left out", 0)
    n_outliers = figures.get("outliers", 0)
    if n_lost >= _WORTH_SAYING * n_points:
        patches = "1 patch" if n_patches == 1 else f"{n_patches:,.0f} patches"
        what = (
            f"{n_lost:,.0f} of {n_points:,.0f} points lie on {patches} that were left out, as they "
            "are probably no surface; a lower min_probability keeps more, min_probability=0 all"
        )
    elif n_outliers >= _MOSTLY_NONE * n_points:
        what = (
            f"{n_outliers:,.0f} of {n_points:,.0f} points lie on no plane: what is curved has "
            "none; a smaller min_points finds planes of fewer points"
        )
    else:
        return
    warnings.warn(what, IncompleteModelWarning, stacklevel=3)


@dataclass(frozen=True, slots=True)
class PlaneFit:
    """What classical EM finds: k infinite planes."""

    centers: NDArray[np.float64]
    """A world position on each plane, the weighted mean of its points, (k, 3), metres."""
    normals: NDArray[np.float64]
    """Unit normals, (k, 3)."""
    labels: NDArray[np.int32]
    """The plane that each point most probably belongs to, (n,)."""
    standard_deviation: float
    """Standard deviation of the points about their planes (S), metres."""
    log_likelihood: NDArray[np.float64]
    """Mean log-likelihood of a point after each iteration; it never falls."""


def random_planes(
    cloud: PointCloud, n_planes: int, *, random_state: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Planes through points of a cloud, turned at random: where `fit_planes_em` may start.

    They are the planes of the patches that `learn_planes` starts from with as many
    `initial_patches` and the same `random_state`, so that both can be compared.

    Parameters
    ----------
    cloud
        The points.
    n_planes
        How many planes, 1 to 2^20.
    random_state
        Seed; the same planes for the same cloud and seed.

    Returns
    -------
    centers, normals
        World positions on the planes, metres, and unit normals, (n_planes, 3) each.

    Raises
    ------
    InvalidInputError
        For an empty cloud or no planes.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> cloud = sb.PointCloud(np.random.default_rng(0).random((1000, 3)) * [1, 1, 0])
    >>> fit = sb.fit_planes_em(cloud, *sb.random_planes(cloud, 1))
    >>> fit.normals.round(6).tolist() in ([[0, 0, 1]], [[0, 0, -1]])
    True
    """
    check_integer("n_planes", n_planes, 1, 1 << 20)
    check_integer("random_state", random_state, 0)
    return _core.random_planes(cloud, n_planes=n_planes, random_state=random_state)


def fit_planes_em(
    cloud: PointCloud,
    centers: ArrayLike,
    normals: ArrayLike,
    *,
    weights: ArrayLike | None = None,
    max_iterations: int = 100,
    tolerance: float = 1e-6,
    progress: Progress = None,
) -> PlaneFit:
    """Fits infinite planes, as many as given, by classical EM: what `learn_planes` improves on.

    A mixture of planes with noise of one standard deviation. The E-step weighs each point by
    exp(-d^2 / 2 S^2) for its distances d to the planes; the M-step refits every plane, and S.

    Parameters
    ----------
    cloud
        The points.
    centers, normals
        Points on the planes to start from, and the planes' normals, (k, 3) each.
    weights
        By how much each point counts, (n,), not negative; one if None.
    max_iterations
        Most iterations.
    tolerance
        It ends when the mean log-likelihood of a point grows by less.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For an empty cloud, no planes, or normals without a length.
    """
    check_integer("max_iterations", max_iterations, 1)
    check_number("tolerance", tolerance, "0 or a positive number", least=0.0)
    with progress_callback(progress) as callback:
        fitted = _core.fit_planes_em(
            cloud,
            centers=centers,
            normals=normals,
            weights=weights,
            max_iterations=max_iterations,
            tolerance=tolerance,
            progress=callback,
        )
    return PlaneFit(*fitted)
