"""OBJ: the vertices of a mesh as points, with the colours that many tools write behind them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from surfabet._core import PointCloud
from surfabet.io._columns import Column, cloud_from_columns
from surfabet.io._files import Lines, format_error
from surfabet.io._notes import Notes
from surfabet.io._tables import parse_rows

_KEYWORDS = frozenset(
    b"v vt vn vp f l p o g s mg usemtl mtllib maplib usemap lod bevel c_interp d_interp shadow_obj "
    b"trace_obj ctech stech cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con "
    b"call csh".split()
)
# What a vertex may have, by the number of its values.
_VERTEX = {
    3: ("x", "y", "z"),
    4: ("x", "y", "z", "w"),
    6: ("x", "y", "z", "red", "green", "blue"),
    7: ("x", "y", "z", "red", "green", "blue", "alpha"),
}
_NORMAL = ("nx", "ny", "nz")


class _Body:
    """The statements of a file: rows of vertices and normals, and the number of all others."""

    def __init__(self, lines: Lines) -> None:
        self.lines = lines
        self.normals: list[str] = []
        self.counts: Counter[bytes] = Counter()
        # Whether every corner of a face has the normal of the same number as its vertex.
        self.paired = True

    def _statements(self) -> Iterator[list[bytes]]:
        words: list[bytes] = []
        while (line := self.lines.next()) is not None:
            words += line.partition(b"#")[0].split()
            if words and words[-1] == b"\\":
                words.pop()
                continue
            if words:
                yield words
            words = []

    def vertices(self) -> Iterator[str]:
        """The values of each vertex; takes note of all else that comes by."""
        for keyword, *values in self._statements():
            if keyword not in _KEYWORDS:
                raise format_error(
                    self.lines.path,
                    f"unknown statement {keyword.decode('latin-1')!r:.40} of OBJ",
                    line=self.lines.number,
                )
            self.counts[keyword] += 1
            if keyword == b"v":
                yield b" ".join(values).decode("latin-1")
            elif keyword == b"vn":
                self.normals.append(b" ".join(values).decode("latin-1"))
            elif keyword == b"f" and self.paired:
                corners = (word.split(b"/") for word in values)
                self.paired = all(len(c) < 3 or c[0] == c[2] for c in corners)


def _vertices(body: _Body) -> dict[str, Column]:
    """The columns of the vertices, which all must have the same number of values."""
    rows = body.vertices()
    first = next(rows, None)
    if first is None:
        raise format_error(body.lines.path, "no vertices (lines that begin with v)")
    n_values = len(first.split())
    if n_values not in _VERTEX:
        raise format_error(
            body.lines.path,
            f"a vertex has {n_values} values; known are 3 (x y z), 4 (and w), 6 (and red green "
            "blue) and 7 (and alpha)",
            line=body.lines.number,
        )

    def all_rows() -> Iterator[str]:
        yield first
        yield from rows

    table = parse_rows(body.lines, all_rows(), n_values)
    return dict(zip(_VERTEX[n_values], table.T, strict=True))


def read_obj(path: Path) -> PointCloud:
    """Reads the vertices of an OBJ file.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    PointCloud
        Positions; colours, where three values from 0 to 1 or to 255 follow each position; and
        normals, where the file has one for each vertex, in the same order.

    Raises
    ------
    FormatError
        The file is not OBJ, has no vertices, or these differ in their number of values.

    Warns
    -----
    DroppedPointsWarning
        Points are not finite, or are no returns (exactly 0 0 0).
    LostAttributeWarning
        The file has faces, texture coordinates, normals that do not belong to single vertices, or
        other statements, which are left aside; the message counts them.
    """
    notes = Notes(path)
    with path.open("rb") as file:
        body = _Body(Lines(path, file))
        columns = _vertices(body)
        n_vertices = len(columns["x"])
        has_normals = len(body.normals) == n_vertices and body.paired
        if has_normals:
            table = parse_rows(body.lines, iter(body.normals), len(_NORMAL))
            columns |= dict(zip(_NORMAL, table.T, strict=True))
    weights = columns.pop("w", None)
    if weights is not None and (weights != 1).any():
        notes.aside("w of vertices")
    names = {b"f": "faces", b"vn": "normals", b"vt": "texture coordinates", b"l": "lines"}
    for keyword, count in body.counts.items():
        if keyword == b"v" or (keyword == b"vn" and has_normals):
            continue
        notes.aside(f"{names.get(keyword, keyword.decode())} ({count:,})")
    return cloud_from_columns(path, columns, notes=notes)
