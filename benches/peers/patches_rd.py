"""Rate and distortion of the coloured room: surfabet's patches beside voxel and surface coders.

    python benches/peers/patches_rd.py [--resolutions 0.008 0.012 ...] [--tmc3 PATH] [--gestm PATH]
                                       [--out DIR]

The reference is the real room thinned to 5 mm by voxel means. All tools code this reference
(`--input raw` gives ours the raw scan instead). Patches are decoded as measured. The error is the
larger of both directions with all points queried, the pooled one stands beside it; all bytes count.

With `--out`, the peers' rows are kept in DIR/peers.json and are measured again only with
`--refresh`; ours go to DIR/ours.json, and the curves to DIR/patches_rd.png. `--redraw` measures
nothing and prints and draws what is kept.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import peer_codecs as peers
from peer_bench import ROOM
from peer_codecs import Coded, GesSetting, GpccSetting, number

import surfabet as sb

OURS = "surfabet patches"
RESOLUTIONS = [0.006, 0.008, 0.010, 0.012, 0.015, 0.020, 0.025]
DRACO_STEPS = [0.005, 0.007, 0.010, 0.015, 0.020, 0.030]
OCTOMAP_STEPS = [0.007, 0.010, 0.015, 0.020, 0.030]
LAZ_STEPS = [0.010, 0.020]
GPCC_OCTREE = [GpccSetting(step, 0, qp) for qp in (34, 46) for step in (0.007, 0.010, 0.015, 0.020)]
GPCC_TRISOUP = [
    GpccSetting(step, node_log2, qp)
    for qp in (46, 40, 51)
    for step, node_log2 in ((0.005, 2), (0.007, 2), (0.005, 3), (0.007, 3), (0.010, 3), (0.014, 3))
]
# Steps, nodes, thicknesses and quantisers of vertices: those on the hull at four quantisers of
# colour, their neighbours at one.
_GESTM_BEST = [
    (0.007, 8, 256, 24),
    (0.007, 8, 256, 18),
    (0.010, 8, 192, 24),
    (0.005, 12, 512, 22),
]
_GESTM_BESIDE = [
    (0.005, 8, 384, 18),
    (0.007, 6, 256, 15),
    (0.007, 7, 256, 18),
    (0.007, 10, 256, 24),
    (0.010, 10, 192, 24),
    (0.014, 8, 128, 24),
    (0.007, 8, 192, 24),
    (0.007, 8, 320, 24),
    (0.010, 8, 256, 24),
]
GESTM = [GesSetting(*geometry, qp) for qp in (46, 43, 40, 50) for geometry in _GESTM_BEST]
GESTM += [GesSetting(*geometry, 46) for geometry in _GESTM_BESIDE]

Row = dict[str, Any]


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolutions", type=float, nargs="+", default=RESOLUTIONS)
    parser.add_argument("--input", choices=["reference", "raw"], default="reference")
    parser.add_argument("--tmc3", type=Path, help="G-PCC's program, if not on the PATH")
    parser.add_argument("--gestm", type=Path, help="GeS-TM's program, if not on the PATH as gestm")
    parser.add_argument("--out", type=Path, help="folder of the plot and of measured rows")
    parser.add_argument("--refresh", action="store_true", help="measure the peers again")
    parser.add_argument("--redraw", action="store_true", help="measure nothing")
    parser.add_argument("--only-peers", action="store_true", help="leave ours as it was")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    if options.redraw and options.out is None:
        parser.error("--redraw needs --out")
    return options


def jobs(
    reference: sb.PointCloud, tmc3: Path | None, gestm: Path | None
) -> Iterator[tuple[str, str, str, Callable[[], Coded | None]]]:
    """Tool, setting, name of the curve and how it is measured."""
    for step in DRACO_STEPS:
        tool = "Draco, level 10"
        setting = f"{1e3 * step:g} mm grid, 5-bit colour"
        yield tool, setting, tool, lambda step=step: peers.draco(reference, step)
    for step in OCTOMAP_STEPS:
        tool = "OctoMap .ot, leaves"
        yield tool, f"{1e3 * step:g} mm", tool, lambda step=step: peers.octomap(reference, step)
    for step in LAZ_STEPS:
        tool, setting = "LAZ, 1 mm", f"{1e3 * step:g} mm voxel means"
        yield tool, setting, tool, lambda step=step: peers.laz(reference, step)
    if tmc3 is not None:
        for gpcc in GPCC_OCTREE + GPCC_TRISOUP:
            yield (
                gpcc.tool,
                gpcc.name,
                f"{gpcc.tool}, qp {gpcc.qp}",
                lambda gpcc=gpcc: peers.gpcc(reference, gpcc, tmc3),
            )
    if gestm is not None:
        for ges in GESTM:
            yield (
                ges.tool,
                ges.name,
                f"{ges.tool}, qp {ges.qp}",
                lambda ges=ges: peers.gestm(reference, ges, gestm),
            )


def kept(path: Path | None, n_reference: int | None = None) -> list[Row]:
    """Rows of a file, if it was measured against a reference of as many points."""
    if path is None or not path.is_file():
        return []
    content = json.loads(path.read_text(encoding="utf-8"))
    if n_reference is not None and content["reference_points"] != n_reference:
        print(f"{path} is of another reference and is measured again", file=sys.stderr)
        return []
    return list(content["rows"])


def measure(options: argparse.Namespace) -> list[Row]:
    raw = sb.read(ROOM)
    reference = sb.voxel_downsample(raw, 0.005)
    n = len(reference)
    tmc3, gestm = peers.find_tmc3(options.tmc3), peers.find_gestm(options.gestm)
    own_file = options.out and options.out / "ours.json"
    peer_file = options.out and options.out / "peers.json"

    theirs = [] if options.refresh else kept(peer_file, n)
    known = {(row["tool"], row["setting"]) for row in theirs}
    for tool, setting, curve, code in jobs(reference, tmc3, gestm):
        if (tool, setting) in known or (coded := code()) is None:
            continue
        row = {"tool": tool, "setting": setting, "curve": curve}
        theirs.append(row | peers.measured(reference, coded))
        print(f"{tool}, {setting}: {coded.bytes:,} bytes", file=sys.stderr, flush=True)
        if peer_file:
            peers.write_json(peer_file, {"reference_points": n, "rows": theirs})

    if options.only_peers:
        return kept(own_file) + theirs
    cloud = raw if options.input == "raw" else reference
    ours = []
    for resolution in options.resolutions:
        _, coded = peers.surfabet_patches(cloud, resolution)
        row = {"tool": OURS, "setting": f"{1e3 * resolution:g} mm", "curve": OURS}
        ours.append(row | {"input": options.input} | peers.measured(reference, coded))
        print(f"{OURS}, {row['setting']}: {coded.bytes:,} bytes", file=sys.stderr, flush=True)
    if own_file:
        peers.write_json(own_file, {"reference_points": n, "rows": ours})
    return ours + theirs


def cells(row: Row) -> list[str]:
    def mm(name: str) -> str:
        return number(row[name], 1, 1e3)

    def share(name: str) -> str:
        return number(row[name], 2, 1e2)

    return [
        row["tool"],
        row["setting"],
        number(row["bytes"]),
        number(row["geometry_bytes"]),
        mm("rmse"),
        f"{mm('rmse_forward')} / {mm('rmse_backward')} ({mm('rmse_pooled')})",
        number(row["color_rmse"], 1),
        f"{row['color_rmse_forward']:.1f} / {row['color_rmse_backward']:.1f}"
        f" ({row['color_rmse_pooled']:.1f})",
        f"{number(1 - row['outliers'], 2, 1e2)} / {share('inliers')}",
        f"{mm('p99_forward')} / {mm('p99_backward')}",
        number(row["points"]),
        number(row["encode_seconds"], 1),
        number(row["decode_seconds"], 1),
    ]


HEADER = [
    "tool",
    "setting",
    "bytes",
    "geometry",
    "error mm",
    "forward / backward (pooled)",
    "colour",
    "forward / backward (pooled)",
    "% within 2 cm",
    "p99 mm",
    "points out",
    "encode CPU s",
    "decode CPU s",
]


def plot(rows: list[Row], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(17, 6), layout="constrained")
    panels = [
        ("bytes", "rmse", 1e3, "error, larger of both directions (mm)", "all bytes"),
        ("geometry_bytes", "rmse", 1e3, "error, larger of both directions (mm)", "geometry bytes"),
        ("bytes", "color_rmse", 1.0, "colour rmse, larger of both directions", "all bytes"),
    ]
    tools = sorted({row["tool"] for row in rows})
    palette = {tool: plt.colormaps["tab10"](i) for i, tool in enumerate(tools)}
    styles = {"34": "-", "40": "-.", "43": (0, (3, 1)), "46": "--", "50": ":", "51": ":"}
    for axis, (size, error, scale, x_label, y_label) in zip(axes, panels, strict=True):
        for curve, group in itertools.groupby(
            sorted(rows, key=lambda r: r["curve"]), key=lambda r: r["curve"]
        ):
            found = sorted((r[size], r[error] * scale, r["tool"]) for r in group)
            y, x, names = zip(*found, strict=True)
            own = curve == OURS
            axis.plot(
                x,
                y,
                "-" if own else styles.get(curve.rpartition(" qp ")[2], "-"),
                marker="o" if own else ".",
                color="black" if own else palette[names[0]],
                linewidth=2.5 if own else 1.2,
                label=curve,
            )
        axis.set_yscale("log")
        axis.set_xlabel(x_label)
        axis.set_ylabel(y_label)
        axis.grid(alpha=0.3, which="both")
    axes[0].legend(fontsize="small")
    figure.savefig(path, dpi=130)
    print(f"curves in {path}", file=sys.stderr)


def main() -> None:
    options = parse()
    sb.set_num_threads(options.threads)
    if options.redraw:
        rows = kept(options.out / "ours.json") + kept(options.out / "peers.json")
    else:
        rows = measure(options)
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        print(peers.table(HEADER, [cells(row) for row in rows]))
    if options.out:
        plot(rows, options.out / "patches_rd.png")


if __name__ == "__main__":
    main()
