"""Alphabets by description length beside what else makes a scan small.

    python benches/papers/alphabet_sizes.py [--out FOLDER] [--only curve|rebuild|scans]

"curve": one laser scan of a room with everything estimated from it, and at several qualities,
beside planes alone, words of another place, Draco, voxels, a range-image codec, and range images
that are decimated, interpolated and coded arithmetically: bytes of whole files against inliers and
outliers at lambda 3 (eq. 13).
"rebuild" (IV-B): a second scan of the room by the words of the first, whose bytes do not count.
"scans": bytes of a hall's map against the number of scans in it, with inliers and outliers at
lambda 3 and the resolution of the first scan, with the noise that the map is learned with, and
without any (eq. 13 of the paper); three of the six stand at one place, so that revisits show.
With --out, curve and scans are drawn there.
"""

from __future__ import annotations

import argparse
import lzma
import math
import time
import warnings
import zlib
from collections.abc import Callable
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
MAX_JUMP = 0.2
"""Ratio of ranges, less one, between pixels of one surface."""
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


def on_scanner_grid(
    points: NDArray[np.float32],
) -> tuple[NDArray[Any], NDArray[Any], Callable[[NDArray[Any]], NDArray[Any]]]:
    """Ranges, pixels of the scanner's own grid, and what gives azimuth and elevation of pixels."""
    ranges = np.linalg.norm(points, axis=1)
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    elevation = np.arcsin(points[:, 2] / ranges)
    steps = np.radians((1.2, ROOM_RESOLUTION))
    low = np.array((-np.pi, elevation.min()))
    at = np.floor((np.column_stack([azimuth, elevation]) - low) / steps).astype(int)
    return ranges, at, lambda pixels: (pixels + 0.5) * steps + low


def points_at(ranges: NDArray[Any], angles: NDArray[Any]) -> NDArray[Any]:
    """Points, (n, 3), by range and by azimuth and elevation, (n, 2)."""
    azimuth, elevation = angles.T
    flat = ranges * np.cos(elevation)
    xyz = flat * np.cos(azimuth), flat * np.sin(azimuth), ranges * np.sin(elevation)
    return np.column_stack(xyz)


def range_image(points: NDArray[np.float32]) -> tuple[bytes, sb.PointCloud]:
    """Ranges on the scanner's own grid, predicted from the left and from below, then LZMA."""
    ranges, at, angles_of = on_scanner_grid(points)
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
    decoded = np.exp((levels[levels > 0] - 128) * step)
    return data, sb.PointCloud(points_at(decoded, angles_of(filled)))


def code_length(symbols: NDArray[np.int64], contexts: NDArray[np.int64]) -> float:
    """Bits of an adaptive arithmetic coder: by context, as Krichevsky and Trofimov estimate."""
    values = np.unique(symbols, return_inverse=True)[1]
    half = 0.5 * (values.max() + 1)
    bits = 0.0
    for context in np.unique(contexts):
        counts = np.bincount(values[contexts == context])
        bits += math.lgamma(counts.sum() + half) - math.lgamma(half)
        bits -= sum(math.lgamma(n + 0.5) - math.lgamma(0.5) for n in counts[counts > 0])
    return bits / math.log(2)


def neighbors(image: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Left, lower and lower left neighbour of every pixel, 0 beyond the rim."""
    padded = np.pad(image, ((1, 0), (1, 0)))
    return padded[:-1, 1:], padded[1:, :-1], padded[:-1, :-1]


def decimated_range_image(
    points: NDArray[np.float32], factor: int, levels_per_sigma: float
) -> tuple[int, sb.PointCloud]:
    """Every factor-th pixel of the scanner's grid, and the others interpolated between them.

    A pixel is the median of its block, where half of that has points. Its level is coded as the
    difference from the plane through its coded neighbours, in contexts of their differences, and
    whether it is there in contexts of theirs. No file is written: the length is that of an adaptive
    arithmetic coder, with 16 bytes for a header.
    """
    ranges, at, angles_of = on_scanner_grid(points)
    n_across, n_up = -(-(at.max(axis=0) + 1) // factor)
    grid = np.full((n_across * factor, n_up * factor), np.nan)
    grid[at[:, 0], at[:, 1]] = np.log(ranges)
    blocks = grid.reshape(n_across, factor, n_up, factor).swapaxes(1, 2).reshape(n_across, n_up, -1)
    known = (~np.isnan(blocks)).mean(axis=2) >= 0.5
    step = SIGMA.sigma_scale * np.tan(np.radians(SIGMA.angular_resolution) / 2) / levels_per_sigma
    with warnings.catch_warnings():
        # Blocks without points.
        warnings.simplefilter("ignore", RuntimeWarning)
        medians = np.nanmedian(blocks, axis=2)
    level = np.where(known, np.round(np.nan_to_num(medians) / step), 0).astype(np.int64)
    level -= np.where(known, level[known].min() - 1, 0)

    left, below, corner = neighbors(level)
    plane = np.median(np.stack([left, below, left + below - corner]), axis=0).astype(np.int64)
    # Where a neighbour is not there, the other one predicts.
    plane = np.where(left == 0, below, np.where(below == 0, left, plane))
    difference = np.where(known, level - plane, 0)
    size = sum(np.abs(d) for d in neighbors(difference)[:2])
    bits = code_length(difference[known], np.digitize(size, (1, 2, 4, 9))[known])
    of_mask = sum(k * w for k, w in zip(neighbors(known.astype(np.int64)), (1, 2, 4), strict=True))
    bits += code_length(known.astype(np.int64).reshape(-1), of_mask.reshape(-1))

    # Four pixels about each of the full grid; the nearest one where they do not belong together.
    full = np.stack(np.meshgrid(*(np.arange(n) for n in grid.shape), indexing="ij"), axis=-1)
    place = (full + 0.5) / factor - 0.5
    first = np.floor(place).astype(int)
    share = place - first
    values, weights = [], []
    for across in (0, 1):
        for up in (0, 1):
            # The image closes around the scanner.
            i = (first[..., 0] + across) % n_across
            j = np.clip(first[..., 1] + up, 0, n_up - 1)
            values.append(np.where(known[i, j], level[i, j] * step, np.nan))
            weight = np.abs(1 - across - share[..., 0]) * np.abs(1 - up - share[..., 1])
            weights.append(weight)
    corners, weight = np.stack(values), np.stack(weights)
    spread = corners.max(axis=0) - corners.min(axis=0)
    mixed = (corners * weight).sum(axis=0)
    nearest = np.take_along_axis(corners, weight.argmax(axis=0)[None], axis=0)[0]
    found = np.where(spread <= MAX_JUMP, mixed, nearest)
    lowest = np.round(np.nanmin(medians[known]) / step) - 1
    filled = ~np.isnan(found)
    decoded = np.exp(found[filled] + lowest * step)
    cloud = sb.PointCloud(points_at(decoded, angles_of(full[filled])).astype(np.float32))
    return 16 + math.ceil(bits / 8), cloud


def curve() -> list[Row]:
    print("\n### One scan of a room\n")
    scan = room(1)
    points = distinct(scan, MIN_RANGE)
    reference = at_origin(points)
    print_header(*NAMES)
    rows = []
    for quality in ("small", "balanced", "fine"):
        model, seconds = timed(
            lambda quality=quality: sb.learn_alphabet(scan, min_range=MIN_RANGE, quality=quality)
        )
        assert isinstance(model.sigma, sb.RangeSigma)
        alpha = model.sigma.angular_resolution
        name = f"words, all estimated (alpha {alpha:.3f} degrees), {quality}"
        rows.append(row(name, reference, model.decode(), len(model.to_bytes()), seconds))
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
    elsewhere = sb.learn_alphabet(hall(1), radius=0.1, min_range=MIN_RANGE).alphabet
    for bits in (4.0, 7.0):
        model, seconds = timed(
            lambda bits=bits: elsewhere.describe(scan, **OPTIONS, inlier_bits=bits)
        )
        name = f"words of a hall, not counted, {bits:g} bits"
        rows.append(row(name, reference, model.decode(), len(model.to_bytes()), seconds))
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
    for factor, levels in ((2, 1.0), (3, 1.0), (3, 2.0), (4, 1.0), (5, 1.0)):
        length, decoded = decimated_range_image(points, factor, levels)
        name = f"range image, every {factor}th pixel, {levels:g} levels per sigma"
        rows.append(row(name, reference, decoded, length, 0.0))
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


def shares_within(
    reference: sb.PointCloud, decoded: sb.PointCloud, resolution: float, noise: float
) -> tuple[float, float]:
    """Inliers and outliers within lambda hypot(tan(alpha / 2) range, noise)."""
    assert reference.viewpoints is not None
    assert reference.viewpoint_index is not None
    seen_from = reference.viewpoints[reference.viewpoint_index]
    ranges = np.linalg.norm(reference.points - seen_from, axis=1)
    sigma = 3 * np.hypot(np.tan(np.radians(resolution) / 2) * ranges, noise)
    points, found = (np.asarray(c.points, np.float32) for c in (reference, decoded))
    to_decoded = sb.KdTree(found).query(points)[0].ravel()
    to_reference, nearest = (x.ravel() for x in sb.KdTree(points).query(found))
    return float((to_decoded <= sigma).mean()), float((to_reference > sigma[nearest]).mean())


def scans() -> list[tuple[int, int, int]]:
    print("\n### A hall, scan by scan\n")
    names = ("bytes", "bytes per scan", "words", "occurrences", "inliers", "outliers")
    print_header("scans", "points", *names, "inliers, eq. 13", "outliers, eq. 13", "seconds")
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
        size, decoded = len(model.to_bytes()), model.decode()
        counts = len(model.alphabet), len(model)
        quality = sb.evaluate(cloud, decoded, sigma=alone, normal_neighbors=None)
        shares = (
            *shares_within(cloud, decoded, alone.angular_resolution, REGISTRATION_ERROR),
            quality.inliers,
            quality.outliers,
        )
        cells = [f"{share:.1%}" for share in shares]
        print_row(n, f"{len(cloud):,}", f"{size:,}", size // n, *counts, *cells, f"{seconds:.1f}")
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
