"""One job in a process of its own: `python -m surfabet.comparison.worker FOLDER`.

A process of its own has its own memory, which is measured, and a tool that fails or is killed takes
nothing with it. The folder holds `cloud.npz` and `job.json`, and gets `result.json` and pictures.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import surfabet
from surfabet.comparison.coded import Coded, measured
from surfabet.comparison.jobs import CODERS

__all__ = ["main"]

_CLEAR = Path("/proc/self/clear_refs")
_STATUS = Path("/proc/self/status")


def _forget_peak() -> None:
    """Starts the count of the most memory anew, where the system can."""
    try:
        _CLEAR.write_text("5")
    except OSError:
        return


def _memory(name: str) -> int | None:
    """A figure of this process in bytes: VmRSS for now, VmHWM for the most; None if not known."""
    try:
        lines = _STATUS.read_text().splitlines()
    except OSError:
        return None
    for line in lines:
        if line.startswith(f"{name}:"):
            return int(line.split()[1]) * 1024
    return None


def _peak_of_programs() -> int:
    """Most memory of a program that was run, bytes."""
    try:
        import resource
    except ImportError:
        return 0
    found = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    # macOS counts bytes, other systems kibibytes.
    return found if sys.platform == "darwin" else found * 1024


def _run(folder: Path, job: dict[str, Any]) -> list[dict[str, Any]]:
    surfabet.set_num_threads(job["threads"])
    cloud = surfabet.read(folder / "cloud.npz")
    before = _memory("VmRSS")
    _forget_peak()
    coded = CODERS[job["coder"]](cloud, **job["arguments"])
    peak = _memory("VmHWM")
    memory = None
    if before is not None and peak is not None:
        memory = max(peak - before, _peak_of_programs())
    rows = []
    for number, of in enumerate([coded] if isinstance(coded, Coded) else coded):
        row = measured(cloud, of, job["sigma"]) | {"memory": memory, "pictures": []}
        if job["scale"] is not None:
            row["pictures"] = _pictures(folder, number, cloud, of, job["scale"])
        rows.append(row)
    return rows


def _pictures(
    folder: Path, number: int, cloud: surfabet.PointCloud, coded: Coded, scale: float
) -> list[str]:
    """Draws what was decoded, and errors both ways; names of the files in the folder."""
    from surfabet.report import draw_errors

    names = [f"{what}{number}.webp" for what in ("decoded", "forward", "backward")]
    draw_errors(cloud, coded.decoded, scale, *(folder / name for name in names), width=480)
    return names


def main(folder: Path) -> int:
    """Runs the job of a folder."""
    job = json.loads((folder / "job.json").read_text("utf-8"))
    result: dict[str, Any] = {}
    try:
        result["rows"] = _run(folder, job)
    except Exception as error:
        result["error"] = str(error) or type(error).__name__
    (folder / "result.json").write_text(json.dumps(result), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
