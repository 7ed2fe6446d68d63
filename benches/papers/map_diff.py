"""Differences between maps: furniture that was moved, taken away and brought between two scans.

    python benches/papers/map_diff.py [--seeds 0 8] [--sensor rgbd|lidar]
    python benches/papers/map_diff.py --part real
    python benches/papers/map_diff.py --part cut

Rooms of the simulator. Of the things that stand free two are moved, one is taken away and one is
brought. Both maps are learned from frames of their own, with noise and errors of the poses, and
compared without viewpoints and with them.

A thing is found when a change of its kind covers a quarter of its surface that both maps could
judge: what the map that has it shows, and the other has not within the tolerance. A change is right
when half of its points are on things that changed so. The least area of a change was chosen on
seeds 0 to 6, all other constants on 0 and 1.

The part `real` compares scans of one place with others of it, where nothing changed: each change is
false. In the part `cut` the points of one thing on the table are taken from one half of the frames
of a kitchen. What it hid is a hole then, through which no line meets a surface, so that no map can
say that it looked there. A scan without the thing would show what is behind: so the points are put
there instead, each along its line of sight onto the plane of the table or of the wall.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import locate
import numpy as np
from numpy.typing import NDArray
from paper_bench import DATA, check_data, print_header, print_row

import surfabet as sb
from surfabet import datasets
from surfabet.io import read_rgbd

FREE = ("chair", "bin", "plant", "carton", "ball", "table", "armchair", "stool")
"""Classes of things that stand free on the floor."""

NEAR = 0.05
"""A point that is so near to the surface of a thing is on it, metres."""

COVERED = 0.25
"""Least share of a thing that a change covers to have found it."""


def stands_free(scene: datasets.Scene) -> list[datasets.Instance]:
    return [thing for thing in scene.instances if thing.class_name in FREE]


def clear_of_others(
    scene: datasets.Scene, moved: datasets.Instance, shift: NDArray[np.float64]
) -> bool:
    """Whether a thing can stand elsewhere: in the room, and in no box of another."""
    low, high = (np.array(corner) + shift for corner in moved.bounds)
    inner = np.array(scene.interior)
    if (low[:2] < inner[0][:2] + 0.05).any() or (high[:2] > inner[1][:2] - 0.05).any():
        return False
    for other in scene.instances:
        a, b = map(np.array, other.bounds)
        is_flat = b[2] - a[2] < 0.05
        around = (a[:2] <= inner[0][:2]).all() and (b[:2] >= inner[1][:2]).all()
        if other.id == moved.id or is_flat or around or other.class_name in ("wall", "skirting"):
            continue
        if ((low < b + 0.02) & (high > a - 0.02)).all():
            return False
    return True


def carries(scene: datasets.Scene, thing: datasets.Instance) -> bool:
    """Whether something stands on a thing."""
    low, high = map(np.array, thing.bounds)
    for other in scene.instances:
        a, b = map(np.array, other.bounds)
        on = other.id != thing.id and abs(a[2] - high[2]) < 0.1 and a[2] > 0.2
        if on and (a[:2] < high[:2]).all() and (b[:2] > low[:2]).all():
            return True
    return False


def changed_scenes(
    seed: int,
) -> tuple[datasets.Scene, datasets.Scene, dict[str, list[tuple[datasets.Scene, int]]]]:
    """Scenes before and after, and the things that vanished and appeared, each with the scene that
    has it."""
    scene = datasets.make_room(seed=seed)
    rng = np.random.default_rng(seed)
    things = [thing for thing in stands_free(scene) if not carries(scene, thing)]
    things = [things[i] for i in rng.permutation(len(things))]
    moved: dict[int, NDArray[np.float64]] = {}
    for thing in things:
        for _ in range(200):
            shift = np.append(rng.uniform(-3, 3, 2), 0.0)
            if np.linalg.norm(shift) > 0.6 and clear_of_others(scene, thing, shift):
                pose = np.array(thing.pose)
                pose[:3, 3] += shift
                moved[thing.id] = pose
                break
        if len(moved) == 2:
            break
    rest = [thing.id for thing in things if thing.id not in moved]
    brought, taken = rest[0], rest[1]
    before = scene.rearranged({brought: None})
    after = scene.rearranged({**moved, taken: None})

    def row(of: datasets.Scene, missing: int, thing: int) -> tuple[datasets.Scene, int]:
        return of, thing - (thing > missing)

    truth = {
        "vanished": [row(before, brought, thing) for thing in (*moved, taken)],
        "appeared": [row(after, taken, thing) for thing in (*moved, brought)],
    }
    return before, after, truth


def learned(
    scene: datasets.Scene, sensor: str, seed: int
) -> tuple[sb.PatchModel, NDArray[np.float64]]:
    """The map of a scan, and where its sensors stood."""
    errors = {"translation_std": 0.003, "rotation_std": 0.1, "random_state": seed}
    if sensor == "lidar":
        poses = scene.default_lidar_poses(4)
        scan = datasets.scan_lidar(scene, poses, **errors)
    else:
        # Those of a second scan are not those of the first.
        poses = scene.default_poses(24 + seed % 2 * 3)
        scan = datasets.scan_rgbd(scene, poses, width=320, height=240, **errors)
    return sb.learn_patches(scan.cloud), np.array([pose[:3, 3] for pose in poses])


def on_thing(scene: datasets.Scene, row: int, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points lie on a thing."""
    found = np.zeros(len(points), bool)
    low, high = map(np.array, scene.instances[row].bounds)
    inside = ((points > low - NEAR) & (points < high + NEAR)).all(axis=1)
    distance, _, _, instance, _ = scene.closest_points(points[inside])
    found[inside] = (instance == row) & (distance < NEAR)
    return found


def score(
    changes: sb.Changes,
    truth: dict[str, list[tuple[datasets.Scene, int]]],
    maps: dict[str, tuple[sb.PointCloud, sb.KdTree]],
) -> tuple[int, int, int, int]:
    """Things found, things that could be found, changes that are right, and all changes."""
    cloud = changes.cloud
    found = shown = right = 0
    for kind, number in (("appeared", 1), ("vanished", 2)):
        own, other = maps[kind]
        is_kind = cloud["change"] == number
        changed, group = cloud.points[is_kind], cloud["group"][is_kind]
        of_things = np.zeros(len(changed), bool)
        tree = sb.KdTree(changed) if len(changed) else None
        for scene, row in truth[kind]:
            of_things |= on_thing(scene, row, changed)
            points = own.points[on_thing(scene, row, own.points)]
            if len(points):
                distance, _ = other.query(points)
                points = points[distance[:, 0] > changes.tolerance]
            if len(points) < 50:
                continue
            shown += 1
            if tree is not None:
                distance, _ = tree.query(points)
                found += int((distance[:, 0] < 0.01).mean() >= COVERED)
        for i in np.unique(group):
            right += int(of_things[group == i].mean() >= 0.5)
    return found, shown, right, len(changes)


def one(seed: int, sensor: str) -> list[tuple[str, tuple[int, int, int, int], sb.Changes]]:
    """Scores without viewpoints and with them."""
    before, after, truth = changed_scenes(seed)
    (a, from_a), (b, from_b) = (
        learned(scene, sensor, 2 * seed + i) for i, scene in enumerate((before, after))
    )
    surfaces = {"vanished": a.decode(), "appeared": b.decode()}
    thick = {"vanished": b, "appeared": a}
    maps = {
        kind: (surfaces[kind], sb.KdTree(thick[kind].decode(as_measured=True))) for kind in surfaces
    }
    found = []
    for name, sensors in (("none", (None, None)), ("given", (from_a, from_b))):
        changes = sb.diff(a, b, viewpoints=sensors)
        found.append((name, score(changes, truth, maps), changes))
    return found


TABLE = np.array([0.0, -0.8924, -0.4512]), -0.8022
"""The table of the kitchen: what is up there, and its height along it, metres."""

LEAST_AREAS = (0.05, 0.01)
"""The default, and one that things of the size of a cup have."""

WALL = np.array([0.0074, -0.4707, 0.8823]), 3.32
"""The wall behind it likewise: its normal and its place along it."""

THINGS = {
    "a": ([-1.36, -0.28, 1.73], [-1.07, -0.02, 2.13]),
    "b": ([-0.70, -0.41, 2.19], [-0.18, -0.25, 2.38]),
    "c": ([0.39, -0.18, 1.56], [0.87, 0.08, 1.94]),
    "d": ([0.39, -0.41, 2.14], [0.86, -0.23, 2.42]),
    "e": ([-0.80, -0.20, 1.84], [-0.51, -0.07, 2.00]),
    "f": ([0.19, -0.12, 1.73], [0.34, -0.03, 1.89]),
}
"""Boxes about things that stand on it by themselves: groups of points more than 3 cm above it."""


def of_thing(points: NDArray[np.float64], name: str) -> NDArray[np.bool_]:
    """Which points are of a thing on the table."""
    low, high = map(np.array, THINGS[name])
    above = points @ TABLE[0] > TABLE[1] + 0.03
    return np.asarray(above & ((points > low - 0.02) & (points < high + 0.02)).all(axis=1))


def behind(points: NDArray[np.float64], viewpoints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where lines of sight through points end on the table or on the wall."""
    along = points - viewpoints
    reach = np.full(len(points), np.inf)
    for normal, at in (TABLE, WALL):
        t = (at - viewpoints @ normal) / (along @ normal)
        reach = np.where(t > 1, np.minimum(reach, t), reach)
    return viewpoints + np.where(np.isfinite(reach), reach, 1.0)[:, None] * along


def of_frames(
    frames: list[sb.PointCloud], without: str | None = None, fill: bool = False
) -> sb.PatchModel:
    """The map of some frames, perhaps without a thing, whose points go or are put behind it."""
    points = np.concatenate([frame.points for frame in frames])
    viewpoints = np.stack([frame.viewpoints[0] for frame in frames])  # type: ignore[index]
    index = np.repeat(np.arange(len(frames), dtype=np.uint32), [len(frame) for frame in frames])
    if without is not None:
        thing = of_thing(points, without)
        if fill:
            points[thing] = behind(points[thing], viewpoints[index[thing]])
        else:
            points, index = points[~thing], index[~thing]
    cloud = sb.PointCloud(points, viewpoints=viewpoints, viewpoint_index=index)
    return sb.learn_patches(cloud, resolution=0.0165)


def sensors_of(frames: list[sb.PointCloud]) -> NDArray[np.float64]:
    return np.stack([frame.viewpoints[0] for frame in frames])  # type: ignore[index]


def compared(
    name: str, maps: Sequence[sb.PatchModel], sensors: Sequence[NDArray[np.float64]]
) -> None:
    """Rows of two maps of what did not change."""
    for how, given in (("none", (None, None)), ("given", (sensors[0], sensors[1]))):
        found = sb.diff(maps[0], maps[1], viewpoints=given)
        areas = [sum(c.area for c in found if c.kind == kind) for kind in ("appeared", "vanished")]
        largest = max((change.area for change in found), default=0.0)
        cells = [f"{area:.2f}" for area in (*areas, largest)]
        unseen = " / ".join(f"{area:.1f}" for area in found.unseen)
        print_row(name, how, f"{found.tolerance:.3f}", len(found), *cells, unseen)


def real() -> None:
    """Scans of one place against others of it, and with a thing cut out."""
    print_header(
        "scans", "viewpoints", "tolerance (m)", "changes, all false", "appeared (m2)",
        "vanished (m2)", "largest (m2)", "unseen (m2)",
    )  # fmt: skip
    frames = read_rgbd(DATA / "rgbd_room", pixel_stride=3, fused=False)
    half = len(frames) // 2
    splits = {
        "kitchen, first and second half": (frames[:half], frames[half:]),
        "kitchen, even and odd frames": (frames[::2], frames[1::2]),
    }
    for name, parts in splits.items():
        maps = [of_frames(part) for part in parts]
        compared(name, maps, [sensors_of(part) for part in parts])
    scans, poses = locate.drive()
    numbers = sorted(scans)
    halls, sensors = [], []
    for own in (numbers[::2], numbers[1::2]):
        index = np.repeat(np.arange(len(own), dtype=np.uint32), [len(scans[k]) for k in own])
        at = np.stack([poses[k][:3, 3] for k in own])
        points = np.concatenate([scans[k] @ poses[k][:3, :3].T + poses[k][:3, 3] for k in own])
        halls.append(sb.learn_patches(sb.PointCloud(points, viewpoints=at, viewpoint_index=index)))
        sensors.append(at)
    compared("hall, every second scan and the others", halls, sensors)


def cut() -> None:
    """A thing that one half of the frames of the kitchen does not show."""
    print_header(
        "thing", "m2", "behind it", "viewpoints", "least m2", "covered", "found", "other changes"
    )
    frames = read_rgbd(DATA / "rgbd_room", pixel_stride=3, fused=False)
    even, odd = frames[::2], frames[1::2]
    before, sensors = of_frames(even), (sensors_of(even), sensors_of(odd))
    for thing in THINGS:
        for what, fill in (("a hole", False), ("table or wall", True)):
            cut_out(thing, what, before, of_frames(odd, thing, fill), sensors)


def cut_out(
    thing: str,
    what: str,
    before: sb.PatchModel,
    after: sb.PatchModel,
    sensors: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Rows of a thing that the second map has not."""
    surface = before.decode()
    own = surface.points[of_thing(surface.points, thing)]
    area = len(own) * sb.survey(surface).spacing ** 2
    for how, given in (("none", (None, None)), ("given", sensors)):
        for least in LEAST_AREAS:
            changes = sb.diff(before, after, viewpoints=given, min_area=least)
            gone = changes.cloud.points[changes.cloud["change"] == 2]
            group = changes.cloud["group"][changes.cloud["change"] == 2]
            share, right = 0.0, set()
            if len(gone):
                distance, _ = sb.KdTree(gone).query(own)
                share = float((distance[:, 0] < 0.01).mean())
                right = {
                    g for g in np.unique(group) if of_thing(gone[group == g], thing).mean() >= 0.5
                }
            found = "yes" if share >= COVERED else "no"
            cells = (f"{area:.3f}", what, how, least, f"{share:.0%}", found)
            print_row(thing, *cells, len(changes) - len(right))


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", nargs=2, type=int, default=(8, 16))
    parser.add_argument("--sensor", choices=("rgbd", "lidar"), default="rgbd")
    parser.add_argument("--part", choices=("simulated", "real", "cut"), default="simulated")
    options = parser.parse_args(argv)
    if options.part != "simulated":
        check_data()
        {"real": real, "cut": cut}[options.part]()
        return
    print_header(
        "seed", "viewpoints", "things", "found", "changes", "right", "tolerance (m)", "unseen (m2)"
    )
    totals: dict[str, np.ndarray] = {}
    for seed in range(*options.seeds):
        for name, counts, changes in one(seed, options.sensor):
            totals[name] = totals.get(name, 0) + np.array(counts)
            found, shown, right, n = counts
            unseen = " / ".join(f"{area:.1f}" for area in changes.unseen)
            print_row(seed, name, shown, found, n, right, f"{changes.tolerance:.3f}", unseen)
    for name, (found, shown, right, n) in totals.items():
        print_row("all", name, shown, found, n, right, "", "")
        print(f"viewpoints {name}: recall {found / shown:.3f}, precision {right / max(1, n):.3f}")


if __name__ == "__main__":
    main()
