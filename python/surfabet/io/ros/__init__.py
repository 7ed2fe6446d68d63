"""ROS bags without ROS: `PointCloud2` from bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap, folders).

Messages are placed by the tree of `/tf` and `/tf_static`, or by a topic of odometry or poses, at
the times of their headers. Written are MCAP files of one message.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.errors import InvalidInputError
from surfabet.io._columns import (
    VIEWPOINT_INDEX,
    Column,
    cloud_from_columns,
    columns_from_cloud,
    no_returns,
    viewpoint_columns,
    warn_lost,
)
from surfabet.io._files import format_error, optional_module, written_whole
from surfabet.io._notes import Notes
from surfabet.io.ros._bags import (
    REQUIREMENT,
    Topic,
    as_defined,
    frame_of,
    is_bag,
    messages,
    open_bag,
    stamp_of,
    topics_of,
)
from surfabet.io.ros._point_cloud2 import TYPE, can_encode, decode, encode
from surfabet.io.ros._transforms import (
    ODOMETRY_TYPE,
    TRACK_TYPES,
    Edge,
    note_invalid,
    poses_along,
    read_track,
    read_tree,
)

__all__ = ["Topic", "is_bag", "list_topics", "read_bag", "write_mcap"]

_NORMALS = (("normal_x", "normal_y", "normal_z"), ("nx", "ny", "nz"))
_CHANNELS = ("red", "green", "blue")
_NO_POSES = "none"
_TREE = "tf"


@dataclass
class _Scan:
    """One message."""

    columns: dict[str, Column]
    stamp: int
    frame: str


def list_topics(path: str | os.PathLike[str]) -> list[Topic]:
    """The topics of a ROS bag, with their types and numbers of messages.

    Parameters
    ----------
    path
        A file of ROS 1 (.bag) or ROS 2 (.db3, .mcap), or the folder of a ROS 2 bag.

    Raises
    ------
    FormatError
        It is no readable bag.
    MissingDependencyError
        The package rosbags is not installed.
    """
    with open_bag(Path(path)) as reader:
        return topics_of(reader)


def _wrong(argument: str, value: object, requirement: str) -> InvalidInputError:
    return InvalidInputError(
        f"{argument} is {value!r}, but must be {requirement}",
        argument=argument,
        value=repr(value),
        requirement=requirement,
    )


def _choose_topic(path: Path, topics: Sequence[Topic], name: str | None) -> Topic:
    clouds = [topic for topic in topics if topic.type == TYPE]
    if not clouds:
        others = ", ".join(f"{topic.name} ({topic.type})" for topic in topics) or "none at all"
        raise format_error(path, f"no topic has PointCloud2 messages; its topics: {others:.300}")
    known = ", ".join(f"{topic.name} ({topic.count} messages)" for topic in clouds)
    if name is None:
        if len(clouds) > 1:
            raise InvalidInputError(f"{path} has several clouds; name one with topic=: {known}")
        return clouds[0]
    chosen = next((topic for topic in clouds if topic.name == name), None)
    if chosen is None:
        raise _wrong("topic", name, f"one with PointCloud2 messages: {known}")
    return chosen


def _read_scans(
    path: Path, reader: Any, topic: Topic, number: int | None, notes: Notes
) -> list[_Scan]:
    scans = []
    for _, stamp, message in messages(path, reader, [topic.name], number):
        with as_defined(path, topic.type):
            frame = frame_of(message.header.frame_id)
            scans.append(_Scan(decode(path, message, notes), stamp_of(message, stamp), frame))
    return scans


class _Placing:
    """How frames get into the common one: the steps from each."""

    def __init__(self, path: Path, reader: Any, frame: str, source: str | None) -> None:
        """`frame` is that of the clouds; `source` is the user's, or what the bag has."""
        self.path = path
        self.tree = read_tree(path, reader)
        self.track: Edge | None = None
        tracks = [topic for topic in topics_of(reader) if topic.type in TRACK_TYPES]
        if source not in (None, _TREE, _NO_POSES):
            chosen = next((topic for topic in tracks if topic.name == source), None)
            if chosen is None:
                known = ", ".join(topic.name for topic in tracks) or "none here"
                raise _wrong("poses", source, f"tf, none, or a topic of odometry or poses: {known}")
            self.track = read_track(path, reader, chosen.name, chosen.type, frame)
        elif source is None and not self.moves(frame) and not self.is_fixed(frame):
            odometry = [topic for topic in tracks if topic.type == ODOMETRY_TYPE]
            if len(odometry) > 1:
                known = ", ".join(topic.name for topic in odometry)
                raise InvalidInputError(f"{path} has several odometries; name one: poses={known}")
            if odometry:
                self.track = read_track(path, reader, odometry[0].name, ODOMETRY_TYPE, frame)
        if source == _TREE and not self.tree.chain(frame) and not self.is_fixed(frame):
            raise _wrong("poses", source, f"another source, since /tf has no frame {frame!r}")

    def moves(self, frame: str) -> bool:
        """Whether the tree knows motions of a frame."""
        return any(not step.static for step in self.tree.chain(frame))

    def is_fixed(self, frame: str) -> bool:
        """Whether other frames move in this one, and it in none."""
        if self.track is not None and frame == self.track.parent:
            return True
        moving = any(not edge.static for edge in self.tree.edges.values())
        parents = {edge.parent for edge in self.tree.edges.values()}
        return moving and frame in parents and frame not in self.tree.edges

    def steps(self, frame: str, target: str | None, notes: Notes) -> list[Edge]:
        """The steps from a frame to the one that clouds are fused in."""
        if self.track is None or self.is_fixed(frame):
            steps = self.tree.chain(frame, target)
        else:
            steps = self.tree.chain(frame, self.track.child)
            if (steps[-1].parent if steps else frame) != self.track.child:
                steps = []
                notes.remark(
                    f"no transform leads from {frame!r} to {self.track.child!r}, which has the "
                    "poses; they are taken as the same"
                )
            steps = [*steps, self.track]
        if target is not None and (steps[-1].parent if steps else frame) != target:
            known = ", ".join([frame, *(step.parent for step in self.tree.chain(frame))])
            raise _wrong("frame", target, f"one of those above the cloud's: {known}")
        return steps


def _place(scan: _Scan, pose: NDArray[np.float64]) -> None:
    """Moves a scan by a pose, and notes its ranges."""
    columns = scan.columns
    local = [columns[axis].astype(np.float64) for axis in "xyz"]
    for row, axis in enumerate("xyz"):
        columns[axis] = (
            pose[row, 0] * local[0] + pose[row, 1] * local[1] + pose[row, 2] * local[2]
        ) + pose[row, 3]
    for names in _NORMALS:
        if all(name in columns for name in names):
            normal = [columns[name] for name in names]
            for row, name in enumerate(names):
                columns[name] = sum(pose[row, k] * normal[k] for k in range(3))
    if "range" in columns and columns["range"].dtype.kind != "f":
        # Drivers write integer ranges in units of their own.
        columns["range_"] = columns.pop("range")
    with np.errstate(over="ignore", invalid="ignore"):
        distance = np.sqrt(local[0] ** 2 + local[1] ** 2 + local[2] ** 2)
    columns.setdefault("range", distance.astype(np.float32))


def _placed(
    path: Path, scans: Sequence[_Scan], placing: _Placing, target: str | None, notes: Notes
) -> tuple[list[_Scan], NDArray[np.float64] | None]:
    """The scans that could be placed, in the common frame, and where the sensor was for each."""
    placed: list[_Scan] = []
    centers: list[NDArray[np.float64]] = []
    moved = False
    for frame in dict.fromkeys(scan.frame for scan in scans):
        own = [scan for scan in scans if scan.frame == frame]
        steps = placing.steps(frame, target, notes)
        moved = moved or bool(steps)
        poses, known = poses_along(steps, np.array([scan.stamp for scan in own], np.int64))
        for scan, pose, there in zip(own, poses, known, strict=True):
            if there:
                if steps:
                    _place(scan, pose)
                placed.append(scan)
                centers.append(pose[:3, 3])
    note_invalid(placing.tree, notes)
    if n_lost := len(scans) - len(placed):
        notes.points(
            f"left out {n_lost} of {len(scans)} messages, for whose times there is no pose"
        )
    if not placed:
        raise format_error(
            path, "no message could be placed; read one with message=, or all with poses='none'"
        )
    return placed, np.array(centers) if moved else None


def _drop_no_returns(scans: Sequence[_Scan], notes: Notes) -> None:
    """Leaves out points at exactly 0 0 0, which would become the sensor's position."""
    n_empty = n_points = 0
    for scan in scans:
        empty = no_returns(np.stack([scan.columns[axis] for axis in "xyz"], axis=1))
        n_points += len(empty)
        if empty.any():
            n_empty += int(empty.sum())
            scan.columns = {name: column[~empty] for name, column in scan.columns.items()}
    if n_empty:
        notes.points(f"left out {n_empty:,} of {n_points:,} points at exactly 0 0 0 (no returns)")


def _joined(scans: Sequence[_Scan], notes: Notes) -> dict[str, Column]:
    """The columns that all scans have, one scan after the other."""
    names = [n for n in scans[0].columns if all(n in scan.columns for scan in scans)]
    partial = {name: None for scan in scans for name in scan.columns if name not in names}
    for name in partial:
        n_with = sum(name in scan.columns for scan in scans)
        notes.aside(f"{name!r:.40}, which {n_with} of {len(scans)} messages have")
    return {name: np.concatenate([scan.columns[name] for scan in scans]) for name in names}


def _fused(
    path: Path, scans: Sequence[_Scan], centers: NDArray[np.float64] | None, notes: Notes
) -> PointCloud:
    columns = _joined(scans, notes)
    if centers is not None:
        counts = [len(scan.columns["x"]) for scan in scans]
        columns[VIEWPOINT_INDEX] = np.repeat(np.arange(len(scans), dtype=np.uint32), counts)
    return cloud_from_columns(path, columns, viewpoints=centers, notes=notes)


def _check_positions(path: Path, topic: Topic, scans: Sequence[_Scan]) -> None:
    for scan in scans:
        if not {"x", "y", "z"} <= scan.columns.keys():
            raise format_error(
                path, f"{topic.name} has no fields x, y and z among {sorted(scan.columns)}"
            )


@overload
def read_bag(
    path: str | os.PathLike[str],
    *,
    topic: str | None = ...,
    message: int | None = ...,
    poses: str | None = ...,
    frame: str | None = ...,
    fused: Literal[True] = ...,
) -> PointCloud: ...
@overload
def read_bag(
    path: str | os.PathLike[str],
    *,
    topic: str | None = ...,
    message: int | None = ...,
    poses: str | None = ...,
    frame: str | None = ...,
    fused: Literal[False],
) -> list[PointCloud]: ...
def read_bag(
    path: str | os.PathLike[str],
    *,
    topic: str | None = None,
    message: int | None = None,
    poses: str | None = None,
    frame: str | None = None,
    fused: bool = True,
) -> PointCloud | list[PointCloud]:
    """Reads the clouds of a ROS bag, fused or one by one.

    Parameters
    ----------
    path
        A file of ROS 1 (.bag) or ROS 2 (.db3, .mcap), or the folder of a ROS 2 bag.
    topic
        The topic with the clouds; needed where several have `PointCloud2` messages.
    message
        The number of a single message to read, from 0; it stays in the sensor's frame unless
        `poses` says how to place it.
    poses
        How messages are placed: "tf", by the frames of `/tf` and `/tf_static`; a topic of odometry
        or poses; or "none", as they are. Default: the frames where they move, else the only
        odometry.
    frame
        The frame to fuse in, one of those that the cloud's frame hangs on. Default: the topmost.
    fused
        One cloud of all messages, or a list of one cloud per message.

    Returns
    -------
    PointCloud or list of PointCloud
        Positions with all fields of the messages: colours of packed `rgb` or `rgba`, intensities,
        normals, and any other as an extra column of its name. Placed messages have ranges (metres,
        to the origin of their own frame) and viewpoints (the position of that frame; row i is
        message i of those placed). Points are in the order of messages, rows and columns.

    Raises
    ------
    FormatError
        It is no readable bag, has no clouds, or no message has a pose at its time.
    InvalidInputError
        An option has a value that this bag does not allow, or the bag needs `topic`, `message` or
        `poses`; the message lists what it has.
    MissingDependencyError
        The package rosbags is not installed.

    Warns
    -----
    DroppedPointsWarning
        Messages without a pose at their time, points at exactly 0 0 0 or points that are not finite
        were left out; the message counts them.
    LostAttributeWarning
        Fields that not all messages have were left aside.
    """
    path = Path(path)
    if message is not None and (isinstance(message, bool) or message < 0):
        raise _wrong("message", message, "a number from 0")
    notes = Notes(path)
    with open_bag(path) as reader:
        chosen = _choose_topic(path, topics_of(reader), topic)
        if message is not None and message >= chosen.count:
            raise _wrong("message", message, f"less than {chosen.count}, as {chosen.name} has")
        scans = _read_scans(path, reader, chosen, message, notes)
        if not scans:
            raise format_error(path, f"{chosen.name} has no messages")
        _check_positions(path, chosen, scans)
        _drop_no_returns(scans, notes)
        centers = None
        if poses != _NO_POSES and (message is None or poses is not None):
            placing = _Placing(path, reader, scans[0].frame, poses)
            known = placing.moves(scans[0].frame) or placing.is_fixed(scans[0].frame)
            if known or placing.track or poses == _TREE:
                scans, centers = _placed(path, scans, placing, frame, notes)
            elif fused and len(scans) > 1:
                raise InvalidInputError(
                    f"{path} has {len(scans)} messages on {chosen.name} and no poses for them; "
                    "read one with message=, or all in the sensor's frame with poses='none'"
                )
    if fused:
        return _fused(path, scans, centers, notes)
    clouds = [
        _fused(path, [scan], None if centers is None else centers[i : i + 1], Notes(path))
        for i, scan in enumerate(scans)
    ]
    notes.warn()
    return clouds


def write_mcap(
    path: Path, cloud: PointCloud, *, topic: str = "/points", frame: str = "map"
) -> None:
    """Writes a cloud as one `PointCloud2` message in an MCAP file, as ROS 2 records them.

    Parameters
    ----------
    path
        The file, replaced in one piece.
    cloud
        What to write, in world coordinates: as 32-bit floats, or as 64-bit floats where the cloud
        lies far from the origin. Colours are packed in a field `rgb`, as ROS tools expect.
    topic
        The message's topic.
    frame
        The frame that its coordinates are in.

    Raises
    ------
    MissingDependencyError
        The package rosbags is not installed.

    Warns
    -----
    LostAttributeWarning
        Columns of 64-bit integers, which the message does not have, were left out.
    """
    purpose = "writing MCAP files"
    rosbag2 = optional_module("rosbags.rosbag2", REQUIREMENT, purpose)
    typesys = optional_module("rosbags.typesys", REQUIREMENT, purpose)
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    columns = columns_from_cloud(cloud) | viewpoint_columns(cloud)
    lost = [name for name, column in columns.items() if not can_encode(column)]
    columns = {name: column for name, column in columns.items() if name not in lost}
    if cloud.colors is not None:
        red, green, blue = (columns.pop(name).astype(np.uint32) for name in _CHANNELS)
        columns["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)
    message = encode(columns, store, frame)
    with written_whole(path) as temporary:
        folder = Path(tempfile.mkdtemp(prefix=f".{path.stem}.", dir=temporary.parent))
        try:
            plugin = rosbag2.StoragePlugin.MCAP
            with rosbag2.Writer(folder / "bag", version=9, storage_plugin=plugin) as writer:
                connection = writer.add_connection(topic, TYPE, typestore=store)
                writer.write(connection, 0, store.serialize_cdr(message, TYPE))
            os.replace(folder / "bag" / "bag.mcap", temporary)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    warn_lost(path, "MCAP", lost)
