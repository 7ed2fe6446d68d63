"""`surfabet decompress`: model file in, cloud out."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number

import surfabet
from surfabet._progress import ProgressCallback
from surfabet.cli._files import (
    check_output,
    cloud_suffixes,
    holds_tiles,
    load_model,
    load_vocabulary,
    size_on_disk,
)
from surfabet.cli._format import bytes_text, points_text, print_json
from surfabet.cli._numbers import WHOLE
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
from surfabet.files import AnyModel, Vocabulary


def decompress(
    input_: Annotated[Path, Parameter(name="IN")],
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    resolution: PositiveFloat = None,
    as_measured: Flag = False,
    box: Annotated[Box | None, Parameter(negative=())] = None,
    level: Annotated[int | None, Parameter(validator=Number(gte=0)), WHOLE] = None,
    json: Flag = False,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    common: Common = COMMON,
) -> None:
    """Make a point cloud of a model file.

        surfabet decompress room.sfb room.ply
        surfabet decompress room.sfb fine.laz --resolution 0.005
        surfabet decompress room.sfb thick.ply --as-measured
        surfabet decompress map.sfb part.ply --box 0 0 -1 20 20 3

    Parameters
    ----------
    input_
        The model file.
    output
        The cloud to write; its name tells the format: ply, pcd, las, laz, e57, npz, xyz.
    resolution
        Spacing of the points in metres, by default half a pixel of patches, sigma of words, and
        half the grid size of planes.
    as_measured
        Fill the thickness that the scan had, instead of giving the thin surface in its middle.
    box
        Give only what is in a box, `X0 Y0 Z0 X1 Y1 Z1` in metres; of a map in tiles only those that
        meet it are read.
    level
        Level of detail of a map in tiles, 0 the coarsest; by default the finest.
    json
        Print one JSON object instead of a line.
    """
    check_output(output, cloud_suffixes(), input_)
    seconds: dict[str, float] = {}
    with common.progress() as progress:
        started = time.perf_counter()
        region = None if box is None else (box[:3], box[3:])
        tiled = {"box": region, "level": level} if holds_tiles(input_) else {}
        if level is not None and not tiled:
            raise UsageError(f"--level: {input_} has no tiles")
        words = load_vocabulary(vocabulary, progress)
        model = _loaded(input_, progress, words, tiled)
        cloud = model.decode(resolution, as_measured=as_measured, box=region, progress=progress)
        seconds["decode"] = time.perf_counter() - started
        if box is not None and not len(cloud):
            corners = " ".join(f"{c:g}" for c in box)
            raise UsageError(
                f"--box {corners}: no point of {input_} lies in it; surfabet info {input_} shows "
                "where its points are"
            )

        started = time.perf_counter()
        progress(f"write {output.name}", 0.0)
        surfabet.write(output, cloud)
        seconds["write"] = time.perf_counter() - started

    n_bytes = size_on_disk(output)
    if json:
        print_json(
            {
                "input": {"path": str(input_), "bytes": size_on_disk(input_)},
                "output": {"path": str(output), "bytes": n_bytes, "points": len(cloud)},
                "seconds": seconds,
            }
        )
    elif not common.quiet:
        print(
            f"{output}: {points_text(len(cloud))}, {bytes_text(n_bytes)}, "
            f"{sum(seconds.values()):.1f} s"
        )


def _loaded(
    path: Path, progress: ProgressCallback, words: Vocabulary | None, tiled: dict[str, Any]
) -> AnyModel:
    """The model, or the part of one in tiles."""
    try:
        return load_model(path, progress, words, **tiled)
    except surfabet.InvalidInputError as error:
        if error.argument != "level" or not (error.requirement or "").startswith("from 0 to 0"):
            raise
        raise UsageError(
            f"--level {error.value}: {path} has one level of detail, 0, which is decoded anyway; "
            "surfabet compress --details makes maps of several"
        ) from error
