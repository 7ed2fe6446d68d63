"""`surfabet info`: what is in a model file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

import surfabet
from surfabet.cli._files import Shared, check_output, load_model, size_on_disk, whole_file
from surfabet.cli._format import bytes_text, print_json
from surfabet.cli._options import (
    COMMON,
    SHARED_OPTIONS,
    Common,
    Flag,
    SharedOptions,
    UsageError,
)


def info(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    picture: Path | None = None,
    json: Flag = False,
    shared: SharedOptions = SHARED_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Tell what a model file holds: family, options that made it, and bytes by part.

        surfabet info room.sfb
        surfabet info room.sfb --json

    Parameters
    ----------
    file
        The model file.
    picture
        Draw the words of an alphabet, with how often each occurs, into this file: png, jpg, pdf,
        svg or webp.
    json
        Print one JSON object instead of tables.
    """
    with common.progress() as progress:
        known = Shared.load(shared, progress)
    found = surfabet.inspect(file, dictionary=known.dictionary, alphabet=known.alphabet)
    if picture is not None:
        _draw(file, picture, known)
    n_bytes = size_on_disk(file)
    if json:
        print_json({"path": str(file), "bytes": n_bytes, **found.as_dict()})
        return
    if common.quiet:
        return
    console = Console(highlight=False, soft_wrap=True)
    console.print(
        f"{file}: {found.family}, {bytes_text(n_bytes)}, made from {found.n_points:,} points, "
        f"read by surfabet {found.version} and newer",
        markup=False,
    )
    options = Table("option", "value", box=None, header_style="bold")
    for name, value in found.options.items():
        options.add_row(name, str(value))
    console.print(options)
    parts = Table("part", "bytes", "share", box=None, header_style="bold")
    for column in parts.columns[1:]:
        column.justify = "right"
    # What no section holds is the file's own frame: magic, table of sections, checksums.
    frame = n_bytes - sum(found.sections.values())
    for name, part in [*found.sections.items(), ("frame of the file", frame)]:
        parts.add_row(name, f"{part:,}", f"{part / n_bytes:.1%}")
    console.print(parts)


def _draw(file: Path, picture: Path, known: Shared) -> None:
    from surfabet import report

    check_output(picture, report.PICTURE_SUFFIXES, file)
    model = load_model(file, lambda _stage, _fraction: None, known)
    if not isinstance(model, surfabet.AlphabetModel):
        raise UsageError(f"--picture: {file} has no words to draw")
    with whole_file(picture) as temporary:
        report.draw_words(temporary, model)
