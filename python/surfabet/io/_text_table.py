"""Tables of numbers in text files: where they begin, how they are separated, what they are called.

Before the rows there may be comments, prose, a line of names (also as a comment) and a line with
the number of rows, which PTS files and CloudCompare write.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from surfabet.io._files import Lines, format_error
from surfabet.io._names import SPACED_NAME, ColumnName, column_names
from surfabet.io._notes import Notes
from surfabet.io._tables import check_count, parse_rows, plain_numbers

_COMMENTS = ("#", "//", "%")
# `1.#QNAN` is a number, or rather none.
_TRAILING_COMMENT = re.compile(r"(?<![.,])#.*")
_QUOTED = re.compile(r'"([^"]*)"')
_DECIMAL_COMMA = re.compile(r"[-+]?\d+(?:,\d+)?(?:[eE][-+]?\d+)?")


def is_number(word: str) -> bool:
    """Whether a word is a number that stands alone."""
    try:
        float(word)
    except ValueError:
        return False
    # Python's own literals have it, files do not.
    return "_" not in word


def _has_decimal_commas(words: Sequence[str]) -> bool:
    return any("," in w for w in words) and all(map(_DECIMAL_COMMA.fullmatch, words))


class Layout:
    """How a line falls into words."""

    def __init__(self, text: str, delimiter: str | None) -> None:
        """`delimiter` is the user's; without it the line tells."""
        self.delimiter = delimiter or self._delimiter_of(text)
        self.decimal_comma = False
        if "," in text and self.delimiter != ",":
            self.decimal_comma = "." not in text

    @staticmethod
    def _delimiter_of(text: str) -> str | None:
        if ";" in text:
            return ";"
        if "," in text:
            words = text.split()
            return None if len(words) > 2 and _has_decimal_commas(words) else ","
        if "\t" in text and any(" " in word.strip() for word in text.split("\t")):
            # Names of several words, or empty cells.
            return "\t" if not is_number(text.split()[0]) else None
        return None

    def clean(self, text: str) -> str:
        """The line without quotes, decimal commas and a comment at its end."""
        if '"' in text:
            separator = self.delimiter or " "
            text = _QUOTED.sub(lambda quoted: quoted[1].replace(separator, " "), text)
        if "#" in text:
            text = _TRAILING_COMMENT.sub("", text)
        return text.replace(",", ".") if self.decimal_comma else text

    def words(self, text: str) -> list[str]:
        """The values of a line of numbers."""
        return [word.strip() for word in plain_numbers(self.clean(text)).split(self.delimiter)]

    def names(self, text: str) -> list[ColumnName] | None:
        """The columns that a line names, if it names a position."""
        if self.delimiter is None:
            return column_names(SPACED_NAME.findall(text))
        # Lines may end in a delimiter.
        text = text.strip().removesuffix(self.delimiter)
        return column_names([word.strip() for word in text.split(self.delimiter)])


class TextTable:
    """An open text file at its first row of numbers; what precedes it has been looked at."""

    def __init__(
        self, path: Path, file: BinaryIO, delimiter: str | None, *, named: bool = False
    ) -> None:
        """`named` columns need no header."""
        self.lines = Lines(path, file)
        self.names: list[ColumnName] | None = None
        self.count: int | None = None
        self.first: str | None = None
        self.layout = Layout("", delimiter)
        prose: tuple[int, str] | None = None
        for text in self._texts():
            if text.startswith(_COMMENTS):
                words = text.lstrip("#/%").strip()
                self.names = Layout(words, delimiter).names(words) or self.names
                continue
            self.layout = Layout(text, delimiter)
            words_ = self.layout.words(text)
            if self._is_count(words_):
                continue
            if 2 * sum(map(is_number, words_)) <= len(words_):
                names = self.layout.names(text)
                self.names = names or self.names
                prose = prose or (None if names else (self.lines.number, text))
                continue
            self.first = text
            break
        if prose and self.names is None and not named:
            raise format_error(
                path,
                f"neither numbers nor column names with x, y and z: {prose[1]!r:.60}; name the "
                "columns with columns=",
                line=prose[0],
            )

    def _is_count(self, words: Sequence[str]) -> bool:
        """Takes a line with the number of rows."""
        if len(words) != 1 or not words[0].isdecimal():
            return False
        if self.count is not None:
            raise format_error(
                self.lines.path,
                "two lines with a single number each, as PTX files begin; read it with "
                "format='ptx'",
                line=self.lines.number,
            )
        self.count = int(words[0][:18])
        return True

    def _texts(self) -> Iterator[str]:
        while (line := self.lines.next()) is not None:
            if line and not line.isspace():
                yield line.decode("latin-1").strip()

    def _rows(self) -> Iterator[str]:
        clean, has_commas = self.layout.clean, self.layout.decimal_comma
        if self.first is not None:
            yield clean(self.first)
        # One loop over all lines, which takes most of the time.
        while (line := self.lines.next()) is not None:
            text = line.decode("latin-1").strip()
            if not text or text.startswith(_COMMENTS):
                continue
            if self.count is not None and text.isdecimal():
                # The next scan of a PTS file.
                self.count += int(text[:18])
                continue
            yield clean(text) if has_commas or '"' in text or "#" in text else text

    def rows(self) -> Iterator[list[str]]:
        """The words of each row."""
        for row in self._rows():
            yield [word.strip() for word in plain_numbers(row).split(self.layout.delimiter)]

    def numbers(self, places: Sequence[int], n_words: int, notes: Notes) -> NDArray[np.float64]:
        """The columns at these places of rows of `n_words` values."""
        everything = len(places) == n_words
        table = parse_rows(
            self.lines,
            self._rows(),
            len(places),
            self.layout.delimiter,
            None if everything else places,
        )
        if self.count is not None:
            check_count(self.lines, len(table), self.count)
            if len(table) > self.count:
                notes.remark(f"the file has {len(table)} rows, but says {self.count}; all are read")
        return table
