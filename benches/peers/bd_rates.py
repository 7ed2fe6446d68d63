"""Bjontegaard rate differences of surfabet's patches to GeS-TM and G-PCC, on scans with colours.

    python benches/peers/bd_rates.py --out DIR                   # ours, beside kept rows of peers
    python benches/peers/bd_rates.py --gestm PATH [--tmc3 PATH]  # rows of peers that are missing
    python benches/peers/bd_rates.py --out DIR --tables          # measures nothing

The scans are the real kitchen of `patches_rd.py` and four simulated rooms that chose no constant
of surfabet. All tools code the scan thinned to 5 mm by voxel means, and are measured against it
with all points queried; error and colour are those of the worse direction. Every tool has a sweep
of settings, of which the lower hull counts; surfabet also its curve over `resolution` alone at the
defaults.

Three differences of bytes, each the mean of the logarithm over the qualities of both hulls
(`bjontegaard.py`):

- geometry: bytes without colour against the error;
- total: all bytes against the colour's error, with only those settings of surfabet whose error is
  no larger than the peer's at that colour;
- colour: bytes of colour against the colour's error.

Peers' rows are kept in `--peers` (by default those of docs/benchmarks/patches.md), ours in
DIR/ours.json.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import peer_codecs as peers
from bjontegaard import bd_rate, lower_hull
from patches_rd import GESTM, GPCC_TRISOUP
from peer_codecs import Coded, GesSetting, number

import surfabet as sb
from surfabet import datasets

KEPT = Path(__file__).resolve().with_name("bd_peers.json")
SCENES = ["kitchen", "room 8", "room 9", "room 10", "room 11"]
COLORS = {"kitchen": (22.5, 27.0)}
"""Errors of colour that are compared; elsewhere all that both tools have."""
RESOLUTIONS = [0.008, 0.009, 0.010, 0.011, 0.0125, 0.015, 0.018, 0.022]
ROOM_RESOLUTIONS = [0.015, 0.018, 0.022, 0.028, 0.035, 0.045]
"""Rooms are noisier than the kitchen: the default there is 22 mm."""
ROOM_GESTM = [
    GesSetting(0.014, 8, 256, 24, 43),
    GesSetting(0.020, 8, 192, 18, 43),
    GesSetting(0.010, 8, 256, 24, 43),
    GesSetting(0.014, 8, 256, 24, 38),
    GesSetting(0.020, 8, 192, 18, 38),
    GesSetting(0.014, 8, 256, 24, 48),
    GesSetting(0.020, 8, 192, 18, 50),
    GesSetting(0.010, 8, 256, 24, 37),
    GesSetting(0.014, 6, 256, 18, 43),
    GesSetting(0.020, 5, 192, 15, 43),
    GesSetting(0.028, 8, 128, 18, 46),
]
"""The best that was found on room 8 at four quantisers of colour, in nodes of 8 to 22 cm."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Own:
    """Options of `learn_patches`; None where the default decides."""

    resolution: float
    color_step: int | None = None
    rate: float | None = None

    @property
    def name(self) -> str:
        given = [f"{1e3 * self.resolution:g} mm"]
        if self.color_step is not None:
            given.append(f"color_step {self.color_step}")
        if self.rate is not None:
            given.append(f"rate {self.rate:g}")
        return ", ".join(given)

    def options(self) -> dict[str, float]:
        given = {"color_step": self.color_step, "rate": self.rate}
        return {name: value for name, value in given.items() if value is not None}


SWEEP = [
    Own(0.0065, 90, 2.8),
    Own(0.007, 100, 2.8),
    Own(0.008, 120, 2.8),
    Own(0.008, 160, 2.8),
    Own(0.009, 120, 2.8),
    Own(0.010, 120, 2.8),
    Own(0.010, 160, 2.8),
    Own(0.0125, 140, 2.8),
    Own(0.015, 140, 2.8),
    Own(0.018, 120, 4.0),
]
ROOM_SWEEP = [
    Own(0.018, 90, 2.8),
    Own(0.022, 60, 2.8),
    Own(0.028, 60, 2.8),
    Own(0.028, 120, 2.8),
    Own(0.035, 60, 2.8),
]


def own_settings(scene: str) -> list[Own]:
    """The curve of the defaults over `resolution`, and the sweep about it."""
    if scene == "kitchen":
        return [Own(r) for r in RESOLUTIONS] + SWEEP
    return [Own(r) for r in ROOM_RESOLUTIONS] + ROOM_SWEEP


def gestm_settings(scene: str) -> list[GesSetting]:
    return GESTM if scene == "kitchen" else ROOM_GESTM


def reference(scene: str) -> sb.PointCloud:
    """What all tools code: a scan thinned to 5 mm."""
    if scene == "kitchen":
        return peers.room_reference()
    seed = int(scene.rpartition(" ")[2])
    return sb.voxel_downsample(datasets.simulated_room(seed=seed).cloud, 0.005)


def own(cloud: sb.PointCloud, setting: Own) -> Coded:
    """Our patches through their bytes, decoded as measured as `patches_rd.py` does."""
    began = peers.cpu_seconds()
    model = sb.learn_patches(
        cloud, resolution=setting.resolution, completeness=0, **setting.options()
    )
    data = model.to_bytes()
    encoded = peers.cpu_seconds()
    spacing = min(0.5 * setting.resolution, 0.005)
    decoded = sb.from_bytes(data).decode(spacing, as_measured=True)
    seconds = peers.cpu_seconds() - encoded
    return Coded(len(data), geometry_bytes(data), encoded - began, seconds, decoded)


def geometry_bytes(data: bytes) -> int:
    """All bytes of a file but the sections of colour."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.sfb"
        path.write_bytes(data)
        return sum(n for name, n in sb.inspect(path).sections.items() if "colour" not in name)


def rows_of(path: Path, scene: str) -> list[Row]:
    content = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return list(content.get(scene, {}).get("rows", []))


def keep(path: Path, scene: str, n_reference: int, row: Row) -> None:
    """Adds a row to a file, which other runs may have written to since."""
    content = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    of = content.setdefault(scene, {"reference_points": n_reference, "rows": []})
    if of["reference_points"] != n_reference:
        raise SystemExit(
            f"{path} has rows of {scene} with {of['reference_points']:,} points, not"
            f" {n_reference:,}: give another file"
        )
    of["rows"] = [
        r for r in of["rows"] if (r["tool"], r["setting"]) != (row["tool"], row["setting"])
    ]
    of["rows"].append(row)
    peers.write_json(path, content)


def measure(options: argparse.Namespace, scene: str) -> None:
    """Measures rows of a scene that are missing."""
    cloud = reference(scene)
    theirs: list[tuple[str, str, Callable[[], Coded]]] = []
    if options.gestm is not None:
        program = peers.find_gestm(options.gestm)
        theirs += [
            (s.tool, s.name, lambda s=s: peers.gestm(cloud, s, program))
            for s in gestm_settings(scene)
        ]
    if options.tmc3 is not None:
        tmc3 = peers.find_tmc3(options.tmc3)
        theirs += [(s.tool, s.name, lambda s=s: peers.gpcc(cloud, s, tmc3)) for s in GPCC_TRISOUP]
    ours = [("surfabet", s.name, lambda s=s: own(cloud, s)) for s in own_settings(scene)]
    for path, jobs in ((options.peers, theirs), (options.ours, ours)):
        if path is None:
            continue
        for tool, setting, code in jobs:
            if any((r["tool"], r["setting"]) == (tool, setting) for r in rows_of(path, scene)):
                continue
            row = {"tool": tool, "setting": setting, **peers.measured(cloud, code())}
            keep(path, scene, len(cloud), row)
            print(
                f"{scene}, {tool}, {setting}: {row['bytes']:,} bytes", file=sys.stderr, flush=True
            )


def color_bytes(row: Row) -> int:
    return int(row["bytes"] - row["geometry_bytes"])


def geometry(rows: Sequence[Row]) -> list[tuple[float, float]]:
    return [(1e3 * r["rmse"], r["geometry_bytes"]) for r in rows]


def total(rows: Sequence[Row]) -> list[tuple[float, float]]:
    return [(r["color_rmse"], r["bytes"]) for r in rows]


def color(rows: Sequence[Row]) -> list[tuple[float, float]]:
    return [(r["color_rmse"], color_bytes(r)) for r in rows]


def hull_rows(rows: Sequence[Row]) -> list[Row]:
    """The rows on the lower hull of all bytes against colour, by growing error of colour."""
    hull = set(lower_hull(total(rows)))
    found = {point: row for row, point in zip(rows, total(rows), strict=True) if point in hull}
    return [found[point] for point in sorted(found)]


def no_larger_error(ours: Sequence[Row], theirs: Sequence[Row]) -> list[Row]:
    """Those of ours whose error is no larger than that of the peer's hull at the same colour."""
    hull = hull_rows(theirs)
    colors, errors = [r["color_rmse"] for r in hull], [r["rmse"] for r in hull]
    return [r for r in ours if r["rmse"] <= np.interp(r["color_rmse"], colors, errors)]


def difference(
    theirs: list[tuple[float, float]],
    ours: list[tuple[float, float]],
    errors: tuple[float, float] = (0.0, np.inf),
) -> str:
    """The rate difference of two lower hulls and what it was taken over, for a table."""
    anchor, tested = lower_hull(theirs), lower_hull(ours)
    if min(len(anchor), len(tested)) < 2:
        return "-"
    try:
        rate, (low, high) = bd_rate(anchor, tested, errors, straight=True)
    except ValueError:
        return "-"
    return f"{100 * rate:+.0f} % ({low:.1f} to {high:.1f})"


def rate_table(options: argparse.Namespace) -> str:
    """A row per scene, peer and curve of ours."""
    lines = []
    for scene in options.scenes:
        all_ours = rows_of(options.ours, scene)
        defaults = {s.name for s in own_settings(scene) if not s.options()}
        curves = {
            "sweep": all_ours,
            "default": [r for r in all_ours if r["setting"] in defaults],
        }
        their_rows = rows_of(options.peers, scene)
        colors = COLORS.get(scene, (0.0, np.inf))
        for tool in sorted({r["tool"] for r in their_rows}):
            theirs = [r for r in their_rows if r["tool"] == tool]
            for name, ours in curves.items():
                even = no_larger_error(ours, theirs)
                lines.append(
                    [
                        scene,
                        tool,
                        name,
                        difference(geometry(theirs), geometry(ours)),
                        difference(total(theirs), total(even), colors),
                        difference(color(theirs), color(ours), colors),
                    ]
                )
    header = [
        "scan",
        "against",
        "ours",
        "geometry (mm)",
        "total at no larger error (colour)",
        "colour bytes (colour)",
    ]
    return peers.table(header, lines)


def hull_table(options: argparse.Namespace) -> str:
    """What lies on the hulls of all bytes against colour."""
    header = ["scan", "tool", "setting", "bytes", "geometry", "colour bytes", "error mm", "colour"]
    lines = []
    for scene in options.scenes:
        rows = rows_of(options.peers, scene)
        for tool in sorted({r["tool"] for r in rows}):
            lines += hull_rows([r for r in rows if r["tool"] == tool])
        lines += hull_rows(rows_of(options.ours, scene))
        lines = [line if isinstance(line, list) else hull_cells(scene, line) for line in lines]
    return peers.table(header, lines)


def hull_cells(scene: str, row: Row) -> list[str]:
    return [
        scene,
        row["tool"],
        row["setting"],
        number(row["bytes"]),
        number(row["geometry_bytes"]),
        number(color_bytes(row)),
        number(row["rmse"], 1, 1e3),
        number(row["color_rmse"], 1),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=SCENES)
    parser.add_argument("--gestm", type=Path, help="GeS-TM's program: measures its missing rows")
    parser.add_argument("--tmc3", type=Path, help="G-PCC's program: measures its missing rows")
    parser.add_argument("--peers", type=Path, default=KEPT, help="file of the peers' rows")
    parser.add_argument("--out", type=Path, help="folder of our rows, ours.json")
    parser.add_argument("--tables", action="store_true", help="measure nothing")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    options.ours = options.out and options.out / "ours.json"
    if options.ours is None and options.gestm is None and options.tmc3 is None:
        parser.error("nothing to do: give --out for ours, --gestm or --tmc3 for peers")
    sb.set_num_threads(options.threads)
    if not options.tables:
        for scene in options.scenes:
            measure(options, scene)
    if options.ours is not None:
        print(rate_table(options), hull_table(options), sep="\n\n")


if __name__ == "__main__":
    main()
