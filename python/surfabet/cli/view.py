"""`surfabet view`: a map in one web page."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from surfabet._distance_field import distance_field
from surfabet.cli._files import check_output, read_cloud, refuse_cloud, whole_file
from surfabet.cli._format import bytes_text, print_json
from surfabet.cli._options import COMMON, READ_OPTIONS, Common, Flag, UsageError
from surfabet.files import from_bytes
from surfabet.view import address_of, check_page, page_of, temporary_page

_SUFFIXES = frozenset({".html", ".htm"})


def view(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    out: Path | None = None,
    against: Path | None = None,
    link: Flag = False,
    json: Flag = False,
    common: Common = COMMON,
) -> None:
    """Show a model in the web browser, as one page that needs no network.

    The page holds the model and all that shows it; it can be kept, sent and opened anywhere. Its
    points are decoded in the page, at any spacing.

        surfabet view room.sfb
        surfabet view room.sfb --out room.html
        surfabet view room.sfb --against room.ply

    Parameters
    ----------
    file
        The model file, of any method.
    out
        Write the page here, and do not open it; by default it is written to the folder for
        temporary files and opened.
    against
        Colour the map by its distance to this cloud, which is in the same frame: the scan, or one
        of another day. The page gets the distances, not the cloud.
    link
        With --out: leave the model in its file, from which the page reads what it shows, by a web
        server. For maps in tiles that are too large for a page.
    json
        Print one JSON object instead of a line.
    """
    refuse_cloud(file)
    if link and out is None:
        raise UsageError("--link: needs --out, a page to be served beside the model")
    if out is not None:
        check_output(out, _SUFFIXES, *(path for path in (file, against) if path is not None))
    data = file.read_bytes()
    check_page(data, file.name)
    field = b""
    if against is not None:
        with common.progress() as progress:
            cloud = read_cloud(against, READ_OPTIONS, progress)
        field = distance_field(from_bytes(data), cloud, against.name)
    page = temporary_page(file.name) if out is None else out
    address = address_of(file, page) if link else ""
    text = page_of(data, file.name, field, address).encode()
    n_bytes = len(text)
    with whole_file(page) as temporary:
        temporary.write_bytes(text)
    is_open = out is None and webbrowser.open(page.resolve().as_uri())
    if json:
        print_json({"path": str(file), "page": str(page), "bytes": n_bytes, "opened": is_open})
    elif not common.quiet:
        done = "opened in the browser" if is_open else "open it in a web browser"
        if link:
            done = f"serve it with {file.name} by a web server that gives ranges of files"
        print(f"{page}: {bytes_text(n_bytes)}; {done}")
