"""A comparison in words and cells, for the terminal and the page."""

from __future__ import annotations

from surfabet.comparison import Comparison, Row
from surfabet.io._units import small_lengths

__all__ = ["advice", "header", "row_cells", "size", "small_text"]


def header(unit: str) -> tuple[str, ...]:
    """Of `row_cells`."""
    _, small = small_lengths(unit)
    return (
        "tool",
        "setting",
        "decoded",
        "bytes",
        f"to input {small}",
        f"from input {small}",
        "found %",
        f"bound {small}",
        "colour",
        "encode s",
        "decode s",
        "memory MB",
    )


def size(n_bytes: int) -> str:
    """As `38.1 kB`, decimal multiples."""
    for limit, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if n_bytes >= limit:
            return f"{n_bytes / limit:.3g} {unit}"
    return f"{n_bytes} bytes"


def _number(value: float | None, digits: int, scale: float = 1.0) -> str:
    return "-" if value is None else f"{scale * value:,.{digits}f}"


def _small(length: float | None, unit: str) -> str:
    """Three digits of a length, but no more than a micrometre: metres as millimetres."""
    if length is None:
        return "-"
    value = small_lengths(unit)[0] * length
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def small_text(length: float, unit: str) -> str:
    """The same with its unit."""
    return f"{_small(length, unit)} {small_lengths(unit)[1]}"


def _ratio(value: float) -> str:
    """Three digits below a hundred, whole numbers above."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def row_cells(row: Row, unit: str) -> tuple[str, ...]:
    """A row of the table."""
    return (
        row.label,
        row.setting,
        row.kind,
        f"{row.n_bytes:,}",
        _small(row.rmse_forward, unit),
        _small(row.rmse_backward, unit),
        _number(row.inliers, 1, 100),
        _small(row.bound, unit),
        _number(row.color_rmse, 1),
        _number(row.encode_seconds, 1),
        _number(row.decode_seconds, 1),
        _number(row.memory, 0, 1e-6),
    )


def advice(found: Comparison) -> list[tuple[str, str, str]]:
    """Three aims, the row to take for each, and why."""
    best = found.best
    error, bound = (small_text(x, found.unit) for x in (found.error, found.max_error))
    answers = []
    for aim, title in (
        ("smallest", f"smallest under {error}"),
        ("bounded", f"no point further than {bound}"),
        ("planes", "planes only"),
    ):
        row = best[aim]
        if row is None:
            answers.append((title, "none", _why_none(found, aim)))
            continue
        forward = _small(row.rmse_forward, found.unit)
        errors = f"{forward} / {small_text(row.rmse_backward, found.unit)}"
        why = f"{size(row.n_bytes)}, 1 : {_ratio(found.raw_bytes / row.n_bytes)}, rmse {errors}"
        if aim == "bounded" and row.bound is not None:
            why += f", bound {small_text(row.bound, found.unit)}"
        if aim == "planes":
            why += f", {row.inliers:.1%} of the input found"
        answers.append((title, row.name, why))
    return answers


def _why_none(found: Comparison, aim: str) -> str:
    """What was nearest to an aim that nothing keeps to."""
    if aim == "smallest" and found.rows:
        row = min(found.rows, key=lambda row: row.rmse)
        error = small_text(row.rmse, found.unit)
        return f"the nearest is {row.name} with {error} and {size(row.n_bytes)}"
    if aim == "bounded":
        bounds = [row.bound for row in found.rows if row.bound is not None]
        if bounds:
            return f"the least bound is {small_text(min(bounds), found.unit)}"
    if aim == "planes":
        return "no planes were asked for, or none were found"
    return "nothing was asked for that keeps to it"
