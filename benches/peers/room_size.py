"""Size and error of the coloured room: surfabet's patches beside Draco and OctoMap.

    python benches/peers/room_size.py [PATH] [--resolution 0.01] [--threads 2]

PATH is a coloured scan; by default the real room beside the checkout, else the simulated one.
Errors are against the raw scan and, beside it, against the scan thinned to 5 mm; all bytes count.
The peers get the voxels of a grid of the same resolution with their mean colours, as is usual for
them. Prints a table in Markdown. `patches_rd.py` draws whole curves.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import peer_codecs as peers
from peer_bench import ROOM
from peer_codecs import Coded, number

import surfabet as sb


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("path", nargs="?", type=Path)
    parser.add_argument("--resolution", type=float, default=0.01)
    parser.add_argument("--threads", type=int, default=2)
    return parser.parse_args()


def read(path: Path | None) -> sb.PointCloud:
    if path is None and ROOM.is_dir():
        path = ROOM
    if path is None:
        from surfabet import datasets

        return datasets.load_demo().cloud
    return sb.read(path)


def cells(name: str, coded: Coded, clouds: list[sb.PointCloud]) -> list[str]:
    found = [name, number(coded.bytes), number(coded.encode_seconds, 1)]
    found.append(number(len(coded.decoded)))
    for reference in clouds:
        q = sb.evaluate(reference, coded.decoded, normal_neighbors=None)
        errors = (q.rmse_forward, q.rmse_backward, q.rmse_pooled)
        forward, backward, pooled = (number(error, 1, 1e3) for error in errors)
        found += [f"{forward} / {backward} ({pooled})", number(q.color_rmse_pooled, 1)]
    return found


def main() -> None:
    options = parse()
    sb.set_num_threads(options.threads)
    step = options.resolution
    raw = read(options.path)
    clouds = [raw, sb.voxel_downsample(raw, 0.005)]
    print(f"{len(raw):,} points; thinned to 5 mm: {len(clouds[1]):,}; errors in mm as")
    print("decoded to input / input to decoded (pooled), colour rmse pooled\n")
    surface, measured = peers.surfabet_patches(raw, step)
    found = {
        "surfabet patches, surface": surface,
        "surfabet patches, as measured": measured,
        "Draco, level 10, 5-bit colour": peers.draco(raw, step),
        "OctoMap .ot, leaves": peers.octomap(raw, step),
    }
    header = ["tool", "bytes", "encode CPU s", "points out", "raw", "colour", "thinned", "colour"]
    rows = [cells(f"{name}, {step:g} m", coded, clouds) for name, coded in found.items() if coded]
    print(peers.table(header, rows))


if __name__ == "__main__":
    main()
