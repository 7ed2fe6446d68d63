"""What occurs in a scene again and again: classes of things, unsupervised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._checks import check_integer
from surfabet._progress import Progress, progress_callback
from surfabet.alphabet import AlphabetModel, FoundOccurrence
from surfabet.errors import wrong_type
from surfabet.io._files import path_of

__all__ = ["RecurringClass", "RecurringClasses", "recurring"]


@dataclass(frozen=True, slots=True, eq=False)
class RecurringClass:
    """Things of one kind."""

    box: tuple[NDArray[np.float64], NDArray[np.float64]]
    """Lowest and highest corner of a box around the thing that stands for the class."""
    places: list[FoundOccurrence]
    """Where it occurs, itself first, then the best first."""
    occurrences: list[NDArray[np.int64]]
    """Of each place the rows of `model.occurrences` that it consists of: a group of words."""

    def __len__(self) -> int:
        """How often it occurs."""
        return len(self.places)


class RecurringClasses(Sequence[RecurringClass]):
    """The classes of a scene, the largest things first."""

    __slots__ = ("_classes", "_scene")

    def __init__(self, scene: AlphabetModel, classes: Sequence[RecurringClass]) -> None:
        self._scene, self._classes = scene, tuple(classes)

    @property
    def labels(self) -> NDArray[np.int64]:
        """Class of every occurrence of a word, (m,); -1 where it belongs to none."""
        return self._numbers(0)

    @property
    def things(self) -> NDArray[np.int64]:
        """Which place of its class every occurrence of a word belongs to, (m,); -1 for none."""
        return self._numbers(1)

    def _numbers(self, which: int) -> NDArray[np.int64]:
        numbers = np.full(len(self._scene), -1, np.int64)
        for k, of_class in enumerate(self._classes):
            for i, rows in enumerate(of_class.occurrences):
                numbers[rows] = (k, i)[which]
        return numbers

    def draw(self, path: str | Path, *, most: int = 6) -> None:
        """A picture with a row per class: the thing that stands for it, and up to `most` places.

        Raises
        ------
        MissingDependencyError
            Without matplotlib.
        """
        from surfabet.report import draw_recurring

        path = path_of("path", path)
        check_integer("most", most, 1)
        draw_recurring(path, self._scene, self, most=most)

    @overload
    def __getitem__(self, index: int) -> RecurringClass: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[RecurringClass]: ...
    def __getitem__(self, index: int | slice) -> RecurringClass | Sequence[RecurringClass]:
        return self._classes[index]

    def __len__(self) -> int:
        return len(self._classes)

    def __repr__(self) -> str:
        counts = ", ".join(str(len(of_class)) for of_class in self._classes)
        return f"RecurringClasses({len(self)} classes that occur {counts or 'never'} times)"


def recurring(
    scene: AlphabetModel,
    *,
    min_count: int = 3,
    min_size: float = 0.2,
    max_size: float = 2.2,
    min_score: float = 0.5,
    resolution: float | None = None,
    tolerance: float | None = None,
    color_tolerance: float | None = None,
    size_tolerance: float = 0.0,
    progress: Progress = None,
) -> RecurringClasses:
    """Classes of things that occur in a scene again and again, without examples or training.

    Candidates are what hangs together beside large smooth surfaces, and smooth pieces of it. The
    largest is searched for in the scene as by `AlphabetModel.find`, and grown by what stands beside
    it in the same way at most of its places; when it is found often enough, it and what was found
    belong to no other; then the next. The largest thing is the first class. As for `find`, things
    must stand out of the deviation that the model was learned with: learn with a `sigma_scale` of 1
    to 1.5.

    Parameters
    ----------
    scene
        The scene, upright.
    min_count
        How often a thing must occur. An integer from 2 to 1e6; by default 3.
    min_size
        Smallest diagonal of a thing. A positive number of metres; by default 0.2.
    max_size
        Largest diagonal of a thing; smooth surfaces that are larger, such as walls and floors, are
        no part of any. A positive number of metres; by default 2.2.
    min_score
        Least score of an occurrence against the thing that stands for its class, as of `find`; 0.85
        of it where the thing grew from a piece. A number from 0 to 1; by default 0.5.
    resolution
        Spacing of the samples that are compared. A positive number of metres; by default the median
        sigma of all occurrences, at least 0.015 m, and no closer than 4 million samples allow.
    tolerance
        Standard deviation of equal surfaces. A positive number of metres; by default the median
        sigma of all occurrences.
    color_tolerance
        Standard deviation of equal chromas. A positive number of grey levels; by default shape
        alone counts.
    size_tolerance
        Largest change of a size, what is level and what is upright each by its own factor. A number
        from 0 to 0.3 as a share; by default 0.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Returns
    -------
    RecurringClasses
        A sequence of `RecurringClass`. The same for any number of threads.

    Raises
    ------
    InvalidInputError
        For an option outside of its domain.
    """
    options = {
        "min_count": min_count,
        "min_size": min_size,
        "max_size": max_size,
        "min_score": min_score,
        "resolution": resolution,
        "tolerance": tolerance,
        "color_tolerance": color_tolerance,
        "size_tolerance": size_tolerance,
    }
    if not isinstance(scene, AlphabetModel):
        raise wrong_type("scene", scene, "an AlphabetModel: learn_alphabet makes one of a cloud")
    with progress_callback(progress) as callback:
        found = _core.recurring(scene._core, options, progress=callback)
    return RecurringClasses(scene, [_class(*parts) for parts in found])


def _class(
    corners: tuple[Sequence[float], Sequence[float]],
    found: tuple[NDArray[Any], ...],
    occurrences: list[NDArray[np.int64]],
) -> RecurringClass:
    box = (np.array(corners[0]), np.array(corners[1]))
    places = [
        FoundOccurrence(pose, float(score), center, (float(sizes[0]), float(sizes[1])), int(k), box)
        for pose, score, center, sizes, k in zip(*found, strict=True)
    ]
    return RecurringClass(box, places, occurrences)
