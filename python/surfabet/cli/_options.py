"""Options that several verbs share."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Group, Parameter
from cyclopts.validators import Number

from surfabet._progress import ProgressCallback, progress_callback

GENERAL = Group("General", sort_key=9)
RGBD = Group("RGB-D folders", sort_key=8)


Flag = Annotated[bool, Parameter(negative=(), show_default=False)]
PositiveFloat = Annotated[float | None, Parameter(validator=Number(gt=0))]


class UsageError(Exception):
    """The options were understood, but do not fit together."""


@Parameter(name="*", group=GENERAL)
@dataclass(frozen=True)
class Common:
    """What every verb accepts."""

    quiet: Annotated[Flag, Parameter(name=("--quiet", "-q"))] = False
    """No progress and no result, only warnings and errors."""

    threads: Annotated[int | None, Parameter(validator=Number(gte=1, lte=1024))] = None
    """Threads to use, by default one per core; the result does not depend on it."""

    debug: Flag = False
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

    frame_stride: Annotated[int, Parameter(validator=Number(gte=1))] = 1
    """Read every n-th frame only."""

    pixel_stride: Annotated[int, Parameter(validator=Number(gte=1))] = 1
    """Read every n-th row and column of a frame only."""

    depth_min: Annotated[float, Parameter(validator=Number(gte=0))] = 0.3
    """Leave out what is nearer than this, in metres."""

    depth_max: Annotated[float, Parameter(validator=Number(gt=0))] = 4.0
    """Leave out what is farther than this, in metres."""

    depth_scale: PositiveFloat = None
    """Steps of the depth images per metre, by default what the folder's layout has."""

    intrinsics: Annotated[tuple[float, float, float, float] | None, Parameter(negative=())] = None
    """Focal lengths and centre in pixels, `FX FY CX CY`, by default what the folder says."""

    viewpoint: Annotated[
        tuple[float, float, float] | None, Parameter(negative=(), group=GENERAL)
    ] = None
    """Where the scanner stood, `X Y Z` in metres, for files that do not say."""

    def for_folder(self) -> dict[str, Any]:
        """As `surfabet.read` names them."""
        return {
            "frame_stride": self.frame_stride,
            "pixel_stride": self.pixel_stride,
            "depth_limits": (self.depth_min, self.depth_max),
            "depth_scale": self.depth_scale,
            "intrinsics": self.intrinsics,
        }

    def changed(self) -> list[str]:
        """The options of folders that are not as by default."""
        return [
            spelled(field.name)
            for field in fields(self)
            if field.name != "viewpoint" and getattr(self, field.name) != field.default
        ]


READ_OPTIONS = ReadOptions()


@Parameter(name="*", group=GENERAL)
@dataclass(frozen=True)
class VocabularyOption:
    """Where the words are that model files may name instead of holding them."""

    vocabulary: Path | None = None
    """A model file, of --model hscsm, alphabet or bic-alphabet, whose dictionary or alphabet other
    files name instead of holding it."""


VOCABULARY_OPTION = VocabularyOption()


def spelled(argument: str) -> str:
    """An argument of the library as the command line has it."""
    return "--" + argument.replace("_", "-")
