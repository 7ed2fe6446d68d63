"""`surfabet compress` in tiles: for maps that are larger than the memory."""

from __future__ import annotations

import math
import re
import sys
import time
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Group, Parameter
from cyclopts.validators import Number

import surfabet
from surfabet._progress import ProgressCallback
from surfabet.cli._format import bytes_text, points_text, print_json
from surfabet.cli._learn_options import LearnOptions
from surfabet.cli._numbers import WHOLE
from surfabet.cli._options import READ_OPTIONS, PositiveFloat, ReadOptions, UsageError, spelled
from surfabet.learning import in_unit

TILES = Group("Tiles", sort_key=5)

_UNITS = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30, "t": 1 << 40}

DEFAULT_MEMORY = 2 << 30


@Parameter(name="*", group=TILES)
@dataclass(frozen=True)
class TileOptions:
    """Whether and how a map is learned in tiles."""

    tile: PositiveFloat = None
    """Learn the map in tiles of this side, metres, of which parts can be read alone."""

    details: Annotated[int | None, Parameter(validator=Number(gte=1, lte=3)), WHOLE] = None
    """Levels of detail of a map in tiles, of which the coarsest can be read alone; pixels of each
    but the last are four times as large as those of the next. By default 1."""

    max_memory: str | None = None
    """Learn in tiles with at most this memory: 2G, 500M. By default all points are in memory at
    once, and with --tile alone 2G."""

    workers: Annotated[int | None, Parameter(validator=Number(gte=1, lte=256)), WHOLE] = None
    """Processes that learn tiles, which share the memory; by default one, on all threads."""

    work: Path | None = None
    """Folder for points and tiles until the map is complete, by default beside it; a run that was
    stopped goes on from it."""

    @property
    def is_given(self) -> bool:
        """Whether tiles were asked for."""
        if self.tile is None and self.max_memory is None:
            for name in ("details", "workers", "work"):
                if getattr(self, name) is not None:
                    raise UsageError(f"{spelled(name)}: needs --tile or --max-memory")
            return False
        return True


TILE_OPTIONS = TileOptions()


def memory_of(text: str | None) -> int:
    """Bytes of a text like 2G."""
    if text is None:
        return DEFAULT_MEMORY
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmgt]?)i?b?", text.strip().lower())
    if match is None:
        raise UsageError(f"--max-memory {text}: give a number of bytes, such as 2G or 500M")
    return int(float(match[1]) * _UNITS[match[2]])


def refuse_read_options(read: ReadOptions, beside: str) -> None:
    """Refuses options of reading, which chunks do not have."""
    if read != READ_OPTIONS:
        names = ", ".join(spelled(name) for name in read.given()) or "--format, --unit, --viewpoint"
        raise UsageError(
            f"{names}: not together with {beside}; convert the input first with surfabet convert"
        )


def compress_tiles(
    source: Path,
    output: Path,
    tiles: TileOptions,
    model: str | None,
    learning: LearnOptions,
    read: ReadOptions,
    progress: ProgressCallback,
) -> tuple[surfabet.TilingReport, dict[str, float]]:
    """Learns a map in tiles; gives its report and the seconds."""
    if model not in (None, "patches"):
        raise UsageError(f"--model {model}: only patches are learned in tiles")
    refuse_read_options(read, "--tile or --max-memory")
    started = time.perf_counter()
    folder = Path(f"{output}.work") if tiles.work is None else tiles.work
    options = {
        "tile": tiles.tile,
        "details": tiles.details or 1,
        "max_memory": memory_of(tiles.max_memory),
        "work": tiles.work,
        "progress": progress,
        **learning.given(),
    }
    try:
        report = _learned(source, output, tiles.workers or 1, options)
    except KeyboardInterrupt:
        if folder.exists():
            print(
                f"surfabet: {folder} keeps what is done; the same command goes on from there",
                file=sys.stderr,
            )
        raise
    return report, {"learn": time.perf_counter() - started}


def _learned(source: Path, output: Path, n: int, options: dict[str, Any]) -> surfabet.TilingReport:
    """Learns a map in tiles, by `n` workers."""
    if n == 1:
        return surfabet.learn_patches_tiled(source, output, **options)
    # Imported here: a tenth of a second that most runs do without.
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(n, mp_context=context) as executor:
        return surfabet.learn_patches_tiled(source, output, executor=executor, workers=n, **options)


def print_result(
    source: Path,
    output: Path,
    report: surfabet.TilingReport,
    asked: float | None,
    seconds: dict[str, float],
    json: bool,
    quiet: bool,
) -> None:
    """Prints what came out, in tiles of which side where another was `asked` for, and names what
    was lost."""
    if report.not_kept:
        lost = ", ".join(report.not_kept)
        can_be_kept = set(report.not_kept) - {"normals", "ranges", "viewpoints"}
        remedy = "; --attributes names what to keep" if can_be_kept else ""
        warnings.warn(
            f"{output}: the map does not keep {lost}{remedy}",
            surfabet.LostAttributeWarning,
            stacklevel=1,
        )
    if json:
        print_json(
            {
                "input": {"path": str(source), "points": report.n_points},
                "output": {"path": str(output), "bytes": report.n_bytes},
                "seconds": seconds,
                "report": asdict(report),
            }
        )
    elif not quiet:
        for option, (value, why) in report.chosen.items():
            why = in_unit(why, report.unit)
            print(f"{source}: by the data: {option.replace('_', '-')} {value:.6g} ({why})")
        tiles = "tile" if report.n_tiles == 1 else "tiles"
        if asked is not None and not math.isclose(asked, report.tile, rel_tol=1e-4):
            print(
                f"{source}: tile {asked:g} rounded to {report.tile:g} {report.unit}: "
                "whole squares of the coarsest patches"
            )
        print(
            f"{output}: {points_text(report.n_points)}, {report.n_tiles} {tiles} of "
            f"{report.tile:g} {report.unit}, "
            f"{bytes_text(report.n_bytes)}, {seconds['learn']:.1f} s"
        )
