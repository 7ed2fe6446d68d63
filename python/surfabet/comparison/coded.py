"""What a tool makes of a cloud, and how that is judged."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from typing import Any

from surfabet._core import PointCloud
from surfabet.metrics import RangeSigma, evaluate

__all__ = ["Coded", "cpu_seconds", "measured"]


@dataclass(frozen=True)
class Coded:
    """Bytes, and the cloud that a user gets from them."""

    bytes: int
    """All bytes."""
    geometry_bytes: int | None
    """Those of the geometry, where it can be told apart."""
    encode_seconds: float | None
    """Of all cores; None where only the binding's loop would be timed."""
    decode_seconds: float | None
    """Of all cores."""
    decoded: PointCloud
    """What comes back."""
    kind: str = "points"
    """What was decoded: "points", or of our models "surface" or "as measured"."""
    bound: float | None = None
    """Largest distance that an input point can have from what is decoded, by construction, metres;
    None where nothing bounds it."""


def cpu_seconds() -> float:
    """Seconds of this process and of those it waited for, on all cores."""
    return sum(os.times()[:4])


def measured(
    reference: PointCloud, coded: Coded, sigma: float | RangeSigma | None
) -> dict[str, Any]:
    """Bytes, seconds and errors of what a tool made, by name; metres, 0 to 255 for colours.

    Errors of colour are None where one of both clouds has none.
    """
    q = evaluate(reference, coded.decoded, sigma=sigma, normal_neighbors=None)
    figures = {
        field.name: getattr(coded, field.name)
        for field in dataclasses.fields(coded)
        if field.name not in ("bytes", "decoded")
    }
    both = (q.color_rmse_forward, q.color_rmse_backward)
    return figures | {
        "n_bytes": coded.bytes,
        "points": q.decoded_points,
        "rmse": q.rmse,
        "rmse_forward": q.rmse_forward,
        "rmse_backward": q.rmse_backward,
        "rmse_pooled": q.rmse_pooled,
        "p99_forward": q.p99_forward,
        "p99_backward": q.p99_backward,
        "max_forward": q.max_forward,
        "max_backward": q.max_backward,
        "inliers": q.inliers,
        "outliers": q.outliers,
        "color_rmse": max((value for value in both if value is not None), default=None),
        "color_rmse_forward": q.color_rmse_forward,
        "color_rmse_backward": q.color_rmse_backward,
        "color_rmse_pooled": q.color_rmse_pooled,
    }
