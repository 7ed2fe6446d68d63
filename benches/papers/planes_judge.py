"""How the judge of `learn_planes` is trained, which tells surfaces from other patches.

    python benches/papers/planes_judge.py --figures FOLDER [--rooms]
    python benches/papers/planes_judge.py --train FOLDER
    python benches/papers/planes_judge.py --check SCENES

`--figures` runs the fit up to where patches are judged and writes what the judge gets of every
patch, and whether it is right: whether its points and those of a true plane overlap by more than
half. Scenes are 2400 generated ones (seeds 0 to 2399), or with `--rooms` the simulated rooms 0,
2, 4 and 6 at five noises, whole and thinned to an eighth. Generated are boxes, rooms, prisms,
L-shapes, stairs, houses, tables, shelves, loose rectangles, each alone or among clutter, and
spheres, cylinders, cones, tori, waves and heaps alone, which have no plane. A face is 6 to 1000
standard deviations of the noise wide, a scene has 30 to 100,000 points; points are even, or those
of a sensor.

`--train` fits a network of one layer by L-BFGS to both and prints it as `planes/constants.rs` has
it. All right patches count a second time with half the weight as surfaces of real scans, which
are nearly flat, not exactly: warped, thinner than the noise that is assumed, with gaps
(`warped`). The same figures give the same network, but the weights of `planes/constants.rs` are
not what it prints: they were made by an earlier form of this script, from figures of a state in
which clouds without flat cells had no patches. Those figures are not kept.

`--check` counts what `learn_planes` as it is finds in generated scenes that no judge has seen,
seeds from 100000 on, as `planes_room.py` does. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from paper_bench import print_header, print_row
from planes_room import OUTLIER, Score, true_planes
from scipy.optimize import minimize

import surfabet as sb
from surfabet import _core, datasets

ROOMS = (0, 2, 4, 6)
ROOM_NOISES = (0.002, 0.005, 0.01, 0.02, 0.04)
ROOM_THINNINGS = (1, 8)
SCENES = 2400
UNSEEN = 100_000
UNITS = 16
DECAY = 3.0
STEPS = 250
MOST_WARP = 0.6
WARPED_WEIGHT = 0.5
NAMES = [
    "gain", "spread", "kurtosis", "fill", "certainty", "length", "width", "near", "within",
    "points", "bend", "turn", "beside", "far_beside",
]  # fmt: skip
OPTIONS = {"min_probability": 0.0}


# Scenes. A surface is its area and a function that draws points on it; a plane has a number.


@dataclass(frozen=True)
class Surface:
    """A piece of surface."""

    area: float
    draw: Callable[[np.random.Generator, int], np.ndarray]
    flat: bool = True


def rectangle(corner: np.ndarray, u: np.ndarray, v: np.ndarray, hole: float = 0.0) -> Surface:
    """A rectangle, of which a share may be missing in its middle."""
    side = np.sqrt(hole)

    def draw(rng: np.random.Generator, n: int) -> np.ndarray:
        at = rng.random((n, 2))
        while hole and (inside := (np.abs(at - 0.5) < side / 2).all(axis=1)).any():
            at[inside] = rng.random((inside.sum(), 2))
        return corner + at[:, :1] * u + at[:, 1:] * v

    return Surface(float(np.linalg.norm(np.cross(u, v))) * (1 - hole), draw)


def prism(corners: np.ndarray, height: float, caps: bool) -> list[Surface]:
    """The walls over a polygon, and its triangles about the middle as floor and roof."""
    rise = np.array([0, 0, height])
    ground = np.column_stack([corners, np.zeros(len(corners))])
    walls = [
        rectangle(a, b - a, rise) for a, b in zip(ground, np.roll(ground, -1, axis=0), strict=True)
    ]
    return walls + [polygon(corners, z) for z in (0.0, height)] * caps


def polygon(corners: np.ndarray, z: float) -> Surface:
    """A polygon that is seen whole from its middle, at a height."""
    middle = corners.mean(axis=0)
    a, b = corners - middle, np.roll(corners, -1, axis=0) - middle
    areas = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2

    def draw(rng: np.random.Generator, n: int) -> np.ndarray:
        part = rng.choice(len(areas), n, p=areas / areas.sum())
        s, t = rng.random((2, n, 1))
        s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
        return np.column_stack([middle + s * a[part] + t * b[part], np.full(n, z)])

    return Surface(float(areas.sum()), draw)


def box(low: np.ndarray, size: np.ndarray, without: tuple[int, ...] = ()) -> list[Surface]:
    """The faces of a box; 0 to 2 are the low ones."""
    faces = []
    for k in range(6):
        axis = k % 3
        corner = low + (k >= 3) * size * np.eye(3)[axis]
        u, v = size * np.eye(3)[(axis + 1) % 3], size * np.eye(3)[(axis + 2) % 3]
        if k not in without:
            faces.append(rectangle(corner, u, v))
    return faces


def scene_box(rng: np.random.Generator) -> list[Surface]:
    size = rng.uniform(0.2, 1, 3) if rng.random() < 0.7 else np.ones(3)
    if rng.random() < 0.5:
        return box(np.zeros(3), size)
    floor = rectangle(np.array([-1.0, -1, 0]), np.array([3.0, 0, 0]), np.array([0, 3.0, 0]))
    return [*box(np.zeros(3), size, (2,)), floor]


def scene_room(rng: np.random.Generator) -> list[Surface]:
    size = rng.uniform(0.5, 2, 3)
    faces = box(np.zeros(3), size)
    for _ in range(rng.integers(0, 6)):
        own = size * rng.uniform(0.05, 0.4, 3)
        low = rng.uniform(0, 1, 3) * (size - own) * [1, 1, 0]
        faces += box(low, own, (2,))
    return faces


def scene_prism(rng: np.random.Generator) -> list[Surface]:
    n = int(rng.integers(3, 9))
    turn = np.arange(n) * 2 * np.pi / n
    corners = 0.5 * np.column_stack([np.cos(turn), np.sin(turn)])
    return prism(corners, rng.uniform(0.3, 2), bool(rng.random() < 0.8))


def scene_corner(rng: np.random.Generator) -> list[Surface]:
    if rng.random() < 0.5:
        fold = rng.uniform(np.pi / 6, 5 * np.pi / 6)
        along = np.array([0, rng.uniform(0.3, 2), 0])
        arm = rng.uniform(0.4, 1) * np.array([np.cos(fold), 0, np.sin(fold)])
        zero = np.zeros(3)
        return [rectangle(zero, np.array([1.0, 0, 0]), along), rectangle(zero, arm, along)]
    a, b = rng.uniform(0.3, 0.7, 2)
    corners = np.array([[0, 0], [1, 0], [1, b], [a, b], [a, 1], [0, 1]])
    return prism(corners, rng.uniform(0.3, 1), False)


def scene_stairs(rng: np.random.Generator) -> list[Surface]:
    n, width = int(rng.integers(3, 12)), rng.uniform(1, 6)
    rise, tread = rng.uniform(0.5, 0.7), 1.0
    across = np.array([0, width, 0])
    faces = []
    for k in range(n):
        at = np.array([k * tread, 0, k * rise])
        faces.append(rectangle(at, np.array([0, 0, rise]), across))
        faces.append(rectangle(at + np.array([0, 0, rise]), np.array([tread, 0, 0]), across))
    return faces


def scene_house(rng: np.random.Generator) -> list[Surface]:
    size = rng.uniform(0.5, 1.5, 3)
    ridge = rng.uniform(0.15, 0.8) * size[0]
    along = np.array([0, size[1], 0])
    half = np.array([size[0] / 2, 0, ridge])
    eaves = np.array([0, 0, size[2]])
    roofs = [
        rectangle(eaves, half, along),
        rectangle(eaves + np.array([size[0], 0, 0]), half * [-1, 1, 1], along),
    ]
    return roofs + box(np.zeros(3), size, (5,) if rng.random() < 0.5 else (2, 5))


def scene_table(rng: np.random.Generator) -> list[Surface]:
    size, leg = rng.uniform(0.4, 1, 3), 0.05
    faces = box(np.array([0, 0, size[2]]), size * [1, 1, 0.05 / size[2]])
    for x in (0, size[0] - leg):
        for y in (0, size[1] - leg):
            faces += box(np.array([x, y, 0]), np.array([leg, leg, size[2]]), (2, 5))
    floor = rectangle(np.array([-1.0, -1, 0]), np.array([3.0, 0, 0]), np.array([0, 3.0, 0]))
    return [*faces, floor]


def scene_shelf(rng: np.random.Generator) -> list[Surface]:
    size = np.array([rng.uniform(0.5, 1.2), rng.uniform(0.2, 0.5), 1.5])
    n = int(rng.integers(2, 7))
    faces = box(np.zeros(3), size, (1,))
    for k in range(1, n):
        corner = np.array([0, 0, size[2] * k / n])
        faces.append(rectangle(corner, size * [1, 0, 0], size * [0, 1, 0]))
        x = 0.0
        while rng.random() < 0.9 and x < size[0]:
            book = np.array([rng.uniform(0.02, 0.06), rng.uniform(0.1, 0.19), 0.15])
            faces += box(corner + np.array([x, 0, 0]), book, (1,))
            x += book[0]
    return faces


def scene_loose(rng: np.random.Generator) -> list[Surface]:
    faces = []
    for _ in range(rng.integers(1, 8)):
        axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        u, v = axes[0] * rng.uniform(0.3, 1), axes[1] * rng.uniform(0.1, 1)
        hole = rng.uniform(0.05, 0.4) if rng.random() < 0.3 else 0.0
        faces.append(rectangle(rng.uniform(0, 1.5, 3), u, v, hole))
    return faces


def curved(area: float, place: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Surface:
    """A surface that is bent: places of two numbers from 0 to 1."""
    return Surface(area, lambda rng, n: place(*rng.random((2, n))), False)


def round_things(rng: np.random.Generator) -> Surface:
    """A sphere or ellipsoid, a cylinder, cone, torus, or wave."""
    at, r, h = rng.uniform(0, 1, 3), rng.uniform(0.15, 0.6), rng.uniform(0.3, 2)
    tau = 2 * np.pi
    kind = rng.integers(0, 5)
    if kind == 0:
        axes = r * (np.ones(3) if rng.random() < 0.6 else rng.uniform(0.5, 1.5, 3))

        def sphere(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            z = 2 * s - 1
            ring = np.sqrt(1 - z * z)
            return at + axes * np.column_stack([ring * np.cos(tau * t), ring * np.sin(tau * t), z])

        return curved(2 * tau * r * r, sphere)
    if kind in (1, 2):
        top = 1.0 if kind == 1 else rng.uniform(0, 0.6)

        def cone(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            wide = r * (1 + (top - 1) * s)
            return at + np.column_stack([wide * np.cos(tau * t), wide * np.sin(tau * t), h * s])

        return curved(tau * r * h, cone)
    if kind == 3:
        thin = r * rng.uniform(0.2, 0.6)

        def torus(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            wide = r + thin * np.cos(tau * t)
            ring = [wide * np.cos(tau * s), wide * np.sin(tau * s), thin * np.sin(tau * t)]
            return at + np.column_stack(ring)

        return curved(tau * tau * r * thin, torus)
    high, often = rng.uniform(0.02, 0.2, 2), rng.uniform(0.5, 3, 2)

    def wave(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        z = high[0] * np.sin(tau * often[0] * s) + high[1] * np.sin(tau * often[1] * t)
        return at + np.column_stack([h * s, h * t, z])

    return curved(h * h, wave)


def heap(rng: np.random.Generator) -> Surface:
    """Points in a volume: a bush."""
    at, size = rng.uniform(0, 1, 3), rng.uniform(0.1, 0.7, 3)
    normal = rng.random() < 0.5

    def draw(rng: np.random.Generator, n: int) -> np.ndarray:
        off = rng.standard_normal((n, 3)) * 0.3 if normal else rng.random((n, 3))
        return at + size * off

    return Surface(
        float(2 * (size[0] * size[1] + size[1] * size[2] + size[0] * size[2])), draw, False
    )


def scene_round(rng: np.random.Generator) -> list[Surface]:
    return [round_things(rng) for _ in range(rng.integers(1, 4))]


def scene_heaps(rng: np.random.Generator) -> list[Surface]:
    return [heap(rng) for _ in range(rng.integers(1, 5))]


KINDS = {
    "box": scene_box,
    "room": scene_room,
    "prism": scene_prism,
    "corner": scene_corner,
    "stairs": scene_stairs,
    "house": scene_house,
    "table": scene_table,
    "shelf": scene_shelf,
    "loose": scene_loose,
    "round": scene_round,
    "heaps": scene_heaps,
}
NEGATIVE = ("round", "heaps")


def generated(seed: int) -> tuple[str, np.ndarray, np.ndarray, float, np.ndarray | None]:
    """Kind, points, the plane of each, noise, and the place of the sensor where there is one."""
    rng = np.random.default_rng(seed)
    kind = list(KINDS)[seed % len(KINDS)]
    surfaces = KINDS[kind](rng)
    if kind not in NEGATIVE and rng.random() < 0.4:
        surfaces = surfaces + [
            (round_things if rng.random() < 0.6 else heap)(rng) for _ in range(rng.integers(1, 4))
        ]
    n = int(np.exp(rng.uniform(np.log(30), np.log(100_000 if rng.random() < 0.15 else 12_000))))
    # A face has a side of about one.
    noise = 1 / np.exp(rng.uniform(np.log(6), np.log(1000)))
    areas = np.array([s.area for s in surfaces])
    sensor = rng.uniform(-1, 2, 3) * [2, 2, 1] if rng.random() < 0.3 else None
    many = n if sensor is None else 8 * n
    of = rng.choice(len(surfaces), many, p=areas / areas.sum())
    points = np.empty((many, 3))
    for k, surface in enumerate(surfaces):
        points[of == k] = surface.draw(rng, int((of == k).sum()))
    if sensor is not None:
        near = np.linalg.norm(points - sensor, axis=1)
        weight = 1 / np.maximum(near, 0.3) ** 2
        kept = rng.choice(many, n, replace=False, p=weight / weight.sum())
        points, of = points[kept], of[kept]
    true = np.where([s.flat for s in surfaces], np.arange(len(surfaces)), OUTLIER)[of]
    if sensor is not None and rng.random() < 0.7:
        rays = points - sensor
        rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-9)
        points = points + noise * rng.standard_normal((n, 1)) * rays
    else:
        points = points + noise * rng.standard_normal((n, 3))
    turned = np.linalg.qr(rng.standard_normal((3, 3)))[0] if rng.random() < 0.5 else np.eye(3)
    # From a cup to a building, with the noise that a scanner has at that size.
    scale = float(np.clip(rng.uniform(1e-3, 3e-2) / noise, 0.05, 60))
    stray = rng.random() < 0.2
    if stray:
        low, high = points.min(axis=0), points.max(axis=0)
        extra = int(rng.uniform(0.02, 0.4) * n)
        points = np.concatenate([points, rng.uniform(low, high, (extra, 3))])
        true = np.concatenate([true, np.full(extra, OUTLIER)])
    points = scale * points @ turned.T
    if rng.random() < 0.2:
        step = rng.choice([1e-3, 1e-4])
        points = np.round(points / step) * step
    view = None if sensor is None or rng.random() < 0.5 else scale * turned @ sensor
    return kind, points, true, scale * noise, view


def cloud_of(points: np.ndarray, view: np.ndarray | None) -> sb.PointCloud:
    if view is None:
        return sb.PointCloud(points)
    index = np.zeros(len(points), np.uint32)
    return sb.PointCloud(points, viewpoints=view[None], viewpoint_index=index)


# What is right.


def overlaps(found: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest intersection over union of each found plane with a true one, and the reverse."""
    n, m = found.max(initial=-1) + 1, true.max(initial=-1) + 1
    both = (found >= 0) & (true >= 0)
    joint = np.zeros((n, m))
    np.add.at(joint, (found[both], true[both]), 1)
    of_found = np.bincount(found[found >= 0], minlength=n)
    of_true = np.bincount(true[true >= 0], minlength=m)
    union = of_found[:, None] + of_true - joint
    iou = joint / np.maximum(union, 1)
    return iou.max(axis=1, initial=0), iou.max(axis=0, initial=0)


def candidates(cloud: sb.PointCloud, true: np.ndarray) -> np.ndarray:
    """Figures of all patches before any is judged, and 1 for those that are right, (k, f + 1)."""
    labels, figures = _core.plane_candidates(cloud, OPTIONS)
    found = np.full(labels.max(initial=-1) + 1, 0.0)
    best, _ = overlaps(labels, true)
    found[: len(best)] = best > 0.5
    right = np.zeros(len(figures))
    right[: len(found)] = found
    return np.column_stack([figures, right])


def room_scan(room: int, noise: float) -> tuple[datasets.LidarScan, np.ndarray]:
    scene = datasets.make_room(seed=room)
    scan = datasets.scan_lidar(scene, range_noise=noise, elevation_step=0.5, azimuth_step=0.5)
    return scan, true_planes(scene, scan.ground_truth)


def write_figures(folder: Path, rooms: bool) -> None:
    """The figures of all scenes, and where each is from: room or -1, noise or seed, thinning."""
    folder.mkdir(parents=True, exist_ok=True)
    rows, sources = [], []
    if rooms:
        for room in ROOMS:
            for noise in ROOM_NOISES:
                scan, true = room_scan(room, noise)
                for thinning in ROOM_THINNINGS:
                    kept = np.random.default_rng(room).permutation(len(true))[::thinning]
                    kept.sort()
                    found = candidates(scan.cloud.select(kept), true[kept])
                    rows.append(found)
                    sources += [(room, noise, thinning)] * len(found)
                    print(room, noise, thinning, len(found), found[:, -1].mean(), flush=True)
        np.savez(folder / "rooms.npz", rows=np.concatenate(rows), sources=np.array(sources))
        return
    for seed in range(SCENES):
        _, points, true, noise, view = generated(seed)
        found = candidates(cloud_of(points, view), true)
        rows.append(found)
        sources += [(-1, seed, noise)] * len(found)
    np.savez(folder / "generated.npz", rows=np.concatenate(rows), sources=np.array(sources))


def warped(inputs: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Right patches as they would be if their surfaces were warped by part of the noise."""
    figures = dict(zip(NAMES, np.exp(inputs.T), strict=True))
    n, uniform = len(inputs), rng.uniform
    warp = uniform(0, MOST_WARP, n)
    warp *= np.where(rng.random(n) < 0.5, 1, figures["spread"].clip(0.05, 1))
    figures["bend"] = np.hypot(figures["bend"], warp)
    figures["spread"] = np.sqrt(figures["spread"] ** 2 + uniform(1, 2.5, n) * warp**2)
    figures["within"] = figures["within"] * uniform(0.4, 1, n)
    gain = figures["gain"]
    figures["gain"] = np.where(gain > 2, gain - uniform(0, 0.3, n), gain)
    figures["fill"] = figures["fill"] * np.where(rng.random(n) < 0.6, uniform(0.35, 1, n), 1)
    kurtosis = figures["kurtosis"].clip(1.8, 12)
    figures["kurtosis"] = 1.8 + (kurtosis - 1.8) * uniform(0.7, 1.1, n)
    # Beside slivers of the same surface.
    parallel = (rng.random(n) < 0.5) & (figures["gain"] > 2.2)
    figures["turn"][parallel] = uniform(0.03, 0.4, parallel.sum())
    return np.log(np.maximum(np.column_stack([figures[name] for name in NAMES]), 0.01))


def network(
    inputs: np.ndarray, right: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Weights and offsets of the units, what each adds, and the offset of the sum."""
    mean = np.average(inputs, axis=0, weights=weights)
    spread = np.sqrt(np.average((inputs - mean) ** 2, axis=0, weights=weights)) + 1e-9
    x, w = (inputs - mean) / spread, weights / weights.sum() * len(weights)
    d, h = x.shape[1], UNITS

    def parts(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        return t[: h * d].reshape(h, d), t[h * d : h * d + h], t[h * d + h : -1], t[-1]

    def loss(t: np.ndarray) -> tuple[float, np.ndarray]:
        a, b, v, c = parts(t)
        units = np.tanh(x @ a.T + b)
        out = units @ v + c
        off = (1 / (1 + np.exp(-out)) - right) * w
        back = off[:, None] * v * (1 - units * units)
        value = (w * (np.logaddexp(0, out) - right * out)).sum()
        value += 0.5 * DECAY * ((a**2).sum() + (v**2).sum())
        slope = [(back.T @ x + DECAY * a).ravel(), back.sum(0), units.T @ off + DECAY * v]
        return value, np.concatenate([*slope, [off.sum()]])

    rng = np.random.default_rng(0)
    first = [rng.normal(size=h * d) / np.sqrt(d), 0.1 * rng.normal(size=h)]
    first += [rng.normal(size=h) / np.sqrt(h), np.zeros(1)]
    best = minimize(
        loss, np.concatenate(first), jac=True, method="L-BFGS-B",
        options={"maxiter": STEPS, "maxcor": 20},
    )  # fmt: skip
    a, b, v, c = parts(best.x)
    return a / spread, b - (a / spread) @ mean, v, float(c)


def train(folder: Path) -> None:
    """Prints the network. Rooms and generated scenes have the same weight in all."""
    rooms, scenes = np.load(folder / "rooms.npz"), np.load(folder / "generated.npz")
    _, noise, thinning = rooms["sources"].T
    scanned = np.isin(noise, (0.005, 0.02)) & (thinning == 1)
    of_rooms = np.where(scanned, 2.0, 1.0)
    n = len(scenes["rows"])
    sets = [(rooms["rows"], of_rooms), (scenes["rows"], np.full(n, of_rooms.sum() / n))]
    rng = np.random.default_rng(0)
    inputs = [rows[:, :-1] for rows, _ in sets]
    right = [rows[:, -1] for rows, _ in sets]
    weights = [w for _, w in sets]
    for rows, w in sets:
        is_right = rows[:, -1] > 0
        inputs.append(warped(rows[is_right, :-1], rng))
        right.append(np.ones(is_right.sum()))
        weights.append(WARPED_WEIGHT * w[is_right])
    a, b, v, c = network(*(np.concatenate(of) for of in (inputs, right, weights)))
    for k in np.argsort(-np.abs(v)):
        row = ", ".join(f"{x:.2f}" for x in a[k])
        print(f"    Unit {{ weights: [{row}], offset: {b[k]:.2f}, output: {v[k]:.2f} }},")
    print(f"SURFACE_OFFSET: {c:.2f}")


def check(scenes: int) -> None:
    """Prints what is found in unseen scenes, by kind: planes, the right ones, and true planes."""
    counts = {kind: np.zeros(5, int) for kind in KINDS}
    for seed in range(UNSEEN, UNSEEN + scenes):
        kind, points, true, noise, view = generated(seed)
        labels = sb.learn_planes(cloud_of(points, view)).labels
        assert labels is not None
        score = Score(labels, true, points, noise)
        right, met = score.precision * score.found, score.recall * score.true
        counts[kind] += [1, score.found, round(right), score.true, round(met)]
    print_header("kind", "scenes", "planes", "right", "precision", "true", "found", "recall")
    for kind, row in [*counts.items(), ("all", np.sum(list(counts.values()), axis=0))]:
        n, planes, right, seen, met = row
        precision, recall = right / max(planes, 1), met / max(seen, 1)
        print_row(kind, n, planes, right, f"{precision:.2f}", seen, met, f"{recall:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--figures", type=Path, help="folder to write figures to")
    parser.add_argument("--rooms", action="store_true", help="figures of rooms, not of scenes")
    parser.add_argument("--train", type=Path, help="folder of figures to train by")
    parser.add_argument("--check", type=int, help="how many unseen scenes to learn planes of")
    options = parser.parse_args()
    if options.check:
        check(options.check)
    if options.train:
        train(options.train)
    if options.figures:
        write_figures(options.figures, options.rooms)


if __name__ == "__main__":
    main()
