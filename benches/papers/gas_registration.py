"""Registration on raw, voxel-grid and GNG clouds (Morell et al., last table, in today's terms).

    python benches/papers/gas_registration.py [--pairs 5] [--seeds 3]

Pairs of overlapping real RGB-D frames of the kitchen with known poses. Of each frame: the raw cloud
(every fourth row and column of pixels), and the voxel grid's means and the neurons of a gas, in
equal number. Keypoints are Open3D's ISS, or all points; descriptors FPFH; the transformation comes
from RANSAC over matched descriptors, without refinement. The error is the root mean squared
distance between the source's points under the estimated and under the known transformation, in
metres: median and quartiles over pairs and seeds. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from gas_scans import DATA

import surfabet as sb

try:
    import open3d as o3d
except ImportError as error:
    sys.exit(f"{error}; pip install open3d")

COUNTS = [5000, 10_000]
RADIUS = 0.15
"""Of the descriptors, metres; normals come from within half of it."""


def frame(number: int) -> tuple[sb.PointCloud, np.ndarray]:
    """A frame in camera coordinates and its pose, camera to world."""
    folder = DATA / "rgbd_room"
    pose = np.loadtxt(folder / f"frame-{number:06d}.pose.txt")
    fx, _, cx, _, fy, cy = np.loadtxt(folder / "camera-intrinsics.txt").ravel()[:6]
    image = o3d.io.read_image(str(folder / f"frame-{number:06d}.depth.png"))
    depth = np.asarray(image).astype(np.float64)[::4, ::4] / 1000
    v, u = np.nonzero((depth > 0.3) & (depth < 4))
    z = depth[v, u]
    points = np.stack([(4 * u - cx) * z / fx, (4 * v - cy) * z / fy, z], axis=1)
    return sb.PointCloud(points), pose


def describe(points: np.ndarray, keypoints: bool) -> tuple[o3d.geometry.PointCloud, object]:
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=RADIUS / 2, max_nn=30))
    cloud.orient_normals_towards_camera_location(np.zeros(3))
    search = o3d.geometry.KDTreeSearchParamHybrid(radius=RADIUS, max_nn=200)
    features = o3d.pipelines.registration.compute_fpfh_feature(cloud, search)
    if not keypoints:
        return cloud, features
    found = o3d.geometry.keypoint.compute_iss_keypoints(cloud)
    tree = o3d.geometry.KDTreeFlann(cloud)
    chosen = [tree.search_knn_vector_3d(p, 1)[1][0] for p in found.points]
    picked = o3d.pipelines.registration.Feature()
    picked.data = np.asarray(features.data)[:, chosen]
    return cloud.select_by_index(chosen), picked


def deviation(
    source: np.ndarray, target: np.ndarray, known: np.ndarray, keypoints: bool, seed: int
) -> float:
    o3d.utility.random.seed(seed)
    (a, of_a), (b, of_b) = (describe(points, keypoints) for points in (source, target))
    if min(len(a.points), len(b.points)) < 4:
        return float("nan")
    pipeline = o3d.pipelines.registration
    result = pipeline.registration_ransac_based_on_feature_matching(
        a, b, of_a, of_b, True, 0.06, pipeline.TransformationEstimationPointToPoint(False), 3,
        [pipeline.CorrespondenceCheckerBasedOnEdgeLength(0.9)],
        pipeline.RANSACConvergenceCriteria(50_000, 0.999),
    )  # fmt: skip
    estimated = np.asarray(result.transformation)
    off = source @ (estimated - known)[:3, :3].T + (estimated - known)[:3, 3]
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    numbers = [180 * i for i in range(options.pairs)]
    frames = [(frame(n), frame(n + 20)) for n in numbers]
    known = [np.linalg.inv(second[1]) @ first[1] for first, second in frames]
    reducers = {
        "GNG": lambda cloud, n: sb.learn_gas(cloud, n_neurons=n).neurons.positions,
        "voxel grid": lambda cloud, n: sb.voxel_downsample(cloud, count=n).points,
    }
    columns = [(name, count) for name in reducers for count in COUNTS]
    clouds: dict[tuple[str, int], list[tuple[np.ndarray, np.ndarray]]] = {
        (name, count): [
            (reducers[name](first[0], count), reducers[name](second[0], count))
            for first, second in frames
        ]
        for name, count in columns
    }
    columns.append(("raw", 0))
    clouds["raw", 0] = [(first[0].points, second[0].points) for first, second in frames]
    print(f"{options.pairs} pairs, {options.seeds} seeds; median [quartiles] in m\n")
    titles = [f"{name}, {count:,}" if count else name for name, count in columns]
    print("| keypoints | " + " | ".join(titles) + " |")
    print("|" + "---|" * (len(columns) + 1))
    for keypoints in (True, False):
        cells = []
        for column in columns:
            errors = [
                deviation(source, target, to, keypoints, seed)
                for (source, target), to in zip(clouds[column], known, strict=True)
                for seed in range(options.seeds)
            ]
            low, middle, high = np.nanpercentile(errors, [25, 50, 75])
            lost = int(np.isnan(errors).sum())
            note = f", {lost} without keypoints" if lost else ""
            cells.append(f"{middle:.3f} [{low:.3f}, {high:.3f}]{note}")
        print(f"| {'ISS' if keypoints else 'all'} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
