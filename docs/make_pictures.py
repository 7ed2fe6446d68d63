"""Draws the pictures of the guides from simulated rooms: python docs/make_pictures.py [FOLDER]

Needs surfabet with its extra `report`, and Pillow. Prints the figures that the guides quote.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray
from PIL import Image

import surfabet as sb
from surfabet import datasets, report

WIDTH, HEIGHT = 520, 390
# Width of the two clouds of the README, pixels.
COMPARISON = 1200
# Side of a drawn point, metres: one for all clouds, so that none looks denser than it is.
SPACING = 0.012
MARGIN = 8
ENTRIES = 64


# One level, SCSM, with dictionaries of the sizes that the page states.
ONE: dict[str, Any] = {"levels": 1, "depth_atoms": 128, "color_atoms": 256}


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "pictures")
    folder.mkdir(parents=True, exist_ok=True)
    scan = datasets.load_demo()
    cloud = scan.cloud
    camera = report.choose_camera(cloud)
    comparison(folder / "demo.png", cloud)
    for resolution in (0.04, 0.02, 0.01):
        model = sb.learn_hscsm(cloud, resolution=resolution, **ONE)
        decoded = model.decode()
        print_figures(scan, model, decoded)
    # The last one, at 1 cm, is drawn.
    views = [draw(cloud, colors_of(cloud), camera), draw(decoded, colors_of(decoded), camera)]
    save(folder / "room.png", beside(views), colors=80)

    exact = datasets.simulated_room(n_poses=18, noise=0, pose_error=0)
    model = sb.learn_hscsm(exact.cloud, resolution=0.01, **ONE)
    decoded = model.decode()
    print_figures(exact, model, decoded)
    views = [
        draw(decoded, colors_of(decoded), camera),
        draw(decoded, patch_colors(model, decoded), camera),
    ]
    save(folder / "patches.png", beside(views), colors=96)
    depth = entries_by_use(model, "depth")
    tiles = [colormapped(entry.reshape(8, 8)) for entry in depth[:ENTRIES]]
    save(folder / "depth_dictionary.png", mosaic(tiles), colors=256)
    color = entries_by_use(model, "color")
    tiles = [as_rgb(entry.reshape(3, 8, 8)) for entry in color[:ENTRIES]]
    save(folder / "color_dictionary.png", mosaic(tiles), colors=256)


def comparison(path: Path, cloud: sb.PointCloud) -> None:
    """The clouds of the README: those of the picture that `surfabet evaluate` draws."""
    model = sb.learn_patches(cloud)
    decoded = model.decode(as_measured=True)
    quality = sb.evaluate(cloud, decoded, bytes=len(model.to_bytes()))
    print(f"{model}\n  {quality}")
    with TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.png"
        report.draw_comparison(whole, cloud, decoded, quality)
        picture = Image.open(whole).convert("RGB")
    clouds = picture.crop((0, 0, picture.width, picture.height * 19 // 40))
    height = COMPARISON * clouds.height // clouds.width
    save(path, np.asarray(clouds.resize((COMPARISON, height))), colors=256)


def print_figures(
    scan: datasets.SimulatedScan, model: sb.HscsmModel, decoded: sb.PointCloud
) -> None:
    """Size, and errors against the scan and against the room itself."""
    n_bytes = len(model.to_bytes())
    quality = sb.evaluate(scan.cloud, decoded, normal_neighbors=None, bytes=n_bytes)
    truth = [
        float(np.sqrt(np.mean(np.square(scan.scene.distance(points)))))
        for points in (scan.cloud.points, decoded.points)
    ]
    per_patch = model.masks().sum() / len(model)
    print(f"{model}\n  {per_patch:.1f} set pixels per patch\n  {quality}")
    print(f"  ratio {quality.ratio:.1f}")
    print(
        f"  rms distance to the room: scan {1000 * truth[0]:.2f}, decoded {1000 * truth[1]:.2f} mm"
    )


def colors_of(cloud: sb.PointCloud) -> NDArray[np.uint8]:
    assert cloud.colors is not None  # the simulated camera sees colours
    return cloud.colors


def draw(cloud: sb.PointCloud, rgb: NDArray[np.uint8], camera: report.Camera) -> NDArray[np.uint8]:
    return report.render(cloud, camera, rgb, spacing=SPACING, width=WIDTH, height=HEIGHT)


def patch_colors(model: sb.HscsmModel, decoded: sb.PointCloud) -> NDArray[np.uint8]:
    """A random colour per patch; `decoded` is `model.decode()`: four points per set pixel."""
    points_per_patch = 4 * model.masks().sum(axis=(1, 2))
    assert points_per_patch.sum() == len(decoded)
    palette = (255 * np.array(colormaps["tab20"].colors)).astype(np.uint8)
    chosen = np.random.default_rng(0).integers(len(palette), size=len(model))
    return np.repeat(palette[chosen], points_per_patch, axis=0)


def entries_by_use(model: sb.HscsmModel, channel: sb.patches.Channel) -> NDArray[np.float32]:
    """Dictionary entries, those that most patches use first."""
    entries = model.dictionary.concatenated(channel)[0]
    _, used, _ = model.codes(channel=channel)
    count = np.bincount(used, minlength=len(entries))
    return entries[np.argsort(-count, kind="stable")]


def colormapped(entry: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Depth from blue through white (the mean) to red; the entry's sign is arbitrary."""
    scaled = 0.5 + 0.5 * entry / np.abs(entry).max()
    return (255 * colormaps["RdBu_r"](scaled)[..., :3]).astype(np.uint8)


def as_rgb(entry: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colours about middle grey; the entry's sign is arbitrary."""
    scaled = 127.5 + 127.5 * entry / np.abs(entry).max()
    return np.moveaxis(scaled, 0, -1).astype(np.uint8)


def mosaic(tiles: list[NDArray[np.uint8]], columns: int = 16, zoom: int = 5) -> NDArray[np.uint8]:
    """Square tiles in rows, on white."""
    side = zoom * len(tiles[0]) + 4
    rows = -(-len(tiles) // columns)
    canvas = np.full((rows * side, columns * side, 3), 255, np.uint8)
    for k, tile in enumerate(tiles):
        large = tile.repeat(zoom, axis=0).repeat(zoom, axis=1)
        y, x = k // columns * side + 2, k % columns * side + 2
        canvas[y : y + len(large), x : x + len(large)] = large
    return canvas


def beside(pictures: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    gap = np.full((HEIGHT, MARGIN, 3), 255, np.uint8)
    return np.concatenate([pictures[0], gap, pictures[1]], axis=1)


def save(path: Path, picture: NDArray[np.uint8], colors: int) -> None:
    """As PNG with a palette, which is a third of the size in true colour."""
    image = Image.fromarray(picture).quantize(colors, dither=Image.Dither.NONE)
    image.save(path, optimize=True)
    print(f"{path.stat().st_size:9d} bytes  {path}")


if __name__ == "__main__":
    main()
