"""Bjontegaard's rate difference of two curves, and the lower hull of a sweep.

A curve is a list of (error, bytes). Quality is -20 log10(error), in decibels, as for a PSNR; the
logarithm of the bytes is interpolated over it, and its mean is taken over the range of qualities
that both curves have (Bjontegaard, VCEG-M33 and VCEG-AI11, with scipy's PCHIP in the place of the
cubic polynomial, as in later practice).

A lower hull is interpolated by its own straight edges instead. It may end in two settings of
nearly the same error and different bytes; there PCHIP leaves the second as steeply as up to three
times the next edge and falls far below everything that was measured (on the kitchen by a quarter of
the bytes over the whole range).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator, PPoly

Curve = Sequence[tuple[float, float]]
"""(error, bytes), both positive."""


def lower_hull(points: Curve) -> list[tuple[float, float]]:
    """The points that no other and no mixture of two others beats, by growing error.

    It is the lower convex hull in the logarithms of error and bytes, from the least error to the
    least bytes.
    """
    hull: list[tuple[float, float]] = []
    least = math.inf
    for point in sorted(set(points)):
        if point[1] >= least:
            continue
        least = point[1]
        while len(hull) > 1 and _turn(hull[-2], hull[-1], point) <= 0:
            hull.pop()
        hull.append(point)
    return hull


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Above 0 where a, b, c turn to the left, so that b lies below the line from a to c."""
    (ax, ay), (bx, by), (cx, cy) = (tuple(map(math.log, point)) for point in (a, b, c))
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def bd_rate(
    anchor: Curve,
    tested: Curve,
    errors: tuple[float, float] = (0.0, math.inf),
    straight: bool = False,
) -> tuple[float, tuple[float, float]]:
    """Mean difference of the bytes of `tested` to those of `anchor` at equal error.

    Returns a share (-0.25: a quarter fewer bytes) and the range of errors that it was taken over:
    what both curves have of `errors`. More bytes must not have more error on either curve.
    `straight` interpolates by lines, for hulls, else by PCHIP.
    """
    a, b = (_log_bytes(curve, straight) for curve in (anchor, tested))
    # Interpolators run over quality, which falls as the error grows.
    low = max(a.x[0], b.x[0], _quality(errors[1]))
    high = min(a.x[-1], b.x[-1], _quality(errors[0]))
    if low >= high:
        raise ValueError(f"the curves have no error in common within {errors}")
    mean = (b.integrate(low, high) - a.integrate(low, high)) / (high - low)
    return math.expm1(mean), (_error(high), _error(low))


def bytes_at(curve: Curve, error: float, straight: bool = False) -> float:
    """Bytes that a curve takes for an error, by the same interpolation; NaN outside of it."""
    return math.exp(_log_bytes(curve, straight)(_quality(error), extrapolate=False))


def _log_bytes(curve: Curve, straight: bool) -> PPoly:
    points = sorted((_quality(error), math.log(n)) for error, n in curve)
    if len(points) < 2:
        raise ValueError("a curve needs two points")
    if any(a[0] == b[0] or a[1] >= b[1] for a, b in itertools.pairwise(points)):
        raise ValueError("more bytes must have less error; take the lower hull first")
    x, y = np.array(points).T
    if straight:
        return PPoly([np.diff(y) / np.diff(x), y[:-1]], x)
    return PchipInterpolator(x, y)


def _quality(error: float) -> float:
    return -20 * math.log10(error) if error > 0 else math.inf


def _error(quality: float) -> float:
    return 10 ** (-quality / 20)
