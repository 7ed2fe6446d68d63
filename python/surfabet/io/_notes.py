"""What a reader left out of a file and what it made of doubtful values, gathered in one warning."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from surfabet.errors import DroppedPointsWarning, IncompleteReadWarning, LostAttributeWarning
from surfabet.io._files import warn

_MOST_NAMES = 12
_NUMBER = re.compile(r"(\d[\d,]*)")


@dataclass
class Dropped:
    """How many points readers left out."""

    n: int = 0


_COUNTING: ContextVar[Dropped | None] = ContextVar("counting", default=None)


@contextmanager
def counted() -> Iterator[Dropped]:
    """Counts the points that readers leave out within the block."""
    token = _COUNTING.set(Dropped())
    found = _COUNTING.get()
    assert found is not None
    try:
        yield found
    finally:
        _COUNTING.reset(token)


def _sum(a: str, b: str) -> str:
    return f"{int(a.replace(',', '')) + int(b.replace(',', '')):,}"


class Notes:
    """Gathers what there is to say about a file; `warn` says it once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.n_dropped = 0
        self._dropped: list[str] = []
        self._not_finite = 0, 0
        # By reason, of how many points how many; by remark, of how many points it is made.
        self._left_out: dict[str, tuple[int, int]] = {}
        self._remarks: dict[str, int] = {}
        self._aside: dict[str, None] = {}

    def points(self, text: str, count: int = 0) -> None:
        """Points that were left out, with the reason and, where it is known, their number."""
        self._dropped.append(text)
        self.n_dropped += count

    def left_out(self, reason: str, count: int, total: int) -> None:
        """`count` of `total` points were left out for a reason; those of several scans add up."""
        self.n_dropped += count
        before, of = self._left_out.get(reason, (0, 0))
        self._left_out[reason] = before + count, of + total

    def not_finite(self, count: int, total: int, dropped: str | None) -> None:
        """`count` of `total` points were dropped since their coordinates are not finite; `dropped`
        has that and what became of attributes."""
        self.n_dropped += count
        before, of = self._not_finite
        self._not_finite = before + count, of + total
        if dropped is not None and (rest := dropped.split("; ")[1 if count else 0 :]):
            self.points("; ".join(rest))

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
        if (counting := _COUNTING.get()) is not None:
            counting.n += self.n_dropped
        dropped = [
            f"left out {count:,} of {total:,} points {reason}"
            for reason, (count, total) in self._left_out.items()
            if count
        ]
        count, total = self._not_finite
        if count:
            dropped.append(f"dropped {count} of {total} points with NaN or infinite coordinates")
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


class HeldNotes(Notes):
    """Gathers over all parts of a file, each of which would warn of its own."""

    def points(self, text: str, count: int = 0) -> None:
        """As `Notes.points`; the numbers in texts that are else the same add up."""
        self.n_dropped += count
        words = _NUMBER.split(text)
        for i, known in enumerate(self._dropped):
            before = _NUMBER.split(known)
            if before[::2] == words[::2]:
                # Every second part is a number.
                words[1::2] = map(_sum, before[1::2], words[1::2])
                self._dropped[i] = "".join(words)
                return
        self._dropped.append(text)

    def warn(self) -> None:
        """Nothing to warn of yet."""

    def release(self) -> None:
        """The warning for all parts."""
        super().warn()
