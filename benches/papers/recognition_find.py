"""`AlphabetModel.find` on simulated rooms: in the scene of the example, and across scenes.

    python benches/papers/recognition_find.py --part within --seeds 0 1 2
    python benches/papers/recognition_find.py --part across
    python benches/papers/recognition_find.py --part across --sensors rgbd
    python benches/papers/recognition_find.py --part recurring

`within`: every object of a kind is the example once, copies are looked for. `across`: a library of
examples that are cut, by the points of one object each, out of scans of rooms 0 to 3; looked for
in rooms 8 to 23, where things of a kind differ in size (10 %), style and colour and some are hidden
in part. A find is right when its pose takes the middle of the object that the example is cut from
to within 0.25 m of the middle of an object of the kind that no better find has taken. `recurring`:
classes without example beside the simulator's instances, by scikit-learn's adjusted Rand index.
Constants were chosen on rooms 0 to 7
(`--choose` runs on rooms 4 to 7).
"""

from __future__ import annotations

import argparse
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from paper_bench import print_header, print_row
from recognition_places import purity
from sklearn.metrics import adjusted_rand_score

import surfabet as sb
from surfabet import datasets

Array = NDArray[np.float64]
NEAR = 0.25
MARGIN = 0.03
LEARNING = {"angular_resolution": 0.5, "noise": 0.005}


def scan(seed: int, sensor: str, variation: float) -> datasets.SimulatedScan:
    """Six stations of a laser, or 32 frames of a depth camera."""
    scene = datasets.make_room(seed=seed, variation=variation)
    if sensor == "lidar":
        return datasets.scan_lidar(scene, n_scans=6, random_state=seed)
    noise = {"rgbd": 1.0, "rgbd-low": 0.25}[sensor]
    return datasets.scan_rgbd(
        scene, n_frames=32, width=320, height=240, depth_noise=noise, random_state=seed
    )


def learned(cloud: sb.PointCloud, args: argparse.Namespace) -> sb.AlphabetModel:
    return sb.learn_alphabet(
        cloud, radius=0.1, sigma_scale=args.sigma_scale, scales=args.scales, **LEARNING
    )


def kept(
    args: argparse.Namespace, name: str, learn: Callable[[], sb.AlphabetModel]
) -> sb.AlphabetModel:
    """The model of that name in a folder; learned and saved there when there is none."""
    if args.keep is None:
        return learn()
    path = Path(args.keep) / f"{name}_{args.sigma_scale:g}_{args.scales}.sfb"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        learn().save(path)
    model = sb.load(path)
    assert isinstance(model, sb.AlphabetModel)
    return model


def room_model(seed: int, sensor: str, args: argparse.Namespace) -> sb.AlphabetModel:
    def learn() -> sb.AlphabetModel:
        return learned(scan(seed, sensor, 0.1).cloud, args)

    return kept(args, f"{sensor}_{seed}", learn)


def middle(instance: datasets.Instance) -> Array:
    low, high = instance.extent
    return np.asarray((instance.pose @ [*(0.5 * (np.array(low) + high)), 1.0])[:3])


def of_kind(scene: datasets.Scene, name: str) -> list[datasets.Instance]:
    return [i for i in scene.instances if i.class_name == name]


def judged(middles: list[Array], kind: list[datasets.Instance]) -> list[int | None]:
    """The object that each find, the best first, is of."""
    left = {other.id: middle(other) for other in kind}
    found: list[int | None] = []
    for at in middles:
        off = {key: float(np.linalg.norm(at - where)) for key, where in left.items()}
        nearest = min(off, key=lambda key: off[key], default=None)
        if nearest is None or off[nearest] > NEAR:
            found.append(None)
        else:
            del left[nearest]
            found.append(nearest)
    return found


# ------------------------------------------------------------------------------------- in one scene


def within(args: argparse.Namespace) -> None:
    print_header("sensor", "kind", "examples", "recall", "precision", "median CPU s")
    for sensor in args.sensors:
        sums: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0])
        seconds = defaultdict(list)
        for seed in args.seeds:
            seen = scan(seed, sensor, args.variation)
            model = learned(seen.cloud, args)
            for name in args.kinds:
                kind = of_kind(seen.scene, name)
                for example in kind:
                    low, high = (np.array(corner) for corner in example.bounds)
                    low, high = low - MARGIN, high + MARGIN
                    low[2] += 2 * MARGIN  # not the floor
                    start = time.process_time()
                    found = model.find(
                        box=(low.tolist(), high.tolist()),
                        min_score=args.min_score,
                        color_tolerance=None if args.shape_only else args.color_tolerance,
                    )
                    seconds[name].append(time.process_time() - start)
                    at = [(f.pose @ [*middle(example), 1.0])[:3] for f in found]
                    hits = judged(at, kind)
                    right = sum(hit not in (None, example.id) for hit in hits)
                    wrong = sum(hit is None for hit in hits)
                    parts = (1, right, len(kind) - 1, wrong)
                    sums[name] = [a + b for a, b in zip(sums[name], parts, strict=True)]
        for name, (n, right, wanted, wrong) in sums.items():
            print_row(
                sensor,
                name,
                n,
                f"{right / max(wanted, 1):.2f}",
                f"{right / max(right + wrong, 1):.2f}",
                f"{np.median(seconds[name]):.1f}",
            )


# ------------------------------------------------------------------------------------- across


def library(kind: str, args: argparse.Namespace) -> list[tuple[sb.AlphabetModel, Array]]:
    """Examples from rooms 0 to 3, the points of one object each, and the middles of the objects."""
    examples: list[tuple[sb.AlphabetModel, Array]] = []
    for seed in range(4):
        scene = datasets.make_room(seed=seed, variation=0.1)
        chosen = of_kind(scene, kind)[: args.per_room]

        @cache
        def seen(seed: int = seed) -> datasets.SimulatedScan:
            return scan(seed, args.library_sensor, 0.1)

        for instance in chosen:

            def learn(
                instance: datasets.Instance = instance,
                seen: Callable[[], datasets.SimulatedScan] = seen,
            ) -> sb.AlphabetModel:
                of_one = seen().ground_truth.instances == instance.id
                return learned(seen().cloud.select(of_one), args)

            name = f"{kind}_{args.library_sensor}_{seed}_{instance.id}"
            examples.append((kept(args, name, learn), middle(instance)))
    return examples


def across(args: argparse.Namespace) -> None:
    print_header(
        "sensor",
        "kind",
        "examples",
        "rooms",
        "objects",
        "least score",
        "recall",
        "precision",
        "median CPU s",
    )
    for sensor in args.sensors:
        libraries = {kind: library(kind, args) for kind in args.kinds}
        scores: dict[str, list[tuple[float, bool]]] = defaultdict(list)
        wanted: Counter[str] = Counter()
        seconds = defaultdict(list)
        for seed in args.seeds:
            model = room_model(seed, sensor, args)
            scene = datasets.make_room(seed=seed, variation=0.1)
            for name, examples in libraries.items():
                kind = of_kind(scene, name)
                wanted[name] += len(kind)
                start = time.process_time()
                found = model.find(
                    [example for example, _ in examples],
                    min_score=0.3,
                    color_tolerance=None if args.shape_only else args.color_tolerance,
                )
                seconds[name].append(time.process_time() - start)
                at = [(f.pose @ [*examples[f.example][1], 1.0])[:3] for f in found]
                hits = judged(at, kind)
                scores[name] += [
                    (f.score, hit is not None) for f, hit in zip(found, hits, strict=True)
                ]
        for name, all_scores in scores.items():
            for least in args.scores:
                kept = [hit for score, hit in all_scores if score >= least]
                print_row(
                    sensor,
                    name,
                    len(libraries[name]),
                    len(args.seeds),
                    wanted[name],
                    least,
                    f"{sum(kept) / max(wanted[name], 1):.2f}",
                    f"{sum(kept) / max(len(kept), 1):.2f}",
                    f"{np.median(seconds[name]):.1f}",
                )


# ------------------------------------------------------------------------------------- recurring


ROOM = ("floor", "ceiling", "wall", "skirting")
"""What `recurring` leaves out by design."""


def recurring(args: argparse.Namespace) -> None:
    """Points of things that occur three times or more: their kinds beside the classes found.

    With and without walls and skirtings, which the simulator counts as instances and `recurring`
    leaves out.
    """
    print_header(
        "sensor",
        "room",
        "variation",
        "classes",
        "places",
        "of one kind",
        "purity of points",
        "adjusted Rand",
        "things in a class",
        "of",
        "adjusted Rand with walls",
        "things with walls",
        "of",
        "CPU s",
    )
    for sensor, variation in product(args.sensors, args.variations):
        for seed in args.seeds:
            seen = scan(seed, sensor, variation)
            model = learned(seen.cloud, args)
            start = time.process_time()
            options = {"size_tolerance": 0.1 * (variation > 0)}
            classes = sb.recurring(model, **options)  # type: ignore[arg-type]
            spent = time.process_time() - start
            row(sensor, seed, variation, seen, classes, spent)
            if args.save:
                Path(args.save).mkdir(parents=True, exist_ok=True)
                classes.draw(Path(args.save) / f"recurring_{sensor}_{seed}_{variation:g}.png")


def row(
    sensor: str,
    seed: int,
    variation: float,
    seen: datasets.SimulatedScan,
    classes: sb.RecurringClasses,
    spent: float,
) -> None:
    names = [i.class_name for i in seen.scene.instances]
    instances = np.asarray(seen.ground_truth.instances)
    points = np.asarray(seen.cloud.points)
    # A point belongs to the class of the places whose box it is in, and whose words are near it.
    inside = [[place.mask(points, margin=0.0) for place in of_class.places] for of_class in classes]
    found = np.full(len(points), -1)
    for k, masks in enumerate(inside):
        for mask in masks:
            found[mask & (found < 0)] = k
    counts = Counter(names)
    recurs = np.array([counts[n] >= 3 for n in names])
    is_thing = np.array([n not in ROOM for n in names])
    kinds = np.array([names.index(n) for n in names])
    clean = 0
    met: set[int] = set()
    for masks in inside:
        shown = []
        for mask in masks:
            here = instances[mask]
            here = here[recurs[here]]
            main = int(np.bincount(here).argmax()) if len(here) else -1
            shown.append(int(kinds[main]) if main >= 0 else -1)
            met.update([main] if main >= 0 else [])
        clean += max(Counter(shown).values())
    n_places = sum(len(of_class) for of_class in classes)
    cells: list[str | int] = []
    for counted in (recurs & is_thing, recurs):
        of_points = counted[instances]
        truth = kinds[instances[of_points]]
        cells.append(f"{adjusted_rand_score(truth, found[of_points]):.2f}")
        cells += [sum(bool(counted[m]) for m in met), int(counted.sum())]
    used = (recurs & is_thing)[instances] & (found >= 0)
    pure = float("nan")
    if used.any():
        pure = purity(found[used].tolist(), kinds[instances[used]].tolist())
    print_row(
        sensor,
        seed,
        variation,
        len(classes),
        n_places,
        f"{clean / max(n_places, 1):.2f}",
        f"{pure:.2f}",
        *cells,
        f"{spent:.0f}",
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--part", choices=["within", "across", "recurring"], default="within")
    parser.add_argument("--seeds", type=int, nargs="+")
    parser.add_argument("--sensors", nargs="+", default=["lidar"])
    parser.add_argument("--library-sensor", default="lidar")
    parser.add_argument("--kinds", nargs="+", default=["chair", "door"])
    parser.add_argument("--per-room", type=int, default=2, help="examples of a kind from each room")
    parser.add_argument("--sigma-scale", type=float, default=1.5)
    parser.add_argument("--scales", type=int, default=4, help="radii of words, from 0.1 m on")
    parser.add_argument("--color-tolerance", type=float, default=10.0, help="grey levels")
    parser.add_argument("--shape-only", action="store_true")
    parser.add_argument("--min-score", type=float, default=0.5)
    parser.add_argument("--scores", type=float, nargs="+", default=[0.35, 0.4, 0.45, 0.5, 0.55])
    parser.add_argument("--variation", type=float, default=0.0, help="within: of sizes and styles")
    parser.add_argument("--variations", type=float, nargs="+", default=[0.0, 0.1], help="recurring")
    parser.add_argument("--choose", action="store_true", help="on rooms 4 to 7")
    parser.add_argument("--save", help="folder for pictures")
    parser.add_argument("--keep", help="across: folder for models, which are then learned once")
    args = parser.parse_args()
    if args.seeds is None:
        args.seeds = [0, 1, 2] if args.part == "within" else list(range(8, 24))
    if args.choose:
        args.seeds = [4, 5, 6, 7]
    {"within": within, "across": across, "recurring": recurring}[args.part](args)


if __name__ == "__main__":
    main()
