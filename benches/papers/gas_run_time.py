"""Run time of growing neural gas (Morell et al., table of runtimes), indexed and by brute force.

    python benches/papers/gas_run_time.py [--out FOLDER] [--brute-signals 200000]

On two million points of the kitchen, one thread, CPU seconds: the paper's networks of 5000, 12000
and 20000 neurons with 250, 350 and 500 patterns each, grown through our index; and the cost of a
signal for 1000 to 50000 neurons, from networks that are kept at their size while more signals
come, through the index and by our own brute-force search (vectorised over all neurons, same
network). Both costs include the adaptation; brute force gets fewer signals.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from gas_scans import cpu_seconds, scan

import surfabet as sb

PAPER = [(5000, 250, 63.0, 21.0), (12_000, 350, 526.0, 105.2), (20_000, 500, 1448.0, 241.33)]
SIZES = [1000, 2000, 5000, 10_000, 20_000, 50_000]


def grow(cloud: sb.PointCloud, n: int, patterns: int) -> tuple[float, float]:
    """CPU seconds and wall-clock seconds of growth alone."""
    began = cpu_seconds()
    model = sb.learn_gas(cloud, n_neurons=n, patterns=patterns)
    used = cpu_seconds() - began
    stages = model.report.stages
    share = stages["growing"] / sum(stages.values())
    return used * share, stages["growing"]


def per_signal(cloud: sb.PointCloud, n: int, search: str, signals: int) -> float:
    """Microseconds of CPU per signal at n neurons: what more signals cost a grown network."""

    def seconds(passes: float) -> float:
        began = cpu_seconds()
        model = sb.learn_gas(cloud, n_neurons=n, patterns=2, passes=passes, search=search)  # type: ignore[arg-type]
        assert len(model) == n
        return cpu_seconds() - began

    # Few patterns, so that the network grows up soon; the difference of both runs is of the grown.
    base = 4 * n / len(cloud)
    short, long = seconds(base), seconds(base + signals / len(cloud))
    return 1e6 * (long - short) / signals


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(5.4, 4))
    n = [row["neurons"] for row in rows]
    indexed = [row["indexed"] for row in rows]
    axis.loglog(n, indexed, marker="o", lw=2, label="indexed")
    axis.loglog(n, [row["brute force"] for row in rows], marker="s", label="brute force")
    law = indexed[0] * np.log(n) / np.log(n[0])
    axis.loglog(n, law, ls=":", color="grey", label="logarithm, through the first point")
    axis.set_xlabel("neurons")
    axis.set_ylabel("microseconds per signal, one core")
    axis.grid(True, which="both", alpha=0.3)
    axis.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder of rows and plot")
    parser.add_argument("--signals", type=int, default=2_000_000)
    parser.add_argument("--brute-signals", type=int, default=200_000)
    options = parser.parse_args()
    sb.set_num_threads(1)
    cloud = scan("kitchen")
    print(f"{len(cloud):,} points, one thread\n")
    print("| neurons | patterns | CPU s | wall clock s | paper, CPU s | paper, GPU s |")
    print("|---|---|---|---|---|---|")
    for n, patterns, cpu, gpu in PAPER:
        used, wall = grow(cloud, n, patterns)
        print(f"| {n:,} | {patterns} | {used:.1f} | {wall:.1f} | {cpu:g} | {gpu:g} |", flush=True)
    print("\n| neurons | indexed, us per signal | brute force, us per signal | ratio |")
    print("|---|---|---|---|")
    rows = []
    for n in SIZES:
        indexed = per_signal(cloud, n, "indexed", options.signals)
        brute = per_signal(cloud, n, "brute-force", options.brute_signals)
        rows.append({"neurons": n, "indexed": indexed, "brute force": brute})
        print(f"| {n:,} | {indexed:.2f} | {brute:.2f} | {brute / indexed:.1f} |", flush=True)
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "gas_run_time.json").write_text(json.dumps(rows, indent=1))
        draw(rows, options.out / "gas_run_time.png")


if __name__ == "__main__":
    main()
