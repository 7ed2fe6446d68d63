"""A map in one web page: the model, its decoder, and a renderer; no network, no server."""

from __future__ import annotations

import base64
import html
import os
import re
import tempfile
import webbrowser
import zlib
from pathlib import Path
from typing import Any
from urllib.parse import quote

from surfabet import _core
from surfabet._checks import check_flag, check_text
from surfabet._core import PointCloud
from surfabet._distance_field import distance_field
from surfabet.errors import FormatError, InvalidInputError, wrong_type, wrong_value
from surfabet.files import MAX_BYTES, MAX_ITEMS, from_bytes
from surfabet.io import read
from surfabet.io._files import is_same_file, path_of
from surfabet.model import Model

__all__ = ["address_of", "check_page", "page_of", "temporary_page", "view"]

VIEWER = Path(__file__).parent / "viewer"
_IMPORT = re.compile(r"^import \{([^}]*)\} from \"(\.[^\"]+)\";\n", re.MULTILINE)
_EXPORT = re.compile(r"^export ((?:async )?function|class|const|let) (\w+)", re.MULTILINE)


def view(
    model: Model[Any] | str | os.PathLike[str],
    path: str | os.PathLike[str] | None = None,
    *,
    against: PointCloud | str | os.PathLike[str] | None = None,
    link: bool = False,
    open: bool | None = None,
    title: str | None = None,
) -> Path:
    """Writes a model as one web page that shows it, and opens it in the browser.

    The page holds the model's bytes, their decoder and a renderer; it needs no network and no
    server, works from a file and in an e-mail, and runs in any browser with WebGL2.

    Parameters
    ----------
    model
        A model of any method, or the name of its file.
    path
        The page to write, usually `.html`; by default a file in the folder for temporary files.
    against
        A second cloud in the frame of the model, or a file that `surfabet.read` reads: the page
        colours the map by its distance to it, such as to the scan or to a scan of another day. Only
        the distances are in the page, in at most 100,000 cells.
    link
        Do not put the model into the page, which reads it from its file through a web server: of a
        map in tiles only the tiles near the middle of the view. Needs the name of a file as
        `model`, and a `path`; the page finds the file by its place relative to it.
    open
        Open the page in the browser; by default when no `path` is given.
    title
        Name of the map, by default that of its file.

    Returns
    -------
    pathlib.Path
        The page.

    Raises
    ------
    OSError
        When a file cannot be read or written.
    FormatError
        When the file is damaged, or not a model.
    InvalidInputError
        For a model whose file names its vocabulary by a hash instead of holding it, and for an
        empty cloud.
    """
    if path is not None:
        path = path_of("path", path)
    if against is not None and not isinstance(against, PointCloud | str | os.PathLike):
        raise wrong_type("against", against, "a PointCloud or the path of a file with one")
    check_flag("link", link)
    if open is not None:
        check_flag("open", open)
    if title is not None:
        check_text("title", title)
    sources = [source for source in (model, against) if isinstance(source, str | os.PathLike)]
    if path is not None and any(is_same_file(source, path) for source in sources):
        raise wrong_value("path", str(path), "another file than those that are read")
    address = ""
    if isinstance(model, str | os.PathLike):
        data = Path(model).read_bytes()
        title = title or Path(model).name
        if link and path is not None:
            address = address_of(Path(model), Path(path))
    elif isinstance(model, Model):
        data = model.to_bytes()
        title = title or model.method
    else:
        raise wrong_type("model", model, "a model or the path of its file")
    if link and not address:
        raise wrong_value("link", link, "False without the names of a model file and of a page")
    check_page(data, title)
    field = b""
    if against is not None:
        if isinstance(against, PointCloud):
            field = distance_field(from_bytes(data), against, "the second cloud")
        else:
            field = distance_field(from_bytes(data), read(against), Path(against).name)
    page = temporary_page(title) if path is None else Path(path)
    page.write_text(page_of(data, title, field, address), "utf-8")
    if open if open is not None else path is None:
        webbrowser.open(page.resolve().as_uri())
    return page


def temporary_page(title: str) -> Path:
    """A new file for a page that nobody gave a name."""
    prefix = re.sub(r"\W+", "-", Path(title).stem) + "-"
    with tempfile.NamedTemporaryFile(prefix=prefix, suffix=".html", delete=False) as opened:
        return Path(opened.name)


def check_page(data: bytes, title: str) -> None:
    """Refuses bytes that are no model file, or one without its vocabulary."""
    try:
        _, _, vocabulary, _, _ = _core.inspect(data, max_items=MAX_ITEMS, max_bytes=MAX_BYTES)
    except FormatError as error:
        raise FormatError(f"{title}: {error}") from None
    if vocabulary is not None:
        raise InvalidInputError(
            f"{title} does not hold its vocabulary, but names that of another file ({vocabulary}): "
            "a page needs a model that holds it; learn the model without a given vocabulary",
            argument="model",
        )


def address_of(model: Path, page: Path) -> str:
    """Where a page finds the file of its model, as a URL relative to it."""
    return quote(Path(os.path.relpath(model, page.parent)).as_posix())


def page_of(data: bytes, title: str, field: bytes = b"", address: str = "") -> str:
    """The page of a model file's bytes, with a distance field or without; with an address it holds
    that in the place of the bytes."""
    folder = VIEWER / "page"
    worker = folder / ("linked_worker.js" if address else "worker.js")
    parts = {
        "title": html.escape(title),
        "style": _squeezed((folder / "style.css").read_text("utf-8")),
        "model": "" if address else base64.b64encode(data).decode(),
        "link": address,
        "against": base64.b64encode(field).decode(),
        "decoder": _packed(f"var surfabetWorker = {_bundle(worker)};"),
        "page": _packed(f"var surfabetPage = {_bundle(folder / 'app.js')};"),
    }
    page = (folder / "page.html").read_text("utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], page)


def _packed(source: str) -> str:
    return base64.b64encode(zlib.compress(source.encode(), 9)).decode()


def _bundle(entry: Path) -> str:
    """An expression that is what a module exports: it and all that it imports, a scope each."""
    order: list[Path] = []

    def visit(module: Path, above: tuple[Path, ...]) -> None:
        if module in above:
            raise ValueError(f"{module} imports itself")
        if module in order:
            return
        for _, name in _IMPORT.findall(module.read_text("utf-8")):
            visit((module.parent / name).resolve(), (*above, module))
        order.append(module)

    visit(entry.resolve(), ())
    names = {module: f"m{i}" for i, module in enumerate(order)}
    scopes = []
    for module in order:
        text = module.read_text("utf-8")

        def destructured(found: re.Match[str], folder: Path = module.parent) -> str:
            return f"const {{{found[1]}}} = {names[(folder / found[2]).resolve()]};\n"

        exported = ", ".join(name for _, name in _EXPORT.findall(text))
        body = _EXPORT.sub(r"\1 \2", _IMPORT.sub(destructured, text))
        body = f"const {names[module]} = (() => {{\n{body}\nreturn {{ {exported} }};\n}})();\n"
        scopes.append(_squeezed(body))
    return f'(() => {{\n"use strict";\n{"".join(scopes)}return {names[order[-1]]};\n}})()'


def _squeezed(text: str) -> str:
    """Without indentation, and without lines that hold nothing but a comment."""
    text = re.sub(r"^\s*/\*\*.*?\*/\s*$", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = (line.strip() for line in text.splitlines())
    return "".join(f"{line}\n" for line in lines if line and not line.startswith("//"))
