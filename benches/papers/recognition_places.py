"""Places: which of many a scan shows, with its pose; precision and recall; kinds of rooms.

    python benches/papers/recognition_places.py --part real
    python benches/papers/recognition_places.py --part simulated
    python benches/papers/recognition_places.py --part kinds
    python benches/papers/recognition_places.py --part copies

`real`: every scan is asked for among all others. Scans of the hall within 5 m of each other are of
one place, those farther apart of one building only; the two scans of the room, and the three of the
street, are one place each. `simulated`: one scan per room is in the index, one from elsewhere in
the room, turned, is asked for. `kinds`: rooms of five kinds, two scans each. `copies`: equal rooms
beside similar ones. Rooms with seeds 0 to 7 are for choosing constants (`--choose`), those with
seeds 8 to 23 are reported.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from paper_bench import DATA, check_data, print_header, print_row

import surfabet as sb
from surfabet import datasets

Array = NDArray[np.float64]
NEAR_HALL = 5.0
RADIUS = 0.1
KINDS = {
    "dwelling": ((4.8, 4.0, 2.5), (7.0, 6.0, 2.9)),
    "office": ((3.6, 3.6, 2.5), (7.0, 6.0, 2.9)),
    "classroom": ((6.5, 5.5, 2.6), (9.0, 7.5, 3.2)),
    "library": ((4.8, 4.8, 2.5), (8.0, 7.0, 3.0)),
    "corridor": ((9.0, 1.6, 2.4), (24.0, 2.6, 2.8)),
}


@dataclass
class Place:
    """A scan with what it shows."""

    name: str
    building: str
    cloud: sb.PointCloud
    pose: Array
    """Sensor in the world of its building."""
    model: sb.AlphabetModel


def learned(cloud: sb.PointCloud) -> sb.AlphabetModel:
    return sb.learn_alphabet(cloud, radius=RADIUS, min_range=0.5)


def turned(cloud: sb.PointCloud, angle: float) -> tuple[sb.PointCloud, Array]:
    """The cloud in a frame turned about the vertical, and that frame in the old one."""
    s, c = np.sin(angle), np.cos(angle)
    frame = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    points = np.asarray(cloud.points, np.float64) @ frame[:3, :3]
    return sb.PointCloud(points).seen_from((0, 0, 0)), frame


# ------------------------------------------------------------------------------------- real scans


def real_places(stride: int) -> list[Place]:
    poses = np.loadtxt(DATA / "multi_scan/alidarPose.csv", delimiter=",", usecols=range(4))
    poses = poses.reshape(-1, 4, 4)
    found = [("room", f"indoor_scan/room_scan{k}.pcd", np.eye(4)) for k in (1, 2)]
    found += [("street", f"outdoor_360/{k:06}.bin", np.eye(4)) for k in (0, 2, 4)]
    hall = sorted((DATA / "multi_scan").glob("full*.pcd"), key=lambda p: int(p.stem[4:]))
    for path in hall[::stride]:
        found.append(("hall", f"multi_scan/{path.name}", poses[int(path.stem[4:])]))
    random = np.random.default_rng(11)
    places = []
    for building, name, pose in found:
        cloud, frame = turned(sb.read(DATA / name), random.uniform(0, 2 * np.pi))
        pose = pose.copy()
        pose[3] = [0, 0, 0, 1]
        places.append(Place(Path(name).stem, building, cloud, pose @ frame, learned(cloud)))
    return places


def is_same_place(a: Place, b: Place) -> bool:
    near = float(np.linalg.norm(a.pose[:3, 3] - b.pose[:3, 3])) <= NEAR_HALL
    return a.building == b.building and (a.building != "hall" or near)


def real(stride: int) -> None:
    places = real_places(stride)
    index = sb.place_index({p.name: p.model for p in places})
    similar = index.similarities
    np.fill_diagonal(similar, -1.0)
    same = np.array([[is_same_place(a, b) for b in places] for a in places])
    building = np.array([[a.building == b.building for b in places] for a in places])
    np.fill_diagonal(same, False)
    asked = same.any(axis=1)
    first = similar.argmax(axis=1)
    print_header("asked", "scans", "same place first", "same building first")
    for name in ("room", "street", "hall"):
        which = asked & np.array([p.building == name for p in places])
        right = int(same[np.flatnonzero(which), first[which]].sum())
        built = int(building[np.flatnonzero(which), first[which]].sum())
        print_row(name, int(which.sum()), right, built)
    # Of the hall by how far apart the nearest other scan is.
    hall = [i for i, p in enumerate(places) if p.building == "hall"]
    positions = np.array([places[i].pose[:3, 3] for i in hall])
    apart = np.linalg.norm(positions[:, None] - positions, axis=2)
    beside = [apart[k, hall.index(first[i])] for k, i in enumerate(hall) if first[i] in hall]
    print(
        f"\nthe scan of the hall that comes first was taken {np.median(beside):.1f} m away (median)"
    )
    print("\nall pairs: similarity that is called the same place, or the same building")
    pairs = np.triu_indices(len(places), 1)
    curve("same place", similar[pairs], same[pairs])
    curve("same building", similar[pairs], building[pairs])
    real_poses(places)


def curve(name: str, values: Array, truth: NDArray[np.bool_]) -> None:
    """Precision at some recalls, and the largest recall at full precision."""
    order = np.argsort(-values, kind="stable")
    hits = np.cumsum(truth[order])
    precision = hits / np.arange(1, len(order) + 1)
    recall = hits / max(int(truth.sum()), 1)
    print_header(
        "pairs",
        "positive",
        *(f"precision at recall {r}" for r in (0.25, 0.5, 0.75, 0.9)),
        "recall at precision 1",
        "average precision",
    )
    best = np.maximum.accumulate(precision[::-1])[::-1]
    cells = [f"{best[np.searchsorted(recall, r)]:.2f}" for r in (0.25, 0.5, 0.75, 0.9)]
    full = recall[precision >= 1.0].max(initial=0.0)
    average = float((precision * truth[order]).sum() / max(int(truth.sum()), 1))
    print_row(name, int(truth.sum()), *cells, f"{full:.2f}", f"{average:.2f}")
    print()


def real_poses(places: list[Place]) -> None:
    """Relative poses from every eighth scan, with the first three that are not itself."""
    print_header("asked", "located in the three most similar", "within 0.5 m, 5 degrees", "wrong")
    for name in ("room", "street", "hall"):
        chosen = [p for p in places if p.building == name][:: 8 if name == "hall" else 1]
        located = right = wrong = 0
        for asked in chosen:
            others = [p for p in places if p is not asked]
            index = sb.place_index({p.name: p.model for p in others})
            for match in index.query(asked.model, scan=asked.cloud, top=3, verify=3):
                if match.pose is None:
                    continue
                located += 1
                there = others[match.place]
                if there.building != name:
                    wrong += 1
                elif name == "hall":
                    away = errors(match.pose, np.linalg.inv(there.pose) @ asked.pose)
                    right += away[0] < 0.5 and away[1] < 5
                    wrong += not (away[0] < 0.5 and away[1] < 5)
        # Relative poses of the other scans are not known.
        print_row(f"{name}, {len(chosen)} scans", located, right if name == "hall" else "", wrong)


def errors(found: Array, pose: Array) -> tuple[float, float]:
    """Metres and degrees."""
    turn = found[:3, :3].T @ pose[:3, :3]
    cosine = np.clip((np.trace(turn) - 1) / 2, -1, 1)
    return float(np.linalg.norm(found[:3, 3] - pose[:3, 3])), float(np.rad2deg(np.arccos(cosine)))


# ------------------------------------------------------------------------------------- simulation


def make(kind: str, seed: int) -> datasets.Scene:
    random = np.random.default_rng([seed, list(KINDS).index(kind)])
    low, high = KINDS[kind]
    size = random.uniform(low, high).tolist()
    extra = {"variation": 0.1} if kind == "dwelling" else {}
    return datasets.make_room(seed=seed, kind=kind, size=size, **extra)


def scans(scene: datasets.Scene, seed: int, n: int) -> list[tuple[sb.PointCloud, Array]]:
    """Single turns of a laser from far apart, each in its own frame, headings at random."""
    random = np.random.default_rng([seed, 99])
    poses = scene.default_lidar_poses(n)
    seen = datasets.scan_lidar(
        scene,
        poses,
        elevation_limits=(-45, 45),
        elevation_step=0.7,
        azimuth_step=0.7,
        range_noise=0.01,
        random_state=seed,
    )
    found = []
    for frame in seen.frames:
        pose = np.asarray(frame.true_pose)
        points = (np.asarray(frame.cloud.points, np.float64) - pose[:3, 3]) @ pose[:3, :3]
        cloud, heading = turned(sb.PointCloud(points), random.uniform(0, 2 * np.pi))
        found.append((cloud, pose @ heading))
    return found


def simulated(seeds: Sequence[int], kinds: Sequence[str]) -> None:
    """A scan per room in the index; one from the other side of the room is asked for."""
    kept: list[Place] = []
    asked: list[Place] = []
    for seed in seeds:
        for kind in kinds:
            pair = scans(make(kind, seed), seed, 2)
            for (cloud, pose), to in zip(pair, (kept, asked), strict=True):
                to.append(Place(f"{kind} {seed}", kind, cloud, pose, learned(cloud)))
    index = sb.place_index({p.name: p.model for p in kept})
    similar = np.array([[sb.place_similarity(a.model, b.model) for b in kept] for a in asked])
    print_header(
        "kind",
        "rooms",
        "metres apart",
        "recall at 1",
        "recall at 5",
        "recall at 1 with poses",
        "right pose",
        "right among several",
        "wrong pose",
        "none accepted",
        "median CPU ms",
    )
    rows = {kind: [i for i, p in enumerate(asked) if p.building == kind] for kind in kinds}
    rows["all"] = list(range(len(asked)))
    answers = []
    for i, place in enumerate(asked):
        start = time.process_time()
        found = index.query(place.model, scan=place.cloud, top=5, verify=5)
        spent = 1000 * (time.process_time() - start)
        right = [m for m in found if m.place == i]
        posed = [m for m in found if m.pose is not None]
        best = max(posed, key=lambda m: m.locations[0].score if m.locations else 0.0, default=None)
        true = np.linalg.inv(kept[i].pose) @ place.pose
        good = False
        several = False
        if best is not None and best.place == i and best.locations is not None:
            away = [errors(p.pose, true) for p in best.locations]
            good = any(a < 0.2 and t < 2 for a, t in away)
            several = good and len(away) > 1
        answers.append(
            (
                found[0].place == i,
                bool(right),
                best is not None and best.place == i,
                good and not several,
                several,
                best is not None and not good,
                best is None,
                spent,
            )
        )
    table = np.array(answers, np.float64)
    apart = [
        float(np.linalg.norm(a.pose[:3, 3] - b.pose[:3, 3]))
        for a, b in zip(kept, asked, strict=True)
    ]
    for kind, which in rows.items():
        n = len(which)
        part = table[which]
        print_row(
            kind,
            n,
            f"{np.median([apart[i] for i in which]):.1f}",
            *(f"{part[:, k].mean():.2f}" for k in range(3)),
            *(int(part[:, k].sum()) for k in (3, 4, 5, 6)),
            f"{np.median(part[:, 7]):.0f}",
        )
    print()
    curve("same room", similar.ravel(), np.eye(len(kept), dtype=bool).ravel())


def adjusted_rand(a: Sequence[int], b: Sequence[int]) -> float:
    """Hubert and Arabie 1985."""
    table = np.zeros((max(a) + 1, max(b) + 1))
    np.add.at(table, (np.asarray(a), np.asarray(b)), 1)

    def pairs(n: Array) -> float:
        return float((n * (n - 1) / 2).sum())

    together, rows, columns = pairs(table), pairs(table.sum(axis=1)), pairs(table.sum(axis=0))
    expected = rows * columns / pairs(np.array([float(len(a))]))
    most = 0.5 * (rows + columns)
    return 1.0 if most == expected else (together - expected) / (most - expected)


def purity(found: Sequence[int], true: Sequence[int]) -> float:
    table = np.zeros((max(found) + 1, max(true) + 1))
    np.add.at(table, (np.asarray(found), np.asarray(true)), 1)
    return float(table.max(axis=1).sum() / len(found))


def kinds(seeds: Sequence[int], choose: bool) -> None:
    """Rooms of five kinds, two merged scans each, told apart by what stands at which height."""
    models, true = [], []
    for seed in seeds:
        for number, kind in enumerate(KINDS):
            scene = make(kind, seed)
            poses = scene.default_lidar_poses(2)
            seen = datasets.scan_lidar(
                scene,
                poses,
                elevation_step=0.7,
                azimuth_step=0.7,
                range_noise=0.01,
                random_state=seed,
            )
            models.append(sb.learn_alphabet(seen.cloud, radius=RADIUS))
            true.append(number)
    print_header("kinds asked for", "kinds found", "adjusted Rand", "purity")
    settings: list[tuple[str, dict[str, float | int]]] = [("5", {"n_kinds": 5}), ("default", {})]
    if choose:
        settings += [
            (f"similarity {s}", {"min_similarity": s}) for s in np.arange(0.3, 0.81, 0.05).round(2)
        ]
    for name, options in settings:
        found = sb.label_places(models, **options)  # type: ignore[arg-type]
        labels = found.labels.tolist()
        print_row(
            name, len(found), f"{adjusted_rand(labels, true):.2f}", f"{purity(labels, true):.2f}"
        )
    found = sb.label_places(models, n_kinds=5)
    print("\nrows: kinds of rooms, columns: kinds found")
    print_header("kind", *range(len(found)))
    for number, kind in enumerate(KINDS):
        of = found.labels[np.array(true) == number]
        print_row(kind, *np.bincount(of, minlength=len(found)).tolist())


def copies(seeds: Sequence[int]) -> None:
    """Equal rooms: similarity cannot tell them apart, and every one has a pose."""
    print_header(
        "equal rooms",
        "other rooms",
        "equal ones first",
        "equal ones with a pose",
        "others with a pose",
    )
    rooms = [(datasets.make_room(seed=s, variation=0.1), s) for s in seeds]
    kept = [scans(scene, 100 + k, 2)[0] for k, (scene, _) in enumerate([*rooms, *[rooms[0]] * 2])]
    index = sb.place_index([learned(cloud) for cloud, _ in kept])
    equal = {0, len(rooms), len(rooms) + 1}
    cloud, _ = scans(rooms[0][0], 7, 4)[1]
    found = index.query(cloud, top=len(index), verify=len(index))
    posed = {m.place for m in found if m.pose is not None}
    print_row(
        3,
        len(rooms) - 1,
        {m.place for m in found[:3]} == equal,
        len(posed & equal),
        len(posed - equal),
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--part", choices=["real", "simulated", "kinds", "copies"], default="real")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(8, 24)))
    parser.add_argument("--stride", type=int, default=1, help="of the hall only every n-th scan")
    parser.add_argument(
        "--kinds", nargs="+", choices=list(KINDS), default=list(KINDS), help="simulated: of rooms"
    )
    parser.add_argument("--choose", action="store_true", help="thresholds on rooms 0 to 7")
    options = parser.parse_args()
    seeds = range(8) if options.choose else options.seeds
    match options.part:
        case "real":
            check_data()
            real(options.stride)
        case "simulated":
            simulated(seeds, options.kinds)
        case "kinds":
            kinds(seeds, options.choose)
        case "copies":
            copies(seeds[:6])
    sys.stdout.flush()


if __name__ == "__main__":
    main()
