"""`surfabet evaluate`: how far two clouds lie apart, whoever made them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number
from rich.console import Console
from rich.table import Table

import surfabet
from surfabet.cli._files import (
    MODEL_SUFFIX,
    check_output,
    load_model,
    read_cloud,
    size_on_disk,
    whole_file,
)
from surfabet.cli._format import print_json
from surfabet.cli._options import COMMON, READ_OPTIONS, Common, Flag, ReadOptions


def evaluate(
    reference: Annotated[Path, Parameter(name="REFERENCE")],
    decoded: Annotated[Path, Parameter(name="DECODED")],
    /,
    *,
    sigma: Annotated[float | None, Parameter(validator=Number(gt=0))] = None,
    picture: Path | None = None,
    json: Flag = False,
    read: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Measure how far a decoded cloud lies from the original, both ways.

        surfabet evaluate room.ply again.ply
        surfabet evaluate room.ply room.sfb --picture room.png
        surfabet evaluate room.ply draco.ply --json

    Parameters
    ----------
    reference
        The original: any readable cloud or a folder of RGB-D frames.
    decoded
        The cloud to judge, from any codec; a model file is decoded, and then its bytes are counted
        too.
    sigma
        Distance in metres within which a point counts as found; by default the expected depth error
        where the original knows its ranges.
    picture
        Draw both clouds and the histogram of errors into this file: png, jpg, pdf, svg or webp.
    json
        Print one JSON object instead of a table.
    """
    if picture is not None:
        from surfabet import report

        check_output(picture, report.PICTURE_SUFFIXES, reference, decoded)
    with common.progress() as progress:
        original = read_cloud(reference, read, progress)
        n_bytes = None
        if decoded.suffix.lower() == MODEL_SUFFIX:
            n_bytes = size_on_disk(decoded)
            judged = load_model(decoded, progress).decode(progress=progress)
        else:
            judged = read_cloud(decoded, READ_OPTIONS, progress)
        quality = surfabet.evaluate(original, judged, sigma=sigma, bytes=n_bytes, progress=progress)
        if picture is not None:
            progress("draw the picture", 0.0)
            with whole_file(picture) as temporary:
                report.draw_comparison(temporary, original, judged, quality)
    if json:
        print_json({"reference": str(reference), "decoded": str(decoded), **quality.as_dict()})
    elif not common.quiet:
        _print_table(quality)


def _print_table(quality: surfabet.Quality) -> None:
    table = Table("measure", "value", box=None, header_style="bold")
    for name, value in quality.as_dict().items():
        table.add_row(name, str(value))
    Console(highlight=False).print(table)
