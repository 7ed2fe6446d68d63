"""`surfabet info`: what is in a model file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

import surfabet
from surfabet.cli._files import (
    check_output,
    load_model,
    load_vocabulary,
    size_on_disk,
    whole_file,
)
from surfabet.cli._format import bytes_text, print_json
from surfabet.cli._options import (
    COMMON,
    VOCABULARY_OPTION,
    Common,
    Flag,
    UsageError,
    VocabularyOption,
)
from surfabet.files import AnyModel


def info(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    picture: Path | None = None,
    json: Flag = False,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    common: Common = COMMON,
) -> None:
    """Show what a model file holds: method, sizes, and bytes by part.

    A file that names a vocabulary instead of holding it shows its sizes only with --vocabulary.

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
    found = surfabet.inspect(file)
    with common.progress() as progress:
        words = load_vocabulary(vocabulary, progress)
        model = None
        if found.vocabulary is None or words is not None:
            model = load_model(file, progress, words)
    if picture is not None:
        _draw(file, picture, model)
    n_bytes = size_on_disk(file)
    if json:
        known = {} if model is None else {"n_points": model.n_points, "info": model.info}
        print_json({"path": str(file), "bytes": n_bytes, **found.as_dict(), **known})
        return
    if common.quiet:
        return
    console = Console(highlight=False, soft_wrap=True)
    made_from = f"made from {model.n_points:,} points, " if model else ""
    console.print(
        f"{file}: {found.method}, {bytes_text(n_bytes)}, {made_from}"
        f"read by surfabet {found.version} and newer",
        markup=False,
    )
    if found.vocabulary is not None:
        console.print(f"The file names a vocabulary by its hash: {found.vocabulary}", markup=False)
    if model:
        sizes = Table("content", "value", box=None, header_style="bold")
        for name, value in model.info.items():
            sizes.add_row(name, f"{value:.6g}" if isinstance(value, float) else str(value))
        console.print(sizes)
    parts = Table("part", "bytes", "share", box=None, header_style="bold")
    for column in parts.columns[1:]:
        column.justify = "right"
    # What no section holds is the file's own frame: magic, table of sections, checksums.
    frame = n_bytes - sum(found.sections.values())
    for name, part in [*found.sections.items(), ("frame of the file", frame)]:
        parts.add_row(name, f"{part:,}", f"{part / n_bytes:.1%}")
    console.print(parts)


def _draw(file: Path, picture: Path, model: AnyModel | None) -> None:
    from surfabet import report

    check_output(picture, report.PICTURE_SUFFIXES, file)
    if not isinstance(model, surfabet.AlphabetModel):
        raise UsageError(f"--picture: {file} has no words to draw")
    with whole_file(picture) as temporary:
        report.draw_words(temporary, model)
