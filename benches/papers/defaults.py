"""What the defaults choose: resolution, bytes, share within the tolerance, seconds and memory.

    python benches/papers/defaults.py                         every real scan, as it is
    python benches/papers/defaults.py --thin 0.01 0.02 0.05   and thinned to these spacings, metres
    python benches/papers/defaults.py --model patches gas

The tolerance is that of the survey: two spacings of the points, or three times their noise where
that is more. Each run is a process of its own, so that its peak memory is known.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
import warnings

import numpy as np
from paper_bench import DATA, check_data, print_header, print_row

import surfabet as sb

SCANS = {
    "room": "indoor_scan/room_scan1.pcd",
    "table": "rgbd_frame/table.pcd",
    "objects": "rgbd_frame/objects.pcd",
    "hall": "multi_scan/full0.pcd",
    "street": "outdoor_360",
    "pump": "e57/pumpAVisualReferenceImage.e57",
    "airborne, feet": "georeferenced/autzen_trim.laz",
    "airborne, UTM": "georeferenced/terrain_utm.pcd",
    "fused room": "rgbd_room",
}
LEARN = {
    "patches": sb.learn_patches,
    "hscsm": sb.learn_hscsm,
    "gas": sb.learn_gas,
    "alphabet": sb.learn_alphabet,
    "bic-alphabet": sb.learn_bic_alphabet,
    "planes": sb.learn_planes,
}


def read(name: str) -> sb.PointCloud:
    """A scan; of a folder of single scans the first."""
    path = DATA / SCANS[name]
    if name == "street":
        path = min(path.glob("*.bin"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sb.read(path)


def thinned(cloud: sb.PointCloud, side: float) -> sb.PointCloud:
    """The first point of each cube of this side, metres."""
    cubes = np.floor(cloud.local_points / side).astype(np.int64)
    _, first = np.unique(cubes, axis=0, return_index=True)
    return cloud.select(np.sort(first).astype(np.uint32))


def measure(name: str, thin: float, method: str) -> dict[str, object]:
    """One run."""
    cloud = read(name)
    if thin > 0:
        cloud = thinned(cloud, thin)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        started = time.perf_counter()
        model = LEARN[method](cloud)
        seconds = time.perf_counter() - started
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    survey = sb.survey(cloud)
    kept = np.ones(len(cloud), bool)
    kept[survey.outliers if method == "gas" else survey.strays] = False
    decoded = model.decode(as_measured=model.keeps_thickness)
    near = 0.0
    if len(decoded):
        quality = sb.evaluate(
            cloud.select(kept), decoded, sigma=survey.tolerance, normal_neighbors=None
        )
        near = quality.inliers or 0.0
    chosen = ", ".join(f"{k} {v[0]:.4g}" for k, v in model.report.chosen.items())
    return {
        "points": len(cloud),
        "tolerance": survey.tolerance,
        "chosen": chosen or "-",
        "bytes": len(model.to_bytes()),
        "within": near,
        "seconds": seconds,
        "MB": (peak - before) / 1024,
    }


def main() -> None:
    """Prints a row per scan and method."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scan", nargs="+", choices=SCANS, default=list(SCANS))
    parser.add_argument("--thin", nargs="*", type=float, default=[])
    parser.add_argument("--model", nargs="+", choices=LEARN, default=["patches", "hscsm", "gas"])
    parser.add_argument("--one", nargs=3, metavar=("SCAN", "THIN", "MODEL"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    check_data()
    if arguments.one:
        name, thin, method = arguments.one
        print(json.dumps(measure(name, float(thin), method)))
        return
    print_header("scan", "points", "model", "tolerance, m", "chosen", "bytes", "within", "s", "MB")
    for name in arguments.scan:
        for thin in [0.0, *arguments.thin]:
            for method in arguments.model:
                call = [sys.executable, __file__, "--one", name, str(thin), method]
                done = subprocess.run(call, capture_output=True, text=True, check=True)
                row = json.loads(done.stdout)
                label = f"{name}, {100 * thin:g} cm" if thin else name
                print_row(
                    label,
                    f"{row['points']:,}",
                    method,
                    f"{row['tolerance']:.3g}",
                    row["chosen"],
                    f"{row['bytes']:,}",
                    f"{row['within']:.2%}",
                    f"{row['seconds']:.1f}",
                    f"{row['MB']:.0f}",
                )


if __name__ == "__main__":
    main()
