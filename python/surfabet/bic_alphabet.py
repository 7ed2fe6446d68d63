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

    def describe(
        self,
        cloud: PointCloud,
        *,
        progress: Progress = None,
    ) -> BicAlphabetModel:
        """Another cloud in the words of this alphabet, which stays as it is (IV-B).

        Radius, pixels and the rule for what is up are the alphabet's own. The file names the
        alphabet and does not hold it.

        Parameters
        ----------
        cloud
            The scan.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Raises
        ------
        InvalidInputError
            As `learn_bic_alphabet`, and for an alphabet without words.
        """
        options = {}
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
    points of all occurrences, no two nearer than epsilon (eq. 2 and 3). Words are points and not
    surfaces, so that no other spacing can be decoded.
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
    options = {}
    with progress_callback(progress) as callback:
        return BicAlphabetModel(_core.learn_bic_alphabet(cloud, options, progress=callback))
