"""Alphabets of local scans chosen by the Bayesian information criterion, as published.

M. Ruhnke, B. Steder, G. Grisetti, W. Burgard: Unsupervised Learning of Compact 3D Models Based on
the Detection of Recurrent Structures, ICRA 2010.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._checks import check_integer
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.model import Model

__all__ = ["BicAlphabet", "BicAlphabetModel", "learn_bic_alphabet"]


@final
class BicAlphabet:
    """Words that are points of the scene that they were learned from; immutable."""

    __slots__ = ("_core",)

    def __init__(self, core: _core.BicAlphabet) -> None:
        self._core = core

    @property
    def hash(self) -> str:
        """The first 128 bits of the BLAKE3 hash of its content, as hexadecimal digits."""
        return self._core.hash

    @property
    def radius(self) -> float:
        """Radius of the words, metres (delta of eq. 1)."""
        return self._core.radius

    @property
    def points(self) -> tuple[NDArray[np.float32], ...]:
        """Points of each word in its own frame, (k, 3), metres: right, up, along the normal."""
        return tuple(self._core.points())

    @property
    def descriptors(self) -> NDArray[np.float32]:
        """Local range images of the words, (n, pixels, pixels), metres; NaN where empty."""
        return self._core.descriptors()

    def first(self, n: int) -> BicAlphabet:
        """The alphabet of the `n` words that were accepted first, or of all where there are fewer.

        That is what learning had after some of its iterations; describe a cloud with it to see what
        the other words add.

        Raises
        ------
        InvalidInputError
            `n` is not positive.
        """
        check_integer("n", n, 1)
        return BicAlphabet(self._core.first(n))

    def describe(
        self,
        cloud: PointCloud,
        *,
        sigma_scale: float = 3.0,
        angular_resolution: float | None = None,
        noise: float | None = 0.0,
        min_range: float = 0.0,
        epsilon: float | None = None,
        feature_spacing: float | None = None,
        interest_scales: Sequence[float] = (1.0, 2.0, 4.0),
        interest_threshold: float = 0.05,
        normal_neighbors: int = 12,
        empty_penalty: float = 0.5,
        floor: float = 3.0,
        reduce: bool = True,
        reduce_tolerance: float | None = 3.0,
        keep_outliers: bool = False,
        random_state: int = 0,
        progress: Progress = None,
    ) -> BicAlphabetModel:
        """Another cloud in the words of this alphabet, which stays as it is (IV-B).

        Radius, pixels and the rule for what is up are the alphabet's own. The file names the
        alphabet and does not hold it.

        Parameters
        ----------
        cloud
            The scan.
        sigma_scale
            Factor of the deviation sigma within which a point is explained (lambda, eq. 13). Sigma
            is this times hypot(tan(`angular_resolution` / 2) * range, `noise`). A number above 0
            and at most 1e6; by default 3.
        angular_resolution
            Angle between neighbouring beams (alpha, eq. 13). A number above 0 and below 180
            degrees; by default estimated from the spacing of the points.
        noise
            Standard deviation of a measured point about its surface. The paper has none. A number
            from 0 to 1e9 metres; by default 0. None: estimated as the median deviation of
            neighbouring points from their plane.
        min_range
            Points nearer to the sensor are left out, such as the robot's own body. A number from 0
            to 1e9 metres; by default 0.
        epsilon
            Least distance of decoded points (epsilon, eq. 3). It should be below the sigma of near
            points. A number from 1e-9 to 1e5 metres; by default a fifth of the radius.
        feature_spacing
            Largest distance of a point of the scene to a feature. A number from 1e-9 to 1e9 metres;
            by default the radius.
        interest_scales
            Scales of the Laplacian of Gaussian that finds interest points in the range image.
            Without scales, or where the cloud has no viewpoints, features are spread uniformly
            only. A sequence with each a number from 0.5 to 32 pixels; by default 1, 2, 4.
        interest_threshold
            Least response of an interest point: squared scale times the Laplacian of the logarithm
            of the range. A positive number; by default 0.05.
        normal_neighbors
            Least number of neighbours that a feature's normal is fitted to, where fewer lie within
            the radius. An integer from 3 to 1000; by default 12.
        empty_penalty
            Part of the distance of two descriptors for a pixel that is empty in only one of them,
            as a share of the radius. A number from 0 to 1; by default 0.5.
        floor
            Distance at which a point without a decoded one nearby counts as having one. Its
            likelihood would be zero otherwise; the paper has no floor. A number from 3 to 40 sigma;
            by default 3.
        reduce
            Removes occurrences without which the likelihood does not fall (section III-D). True or
            False; by default True.
        reduce_tolerance
            How far the logarithm of the likelihood may fall with each occurrence that is removed
            (section III-D). The likelihood is then that without the factor 1/M (eq. 9), which
            rewards fewer decoded points. 0 or a positive number of nats; by default 3. None: not at
            all, and the factor 1/M counts.
        keep_outliers
            Keeps points that are far from all others. Otherwise those of which a few would make the
            scene many times as large as it is are left out, and counted in the report. True or
            False; by default False.
        random_state
            Seed of the order in which candidates are tried and features are spread. An integer from
            0 to below 2^64; by default 0.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Raises
        ------
        InvalidInputError
            As `learn_bic_alphabet`, and for an alphabet without words.
        """
        options = {
            "sigma_scale": sigma_scale,
            "angular_resolution": angular_resolution,
            "noise": noise,
            "min_range": min_range,
            "epsilon": epsilon,
            "feature_spacing": feature_spacing,
            "interest_scales": interest_scales,
            "interest_threshold": interest_threshold,
            "normal_neighbors": normal_neighbors,
            "empty_penalty": empty_penalty,
            "floor": floor,
            "reduce": reduce,
            "reduce_tolerance": reduce_tolerance,
            "keep_outliers": keep_outliers,
            "random_state": random_state,
        }
        with progress_callback(progress) as callback:
            return BicAlphabetModel(self._core.describe(cloud, options, progress=callback))

    def __len__(self) -> int:
        return len(self._core)

    def __repr__(self) -> str:
        return f"BicAlphabet({len(self)} words of radius {self.radius:g} m)"


@final
class BicAlphabetModel(Model[_core.BicAlphabetModel]):
    """A cloud as occurrences of words that were chosen by BIC; immutable.

    Made by `learn_bic_alphabet`, `BicAlphabet.describe` and `surfabet.load`. It decodes to the
    points of all occurrences, no two nearer than the spacing, by default epsilon (eq. 2 and 3).
    Words are points and not surfaces, so that a spacing below epsilon adds few.
    """

    __slots__ = ()

    @property
    def alphabet(self) -> BicAlphabet:
        """The words that occur."""
        return BicAlphabet(self._core.alphabet)

    @property
    def words(self) -> NDArray[np.uint32]:
        """Which word occurs, (m,)."""
        return self._core.word_ids

    @property
    def poses(self) -> NDArray[np.float64]:
        """Where, word to world, (m, 4, 4)."""
        return self._core.poses()

    @property
    def counts(self) -> NDArray[np.uint64]:
        """How often each word of the alphabet occurs, (n,)."""
        return self._core.counts

    def __repr__(self) -> str:
        return (
            f"BicAlphabetModel({self.n_points} points as {len(self)} occurrences of "
            f"{len(self.alphabet)} words)"
        )


def learn_bic_alphabet(
    cloud: PointCloud,
    *,
    quality: Literal["small", "balanced", "fine"] = "balanced",
    radius: float | None = None,
    sigma_scale: float = 3.0,
    angular_resolution: float | None = None,
    noise: float | None = 0.0,
    min_range: float = 0.0,
    epsilon: float | None = None,
    feature_spacing: float | None = None,
    interest_scales: Sequence[float] = (1.0, 2.0, 4.0),
    interest_threshold: float = 0.05,
    normal_neighbors: int = 12,
    upright: Literal["x", "z", "view"] = "x",
    descriptor_pixels: int = 8,
    empty_penalty: float = 0.5,
    floor: float = 3.0,
    min_points: int = 8,
    iterations: int = 500,
    max_rejections: int = 100,
    reduce: bool = True,
    reduce_tolerance: float | None = 3.0,
    keep_outliers: bool = False,
    random_state: int = 0,
    progress: Progress = None,
) -> BicAlphabetModel:
    """Learns an alphabet of local scans by the Bayesian information criterion, as published.

    Words are points of the scene, every feature takes the word with the nearest descriptor, and
    candidates are accepted when the criterion falls.

    A point is explained when a decoded point lies within sigma of it (eq. 13). Where the cloud has
    no ranges, half the spacing of its points takes the place of the beams' spacing;
    `surfabet.read(..., viewpoint=)` gives a scan its sensor back.

    Parameters
    ----------
    cloud
        The scan. Duplicates count once. Ranges and viewpoints make sigma, and orient words.
    quality
        Small files or fine detail. Sets `radius`, unless that is given: 'small' doubles it, 'fine'
        halves it. 'small', 'balanced' or 'fine'; by default balanced.
    radius
        Radius of a word (delta, eq. 1). A number from 1e-6 to 1e5 metres; by default from the data:
        four spacings of the points, or a 300th of the scene where that is more.
    sigma_scale
        Factor of the deviation sigma within which a point is explained (lambda, eq. 13). Sigma is
        this times hypot(tan(`angular_resolution` / 2) * range, `noise`). A number above 0 and at
        most 1e6; by default 3.
    angular_resolution
        Angle between neighbouring beams (alpha, eq. 13). A number above 0 and below 180 degrees; by
        default estimated from the spacing of the points.
    noise
        Standard deviation of a measured point about its surface. The paper has none. A number from
        0 to 1e9 metres; by default 0. None: estimated as the median deviation of neighbouring
        points from their plane.
    min_range
        Points nearer to the sensor are left out, such as the robot's own body. A number from 0 to
        1e9 metres; by default 0.
    epsilon
        Least distance of decoded points (epsilon, eq. 3). It should be below the sigma of near
        points. A number from 1e-9 to 1e5 metres; by default a fifth of the radius.
    feature_spacing
        Largest distance of a point of the scene to a feature. A number from 1e-9 to 1e9 metres; by
        default the radius.
    interest_scales
        Scales of the Laplacian of Gaussian that finds interest points in the range image. Without
        scales, or where the cloud has no viewpoints, features are spread uniformly only. A sequence
        with each a number from 0.5 to 32 pixels; by default 1, 2, 4.
    interest_threshold
        Least response of an interest point: squared scale times the Laplacian of the logarithm of
        the range. A positive number; by default 0.05.
    normal_neighbors
        Least number of neighbours that a feature's normal is fitted to, where fewer lie within the
        radius. An integer from 3 to 1000; by default 12.
    upright
        What is up where the normal is vertical. It is an axis of the world, or away from the sensor
        for 'view'. 'x', 'z' or 'view'; by default x.
    descriptor_pixels
        Pixels per side of a descriptor; those within the inscribed circle count. An integer from 2
        to 32; by default 8.
    empty_penalty
        Part of the distance of two descriptors for a pixel that is empty in only one of them, as a
        share of the radius. A number from 0 to 1; by default 0.5.
    floor
        Distance at which a point without a decoded one nearby counts as having one. Its likelihood
        would be zero otherwise; the paper has no floor. A number from 3 to 40 sigma; by default 3.
    min_points
        Least number of points of a word. An integer from 1 to below 2^32; by default 8.
    iterations
        Most candidate words that are tried. An integer from 1 to below 2^32; by default 500.
    max_rejections
        Learning ends after this many candidates in a row that did not lower the BIC. An integer
        from 1 to below 2^32; by default 100.
    reduce
        Removes occurrences without which the likelihood does not fall (section III-D). True or
        False; by default True.
    reduce_tolerance
        How far the logarithm of the likelihood may fall with each occurrence that is removed
        (section III-D). The likelihood is then that without the factor 1/M (eq. 9), which rewards
        fewer decoded points. 0 or a positive number of nats; by default 3. None: not at all, and
        the factor 1/M counts.
    keep_outliers
        Keeps points that are far from all others. Otherwise those of which a few would make the
        scene many times as large as it is are left out, and counted in the report. True or False;
        by default False.
    random_state
        Seed of the order in which candidates are tried and features are spread. An integer from 0
        to below 2^64; by default 0.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Returns
    -------
    BicAlphabetModel
        The same for any order of the points and any number of threads.

    Raises
    ------
    InvalidInputError
        For an empty cloud, a cloud too large for its radius, or options outside their range.
    """
    options = {
        "quality": quality,
        "radius": radius,
        "sigma_scale": sigma_scale,
        "angular_resolution": angular_resolution,
        "noise": noise,
        "min_range": min_range,
        "epsilon": epsilon,
        "feature_spacing": feature_spacing,
        "interest_scales": interest_scales,
        "interest_threshold": interest_threshold,
        "normal_neighbors": normal_neighbors,
        "upright": upright,
        "descriptor_pixels": descriptor_pixels,
        "empty_penalty": empty_penalty,
        "floor": floor,
        "min_points": min_points,
        "iterations": iterations,
        "max_rejections": max_rejections,
        "reduce": reduce,
        "reduce_tolerance": reduce_tolerance,
        "keep_outliers": keep_outliers,
        "random_state": random_state,
    }
    with progress_callback(progress) as callback:
        return BicAlphabetModel(_core.learn_bic_alphabet(cloud, options, progress=callback))
