"""Triangles of a model, with colours, for other programs."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["MESH_SUFFIXES", "Mesh"]

MESH_SUFFIXES = frozenset({".ply", ".obj", ".glb"})
"""Endings of the files that meshes are written to."""


@dataclass(frozen=True, slots=True)
class Mesh:
    """A surface as triangles."""

    vertices: NDArray[np.float64]
    """World positions, (m, 3), metres."""
    triangles: NDArray[np.uint32]
    """Rows of three vertices, (t, 3), anticlockwise seen from where the surface was seen."""
    colors: NDArray[np.uint8] | None = None
    """Colours of the vertices, (m, 3), 0 to 255; None without."""

    @property
    def area(self) -> float:
        """Of all triangles, square metres."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)

    def export(self, path: str | os.PathLike[str]) -> int:
        """Writes the mesh and returns the size of the file in bytes.

        An existing file is replaced only when the new one is complete.

        Parameters
        ----------
        path
            Its ending tells the format. `.ply`: binary, double precision. `.obj`: text, with
            colours behind the coordinates. `.glb`: glTF, single precision about a node that holds
            the place in the world, y upwards; needs trimesh.

        Raises
        ------
        InvalidInputError
            For another ending.
        MissingDependencyError
            For `.glb` without trimesh: `pip install 'surfabet[mesh]'`.
        OSError
            When the file cannot be written.
        """
        from surfabet.io._files import export
        from surfabet.io.meshes import WRITERS

        return export(path, self, WRITERS)
