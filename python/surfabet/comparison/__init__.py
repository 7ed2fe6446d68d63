"""Models of all methods beside other tools, on a cloud of yours: bytes, errors, time, memory.

    from surfabet import comparison

    found = comparison.compare(surfabet.read("room.ply"))
    print(found.best["smallest"])

Every tool runs in a process of its own and is judged by what a user gets from its bytes.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from surfabet._checks import check_choice, check_cloud, check_flag, check_items, check_number
from surfabet._core import PointCloud, get_num_threads
from surfabet._progress import Progress, progress_callback
from surfabet.comparison.jobs import TOOLS, Job, all_jobs, missing
from surfabet.errors import InvalidInputError
from surfabet.io import write
from surfabet.io._crs import unit_of
from surfabet.survey import survey

__all__ = ["TOOLS", "Comparison", "Row", "compare"]

_SHARE_OF_BEST = 0.98
"""Planes that find this share of what the best find are as good."""


@dataclass(frozen=True, slots=True)
class Row:
    """One tool with one setting; lengths in `Comparison.unit`, bytes, 0 to 255 for colours."""

    tool: str
    """The tool as `TOOLS` names it."""
    label: str
    """The tool for people."""
    setting: str
    """How it was set."""
    ours: bool
    """Whether it is a model of surfabet."""
    kind: str
    """What was decoded: "points", or of our models the thin "surface" or "as measured"."""
    n_bytes: int
    """All bytes."""
    geometry_bytes: int | None
    """Those of the geometry, where they can be told apart."""
    bound: float | None
    """Largest distance that a point of the input can have from what is decoded, by construction."""
    points: int
    """Points that were decoded."""
    rmse: float
    """The larger of both directions."""
    rmse_forward: float
    """From decoded points to the input."""
    rmse_backward: float
    """From points of the input to what was decoded."""
    rmse_pooled: float
    """Over both together."""
    p99_forward: float
    """The distance that 99 % of the decoded points do not exceed."""
    p99_backward: float
    """The distance that 99 % of the input do not exceed."""
    max_forward: float
    """Largest distance of a decoded point."""
    max_backward: float
    """Largest distance of a point of the input."""
    inliers: float
    """Share of the input within the tolerance of what was decoded."""
    outliers: float
    """Share of the decoded points beyond the tolerance of the input."""
    color_rmse: float | None
    """The larger of both directions; None where one of both has no colours."""
    color_rmse_forward: float | None
    color_rmse_backward: float | None
    color_rmse_pooled: float | None
    encode_seconds: float | None
    """Of all cores together; None where a binding would be timed and not the tool."""
    decode_seconds: float | None
    """Of all cores together."""
    memory: int | None
    """Most memory for encoding and decoding beside the cloud, bytes; None where it is not known."""
    pictures: tuple[bytes, ...] = field(default=(), repr=False)
    """What was decoded, its distance to the input, and the input's distance to it, as WebP; empty
    unless asked for."""

    @property
    def name(self) -> str:
        """Tool, setting, and what was decoded."""
        kind = "" if self.kind == "points" else f", {self.kind}"
        return f"{self.label}, {self.setting}{kind}"

    def as_dict(self) -> dict[str, Any]:
        """All fields but the pictures; `n_bytes` as "bytes"."""
        return {
            "bytes" if of.name == "n_bytes" else of.name: getattr(self, of.name)
            for of in dataclasses.fields(self)
            if of.name != "pictures"
        }


@dataclass(frozen=True, slots=True)
class Comparison:
    """What `compare` found; lengths in `unit`."""

    n_points: int
    """Points of the cloud."""
    has_color: bool
    """Whether it has colours."""
    spacing: float
    """Median distance of its points."""
    noise: float
    """Median standard deviation about their surface."""
    resolution: float
    """What the steps of the grids follow from."""
    tolerance: float
    """For inliers and outliers."""
    error: float
    """The rmse that "smallest" and "planes" are to keep."""
    max_error: float
    """The largest distance that "bounded" is to keep."""
    rows: tuple[Row, ...]
    """What each tool made."""
    missing: dict[str, str]
    """Tools that are not here, and how to get them."""
    failed: dict[str, str]
    """Tools and settings that made nothing of the cloud, and why."""
    unit: str = "m"
    """What lengths are in: `m`, or the unit of the cloud's coordinate reference system."""

    @property
    def raw_bytes(self) -> int:
        """12 bytes per point, and 3 for its colour."""
        return (15 if self.has_color else 12) * self.n_points

    @property
    def best(self) -> dict[str, Row | None]:
        """The row to take for three aims; None where none keeps to it.

        "smallest": fewest bytes with an rmse of at most `error` in both directions. "bounded":
        fewest bytes with all points of the input within `max_error` by construction. "planes":
        of the rows of planes that lie within `error` of the input (of all planes where none do),
        those that find about as much of it as any (98 %), and of these the one of fewest bytes.
        """
        near = [row for row in self.rows if row.rmse <= self.error]
        bounded = [
            row for row in self.rows if row.bound is not None and row.bound <= self.max_error
        ]
        planes = [row for row in self.rows if row.tool in ("planes", "open3d-planes")]
        planes = [row for row in planes if row.rmse_forward <= self.error] or planes
        found = max((row.inliers for row in planes), default=0.0)
        planes = [row for row in planes if row.inliers >= _SHARE_OF_BEST * found]
        groups = {"smallest": near, "bounded": bounded, "planes": planes}
        return {
            aim: min(rows, key=lambda row: row.n_bytes, default=None)
            for aim, rows in groups.items()
        }

    def as_dict(self) -> dict[str, Any]:
        """Everything but pictures, for JSON."""
        common = {
            of.name: getattr(self, of.name)
            for of in dataclasses.fields(self)
            if of.name not in ("rows",)
        }
        best = {aim: None if row is None else row.name for aim, row in self.best.items()}
        return common | {"best": best, "rows": [row.as_dict() for row in self.rows]}


def compare(
    cloud: PointCloud,
    *,
    tools: Sequence[str] = TOOLS,
    error: float = 0.01,
    max_error: float | None = None,
    pictures: bool = False,
    progress: Progress = None,
) -> Comparison:
    """Runs models of all methods and the other tools that are installed on one cloud.

    Positions and colours are compared; other attributes are left aside, as not all tools have them.

    Parameters
    ----------
    cloud
        The scan. All tools code it and are judged by it. Its unit is that of all lengths.
    tools
        Names of `TOOLS`; by default all.
    error
        Rmse in both directions that `Comparison.best` is to keep.
    max_error
        Largest distance of a point of the scan that "bounded" is to keep; five times
        `error` if None.
    pictures
        Draw what every tool decodes, and its errors; needs matplotlib.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For an empty cloud, unknown tools, or errors that are not positive.
    """
    check_cloud("cloud", cloud)
    for name in check_items("tools", tools, f"names of {', '.join(TOOLS)}"):
        check_choice("tools", name, TOOLS)
    metres = "a positive number of metres"
    check_number("error", error, metres, above=0.0)
    if max_error is None:
        max_error = 5 * error
    check_number("max_error", max_error, metres, above=0.0)
    check_flag("pictures", pictures)
    if len(cloud) == 0:
        raise InvalidInputError("the cloud is empty; there is nothing to compare")
    found = survey(cloud)
    # What `learn_patches` chooses; the steps of all grids follow from it.
    resolution = max(3 * found.spacing, 1.25 * found.noise) or error
    unit, colored = unit_of(cloud), cloud.colors is not None
    todo = list(all_jobs(tools, resolution, max_error, colored=colored, unit=unit))
    rows: list[Row] = []
    failed: dict[str, str] = {}
    bare = _bare(cloud)
    with tempfile.TemporaryDirectory() as name, progress_callback(progress) as callback:
        folder = Path(name)
        write(folder / "cloud.npz", bare)
        common = {
            "threads": get_num_threads(),
            "sigma": found.tolerance or error,
            "scale": resolution if pictures else None,
        }
        for number, job in enumerate(todo):
            if callback is not None:
                callback(f"{job.label}, {job.setting}", number / len(todo))
            made = _run(folder, job, common)
            if isinstance(made, str):
                failed[f"{job.label}, {job.setting}"] = made
            else:
                rows += made
    return Comparison(
        n_points=len(cloud),
        has_color=colored,
        spacing=found.spacing,
        noise=found.noise,
        resolution=resolution,
        tolerance=found.tolerance or error,
        error=error,
        max_error=max_error,
        rows=tuple(rows),
        missing={tool: how for tool in tools if (how := missing(tool)) is not None},
        failed=failed,
        unit=unit,
    )


def _bare(cloud: PointCloud) -> PointCloud:
    """Positions and colours, with what sides and weights of points follow from."""
    return PointCloud(
        cloud.local_points,
        colors=cloud.colors,
        normals=cloud.normals,
        ranges=cloud.ranges,
        viewpoints=cloud.viewpoints,
        viewpoint_index=cloud.viewpoint_index,
        origin=cloud.origin,
    )


def _run(folder: Path, job: Job, common: dict[str, Any]) -> list[Row] | str:
    """The rows of a job, or why there are none."""
    content = {"coder": job.coder, "arguments": job.arguments} | common
    (folder / "job.json").write_text(json.dumps(content), "utf-8")
    result = folder / "result.json"
    result.unlink(missing_ok=True)
    command = [sys.executable, "-m", "surfabet.comparison.worker", str(folder)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True)
    if not result.is_file():
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        killed = f"ended by signal {-done.returncode}" if done.returncode < 0 else None
        return killed or " ".join(last) or f"ended with {done.returncode}"
    made = json.loads(result.read_text("utf-8"))
    if "error" in made:
        return str(made["error"])
    named: dict[str, Any] = {
        "tool": job.tool,
        "label": job.label,
        "setting": job.setting,
        "ours": job.ours,
    }
    rows = []
    for row in made["rows"]:
        files = [folder / name for name in row.pop("pictures")]
        pictures = tuple(file.read_bytes() for file in files)
        rows.append(Row(**named, **row, pictures=pictures))
        for file in files:
            with contextlib.suppress(OSError):
                file.unlink()
    return rows
