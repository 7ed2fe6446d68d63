"""`surfabet verify`: proof that a model keeps the bound it was made with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet.cli._files import load_model, read_cloud
from surfabet.cli._format import millimetres, print_json
from surfabet.cli._options import (
    COMMON,
    READ_OPTIONS,
    Common,
    Flag,
    PositiveFloat,
    ReadOptions,
    UsageError,
)


def verify(
    input_: Annotated[Path, Parameter(name="IN")],
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    max_error: PositiveFloat = None,
    json: Flag = False,
    read: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> int:
    """Check that no point of a scan is further from its model than the model says.

    The file is decoded as measured at its default spacing, and the nearest decoded point of every
    point of the scan is found. Ends with 1 when one of them is further away than the bound.

        surfabet compress room.ply room.sfb --max-error 0.05
        surfabet verify room.ply room.sfb

    Parameters
    ----------
    input_
        The scan that the model was made from.
    file
        The model file.
    max_error
        The bound in metres, by default the one that the file was made with.
    json
        Print one JSON object instead of a line.
    """
    with common.progress() as progress:
        model = load_model(file, progress)
        if not isinstance(model, surfabet.PatchModel | surfabet.TiledPatchModel):
            raise UsageError(
                f"{file}: --model {model.method} keeps no bound, only --model patches does"
            )
        bound = max_error if max_error is not None else model.max_error
        if bound is None:
            raise UsageError(f"{file}: was made without --max-error; give a bound to check")
        cloud = read_cloud(input_, read, progress)
        decoded = model.decode(as_measured=True, progress=progress)
        quality = surfabet.evaluate(cloud, decoded, normal_neighbors=None, progress=progress)
    largest = quality.max_backward
    kept = largest <= bound
    if json:
        print_json({"path": str(file), "max_error": bound, "largest": largest, "kept": kept})
    elif not common.quiet:
        verdict = "kept" if kept else "NOT kept"
        print(
            f"{file}: the furthest of {len(cloud):,} points is {millimetres(largest)} from the "
            f"decoded cloud; the bound of {millimetres(bound)} is {verdict}"
        )
    return 0 if kept else 1
