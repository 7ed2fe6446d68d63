"""Bytes of lidar scans at a bound on the error in both directions, beside G-PCC, Draco and LAZ.

    python benches/peers/lidar_bounds.py [--tmc3 PATH] [--scans street hall] [--json FILE]

No point of the input is further than the bound from what is decoded, and no decoded point further
from the input. Ours are `learn_patches` with `max_error` and `max_error_forward`, the smallest file
of pixels of one, two and five bounds. Every peer codes the same points, geometry alone, at its
coarsest step that keeps the bound; G-PCC is the smallest of two octrees and two predictive trees.
G-PCC needs `tmc3` on the PATH or given. `--peers` takes the peers' rows from an earlier `--json`.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import peer_codecs as peers
from lidar_defaults import SCANS, Row, cells, coarsest, coders, row, scans, version
from peer_codecs import Coded, cpu_seconds

import surfabet as sb

BOUNDS = [0.02, 0.05, 0.1]


PIXELS = [1, 2, 5]
"""Sides of our pixels that are tried, in bounds."""


def bounded(cloud: sb.PointCloud, bound: float) -> tuple[Coded, str]:
    """Ours at this bound, through the bytes of a file."""
    began = cpu_seconds()
    files = {
        pixels: sb.learn_patches(
            cloud,
            resolution=pixels * bound,
            max_error=bound,
            max_error_forward=bound,
            attributes=(),
        ).to_bytes()
        for pixels in PIXELS
    }
    encoded = cpu_seconds()
    pixels, data = min(files.items(), key=lambda item: len(item[1]))
    decoded = sb.from_bytes(data).decode(as_measured=True)
    # All sizes were tried; a user takes one.
    encode_seconds = (encoded - began) / len(PIXELS)
    coded = Coded(len(data), len(data), encode_seconds, cpu_seconds() - encoded, decoded)
    return coded, f"pixel {pixels * bound:g}"


def largest(found: Row) -> float:
    """The largest error of both directions."""
    return max(found.forward[3], found.backward[3])


def _is(kept: dict[str, Any], name: str, bound: float) -> bool:
    """Whether a row of a file is a peer's of this scan and bound."""
    return kept["scan"] == name and kept["bound"] == bound and kept["tool"] != "surfabet"


def _row(kept: dict[str, Any]) -> Row:
    """A row of a file."""
    return Row(**{key: value for key, value in kept.items() if key != "bound"})


def main() -> None:
    """Prints a table for each bound."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scans", nargs="+", choices=SCANS, default=["room", "street", "hall"])
    parser.add_argument("--tmc3", type=Path, help="G-PCC's program, where it is not on the PATH")
    parser.add_argument("--json", type=Path, help="write the rows here, too")
    parser.add_argument("--peers", type=Path, help="take the peers' rows from this file")
    options = parser.parse_args()
    kept = json.loads(options.peers.read_text()) if options.peers else None
    tmc3 = None if kept else peers.find_tmc3(options.tmc3)
    tools = {} if kept else coders(tmc3)
    if tmc3 is not None:
        print(version(tmc3))
    header = ["scan", "tool", "setting", "bytes", "of ours", "decoded to input", "input to decoded"]
    header += ["encode CPU s", "decode CPU s", "points out"]
    tables: dict[float, list[list[str]]] = {bound: [] for bound in BOUNDS}
    rows: list[dict[str, object]] = []
    for scan, cloud in scans(options.scans):
        for bound in BOUNDS:
            name = f"{scan} ({len(cloud):,})"
            coded, setting = bounded(cloud, bound)
            ours = row(name, cloud, "surfabet", setting, coded)
            if largest(ours) > bound:
                raise SystemExit(f"{name}: {largest(ours)} m, above the bound of {bound} m")
            found = [coarsest(cloud, name, t, c, largest, bound) for t, c in tools.items()]
            found += [_row(of) for of in kept or [] if _is(of, name, bound)]
            tables[bound] += [cells(one, ours) for one in (ours, *found)]
            rows += [{"bound": bound, **asdict(one)} for one in (ours, *found)]
    for bound, table in tables.items():
        print(f"\nAt most {1e3 * bound:g} mm, both ways:\n\n{peers.table(header, table)}")
    if options.json:
        peers.write_json(options.json, rows)


if __name__ == "__main__":
    main()
