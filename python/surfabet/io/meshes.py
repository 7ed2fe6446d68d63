"""Meshes with colours for other programs: PLY, OBJ, glTF."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from surfabet.io._files import optional_module, written_whole

if TYPE_CHECKING:
    from surfabet.meshes import Mesh

__all__ = ["WRITERS"]


def write_ply(path: Path, mesh: Mesh) -> None:
    """Binary PLY: vertices in double precision."""
    channels = () if mesh.colors is None else ("red", "green", "blue")
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "comment written by surfabet; metres",
        f"element vertex {len(mesh.vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        *(f"property uchar {channel}" for channel in channels),
        f"element face {len(mesh.triangles)}",
        "property list uchar int vertex_indices",
        "end_header",
        "",
    ]
    vertices = np.zeros(
        len(mesh.vertices), [("at", "<f8", 3), *((name, "u1") for name in channels)]
    )
    vertices["at"] = mesh.vertices
    if mesh.colors is not None:
        for k, name in enumerate(channels):
            vertices[name] = mesh.colors[:, k]
    faces = np.zeros(len(mesh.triangles), [("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, mesh.triangles
    with written_whole(path) as temporary, temporary.open("xb") as file:
        file.write("\n".join(lines).encode("ascii"))
        vertices.tofile(file)
        faces.tofile(file)


def write_obj(path: Path, mesh: Mesh) -> None:
    """OBJ: colours behind the coordinates, 0 to 1, as most programs read them.

    Coordinates have as many digits as it takes to read back the same.
    """
    with written_whole(path) as temporary, temporary.open("x", encoding="ascii") as file:
        file.write("# written by surfabet; metres\n")
        if mesh.colors is None:
            for x, y, z in mesh.vertices.tolist():
                file.write(f"v {x!r} {y!r} {z!r}\n")
        else:
            shades = (mesh.colors / 255).tolist()
            for (x, y, z), (r, g, b) in zip(mesh.vertices.tolist(), shades, strict=True):
                file.write(f"v {x!r} {y!r} {z!r} {r:.4g} {g:.4g} {b:.4g}\n")
        np.savetxt(file, mesh.triangles.astype(np.int64) + 1, "f %d %d %d")


def write_glb(path: Path, mesh: Mesh) -> None:
    """glTF in one file. Its numbers are single precision and its y is upwards: a node holds the
    turn from z upwards, and the place in the world."""
    trimesh = optional_module("trimesh", "surfabet[mesh]", "writing glTF")
    middle = np.zeros(3)
    if len(mesh.vertices):
        middle = np.round((mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2)
    colors = None if mesh.colors is None else _linear(mesh.colors)
    surface = trimesh.Trimesh(
        mesh.vertices - middle,
        mesh.triangles.astype(np.int64),
        vertex_colors=colors,
        process=False,
    )
    upright = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    place = np.eye(4)
    place[:3, 3] = middle
    scene = trimesh.Scene()
    scene.add_geometry(surface, node_name="surfabet", transform=upright @ place)
    data = scene.export(file_type="glb")
    with written_whole(path) as temporary:
        temporary.write_bytes(data)


def _linear(colors: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Shares of light of colours of the screen (sRGB), with alpha: colours of glTF's vertices."""
    values = np.arange(256) / 255
    light = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    table = np.rint(255 * light).astype(np.uint8)
    opaque: NDArray[np.uint8] = np.full((len(colors), 4), 255, np.uint8)
    opaque[:, :3] = table[colors]
    return opaque


WRITERS: dict[str, Callable[[Path, Mesh], None]] = {
    ".ply": write_ply,
    ".obj": write_obj,
    ".glb": write_glb,
}
"""What writes a mesh, by the ending of the file's name."""
