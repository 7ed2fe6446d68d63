"""`surfabet verify`: proof that a model keeps the bound it was made with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import surfabet
from surfabet.cli._files import load_model, read_cloud
from surfabet.cli._format import print_json, unequal_texts
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
    max_error_forward: PositiveFloat = None,
    json: Flag = False,
    read: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> int:
    """Check that model and scan are no further apart than the model says.

    The file is decoded as measured at its default spacing, and the nearest decoded point of every
    point of the scan is found; for the bound forward, the nearest point of the scan of every
    decoded point, as measured and as a surface. Ends with 1 when one is further away than its
    bound.

        surfabet compress room.ply room.sfb --max-error 0.05
        surfabet verify room.ply room.sfb

    Parameters
    ----------
    input_
        The scan that the model was made from.
    file
        The model file.
    max_error
        The bound on points of the scan in metres, by default the one that the file was made with.
    max_error_forward
        The bound on decoded points in metres, by default the one that the file was made with.
    json
        Print one JSON object instead of a line.
    """
    with common.progress() as progress:
        model = load_model(file, progress)
        if not isinstance(model, surfabet.PatchModel | surfabet.TiledPatchModel):
            raise UsageError(
                f"{file}: --model {model.method} keeps no bound, only --model patches does"
            )
        bound = max_error or model.max_error
        forward = max_error_forward or model.max_error_forward
        if bound is None and forward is None:
            raise UsageError(
                f"{file}: was made without --max-error and --max-error-forward; "
                "give a bound to check"
            )
        cloud = read_cloud(input_, read, progress)

        def compare(as_measured: bool) -> surfabet.Quality:
            decoded = model.decode(as_measured=as_measured, progress=progress)
            return surfabet.evaluate(cloud, decoded, normal_neighbors=None, progress=progress)

        measured = compare(True)
        unit = measured.unit
        largest = measured.max_backward
        largest_forward = measured.max_forward
        if forward is not None:
            largest_forward = max(largest_forward, compare(False).max_forward)
    checks = [
        (bound, largest, f"the furthest of {len(cloud):,} points is", "from the decoded cloud"),
        (forward, largest_forward, "the furthest decoded point is", "from the scan"),
    ]
    kept = all(limit is None or found <= limit for limit, found, _, _ in checks)
    if json:
        row: dict[str, Any] = {"max_error": bound, "largest": largest, "max_error_forward": forward}
        row |= {"largest_forward": largest_forward, "kept": kept, "unit": unit}
        print_json({"path": str(file)} | row)
    elif not common.quiet:
        for limit, found, what, where in checks:
            if limit is not None:
                verdict = "kept" if found <= limit else "NOT kept"
                furthest, allowed = unequal_texts(found, limit, unit)
                print(f"{file}: {what} {furthest} {where}; the bound of {allowed} is {verdict}")
    return 0 if kept else 1
