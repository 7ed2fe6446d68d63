"""`surfabet compare`: models of all methods beside other tools, on a scan of the user's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

import surfabet
from surfabet import comparison
from surfabet.cli._files import HTML_SUFFIXES, check_output, read_cloud, whole_file
from surfabet.cli._format import Output, bytes_text, print_json
from surfabet.cli._options import (
    COMMON,
    POSITIVE,
    READ_OPTIONS,
    Common,
    Flag,
    PositiveFloat,
    ReadOptions,
    UsageError,
)

_WIDTH = 250
"""Of the table, characters; more than it takes."""


def compare(
    input_: Annotated[Path, Parameter(name="IN")],
    /,
    *,
    html: Path | None = None,
    json: Flag = False,
    error: Annotated[float, Parameter(validator=POSITIVE)] = 0.01,
    max_error: PositiveFloat = None,
    tools: str | None = None,
    voxel: PositiveFloat = None,
    read: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Compare all models, and other tools that are installed, on a scan of yours.

    Each model is learned at its defaults and three qualities; patches with a bound, too. Beside
    them stand Draco, LAZ, OctoMap, a voxel grid with zstd, the planes of Open3D and G-PCC (`tmc3`),
    as far as they are installed, at grids of half, one and two times the resolution that the scan
    asks for. All are judged by what comes back from their bytes. At the end stand the rows to take:
    the smallest under an error, the smallest with a bound, and planes only.

        surfabet compare room.ply
        surfabet compare room.ply --html report.html
        surfabet compare room.ply --tools patches,draco,laz --error 0.005
        surfabet compare frames/ --voxel 0.005 --json

    Parameters
    ----------
    input_
        The scan: any readable cloud, or a folder of RGB-D frames.
    html
        Write one page with curves, the table, and pictures of every row into this file.
    json
        Print one JSON object instead of a table.
    error
        The rmse in both directions, in the unit of the scan, that the smallest file and the planes
        are to keep.
    max_error
        The distance that no point of the scan may be beyond; by default five times
        --error.
    tools
        Which tools, with commas between them: patches, hscsm, alphabet, bic-alphabet, planes, gas,
        draco, laz, copc, octomap, voxel-zstd, open3d-planes, gpcc. By default all.
    voxel
        First thin the scan to one mean point per voxel of this side: scans of many
        millions of points take long. Every tool then codes, and is judged by, this cloud.
    """
    chosen = comparison.TOOLS if tools is None else tuple(_names(tools))
    if html is not None:
        from surfabet.report import check_pictures

        check_output(html, HTML_SUFFIXES, input_)
        check_pictures()
    with common.progress() as progress:
        cloud = read_cloud(input_, read, progress)
        if voxel is not None:
            cloud = surfabet.voxel_downsample(cloud, voxel)
        found = comparison.compare(
            cloud,
            tools=chosen,
            error=error,
            max_error=max_error,
            pictures=html is not None,
            progress=progress,
        )
        if html is not None:
            from surfabet.comparison.html import save_html

            progress(f"write {html.name}", 0.99)
            with whole_file(html) as temporary:
                save_html(temporary, found, cloud, f"{input_.name}: surfabet beside other tools")
    if json:
        print_json({"path": str(input_), "voxel": voxel, **found.as_dict()})
    elif not common.quiet:
        _print(found)


def _names(tools: str) -> list[str]:
    names = [name.strip() for name in tools.split(",") if name.strip()]
    for name in names:
        if name not in comparison.TOOLS:
            raise UsageError(f"--tools: there is no {name}; give {', '.join(comparison.TOOLS)}")
    if not names:
        raise UsageError(f"--tools: is empty; give {', '.join(comparison.TOOLS)}")
    return names


def _print(found: comparison.Comparison) -> None:
    from surfabet.comparison.words import advice, header, row_cells

    # Rows are whole wherever they go; a narrow terminal breaks them, and a pager does not.
    console = Output(highlight=False, soft_wrap=True, markup=False, width=_WIDTH)
    colored = ", coloured" if found.has_color else ""
    console.print(
        f"{found.n_points:,} points{colored}, {bytes_text(found.raw_bytes)} raw; errors are rmse, "
        "from the decoded to the input and from the input to the decoded; seconds are of all cores"
    )
    table = Table(*header(found.unit), box=None, header_style="bold")
    for column in table.columns[3:]:
        column.justify = "right"
    for row in found.rows:
        table.add_row(*row_cells(row, found.unit))
    console.print(table)
    console.print()
    for aim, choice, why in advice(found):
        console.print(f"{aim}: {choice} ({why})")
    for name, why in found.failed.items():
        console.print(f"failed: {name}: {why}")
    for name, how in found.missing.items():
        console.print(f"not installed: {name}: {how}")
