"""Cost of encoding against the number of points: surfabet's patches beside OctoMap.

    python benches/peers/encode_scaling.py [--resolution 0.012] [--millions 1 2 4 8 14] [--full]
                                           [--out DIR]

The points are the first frames of the real room. Every run is a process of its own; seconds are
wall clock, from the cloud in memory to the file's bytes and back, and beside them those of all
cores together. Peak memory is the process's
largest resident set from just before the encoding, input included (read from /proc: Linux only).
OctoMap inserts the same points frame by frame with ray casting (`insertPointCloud`, lazily
evaluated, without colours, both with its scans discretised first and without) on the smallest
size, and with `--full` on the largest too.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import peer_codecs as peers
from peer_bench import ROOM, load
from peer_codecs import cpu_seconds, number

import surfabet as sb

Row = dict[str, Any]
OCTREE_STEP = 0.01


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolution", type=float, default=0.012)
    parser.add_argument("--millions", type=float, nargs="+", default=[1, 2, 4, 8, 14])
    parser.add_argument("--full", action="store_true", help="OctoMap on the largest size too")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for an OctoMap")
    parser.add_argument("--out", type=Path, help="folder of the plot and of the rows")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--job", choices=["patches", "rays", "discretised"], help=argparse.SUPPRESS)
    return parser.parse_args()


def first_frames(n_points: float) -> tuple[sb.PointCloud, int]:
    """The cloud of as many whole frames as come nearest to a number of points, and their number."""
    cloud = sb.read(ROOM)
    ends = np.cumsum(np.bincount(cloud.viewpoint_index))
    n_frames = int(np.argmin(np.abs(ends - n_points))) + 1
    return cloud.select(np.arange(ends[n_frames - 1])), n_frames


def reset_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def peak_bytes() -> int:
    status = Path("/proc/self/status").read_text(encoding="ascii")
    line = next(line for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(line.split()[1]) * 1024


def patches_job(options: argparse.Namespace, cloud: sb.PointCloud) -> Row:
    sb.set_num_threads(options.threads)
    reset_peak()
    began, cpu = time.perf_counter(), cpu_seconds()
    data = sb.learn_patches(cloud, resolution=options.resolution, completeness=0).to_bytes()
    encoded, cpu = time.perf_counter(), cpu_seconds() - cpu
    peak = peak_bytes()
    surface = sb.from_bytes(data).decode()
    decoded = time.perf_counter()
    measured = sb.from_bytes(data).decode(as_measured=True)
    return {
        "bytes": len(data),
        "encode_seconds": encoded - began,
        "encode_cpu_seconds": cpu,
        "peak_bytes": peak,
        "decode_seconds": decoded - encoded,
        "decode_as_measured_seconds": time.perf_counter() - decoded,
        "decoded_points": len(surface),
        "decoded_as_measured_points": len(measured),
    }


def octomap_job(options: argparse.Namespace, cloud: sb.PointCloud) -> Row:
    import pyoctomap

    points, eyes, frame_of = cloud.points, cloud.viewpoints, cloud.viewpoint_index
    frames = np.split(points, np.flatnonzero(np.diff(frame_of)) + 1)
    reset_peak()
    tree = pyoctomap.OcTree(OCTREE_STEP)
    began, cpu = time.perf_counter(), cpu_seconds()
    for eye, frame in zip(eyes[np.unique(frame_of)], frames, strict=True):
        tree.insertPointCloud(
            np.ascontiguousarray(frame), eye, -1.0, True, options.job == "discretised"
        )
    tree.updateInnerOccupancy()
    return {
        "encode_seconds": time.perf_counter() - began,
        "encode_cpu_seconds": cpu_seconds() - cpu,
        "peak_bytes": peak_bytes(),
    }


def job(options: argparse.Namespace) -> None:
    """The one measurement of a child process, as JSON on its standard output."""
    cloud, n_frames = first_frames(options.millions[0] * 1e6)
    run = patches_job if options.job == "patches" else octomap_job
    print(json.dumps({"points": len(cloud), "frames": n_frames} | run(options, cloud)))


def measure(options: argparse.Namespace, name: str, millions: float) -> Row | None:
    command = [sys.executable, __file__, "--job", name, "--millions", str(millions)]
    command += ["--resolution", str(options.resolution), "--threads", str(options.threads)]
    limit = None if name == "patches" else options.limit
    threads = os.environ | {"OMP_NUM_THREADS": str(options.threads)}
    try:
        done = subprocess.run(
            command, stdout=subprocess.PIPE, text=True, check=True, timeout=limit, env=threads
        )
    except subprocess.TimeoutExpired:
        print(f"{name} on {millions:g} million points: over {limit:g} s", file=sys.stderr)
        return None
    row: Row = {"tool": name} | json.loads(done.stdout)
    print(f"{name}, {row['points']:,} points: {row['encode_seconds']:.2f} s", file=sys.stderr)
    return row


def slope(rows: list[Row]) -> float:
    """Exponent of the power of the number of points that the seconds grow with."""
    points, seconds = (np.log([row[name] for row in rows]) for name in ("points", "encode_seconds"))
    return float(np.polyfit(points, seconds, 1)[0])


TITLES = {
    "patches": "surfabet patches",
    "rays": "OctoMap, rays of all points",
    "discretised": "OctoMap, discretised scans",
}


def plot(rows: list[Row], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
    panels = [("encode_seconds", 1.0, "encode (s)"), ("peak_bytes", 1e-9, "peak memory (GB)")]
    for axis, (name, scale, label) in zip(axes, panels, strict=True):
        for tool, title in TITLES.items():
            found = [row for row in rows if row["tool"] == tool]
            x = [row["points"] for row in found]
            axis.loglog(x, [scale * row[name] for row in found], "o-", label=title)
        axis.set_xlabel("points")
        axis.set_ylabel(label)
        axis.grid(alpha=0.3, which="both")
    ours = [row for row in rows if row["tool"] == "patches"]
    if len(ours) > 1:
        axes[0].set_title(f"surfabet grows with points to the power {slope(ours):.2f}")
    axes[0].legend()
    figure.savefig(path, dpi=130)


def main() -> None:
    options = parse()
    if options.job:
        job(options)
        return
    if not ROOM.is_dir():
        sys.exit(f"{ROOM} is not there: this script needs the real room")
    sizes = sorted(options.millions)
    runs = [("patches", millions) for millions in sizes]
    if load("pyoctomap"):
        largest = sizes[-1:] if options.full else []
        runs += [(n, m) for m in sizes[:1] + largest for n in ("rays", "discretised")]
    rows = [row for name, millions in runs if (row := measure(options, name, millions))]
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        header = ["tool", "points", "frames", "bytes", "encode s", "CPU s", "peak MB"]
        header += ["decode surface s", "decode as measured s"]
        cells = [
            [
                TITLES[row["tool"]],
                number(row["points"]),
                number(row["frames"]),
                number(row.get("bytes")),
                number(row["encode_seconds"], 2),
                number(row["encode_cpu_seconds"], 2),
                number(row["peak_bytes"], 0, 1e-6),
                number(row.get("decode_seconds"), 2),
                number(row.get("decode_as_measured_seconds"), 2),
            ]
            for row in rows
        ]
        print(peers.table(header, cells))
        ours = [row for row in rows if row["tool"] == "patches"]
        if len(ours) > 1:
            print(f"\nseconds grow with the number of points to the power {slope(ours):.2f}")
    if options.out:
        peers.write_json(options.out / "encode_scaling.json", rows)
        plot(rows, options.out / "encode_scaling.png")


if __name__ == "__main__":
    main()
