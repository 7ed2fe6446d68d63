"""Openings: holes in a face that nothing stands before."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from surfabet.plan._faces import Face
from surfabet.plan._model import Opening
from surfabet.plan._scene import Scene, shapely_module

__all__ = ["openings_of"]

_NARROWEST = 0.45
"""Metres; less is a gap between points."""

_WIDEST = {"door": 2.5, "passage": 2.5, "window": 6.0}
"""Metres; what is wider was not scanned, or is hidden by what the model does not hold."""

_LOWEST = 0.4
"""Least height of a window, metres."""

_DOOR = 1.7
"""Least height of a door, metres."""

_AT_EDGE = 0.25
"""A hole that ends so near to floor or ceiling reaches it, metres."""

_RECTANGULAR = 0.75
"""Least share of its box that an opening fills; shadows of furniture fill less."""

_BEFORE = (0.03, 1.2)
"""What stands so far before a wall hides it, metres."""

_HIDDEN = 0.4
"""A hole of which this share has something before it is a shadow."""


def openings_of(face: Face, scene: Scene) -> list[Opening]:
    """The openings of a face, in order."""
    shapely = shapely_module()

    axes = np.stack([face.along @ scene.basis, scene.up])
    edge = float(max(scene.planes.tile_edges[list(face.planes)].max(), 0.02))
    # Tiles that miss a few points are no holes: what is narrower than two tiles is closed.
    seen = shapely.union_all([scene.area(plane, axes) for plane in face.planes])
    seen = seen.buffer(edge, join_style="mitre")
    seen = seen.buffer(-edge, join_style="mitre")
    whole = shapely.box(face.low, scene.floor, face.high, scene.top)
    gaps = whole.difference(seen)
    half = _NARROWEST / 2 - 0.01
    gaps = gaps.buffer(-half, join_style="mitre").buffer(half, join_style="mitre")
    before = None
    found = []
    for gap in shapely.get_parts(gaps):
        low, bottom, high, top = gap.bounds
        kind = _kind(bottom - scene.floor, top - scene.floor, scene)
        fills = gap.area / ((high - low) * (top - bottom))
        at_end = low < face.low + 0.02 or high > face.high - 0.02
        if kind is None or fills < _RECTANGULAR or high - low > _WIDEST[kind]:
            continue
        if at_end and kind != "door":
            continue
        if before is None:
            before = _before(face, scene)
        if before.intersection(gap).area > _HIDDEN * gap.area:
            continue
        found.append(
            Opening(kind, face.at(low), face.at(high), bottom - scene.floor, top - scene.floor)
        )
    found.sort(key=lambda opening: float(opening.start @ face.along))
    return found


def _kind(bottom: float, top: float, scene: Scene) -> Literal["door", "window", "passage"] | None:
    """What a hole between these heights above the floor is."""
    height = scene.top - scene.floor
    if bottom < _AT_EDGE:
        if top > height - _AT_EDGE:
            return "passage"
        return "door" if top >= _DOOR else None
    return "window" if top - bottom >= _LOWEST and top < height - 0.02 else None


def _on_face(corners: list[NDArray[np.float64]], face: Face, scene: Scene) -> NDArray[np.float64]:
    """Boxes of tiles on a face, (4, k): places and heights from, places and heights to."""
    joined = np.concatenate(corners)
    places = (joined @ scene.basis.T) @ face.along
    heights = joined @ scene.up
    return np.stack(
        [places.min(axis=1), heights.min(axis=1), places.max(axis=1), heights.max(axis=1)]
    )


def _before(face: Face, scene: Scene) -> Any:
    """The shadow on a face of everything that stands before it."""
    shapely = shapely_module()

    shadows = []
    for plane in range(len(scene.planes)):
        if plane in face.planes:
            continue
        corners = scene.corners(plane)
        if not len(corners):
            continue
        away = (corners.mean(axis=1) @ scene.basis.T) @ face.normal - face.offset
        near = (away > _BEFORE[0]) & (away < _BEFORE[1])
        heights = corners.mean(axis=1) @ scene.up
        near &= (heights > scene.floor + 0.1) & (heights < scene.top - 0.1)
        if near.any():
            low, bottom, high, top = _on_face([corners[near]], face, scene)
            # Faces of furniture across the wall are thin from here.
            shadows.append(shapely.box(low, bottom, high, top))
            if abs(scene.planes.normals[plane] @ scene.up) > 0.9:
                # What is below a top that stands before the wall is hidden, too.
                shadows.append(shapely.box(low, scene.floor, high, top))
    return shapely.union_all(np.concatenate(shadows)) if shadows else shapely.Polygon()
