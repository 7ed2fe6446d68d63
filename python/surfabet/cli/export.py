"""`surfabet export`: the surfaces of a model for other programs."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet.cli._files import check_output, load_model, size_on_disk
from surfabet.cli._format import bytes_text, print_json
from surfabet.cli._options import COMMON, Common, Flag, UsageError
from surfabet.io.polygons import EXPORTS


def export(
    input_: Annotated[Path, Parameter(name="IN")],
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    json: Flag = False,
    common: Common = COMMON,
) -> None:
    """Write the planes of a model as a mesh or as polygons, in world coordinates.

        surfabet export room.sfb walls.ply
        surfabet export room.sfb walls.dxf

    Parameters
    ----------
    input_
        The model file, of --model planes.
    output
        The file to write; its name tells the format: ply (triangles), obj (an object per plane),
        dxf (a layer per plane).
    json
        Print one JSON object instead of a line.
    """
    check_output(output, frozenset(EXPORTS), input_)
    started = time.perf_counter()
    with common.progress() as progress:
        model = load_model(input_, progress)
        if not isinstance(model, surfabet.PlaneModel):
            raise UsageError(f"{input_}: only --model planes has planes to export")
        progress(f"write {output.name}", 0.0)
        n_bytes = model.export(output)
    seconds = time.perf_counter() - started
    if json:
        print_json(
            {
                "input": {"path": str(input_), "bytes": size_on_disk(input_)},
                "output": {"path": str(output), "bytes": n_bytes, "planes": len(model)},
                "seconds": seconds,
            }
        )
    elif not common.quiet:
        print(f"{output}: {len(model):,} planes, {bytes_text(n_bytes)}, {seconds:.1f} s")
