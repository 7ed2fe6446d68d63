"""What models of all families have in common."""

from __future__ import annotations

import os
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from surfabet.learning import LearningReport

__all__ = ["MAX_POINTS", "Model"]

MAX_POINTS = 500_000_000
"""Most points that `decode` makes unless told otherwise."""


class _Core(Protocol):
    """What the compiled class behind a model has."""

    def to_bytes(self) -> bytes: ...
    def save(self, path: str) -> int: ...
    @property
    def n_points(self) -> int: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def has_color(self) -> bool: ...
    @property
    def report_dict(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...


C = TypeVar("C", bound=_Core)


class Model(Generic[C]):
    """A cloud as a model; immutable.

    Everything in it is quantised already, so it decodes to the same cloud before it is saved and
    after it is loaded. Families derive from this class and add `decode` and what they are made of.
    """

    __slots__ = ("_core",)

    def __init__(self, core: C) -> None:
        self._core = core

    def to_bytes(self) -> bytes:
        """The bytes of the model's file. The same model always gives the same bytes."""
        return self._core.to_bytes()

    def save(self, path: str | os.PathLike[str]) -> int:
        """Writes the model to a file, usually `.sfb`, and returns its size in bytes.

        An existing file is replaced only when the new one is complete.
        """
        return self._core.save(os.fspath(path))

    @property
    def report(self) -> LearningReport:
        """How the model was learned."""
        found = self._core.report_dict
        return LearningReport(**{**found, "not_kept": tuple(found["not_kept"])})

    @property
    def n_points(self) -> int:
        """Points of the cloud that the model was learned from."""
        return self._core.n_points

    @property
    def origin(self) -> NDArray[np.float64]:
        """World position that the model computes about, (3,), metres."""
        return np.array(self._core.origin)

    @property
    def has_color(self) -> bool:
        """Whether the model carries colour."""
        return self._core.has_color

    def __len__(self) -> int:
        return len(self._core)
