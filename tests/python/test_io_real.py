"""Real files against their documented counts and the readings of other packages.

Each has a small twin made in the tests: counts and attributes in `test_io_roundtrip.py`, gaps of
organised clouds in `test_io_pcd.py`, a robot in its scan in `test_alphabet.py`, frames, fused and
not, in `test_io_rgbd.py`, LAS with feet and colours of 8 bits, E57 and KITTI in
`test_io_formats.py`, map coordinates through every format in `test_io_roundtrip.py`.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
from generated import DATA, WITHOUT_DATA
from surfabet.io import read_rgbd

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=WITHOUT_DATA)


def read(name: str, **options: Any) -> sb.PointCloud:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sb.read(DATA / name, **options)


LAS_COLUMNS = [
    "return_number",
    "number_of_returns",
    "scan_direction_flag",
    "classification",
    "scan_angle_rank",
    "user_data",
    "point_source_id",
    "gps_time",
]


@pytest.mark.parametrize(
    ("name", "n_points", "attributes"),
    [
        ("indoor_scan/room_scan1.pcd", 112_586, []),
        ("indoor_scan/room_scan2.pcd", 112_624, []),
        ("multi_scan/full0.pcd", 73_452, ["intensities", "curvature"]),
        ("rgbd_frame/table.pcd", 241_407, ["colors"]),
        ("rgbd_frame/objects.pcd", 207_451, ["colors", "label"]),
        ("georeferenced/terrain_utm.pcd", 392_872, []),
        ("georeferenced/autzen_trim.laz", 110_000, ["colors", "intensities", *LAS_COLUMNS]),
        (
            "e57/pumpAVisualReferenceImage.e57",
            155_201,
            ["colors", "intensities", "ranges", "viewpoints", "rowIndex", "columnIndex"],
        ),
        ("outdoor_360/000000.bin", 124_668, ["intensities", "ranges", "viewpoints"]),
    ],
)
def test_counts_and_attributes(name: str, n_points: int, attributes: list[str]) -> None:
    if name.endswith(".laz"):
        pytest.importorskip("lazrs")
    if name.endswith(".e57"):
        pytest.importorskip("pye57")
    cloud = read(name)
    assert len(cloud) == n_points
    assert cloud.attributes == attributes


def test_the_robot_stands_in_its_scan() -> None:
    cloud = read("indoor_scan/room_scan1.pcd", viewpoint=(0, 0, 0))
    assert cloud.ranges is not None
    distances = np.linalg.norm(cloud.points, axis=1)
    np.testing.assert_allclose(cloud.ranges, distances, rtol=1e-6)
    distinct, first = np.unique(cloud.local_points, axis=0, return_index=True)
    assert len(distinct) == 56_159
    # Eighteen points lie within a rounding error of half a metre.
    assert int((distances[first] < 0.5).sum()) == 11_186


def test_organised_clouds_say_how_many_gaps_they_had() -> None:
    with pytest.warns(sb.DroppedPointsWarning, match="dropped 65793 of 307200 points"):
        sb.read(DATA / "rgbd_frame/table.pcd")


def test_rgbd_room() -> None:
    pytest.importorskip("PIL")
    folder = DATA / "rgbd_room"
    cloud = sb.read(folder)
    assert len(cloud) == 13_651_253
    assert cloud.attributes == ["colors", "ranges", "viewpoints"]
    assert cloud.viewpoints is not None
    assert len(cloud.viewpoints) == 50
    assert cloud.ranges is not None
    assert cloud.viewpoint_index is not None
    some = slice(None, None, 1009)
    centers = cloud.viewpoints[cloud.viewpoint_index[some]]
    distances = np.linalg.norm(cloud.local_points[some] - centers, axis=1)
    # The rotations in these files stretch by up to 0.02 percent.
    np.testing.assert_allclose(cloud.ranges[some], distances, rtol=3e-4)


def test_rgbd_room_by_frame_is_the_fused_cloud() -> None:
    pytest.importorskip("PIL")
    folder = DATA / "rgbd_room"
    fused = sb.read(folder, frame_stride=20, pixel_stride=4)
    frames = read_rgbd(folder, frame_stride=20, pixel_stride=4, fused=False)
    assert len(frames) == 3
    joined, lost = sb.PointCloud.concat(frames)
    assert lost == []
    np.testing.assert_array_equal(joined.local_points, fused.local_points)
    np.testing.assert_array_equal(joined.colors, fused.colors)
    np.testing.assert_array_equal(joined.viewpoint_index, fused.viewpoint_index)


def test_laz_against_laspy() -> None:
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    path = DATA / "georeferenced/autzen_trim.laz"
    with pytest.warns(sb.LostAttributeWarning, match=r"Conic\): foot \(0.3048 m\) horiz"):
        cloud = sb.read(path)
    other = laspy.read(path)
    np.testing.assert_allclose(cloud.points, other.xyz, rtol=0, atol=1e-3)
    np.testing.assert_array_equal(cloud.intensities, other.intensity)
    # This file holds 8-bit colours in its 16-bit fields.
    assert other.red.max() < 256
    colors = np.stack([other.red, other.green, other.blue], axis=1)
    np.testing.assert_array_equal(cloud.colors, colors)
    for name in LAS_COLUMNS:
        np.testing.assert_array_equal(cloud[name], other[name], err_msg=name)


def test_e57_against_pye57() -> None:
    pye57 = pytest.importorskip("pye57")
    path = DATA / "e57/pumpAVisualReferenceImage.e57"
    with pytest.warns(sb.LostAttributeWarning, match=r"left aside: images \(1\)"):
        cloud = sb.read(path)
    with pye57.E57(str(path)) as file:
        scan = file.read_scan(0, intensity=True, colors=True)
    for axis, name in enumerate(("cartesianX", "cartesianY", "cartesianZ")):
        np.testing.assert_allclose(cloud.points[:, axis], scan[name], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(cloud.intensities, scan["intensity"])
    colors = np.stack([scan[f"color{c}"] for c in ("Red", "Green", "Blue")], axis=1)
    np.testing.assert_array_equal(cloud.colors, colors)
    assert cloud.ranges is not None
    # The file's own spherical bounds.
    assert cloud.ranges.min() == pytest.approx(1.983619, abs=1e-5)
    assert cloud.ranges.max() == pytest.approx(5.429336, abs=1e-5)


def test_kitti_against_numpy() -> None:
    rows = np.fromfile(DATA / "outdoor_360/000002.bin", np.float32).reshape(-1, 4)
    cloud = read("outdoor_360/000002.bin")
    np.testing.assert_array_equal(cloud.local_points, rows[:, :3])
    np.testing.assert_array_equal(cloud.intensities, rows[:, 3])


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npz", ".las", ".e57"])
def test_terrain_survives_every_format_to_the_millimetre(tmp_path: Path, suffix: str) -> None:
    if suffix in (".las", ".e57"):
        pytest.importorskip("laspy" if suffix == ".las" else "pye57")
    cloud = read("georeferenced/terrain_utm.pcd")
    sb.write(tmp_path / f"a{suffix}", cloud)
    again = sb.read(tmp_path / f"a{suffix}")
    np.testing.assert_allclose(again.points, cloud.points, rtol=0, atol=1e-3)
