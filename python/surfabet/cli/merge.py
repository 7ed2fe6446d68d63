"""`surfabet merge`: maps in tiles as one."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet.cli._files import MODEL_SUFFIX, check_output, size_on_disk
from surfabet.cli._maps import load_tiled, tell_map
from surfabet.cli._options import COMMON, Common, Flag, UsageError


def merge(
    *maps: Annotated[Path, Parameter(name="MAP")],
    out: Path,
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
        The map to write.
    json
        Print one JSON object instead of a line.
    """
    if len(maps) < 2:
        raise UsageError("MAP: give two maps or more")
    check_output(out, frozenset({MODEL_SUFFIX}))
    started = time.perf_counter()
    with common.progress() as progress:
        models = [load_tiled(path, progress) for path in maps]
        # Before the map is written, which may be one of these.
        inputs = [{"path": str(path), "bytes": size_on_disk(path)} for path in maps]
        merged = surfabet.merge_tiles(models, progress=progress)
        n_bytes = merged.save(out)
    points = f"{merged.n_points:,} points"
    saved = (out, merged, n_bytes)
    tell_map(saved, {"inputs": inputs}, points, started, json=json, quiet=common.quiet)
