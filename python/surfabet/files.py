"""Model files: read them, and see what is inside."""

from __future__ import annotations

import dataclasses
import io
import os
from dataclasses import dataclass
from typing import Any, BinaryIO

from surfabet import _core
from surfabet._checks import check_integer
from surfabet._methods import METHODS
from surfabet._note import note_of_source
from surfabet._remote import RemoteFile, is_url
from surfabet.alphabet import Alphabet, AlphabetModel
from surfabet.bic_alphabet import BicAlphabet, BicAlphabetModel
from surfabet.errors import FormatError, wrong_type, wrong_value
from surfabet.gas import GasModel
from surfabet.hscsm import HscsmDictionary, HscsmModel
from surfabet.io._files import path_of
from surfabet.model import Box
from surfabet.patches import PatchModel
from surfabet.planes import PlaneModel
from surfabet.tiles import TiledPatchModel, open_tiled

__all__ = ["AnyModel", "FileInfo", "Vocabulary", "from_bytes", "inspect", "load"]

MAX_ITEMS = 500_000_000
"""Most patches or other items that a file may ask for unless told otherwise."""
MAX_BYTES = 8 << 30
"""Most bytes that a file may make us allocate unless told otherwise."""

AnyModel = (
    AlphabetModel
    | BicAlphabetModel
    | GasModel
    | PatchModel
    | HscsmModel
    | PlaneModel
    | TiledPatchModel
)
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
    """What the writer noted for people: `surfabet compress` notes what it chose and why."""

    def as_dict(self) -> dict[str, Any]:
        """All fields as plain dicts and numbers."""
        return dataclasses.asdict(self)


def load(
    path: str | os.PathLike[str] | BinaryIO,
    *,
    box: Box | None = None,
    level: int | None = None,
    vocabulary: Vocabulary | None = None,
    max_items: int = MAX_ITEMS,
    max_bytes: int = MAX_BYTES,
) -> AnyModel:
    """Reads a model file (`.sfb`), which need not be trusted.

    Parameters
    ----------
    path
        The file: a path, a URL such as `https://...` or `s3://...` (needs `surfabet[remote]`), or a
        binary object with `read` and `seek`.
    box
        Of a file with tiles, read only those that meet this box: its lower and upper corner in
        world coordinates, metres. The model decodes to the points in the box.
    level
        Of a file with tiles, read only this level of detail, 0 the coarsest; with `box` the finest
        by default.
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
    InvalidInputError
        For a box that is none, a level that the file does not have, and for either with a file
        that has no tiles.
    """
    if not isinstance(path, str | os.PathLike) and not hasattr(path, "seek"):
        raise wrong_type("path", path, "a path, a URL, or a binary file that can be sought in")
    words = _checked(vocabulary, max_items, max_bytes)
    source = RemoteFile(path) if isinstance(path, str) and is_url(path) else path
    tiled = open_tiled(source, box=box, level=level, max_items=max_items, max_bytes=max_bytes)
    if tiled is not None:
        return tiled
    for name, given in (("box", box), ("level", level)):
        if given is not None:
            requirement = "left out: the file has no tiles, load it whole and decode with box="
            raise wrong_value(name, given, requirement)
    if not isinstance(source, str | os.PathLike):
        source.seek(0)
        return from_bytes(
            source.read(), vocabulary=vocabulary, max_items=max_items, max_bytes=max_bytes
        )
    core = _core.load(
        os.fspath(source),
        max_items=max_items,
        max_bytes=max_bytes,
        vocabulary=words,
    )
    return _wrapped(core, note_of_source(source))


def _checked(
    vocabulary: Vocabulary | None, max_items: int, max_bytes: int
) -> _core.HscsmDictionary | _core.Alphabet | _core.BicAlphabet | None:
    """What the core takes as the vocabulary.

    Raises
    ------
    InvalidInputError
        One of the arguments is none.
    """
    check_integer("max_items", max_items, 0)
    check_integer("max_bytes", max_bytes, 0)
    if vocabulary is not None and not isinstance(vocabulary, Vocabulary):
        requirement = "what a model has as model.dictionary or model.alphabet"
        raise wrong_type("vocabulary", vocabulary, requirement)
    return None if vocabulary is None else vocabulary._core


def from_bytes(
    data: bytes,
    *,
    vocabulary: Vocabulary | None = None,
    max_items: int = MAX_ITEMS,
    max_bytes: int = MAX_BYTES,
) -> AnyModel:
    """As `load`, from bytes as `Model.to_bytes` gives them."""
    if not isinstance(data, bytes):
        raise wrong_type("data", data, "bytes")
    words = _checked(vocabulary, max_items, max_bytes)
    tiled = open_tiled(
        io.BytesIO(data), box=None, level=None, max_items=max_items, max_bytes=max_bytes
    )
    if tiled is not None:
        return tiled
    core = _core.from_bytes(
        data,
        max_items=max_items,
        max_bytes=max_bytes,
        vocabulary=words,
    )
    return _wrapped(core, note_of_source(io.BytesIO(data)))


def inspect(path: str | os.PathLike[str]) -> FileInfo:
    """What a model file holds, with the bytes of each part; needs no vocabulary.

    Raises
    ------
    OSError, FormatError
        As `load`.
    """
    path = path_of("path", path)
    data = path.read_bytes()
    try:
        method, version, vocabulary, sections, note = _core.inspect(
            data, max_items=MAX_ITEMS, max_bytes=MAX_BYTES
        )
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from None
    return FileInfo(method, version, vocabulary, dict(sections), note)


CLASSES = {method.compiled: method.model for method in METHODS.values()}
"""The class of each compiled one."""


def _wrapped(core: _core.Model, note: str) -> AnyModel:
    model: AnyModel = CLASSES[type(core)](core, note)  # type: ignore[assignment]
    return model
