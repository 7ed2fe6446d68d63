"""Units of length, and clouds scaled to metres."""

from __future__ import annotations

import numpy as np

from surfabet._core import PointCloud
from surfabet.errors import wrong_value

# The international foot and inch are exact since 1959; the foot of US surveys is older.
_METRES = {
    "mm": 0.001,
    "cm": 0.01,
    "m": 1.0,
    "km": 1000.0,
    "ft": 0.3048,
    "us-ft": 1200 / 3937,
    "in": 0.0254,
}
_OTHER_NAMES = {
    "millimeter": "mm",
    "millimetre": "mm",
    "centimeter": "cm",
    "centimetre": "cm",
    "meter": "m",
    "metre": "m",
    "kilometer": "km",
    "kilometre": "km",
    "foot": "ft",
    "feet": "ft",
    "ftus": "us-ft",
    "usft": "us-ft",
    "us_ft": "us-ft",
    "us survey foot": "us-ft",
    "us survey feet": "us-ft",
    "inch": "in",
    "inche": "in",
}
UNITS = tuple(_METRES)
"""The units that `read(path, unit=...)` takes."""


def metres_in(name: str) -> float | None:
    """Metres in the unit that a file names, in any usual spelling; `None` for no unit of length."""
    name = name.strip().lower()
    for known in (name, name.removesuffix("s")):
        if (known := _OTHER_NAMES.get(known, known)) in _METRES:
            return _METRES[known]
    return None


def name_of(metres: float) -> str | None:
    """The unit of that length, as `UNITS` has it; `None` for another."""
    # The two feet differ by two millionths; files round them to seven digits and more.
    alike = (name for name, known in _METRES.items() if abs(metres / known - 1) < 5e-7)
    return next(alike, None)


def small_lengths(unit: str) -> tuple[float, str]:
    """By what lengths in a unit are multiplied to be shown where they are small, and their unit
    then: metres become millimetres."""
    return (1000.0, "mm") if unit == "m" else (1.0, unit)


def metres_per(unit: str) -> float:
    """Metres in a unit that the user names.

    Raises
    ------
    InvalidInputError
        For a unit that is none of `UNITS`.
    """
    if unit not in _METRES:
        raise wrong_value("unit", unit, f"one of {', '.join(UNITS)}")
    return _METRES[unit]


def scaled(cloud: PointCloud, factor: float) -> PointCloud:
    """The cloud with points, ranges and viewpoints multiplied by `factor`.

    Its coordinate reference system, whose unit is another then, is left out.
    """
    far = any(cloud.origin)
    points = cloud.points * factor if far else cloud.local_points * np.float32(factor)
    return PointCloud(
        points,
        colors=cloud.colors,
        intensities=cloud.intensities,
        normals=cloud.normals,
        ranges=None if cloud.ranges is None else cloud.ranges * np.float32(factor),
        viewpoints=None if cloud.viewpoints is None else cloud.viewpoints * factor,
        viewpoint_index=cloud.viewpoint_index,
        extra=cloud.extra,
    )
