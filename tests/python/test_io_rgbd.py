"""RGB-D folders made here, point by point against the pinhole equations."""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb
from surfabet.io import read_rgbd

Image = pytest.importorskip("PIL.Image")

# Each generated image has pixels on both sides of the default limits; a test of their own asserts
# what is said about them.
pytestmark = pytest.mark.filterwarnings("ignore:.*left out .* pixels:surfabet.DroppedPointsWarning")

INTRINSICS = (50.0, 60.0, 3.5, 2.0)
HEIGHT, WIDTH = 6, 8


def pose(angle: float, *center: float) -> NDArray[np.float64]:
    """Camera to world: a turn about y, then a shift."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(4)
    matrix[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    matrix[:3, 3] = center
    return matrix


POSES = [pose(0.3, 1, 2, 3), pose(-1.2, 0, 0.5, -1)]


def depth_image(number: int) -> NDArray[np.uint16]:
    depth = np.random.default_rng(number).integers(300, 4001, (HEIGHT, WIDTH)).astype(np.uint16)
    depth[0, :6] = [0, 65535, 299, 300, 4000, 4001]
    return depth


def color_image(number: int) -> NDArray[np.uint8]:
    image = np.random.default_rng(10 + number).integers(0, 256, (HEIGHT, WIDTH, 3))
    return image.astype(np.uint8)


def make_frames(folder: Path, poses: list[NDArray[np.float64]] = POSES) -> Path:
    fx, fy, cx, cy = INTRINSICS
    np.savetxt(folder / "camera-intrinsics.txt", np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]))
    for i, matrix in enumerate(poses):
        Image.fromarray(depth_image(i)).save(folder / f"frame-{i:06d}.depth.png")
        Image.fromarray(color_image(i)).save(folder / f"frame-{i:06d}.color.png")
        np.savetxt(folder / f"frame-{i:06d}.pose.txt", matrix)
    return folder


def expected_frame(
    number: int,
    matrix: NDArray[np.float64],
    *,
    limits: tuple[float, float] = (300, 4000),
    stride: int = 1,
    scale: float = 1000,
    intrinsics: tuple[float, float, float, float] = INTRINSICS,
) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.float64]]:
    """World points, colours and distances from the camera, one pixel after the other."""
    fx, fy, cx, cy = intrinsics
    depth, image = depth_image(number), color_image(number)
    points, colors = [], []
    for v in range(0, HEIGHT, stride):
        for u in range(0, WIDTH, stride):
            d = int(depth[v, u])
            if d in (0, 65535) or not limits[0] <= d <= limits[1]:
                continue
            z = d / scale
            points.append([(u - cx) / fx * z, (v - cy) / fy * z, z])
            colors.append(image[v, u])
    local = np.array(points)
    world = local @ matrix[:3, :3].T + matrix[:3, 3]
    return world, np.array(colors), np.linalg.norm(local, axis=1)


def check(cloud: sb.PointCloud, frames: list[Any], centers: list[NDArray[np.float64]]) -> None:
    points, colors, ranges = (np.concatenate(part) for part in zip(*frames, strict=True))
    np.testing.assert_allclose(cloud.points, points, rtol=0, atol=2e-6)
    np.testing.assert_array_equal(cloud.colors, colors)
    assert cloud.ranges is not None
    np.testing.assert_allclose(cloud.ranges, ranges, rtol=1e-6)
    assert cloud.viewpoints is not None
    np.testing.assert_array_equal(cloud.viewpoints, centers)
    index = np.repeat(np.arange(len(frames)), [len(frame[0]) for frame in frames])
    np.testing.assert_array_equal(cloud.viewpoint_index, index)


def test_fused(tmp_path: Path) -> None:
    cloud = sb.read(make_frames(tmp_path))
    frames = [expected_frame(i, matrix) for i, matrix in enumerate(POSES)]
    check(cloud, frames, [matrix[:3, 3] for matrix in POSES])
    # The limits are sharp and included: of the six special depths 0.3 and 4 m stay.
    assert len(cloud) == 2 * (HEIGHT * WIDTH - 4)


def test_per_frame(tmp_path: Path) -> None:
    clouds = read_rgbd(make_frames(tmp_path), fused=False)
    for i, (cloud, matrix) in enumerate(zip(clouds, POSES, strict=True)):
        check(cloud, [expected_frame(i, matrix)], [matrix[:3, 3]])


def test_poses_that_stretch_are_taken_as_they_are(tmp_path: Path) -> None:
    # As rotations of tracked cameras do, by up to 0.02 percent. Ranges are those of the images.
    stretched = [matrix.copy() for matrix in POSES]
    for matrix in stretched:
        matrix[:3, :3] *= 1.0002
    cloud = sb.read(make_frames(tmp_path, stretched))
    frames = [expected_frame(i, matrix) for i, matrix in enumerate(stretched)]
    check(cloud, frames, [matrix[:3, 3] for matrix in stretched])
    assert cloud.viewpoints is not None
    assert cloud.viewpoint_index is not None
    away = np.linalg.norm(cloud.points - cloud.viewpoints[cloud.viewpoint_index], axis=1)
    np.testing.assert_allclose(away / cloud.ranges, 1.0002, rtol=1e-6)


def test_strides_and_limits(tmp_path: Path) -> None:
    folder = make_frames(tmp_path)
    cloud = sb.read(folder, frame_stride=2, pixel_stride=3, depth_limits=(1, 2.5))
    frame = expected_frame(0, POSES[0], stride=3, limits=(1000, 2500))
    check(cloud, [frame], [POSES[0][:3, 3]])
    everything = sb.read(folder, depth_limits=(0, 100))
    assert len(everything) == 2 * (HEIGHT * WIDTH - 2)


def test_given_intrinsics_and_scale(tmp_path: Path) -> None:
    folder = make_frames(tmp_path)
    (folder / "camera-intrinsics.txt").unlink()
    with pytest.raises(sb.InvalidInputError, match=r"give intrinsics=\(fx, fy, cx, cy\)"):
        sb.read(folder)
    other = (40.0, 45.0, 4.0, 3.0)
    frames = [
        expected_frame(i, matrix, scale=2000, intrinsics=other, limits=(600, 4001))
        for i, matrix in enumerate(POSES)
    ]
    matrix = np.array([[40.0, 0, 4], [0, 45, 3], [0, 0, 1]])
    for given in (other, matrix):
        cloud = sb.read(folder, intrinsics=given, depth_scale=2000)
        check(cloud, frames, [m[:3, 3] for m in POSES])


def test_the_number_of_threads_changes_nothing(tmp_path: Path) -> None:
    folder = make_frames(tmp_path, [pose(0.1 * i, i, 0, 0) for i in range(9)])
    before = sb.get_num_threads()
    clouds = []
    try:
        for n_threads in (1, 4):
            sb.set_num_threads(n_threads)
            clouds.append(sb.read(folder))
    finally:
        sb.set_num_threads(before)
    np.testing.assert_array_equal(clouds[0].local_points, clouds[1].local_points)
    np.testing.assert_array_equal(clouds[0].colors, clouds[1].colors)


def test_far_poses_keep_millimetres(tmp_path: Path) -> None:
    far = pose(0.3, 448_262.123, 5_411_932.678, 512.345)
    cloud = sb.read(make_frames(tmp_path, [far]))
    points, _, _ = expected_frame(0, far)
    np.testing.assert_allclose(cloud.points, points, rtol=0, atol=1e-5)


def test_frames_without_colors(tmp_path: Path) -> None:
    folder = make_frames(tmp_path)
    for image in folder.glob("*.color.png"):
        image.unlink()
    cloud = sb.read(folder)
    assert cloud.colors is None
    np.testing.assert_allclose(
        cloud.points,
        np.concatenate([expected_frame(i, m)[0] for i, m in enumerate(POSES)]),
        rtol=0,
        atol=2e-6,
    )


def test_frames_that_lost_track_are_left_out(tmp_path: Path) -> None:
    lost = np.full((4, 4), np.nan)
    folder = make_frames(tmp_path, [POSES[0], lost, POSES[1]])
    with pytest.warns(sb.DroppedPointsWarning, match="left out 1 of 3 frames"):
        cloud = sb.read(folder)
    assert cloud.viewpoints is not None
    np.testing.assert_array_equal(cloud.viewpoints, [m[:3, 3] for m in POSES])


def make_tum(folder: Path) -> Path:
    (folder / "depth").mkdir()
    (folder / "rgb").mkdir()
    stamps = [100.0, 100.1, 100.2]
    for i, stamp in enumerate(stamps):
        Image.fromarray(depth_image(i)).save(folder / "depth" / f"{stamp}.png")
        Image.fromarray(color_image(i)).save(folder / "rgb" / f"{stamp}.png")
    (folder / "depth.txt").write_text(
        "# depth maps\n" + "".join(f"{s} depth/{s}.png\n" for s in stamps)
    )
    # Out of order, shifted by less than 0.02 s; the last image has no partner.
    (folder / "rgb.txt").write_text(
        "# color images\n100.112 rgb/100.1.png\n99.991 rgb/100.0.png\n100.25 rgb/100.2.png\n"
    )
    # About y by 0.3 and -1.2; a pose at 100.05 s is near to no image.
    rows = [(99.99, POSES[0], 0.3), (100.05, pose(1, 9, 9, 9), 1.0), (100.105, POSES[1], -1.2)]
    lines = [
        f"{s} {' '.join(map(str, m[:3, 3]))} 0 {np.sin(a / 2)} 0 {np.cos(a / 2)}"
        for s, m, a in rows
    ]
    (folder / "groundtruth.txt").write_text("# ground truth\n" + "\n".join(lines) + "\n")
    return folder


@pytest.mark.parametrize(
    ("name", "intrinsics"),
    [
        ("scan", (525.0, 525.0, 319.5, 239.5)),
        ("rgbd_dataset_freiburg2_desk", (520.9, 521.0, 325.1, 249.7)),
    ],
)
def test_tum(tmp_path: Path, name: str, intrinsics: tuple[float, float, float, float]) -> None:
    folder = tmp_path / name
    folder.mkdir()
    cloud = sb.read(make_tum(folder))
    frames = [
        expected_frame(i, m, scale=5000, limits=(1500, 20000), intrinsics=intrinsics)
        for i, m in enumerate(POSES)
    ]
    check(cloud, frames, [m[:3, 3] for m in POSES])
    wider = sb.read(folder, max_time_difference=0.1)
    assert wider.viewpoints is not None
    assert len(wider.viewpoints) == 3


def spoil(folder: Path, name: str, data: bytes | None) -> None:
    path = folder / name
    path.unlink()
    if data is not None:
        path.write_bytes(data)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("frame-000001.pose.txt", b"1 2 3\n", r"pose.txt: a pose has 4 x 4 numbers, not \(1, 3\)"),
        ("frame-000001.pose.txt", b"1 2\n3\n", "pose.txt, line 2: rows of differing lengths"),
        ("frame-000001.pose.txt", b"1 2 3 x\n", "pose.txt, line 1: not numbers"),
        ("frame-000001.pose.txt", b"\xff\n", "pose.txt, byte 0: not a text of numbers"),
        ("frame-000001.color.png", b"no image", "color.png: cannot decode the image"),
        ("frame-000001.depth.png", b"", "depth.png: cannot decode the image"),
        ("camera-intrinsics.txt", b"0 0 0\n0 0 0\n0 0 1\n", "camera-intrinsics.txt: intrinsics"),
    ],
)
def test_broken_frames(tmp_path: Path, name: str, data: bytes | None, message: str) -> None:
    folder = make_frames(tmp_path)
    spoil(folder, name, data)
    with pytest.raises(sb.FormatError, match=message):
        sb.read(folder)


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("frame-000001.depth.png", None, "without a depth image"),
        ("frame-000001.color.png", None, "without a colour image"),
        ("frame-000001.pose.txt", None, "without a pose"),
        ("frame-000001.pose.txt", b"-inf " * 16, "with a pose that is not finite"),
        (
            "frame-000001.pose.txt",
            b"2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1",
            "with a pose that is not a r",
        ),
        (
            "frame-000001.pose.txt",
            b"-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1",
            "with a pose that is not a r",
        ),
    ],
)
def test_a_frame_that_lacks_a_part_is_left_out(
    tmp_path: Path, name: str, data: bytes | None, reason: str
) -> None:
    folder = make_frames(tmp_path, [POSES[0], POSES[1], POSES[0]])
    if data is not None:
        data = b"\n".join(b" ".join(data.split()[i : i + 4]) for i in range(0, 16, 4))
    spoil(folder, name, data)
    expected = rf"left out 1 of 3 frames: 1 {reason}.*\(frame-000001\)"
    with pytest.warns(sb.DroppedPointsWarning, match=expected):
        cloud = sb.read(folder)
    frames = [expected_frame(i, POSES[0]) for i in (0, 2)]
    check(cloud, frames, [POSES[0][:3, 3]] * 2)


def test_the_default_limits_of_depth_say_what_they_leave_out(tmp_path: Path) -> None:
    folder = make_frames(tmp_path)
    said = r"left out 4 of 92 pixels outside depth_limits=\(0.3, 4\) metres: 2 nearer, 2 farther"
    with pytest.warns(sb.DroppedPointsWarning, match=said):
        sb.read(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(sb.read(folder, depth_limits=(0.3, 4))) == 88
        assert len(sb.read(folder, depth_limits=(0.299, 4.001))) == 92


def test_images_of_another_kind(tmp_path: Path) -> None:
    folder = make_frames(tmp_path)
    Image.fromarray(color_image(0)[:3]).save(folder / "frame-000000.color.png")
    with pytest.raises(
        sb.FormatError,
        match=r"colour image has 8 x 3 pixels, the depth image 8 x 6, .* not the same view",
    ):
        sb.read(folder)
    Image.fromarray(color_image(0)).save(folder / "frame-000000.depth.png")
    with pytest.raises(sb.FormatError, match=r"depth\.png: the image has mode RGB"):
        sb.read(folder)


def png_of_16_bits(image: NDArray[np.uint8]) -> bytes:
    """A PNG file of 16 bits per channel: `image`, (h, w, 3) or (h, w), and more."""
    height, width = image.shape[:2]
    values = np.minimum(image.astype(np.uint32) * 257 + 1, 65535).astype(">u2")
    rows = b"".join(b"\0" + row.tobytes() for row in values)

    def chunk(name: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        )

    kind = 2 if image.ndim == 3 else 0
    header = struct.pack(">IIBBBBB", width, height, 16, kind, 0, 0, 0)
    parts = chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(rows)), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


@pytest.mark.parametrize("grey", [False, True])
def test_colors_of_16_bits_keep_8_and_say_so(tmp_path: Path, grey: bool) -> None:
    folder = make_frames(tmp_path)
    usual = sb.read(folder).colors
    images = [color_image(i)[..., 0] if grey else color_image(i) for i in range(len(POSES))]
    for i, image in enumerate(images):
        (folder / f"frame-{i:06d}.color.png").write_bytes(png_of_16_bits(image))
    with pytest.warns(
        sb.IncompleteReadWarning, match="left aside: what colours have beyond 8 bits"
    ):
        colors = sb.read(folder).colors
    assert usual is not None
    assert colors is not None
    np.testing.assert_array_equal(colors, usual[:, [0, 0, 0]] if grey else usual)


def test_truncated_images(tmp_path: Path) -> None:
    folder = make_frames(tmp_path)
    path = folder / "frame-000000.depth.png"
    data = path.read_bytes()
    whole = sb.read(folder)
    n_errors = 0
    for size in range(len(data)):
        path.write_bytes(data[:size])
        try:
            cloud = sb.read(folder)
        except sb.FormatError as error:
            assert "frame-000000.depth.png" in str(error)  # noqa: PT017
            n_errors += 1
        else:
            # All pixels are there; only checksums and the end mark may be missing.
            np.testing.assert_array_equal(cloud.points, whole.points)
    assert n_errors > len(data) * 0.6


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("groundtruth.txt", None, "groundtruth.txt is missing"),
        ("groundtruth.txt", "100 1 2 3\n", "groundtruth.txt, line 1: expected a time stamp and 7"),
        (
            "groundtruth.txt",
            "100 1 2 3 1 1 1 1\n",
            "left out 3 of 3 frames.*1 with a pose that is n",
        ),
        ("groundtruth.txt", "900 1 2 3 0 0 0 1\n", "2 without a pose within max_time_difference="),
        ("depth.txt", "soon depth/a.png\n", "depth.txt, line 1: expected a time stamp"),
        (
            "depth.txt",
            "100 depth/b.png\n",
            r"1 of 1 frames: 1 without a depth image \(depth/b.png\)",
        ),
        ("depth.txt", "100 ../../etc/passwd\n", "outside the folder"),
        ("depth.txt", "100 /etc/passwd\n", "outside the folder"),
    ],
)
def test_broken_tum(tmp_path: Path, name: str, text: str | None, message: str) -> None:
    folder = make_tum(tmp_path)
    spoil(folder, name, None if text is None else text.encode())
    with pytest.raises(sb.FormatError, match=message):
        sb.read(folder)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frame_stride": 0}, "frame_stride is 0, but must be an integer of at least 1"),
        ({"pixel_stride": 1.5}, "pixel_stride is 1.5"),
        ({"depth_limits": (4, 0.3)}, "depth_limits is .* two ascending distances"),
        ({"depth_scale": 0}, "depth_scale is 0"),
        ({"intrinsics": (1, 2, 3)}, "intrinsics is .* but must be"),
        ({"intrinsics": (-1, 2, 3, 4)}, "intrinsics is .* but must be"),
        ({"intrinsics": (1, 0, 3, 4)}, "intrinsics is .* but must be"),
        ({"max_time_difference": float("nan")}, "max_time_difference is nan"),
        ({"fused": False}, "read_rgbd gives one per frame"),
        ({"stride": 2}, "unknown option 'stride' for rgbd; known are intrinsics, depth_scale"),
    ],
)
def test_wrong_options(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises(sb.InvalidInputError, match=message):
        sb.read(make_frames(tmp_path), **options)


def test_folders_without_frames(tmp_path: Path) -> None:
    with pytest.raises(sb.FormatError, match="no RGB-D frames in this folder"):
        sb.read(tmp_path)
    with pytest.raises(FileNotFoundError):
        read_rgbd(tmp_path / "missing")
