"""How far the surface of a model is from a second cloud, in small cells: what the page of `view`
holds of that cloud."""

from __future__ import annotations

import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet._core import KdTree, PointCloud
from surfabet.errors import InvalidInputError, wrong_value
from surfabet.model import Model
from surfabet.survey import survey

__all__ = ["distance_field"]

MOST_CELLS = 100_000
"""Cells of a field: about 1.5 bytes each in the page, beside a model of some tens of kilobytes."""

_EXACT = 1 << 53
"""Integers below it are exact in JavaScript."""

_GROWTH = 2 ** (1 / 3)


def distance_field(model: Model[Any], cloud: PointCloud, name: str) -> bytes:
    """The distance from the thin surface of a model to the nearest point of a cloud, as the mean in
    each cell that the surface passes through; packed.

    Cells have a side of two spacings of the decoded points, more where that makes more than
    `MOST_CELLS`. Distances have 254 steps of equal ratio, from a 64th of a side to the largest.
    viewer/page/distance.js reads it.

    Raises
    ------
    InvalidInputError
        The cloud has no points, or the model decodes to none.
    """
    decoded = model.decode()
    if not len(decoded):
        raise InvalidInputError("the model decodes to no points; there are no distances to show")
    if not len(cloud):
        shown = f"{name}, which has no points"
        raise wrong_value("against", cloud, "a cloud with points", shown=shown)
    distances = KdTree(cloud).query(decoded)[0].ravel().astype(np.float64)
    local = decoded.points - np.array(model.origin)
    low = local.min(axis=0)
    side, keys, dimensions, cell_of = _cells(local - low, survey(decoded).spacing or 0.01)
    means = np.bincount(cell_of, distances) / np.bincount(cell_of)
    least = side / 64
    ratio = max(float(means.max()) / least, 2.0) ** (1 / 254)
    steps = 1 + np.rint(np.log(np.maximum(means, least) / least) / np.log(ratio))
    codes = np.where(means < least, 0, np.minimum(steps, 255)).astype(np.uint8)
    header = {
        "name": name,
        "low": low.tolist(),
        "side": side,
        "dimensions": dimensions.tolist(),
        "count": len(keys),
        "least": least,
        "ratio": ratio,
    }
    gaps = np.diff(keys, prepend=0)
    text = json.dumps(header).encode() + b"\n"
    return zlib.compress(text + _varints(gaps) + codes.tobytes(), 9)


def _cells(
    places: NDArray[np.float64], spacing: float
) -> tuple[float, NDArray[np.int64], NDArray[np.int64], NDArray[np.intp]]:
    """Side of the cells, their numbers (x fastest) in order, cells along each axis, and the cell of
    each place, by its position in that order."""
    side = 2 * spacing
    while True:
        cells = np.floor(places / side).astype(np.int64)
        dimensions = cells.max(axis=0) + 1
        # In floating point, which does not overflow.
        if np.prod(dimensions.astype(np.float64)) < _EXACT:
            numbers = (cells[:, 2] * dimensions[1] + cells[:, 1]) * dimensions[0] + cells[:, 0]
            keys, cell_of = np.unique(numbers, return_inverse=True)
            if len(keys) <= MOST_CELLS:
                return side, keys, dimensions, cell_of
        side *= _GROWTH


def _varints(values: NDArray[np.int64]) -> bytes:
    """Seven bits per byte, the lowest first; the highest bit says that more follow."""
    lengths = np.ones(len(values), np.int64)
    rest = values >> 7
    while rest.any():
        lengths += rest > 0
        rest >>= 7
    starts = np.cumsum(lengths) - lengths
    out = np.zeros(int(lengths.sum()), np.uint8)
    for k in range(int(lengths.max())):
        there = lengths > k
        more = np.where(lengths[there] > k + 1, 128, 0)
        out[starts[there] + k] = (values[there] >> 7 * k & 127) | more
    return out.tobytes()
