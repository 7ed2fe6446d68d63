"""Learned dictionaries against the fixed cosine basis, on the patches of real scans.

    python benches/papers/dictionary_or_cosine.py [--only room|frame] [--scale 1] [--json]

The patches are those of a lattice model. Their 8 x 8 images of depth and of luma are measured from
the scan: weighted means of the points that lie within three standard deviations of the patch, less
a least-squares plane (depth) or the mean (luma) over the mask. Every image is coded by masked
orthogonal matching pursuit to a tolerance over

- the two-dimensional discrete cosine transform (64 atoms),
- dictionaries that weighted K-SVD learned from all of these images (in sample),
- dictionaries learned from every other image and used for the rest (held out).

For learned dictionaries the tolerance is then moved until the error of all images after rounding
is that of the transform. Bits are empirical entropies: of the number of atoms, of the indices of
atoms (less the order, which says nothing) and of the quantised coefficients. They cost a table of
frequencies nothing, which favours many atoms. A dictionary learned in sample has to be said as
well: 8 bits for each value, or the entropy of these bytes where smaller. One learned elsewhere may
be shared, and costs nothing.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import lgamma, log
from typing import Any

import numpy as np
from numpy.typing import NDArray
from paper_bench import check_data, kinect_frame, print_header, print_row, room

import surfabet as sb
from surfabet import sparse

PIXELS = 8
"""Per side of a patch."""
ATOMS = (32, 64, 128)
MAX_ATOMS = 40
"""Most atoms in a code."""
MIN_PIXELS = 12
"""Images with fewer measured pixels say nothing of a basis."""
MIN_IMAGES = 200
"""Levels with fewer images teach no dictionary."""
ITERATIONS = 10
DEPTH_TOLERANCE = 0.2
"""Root mean square error of depth, finest pixels."""
LUMA_TOLERANCE = 7.0

EVERY = slice(None)
SPLIT = (slice(0, None, 2), slice(1, None, 2))

Array = NDArray[np.float64]
Halves = list[tuple[NDArray[np.float32], slice]]


@dataclass(frozen=True)
class Images:
    """Images of all patches of a level in one channel, with the mean taken out."""

    level: str
    channel: str
    values: NDArray[np.float32]
    """(m, 64), zero where not measured."""
    measured: NDArray[np.bool_]
    """(m, 64)."""
    tolerance: float


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", choices=["room", "frame"])
    parser.add_argument("--scale", type=float, default=1.0, help="of both tolerances")
    parser.add_argument("--json", action="store_true", help="a JSON object per line instead")
    parser.add_argument("--threads", type=int, default=2)
    return parser.parse_args()


def scene(name: str) -> tuple[sb.PointCloud, sb.PatchModel]:
    if name == "room":
        cloud = room()
        return cloud, sb.learn_patches(cloud, resolution=0.011, completeness=0)
    cloud = kinect_frame()
    return cloud, sb.learn_patches(cloud, resolution=0.004, rate=0.05, completeness=0)


def cosines(x: Array) -> Array:
    """The six functions that the depth of a lattice patch is made of, (..., 6), x in -1 to 1."""
    shapes = [np.ones_like(x), np.sqrt(3) * x]
    shapes += [np.sqrt(2) * np.cos(k * np.pi * (x + 1) / 2) for k in range(2, 6)]
    return np.stack(shapes, axis=-1)


DEGREES = np.array([(order - j, j) for order in range(6) for j in range(order + 1)])


class Columns:
    """Points of a cloud by the finest squares of the lattice that they project to, for one axis."""

    def __init__(self, local: Array, axis: int, side: float) -> None:
        plane = local[:, [(axis + 1) % 3, (axis + 2) % 3]]
        square = np.floor(plane / side).astype(np.int64)
        self._low = square.min(axis=0)
        self._wide = int(np.ptp(square[:, 1])) + 1
        key = (square[:, 0] - self._low[0]) * self._wide + square[:, 1] - self._low[1]
        self._order = np.argsort(key, kind="stable")
        self._keys = key[self._order]

    def within(self, corner: NDArray[np.int64], width: int) -> NDArray[np.int64]:
        """Indices of the points in `width` squared finest squares from a corner."""
        first = corner - self._low
        low = int(np.clip(first[1], 0, self._wide))
        high = int(np.clip(first[1] + width, 0, self._wide))
        rows = np.arange(first[0], first[0] + width) * self._wide
        starts = np.searchsorted(self._keys, rows + low)
        ends = np.searchsorted(self._keys, rows + high)
        found = [self._order[a:b] for a, b in zip(starts, ends, strict=True)]
        return np.concatenate(found)


def measured_images(
    cloud: sb.PointCloud, model: sb.PatchModel
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Mean depth (m) and luma of all pixels of all patches, and which of them were measured."""
    patches = model.patches
    local = (cloud.points - model.origin) @ model.rotation
    assert cloud.colors is not None
    luma = cloud.colors @ np.array([0.299, 0.587, 0.114])
    # The depth error of structured light grows with the square of the range.
    weights = np.ones(len(cloud)) if cloud.ranges is None else cloud.ranges.astype(float) ** -4
    finest = model.levels[-1].pixel_size
    columns = [Columns(local, axis, PIXELS * finest) for axis in range(3)]
    depth_axis = np.abs(np.einsum("ji,mj->mi", model.rotation, patches.poses[:, :3, 2])).argmax(1)
    middles = (patches.poses[:, :3, 3] - model.origin) @ model.rotation
    m = len(patches)
    depths, lumas = np.zeros((m, PIXELS**2)), np.zeros((m, PIXELS**2))
    measured = np.zeros((m, PIXELS**2), bool)
    for i, axis in enumerate(depth_axis):
        plane = [(axis + 1) % 3, (axis + 2) % 3]
        side = patches.size[i]
        corner = middles[i, plane] - side / 2
        square = np.rint(corner / (PIXELS * finest)).astype(np.int64)
        near = columns[axis].within(square, round(side / (PIXELS * finest)))
        window = max(3 * patches.sigma[i], 1.5 * finest)
        # Shapes are at most 3: what is further away than this cannot be in the window.
        reach = 3 * np.abs(patches.coefficients[i, 1:]).sum() + window
        near = near[np.abs(local[near, axis] - patches.coefficients[i, 0]) < reach]
        pixel = np.floor((local[near][:, plane] - corner) / side * PIXELS).astype(np.int64)
        inside = ((pixel >= 0) & (pixel < PIXELS)).all(axis=1)
        near, pixel = near[inside], pixel[inside]
        x, y = (2 * (local[near][:, plane] - corner) / side - 1).T
        shapes = cosines(x)[:, DEGREES[:, 0]] * cosines(y)[:, DEGREES[:, 1]]
        off = local[near, axis] - shapes @ patches.coefficients[i]
        close = np.abs(off) < window
        near = near[close]
        at = pixel[close, 1] * PIXELS + pixel[close, 0]
        total = np.bincount(at, weights[near], PIXELS**2)
        seen = (total > 0) & patches.masks[i].ravel()
        for image, values in ((depths, local[near, axis]), (lumas, luma[near])):
            sums = np.bincount(at, weights[near] * values, PIXELS**2)
            image[i, seen] = sums[seen] / total[seen]
        measured[i] = seen
    return depths, lumas, measured


def without_fit(images: Array, measured: NDArray[np.bool_], shapes: Array) -> NDArray[np.float32]:
    """Images less their least-squares sum of shapes (k, 64) over the measured pixels."""
    left = np.zeros_like(images)
    for image, seen, rest in zip(images, measured, left, strict=True):
        fit = np.linalg.lstsq(shapes[:, seen].T, image[seen], rcond=None)[0]
        rest[seen] = image[seen] - fit @ shapes[:, seen]
    return left.astype(np.float32)


def images_of(name: str, scale: float) -> Iterator[Images]:
    cloud, model = scene(name)
    depths, lumas, measured = measured_images(cloud, model)
    row, column = (g.ravel() - (PIXELS - 1) / 2 for g in np.mgrid[:PIXELS, :PIXELS])
    plane = np.stack([np.ones(PIXELS**2), row, column])
    finest = model.levels[-1].pixel_size
    for j, level in enumerate(model.levels):
        use = (model.patches.level == j) & (measured.sum(axis=1) >= MIN_PIXELS)
        size = f"{1e3 * level.pixel_size:g} mm"
        if use.sum() < MIN_IMAGES:
            print(f"{name}, {size}: {use.sum()} images only, left out", file=sys.stderr)
            continue
        channels = [
            ("depth", depths, plane, DEPTH_TOLERANCE * finest),
            ("luma", lumas, plane[:1], LUMA_TOLERANCE),
        ]
        for channel, images, shapes, tolerance in channels:
            values = without_fit(images[use], measured[use], shapes)
            yield Images(size, channel, values, measured[use], scale * tolerance)


def entropy(values: NDArray[Any]) -> float:
    """Bits of a sequence at the entropy of its own frequencies."""
    counts = np.unique(values, return_counts=True)[1]
    return float(-(counts * np.log2(counts / counts.sum())).sum())


@dataclass(frozen=True)
class Coded:
    """Codes of images over a dictionary."""

    n_images: int
    counts: NDArray[np.int64]
    atoms: NDArray[np.int64]
    quantised: NDArray[np.int64]
    squared_error: float

    def __add__(self, other: Coded) -> Coded:
        return Coded(
            self.n_images + other.n_images,
            np.concatenate([self.counts, other.counts]),
            np.concatenate([self.atoms, other.atoms]),
            np.concatenate([self.quantised, other.quantised]),
            self.squared_error + other.squared_error,
        )

    @property
    def index_bits(self) -> float:
        orders = sum(lgamma(n + 1) for n in self.counts) / log(2)
        return entropy(self.counts) + entropy(self.atoms) - orders

    @property
    def coefficient_bits(self) -> float:
        return entropy(self.quantised)


def code(
    dictionary: NDArray[np.float32],
    images: Images,
    tolerance: float,
    which: slice = EVERY,
) -> Coded:
    """Codes to a tolerance, coefficients rounded to twice the images' own."""
    values, weights = images.values[which], images.measured[which].astype(np.float32)
    codes = sparse.omp(
        dictionary, values, weights=weights, max_atoms=MAX_ATOMS, tolerance=tolerance
    )
    step = 2 * images.tolerance
    quantised = np.rint(codes.coefficients / step).astype(np.int64)
    kept = quantised != 0
    owner = np.repeat(np.arange(len(values)), np.diff(codes.offsets.astype(np.int64)))
    counts = np.bincount(owner[kept], minlength=len(values))
    atoms = codes.atoms[kept].astype(np.int64)
    rounded = sparse.SparseCodes(
        np.concatenate([[0], np.cumsum(counts)]), atoms, step * quantised[kept]
    )
    errors = sparse.squared_errors(dictionary, values, rounded, weights=weights)
    return Coded(len(values), counts, atoms, quantised[kept], float(errors.sum()))


def to_error(squared_error: float, tolerance: float, coded: Callable[[float], Coded]) -> Coded:
    """Codes of about the same error as others, by bisection of the tolerance."""
    low, high = tolerance / 2, tolerance * 2
    best = coded(tolerance)
    for _ in range(8):
        middle = np.sqrt(low * high)
        found = coded(middle)
        if abs(found.squared_error - squared_error) < abs(best.squared_error - squared_error):
            best = found
        if found.squared_error < squared_error:
            low = middle
        else:
            high = middle
    return best


def dct() -> NDArray[np.float32]:
    """The orthonormal two-dimensional transform, (64, 64)."""
    k, x = np.mgrid[:PIXELS, :PIXELS]
    rows = np.sqrt(2 / PIXELS) * np.cos(np.pi * k * (x + 0.5) / PIXELS)
    rows[0] = np.sqrt(1 / PIXELS)
    return np.kron(rows, rows).astype(np.float32)


def learn(images: Images, n_atoms: int, which: slice = EVERY) -> NDArray[np.float32]:
    return sparse.ksvd(
        images.values[which],
        weights=images.measured[which],
        n_atoms=n_atoms,
        max_atoms=MAX_ATOMS,
        tolerance=images.tolerance,
        iterations=ITERATIONS,
    ).dictionary


def dictionary_bytes(dictionary: NDArray[np.float32]) -> tuple[int, float]:
    """Bytes at 8 bits a value, and at the entropy of these."""
    values = np.rint(dictionary / np.abs(dictionary).max() * 127)
    return dictionary.size, entropy(values) / 8


def results(name: str, images: Images) -> Iterator[dict[str, Any]]:
    def result(basis: str, coded: Coded, raw: int = 0, compact: float = 0.0) -> dict[str, Any]:
        bits = coded.index_bits + coded.coefficient_bits
        return {
            "scene": name,
            "level": images.level,
            "channel": images.channel,
            "basis": basis,
            "images": coded.n_images,
            "tolerance": images.tolerance,
            "rmse": float(np.sqrt(coded.squared_error / images.measured.sum())),
            "atoms_per_image": len(coded.atoms) / coded.n_images,
            "index_bits": coded.index_bits / coded.n_images,
            "coefficient_bits": coded.coefficient_bits / coded.n_images,
            "code_bytes": bits / 8,
            "dictionary_bytes_raw": raw,
            "dictionary_bytes": min(raw, compact),
            "total_bytes": bits / 8 + min(raw, compact),
        }

    fixed = code(dct(), images, images.tolerance)
    yield result("DCT", fixed)
    for n_atoms in ATOMS:
        own = learn(images, n_atoms)
        coded = to_error(
            fixed.squared_error, images.tolerance, lambda t, own=own: code(own, images, t)
        )
        yield result(f"K-SVD {n_atoms}, in sample", coded, *dictionary_bytes(own))
        halves = [(learn(images, n_atoms, half), other) for half, other in (SPLIT, SPLIT[::-1])]

        def held_out(tolerance: float, halves: Halves = halves) -> Coded:
            first, second = (code(learned, images, tolerance, rest) for learned, rest in halves)
            return first + second

        coded = to_error(fixed.squared_error, images.tolerance, held_out)
        yield result(f"K-SVD {n_atoms}, held out", coded)


HEADER = [
    "scene, pixel, channel",
    "basis",
    "images",
    "error after rounding",
    "coefficients each",
    "bits each: which + how much",
    "code bytes",
    "dictionary bytes (8-bit)",
    "total",
    "against DCT: codes, total",
]


def cells(found: dict[str, Any], fixed: float) -> list[str]:
    scale, unit = (1e3, " mm") if found["channel"] == "depth" else (1.0, "")
    return [
        f"{found['scene']}, {found['level']}, {found['channel']}",
        found["basis"],
        f"{found['images']:,}",
        f"{scale * found['rmse']:.2f}{unit}",
        f"{found['atoms_per_image']:.2f}",
        f"{found['index_bits']:.1f} + {found['coefficient_bits']:.1f}",
        f"{found['code_bytes']:,.0f}",
        f"{found['dictionary_bytes']:,.0f} ({found['dictionary_bytes_raw']:,})",
        f"{found['total_bytes']:,.0f}",
        f"{found['code_bytes'] / fixed - 1:+.0%}, {found['total_bytes'] / fixed - 1:+.0%}",
    ]


def main() -> None:
    options = parse()
    sb.set_num_threads(options.threads)
    check_data()
    if not options.json:
        print_header(*HEADER)
    for name in ("frame", "room"):
        if options.only not in (None, name):
            continue
        for images in images_of(name, options.scale):
            began = time.perf_counter()
            fixed = 0.0
            for found in results(name, images):
                fixed = fixed or found["code_bytes"]
                if options.json:
                    print(json.dumps(found), flush=True)
                else:
                    print_row(*cells(found, fixed))
            seconds = time.perf_counter() - began
            print(f"{name}, {images.level}, {images.channel}: {seconds:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
