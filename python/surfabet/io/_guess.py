"""Names for columns that come without: by their number, and by what their values can be.

A reading counts only where the values fit it: normals have length 0 or 1; colours lie within 0..1,
0..255 or 0..65535; labels are few integers. Where two readings fit, the user must say which.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from surfabet.io._columns import Column, is_normals
from surfabet.io._files import format_error

_POSITION = ("x", "y", "z")
_COLOR = ("red", "green", "blue")
_NORMAL = ("nx", "ny", "nz")
# Classes of semantic labels are fewer, intensities of 8 bits are more.
_MOST_LABELS, _FEWEST_INTENSITIES = 32, 64
# With fewer points per value, values of any kind look like labels.
_POINTS_PER_LABEL = 8


def _finite_rows(columns: Sequence[Column]) -> Column:
    rows = np.stack(columns, axis=1).astype(np.float64)
    return rows[np.isfinite(rows).all(axis=1)]


def _is_normal(columns: Sequence[Column]) -> bool:
    rows = _finite_rows(columns)
    return bool(rows.any()) and is_normals(rows)


def _is_color(columns: Sequence[Column]) -> bool:
    rows = _finite_rows(columns)
    if rows.size == 0 or rows.min() < 0 or _is_normal(columns):
        return False
    if rows.max() <= 1:
        return True
    if (rows != np.rint(rows)).any():
        return False
    # With 16 bits no channel stays within 8; else a value of another kind is among them.
    return bool(rows.max() <= 255 or (rows.max() <= 65535 and (rows.max(axis=0) > 255).all()))


def _kind(column: Column) -> str | None:
    """What a single column can only be: a label or an intensity; `None` where both fit."""
    values = column[np.isfinite(column.astype(np.float64))]
    if len(values) == 0 or (values != np.rint(values)).any() or values.min() < -1:
        return "intensity"
    n_distinct = len(np.unique(values))
    if n_distinct >= _FEWEST_INTENSITIES:
        return "intensity"
    few = n_distinct <= _MOST_LABELS and n_distinct * _POINTS_PER_LABEL <= len(values)
    return "label" if few else None


def _color_and_one(columns: Sequence[Column]) -> list[tuple[str, ...]]:
    """The readings of three columns of colour with a column before or behind them."""
    first, last = _kind(columns[0]), _kind(columns[3])
    before = (first or "intensity", *_COLOR) if _is_color(columns[1:4]) else None
    behind = (*_COLOR, last or "intensity") if _is_color(columns[0:3]) else None
    if before and behind and (first == "label") != (last == "label"):
        # A channel of a colour takes more values than a label.
        return [before if first == "label" else behind]
    if before and not behind and first is None:
        return [before, ("label", *_COLOR)]
    if behind and not before and last is None:
        return [behind, (*_COLOR, "label")]
    return [reading for reading in (before, behind) if reading]


def _readings(columns: Sequence[Column]) -> list[tuple[str, ...]]:
    """All that the columns behind the position can be."""
    match len(columns):
        case 0:
            return [()]
        case 1:
            kind = _kind(columns[0])
            return [("intensity",), ("label",)] if kind is None else [(kind,)]
        case 3:
            normal, color = _is_normal(columns), _is_color(columns)
            return [names for names, fits in ((_COLOR, color), (_NORMAL, normal)) if fits]
        case 4:
            return _color_and_one(columns)
        case 6:
            orders = ((_COLOR, _NORMAL), (_NORMAL, _COLOR))
            fits = {_COLOR: _is_color, _NORMAL: _is_normal}
            return [(*a, *b) for a, b in orders if fits[a](columns[0:3]) and fits[b](columns[3:6])]
    return []


def guess_names(
    path: Path,
    columns: Sequence[Column],
    remedy: str = "name them in a first line or with columns=",
) -> dict[str, Column]:
    """The columns by the names that their values allow; `remedy` says how to name them.

    Raises
    ------
    FormatError
        No reading fits, or more than one; the message lists them.
    """
    if len(columns) >= 3 and len(columns[0]) == 0:
        columns = columns[:3]
    found = _readings(columns[3:]) if len(columns) >= 3 else []
    if len(found) == 1:
        return dict(zip((*_POSITION, *found[0]), columns, strict=True))
    if found:
        either = " or ".join(" ".join((*_POSITION, *names)) for names in found)
        raise format_error(
            path, f"cannot tell what {len(columns)} columns mean: {either}; {remedy}"
        )
    raise format_error(
        path,
        f"cannot tell what {len(columns)} columns mean: known are 3 (x y z), 4 (and intensity or "
        "label), 6 (and colours or normals), 7 (and colours with an intensity or a label) and 9 "
        f"(and colours and normals), and their values must be such; {remedy}",
    )
