"""Chunks of files, joined, are what `read` gives of the whole, for every format and size."""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import case_files as made
import surfabet as sb
from case_files import Room
from surfabet.io import chunks as chunks_module
from surfabet.io.chunks import read_chunks
from test_io_fields import TYPES, columns

N = 60
ROOM = Room(N)
SIZES = [1, 7, 20, 1000]


def told(give: Callable[[], Any]) -> tuple[Any, str]:
    """What a call gives, and its only warning."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = give()
    assert len(caught) <= 1, [str(one.message) for one in caught]
    return found, str(caught[0].message) if caught else ""


def assert_chunks(path: Path, size: int, *, says_the_same: bool = True) -> None:
    """Holds the chunks of a file against the whole."""
    whole, said = told(lambda: sb.read(path))
    parts, said_of_parts = told(lambda: list(read_chunks(path, size)))
    if says_the_same:
        assert said_of_parts == said
    assert all(0 < len(part) <= size for part in parts if len(part))
    parts = [part for part in parts if len(part)]
    assert sum(map(len, parts)) == len(whole)
    if not parts:
        return
    # Each chunk is rounded to single precision about an origin of its own.
    far = 1e-4 if any(any(cloud.origin) for cloud in (whole, *parts)) else 0
    points = np.concatenate([part.points for part in parts])
    np.testing.assert_allclose(points, whole.points, rtol=0, atol=far)
    for part in parts:
        assert part.attributes == whole.attributes
        assert part.crs == whole.crs
    for name in whole.attributes:
        if name == "viewpoints":
            values = [part.viewpoints[part.viewpoint_index] for part in parts]
            assert whole.viewpoints is not None
            expected = whole.viewpoints[whole.viewpoint_index]
        else:
            values, expected = [part[name] for part in parts], whole[name]
            assert {v.dtype for v in values} == {expected.dtype}, name
        np.testing.assert_array_equal(np.concatenate(values), expected, err_msg=name)


def late(values: NDArray[Any]) -> NDArray[Any]:
    """The values with 0 in all but the last third."""
    values = values.copy()
    values[: 2 * N // 3] = 0
    return values


def deep(low: int, high: int, dtype: Any = np.uint16) -> dict[str, NDArray[Any]]:
    """Colours whose first half lies between 0 and 200, and the rest between two limits."""
    rng = np.random.default_rng(0)
    rows = np.concatenate(
        [rng.integers(0, 200, (N // 2, 3)), rng.integers(low, high, (N - N // 2, 3))]
    )
    return dict(zip(("red", "green", "blue"), rows.astype(dtype).T, strict=True))


def packed(alpha: NDArray[Any]) -> NDArray[np.uint32]:
    bits = ROOM.colors.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    return (bits | alpha.astype(np.uint32) << 24).astype(np.uint32)


def some(share: slice, value: float) -> NDArray[np.float32]:
    points = ROOM.points.copy()
    points[share] = value
    return points


def normals(rows: NDArray[Any]) -> dict[str, NDArray[Any]]:
    return dict(zip(("nx", "ny", "nz"), rows.astype(np.float32).T, strict=True))


COUNT = np.arange(N)
CASES: dict[str, dict[str, NDArray[Any]]] = {
    "colours of 16 bits, dark at first": deep(0, 65535),
    "colours of 8 bits in 16": deep(0, 255),
    "colours times 256": {k: v * 256 for k, v in deep(0, 255).items()},
    "colours to 1": {k: (v / 255).astype(np.float32) for k, v in deep(0, 255).items()},
    "floats to 255, dark at first": {k: late(v) for k, v in deep(1, 255, np.float32).items()},
    "packed": {"rgb": packed(np.zeros(N))},
    "packed floats": {"rgb": packed(np.zeros(N)).view(np.float32)},
    "packed digits": {"rgb": late(packed(np.zeros(N)).astype(np.float64))},
    "alpha": {"rgba": packed(COUNT // 20)},
    "late intensities": {"intensity": late(COUNT.astype(np.float32))},
    "second intensities": {"intensity": 0 * COUNT, "reflectivity": late(COUNT)},
    "no intensities": {"intensity": 0 * COUNT.astype(np.float32)},
    "late normals": normals(late(ROOM.normals)),
    "no normals": normals(0 * ROOM.normals),
    "late vectors": normals(late(ROOM.normals * 7)),
    "ranges": {"range": COUNT.astype(np.float32)},
    "no ranges": {"range": (30 - COUNT).astype(np.float32)},
    "viewpoints": {f"vp_{a}": (COUNT // 25 + i).astype(float) for i, a in enumerate("xyz")},
    "not finite": {"x": some(slice(20, 30), np.nan)[:, 0], "intensity": 1.0 / (COUNT - 1 - 1e-9)},
}


def fields(case: str) -> dict[str, NDArray[Any]]:
    found = ROOM.columns() | CASES[case]
    narrow = {np.dtype(np.int64): np.int32}
    return {name: c.astype(narrow.get(c.dtype, c.dtype)) for name, c in found.items()}


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("format_name", ["ply", "pcd", "pcd ascii"])
def test_what_all_points_decide(case: str, format_name: str, size: int, tmp_path: Path) -> None:
    table = fields(case)
    if format_name == "ply":
        path = tmp_path / "a.ply"
        path.write_bytes(made.ply(table))
    else:
        rows = [" ".join(map(repr, row.tolist())) for row in made.records(table)]
        path = tmp_path / "a.pcd"
        path.write_bytes(made.pcd(table, rows=rows if "ascii" in format_name else None))
    # That colours are deeper than 8 bits shows where two of them become the same one.
    assert_chunks(path, size, says_the_same=size > 1 or "16 bits, dark" not in case)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("n_zero", [1, 5])
@pytest.mark.parametrize("shift", [0, 1e6])
def test_points_at_zero(n_zero: int, shift: float, size: int, tmp_path: Path) -> None:
    points = ROOM.points.astype(np.float64) + shift
    points[10 : 10 + n_zero] = 0
    table = dict(zip("xyz", points.T, strict=True)) | {"intensity": COUNT.astype(np.float32)}
    (tmp_path / "a.ply").write_bytes(made.ply(table))
    (tmp_path / "a.pcd").write_bytes(made.pcd(table))
    assert_chunks(tmp_path / "a.ply", size)
    assert_chunks(tmp_path / "a.pcd", size)


@pytest.mark.parametrize("seed", range(40))
def test_columns_of_any_name(seed: int, tmp_path: Path) -> None:
    table = ROOM.columns() | columns(random.Random(seed), types=TYPES)
    (tmp_path / "a.ply").write_bytes(made.ply(table))
    assert_chunks(tmp_path / "a.ply", 7)
    table = ROOM.columns() | columns(random.Random(seed), most_values=4, types=[*TYPES, "u8", "i8"])
    viewpoint = "0 0 0 1 0 0 0" if "viewpoint_index" in table else "1 2 3 1 0 0 0"
    (tmp_path / "a.pcd").write_bytes(made.pcd(table, viewpoint=viewpoint))
    assert_chunks(tmp_path / "a.pcd", 7)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz", ".npz", ".e57", ".las", ".laz"])
def test_what_is_written_here(suffix: str, size: int, tmp_path: Path) -> None:
    if suffix == ".e57":
        pytest.importorskip("pye57")
    if suffix in (".las", ".laz"):
        pytest.importorskip("lazrs")
    cloud = sb.PointCloud(
        ROOM.points + (UTM if suffix != ".xyz" else 0),
        colors=ROOM.colors,
        intensities=ROOM.intensities if "la" not in suffix else 1 + 0 * ROOM.intensities,
        extra={"classification": (1 + COUNT % 4).astype(np.uint8)},
    )
    path = tmp_path / f"a{suffix}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sb.write(path, cloud)
    assert_chunks(path, size, says_the_same=False)


UTM = np.array([500_000.0, 5_400_000.0, 100.0])


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("encoding", ["binary", "ascii", "binary_compressed"])
def test_encodings_of_pcd(encoding: str, size: int, tmp_path: Path) -> None:
    sb.write(tmp_path / "a.pcd", sb.PointCloud(ROOM.points, colors=ROOM.colors), encoding=encoding)
    assert_chunks(tmp_path / "a.pcd", size)


def test_packed_files_are_read_in_chunks_too(tmp_path: Path) -> None:
    import gzip

    for name, data in (("a.ply", made.ply(ROOM.columns())), ("a.pcd", made.pcd(ROOM.columns()))):
        (tmp_path / f"{name}.gz").write_bytes(gzip.compress(data))
        assert_chunks(tmp_path / f"{name}.gz", 7)


# E57: scans


def scans(n_viewpoints: int, **left_out: bool) -> sb.PointCloud:
    attributes: dict[str, Any] = {
        "colors": ROOM.colors,
        "intensities": ROOM.intensities,
        "normals": ROOM.normals,
        "extra": {"timeStamp": COUNT + 0.5, "label": (COUNT % 5).astype(np.int16)},
    }
    for name in left_out:
        del attributes[name]
    viewpoints = np.arange(3.0 * n_viewpoints).reshape(n_viewpoints, 3)
    index = np.sort(COUNT % n_viewpoints)
    return sb.PointCloud(
        ROOM.points, viewpoints=viewpoints, viewpoint_index=index.astype(np.uint32), **attributes
    )


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("n_scans", [1, 4])
def test_scans_of_e57(n_scans: int, size: int, tmp_path: Path) -> None:
    pytest.importorskip("pye57")
    sb.write(tmp_path / "a.e57", scans(n_scans))
    assert_chunks(tmp_path / "a.e57", size)


@pytest.mark.parametrize("lacking", ["colors", "normals", "intensities", "zero colors"])
def test_attributes_that_some_scans_of_e57_lack(lacking: str, tmp_path: Path) -> None:
    pytest.importorskip("pye57")
    cloud = scans(3)
    if lacking == "zero colors":
        # The second scan is black, which counts as no colours.
        colors = ROOM.colors.copy()
        colors[20:40] = 0
        cloud = sb.PointCloud(
            ROOM.points, colors=colors, viewpoints=cloud.viewpoints,
            viewpoint_index=cloud.viewpoint_index,
        )  # fmt: skip
        sb.write(tmp_path / "a.e57", cloud)
        assert "colors" not in sb.read(tmp_path / "a.e57").attributes
    else:
        sb.write(tmp_path / "a.e57", scans(3, **{lacking: True}))
    assert_chunks(tmp_path / "a.e57", 7)


# RGB-D: frames


@pytest.mark.filterwarnings("ignore::surfabet.DroppedPointsWarning")
@pytest.mark.parametrize("size", [1, 10, 1000])
def test_frames(size: int, tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    from test_io_rgbd import make_frames, pose

    far = [pose(0.3, 5000, 2, 3), pose(-1.2, 5000, 0.5, -1), pose(0, 5001, 0, 0)]
    for name, poses in (("near", [pose(0.3, 1, 2, 3), pose(-1.2, 0, 0.5, -1)]), ("far", far)):
        folder = tmp_path / name
        folder.mkdir()
        assert_chunks(make_frames(folder, poses), size)


def test_a_frame_without_a_pose_is_said_once(tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    from test_io_rgbd import make_frames

    make_frames(tmp_path)
    (tmp_path / "frame-000001.pose.txt").unlink()
    assert_chunks(tmp_path, 10)
    (tmp_path / "frame-000000.depth.png").write_bytes(b"none")
    with pytest.raises(sb.FormatError, match="cannot decode the image") as whole:
        sb.read(tmp_path)
    with pytest.raises(sb.FormatError) as parts:
        list(read_chunks(tmp_path))
    assert str(parts.value) == str(whole.value)


# Bags: messages


@pytest.mark.parametrize("size", [1, 3, 1000])
@pytest.mark.parametrize("kind", ["bag", "db3", "mcap", "folder"])
def test_messages(kind: str, size: int, tmp_path: Path) -> None:
    ros = pytest.importorskip("test_io_ros")
    maker = ros.ONE if kind == "bag" else ros.TWO
    messages = []
    for i in range(5):
        rows = ros.xyz(
            ros.POINTS + i,
            intensity=np.full(4, 10.0 * (i > 2), "<f4"),
            nx=np.ones(4, "<f4"), ny=np.zeros(4, "<f4"), nz=np.zeros(4, "<f4"),
            range=np.full(4, i, "<u2"),
            **({} if i == 1 else {"ring": np.arange(4, dtype="<u2" if i < 3 else "<u4")}),
        )  # fmt: skip
        if i == 2:
            for axis in "xyz":
                rows[axis][[1, 3]] = 0
            rows["x"][2] = np.nan
        cloud = maker.cloud(1.0 + i, "lidar", rows)
        messages.append((1.0 + i, "/points", ros.CLOUD, cloud))
    moving = [
        ros.tf(maker, t, maker.transform(t, "map", "lidar", (t, 1, 0), 0.3 * t))
        for t in (1.0, 2.5, 4.5)
    ]
    path = ros.write_bag(tmp_path, [*messages, *moving], kind)
    assert_chunks(path, size)
    assert len(told(lambda: sb.read(path))[0]) == 4 * 4 - 3


def test_messages_without_poses_are_refused_alike(tmp_path: Path) -> None:
    ros = pytest.importorskip("test_io_ros")
    messages = [
        (t, "/points", ros.CLOUD, ros.TWO.cloud(t, "lidar", ros.xyz(ros.POINTS + t)))
        for t in (1.0, 2.0)
    ]
    path = ros.write_bag(tmp_path, messages)
    with pytest.raises(sb.InvalidInputError, match="has 2 messages on /points") as whole:
        sb.read(path)
    with pytest.raises(sb.InvalidInputError) as parts:
        list(read_chunks(path))
    assert str(parts.value) == str(whole.value)


# Wrong files, and learning


def broken(path: Path, data: bytes) -> tuple[str, str]:
    """What reading the whole and reading chunks say of a file."""
    path.write_bytes(data)
    said = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for read in (lambda: sb.read(path), lambda: list(read_chunks(path, 7))):
            with pytest.raises(sb.FormatError) as error:
                read()
            said.append(str(error.value))
    return said[0], said[1]


@pytest.mark.parametrize("suffix", ["ply", "pcd", "ascii.pcd", "e57", "las", "mcap", "bag"])
@pytest.mark.parametrize("share", [0.02, 0.5, 0.97])
def test_truncated_files(suffix: str, share: float, tmp_path: Path) -> None:
    path = tmp_path / f"a.{suffix}"
    cloud = sb.PointCloud(ROOM.points, colors=ROOM.colors)
    if suffix == "e57":
        pytest.importorskip("pye57")
    if suffix == "las":
        pytest.importorskip("lazrs")
    if suffix in ("bag", "mcap"):
        ros = pytest.importorskip("test_io_ros")
        maker = ros.ONE if suffix == "bag" else ros.TWO
        path = ros.single(tmp_path, maker.cloud(1.0, "lidar", ros.xyz(ros.POINTS)), suffix)
    elif suffix == "ascii.pcd":
        sb.write(path, cloud, encoding="ascii")
    else:
        sb.write(path, cloud)
    data = path.read_bytes()
    whole, parts = broken(path, data[: int(share * len(data))])
    assert parts == whole


def test_wrong_headers(tmp_path: Path) -> None:
    data = made.pcd(ROOM.columns())
    for before, after in ((b"POINTS 60", b"POINTS 61"), (b"TYPE F", b"TYPE Q"), (b"SIZE", b"SIZ")):
        whole, parts = broken(tmp_path / "a.pcd", data.replace(before, after))
        assert parts == whole
    data = made.ply(ROOM.columns())
    for before, after in ((b"vertex 60", b"vertex 61"), (b"float x", b"flout x"), (b"x\n", b"q\n")):
        whole, parts = broken(tmp_path / "a.ply", data.replace(before, after))
        assert parts == whole


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".e57"])
def test_maps_are_learned_without_holding_the_file(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if suffix == ".e57":
        pytest.importorskip("pye57")
    u, v = np.meshgrid(np.arange(0, 2, 0.01), np.arange(0, 1, 0.01))
    wall = sb.PointCloud(np.stack([u.ravel(), 0 * u.ravel(), v.ravel()], axis=1))
    path = tmp_path / f"a{suffix}"
    sb.write(path, wall)
    sizes: list[int] = []

    def watched(path: Path, n: int = 5000) -> Any:
        for chunk in read_chunks(path, n):
            sizes.append(len(chunk))
            yield chunk

    monkeypatch.setattr(chunks_module, "read_chunks", watched)
    report = sb.learn_patches_tiled(path, tmp_path / "a.sfb", tile=1.28, resolution=0.02)
    assert report.n_kept == len(wall)
    assert sizes == [5000] * 4


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_counts_add_up(suffix: str, tmp_path: Path) -> None:
    u, v = np.meshgrid(np.arange(0, 4, 0.01), np.arange(0, 3, 0.01))
    points = np.stack([u.ravel(), 1 + 0 * u.ravel(), v.ravel()], axis=1).astype(np.float32)
    points[100:130] = np.nan
    points[200:250] = 0
    points[300] = [90_000, 0, 0]
    table = dict(zip("xyz", points.T, strict=True))
    path = tmp_path / f"a{suffix}"
    path.write_bytes((made.ply if suffix == ".ply" else made.pcd)(table))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        report = sb.learn_patches_tiled(path, tmp_path / "a.sfb", tile=1.28, resolution=0.02)
    assert report.n_points == len(points)
    assert report.dropped == 80
    assert report.left_out == 1
    assert report.n_kept == len(points) - 81
    assert sb.load(tmp_path / "a.sfb").n_points == report.n_kept
    said = " ".join(str(one.message) for one in caught)
    for part in (
        "dropped 30 of 119,950 points with NaN",
        "50 of 120,000 points at exactly 0 0 0",
        "1 points",
    ):
        assert part.replace(",", "") in said.replace(",", "")
