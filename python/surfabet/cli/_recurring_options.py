"""Options of the verb `recurring`; written by scripts/generate_options.py."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from cyclopts import Group, Parameter

from surfabet.cli._numbers import WHOLE

__all__ = ["RECURRING_OPTIONS", "RecurringOptions"]

SEARCH = Group("Options of the search", sort_key=1)


@Parameter(name="*")
@dataclass(frozen=True)
class RecurringOptions:
    """Options of the search; None leaves them to it."""

    min_count: Annotated[int | None, Parameter(group=SEARCH), WHOLE] = None
    """How often a thing must occur. An integer from 2 to 1e6; by default 3."""

    min_size: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Smallest diagonal of a thing. A positive number of metres; by default 0.2."""

    max_size: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Largest diagonal of a thing; smooth surfaces that are larger, such as walls and floors, are
    no part of any. A positive number of metres; by default 2.2."""

    min_score: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Least score of an occurrence against the thing that stands for its class, as of `find`; 0.85
    of it where the thing grew from a piece. A number from 0 to 1; by default 0.5."""

    resolution: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Spacing of the samples that are compared. A positive number of metres; by default the median
    sigma of all occurrences, at least 0.015 m, and no closer than 4 million samples allow."""

    tolerance: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Standard deviation of equal surfaces. A positive number of metres; by default the median
    sigma of all occurrences."""

    color_tolerance: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Standard deviation of equal chromas. A positive number of grey levels; by default shape alone
    counts."""

    size_tolerance: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Largest change of a size, what is level and what is upright each by its own factor. A number
    from 0 to 0.3 as a share; by default 0."""

    def given(self) -> dict[str, Any]:
        """The options that were given."""
        return {name: value for name, value in vars(self).items() if value is not None}


RECURRING_OPTIONS = RecurringOptions()
