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
        self._dropped: list[str] = []
        # By reason, of how many points how many; by remark, of how many points it is made.
        self._left_out: dict[str, tuple[int, int]] = {}
        self._remarks: dict[str, int] = {}
        self._aside: dict[str, None] = {}

    def points(self, text: str) -> None:
        """Points that were left out, with their number and the reason."""
        self._dropped.append(text)

    def left_out(self, reason: str, count: int, total: int) -> None:
        """`count` of `total` points were left out for a reason; those of several scans add up."""
        before, of = self._left_out.get(reason, (0, 0))
        self._left_out[reason] = before + count, of + total

    def remark(self, text: str, count: int = 0) -> None:
        """What was read in another way than its name says, or has a unit of its own.

        A `count`, which adds up over the scans of a file, comes after the text.
        """
        self._remarks[text] = self._remarks.get(text, 0) + count

    def aside(self, name: str) -> None:
        """What the file holds and the cloud does not, with a count where it has one."""
        self._aside[name] = None

    def warn(self) -> None:
        """One warning for all of it, of the class that says what it is about; none for nothing."""
        dropped = [
            f"left out {count:,} of {total:,} points {reason}"
            for reason, (count, total) in self._left_out.items()
            if count
        ]
        dropped += self._dropped
        parts = dropped + [f"{text}: {n:,}" if n else text for text, n in self._remarks.items()]
        if self._aside:
            names = list(self._aside)[:_MOST_NAMES]
            if more := len(self._aside) - len(names):
                names.append(f"{more} more")
            parts.append("left aside: " + ", ".join(names))
        if not parts:
            return
        if not dropped:
            category: type[Warning] = LostAttributeWarning
        elif len(parts) == len(dropped):
            category = DroppedPointsWarning
        else:
            category = IncompleteReadWarning
        warn(f"{self.path}: {'; '.join(parts)}", category)
