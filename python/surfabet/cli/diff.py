"""`surfabet diff`: what appeared and what vanished between two maps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

import surfabet
from surfabet.cli._files import (
    check_output,
    cloud_suffixes,
    holds_tiles,
    load_model,
    load_vocabulary,
)
from surfabet.cli._format import print_json
from surfabet.cli._options import (
    COMMON,
    VOCABULARY_OPTION,
    Box,
    Common,
    Flag,
    PositiveFloat,
    UsageError,
    VocabularyOption,
)


def diff(
    a: Annotated[Path, Parameter(name="A")],
    b: Annotated[Path, Parameter(name="B")],
    /,
    *,
    out: Path | None = None,
    tolerance: PositiveFloat = None,
    min_area: PositiveFloat = 0.05,
    viewpoints_a: Path | None = None,
    viewpoints_b: Path | None = None,
    box: Annotated[Box | None, Parameter(negative=())] = None,
    json: Flag = False,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    common: Common = COMMON,
) -> None:
    """List what appeared and what vanished between two maps of one frame.

    What one map has and the other has not counts where the other map looked: unseen is not
    vanished.

        surfabet diff monday.sfb friday.sfb
        surfabet diff monday.sfb friday.sfb --out changes.ply

    Parameters
    ----------
    a
        The map before.
    b
        The map after.
    out
        Write a cloud: grey for what is the same, green for what appeared, red for what vanished,
        blue for what the map before did not look at.
    tolerance
        Surfaces nearer than this are the same, metres; by default two pixels of patches.
    min_area
        Least surface of a change, square metres.
    viewpoints_a, viewpoints_b
        Where the sensors of a map stood: a text file of `X Y Z` in each line. By default a map
        looked at places between surfaces that face them.
    box
        Compare the maps in a box only, `X0 Y0 Z0 X1 Y1 Z1` in metres; both need tiles.
    json
        Print one JSON object instead of lines.
    """
    if out is not None:
        check_output(out, cloud_suffixes(), a, b)
    region = {} if box is None else {"box": (box[:3], box[3:])}
    for path in (a, b):
        if region and not holds_tiles(path):
            raise UsageError(f"--box: {path} has no tiles")
    sensors = (
        _positions(viewpoints_a, "--viewpoints-a"),
        _positions(viewpoints_b, "--viewpoints-b"),
    )
    with common.progress() as progress:
        words = load_vocabulary(vocabulary, progress)
        before, after = (load_model(path, progress, words, **region) for path in (a, b))
        found = surfabet.diff(
            before,
            after,
            tolerance=tolerance,
            min_area=0.05 if min_area is None else min_area,
            viewpoints=sensors,
            progress=progress,
        )
        if out is not None:
            progress(f"write {out.name}", 0.0)
            surfabet.write(out, found.cloud)
    if json:
        print_json(
            {
                "before": str(a),
                "after": str(b),
                "unit": found.unit,
                "tolerance": found.tolerance,
                "unseen": {"before": found.unseen[1], "after": found.unseen[0]},
                "changes": [
                    {
                        "kind": change.kind,
                        "box": change.box.tolist(),
                        "area": change.area,
                        "points": change.n_points,
                    }
                    for change in found
                ],
            }
        )
    elif not common.quiet:
        for change in found:
            low, high = (" ".join(f"{c:.2f}" for c in corner) for corner in change.box)
            print(f"{change.kind}: {low} to {high}, {change.area:.3f} {found.unit}2")
        kinds = [change.kind for change in found]
        of_before, of_after = (f"{area:.1f} {found.unit}2" for area in found.unseen[::-1])
        print(
            f"{kinds.count('appeared')} appeared, {kinds.count('vanished')} vanished; not looked "
            f"at: {of_before} before, {of_after} after"
        )


def _positions(path: Path | None, option: str) -> NDArray[np.float64] | None:
    """The positions in a text file."""
    if path is None:
        return None
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "No such file or directory"
        raise UsageError(f"{option} {path}: {what}; name a text file of X Y Z in each line")
    try:
        rows = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise UsageError(f"{option} {path}: needs three numbers in each line ({error})") from error
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise UsageError(f"{option} {path}: needs three numbers in each line")
    return rows
