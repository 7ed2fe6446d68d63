"""Many places: which of them is this, where in it, and which are of one kind."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._checks import check_cloud, check_flag, check_integer, check_items, check_number
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.alphabet import AlphabetModel, learn_alphabet
from surfabet.errors import InvalidInputError, wrong_type
from surfabet.locate import Locations, locations_of
from surfabet.model import Model

__all__ = ["PlaceIndex", "PlaceKinds", "PlaceMatch", "label_places", "place_index"]

RADIUS = 0.1
"""Smallest radius of the words that clouds, and models of other methods, are described by, metres,
where no place of the index tells another."""
MIN_RANGE = 0.5
"""What is nearer to the sensor of a cloud is the carrier's own body, metres."""

AnyPlace = PointCloud | Model[Any]

_PLACES = "models or clouds, one after the other"


@dataclass(frozen=True, slots=True, eq=False)
class PlaceMatch:
    """A place of an index beside what was asked."""

    name: str
    """Name of the place."""
    place: int
    """Its number in the index, from 0."""
    similarity: float
    """How alike, 0 to 1, as `surfabet.place_similarity`."""
    locations: Locations | None
    """Where in this place the scan was taken, as `model.locate` says it: empty with a reason where
    that was refused; None where it was not asked."""

    @property
    def pose(self) -> NDArray[np.float64] | None:
        """From what was asked to the place, (4, 4), the likeliest; None where none is accepted."""
        return self.locations[0].pose if self.locations else None


class PlaceIndex:
    """Many places, to ask which of them a scan or a model shows; immutable.

    Made by `place_index`. What a place is compared by takes 24 kB of memory; it is made ready to
    locate scans in when it is first among the most similar ones.
    """

    __slots__ = ("_core", "_models", "_names")

    def __init__(
        self, core: _core.PlaceIndex, models: Sequence[AlphabetModel], names: Sequence[str]
    ) -> None:
        self._core, self._models, self._names = core, tuple(models), tuple(names)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the places, in the order of the index."""
        return self._names

    @property
    def models(self) -> tuple[AlphabetModel, ...]:
        """The places in words, in the order of the index."""
        return self._models

    @property
    def similarities(self) -> NDArray[np.float64]:
        """Similarity of every two places, (n, n)."""
        return self._core.similarities()

    def query(
        self,
        place: AnyPlace,
        *,
        scan: PointCloud | None = None,
        top: int = 5,
        verify: int = 3,
        upright: bool | None = None,
        progress: Progress = None,
    ) -> list[PlaceMatch]:
        """The places most like a scan or a model, the most similar first.

        Similarity says how alike two places are; only a pose says that they are the same. In a
        building of equal rooms every equal room is similar, and each of them has a pose.

        Parameters
        ----------
        place
            A cloud, or a model of any method, upright, whatever its heading. Clouds, and models of
            other methods than alphabets, are described with words first.
        scan
            What to locate: one scan in the frame of its sensor, as for `model.locate`. By default
            `place` itself where it is a cloud, and else the decoded model.
        top
            Most places that are given.
        verify
            In how many of them, from the most similar on, the scan is located; 0 for none.
        upright
            As for `model.locate`.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Returns
        -------
        list of PlaceMatch
            The same for any number of threads.

        Raises
        ------
        InvalidInputError
            For an index without places, an empty cloud, or an option outside of its domain.
        """
        if not self._names:
            raise InvalidInputError("the index has no places; give place_index at least one")
        check_integer("top", top, 1)
        check_integer("verify", verify, 0)
        if upright is not None:
            check_flag("upright", upright)
        if scan is not None:
            check_cloud("scan", scan)
        model = _described("place", place, self._models[0])
        if scan is None:
            scan = place if isinstance(place, PointCloud) else place.decode()
        with progress_callback(progress) as callback:
            found = self._core.query(
                model._core,
                scan if verify > 0 else None,
                top=top,
                verify=verify,
                upright=upright,
                progress=callback,
            )
        return [
            PlaceMatch(
                self._names[number],
                number,
                similarity,
                None if located is None else locations_of(*located),
            )
            for number, similarity, located in found
        ]

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"PlaceIndex({len(self)} places)"


@dataclass(frozen=True, slots=True, eq=False)
class PlaceKinds:
    """Which places are of one kind."""

    labels: NDArray[np.int64]
    """Kind of every place, (n,), numbered from 0 in the order of their first places."""
    similarities: NDArray[np.float64]
    """Similarity of every two places among those given, (n, n), 0 to 1."""

    def __len__(self) -> int:
        """Number of kinds."""
        return int(self.labels.max(initial=-1)) + 1


def place_index(
    places: Mapping[str, AnyPlace] | Iterable[AnyPlace], *, progress: Progress = None
) -> PlaceIndex:
    """Many places in one index, to ask which of them a scan shows and where in it it was taken.

    Parameters
    ----------
    places
        Models or clouds by name, or one after the other; unnamed ones are called by their number.
        Models of other methods than alphabets, and clouds, are described with words first.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> def room(x, y):
    ...     u, v = (a.ravel() for a in np.meshgrid(*[np.arange(60) / 60] * 2))
    ...     floor, wall = np.stack([x * u, y * v, 0 * u], 1), np.stack([x * u, 0 * u, 2.5 * v], 1)
    ...     return sb.PointCloud(np.concatenate([floor, wall, wall[:, [1, 0, 2]] * [1, y / x, 1]]))
    >>> index = sb.place_index({"small": room(4, 3), "long": room(9, 2)})
    >>> index.query(room(4, 3), verify=0)[0].name
    'small'
    """
    if isinstance(places, Mapping):
        named = {str(name): place for name, place in places.items()}
        models = _all_described([f"places[{name!r}]" for name in places], list(named.values()))
    else:
        items = check_items("places", places, _PLACES)
        named = {str(number): place for number, place in enumerate(items)}
        models = _all_described(_numbered(items), items)
    with progress_callback(progress) as callback:
        core = _core.PlaceIndex([model._core for model in models], callback)
    return PlaceIndex(core, models, list(named))


def label_places(
    places: Iterable[AnyPlace],
    *,
    n_kinds: int | None = None,
    min_similarity: float = _core.KIND_SIMILARITY,
    progress: Progress = None,
) -> PlaceKinds:
    """Which places are of one kind, by what stands in them at which height: offices, corridors.

    Compared is the share of area of level, sloped and steep words in layers above the floor. What
    all the places have counts little, what tells some of them from others counts most; so kinds are
    those of the places given, and two or three places say little. Kinds are joined by average
    linkage: the two with the largest mean similarity become one, until `n_kinds` are left or,
    without that, the mean falls below `min_similarity`.

    Parameters
    ----------
    places
        Models or clouds. Models of other methods than alphabets, and clouds, are described with
        words first.
    n_kinds
        How many kinds; by default as many as `min_similarity` leaves.
    min_similarity
        Least mean similarity within a kind, 0 to 1, where `n_kinds` is not given.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For an option outside of its domain.
    """
    if n_kinds is not None:
        check_integer("n_kinds", n_kinds, 1)
    check_number("min_similarity", min_similarity, "a number from 0 to 1", least=0.0, most=1.0)
    items = check_items("places", places, _PLACES)
    models = _all_described(_numbered(items), items)
    with progress_callback(progress) as callback:
        labels, similarities = _core.label_places(
            [model._core for model in models],
            n_kinds=n_kinds,
            min_similarity=min_similarity,
            progress=callback,
        )
    return PlaceKinds(labels, similarities)


def _numbered(places: Sequence[object]) -> list[str]:
    """What messages call the places of a sequence."""
    return [f"places[{number}]" for number in range(len(places))]


def _all_described(names: Sequence[str], places: Sequence[AnyPlace]) -> list[AlphabetModel]:
    for name, place in zip(names, places, strict=True):
        _check_place(name, place)
    first = next((place for place in places if isinstance(place, AlphabetModel)), None)
    return [_described(name, place, first) for name, place in zip(names, places, strict=True)]


def _check_place(name: str, place: object) -> None:
    if not isinstance(place, PointCloud | Model):
        raise wrong_type(name, place, "a PointCloud or a model")


def _described(name: str, place: AnyPlace, like: AlphabetModel | None) -> AlphabetModel:
    """A place in words, of the radii of another model, so that sizes of words do not differ."""
    if isinstance(place, AlphabetModel):
        return place
    _check_place(name, place)
    cloud = place if isinstance(place, PointCloud) else place.decode()
    radii = np.array([RADIUS]) if like is None else like.alphabet.radii
    min_range = MIN_RANGE if isinstance(place, PointCloud) and place.viewpoints is not None else 0.0
    learn = partial(learn_alphabet, cloud, radius=float(radii[0]), min_range=min_range)
    return learn() if like is None else learn(scales=len(radii))
