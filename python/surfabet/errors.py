"""The exceptions and warnings of surfabet, each also one of Python's own kinds."""

from __future__ import annotations

__all__ = [
    "DroppedPointsWarning",
    "FormatError",
    "IncompleteModelWarning",
    "IncompleteReadWarning",
    "InvalidInputError",
    "InvalidTypeError",
    "LostAttributeWarning",
    "MissingDependencyError",
    "UnitWarning",
]


class InvalidInputError(ValueError):
    """An argument has a wrong value, shape or length."""

    argument: str | None
    """Name of the argument; None where the error is about several or about the data."""
    value: str | None
    """Its value, as the message shows it."""
    requirement: str | None
    """What it must be, as the message has it."""

    def __init__(
        self,
        message: str = "",
        *,
        argument: str | None = None,
        value: str | None = None,
        requirement: str | None = None,
    ) -> None:
        super().__init__(message)
        self.argument = argument
        self.value = value
        self.requirement = requirement


class InvalidTypeError(InvalidInputError, TypeError):
    """An argument is of another type than it must be."""


_LONGEST = 120
"""Characters of a value that a message shows."""


def _in_one_line(value: object) -> str:
    """The `repr` of a value, without the middle of a long one."""
    text = " ".join(repr(value).split())
    half = _LONGEST // 2
    return text if len(text) <= _LONGEST else f"{text[:half]} ... {text[-half:]}"


def wrong_value(
    argument: str, value: object, requirement: str, *, shown: str | None = None
) -> InvalidInputError:
    """The error for an argument of a wrong value.

    `shown` is what the message has in place of the value's `repr`.
    """
    text = _in_one_line(value) if shown is None else shown
    return InvalidInputError(
        f"{argument} is {text}, but must be {requirement}",
        argument=argument,
        value=text,
        requirement=requirement,
    )


def wrong_type(argument: str, value: object, requirement: str) -> InvalidTypeError:
    """The error for an argument of a wrong type, which shows texts and numbers themselves."""
    kind = type(value).__name__
    text = f"{'an' if kind[0].lower() in 'aeiou' else 'a'} {kind}"
    if value is None or isinstance(value, str | bool | int | float):
        text = _in_one_line(value)
    return InvalidTypeError(
        f"{argument} is {text}, but must be {requirement}",
        argument=argument,
        value=text,
        requirement=requirement,
    )


class FormatError(OSError, ValueError):
    """A file is not what it claims to be: truncated, corrupt, of another format or version."""


class MissingDependencyError(ImportError):
    """A file format or view needs an optional package that is not installed."""


class DroppedPointsWarning(UserWarning):
    """Points were left out: not finite, no returns, withheld, noise, or far from all others."""


class LostAttributeWarning(UserWarning):
    """The target cannot hold an attribute of the cloud, or a reader left something aside."""


class IncompleteReadWarning(DroppedPointsWarning, LostAttributeWarning):
    """A file was read without some of its points and with something left aside."""


class IncompleteModelWarning(UserWarning):
    """A model lost a part of the scan that it was to hold."""


class UnitWarning(UserWarning):
    """Coordinates look as if their unit was another than the metre."""


class FrameWarning(UserWarning):
    """Two things that are to be in one frame are so far apart that they are perhaps not."""
