"""Alphabets of local scans chosen by the Bayesian information criterion, as published.

M. Ruhnke, B. Steder, G. Grisetti, W. Burgard: Unsupervised Learning of Compact 3D Models Based on
the Detection of Recurrent Structures, ICRA 2010. `surfabet.learn_alphabet(..., method="bic")` makes
these models.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.errors import InvalidInputError
from surfabet.model import MAX_POINTS, Model

__all__ = ["BicAlphabet", "BicAlphabetModel"]


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
        self, cloud: PointCloud, *, progress: Progress = None, **options: Any
    ) -> BicAlphabetModel:
        """Another cloud in the words of this alphabet, which stays as it is (IV-B).

        Options are those of `learn_alphabet` with method "bic"; radius, pixels and rule for what is
        up are the alphabet's own. The file names the alphabet and does not hold it.
        """
        core = learn(cloud, alphabet=self._core, progress=progress, **options)
        return BicAlphabetModel(core.sharing_alphabet(True))

    def __len__(self) -> int:
        return len(self._core)

    def __repr__(self) -> str:
        return f"BicAlphabet({len(self)} words of radius {self.radius:g} m)"


@final
class BicAlphabetModel(Model[_core.BicAlphabetModel]):
    """A cloud as occurrences of words that were chosen by BIC; immutable.

    Made by `learn_alphabet` with method "bic", `BicAlphabet.describe` and `surfabet.load`.
    """

    __slots__ = ()

    @property
    def alphabet(self) -> BicAlphabet:
        """The words that occur."""
        return BicAlphabet(self._core.alphabet)

    @property
    def shares_alphabet(self) -> bool:
        """Whether the file names its alphabet instead of holding it."""
        return self._core.shares_alphabet

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

    def decode(
        self,
        resolution: float | None = None,
        *,
        max_points: int = MAX_POINTS,
        progress: Progress = None,
    ) -> PointCloud:
        """The points of all occurrences, no two nearer than epsilon (eq. 2, 3).

        Raises
        ------
        InvalidInputError
            When a resolution is asked for, since words are points and not surfaces, or when there
            would be more than `max_points` points.
        """
        if resolution is not None:
            raise InvalidInputError(
                f"resolution is {resolution}, but words of method bic are points: "
                "only the spacing of learning can be decoded"
            )
        with progress_callback(progress) as callback:
            return self._core.decode(max_points=max_points, progress=callback)

    def __repr__(self) -> str:
        return (
            f"BicAlphabetModel({self.n_points} points as {len(self)} occurrences of "
            f"{len(self.alphabet)} words)"
        )


def learn(
    cloud: PointCloud,
    *,
    alphabet: _core.BicAlphabet | None = None,
    progress: Progress = None,
    **options: Any,
) -> _core.BicAlphabetModel:
    """The model by BIC; what is not given is as `bic_defaults` says, or as the alphabet is."""
    names = {"sigma_scale": "scale"}
    given = {names.get(name, name): value for name, value in options.items()}
    defaults = _core.bic_defaults()
    if alphabet is not None:
        defaults |= {
            "radius": alphabet.radius,
            "descriptor_pixels": alphabet.descriptor_pixels,
            "upright": alphabet.upright,
        }
    if unknown := given.keys() - defaults.keys():
        raise InvalidInputError(f"{', '.join(sorted(unknown))}: no option of method bic")
    with progress_callback(progress) as callback:
        return _core.learn_bic(cloud, **{**defaults, **given}, alphabet=alphabet, progress=callback)
