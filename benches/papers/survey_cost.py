"""CPU seconds of the survey that every method starts with, on one thread.

    python benches/papers/survey_cost.py [--runs 5]

For every real scan the least of some runs, with the figures that were found.
"""

from __future__ import annotations

import argparse

import defaults
from gas_scans import cpu_seconds, scan
from paper_bench import check_data, print_header, print_row

import surfabet as sb


def cost(cloud: sb.PointCloud, runs: int) -> float:
    """Least CPU seconds of a survey."""
    seconds = []
    for _ in range(runs):
        began = cpu_seconds()
        sb.survey(cloud)
        seconds.append(cpu_seconds() - began)
    return min(seconds)


def figure(value: float | None) -> str:
    """A length in four digits."""
    return "" if value is None else f"{value:.4g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    check_data()
    sb.set_num_threads(1)
    print_header("scan", "points", "spacing", "noise", "layers", "lines", "outliers", "CPU s")
    for name in [*defaults.SCANS, "kitchen"]:
        cloud = scan(name) if name == "kitchen" else defaults.read(name)
        found = sb.survey(cloud)
        print_row(
            name,
            f"{len(cloud):,}",
            figure(found.spacing),
            figure(found.noise),
            figure(found.layer_gap),
            figure(found.line_spacing),
            f"{len(found.outliers):,}",
            f"{cost(cloud, options.runs):.2f}",
        )


if __name__ == "__main__":
    main()
