"""Table I of the alphabet paper (Ruhnke, Steder, Grisetti, Burgard, ICRA 2010) on our scans.

    python benches/papers/bic_alphabet_table.py [--only TOPIC] [--out FOLDER] [--iterations 500]
                                            [--seeds 0] [--threads 2]

Prints rows as those of the table, in Markdown. As in the paper the rate is against the sparsified
original: the distinct points farther from the sensor than the least range, thinned so that they
keep epsilon as the decoded ones do (eq. 3), at 12 bytes each; a word's point takes 12 bytes and an
occurrence 28. The rate with zlib is that of both after zlib. The row after the reduction of
occurrences (III-D), the paper's last step, is the paper's; that before it stands above. The last
column is a real file of the same model. Topics:

    indoor      each of two scans of a room and one of a hall, at radius 0.1 and 0.25 m
    multi       six registered scans of a hall with corridors
    outdoor     three scans of a street, which are not registered and stand 400 m apart here
    corridor    the map of the paper's corridor (building 079) as an octree of 8 cm
    rebuild     IV-B: a second scan of the room with the alphabet of the first
    lambda      the room at sigma_scale 1, 2 and 3
    reduction   III-D by the likelihood with the factor 1/M, without it, and with a tolerance
    words       words, points per word and candidates by radius and number of candidates
    figures     figures 4 to 7, into the folder --out

Without --only the first five are printed. With --out, the plots of figures 4b and 6 of each are
written there too.
"""

from __future__ import annotations

import argparse
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from alphabet_scans import ROOM_RESOLUTION, corridor, distinct, hall, room, sparsified, street
from bic_alphabet_figures import figures, plot
from paper_bench import check_data, print_header, print_row

import surfabet as sb

RADII = (0.1, 0.25)
NAMES = (
    "data",
    "radius",
    "alphabet",
    "occurrences",
    "rate",
    "rate (zlib)",
    "inliers",
    "outliers",
    "CPU seconds",
    "file (bytes)",
)
ROOM: dict[str, Any] = {"min_range": 0.5, "angular_resolution": ROOM_RESOLUTION}
TOLERANCES = (None, 0.0, 2.0, 5.0, 10.0, 20.0)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder for the plots")
    parser.add_argument("--only", choices=[*TABLE, *TOPICS])
    parser.add_argument("--iterations", type=int, default=500)
    parser.add_argument("--seeds", type=int, nargs="*", default=[0])
    parser.add_argument("--threads", type=int, default=2)
    return parser.parse_args()


def paper_file(model: sb.BicAlphabetModel) -> bytes:
    """A model as the paper counts it: three floats a point, six and a number an occurrence."""
    poses = model.poses
    rotation = poses[:, :3, :3]
    # Any six numbers of a pose will do for zlib: the axis-angle vector and the translation.
    angle = np.arccos(np.clip((np.trace(rotation, axis1=1, axis2=2) - 1) / 2, -1, 1))
    axis = np.stack(
        [
            rotation[:, 2, 1] - rotation[:, 1, 2],
            rotation[:, 0, 2] - rotation[:, 2, 0],
            rotation[:, 1, 0] - rotation[:, 0, 1],
        ],
        axis=1,
    )
    vector = axis * (angle / np.maximum(2 * np.sin(angle), 1e-9))[:, None]
    six = np.concatenate([vector, poses[:, :3, 3]], axis=1).astype(np.float32)
    points = [p.tobytes() for p in model.alphabet.points]
    return b"".join(points) + six.tobytes() + model.words.tobytes()


class Original:
    """What the rates of a cloud are against: its bytes, and those after zlib."""

    def __init__(self, cloud: sb.PointCloud, min_range: float, epsilon: float) -> None:
        raw = sparsified(distinct(cloud, min_range), epsilon)
        self.points = len(raw)
        self.bytes = raw.nbytes
        self.zlib = len(zlib.compress(raw.tobytes(), 9))

    def rates(self, model: sb.BicAlphabetModel) -> tuple[str, str]:
        stored = paper_file(model)
        packed = len(zlib.compress(stored, 9))
        return f"{100 * len(stored) / self.bytes:.1f} %", f"{100 * packed / self.zlib:.1f} %"


def print_model(
    name: str, model: sb.BicAlphabetModel, original: Original, suffix: str, seconds: float
) -> None:
    """The row of a model, whose figures are those of its report with the suffix."""
    found = model.report.figures
    print_row(
        name,
        f"{model.alphabet.radius:g} m",
        len(model.alphabet),
        f"{len(model):,}",
        *original.rates(model),
        f"{100 * found['inliers' + suffix]:.1f} %",
        f"{100 * found['outliers' + suffix]:.1f} %",
        f"{seconds:.1f}",
        f"{len(model.to_bytes()):,}",
    )


def of_scene(chosen: dict[str, Any]) -> dict[str, Any]:
    """Those of the options that describe a scene, not words."""
    of_words = ("radius", "iterations", "max_rejections", "min_points")
    return {option: value for option, value in chosen.items() if option not in of_words}


def rows(
    name: str,
    cloud: sb.PointCloud,
    chosen: dict[str, Any],
    alphabet: sb.BicAlphabet | None = None,
) -> sb.BicAlphabetModel:
    """Prints the rows of a run, before and after III-D, and gives back the reduced model.

    With an alphabet nothing is learned: the cloud is described in its words.
    """
    began = time.process_time()
    if alphabet is None:
        model = sb.learn_bic_alphabet(cloud, **chosen)
    else:
        model = alphabet.describe(cloud, **of_scene(chosen))
    seconds = time.process_time() - began
    # Describing the cloud in its own words gives the model as it was before III-D.
    full = model.alphabet.describe(cloud, **of_scene(chosen) | {"reduce": False})
    original = Original(cloud, chosen["min_range"], model._core.epsilon)
    print_model(f"{name}, before III-D", full, original, "", seconds)
    print_model(name, model, original, " reduced", seconds)
    return model


def table(
    args: argparse.Namespace, name: str, read: Callable[[], sb.PointCloud], least: float
) -> None:
    cloud = read()
    for radius in RADII:
        for seed in args.seeds:
            chosen = {
                "radius": radius,
                "min_range": least,
                "iterations": args.iterations,
                "random_state": seed,
            }
            if name.startswith("room"):
                chosen["angular_resolution"] = ROOM_RESOLUTION
            shown = f"{name}, seed {seed}" if len(args.seeds) > 1 else name
            model = rows(shown, cloud, chosen)
            if args.out:
                place = name.replace(", ", "_").replace(" ", "_")
                file = f"bic_alphabet_{place}_{round(100 * radius)}cm"
                plot(args.out, file, model, f"{name}, radius {radius:g} m")


def indoor(args: argparse.Namespace) -> None:
    table(args, "room, scan 1", lambda: room(1), 0.5)
    table(args, "room, scan 2", lambda: room(2), 0.5)
    table(args, "hall, 1 scan", lambda: hall(1), 0.5)


def corridor_map(args: argparse.Namespace) -> None:
    """The paper's corridor as the cells of an octree: at 0.1 m a word has five of them."""
    cloud = corridor()
    for radius in (0.25, 0.4):
        chosen = {"radius": radius, "min_range": 0.0, "iterations": args.iterations}
        model = rows("corridor 079, octree of 8 cm", cloud, chosen)
        if args.out:
            file = f"bic_alphabet_corridor_{round(100 * radius)}cm"
            plot(args.out, file, model, f"corridor 079, radius {radius:g} m")


def rebuild(args: argparse.Namespace) -> None:
    """Scene rebuilding (IV-B): the second scan in the words of the first."""
    alphabet = sb.learn_bic_alphabet(
        room(1), radius=0.1, iterations=args.iterations, **ROOM
    ).alphabet
    rows("room, scan 2 in the words of scan 1", room(2), ROOM, alphabet)
    few = alphabet.first(10)
    rows("the same in the first 10 words", room(2), ROOM, few)


def lambdas(args: argparse.Namespace) -> None:
    print_header("lambda", *NAMES)
    for scale in (1.0, 2.0, 3.0):
        chosen = {"radius": 0.1, "iterations": args.iterations, "sigma_scale": scale, **ROOM}
        rows(f"{scale:g} | room", room(1), chosen)


def reduction(args: argparse.Namespace) -> None:
    """III-D after several criteria, on the same words."""
    scenes = [("room 1", room(1), ROOM), ("hall, scan 1", hall(1), {"min_range": 0.5})]
    print_header("tolerance (nats)", *NAMES)
    for name, cloud, options in scenes:
        chosen = {"radius": 0.1, "iterations": args.iterations, **options}
        alphabet = sb.learn_bic_alphabet(cloud, **chosen, reduce=False).alphabet
        for tolerance in TOLERANCES:
            began = time.process_time()
            model = alphabet.describe(cloud, **of_scene(chosen), reduce_tolerance=tolerance)
            seconds = time.process_time() - began
            original = Original(cloud, chosen["min_range"], model._core.epsilon)
            label = "factor 1/M" if tolerance is None else f"{tolerance:g}"
            print_model(f"{label} | {name}", model, original, " reduced", seconds)


def words(args: argparse.Namespace) -> None:
    """How many words are chosen, of how many points, and how many points a candidate has."""
    cloud = room(1)
    print_header("radius", "candidates", "words", "points per word", "points of a place", "BIC")
    for radius, iterations, least in (
        (0.05, 500, 8),
        (0.1, 500, 8),
        (0.1, 3000, 8),
        (0.1, 3000, 1),
        (0.15, 500, 8),
        (0.25, 500, 8),
    ):
        model = sb.learn_bic_alphabet(
            cloud,
            radius=radius,
            iterations=iterations,
            max_rejections=iterations,
            min_points=least,
            reduce=False,
            **ROOM,
        )
        sizes = [len(p) for p in model.alphabet.points]
        tree = sb.KdTree(distinct(cloud, ROOM["min_range"]))
        starts, _, _ = tree.query_radius(model.poses[:, :3, 3].astype(np.float32), radius)
        print_row(
            f"{radius:g} m",
            f"{model.report.iterations}, of {least} points or more",
            len(sizes),
            f"{min(sizes)} / {np.median(sizes):.0f} / {max(sizes)}",
            f"{np.median(np.diff(starts)):.0f}",
            f"{model.report.figures['bic']:,.0f}",
        )


TABLE: dict[str, Callable[[argparse.Namespace], None]] = {
    "indoor": indoor,
    "multi": lambda args: table(args, "hall, 6 scans", hall, 0.5),
    # The car's roof.
    "outdoor": lambda args: table(args, "street, 3 scans", street, 2.5),
    "corridor": corridor_map,
    "rebuild": rebuild,
}
TOPICS: dict[str, Callable[[argparse.Namespace], None]] = {
    "lambda": lambdas,
    "reduction": reduction,
    "words": words,
    "figures": lambda args: figures(args.out or Path("."), args.iterations),
}


def main() -> None:
    args = parse()
    check_data()
    sb.set_num_threads(args.threads)
    if args.only in TOPICS:
        TOPICS[args.only](args)
        return
    print_header(*NAMES)
    for topic, print_rows in TABLE.items():
        if args.only in (None, topic):
            print_rows(args)


if __name__ == "__main__":
    main()
