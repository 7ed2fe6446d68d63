"""`surfabet recurring`: what occurs in a scene again and again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet.cli._files import check_output, load_model, load_vocabulary, whole_file
from surfabet.cli._format import print_json
from surfabet.cli._options import (
    COMMON,
    VOCABULARY_OPTION,
    Common,
    Flag,
    UsageError,
    VocabularyOption,
)
from surfabet.cli._recurring_options import RECURRING_OPTIONS, RecurringOptions


def recurring(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    picture: Path | None = None,
    json: Flag = False,
    options: RecurringOptions = RECURRING_OPTIONS,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    common: Common = COMMON,
) -> None:
    """Find classes of things that occur in a scene again and again, without an example.

    The model must be of --model alphabet, and fine enough to show the things: `surfabet compress`
    it with a sigma scale of 1 to 1.5.

        surfabet recurring room.sfb --picture classes.png
        surfabet recurring room.sfb --min-count 4 --json

    Parameters
    ----------
    file
        The model file.
    picture
        A picture (png, svg or pdf) with a row per class.
    json
        Print one JSON object instead of lines.
    """
    if picture is not None:
        check_output(picture, frozenset({".png", ".svg", ".pdf"}), file)
    with common.progress() as progress:
        model = load_model(file, progress, load_vocabulary(vocabulary, progress))
        if not isinstance(model, surfabet.AlphabetModel):
            raise UsageError(
                f"{file}: --model {model.method} has no words that recur, only --model alphabet "
                "has; surfabet compress --model alphabet makes one of the scan"
            )
        classes = surfabet.recurring(model, progress=progress, **options.given())
    if picture is not None:
        with whole_file(picture) as temporary:
            classes.draw(temporary)
    if json:
        rows = [
            {
                "box": [corner.tolist() for corner in of_class.box],
                "places": [
                    {
                        "score": place.score,
                        "center": place.center.tolist(),
                        "pose": place.pose.tolist(),
                        "occurrences": rows.tolist(),
                    }
                    for place, rows in zip(of_class.places, of_class.occurrences, strict=True)
                ],
            }
            for of_class in classes
        ]
        print_json({"path": str(file), "classes": rows})
    elif not common.quiet:
        print("class  times      size       x        y        z")
        for k, of_class in enumerate(classes):
            low, high = of_class.box
            x, y, z = 0.5 * (low + high)
            size = float(((high - low) ** 2).sum() ** 0.5)
            print(f"{k:5d} {len(of_class):6d} {size:9.2f} {x:8.3f} {y:8.3f} {z:8.3f}")
