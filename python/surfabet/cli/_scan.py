"""What the command line prints about a scan before it learns from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import surfabet
from surfabet.cli._format import length_text
from surfabet.files import AnyModel
from surfabet.io._crs import unit_of

_LARGE_ROOM = 500.0
"""Sides of a scene from which on its unit is in doubt, metres."""
_FLAT = 0.2
"""Terrain is lower than this share of its width."""
_TINY = 0.02
"""Largest side of a scene that hardly any scanner resolves, metres."""


def unit_in_doubt(path: Path, cloud: surfabet.PointCloud, survey: surfabet.Survey) -> str | None:
    """One line with the remedy where the size of a scan looks as if its unit was not the metre."""
    if survey.bounds is None or unit_of(cloud) != "m":
        return None
    low, high = survey.bounds
    sides = sorted(b - a for a, b in zip(low, high, strict=True))
    size = " x ".join(f"{b - a:.3g}" for a, b in zip(low, high, strict=True))
    if sides[0] > _LARGE_ROOM and sides[0] > _FLAT * sides[2]:
        return f"{path}: the scene is {size} m large; if these are millimetres, give --unit mm"
    if 0 < sides[2] < _TINY:
        return f"{path}: the scene is {size} m large; if its unit is not the metre, give --unit"
    return None


def without(cloud: surfabet.PointCloud, points: NDArray[np.uint32]) -> surfabet.PointCloud:
    """The cloud without these points."""
    kept = np.ones(len(cloud), bool)
    kept[points] = False
    return cloud.select(kept)


def incomplete(output: Path, model: AnyModel, quality: surfabet.Quality | None) -> str | None:
    """One line with the remedy where a model that is to hold the whole scan lost some of it."""
    if quality is None:
        return None
    share = quality.inliers
    if share is None or share >= 0.99 or model.report.tolerance == 0:
        return None
    # A bound that is given already defines what is near enough.
    if isinstance(model, surfabet.PatchModel) and model.max_error is not None:
        return None
    remedies = {
        "patches": "--quality fine, a smaller --resolution or --completeness 0.99 keep more",
        "hscsm": "--quality fine or a smaller --resolution keep more",
        "gas": "--quality fine or more neurons (--n-neurons) keep more",
    }
    tolerance = length_text(model.report.tolerance, quality.unit)
    return (
        f"{output}: {1 - share:.1%} of the points are further than {tolerance} from what is "
        f"decoded; {remedies[model.method]}"
    )
