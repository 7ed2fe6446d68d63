"""Pictures of what a model keeps: the original and the decoded cloud from one camera, and their errors."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from surfabet import KdTree, PointCloud, Quality
from surfabet.errors import InvalidInputError, MissingDependencyError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["PICTURE_SUFFIXES", "Camera", "choose_camera", "draw_comparison", "render"]

PICTURE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".pdf", ".svg", ".webp"})

BACKGROUND = 255
# Points are projected in pieces of this many, so that memory stays small beside the cloud itself.
CHUNK = 1 << 20
# Points looked at to place the camera and to learn spacing, height and intensity ranges.
SAMPLE = 100_000


@dataclass(frozen=True)
class Camera:
    """A perspective camera without distortion.

    Attributes
    ----------
    eye, target, up
        Position, the point looked at, and the direction that is upwards in the picture; metres, world frame.
    field_of_view
        Horizontal opening in degrees.
    keep
        Half spaces `(normal, limit)`: a point p is drawn only where `normal . p <= limit` for each. They cut
        away a ceiling or a wall that would hide a room seen from outside.
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
    width, height
        Size of the picture in pixels.

    Returns
    -------
    numpy.ndarray
        (height, width, 3) uint8, white where nothing is, edges in depth darkened.
    """
    rotation = camera.rotation()
    focal = 0.5 * width / np.tan(np.radians(camera.field_of_view) / 2)
    spacing = _spacing(cloud)
    # One 64-bit word per pixel: depth in the upper half, index in the lower, so the minimum is the front.
    # A positive float's bits sort as the float does.
    front = np.full(height * width, np.iinfo(np.uint64).max, np.uint64)
    local = cloud.local_points
    # Differences to the camera are taken in f64: clouds in map coordinates lose their detail in f32.
    offset = np.asarray(cloud.origin) - camera.eye
    for start in range(0, len(cloud), CHUNK):
        world = local[start : start + CHUNK] + offset
        kept = np.ones(len(world), bool)
        for normal, limit in camera.keep:
            kept &= world @ normal <= limit - camera.eye @ normal
        x, y, depth = rotation @ world.T
        kept &= depth > 1e-3
        index = np.flatnonzero(kept)
        depth = depth[index]
        column = np.floor(focal * x[index] / depth + width / 2)
        row = np.floor(focal * y[index] / depth + height / 2)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        index, depth = index[inside], depth[inside]
        column, row = column[inside].astype(np.int64), row[inside].astype(np.int64)
        size = np.clip(np.ceil(focal * spacing / depth), 1, 7).astype(np.int64)
        bits = depth.astype(np.float32).view(np.uint32).astype(np.uint64)
        key = (bits << np.uint64(32)) | (index + start).astype(np.uint64)
        for side in range(1, int(size.max(initial=0)) + 1):
            chosen = size == side
            for dy in range(side):
                for dx in range(side):
                    r = np.clip(row[chosen] + dy - side // 2, 0, height - 1)
                    c = np.clip(column[chosen] + dx - side // 2, 0, width - 1)
                    np.minimum.at(front, r * width + c, key[chosen])

    drawn = front != np.iinfo(np.uint64).max
    picture = np.full((height * width, 3), BACKGROUND, np.uint8)
    z = np.full(height * width, np.inf)
    z[drawn] = (front[drawn] >> np.uint64(32)).astype(np.uint32).view(np.float32)
    shade = _eye_dome(z.reshape(height, width)).ravel()[drawn]
    nearest = (front[drawn] & np.uint64(0xFFFFFFFF)).astype(np.int64)
    picture[drawn] = rgb[nearest] * shade[:, None]
    return picture.reshape(height, width, 3)


def _eye_dome(depth: NDArray[np.float64], strength: float = 8.0) -> NDArray[np.float64]:
    """Shade in 0..1 that darkens a pixel by how far its neighbours lie before it (eye-dome lighting)."""
    log = np.log(depth, out=np.full(depth.shape, np.inf), where=np.isfinite(depth))
    padded = np.pad(log, 1, mode="edge")
    rows, columns = depth.shape
    response = np.zeros(depth.shape)
    for dy, dx in ((0, 1), (2, 1), (1, 0), (1, 2)):
        neighbour = padded[dy : dy + rows, dx : dx + columns]
        both = np.isfinite(neighbour) & np.isfinite(log)
        response[both] += np.clip(log[both] - neighbour[both], 0, 0.1)
    return np.exp(-strength * response / 4)


def _sample(n: int) -> NDArray[np.int64]:
    return np.linspace(0, n - 1, min(n, SAMPLE)).astype(np.int64)


def _spacing(cloud: PointCloud) -> float:
    """Side of a square that closes the gaps between most points and their neighbours."""
    if len(cloud) < 2:
        return 0.01
    tree = KdTree(cloud)
    sample = cloud.select(_sample(len(cloud))[:: max(1, SAMPLE // 5_000)])
    distances, _ = tree.query(sample.points, k=min(4, len(cloud)))
    return float(1.5 * np.median(distances[:, -1]))


def choose_camera(cloud: PointCloud) -> Camera:
    """A camera that shows most of a cloud: from one of its sensor positions where known, else from outside.

    From outside, faces of the bounding box that are turned to the camera and closed, as ceilings and walls of
    a room are, are cut away. Upwards is z, unless the sensor moved over a space that is thin along another
    axis, as hand-held cameras in their own frame do.
    """
    if len(cloud) == 0:
        raise InvalidInputError("the cloud is empty; there is nothing to look at")
    sample = cloud.select(_sample(len(cloud)))
    points = sample.points
    up = _upwards(points, sample.viewpoints)
    low, high = np.percentile(points, [0.5, 99.5], axis=0)
    if sample.viewpoints is not None and sample.viewpoint_index is not None:
        seen_from = sample.viewpoints
        inside = np.all((seen_from >= low) & (seen_from <= high), axis=1)
        if inside.any():
            return _inside_view(points, seen_from[inside], up)
    return _outside_view(points, low, high, up)


def _upwards(
    points: NDArray[np.float64], viewpoints: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    axis, sign = 2, 1.0
    if viewpoints is not None and len(viewpoints) >= 8:
        spread = viewpoints.std(axis=0)
        if spread.min() > 0:
            # Who carries a sensor moves it sideways more than up and down, and above most of what it sees.
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
        if _is_closed(np.delete(points, axis, axis=1), along > limit):
            keep.append((side * np.eye(3)[axis], float(limit)))
    center = (low + high) / 2
    distance = 1.0 * float(np.linalg.norm(extent))
    return Camera(center + distance * toward_eye, center, up, 55.0, tuple(keep))


def _is_closed(plane: NDArray[np.float64], in_slab: NDArray[np.bool_], cells: int = 24) -> bool:
    """True when the points in the slab cover most of what all points cover, seen along the slab's normal."""
    low = plane.min(axis=0)
    scale = cells / np.maximum(np.ptp(plane, axis=0), 1e-9)
    cell = np.minimum((plane - low) * scale, cells - 1).astype(np.int64) @ np.array([cells, 1])
    return len(np.unique(cell[in_slab])) > 0.6 * len(np.unique(cell))


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
        Both clouds. They are drawn in their colours; where one has none, by intensity or else by height.
    quality
        What `surfabet.evaluate` said of them, for the titles.
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
    forward = KdTree(reference).query(decoded.points, k=1)[0].ravel()
    backward_sample = reference.select(_sample(len(reference)))
    backward = KdTree(decoded).query(backward_sample.points, k=1)[0].ravel()
    limit = max(float(np.percentile(forward, 99)), 1e-6)

    figure = Figure(figsize=(14, 11), layout="constrained")
    panels = figure.subplots(2, 2)
    rgb_reference, rgb_decoded = _colors(reference, decoded, camera.up)
    _show(panels[0, 0], render(reference, camera, rgb_reference), f"original: {len(reference):,} points")
    _show(panels[0, 1], render(decoded, camera, rgb_decoded), _decoded_title(decoded, quality))
    errors = _colormap(forward, 0.0, limit, "inferno")
    _show(panels[1, 0], render(decoded, camera, errors), "distance of decoded points to the original")
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    scale = ScalarMappable(Normalize(0, 1000 * limit), "inferno")
    figure.colorbar(scale, ax=panels[1, 0], location="bottom", shrink=0.6, label="mm")
    _histogram(panels[1, 1], forward, backward, limit, quality)
    figure.savefig(path, dpi=110)


def _decoded_title(decoded: PointCloud, quality: Quality) -> str:
    title = f"decoded: {len(decoded):,} points"
    if quality.bytes is not None:
        title += f" from {quality.bytes:,} bytes"
    if quality.color_rmse is not None:
        title += f", colour rmse {quality.color_rmse:.1f}"
    return title


def _show(axes: Axes, picture: NDArray[np.uint8], title: str) -> None:
    axes.imshow(picture, interpolation="lanczos")
    axes.set_title(title)
    axes.set_axis_off()


def _histogram(
    axes: Axes,
    forward: NDArray[np.float64],
    backward: NDArray[np.float64],
    limit: float,
    quality: Quality,
) -> None:
    bins = np.linspace(0, 1000 * max(limit, float(np.percentile(backward, 99))), 80)
    for distances, label in (
        (forward, f"decoded to original, rmse {1000 * quality.rmse_forward:.2f} mm"),
        (backward, f"original to decoded, rmse {1000 * quality.rmse_backward:.2f} mm"),
    ):
        weights = np.full(len(distances), 100 / len(distances))
        axes.hist(1000 * distances, bins=bins, weights=weights, histtype="step", label=label)
    axes.set_xlabel("distance to the nearest point of the other cloud, mm")
    axes.set_ylabel("share of the points, %")
    axes.set_title(f"rmse {1000 * quality.rmse:.2f} mm, pooled {1000 * quality.rmse_pooled:.2f} mm")
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
    return table[(255 * scaled).astype(np.uint8)]
