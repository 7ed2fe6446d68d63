"""Tables of numbers as text: the bodies of ASCII PLY and PCD files, and plain text files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from surfabet.io._columns import Column
from surfabet.io._files import Lines, format_error

_ROWS_AT_A_TIME = 65_536
# What other languages print for numbers, and numpy's parser does not know.
_FOREIGN = re.compile(
    r"(?P<nan>[-+]?(?:nan\([^)\s]*\)|1\.#(?:q?nan|snan|ind)[0-9]*))"
    r"|(?P<inf>[-+]?1\.#inf[0-9]*)"
    r"|(?P<hex>[-+]?0x[0-9a-f]*\.?[0-9a-f]*p[-+]?[0-9]+)",
    re.IGNORECASE,
)


def check_count(lines: Lines, found: int, expected: int) -> None:
    """Refuses a file that ended before all its rows."""
    if found < expected:
        raise format_error(
            lines.path, f"the file ends after {found} of {expected} rows", line=lines.number
        )


def _plain_number(found: re.Match[str]) -> str:
    if found["nan"]:
        return "nan"
    if found["inf"]:
        return "-inf" if found["inf"].startswith("-") else "inf"
    try:
        return repr(float.fromhex(found["hex"]))
    except (ValueError, OverflowError):
        return found["hex"]


def plain_numbers(row: str) -> str:
    """A row with C's hexadecimal numbers and names of NaN and infinity as Python has them."""
    if "#" in row or "(" in row or "x" in row or "X" in row:
        return _FOREIGN.sub(_plain_number, row)
    return row


def parse_rows(
    lines: Lines,
    rows: Iterable[str],
    n_columns: int,
    delimiter: str | None = None,
    columns: Sequence[int] | None = None,
) -> NDArray[np.float64]:
    """Rows of numbers; an error names the line. `nan` and `inf` are numbers, in any spelling.

    Without `columns`, every row must have `n_columns` values; else those at these places are taken.
    """
    stopped: list[BaseException] = []

    def watched() -> Iterator[str]:
        try:
            yield from map(plain_numbers, rows)
        except Exception as error:
            stopped.append(error)
            raise

    source = watched()
    first = next(source, None)
    if first is None:
        return np.empty((0, n_columns))

    def chained() -> Iterator[str]:
        yield first
        yield from source

    try:
        table = np.loadtxt(
            chained(),
            np.float64,
            comments=None,
            delimiter=delimiter,
            usecols=columns,
            ndmin=2,
            encoding=None,
        )
    except (ValueError, OverflowError) as error:
        if stopped:
            raise stopped[0] from None
        # numpy counts rows, and advises on its own options.
        reason = re.split(" at row |;", str(error))[0]
        raise format_error(
            lines.path, f"cannot read a row of {n_columns} numbers: {reason}", line=lines.number
        ) from None
    if table.shape[1] != n_columns:
        raise format_error(
            lines.path,
            f"rows have {table.shape[1]} values where {n_columns} are due",
            line=lines.number,
        )
    return table


def load_table(lines: Lines, count: int, n_columns: int) -> NDArray[np.float64]:
    """The next `count` rows that are not blank, separated by white space."""
    table = parse_rows(lines, lines.filled(count), n_columns)
    check_count(lines, len(table), count)
    return table


def load_fields(
    lines: Lines,
    count: int,
    fields: Sequence[tuple[str, str]],
    *,
    empty: int | None = None,
    before: int = 0,
    total: int | None = None,
) -> dict[str, Column]:
    """The next `count` rows as columns of the given names and types.

    `empty` stands in columns of integers where the file has NaN, which else is refused. Of `total`
    rows of a file that is read in parts, `before` were read.
    """
    wide = [i for i, (_, type_) in enumerate(fields) if np.dtype(type_) in (np.int64, np.uint64)]
    texts: list[list[str]] = [[] for _ in wide]

    def watched() -> Iterator[str]:
        for row in lines.filled(count):
            words = row.split() if wide else []
            for kept, i in zip(texts, wide, strict=True):
                kept.extend(words[i : i + 1])
            yield row

    table = parse_rows(lines, watched(), len(fields))
    if len(table) < count:
        check_count(lines, before + len(table), count if total is None else total)
    if empty is not None:
        integers = [i for i, (_, type_) in enumerate(fields) if np.dtype(type_).kind in "iu"]
        table[:, integers] = np.where(np.isnan(table[:, integers]), empty, table[:, integers])
    columns = typed_columns(lines, table, fields)
    # No double holds all integers of 64 bits.
    for kept, i in zip(texts, wide, strict=True):
        name, type_ = fields[i]
        # Words like 1e3 and nan are no integers, and doubles are as good for them.
        with suppress(ValueError, OverflowError):
            columns[name] = np.array([int(word) for word in kept], type_)
    return columns


def typed_columns(
    lines: Lines, table: NDArray[np.float64], fields: Iterable[tuple[str, str]]
) -> dict[str, Column]:
    """The columns in the types that a header gives them; integers must fit theirs."""
    columns: dict[str, Column] = {}
    for i, (name, type_) in enumerate(fields):
        column = table[:, i]
        dtype = np.dtype(type_)
        if dtype.kind in "iu" and len(column):
            limits = np.iinfo(dtype)
            if not ((column >= limits.min) & (column <= limits.max)).all():
                raise format_error(
                    lines.path,
                    f"column {name!r:.40} has values that are not integers from {limits.min} to "
                    f"{limits.max}, above this line",
                    line=lines.number,
                )
            # The limits of 64 bits are no doubles.
            column = np.clip(column, -(2.0**53), 2.0**53)
        with np.errstate(over="ignore"):
            columns[name] = column.astype(dtype)
    return columns


def save_table(file: BinaryIO, rows: Column, delimiter: str = " ") -> None:
    """Writes a structured array as text, with the digits it takes to read back the same numbers."""
    for start in range(0, len(rows), _ROWS_AT_A_TIME):
        part = rows[start : start + _ROWS_AT_A_TIME]
        columns: list[list[Any]] = [_words(part[name]) for name in part.dtype.names or ()]
        text = "\n".join(map(delimiter.join, zip(*columns, strict=True)))
        file.write(text.encode("ascii") + b"\n")


def _words(column: Column) -> list[str]:
    if column.dtype != np.float32:
        return list(map(repr, column.tolist()))
    # Shortest text that a parser of that very precision reads back; tolist() would widen float32.
    words: list[str] = column.astype("U32").tolist()
    return words
