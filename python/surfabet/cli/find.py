"""`surfabet find`: where else in a scene stands what an example shows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet._progress import ProgressCallback
from surfabet.cli._files import load_model, load_vocabulary
from surfabet.cli._find_options import FIND_OPTIONS, FindOptions
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
from surfabet.files import Vocabulary

Point = tuple[float, float, float]


def find(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    example: Annotated[list[Path] | None, Parameter(negative=(), consume_multiple=True)] = None,
    point: Annotated[Point | None, Parameter(negative=())] = None,
    radius: PositiveFloat = None,
    box: Annotated[Box | None, Parameter(negative=())] = None,
    shape_only: Flag = False,
    json: Flag = False,
    options: FindOptions = FIND_OPTIONS,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    common: Common = COMMON,
) -> None:
    """Find all places in a scene that look like an example: a part of it, or models of their own.

    The model must be of --model alphabet, and fine enough to show the thing: `surfabet compress` it
    with a sigma scale of 1 to 1.5.

        surfabet find room.sfb --point 1.2 0.4 0.5 --radius 0.5
        surfabet find room.sfb --box 0.9 0.1 0.02 1.5 0.7 1.0 --json
        surfabet find room.sfb --example library/*.sfb --shape-only

    Parameters
    ----------
    file
        The model file.
    example
        Models of the thing, each of points cut out of any scan; every place is given once, with the
        example that fits best.
    point
        Middle of a ball around the example, `X Y Z` in metres.
    radius
        Radius of the ball, metres.
    box
        Lowest and highest corner of a box around the example instead, `X0 Y0 Z0 X1 Y1 Z1`.
    shape_only
        Leave colours out of account: find things of one shape in any colour.
    json
        Print one JSON object instead of lines.
    """
    if (point is None) != (radius is None) or (box is not None and point is not None):
        raise UsageError("give either --point and --radius, or --box")
    if example is None and box is None and point is None:
        raise UsageError("give --example, or --point and --radius, or --box")
    if shape_only and options.color_tolerance is not None:
        raise UsageError("--shape-only leaves no use for --color-tolerance")
    given = options.given()
    if shape_only:
        given["color_tolerance"] = None
    with common.progress() as progress:
        known = load_vocabulary(vocabulary, progress)
        model = _alphabet(file, progress, known)
        examples = None
        if example is not None:
            examples = [_alphabet(path, progress, known) for path in example]
        found = model.find(
            examples,
            point=point,
            radius=radius,
            box=None if box is None else (box[:3], box[3:]),
            progress=progress,
            **given,
        )
    if json:
        places = [
            {
                "score": f.score,
                "center": f.center.tolist(),
                "pose": f.pose.tolist(),
                "sizes": list(f.sizes),
                "example": None if example is None else str(example[f.example]),
            }
            for f in found
        ]
        print_json({"path": str(file), "found": places})
    elif not common.quiet:
        print("score       x        y        z" + ("  example" if example else ""))
        for f in found:
            x, y, z = f.center
            of = f"  {example[f.example]}" if example else ""
            print(f"{f.score:.3f} {x:8.3f} {y:8.3f} {z:8.3f}{of}")


def _alphabet(
    path: Path, progress: ProgressCallback, known: Vocabulary | None
) -> surfabet.AlphabetModel:
    model = load_model(path, progress, known)
    if not isinstance(model, surfabet.AlphabetModel):
        raise UsageError(
            f"{path}: --model {model.method} has no words to search by, only --model alphabet has; "
            "surfabet compress --model alphabet makes one of the scan"
        )
    return model
