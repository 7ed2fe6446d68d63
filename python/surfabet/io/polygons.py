"""Flat surfaces for other programs: PLY mesh, OBJ, DXF, glTF.

Coordinates are the world's, in double precision.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surfabet.io import meshes
from surfabet.io._files import optional_module, written_whole
from surfabet.meshes import Mesh

METRES = 6
"""The unit as DXF numbers it."""


@dataclass(frozen=True)
class Surface:
    """Triangles in several parts, with polygons around each part."""

    vertices: NDArray[np.float64]
    """World positions, (m, 3), metres."""
    triangles: NDArray[np.uint32]
    """Rows of three vertices, (t, 3)."""
    parts: NDArray[np.uint32]
    """The part of each triangle, (t,), ascending."""
    n_parts: int
    """Number of parts."""
    polygons: Callable[[int], list[NDArray[np.float64]]]
    """Rings around a part, each (k, 3)."""
    colors: NDArray[np.uint8] | None
    """A colour per part, (n_parts, 3), or None."""

    def triangles_of(self, part: int) -> NDArray[np.uint32]:
        """The triangles of one part."""
        first, end = np.searchsorted(self.parts, [part, part + 1])
        return self.triangles[first:end]


def name(part: int) -> str:
    """What a part is called."""
    return f"plane_{part:04d}"


def write_ply(path: Path, surface: Surface) -> None:
    """Binary PLY: vertices in double precision, faces with the number of their part."""
    colored = surface.colors is not None
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "comment written by surfabet; metres",
        f"element vertex {len(surface.vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(surface.triangles)}",
        "property list uchar int vertex_indices",
        "property int plane",
        *(f"property uchar {channel}" for channel in ("red", "green", "blue") if colored),
        "end_header",
        "",
    ]
    fields = [("n", "u1"), ("corners", "<i4", 3), ("plane", "<i4")]
    faces = np.zeros(len(surface.triangles), [*fields, *([("color", "u1", 3)] if colored else [])])
    faces["n"], faces["corners"], faces["plane"] = 3, surface.triangles, surface.parts
    if surface.colors is not None:
        faces["color"] = surface.colors[surface.parts]
    with written_whole(path) as temporary, temporary.open("xb") as file:
        file.write("\n".join(lines).encode("ascii"))
        surface.vertices.astype("<f8").tofile(file)
        faces.tofile(file)


def write_obj(path: Path, surface: Surface) -> None:
    """OBJ: an object per part, its triangles as faces, the polygons around it as closed lines.

    Numbers have as many digits as it takes to read back the same.
    """
    # Numbers of vertices start at one and go on from object to object.
    count = 1
    with written_whole(path) as temporary, temporary.open("x", encoding="ascii") as file:
        file.write("# written by surfabet; metres\n")
        for part in range(surface.n_parts):
            triangles = surface.triangles_of(part)
            used, corners = np.unique(triangles, return_inverse=True)
            rings = surface.polygons(part)
            file.write(f"o {name(part)}\n")
            for x, y, z in np.concatenate([surface.vertices[used], *rings]).tolist():
                file.write(f"v {x!r} {y!r} {z!r}\n")
            for a, b, c in (corners.reshape(-1, 3) + count).tolist():
                file.write(f"f {a} {b} {c}\n")
            count += len(used)
            for ring in rings:
                along = [*range(count, count + len(ring)), count]
                file.write("l " + " ".join(map(str, along)) + "\n")
                count += len(ring)


def write_dxf(path: Path, surface: Surface) -> None:
    """DXF: a layer per part, with its triangles as 3D faces and the polygons as 3D polylines."""
    ezdxf = optional_module("ezdxf", "ezdxf>=1.1", "writing DXF")
    drawing = ezdxf.new("R2010", units=METRES)
    space = drawing.modelspace()
    for part in range(surface.n_parts):
        layer = drawing.layers.add(name(part))
        if surface.colors is not None:
            layer.rgb = tuple(surface.colors[part].tolist())
        on_layer = {"layer": name(part)}
        for corners in surface.vertices[surface.triangles_of(part)].tolist():
            space.add_3dface(corners, dxfattribs=on_layer)
        for ring in surface.polygons(part):
            space.add_polyline3d(ring.tolist(), close=True, dxfattribs=on_layer)
    with written_whole(path) as temporary:
        drawing.saveas(temporary)


def write_glb(path: Path, surface: Surface) -> None:
    """glTF: the triangles, with the colour of its part at every vertex."""
    shades = None
    if surface.colors is not None:
        shades = np.zeros((len(surface.vertices), 3), np.uint8)
        shades[surface.triangles] = surface.colors[surface.parts][:, None]
    meshes.write_glb(path, Mesh(surface.vertices, surface.triangles, shades))


WRITERS: dict[str, Callable[[Path, Surface], None]] = {
    ".ply": write_ply,
    ".obj": write_obj,
    ".dxf": write_dxf,
    ".glb": write_glb,
}
"""What writes a surface, by the ending of the file's name."""
