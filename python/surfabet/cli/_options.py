"""Options that several verbs share."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Group, Parameter
from cyclopts.validators import Number

from surfabet._progress import ProgressCallback, progress_callback

GENERAL = Group("General", sort_key=2)
RGBD = Group("RGB-D folders", sort_key=1)


class UsageError(Exception):
    """The options were understood, but do not fit together."""


@Parameter(name="*", group=GENERAL)
@dataclass(frozen=True)
class Common:
    """What every verb accepts."""

    quiet: Annotated[bool, Parameter(name=("--quiet", "-q"), negative=())] = False
    """No progress and no result, only warnings and errors."""

    threads: Annotated[int | None, Parameter(validator=Number(gte=1, lte=1024))] = None
    """Threads to use, by default one per core; the result does not depend on it."""

    debug: Annotated[bool, Parameter(negative=())] = False
    """Show the whole traceback of an error."""

    @contextmanager
    def progress(self) -> Iterator[ProgressCallback]:
        """A progress bar, or nothing when quiet or when nobody looks at stderr."""
        with progress_callback(not self.quiet and sys.stderr.isatty()) as callback:
            yield callback or (lambda _stage, _fraction: None)


COMMON = Common()


@Parameter(name="*", group=RGBD)
@dataclass(frozen=True)
class ReadOptions:
    """How a folder of RGB-D frames becomes a cloud."""

    frame_stride: Annotated[int | None, Parameter(validator=Number(gte=1))] = None
    """Read every n-th frame only."""

    pixel_stride: Annotated[int | None, Parameter(validator=Number(gte=1))] = None
    """Read every n-th row and column of a frame only."""

    depth_min: Annotated[float | None, Parameter(validator=Number(gte=0))] = None
    """Leave out pixels nearer than this, in metres."""

    depth_max: Annotated[float | None, Parameter(validator=Number(gt=0))] = None
    """Leave out pixels farther than this, in metres."""

    def given(self) -> dict[str, int | float]:
        """The options that were given."""
        return {name: value for name, value in vars(self).items() if value is not None}


READ_OPTIONS = ReadOptions()
