"""Stubs of the compiled module; `stubtest` holds them against the binary."""

from collections.abc import Sequence
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet._progress import ProgressCallback

__version__: str

def set_num_threads(n_threads: int | None) -> None: ...
def get_num_threads() -> int: ...

@final
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

def lzf_compress(data: bytes) -> bytes: ...
def lzf_decompress(data: bytes, size: int) -> bytes: ...

# The scan simulator: crates/surfabet-py/src/sim.rs

@final
class Instance:
    @property
    def id(self) -> int: ...
    @property
    def class_name(self) -> str: ...
    @property
    def model(self) -> int: ...
    @property
    def pose(self) -> NDArray[np.float64]: ...
    @property
    def extent(self) -> tuple[list[float], list[float]]: ...
    @property
    def bounds(self) -> tuple[list[float], list[float]]: ...

@final
class Surface:
    @property
    def id(self) -> int: ...
    @property
    def kind(self) -> str: ...
    @property
    def instance(self) -> int: ...
    @property
    def direction(self) -> list[float]: ...
    @property
    def offset(self) -> float: ...

@final
class GroundTruth:
    @property
    def points(self) -> NDArray[np.float32]: ...
    @property
    def normals(self) -> NDArray[np.float32]: ...
    @property
    def instances(self) -> NDArray[np.uint32]: ...
    @property
    def surfaces(self) -> NDArray[np.uint32]: ...
    def __len__(self) -> int: ...

@final
class Frame:
    @property
    def cloud(self) -> PointCloud: ...
    @property
    def ground_truth(self) -> GroundTruth: ...
    @property
    def pose(self) -> NDArray[np.float64]: ...
    @property
    def true_pose(self) -> NDArray[np.float64]: ...
    @property
    def depth(self) -> NDArray[np.float32] | None: ...
    @property
    def color(self) -> NDArray[np.uint8] | None: ...
    @property
    def intrinsics(self) -> NDArray[np.float64] | None: ...

@final
class Scene:
    @staticmethod
    def room(
        *,
        seed: int,
        size: Sequence[float],
        n_chairs: int,
        n_shelves: int,
        n_doors: int,
    ) -> Scene: ...
    @property
    def instances(self) -> list[Instance]: ...
    @property
    def surfaces(self) -> list[Surface]: ...
    @property
    def interior(self) -> tuple[list[float], list[float]]: ...
    def default_poses(self, n: int) -> NDArray[np.float64]: ...
    def default_lidar_poses(self, n: int) -> NDArray[np.float64]: ...
    def distance(self, points: ArrayLike) -> NDArray[np.float64]: ...
    def closest_points(
        self, points: ArrayLike
    ) -> tuple[
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.uint32],
        NDArray[np.uint32],
    ]: ...
    def visible(
        self, points: ArrayLike, normals: ArrayLike, viewpoints: ArrayLike
    ) -> NDArray[np.bool_]: ...
    def sample_surface(self, spacing: float) -> tuple[NDArray[np.float64], GroundTruth]: ...
    def scan_rgbd(
        self,
        poses: ArrayLike,
        *,
        width: int,
        height: int,
        intrinsics: Sequence[float] | None,
        depth_limits: tuple[float, float],
        depth_noise: float,
        quantize_disparity: bool,
        max_incidence: float,
        dropout: float,
        color_noise: float,
        translation_std: float,
        rotation_std: float,
        seed: int,
        progress: ProgressCallback | None,
    ) -> tuple[PointCloud, GroundTruth, list[Frame]]: ...
    def scan_lidar(
        self,
        poses: ArrayLike,
        *,
        elevation_limits: tuple[float, float],
        elevation_step: float,
        azimuth_step: float,
        range_limits: tuple[float, float],
        range_noise: float,
        dropout: float,
        color_noise: float,
        translation_std: float,
        rotation_std: float,
        seed: int,
        progress: ProgressCallback | None,
    ) -> tuple[PointCloud, GroundTruth, list[Frame]]: ...

# Geometry

@final
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

@final
class VoxelGrid:
    def __new__(
        cls, cloud: PointCloud, size: float, *, progress: ProgressCallback | None = None
    ) -> VoxelGrid: ...
    @staticmethod
    def with_at_most(
        cloud: PointCloud, count: int, *, progress: ProgressCallback | None = None
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

@final
class Octree:
    def __new__(
        cls, cloud: PointCloud, leaf_size: float, *, progress: ProgressCallback | None = None
    ) -> Octree: ...
    @staticmethod
    def with_at_most(
        cloud: PointCloud, count: int, *, progress: ProgressCallback | None = None
    ) -> Octree: ...
    @property
    def depth(self) -> int: ...
    def node_size(self, level: int) -> float: ...
    def level_with_at_most(self, count: int) -> int: ...
    def counts(self, level: int | None = None) -> NDArray[np.uint32]: ...
    def centers(self, level: int | None = None) -> NDArray[np.float64]: ...
    def centroids(self, level: int | None = None) -> NDArray[np.float64]: ...

@final
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

@final
class SparseCodes:
    def __new__(
        cls, offsets: ArrayLike, atoms: ArrayLike, coefficients: ArrayLike
    ) -> SparseCodes: ...
    @property
    def offsets(self) -> NDArray[np.uint64]: ...
    @property
    def atoms(self) -> NDArray[np.uint32]: ...
    @property
    def coefficients(self) -> NDArray[np.float32]: ...
    def to_dense(self, n_atoms: int) -> NDArray[np.float32]: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: int, /) -> tuple[NDArray[np.uint32], NDArray[np.float32]]: ...

@final
class Ksvd:
    @property
    def dictionary(self) -> NDArray[np.float32]: ...
    @property
    def codes(self) -> SparseCodes: ...
    @property
    def objective(self) -> NDArray[np.float64]: ...
    @property
    def iterations(self) -> int: ...
    @property
    def replaced(self) -> int: ...
    @property
    def cropped(self) -> int: ...
    @property
    def stop_reason(self) -> str: ...

def sparse_omp(
    dictionary: ArrayLike,
    signals: ArrayLike,
    weights: ArrayLike | None,
    max_atoms: int,
    tolerance: float,
    selection: str,
) -> SparseCodes: ...
def sparse_ksvd(
    signals: ArrayLike,
    weights: ArrayLike | None,
    n_atoms: int,
    max_atoms: int,
    tolerance: float,
    selection: str,
    iterations: int,
    convergence: float,
    random_state: int,
    max_coherence: float,
    update_iterations: int,
    update_tolerance: float,
    progress: ProgressCallback | None,
) -> Ksvd: ...
def sparse_reconstruct(dictionary: ArrayLike, codes: SparseCodes) -> NDArray[np.float32]: ...
def sparse_squared_errors(
    dictionary: ArrayLike,
    signals: ArrayLike,
    weights: ArrayLike | None,
    codes: SparseCodes,
) -> NDArray[np.float64]: ...

# The patches family: crates/surfabet-py/src/patches.rs

def learn_patches(
    cloud: PointCloud,
    *,
    resolution: float,
    patch_pixels: int,
    levels: int,
    max_depth_deviation: float | None,
    max_color_deviation: float,
    min_coverage: float,
    placement: str,
    depth_atoms: int,
    color_atoms: int,
    depth_sparsity: int,
    color_sparsity: int,
    depth_tolerance: float | None,
    color_tolerance: float,
    iterations: int,
    sensor: str,
    random_state: int,
    dictionary: HscsmDictionary | None,
    progress: ProgressCallback | None,
) -> HscsmModel: ...
def learn_lattice(
    cloud: PointCloud,
    *,
    resolution: float,
    levels: int,
    rate: float,
    depth_step: int,
    rounds: int,
    color_step: int,
    chroma_ratio: float,
    color_rate: float,
    max_error: float | None,
    sensor: str,
    progress: ProgressCallback | None,
) -> PatchModel: ...

class Model:
    def decode(
        self,
        *,
        resolution: float | None,
        as_measured: bool,
        normals: bool,
        max_points: int,
        progress: ProgressCallback | None,
    ) -> PointCloud: ...
    def to_bytes(self) -> bytes: ...
    def save(self, path: str) -> int: ...
    @property
    def method(self) -> str: ...
    @property
    def n_points(self) -> int: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def has_color(self) -> bool: ...
    @property
    def keeps_thickness(self) -> bool: ...
    @property
    def shares_vocabulary(self) -> bool: ...
    @property
    def report_dict(self) -> dict[str, Any]: ...
    @property
    def summary_dict(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...

_Vocabulary: TypeAlias = Alphabet | BicAlphabet | HscsmDictionary

def from_bytes(
    data: bytes, *, max_items: int, max_bytes: int, vocabulary: _Vocabulary | None
) -> Model: ...
def load(
    path: str, *, max_items: int, max_bytes: int, vocabulary: _Vocabulary | None
) -> Model: ...
def inspect(
    data: bytes, *, max_items: int, max_bytes: int
) -> tuple[str, str, str | None, list[tuple[str, int]]]: ...
def learn_alphabet(
    cloud: PointCloud,
    *,
    alphabet: Alphabet | None,
    radius: float | None,
    scales: int,
    max_words: int,
    inlier_bits: float,
    outlier_bits: float,
    spacing: float,
    rounds: int,
    sigma_scale: float,
    angular_resolution: float | None,
    noise: float | None,
    min_range: float,
    color_step: int,
    progress: ProgressCallback | None,
) -> AlphabetModel: ...

@final
class Alphabet:
    @property
    def radius(self) -> float: ...
    @property
    def scales(self) -> int: ...
    @property
    def hash(self) -> str: ...
    def heights(self) -> NDArray[np.float32]: ...
    def __len__(self) -> int: ...

@final
class AlphabetModel(Model):
    @property
    def has_intensity(self) -> bool: ...
    @property
    def alphabet(self) -> Alphabet: ...
    @property
    def deviation(self) -> tuple[float, float | None, float]: ...
    @property
    def constant_sigma(self) -> float: ...
    def words(self) -> NDArray[np.int64]: ...
    def radii(self) -> NDArray[np.float64]: ...
    def sigma(self) -> NDArray[np.float64]: ...
    def poses(self) -> NDArray[np.float64]: ...
    def colors(self) -> NDArray[np.uint8] | None: ...
    def intensities(self) -> NDArray[np.float32] | None: ...

def learn_bic(
    cloud: PointCloud,
    *,
    radius: float,
    scale: float,
    angular_resolution: float | None,
    noise: float | None,
    min_range: float,
    epsilon: float | None,
    feature_spacing: float | None,
    interest_scales: Sequence[float],
    interest_threshold: float,
    normal_neighbors: int,
    upright: str,
    descriptor_pixels: int,
    empty_penalty: float,
    floor: float,
    min_points: int,
    iterations: int,
    max_rejections: int,
    reduce: bool,
    random_state: int,
    alphabet: BicAlphabet | None,
    progress: ProgressCallback | None,
) -> BicAlphabetModel: ...
def bic_defaults() -> dict[str, Any]: ...

@final
class BicAlphabet:
    @property
    def radius(self) -> float: ...
    @property
    def descriptor_pixels(self) -> int: ...
    @property
    def upright(self) -> str: ...
    @property
    def hash(self) -> str: ...
    def points(self) -> list[NDArray[np.float32]]: ...
    def descriptors(self) -> NDArray[np.float32]: ...
    def __len__(self) -> int: ...

@final
class BicAlphabetModel(Model):
    def sharing_alphabet(self, shares: bool) -> BicAlphabetModel: ...
    @property
    def epsilon(self) -> float: ...
    @property
    def alphabet(self) -> BicAlphabet: ...
    @property
    def word_ids(self) -> NDArray[np.uint32]: ...
    @property
    def counts(self) -> NDArray[np.uint64]: ...
    def poses(self) -> NDArray[np.float64]: ...

@final
class HscsmModel(Model):
    @property
    def levels(self) -> list[tuple[float, int, int, int, int, int, float]]: ...
    @property
    def centers(self) -> NDArray[np.float64]: ...
    @property
    def axes(self) -> NDArray[np.float32]: ...
    def masks(self, level: int) -> NDArray[np.bool_]: ...
    def means(self, level: int, channel: str) -> NDArray[np.float64]: ...
    def dictionary(self, level: int, channel: str) -> NDArray[np.float32]: ...
    def dictionaries(self) -> HscsmDictionary: ...
    def codes(
        self, level: int, channel: str
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint16], NDArray[np.float64]]: ...

@final
class PatchModel(Model):
    @property
    def rotation(self) -> list[list[float]]: ...
    @property
    def max_error(self) -> float | None: ...
    @property
    def n_extra_points(self) -> int: ...
    @property
    def levels(self) -> list[tuple[float, int, int, int]]: ...
    def places(self) -> NDArray[np.int64]: ...
    def masks(self) -> NDArray[np.bool_]: ...
    def coefficients(self) -> NDArray[np.float64]: ...
    def sigma(self) -> NDArray[np.float64]: ...

@final
class HscsmDictionary:
    @property
    def levels(self) -> list[tuple[float, int]]: ...
    @property
    def hash(self) -> str: ...
    def entries(self, channel: str) -> list[NDArray[np.float32]] | None: ...

def random_downsample(cloud: PointCloud, count: int, random_state: int) -> PointCloud: ...
def farthest_point_downsample(
    cloud: PointCloud, count: int, start: int, progress: ProgressCallback | None
) -> PointCloud: ...
def learn_gas(
    cloud: PointCloud,
    *,
    n_neurons: int,
    patterns: int,
    epsilon_w: float,
    epsilon_n: float,
    alpha: float,
    beta: float | None,
    max_age: int,
    target_error: float | None,
    passes: float | None,
    position_step: float | None,
    color_step: int,
    search: str,
    random_state: int,
    progress: ProgressCallback | None,
) -> GasModel: ...

@final
class GasModel(Model):
    def update(
        self,
        cloud: PointCloud,
        *,
        n_neurons: int | None,
        patterns: int,
        target_error: float | None,
        random_state: int,
        progress: ProgressCallback | None,
    ) -> GasModel: ...
    @property
    def mean_error(self) -> float: ...
    @property
    def position_step(self) -> float: ...
    def positions(self) -> NDArray[np.float64]: ...
    def normals(self) -> NDArray[np.float32]: ...
    def colors(self) -> NDArray[np.uint8] | None: ...
    def counts(self) -> NDArray[np.float64]: ...
    def radii(self) -> NDArray[np.float64]: ...
    def thicknesses(self) -> NDArray[np.float64]: ...
    def edges(self) -> NDArray[np.uint32]: ...
    def mesh(self) -> NDArray[np.uint32]: ...
    def components(self) -> NDArray[np.uint32]: ...
    def geodesic_distances(self, source: int) -> NDArray[np.float64]: ...

def find_occurrences(
    model: AlphabetModel,
    *,
    ball: tuple[Sequence[float], float] | None,
    corners: tuple[Sequence[float], Sequence[float]],
    min_score: float,
    max_found: int,
    resolution: float | None,
    tolerance: float | None,
    color_tolerance: float | None,
    progress: ProgressCallback | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
def place_similarity(a: AlphabetModel, b: AlphabetModel) -> float: ...
def word_histogram(
    model: AlphabetModel,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]: ...

# Planes: crates/surfabet-py/src/planes.rs

def learn_planes(
    cloud: PointCloud,
    *,
    initial_patches: int,
    min_grid_size: float | None,
    weight_at_grid_size: float,
    split_threshold: float,
    merge_tolerance: float,
    em_steps: int,
    new_patches_every: int,
    max_iterations: int,
    tolerance: float,
    min_points: int | None,
    min_purity: float,
    min_fill: float,
    max_bend: float,
    color_step: int,
    weights: ArrayLike | None,
    random_state: int,
    progress: ProgressCallback | None,
) -> PlaneModel: ...
def random_planes(
    cloud: PointCloud, *, n_planes: int, random_state: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def fit_planes_em(
    cloud: PointCloud,
    *,
    centers: ArrayLike,
    normals: ArrayLike,
    weights: ArrayLike | None,
    max_iterations: int,
    tolerance: float,
    progress: ProgressCallback | None,
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.int32], float, NDArray[np.float64]
]: ...

@final
class PlaneModel(Model):
    def segment(
        self, cloud: PointCloud, *, progress: ProgressCallback | None
    ) -> NDArray[np.int32]: ...
    def project(self, cloud: PointCloud, *, progress: ProgressCallback | None) -> PointCloud: ...
    @property
    def n_outliers(self) -> int: ...
    @property
    def grid_size(self) -> float: ...
    @property
    def labels(self) -> NDArray[np.int32] | None: ...
    def centers(self) -> NDArray[np.float64]: ...
    def axes(self) -> NDArray[np.float64]: ...
    def extents(self) -> NDArray[np.float64]: ...
    def standard_deviations(self) -> NDArray[np.float64]: ...
    def counts(self) -> NDArray[np.float64]: ...
    def areas(self) -> NDArray[np.float64]: ...
    def tile_edges(self) -> NDArray[np.float64]: ...
    def supported(self) -> list[NDArray[np.bool_]]: ...
    def colors(self) -> list[NDArray[np.uint8]] | None: ...
    def polygons(self, patch: int) -> list[NDArray[np.float64]]: ...
    def mesh(self) -> tuple[NDArray[np.float64], NDArray[np.uint32], NDArray[np.uint32]]: ...