"""Surface patches on a lattice: the most compact model of a scan, with its thickness.

Patches follow the scene's own axes and share one pixel lattice; each is encoded in the way that
costs least, bits weighed against squared error.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._core import PointCloud
from surfabet._patch_mesh import mesh_of
from surfabet._progress import Progress, progress_callback
from surfabet.meshes import Mesh
from surfabet.model import Model

__all__ = [
    "LatticeInstance",
    "LatticeLevel",
    "LatticeModel",
    "LatticePatches",
    "PatchModel",
    "learn_patches",
]


@dataclass(frozen=True, slots=True)
class LatticeLevel:
    """All patches of one size."""

    pixel_size: float
    """Side of a pixel, metres."""
    pixels: int
    """Pixels per side of a patch."""
    patches: int
    """Number of patches."""
    set_pixels: int
    """Pixels that are set, over all patches."""

    @property
    def area(self) -> float:
        """Area of the set pixels, square metres."""
        return self.set_pixels * self.pixel_size**2


@dataclass(frozen=True, slots=True)
class LatticePatches:
    """All m patches of a model as arrays, in the order of the file."""

    poses: NDArray[np.float64]
    """Patch to world, (m, 4, 4): columns are the directions of columns, rows and depth, and the
    middle of the patch's square at depth zero."""
    facing: NDArray[np.int64]
    """1 where the surface is seen from growing depth, -1 from falling depth, (m,)."""
    level: NDArray[np.int64]
    """Level, 0 the coarsest as in `PatchModel.levels`, (m,)."""
    size: NDArray[np.float64]
    """Side of each patch, (m,), metres."""
    masks: NDArray[np.bool_]
    """Set pixels, (m, 8, 8), rows first."""
    coefficients: NDArray[np.float64]
    """Depth as a sum of shapes, (m, 21), metres: constant, tilts, then cosines by order; the guide
    has their formulas."""
    sigma: NDArray[np.float64]
    """Standard deviation of the scan about the patch, (m,), metres."""

    def __len__(self) -> int:
        return len(self.level)


@dataclass(frozen=True, slots=True)
class LatticeInstance:
    """Patches that a model gives once more at another place.

    A position along the axes of the lattice, metres from its zero, stands at
    `linear @ position + shift`.
    """

    linear: NDArray[np.float64]
    """Turn, or turn and mirror, (3, 3)."""
    shift: NDArray[np.float64]
    """Shift, (3,), metres."""
    patches: NDArray[np.int64]
    """Numbers of its patches in the order of the file, (k,)."""

    @property
    def facing(self) -> int:
        """1 where the patches are only turned, -1 where they are mirrored too."""
        return 1 if np.linalg.det(self.linear) > 0 else -1


L = TypeVar("L", _core.PatchModel, _core.TiledPatchModel)


class LatticeModel(Model[L]):
    """Surface patches on the lattice of a scene, in one piece or in tiles."""

    __slots__ = ()

    @property
    def attributes(self) -> tuple[str, ...]:
        """Names of the attributes that the model keeps: `"colors"`, `"intensities"` and others."""
        return (*(("colors",) if self.has_color else ()), *self._core.attribute_names)

    @property
    def max_error(self) -> float | None:
        """Largest distance of any input point to the cloud decoded as measured at the default
        spacing, metres; None when no bound was asked for."""
        return self._core.max_error

    @property
    def max_error_forward(self) -> float | None:
        """Bound on the distance of decoded points to the input, metres; None where none was asked.

        It holds for the model decoded at its default spacing, as measured or as a surface.
        """
        return self._core.max_error_forward

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Lattice to world, (3, 3): the scene's own axes as columns."""
        return np.array(self._core.rotation)

    @property
    def instances(self) -> tuple[LatticeInstance, ...]:
        """Patches that the model gives once more at other places, where the scene recurs. Maps in
        tiles have none."""
        return ()

    def mesh(self) -> Mesh:
        """The thin surface as triangles, half a square of the finest pixel each.

        Corners that patches of one side share are one vertex, so that there are no gaps along the
        borders of patches. Sheets of different sides, as both walls of a corner, are not joined.
        Points that the model keeps beside its patches are left out. All tiles of a map that were
        read are one mesh.
        """
        return mesh_of(self)

    def export(self, path: str | os.PathLike[str]) -> int:
        """Writes `mesh()` to a file, `.ply`, `.obj` or `.glb`, and returns its size in bytes; see
        `Mesh.export`."""
        return self.mesh().export(path)


@final
class PatchModel(LatticeModel[_core.PatchModel]):
    """A cloud as surface patches on a lattice, with thickness and attributes; immutable.

    Made by `learn_patches` and `surfabet.load`. It decodes to a spacing of half a pixel of the
    finest level by default, patch by patch. The thin surface leaves fragments out: at most 16
    finest pixels that touch nothing and stand 1.5 to 10 of them off a larger piece. Points that no
    patch holds have the normal of the nearest patch.
    """

    __slots__ = ()

    @property
    def n_extra_points(self) -> int:
        """Points that the model keeps beside its patches, for `max_error`."""
        return self._core.n_extra_points

    @property
    def levels(self) -> tuple[LatticeLevel, ...]:
        """The levels of the hierarchy, coarsest first."""
        return tuple(LatticeLevel(*level) for level in self._core.levels)

    @property
    def instances(self) -> tuple[LatticeInstance, ...]:
        """Patches that the model gives once more at other places, where the scene recurs."""
        pixel = self.levels[-1].pixel_size
        return tuple(
            LatticeInstance(np.array(linear), np.array(shift) * pixel, patches)
            for linear, shift, patches in self._core.instances()
        )

    @property
    def patches(self) -> LatticePatches:
        """All patches of the file as arrays; those of `instances` are among them once."""
        levels = self.levels
        places = self._core.places()
        sides, level, corners = places[:, 0], places[:, 1], places[:, 2:]
        size = np.array([of.pixel_size * of.pixels for of in levels])[level]
        depth_axis = sides // 2
        axes = np.stack([(depth_axis + 1) % 3, (depth_axis + 2) % 3, depth_axis], axis=1)
        middle = corners * levels[-1].pixel_size + size[:, None] / 2
        local = np.zeros((len(places), 3))
        np.put_along_axis(local, axes[:, :2], middle, axis=1)
        poses = np.zeros((len(places), 4, 4))
        poses[:, :3, :3] = self.rotation[:, axes].transpose(1, 0, 2)
        poses[:, :3, 3] = local @ self.rotation.T + self.origin
        poses[:, 3, 3] = 1
        return LatticePatches(
            poses=poses,
            facing=1 - 2 * (sides % 2),
            level=level,
            size=size,
            masks=self._core.masks(),
            coefficients=self._core.coefficients(),
            sigma=self._core.sigma(),
        )

    def __repr__(self) -> str:
        counts = " + ".join(str(level.patches) for level in self.levels)
        return (
            f"PatchModel({self.n_points} points as {counts} patches with pixels of "
            f"{' / '.join(f'{level.pixel_size:g}' for level in self.levels)} m"
            + (", coloured" if self.has_color else "")
            + ")"
        )


def learn_patches(
    cloud: PointCloud,
    *,
    quality: Literal["small", "balanced", "fine"] = "balanced",
    resolution: float | None = None,
    levels: int = 2,
    max_error: float | None = None,
    max_error_forward: float | None = None,
    completeness: float = 0.99,
    rate: float = 1.4,
    depth_step: float | None = None,
    recurrence: bool = False,
    rounds: int = 3,
    color_step: int = 115,
    chroma_ratio: float = 1.0,
    color_rate: float = 0.15,
    attributes: Sequence[str] | None = None,
    attribute_step: float = 0.5,
    attribute_rate: float = 0.15,
    sensor: Literal["structured-light", "constant"] = "structured-light",
    keep_outliers: bool = False,
    progress: Progress = None,
) -> PatchModel:
    """Learns surface patches on the scene's own lattice, at the least cost in bits and error.

    It keeps the thickness of the scan, and its files are the smallest of all methods.

    Parameters
    ----------
    cloud
        The scan. Colours and intensities are kept when present, or the `attributes` that are named;
        ranges weight the points by the depth error of
        their sensor; viewpoints tell the two sides of a thin wall apart.
    quality
        Small files or fine detail. Sets `resolution`, unless that is given: 'small' doubles it,
        'fine' halves it. 'small', 'balanced' or 'fine'; by default balanced.
    resolution
        Side of a pixel of the finest level. Smaller detail is lost, and all lengths of the method
        follow it. A number from 1e-8 to 1e5 metres; by default from the data: 2.25 spacings of the
        points, 3 on scan lines and of rounded coordinates, 1.25 standard deviations of their noise
        or half of max_error (with max_error_forward all of it, or of that where it is less),
        whichever is most.
    levels
        Levels of the hierarchy. Patches of the finest are 8 pixels wide; from level to level above
        it, pixels and patches double in size. An integer from 1 to 4; by default 2.
    max_error
        Largest distance of any input point to the cloud that is decoded as measured at the default
        spacing. Points that would be further away are kept beside the patches. A number from 1e-8
        to 1e5 metres; by default no bound.
    max_error_forward
        Largest distance of any decoded point to the input, as measured or as a surface at the
        default spacing: no surface is filled in where nothing was measured. Patches lose what would
        be further away. A number from 1e-8 to 1e5 metres; by default no bound.
    completeness
        Least share of the points that are within the tolerance of the cloud decoded as measured:
        two spacings, three standard deviations of the noise, or two thirds of a given `resolution`,
        whichever is most; twice as much for 'small'. Points beside the patches make up for what
        these leave out. With 0 there are none, and with `max_error` this has no effect. A number
        from 0 to 1; by default 0.99.
    rate
        Squared error that a bit of geometry must save (lambda), summed over pixels and both
        directions. Larger makes smaller files. A positive number of squared pixels; by default 1.4.
    depth_step
        Rounding of depths, in pixels of the finest level. A number from 0.0625 to 16 pixels in
        steps of 0.0625; by default 0.75, or an eighth of the gap where surfaces lie close behind
        one another and that is less.
    recurrence
        Looks for what recurs in the scene: patches are left out where others, moved, give the same
        surface, if that makes the file smaller. Takes two to three times as long; for buildings
        with equal rooms, or many equal things. True or False; by default False.
    rounds
        Rounds of choosing patches. Each uses the prices that the coder learned in the round before.
        An integer from 1 to 10; by default 3.
    color_step
        Rounding of luma of a single cell. Means over n cells are rounded about sqrt(n) times finer;
        larger makes smaller files. An integer from 1 to 1024 grey levels; by default 115.
    chroma_ratio
        Rounding of chroma as a multiple of that of luma. A number from 0.25 to 4; by default 1.
    color_rate
        Squared error that a bit of colour must save. A positive number of squared colour steps; by
        default 0.15.
    attributes
        Attributes to keep, by name: 'colors', 'intensities', or any that the cloud has beside them.
        Integers of at most 32 different values are labels: each cell has the most frequent. All
        others are scalars, which are averaged. A sequence of names; by default colours and
        intensities, where the cloud has them.
    attribute_step
        Rounding of intensities and other scalars of a single cell, as a share of their standard
        deviation. Means over n cells are rounded about sqrt(n) times finer; larger makes smaller
        files. A number from 0.001 to 100 standard deviations; by default 0.5.
    attribute_rate
        Squared error that a bit of a scalar must save. A positive number of squared steps; by
        default 0.15.
    sensor
        How the error of a range measurement grows with the range. 'structured-light' is with its
        square, as for Kinects. Without ranges all points weigh the same. 'structured-light' or
        'constant'; by default structured-light.
    keep_outliers
        Keeps points that are far from all others. Otherwise those of which a few would make the
        scene many times as large as it is are left out, and counted in the report. True or False;
        by default False.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Returns
    -------
    PatchModel
        The same for the same cloud and options, whatever the number of threads.

    Raises
    ------
    InvalidInputError
        For an empty cloud, options outside their range, or a scene too large for its resolution.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> u, v = np.meshgrid(np.arange(0, 1, 0.005), np.arange(0, 1, 0.005))
    >>> wall = sb.PointCloud(np.stack([u.ravel(), np.zeros(u.size), v.ravel()], axis=1))
    >>> model = sb.learn_patches(wall, resolution=0.01)
    >>> bool(np.abs(model.decode().points[:, 1]).max() < 0.002)
    True
    >>> len(model.to_bytes()) < 300
    True
    """
    options = {
        "quality": quality,
        "resolution": resolution,
        "levels": levels,
        "max_error": max_error,
        "max_error_forward": max_error_forward,
        "completeness": completeness,
        "rate": rate,
        "depth_step": depth_step,
        "recurrence": recurrence,
        "rounds": rounds,
        "color_step": color_step,
        "chroma_ratio": chroma_ratio,
        "color_rate": color_rate,
        "attributes": attributes,
        "attribute_step": attribute_step,
        "attribute_rate": attribute_rate,
        "sensor": sensor,
        "keep_outliers": keep_outliers,
    }
    with progress_callback(progress) as callback:
        return PatchModel(_core.learn_patches(cloud, options, progress=callback))
