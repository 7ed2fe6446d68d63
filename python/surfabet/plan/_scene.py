"""Planes of a scan sorted into what is level and what is upright, with floor and ceiling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet.io._files import optional_module
from surfabet.planes import Planes

__all__ = ["Scene", "shapely_module"]

_LEVEL = float(np.cos(np.radians(15)))
_UPRIGHT = float(np.sin(np.radians(10)))
"""Cosines to the vertical of the normals of level planes, and of upright ones."""

_LARGE = 0.2
"""Floors and ceilings have at least this share of the largest level plane."""

_LOWEST_ROOM = 1.5
"""What is less above the floor is no ceiling, metres."""


def shapely_module() -> Any:
    """Polygons."""
    return optional_module("shapely", "surfabet[plan]", "a floor plan")


@dataclass(frozen=True)
class Scene:
    """The planes as a plan sees them: two axes along the plan, and heights."""

    planes: Planes
    rings: Callable[[int], list[NDArray[np.float64]]]
    """Outlines and holes of the supported tiles of a plane, (k, 3) each."""
    up: NDArray[np.float64]
    basis: NDArray[np.float64]
    """Axes of the plan as rows, (2, 3)."""
    upright: NDArray[np.int64]
    """Numbers of the upright planes, the largest first."""
    level: NDArray[np.int64]
    """Numbers of the level planes."""
    floor: float
    ceiling: float | None
    top: float
    """Height of the ceiling, or of what was seen highest."""
    large_heights: NDArray[np.float64]
    """Heights of the large level planes, ascending."""

    @classmethod
    def of(
        cls,
        planes: Planes,
        rings: Callable[[int], list[NDArray[np.float64]]],
        up: NDArray[np.float64],
        floor: float | None,
    ) -> Scene:
        """Sorts the planes and finds floor and ceiling."""
        lean = np.abs(planes.normals @ up)
        order = np.argsort(-planes.areas, kind="stable")
        upright = order[(lean[order] < _UPRIGHT) & planes.planar[order]]
        flat = order[lean[order] > _LEVEL]
        heights = planes.centers @ up
        large = flat[planes.areas[flat] >= _LARGE * planes.areas[flat].max()] if len(flat) else flat
        reach = [_heights(planes, i, up) for i in upright]
        lowest = min((low for low, _ in reach), default=0.0)
        highest = max((high for _, high in reach), default=0.0)
        if floor is None:
            floor = float(heights[large].min()) if len(large) else lowest
            # A ceiling alone, or a table, with walls that go on below.
            if lowest < floor - _LOWEST_ROOM:
                floor = lowest
        above = heights[large][heights[large] > floor + _LOWEST_ROOM]
        ceiling = float(above.min()) if len(above) else None
        top = highest if ceiling is None else ceiling
        large_heights = np.sort(heights[large])
        return cls(planes, rings, up, _axes(up), upright, flat, floor, ceiling, top, large_heights)

    def tiles(self, plane: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Middles (k, 3) and sides (k, 2) of the supported tiles of a plane."""
        edge = self.planes.tile_edges[plane]
        sides = self.planes.extents[plane]
        rows, columns = np.nonzero(self.planes.supported[plane])
        low = np.stack([columns, rows], axis=1) * edge
        high = np.minimum(low + edge, sides)
        local = (low + high) / 2 - sides / 2
        middles = self.planes.centers[plane] + local @ self.planes.axes[plane, :2]
        return middles, high - low

    def area(self, plane: int, axes: NDArray[np.float64]) -> Any:
        """What a plane supports, as a shape of shapely in the coordinates of two axes, (2, 3)."""
        shapely = shapely_module()
        shapes = []
        signs = []
        for ring in self.rings(plane):
            x, y = axes @ ring.T
            shapes.append(shapely.Polygon(np.column_stack([x, y])))
            signs.append(float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))
        found = np.array(signs)
        # The longest ring is an outline; holes run the other way.
        outer = found * found[np.argmax(np.abs(found))] > 0
        parts = np.array(shapes)
        return shapely.difference(shapely.union_all(parts[outer]), shapely.union_all(parts[~outer]))

    def corners(self, plane: int) -> NDArray[np.float64]:
        """Corners of the supported tiles of a plane, (k, 4, 3), in turn around each."""
        middles, sides = self.tiles(plane)
        turn = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
        offsets = (turn[None] * sides[:, None]) @ self.planes.axes[plane, :2]
        return middles[:, None] + offsets


def _axes(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Two axes across the vertical: those of the world that are next in turn, made level."""
    vertical = int(np.argmax(np.abs(up)))
    first = np.eye(3)[(vertical + 1) % 3]
    first = first - (first @ up) * up
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


def _heights(planes: Planes, plane: int, up: NDArray[np.float64]) -> tuple[float, float]:
    """Lowest and highest point of a rectangle."""
    half = np.abs(planes.axes[plane, :2] @ up) @ planes.extents[plane] / 2
    middle = float(planes.centers[plane] @ up)
    return middle - float(half), middle + float(half)
