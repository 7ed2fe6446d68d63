"""Alphabets by description length beside what else makes a scan small.

    python benches/papers/alphabet_sizes.py [--out FOLDER] [--only curve|rebuild|scans]

"curve": one laser scan of a room at several qualities, beside planes alone, Draco, voxels and a
plain range-image codec: bytes of whole files against inliers and outliers at lambda 3 (eq. 13).
"rebuild" (IV-B): a second scan of the room by the words of the first, whose bytes do not count.
"scans": bytes of a hall's map against the number of scans in it; three of the six stand at one
place, so that revisits show.
With --out, curve and scans are drawn there.
"""

from __future__ import annotations

import argparse
import lzma
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from alphabet_scans import HALL_SCANS, ROOM_RESOLUTION, at_origin, distinct, hall, room
from numpy.typing import NDArray
from paper_bench import check_data, print_header, print_row

import surfabet as sb

SIGMA = sb.RangeSigma(3.0, ROOM_RESOLUTION)
MIN_RANGE = 0.5
OPTIONS: dict[str, Any] = {
    "angular_resolution": ROOM_RESOLUTION,
    "noise": 0.0,
    "min_range": MIN_RANGE,
}
NAMES = ("", "bytes", "inliers", "outliers", "seconds")
REGISTRATION_ERROR = 0.02
"""Metres: the hall's scans lie a few centimetres apart where they meet."""
Row = tuple[str, int, float, float]


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder for the plots")
    parser.add_argument("--only", choices=["curve", "rebuild", "scans"])
    return parser.parse_args()


def row(
    name: str, reference: sb.PointCloud, decoded: sb.PointCloud, n_bytes: int, seconds: float
) -> Row:
    quality = sb.evaluate(reference, decoded, sigma=SIGMA, normal_neighbors=None)
    assert quality.inliers is not None
    assert quality.outliers is not None
    shares = f"{quality.inliers:.1%}", f"{quality.outliers:.1%}"
    print_row(name, f"{n_bytes:,}", *shares, f"{seconds:.2f}")
    return name, n_bytes, quality.inliers, quality.outliers


def timed(work: Any) -> tuple[Any, float]:
    began = time.perf_counter()
    found = work()
    return found, time.perf_counter() - began


def draco(points: NDArray[np.float32], bits: int) -> tuple[bytes, sb.PointCloud] | None:
    try:
        import DracoPy
    except ImportError:
        return None
    data = DracoPy.encode(points, quantization_bits=bits, compression_level=10)
    return data, sb.PointCloud(np.asarray(DracoPy.decode(data).points))


def voxels(points: NDArray[np.float32], size: float) -> tuple[bytes, sb.PointCloud]:
    cells = np.unique(np.floor(points / size).astype(np.int16), axis=0)
    # Differences along the sorted list, axis by axis, are what zlib likes best.
    steps = np.diff(cells, axis=0, prepend=cells[:1])
    data = zlib.compress(np.ascontiguousarray(steps.T).tobytes(), 9)
    return data, sb.PointCloud((cells + 0.5) * size)


def range_image(points: NDArray[np.float32]) -> tuple[bytes, sb.PointCloud]:
    """Ranges on the scanner's own grid, predicted from the left and from below, then LZMA."""
    ranges = np.linalg.norm(points, axis=1)
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    elevation = np.arcsin(points[:, 2] / ranges)
    steps = np.radians((1.2, ROOM_RESOLUTION))
    low = np.array((-np.pi, elevation.min()))
    at = np.floor((np.column_stack([azimuth, elevation]) - low) / steps).astype(int)
    shape = at.max(axis=0) + 1
    # A step of the logarithm as wide as sigma: the error stays within half of it.
    step = 1.4 * SIGMA.sigma_scale * np.tan(np.radians(SIGMA.angular_resolution) / 2)
    levels = np.zeros(shape, np.int64)
    levels[at[:, 0], at[:, 1]] = np.round(np.log(ranges) / step).astype(int) + 128
    left = np.pad(levels, ((1, 0), (0, 0)))[:-1]
    below = np.pad(levels, ((0, 0), (1, 0)))[:, :-1]
    corner = np.pad(levels, ((1, 0), (1, 0)))[:-1, :-1]
    predicted = np.median(np.stack([left, below, left + below - corner]), axis=0).astype(int)
    data = lzma.compress((levels - predicted).astype(np.int16).tobytes(), preset=9)
    filled = np.argwhere(levels > 0)
    angles = (filled + 0.5) * steps + low
    decoded = np.exp((levels[levels > 0] - 128) * step)
    flat = decoded * np.cos(angles[:, 1])
    xyz = (flat * np.cos(angles[:, 0]), flat * np.sin(angles[:, 0]), decoded * np.sin(angles[:, 1]))
    return data, sb.PointCloud(np.column_stack(xyz))


def curve() -> list[Row]:
    print("\n### One scan of a room\n")
    scan = room(1)
    points = distinct(scan, MIN_RANGE)
    reference = at_origin(points)
    print_header(*NAMES)
    rows = []
    for bits in (2.0, 4.0, 7.0, 12.0, 24.0):
        options: dict[str, Any] = {**OPTIONS, "inlier_bits": bits}
        model, seconds = timed(
            lambda options=options: sb.learn_alphabet(scan, radius=0.1, **options)
        )
        name = f"words, {bits:g} bits ({len(model.alphabet)} words)"
        rows.append(row(name, reference, model.decode(), len(model.to_bytes()), seconds))
    for bits in (7.0, 16.0):
        options = {**OPTIONS, "inlier_bits": bits, "max_words": 0}
        model, seconds = timed(
            lambda options=options: sb.learn_alphabet(scan, radius=0.1, **options)
        )
        decoded, size = model.decode(), len(model.to_bytes())
        rows.append(row(f"planes alone, {bits:g} bits", reference, decoded, size, seconds))
    for bits in (8, 9, 10):
        if (found := draco(points, bits)) is None:
            print_row("Draco: not installed", "", "", "", "")
            break
        rows.append(row(f"Draco, {bits} bits", reference, found[1], len(found[0]), 0.0))
    for size in (0.05, 0.08):
        data, decoded = voxels(points, size)
        rows.append(row(f"voxel centres {size:g} m, zlib", reference, decoded, len(data), 0.0))
    data, decoded = range_image(points)
    rows.append(row("range image, LZMA", reference, decoded, len(data), 0.0))
    return rows


def rebuild() -> None:
    print("\n### A second scan by the words of the first\n")
    first, second = room(1), room(2)
    reference = at_origin(distinct(second, MIN_RANGE))
    print_header(*NAMES)
    for bits in (4.0, 7.0):
        words = sb.learn_alphabet(first, radius=0.1, **OPTIONS, inlier_bits=bits).alphabet
        options: dict[str, Any] = {**OPTIONS, "inlier_bits": bits}
        model, seconds = timed(
            lambda words=words, options=options: words.describe(second, **options)
        )
        name = f"words of the first, {bits:g} bits"
        row(name, reference, model.decode(), len(model.to_bytes()), seconds)
        model, seconds = timed(
            lambda options=options: sb.learn_alphabet(second, radius=0.1, **options)
        )
        name = f"words of its own, {bits:g} bits"
        row(name, reference, model.decode(), len(model.to_bytes()), seconds)


def scans() -> list[tuple[int, int, int]]:
    print("\n### A hall, scan by scan\n")
    print_header("scans", "points", "bytes", "bytes per scan", "words", "occurrences", "seconds")
    found = []
    # One tolerance for all, or the scans' errors against each other would make it wider and wider.
    alone = sb.learn_alphabet(hall(1), radius=0.1).sigma
    assert isinstance(alone, sb.RangeSigma)
    options: dict[str, Any] = {
        "angular_resolution": alone.angular_resolution,
        "noise": REGISTRATION_ERROR,
    }
    for n in range(1, len(HALL_SCANS) + 1):
        cloud = hall(n)
        model, seconds = timed(lambda cloud=cloud: sb.learn_alphabet(cloud, radius=0.1, **options))
        size = len(model.to_bytes())
        counts = len(model.alphabet), len(model)
        print_row(n, f"{len(cloud):,}", f"{size:,}", size // n, *counts, f"{seconds:.1f}")
        found.append((n, len(cloud), size))
    return found


def draw(folder: Path, of_curve: list[Row], of_scans: list[tuple[int, int, int]]) -> None:
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    if of_curve:
        figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
        kinds: dict[str, list[Row]] = {}
        for found in of_curve:
            kinds.setdefault(found[0].split(",")[0].split(" 0")[0], []).append(found)
        for kind, group in kinds.items():
            size, inliers = [r[1] for r in group], [100 * r[2] for r in group]
            axes.plot(size, inliers, marker="o", label=kind)
            for x, y, r in zip(size, inliers, group, strict=True):
                beside = {"xytext": (4, -9), "textcoords": "offset points"}
                axes.annotate(f"{100 * r[3]:.1f}", (x, y), **beside)
        axes.set(xscale="log", xlabel="bytes", ylabel="inliers (%); beside the points, outliers")
        axes.grid(alpha=0.3)
        axes.legend()
        figure.savefig(folder / "alphabet_curve.png", dpi=110)
    if of_scans:
        figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
        n, size = [s[0] for s in of_scans], [s[2] / 1000 for s in of_scans]
        axes.plot(n, size, marker="o", label="one map")
        axes.plot(n, [size[0] * k for k in n], linestyle="--", label="a file per scan")
        axes.set(xlabel="scans", ylabel="kB", ylim=(0, None))
        axes.grid(alpha=0.3)
        axes.legend()
        figure.savefig(folder / "alphabet_scans.png", dpi=110)


def main() -> None:
    options = parse()
    check_data()
    of_curve = curve() if options.only in (None, "curve") else []
    if options.only in (None, "rebuild"):
        rebuild()
    of_scans = scans() if options.only in (None, "scans") else []
    if options.out is not None:
        draw(options.out, of_curve, of_scans)


if __name__ == "__main__":
    main()
