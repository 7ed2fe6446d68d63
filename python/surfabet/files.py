"""Model files: read them, and see what is inside."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from surfabet import _core
from surfabet.alphabet import Alphabet, AlphabetModel
from surfabet.bic_alphabet import BicAlphabet, BicAlphabetModel
from surfabet.errors import FormatError
from surfabet.gas import GasModel
from surfabet.hscsm import HscsmDictionary, HscsmModel
from surfabet.patches import PatchModel
from surfabet.planes import PlaneModel

__all__ = ["AnyModel", "FileInfo", "Vocabulary", "from_bytes", "inspect", "load"]

MAX_ITEMS = 500_000_000
"""Most patches or other items that a file may ask for unless told otherwise."""
MAX_BYTES = 8 << 30
"""Most bytes that a file may make us allocate unless told otherwise."""

AnyModel = AlphabetModel | BicAlphabetModel | GasModel | PatchModel | HscsmModel | PlaneModel
"""A model of any method."""


Vocabulary = HscsmDictionary | Alphabet | BicAlphabet
"""What files of several models can share."""


@dataclass(frozen=True, slots=True)
class FileInfo:
    """What a model file holds, known without decoding it."""

    method: str
    """Name of the model's method."""
    version: str
    """Oldest release of surfabet that reads the file."""
    vocabulary: str | None
    """Hash of the dictionary or alphabet that the file names instead of holding it."""
    sections: dict[str, int]
    """Bytes of each part."""
    note: str | None
    """What the writer noted for people: `surfabet compress` says what it chose and why."""

    def as_dict(self) -> dict[str, Any]:
        """All fields as plain dicts and numbers."""
        return dataclasses.asdict(self)


def load(
    path: str | os.PathLike[str],
    *,
    vocabulary: Vocabulary | None = None,
    max_items: int = MAX_ITEMS,
    max_bytes: int = MAX_BYTES,
) -> AnyModel:
    """Reads a model file (`.sfb`), which need not be trusted.

    Parameters
    ----------
    path
        The file.
    vocabulary
        The dictionary or alphabet that the file was made with, when it names one by its hash
        instead of holding it: `model.dictionary` or `model.alphabet`.
    max_items, max_bytes
        Refuse files that ask for more than this.

    Returns
    -------
    Model
        Of the class of its method.

    Raises
    ------
    OSError
        When the file cannot be read.
    FormatError
        When it is damaged, not a model, needs a newer release, or was made with another
        vocabulary; the message says which.
    """
    core = _core.load(
        os.fspath(path),
        max_items=max_items,
        max_bytes=max_bytes,
        vocabulary=None if vocabulary is None else vocabulary._core,
    )
    return _wrapped(core)


def from_bytes(
    data: bytes,
    *,
    vocabulary: Vocabulary | None = None,
    max_items: int = MAX_ITEMS,
    max_bytes: int = MAX_BYTES,
) -> AnyModel:
    """As `load`, from bytes as `Model.to_bytes` gives them."""
    core = _core.from_bytes(
        data,
        max_items=max_items,
        max_bytes=max_bytes,
        vocabulary=None if vocabulary is None else vocabulary._core,
    )
    return _wrapped(core)


def inspect(path: str | os.PathLike[str]) -> FileInfo:
    """What a model file holds, with the bytes of each part; needs no vocabulary.

    Raises
    ------
    OSError, FormatError
        As `load`.
    """
    data = Path(path).read_bytes()
    try:
        method, version, vocabulary, sections, note = _core.inspect(
            data, max_items=MAX_ITEMS, max_bytes=MAX_BYTES
        )
    except FormatError as error:
        raise FormatError(f"{os.fspath(path)}: {error}") from None
    return FileInfo(method, version, vocabulary, dict(sections), note)


CLASSES: dict[type[_core.Model], type[AnyModel]] = {
    _core.PatchModel: PatchModel,
    _core.HscsmModel: HscsmModel,
    _core.AlphabetModel: AlphabetModel,
    _core.BicAlphabetModel: BicAlphabetModel,
    _core.PlaneModel: PlaneModel,
    _core.GasModel: GasModel,
}
"""The class of each compiled one."""


def _wrapped(core: _core.Model) -> AnyModel:
    model: AnyModel = CLASSES[type(core)](core)  # type: ignore[arg-type]
    return model
