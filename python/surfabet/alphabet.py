"""Alphabets: recurrent pieces of surface as words, and a scene as the places where they occur.

The idea is that of M. Ruhnke, B. Steder, G. Grisetti, W. Burgard: Unsupervised Learning of Compact
3D Models Based on the Detection of Recurrent Structures, ICRA 2010. What is learned here is chosen
by description length: every bit of words, occurrences and misfit counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, final, overload

import numpy as np
from numpy.typing import NDArray

from surfabet import _core, alphabet_bic
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.alphabet_bic import BicAlphabetModel
from surfabet.errors import InvalidInputError
from surfabet.metrics import RangeSigma
from surfabet.model import MAX_POINTS, Model

__all__ = [
    "Alphabet",
    "AlphabetModel",
    "FoundOccurrence",
    "Occurrences",
    "WordShares",
    "learn_alphabet",
    "place_similarity",
]

PRESETS = {"small": 4.0, "balanced": 7.0, "fine": 24.0}
"""Bits that a point is worth, by preset."""

Preset = Literal["small", "balanced", "fine"]


@dataclass(frozen=True, slots=True)
class Occurrences:
    """Where words occur: all m occurrences of a model as arrays, in the order of the file."""

    words: NDArray[np.int64]
    """Which word, (m,); 0 is the plane."""
    radii: NDArray[np.float64]
    """Radius of the word there, (m,), metres: it spans a square of two radii."""
    poses: NDArray[np.float64]
    """Word to world, (m, 4, 4): columns are what is right, what is up, the normal towards the
    sensor, and the middle of the word."""
    sigma: NDArray[np.float64]
    """Deviation that was allowed there, (m,), metres."""
    colors: NDArray[np.uint8] | None
    """Mean red, green and blue, (m, 3); None without colour."""
    intensities: NDArray[np.float32] | None
    """Mean return strength, (m,), in the sensor's unit; None without."""

    def __len__(self) -> int:
        return len(self.words)


@dataclass(frozen=True, slots=True)
class FoundOccurrence:
    """A place that looks like the example."""

    pose: NDArray[np.float64]
    """Takes the example there, world to world, (4, 4): a turn about the vertical and a shift."""
    score: float
    """How alike, 0 to 1; 1 for the example itself."""
    center: NDArray[np.float64]
    """Where the middle of the region comes to lie, (3,), metres."""


@dataclass(frozen=True, slots=True)
class WordShares:
    """What a scene is made of: area per word, radius and inclination, all arrays of length k."""

    words: NDArray[np.int64]
    """Which word, (k,)."""
    radii: NDArray[np.float64]
    """In which radius, (k,), metres."""
    inclinations: NDArray[np.int64]
    """Class of its normal's inclination, (k,): 0 steep as on a wall to 3 level as on a floor, a
    quarter of a right angle each."""
    shares: NDArray[np.float64]
    """Share of the area of all occurrences, (k,); they add up to 1."""

    def __len__(self) -> int:
        return len(self.words)


@final
class Alphabet:
    """Words, to describe any number of scenes by; immutable.

    Made by `AlphabetModel.alphabet`. A model that `describe` makes names its alphabet in the file
    and does not hold it, so that it needs the alphabet again when it is loaded.
    """

    __slots__ = ("_core",)

    def __init__(self, core: _core.Alphabet) -> None:
        self._core = core

    @property
    def hash(self) -> str:
        """The first 128 bits of the BLAKE3 hash of its content, as hexadecimal digits."""
        return self._core.hash

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radii that words stand in, metres, ascending."""
        return self._core.radius * np.exp2(np.arange(self._core.scales, dtype=np.float64))

    @property
    def heights(self) -> NDArray[np.float32]:
        """Height maps of the words over their radius, (n, 8, 8), rows going up; NaN where a word
        has a hole. Word 0 is the plane."""
        return self._core.heights()

    def describe(
        self,
        cloud: PointCloud,
        *,
        preset: Preset = "balanced",
        inlier_bits: float | None = None,
        outlier_bits: float | None = None,
        spacing: float = 1.0,
        rounds: int = 4,
        sigma_scale: float = 3.0,
        angular_resolution: float | None = None,
        noise: float | None = None,
        min_range: float = 0.0,
        color_step: int = 8,
        progress: Progress = None,
    ) -> AlphabetModel:
        """Another cloud by the words of this alphabet, which stays as it is (IV-B).

        Options, errors and determinism are those of `learn_alphabet`.
        """
        return _learn_mdl(
            cloud,
            self._core,
            preset=preset,
            inlier_bits=inlier_bits,
            outlier_bits=outlier_bits,
            spacing=spacing,
            rounds=rounds,
            sigma_scale=sigma_scale,
            angular_resolution=angular_resolution,
            noise=noise,
            min_range=min_range,
            color_step=color_step,
            progress=progress,
        )

    def __len__(self) -> int:
        return len(self._core)

    def __repr__(self) -> str:
        radii = " / ".join(f"{radius:g}" for radius in self.radii)
        return f"Alphabet({len(self)} words in radii of {radii} m)"


@final
class AlphabetModel(Model[_core.AlphabetModel]):
    """A cloud as occurrences of words; immutable.

    Made by `learn_alphabet`, `Alphabet.describe` and `surfabet.load`.
    """

    __slots__ = ()

    @property
    def alphabet(self) -> Alphabet:
        """The words that occur."""
        return Alphabet(self._core.alphabet)

    @property
    def shares_alphabet(self) -> bool:
        """Whether the file names its alphabet instead of holding it."""
        return self._core.shares_alphabet

    @property
    def has_intensity(self) -> bool:
        """Whether the model carries intensity."""
        return self._core.has_intensity

    @property
    def occurrences(self) -> Occurrences:
        """Where words occur, as arrays."""
        return Occurrences(
            words=self._core.words(),
            radii=self._core.radii(),
            poses=self._core.poses(),
            sigma=self._core.sigma(),
            colors=self._core.colors(),
            intensities=self._core.intensities(),
        )

    @property
    def counts(self) -> NDArray[np.int64]:
        """How often each word of the alphabet occurs, (n,)."""
        return np.bincount(self._core.words(), minlength=len(self.alphabet))

    @property
    def sigma(self) -> RangeSigma | float:
        """The tolerance that the model was made for, as `evaluate` takes it: metres where ranges
        were not known; else it grows with the range, without the noise allowed beside it."""
        scale, angular_resolution, _ = self._core.deviation
        if angular_resolution is None:
            return self._core.constant_sigma
        return RangeSigma(scale, angular_resolution)

    @property
    def noise(self) -> float:
        """Standard deviation of the scan about its surface that was allowed beside `sigma`,
        metres."""
        return self._core.deviation[2]

    def decode(
        self,
        resolution: float | None = None,
        *,
        normals: bool = False,
        max_points: int = MAX_POINTS,
        progress: Progress = None,
    ) -> PointCloud:
        """The model as a cloud.

        Parameters
        ----------
        resolution
            Spacing of the points, metres; by default one sigma, so that points lie denser near the
            sensor, as they did in the scan.
        normals
            Give every point the normal of its word.
        max_points
            Refuse to make more points than this.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Returns
        -------
        PointCloud
            Points word by word; where words overlap, so do their points.

        Raises
        ------
        InvalidInputError
            For a spacing that is not positive, or one that makes more than `max_points` points.
        """
        with progress_callback(progress) as callback:
            return self._core.decode(
                resolution=resolution, normals=normals, max_points=max_points, progress=callback
            )

    def find(
        self,
        *,
        point: Sequence[float] | None = None,
        radius: float | None = None,
        box: tuple[Sequence[float], Sequence[float]] | None = None,
        min_score: float = 0.5,
        max_found: int = 1000,
        resolution: float | None = None,
        tolerance: float | None = None,
        color_tolerance: float | None = 10.0,
        progress: Progress = None,
    ) -> list[FoundOccurrence]:
        """All places that look like an example in the scene: the surface within `radius` of `point`
        or in `box`.

        Scenes are upright: places differ by a turn about the vertical and a shift. A thing must
        stand out of the deviation that the model was learned with, so learn finer than for the
        smallest file: `sigma_scale` 1 to 1.5, and `angular_resolution` divided by the root of the
        number of scans that overlap.

        Parameters
        ----------
        point, radius
            Middle and radius of a ball around the example, metres.
        box
            Lowest and highest corner of an upright box around it, in place of a ball.
        min_score
            Least score of what is returned. Things of one kind seen from different sides score
            0.5 to 0.85 against each other; unlike things score up to 0.55 by shape alone, less with
            colours.
        max_found
            Most places.
        resolution
            Spacing of the samples compared, metres; by default a 64th of the region's diagonal.
        tolerance
            Deviation of equal surfaces, metres; by default the median sigma of the example's
            occurrences.
        color_tolerance
            Deviation of equal colours in chroma, grey levels; luma, which changes with the light,
            may differ three times as much. None goes by shape alone, as in a model without colours:
            things of one shape are found in any colour, but not what lies flush with a wall, such
            as a door.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Returns
        -------
        list of FoundOccurrence
            Best first; the example itself, with score 1, comes first. The same for any number of
            threads.

        Raises
        ------
        InvalidInputError
            For no region or two, a region where the model has no words, or an option outside of its
            domain.
        """
        corners: tuple[list[float], list[float]] = ([0.0] * 3, [0.0] * 3)
        ball: tuple[list[float], float] | None = None
        if box is not None and point is None and radius is None:
            low, high = box
            corners = (_triple("box", low), _triple("box", high))
        elif box is None and point is not None and radius is not None:
            ball = (_triple("point", point), float(radius))
        else:
            raise InvalidInputError("give either point and radius, or box")
        with progress_callback(progress) as callback:
            poses, scores, centers = _core.find_occurrences(
                self._core,
                ball=ball,
                corners=corners,
                min_score=min_score,
                max_found=max_found,
                resolution=resolution,
                tolerance=tolerance,
                color_tolerance=color_tolerance,
                progress=callback,
            )
        return [
            FoundOccurrence(pose, float(score), center)
            for pose, score, center in zip(poses, scores, centers, strict=True)
        ]

    def word_histogram(self) -> WordShares:
        """The share of area that every word takes, by radius and inclination."""
        return WordShares(*_core.word_histogram(self._core))

    def __repr__(self) -> str:
        return (
            f"AlphabetModel({self.n_points} points as {len(self)} occurrences of "
            f"{len(self.alphabet)} words"
            + (", coloured" if self.has_color else "")
            + (", with intensity" if self.has_intensity else "")
            + ")"
        )


@overload
def learn_alphabet(
    cloud: PointCloud,
    *,
    method: Literal["mdl"] = ...,
    radius: float | None = ...,
    scales: int = ...,
    max_words: int = ...,
    preset: Preset = ...,
    inlier_bits: float | None = ...,
    outlier_bits: float | None = ...,
    spacing: float = ...,
    rounds: int = ...,
    sigma_scale: float = ...,
    angular_resolution: float | None = ...,
    noise: float | None = ...,
    min_range: float = ...,
    color_step: int = ...,
    random_state: int = ...,
    progress: Progress = ...,
) -> AlphabetModel: ...
@overload
def learn_alphabet(
    cloud: PointCloud,
    *,
    method: Literal["bic"],
    radius: float = ...,
    sigma_scale: float = ...,
    angular_resolution: float | None = ...,
    noise: float | None = ...,
    min_range: float = ...,
    epsilon: float | None = ...,
    feature_spacing: float | None = ...,
    interest_scales: Sequence[float] = ...,
    interest_threshold: float = ...,
    normal_neighbors: int = ...,
    upright: Literal["x", "z", "view"] = ...,
    descriptor_pixels: int = ...,
    empty_penalty: float = ...,
    floor: float = ...,
    min_points: int = ...,
    iterations: int = ...,
    max_rejections: int = ...,
    reduce: bool = ...,
    random_state: int = ...,
    progress: Progress = ...,
) -> BicAlphabetModel: ...
def learn_alphabet(
    cloud: PointCloud,
    *,
    method: Literal["mdl", "bic"] = "mdl",
    progress: Progress = None,
    **options: Any,
) -> AlphabetModel | BicAlphabetModel:
    """Learns an alphabet from a cloud, and describes the cloud by it.

    Two methods share the idea of recurrent words placed by poses:

    "mdl", the default, chooses by description length: bits of words and of occurrences against
    what is not explained. Words are small height maps at several radii, poses are quantised before
    they are scored, and files are a hundred times smaller.

    "bic" is the published method: words are points of the scene, every feature takes the word with
    the nearest descriptor, and candidates are accepted when the Bayesian information criterion
    falls.

    A point is explained when a decoded point lies within sigma of it (eq. 13):
    sigma = sigma_scale * hypot(tan(angular_resolution / 2) * range, noise). Where the cloud has no
    ranges, half the spacing of its points takes the place of the first term;
    `surfabet.read(..., viewpoint=)` gives a scan its sensor back.

    Parameters
    ----------
    cloud
        What to describe. Duplicates count once. Ranges and viewpoints make sigma, and orient words.
        "mdl" keeps colours and intensities as the mean of every occurrence.
    method
        "mdl" or "bic".
    radius
        Radius of a word, metres (delta): the smallest for "mdl", by default 0.1, or one and a half
        times the median sigma where that is more; the only one for "bic", by default 0.1.
    sigma_scale
        Lambda of eq. 13, by default 3.
    angular_resolution
        Alpha, the angle between neighbouring beams, radians; estimated when not given.
    noise
        Standard deviation of a measured point about its surface, metres; estimated when not given
        for "mdl", by default 0 for "bic".
    min_range
        What is nearer to the sensor is left out, metres: a robot sees itself.
    random_state
        Seed of the candidates of "bic". "mdl" leaves nothing to chance, so that every seed gives
        the same.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Of "mdl":

    scales
        Number of radii, each twice the one before, 1 to 8, by default 4.
    max_words
        Most words beside the plane, by default 24. Those that do not pay for themselves are
        dropped.
    preset
        "small", "balanced" or "fine": 4, 7 or 24 bits for `inlier_bits` and `outlier_bits`.
    inlier_bits
        What explaining a point is worth, bits. Points denser than half a sigma count once.
    outlier_bits
        What a decoded point that explains nothing costs, bits; by default as much as an inlier is
        worth.
    spacing
        Distance of decoded points, in sigma, 0.25 to 4, by default 1.
    rounds
        How often the scene is covered, each time with the prices that the round before taught, by
        default 4.
    color_step
        Rounding of mean colours, 1 to 255, by default 8.

    Of "bic" (defaults and what they were chosen by stand in the guide):

    epsilon
        Least distance of decoded points, metres (eq. 3).
    feature_spacing
        No point is further than this from a feature, metres.
    interest_scales, interest_threshold
        Scales of the Laplacian of Gaussian, pixels, and its least response.
    normal_neighbors
        Points that a normal is fitted to.
    upright
        What is up about a vertical normal: "x", "z" or "view".
    descriptor_pixels
        Pixels per side of a descriptor.
    empty_penalty
        Distance of a pixel that only one of two descriptors has, in radii.
    floor
        Where a point without neighbour counts as having one, in sigma.
    min_points
        Least number of points of a candidate word.
    iterations, max_rejections
        Candidates at most, and rejected ones in a row.
    reduce
        Remove occurrences without which the likelihood does not fall (III-D).

    Returns
    -------
    AlphabetModel or BicAlphabetModel
        The same for any order of the points and any number of threads.

    Raises
    ------
    InvalidInputError
        For an empty cloud, a cloud too large for its radius, or an option outside of its domain.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> square = np.stack(np.meshgrid(*[np.arange(100) * 0.02] * 2), -1).reshape(-1, 2)
    >>> cloud = sb.PointCloud(np.column_stack([square, np.ones(len(square))]))
    >>> model = sb.learn_alphabet(cloud)
    >>> quality = sb.evaluate(cloud, model.decode(), sigma=model.sigma)
    >>> quality.inliers > 0.95
    True
    """
    match method:
        case "mdl":
            return _learn_mdl(cloud, None, progress=progress, **options)
        case "bic":
            return BicAlphabetModel(alphabet_bic.learn(cloud, progress=progress, **options))
        case other:
            raise InvalidInputError(f'method is {other!r}, but must be "mdl" or "bic"')


def _learn_mdl(
    cloud: PointCloud,
    alphabet: _core.Alphabet | None,
    /,
    *,
    radius: float | None = None,
    scales: int = 4,
    max_words: int = 24,
    preset: Preset = "balanced",
    inlier_bits: float | None = None,
    outlier_bits: float | None = None,
    spacing: float = 1.0,
    rounds: int = 4,
    sigma_scale: float = 3.0,
    angular_resolution: float | None = None,
    noise: float | None = None,
    min_range: float = 0.0,
    color_step: int = 8,
    random_state: int = 0,
    progress: Progress = None,
) -> AlphabetModel:
    """With an alphabet, radius and scales are its own, and no words are sought."""
    if not 0 <= random_state < 2**64:
        raise InvalidInputError(f"random_state is {random_state}, but must be 0 to 2**64 - 1")
    if preset not in PRESETS:
        raise InvalidInputError(f"preset is {preset!r}, but must be one of {', '.join(PRESETS)}")
    inlier_bits = PRESETS[preset] if inlier_bits is None else inlier_bits
    with progress_callback(progress) as callback:
        core = _core.learn_alphabet(
            cloud,
            alphabet=alphabet,
            radius=radius,
            scales=scales,
            max_words=max_words,
            inlier_bits=inlier_bits,
            outlier_bits=inlier_bits if outlier_bits is None else outlier_bits,
            spacing=spacing,
            rounds=rounds,
            sigma_scale=sigma_scale,
            angular_resolution=angular_resolution,
            noise=noise,
            min_range=min_range,
            color_step=color_step,
            progress=callback,
        )
    return AlphabetModel(core)


def place_similarity(a: AlphabetModel, b: AlphabetModel) -> float:
    """How alike two places are, 0 to 1, by the words that occur and how they lie to each other.

    1 for a model and itself, the same either way, and whatever the heading and position of the
    scans, as long as both are upright. Alphabets may differ: words are compared by their looks.
    """
    return _core.place_similarity(a._core, b._core)


def _triple(name: str, values: Sequence[float]) -> list[float]:
    if len(values) != 3:
        raise InvalidInputError(f"{name} has {len(values)} coordinates, expected 3")
    return [float(value) for value in values]
