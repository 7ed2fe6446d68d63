"""Our models through their file format."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from surfabet import files
from surfabet._core import PointCloud
from surfabet._methods import METHODS
from surfabet.comparison.coded import Coded, cpu_seconds
from surfabet.errors import InvalidInputError
from surfabet.patches import PatchModel

__all__ = ["model"]


def model(
    cloud: PointCloud, *, method: str, spacing: float | None = None, **options: Any
) -> list[Coded]:
    """A model of ours: as a surface and, where it keeps thickness, as measured.

    It is decoded from its bytes, at its own spacing unless one is given: that costs no bytes.
    """
    began = cpu_seconds()
    learned = METHODS[method].learn(cloud, **options)
    if len(learned) == 0:
        raise InvalidInputError(f"found no surface in {len(cloud):,} points to describe")
    data = learned.to_bytes()
    encode_seconds = cpu_seconds() - began
    del learned
    geometry = sum(size for name, size in _parts(data).items() if "colour" not in name)
    found = []
    for kind in ("surface", "as measured"):
        began = cpu_seconds()
        again = files.from_bytes(data)
        thick = kind == "as measured"
        if thick and not again.keeps_thickness:
            break
        decoded = again.decode(spacing, as_measured=thick)
        seconds = cpu_seconds() - began
        # The bound holds for the cloud as measured at the spacing of the model.
        kept = thick and spacing is None and isinstance(again, PatchModel)
        bound = again.max_error if kept and isinstance(again, PatchModel) else None
        found.append(Coded(len(data), geometry, encode_seconds, seconds, decoded, kind, bound))
    return found


def _parts(data: bytes) -> dict[str, int]:
    """Bytes of the sections of a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.sfb"
        path.write_bytes(data)
        return files.inspect(path).sections
