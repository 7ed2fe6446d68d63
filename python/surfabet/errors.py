"""The exceptions and warnings of surfabet, each also one of Python's own kinds."""

from __future__ import annotations

__all__ = [
    "DroppedPointsWarning",
    "FormatError",
    "InvalidInputError",
    "LostAttributeWarning",
    "MissingDependencyError",
]


class InvalidInputError(ValueError):
    """An argument has a wrong value, shape or length."""


class FormatError(OSError, ValueError):
    """A file is not what it claims to be: truncated, corrupt, of another format or version."""


class MissingDependencyError(ImportError):
    """A file format or view needs an optional package that is not installed."""


class DroppedPointsWarning(UserWarning):
    """Points that are not finite were left out."""


class LostAttributeWarning(UserWarning):
    """The target cannot hold an attribute of the cloud."""
