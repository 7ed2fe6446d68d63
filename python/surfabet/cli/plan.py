"""`surfabet plan`: a floor plan from the planes of a model."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet.cli._files import check_output, load_model
from surfabet.cli._format import bytes_text, print_json
from surfabet.cli._options import COMMON, NOT_NEGATIVE, Common, Flag
from surfabet.plan import PLAN_SUFFIXES, FloorPlan, floor_plan


def plan(
    input_: Annotated[Path, Parameter(name="IN")],
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    up: Annotated[tuple[float, float, float], Parameter(negative=())] = (0.0, 0.0, 1.0),
    floor: float | None = None,
    min_room_area: Annotated[float, Parameter(validator=NOT_NEGATIVE)] = 1.0,
    json: Flag = False,
    common: Common = COMMON,
) -> None:
    """Draw the floor plan of a storey: walls, openings, and rooms with their areas.

    Walls are vertical planes that reach up to the ceiling. Those that were scanned from both sides
    are drawn with their thickness. Coordinates are those of the map.

        surfabet compress room.ply walls.sfb --model planes
        surfabet plan walls.sfb plan.dxf
        surfabet plan walls.sfb plan.pdf

    Parameters
    ----------
    input_
        The model file. Of models other than --model planes, planes are learned first, from what
        they decode to.
    output
        The file to write; its name tells the format: dxf (layers, metres, coordinates of the map),
        svg, pdf or png (a sheet to scale).
    up
        Direction that is up in the scan, `X Y Z`: 0 -1 0 for the frames of most cameras.
    floor
        Height of the floor in metres, to choose the storey; by default that of the lowest large
        horizontal plane.
    min_room_area
        Leave out rooms that have fewer square metres.
    json
        Print one JSON object instead of a line per room.
    """
    check_output(output, PLAN_SUFFIXES, input_)
    started = time.perf_counter()
    with common.progress() as progress:
        model = load_model(input_, progress)
        if not isinstance(model, surfabet.PlaneModel):
            surface = model.decode(normals=True, progress=progress)
            model = surfabet.learn_planes(surface, progress=progress)
        progress("find walls", 0.0)
        drawn = floor_plan(model, up=up, floor=floor, min_room_area=min_room_area)
        n_bytes = drawn.save(output)
    seconds = time.perf_counter() - started
    if json:
        print_json(
            {"input": str(input_), "output": str(output), "bytes": n_bytes, "seconds": seconds}
            | _as_dict(drawn)
        )
    elif not common.quiet:
        openings = [opening for wall in drawn.walls for opening in wall.openings]
        print(
            f"{output}: {len(drawn.walls)} faces of walls, {len(openings)} openings, "
            f"{_rooms_text(drawn)}, {bytes_text(n_bytes)}, {seconds:.1f} s"
        )
        for number, room in enumerate(drawn.rooms, 1):
            print(f"room {number}: {room.area:.2f} m2")


def _rooms_text(drawn: FloorPlan) -> str:
    """How many rooms there are, and their area."""
    if not drawn.rooms:
        return "no rooms"
    rooms = "room" if len(drawn.rooms) == 1 else "rooms"
    return f"{len(drawn.rooms)} {rooms} of {drawn.area:.2f} m2"


def _as_dict(drawn: FloorPlan) -> dict[str, object]:
    """The plan as plain lists and numbers."""
    return {
        "floor": drawn.floor,
        "ceiling": drawn.ceiling,
        "area": drawn.area,
        "rooms": [
            {
                "area": room.area,
                "outline": room.outline.tolist(),
                "holes": [hole.tolist() for hole in room.holes],
            }
            for room in drawn.rooms
        ],
        "walls": [
            {
                "start": wall.start.tolist(),
                "end": wall.end.tolist(),
                "normal": wall.normal.tolist(),
                "thickness": wall.thickness,
                "height": wall.height,
                "openings": [
                    {
                        "kind": opening.kind,
                        "start": opening.start.tolist(),
                        "end": opening.end.tolist(),
                        "bottom": opening.bottom,
                        "top": opening.top,
                    }
                    for opening in wall.openings
                ],
            }
            for wall in drawn.walls
        ],
    }
