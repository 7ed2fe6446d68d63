"""Pictures of what a model keeps: both clouds from one camera, and their errors."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import AlphabetModel, KdTree, PointCloud, Quality, RecurringClasses, _html
from surfabet.errors import InvalidInputError, MissingDependencyError, wrong_value
from surfabet.io._units import small_lengths

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "PICTURE_SUFFIXES",
    "Camera",
    "choose_camera",
    "draw_cloud",
    "draw_comparison",
    "draw_errors",
    "draw_recurring",
    "draw_words",
    "point_spacing",
    "render",
    "save_page",
]

PICTURE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".pdf", ".svg", ".webp"})

BACKGROUND = 255
EMPTY = np.uint64(2**64 - 1)
# Points are projected in pieces of this many, so that memory stays small beside the cloud itself.
CHUNK = 1 << 20
# From as many sensor positions on, a cloud is taken for the work of a moving sensor.
MANY_VIEWPOINTS = 8
# Points looked at to place the camera and to learn spacing, height and intensity ranges.
SAMPLE = 100_000


@dataclass(frozen=True)
class Camera:
    """A perspective camera without distortion.

    Attributes
    ----------
    eye, target, up
        Position, the point looked at, and the direction that is upwards in the picture; metres,
        world frame.
    field_of_view
        Horizontal opening in degrees.
    keep
        Half spaces `(normal, limit)`: a point p is drawn only where `normal . p <= limit` for each.
        They cut away a ceiling or a wall that would hide a room seen from outside.
    """

    eye: NDArray[np.float64]
    target: NDArray[np.float64]
    up: NDArray[np.float64]
    field_of_view: float = 60.0
    keep: tuple[tuple[NDArray[np.float64], float], ...] = ()

    def rotation(self) -> NDArray[np.float64]:
        """World to camera: rows are the directions right, down and forward."""
        forward = self.target - self.eye
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(forward, right), forward])


def render(
    cloud: PointCloud,
    camera: Camera,
    rgb: NDArray[np.uint8],
    *,
    spacing: float,
    width: int = 960,
    height: int = 720,
) -> NDArray[np.uint8]:
    """Draws the points of a cloud as squares of the size of their spacing, nearest in front.

    Parameters
    ----------
    cloud
        What to draw.
    camera
        From where.
    rgb
        (n, 3) colours of the points.
    spacing
        Side of the squares in metres, see `point_spacing`.
    width, height
        Size of the picture in pixels.

    Returns
    -------
    numpy.ndarray
        (height, width, 3) uint8, white where nothing is, edges in depth darkened.
    """
    rotation = camera.rotation()
    focal = 0.5 * width / np.tan(np.radians(camera.field_of_view) / 2)
    # One 64-bit word per pixel: depth in the upper half, index in the lower, so the minimum is the
    # front. A positive float's bits sort as the float does.
    front = np.full(height * width, EMPTY)
    # Differences to the camera are taken in f64: clouds in map coordinates lose their detail in
    # f32.
    offset = np.asarray(cloud.origin) - camera.eye
    for start in range(0, len(cloud), CHUNK):
        ray = cloud.local_points[start : start + CHUNK] + offset
        x, y, depth = rotation @ ray.T
        kept = depth > 1e-3
        for normal, limit in camera.keep:
            kept &= ray @ normal <= limit - camera.eye @ normal
        index = np.flatnonzero(kept)
        depth = depth[index]
        column = np.floor(focal * x[index] / depth + width / 2)
        row = np.floor(focal * y[index] / depth + height / 2)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        pixel = row[inside].astype(np.int64) * width + column[inside].astype(np.int64)
        bits = depth[inside].astype(np.float32).view(np.uint32).astype(np.uint64)
        key = (bits << np.uint64(32)) | (index[inside] + start).astype(np.uint64)
        np.minimum.at(front, pixel, key)

    # Only points that are in front of their own pixel are widened to squares.
    pixel = np.flatnonzero(front != EMPTY)
    key = front[pixel]
    row, column = np.divmod(pixel, width)
    sides = np.clip(np.ceil(focal * spacing / _depth(key)), 1, 15).astype(np.int64)
    for side in np.unique(sides):
        chosen = sides == side
        for dy in range(side):
            for dx in range(side):
                r = np.clip(row[chosen] + dy - side // 2, 0, height - 1)
                c = np.clip(column[chosen] + dx - side // 2, 0, width - 1)
                np.minimum.at(front, r * width + c, key[chosen])

    drawn = front != EMPTY
    depth_image = np.full(height * width, np.inf)
    depth_image[drawn] = _depth(front[drawn])
    shade = _eye_dome(depth_image.reshape(height, width)).ravel()[drawn]
    nearest = (front[drawn] & np.uint64(0xFFFFFFFF)).astype(np.int64)
    picture = np.full((height * width, 3), BACKGROUND, np.uint8)
    picture[drawn] = rgb[nearest] * shade[:, None]
    return picture.reshape(height, width, 3)


def point_spacing(cloud: PointCloud, tree: KdTree) -> float:
    """Side in metres of a square that closes the gaps between most points and their neighbours.

    It is 1.5 times the median distance to the third neighbour, of a sample; `tree` holds the
    cloud's points.
    """
    sample = cloud.select(_sample(len(cloud), 5_000))
    distances, _ = tree.query(sample, k=min(4, len(cloud)))
    return float(1.5 * np.median(distances[:, -1]))


def _depth(key: NDArray[np.uint64]) -> NDArray[np.float32]:
    return (key >> np.uint64(32)).astype(np.uint32).view(np.float32)


def _eye_dome(depth: NDArray[np.float64], strength: float = 8.0) -> NDArray[np.float64]:
    """Eye-dome lighting: shade in 0..1, darker where neighbours lie farther before a pixel."""
    log = np.log(depth, out=np.full(depth.shape, np.inf), where=np.isfinite(depth))
    padded = np.pad(log, 1, mode="edge")
    rows, columns = depth.shape
    response = np.zeros(depth.shape)
    for dy, dx in ((0, 1), (2, 1), (1, 0), (1, 2)):
        neighbour = padded[dy : dy + rows, dx : dx + columns]
        both = np.isfinite(neighbour) & np.isfinite(log)
        response[both] += np.clip(log[both] - neighbour[both], 0, 0.1)
    return np.exp(-strength * response / 4)


def _sample(n: int, at_most: int = SAMPLE) -> NDArray[np.int64]:
    """Indices spread evenly over n points."""
    return np.linspace(0, n - 1, min(n, at_most)).astype(np.int64)


def choose_camera(cloud: PointCloud, up: ArrayLike | None = None) -> Camera:
    """A camera that shows most of a cloud.

    For a cloud that a moving sensor took, with known positions, it stands at one of them, else
    outside. From outside, faces of the bounding box that are turned to the camera and closed, as
    ceilings and walls of a room are, are cut away.

    Parameters
    ----------
    cloud
        What to look at.
    up
        The coordinate axis that points upwards, such as (0, -1, 0). By default z, unless the sensor
        moved over a space that is thin along another axis, as hand-held cameras in their own frame
        do.

    Raises
    ------
    InvalidInputError
        When the cloud is empty or `up` is no coordinate axis.
    """
    if len(cloud) == 0:
        raise InvalidInputError("the cloud is empty; there is nothing to look at")
    sample = cloud.select(_sample(len(cloud)))
    points = sample.points
    upwards = _upwards(points, sample.viewpoints) if up is None else np.asarray(up, np.float64)
    if sorted(np.abs(upwards).tolist()) != [0, 0, 1]:
        raise wrong_value("up", up, "a coordinate axis such as (0, 0, 1)")
    low, high = np.percentile(points, [0.5, 99.5], axis=0)
    seen_from = sample.viewpoints
    if seen_from is not None and len(seen_from) >= MANY_VIEWPOINTS:
        inside = np.all((seen_from >= low) & (seen_from <= high), axis=1)
        if inside.any():
            return _inside_view(points, seen_from[inside], upwards)
    return _outside_view(points, low, high, upwards)


def _upwards(
    points: NDArray[np.float64], viewpoints: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    axis, sign = 2, 1.0
    if viewpoints is not None and len(viewpoints) >= MANY_VIEWPOINTS:
        spread = viewpoints.std(axis=0)
        if spread.min() > 0:
            # Who carries a sensor moves it sideways more than up and down, and above most of what
            # it sees.
            axis = int(np.argmin(spread))
            below = np.median(points[:, axis]) <= np.median(viewpoints[:, axis])
            sign = 1.0 if below else -1.0
    up = np.zeros(3)
    up[axis] = sign
    return up


def _inside_view(
    points: NDArray[np.float64], viewpoints: NDArray[np.float64], up: NDArray[np.float64]
) -> Camera:
    """The sensor position and direction, of a few, that has most points in sight."""
    field_of_view = 75.0
    eyes = viewpoints[np.linspace(0, len(viewpoints) - 1, min(len(viewpoints), 24)).astype(int)]
    points = points[:: max(1, len(points) // 5_000)]
    first, second = np.delete(np.eye(3), np.argmax(np.abs(up)), axis=0)
    best, most = None, -1.0
    for eye in eyes:
        ray = points - eye
        distance = np.linalg.norm(ray, axis=1)
        far = distance > 0.3
        direction = ray[far] / distance[far, None]
        for angle in np.linspace(0, 2 * np.pi, 24, endpoint=False):
            forward = np.cos(angle) * first + np.sin(angle) * second - 0.25 * up
            forward /= np.linalg.norm(forward)
            in_sight = direction @ forward > np.cos(np.radians(field_of_view / 2))
            # Far points count more: a wall right before the camera is no view of the room.
            score = float(np.sqrt(distance[far][in_sight]).sum())
            if score > most:
                best, most = Camera(eye, eye + forward, up, field_of_view), score
    assert best is not None
    return best


def _outside_view(
    points: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    up: NDArray[np.float64],
) -> Camera:
    """Obliquely from above, far enough away to see all."""
    vertical = int(np.argmax(np.abs(up)))
    first, second = np.delete(np.eye(3), vertical, axis=0)
    toward_eye = 0.45 * first - 0.7 * second + 0.75 * up
    toward_eye /= np.linalg.norm(toward_eye)
    extent = np.maximum(high - low, 1e-3)
    keep = []
    for axis in range(3):
        side = np.sign(toward_eye[axis])
        along = side * points[:, axis]
        limit = (side * (high if side > 0 else low))[axis] - 0.12 * extent[axis]
        # A cloud that is thin along the axis has no inside that a face could hide.
        thick = extent[axis] > 0.1 * extent.max()
        if thick and _is_closed(np.delete(points, axis, axis=1), along > limit):
            keep.append((side * np.eye(3)[axis], float(limit)))
    camera = Camera((low + high) / 2 + toward_eye, (low + high) / 2, up, 50.0, tuple(keep))
    seen = points[np.all((points >= low) & (points <= high), axis=1)]
    for normal, limit in keep:
        seen = seen[seen @ normal <= limit]
    return _fit(camera, seen if len(seen) else points, aspect=0.75)


def _fit(camera: Camera, points: NDArray[np.float64], aspect: float) -> Camera:
    """The same direction of view, centred on the points and as near as shows them all."""
    rotation = camera.rotation()
    x, y, z = rotation @ (points - camera.target).T
    half = np.tan(np.radians(camera.field_of_view) / 2)
    shift = [(side.max() + side.min()) / 2 for side in (x, y)]
    wide = np.maximum(np.abs(x - shift[0]), np.abs(y - shift[1]) / aspect)
    distance = max(1.05 * float(np.max(wide / half - z)), 0.01)
    target = camera.target + shift[0] * rotation[0] + shift[1] * rotation[1]
    return replace(camera, eye=target - distance * rotation[2], target=target)


def _is_closed(plane: NDArray[np.float64], in_slab: NDArray[np.bool_], cells: int = 24) -> bool:
    """True when the points in the slab cover an area, and most of what all points do.

    `plane` holds the points as seen along the slab's normal, (n, 2).
    """
    low = plane.min(axis=0)
    scale = cells / np.maximum(np.ptp(plane, axis=0), 1e-9)
    cell = np.minimum((plane - low) * scale, cells - 1).astype(np.int64) @ np.array([cells, 1])
    n_covered = len(np.unique(cell))
    return n_covered > cells**2 / 4 and len(np.unique(cell[in_slab])) > 0.6 * n_covered


def draw_comparison(
    path: str | os.PathLike[str],
    reference: PointCloud,
    decoded: PointCloud,
    quality: Quality,
    *,
    camera: Camera | None = None,
) -> None:
    """Draws the original, the decoded cloud, its errors and their histogram into one picture file.

    Parameters
    ----------
    path
        File to write; the name tells the format, see `PICTURE_SUFFIXES`.
    reference, decoded
        Both clouds. They are drawn in their colours; where one has none, by intensity or else by
        height.
    quality
        What `surfabet.evaluate` gave for them, for the titles.
    camera
        From where to look, by default `choose_camera(reference)`.

    Raises
    ------
    MissingDependencyError
        Without matplotlib.
    InvalidInputError
        When a cloud is empty.
    """
    try:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError(
            "pictures need matplotlib: pip install 'surfabet[report]'"
        ) from error
    if len(reference) == 0 or len(decoded) == 0:
        raise InvalidInputError(
            f"the clouds have {len(reference)} and {len(decoded)} points; there is nothing to draw"
        )
    camera = choose_camera(reference) if camera is None else camera
    tree, decoded_tree = KdTree(reference), KdTree(decoded)
    forward = tree.query(decoded)[0].ravel()
    sample = reference.select(_sample(len(reference)))
    backward = decoded_tree.query(sample)[0].ravel()
    limit = max(float(np.percentile(forward, 99)), 1e-6)
    spacing = point_spacing(reference, tree)
    decoded_spacing = point_spacing(decoded, decoded_tree)
    rgb, decoded_rgb = _colors(reference, decoded, camera.up)
    error_rgb = _colormap(forward, 0.0, limit, "inferno")

    factor, unit = small_lengths(quality.unit)
    figure = Figure(figsize=(14, 11), layout="constrained")
    (top_left, top_right), (bottom_left, bottom_right) = figure.subplots(2, 2)
    picture = render(reference, camera, rgb, spacing=spacing)
    _show(top_left, picture, f"original: {len(reference):,} points")
    picture = render(decoded, camera, decoded_rgb, spacing=decoded_spacing)
    _show(top_right, picture, _decoded_title(decoded, quality))
    picture = render(decoded, camera, error_rgb, spacing=decoded_spacing)
    _show(bottom_left, picture, f"distance of the decoded points to the original, {unit}")
    scale = ScalarMappable(Normalize(0, factor * limit), "inferno")
    figure.colorbar(
        scale, cax=bottom_left.inset_axes((0.2, -0.06, 0.6, 0.03)), orientation="horizontal"
    )
    _histogram(bottom_right, forward, backward, limit, quality)
    figure.savefig(path, dpi=110)


def draw_cloud(
    path: str | os.PathLike[str],
    cloud: PointCloud,
    *,
    camera: Camera | None = None,
    width: int = 640,
) -> None:
    """Draws one cloud in its colours, or else by intensity or height; no axes and no title.

    Parameters
    ----------
    path
        File to write, of a format that Pillow knows by the name.
    cloud
        What to draw.
    camera
        From where to look, by default `choose_camera(cloud)`.
    width
        Width in pixels; the height is three quarters of it.

    Raises
    ------
    MissingDependencyError
        Without matplotlib.
    InvalidInputError
        When the cloud is empty.
    """
    check_pictures()
    camera = choose_camera(cloud) if camera is None else camera
    spacing = point_spacing(cloud, KdTree(cloud))
    _save(path, _render(cloud, camera, _colors(cloud, cloud, camera.up)[0], spacing, width))


def draw_errors(
    reference: PointCloud,
    decoded: PointCloud,
    limit: float,
    *paths: str | os.PathLike[str],
    width: int = 640,
) -> None:
    """Draws what was decoded, its distance to the reference, and the reference's distance to it.

    Parameters
    ----------
    reference, decoded
        Both clouds, with at least a point each.
    limit
        Distance in metres that has the brightest colour, as have all larger ones.
    paths
        Three files to write, of formats that Pillow knows by their names.
    width
        Width in pixels; the height is three quarters of it.

    Raises
    ------
    MissingDependencyError
        Without matplotlib.
    """
    check_pictures()
    camera = choose_camera(reference)
    trees = KdTree(reference), KdTree(decoded)
    spacings = point_spacing(reference, trees[0]), point_spacing(decoded, trees[1])
    forward = _colormap(trees[0].query(decoded)[0].ravel(), 0.0, limit, "inferno")
    backward = _colormap(trees[1].query(reference)[0].ravel(), 0.0, limit, "inferno")
    rgb = _colors(reference, decoded, camera.up)[1]
    for path, cloud, colors, spacing in (
        (paths[0], decoded, rgb, spacings[1]),
        (paths[1], decoded, forward, spacings[1]),
        (paths[2], reference, backward, spacings[0]),
    ):
        _save(path, _render(cloud, camera, colors, spacing, width))


def check_pictures() -> None:
    """Raises `MissingDependencyError` where pictures cannot be drawn."""
    try:
        import matplotlib  # noqa: F401
        import PIL  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError(
            "pictures need matplotlib: pip install 'surfabet[report]'"
        ) from error


def _render(
    cloud: PointCloud, camera: Camera, rgb: NDArray[np.uint8], spacing: float, width: int
) -> NDArray[np.uint8]:
    """Drawn at twice the size, so that edges are smooth when it is halved."""
    return render(cloud, camera, rgb, spacing=spacing, width=2 * width, height=3 * width // 2)


def _save(path: str | os.PathLike[str], picture: NDArray[np.uint8]) -> None:
    """Writes a picture of twice the size."""
    from PIL import Image

    Image.fromarray(picture).reduce(2).save(os.fspath(path), quality=80)


def save_page(
    path: str | os.PathLike[str],
    reference: PointCloud,
    decoded: PointCloud,
    quality: Quality,
    title: str,
    tables: Sequence[Sequence[Sequence[str]]],
) -> None:
    """Writes a comparison of two clouds as one page that needs no other file and no network.

    Parameters
    ----------
    path
        The file to write.
    reference, decoded
        Both clouds.
    quality
        What `surfabet.evaluate` gave for them.
    title
        What the page is called.
    tables
        Tables of text to show, each with its heading as the first row.

    Raises
    ------
    MissingDependencyError
        Without matplotlib.
    InvalidInputError
        When a cloud is empty.
    """
    check_pictures()
    from matplotlib.figure import Figure

    limit = max(quality.p99_forward, quality.p99_backward, 1e-6)
    with tempfile.TemporaryDirectory() as folder:
        names = [os.path.join(folder, f"{n}.webp") for n in range(4)]
        draw_cloud(names[0], reference)
        draw_errors(reference, decoded, limit, *names[1:])
        pictures = [Path(name).read_bytes() for name in names]
    forward, backward = _distances(reference, decoded)
    figure = Figure(figsize=(10, 4.5), layout="constrained")
    _histogram(figure.subplots(), forward, backward, limit, quality)
    factor, unit = small_lengths(quality.unit)
    shade = f"black 0, bright {factor * limit:.3g} {unit} and more"
    captions = (
        f"original: {len(reference):,} points",
        _decoded_title(decoded, quality),
        f"decoded, by its distance to the original: {shade}",
        f"original, by its distance to the decoded: {shade}",
    )
    drawn = "".join(
        _html.picture(data, caption) for data, caption in zip(pictures, captions, strict=True)
    )
    body = [
        *(_html.table(table[0], table[1:]) for table in tables),
        f'<h2>Pictures</h2><div class="pictures">{drawn}</div><div class="scale"></div>',
        f'<h2>Errors</h2><div class="plot">{_html.svg(figure)}</div>',
    ]
    Path(path).write_text(_html.page(title, "\n".join(body)), "utf-8")


def _distances(
    reference: PointCloud, decoded: PointCloud
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Distances of decoded points to the reference, and of a sample of the reference to them."""
    sample = reference.select(_sample(len(reference)))
    return KdTree(reference).query(decoded)[0].ravel(), KdTree(decoded).query(sample)[0].ravel()


def _decoded_title(decoded: PointCloud, quality: Quality) -> str:
    title = f"decoded: {len(decoded):,} points"
    if quality.bytes is not None:
        title += f" from {quality.bytes:,} bytes"
    if quality.color_rmse_pooled is not None:
        title += f", colour rmse {quality.color_rmse_pooled:.1f}"
    return title


def _show(axes: Axes, picture: NDArray[np.uint8], title: str) -> None:
    axes.imshow(picture, interpolation="lanczos")
    axes.set_title(title)
    axes.set_axis_off()


def _histogram(
    axes: Axes,
    forward: NDArray[np.floating],
    backward: NDArray[np.floating],
    limit: float,
    quality: Quality,
) -> None:
    factor, unit = small_lengths(quality.unit)
    bins = np.linspace(0, factor * max(limit, float(np.percentile(backward, 99))), 80).tolist()
    for distances, label in (
        (forward, f"decoded to original, rmse {factor * quality.rmse_forward:.2f} {unit}"),
        (backward, f"original to decoded, rmse {factor * quality.rmse_backward:.2f} {unit}"),
    ):
        weights = np.full(len(distances), 100 / len(distances))
        axes.hist(factor * distances, bins=bins, weights=weights, histtype="step", label=label)
    axes.set_xlabel(f"distance to the nearest point of the other cloud, {unit}")
    axes.set_ylabel("share of the points, %")
    rmse, pooled = factor * quality.rmse, factor * quality.rmse_pooled
    axes.set_title(f"rmse {rmse:.2f} {unit}, pooled {pooled:.2f} {unit}")
    axes.legend()


def _colors(
    reference: PointCloud, decoded: PointCloud, up: NDArray[np.float64]
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """(n, 3) colours of both clouds after the best attribute that both have."""
    if reference.colors is not None and decoded.colors is not None:
        return reference.colors, decoded.colors
    if reference.intensities is not None and decoded.intensities is not None:
        name = "gray"
        values = [reference.intensities, decoded.intensities]
    else:
        name = "viridis"
        axis = int(np.argmax(np.abs(up)))
        values = [up[axis] * c.local_points[:, axis] + up @ c.origin for c in (reference, decoded)]
    low, high = np.percentile(values[0][_sample(len(reference))], [1, 99])
    first, second = (_colormap(v, float(low), float(high), name) for v in values)
    return first, second


def _colormap(
    values: NDArray[np.floating], low: float, high: float, name: str
) -> NDArray[np.uint8]:
    from matplotlib import colormaps

    scaled = np.clip((values - low) / max(high - low, 1e-9), 0, 1)
    table = (255 * colormaps[name](np.linspace(0, 1, 256))[:, :3]).astype(np.uint8)
    rgb: NDArray[np.uint8] = table[(255 * scaled).astype(np.uint8)]
    return rgb


def draw_words(path: str | os.PathLike[str], model: AlphabetModel) -> None:
    """Draws the words of an alphabet, the most frequent first, with how often each occurs.

    Parameters
    ----------
    path
        File to write; the name tells the format, see `PICTURE_SUFFIXES`.
    model
        The model whose words to draw: heights from half a radius below to half a radius above
        the word's plane, holes in white.

    Raises
    ------
    MissingDependencyError
        Without matplotlib.
    """
    heights, counts = model.alphabet.heights, model.counts
    columns = min(len(counts), 8)
    rows = -(-len(counts) // columns)
    figure = _new_figure(1.4 * columns + 0.8, 1.65 * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for place in axes:
        place.axis("off")
    for place, word in zip(axes, np.argsort(-counts, kind="stable"), strict=False):
        shown = place.imshow(heights[word], origin="lower", vmin=-0.5, vmax=0.5, cmap="RdBu")
        place.set_title(f"word {word}\n{counts[word]:,} times", fontsize=8)
    figure.colorbar(shown, ax=axes, label="height / radius", shrink=0.8)
    figure.savefig(os.fspath(path), dpi=110)


def draw_recurring(
    path: str | os.PathLike[str],
    scene: AlphabetModel,
    classes: RecurringClasses,
    *,
    most: int = 6,
    resolution: float = 0.012,
) -> None:
    """Draws what recurs in a scene: a row per class, first the thing that stands for it.

    Parameters
    ----------
    path
        File to write; the name tells the format, see `PICTURE_SUFFIXES`.
    scene, classes
        The scene and its classes, of `surfabet.recurring`. Every place is turned as the first.
    most
        Places that are drawn of each class.
    resolution
        Spacing of the points that are drawn, metres.

    Raises
    ------
    MissingDependencyError
        Without matplotlib.
    """
    rows = max(len(classes), 1)
    figure = _new_figure(1.8 * most, 1.9 * rows)
    cloud = scene.decode(resolution)
    points = cloud.points
    rgb = _colors(cloud, cloud, np.array([0.0, 0.0, 1.0]))[0]
    cells = figure.subplots(rows, most, squeeze=False)
    for axes in cells.flat:
        axes.set_axis_off()
    for k, of_class in enumerate(classes):
        reach = 0.5 * float(np.linalg.norm(of_class.box[1] - of_class.box[0]))
        eye = reach * np.array([2.2, -2.2, 1.8])
        camera = Camera(eye, np.zeros(3), np.array([0.0, 0.0, 1.0]), 40.0)
        for i, place in enumerate(of_class.places[:most]):
            inside = place.mask(points, margin=0.0)
            local = (points[inside] - place.center) @ place.pose[:3, :3]
            if len(local) == 0:
                continue
            picture = render(
                PointCloud(local), camera, rgb[inside], spacing=resolution, width=240, height=240
            )
            title = f"class {k}, {len(of_class)} times" if i == 0 else f"{place.score:.2f}"
            _show(cells[k, i], picture, title)
            cells[k, i].title.set_fontsize(8)
    figure.savefig(path, dpi=110)


def _new_figure(width: float, height: float) -> Figure:
    """An empty figure of matplotlib, inches; nothing imports it before a picture is drawn."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError(
            "pictures need matplotlib: pip install 'surfabet[report]'"
        ) from error
    return Figure(figsize=(width, height), layout="constrained")
