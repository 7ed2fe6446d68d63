"""Text files of any encoding and any ends of lines, as bytes with line feeds."""

from __future__ import annotations

import codecs
import io
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

_BYTE_ORDER_MARKS = (
    # The mark of UTF-16 begins that of UTF-32.
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_LOOKED_AT = 1 << 16
_PART = 1 << 20


def _wide_encoding(start: bytes) -> str | None:
    """The encoding of text of more than one byte per digit, told by its mark or its zeros."""
    for mark, name in _BYTE_ORDER_MARKS:
        if start.startswith(mark):
            return name
    pairs = start[: len(start) // 2 * 2]
    if len(pairs) < 4 or any(pairs[0::2]) == any(pairs[1::2]):
        return None
    return "utf-16-le" if not any(pairs[1::2]) else "utf-16-be"


@contextmanager
def open_text(path: Path) -> Iterator[BinaryIO]:
    """The file opened at its first character, with line feeds, in an encoding that extends ASCII.

    Files in UTF-16 and UTF-32 are given as UTF-8, and files whose lines end in carriage returns
    with line feeds, both by way of a temporary file; all others as they are. Bytes that mean
    nothing in such an encoding become replacement characters, which no number has.
    """
    with path.open("rb") as file:
        start = file.read(_LOOKED_AT)
        begin = len(codecs.BOM_UTF8) if start.startswith(codecs.BOM_UTF8) else 0
        wide = _wide_encoding(start)
        if wide is None and (b"\n" in start or b"\r" not in start):
            file.seek(begin)
            yield file
            return
        file.seek(begin)
        target = "latin-1" if wide is None else "utf-8"
        text = io.TextIOWrapper(file, wide or target, errors="replace", newline=None)
        with tempfile.TemporaryFile() as recoded:
            while part := text.read(_PART):
                recoded.write(part.encode(target, errors="replace"))
            recoded.seek(0)
            yield recoded
