"""Table I of the alphabet paper (Ruhnke, Steder, Grisetti, Burgard, ICRA 2010) on our scans.

    python benches/papers/alphabet_table.py [--out FOLDER] [--only indoor|multi|outdoor|rebuild]
                                            [--iterations 500] [--threads 2]

Prints the table's rows in Markdown for the paper's own method, at radius 0.1 and 0.25 m and lambda
3, before and after the reduction of occurrences (III-D): one scan of a room, six registered scans
of a hall with corridors, and three scans of a street, which are not registered and stand 400 m
apart here. Rates are against 12 bytes per distinct point that is farther from the sensor than the
least range; a word's point takes 12 bytes and an occurrence 28, as in the paper; the rate with
zlib is that of both after zlib. The last column is a real file of the same model.
"rebuild" (IV-B) describes a second scan of the room with the alphabet of the first.
With --out, the plots of figures 4b and 6 are written there: BIC against iterations, and
occurrences per word.
"""

from __future__ import annotations

import argparse
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from alphabet_scans import ROOM_RESOLUTION, distinct, hall, room, street
from paper_bench import check_data, print_header, print_row

import surfabet as sb

RADII = (0.1, 0.25)
NAMES = ("alphabet", "occurrences", "rate", "rate (zlib)", "inliers", "outliers", "seconds")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder for the plots")
    parser.add_argument("--only", choices=["indoor", "multi", "outdoor", "rebuild"])
    parser.add_argument("--iterations", type=int, default=500)
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


def rows(
    name: str,
    cloud: sb.PointCloud,
    chosen: dict[str, Any],
    alphabet: sb.BicAlphabet | None = None,
) -> sb.BicAlphabetModel:
    """Prints the rows of a run, before and after III-D, and gives back the reduced model.

    With an alphabet nothing is learned: the cloud is described in its words.
    """
    raw = distinct(cloud, chosen["min_range"])
    raw_zlib = len(zlib.compress(raw.tobytes(), 9))
    of_words = ("radius", "iterations")
    described = {option: value for option, value in chosen.items() if option not in of_words}
    began = time.perf_counter()
    if alphabet is None:
        model = sb.learn_bic_alphabet(cloud, **chosen)
    else:
        model = alphabet.describe(cloud, **described)
    seconds = time.perf_counter() - began
    # Describing the cloud in its own words gives the model as it was before III-D.
    full = model.alphabet.describe(cloud, **described, reduce=False)
    report = model.report
    spent = seconds - report.stages["removing occurrences"]
    for of, label, suffix, time_spent in (
        (full, name, "", spent),
        (model, f"{name}, III-D", " reduced", seconds),
    ):
        stored = paper_file(of)
        print_row(
            label,
            f"{model.alphabet.radius:g} m",
            len(of.alphabet),
            f"{len(of):,}",
            f"{100 * len(stored) / raw.nbytes:.1f} %",
            f"{100 * len(zlib.compress(stored, 9)) / raw_zlib:.1f} %",
            f"{100 * report.figures['inliers' + suffix]:.1f} %",
            f"{100 * report.figures['outliers' + suffix]:.1f} %",
            f"{time_spent:.1f}",
            f"{len(of.to_bytes()):,}",
        )
    return model


def plot(out: Path, name: str, model: sb.BicAlphabetModel, title: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    trace = np.array(model.report.objectives["bic"])
    axes[0].plot(np.arange(1, len(trace) + 1), trace / 1e3)
    axes[0].set(xlabel="iteration", ylabel="BIC (thousands)", title=title)
    counts = np.sort(model.counts)[::-1]
    axes[1].bar(np.arange(1, len(counts) + 1), counts)
    axes[1].set(xlabel="word", ylabel="occurrences", title=f"{len(counts)} words")
    axes[1].xaxis.set_major_locator(MaxNLocator(integer=True))
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / f"{name}.png", dpi=110)
    plt.close(figure)


def table(args: argparse.Namespace) -> None:
    sets = [
        ("indoor", "room, 1 scan", lambda: room(1), {"angular_resolution": ROOM_RESOLUTION}),
        ("multi", "hall, 6 scans", hall, {}),
        ("outdoor", "street, 3 scans", street, {}),
    ]
    print_header("data", "radius", *NAMES, "file (bytes)")
    for key, name, read, changes in sets:
        if args.only not in (None, key):
            continue
        cloud = read()
        # The robot's own body, or the car's roof.
        least = {"indoor": 0.5, "multi": 0.5, "outdoor": 2.5}[key]
        for radius in RADII:
            chosen = {"radius": radius, "min_range": least, "iterations": args.iterations} | changes
            model = rows(name, cloud, chosen)
            if args.out:
                file = f"alphabet_bic_{key}_{round(100 * radius)}cm"
                plot(args.out, file, model, f"{name}, radius {radius:g} m")


def rebuild(args: argparse.Namespace) -> None:
    """Scene rebuilding (IV-B): the second scan in the words of the first."""
    chosen = {
        "min_range": 0.5,
        "angular_resolution": ROOM_RESOLUTION,
        "iterations": args.iterations,
    }
    alphabet = sb.learn_bic_alphabet(room(1), **chosen).alphabet
    print_header("data", "radius", *NAMES, "file (bytes)")
    rows("room, scan 2 in the words of scan 1", room(2), chosen, alphabet)


def main() -> None:
    args = parse()
    check_data()
    sb.set_num_threads(args.threads)
    if args.only != "rebuild":
        table(args)
    if args.only in (None, "rebuild"):
        print()
        rebuild(args)


if __name__ == "__main__":
    main()
