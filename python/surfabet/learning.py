"""What learning tells about itself, whatever the family."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from surfabet._core import Survey

__all__ = ["AttributeFigures", "LearningReport"]


_LENGTHS_IN = "lengths in"
"""What stands before the unit in a note on lengths that are no metres."""


def note_of(chosen: Mapping[str, tuple[float, str]], unit: str) -> str:
    """The options that follow from the data, and why, in one line, as files keep them."""
    parts = [
        f"{option.replace('_', '-')} {value:.6g} ({in_unit(why, unit)})"
        for option, (value, why) in chosen.items()
    ]
    note = ", ".join(parts)
    if unit == "m":
        return note
    return f"{note}; {_LENGTHS_IN} {unit}" if note else f"{_LENGTHS_IN} {unit}"


def in_unit(sentence: str, unit: str) -> str:
    """A sentence on a scan, which calls all lengths metres, with the unit that they have."""
    return re.sub(r"(?<=\d) m\b", f" {unit}", sentence)


def unit_in(note: str | None) -> str:
    """The unit of lengths that a note names; `m` where it names none."""
    found = re.search(rf"{_LENGTHS_IN} (\S+)$", note or "")
    return found[1] if found else "m"


@dataclass(frozen=True, slots=True)
class AttributeFigures:
    """What an attribute takes in a model, and how far it is off."""

    name: str
    """Its name in the cloud."""
    bytes: float
    """Bytes of its stream."""
    rmse: float | None
    """Of numbers: root mean square difference of the input points to what the model has where they
    are, in the attribute's unit; of colours over the three channels. None for labels, and where the
    method does not measure it."""
    equal: float | None
    """Of labels: share of the input points with the label that the model has where they are. None
    for all others."""


@dataclass(frozen=True, slots=True)
class LearningReport:
    """How a model came about. A model read from a file has an empty one."""

    stages: dict[str, float]
    """Seconds of each stage, in order."""
    figures: dict[str, float]
    """Counts by name: points, samples, patches, set pixels, dictionary entries."""
    levels: list[dict[str, float]]
    """Counts and measures of each level, coarsest first: pixel size (m), patches, area (m2), and
    what the method adds to these."""
    objectives: dict[str, list[float]]
    """What was minimised, by name, before and after every iteration."""
    iterations: int
    """Iterations, over all objectives."""
    stop_reason: str
    """Why learning ended."""
    attributes: tuple[AttributeFigures, ...]
    """What each attribute that the model keeps takes, and how far it is off."""
    not_kept: tuple[str, ...]
    """Attributes of the cloud that the model does not hold."""
    chosen: dict[str, tuple[float, str]]
    """Options that were not given: the value that follows from the data, and why."""
    left_out: int
    """Points that were left out as outliers."""
    survey: Survey
    """The figures of the cloud, which the options that were not given follow from."""
    tolerance: float
    """How far from a point its surface may be decoded and still show it, metres: two spacings,
    three standard deviations of the noise, or two thirds of a pixel that was asked for, whichever
    is most. 0 for models that do not hold all of a surface."""

    def as_dict(self) -> dict[str, Any]:
        """The report as plain dicts, lists and numbers."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        attributes = [dataclasses.asdict(of) for of in self.attributes]
        survey = {
            "spacing": self.survey.spacing,
            "noise": self.survey.noise,
            "layer_gap": self.survey.layer_gap,
            "line_spacing": self.survey.line_spacing,
            "has_facings": self.survey.has_facings,
            "tolerance": self.survey.tolerance,
            "bounds": self.survey.bounds,
            "outliers": len(self.survey.outliers),
            "strays": len(self.survey.strays),
        }
        return fields | {"attributes": attributes, "survey": survey}
