"""What arguments must be: a check for each kind, with errors that name the argument.

Options of methods are checked by their records in Rust; these are for all other arguments.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Sequence
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.errors import wrong_type, wrong_value

__all__ = [
    "check_choice",
    "check_cloud",
    "check_flag",
    "check_integer",
    "check_items",
    "check_number",
    "check_text",
    "check_vector",
]

_LARGEST = (1 << 64) - 1
"""The largest integer that Rust takes for any count or seed."""


def check_cloud(name: str, value: object) -> PointCloud:
    """The cloud that an argument is."""
    if not isinstance(value, PointCloud):
        raise wrong_type(name, value, "a PointCloud")
    return value


def check_flag(name: str, value: object) -> bool:
    """The truth value that an argument is; numbers are none."""
    if not isinstance(value, bool | np.bool_):
        raise wrong_type(name, value, "True or False")
    return bool(value)


def check_integer(name: str, value: object, least: int, most: int = _LARGEST) -> int:
    """The integer that an argument is, also one of numpy."""
    requirement = f"an integer from {least} to {most}"
    if most == _LARGEST:
        requirement = f"an integer of at least {least}"
    try:
        if isinstance(value, bool | np.bool_):
            raise TypeError
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise wrong_type(name, value, requirement) from None
    if number > _LARGEST:
        raise wrong_value(name, value, "an integer below 2^64")
    if not least <= number <= most:
        raise wrong_value(name, value, requirement)
    return number


def check_number(
    name: str,
    value: object,
    requirement: str,
    *,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
) -> float:
    """The finite number that an argument is, also one of numpy.

    `requirement` is the range from `least`, or from `above`, which it must exceed, to `most` in
    words.
    """
    if isinstance(value, bool | np.bool_ | str | bytes) or not isinstance(value, SupportsFloat):
        raise wrong_type(name, value, requirement)
    try:
        number = float(value)
    except (TypeError, ValueError):
        # An array of several numbers.
        raise wrong_type(name, value, requirement) from None
    except OverflowError:
        number = math.inf
    if not (math.isfinite(number) and least <= number <= most and above < number):
        raise wrong_value(name, value, requirement)
    return number


def check_text(name: str, value: object, requirement: str = "a text") -> str:
    """The text that an argument is."""
    if not isinstance(value, str):
        raise wrong_type(name, value, requirement)
    return value


def check_choice(name: str, value: object, choices: Sequence[str]) -> str:
    """The one of some texts that an argument is."""
    *others, last = (repr(choice) for choice in choices)
    requirement = f"{', '.join(others)} or {last}"
    text = check_text(name, value, requirement)
    if text not in choices:
        raise wrong_value(name, value, requirement)
    return text


def check_vector(name: str, value: object, requirement: str, length: int = 3) -> list[float]:
    """The finite numbers that an argument is a sequence of."""
    array = real_array(value)
    if array is None:
        raise wrong_type(name, value, requirement)
    if array.shape != (length,) or not np.isfinite(array).all():
        raise wrong_value(name, value, requirement)
    numbers: list[float] = array.tolist()
    return numbers


def check_items(name: str, value: object, requirement: str) -> list[Any]:
    """The items of an argument that is a sequence or another iterable of things."""
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        raise wrong_type(name, value, requirement)
    return list(value)


def real_array(value: object) -> NDArray[np.float64] | None:
    """Numbers as an array in double precision; None for what does not consist of numbers."""
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "fiu":
            return None
        return array.astype(np.float64)
    except (TypeError, ValueError):
        return None
