"""What `progress=` accepts everywhere, made into one kind of callable."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from surfabet.errors import wrong_type

__all__ = ["Progress", "ProgressCallback", "progress_callback"]

ProgressCallback = Callable[[str, float], object]
"""Called as `callback(stage, fraction)`: the work is in its stage `stage`, and `fraction` of all of
it is done, 0 to 1."""

Progress = bool | ProgressCallback | None
"""None or False: silent; True: a bar on stderr; a callable: called with every step."""


@contextmanager
def progress_callback(progress: Progress) -> Iterator[ProgressCallback | None]:
    """The callable that `progress` stands for, for the time of a `with` block.

    With True it is a bar on stderr, drawn by rich where that is installed and as a plain line where
    not; the bar is taken away at the end of the block, whichever way it is left.

    Examples
    --------
    >>> with progress_callback(print) as callback:
    ...     callback("read", 0.5)
    read 0.5
    """
    if progress is None or progress is False:
        yield None
    elif progress is not True:
        if not callable(progress):
            raise wrong_type("progress", progress, "None, True or a callable")
        yield progress
    else:
        try:
            import rich.progress  # noqa: F401
        except ImportError:
            with _plain_line() as callback:
                yield callback
        else:
            with _rich_bar() as callback:
                yield callback


@contextmanager
def _rich_bar() -> Iterator[ProgressCallback]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    bar = Progress(
        TextColumn("{task.description:24}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task("", total=None)

    def show(stage: str, fraction: float) -> None:
        # Without a total the bar pulses: the work has begun, and how far it is is not known yet.
        bar.update(task, description=stage, completed=fraction, total=1.0 if fraction > 0 else None)

    with bar:
        yield show


@contextmanager
def _plain_line() -> Iterator[ProgressCallback]:
    is_terminal = sys.stderr.isatty()
    stage_shown = ""
    shown_at = 0.0

    def show(stage: str, fraction: float) -> None:
        nonlocal stage_shown, shown_at
        if not is_terminal:
            if stage != stage_shown:
                print(stage, file=sys.stderr, flush=True)
        elif stage != stage_shown or fraction >= 1 or time.monotonic() - shown_at > 0.1:
            print(f"\r\x1b[K{stage} {fraction:4.0%}", end="", file=sys.stderr, flush=True)
            shown_at = time.monotonic()
        stage_shown = stage

    try:
        yield show
    finally:
        if is_terminal and stage_shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
