"""`surfabet merge`: maps in tiles as one."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet._progress import ProgressCallback
from surfabet.cli._files import MODEL_SUFFIX, check_output, size_on_disk
from surfabet.cli._format import points_text
from surfabet.cli._maps import load_tiled, tell_map
from surfabet.cli._options import COMMON, Common, Flag, UsageError


def merge(
    *maps: Annotated[Path, Parameter(name="MAP")],
    out: Path | None = None,
    json: Flag = False,
    common: Common = COMMON,
) -> None:
    """Put maps in tiles of one plan together.

    A tile that one map has keeps its bytes. Where tiles of several differ, one is learned from what
    they hold, so that nothing is stored twice. Maps of one plan come from one map that was added
    to, with surfabet append.

        surfabet append map.sfb east.ply --alone --out east.sfb
        surfabet append map.sfb west.ply --alone --out west.sfb
        surfabet merge map.sfb east.sfb west.sfb --out all.sfb

    Parameters
    ----------
    maps
        The maps.
    out
        The map to write; it must be given.
    json
        Print one JSON object instead of a line.
    """
    if len(maps) < 2:
        raise UsageError("MAP: give two maps or more")
    if out is None:
        raise UsageError("--out: is required; name the map to write")
    check_output(out, frozenset({MODEL_SUFFIX}))
    started = time.perf_counter()
    with common.progress() as progress:
        models = [load_tiled(path, progress) for path in maps]
        # Before the map is written, which may be one of these.
        inputs = [{"path": str(path), "bytes": size_on_disk(path)} for path in maps]
        merged = _merged(maps, models, progress)
        n_bytes = merged.save(out)
    points = points_text(merged.n_points)
    saved = (out, merged, n_bytes)
    tell_map(saved, {"inputs": inputs}, points, started, json=json, quiet=common.quiet)


def _merged(
    maps: tuple[Path, ...], models: list[surfabet.TiledPatchModel], progress: ProgressCallback
) -> surfabet.TiledPatchModel:
    """The maps as one; where they do not fit together, they are called by their files."""
    try:
        return surfabet.merge_tiles(models, progress=progress)
    except surfabet.InvalidInputError as error:
        if error.argument != "models":
            raise
        names = ", ".join(map(str, maps))
        raise UsageError(
            f"{names}: are {error.value}; only maps of one plan are merged: add the scan of one to "
            "the other with surfabet append"
        ) from error
