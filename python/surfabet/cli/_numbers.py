"""Integers of the command line: 1.5 is none, as in Python."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cyclopts import Parameter, Token

__all__ = ["WHOLE"]


def _whole(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise ValueError(f'"{text}" is no integer.') from None


def _converted(type_: Any, tokens: Sequence[Token]) -> Any:
    """The integer, or the list of integers, that words of the command line are."""
    numbers = [_whole(token.value) for token in tokens]
    return numbers[0] if type_ is int else numbers


WHOLE = Parameter(converter=_converted)
"""For options of integers: what cyclopts itself makes of 1.5 is 2."""
