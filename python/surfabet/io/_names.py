"""What the names mean that text files give their columns."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Sequence
from dataclasses import dataclass

from surfabet.io._columns import KNOWN_NAMES
from surfabet.io._units import metres_in

_POSITION = ("x", "y", "z")
_COLOR = ("red", "green", "blue")
UNIT_COLOR = {"rf": "red", "gf": "green", "bf": "blue"}
"""Colours from 0 to 1, as CloudCompare names them."""
_NORMAL = ("nx", "ny", "nz")
LENGTHS = frozenset({*_POSITION, "range", "vp_x", "vp_y", "vp_z"})
"""The columns that a unit of length is for."""

LABEL = "label"
"""Classes of points, whoever gave them."""

_OTHER_NAMES = {
    "easting": "x",
    "east": "x",
    "rechtswert": "x",
    "point_x": "x",
    "northing": "y",
    "north": "y",
    "hochwert": "y",
    "point_y": "y",
    "elevation": "z",
    "elev": "z",
    "height": "z",
    "altitude": "z",
    "hoehe": "z",
    "höhe": "z",
    "point_z": "z",
    # LidarView and VeloView, in metres.
    "distance_m": "range",
    "labels": LABEL,
    "scalar_label": LABEL,
}
# Surveyors' files have these letters, which alone say too little: point, northing, easting, ...
_LETTERS = {"e": "x", "n": "y", "z": "z", "h": "z"}
# Components of a vector by number, as ParaView and LidarView write them: `Points:0`, `RGB_2`.
_COMPONENT = re.compile(r"(points|points_m_xyz|coordinates|rgb|colors|normals)[:_ ]([012])")
_VECTORS = {"rgb": _COLOR, "colors": _COLOR, "normals": _NORMAL}
# `X [m]`, `range (mm)`.
_BRACKETED = re.compile(r"(.*\S)\s*[\[({]\s*([^\])}]*?)\s*[\])}]")
# A name of a header that white space separates, with what stands in brackets behind it.
SPACED_NAME = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")


@dataclass(frozen=True)
class ColumnName:
    """What a name in a header says."""

    written: str
    """As the file has it."""
    name: str
    """As the columns of clouds are named here; as written for all others."""
    unit: str | None
    """What stands in brackets behind it."""
    metres: float | None
    """Metres in that unit, for columns of lengths."""


def _meaning(written: str) -> ColumnName:
    # Lines are read as latin-1, in which no bytes are wrong.
    with contextlib.suppress(UnicodeError):
        written = written.encode("latin-1").decode("utf-8")
    written = written.strip().strip("\"'").strip()
    name, unit = written.lower(), None
    if match := _BRACKETED.fullmatch(name):
        name, unit = match.groups()
    name = _OTHER_NAMES.get(name, name)
    if match := _COMPONENT.fullmatch(name):
        name = _VECTORS.get(match[1], _POSITION)[int(match[2])]
    if name not in KNOWN_NAMES and name not in UNIT_COLOR and name != LABEL:
        return ColumnName(written, written, None, None)
    metres = metres_in(unit) if unit is not None and name in LENGTHS else None
    return ColumnName(written, name, unit, metres)


def _letter(word: str) -> str | None:
    """The axis that a surveyor's letter is for."""
    name, _, _ = word.strip().strip("\"'").lower().partition("[")
    return _LETTERS.get(name.partition("(")[0].strip())


def _of_letter(word: str) -> ColumnName | None:
    if (axis := _letter(word)) is None:
        return None
    # With the unit that may stand behind it.
    match = _BRACKETED.fullmatch(word.strip().strip("\"'").lower())
    unit = None if match is None else match[2]
    return ColumnName(word, axis, unit, None if unit is None else metres_in(unit))


def column_names(words: Sequence[str]) -> list[ColumnName] | None:
    """The meaning of each word if together they name a position, else `None`."""
    names = [_meaning(word) for word in words]
    known = {name.name for name in names}
    letters = {letter for letter in map(_letter, words) if letter is not None}
    if not known >= set(_POSITION) and letters >= set(_POSITION):
        names = [_of_letter(word) or name for word, name in zip(words, names, strict=True)]
        known = {name.name for name in names}
    return names if known >= set(_POSITION) else None
