"""Where in a saved model a scan was taken: without an initial pose, from the model alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._checks import (
    check_cloud,
    check_flag,
    check_integer,
    check_number,
    real_array,
)
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.errors import wrong_type, wrong_value

__all__ = ["Localizer", "Location", "Locations"]


@dataclass(frozen=True, slots=True, eq=False)
class Location:
    """A place where a scan may have been taken."""

    pose: NDArray[np.float64]
    """Scan to world, (4, 4)."""
    score: float
    """How well the scan's surfaces lie on those of the map, 0 to 1."""
    probability: float
    """How likely this is the place, of all that were found, 0 to 1; 0 where it is rejected, unless
    the scan is ambiguous."""
    covariance: NDArray[np.float64]
    """Covariance of the pose, (6, 6): x, y, z of the sensor in the world in metres, then turns
    about the world's x, y, z in radians."""
    explained: float
    """Share of the scan that lies on mapped surfaces."""
    contradicted: float
    """Share of the scan that was seen through mapped surfaces."""
    in_front: float
    """Share of the scan that lies on nothing mapped and hides a mapped surface: furniture that was
    moved, people."""


class Locations(Sequence[Location]):
    """The accepted places of a scan, the likeliest first: none where `reason` says why, several
    where places look alike."""

    __slots__ = (
        "_accepted",
        "free_about",
        "free_along",
        "is_ambiguous",
        "n_places",
        "reason",
        "refusal",
        "rejected",
    )

    def __init__(
        self,
        accepted: Sequence[Location],
        rejected: Sequence[Location],
        n_places: int,
        is_ambiguous: bool,
        refusal: str | None,
        reason: str | None,
        free: Sequence[Sequence[Sequence[float]]],
    ) -> None:
        self._accepted = tuple(accepted)
        self.rejected: tuple[Location, ...] = tuple(rejected)
        """The best places that are not accepted: where none is since the scan is ambiguous, those
        that it fits, with their probabilities."""
        self.n_places: int = n_places
        """How many places the scan fits, also where `top` gives fewer: those that are accepted, or
        none of which is since the scan is ambiguous; 0 where it is refused for another reason."""
        self.is_ambiguous: bool = is_ambiguous
        """Whether the scan fits in several places, all of which are accepted or none, or anywhere
        along a line, also where `top` gives one, or its mirror image fits as well."""
        self.refusal: str | None = refusal
        """Why no place is accepted, for programs: `too few surfaces`, `no place`, `unexplained`,
        `contradicted`, `alike` (several places, none of them sure), `loose` (anywhere along a
        line) or `mirrored` (its mirror image fits as well); None when one is."""
        self.reason: str | None = reason
        """The same as a sentence."""
        self.free_along: NDArray[np.float64] = _rows(free[0])
        """Directions in the world, (k, 3), along which nothing in the scan fixes the position: one
        in a corridor, two over a floor. Where the refusal is `loose`, and of the likeliest place
        where a prior holds it there; else none, (0, 3)."""
        self.free_about: NDArray[np.float64] = _rows(free[1])
        """Axes in the world, (k, 3), about which nothing fixes how the scan is turned, such as the
        normal of a floor; given where `free_along` is, and where a prior alone holds the turn."""

    @overload
    def __getitem__(self, index: int) -> Location: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Location]: ...
    def __getitem__(self, index: int | slice) -> Location | Sequence[Location]:
        return self._accepted[index]

    def __len__(self) -> int:
        return len(self._accepted)

    def __iter__(self) -> Iterator[Location]:
        return iter(self._accepted)

    def __repr__(self) -> str:
        if not self._accepted:
            return f"Locations(none: {self.reason})"
        places = ", ".join(
            "({:.2f}, {:.2f}, {:.2f}) with probability {:.2f}".format(
                *place.pose[:3, 3], place.probability
            )
            for place in self._accepted
        )
        return f"Locations({places})"


class Localizer:
    """A model made ready to be asked where scans were taken; built once, asked often.

    Made by `model.localizer()`.
    """

    __slots__ = ("_core",)

    def __init__(self, core: _core.Localizer) -> None:
        self._core = core

    def locate(
        self,
        scan: PointCloud,
        *,
        prior: ArrayLike | None = None,
        radius: float | None = None,
        angle: float | None = None,
        upright: bool | None = None,
        top: int = 5,
        progress: Progress = None,
    ) -> Locations:
        """Where a scan was taken, as `surfabet.model.Model.locate`."""
        options = locate_options(scan, prior, radius, angle, upright, top)
        return self._located(scan, options, progress)

    def _located(self, scan: PointCloud, options: dict[str, Any], progress: Progress) -> Locations:
        with progress_callback(progress) as callback:
            located = self._core.locate(scan, **options, progress=callback)
        found = locations_of(*located)
        if found.reason is not None and options["prior"] is not None:
            radius, angle = options["radius"], options["angle"]
            found.reason += f" (within {radius:g} m and {angle:g} degrees of the prior)"
        return found

    def __len__(self) -> int:
        """Number of samples of the model's surface."""
        return len(self._core)


def locate_options(
    scan: object,
    prior: ArrayLike | None,
    radius: float | None,
    angle: float | None,
    upright: bool | None,
    top: int,
) -> dict[str, Any]:
    """The options of `locate` as the core takes them.

    Raises
    ------
    InvalidInputError
        One of them is none, or `radius` or `angle` is given without a prior.
    """
    check_cloud("scan", scan)
    limits = (("radius", radius, 1.0, "metres"), ("angle", angle, 20.0, "degrees"))
    options: dict[str, Any] = {}
    for name, value, default, unit in limits:
        requirement = f"a positive number of {unit}"
        if value is not None:
            check_number(name, value, requirement, above=0.0)
            if prior is None:
                raise wrong_value(name, value, "left out without a prior, which it goes with")
        options[name] = default if value is None else float(value)
    return options | {
        "prior": None if prior is None else _pose(prior),
        "upright": None if upright is None else check_flag("upright", upright),
        "top": check_integer("top", top, 1),
    }


def _pose(prior: ArrayLike) -> list[list[float]]:
    """A 4 x 4 matrix, also from x, y, z and yaw in degrees."""
    array = real_array(prior)
    if array is None:
        raise wrong_type("prior", prior, "a (4, 4) pose or x, y, z and yaw")
    if array.shape not in ((4,), (4, 4)):
        shown = f"of the shape {array.shape}"
        raise wrong_value("prior", prior, "a (4, 4) pose or x, y, z and yaw", shown=shown)
    if not np.isfinite(array).all():
        raise wrong_value("prior", array.tolist(), "finite numbers")
    if array.shape == (4,):
        x, y, z, yaw = array
        cosine, sine = np.cos(np.deg2rad(yaw)), np.sin(np.deg2rad(yaw))
        array = np.array([[cosine, -sine, 0, x], [sine, cosine, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])
    return [[float(value) for value in row] for row in array]


Columns = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def locations_of(
    accepted: Columns,
    rejected: Columns,
    n_places: int,
    is_ambiguous: bool,
    refused: tuple[str, str] | None,
    free: Sequence[Sequence[Sequence[float]]],
) -> Locations:
    """What the core gives as arrays, as locations."""
    refusal, reason = refused or (None, None)
    return Locations(
        _locations(accepted),
        _locations(rejected),
        n_places,
        is_ambiguous,
        refusal,
        reason,
        free,
    )


def _rows(directions: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    return np.array(directions, dtype=np.float64).reshape(-1, 3)


def _locations(columns: Columns) -> list[Location]:
    return [
        Location(
            pose=pose,
            score=score,
            probability=probability,
            covariance=covariance,
            explained=explained,
            contradicted=contradicted,
            in_front=in_front,
        )
        for pose, covariance, (score, probability, explained, contradicted, in_front) in zip(
            columns[0], columns[1], columns[2].tolist(), strict=True
        )
    ]
