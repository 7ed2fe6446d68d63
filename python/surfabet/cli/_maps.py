"""What `surfabet append` and `surfabet merge` share: maps in tiles in and out."""

from __future__ import annotations

import time
from pathlib import Path

import surfabet
from surfabet._progress import ProgressCallback
from surfabet.cli._files import load_model
from surfabet.cli._format import bytes_text, print_json
from surfabet.cli._options import UsageError


def load_tiled(path: Path, progress: ProgressCallback) -> surfabet.TiledPatchModel:
    """The map in tiles of a file."""
    model = load_model(path, progress)
    if not isinstance(model, surfabet.TiledPatchModel):
        raise UsageError(f"{path}: has no tiles; surfabet compress --tile makes a map of them")
    return model


def tell_map(
    saved: tuple[Path, surfabet.TiledPatchModel, int],
    inputs: dict[str, object],
    points: str,
    started: float,
    *,
    json: bool,
    quiet: bool,
) -> None:
    """Prints of a map with the path and the bytes that it was saved to one JSON object with the
    `inputs`, or a line with the `points`."""
    path, model, n_bytes = saved
    n_tiles, seconds = len(model.tiles), time.perf_counter() - started
    if json:
        output = {"path": str(path), "bytes": n_bytes, "tiles": n_tiles}
        print_json({**inputs, "output": output, "seconds": seconds})
    elif not quiet:
        tiles = "1 tile" if n_tiles == 1 else f"{n_tiles} tiles"
        print(f"{path}: {points}, {tiles}, {bytes_text(n_bytes)}, {seconds:.1f} s")
