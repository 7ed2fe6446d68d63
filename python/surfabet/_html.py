"""Pages that need nothing but themselves: no network, no other file."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["cells", "page", "picture", "svg", "table"]

_STYLE = """
:root { color-scheme: light dark; --line: #8884; --mark: #fb03; --own: #08f1; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 78rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 14px; }
th, td { padding: .25rem .6rem; border-bottom: 1px solid var(--line); text-align: right; }
th:first-child, td:first-child { text-align: left; }
#rows :is(th, td):nth-child(-n+3) { text-align: left; }
thead th { position: sticky; top: 0; background: Canvas; }
tr.own { background: var(--own); } tr.chosen { background: var(--mark); }
th button { all: unset; cursor: pointer; } th button:focus-visible { outline: 2px solid; }
tr[data-row] { cursor: pointer; }
.cards { display: flex; flex-wrap: wrap; gap: 1rem; }
.cards > div { flex: 1 1 18rem; border: 1px solid var(--line); border-radius: .5rem;
  padding: .6rem 1rem; }
.cards b { display: block; font-size: 1.1rem; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(18rem, 1fr)); gap: 1rem; }
figure { margin: 0; } figure img { width: 100%; background: #fff; }
.plot svg { width: 100%; height: auto; background: #fff; }
figcaption, .small { font-size: 13px; opacity: .85; }
.scale { height: .6rem; background: linear-gradient(90deg, #000004, #420a68, #932667, #dd513a,
  #fca50a, #fcffa4); }
"""


def page(title: str, body: str, script: str = "") -> str:
    """A whole page; `body` and `script` are trusted, the title is text."""
    head = (
        f'<meta charset="utf-8"><title>{html.escape(title)}</title>'
        '<meta name="viewport" content="width=device-width">'
        f"<style>{_STYLE}</style>"
    )
    code = f"<script>{script}</script>" if script else ""
    return (
        f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>\n'
        f"<h1>{html.escape(title)}</h1>\n{body}\n{code}</body></html>\n"
    )


def cells(values: Iterable[str], tag: str = "td") -> str:
    """Cells of a row, of text."""
    return "".join(f"<{tag}>{html.escape(value)}</{tag}>" for value in values)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A plain table of text."""
    body = "\n".join(f"<tr>{cells(row)}</tr>" for row in rows)
    return (
        f'<div class="wide"><table><thead><tr>{cells(header, "th")}</tr></thead>\n'
        f"<tbody>{body}</tbody></table></div>"
    )


def picture(data: bytes, caption: str, name: str = "") -> str:
    """A WebP picture with its caption, by which those who do not see it know it."""
    text = html.escape(caption)
    called = f' id="{html.escape(name)}"' if name else ""
    return (
        f'<figure{called}><img alt="{text}" src="{source(data)}">'
        f"<figcaption>{text}</figcaption></figure>"
    )


def source(data: bytes) -> str:
    """A WebP picture as an address."""
    return f"data:image/webp;base64,{base64.b64encode(data).decode('ascii')}"


def svg(figure: Figure) -> str:
    """A figure of matplotlib as an element of the page; text stays text."""
    from matplotlib import rc_context

    out = io.StringIO()
    # Names within the drawing follow from the salt and not from chance; no date either.
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "surfabet"}):
        figure.savefig(out, format="svg", metadata={"Date": None})
    drawn = out.getvalue()
    return drawn[drawn.index("<svg") :]
