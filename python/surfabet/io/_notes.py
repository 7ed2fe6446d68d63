"""What a reader left out of a file and what it made of doubtful values, said in one warning."""

from __future__ import annotations

from pathlib import Path

from surfabet.errors import DroppedPointsWarning, IncompleteReadWarning, LostAttributeWarning
from surfabet.io._files import warn

_MOST_NAMES = 12


class Notes:
    """Gathers what there is to say about a file; `warn` says it once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._points: list[str] = []
        self._remarks: list[str] = []
        self._aside: list[str] = []

    def points(self, text: str) -> None:
        """Points that were left out, with their number and the reason."""
        self._points.append(text)

    def remark(self, text: str) -> None:
        """What was read in another way than its name says, or has a unit of its own."""
        self._remarks.append(text)

    def aside(self, name: str) -> None:
        """What the file holds and the cloud does not, with a count where it has one."""
        self._aside.append(name)

    def warn(self) -> None:
        """One warning for all of it, of the class that says what it is about; none for nothing."""
        parts = [*self._points, *self._remarks]
        if self._aside:
            names = self._aside[:_MOST_NAMES]
            if more := len(self._aside) - len(names):
                names.append(f"{more} more")
            parts.append("left aside: " + ", ".join(names))
        if not parts:
            return
        if not self._points:
            category: type[Warning] = LostAttributeWarning
        elif len(parts) == len(self._points):
            category = DroppedPointsWarning
        else:
            category = IncompleteReadWarning
        warn(f"{self.path}: {'; '.join(parts)}", category)
