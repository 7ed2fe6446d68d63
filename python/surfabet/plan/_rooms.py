"""Rooms: cells between the lines of all walls, joined where no wall stands between them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet.plan._faces import Face
from surfabet.plan._model import Room
from surfabet.plan._scene import Scene, shapely_module

__all__ = ["rooms_of"]

_COVERED = 0.5
"""Share of a cell that floor or ceiling cover if it is in a room."""

_WALLED = 0.5
"""Share of the border of two cells that walls take if it parts them."""

_CLOSED = 0.1
"""Gaps between tiles of floor and ceiling that are closed, metres."""

_BEYOND = 0.5
"""How far the lines of walls go on beyond all that was seen, metres."""


def rooms_of(
    faces: list[Face], scene: Scene, min_area: float, by: NDArray[np.float64]
) -> tuple[Room, ...]:
    """All rooms, the largest first, moved `by` so much."""
    shapely = shapely_module()

    ground = _ground(scene)
    if ground.is_empty:
        return ()
    middle = np.array(ground.centroid.coords[0])
    low, high = np.array(ground.bounds[:2]), np.array(ground.bounds[2:])
    reach = float(np.linalg.norm(high - low)) + _BEYOND
    lines = [shapely.box(*ground.bounds).exterior]
    for face in faces:
        at = float(middle @ face.along)
        lines.append(shapely.LineString([face.at(at - reach), face.at(at + reach)]))
    cells = [
        cell
        for cell in shapely.get_parts(
            shapely.polygonize(shapely.get_parts(shapely.union_all(lines)))
        )
        if cell.area > 1e-6
    ]
    inside = [c for c in cells if c.intersection(ground).area >= _COVERED * c.area]
    rooms = []
    for group in _joined(inside, faces):
        room = shapely.union_all(group, grid_size=1e-6)
        for part in shapely.get_parts(room):
            if part.area >= min_area:
                rooms.append(_room(part, by))
    return tuple(sorted(rooms, key=lambda room: -room.area))


def _ground(scene: Scene) -> Any:
    """What floor and ceiling cover."""
    shapely = shapely_module()

    found = []
    for plane in scene.level.tolist():
        height = scene.planes.centers[plane] @ scene.up
        if height > scene.floor + 0.3 and (
            scene.ceiling is None or height < scene.ceiling - 0.3 or height > scene.ceiling + 1.0
        ):
            continue
        if height < scene.floor - 0.3:
            continue
        if scene.planes.areas[plane] > 0:
            found.append(scene.area(plane, scene.basis))
    if not found:
        return shapely.Polygon()
    joined = shapely.union_all(found, grid_size=1e-6)
    closed = joined.buffer(_CLOSED, join_style="mitre")
    return closed.buffer(-_CLOSED, join_style="mitre")


def _joined(cells: list[Any], faces: list[Face]) -> list[list[Any]]:
    """Cells in groups that no wall parts."""
    shapely = shapely_module()

    if not cells:
        return []
    walls = shapely.union_all(
        [shapely.LineString([face.at(face.low), face.at(face.high)]) for face in faces]
    ).buffer(1e-4, cap_style="flat")
    tree = shapely.STRtree(cells)
    group = np.arange(len(cells))
    for first, second in tree.query(cells, predicate="intersects").T.tolist():
        if first >= second or group[first] == group[second]:
            continue
        border = shapely.intersection(cells[first], cells[second], grid_size=1e-6)
        length = border.length
        if length > 1e-6 and border.intersection(walls).length < _WALLED * length:
            group[group == group[second]] = group[first]
    return [[cells[k] for k in np.flatnonzero(group == g)] for g in np.unique(group)]


def _room(polygon: Any, by: NDArray[np.float64]) -> Room:
    """A polygon without corners that are none."""
    shapely = shapely_module()

    # Anticlockwise outside, clockwise inside.
    plain = shapely.orient_polygons(polygon.simplify(1e-4))
    label = plain.representative_point()

    def ring(of: Any) -> NDArray[np.float64]:
        corners: NDArray[np.float64] = np.array(of.coords)[:-1, :2] + by
        return corners

    return Room(
        outline=ring(plain.exterior),
        holes=tuple(ring(hole) for hole in plain.interiors),
        area=float(plain.area),
        label=np.array(label.coords[0]) + by,
    )
