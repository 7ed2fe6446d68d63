"""Draws the picture of the gas guide: python docs/gas_pictures.py SCAN [FOLDER]

SCAN is the Kinect frame `rgbd_frame/table.pcd` of `../shared/data`. Needs matplotlib.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

import surfabet as sb
from surfabet import report

NEURONS = 2000
SPACING = 0.004


def main() -> None:
    cloud = sb.read(sys.argv[1])
    folder = Path(sys.argv[2] if len(sys.argv) > 2 else Path(__file__).parent / "pictures")
    model = sb.learn_gas(cloud, n_neurons=NEURONS)
    print(model)
    # As the sensor saw it, which stood at the origin with y upwards.
    target = cloud.points.mean(axis=0)
    camera = report.Camera(np.zeros(3), target, np.array([0.0, 1.0, 0.0]), field_of_view=56)
    neurons = model.neurons
    ray = (neurons.positions - camera.eye) @ camera.rotation().T
    flat, depth = ray[:, :2] / ray[:, 2:], ray[:, 2]
    colors = (np.full((len(model), 3), 90) if neurons.colors is None else neurons.colors) / 255
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.6))

    edges = model.edges[np.argsort(-depth[model.edges].mean(axis=1))]
    lines = LineCollection(flat[edges], colors=colors[edges].mean(axis=1), linewidths=0.8)
    axes[0].add_collection(lines)
    axes[0].set_title(f"{len(model):,} neurons, {len(edges):,} edges")

    mesh = model.mesh().triangles
    mesh = mesh[np.argsort(-depth[mesh].mean(axis=1))]
    p, q, r = (neurons.positions[mesh[:, i]] for i in range(3))
    normals = np.cross(q - p, r - p)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    light = np.abs(normals @ np.array([0.3, 0.5, 0.81]))
    shade = np.repeat((0.25 + 0.7 * light)[:, None], 3, axis=1)
    faces = PolyCollection(flat[mesh], facecolors=shade, edgecolors="#44444455", linewidths=0.3)
    axes[1].add_collection(faces)
    axes[1].set_title(f"{len(mesh):,} triangles")

    decoded = model.decode(SPACING)
    rgb = decoded.colors if decoded.colors is not None else np.full((len(decoded), 3), 90, np.uint8)
    axes[2].imshow(report.render(decoded, camera, rgb, spacing=SPACING * 1.1))
    axes[2].set_title(f"decoded at {1e3 * SPACING:g} mm: {len(decoded):,} points")
    axes[2].axis("off")
    for axis in axes[:2]:
        frame(axis, camera)
    figure.tight_layout()
    figure.savefig(folder / "gas.png", dpi=75)


def frame(axis: Axes, camera: report.Camera) -> None:
    """What the camera sees, as the rendering shows it."""
    half = np.tan(np.radians(camera.field_of_view) / 2)
    axis.set_xlim(-half, half)
    axis.set_ylim(0.75 * half, -0.75 * half)
    axis.set_aspect("equal")
    axis.axis("off")


if __name__ == "__main__":
    main()
