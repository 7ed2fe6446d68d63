"""Options that several verbs share."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Group, Parameter
from cyclopts.validators import Number

from surfabet._progress import ProgressCallback, progress_callback
from surfabet.cli._numbers import WHOLE
from surfabet.io.rgbd import DEFAULT_DEPTH_LIMITS

GENERAL = Group("General", sort_key=9)
READING = Group("Reading clouds", sort_key=6)
RGBD = Group("RGB-D folders", sort_key=7)
BAGS = Group("ROS bags", sort_key=8)

_DELIMITERS = {"tab": "\t", "\\t": "\t", "space": " ", "comma": ",", "semicolon": ";"}

Flag = Annotated[bool, Parameter(negative=(), show_default=False)]
POSITIVE, NOT_NEGATIVE = Number(gt=0, lt=math.inf), Number(gte=0, lt=math.inf)
PositiveFloat = Annotated[float | None, Parameter(validator=POSITIVE)]
Box = tuple[float, float, float, float, float, float]
Classes = Annotated[
    list[int] | None, Parameter(negative=(), validator=Number(gte=0, lte=255)), WHOLE
]


class UsageError(Exception):
    """The options were understood, but do not fit together."""


@Parameter(name="*", group=GENERAL)
@dataclass(frozen=True)
class Common:
    """What every verb accepts."""

    quiet: Annotated[Flag, Parameter(name=("--quiet", "-q"))] = False
    """No progress and no result, only warnings and errors."""

    threads: Annotated[int | None, Parameter(validator=Number(gte=1, lte=1024)), WHOLE] = None
    """Threads to use, by default one per core; the result does not depend on it."""

    debug: Flag = False
    """Show the whole traceback of an error."""

    @contextmanager
    def progress(self) -> Iterator[ProgressCallback]:
        """A progress bar, or nothing when quiet or when nobody looks at stderr."""
        with progress_callback(not self.quiet and sys.stderr.isatty()) as callback:
            yield callback or (lambda _stage, _fraction: None)


COMMON = Common()


@Parameter(name="*", group=READING)
@dataclass(frozen=True)
class ReadOptions:
    """How a file or folder becomes a cloud."""

    format: str | None = None
    """Format of the input, where name and first bytes do not show it: ply, pcd, las, xyz, ..."""

    columns: str | None = None
    """Names of a text file's columns, as `x,y,z,_,intensity,red,green,blue`; `_` leaves one
    aside."""

    delimiter: str | None = None
    """What separates a text file's columns: one character, or tab, space, comma or semicolon."""

    unit: str | None = None
    """Unit of the input's lengths, where it does not say: mm, cm, m, km, ft, us-ft or in."""

    viewpoint: Annotated[tuple[float, float, float] | None, Parameter(negative=())] = None
    """Where the scanner stood, `X Y Z` in metres, for files that do not say."""

    keep_class: Classes = None
    """Keep only points of this class (LAS); can be given several times."""

    drop_class: Classes = None
    """Leave out points of this class (LAS); can be given several times."""

    keep_noise: Flag = False
    """Keep points that are marked as noise or withheld (LAS)."""

    box: Annotated[Box | None, Parameter(negative=())] = None
    """Read only what is in a box, `X0 Y0 Z0 X1 Y1 Z1` in the file's coordinates (COPC)."""

    level: Annotated[int | None, Parameter(validator=Number(gte=0)), WHOLE] = None
    """Read only the levels 0 (the coarsest) to this one (COPC)."""

    frame_stride: Annotated[int | None, Parameter(group=RGBD, validator=Number(gte=1)), WHOLE] = (
        None
    )
    """Read every n-th frame only."""

    pixel_stride: Annotated[int | None, Parameter(group=RGBD, validator=Number(gte=1)), WHOLE] = (
        None
    )
    """Read every n-th row and column of a frame only."""

    depth_min: Annotated[float | None, Parameter(group=RGBD, validator=NOT_NEGATIVE)] = None
    """Leave out what is nearer than this, in metres; by default 0.3."""

    depth_max: Annotated[float | None, Parameter(group=RGBD, validator=Number(gt=0))] = None
    """Leave out what is farther than this, in metres; by default 4."""

    depth_scale: Annotated[float | None, Parameter(group=RGBD, validator=POSITIVE)] = None
    """Steps of the depth images per metre, by default what the folder's layout has."""

    intrinsics: Annotated[
        tuple[float, float, float, float] | None, Parameter(group=RGBD, negative=())
    ] = None
    """Focal lengths and centre in pixels, `FX FY CX CY`, by default what the folder says."""

    max_time_difference: Annotated[float | None, Parameter(group=RGBD, validator=Number(gt=0))] = (
        None
    )
    """Seconds between a depth image and its colour image or pose (TUM); by default 0.02."""

    topic: Annotated[str | None, Parameter(group=BAGS)] = None
    """The topic with the clouds, where several have some."""

    message: Annotated[int | None, Parameter(group=BAGS, validator=Number(gte=0)), WHOLE] = None
    """Read a single message by its number, from 0, in the sensor's own frame."""

    poses: Annotated[str | None, Parameter(group=BAGS)] = None
    """How messages are placed: tf, a topic of odometry or poses, or none."""

    frame: Annotated[str | None, Parameter(group=BAGS)] = None
    """The frame to fuse in, by default the topmost."""

    def given(self) -> dict[str, Any]:
        """The options of readers that were given, as `surfabet.read` names them."""
        options = {
            field.name: value
            for field in fields(self)
            if field.name not in ("format", "unit", "viewpoint", "depth_min", "depth_max")
            and (value := getattr(self, field.name)) not in (None, False)
        }
        if self.columns is not None:
            options["columns"] = self.columns.split(",")
        if self.box is not None:
            options["box"] = (self.box[:3], self.box[3:])
        if self.delimiter is not None:
            options["delimiter"] = _DELIMITERS.get(self.delimiter, self.delimiter)
        if self.depth_min is not None or self.depth_max is not None:
            low, high = DEFAULT_DEPTH_LIMITS
            options["depth_limits"] = (
                low if self.depth_min is None else self.depth_min,
                high if self.depth_max is None else self.depth_max,
            )
        return options

    def spelled(self, argument: str) -> str:
        """An argument of `surfabet.read` as it was given here."""
        if argument != "depth_limits":
            return spelled(argument)
        limits = {"depth_min": self.depth_min, "depth_max": self.depth_max}
        return ", ".join(spelled(name) for name, value in limits.items() if value is not None)


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


_ARGUMENT = re.compile(
    r"\b(columns|delimiter|depth_scale|format|frame|frame_stride|intrinsics|keep_class|drop_class|"
    r"keep_noise|max_time_difference|message|pixel_stride|poses|topic|unit|up|viewpoint)="
    r"(?:'([^']*)')?(?=(\S?))"
)


def in_own_words(message: str) -> str:
    """A message of the library with the options of the command line in place of its arguments."""

    def option(match: re.Match[str]) -> str:
        name, value, follows = match.groups()
        if value is not None:
            return f"{spelled(name)} {value}"
        return spelled(name) + (" " if follows and follows not in ",;:)." else "")

    message = re.sub(
        r"depth_limits=\(([^,]+), ([^)]+)\)", r"--depth-min \1 and --depth-max \2", message
    )
    message = message.replace("intrinsics=(fx, fy, cx, cy)", "--intrinsics FX FY CX CY")
    message = re.sub(r"\bdepth_limits\b", "--depth-min and --depth-max", message)
    return _ARGUMENT.sub(option, message)
