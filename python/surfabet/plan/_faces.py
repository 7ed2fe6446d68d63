"""Faces of walls: upright planes that lie in one line and reach up to the ceiling."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from surfabet.plan._scene import Scene

__all__ = ["Face", "faces_of"]

_REACH = 0.85
"""Walls reach at least to this share of the height of the room; cupboards and doors do not."""

_SEEN = 0.4
"""Share of the height of the room that some part of a wall shows."""

_SHORTEST = 0.25
"""Shorter faces are left out, metres."""

_LARGEST_GAP = 2.5
"""A wall that ends and goes on further away than this is two, metres."""

_APART = 4.0
"""Planes are in one line where they are no more standard deviations of their points apart than
this, or a centimetre."""

_CORNER = 0.35
"""Ends of a face are moved to the next face where that is nearer than this, metres."""

_PARALLEL = float(np.cos(np.radians(3)))

_THINNEST, _THICKEST = 0.03, 0.7
"""Thickness of walls, metres."""

_BESIDE = 0.3
"""How far to both sides of a face floor and ceiling show where the room is, metres."""


@dataclass(frozen=True)
class Face:
    """A line x with normal . x = offset, from low to high along it."""

    normal: NDArray[np.float64]
    offset: float
    low: float
    high: float
    top: float
    """Height that it reaches, metres."""
    sigma: float
    """Standard deviation of its points, metres."""
    planes: tuple[int, ...]
    """The planes in it."""
    thickness: float | None = None

    @property
    def along(self) -> NDArray[np.float64]:
        """Direction in which `low` and `high` count."""
        return np.array([-self.normal[1], self.normal[0]])

    def at(self, place: float) -> NDArray[np.float64]:
        """The point of the line at a place along it."""
        return self.offset * self.normal + place * self.along


@dataclass(frozen=True)
class _Piece:
    """One upright plane as a line."""

    plane: int
    normal: NDArray[np.float64]
    offset: float
    places: NDArray[np.float64]
    """Places of its tiles along the line, (k, 2): from, to."""
    heights: NDArray[np.float64]
    """Heights of its tiles, (k, 2): from, to."""
    weight: float
    sigma: float

    def ends(self) -> NDArray[np.float64]:
        """Both ends on the line, (2, 2)."""
        along = np.array([-self.normal[1], self.normal[0]])
        places = np.array([self.places[:, 0].min(), self.places[:, 1].max()])
        ends: NDArray[np.float64] = self.offset * self.normal + places[:, None] * along
        return ends

    def middle(self) -> NDArray[np.float64]:
        """Between both ends, (2,)."""
        middle: NDArray[np.float64] = self.ends().mean(axis=0)
        return middle


def _piece(scene: Scene, plane: int) -> _Piece:
    normal = scene.planes.normals[plane]
    level = scene.basis @ normal
    steep = float(np.linalg.norm(level))
    flat = level / steep
    center = scene.planes.centers[plane]
    # Where the plane crosses the middle height of the room: walls are not quite upright.
    height = 0.5 * (scene.floor + scene.top)
    shift = (normal @ scene.up) * (height - center @ scene.up) / steep
    offset = float(flat @ (scene.basis @ center) - shift)
    corners = scene.corners(plane)
    along = np.array([-flat[1], flat[0]])
    places = (corners @ scene.basis.T) @ along
    heights = corners @ scene.up
    return _Piece(
        plane,
        flat,
        offset,
        np.stack([places.min(axis=1), places.max(axis=1)], axis=1),
        np.stack([heights.min(axis=1), heights.max(axis=1)], axis=1),
        float(scene.planes.counts[plane]),
        float(scene.planes.standard_deviations[plane]),
    )


def faces_of(scene: Scene) -> list[Face]:
    """All faces of walls, the longest first, with corners where they meet, and thicknesses."""
    pieces = [_piece(scene, plane) for plane in scene.upright.tolist()]
    pieces = [piece for piece in pieces if len(piece.places)]
    faces: list[Face] = []
    left = list(pieces)
    while left:
        line = [piece for piece in left if _in_line(left[0], piece)]
        left = [piece for piece in left if all(piece is not other for other in line)]
        faces += _walls_in(line, scene)
    faces = [_towards_room(face, scene) for face in faces]
    faces = [_to_corners(face, faces) for face in faces]
    faces = [face for face in faces if face.high - face.low >= _SHORTEST]
    faces = [replace(face, thickness=_thickness(face, faces)) for face in faces]
    return sorted(faces, key=lambda face: face.low - face.high)


def _in_line(first: _Piece, other: _Piece) -> bool:
    """Whether two planes are of one face: both ends of the other lie on the line of the first."""
    if first is other:
        return True
    if first.normal @ other.normal < _PARALLEL:
        return False
    allowed = max(_APART * max(first.sigma, other.sigma), 0.01)
    return bool(np.all(np.abs(other.ends() @ first.normal - first.offset) <= allowed))


def _median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """The weighted median: frames of doors stand out from a wall and must not move it."""
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(reached, reached[-1] / 2)])


def _walls_in(line: list[_Piece], scene: Scene) -> list[Face]:
    """The walls that planes in one line are: parts that are not far from each other."""
    normal = line[0].normal
    places = np.concatenate([piece.places for piece in line])
    heights = np.concatenate([piece.heights for piece in line])
    owners = np.concatenate([np.full(len(p.places), k) for k, p in enumerate(line)])
    order = np.argsort(places[:, 0], kind="stable")
    places, heights, owners = places[order], heights[order], owners[order]
    reached = np.maximum.accumulate(places[:, 1])
    starts = np.flatnonzero(np.append(True, places[1:, 0] > reached[:-1] + _LARGEST_GAP))
    found = []
    for first, end in zip(starts, np.append(starts[1:], len(places)), strict=True):
        within = slice(int(first), int(end))
        if not _reaches_up(places[within], heights[within], scene):
            continue
        members = [line[k] for k in np.unique(owners[within])]
        weights = np.array([piece.weight for piece in members])
        offsets = np.array([piece.middle() @ normal for piece in members])
        found.append(
            Face(
                normal=normal,
                offset=_median(offsets, weights),
                low=float(places[within, 0].min()),
                high=float(places[within, 1].max()),
                top=float(heights[within, 1].max()),
                sigma=float(np.sqrt(weights @ [p.sigma**2 for p in members] / weights.sum())),
                planes=tuple(piece.plane for piece in members),
            )
        )
    return found


def _reaches_up(places: NDArray[np.float64], heights: NDArray[np.float64], scene: Scene) -> bool:
    """Whether some part of tiles, 25 cm wide, reaches up to the ceiling and shows enough."""
    height = scene.top - scene.floor
    if heights[:, 1].max() < scene.floor + _REACH * height:
        return False
    part = np.floor((places.mean(axis=1) - places.min()) / _SHORTEST).astype(np.int64)
    area = np.zeros(part.max() + 1)
    np.add.at(area, part, np.ptp(places, axis=1) * np.ptp(heights, axis=1))
    top = np.full(len(area), -np.inf)
    np.maximum.at(top, part, heights[:, 1])
    enough = area / _SHORTEST >= _SEEN * height
    return bool(np.any(enough & (top >= scene.floor + _REACH * height)))


def _towards_room(face: Face, scene: Scene) -> Face:
    """The face with its normal to the side where more of floor and ceiling is."""
    counts = np.zeros(2)
    for plane in scene.level.tolist():
        height = scene.planes.centers[plane] @ scene.up
        if scene.floor + 0.3 < height < scene.top - 0.3:
            continue
        middles, sides = scene.tiles(plane)
        flat = middles @ scene.basis.T
        place, away = flat @ face.along, flat @ face.normal - face.offset
        beside = (place > face.low) & (place < face.high) & (np.abs(away) < _BESIDE)
        areas = sides.prod(axis=1)
        counts += [areas[beside & (away > 0)].sum(), areas[beside & (away < 0)].sum()]
    # Where both sides are rooms the normal is that of the scan: each side has a face of its own.
    if counts[1] > 3 * counts[0]:
        return replace(
            face, normal=-face.normal, offset=-face.offset, low=-face.high, high=-face.low
        )
    return face


def _to_corners(face: Face, faces: list[Face]) -> Face:
    """The face with its ends where it meets the faces next to them."""
    low, high = face.low, face.high
    nearest = [_CORNER, _CORNER]
    for other in faces:
        cross = float(face.normal[0] * other.normal[1] - face.normal[1] * other.normal[0])
        if abs(cross) < 0.17:
            continue
        # Where both lines meet, along this one and along the other.
        meeting = np.linalg.solve(
            np.stack([face.normal, other.normal]), [face.offset, other.offset]
        )
        at, there = float(meeting @ face.along), float(meeting @ other.along)
        if not other.low - _CORNER <= there <= other.high + _CORNER:
            continue
        if abs(at - face.low) < nearest[0]:
            low, nearest[0] = at, abs(at - face.low)
        if abs(at - face.high) < nearest[1]:
            high, nearest[1] = at, abs(at - face.high)
    return replace(face, low=low, high=high)


def _thickness(face: Face, faces: list[Face]) -> float | None:
    """Distance to the nearest face behind it that looks away from it, along half of either."""
    found = []
    for other in faces:
        if face.normal @ other.normal > -_PARALLEL:
            continue
        # Places along the other count the opposite way.
        low, high = max(face.low, -other.high), min(face.high, -other.low)
        if high - low < 0.5 * min(face.high - face.low, other.high - other.low):
            continue
        behind = float(face.offset - face.normal @ other.at(-(low + high) / 2))
        if _THINNEST <= behind <= _THICKEST:
            found.append(behind)
    return min(found, default=None)
