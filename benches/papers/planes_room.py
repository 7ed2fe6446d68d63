"""Planes of simulated rooms against the truth, beside Open3D's plane finders.

    python benches/papers/planes_room.py [--noise 0 0.005 0.01 0.02 0.03] [--rooms 0 1]
                                         [--step 0.5] [--ransac]

Rooms are seen by a simulated laser from four places, with range noise. True planes are the flat
pieces of surface; pieces that are coplanar to a millimetre and within 5 cm of each other (doors of
a cupboard) are one. A plane counts if it can be seen: at least 200 points, over a width of at least
four standard deviations of the noise. The width is that of an even strip with the same variance
along the shorter of both axes. A found plane is right if its points and those of a true plane
overlap by more than half (intersection over union). `--min-points` is how many points a plane of
`learn_planes` needs, its default where that is not given.

Open3D: `estimate_normals` with its default of 30 neighbours, oriented to the sensor, then
`detect_planar_patches` with its defaults. It gives boxes; a point belongs to the box that it lies
in, grown to three standard deviations of the noise to both sides where the box is thinner, and to
the one whose plane is nearest if there are several. RANSAC is `segment_plane` at three standard
deviations, 1000 iterations, again and again on what is left until a plane has fewer points than
count. Seconds include normals and all labels. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
import open3d as o3d
from paper_bench import print_header, print_row

import surfabet as sb
from surfabet import datasets

COLUMNS = [
    "room",
    "noise mm",
    "points",
    "finder",
    "planes (true)",
    "precision",
    "recall",
    "planes per true plane",
    "within 3 sigma",
    "mean distance mm",
    "seconds",
]
SHARE = 1e-3
LEAST_POINTS = 200
LEAST_SIGMAS = 4.0
SAME_ANGLE = np.cos(np.radians(1.0))
SAME_OFFSET = 1e-3
NEAR = 0.05
OUTLIER = -1


def true_planes(scene: datasets.Scene, truth: datasets.GroundTruth) -> np.ndarray:
    """The true plane of every point, -1 on curved surfaces."""
    surfaces = scene.surfaces
    flat = [s.id for s in surfaces if s.kind == "plane"]
    low = {s: np.full(3, np.inf) for s in flat}
    high = {s: np.full(3, -np.inf) for s in flat}
    order = np.argsort(truth.surfaces, kind="stable")
    ids, starts = np.unique(truth.surfaces[order], return_index=True)
    for surface, members in zip(ids, np.split(order, starts[1:]), strict=True):
        if surface in low:
            low[surface] = truth.points[members].min(axis=0)
            high[surface] = truth.points[members].max(axis=0)
    group = {s: s for s in flat}

    def root(s: int) -> int:
        while group[s] != s:
            s = group[s]
        return s

    for k, a in enumerate(flat):
        for b in flat[:k]:
            parallel = np.dot(surfaces[a].direction, surfaces[b].direction) > SAME_ANGLE
            level = abs(surfaces[a].offset - surfaces[b].offset) < SAME_OFFSET
            if (
                parallel
                and level
                and np.all((low[a] <= high[b] + NEAR) & (low[b] <= high[a] + NEAR))
            ):
                group[root(a)] = root(b)
    table = np.full(len(surfaces), OUTLIER)
    for s in flat:
        table[s] = root(s)
    return table[truth.surfaces]


class Score:
    """Found planes against true ones."""

    def __init__(
        self, found: np.ndarray, true: np.ndarray, places: np.ndarray, sigma: float
    ) -> None:
        pairs, joint = np.unique(np.stack([found, true]), axis=1, return_counts=True)
        of_found = dict(zip(*np.unique(found, return_counts=True), strict=True))
        of_true = dict(zip(*np.unique(true, return_counts=True), strict=True))
        right_found, right_true, best = set(), set(), {}
        for (f, t), n in zip(pairs.T, joint, strict=True):
            if f == OUTLIER or t == OUTLIER:
                continue
            if n > best.get(f, (0, 0))[0]:
                best[f] = (n, t)
            if n / (of_found[f] + of_true[t] - n) > 0.5:
                right_found.add(f)
                right_true.add(t)
        planes = {
            t
            for t, n in of_true.items()
            if t != OUTLIER
            and n >= LEAST_POINTS
            and width(places[true == t]) >= LEAST_SIGMAS * sigma
        }
        self.found = len(of_found.keys() - {OUTLIER})
        self.true = len(planes)
        self.precision = len(right_found) / max(self.found, 1)
        self.recall = len(right_true & planes) / max(len(planes), 1)
        hit = [t for _, t in best.values() if t in planes]
        self.segments = len(hit) / max(len(set(hit)), 1)


def width(points: np.ndarray) -> float:
    """Width of an even strip with the variance of flat points along the shorter of both axes."""
    return float(np.sqrt(12 * max(np.linalg.eigvalsh(np.cov(points.T))[1], 0.0)))


def fit_error(points: np.ndarray, labels: np.ndarray, sigma: float) -> tuple[float, float]:
    """Share of points within 3 sigma of the fitted plane of their label, and mean distance."""
    near, total, n = 0, 0.0, 0
    for label in np.unique(labels[labels != OUTLIER]):
        own = points[labels == label]
        centered = own - own.mean(axis=0)
        _, _, axes = np.linalg.svd(centered.T @ centered)
        distance = np.abs(centered @ axes[2])
        near += int((distance <= 3 * sigma).sum())
        total += float(distance.sum())
        n += len(own)
    return near / len(points), total / max(n, 1)


def planar_patches(points: np.ndarray, sensors: np.ndarray, sigma: float) -> np.ndarray:
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
    normals = np.asarray(cloud.normals)
    normals[np.einsum("ij,ij->i", normals, sensors - points) < 0] *= -1
    boxes = cloud.detect_planar_patches()
    labels = np.full(len(points), OUTLIER)
    nearest = np.full(len(points), np.inf)
    for k, box in enumerate(boxes):
        thick = np.array(box.extent)
        thick[2] = max(thick[2], 6 * sigma)
        grown = o3d.geometry.OrientedBoundingBox(box.center, box.R, thick)
        inside = np.asarray(grown.get_point_indices_within_bounding_box(cloud.points), dtype=int)
        distance = np.abs((points[inside] - box.center) @ box.R[:, 2])
        closer = distance < nearest[inside]
        labels[inside[closer]] = k
        nearest[inside[closer]] = distance[closer]
    return labels


def ransac(points: np.ndarray, sensors: np.ndarray, sigma: float) -> np.ndarray:
    labels = np.full(len(points), OUTLIER)
    left = np.arange(len(points))
    least = max(int(SHARE * len(points)), 3)
    o3d.utility.random.seed(0)
    k = 0
    while len(left) >= least:
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points[left]))
        _, inside = cloud.segment_plane(max(3 * sigma, 1e-3), 3, 1000)
        if len(inside) < least:
            break
        labels[left[inside]] = k
        k += 1
        left = np.delete(left, inside)
    return labels


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.005, 0.01, 0.02, 0.03])
    parser.add_argument("--rooms", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--step", type=float, default=0.5, help="between beams, degrees")
    parser.add_argument("--min-points", type=int, help="of a plane of learn_planes")
    parser.add_argument("--ransac", action="store_true", help="also RANSAC, which is slow")
    options = parser.parse_args()

    def ours(points: np.ndarray, sensors: np.ndarray, sigma: float) -> np.ndarray:
        places, index = np.unique(sensors, axis=0, return_inverse=True)
        cloud = sb.PointCloud(points, viewpoints=places, viewpoint_index=index.ravel())
        labels = sb.learn_planes(cloud, min_points=options.min_points).labels
        assert labels is not None
        return labels

    finders: dict[str, Callable[[np.ndarray, np.ndarray, float], np.ndarray]] = {
        "surfabet": ours,
        "detect_planar_patches": planar_patches,
    }
    if options.ransac:
        finders["segment_plane, repeated"] = ransac
    print_header(*COLUMNS)
    for room in options.rooms:
        scene = datasets.make_room(seed=room)
        for noise in options.noise:
            scan = datasets.scan_lidar(
                scene, range_noise=noise, elevation_step=options.step, azimuth_step=options.step
            )
            points = np.array(scan.cloud.points)
            true = true_planes(scene, scan.ground_truth)
            assert scan.cloud.viewpoints is not None
            sensors = scan.cloud.viewpoints[scan.cloud.viewpoint_index]
            for name, find in finders.items():
                began = time.perf_counter()
                labels = find(points, sensors, noise)
                seconds = time.perf_counter() - began
                score = Score(labels, true, scan.ground_truth.points, noise)
                near, distance = fit_error(points, labels, max(noise, 1e-3))
                print_row(
                    room,
                    f"{1000 * noise:g}",
                    f"{len(points):,}",
                    name,
                    f"{score.found} ({score.true})",
                    f"{score.precision:.2f}",
                    f"{score.recall:.2f}",
                    f"{score.segments:.2f}",
                    f"{near:.3f}",
                    f"{1000 * distance:.2f}",
                    f"{seconds:.1f}",
                )


if __name__ == "__main__":
    main()
