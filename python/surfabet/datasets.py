"""Simulated scans with exact ground truth: a furnished room seen by a depth camera or a laser.

Nothing is downloaded: rooms are made from a seed and ray-cast. Equal arguments give equal results
on any number of threads.

World frame: z up, floor at z = 0, the room's centre above the origin, metres. Camera frame: x
right, y down, z forward. Laser frame: x forward, y left, z up. Poses are 4 x 4 matrices from sensor
to world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet._checks import (
    check_choice,
    check_flag,
    check_integer,
    check_items,
    check_number,
    check_vector,
)
from surfabet._core import Frame, GroundTruth, Instance, PointCloud, Scene, Surface
from surfabet._progress import Progress, progress_callback
from surfabet.errors import InvalidInputError, MissingDependencyError, wrong_type, wrong_value
from surfabet.io._files import path_of

__all__ = [
    "Frame",
    "GroundTruth",
    "Instance",
    "Scene",
    "SimulatedScan",
    "Surface",
    "load_demo",
    "make_room",
    "scan_lidar",
    "scan_rgbd",
    "simulated_room",
    "write_rgbd_folder",
]


@dataclass(frozen=True)
class SimulatedScan:
    """What a simulated sensor saw, and the truth about it.

    Attributes:
        scene: the room; ``scene.distance(points)`` is the exact distance to its surface.
        cloud: all frames as one cloud, with colours, ranges and viewpoints (lasers: intensities
            too).
        frames: one per pose, in order; each has its own ``cloud``, ``ground_truth``, ``pose`` (the
            one the points were placed with), ``true_pose`` and, from a camera, ``depth``,
            ``color`` and ``intrinsics``.
        ground_truth: for every point of ``cloud`` the exact surface point, normal, instance id and
            surface id.
    """

    scene: Scene
    cloud: PointCloud
    frames: list[Frame]
    ground_truth: GroundTruth


_NOISES = ("depth_noise", "range_noise", "color_noise", "translation_std", "rotation_std")


def _check_numbers(**given: float) -> None:
    """Refuses what are no numbers; limits are those of the simulator."""
    for name, value in given.items():
        if name in _NOISES:
            check_number(name, value, "0 or a positive number", least=0.0)
        else:
            check_number(name, value, "a number")


def _check_limits(name: str, limits: Sequence[float]) -> tuple[float, float]:
    low, high = check_vector(name, limits, "two numbers, the lowest and the highest", 2)
    return low, high


def _check_scene(scene: object) -> None:
    if not isinstance(scene, Scene):
        raise wrong_type("scene", scene, "a Scene, as make_room gives it")


def make_room(
    *,
    seed: int = 0,
    kind: Literal["dwelling", "office", "classroom", "library", "corridor"] = "dwelling",
    size: Sequence[float] = (5.4, 4.4, 2.6),
    n_chairs: int = 6,
    n_shelves: int = 3,
    n_doors: int = 3,
    variation: float = 0.0,
) -> Scene:
    """A furnished, coloured room.

    Args:
        seed: varies colours, prints, books and where things stand; 0 to 2**64 - 1.
        kind: what the room is for, which sets what stands in it.
        size: inner length (x), depth (y) and height (z) in metres: of a dwelling 4.8 x 4.0 x 2.4 to
            12 x 10 x 4, of a corridor 6 x 1.4 x 2.4 to 40 x 4 x 4.
        n_chairs: chairs of a dwelling, at most six per table (one table per 28 square metres).
        n_shelves: shelves of a dwelling, at most one per 0.85 m of ``size[1]`` less 1.3 m.
        n_doors: doors of a dwelling, 1 to 3; the third stands open.
        variation: by how much chairs and shelves of a dwelling differ in each of their sizes, as a
            share up to 0.2. Above zero they and the doors differ in style and colour too, and some
            chairs are pushed under the table; at 0 things of a class are congruent.

    Returns:
        The scene. ``scene.instances`` names everything in it; ``scene.surfaces`` its smooth pieces.

    Raises:
        InvalidInputError: an argument is outside its limits.
    """
    counts = {"n_chairs": n_chairs, "n_shelves": n_shelves, "n_doors": n_doors, "seed": seed}
    for name, count in counts.items():
        check_integer(name, count, 0)
    check_choice("kind", kind, ("dwelling", "office", "classroom", "library", "corridor"))
    check_number("variation", variation, "a number from 0 to 0.2", least=0.0, most=0.2)
    x, y, z = check_vector("size", size, "three numbers: length, depth and height")
    return Scene.room(
        seed=seed,
        kind=kind,
        size=(x, y, z),
        n_chairs=n_chairs,
        n_shelves=n_shelves,
        n_doors=n_doors,
        variation=variation,
    )


def scan_rgbd(
    scene: Scene,
    poses: ArrayLike | None = None,
    *,
    n_frames: int = 16,
    width: int = 640,
    height: int = 480,
    intrinsics: Sequence[float] | None = None,
    depth_limits: tuple[float, float] = (0.4, 4.0),
    depth_noise: float = 1.0,
    quantize_disparity: bool = False,
    max_incidence: float = 82.0,
    dropout: float = 0.002,
    color_noise: float = 3.0,
    translation_std: float = 0.0,
    rotation_std: float = 0.0,
    random_state: int = 0,
    progress: Progress = None,
) -> SimulatedScan:
    """Frames of an RGB-D camera.

    Args:
        scene: the room.
        poses: (n, 4, 4) camera to world; by default ``scene.default_poses(n_frames)``.
        n_frames: number of default poses.
        width, height: of the images, pixels.
        intrinsics: fx, fy, cx, cy in pixels; by default a Kinect's 585, 585, 320, 240 at 640 x 480,
            scaled to the image.
        depth_limits: nearest and farthest depth, metres.
        depth_noise: times the standard deviation that Nguyen, Izadi and Lovell (2012) measured for
            a Kinect, 1.2 mm + 1.9 mm (z - 0.4)^2 and more at grazing angles; 0 for exact depth.
        quantize_disparity: depth in a Kinect's steps, 2.85 mm times the depth squared.
        max_incidence: largest angle between ray and normal that gives a depth, degrees; over the 15
            degrees before it more and more pixels are lost. At 90 none is.
        dropout: fraction of pixels lost anywhere.
        color_noise: standard deviation per channel, 0 to 255.
        translation_std, rotation_std: error of each frame's pose, metres and degrees per axis.
        random_state: seed of all noise.
        progress: None, True for a bar on stderr, or a callable of stage and fraction.

    Raises:
        InvalidInputError: no poses, a pose that is not rigid, an option outside its limits.
    """
    _check_scene(scene)
    check_integer("n_frames", n_frames, 1)
    check_integer("width", width, 1, 8192)
    check_integer("height", height, 1, 8192)
    check_integer("random_state", random_state, 0)
    check_flag("quantize_disparity", quantize_disparity)
    _check_numbers(
        depth_noise=depth_noise,
        max_incidence=max_incidence,
        dropout=dropout,
        color_noise=color_noise,
        translation_std=translation_std,
        rotation_std=rotation_std,
    )
    depth_limits = _check_limits("depth_limits", depth_limits)
    if intrinsics is not None:
        intrinsics = check_vector("intrinsics", intrinsics, "fx, fy, cx and cy", 4)
    if poses is None:
        poses = scene.default_poses(n_frames)
    with progress_callback(progress) as callback:
        cloud, truth, frames = scene.scan_rgbd(
            poses,
            width=width,
            height=height,
            intrinsics=intrinsics,
            depth_limits=depth_limits,
            depth_noise=depth_noise,
            quantize_disparity=quantize_disparity,
            max_incidence=max_incidence,
            dropout=dropout,
            color_noise=color_noise,
            translation_std=translation_std,
            rotation_std=rotation_std,
            seed=random_state,
            progress=callback,
        )
    return SimulatedScan(scene, cloud, frames, truth)


def scan_lidar(
    scene: Scene,
    poses: ArrayLike | None = None,
    *,
    n_scans: int = 4,
    elevation_limits: tuple[float, float] = (-60.0, 60.0),
    elevation_step: float = 0.5,
    azimuth_step: float = 0.5,
    range_limits: tuple[float, float] = (0.3, 100.0),
    range_noise: float = 0.005,
    dropout: float = 0.002,
    color_noise: float = 3.0,
    translation_std: float = 0.0,
    rotation_std: float = 0.0,
    random_state: int = 0,
    progress: Progress = None,
) -> SimulatedScan:
    """Full turns of a rotating laser.

    Args:
        scene: the room.
        poses: (n, 4, 4) laser to world; by default ``scene.default_lidar_poses(n_scans)``.
        n_scans: number of default poses.
        elevation_limits: lowest and highest beam, degrees above the horizon.
        elevation_step, azimuth_step: between neighbouring beams and columns, degrees.
        range_limits: nearest and farthest range, metres.
        range_noise: standard deviation of the range, metres.
        dropout: fraction of beams lost anywhere; beams that leave the room are lost as well.
        color_noise: standard deviation per channel, 0 to 255.
        translation_std, rotation_std: error of each scan's pose, metres and degrees per axis.
        random_state: seed of all noise.
        progress: None, True for a bar on stderr, or a callable of stage and fraction.

    Raises:
        InvalidInputError: no poses, a pose that is not rigid, an option outside its limits.
    """
    _check_scene(scene)
    check_integer("n_scans", n_scans, 1)
    check_integer("random_state", random_state, 0)
    _check_numbers(
        elevation_step=elevation_step,
        azimuth_step=azimuth_step,
        range_noise=range_noise,
        dropout=dropout,
        color_noise=color_noise,
        translation_std=translation_std,
        rotation_std=rotation_std,
    )
    elevation_limits = _check_limits("elevation_limits", elevation_limits)
    range_limits = _check_limits("range_limits", range_limits)
    if poses is None:
        poses = scene.default_lidar_poses(n_scans)
    with progress_callback(progress) as callback:
        cloud, truth, frames = scene.scan_lidar(
            poses,
            elevation_limits=elevation_limits,
            elevation_step=elevation_step,
            azimuth_step=azimuth_step,
            range_limits=range_limits,
            range_noise=range_noise,
            dropout=dropout,
            color_noise=color_noise,
            translation_std=translation_std,
            rotation_std=rotation_std,
            seed=random_state,
            progress=callback,
        )
    return SimulatedScan(scene, cloud, frames, truth)


def simulated_room(
    *,
    sensor: Literal["rgbd", "lidar"] = "rgbd",
    seed: int = 0,
    n_poses: int | None = None,
    noise: float = 1.0,
    pose_error: float = 1.0,
    progress: Progress = None,
) -> SimulatedScan:
    """A room of the default size scanned from default poses, in one call.

    Args:
        sensor: "rgbd" for 320 x 240 frames of a Kinect, "lidar" for turns of a laser.
        seed: of the room and of all noise.
        n_poses: 16 frames or 4 turns by default.
        noise: times the sensor's own noise (depth or range, colour, lost points); 0 for none.
        pose_error: times 3 mm and 0.1 degrees per axis and pose; 0 for exact poses.
        progress: None, True for a bar on stderr, or a callable of stage and fraction.

    Raises:
        InvalidInputError: an unknown sensor, or a number outside its limits.
    """
    check_choice("sensor", sensor, ("rgbd", "lidar"))
    if n_poses is not None:
        check_integer("n_poses", n_poses, 1)
    check_number("noise", noise, "0 or a positive number", least=0.0)
    check_number("pose_error", pose_error, "0 or a positive number", least=0.0)
    scene = make_room(seed=seed)
    translation_std, rotation_std = 0.003 * pose_error, 0.1 * pose_error
    if sensor == "rgbd":
        return scan_rgbd(
            scene,
            n_frames=16 if n_poses is None else n_poses,
            width=320,
            height=240,
            depth_noise=noise,
            max_incidence=82.0 if noise > 0 else 90.0,
            dropout=0.002 * noise,
            color_noise=3.0 * noise,
            translation_std=translation_std,
            rotation_std=rotation_std,
            random_state=seed,
            progress=progress,
        )
    return scan_lidar(
        scene,
        n_scans=4 if n_poses is None else n_poses,
        range_noise=0.005 * noise,
        dropout=0.002 * noise,
        color_noise=3.0 * noise,
        translation_std=translation_std,
        rotation_std=rotation_std,
        random_state=seed,
        progress=progress,
    )


def load_demo(*, progress: Progress = None) -> SimulatedScan:
    """The scan that examples run on: 18 noisy RGB-D frames of a room, over a million points."""
    return simulated_room(n_poses=18, progress=progress)


def write_rgbd_folder(
    path: str | Path, frames: Sequence[Frame], *, color_format: Literal["jpg", "png"] = "jpg"
) -> None:
    """Writes frames of a camera as ``frame-NNNNNN.color.*``, ``.depth.png`` and ``.pose.txt``.

    Depth is 16 bit, millimetres, 0 where there is none; poses are those that the points were placed
    with; ``camera-intrinsics.txt`` holds the 3 x 3 matrix. Colour is JPEG (lossy) or PNG.

    Args:
        path: folder, made when missing; files of other frames in it stay.
        frames: of one camera.
        color_format: "jpg" or "png".

    Raises:
        InvalidInputError: no frames, frames without images or of different cameras, or a depth
            above 65.535 m.
        MissingDependencyError: Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError as error:
        raise MissingDependencyError(
            "writing RGB-D folders needs Pillow: pip install 'surfabet[io]'"
        ) from error
    folder = path_of("path", path)
    check_choice("color_format", color_format, ("jpg", "png"))
    for number, frame in enumerate(check_items("frames", frames, "frames of a camera")):
        if not isinstance(frame, Frame):
            raise wrong_type(f"frames[{number}]", frame, "a Frame, as scan_rgbd gives them")
    if not frames:
        raise wrong_value("frames", frames, "at least one frame", shown="empty")
    images = [_images(frame, number) for number, frame in enumerate(frames)]
    intrinsics = images[0][2]
    for number, (depth, _, matrix) in enumerate(images):
        if depth.shape != images[0][0].shape or not np.array_equal(matrix, intrinsics):
            raise InvalidInputError(
                f"frame {number} is of another camera than frame 0; write one folder per camera"
            )
    folder.mkdir(parents=True, exist_ok=True)
    np.savetxt(folder / "camera-intrinsics.txt", intrinsics)
    for number, ((depth, color, _), frame) in enumerate(zip(images, frames, strict=True)):
        stem = f"frame-{number:06d}"
        Image.fromarray(depth).save(folder / f"{stem}.depth.png")
        picture = Image.fromarray(color)
        if color_format == "jpg":
            picture.save(folder / f"{stem}.color.jpg", quality=95, subsampling=0)
        else:
            picture.save(folder / f"{stem}.color.png")
        np.savetxt(folder / f"{stem}.pose.txt", frame.pose)


def _images(
    frame: Frame, number: int
) -> tuple[NDArray[np.uint16], NDArray[np.uint8], NDArray[np.float64]]:
    """Depth in millimetres, colour and pinhole matrix of a camera's frame."""
    depth, color, intrinsics = frame.depth, frame.color, frame.intrinsics
    if depth is None or color is None or intrinsics is None:
        raise InvalidInputError(f"frame {number} has no images: it is a turn of a laser")
    millimetres = np.rint(depth.astype(np.float64) * 1000.0)
    if millimetres.max(initial=0.0) > 65535.0:
        raise InvalidInputError(
            f"frame {number} reaches {millimetres.max() / 1000.0:.1f} m; "
            "16-bit depth ends at 65.535 m"
        )
    return millimetres.astype(np.uint16), color, intrinsics
