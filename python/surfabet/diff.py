"""What appeared and what vanished between two maps of one place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._checks import check_number
from surfabet._core import PointCloud
from surfabet._progress import Progress, ProgressCallback, progress_callback
from surfabet.errors import InvalidInputError, wrong_type, wrong_value
from surfabet.learning import unit_in
from surfabet.model import Model
from surfabet.survey import survey

__all__ = ["Change", "Changes", "diff"]

Kind = Literal["appeared", "vanished"]

_SPACINGS = 4.0
"""Tolerance in spacings of the decoded points: two pixels of patches."""

_LEAST_SPACINGS = 2.0
"""Least tolerance likewise: below a pixel what is rounded otherwise counts as a change."""

_SAME, _APPEARED, _VANISHED, _UNSEEN = range(4)

_COLORS = np.array([[170, 170, 170], [40, 170, 60], [210, 50, 40], [90, 120, 200]], np.uint8)
"""Of what is the same, appeared, vanished, and was not seen before."""


@dataclass(frozen=True, slots=True)
class Change:
    """A thing that one of two maps has and the other has not, though it looked there."""

    kind: Kind
    """`"appeared"`: the second map has it. `"vanished"`: the first has it."""
    box: NDArray[np.float64]
    """Lower and upper corner, world coordinates, (2, 3), metres."""
    area: float
    """Area of its surface, square metres."""
    n_points: int
    """Points of `Changes.cloud` that show it."""


@dataclass(frozen=True, slots=True, repr=False)
class Changes(Sequence[Change]):
    """What appeared and what vanished between two maps, the largest changes first."""

    changes: tuple[Change, ...]
    cloud: PointCloud
    """The surface of the second map, and of the first what vanished. `change` is 0 for what is the
    same, 1 for what appeared, 2 for what vanished, and 3 for surface that the first map neither has
    nor looked at; colours are grey, green, red and blue. `group` is the number of the change, -1
    without one."""
    tolerance: float
    """Surfaces nearer than this are the same, metres."""
    unseen: tuple[float, float]
    """Surface of the first map where the second did not look, and of the second where the first
    did not, square metres: nothing is known of a change there."""
    unit: str = "m"
    """What lengths are in: `m`, or the unit that the notes of the maps name."""

    def __len__(self) -> int:
        return len(self.changes)

    @overload
    def __getitem__(self, index: int) -> Change: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Change]: ...
    def __getitem__(self, index: int | slice) -> Change | Sequence[Change]:
        return self.changes[index]

    def __repr__(self) -> str:
        n = sum(change.kind == "appeared" for change in self.changes)
        return f"Changes({n} appeared, {len(self) - n} vanished)"


def diff(
    a: Model[Any],
    b: Model[Any],
    *,
    tolerance: float | None = None,
    min_area: float = 0.05,
    viewpoints: tuple[ArrayLike | None, ArrayLike | None] = (None, None),
    progress: Progress = None,
) -> Changes:
    """What appeared and what vanished between two maps of one frame, of any methods.

    Surface of one map without surface of the other counts where the other map looked; where it did
    not, nothing is known. With `viewpoints` a map looked at a place when a line from one of its
    sensors passes it and meets a surface behind it, and none before. Without, a map looked at
    places between surfaces that face them. For this the maps need to know from which side their
    surfaces were seen: learn them from scans with viewpoints or normals.

    Parameters
    ----------
    a, b
        The map before and the map after, in the same world frame. Of large maps load a box.
    tolerance
        Surfaces that are nearer to one another are the same, metres; by default four spacings of
        the points that the coarser map decodes to, which are two pixels of patches, and at least
        two. Thickness that the maps keep adds to it.
    min_area
        Least surface of a change, square metres.
    viewpoints
        World positions of the sensors of both maps, (n, 3) each, or None where they are not known.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Returns
    -------
    Changes
        A sequence of `Change`, with a coloured cloud. The same for any number of threads.

    Raises
    ------
    InvalidInputError
        For maps without surface, other things than maps, and options outside of their domain.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> before = sb.datasets.make_room(seed=1)
    >>> (chair, *_) = [thing.id for thing in before.instances if thing.class_name == "chair"]
    >>> after = before.rearranged({chair: None})
    >>> def learned(scene):
    ...     scan = sb.datasets.scan_rgbd(scene, n_frames=8, width=160, height=120)
    ...     return sb.learn_patches(scan.cloud, resolution=0.03)
    >>> [change.kind for change in sb.diff(learned(before), learned(after))]
    ['vanished']
    """
    _check_maps(a, b)
    requirement = "those of both maps, each None or (n, 3)"
    if not isinstance(viewpoints, Sequence) or isinstance(viewpoints, str):
        raise wrong_type("viewpoints", viewpoints, requirement)
    if len(viewpoints) != 2:
        raise wrong_value("viewpoints", viewpoints, requirement)
    if tolerance is not None:
        check_number("tolerance", tolerance, "a positive number of metres", above=0.0)
    check_number("min_area", min_area, "a positive number of square metres", above=0.0)
    unit = next((unit for of in (a, b) if (unit := unit_in(of.note)) != "m"), "m")
    with progress_callback(progress) as callback:
        notify: ProgressCallback = callback or (lambda stage, fraction: None)
        maps = [_decoded(model, name, notify) for model, name in ((a, "a"), (b, "b"))]
        spacing = max(survey(surface).spacing for surface, _ in maps)
        if tolerance is None:
            tolerance = _SPACINGS * spacing
        elif tolerance < _LEAST_SPACINGS * spacing * (1 - 1e-3):
            least = f"{_LEAST_SPACINGS * spacing:.3g}"
            requirement = (
                f"at least {least} {unit}, two spacings of what the coarser map decodes to: below, "
                "rounding counts as change"
            )
            raise wrong_value("tolerance", tolerance, requirement, shown=f"{tolerance:g}")
        options = {"tolerance": float(tolerance), "min_area": float(min_area)}
        (before, before_thick), (after, after_thick) = maps
        gone = _core.changes(
            before, after, after_thick, viewpoints[1], **options, progress=callback
        )
        new = _core.changes(
            after, before, before_thick, viewpoints[0], **options, progress=callback
        )
    return _put_together(before, after, gone, new, float(tolerance), unit)


def _check_maps(a: object, b: object) -> None:
    for name, model in (("a", a), ("b", b)):
        if not isinstance(model, Model):
            raise wrong_type(name, model, "a model")


def _decoded(
    model: Model[Any], name: str, notify: ProgressCallback
) -> tuple[PointCloud, PointCloud]:
    """The surface of a map with its normals, and its points with the thickness of the scan."""
    surface = model.decode(normals=True, progress=notify)
    if len(surface) < 2:
        raise InvalidInputError(
            f"{name} decodes to {len(surface)} points; a map to compare has a surface"
        )
    if not model.keeps_thickness:
        return surface, surface
    return surface, model.decode(as_measured=True, progress=notify)


_Found = tuple[
    NDArray[np.uint8],
    NDArray[np.uint32],
    list[tuple[list[float], list[float], int, float]],
    float,
]


def _put_together(
    before: PointCloud, after: PointCloud, gone: _Found, new: _Found, tolerance: float, unit: str
) -> Changes:
    """Both directions as one sequence, the largest first, with the cloud that shows them."""
    directions: list[tuple[Kind, _Found]] = [("vanished", gone), ("appeared", new)]
    named: list[tuple[Kind, int, Any]] = [
        (kind, number, row) for kind, found in directions for number, row in enumerate(found[2])
    ]
    named.sort(key=lambda of: -of[2][3])
    changes = tuple(
        Change(kind, np.array([low, high]), area, n) for kind, _, (low, high, n, area) in named
    )
    numbers = {
        kind: np.array([i for i, of in enumerate(named) if of[0] == kind], np.int32)
        for kind in ("vanished", "appeared")
    }
    # Within a direction the order is the same, so that the numbers follow by place.
    fate, of_points = new[0], new[1]
    state = np.array([_SAME, _APPEARED, _UNSEEN], np.uint8)[fate]
    group = np.full(len(after), -1, np.int32)
    group[state == _APPEARED] = numbers["appeared"][of_points[state == _APPEARED]]
    vanished = gone[0] == 1
    origin = after.origin
    shift = np.array(before.origin) - np.array(origin)
    lost = before.local_points[vanished].astype(np.float64) + shift
    state = np.concatenate([state, np.full(len(lost), _VANISHED, np.uint8)])
    group = np.concatenate([group, numbers["vanished"][gone[1][vanished]]])
    cloud = PointCloud(
        np.concatenate([after.local_points, lost.astype(np.float32)]),
        colors=_COLORS[state],
        extra={"change": state, "group": group},
        origin=origin,
        crs=after.crs,
    )
    return Changes(changes, cloud, tolerance, (gone[3], new[3]), unit)
