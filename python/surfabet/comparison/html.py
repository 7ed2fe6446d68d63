"""A comparison as one page: which to take, the curves, the table, pictures of every row."""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import TYPE_CHECKING

from surfabet import _html
from surfabet._core import PointCloud
from surfabet.comparison import Comparison, Row
from surfabet.comparison.words import advice, header, row_cells, size, small_text
from surfabet.io._units import small_lengths
from surfabet.report import check_pictures, draw_cloud

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["save_html"]

_SCRIPT = """
const rows = ROWS, body = document.querySelector("#rows tbody");
function show(n) {
  for (const tr of body.rows) tr.classList.toggle("chosen", tr.dataset.row === String(n));
  document.querySelector("#shown").textContent = rows[n].name;
  ["decoded", "forward", "backward"].forEach((id, k) => {
    const image = document.querySelector("#" + id + " img");
    if (rows[n].pictures[k]) image.src = rows[n].pictures[k];
  });
}
body.addEventListener("click", event => {
  const tr = event.target.closest("tr");
  if (tr) show(+tr.dataset.row);
});
document.querySelectorAll("#rows th").forEach((th, column) => {
  let sign = 1;
  th.firstChild.addEventListener("click", () => {
    const key = tr => {
      const text = tr.cells[column].textContent.replace(/,/g, "");
      const value = parseFloat(text);
      return column < 3 ? text : isNaN(value) ? Infinity : value;
    };
    const sorted = [...body.rows].sort((a, b) => {
      const x = key(a), y = key(b);
      return sign * (x < y ? -1 : x > y ? 1 : 0);
    });
    sign = -sign;
    body.append(...sorted);
  });
});
show(FIRST);
"""


def save_html(path: Path, found: Comparison, cloud: PointCloud, title: str) -> None:
    """Writes the page.

    Parameters
    ----------
    path
        The file to write.
    found
        What `compare` found, with pictures.
    cloud
        The scan, for its picture.
    title
        What the page is called.

    Raises
    ------
    MissingDependencyError
        Without matplotlib.
    """
    check_pictures()
    drawn = path.with_suffix(".webp")
    draw_cloud(drawn, cloud)
    seen = drawn.read_bytes()
    drawn.unlink()
    first = next((row for row in found.best.values() if row is not None), None)
    number = 0 if first is None else found.rows.index(first)
    body = [_summary(found), _cards(found), _curves(found), _table(found)]
    body += [_pictures(found, seen, number), _notes(found)]
    shown = [
        {"name": row.name, "pictures": [_html.source(data) for data in row.pictures]}
        for row in found.rows
    ]
    # A slash in a string would end the script where it follows a bracket.
    rows = json.dumps(shown).replace("</", "<\\/")
    script = _SCRIPT.replace("ROWS", rows, 1).replace("FIRST", str(number), 1)
    path.write_text(_html.page(title, "\n".join(body), script if shown else ""), "utf-8")


def _summary(found: Comparison) -> str:
    colored = ", coloured" if found.has_color else ""
    return (
        f"<p>{found.n_points:,} points{colored}: {size(found.raw_bytes)} raw. "
        f"Spacing {small_text(found.spacing, found.unit)}, "
        f"noise {small_text(found.noise, found.unit)}. "
        "Every tool coded this cloud and is judged by what comes back from its bytes.</p>"
    )


def _cards(found: Comparison) -> str:
    cards = "".join(
        f"<div>{html.escape(aim)}<b>{html.escape(choice)}</b>"
        f'<span class="small">{html.escape(why)}</span></div>'
        for aim, choice, why in advice(found)
    )
    return f'<h2>Which to take</h2><div class="cards">{cards}</div>'


def _table(found: Comparison) -> str:
    head = "".join(f"<th><button>{html.escape(name)}</button></th>" for name in header(found.unit))
    rows = "\n".join(
        f'<tr data-row="{number}"{" class=own" if row.ours else ""}>'
        f"{_html.cells(row_cells(row, found.unit))}</tr>"
        for number, row in enumerate(found.rows)
    )
    return (
        '<h2>All of them</h2><p class="small">Click a row for its pictures, a heading to sort. '
        "Ours are shaded.</p>"
        f'<div class="wide"><table id="rows"><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _pictures(found: Comparison, seen: bytes, number: int) -> str:
    if not found.rows:
        return ""
    pictures = found.rows[number].pictures or (b"", b"", b"")
    limit = small_text(found.resolution, found.unit)
    captions = (
        ("decoded", "decoded"),
        ("forward", f"decoded, by its distance to the input: black 0, bright {limit} and more"),
        ("backward", f"input, by its distance to the decoded: black 0, bright {limit} and more"),
    )
    figures = _html.picture(seen, "input") + "".join(
        _html.picture(data, caption, name)
        for data, (name, caption) in zip(pictures, captions, strict=True)
    )
    return (
        '<h2>Pictures: <span id="shown"></span></h2>'
        f'<div class="pictures">{figures}</div><div class="scale"></div>'
    )


def _notes(found: Comparison) -> str:
    lines = [
        "Errors are root mean squares over all points, none sampled: from decoded points to the "
        "input, and from the input to what was decoded; both are needed, as a cloud of one right "
        "point has no error in the first. Found is the share of the input within "
        f"{small_text(found.tolerance, found.unit)} of the decoded.",
        "Our models are decoded as a surface, in the middle of the scan's noise, and where they "
        "keep it as measured, with its thickness: the surface is nearer to the truth, the other to "
        "the scan.",
        "Bytes are all bytes. Seconds are those of all cores together. Memory is what a tool takes "
        "beside the cloud, in a process of its own.",
        "The bound is the largest distance that a point of the input can have by construction.",
    ]
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    parts = [f"<h2>How it was measured</h2><ul>{items}</ul>"]
    for heading, those in (("Not installed", found.missing), ("Failed", found.failed)):
        if those:
            rows = "".join(
                f"<li>{html.escape(name)}: {html.escape(why)}</li>" for name, why in those.items()
            )
            parts.append(f"<h2>{heading}</h2><ul>{rows}</ul>")
    return "\n".join(parts)


def _curves(found: Comparison) -> str:
    """Bytes against errors, a line per tool and way of decoding."""
    from matplotlib.figure import Figure

    if not found.rows:
        return ""
    factor, unit = small_lengths(found.unit)
    panels = [("rmse_forward", factor, f"decoded to input, {unit}")]
    panels += [("rmse_backward", factor, f"input to decoded, {unit}")]
    if any(row.color_rmse is not None for row in found.rows):
        panels.append(("color_rmse", 1.0, "colour, 0 to 255"))
    figure = Figure(figsize=(15, 6), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for place, (name, scale, label) in zip(axes, panels, strict=True):
        _panel(place, found.rows, name, scale)
        if name != "color_rmse":
            place.axhline(scale * found.error, color="black", linewidth=0.7, linestyle=":")
        place.set_ylabel(label)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize="small")
    return f'<h2>Bytes against error</h2><div class="plot">{_html.svg(figure)}</div>'


def _panel(axes: Axes, rows: tuple[Row, ...], name: str, scale: float) -> None:
    from matplotlib import colormaps

    groups: dict[tuple[str, str], list[tuple[int, float]]] = {}
    for row in rows:
        value = getattr(row, name)
        if value is not None and value > 0:
            groups.setdefault((row.label, row.kind), []).append((row.n_bytes, scale * value))
    labels = list(dict.fromkeys(row.label for row in rows))
    own = {row.label for row in rows if row.ours}
    for (label, kind), found in groups.items():
        hollow = kind == "surface"
        axes.plot(
            *zip(*sorted(found), strict=True),
            "--" if hollow else "-",
            marker="o" if label in own else "s",
            markersize=5,
            markerfacecolor="white" if hollow else None,
            color=colormaps["tab20"](labels.index(label) % 20),
            linewidth=1.6 if label in own else 0.9,
            label=label if kind == "points" else f"{label}, {kind}",
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("all bytes")
    axes.grid(alpha=0.3, which="both")
