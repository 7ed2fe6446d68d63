"""The note of a model file: read without the rest of the file."""

from __future__ import annotations

import os
from typing import Any

from surfabet import _core
from surfabet._checks import check_text
from surfabet.errors import wrong_value

__all__ = ["checked_note", "note_of_source", "visible"]

_NOTE = b"note"
_FIRST = 8
"""Magic, versions and family: what stands before the required features."""
_PIECE = 512
"""Bytes that are read at a time until the header is whole; most are shorter."""


def checked_note(note: object) -> str:
    """A line for people that fits into a file.

    Raises
    ------
    InvalidInputError
        It is no text, or too long.
    """
    text = check_text("note", note)
    if (size := len(text.encode())) > _core.MAX_NOTE:
        requirement = f"a text of at most {_core.MAX_NOTE} bytes"
        raise wrong_value("note", note, requirement, shown=f"a text of {size} bytes")
    return text


def note_of_source(source: Any, begin: bytes = b"") -> str:
    """The note of a model file that was read before, by its path or a binary object that can be
    sought in; empty without one, and for one that is longer than it may be.

    Only the header and the note are read; of the header what goes beyond `begin`, which the file
    begins with.
    """
    if isinstance(source, str | os.PathLike):
        with open(source, "rb") as file:
            return note_of_source(file)
    while (header := _header(begin)) is None:
        source.seek(len(begin))
        begin += source.read(_PIECE)
    sections, at = header
    for tag, length in sections:
        if tag == _NOTE and length <= _core.MAX_NOTE:
            source.seek(at)
            held: bytes = source.read(length)
            return held.decode(errors="replace")
        at += length
    return ""


def visible(note: str) -> str:
    """The note without what would steer a terminal, as `surfabet.inspect` shows it."""
    # Control characters of Unicode are those below the blank, and 0x7f to 0x9f.
    return "".join("\ufffd" if c < " " or "\x7f" <= c <= "\x9f" else c for c in note)


def _header(begin: bytes) -> tuple[list[tuple[bytes, int]], int] | None:
    """Tags and lengths of the sections of a file that begins so, and where they begin; None where
    the header is cut short."""
    try:
        _, at = _read_varint(begin, _FIRST)
        count, at = _read_varint(begin, at)
        sections = []
        for _ in range(count):
            length, end = _read_varint(begin, at + 4)
            sections.append((begin[at : at + 4], length))
            at = end + 4
    except IndexError:
        return None
    # The checksum of the header ends it.
    return None if len(begin) < at + 4 else (sections, at + 4)


def _read_varint(data: bytes, at: int) -> tuple[int, int]:
    """The number at a place, and where it ends."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
