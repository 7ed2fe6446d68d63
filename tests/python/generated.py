"""Scans made here: small twins of the real ones that the tests take from outside the repository."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

DATA = Path(__file__).parents[2].parent / "shared" / "data"
"""Real scans, where they are."""
WITHOUT_DATA = f"the real scans are not at {DATA}; a generated twin is tested"


def kinect_frame(width: int = 240, height: int = 180, seed: int = 0) -> NDArray[np.float64]:
    """An organised frame of a table with a ball and a box before a wall, (height x width, 6).

    Columns are x, y, z and red, green, blue from 0 to 255. As in frames of structured light the
    depth has noise that grows with its square (1.4 mm at 1 m) and is rounded to steps that grow
    alike, and is missing at the edges of objects, beyond 3 m, and at a fiftieth of all pixels.
    """
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:height, 0:width]
    focal = 525 * width / 640
    x, y = (u - width / 2) / focal, (v - height / 2) / focal
    rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    # Depth of wall, table (0.4 m below the camera), ball and box along every ray.
    n = len(rays)
    depth, part = np.full(n, 2.2), np.zeros(n, int)
    with np.errstate(divide="ignore", invalid="ignore"):
        table = np.where(rays[:, 1] > 0, 0.4 / rays[:, 1], np.inf)
        center, radius = np.array([-0.15, 0.25, 1.2]), 0.15
        a, b = (rays**2).sum(axis=1), rays @ center
        root = b**2 - a * (center @ center - radius**2)
        ball = np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
        low, high = np.array([0.15, 0.1, 1.3]), np.array([0.45, 0.4, 1.6])
        sides = np.sort(np.stack([low / rays, high / rays]), axis=0)
        near, far = np.nanmax(sides[0], axis=1), np.nanmin(sides[1], axis=1)
        box = np.where(near < far, near, np.inf)
    for k, hit in enumerate((table, ball, box), 1):
        nearer = hit < depth
        depth[nearer], part[nearer] = hit[nearer], k
    image = depth.reshape(height, width)
    jumps = np.abs(np.diff(image, axis=1, prepend=image[:, :1])) > 0.05
    depth += 0.0014 * depth**2 * rng.standard_normal(n)
    step = 0.0028 * depth**2
    depth = np.round(depth / step) * step
    depth[jumps.ravel() | (depth > 3) | (rng.random(n) < 0.02)] = np.nan
    palette = np.array([(180, 180, 170), (150, 100, 60), (200, 40, 30), (30, 70, 190)])
    colors = palette[part] + rng.normal(0, 3, (n, 3))
    return np.column_stack([rays * depth[:, None], np.clip(np.rint(colors), 0, 255)])


def write_organised_pcd(path: Path, rows: NDArray[np.float64], width: int) -> None:
    """An ASCII file of points with colours, some of which are NaN, as an organised cloud."""
    height = len(rows) // width
    colors = rows[:, 3:].astype(np.uint32)
    packed = colors[:, 0] << 16 | colors[:, 1] << 8 | colors[:, 2]
    lines = [
        f"{x:.6f} {y:.6f} {z:.6f} {c}" for (x, y, z), c in zip(rows[:, :3], packed, strict=True)
    ]
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\n"
        f"WIDTH {width}\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(rows)}\nDATA ascii\n"
    )
    path.write_text(head + "\n".join(lines) + "\n")


def rotating_scan(
    position: tuple[float, float, float] = (0.0, 0.0, 0.0), angle: float = 0.972, seed: int = 0
) -> NDArray[np.float32]:
    """A furnished room of 5 x 4 x 2.6 m by a laser that turns on a robot, about the laser.

    The beams are `angle` degrees apart. As in scans of such robots the fan passes every direction
    twice, so that half the points have a duplicate; a tenth hit the robot itself nearer than half
    a metre, and ranges have 3 mm of noise.
    """
    rng = np.random.default_rng(seed)
    step = np.radians(angle)
    elevation, azimuth = np.meshgrid(np.arange(-1.5, 1.5, step), np.arange(-np.pi, np.pi, step))
    flat = np.cos(elevation).ravel()
    rays = np.column_stack(
        [flat * np.cos(azimuth.ravel()), flat * np.sin(azimuth.ravel()), np.sin(elevation).ravel()]
    )
    eye = np.array(position)

    def entry_and_exit(low: object, high: object) -> tuple[NDArray[np.float64], ...]:
        """Distances at which the rays enter and leave a box."""
        with np.errstate(divide="ignore", invalid="ignore"):
            planes = np.stack([(np.array(side) - eye) / rays for side in (low, high)])
        sides = np.sort(planes, axis=0)
        return np.nanmax(sides[0], axis=1), np.nanmin(sides[1], axis=1)

    reach = entry_and_exit([-2.5, -2, -1], [2.5, 2, 1.6])[1]
    for x, y in [(-2, -1.5), (-2, 0), (-2, 1.5), (2, -1.5), (2, 1.5)]:
        near, far = entry_and_exit([x - 0.3, y - 0.2, -1], [x + 0.3, y + 0.2, -0.25])
        reach = np.where((near < far) & (near > 0), np.minimum(reach, near), reach)
    reach = reach + 0.003 * rng.standard_normal(len(reach))
    robot = rng.random(len(reach)) < 0.1
    reach[robot] = rng.uniform(0.2, 0.45, robot.sum())
    points = (rays * reach[:, None]).astype(np.float32)
    return np.concatenate([points, points[: len(points) // 2]])


HALL = np.array([[-8.0, -6.0, -1.8], [14.0, 7.0, 3.0]])
"""Lower and upper corner of the hall of `ring_scan`, metres; the sensor is at the origin."""
HALL_WINDOW = np.array([[-1.5, -0.8], [1.5, 1.2]])
"""Lower and upper y and z of its window, in the wall x = 14."""


def ring_scan(
    rings: int = 16, step: float = 0.3, noise: float = 0.02, seed: int = 5, turned: float = 0.3
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """One turn of a laser scanner in an empty hall with a window that gives no echo.

    `rings` lines over 30 degrees, `step` degrees between the points of one, and `noise` metres
    along the rays. Gives the points, (n, 3), turned about z by `turned` radians, and the turn,
    (3, 3): `points @ turn` is along the axes of the hall.
    """
    rng = np.random.default_rng(seed)
    elevation, azimuth = np.radians(
        np.meshgrid(np.linspace(-15, 15, rings), np.arange(0.1, 360, step))
    )
    level = np.cos(elevation)
    rays = np.stack(
        [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1
    ).reshape(-1, 3)
    to = np.where(rays > 0, HALL[1], HALL[0]) / rays
    face = to.argmin(axis=1)
    ranges = to.min(axis=1)
    hits = rays * ranges[:, None]
    in_window = (hits[:, 1:] > HALL_WINDOW[0]) & (hits[:, 1:] < HALL_WINDOW[1])
    seen = ~((face == 0) & (rays[:, 0] > 0) & in_window.all(axis=1))
    noisy = ranges + noise * rng.standard_normal(len(rays))
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return (rays * noisy[:, None])[seen] @ turn.T, turn


def chests(n: int = 2, noise: float = 0.001) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Points and colours of `n` chests of five boxes, the second and every other one mirrored.

    They stand at shifts that are no whole pixels, and each has noise of its own.
    """
    boxes = [
        ((0.0, 0.0, 0.0), (0.5, 0.3, 0.2)),
        ((0.05, 0.04, 0.2), (0.2, 0.26, 0.45)),
        ((0.3, 0.1, 0.2), (0.42, 0.22, 0.32)),
        ((0.5, 0.05, 0.0), (0.64, 0.12, 0.1)),
        ((0.1, 0.3, 0.0), (0.18, 0.42, 0.27)),
    ]
    rng = np.random.default_rng(5)
    points, colors = [], []
    for k in range(n):
        faces = []
        for low, high in boxes:
            for axis, at in ((0, low), (0, high), (1, low), (1, high), (2, high)):
                u, v = (axis + 1) % 3, (axis + 2) % 3
                grid = np.mgrid[low[u] : high[u] : 0.004, low[v] : high[v] : 0.004]
                face = np.empty((grid[0].size, 3))
                face[:, u], face[:, v] = grid.reshape(2, -1)
                face[:, axis] = at[axis] + noise * rng.standard_normal(len(face))
                faces.append(face)
        chest = np.concatenate(faces)
        colors.append((40 + 150 * (np.floor(chest / 0.06).astype(int) % 2)).astype(np.uint8))
        points.append(chest * [(-1) ** k, 1, 1] + [1.3137 * k, 0.0551 * k, 0.0])
    return np.concatenate(points), np.concatenate(colors)
