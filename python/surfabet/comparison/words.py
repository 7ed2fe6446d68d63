"""A comparison in words and cells, for the terminal and the page."""

from __future__ import annotations

from surfabet.comparison import Comparison, Row

__all__ = ["HEADER", "advice", "row_cells", "size"]

HEADER = (
    "tool",
    "setting",
    "decoded",
    "bytes",
    "to input mm",
    "from input mm",
    "found %",
    "bound mm",
    "colour",
    "encode s",
    "decode s",
    "memory MB",
)
"""Of `row_cells`."""


def size(n_bytes: int) -> str:
    """As `38.1 kB`, decimal multiples."""
    for limit, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if n_bytes >= limit:
            return f"{n_bytes / limit:.3g} {unit}"
    return f"{n_bytes} bytes"


def _number(value: float | None, digits: int, scale: float = 1.0) -> str:
    return "-" if value is None else f"{scale * value:,.{digits}f}"


def _millimetres(metres: float | None) -> str:
    """Three digits, but no more than a micrometre."""
    if metres is None:
        return "-"
    value = 1e3 * metres
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def _ratio(value: float) -> str:
    """Three digits below a hundred, whole numbers above."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def row_cells(row: Row) -> tuple[str, ...]:
    """A row of the table."""
    return (
        row.label,
        row.setting,
        row.kind,
        f"{row.n_bytes:,}",
        _millimetres(row.rmse_forward),
        _millimetres(row.rmse_backward),
        _number(row.inliers, 1, 100),
        _millimetres(row.bound),
        _number(row.color_rmse, 1),
        _number(row.encode_seconds, 1),
        _number(row.decode_seconds, 1),
        _number(row.memory, 0, 1e-6),
    )


def advice(found: Comparison) -> list[tuple[str, str, str]]:
    """Three aims, the row to take for each, and why."""
    best = found.best
    error, bound = (f"{_millimetres(x)} mm" for x in (found.error, found.max_error))
    told = []
    for aim, title in (
        ("smallest", f"smallest under {error}"),
        ("bounded", f"no point further than {bound}"),
        ("planes", "planes only"),
    ):
        row = best[aim]
        if row is None:
            told.append((title, "none", _why_none(found, aim)))
            continue
        errors = f"{_millimetres(row.rmse_forward)} / {_millimetres(row.rmse_backward)} mm"
        why = f"{size(row.n_bytes)}, 1 : {_ratio(found.raw_bytes / row.n_bytes)}, rmse {errors}"
        if aim == "bounded":
            why += f", bound {_millimetres(row.bound)} mm"
        if aim == "planes":
            why += f", {row.inliers:.1%} of the input found"
        told.append((title, row.name, why))
    return told


def _why_none(found: Comparison, aim: str) -> str:
    """What was nearest to an aim that nothing keeps to."""
    if aim == "smallest" and found.rows:
        row = min(found.rows, key=lambda row: row.rmse)
        return f"the nearest is {row.name} with {_millimetres(row.rmse)} mm and {size(row.n_bytes)}"
    if aim == "bounded":
        bounds = [row.bound for row in found.rows if row.bound is not None]
        if bounds:
            return f"the least bound is {_millimetres(min(bounds))} mm"
    if aim == "planes":
        return "no planes were asked for, or none were found"
    return "nothing was asked for that keeps to it"
