"""`surfabet convert`: a cloud from one format into another."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import surfabet
from surfabet.cli._files import check_output, cloud_suffixes, read_cloud, size_on_disk
from surfabet.cli._format import bytes_text, print_json
from surfabet.cli._options import COMMON, READ_OPTIONS, Common, Flag, ReadOptions


def convert(
    input_: Annotated[Path, Parameter(name="IN")],
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    json: Flag = False,
    read: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Write a cloud in another format.

    Every attribute that the new format can hold is kept; a warning names what it cannot hold.

        surfabet convert scan.e57 scan.laz
        surfabet convert frames/ room.ply --frame-stride 5

    Parameters
    ----------
    input_
        The cloud: ply, pcd, las, laz, e57, npz, npy, xyz, csv, txt, pts, ptx, KITTI bin, a ROS
        bag, or a folder of RGB-D frames.
    output
        The cloud to write; its name tells the format: ply, pcd, las, laz, e57, npz, xyz,
        csv, mcap.
    json
        Print one JSON object instead of a line.
    """
    check_output(output, cloud_suffixes(), input_)
    started = time.perf_counter()
    with common.progress() as progress:
        cloud = read_cloud(input_, read, progress)
        progress(f"write {output.name}", 0.0)
        surfabet.write(output, cloud)
    seconds = time.perf_counter() - started

    n_bytes = size_on_disk(output)
    if json:
        print_json(
            {
                "input": {"path": str(input_), "bytes_on_disk": size_on_disk(input_)},
                "output": {
                    "path": str(output),
                    "bytes": n_bytes,
                    "points": len(cloud),
                    "attributes": cloud.attributes,
                },
                "seconds": seconds,
            }
        )
    elif not common.quiet:
        attributes = ", ".join(["positions", *cloud.attributes])
        print(
            f"{output}: {len(cloud):,} points ({attributes}), "
            f"{bytes_text(n_bytes)}, {seconds:.1f} s"
        )
