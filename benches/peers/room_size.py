"""Size and error of the coloured room: surfabet's patches beside Draco and OctoMap.

    python benches/peers/room_size.py [PATH] [--resolution 0.01] [--threads 2]

PATH is a coloured scan; by default the real room beside the checkout, else the simulated one.
Errors are against the raw scan and, beside it, against the scan thinned to 5 mm; all bytes count.
The peers get the voxels of a grid of the same resolution with their mean colours, as is usual for
them. Prints a table in Markdown.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from peer_bench import ROOM, load

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


def draco(voxels: sb.PointCloud, step: float) -> tuple[int, sb.PointCloud] | None:
    if not (peer := load("DracoPy")):
        return None
    # Cell centres, which the quantiser's grid holds exactly.
    points = (np.floor(voxels.points / step) + 0.5) * step
    low = points.min(axis=0)
    cells = round((points - low).max() / step) + 1
    bits = int(np.ceil(np.log2(cells)))
    # 5 bits per colour: 8 would nearly double its bytes and gain little at this spacing.
    data = peer.encode(
        points,
        quantization_bits=bits,
        quantization_range=((1 << bits) - 1) * step,
        quantization_origin=low,
        compression_level=10,
        colors=voxels.colors >> 3,
    )
    back = peer.decode(data)
    colors = (np.asarray(back.colors)[:, :3] << 3) + 4
    return len(data), sb.PointCloud(np.asarray(back.points), colors=colors.astype(np.uint8))


def octomap(voxels: sb.PointCloud, step: float) -> tuple[int, sb.PointCloud] | None:
    if not (peer := load("pyoctomap")):
        return None
    tree = peer.ColorOcTree(step)
    points, colors = voxels.points, voxels.colors
    # The leaves alone, without free space: what the model has to keep.
    for point, color in zip(points, colors, strict=True):
        tree.updateNode(point, True, True)
        tree.setNodeColor(point, *map(int, color))
    tree.updateInnerOccupancy()
    tree.prune()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "room.ot"
        tree.write(str(path))
        size = path.stat().st_size
    centers = (np.floor(points / step) + 0.5) * step
    keep = np.unique(np.floor(points / step).astype(np.int64), axis=0, return_index=True)[1]
    return size, sb.PointCloud(centers[keep], colors=colors[keep])


def row(name: str, size: int, seconds: float, clouds: list[sb.PointCloud], again: sb.PointCloud):
    cells = [name, f"{size:,}", f"{seconds:.1f}", f"{len(again):,}"]
    for reference in clouds:
        q = sb.evaluate(reference, again, normal_neighbors=None)
        cells.append(
            f"{1e3 * q.rmse_forward:.1f} / {1e3 * q.rmse_backward:.1f} ({1e3 * q.rmse_pooled:.1f})"
        )
        cells.append(f"{q.color_rmse_pooled:.1f}")
    print("| " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    options = parse()
    sb.set_num_threads(options.threads)
    step = options.resolution
    raw = read(options.path)
    thinned = sb.voxel_downsample(raw, 0.005)
    voxels = sb.voxel_downsample(raw, step)
    clouds = [raw, thinned]
    print(f"{len(raw):,} points; thinned to 5 mm: {len(thinned):,}; errors in mm as")
    print("decoded to input / input to decoded (pooled), colour rmse pooled\n")
    print("| tool | bytes | encode s | points out | raw | colour | thinned | colour |")
    print("|---|---|---|---|---|---|---|---|")
    began = time.perf_counter()
    model = sb.learn_patches(raw, resolution=step)
    data = model.to_bytes()
    seconds = time.perf_counter() - began
    row(f"surfabet patches, {step:g} m", len(data), seconds, clouds, model.decode())
    for name, peer in [("Draco, level 10, 5-bit colour", draco), ("OctoMap .ot, leaves", octomap)]:
        began = time.perf_counter()
        if found := peer(voxels, step):
            row(f"{name}, {step:g} m", found[0], time.perf_counter() - began, clouds, found[1])


if __name__ == "__main__":
    main()
