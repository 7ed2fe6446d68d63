"""Stubs of the compiled module; `stubtest` holds them against the binary."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

ProgressCallback = Callable[[str, float], object]

def set_num_threads(n_threads: int | None) -> None: ...
def get_num_threads() -> int: ...

class PointCloud:
    def __new__(
        cls,
        points: ArrayLike,
        *,
        colors: ArrayLike | None = None,
        intensities: ArrayLike | None = None,
        normals: ArrayLike | None = None,
        ranges: ArrayLike | None = None,
        viewpoints: ArrayLike | None = None,
        viewpoint_index: ArrayLike | None = None,
        origin: Sequence[float] | None = None,
    ) -> PointCloud: ...
    @property
    def points(self) -> NDArray[np.float64]: ...
    @property
    def local_points(self) -> NDArray[np.float32]: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def colors(self) -> NDArray[np.uint8] | None: ...
    @property
    def intensities(self) -> NDArray[np.float32] | None: ...
    @property
    def normals(self) -> NDArray[np.float32] | None: ...
    @property
    def ranges(self) -> NDArray[np.float32] | None: ...
    @property
    def viewpoints(self) -> NDArray[np.float64] | None: ...
    @property
    def viewpoint_index(self) -> NDArray[np.uint32] | None: ...
    @property
    def bounds(self) -> tuple[list[float], list[float]] | None: ...
    @property
    def attributes(self) -> list[str]: ...
    def select(self, which: ArrayLike) -> PointCloud: ...
    @staticmethod
    def concat(clouds: Sequence[PointCloud]) -> tuple[PointCloud, list[str]]: ...
    def __len__(self) -> int: ...

# Geometry

class KdTree:
    def __new__(cls, points: PointCloud | ArrayLike) -> KdTree: ...
    def query(
        self,
        points: PointCloud | ArrayLike,
        k: int = 1,
        *,
        progress: ProgressCallback | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.uint32]]: ...
    def query_radius(
        self,
        points: PointCloud | ArrayLike,
        radius: float,
        *,
        progress: ProgressCallback | None = None,
    ) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.uint32]]: ...
    def __len__(self) -> int: ...

class VoxelGrid:
    def __new__(
        cls, cloud: PointCloud, size: float, *, progress: ProgressCallback | None = None
    ) -> VoxelGrid: ...
    @property
    def size(self) -> float: ...
    @property
    def cells(self) -> NDArray[np.int64]: ...
    @property
    def counts(self) -> NDArray[np.uint32]: ...
    @property
    def voxel_of_points(self) -> NDArray[np.uint32]: ...
    def means(
        self, weights: ArrayLike | None = None, *, progress: ProgressCallback | None = None
    ) -> PointCloud: ...
    def __len__(self) -> int: ...

class Octree:
    def __new__(
        cls, cloud: PointCloud, leaf_size: float, *, progress: ProgressCallback | None = None
    ) -> Octree: ...
    @property
    def depth(self) -> int: ...
    def node_size(self, level: int) -> float: ...
    def level_with_at_most(self, count: int) -> int: ...
    def counts(self, level: int | None = None) -> NDArray[np.uint32]: ...
    def centers(self, level: int | None = None) -> NDArray[np.float64]: ...
    def centroids(self, level: int | None = None) -> NDArray[np.float64]: ...

class RangeImage:
    @staticmethod
    def spherical(
        cloud: PointCloud,
        *,
        azimuth_step: float,
        elevation_step: float,
        elevations: Sequence[float],
        pose: Sequence[Sequence[float]] | NDArray[np.floating] | None = None,
        progress: ProgressCallback | None = None,
    ) -> RangeImage: ...
    @staticmethod
    def pinhole(
        cloud: PointCloud,
        *,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        width: int,
        height: int,
        pose: Sequence[Sequence[float]] | NDArray[np.floating] | None = None,
        progress: ProgressCallback | None = None,
    ) -> RangeImage: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def ranges(self) -> NDArray[np.float32]: ...
    @property
    def index(self) -> NDArray[np.uint32]: ...
    def project(self, points: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.float64]]: ...
    def unproject(
        self, rows: ArrayLike, columns: ArrayLike, ranges: ArrayLike
    ) -> NDArray[np.float64]: ...

def estimate_normals(
    cloud: PointCloud,
    neighbors: int | None,
    radius: float | None,
    progress: ProgressCallback | None,
) -> tuple[PointCloud, NDArray[np.float32], int]: ...
def evaluate(
    reference: PointCloud,
    decoded: PointCloud,
    sigma: float | None,
    sigma_by_range: tuple[float, float] | None,
    peak: float | None,
    normal_neighbors: int | None,
    progress: ProgressCallback | None,
) -> dict[str, Any]: ...
