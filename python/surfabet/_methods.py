"""The list of methods for Python: the one place where a new method is registered.

Types for checkers are spelled in `surfabet.files` (`AnyModel`), names of the command line generated
into `surfabet.cli._learn_options` (`ModelName`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from surfabet import _core
from surfabet.alphabet import Alphabet, AlphabetModel, learn_alphabet
from surfabet.bic_alphabet import BicAlphabet, BicAlphabetModel, learn_bic_alphabet
from surfabet.gas import GasModel, learn_gas
from surfabet.hscsm import HscsmDictionary, HscsmModel, learn_hscsm
from surfabet.model import Model
from surfabet.patches import PatchModel, learn_patches
from surfabet.planes import PlaneModel, learn_planes

__all__ = ["METHODS", "Method"]


@dataclass(frozen=True)
class Method:
    """A method with what the package has of it."""

    learn: Callable[..., Any]
    model: type[Model[Any]]
    compiled: type[_core.Model]
    """The compiled class that a model holds."""
    content: str
    """What its models are made of, for people."""
    vocabulary: type[HscsmDictionary | Alphabet | BicAlphabet] | None = None
    """What files of several models can share."""


METHODS: dict[str, Method] = {
    "patches": Method(
        learn_patches,
        PatchModel,
        _core.PatchModel,
        "surface patches on the scene's own lattice, each a piece of surface with its mask",
    ),
    "hscsm": Method(
        learn_hscsm,
        HscsmModel,
        _core.HscsmModel,
        "square surface patches, sparse-coded over a dictionary learned from the scene",
        HscsmDictionary,
    ),
    "alphabet": Method(
        learn_alphabet,
        AlphabetModel,
        _core.AlphabetModel,
        "words, pieces of surface that recur, and every place where one occurs",
        Alphabet,
    ),
    "bic-alphabet": Method(
        learn_bic_alphabet,
        BicAlphabetModel,
        _core.BicAlphabetModel,
        "words, pieces of surface that recur (chosen by BIC), and where each occurs",
        BicAlphabet,
    ),
    "planes": Method(
        learn_planes,
        PlaneModel,
        _core.PlaneModel,
        "flat rectangles in tiles, of which those count that points support",
    ),
    "gas": Method(
        learn_gas,
        GasModel,
        _core.GasModel,
        "neurons that spread over the surface, and edges where it goes on",
    ),
}
"""By their names, in the order in which they are shown."""
