"""`surfabet append`: another scan for a map in tiles."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from surfabet.cli._files import (
    MODEL_SUFFIX,
    check_output,
    read_cloud,
    refuse_model,
    size_on_disk,
)
from surfabet.cli._format import bytes_text, points_text
from surfabet.cli._maps import load_tiled, tell_map
from surfabet.cli._options import COMMON, READ_OPTIONS, Common, Flag, ReadOptions, UsageError
from surfabet.cli._tiles import memory_of, refuse_read_options
from surfabet.io._files import is_same_file


def append(
    map_: Annotated[Path, Parameter(name="MAP")],
    scan: Annotated[Path, Parameter(name="SCAN")],
    /,
    *,
    out: Path | None = None,
    alone: Flag = False,
    max_memory: str | None = None,
    work: Path | None = None,
    json: Flag = False,
    options: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Add another scan of the same world to a map in tiles.

    Tiles that no point of the scan lies in keep their bytes; the others are learned from the scan
    and from what the map holds there. The file is replaced when the new one is complete.

        surfabet append map.sfb tuesday.ply
        surfabet append map.sfb tuesday.ply --out both.sfb
        surfabet append map.sfb huge.laz --max-memory 2G

    Parameters
    ----------
    map_
        The map, made by surfabet compress with --tile or --max-memory.
    scan
        The scan, in the frame of the map: any cloud that surfabet reads.
    out
        Write the new map here and leave the old one as it is.
    alone
        Write only what the scan shows, to be put together with surfabet merge; needs --out.
    max_memory
        Read the scan in chunks and learn tile by tile with at most this memory: 2G, 500M. By
        default all points are in memory.
    work
        Folder for the points with --max-memory, by default that of temporary files.
    json
        Print one JSON object instead of a line.
    """
    output = map_ if out is None else out
    if alone and (out is None or is_same_file(out, map_)):
        raise UsageError("--alone: needs --out with another file, since the map would be replaced")
    if max_memory is None and work is not None:
        raise UsageError("--work: needs --max-memory")
    if max_memory is not None:
        refuse_read_options(options, "--max-memory")
    check_output(output, frozenset({MODEL_SUFFIX}), scan)
    started = time.perf_counter()
    with common.progress() as progress:
        model = load_tiled(map_, progress)
        before = size_on_disk(map_)
        if max_memory is None:
            cloud = read_cloud(scan, options, progress)
            updated = model.update(cloud, alone=alone, progress=progress)
            n_points = len(cloud)
        else:
            refuse_model(scan)
            updated = model.update(
                scan, alone=alone, max_memory=memory_of(max_memory), work=work, progress=progress
            )
            n_points = updated.n_points - (0 if alone else model.n_points)
        n_bytes = updated.save(output)
    tell_map(
        (output, updated, n_bytes),
        {
            "map": {"path": str(map_), "bytes": before, "tiles": len(model.tiles)},
            "scan": {"path": str(scan), "points": n_points},
        },
        f"{points_text(n_points)} added to a map of {bytes_text(before)}",
        started,
        json=json,
        quiet=common.quiet,
    )
