"""Bytes and error of a gas as a file, beside Draco at the same number of points.

    python benches/papers/gas_size.py [--scans kitchen table] [--counts 5000 20000]

Draco codes the voxel grid's means, as many as there are neurons, at its best level, with positions
quantised as finely as the neurons' (or with 8 bits, as many as are worth their bytes) and colours
of 5 bits. All bytes count. The error is over both directions, pooled, against the whole scan: of
the points that were stored, and of what the gas decodes between them at half the mean spacing.
Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from gas_scans import scan

import surfabet as sb


def draco(points: np.ndarray, colors: np.ndarray | None, step: float) -> tuple[int, np.ndarray]:
    """Bytes and decoded points of Draco on a grid of `step` metres."""
    try:
        import DracoPy
    except ImportError as error:
        sys.exit(f"{error}; pip install DracoPy")
    low = points.min(axis=0)
    bits = int(np.ceil(np.log2(np.ptp(points, axis=0).max() / step + 1)))
    data = DracoPy.encode(
        points,
        colors=None if colors is None else colors >> 3,
        quantization_bits=bits,
        quantization_range=((1 << bits) - 1) * step,
        quantization_origin=low,
        compression_level=10,
    )
    return len(data), np.asarray(DracoPy.decode(data).points)


def row(*cells: object) -> None:
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def pooled(cloud: sb.PointCloud, decoded: sb.PointCloud) -> str:
    quality = sb.evaluate(cloud, decoded, normal_neighbors=None)
    return f"{1e3 * quality.rmse_pooled:.2f} | {1e3 * quality.rmse:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scans", nargs="+", default=["kitchen", "table"])
    parser.add_argument("--counts", type=int, nargs="+", default=[5000, 20_000])
    options = parser.parse_args()
    row("scan", "points", "what", "bytes", "bits per point", "pooled rmse mm", "larger rmse mm")
    row(*["---"] * 7)
    for name in options.scans:
        cloud = scan(name)
        for count in options.counts:
            model = sb.learn_gas(cloud, n_neurons=count)
            with_all = len(model.to_bytes())
            path_sections = sections(model)
            bare = with_all - sum(path_sections[part] for part in ("normals", "sizes", "colour"))
            only_points = path_sections["positions"] + path_sections["topology"]
            first = f"{count:,}"
            bits = 8 * with_all / count
            said = pooled(cloud, model.decode())
            row(name, first, "gas, all", f"{with_all:,}", f"{bits:.1f}", said)
            half = 0.5 * float(np.median(edge_lengths(model)))
            dense = model.decode(half, as_measured=True)
            said = pooled(cloud, dense)
            what = f"the same, decoded at {1e3 * half:.1f} mm as measured"
            row(name, first, what, f"{with_all:,}", f"{bits:.1f}", said)
            what = "gas, positions and topology"
            row(name, first, what, f"{bare:,}", f"{8 * only_points / count:.1f}", "as all | ")
            voxels = sb.voxel_downsample(cloud, count=count)
            for step in (model.position_step, 4 * model.position_step):
                for colors in (voxels.colors, None):
                    size, back = draco(voxels.points, colors, step)
                    what = f"Draco, {1e3 * step:.2g} mm" + (
                        ", colours" if colors is not None else ""
                    )
                    said = pooled(cloud, sb.PointCloud(back))
                    row(name, first, what, f"{size:,}", f"{8 * size / len(back):.1f}", said)
            size, back = draco(model.neurons.positions, None, model.position_step)
            said = pooled(cloud, sb.PointCloud(back))
            row(name, first, "Draco on the neurons", f"{size:,}", f"{8 * size / count:.1f}", said)


def sections(model: sb.GasModel) -> dict[str, int]:
    """Bytes of each part of the model's file."""
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "gas.sfb"
        model.save(path)
        return {"colour": 0, **sb.inspect(path).sections}


def edge_lengths(model: sb.GasModel) -> np.ndarray:
    p, edges = model.neurons.positions, model.edges
    return np.linalg.norm(p[edges[:, 0]] - p[edges[:, 1]], axis=1)


if __name__ == "__main__":
    main()
