"""ROS bags, written here with the package that reads them; poses and fields against arithmetic."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb
from surfabet.io import list_topics, read_bag

rosbag1 = pytest.importorskip("rosbags.rosbag1")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

ROS1 = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
ROS2 = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
TF_TYPE = "tf2_msgs/msg/TFMessage"
# The package's messages of ROS 1 are those of its core.
ROS1.register(typesys.get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF_TYPE))
CLOUD = "sensor_msgs/msg/PointCloud2"
SECOND = 1_000_000_000
CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}

POINTS = np.array([[0.5, -1.25, 2.0], [3.0, 4.5, -6.75], [10.0, 0.0, 0.125], [1, 2, 3]])


def along(x: float) -> NDArray[np.float64]:
    """The points, moved along x."""
    return POINTS + np.array([x, 0, 0])


Stamped = tuple[float, str, str, Any]
"""Seconds, topic, type and content of a message."""


class Maker:
    """Messages of one version of ROS."""

    def __init__(self, store: Any) -> None:
        self.store = store

    def make(self, name: str, *values: Any) -> Any:
        return self.store.types[name](*values)

    def header(self, seconds: float, frame: str) -> Any:
        whole = int(seconds)
        stamp = self.make("builtin_interfaces/msg/Time", whole, round((seconds - whole) * SECOND))
        number = [0] if self.store is ROS1 else []
        return self.make("std_msgs/msg/Header", *number, stamp, frame)

    def cloud(
        self,
        seconds: float,
        frame: str,
        rows: NDArray[Any],
        *,
        names: dict[str, str] | None = None,
        row_padding: int = 0,
        n_rows: int = 1,
        big: bool = False,
        **changed: Any,
    ) -> Any:
        """A message of a structured array; `changed` members lie."""
        fields = []
        assert rows.dtype.fields is not None
        for name, (type_, offset) in (
            (n, rows.dtype.fields[n][:2]) for n in rows.dtype.names or ()
        ):
            base = type_.base.str[1:]
            count = int(np.prod(type_.shape)) if type_.shape else 1
            shown = (names or {}).get(name, name)
            fields.append(
                self.make("sensor_msgs/msg/PointField", shown, offset, CODES[base], count)
            )
        step, width = rows.dtype.itemsize, len(rows) // n_rows
        data = np.frombuffer(rows.tobytes(), np.uint8).reshape(n_rows, -1)
        data = np.pad(data, ((0, 0), (0, row_padding)), constant_values=0xAB)
        members = {
            "height": n_rows,
            "width": width,
            "fields": fields,
            "is_bigendian": big,
            "point_step": step,
            "row_step": width * step + row_padding,
            "data": np.ascontiguousarray(data.ravel()),
            "is_dense": False,
        } | changed
        return self.make(CLOUD, self.header(seconds, frame), *members.values())

    def pose(self, shift: Iterable[float], angle: float) -> tuple[Any, Any, Any]:
        """Position, translation and a turn about z."""
        x, y, z = map(float, shift)
        turn = self.make(
            "geometry_msgs/msg/Quaternion", 0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)
        )
        return (
            self.make("geometry_msgs/msg/Point", x, y, z),
            self.make("geometry_msgs/msg/Vector3", x, y, z),
            turn,
        )

    def transform(
        self, seconds: float, parent: str, child: str, shift: Iterable[float], angle: float
    ) -> Any:
        _, translation, turn = self.pose(shift, angle)
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            self.header(seconds, parent),
            child,
            self.make("geometry_msgs/msg/Transform", translation, turn),
        )

    def odometry(
        self, seconds: float, parent: str, child: str, shift: Iterable[float], angle: float
    ) -> Any:
        point, zero, turn = self.pose(shift, angle)
        zero = self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        return self.make(
            "nav_msgs/msg/Odometry",
            self.header(seconds, parent),
            child,
            self.make(
                "geometry_msgs/msg/PoseWithCovariance",
                self.make("geometry_msgs/msg/Pose", point, turn),
                np.zeros(36),
            ),
            self.make(
                "geometry_msgs/msg/TwistWithCovariance",
                self.make("geometry_msgs/msg/Twist", zero, zero),
                np.zeros(36),
            ),
        )


ONE, TWO = Maker(ROS1), Maker(ROS2)
KINDS = ("bag", "db3", "mcap", "folder")


def write_bag(folder: Path, messages: Iterable[Stamped], kind: str = "mcap") -> Path:
    """A bag of ROS 1, the storage of ROS 2 alone, or a whole folder of ROS 2."""
    if kind == "bag":
        path = folder / "a.bag"
        with rosbag1.Writer(path) as writer:
            known: dict[str, Any] = {}
            for seconds, topic, type_, message in messages:
                if topic not in known:
                    known[topic] = writer.add_connection(topic, type_, typestore=ROS1)
                data = ROS1.serialize_ros1(message, type_)
                writer.write(known[topic], round(seconds * SECOND), data)
        return path
    plugin = rosbag2.StoragePlugin.SQLITE3 if kind == "db3" else rosbag2.StoragePlugin.MCAP
    path = folder / "bag"
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        known = {}
        for seconds, topic, type_, message in messages:
            if topic not in known:
                known[topic] = writer.add_connection(topic, type_, typestore=ROS2)
            writer.write(known[topic], round(seconds * SECOND), ROS2.serialize_cdr(message, type_))
    return path if kind == "folder" else next(path.glob(f"*.{kind}"))


def xyz(points: NDArray[Any], **columns: Any) -> NDArray[Any]:
    """Points as records of 32-bit floats, with more columns behind them."""
    named = {n: np.asarray(c) for n, c in columns.items()}
    dtype = [(axis, "<f4") for axis in "xyz"] + [(n, c.dtype.str) for n, c in named.items()]
    rows = np.zeros(len(points), dtype)
    for k, axis in enumerate("xyz"):
        rows[axis] = points[:, k]
    for name, column in named.items():
        rows[name] = column
    return rows


def single(path: Path, message: Any, kind: str = "mcap") -> Path:
    return write_bag(path, [(1.0, "/points", CLOUD, message)], kind)


def read(path: Path, **options: Any) -> sb.PointCloud:
    """Reads with every warning an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return sb.read(path, **options)


# The message


@pytest.mark.parametrize("kind", KINDS)
def test_bags_of_every_kind(tmp_path: Path, kind: str) -> None:
    maker = ONE if kind == "bag" else TWO
    rows = xyz(POINTS, intensity=np.arange(4, dtype="<f4"))
    path = single(tmp_path, maker.cloud(1.0, "lidar", rows), kind)
    cloud = read(path)
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.intensities, [0, 1, 2, 3])
    assert cloud.viewpoints is None
    assert [(t.name, t.type, t.count) for t in list_topics(path)] == [("/points", CLOUD, 1)]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("type_", ["f4", "f8", "i2", "i4"])
def test_types_offsets_padding_and_byte_order(tmp_path: Path, order: str, type_: str) -> None:
    dtype = np.dtype(
        {
            "names": ["z", "x", "y", "ring", "time"],
            "formats": [order + type_] * 3 + [order + "u2", order + "f8"],
            "offsets": [32, 5, 17, 2, 40],
            "itemsize": 51,
        }
    )
    rows = np.zeros(4, dtype)
    expected = np.trunc(POINTS) if "i" in type_ else POINTS
    for k, axis in enumerate("xyz"):
        rows[axis] = expected[:, k]
    rows["ring"], rows["time"] = [7, 1, 65535, 3], [0.25, 1e9, -1, 2]
    message = TWO.cloud(1.0, "lidar", rows, n_rows=2, row_padding=13, big=order == ">")
    cloud = read(single(tmp_path, message))
    np.testing.assert_array_equal(cloud.points, expected)
    assert cloud["ring"].dtype == np.uint16
    np.testing.assert_array_equal(cloud["ring"], rows["ring"])
    np.testing.assert_array_equal(cloud["time"], rows["time"])


@pytest.mark.parametrize("name", ["rgb", "rgba"])
@pytest.mark.parametrize("type_", ["<f4", "<u4"])
def test_packed_colours(tmp_path: Path, name: str, type_: str) -> None:
    colors = np.array([[1, 2, 3], [250, 128, 7], [0, 0, 255], [255, 255, 255]], np.uint32)
    bits = (colors[:, 0] << 16 | colors[:, 1] << 8 | colors[:, 2]).astype("<u4")
    message = TWO.cloud(1.0, "camera", xyz(POINTS, **{name: bits.view(type_)}))
    np.testing.assert_array_equal(read(single(tmp_path, message)).colors, colors)


def test_fields_of_several_values(tmp_path: Path) -> None:
    dtype = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("shape", "<f4", (3,))]
    rows = np.zeros(4, dtype)
    for k, axis in enumerate("xyz"):
        rows[axis] = POINTS[:, k]
    rows["shape"] = np.arange(12).reshape(4, 3)
    cloud = read(single(tmp_path, TWO.cloud(1.0, "lidar", rows)))
    for k in range(3):
        np.testing.assert_array_equal(cloud[f"shape_{k}"], rows["shape"][:, k])


def test_points_without_a_return_are_counted(tmp_path: Path) -> None:
    points = np.vstack([POINTS, np.zeros((2, 3)), np.full((1, 3), np.nan)])
    path = single(tmp_path, TWO.cloud(1.0, "lidar", xyz(points)))
    with pytest.warns(sb.DroppedPointsWarning, match=r"2 of 7 points at exactly 0 0 0.*; .*1 "):
        cloud = sb.read(path)
    np.testing.assert_array_equal(cloud.points, POINTS)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"width": 2**31}, "a message of 2147483648 x 1 points of 12 bytes"),
        ({"width": 2**31, "height": 2**31}, "has 48 bytes"),
        ({"height": 2, "width": 3, "row_step": 4}, "3 x 2 points of 12 bytes, in rows of 4"),
        ({"point_step": 8}, "field 'z' reaches to byte 12 of points of 8 bytes"),
        ({"point_step": 0}, "field 'x' reaches to byte 4 of points of 0 bytes"),
        ({"data": np.zeros(47, np.uint8)}, "has 47 bytes"),
        ({"fields": []}, "/points has no fields x, y and z among"),
    ],
)
def test_messages_that_lie(tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    path = single(tmp_path, TWO.cloud(1.0, "lidar", xyz(POINTS), **changed))
    with pytest.raises(sb.FormatError, match=message):
        read(path)


def test_rows_without_a_length(tmp_path: Path) -> None:
    # As drivers write clouds of a single row, or of rows that follow one another.
    for i, changed in enumerate(({"row_step": 0}, {"row_step": 0, "height": 2, "width": 2})):
        (tmp_path / str(i)).mkdir()
        path = single(tmp_path / str(i), TWO.cloud(1.0, "lidar", xyz(POINTS), **changed))
        np.testing.assert_array_equal(read(path).points, POINTS)


def test_a_type_that_does_not_exist_is_named(tmp_path: Path) -> None:
    fields = TWO.cloud(1.0, "lidar", xyz(POINTS)).fields
    fields.append(TWO.make("sensor_msgs/msg/PointField", "odd", 0, 9, 1))
    path = single(tmp_path, TWO.cloud(1.0, "lidar", xyz(POINTS), fields=fields))
    with pytest.warns(sb.LostAttributeWarning, match=r"left aside: 'odd' \(type 9\)"):
        np.testing.assert_array_equal(sb.read(path).points, POINTS)


# Topics and messages


def several(maker: Maker, n: int = 3) -> list[Stamped]:
    """Clouds at 1, 2, 3 s, moved by their number along x in the sensor's frame."""
    return [
        (
            float(i),
            "/points",
            CLOUD,
            maker.cloud(float(i), "lidar", xyz(along(i))),
        )
        for i in range(1, n + 1)
    ]


def test_one_message_all_messages_and_none(tmp_path: Path) -> None:
    path = write_bag(tmp_path, several(TWO))
    np.testing.assert_array_equal(read(path, message=1).points, along(2))
    expected = np.concatenate([along(i) for i in (1, 2, 3)])
    np.testing.assert_array_equal(read(path, poses="none").points, expected)
    clouds = read_bag(path, fused=False)
    assert len(clouds) == 3
    np.testing.assert_array_equal(clouds[2].points, along(3))
    with pytest.raises(
        sb.InvalidInputError, match=r"has 3 messages on /points and no poses.*messa"
    ):
        read(path)
    for number in (3, -1):
        with pytest.raises(sb.InvalidInputError, match=f"message is {number}, but must be"):
            read(path, message=number)
    with pytest.raises(sb.InvalidInputError, match="poses is '/odom', but must be tf, none, or"):
        read(path, poses="/odom")
    with pytest.raises(sb.InvalidInputError, match="poses is 'tf', but must be another source"):
        read(path, poses="tf")


def test_several_clouds_need_a_topic(tmp_path: Path) -> None:
    other = (2.5, "/depth", CLOUD, TWO.cloud(2.5, "camera", xyz(POINTS * 2)))
    path = write_bag(tmp_path, [*several(TWO, 1), other])
    said = r"several clouds; name one with topic=: /depth \(1 messages\), /points \(1 messages\)"
    with pytest.raises(sb.InvalidInputError, match=said):
        read(path)
    np.testing.assert_array_equal(read(path, topic="/depth").points, POINTS * 2)
    with pytest.raises(
        sb.InvalidInputError, match="topic is '/scan', but must be one with PointCl"
    ):
        read(path, topic="/scan")


def test_a_bag_without_clouds(tmp_path: Path) -> None:
    odometry = TWO.odometry(1.0, "odom", "base", (0, 0, 0), 0)
    path = write_bag(tmp_path, [(1.0, "/odom", "nav_msgs/msg/Odometry", odometry)])
    with pytest.raises(sb.FormatError, match=r"no topic has PointCloud2 .* /odom \(nav_msgs/msg/"):
        read(path)


def test_fields_that_not_all_messages_have_are_named(tmp_path: Path) -> None:
    more = TWO.cloud(2.0, "lidar", xyz(POINTS, ring=np.arange(4, dtype="<u2")))
    path = write_bag(tmp_path, [*several(TWO, 1), (2.0, "/points", CLOUD, more)])
    with pytest.warns(sb.LostAttributeWarning, match="left aside: 'ring', which 1 of 2 messages"):
        assert len(sb.read(path, poses="none")) == 8


# Poses


def turned(points: NDArray[Any], shift: Iterable[float], angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + np.array(list(shift))


def tf(maker: Maker, seconds: float, transform: Any, *, static: bool = False) -> Stamped:
    message = maker.make(TF_TYPE, [transform])
    return (seconds, "/tf_static" if static else "/tf", TF_TYPE, message)


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_fused_by_the_tree_of_frames(tmp_path: Path, kind: str) -> None:
    maker = ONE if kind == "bag" else TWO
    # map -> odom is fixed and far away; odom -> base moves and turns; base -> lidar is mounted.
    # ROS 1 allowed a slash before names.
    far = (448_262.0, 5_411_932.0, 500.0)
    messages = [
        tf(maker, 0.0, maker.transform(0.0, "map", "/odom", far, 0.0), static=True),
        tf(maker, 0.0, maker.transform(0.0, "base", "lidar", (0, 0, 1.5), 0.5), static=True),
        *(
            tf(maker, t, maker.transform(t, "/odom", "base", (10 * t, 0, 0), 0.2 * t))
            for t in (1.0, 2.0, 3.0)
        ),
        *(
            (t, "/points", CLOUD, maker.cloud(t, "lidar", xyz(POINTS), names=None))
            for t in (1.0, 1.25, 2.9, 3.5)
        ),
    ]
    path = write_bag(tmp_path, sorted(messages, key=lambda m: m[0]), kind)
    with pytest.warns(sb.DroppedPointsWarning, match="left out 1 of 4 messages, for whose times"):
        cloud = sb.read(path)
    expected, centers = [], []
    for t in (1.0, 1.25, 2.9):
        base = turned(POINTS, (0, 0, 1.5), 0.5)
        expected.append(turned(base, (10 * t, 0, 0), 0.2 * t) + far)
        centers.append(np.array([10 * t, 0, 1.5]) + far)
    np.testing.assert_allclose(cloud.points, np.concatenate(expected), rtol=0, atol=2e-6)
    np.testing.assert_allclose(cloud.viewpoints, centers, rtol=0, atol=1e-6)  # type: ignore[arg-type]
    np.testing.assert_array_equal(cloud.viewpoint_index, np.repeat([0, 1, 2], 4))
    distance = np.linalg.norm(POINTS, axis=1)
    np.testing.assert_allclose(cloud.ranges, np.tile(distance, 3), rtol=1e-6)  # type: ignore[arg-type]
    # In a lower frame, and one message alone.
    with pytest.warns(sb.DroppedPointsWarning, match="1 of 4"):
        lower = sb.read(path, frame="odom")
    np.testing.assert_allclose(lower.points, np.concatenate(expected) - far, rtol=0, atol=2e-6)
    with pytest.raises(
        sb.InvalidInputError, match=r"frame is 'wall', but must be .*: lidar, base, "
    ):
        read(path, frame="wall")
    np.testing.assert_array_equal(read(path, message=0).points, POINTS)
    placed = read(path, message=1, poses="tf")
    np.testing.assert_allclose(placed.points, expected[1], rtol=0, atol=2e-6)


def test_normals_turn_with_their_points(tmp_path: Path) -> None:
    normals = {"normal_x": [1, 0, 0, 0], "normal_y": [0, 1, 0, 0], "normal_z": [0, 0, 1, 1]}
    rows = xyz(POINTS, **{n: np.array(c, "<f4") for n, c in normals.items()})
    messages = [
        tf(TWO, 1.0, TWO.transform(1.0, "map", "lidar", (1, 2, 3), np.pi / 2)),
        (1.0, "/points", CLOUD, TWO.cloud(1.0, "lidar", rows)),
    ]
    cloud = read(write_bag(tmp_path, messages))
    expected = [[0, 1, 0], [-1, 0, 0], [0, 0, 1], [0, 0, 1]]
    np.testing.assert_allclose(cloud.normals, expected, atol=1e-6)  # type: ignore[arg-type]


def odometry(t: float, child: str = "base") -> Stamped:
    message = TWO.odometry(t, "odom", child, (10 * t, 0, 0), 0.2 * t)
    return (t, "/odom", "nav_msgs/msg/Odometry", message)


def test_fused_by_odometry(tmp_path: Path) -> None:
    mounted = tf(TWO, 0.0, TWO.transform(0.0, "base", "lidar", (0, 0, 1.5), 0.5), static=True)
    clouds = [(t, "/points", CLOUD, TWO.cloud(t, "lidar", xyz(POINTS))) for t in (1.0, 1.5)]
    path = write_bag(tmp_path, [mounted, odometry(1.0), *clouds, odometry(2.0)])
    base = turned(POINTS, (0, 0, 1.5), 0.5)
    expected = [turned(base, (10 * t, 0, 0), 0.2 * t) for t in (1.0, 1.5)]
    np.testing.assert_allclose(read(path).points, np.concatenate(expected), rtol=0, atol=2e-6)
    by_name = read(path, poses="/odom", frame="odom")
    np.testing.assert_allclose(by_name.points, np.concatenate(expected), rtol=0, atol=2e-6)


@pytest.mark.parametrize("source", ["tf", "odometry"])
def test_clouds_that_are_in_the_fixed_frame_stay(tmp_path: Path, source: str) -> None:
    # As mapping programs publish scans that they have placed.
    moving = [odometry(t) for t in (1.0, 3.0)]
    if source == "tf":
        moving = [
            tf(TWO, t, TWO.transform(t, "odom", "base", (10 * t, 0, 0), 0.2 * t))
            for t in (1.0, 3.0)
        ]
    clouds = [(t, "/points", CLOUD, TWO.cloud(t, "odom", xyz(along(t)))) for t in (1.0, 2.0)]
    path = write_bag(tmp_path, [moving[0], *clouds, moving[1]])
    cloud = read(path)
    np.testing.assert_array_equal(cloud.points, np.concatenate([along(1), along(2)]))
    assert cloud.viewpoints is None


def test_odometry_of_a_frame_that_nothing_joins_is_said(tmp_path: Path) -> None:
    clouds = [(t, "/points", CLOUD, TWO.cloud(t, "lidar", xyz(POINTS))) for t in (1.0, 1.5)]
    path = write_bag(tmp_path, [odometry(1.0), *clouds, odometry(2.0)])
    with pytest.warns(sb.LostAttributeWarning, match="no transform leads from 'lidar' to 'base'"):
        cloud = sb.read(path)
    expected = [turned(POINTS, (10 * t, 0, 0), 0.2 * t) for t in (1.0, 1.5)]
    np.testing.assert_allclose(cloud.points, np.concatenate(expected), rtol=0, atol=2e-6)


@pytest.mark.parametrize(
    "type_", ["geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/TransformStamped"]
)
def test_topics_of_poses(tmp_path: Path, type_: str) -> None:
    def message(t: float) -> Any:
        if type_.endswith("TransformStamped"):
            return TWO.transform(t, "world", "lidar", (10 * t, 0, 0), 0.2 * t)
        point, _, turn = TWO.pose((10 * t, 0, 0), 0.2 * t)
        pose = TWO.make("geometry_msgs/msg/Pose", point, turn)
        return TWO.make(type_, TWO.header(t, "world"), pose)

    tracked = [(t, "/vicon", type_, message(t)) for t in (1.0, 2.0)]
    clouds = [(t, "/points", CLOUD, TWO.cloud(t, "lidar", xyz(POINTS))) for t in (1.0, 1.5)]
    path = write_bag(tmp_path, [tracked[0], *clouds, tracked[1]])
    cloud = read(path, poses="/vicon")
    expected = [turned(POINTS, (10 * t, 0, 0), 0.2 * t) for t in (1.0, 1.5)]
    np.testing.assert_allclose(cloud.points, np.concatenate(expected), rtol=0, atol=2e-6)


def test_interpolation_takes_the_shorter_arc(tmp_path: Path) -> None:
    # From 170 to 190 degrees about z, by quaternions of opposite signs.
    angles = np.radians([170.0, 190.0])
    first, second = (
        TWO.transform(t, "map", "lidar", (0, 0, 0), a)
        for t, a in zip((1.0, 2.0), angles, strict=True)
    )
    q = second.transform.rotation
    second.transform.rotation = TWO.make("geometry_msgs/msg/Quaternion", -q.x, -q.y, -q.z, -q.w)
    cloud = (1.5, "/points", CLOUD, TWO.cloud(1.5, "lidar", xyz(POINTS)))
    path = write_bag(tmp_path, [tf(TWO, 1.0, first), cloud, tf(TWO, 2.0, second)])
    expected = POINTS * [-1, -1, 1]
    np.testing.assert_allclose(read(path).points, expected, rtol=0, atol=2e-6)


def test_trees_that_are_none(tmp_path: Path) -> None:
    def tree(name: str, *pairs: tuple[str, str]) -> Path:
        (tmp_path / name).mkdir()
        steps = [tf(TWO, 1.0, TWO.transform(1.0, a, b, (0, 0, 0), 0)) for a, b in pairs]
        return write_bag(tmp_path / name, [*steps, *several(TWO, 1)])

    with pytest.raises(sb.FormatError, match=r"the frames above .* form a ring"):
        read(tree("ring", ("base", "lidar"), ("lidar", "base")))
    with pytest.raises(sb.FormatError, match="frame 'lidar' hangs on both 'base' and 'arm'"):
        read(tree("two parents", ("base", "lidar"), ("arm", "lidar")))


def test_transforms_that_are_no_rotation_are_counted(tmp_path: Path) -> None:
    broken = TWO.transform(1.5, "map", "lidar", (0, 0, 0), 0)
    broken.transform.rotation = TWO.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 0.0)
    steps = [tf(TWO, t, TWO.transform(t, "map", "lidar", (t, 0, 0), 0)) for t in (1.0, 2.0)]
    cloud = (1.5, "/points", CLOUD, TWO.cloud(1.5, "lidar", xyz(POINTS)))
    path = write_bag(tmp_path, [steps[0], cloud, tf(TWO, 1.5, broken), steps[1]])
    with pytest.warns(sb.LostAttributeWarning, match="1 transforms that are not finite or no rot"):
        np.testing.assert_allclose(sb.read(path).points, along(1.5), atol=1e-6)


# Writing


@pytest.mark.parametrize("far", [False, True])
def test_what_is_written_reads_back(tmp_path: Path, far: bool) -> None:
    rng = np.random.default_rng(0)
    shift = np.array([448_262.0, 5_411_932.0, 500.0]) * far
    cloud = sb.PointCloud(
        POINTS + shift,
        colors=rng.integers(0, 256, (4, 3), dtype=np.uint8),
        intensities=np.arange(4),
        normals=[[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, -1]],
        ranges=np.arange(4) + 0.5,
        viewpoints=np.array([[1, 2, 3], [4, 5, 6]]) + shift,
        viewpoint_index=[0, 1, 1, 0],
        extra={"ring": np.arange(4, dtype=np.uint16), "time": np.arange(4) / 7},
    )
    path = tmp_path / "a.mcap"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sb.write(path, cloud, topic="/map", frame="world")
    assert list(tmp_path.iterdir()) == [path]
    again = read(path)
    assert again.attributes == cloud.attributes
    np.testing.assert_allclose(again.points, cloud.points, rtol=0, atol=1e-9)
    for name in ("colors", "intensities", "normals", "ranges", "viewpoints", "viewpoint_index"):
        np.testing.assert_array_equal(getattr(again, name), getattr(cloud, name))
    for name, column in cloud.extra.items():
        np.testing.assert_array_equal(again[name], column)
        assert again[name].dtype == column.dtype
    assert [(t.name, t.count) for t in list_topics(path)] == [("/map", 1)]


def test_columns_that_the_message_does_not_have_are_named(tmp_path: Path) -> None:
    cloud = sb.PointCloud(POINTS, extra={"id": np.arange(4, dtype=np.int64)})
    with pytest.warns(sb.LostAttributeWarning, match="MCAP files do not hold id"):
        sb.write(tmp_path / "a.mcap", cloud)
    with pytest.raises(sb.InvalidInputError, match="reads bag, but does not write it"):
        sb.write(tmp_path / "a.bag", cloud)


# Broken files


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_truncated_bags(tmp_path: Path, kind: str) -> None:
    path = single(tmp_path, (ONE if kind == "bag" else TWO).cloud(1, "lidar", xyz(POINTS)), kind)
    data = path.read_bytes()
    other = tmp_path / f"cut.{kind}"
    for size in np.linspace(1, len(data) - 1, 40).astype(int):
        other.write_bytes(data[:size])
        try:
            cloud = sb.read(other)
        except sb.FormatError as error:
            assert str(other) in str(error)  # noqa: PT017
        else:
            # Pages of a database, or an index, may be missing behind the message.
            np.testing.assert_array_equal(cloud.points, POINTS)


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_altered_bags(tmp_path: Path, kind: str) -> None:
    path = single(tmp_path, (ONE if kind == "bag" else TWO).cloud(1, "lidar", xyz(POINTS)), kind)
    data = path.read_bytes()
    other = tmp_path / f"altered.{kind}"
    rng = np.random.default_rng(0)
    for at in rng.integers(0, len(data), 30):
        changed = bytearray(data)
        changed[at] ^= int(rng.integers(1, 256))
        other.write_bytes(changed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                sb.read(other)
            except (sb.FormatError, sb.InvalidInputError) as error:
                assert str(other) in str(error) or "but must be" in str(error)  # noqa: PT017


def test_the_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = single(tmp_path, TWO.cloud(1.0, "lidar", xyz(POINTS)))
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(sb.MissingDependencyError, match=r"rosbags>=0.11.*surfabet\[io,ros\]"):
        read(path)
