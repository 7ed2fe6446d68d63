"""Bytes of lidar scans at a bound on the error in both directions, beside G-PCC, Draco and LAZ.

    python benches/peers/lidar_bounds.py [--tmc3 PATH] [--scans street hall] [--json FILE]

No point of the input is further than the bound from what is decoded, and no decoded point further
from the input. Ours are `learn_patches` with `max_error` and `max_error_forward`, and pixels as
large as the bound. Every peer codes the same points, geometry alone, at its coarsest step that
keeps the bound; G-PCC is the smaller of octree and predictive tree. G-PCC needs `tmc3` on the PATH
or given.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

import peer_codecs as peers
from lidar_defaults import SCANS, Row, cells, coarsest, coders, row, scans, version
from peer_codecs import Coded, cpu_seconds

import surfabet as sb

BOUNDS = [0.02, 0.05, 0.1]


def bounded(cloud: sb.PointCloud, bound: float) -> Coded:
    """Ours at this bound, through the bytes of a file."""
    began = cpu_seconds()
    model = sb.learn_patches(
        cloud, resolution=bound, max_error=bound, max_error_forward=bound, attributes=()
    )
    data = model.to_bytes()
    encoded = cpu_seconds()
    decoded = sb.from_bytes(data).decode(as_measured=True)
    return Coded(len(data), len(data), encoded - began, cpu_seconds() - encoded, decoded)


def largest(found: Row) -> float:
    """The largest error of both directions."""
    return max(found.forward[3], found.backward[3])


def main() -> None:
    """Prints a table for each bound."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scans", nargs="+", choices=SCANS, default=["room", "street", "hall"])
    parser.add_argument("--tmc3", type=Path, help="G-PCC's program, where it is not on the PATH")
    parser.add_argument("--json", type=Path, help="write the rows here, too")
    options = parser.parse_args()
    tmc3 = peers.find_tmc3(options.tmc3)
    tools = coders(tmc3)
    if tmc3 is not None:
        print(version(tmc3))
    header = ["scan", "tool", "setting", "bytes", "of ours", "decoded to input", "input to decoded"]
    header += ["encode CPU s", "decode CPU s", "points out"]
    tables: dict[float, list[list[str]]] = {bound: [] for bound in BOUNDS}
    rows: list[dict[str, object]] = []
    for scan, cloud in scans(options.scans):
        for bound in BOUNDS:
            name = f"{scan} ({len(cloud):,})"
            ours = row(name, cloud, "surfabet", f"pixel {bound:g}", bounded(cloud, bound))
            assert largest(ours) <= bound
            found = [coarsest(cloud, name, t, c, largest, bound) for t, c in tools.items()]
            tables[bound] += [cells(one, ours) for one in (ours, *found)]
            rows += [{"bound": bound, **asdict(one)} for one in (ours, *found)]
    for bound, table in tables.items():
        print(f"\nAt most {1e3 * bound:g} mm, both ways:\n\n{peers.table(header, table)}")
    if options.json:
        peers.write_json(options.json, rows)


if __name__ == "__main__":
    main()
