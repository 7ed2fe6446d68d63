"""Plans as files: DXF in world coordinates; SVG, PDF and PNG as sheets to scale."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from surfabet.errors import MissingDependencyError
from surfabet.io._files import optional_module, written_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from surfabet.plan._model import FloorPlan, Opening, Wall

__all__ = ["DRAWERS", "draw"]

_METRES = 6
"""The unit as DXF numbers it."""

_MILLIMETRES_PER_INCH = 25.4
_DOTS = 150
"""Pixels per inch of a PNG."""
_MARGIN = 25.0
"""Of a sheet, millimetres."""

_SHEETS = ((297.0, 210.0), (420.0, 297.0), (594.0, 420.0), (841.0, 594.0), (1189.0, 841.0))
"""Sides of A4 to A0, millimetres, broad."""

_SCALES = (20, 50, 100, 200, 250, 500, 1000, 2000, 5000, 10000)
_BARS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
"""Lengths of scale bars, metres."""

_LAYERS = {"WALLS": 7, "WALL_BODIES": 8, "OPENINGS": 5, "ROOMS": 3, "TEXT": 2, "SCALE": 7}
"""Layers of a DXF and their colours, as it numbers them."""


def _body(wall: Wall, a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners of a piece of a wall, from its face to the one behind."""
    back = (wall.thickness or 0.0) * wall.normal
    return np.array([a, b, b - back, a - back])


def bar_length(width: float) -> float:
    """Length of a scale bar for a plan of this width: about a fifth of it, a round number."""
    return min(_BARS, key=lambda length: abs(np.log(length / max(0.2 * width, 1e-9))))


def write_dxf(path: Path, plan: FloorPlan) -> None:
    """DXF: layers of walls, openings, rooms and text; metres, coordinates of the map."""
    ezdxf = optional_module("ezdxf", "surfabet[plan]", "writing DXF")
    drawing = ezdxf.new("R2010", units=_METRES)
    for name, color in _LAYERS.items():
        drawing.layers.add(name, color=color)
    space = drawing.modelspace()
    for wall in plan.walls:
        for a, b in wall.pieces():
            space.add_line(a.tolist(), b.tolist(), dxfattribs={"layer": "WALLS"})
            if wall.thickness is not None:
                corners = _body(wall, a, b).tolist()
                space.add_lwpolyline(corners, close=True, dxfattribs={"layer": "WALL_BODIES"})
        for opening in wall.openings:
            _dxf_opening(space, wall, opening)
    for room in plan.rooms:
        for ring in (room.outline, *room.holes):
            space.add_lwpolyline(ring.tolist(), close=True, dxfattribs={"layer": "ROOMS"})
    _dxf_text(space, plan)
    with written_whole(path) as temporary:
        drawing.saveas(temporary)


def _dxf_opening(space: Any, wall: Wall, opening: Opening) -> None:
    """The outline of an opening through the wall, with its kind and heights as a note."""
    layer = {"layer": "OPENINGS"}
    if wall.thickness is not None:
        corners = _body(wall, opening.start, opening.end).tolist()
        space.add_lwpolyline(corners, close=True, dxfattribs=layer)
    else:
        space.add_line(opening.start.tolist(), opening.end.tolist(), dxfattribs=layer)
    text = f"{opening.kind} {opening.width:.2f} x {opening.top - opening.bottom:.2f}"
    middle = (opening.start + opening.end) / 2 + 0.15 * wall.normal
    note = space.add_text(text, height=0.08, dxfattribs={"layer": "TEXT"})
    note.set_placement(middle.tolist())


def _dxf_text(space: Any, plan: FloorPlan) -> None:
    """Areas of rooms, and a scale bar below everything."""
    text = {"layer": "TEXT"}
    for number, room in enumerate(plan.rooms, 1):
        note = space.add_text(f"{number}: {room.area:.2f} m2", height=0.2, dxfattribs=text)
        note.set_placement(room.label.tolist())
    low, high = plan.bounds
    length = bar_length(float(high[0] - low[0]))
    y = float(low[1]) - 0.6
    scale = {"layer": "SCALE"}
    space.add_line((low[0], y), (low[0] + length, y), dxfattribs=scale)
    for x in (float(low[0]), float(low[0]) + length):
        space.add_line((x, y - 0.1), (x, y + 0.1), dxfattribs=scale)
    note = space.add_text(f"{length:g} m", height=0.2, dxfattribs=scale)
    note.set_placement((float(low[0]) + length + 0.1, y - 0.1))


def _write_sheet(path: Path, plan: FloorPlan) -> None:
    """SVG, PDF or PNG: one sheet to scale, with coordinates of the map along its frame."""
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError(
            "plans as SVG, PDF or PNG need matplotlib: pip install 'surfabet[plan]'"
        ) from error
    low, high = plan.bounds
    size = high - low + 1.0
    sheet, scale = _fitting(size)
    figure = Figure(figsize=(sheet[0] / _MILLIMETRES_PER_INCH, sheet[1] / _MILLIMETRES_PER_INCH))
    # One metre is a thousand millimetres by the scale, wherever the sheet is larger than the plan.
    shown = np.array(sheet) - 2 * _MARGIN
    axes = figure.add_axes(
        (_MARGIN / sheet[0], _MARGIN / sheet[1], shown[0] / sheet[0], shown[1] / sheet[1])
    )
    middle, half = (low + high) / 2, shown * scale / 2000
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    draw(axes, plan)
    _draw_bar(axes, plan, scale)
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.tick_params(labelsize=7)
    axes.set_title(f"1 : {scale}, {plan.area:.1f} m², coordinates in metres", fontsize=9)
    with (
        written_whole(path) as temporary,
        rc_context({"svg.fonttype": "none", "svg.hashsalt": "surfabet", "pdf.fonttype": 42}),
    ):
        suffix = path.suffix.lower()
        # Date and release of the drawing would make equal plans differ.
        dated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {"Software": None}}
        figure.savefig(temporary, format=suffix[1:], metadata=dated[suffix], dpi=_DOTS)


def _fitting(size: NDArray[np.float64]) -> tuple[tuple[float, float], int]:
    """The sheet and the scale, one to so many: the largest scale from 1:20 that fits A3, and the
    smallest sheet for it; larger sheets where even the smallest scale does not fit."""
    for scale in _SCALES:
        needed = 1000 * size / scale + 2 * _MARGIN
        for sheet in _SHEETS[:2]:
            if np.all(needed <= sheet):
                return sheet, scale
    needed = 1000 * size / _SCALES[-1] + 2 * _MARGIN
    found = next((sheet for sheet in _SHEETS if np.all(needed <= sheet)), None)
    return found or (float(needed[0]), float(needed[1])), _SCALES[-1]


def draw(axes: Axes, plan: FloorPlan) -> None:
    """Rooms, walls and openings."""
    _draw_rooms(axes, plan)
    for wall in plan.walls:
        _draw_wall(axes, wall)


def _draw_rooms(axes: Axes, plan: FloorPlan) -> None:
    for number, room in enumerate(plan.rooms, 1):
        axes.fill(*room.outline.T, facecolor="#eef3fa", edgecolor="none", zorder=1)
        for hole in room.holes:
            axes.fill(*hole.T, facecolor="white", edgecolor="none", zorder=1)
        text = f"{number}\n{room.area:.2f} m²"
        axes.text(
            float(room.label[0]),
            float(room.label[1]),
            text,
            ha="center",
            va="center",
            fontsize=8,
            zorder=5,
        )


def _draw_wall(axes: Axes, wall: Wall) -> None:
    for a, b in wall.pieces():
        if wall.thickness is not None:
            axes.fill(*_body(wall, a, b).T, facecolor="#777", edgecolor="none", zorder=2)
        axes.plot(*np.array([a, b]).T, color="black", linewidth=1.2, zorder=3)
    for opening in wall.openings:
        ends = np.array([opening.start, opening.end])
        back = ends - (wall.thickness or 0.0) * wall.normal
        style = {"window": "-", "door": "--", "passage": ":"}[opening.kind]
        for line in (ends, back):
            axes.plot(*line.T, style, color="#1f5fa8", linewidth=0.7, zorder=3)
        note = f"{opening.width:.2f}"
        axes.annotate(
            note,
            ends.mean(axis=0),
            xytext=tuple(7 * wall.normal),
            textcoords="offset points",
            fontsize=5,
            ha="center",
            va="center",
            color="#1f5fa8",
            zorder=4,
        )


def _draw_bar(axes: Axes, plan: FloorPlan, scale: int) -> None:
    low, high = plan.bounds
    length = bar_length(float(high[0] - low[0]))
    left, bottom = axes.get_xlim()[0], axes.get_ylim()[0]
    unit = scale / 1000
    x, y = left + 6 * unit, bottom + 8 * unit
    for part in range(4):
        shade = "black" if part % 2 == 0 else "white"
        xs = x + length / 4 * np.array([part, part + 1, part + 1, part])
        axes.fill(xs, y + unit * np.array([0, 0, 1.5, 1.5]), fc=shade, ec="black", lw=0.5, zorder=6)
    for place in (0.0, length):
        axes.text(x + place, y + 2.5 * unit, f"{place:g} m", fontsize=6, ha="center", zorder=6)


DRAWERS: dict[str, Callable[[Path, FloorPlan], None]] = {
    ".dxf": write_dxf,
    ".svg": _write_sheet,
    ".pdf": _write_sheet,
    ".png": _write_sheet,
}
"""What writes a plan, by the ending of the file's name."""
