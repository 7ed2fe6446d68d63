"""Whatever fields a file has: each is kept under its name, or the warning names it."""

from __future__ import annotations

import json
import random
import warnings
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import case_files as made
import surfabet as sb
from case_files import Room
from surfabet.io._columns import MOST_VALUES

ROOM = Room(60)
N = len(ROOM.points)
SEEDS = range(25)
WORDS = ["label", "Time", "ring", "GPS_time", "scalar_x", "t", "w", "echo", "pos", "a", "a_0", "Q"]
# Built-in names in odd company: alone, in other types, twice.
KNOWN = ["red", "g", "nx", "normal_x", "rgb", "rgba", "intensity", "Intensity", "reflectivity"]
KNOWN += ["range", "vp_x", "viewpoint_index", "colors", "normals", "crs", "alpha", "origin"]
TYPES = ["u1", "i1", "u2", "i2", "u4", "i4", "f4", "f8"]


def told(path: Path) -> tuple[sb.PointCloud, str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        cloud = sb.read(path)
    assert len(caught) <= 1, [str(one.message) for one in caught]
    return cloud, str(caught[0].message) if caught else ""


def columns(rng: random.Random, *, most_values: int = 1, types: Iterable[str] = TYPES) -> Any:
    """Columns of random names, types and numbers of values, none of them 0 everywhere."""
    found: dict[str, np.ndarray] = {}
    for name in rng.sample(WORDS + KNOWN, rng.randint(1, 6)):
        k = rng.randint(1, most_values)
        shape = (N, k) if k > 1 else (N,)
        values = np.random.default_rng(rng.randint(0, 999)).integers(1, 100, shape)
        found[name] = values.astype(rng.choice(list(types)))
    return found


BUILT_IN = {
    "colors": ["rgb", "rgba", "red", "g", "blue", "colors"],
    "normals": ["normals", "nx", "normal_x"],
    "intensities": ["intensity", "Intensity", "reflectivity"],
    "ranges": ["range"],
}


def assert_nothing_is_lost(path: Path, fields: dict[str, np.ndarray], said: str = "") -> None:
    cloud, warning = told(path)
    free = list(cloud.attributes)
    for name, values in fields.items():
        builtin = next(
            (a for a, names in BUILT_IN.items() if name in names and a in cloud.attributes), None
        )
        for k in range(1 if values.ndim == 1 else values.shape[1]):
            own = name if values.ndim == 1 else f"{name}_{k}"
            there = next((n for n in (own, own + "_", own + "__") if n in free), None)
            value = values if values.ndim == 1 else values[:, k]
            if there is not None and np.array_equal(cloud[there], value):
                free.remove(there)
                continue
            assert own in warning or name in warning or builtin in free, (name, warning)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("ascii", [False, True])
def test_ply(seed: int, ascii: bool, tmp_path: Path) -> None:
    extra = columns(random.Random(seed))
    fields = ROOM.columns() | extra
    table = made.records(fields)
    rows = [" ".join(map(str, row.tolist())) for row in table] if ascii else None
    (tmp_path / "a.ply").write_bytes(made.ply(fields, rows=rows))
    assert_nothing_is_lost(tmp_path / "a.ply", extra)


@pytest.mark.parametrize("same_length", [False, True])
def test_ply_with_lists_and_elements(same_length: bool, tmp_path: Path) -> None:
    header = (
        f"ply\nformat ascii 1.0\nelement camera 1\nproperty float fov\nelement vertex {N}\n"
        "property float x\nproperty float y\nproperty list uchar int neighbours\n"
        "property float z\nproperty int ring\nproperty uint viewpoint_index\n"
        "element viewpoint 1\nproperty double x\nproperty double y\nproperty double z\n"
        "property float tilt\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"
    )
    lists = ["2 5 6" if same_length or i % 2 else "1 5" for i in range(N)]
    body = [f"{x} {y} {lists[i]} {z} {i} 0" for i, (x, y, z) in enumerate(ROOM.points)]
    (tmp_path / "a.ply").write_text(header + "\n".join(["45", *body, "1 2 3 4"]) + "\n")
    cloud, said = told(tmp_path / "a.ply")
    np.testing.assert_array_equal(cloud["ring"], np.arange(N))
    for lost in ("element camera (1)", "neighbours", "tilt"):
        assert lost in said
    assert "face" not in said


@pytest.mark.parametrize("seed", SEEDS)
def test_pcd(seed: int, tmp_path: Path) -> None:
    extra = columns(random.Random(seed), most_values=4, types=[*TYPES, "u8", "i8"])
    (tmp_path / "a.pcd").write_bytes(made.pcd(ROOM.columns() | extra))
    assert_nothing_is_lost(tmp_path / "a.pcd", extra)


def test_pcd_orientation_is_named(tmp_path: Path) -> None:
    for turn, lost in (("1 0 0 0", False), ("0.7071 0 0 0.7071", True)):
        data = made.pcd(ROOM.columns(), viewpoint=f"1 2 3 {turn}")
        (tmp_path / "a.pcd").write_bytes(data)
        assert ("orientation in VIEWPOINT" in told(tmp_path / "a.pcd")[1]) == lost


def test_alpha_of_packed_colors_is_kept(tmp_path: Path) -> None:
    alpha = np.arange(N, dtype=np.uint32)
    packed = ROOM.colors.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    fields = {"rgb": (packed | alpha << 24).astype(np.uint32)}
    (tmp_path / "a.pcd").write_bytes(made.pcd(ROOM.columns() | fields))
    np.testing.assert_array_equal(told(tmp_path / "a.pcd")[0]["alpha"], alpha)
    fields["alpha"] = np.ones(N, np.uint8)
    (tmp_path / "a.pcd").write_bytes(made.pcd(ROOM.columns() | fields))
    cloud, said = told(tmp_path / "a.pcd")
    assert "a second column alpha" in said
    np.testing.assert_array_equal(cloud["alpha"], 1)


@pytest.mark.parametrize("seed", SEEDS)
def test_las(seed: int, tmp_path: Path) -> None:
    extra = columns(random.Random(seed), most_values=3, types=[*TYPES, "u8", "i8"])
    standard = {"classification": np.arange(N) % 7 + 19, "gps_time": np.arange(N) + 0.5}
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), np.zeros(3)
    own = {name: c for name, c in extra.items() if name.lower() not in ("red", "intensity")}
    for name, c in own.items():
        shape = "" if c.ndim == 1 else str(c.shape[1])
        header.add_extra_dim(laspy.ExtraBytesParams(name, f"{shape}{c.dtype.str[1:]}"))
    file = laspy.LasData(header)
    file.x, file.y, file.z = ROOM.points.T.astype(np.float64)
    for name, values in {**standard, **own}.items():
        file[name] = values
    file.write(str(tmp_path / "a.laz"))
    assert_nothing_is_lost(tmp_path / "a.laz", standard | own)


def test_las_bytes_that_no_record_describes(tmp_path: Path) -> None:
    path = made.las(tmp_path / "a.las", ROOM.points, {}, extra={"echo": np.arange(N, dtype="u2")})
    data = bytearray(path.read_bytes())
    at = data.index(b"LASF_Spec")
    data[at : at + 9] = b"something"
    path.write_bytes(data)
    cloud, said = told(path)
    assert len(cloud) == N
    assert "record something 4" in said
    assert [n for n in cloud.attributes if n.startswith("ExtraBytes")] or "xtra" in said


@pytest.mark.parametrize("seed", SEEDS)
def test_npz(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    arrays = columns(rng, most_values=4, types=[*TYPES, "u8", "i8", "f2", "?"])
    arrays = {name: c for name, c in arrays.items() if name not in ("colors", "normals", "origin")}
    arrays.pop("viewpoint_index", None)
    odd: dict[str, Any] = {
        "shorter": np.ones(N - 1),
        "scalar": np.float64(3),
        "cube": np.ones((N, 2, 2)),
        "when": np.full(N, "2026-11-29", "M8[D]"),
        "complex": np.ones(N, np.complex64),
        "names": np.full(N, "a"),
        "longer": np.ones((N, MOST_VALUES + 1)),
        "wide": np.arange(N, dtype=np.longdouble),
    }
    chosen = {name: odd[name] for name in rng.sample(sorted(odd), 3)}
    np.savez(tmp_path / "a.npz", xyz=ROOM.points, **arrays, **chosen)
    cloud, said = told(tmp_path / "a.npz")
    for name in chosen:
        assert name in said or name in cloud.attributes
    assert_nothing_is_lost(tmp_path / "a.npz", arrays)


def test_npz_with_everything_twice(tmp_path: Path) -> None:
    one = np.ones(N, np.float32)
    arrays: dict[str, Any] = {"points": ROOM.points, "x": one, "colors": ROOM.colors}
    arrays |= {"rgb": ROOM.colors, "normals": ROOM.normals, "nx": one}
    np.savez(tmp_path / "a.npz", **arrays)
    with zipfile.ZipFile(tmp_path / "a.npz", "a") as archive:
        archive.writestr("about.json", json.dumps({}))
    cloud, said = told(tmp_path / "a.npz")
    np.testing.assert_array_equal(cloud.points, ROOM.points)
    for name in ("column x", "column red", "column nx", "about.json"):
        assert name in said


@pytest.mark.parametrize("seed", SEEDS)
def test_e57(seed: int, tmp_path: Path) -> None:
    names = ["timeStamp", "rowIndex", "colorRed", "colorGreen", "intensity", "odd"]
    names += ["isColorInvalid", "isIntensityInvalid", "returnIndex", "sphericalInvalidState"]
    rng = random.Random(seed)
    fields = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), ROOM.points.T, strict=True))
    extra = {name: np.arange(N) % 2 for name in rng.sample(names, rng.randint(1, 6))}
    made.e57(tmp_path / "a.e57", fields | extra, bounds={n: (0, 9) for n in extra})
    cloud, said = told(tmp_path / "a.e57")
    for name in extra:
        attribute = "intensities" if name.startswith(("intensity", "isIntensity")) else name
        assert name in cloud.attributes or name in said or attribute in cloud.attributes, said


@pytest.mark.parametrize("seed", SEEDS)
def test_text(seed: int, tmp_path: Path) -> None:
    """A word in the middle of a column costs that column alone."""
    rng = random.Random(seed)
    extra = columns(rng, types=["i4", "f8"])
    bad = rng.choice([name for name in extra if name in WORDS] or [None])
    rows = [[repr(v) for v in row.tolist()] for row in made.records(ROOM.columns() | extra)]
    names = ["x", "y", "z", *extra]
    if bad is not None:
        rows[N // 2][names.index(bad)] = rng.choice(["wall", "", "1,5"])
    text = "\n".join(";".join(row) for row in [names, *rows])
    (tmp_path / "a.csv").write_text(text)
    kept = {name: c for name, c in extra.items() if name != bad}
    cloud, said = told(tmp_path / "a.csv")
    assert len(cloud) == N
    if bad is not None:
        assert f"column {bad!r}, which does not always hold numbers" in said
        assert bad not in cloud.attributes
    assert_nothing_is_lost(tmp_path / "a.csv", kept)


def test_text_behind_the_names(tmp_path: Path) -> None:
    rows = ["x y z label", *(f"{x} {y} {z} 4 red wall" for x, y, z in ROOM.points)]
    (tmp_path / "a.txt").write_text("\n".join(rows))
    cloud, said = told(tmp_path / "a.txt")
    np.testing.assert_array_equal(cloud["label"], 4)
    assert "what stands behind the last column that has a name" in said


def test_fields_of_messages_that_share_a_name(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types: Any = store.types
    field = types["sensor_msgs/msg/PointField"]
    stamp = types["builtin_interfaces/msg/Time"](1, 0)
    data = np.zeros((N, 6), np.float32)
    data[:, :3] = ROOM.points
    fields = [field(n, 4 * i, 7, 1) for i, n in enumerate(["x", "y", "z", "ring", "ring", ""])]
    fields.append(field("odd", 0, 99, 1))
    fields.append(field("many", 0, 2, MOST_VALUES + 1))
    step = MOST_VALUES + 1
    rows = np.zeros((N, step), np.uint8)
    rows[:, : 6 * 4] = data.view(np.uint8).reshape(N, -1)
    name = "sensor_msgs/msg/PointCloud2"
    message = types[name](
        types["std_msgs/msg/Header"](stamp, "map"),
        1, N, fields, False, step, N * step, rows.reshape(-1), True,
    )  # fmt: skip
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/points", name, typestore=store)
        writer.write(connection, 0, store.serialize_cdr(message, name))
    cloud, said = told(tmp_path / "bag")
    assert cloud.attributes == ["ring"]
    for lost in ("a second column ring", "'odd' (type 99)", "many of 1,025 values per point"):
        assert lost in said
