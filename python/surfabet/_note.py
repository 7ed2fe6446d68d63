"""The note of a model file: read without the rest of the file, and put into one."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from surfabet import _core
from surfabet._checks import check_text
from surfabet.errors import wrong_value

__all__ = ["checked_note", "note_of_source", "visible", "with_note"]

_NOTE = b"note"
_FIRST = 8
"""Magic, versions and family: what stands before the required features."""
_PIECE = 512
"""Bytes that are read at a time until the header is whole; most are shorter."""


@dataclass(frozen=True)
class _Header:
    """The header of a file that was read as a model before, so that it is known to be whole."""

    features: bytes
    """The required features, as they stand in the file."""
    sections: list[tuple[bytes, int, bytes]]
    """Of each its tag, the length of its bytes, and the tag, length and checksum as they stand in
    the file."""
    end: int
    """Where the sections begin."""


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
    at = header.end
    for tag, length, _ in header.sections:
        if tag == _NOTE and length <= _core.MAX_NOTE:
            source.seek(at)
            held: bytes = source.read(length)
            return held.decode(errors="replace")
        at += length
    return ""


def with_note(data: bytes, note: str) -> bytes:
    """The bytes of a model file without a note, with this one at their end."""
    if not note:
        return data
    header, text = _header(data), note.encode()
    assert header is not None, "the core gives whole files"
    row = _NOTE + _varint(len(text)) + _checksum(text)
    rows = [row for _, _, row in header.sections] + [row]
    head = data[:_FIRST] + header.features + _varint(len(rows)) + b"".join(rows)
    return b"".join([head, _checksum(head), data[header.end :], text])


def visible(note: str) -> str:
    """The note without what would steer a terminal, as `surfabet.inspect` shows it."""
    # Control characters of Unicode are those below the blank, and 0x7f to 0x9f.
    return "".join("\ufffd" if c < " " or "\x7f" <= c <= "\x9f" else c for c in note)


def _header(begin: bytes) -> _Header | None:
    """The header of a file that begins so; None where that is cut short."""
    try:
        _, first = _read_varint(begin, _FIRST)
        count, at = _read_varint(begin, first)
        sections = []
        for _ in range(count):
            length, end = _read_varint(begin, at + 4)
            sections.append((begin[at : at + 4], length, begin[at : end + 4]))
            at = end + 4
    except IndexError:
        return None
    # The checksum of the header ends it.
    end = at + 4
    return None if len(begin) < end else _Header(begin[_FIRST:first], sections, end)


def _read_varint(data: bytes, at: int) -> tuple[int, int]:
    """The number at a place, and where it ends."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at


def _varint(value: int) -> bytes:
    groups = []
    while value >= 0x80:
        groups.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*groups, value])


def _checksum(data: bytes) -> bytes:
    """CRC-32C, as it stands in the file."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return (crc ^ 0xFFFFFFFF).to_bytes(4, "little")
