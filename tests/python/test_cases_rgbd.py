"""RGB-D folders as other programs write them; every pixel against the pinhole equations.

All scenes here are a sloped wall, z = 1 + u / 100 metres at column u, seen from shifted cameras.
The folders of `../shared/cases`, where they are, have the same layouts at full size.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb

Image = pytest.importorskip("PIL.Image")

CASES = Path(__file__).parents[2].parent / "shared" / "cases"

FX, FY, CX, CY = 20.0, 22.0, 4.5, 2.5
MATRIX = np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1]])
HEIGHT, WIDTH = 6, 10
DEPTH: NDArray[np.float32] = np.tile(1 + np.arange(WIDTH) / 100, (HEIGHT, 1)).astype(np.float32)
MILLIMETRES = np.rint(DEPTH * 1000).astype(np.uint16)
COLOR: NDArray[np.uint8] = (
    np.random.default_rng(3).integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
)
STAMPS = (100.0, 100.1, 100.2)


def pose(i: int) -> NDArray[np.float64]:
    """Camera `i`, shifted along x."""
    matrix = np.eye(4)
    matrix[0, 3] = 0.1 * i
    return matrix


def expected(
    numbers: tuple[int, ...] = (0, 1, 2), fy: float = FY, scale: float = 1
) -> NDArray[np.float64]:
    """The points of these cameras."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    z = scale * (1 + u / 100)
    local = np.stack([(u - CX) / FX * z, (v - CY) / fy * z, z], axis=-1).reshape(-1, 3)
    return np.concatenate([local + pose(i)[:3, 3] for i in numbers])


def read(folder: Path, **options: Any) -> sb.PointCloud:
    """Reads a folder with every warning an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return sb.read(folder, **options)


def check(cloud: sb.PointCloud, points: NDArray[np.float64], colors: bool = True) -> None:
    np.testing.assert_allclose(cloud.points, points, rtol=0, atol=2e-6)
    if colors:
        n_frames = len(points) // (HEIGHT * WIDTH)
        np.testing.assert_array_equal(cloud.colors, np.tile(COLOR.reshape(-1, 3), (n_frames, 1)))
    else:
        assert cloud.colors is None


def write_pfm(path: Path, image: NDArray[np.float32], byte_order: str = "<") -> None:
    height, width = image.shape
    scale = -1 if byte_order == "<" else 1
    data = image[::-1].astype(f"{byte_order}f4").tobytes()
    path.write_bytes(f"Pf\n{width} {height}\n{scale:.6f}\n".encode() + data)


# 7-Scenes


def make_seven_scenes(folder: Path, save_depth: Callable[[Path], None], suffix: str) -> Path:
    np.savetxt(folder / "camera-intrinsics.txt", MATRIX)
    for i in range(3):
        save_depth(folder / f"frame-{i:06d}.depth{suffix}")
        Image.fromarray(COLOR).save(folder / f"frame-{i:06d}.color.png")
        np.savetxt(folder / f"frame-{i:06d}.pose.txt", pose(i))
    return folder


def save_png(path: Path) -> None:
    Image.fromarray(MILLIMETRES).save(path)


@pytest.mark.parametrize(
    ("suffix", "save_depth"),
    [
        (".png", save_png),
        (".tiff", lambda p: Image.fromarray(DEPTH).save(p)),
        (".pfm", lambda p: write_pfm(p, DEPTH)),
        (".pfm", lambda p: write_pfm(p, DEPTH, ">")),
        (".npy", lambda p: np.save(p, DEPTH)),
        (".npy", lambda p: np.save(p, DEPTH.astype(">f8"))),
        (".npy", lambda p: np.save(p, MILLIMETRES)),
        (".npy", lambda p: np.save(p, np.asfortranarray(MILLIMETRES))),
    ],
)
def test_depth_images_of_any_format(
    tmp_path: Path, suffix: str, save_depth: Callable[[Path], None]
) -> None:
    check(read(make_seven_scenes(tmp_path, save_depth, suffix)), expected())


def test_depth_of_real_numbers(tmp_path: Path) -> None:
    depth = 1000 * DEPTH
    depth[0, :6] = [0, -1, np.nan, np.inf, 299.5, 4000.5]
    folder = make_seven_scenes(tmp_path, lambda p: np.save(p, depth), ".npy")
    at = np.add.outer(np.arange(3) * HEIGHT * WIDTH, np.arange(6)).ravel()
    cloud = read(folder, depth_scale=1000, depth_limits=(0.3, 4))
    np.testing.assert_allclose(cloud.points, np.delete(expected(), at, axis=0), rtol=0, atol=2e-6)
    # The last two measured, outside the limits; the first four did not.
    with pytest.warns(sb.DroppedPointsWarning, match="left out 6 of 168 pixels.*3 nearer, 3 far"):
        sb.read(folder, depth_scale=1000)


def test_colour_images_of_another_size_are_looked_up_at_the_scaled_pixel(tmp_path: Path) -> None:
    folder = make_seven_scenes(tmp_path, save_png, ".png")
    for factor in (8, 3):
        # Each pixel of the depth image has a block of its own colour.
        large = COLOR.repeat(factor, axis=0).repeat(factor, axis=1)
        for i in range(3):
            Image.fromarray(large).save(folder / f"frame-{i:06d}.color.png")
        check(read(folder), expected())
        part = read(folder, pixel_stride=2, frame_stride=3)
        np.testing.assert_array_equal(part.colors, COLOR[::2, ::2].reshape(-1, 3))


def test_a_negative_focal_length_is_for_rows_that_go_up(tmp_path: Path) -> None:
    folder = make_seven_scenes(tmp_path, save_png, ".png")
    check(read(folder, intrinsics=(FX, -FY, CX, CY)), expected(fy=-FY))
    np.savetxt(
        folder / "camera-intrinsics.txt",
        MATRIX * np.array([[1], [-1], [1]]) + [[0, 0, 0], [0, 0, 2 * CY], [0, 0, 0]],
    )
    check(read(folder), expected(fy=-FY))


@pytest.mark.parametrize(
    ("suffix", "data", "message"),
    [
        (".pfm", b"PF\n10 6\n-1\n" + bytes(720), "no header of a PFM image of one channel"),
        (".pfm", b"Pf\n10 6\n-1\n" + bytes(239), "10 x 6 pixels take 251 bytes, not 250"),
        (".pfm", b"Pf\n10 99999\n-1\n", "is too large"),
        (".pfm", b"Pf\n10 6\n1e5e\n" + bytes(240), "cannot decode"),
        (".npy", b"\x93NUMPY\x01\x00", "cannot decode"),
        (".npy", None, r"an array of shape \(3,\) and float64 is no image"),
    ],
)
def test_broken_depth_images(tmp_path: Path, suffix: str, data: bytes | None, message: str) -> None:
    def save(path: Path) -> None:
        if data is None:
            np.save(path, np.zeros(3))
        else:
            path.write_bytes(data)

    with pytest.raises(sb.FormatError, match=message):
        read(make_seven_scenes(tmp_path, save, suffix))


# TUM


def make_tum(folder: Path, *, lists: bool = True, real: bool = False) -> Path:
    for name in ("depth", "rgb"):
        (folder / name).mkdir()
    suffix = ".tiff" if real else ".png"
    depth = DEPTH if real else (MILLIMETRES * 5).astype(np.uint16)
    for stamp in STAMPS:
        Image.fromarray(depth).save(folder / f"depth/{stamp}{suffix}")
        Image.fromarray(COLOR).save(folder / f"rgb/{stamp}.png")
    if lists:
        for name, end in (("depth", suffix), ("rgb", ".png")):
            lines = [f"{s + 0.003} {name}/{s}{end}" for s in STAMPS]
            (folder / f"{name}.txt").write_text("# list\n" + "\n".join(lines))
    truth = [f"{s} {0.1 * i} 0 0 0 0 0 1" for i, s in enumerate(STAMPS)]
    (folder / "groundtruth.txt").write_text("# poses\n" + "\n".join(truth))
    return folder


INTRINSICS = (FX, FY, CX, CY)


@pytest.mark.parametrize("real", [False, True])
def test_tum(tmp_path: Path, real: bool) -> None:
    check(read(make_tum(tmp_path, real=real), intrinsics=INTRINSICS), expected())


@pytest.mark.parametrize("name", ["associations.txt", "associate.txt"])
@pytest.mark.parametrize("order", ["depth first", "colour first", "with poses"])
def test_tum_associations(tmp_path: Path, name: str, order: str) -> None:
    folder = make_tum(tmp_path, lists=False)
    lines = []
    for stamp in STAMPS:
        parts = [f"{stamp + 0.003} rgb/{stamp}.png", f"{stamp} depth/{stamp}.png"]
        if order == "depth first":
            parts.reverse()
        if order == "with poses":
            parts.append(f"{stamp} 0 0 0 0 0 0 1")
        lines.append(" ".join(parts))
    (folder / name).write_text("\n".join(lines))
    check(read(folder, intrinsics=INTRINSICS), expected())


def test_icl_nuim(tmp_path: Path) -> None:
    folder = make_tum(tmp_path, lists=False)
    (folder / "groundtruth.txt").rename(folder / "livingRoom0.gt.freiburg")
    lines = [f"{stamp} depth/{stamp}.png {stamp} rgb/{stamp}.png" for stamp in STAMPS]
    (folder / "associations.txt").write_text("\n".join(lines))
    check(read(folder, intrinsics=(FX, -FY, CX, CY)), expected(fy=-FY))
    (folder / "livingRoom0.gt.freiburg").unlink()
    with pytest.raises(sb.FormatError, match=r"images are listed, but groundtruth\.txt is missing"):
        read(folder)


def test_tum_without_one_depth_image(tmp_path: Path) -> None:
    folder = make_tum(tmp_path)
    (folder / "depth/100.1.png").unlink()
    with pytest.warns(
        sb.DroppedPointsWarning,
        match=r"left out 1 of 3 frames: 1 without a depth image \(depth/100.1.png\)",
    ):
        check(sb.read(folder, intrinsics=INTRINSICS), expected((0, 2)))


def test_tum_with_one_invalid_pose(tmp_path: Path) -> None:
    folder = make_tum(tmp_path)
    path = folder / "groundtruth.txt"
    path.write_text(path.read_text().replace("100.1 0.1 0 0 0 0 0 1", "100.1 0.1 0 0 0 0 0 0"))
    with pytest.warns(sb.DroppedPointsWarning, match="left out 1 of 3 frames: 1 with a pose that"):
        check(sb.read(folder, intrinsics=INTRINSICS), expected((0, 2)))


# ScanNet


def make_scannet(folder: Path, n: int = 3) -> Path:
    for name in ("depth", "color", "pose", "intrinsic"):
        (folder / name).mkdir()
    matrix = np.eye(4)
    matrix[:3, :3] = MATRIX
    np.savetxt(folder / "intrinsic/intrinsic_depth.txt", matrix)
    for i in range(n):
        save_png(folder / f"depth/{i}.png")
        Image.fromarray(COLOR).save(folder / f"color/{i}.png")
        np.savetxt(folder / f"pose/{i}.txt", pose(i))
    return folder


def test_scannet(tmp_path: Path) -> None:
    # Ten comes after nine.
    check(read(make_scannet(tmp_path, 11)), expected(tuple(range(11))))
    np.savetxt(tmp_path / "pose/1.txt", np.full((4, 4), -np.inf))
    with pytest.warns(
        sb.DroppedPointsWarning,
        match=r"left out 1 of 11 frames: 1 with a pose that is not finite \(1\)$",
    ):
        check(sb.read(tmp_path), expected((0, *range(2, 11))))


def test_scannet_colour_camera_of_its_own(tmp_path: Path) -> None:
    folder = make_scannet(tmp_path)
    # Twice the focal lengths; the centre is off by (3, -1) pixels of the colour image.
    shifted = np.array([[2 * FX, 0, 2 * CX + 3, 0], [0, 2 * FY, 2 * CY - 1, 0], [0, 0, 1, 0]])
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", np.vstack([shifted, [0, 0, 0, 1]]))
    image = np.random.default_rng(5).integers(0, 256, (15, 30, 3)).astype(np.uint8)
    for i in range(3):
        Image.fromarray(image).save(folder / f"color/{i}.png")
    cloud = read(folder)
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    looked_up = image[np.maximum(2 * v - 1, 0), 2 * u + 3].reshape(-1, 3)
    np.testing.assert_array_equal(cloud.colors, np.tile(looked_up, (3, 1)))


# Open3D and Redwood


def make_open3d(folder: Path, color: str = "color", **camera: Any) -> Path:
    for name in ("depth", color):
        (folder / name).mkdir()
    content = {"width": WIDTH, "height": HEIGHT, "intrinsic_matrix": MATRIX.T.ravel().tolist()}
    (folder / "camera_intrinsic.json").write_text(json.dumps(content | camera))
    log = ""
    for i in range(3):
        save_png(folder / f"depth/{i:06d}.png")
        # Redwood's names have times of their own.
        stem = f"{i:06d}" if color == "color" else f"{i:06d}-{i * 33:012d}"
        Image.fromarray(COLOR).save(folder / color / f"{stem}.png")
        log += f"{i} {i} {i + 1}\n" + "\n".join(" ".join(map(str, r)) for r in pose(i)) + "\n"
    (folder / "trajectory.log").write_text(log)
    return folder


@pytest.mark.parametrize("color", ["color", "rgb", "image"])
def test_open3d(tmp_path: Path, color: str) -> None:
    check(read(make_open3d(tmp_path, color)), expected())


def test_open3d_poses_are_of_the_frames_that_they_name(tmp_path: Path) -> None:
    folder = make_open3d(tmp_path)
    lines = (folder / "trajectory.log").read_text().splitlines()
    (folder / "trajectory.log").write_text("\n".join(lines[:5] + lines[10:]))
    with pytest.warns(
        sb.DroppedPointsWarning, match=r"1 of 3 frames: 1 without a pose \(000001.png\)"
    ):
        check(sb.read(folder), expected((0, 2)))


@pytest.mark.parametrize(
    ("name", "edit", "message"),
    [
        ("trajectory.log", lambda s: s + "0 0\n", "line 16: expected three integers"),
        ("trajectory.log", lambda s: s + "9 9 10\n" + "1 0 0 0\n" * 4, "frame 9 has a pose, but t"),
        ("trajectory.log", lambda s: s + "9 9 10\n1 0 0 0\n", "the file ends within a pose"),
        ("camera_intrinsic.json", lambda s: s[:-1], "no width, height and intrinsic_matrix"),
        ("camera_intrinsic.json", lambda s: "[" * 9999, "no width, height and intrinsic_matrix"),
        ("camera_intrinsic.json", lambda s: s.replace("20.0", "-20.0"), "json: intrinsics is "),
        (
            "camera_intrinsic.json",
            lambda s: s.replace('"width": 10', '"width": 20'),
            r"10 x 6 pixels, but the folder's intrinsics are for \(20, 6\); give intrinsics=",
        ),
    ],
)
def test_broken_open3d(tmp_path: Path, name: str, edit: Callable[[str], str], message: str) -> None:
    folder = make_open3d(tmp_path)
    (folder / name).write_text(edit((folder / name).read_text()))
    with pytest.raises(sb.FormatError, match=message):
        read(folder)


def test_open3d_without_intrinsics(tmp_path: Path) -> None:
    folder = make_open3d(tmp_path)
    (folder / "camera_intrinsic.json").unlink()
    with pytest.raises(sb.InvalidInputError, match="does not say what its camera is; give intrin"):
        read(folder)
    check(read(folder, intrinsics=INTRINSICS), expected())


# The folders of others

# The room is 6 m deep.
FAR = {"depth_limits": (0.3, 10)}


@pytest.mark.parametrize(
    ("name", "n_frames", "options", "said"),
    [
        (
            "rgbd_tum_far",
            4,
            {},
            r"left out 59,993 of 76,800 pixels outside depth_limits=\(0.3, 4\)",
        ),
        ("rgbd_tum_far", 4, FAR, None),
        ("rgbd_tum_missing_depth", 3, {}, "left out 1 of 4 frames: 1 without a depth image"),
        ("rgbd_tum_assoc", 4, FAR, None),
        ("rgbd_tum_tiff", 4, FAR, None),
        ("rgbd_scannet", 3, {}, "left out 1 of 4 frames: 1 with a pose that is not finite"),
        ("rgbd_open3d", 3, FAR, None),
        ("rgbd_frames_color1920", 3, FAR, None),
    ],
)
def test_cases(name: str, n_frames: int, options: dict[str, Any], said: str | None) -> None:
    if not (CASES / name).is_dir():
        pytest.skip(f"the cases are not at {CASES}; the same layouts are generated above")
    (folder,) = (CASES / name).iterdir()
    if said is None:
        cloud = read(folder, **options)
    else:
        with pytest.warns(sb.DroppedPointsWarning, match=said):
            cloud = sb.read(folder, **options)
    assert cloud.viewpoints is not None
    assert len(cloud.viewpoints) == n_frames
    assert cloud.colors is not None
