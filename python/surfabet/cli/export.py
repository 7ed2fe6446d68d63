"""`surfabet export`: the surface of a model for other programs."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet.cli._files import check_output, load_model, size_on_disk
from surfabet.cli._format import bytes_text, print_json
from surfabet.cli._options import COMMON, Common, Flag, UsageError
from surfabet.io.polygons import WRITERS
from surfabet.meshes import MESH_SUFFIXES

PARTS = {"patches": "patches", "planes": "planes", "gas": "neurons"}
"""What models that are exported consist of."""


def export(
    input_: Annotated[Path, Parameter(name="IN")],
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    json: Flag = False,
    common: Common = COMMON,
) -> None:
    """Write the surface of a model as a mesh with colours, or planes as polygons.

    Coordinates are the world's.

        surfabet export room.sfb room.glb
        surfabet export walls.sfb walls.ply
        surfabet export walls.sfb walls.dxf

    Parameters
    ----------
    input_
        The model file, of --model patches, planes or gas.
    output
        The file to write; its name tells the format: ply, obj or glb (glTF); of planes also dxf (a
        layer per plane).
    json
        Print one JSON object instead of a line.
    """
    check_output(output, MESH_SUFFIXES | frozenset(WRITERS), input_)
    started = time.perf_counter()
    with common.progress() as progress:
        model = load_model(input_, progress)
        if not isinstance(
            model,
            surfabet.PatchModel
            | surfabet.TiledPatchModel
            | surfabet.PlaneModel
            | surfabet.GasModel,
        ):
            raise UsageError(
                f"{input_}: --model {model.method} has no mesh to export; patches, planes and gas "
                "have"
            )
        if output.suffix.lower() == ".dxf" and not isinstance(model, surfabet.PlaneModel):
            raise UsageError(f"{output}: only --model planes is exported to dxf")
        progress(f"write {output.name}", 0.0)
        n_bytes = model.export(output)
    seconds = time.perf_counter() - started
    if json:
        print_json(
            {
                "input": {"path": str(input_), "bytes": size_on_disk(input_)},
                "output": {"path": str(output), "bytes": n_bytes, PARTS[model.method]: len(model)},
                "seconds": seconds,
            }
        )
    elif not common.quiet:
        print(
            f"{output}: {len(model):,} {PARTS[model.method]}, {bytes_text(n_bytes)}, "
            f"{seconds:.1f} s"
        )
