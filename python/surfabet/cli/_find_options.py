"""Options of the verb `find`; written by scripts/generate_options.py."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from cyclopts import Group, Parameter

from surfabet.cli._numbers import WHOLE

__all__ = ["FIND_OPTIONS", "FindOptions"]

SEARCH = Group("Options of the search", sort_key=1)


@Parameter(name="*")
@dataclass(frozen=True)
class FindOptions:
    """Options of the search; None leaves them to it."""

    min_score: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Least score of what is found. A number from 0 to 1; by default 0.5; for examples of another
    model 0.525 by shape alone, 0.48 with colours."""

    max_found: Annotated[int | None, Parameter(group=SEARCH), WHOLE] = None
    """Most places that are found. 0 or a positive integer; by default 1000."""

    resolution: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Spacing of the samples that are compared. A positive number of metres; by default a 64th of
    the diagonal of the example's region."""

    tolerance: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Standard deviation of equal surfaces. A positive number of metres; by default the median
    sigma of the example's occurrences."""

    color_tolerance: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Standard deviation of equal chromas; luma, which changes with the light, may differ three
    times as much. A positive number of grey levels; by default 10."""

    size_tolerance: Annotated[float | None, Parameter(group=SEARCH)] = None
    """Largest change of a size, what is level and what is upright each by its own factor: other
    things of a kind are larger or smaller than the example. A number from 0 to 0.3 as a share; by
    default 0.1 for an example of another model; 0 within one scene, where copies are looked for."""

    def given(self) -> dict[str, Any]:
        """The options that were given."""
        return {name: value for name, value in vars(self).items() if value is not None}


FIND_OPTIONS = FindOptions()
