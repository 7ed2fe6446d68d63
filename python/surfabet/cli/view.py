"""`surfabet view`: a map in one web page."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from surfabet.cli._files import check_output, whole_file
from surfabet.cli._format import bytes_text, print_json
from surfabet.cli._options import COMMON, Common, Flag, UsageError
from surfabet.view import temporary_page, write_page

_SUFFIXES = frozenset({".html", ".htm"})


def view(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    out: Path | None = None,
    json: Flag = False,
    common: Common = COMMON,
) -> None:
    """Show a model in the web browser, as one page that needs no network.

    The page holds the model and all that shows it; it can be kept, sent and opened anywhere. Its
    points are decoded in the page, at any spacing.

        surfabet view room.sfb
        surfabet view room.sfb --out room.html

    Parameters
    ----------
    file
        The model file, of any method.
    out
        Write the page here, and do not open it; by default it is written to the folder for
        temporary files and opened.
    json
        Print one JSON object instead of a line.
    """
    if file.is_dir():
        raise UsageError(f"{file}: is a folder; name the model file (.sfb) to show")
    data = file.read_bytes()
    page = temporary_page(file.name) if out is None else out
    if out is not None:
        check_output(out, _SUFFIXES, file)
    with whole_file(page) as temporary:
        n_bytes = write_page(data, temporary, file.name)
    is_open = out is None and webbrowser.open(page.resolve().as_uri())
    if json:
        print_json({"path": str(file), "page": str(page), "bytes": n_bytes, "opened": is_open})
    elif not common.quiet:
        done = "opened in the browser" if is_open else "open it in a web browser"
        print(f"{page}: {bytes_text(n_bytes)}; {done}")
