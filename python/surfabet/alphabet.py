"""Alphabets: recurrent pieces of surface as words, and a scene as the places where they occur.

The idea is that of M. Ruhnke, B. Steder, G. Grisetti, W. Burgard: Unsupervised Learning of Compact
3D Models Based on the Detection of Recurrent Structures, ICRA 2010. What is learned here is chosen
by description length: every bit of words, occurrences and misfit counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._checks import check_items, check_number, check_vector, real_array
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.errors import InvalidInputError, wrong_type, wrong_value
from surfabet.metrics import RangeSigma
from surfabet.model import Model
from surfabet.model import corners as corners_of

__all__ = [
    "Alphabet",
    "AlphabetModel",
    "FoundOccurrence",
    "Occurrences",
    "WordShares",
    "learn_alphabet",
    "place_similarity",
]


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


@dataclass(frozen=True, slots=True, eq=False)
class FoundOccurrence:
    """A place that looks like the example."""

    pose: NDArray[np.float64]
    """Takes the example there, world to world, (4, 4): a turn about the vertical and a shift."""
    score: float
    """How alike, 0 to 1; 1 for the example itself."""
    center: NDArray[np.float64]
    """Where the middle of the region comes to lie, (3,), metres."""
    sizes: tuple[float, float] = (1.0, 1.0)
    """Sizes over those of the example: what is level, what is upright."""
    example: int = 0
    """Which of several examples fits best, from 0."""
    region: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    """Lowest and highest corner of a box around the example, in the world of the example."""

    def mask(self, points: ArrayLike, *, margin: float = 0.02) -> NDArray[np.bool_]:
        """Which points, (n, 3), of the scene lie in the box of the example where it was found.

        `margin` is by how many metres the box is wider on each side.
        """
        check_number("margin", margin, "a number of metres")
        array = real_array(points)
        if array is None or array.ndim != 2 or array.shape[1] != 3:
            raise wrong_type("points", points, "an array of numbers of the shape (n, 3)")
        if self.region is None:
            raise InvalidInputError("this place was made without a region; use AlphabetModel.find")
        low, high = self.region
        local = (array - self.center) @ self.pose[:3, :3]
        level, upright = self.sizes
        half = 0.5 * (high - low) * [level, level, upright] + margin
        inside: NDArray[np.bool_] = np.all(np.abs(local) <= half, axis=1)
        return inside


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
        quality: Literal["small", "balanced", "fine"] = "balanced",
        inlier_bits: float | None = None,
        outlier_bits: float | None = None,
        spacing: float = 1.0,
        rounds: int = 4,
        sigma_scale: float = 3.0,
        angular_resolution: float | None = None,
        noise: float | None = None,
        min_range: float = 0.0,
        keep_outliers: bool = False,
        color_step: int = 8,
        progress: Progress = None,
    ) -> AlphabetModel:
        """Another cloud by the words of this alphabet, which stays as it is (IV-B).

        Radii are those of the alphabet.

        Parameters
        ----------
        cloud
            The scan.
        quality
            Small files or fine detail. Sets `inlier_bits`, unless that is given, to 4, 7 or 24.
            'small', 'balanced' or 'fine'; by default balanced.
        inlier_bits
            What explaining a point is worth. Points denser than half a sigma count once. A positive
            number of bits; by default by `quality`.
        outlier_bits
            What a decoded point that explains nothing costs. 0 or a positive number of bits; by
            default as `inlier_bits`.
        spacing
            Distance of decoded points. A number from 0.25 to 4 sigma; by default 1.
        rounds
            Rounds of covering the scene. Each uses the prices that the coder learned in the round
            before. An integer from 1 to 64; by default 4.
        sigma_scale
            Factor of the deviation sigma within which a point is explained (lambda, eq. 13). Sigma
            is this times hypot(tan(`angular_resolution` / 2) * range, `noise`). A number above 0
            and at most 1e6; by default 3.
        angular_resolution
            Angle between neighbouring beams (alpha, eq. 13). A number above 0 and below 180
            degrees; by default estimated from the spacing of the points.
        noise
            Standard deviation of a measured point about its surface. A number from 0 to 1e9 metres;
            by default estimated as the median deviation of neighbouring points from their plane.
        min_range
            Points nearer to the sensor are left out, such as the robot's own body. A number from 0
            to 1e9 metres; by default 0.
        keep_outliers
            Keeps points that are far from all others. Otherwise those of which a few would make the
            scene many times as large as it is are left out, and counted in the report. True or
            False; by default False.
        color_step
            Rounding of the mean colours of occurrences. An integer from 1 to 255 grey levels; by
            default 8.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Raises
        ------
        InvalidInputError
            As `learn_alphabet`.
        """
        options = {
            "quality": quality,
            "inlier_bits": inlier_bits,
            "outlier_bits": outlier_bits,
            "spacing": spacing,
            "rounds": rounds,
            "sigma_scale": sigma_scale,
            "angular_resolution": angular_resolution,
            "noise": noise,
            "min_range": min_range,
            "keep_outliers": keep_outliers,
            "color_step": color_step,
        }
        with progress_callback(progress) as callback:
            return AlphabetModel(self._core.describe(cloud, options, progress=callback))

    def __len__(self) -> int:
        return len(self._core)

    def __repr__(self) -> str:
        radii = " / ".join(f"{radius:g}" for radius in self.radii)
        return f"Alphabet({len(self)} words in radii of {radii} m)"


@final
class AlphabetModel(Model[_core.AlphabetModel]):
    """A cloud as occurrences of words; immutable.

    Made by `learn_alphabet`, `Alphabet.describe` and `surfabet.load`. It decodes to a spacing of
    one sigma by default, so that points lie denser near the sensor, as they did in the scan. Where
    words overlap, so do their points.
    """

    __slots__ = ()

    @property
    def alphabet(self) -> Alphabet:
        """The words that occur."""
        return Alphabet(self._core.alphabet)

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
        sigma_scale, angular_resolution, _ = self._core.deviation
        if angular_resolution is None:
            return self._core.constant_sigma
        return RangeSigma(sigma_scale, angular_resolution)

    @property
    def noise(self) -> float:
        """Standard deviation of the scan about its surface that was allowed beside `sigma`,
        metres."""
        return self._core.deviation[2]

    def find(
        self,
        example: AlphabetModel | Sequence[AlphabetModel] | None = None,
        *,
        point: Sequence[float] | None = None,
        radius: float | None = None,
        box: tuple[Sequence[float], Sequence[float]] | None = None,
        min_score: float | None = None,
        max_found: int = 1000,
        resolution: float | None = None,
        tolerance: float | None = None,
        color_tolerance: float | None = 10.0,
        size_tolerance: float | None = None,
        progress: Progress = None,
    ) -> list[FoundOccurrence]:
        """All places that look like an example: a part of this scene, or models of other scenes.

        Without `example` it is the surface of this scene within `radius` of `point` or in `box`.

        Scenes are upright: places differ by a turn about the vertical and a shift. A thing must
        stand out of the deviation that the model was learned with, so learn finer than for the
        smallest file: `sigma_scale` 1 to 1.5, and `angular_resolution` divided by the root of the
        number of scans that overlap.

        Parameters
        ----------
        example
            A model of a thing, learned from points that were cut out of any scan, upright; or
            several: each place is given once, with the example that fits best. With `point` and
            `radius`, or `box`, only that part of each model is the example.
        point
            Middle of a ball around the example, metres.
        radius
            Radius of the ball, metres.
        box
            Lowest and highest corner of an upright box around it, in place of a ball.
        min_score
            Least score of what is found. Things of one kind seen from different sides score 0.5 to
            0.85 against each other; unlike things score up to 0.55 by shape alone, less with
            colours. A number from 0 to 1; by default 0.5; for examples of another model 0.525 by
            shape alone, 0.48 with colours.
        max_found
            Most places that are found. 0 or a positive integer; by default 1000.
        resolution
            Spacing of the samples that are compared. A positive number of metres; by default a 64th
            of the diagonal of the example's region.
        tolerance
            Standard deviation of equal surfaces. A positive number of metres; by default the median
            sigma of the example's occurrences.
        color_tolerance
            Standard deviation of equal chromas; luma, which changes with the light, may differ
            three times as much. A positive number of grey levels; by default 10. None: shape alone
            counts, as in a model without colours: things of one shape are found in any colour, but
            not what lies flush with a wall, such as a door.
        size_tolerance
            Largest change of a size, what is level and what is upright each by its own factor:
            other things of a kind are larger or smaller than the example. A number from 0 to 0.3 as
            a share; by default 0.1 for an example of another model; 0 within one scene, where
            copies are looked for.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Returns
        -------
        list of FoundOccurrence
            Best first; an example in the scene itself, with score 1, comes first. The same for any
            number of threads.

        Raises
        ------
        InvalidInputError
            For no example or two, a region where the model has no words, or an option outside of
            its domain.
        """
        corners: tuple[list[float], list[float]] | None = None
        ball: tuple[list[float], float] | None = None
        if box is not None and point is None and radius is None:
            corners = corners_of(box)
        elif box is None and point is not None and radius is not None:
            ball = (
                check_vector("point", point, "three coordinates x, y, z"),
                check_number("radius", radius, "a positive number of metres", above=0.0),
            )
        elif example is None or not (box is None and point is None and radius is None):
            raise _no_region(point, radius, box)
        options = {
            "min_score": min_score,
            "max_found": max_found,
            "resolution": resolution,
            "tolerance": tolerance,
            "color_tolerance": color_tolerance,
            "size_tolerance": size_tolerance,
        }
        region = (ball, corners)
        models = [self] if example is None else _examples(example)
        with progress_callback(progress) as callback:
            if example is None:
                found = _core.find_occurrences(
                    self._core, region=region, options=options, progress=callback
                )
            else:
                found = _core.find_examples(
                    self._core,
                    [model._core for model in models],
                    region=region,
                    options=options,
                    progress=callback,
                )
        regions = [_box(model, ball, corners) for model in models]
        return [
            FoundOccurrence(pose, float(score), center, (level, upright), int(k), regions[k])
            for pose, score, center, (level, upright), k in zip(*found, strict=True)
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


def learn_alphabet(
    cloud: PointCloud,
    *,
    quality: Literal["small", "balanced", "fine"] = "balanced",
    radius: float | None = None,
    scales: int = 4,
    max_words: int = 24,
    inlier_bits: float | None = None,
    outlier_bits: float | None = None,
    spacing: float = 1.0,
    rounds: int = 4,
    sigma_scale: float = 3.0,
    angular_resolution: float | None = None,
    noise: float | None = None,
    min_range: float = 0.0,
    keep_outliers: bool = False,
    color_step: int = 8,
    progress: Progress = None,
) -> AlphabetModel:
    """Learns words at several scales by description length, and describes the cloud by them.

    Bits of words and of occurrences are weighed against what is not explained. Words are small
    height maps at several radii; poses are quantised before they are scored.

    A point is explained when a decoded point lies within sigma of it (eq. 13). Where the cloud has
    no ranges, half the spacing of its points takes the place of the beams' spacing;
    `surfabet.read(..., viewpoint=)` gives a scan its sensor back.

    Parameters
    ----------
    cloud
        The scan. Duplicates count once. Ranges and viewpoints make sigma, and orient words. Colours
        and intensities are kept as the mean of every occurrence.
    quality
        Small files or fine detail. Sets `inlier_bits`, unless that is given, to 4, 7 or 24.
        'small', 'balanced' or 'fine'; by default balanced.
    radius
        Smallest radius of a word (delta). A number from 1e-9 to 1e9 metres; by default from the
        data: three spacings of the points, or one and a half times the median sigma where that is
        more.
    scales
        Number of radii, each twice the one before. An integer from 1 to 8; by default 4.
    max_words
        Most words beside the plane. Those that do not pay for themselves are dropped. An integer
        from 0 to 4095; by default 24.
    inlier_bits
        What explaining a point is worth. Points denser than half a sigma count once. A positive
        number of bits; by default by `quality`.
    outlier_bits
        What a decoded point that explains nothing costs. 0 or a positive number of bits; by default
        as `inlier_bits`.
    spacing
        Distance of decoded points. A number from 0.25 to 4 sigma; by default 1.
    rounds
        Rounds of covering the scene. Each uses the prices that the coder learned in the round
        before. An integer from 1 to 64; by default 4.
    sigma_scale
        Factor of the deviation sigma within which a point is explained (lambda, eq. 13). Sigma is
        this times hypot(tan(`angular_resolution` / 2) * range, `noise`). A number above 0 and at
        most 1e6; by default 3.
    angular_resolution
        Angle between neighbouring beams (alpha, eq. 13). A number above 0 and below 180 degrees; by
        default estimated from the spacing of the points.
    noise
        Standard deviation of a measured point about its surface. A number from 0 to 1e9 metres; by
        default estimated as the median deviation of neighbouring points from their plane.
    min_range
        Points nearer to the sensor are left out, such as the robot's own body. A number from 0 to
        1e9 metres; by default 0.
    keep_outliers
        Keeps points that are far from all others. Otherwise those of which a few would make the
        scene many times as large as it is are left out, and counted in the report. True or False;
        by default False.
    color_step
        Rounding of the mean colours of occurrences. An integer from 1 to 255 grey levels; by
        default 8.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Returns
    -------
    AlphabetModel
        The same for any order of the points and any number of threads.

    Raises
    ------
    InvalidInputError
        For an empty cloud, a cloud too large for its radius, or options outside their range.

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
    options = {
        "quality": quality,
        "radius": radius,
        "scales": scales,
        "max_words": max_words,
        "inlier_bits": inlier_bits,
        "outlier_bits": outlier_bits,
        "spacing": spacing,
        "rounds": rounds,
        "sigma_scale": sigma_scale,
        "angular_resolution": angular_resolution,
        "noise": noise,
        "min_range": min_range,
        "keep_outliers": keep_outliers,
        "color_step": color_step,
    }
    with progress_callback(progress) as callback:
        return AlphabetModel(_core.learn_alphabet(cloud, options, progress=callback))


def place_similarity(a: AlphabetModel, b: AlphabetModel) -> float:
    """How alike two places are, 0 to 1, by the words that occur and how they lie to each other.

    1 for a model and itself, the same either way, and whatever the heading and position of the
    scans, as long as both are upright. Alphabets may differ: words are compared by their looks.
    """
    for name, model in (("a", a), ("b", b)):
        if not isinstance(model, AlphabetModel):
            raise wrong_type(name, model, "an AlphabetModel: learn_alphabet makes one of a cloud")
    return _core.place_similarity(a._core, b._core)


def _examples(example: AlphabetModel | Sequence[AlphabetModel]) -> list[AlphabetModel]:
    if isinstance(example, AlphabetModel):
        return [example]
    requirement = "an AlphabetModel: learn_alphabet makes one of a cloud"
    if isinstance(example, PointCloud | Model):
        raise wrong_type("example", example, requirement)
    models = check_items("example", example, requirement)
    for number, model in enumerate(models):
        if not isinstance(model, AlphabetModel):
            raise wrong_type(f"example[{number}]", model, requirement)
    if not models:
        raise wrong_value("example", example, "at least one model", shown="empty")
    return models


def _box(
    model: AlphabetModel,
    ball: tuple[list[float], float] | None,
    corners: tuple[list[float], list[float]] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The box around an example."""
    if corners is not None:
        return np.array(corners[0]), np.array(corners[1])
    if ball is not None:
        return np.array(ball[0]) - ball[1], np.array(ball[0]) + ball[1]
    low, high = model._core.extent()
    return np.array(low), np.array(high)


def _no_region(point: object, radius: object, box: object) -> InvalidInputError:
    """What is missing or too much in a question for what looks like an example."""
    if box is not None:
        requirement = "left out beside point and radius: a region is a ball or a box"
        return wrong_value("box", box, requirement)
    if point is not None:
        requirement = "a positive number of metres beside point: how far the example reaches"
        return wrong_value("radius", radius, requirement)
    if radius is not None:
        requirement = "the middle of the example beside radius: three coordinates x, y, z"
        return wrong_value("point", point, requirement)
    return InvalidInputError(
        "nothing says what to look for: give point= and radius=, or box=, for a part of this "
        "scene, or example=, a model of another"
    )
