"""Floor plans: walls with their openings, and rooms with their areas, from the planes of a scan.

    from surfabet import plan

    drawn = plan.floor_plan(surfabet.load("walls.sfb"))
    drawn.rooms[0].area
    drawn.save("plan.dxf")

Coordinates are the world's, in metres and double precision, so that georeferenced maps stay so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from surfabet._checks import check_number, check_vector
from surfabet.errors import InvalidInputError, wrong_type, wrong_value
from surfabet.plan._draw import DRAWERS
from surfabet.plan._faces import Face, faces_of
from surfabet.plan._model import FloorPlan, Opening, Room, Wall
from surfabet.plan._openings import openings_of
from surfabet.plan._rooms import rooms_of
from surfabet.plan._scene import Scene, shapely_module
from surfabet.planes import PlaneModel

__all__ = ["PLAN_SUFFIXES", "FloorPlan", "Opening", "Room", "Wall", "floor_plan"]

PLAN_SUFFIXES = frozenset(DRAWERS)
"""Endings of the files that a plan can be saved to."""


def floor_plan(
    model: PlaneModel,
    *,
    up: Sequence[float] = (0.0, 0.0, 1.0),
    floor: float | None = None,
    min_room_area: float = 1.0,
) -> FloorPlan:
    """The floor plan of one storey.

    Walls are vertical planes that reach nearly up to the ceiling; what is lower is furniture. Two
    faces that look away from each other, with nothing between them, are one wall and give its
    thickness. Openings are holes in a wall that nothing stands before. Rooms are what floor or
    ceiling cover between walls.

    Parameters
    ----------
    model
        The planes of a scan.
    up
        Direction that is up in the world.
    floor
        Height of the floor of the storey along `up`, metres; by default that of the lowest large
        horizontal plane.
    min_room_area
        Smaller rooms are left out, square metres.

    Returns
    -------
    FloorPlan
        The same for the same model and options.

    Raises
    ------
    InvalidInputError
        For a model without walls, a `floor` above which none stands, or an `up` without direction.
    MissingDependencyError
        Without shapely: `pip install 'surfabet[plan]'`.
    """
    if not isinstance(model, PlaneModel):
        raise wrong_type("model", model, "a PlaneModel: learn_planes makes one of a cloud")
    direction = np.array(check_vector("up", up, "a direction of three numbers"))
    length = np.linalg.norm(direction)
    if not length > 0:
        raise wrong_value("up", up, "a direction of three numbers")
    if floor is not None:
        check_number("floor", floor, "a number of metres")
    square_metres = "0 or a positive number of square metres"
    check_number("min_room_area", min_room_area, square_metres, least=0.0)
    shapely_module()
    direction /= length
    planes = model.planes
    # Near zero, so that directions that differ a little do not tear map coordinates apart.
    shift = planes.centers.mean(axis=0) if len(planes) else np.zeros(3)
    planes = replace(planes, centers=planes.centers - shift)
    base = float(shift @ direction)

    def rings(plane: int) -> list[NDArray[np.float64]]:
        return [ring - shift for ring in model.polygons(plane)]

    scene = Scene.of(planes, rings, direction, None if floor is None else floor - base)
    faces = faces_of(scene)
    if not faces and floor is not None:
        found = sorted({round(float(height + base), 2) for height in scene.large_heights})
        where = f": level surfaces are at {', '.join(map(str, found))} m" if found else ""
        raise wrong_value("floor", floor, "the height of a storey with walls" + where)
    if not faces:
        raise InvalidInputError(
            "the model has no walls: no vertical plane reaches up to the ceiling; if the vertical "
            "of the scan is not z, say so by up="
        )
    by = scene.basis @ shift
    ceiling = None if scene.ceiling is None else scene.ceiling + base
    return FloorPlan(
        walls=tuple(_wall(face, scene, by) for face in faces),
        rooms=rooms_of(faces, scene, min_room_area, by),
        floor=scene.floor + base,
        ceiling=ceiling,
        basis=scene.basis,
    )


def _wall(face: Face, scene: Scene, by: NDArray[np.float64]) -> Wall:
    """A face with its openings, moved."""
    openings = tuple(
        replace(opening, start=opening.start + by, end=opening.end + by)
        for opening in openings_of(face, scene)
    )
    return Wall(
        start=face.at(face.low) + by,
        end=face.at(face.high) + by,
        normal=face.normal,
        thickness=face.thickness,
        height=face.top - scene.floor,
        openings=openings,
    )
