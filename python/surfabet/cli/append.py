"""`surfabet append`: another scan for a map in tiles."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet.cli._files import MODEL_SUFFIX, check_output, read_cloud, size_on_disk
from surfabet.cli._format import bytes_text
from surfabet.cli._maps import load_tiled, tell_map
from surfabet.cli._options import COMMON, READ_OPTIONS, Common, Flag, ReadOptions, UsageError
from surfabet.io._files import is_same_file


def append(
    map_: Annotated[Path, Parameter(name="MAP")],
    scan: Annotated[Path, Parameter(name="SCAN")],
    /,
    *,
    out: Path | None = None,
    alone: Flag = False,
    json: Flag = False,
    options: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Add another scan of the same world to a map in tiles.

    Tiles that no point of the scan lies in keep their bytes; the others are learned from the scan
    and from what the map holds there. The file is replaced when the new one is complete.

        surfabet append map.sfb tuesday.ply
        surfabet append map.sfb tuesday.ply --out both.sfb

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
    json
        Print one JSON object instead of a line.
    """
    output = map_ if out is None else out
    if alone and (out is None or is_same_file(out, map_)):
        raise UsageError("--alone: needs --out with another file, since the map would be replaced")
    check_output(output, frozenset({MODEL_SUFFIX}), scan)
    started = time.perf_counter()
    with common.progress() as progress:
        model = load_tiled(map_, progress)
        before = size_on_disk(map_)
        cloud = read_cloud(scan, options, progress)
        updated = model.update(cloud, alone=alone, progress=progress)
        note = surfabet.inspect(map_).note
        n_bytes = updated.save(output, note=note or "")
    tell_map(
        (output, updated, n_bytes),
        {
            "map": {"path": str(map_), "bytes": before, "tiles": len(model.tiles)},
            "scan": {"path": str(scan), "points": len(cloud)},
        },
        f"{len(cloud):,} points more than in {bytes_text(before)} before",
        started,
        json=json,
        quiet=common.quiet,
    )
