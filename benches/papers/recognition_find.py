"""`AlphabetModel.find` on simulated rooms: all chairs and doors from one example.

    python benches/papers/recognition_find.py --seeds 0 1 2 --sensors lidar rgbd rgbd-low

Every object of a kind is the example once. A find is right when it takes the middle of the example
to within 0.25 m of the middle of an object of the kind that no better find has taken; the example
itself is not counted, neither as found nor as to be found.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict

import numpy as np
from numpy.typing import NDArray
from paper_bench import print_header, print_row

import surfabet as sb
from surfabet import datasets

NEAR = 0.25
MARGIN = 0.03


def scan(seed: int, sensor: str) -> tuple[datasets.SimulatedScan, dict[str, float]]:
    """A room, and the options that it is learned with."""
    scene = datasets.make_room(seed=seed)
    if sensor == "lidar":
        seen = datasets.scan_lidar(scene, n_scans=6, random_state=seed)
        return seen, {"angular_resolution": 0.5, "noise": 0.005}
    noise = {"rgbd": 1.0, "rgbd-low": 0.25}[sensor]
    seen = datasets.scan_rgbd(
        scene, n_frames=32, width=320, height=240, depth_noise=noise, random_state=seed
    )
    return seen, {"angular_resolution": 0.5, "noise": 0.005}


def middle(instance: datasets.Instance) -> NDArray[np.float64]:
    low, high = instance.extent
    return (instance.pose @ [*(0.5 * (np.array(low) + high)), 1.0])[:3]


def judged(
    found: list[sb.alphabet.FoundOccurrence],
    example: datasets.Instance,
    kind: list[datasets.Instance],
) -> tuple[int, int]:
    """Right and wrong finds beside the example."""
    left = {other.id: middle(other) for other in kind}
    start = [*middle(example), 1.0]
    right = wrong = 0
    for place in found:
        at = (place.pose @ start)[:3]
        off = {key: float(np.linalg.norm(at - where)) for key, where in left.items()}
        nearest = min(off, key=lambda key: off[key], default=None)
        if nearest is None or off[nearest] > NEAR:
            wrong += 1
            continue
        del left[nearest]
        right += nearest != example.id
    return right, wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--sensors", nargs="+", default=["lidar", "rgbd", "rgbd-low"])
    parser.add_argument("--kinds", nargs="+", default=["chair", "door"])
    parser.add_argument("--sigma-scale", type=float, default=1.5)
    parser.add_argument("--color-tolerance", type=float, default=10.0, help="grey levels")
    parser.add_argument("--shape-only", action="store_true")
    parser.add_argument("--min-score", type=float, default=0.5)
    args = parser.parse_args()
    print_header("sensor", "kind", "examples", "recall", "precision", "median find, s")
    for sensor in args.sensors:
        sums: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0])
        seconds = defaultdict(list)
        for seed in args.seeds:
            seen, options = scan(seed, sensor)
            model = sb.learn_alphabet(
                seen.cloud, radius=0.1, sigma_scale=args.sigma_scale, **options
            )
            for name in args.kinds:
                kind = [i for i in seen.scene.instances if i.class_name == name]
                for example in kind:
                    low, high = (np.array(corner) for corner in example.bounds)
                    low, high = low - MARGIN, high + MARGIN
                    low[2] += 2 * MARGIN  # not the floor
                    start = time.perf_counter()
                    found = model.find(
                        box=(low.tolist(), high.tolist()),
                        min_score=args.min_score,
                        color_tolerance=None if args.shape_only else args.color_tolerance,
                    )
                    seconds[name].append(time.perf_counter() - start)
                    right, wrong = judged(found, example, kind)
                    sums[name] = [
                        total + part
                        for total, part in zip(
                            sums[name], (1, right, len(kind) - 1, wrong), strict=True
                        )
                    ]
        for name, (n, right, wanted, wrong) in sums.items():
            print_row(
                sensor,
                name,
                n,
                f"{right / max(wanted, 1):.2f}",
                f"{right / max(right + wrong, 1):.2f}",
                f"{np.median(seconds[name]):.1f}",
            )


if __name__ == "__main__":
    main()
