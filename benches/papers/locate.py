"""`model.locate` on a hall of laser scans and a simulated building, beside two other tools.

    python benches/papers/locate.py --part hall
    python benches/papers/locate.py --part hall --kinds "90 degrees" --seeds 107 108 109
    python benches/papers/locate.py --part building
    python benches/papers/locate.py --part rooms
    python benches/papers/locate.py --part peers   # pip install kiss-matcher map-closures open3d

The map `half` is of the scans 28, 32, ... of a drive, its queries are 26, 30, ...; `first` maps
scans up to 70, its queries are 72 to 108, up to 9 m away. Every query is turned by a random yaw.
CPU time is that of the process.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from paper_bench import DATA, check_data, print_header, print_row

import surfabet as sb
from surfabet import datasets

Array = NDArray[np.float64]
Query = tuple[str, Array, Array | None]
NEAR, TURNED = 0.2, 2.0
NARROW = "90 degrees"
KINDS = (
    "full",
    NARROW,
    "half",
    "mirrored",
    "90 degrees, mirrored",
    "elsewhere",
    "90 degrees, elsewhere",
    "full, with a prior",
)


def scan(k: int) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        points = np.asarray(sb.read(DATA / f"multi_scan/full{k}.pcd").points, np.float64)
    return points[np.linalg.norm(points, axis=1) > 0.5]


def drive() -> tuple[dict[int, Array], Array]:
    """The scans of the drive, and the poses of all."""
    poses = np.loadtxt(DATA / "multi_scan/alidarPose.csv", delimiter=",", usecols=range(4))
    poses = poses.reshape(-1, 4, 4)
    poses[:, 3] = [0, 0, 0, 1]
    return {k: scan(k) for k in range(26, 110, 2)}, poses


def yaw(angle: float) -> Array:
    s, c = np.sin(angle), np.cos(angle)
    pose = np.eye(4)
    pose[:2, :2] = [[c, -s], [s, c]]
    return pose


def errors(found: Array, pose: Array) -> tuple[float, float]:
    """Metres and degrees."""
    turn = found[:3, :3].T @ pose[:3, :3]
    cosine = np.clip((np.trace(turn) - 1) / 2, -1, 1)
    return float(np.linalg.norm(found[:3, 3] - pose[:3, 3])), float(np.rad2deg(np.arccos(cosine)))


def is_right(found: Array, pose: Array | None) -> bool:
    if pose is None:
        return False
    away, turned = errors(found, pose)
    return away < NEAR and turned < TURNED


def merged(scans: dict[int, Array], poses: Array, numbers: list[int]) -> sb.PointCloud:
    parts = [scans[k] @ poses[k][:3, :3].T + poses[k][:3, 3] for k in numbers]
    return thinned(sb.PointCloud(np.concatenate(parts)), 0.05)


def thinned(cloud: sb.PointCloud, side: float) -> sb.PointCloud:
    return sb.voxel_downsample(cloud, side)


def hall_queries(
    scans: dict[int, Array], poses: Array, numbers: list[int], seeds: Sequence[int] = (7,)
) -> dict[str, list[Query]]:
    """By kind: as it is, a view of 90 degrees, half of the points, mirrored, both."""
    found: dict[str, list[Query]] = {kind: [] for kind in KINDS[:5]}
    for random, k in ((random, k) for random in map(np.random.default_rng, seeds) for k in numbers):
        turn = yaw(random.uniform(0, 2 * np.pi))
        points, pose = scans[k] @ turn[:3, :3], poses[k] @ turn
        found["full"].append((str(k), points, pose))
        found[NARROW].append((str(k), points[is_ahead(points)], pose))
        found["90 degrees, mirrored"].append((str(k), points[is_ahead(points)] * [1, -1, 1], None))
        found["half"].append((str(k), points[random.random(len(points)) < 0.5], pose))
        found["mirrored"].append((str(k), points * [1, -1, 1], None))
    return found


def is_ahead(points: Array) -> NDArray[np.bool_]:
    return np.abs(np.arctan2(points[:, 1], points[:, 0])) < np.pi / 4


def narrow_elsewhere(seeds: Sequence[int]) -> list[Query]:
    """A view of 90 degrees of every scan of another place, of each seed."""
    found: list[Query] = []
    for random in map(np.random.default_rng, seeds):
        for name, points, _ in elsewhere():
            turned = points @ yaw(random.uniform(0, 2 * np.pi))[:3, :3]
            found.append((name, turned[is_ahead(turned)], None))
    return found


def elsewhere() -> list[Query]:
    """Scans of other places."""
    found: list[Query] = []
    for pattern in ("indoor_scan/*.pcd", "outdoor_360/*.bin"):
        for path in sorted(DATA.glob(pattern)):
            found.append((path.name, np.asarray(sb.read(path).points, np.float64), None))
    for seed in range(4):
        room = datasets.make_room(seed=seed, size=(7 + seed, 6, 2.8))
        for frame in datasets.scan_lidar(room, n_scans=2, random_state=seed).frames:
            found.append((f"room {seed}", local(frame), None))
    return found


def local(frame: sb.datasets.Frame) -> Array:
    """Points of a simulated frame in the frame of its sensor."""
    pose = np.asarray(frame.pose)
    return (np.asarray(frame.cloud.points, np.float64) - pose[:3, 3]) @ pose[:3, :3]


def ask(
    model: sb.PatchModel | sb.AlphabetModel | sb.PlaneModel,
    queries: list[Query],
    prior: bool = False,
) -> list[object]:
    """How each was answered, then median error and time.

    `listed` is the right place among those that an ambiguous refusal gives with probabilities.
    """
    right = named = missed = listed = ambiguous = wrong = refused = 0
    away, milliseconds = [], []
    for name, points, pose in queries:
        cloud = sb.PointCloud(points)
        near = None
        if prior and pose is not None:
            near = pose @ yaw(np.deg2rad(5))
            near[:3, 3] += [0.3, -0.3, 0.1]
        start = time.process_time()
        found = model.locate(cloud, prior=near, top=32)
        milliseconds.append(1000 * (time.process_time() - start))
        good = [is_right(place.pose, pose) for place in found]
        if not good and found.is_ambiguous:
            likely = [place for place in found.rejected if place.probability > 0]
            is_listed = any(is_right(place.pose, pose) for place in likely)
            listed += is_listed
            ambiguous += not is_listed
        elif not good:
            refused += 1
        elif not any(good):
            missed += len(good) > 1
            wrong += len(good) == 1
            print(f"<!-- without the right one: {name} {found} -->")
        elif len(good) == 1:
            right += 1
        else:
            named += 1
        if any(good) and pose is not None:
            away.append(errors(found[good.index(True)].pose, pose))
    centre = (
        [100 * np.median([a for a, _ in away]), np.median([t for _, t in away])]
        if away
        else [np.nan] * 2
    )
    return [
        len(queries),
        right,
        named,
        missed,
        wrong,
        listed,
        ambiguous,
        refused,
        f"{centre[0]:.1f}",
        f"{centre[1]:.2f}",
        f"{np.median(milliseconds):.0f}",
        f"{np.percentile(milliseconds, 95):.0f}",
    ]


COLUMNS = (
    "queries",
    "right",
    "right, among several",
    "several, none right",
    "wrong",
    "ambiguous, right one listed",
    "ambiguous, not listed",
    "refused",
    "median error cm",
    "degrees",
    "median CPU ms",
    "95th percentile",
)


def hall_maps(cloud: sb.PointCloud) -> Iterator[tuple[str, sb.PatchModel | sb.AlphabetModel]]:
    yield "patches", sb.learn_patches(cloud, resolution=0.08, completeness=0, rate=4)
    yield "alphabet", sb.learn_alphabet(thinned(cloud, 0.1))


def splits() -> dict[str, tuple[list[int], list[int]]]:
    numbers = list(range(26, 110, 2))
    return {
        "half": ([k for k in numbers if k % 4 == 0], [k for k in numbers if k % 4]),
        "first": ([k for k in numbers if k <= 70], [k for k in numbers if k > 70]),
    }


def hall(asked_kinds: list[str], seeds: list[int]) -> None:
    scans, poses = drive()
    others = elsewhere()
    print_header("map", "method", "bytes", "queries are", *COLUMNS)
    for split, (of_map, asked) in splits().items():
        queries = hall_queries(scans, poses, asked, seeds)
        queries |= {"elsewhere": others, "full, with a prior": queries["full"]}
        queries |= {"90 degrees, elsewhere": narrow_elsewhere(seeds)}
        for method, model in hall_maps(merged(scans, poses, of_map)):
            size = len(model.to_bytes())
            model.localizer()
            for kind in asked_kinds:
                cells = ask(model, queries[kind], prior=kind == "full, with a prior")
                print_row(split, method, size, kind, *cells)


SEEDS = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 0, 1, 1, 1]
"""Of the rooms of the building: those of one seed are copies."""


def rooms_and_cloud() -> tuple[list[datasets.Scene], list[Array], sb.PointCloud]:
    """20 rooms of 4 x 5, where each stands, and the scan of all."""
    sizes = [(6.0 + 0.4 * (s % 5), 5.0 + 0.3 * (s % 4), 2.6) for s in SEEDS]
    rooms = [datasets.make_room(seed=s, size=size) for s, size in zip(SEEDS, sizes, strict=True)]
    shifts = [np.array([9.0 * (i % 5), 8.0 * (i // 5), 0.0]) for i in range(len(rooms))]
    parts = []
    for room, shift in zip(rooms, shifts, strict=True):
        scans = datasets.scan_lidar(
            room, n_scans=4, elevation_step=1, azimuth_step=1, random_state=1
        )
        parts.append(np.asarray(scans.cloud.points) + shift)
    cloud = thinned(sb.PointCloud(np.concatenate(parts)), 0.03)
    return rooms, shifts, cloud


def rooms(seeds: range = range(40, 48)) -> None:
    """Views of 90 degrees in single rooms, a map each: two scans in four directions."""
    counts = {kind: np.zeros(8, int) for kind in (NARROW, "90 degrees, mirrored")}
    for seed in seeds:
        size = (6.0 + 0.4 * (seed % 5), 5.0 + 0.3 * (seed % 4), 2.6)
        room = datasets.make_room(seed=seed, size=size)
        step = {"elevation_step": 1, "azimuth_step": 1}
        cloud = datasets.scan_lidar(room, n_scans=4, random_state=1, **step).cloud
        model = sb.learn_patches(thinned(cloud, 0.03), resolution=0.06, completeness=0)
        model.localizer()
        random = np.random.default_rng(seed)
        views: list[Query] = []
        poses = room.default_lidar_poses(7)[4:6]
        for frame in datasets.scan_lidar(room, poses, random_state=99, **step).frames:
            for _ in range(4):
                turn = yaw(random.uniform(0, 2 * np.pi))
                points = local(frame) @ turn[:3, :3]
                views.append(
                    (str(seed), points[is_ahead(points)], np.asarray(frame.true_pose) @ turn)
                )
        mirrored: list[Query] = [(name, points * [1, -1, 1], None) for name, points, _ in views]
        for kind, queries in zip(counts, (views, mirrored), strict=True):
            counts[kind] += np.array(ask(model, queries)[:8], int)
    print_header("queries are", *COLUMNS[:8])
    for kind, row in counts.items():
        print_row(kind, *row)


def building() -> None:
    """20 rooms, of which 6 are copies: two of one, four of another."""
    rooms, shifts, cloud = rooms_and_cloud()
    models = {
        "patches": sb.learn_patches(cloud, resolution=0.06, completeness=0),
        "alphabet": sb.learn_alphabet(cloud),
    }
    print_header(
        "method",
        "bytes",
        "queries",
        "all equal rooms named",
        "right room first or equal",
        "wrong",
        "refused",
        "median error cm",
        "degrees",
        "median CPU ms",
    )
    for method, model in models.items():
        model.localizer()
        complete = first = wrong = refused = n = 0
        away, milliseconds = [], []
        for i, (room, shift) in enumerate(zip(rooms, shifts, strict=True)):
            poses = room.default_lidar_poses(7)[4:6]
            scans = datasets.scan_lidar(
                room, poses, elevation_step=1, azimuth_step=1, random_state=99
            )
            for frame in scans.frames:
                n += 1
                pose = np.asarray(frame.true_pose)
                start = time.process_time()
                found = model.locate(sb.PointCloud(local(frame)), top=8)
                milliseconds.append(1000 * (time.process_time() - start))
                equal = [s for s, seed in zip(shifts, SEEDS, strict=True) if seed == SEEDS[i]]

                def there(to: Array, pose: Array = pose) -> Array:
                    moved = pose.copy()
                    moved[:3, 3] += to
                    return moved

                if not found:
                    refused += 1
                    continue
                named = [any(is_right(p.pose, there(s)) for p in found) for s in equal]
                complete += all(named)
                first += any(is_right(found[0].pose, there(s)) for s in equal)
                wrong += not any(named)
                right = [
                    errors(p.pose, there(shift)) for p in found if is_right(p.pose, there(shift))
                ]
                away += right[:1]
        centre = np.median(away, axis=0) if away else [np.nan, np.nan]
        print_row(
            method,
            len(model.to_bytes()),
            n,
            complete,
            first,
            wrong,
            refused,
            f"{100 * centre[0]:.1f}",
            f"{centre[1]:.2f}",
            f"{np.median(milliseconds):.0f}",
        )


def refined(points: Array, target: sb.PointCloud, start: Array) -> Array:
    """Point to plane ICP of Open3D, so that peers are not judged by their coarse pose."""
    import open3d as o3d

    def cloud(p: Array) -> o3d.geometry.PointCloud:
        made = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(p))).voxel_down_sample(
            0.2
        )
        made.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(0.6, 30))
        return made

    a, b = cloud(points), cloud(np.array(target.points, np.float64))
    plane = o3d.pipelines.registration.TransformationEstimationPointToPlane()
    for reach in (1.0, 0.4):
        start = o3d.pipelines.registration.registration_icp(
            a, b, reach, start, plane
        ).transformation
    return np.asarray(start)


@dataclass
class Answer:
    """The pose that a tool finds, whether it accepts it, and the CPU milliseconds that it took."""

    pose: Array
    is_accepted: bool
    milliseconds: float


Tool = Callable[[Array], Answer]


def kiss_matcher(target: sb.PointCloud) -> Tool:
    """With its own resolution of 0.3 m; accepted from five final inliers on."""
    import kiss_matcher as km

    points = np.asarray(target.points, np.float32)

    def run(query: Array) -> Answer:
        start = time.process_time()
        matcher = km.KISSMatcher(km.KISSMatcherConfig(0.3))
        solution = matcher.estimate(query.astype(np.float32), points)
        spent = 1000 * (time.process_time() - start)
        pose = np.eye(4)
        pose[:3, :3] = np.asarray(solution.rotation)
        pose[:3, 3] = np.asarray(solution.translation).ravel()
        is_accepted = bool(solution.valid) and matcher.get_num_final_inliers() >= 5
        return Answer(pose, is_accepted, spent)

    return run


def fpfh(target: sb.PointCloud) -> Tool:
    """As Open3D's tutorial of global registration, with voxels of 0.5 m; accepted where half fits.

    Features of the map are computed once and do not count.
    """
    import open3d as o3d

    registration = o3d.pipelines.registration
    voxel = 0.5

    def prepared(points: Array) -> tuple[o3d.geometry.PointCloud, registration.Feature]:
        cloud = o3d.geometry.PointCloud(
            o3d.utility.Vector3dVector(np.array(points))
        ).voxel_down_sample(voxel)
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(2 * voxel, 30))
        around = o3d.geometry.KDTreeSearchParamHybrid(5 * voxel, 100)
        return cloud, registration.compute_fpfh_feature(cloud, around)

    there = prepared(np.array(target.points, np.float64))

    def run(query: Array) -> Answer:
        start = time.process_time()
        here = prepared(query)
        o3d.utility.random.seed(0)
        found = registration.registration_ransac_based_on_feature_matching(
            here[0],
            there[0],
            here[1],
            there[1],
            True,
            1.5 * voxel,
            registration.TransformationEstimationPointToPoint(False),
            3,
            [
                registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
                registration.CorrespondenceCheckerBasedOnDistance(1.5 * voxel),
            ],
            registration.RANSACConvergenceCriteria(1_000_000, 0.999),
        )
        spent = 1000 * (time.process_time() - start)
        return Answer(np.asarray(found.transformation), found.fitness > 0.5, spent)

    return run


def map_closures(
    scans: dict[int, Array], poses: Array, of_map: list[int], resolution: float
) -> tuple[int, Tool]:
    """Bytes of its own database, and the best closure with the scans that are in it.

    Accepted beyond five inliers, its default. Filling the database does not count.
    """
    from map_closures.config import MapClosuresConfig
    from map_closures.map_closures import MapClosures

    def filled() -> MapClosures:
        matcher = MapClosures(MapClosuresConfig(density_map_resolution=resolution))
        for number, k in enumerate(of_map):
            matcher.get_best_closure(number, scans[k])
        return matcher

    with tempfile.TemporaryDirectory() as folder:
        filled().save_hbst_database(str(Path(folder) / "map"))
        size = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())

    def run(query: Array) -> Answer:
        # A question is kept as a part of the map, so that each has a map of its own.
        matcher = filled()
        start = time.process_time()
        # Numbers nearby are taken for neighbours of a drive and not compared.
        closure = matcher.get_best_closure(len(of_map) + 1000, np.array(query))
        spent = 1000 * (time.process_time() - start)
        if closure.number_of_inliers == 0:
            return Answer(np.eye(4), False, spent)
        pose = poses[of_map[closure.source_id]] @ np.linalg.inv(np.asarray(closure.pose))
        return Answer(pose, closure.number_of_inliers > 5, spent)

    return size, run


def ours(model: sb.PatchModel) -> Tool:
    def run(query: Array) -> Answer:
        start = time.process_time()
        found = model.locate(sb.PointCloud(query), top=1)
        spent = 1000 * (time.process_time() - start)
        return Answer(found[0].pose if found else np.eye(4), bool(found), spent)

    return run


def peers(n_queries: int) -> None:
    scans, poses = drive()
    of_map, asked = splits()["half"]
    cloud = merged(scans, poses, of_map)
    model = sb.learn_patches(cloud, resolution=0.08, completeness=0, rate=4)
    kinds = hall_queries(scans, poses, asked[:: max(1, len(asked) // n_queries)][:n_queries])
    others = elsewhere()
    others = others[:: max(1, len(others) // n_queries)][:n_queries]
    model.localizer()
    size, decoded = len(model.to_bytes()), model.decode(0.1)
    tools: list[tuple[str, str, int, Tool]] = [
        ("surfabet", "model", size, ours(model)),
        ("KISS-Matcher", "full cloud", 12 * len(cloud), kiss_matcher(cloud)),
        ("Open3D FPFH and RANSAC", "full cloud", 12 * len(cloud), fpfh(cloud)),
        ("KISS-Matcher", "decoded model", size, kiss_matcher(decoded)),
        ("Open3D FPFH and RANSAC", "decoded model", size, fpfh(decoded)),
    ]
    for resolution in (0.5, 0.1):
        own, run = map_closures(scans, poses, of_map, resolution)
        tools.append(("MapClosures", f"single scans, images of {resolution} m", own, run))
    print_header(
        "tool",
        "map",
        "bytes",
        "queries",
        "right pose",
        "right and accepted",
        "accepted of mirrored",
        "accepted of other places",
        "of",
        "median CPU ms",
    )
    for name, of, size, run in tools:
        answers = [(run(points), points, pose) for _, points, pose in kinds["full"]]
        right = [is_right(refined(p, cloud, a.pose), pose) for a, p, pose in answers]
        accepted = [
            sum(run(points).is_accepted for _, points, _ in queries)
            for queries in (kinds["mirrored"], others)
        ]
        print_row(
            name,
            of,
            size,
            len(right),
            sum(right),
            sum(r and a.is_accepted for r, (a, _, _) in zip(right, answers, strict=True)),
            *accepted,
            len(others),
            f"{np.median([a.milliseconds for a, _, _ in answers]):.0f}",
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--part", choices=["hall", "building", "rooms", "peers"], default="hall")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS), help="hall")
    parser.add_argument("--seeds", type=int, nargs="+", default=[7], help="hall: of the views")
    parser.add_argument("--queries", type=int, default=7, help="of the peers")
    options = parser.parse_args()
    if options.part == "building":
        building()
        return
    if options.part == "rooms":
        rooms()
        return
    check_data()
    if options.part == "hall":
        hall(options.kinds, options.seeds)
    else:
        peers(options.queries)


if __name__ == "__main__":
    main()
