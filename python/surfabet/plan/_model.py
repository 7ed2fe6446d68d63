"""What a floor plan is made of."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from surfabet.errors import wrong_type

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["FloorPlan", "Opening", "Room", "Wall"]


@dataclass(frozen=True, slots=True)
class Opening:
    """A hole in a wall."""

    kind: Literal["door", "window", "passage"]
    """A door reaches the floor, a window does not, a passage reaches floor and ceiling."""
    start: NDArray[np.float64]
    """One end on the face of the wall, (2,), metres."""
    end: NDArray[np.float64]
    """The other end, (2,), metres."""
    bottom: float
    """Height of its lower edge above the floor, metres."""
    top: float
    """Height of its upper edge above the floor, metres."""

    @property
    def width(self) -> float:
        """Metres."""
        return float(np.linalg.norm(self.end - self.start))


@dataclass(frozen=True, slots=True)
class Wall:
    """The face of a wall that was seen. A wall that was seen from both sides has two."""

    start: NDArray[np.float64]
    """One end of the face, (2,), metres."""
    end: NDArray[np.float64]
    """The other end, (2,), metres."""
    normal: NDArray[np.float64]
    """Unit normal into the room, (2,)."""
    thickness: float | None
    """Distance to the face on the other side, metres; None where that was not seen."""
    height: float
    """How far it was seen to reach above the floor, metres."""
    openings: tuple[Opening, ...]
    """Its holes, from start to end."""

    @property
    def length(self) -> float:
        """Metres."""
        return float(np.linalg.norm(self.end - self.start))

    def pieces(self) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """What of it is between its openings, as pairs of ends."""
        corners = [self.start]
        for opening in self.openings:
            corners += [opening.start, opening.end]
        corners.append(self.end)
        along = (self.end - self.start) / max(self.length, 1e-12)
        pairs = zip(corners[::2], corners[1::2], strict=True)
        return [(a, b) for a, b in pairs if (b - a) @ along > 1e-9]


@dataclass(frozen=True, slots=True)
class Room:
    """What floor or ceiling cover between walls."""

    outline: NDArray[np.float64]
    """Corners, anticlockwise, (k, 2), metres; the last is not the first again."""
    holes: tuple[NDArray[np.float64], ...]
    """Pillars and the like within it, clockwise."""
    area: float
    """Square metres, without the holes."""
    label: NDArray[np.float64]
    """A place within it, (2,), for its name."""


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """Walls and rooms of one storey; the largest room first."""

    walls: tuple[Wall, ...]
    """Faces of walls, the longest first."""
    rooms: tuple[Room, ...]
    """Rooms, the largest first."""
    floor: float
    """Height of the floor along the vertical of the world, metres."""
    ceiling: float | None
    """Height of the ceiling, metres; None where none was seen."""
    basis: NDArray[np.float64]
    """Directions of both axes of the plan in the world as rows, (2, 3). For z upwards they are x
    and y, so that coordinates of the plan are those of the map."""

    @property
    def area(self) -> float:
        """Of all rooms, square metres."""
        return sum(room.area for room in self.rooms)

    @property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper corner of everything in it, (2,) each."""
        ends = [end for wall in self.walls for end in (wall.start, wall.end)]
        corners = np.concatenate([np.array(ends), *(room.outline for room in self.rooms)])
        return corners.min(axis=0), corners.max(axis=0)

    def draw(self, axes: Axes) -> None:
        """Draws rooms, walls and openings on axes of matplotlib, in coordinates of the plan."""
        from surfabet.plan._draw import draw

        if not hasattr(axes, "add_patch"):
            raise wrong_type("axes", axes, "axes of matplotlib")
        draw(axes, self)

    def save(self, path: str | os.PathLike[str]) -> int:
        """Writes the plan and returns the size of the file in bytes.

        Parameters
        ----------
        path
            Its ending tells the format. `.dxf`: layers for walls, openings, rooms and text, in
            world coordinates and metres; needs ezdxf. `.svg`, `.pdf`, `.png`: a sheet to scale with
            a scale bar and the coordinates of the map; needs matplotlib.

        Raises
        ------
        InvalidInputError
            For another ending.
        MissingDependencyError
            Without the package for the format: `pip install 'surfabet[plan]'`.
        OSError
            When the file cannot be written.
        """
        from surfabet.io._files import export
        from surfabet.plan._draw import DRAWERS

        return export(path, self, DRAWERS)
