"""Surface patches on a lattice: the most compact model of a scan, with its thickness.

Patches follow the scene's own axes and share one pixel lattice; what is said of each is what costs
least, bits weighed against squared error. `surfabet.learn_patches` makes these models.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.model import MAX_POINTS, Model

__all__ = ["LatticeLevel", "PatchModel", "LatticePatches", "learn"]


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


@final
class PatchModel(Model[_core.PatchModel]):
    """A cloud as surface patches on a lattice, with thickness and colour; immutable.

    Made by `learn_patches` and `surfabet.load`.
    """

    __slots__ = ()

    def decode(
        self,
        resolution: float | None = None,
        *,
        as_measured: bool = False,
        normals: bool = False,
        max_points: int = MAX_POINTS,
        progress: Progress = None,
    ) -> PointCloud:
        """The model as a cloud, at any spacing: patches are surfaces.

        Parameters
        ----------
        resolution
            Spacing of the points, metres; by default half a pixel of the finest level.
        as_measured
            Fill the thickness that the scan had about each patch, in layers at the spacing, instead
            of giving the thin surface in its middle. The thin surface is nearer to the true one,
            the filled one to the scan. The thin one leaves fragments out: at most 16 finest pixels
            that touch nothing and stand 1.5 to 10 of them off a larger piece.
        normals
            Give every point the unit normal of its patch, towards where it was seen from; points
            that no patch holds have none (zero).
        max_points
            Refuse to make more points than this.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Returns
        -------
        PointCloud
            Points patch by patch; number and order are not those of the input.

        Raises
        ------
        InvalidInputError
            For a spacing that is not positive, or one that makes more than `max_points` points.
        """
        with progress_callback(progress) as callback:
            return self._core.decode(
                resolution=resolution,
                as_measured=as_measured,
                normals=normals,
                max_points=max_points,
                progress=callback,
            )

    @property
    def n_extra_points(self) -> int:
        """Points that the model keeps beside its patches, for `max_error`."""
        return self._core.n_extra_points

    @property
    def max_error(self) -> float | None:
        """Largest distance of any input point to the cloud decoded as measured at the default
        spacing, metres; None when no bound was asked for."""
        return self._core.max_error

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Lattice to world, (3, 3): the scene's own axes as columns."""
        return np.array(self._core.rotation)

    @property
    def levels(self) -> tuple[LatticeLevel, ...]:
        """The levels of the hierarchy, coarsest first."""
        return tuple(LatticeLevel(*level) for level in self._core.levels)

    @property
    def patches(self) -> LatticePatches:
        """All patches as arrays."""
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


def learn(
    cloud: PointCloud,
    *,
    resolution: float = 0.01,
    levels: int = 2,
    max_error: float | None = None,
    rate: float = 1.4,
    depth_step: float = 0.75,
    rounds: int = 3,
    color_step: int = 90,
    chroma_ratio: float = 1.5,
    color_rate: float = 0.15,
    sensor: Literal["structured-light", "constant"] = "structured-light",
    random_state: int = 0,
    progress: Progress = None,
) -> PatchModel:
    """As `surfabet.learn_patches` with `method="rate-distortion"`."""
    del random_state
    with progress_callback(progress) as callback:
        learned = _core.learn_lattice(
            cloud,
            resolution=resolution,
            levels=levels,
            rate=rate,
            depth_step=round(16 * depth_step),
            rounds=rounds,
            color_step=color_step,
            chroma_ratio=chroma_ratio,
            color_rate=color_rate,
            max_error=max_error,
            sensor=sensor,
            progress=callback,
        )
    return PatchModel(learned)
