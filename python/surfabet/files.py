"""Model files: read them, and tell what is inside."""

from __future__ import annotations

import dataclasses
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from surfabet import _core
from surfabet.alphabet import Alphabet, AlphabetModel
from surfabet.alphabet_bic import BicAlphabet, BicAlphabetModel
from surfabet.errors import FormatError
from surfabet.gas import GasModel
from surfabet.hscsm import HscsmDictionary, HscsmModel
from surfabet.lattice import PatchModel
from surfabet.metrics import RangeSigma
from surfabet.planes import PlaneModel

__all__ = ["AnyModel", "FileInfo", "from_bytes", "inspect", "load"]

MAX_ITEMS = 500_000_000
"""Most patches or other items that a file may ask for unless told otherwise."""
MAX_BYTES = 8 << 30
"""Most bytes that a file may make us allocate unless told otherwise."""

SECTIONS = {
    "META": "header",
    "POSE": "poses",
    "MASK": "masks",
    "DICT": "dictionaries",
    "GEOM": "geometry",
    "PNTS": "extra points",
    "DREF": "hash of the dictionary",
    "DPTH": "depth",
    "COLR": "colour",
    "WORD": "words",
    "WREF": "hash of the alphabet",
    "OCCR": "occurrences",
    "CHAN": "colour and intensity",
    "TOPO": "topology",
    "POSN": "positions",
    "NORM": "normals",
    "SIZE": "sizes",
}

AnyModel = AlphabetModel | BicAlphabetModel | GasModel | PatchModel | HscsmModel | PlaneModel
"""A model of any family."""


@dataclass(frozen=True, slots=True)
class FileInfo:
    """What a model file holds."""

    family: str
    """The model's family."""
    version: str
    """Oldest release of surfabet that reads the file."""
    n_points: int
    """Points of the cloud that the model was made from."""
    sections: dict[str, int]
    """Bytes of each part."""
    options: dict[str, Any]
    """Sizes and options of the model."""

    def as_dict(self) -> dict[str, Any]:
        """All fields as plain dicts and numbers."""
        return dataclasses.asdict(self)


def load(
    path: str | os.PathLike[str],
    *,
    dictionary: HscsmDictionary | None = None,
    alphabet: Alphabet | BicAlphabet | None = None,
    max_items: int = MAX_ITEMS,
    max_bytes: int = MAX_BYTES,
) -> AnyModel:
    """Reads a model file (`.sfb`), which need not be trusted.

    Parameters
    ----------
    path
        The file.
    dictionary
        The dictionary that the file was made with, when it does not hold one itself.
    alphabet
        The alphabet that the file was made with, when it does not hold one itself.
    max_items, max_bytes
        Refuse files that ask for more than this.

    Raises
    ------
    OSError
        When the file cannot be read.
    FormatError
        When it is damaged, not a model, needs a newer release, or was made with another
        dictionary; the message says which.
    """
    core = _core.load(
        os.fspath(path),
        max_items=max_items,
        max_bytes=max_bytes,
        **_shared(dictionary, alphabet),
    )
    return _wrapped(core)


def from_bytes(
    data: bytes,
    *,
    dictionary: HscsmDictionary | None = None,
    alphabet: Alphabet | BicAlphabet | None = None,
    max_items: int = MAX_ITEMS,
    max_bytes: int = MAX_BYTES,
) -> AnyModel:
    """As `load`, from bytes as `HscsmModel.to_bytes` gives them."""
    core = _core.from_bytes(
        data,
        max_items=max_items,
        max_bytes=max_bytes,
        **_shared(dictionary, alphabet),
    )
    return _wrapped(core)


def inspect(
    path: str | os.PathLike[str],
    *,
    dictionary: HscsmDictionary | None = None,
    alphabet: Alphabet | BicAlphabet | None = None,
) -> FileInfo:
    """What a model file holds, with the bytes of each part.

    Raises
    ------
    OSError, FormatError
        As `load`.
    """
    data = Path(path).read_bytes()
    try:
        family, version, sections, core = _core.inspect(
            data,
            max_items=MAX_ITEMS,
            max_bytes=MAX_BYTES,
            **_shared(dictionary, alphabet),
        )
    except FormatError as error:
        raise FormatError(f"{os.fspath(path)}: {error}") from None
    model = _wrapped(core)
    options = _options(model)
    named = {SECTIONS.get(tag, tag): size for tag, size in sections}
    return FileInfo(family, version, model.n_points, named, options)


def _shared(
    dictionary: HscsmDictionary | None, alphabet: Alphabet | BicAlphabet | None
) -> dict[str, Any]:
    return {
        "dictionary": None if dictionary is None else dictionary._core,
        "alphabet": alphabet._core if isinstance(alphabet, Alphabet) else None,
        "bic_alphabet": alphabet._core if isinstance(alphabet, BicAlphabet) else None,
    }


def _wrapped(core: _core._AnyModel) -> AnyModel:
    match core:
        case _core.AlphabetModel():
            return AlphabetModel(core)
        case _core.BicAlphabetModel():
            return BicAlphabetModel(core)
        case _core.GasModel():
            return GasModel(core)
        case _core.PatchModel():
            return PatchModel(core)
        case _core.PlaneModel():
            return PlaneModel(core)
        case _:
            return HscsmModel(core)


def _options(model: AnyModel) -> dict[str, Any]:
    match model:
        case AlphabetModel():
            return _alphabet_options(model)
        case BicAlphabetModel():
            return _bic_options(model)
        case GasModel():
            return _gas_options(model)
        case PatchModel():
            return _lattice_options(model)
        case PlaneModel():
            return _plane_options(model)
        case _:
            return _hscsm_options(model)


def _alphabet_options(model: AlphabetModel) -> dict[str, Any]:
    words = model.alphabet
    options: dict[str, Any] = {
        "method": "mdl",
        "words": len(words),
        "occurrences": len(model),
        "radii (m)": " ".join(f"{radius:g}" for radius in words.radii),
        "colour": model.has_color,
        "intensity": model.has_intensity,
        "alphabet": words.hash,
        "shared alphabet": model.shares_alphabet,
    }
    match model.sigma:
        case RangeSigma(scale, angle):
            options["sigma scale"] = round(scale, 6)
            options["angular resolution (degrees)"] = round(math.degrees(angle), 6)
        case distance:
            options["sigma (m)"] = round(distance, 6)
    options["noise (m)"] = round(model.noise, 6)
    return options


def _bic_options(model: BicAlphabetModel) -> dict[str, Any]:
    words = model.alphabet
    return {
        "method": "bic",
        "words": len(words),
        "occurrences": len(model),
        "radius (m)": words.radius,
        "colour": model.has_color,
        "alphabet": words.hash,
        "shared alphabet": model.shares_alphabet,
    }


def _gas_options(model: GasModel) -> dict[str, Any]:
    return {
        "neurons": len(model),
        "edges": len(model.edges),
        "components": int(model.components().max()) + 1,
        "colour": model.has_color,
        "mean error (m)": model.mean_error,
        "position step (m)": model.position_step,
    }


def _lattice_options(model: PatchModel) -> dict[str, Any]:
    options: dict[str, Any] = {
        "method": "rate-distortion",
        "levels": len(model.levels),
        "colour": model.has_color,
        "patches": len(model),
    }
    for j, level in enumerate(model.levels):
        options |= {
            f"level {j}: resolution (m)": level.pixel_size,
            f"level {j}: patches": level.patches,
            f"level {j}: area (m2)": level.area,
        }
    options["extra points"] = model.n_extra_points
    if model.max_error is not None:
        options["max error (m)"] = model.max_error
    return options


def _plane_options(model: PlaneModel) -> dict[str, Any]:
    planes = model.planes
    return {
        "planes": len(planes),
        "of these planar": int(planes.planar.sum()),
        "colour": model.has_color,
        "grid size (m)": model.grid_size,
        "area (m2)": float(planes.areas.sum()),
        "tiles": sum(mask.size for mask in planes.supported),
        "of these supported": sum(int(mask.sum()) for mask in planes.supported),
        "outliers": model.n_outliers,
    }


def _hscsm_options(model: HscsmModel) -> dict[str, Any]:
    options: dict[str, Any] = {
        "method": "hscsm",
        "levels": len(model.levels),
        "colour": model.has_color,
        "dictionary": model.dictionary.hash,
        "shared dictionary": model.shares_dictionary,
    }
    for j, level in enumerate(model.levels):
        # One level needs no numbers; of several, 0 is the coarsest.
        prefix = f"level {j}: " if len(model.levels) > 1 else ""
        options |= {
            f"{prefix}resolution (m)": level.pixel_size,
            f"{prefix}pixels per side": level.pixels,
            f"{prefix}patches": level.patches,
            f"{prefix}area (m2)": level.area,
            f"{prefix}set pixels": level.set_pixels,
            f"{prefix}depth dictionary entries": level.depth_entries,
            f"{prefix}colour dictionary entries": level.color_entries,
        }
    if len(model.levels) > 1:
        options["patches"] = len(model)
    return options
