"""Numbers for people, and the JSON for programs."""

from __future__ import annotations

import json
import math
import os
import sys
from typing import Any

from rich.console import Console

from surfabet.io._units import small_lengths

RAW_BYTES_PER_POINT = 12
RAW_BYTES_PER_COLOR = 3


def raw_bytes(n_points: int, has_colors: bool) -> int:
    """Size of the points as plain f32 coordinates, with one byte per channel for colours."""
    return n_points * (RAW_BYTES_PER_POINT + RAW_BYTES_PER_COLOR * has_colors)


def bytes_text(n: int) -> str:
    """As `1.25 MB`, decimal multiples."""
    for limit, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if n >= limit:
            return f"{n / limit:.3g} {unit}" if n < 999.5 * limit else f"{n / limit:.0f} {unit}"
    return f"{n} bytes"


def points_text(n: int) -> str:
    """As `1,234 points`, and `1 point`."""
    return f"{n:,} point" if n == 1 else f"{n:,} points"


def length_text(length: float, unit: str = "m", digits: int = 3) -> str:
    """As `8.31 mm`, metres from one metre on; other units as `0.0273 us-ft`."""
    factor, small = small_lengths(unit)
    if abs(length) >= 1:
        return f"{length:.{digits}g} {unit}"
    return f"{factor * length:.{digits}g} {small}"


def unequal_texts(length: float, limit: float, unit: str = "m") -> tuple[str, str]:
    """As `length_text`, with as many digits as it takes to tell two lengths apart."""
    for digits in range(3, 18):
        texts = length_text(length, unit, digits), length_text(limit, unit, digits)
        if length == limit or texts[0] != texts[1]:
            break
    return texts


def peak_memory() -> int | None:
    """Most memory that this process has held, bytes; None where the system does not give it."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # macOS counts bytes, other systems kibibytes.
    return peak if sys.platform == "darwin" else peak * 1024


class Output(Console):
    """Tables on stdout. That their reader has left, as `head` does, is no failure of the verb."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        no_more_output()


def no_more_output() -> None:
    """Sends what is still to be written to stdout nowhere, also by the interpreter at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def print_json(value: dict[str, Any]) -> None:
    """One JSON object on stdout; not-a-number and infinities become null, which JSON can hold."""
    json.dump(_plain(value), sys.stdout, indent=2)
    print()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
