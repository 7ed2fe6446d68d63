"""Nearer to the true surface than the input? A simulated room, whose surface is known exactly.

    python benches/peers/room_truth.py [--resolutions 0.012 ...] [--steps 0.01 ...] [--tmc3 PATH]
                                       [--out DIR]

The room is scanned by a depth camera with a Kinect's noise and with an error of every frame's pose.
Accuracy is the distance of decoded points to the exact surface (of a fixed sample of them).
Completeness is the share of the true surface within 1 cm of a decoded point. The surface counts
where a camera saw it: a sample lies inside a frame's image and depth limits at its true pose, no
more than 67 degrees from facing the camera (beyond, the simulated camera starts to lose pixels),
with nothing in between. All tools code the same noisy cloud, colours included. It is turned and
shifted first: along the axes the walls would fall on the faces of the voxels of every grid.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import peer_codecs as peers
from peer_codecs import Coded, GpccSetting, number
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import surfabet as sb
from surfabet import datasets

DEPTH_LIMITS = (0.4, 4.0)
MAX_INCIDENCE = 67.0
NEAR = 0.01
"""Metres from a decoded point within which the surface counts as covered."""
N_SAMPLED = 100_000
TURN = Rotation.from_euler("zyx", [31.0, 2.0, 1.0], degrees=True).as_matrix()
SHIFT = np.array([0.137, -0.211, 0.053])

Row = dict[str, Any]


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolutions", type=float, nargs="+", default=[0.008, 0.012, 0.02])
    parser.add_argument("--steps", type=float, nargs="+", default=[0.01, 0.02, 0.04, 0.06])
    parser.add_argument("--frames", type=int, default=18, help="of 640 x 480")
    parser.add_argument("--noise", type=float, default=1.0, help="times a Kinect's depth noise")
    parser.add_argument("--pose-error", type=float, default=1.0, help="times 3 mm, 0.1 degrees")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tmc3", type=Path, help="G-PCC's program, if not on the PATH")
    parser.add_argument("--out", type=Path, help="folder of the plot and of the rows")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    parser.add_argument("--threads", type=int, default=2)
    return parser.parse_args()


def placed(cloud: sb.PointCloud) -> sb.PointCloud:
    """The cloud out of line with the axes."""
    return sb.PointCloud(
        cloud.points @ TURN.T + SHIFT,
        colors=cloud.colors,
        ranges=cloud.ranges,
        viewpoints=cloud.viewpoints @ TURN.T + SHIFT,
        viewpoint_index=cloud.viewpoint_index,
    )


@dataclass(frozen=True)
class Truth:
    """The exact surface, and samples of what the cameras saw of it."""

    scene: datasets.Scene
    seen: np.ndarray
    seed: int

    def judge(self, decoded: sb.PointCloud) -> Row:
        points = (decoded.points - SHIFT) @ TURN
        some = points
        if len(points) > N_SAMPLED:
            rng = np.random.default_rng(self.seed)
            some = points[rng.choice(len(points), N_SAMPLED, replace=False)]
        distances = self.scene.distance(some)
        gaps = cKDTree(points).query(self.seen, workers=sb.get_num_threads())[0]
        return {
            "points": len(points),
            "rms": float(np.sqrt(np.mean(distances**2))),
            "median": float(np.median(distances)),
            "p99": float(np.quantile(distances, 0.99)),
            "complete": float(np.mean(gaps <= NEAR)),
            "gap_p99": float(np.quantile(gaps, 0.99)),
        }


def seen_surface(scan: datasets.SimulatedScan, spacing: float) -> np.ndarray:
    """Samples (n, 3) of the true surface that a camera saw, as the top of the file says."""
    points, truth = scan.scene.sample_surface(spacing)
    normals = truth.normals.astype(np.float64)
    seen = np.zeros(len(points), bool)
    for frame in scan.frames:
        assert frame.depth is not None
        assert frame.intrinsics is not None
        height, width = frame.depth.shape
        rotation, eye = frame.true_pose[:3, :3], frame.true_pose[:3, 3]
        rest = np.flatnonzero(~seen)
        rays = points[rest] - eye
        x, y, z = (rays @ rotation).T
        ok = (z >= DEPTH_LIMITS[0]) & (z <= DEPTH_LIMITS[1])
        fx, fy = frame.intrinsics[0, 0], frame.intrinsics[1, 1]
        cx, cy = frame.intrinsics[0, 2], frame.intrinsics[1, 2]
        u, v = fx * x / np.where(ok, z, 1) + cx, fy * y / np.where(ok, z, 1) + cy
        ok &= (u >= 0) & (u <= width - 1) & (v >= 0) & (v <= height - 1)
        # Where surfaces have no outer side to speak of, either side faces.
        facing = np.abs(np.sum(rays * normals[rest], axis=1)) / np.linalg.norm(rays, axis=1)
        ok &= facing >= np.cos(np.radians(MAX_INCIDENCE))
        rest = rest[ok]
        seen[rest] = scan.scene.visible(points[rest], normals[rest], eye[None])
    return points[seen]


def contestants(
    cloud: sb.PointCloud, options: argparse.Namespace
) -> Iterator[tuple[str, str, Coded | None]]:
    for resolution in options.resolutions:
        setting = f"{1e3 * resolution:g} mm"
        surface, measured = peers.surfabet_patches(cloud, resolution)
        yield "surfabet patches, surface", setting, surface
        yield "surfabet patches, as measured", setting, measured
    for step in options.steps:
        yield "voxel means, LAZ 1 mm", f"{1e3 * step:g} mm", peers.laz(cloud, step)
    for step in options.steps:
        yield "OctoMap centres", f"{1e3 * step:g} mm", peers.octomap(cloud, step)
    for step in options.steps:
        yield "Draco, level 10, 5-bit colour", f"{1e3 * step:g} mm", peers.draco(cloud, step)
    if tmc3 := peers.find_tmc3(options.tmc3):
        for step, node_log2 in ((0.007, 3), (0.010, 3)):
            setting = GpccSetting(step, node_log2, 46)
            yield setting.tool, setting.name, peers.gpcc(cloud, setting, tmc3)


def plot(rows: list[Row], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(12, 5), layout="constrained")
    tools = list(dict.fromkeys(row["tool"] for row in rows[1:]))
    panels = [
        ("rms", 1e3, "rms distance to the true surface (mm)"),
        ("complete", 1e2, "true surface within 1 cm of a point (%)"),
    ]
    for axis, (name, scale, label) in zip(axes, panels, strict=True):
        for tool in tools:
            found = [row for row in rows if row["tool"] == tool]
            sizes = [row["bytes"] for row in found]
            axis.plot(sizes, [scale * row[name] for row in found], "o-", label=tool)
        axis.axhline(scale * rows[0][name], color="black", linestyle=":", label="input")
        axis.set_xscale("log")
        axis.set_xlabel("all bytes")
        axis.set_ylabel(label)
        axis.grid(alpha=0.3, which="both")
    axes[0].legend(fontsize="small")
    figure.savefig(path, dpi=130)


def cells(row: Row) -> list[str]:
    return [
        row["tool"],
        row["setting"],
        number(row["bytes"]),
        number(row["points"]),
        number(row["rms"], 1, 1e3),
        number(row["median"], 1, 1e3),
        number(row["p99"], 1, 1e3),
        number(row["complete"], 2, 1e2),
        number(row["gap_p99"], 1, 1e3),
    ]


HEADER = [
    "tool",
    "setting",
    "bytes",
    "points",
    "rms to surface mm",
    "median",
    "p99",
    "% of surface within 1 cm",
    "p99 surface to point mm",
]


def main() -> None:
    options = parse()
    sb.set_num_threads(options.threads)
    scan = datasets.scan_rgbd(
        datasets.make_room(seed=options.seed),
        n_frames=options.frames,
        depth_limits=DEPTH_LIMITS,
        depth_noise=options.noise,
        translation_std=0.003 * options.pose_error,
        rotation_std=0.1 * options.pose_error,
        random_state=options.seed,
    )
    cloud = placed(scan.cloud)
    truth = Truth(scan.scene, seen_surface(scan, 0.02), options.seed)
    print(
        f"{len(cloud):,} points, {len(truth.seen):,} samples of the surface that was seen",
        file=sys.stderr,
    )
    rows = [{"tool": "input", "setting": "", "bytes": None} | truth.judge(cloud)]
    for tool, setting, coded in contestants(cloud, options):
        if coded is not None:
            row = {"tool": tool, "setting": setting, "bytes": coded.bytes}
            rows.append(row | truth.judge(coded.decoded))
            print(f"{tool}, {setting}: {coded.bytes:,} bytes", file=sys.stderr, flush=True)
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        print(peers.table(HEADER, [cells(row) for row in rows]))
    if options.out:
        peers.write_json(options.out / "room_truth.json", rows)
        plot(rows, options.out / "room_truth.png")


if __name__ == "__main__":
    main()
