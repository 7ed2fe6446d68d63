"""What models of all methods have in common."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._checks import check_flag, check_integer, check_number, real_array
from surfabet._core import PointCloud
from surfabet._note import checked_note, visible
from surfabet._progress import Progress, progress_callback
from surfabet.errors import wrong_type, wrong_value
from surfabet.io._files import path_of
from surfabet.learning import AttributeFigures, LearningReport
from surfabet.locate import Localizer, Locations, locate_options

__all__ = ["MAX_POINTS", "Box", "Model", "corners"]

_MAGIC = b"\x89SFB"
"""What files of models begin with."""

MAX_POINTS = 500_000_000
"""Most points that `decode` makes unless told otherwise."""

Box = tuple[ArrayLike, ArrayLike]
"""Lower and upper corner of a box along the axes of the world, (3,) each, metres. Its faces belong
to it; coordinates may be infinite."""

C = TypeVar("C", bound=_core.Model)


def corners(box: Box | None) -> tuple[list[float], list[float]] | None:
    """The two corners of `box` as plain numbers.

    Raises
    ------
    InvalidInputError
        It is not two corners of three numbers each, or the second is below the first.
    """
    if box is None:
        return None
    requirement = "two corners of three numbers each, (lo, hi)"
    array = real_array(box)
    if array is None:
        raise wrong_type("box", box, requirement)
    if array.shape != (2, 3):
        raise wrong_value("box", box, requirement)
    if not (array[0] <= array[1]).all():
        raise wrong_value("box", box, f"{requirement}, lo nowhere above hi")
    return array[0].tolist(), array[1].tolist()


def decode_options(
    resolution: object, as_measured: object, normals: object, box: Box | None, max_points: object
) -> dict[str, Any]:
    """The options of `decode` as the core takes them.

    Raises
    ------
    InvalidInputError
        One of them is none.
    """
    requirement = "a positive number of metres"
    return {
        "resolution": None
        if resolution is None
        else check_number("resolution", resolution, requirement, above=0.0),
        "as_measured": check_flag("as_measured", as_measured),
        "normals": check_flag("normals", normals),
        "region": corners(box),
        "max_points": check_integer("max_points", max_points, 0),
    }


def is_model(path: Path) -> bool:
    """Whether a path is a file that begins as models do."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(_MAGIC)) == _MAGIC


def path_of_model(path: str | os.PathLike[str]) -> Path:
    """Where a model is to be written: a new file, or that of another model.

    Raises
    ------
    InvalidInputError
        The file holds something else.
    """
    target = path_of("path", path)
    if target.is_file() and target.stat().st_size and not is_model(target):
        requirement = "a new file or that of a model: this one holds something else"
        raise wrong_value("path", str(target), requirement)
    return target


def _from_bytes(data: bytes) -> Any:
    """The model in a pickle."""
    # The module of files knows all models, and so needs this one.
    from surfabet.files import from_bytes

    return from_bytes(data)


class Model(Generic[C]):
    """A cloud as a compact model; immutable.

    Everything in it is quantised already, so it decodes to the same cloud before it is saved and
    after it is loaded. Models are equal when their files are, but for the note: how they were
    learned does not count.
    """

    __slots__ = ("_core", "_localizer", "_note")

    def __init__(self, core: C, note: str = "") -> None:
        self._core = core
        self._note = note
        self._localizer: Localizer | None = None

    def decode(
        self,
        resolution: float | None = None,
        *,
        as_measured: bool = False,
        normals: bool = False,
        box: Box | None = None,
        max_points: int = MAX_POINTS,
        progress: Progress = None,
    ) -> PointCloud:
        """The model as a cloud, at any spacing.

        Parameters
        ----------
        resolution
            Spacing of the points, metres; by default the spacing that the model was made for, see
            the class.
        as_measured
            Fill the thickness that the scan had about its surface instead of giving the thin
            surface in its middle. The thin surface is nearer to the true one, the filled one to
            the scan. Only for models with `keeps_thickness`.
        normals
            Give every point the unit normal of its surface, towards where it was seen from where
            that is known; of a gas zero at a neuron without a plane. Normals that the cloud itself
            had are not kept: planes and gas take the side from them where there are no viewpoints,
            the other methods nothing.
        box
            Lower and upper corner of a box in world coordinates, metres: gives the points of the
            whole cloud that lie in it, in the same order.
        max_points
            Refuse to make more points than this.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Returns
        -------
        PointCloud
            Number and order of its points are not those of the input. The same on any number of
            threads.

        Raises
        ------
        InvalidInputError
            For a box that is none, a spacing that is not positive, one that makes more than
            `max_points` points, or `as_measured` for a model that keeps no thickness.
        """
        options = decode_options(resolution, as_measured, normals, box, max_points)
        with progress_callback(progress) as callback:
            return self._core.decode(**options, progress=callback)

    def localizer(self, *, progress: Progress = None) -> Localizer:
        """The model made ready to be asked where scans were taken: its surfaces as samples, with
        what speeds up the search. Built by the first call and kept.

        Raises
        ------
        InvalidInputError
            For a model without surface.
        """
        if self._localizer is None:
            with progress_callback(progress) as callback:
                self._localizer = Localizer(self._core.localizer(callback))
        return self._localizer

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
        """Where in the model a scan was taken: no initial pose and no original points are needed.

        Only what can be defended is accepted: enough of the scan lies on mapped surfaces, rays of
        the scan do not pass through them, and places that look alike are all named.

        Parameters
        ----------
        scan
            One scan in the frame of its sensor, which stands at zero unless the cloud has
            viewpoints.
        prior
            What is known of the pose: scan to world (4, 4), or x, y, z in metres and yaw in
            degrees.
        radius
            How far the sensor may be from the prior, metres; by default 1. At least a quarter of a
            cell of the map: 0.05, more for very large maps. Only with `prior`.
        angle
            How far the scan may be turned from the prior, degrees; by default 20, at least 1. Only
            with `prior`.
        upright
            True: the vertical of the scan is that of the map within 45 degrees. False: it may be
            any. None: upright poses first, then all others when none of them is accepted.
        top
            Most places that are given.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Returns
        -------
        Locations
            A sequence of `Location`, the likeliest first; empty with a `reason` where no place is
            accepted. The same for any number of threads.

        Raises
        ------
        InvalidInputError
            For a prior that is no pose, or an option outside of its domain.
        """
        # First, since making the model ready takes long.
        options = locate_options(scan, prior, radius, angle, upright, top)
        return self.localizer(progress=progress)._located(scan, options, progress)

    def to_bytes(self, *, note: str | None = None) -> bytes:
        """The bytes of the model's file. The same model and note always give the same bytes.

        `note` is that of `save`, so that a model that was just read gives the bytes of its file.
        """
        return self._core.to_bytes(self._note_or(note))

    def save(self, path: str | os.PathLike[str], *, note: str | None = None) -> int:
        """Writes the model to a file, usually `.sfb`, and returns its size in bytes.

        An existing model is replaced only when the new one is complete, and a file that is none is
        not replaced. `note` is a line for people, at most 1024 bytes of UTF-8, which
        `surfabet info` and `surfabet.inspect` show; it is not part of the model. By default it is
        the one that the model was read with, and `note=""` writes none. A note that ends in
        `lengths in ft` says that lengths are feet, not metres.

        Raises
        ------
        InvalidInputError
            For the file of something else, such as the scan, and a note that is too long.
        OSError
            The file cannot be written.
        """
        return self._core.save(str(path_of_model(path)), self._note_or(note))

    def _note_or(self, note: str | None) -> str:
        """The note to write: one that is given, or else that of the model."""
        return self._note if note is None else checked_note(note)

    @property
    def note(self) -> str:
        """The note that the model was read with; empty for one that was learned."""
        return visible(self._note)

    @property
    def method(self) -> str:
        """Name of the method, as in `surfabet compress --model NAME`."""
        return self._core.method

    @property
    def report(self) -> LearningReport:
        """How the model was learned; empty for a model read from a file."""
        found = self._core.report_dict
        attributes = tuple(AttributeFigures(*of) for of in found["attributes"])
        return LearningReport(
            **{**found, "attributes": attributes, "not_kept": tuple(found["not_kept"])}
        )

    @property
    def info(self) -> dict[str, Any]:
        """What the model holds: sizes, counts and options by name, with the unit in brackets."""
        return self._core.summary_dict

    @property
    def n_points(self) -> int:
        """Points of the cloud that the model was learned from."""
        return self._core.n_points

    @property
    def origin(self) -> NDArray[np.float64]:
        """World position that the model computes about, (3,), metres."""
        return np.array(self._core.origin)

    @property
    def has_color(self) -> bool:
        """Whether the model carries colour."""
        return self._core.has_color

    @property
    def keeps_thickness(self) -> bool:
        """Whether the model keeps how thick the scan was, and can be decoded as measured."""
        return self._core.keeps_thickness

    @property
    def shares_vocabulary(self) -> bool:
        """Whether the file names its dictionary or alphabet by its hash instead of holding it."""
        return self._core.shares_vocabulary

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle: the file with its note; how the model was learned is not kept."""
        if self.shares_vocabulary:
            raise TypeError(
                "a model that names its vocabulary by hash is no pickle of its own: pickle its "
                "to_bytes(), and read them with from_bytes(data, vocabulary=...)"
            )
        return _from_bytes, (self.to_bytes(),)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    def __len__(self) -> int:
        return len(self._core)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self._core == other._core

    def __hash__(self) -> int:
        return hash(self._core.to_bytes())
