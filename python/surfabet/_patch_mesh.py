"""The patches of a lattice as one mesh: squares of the finest pixel whose corners are shared.

Patches of one side lie on the same lattice of pixels. Their depths at a shared corner differ by
what the coder rounded; corners of one place whose depths are near are one vertex at the mean, so
that no gap is left along the borders of patches, whatever their levels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from surfabet.geometry import KdTree
from surfabet.meshes import Mesh

if TYPE_CHECKING:
    from surfabet.patches import LatticeModel

__all__ = ["mesh_of"]

_PIXELS = 8
_ORDER = 5
_DEGREES = [(order - j, j) for order in range(_ORDER + 1) for j in range(order + 1)]
"""Degrees of the shapes along columns and rows."""

_NEAR = 2.0
"""Corners of one place whose depths are within so many pixels of their patches are one vertex.

Depths are rounded to 0.75 pixels by default, and patches of a wavy sheet end a pixel or two off
each other."""


def _shapes(n: int) -> NDArray[np.float64]:
    """Values of all shapes at the corners of n x n squares of a patch, (21, n + 1, n + 1)."""
    x = np.linspace(-1, 1, n + 1)
    values = [np.ones_like(x), np.sqrt(3) * x]
    values += [np.sqrt(2) * np.cos(k * np.pi * (x + 1) / 2) for k in range(2, _ORDER + 1)]
    return np.stack([values[j][:, None] * values[i][None, :] for i, j in _DEGREES])


@dataclass(frozen=True, slots=True)
class _Patches:
    """Patches of one lattice."""

    pixels: list[float]
    """Sides of a pixel by level, metres."""
    places: NDArray[np.int64]
    """Side, level, first column and row in finest pixels, (m, 4)."""
    masks: NDArray[np.bool_]
    """Set pixels, (m, 8, 8)."""
    coefficients: NDArray[np.float64]
    """Of the shapes, metres, (m, 21)."""

    def __getitem__(self, which: NDArray[np.int64]) -> _Patches:
        return _Patches(
            self.pixels, self.places[which], self.masks[which], self.coefficients[which]
        )


def mesh_of(model: LatticeModel[Any]) -> Mesh:
    """The thin surface of a model; see `LatticeModel.mesh`."""
    patches = _Patches(*model._core.surface())
    local, triangles = _surface(patches)
    vertices, parts = [local], [triangles]
    for instance in model.instances:
        local, triangles = _surface(patches[instance.patches])
        # A mirror turns the order of corners round.
        parts.append((triangles if instance.facing > 0 else triangles[:, ::-1]) + _count(vertices))
        vertices.append(local @ instance.linear.T + instance.shift)
    if not _count(vertices):
        none = None if not model.has_color else np.zeros((0, 3), np.uint8)
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.uint32), none)
    world = np.concatenate(vertices) @ model.rotation.T + model.origin
    return Mesh(world, np.concatenate(parts).astype(np.uint32), _colors(model, world))


def _count(parts: list[NDArray[np.float64]]) -> int:
    return sum(len(part) for part in parts)


def _surface(patches: _Patches) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Patches as vertices along the axes of the lattice, metres, and triangles."""
    if not len(patches.places):
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    sides, places, depths, near = _squares(patches)
    side = np.repeat(sides, 4)
    corners = places.reshape(-1, 2)
    vertex, first = _joined(side, corners, depths.ravel(), np.repeat(near, 4))
    count = np.bincount(vertex)
    depth = np.bincount(vertex, depths.ravel()) / count
    squares = vertex.reshape(-1, 4)
    # Two patches may hold a pixel each at one place and depth.
    _, kept = np.unique(np.sort(squares, axis=1), axis=0, return_index=True)
    kept.sort()
    squares, facing_down = squares[kept], sides[kept] % 2 == 1
    squares[facing_down] = squares[facing_down][:, ::-1]
    triangles = np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]])
    local = _local(side[first], corners[first], depth, patches.pixels[-1])
    used, triangles = np.unique(triangles, return_inverse=True)
    return local[used], triangles.reshape(-1, 3)


def _squares(
    patches: _Patches,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Squares of the finest pixel.

    Their sides (q,), places of corners in turn (q, 4, 2) in pixels, depths there (q, 4) and how far
    these may be from those of a neighbour (q,), metres.
    """
    finest = patches.pixels[-1]
    side, level, first = patches.places[:, 0], patches.places[:, 1], patches.places[:, 2:]
    around = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    parts: list[tuple[NDArray[np.int64], ...]] = []
    depths = []
    for number, pixel in enumerate(patches.pixels):
        which = np.flatnonzero(level == number)
        fine = round(pixel / finest)
        patch, row, column = np.nonzero(patches.masks[which])
        grid = np.einsum("mk,kvu->mvu", patches.coefficients[which], _shapes(_PIXELS * fine))
        v, u = np.divmod(np.arange(fine * fine), fine)
        patch = np.repeat(patch, fine * fine)
        inner = np.stack(
            [
                (fine * column[:, None] + u).ravel(),
                (fine * row[:, None] + v).ravel(),
            ],
            axis=1,
        )
        corners = inner[:, None] + around
        depths.append(grid[patch[:, None], corners[..., 1], corners[..., 0]])
        owner = which[patch]
        parts.append((side[owner], first[owner][:, None] + corners, np.full(len(owner), fine)))
    sides, places, fines = (np.concatenate(of) for of in zip(*parts, strict=True))
    return sides, places, np.concatenate(depths), _NEAR * finest * fines


def _joined(
    side: NDArray[np.int64],
    corners: NDArray[np.int64],
    depth: NDArray[np.float64],
    near: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The vertex of every corner, and one corner of every vertex."""
    order = np.lexsort((depth, corners[:, 1], corners[:, 0], side))
    same = np.ones(len(order) - 1, bool)
    for of in (side, corners[:, 0], corners[:, 1]):
        same &= of[order][1:] == of[order][:-1]
    limit = np.maximum(near[order][1:], near[order][:-1])
    same &= np.diff(depth[order]) <= limit
    number = np.concatenate([[0], np.cumsum(~same)])
    vertex = np.empty(len(order), np.int64)
    vertex[order] = number
    first = order[np.concatenate([[True], ~same])]
    return vertex, first


def _local(
    side: NDArray[np.int64],
    corners: NDArray[np.int64],
    depth: NDArray[np.float64],
    pixel: float,
) -> NDArray[np.float64]:
    """Positions along the axes of the lattice, metres."""
    axis = side // 2
    local = np.empty((len(side), 3))
    rows = np.arange(len(side))
    local[rows, (axis + 1) % 3] = corners[:, 0] * pixel
    local[rows, (axis + 2) % 3] = corners[:, 1] * pixel
    local[rows, axis] = depth
    return local


def _colors(model: LatticeModel[Any], vertices: NDArray[np.float64]) -> NDArray[np.uint8] | None:
    """The colour of the decoded point next to each vertex."""
    if not model.has_color:
        return None
    from surfabet._core import PointCloud

    decoded = model.decode()
    nearest = KdTree(decoded).query(PointCloud(vertices))[1].ravel()
    colors = decoded.colors
    assert colors is not None
    found: NDArray[np.uint8] = colors[nearest]
    return found
