"""ROS bags without ROS: `PointCloud2` from bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap, folders).

Messages are placed by the tree of `/tf` and `/tf_static`, or by a topic of odometry or poses, at
the times of their headers. Written are MCAP files of one message.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from surfabet._core import PointCloud
from surfabet.errors import InvalidInputError
from surfabet.io._columns import VIEWPOINT_INDEX, Column, cloud_from_columns, no_returns
from surfabet.io._files import format_error
from surfabet.io._notes import Notes
from surfabet.io._packed import unpacked
from surfabet.io.ros._bags import (
    Topic,
    as_defined,
    frame_of,
    is_bag,
    messages,
    open_bag,
    stamp_of,
    topics_of,
)
from surfabet.io.ros._mcap import write_mcap
from surfabet.io.ros._placing import NO_POSES, TREE, Placing, Scan, placed, wrong_option
from surfabet.io.ros._point_cloud2 import TYPE, decode

__all__ = ["Topic", "is_bag", "list_topics", "read_bag", "write_mcap"]


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
    with unpacked(Path(path)) as there, open_bag(there) as reader:
        return topics_of(reader)


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
        raise wrong_option("topic", name, f"one with PointCloud2 messages: {known}")
    return chosen


def _read_scans(
    path: Path, reader: Any, topic: Topic, number: int | None, notes: Notes
) -> list[Scan]:
    scans = []
    for _, stamp, message in messages(path, reader, [topic.name], number):
        with as_defined(path, topic.type):
            frame = frame_of(message.header.frame_id)
            scans.append(Scan(decode(path, message, notes), stamp_of(message, stamp), frame))
    return scans


def _drop_no_returns(scans: Sequence[Scan], notes: Notes) -> None:
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


def _joined(scans: Sequence[Scan], notes: Notes) -> dict[str, Column]:
    """The columns that all scans have, one scan after the other."""
    names = [n for n in scans[0].columns if all(n in scan.columns for scan in scans)]
    partial = {name: None for scan in scans for name in scan.columns if name not in names}
    for name in partial:
        n_with = sum(name in scan.columns for scan in scans)
        notes.aside(f"{name!r:.40}, which {n_with} of {len(scans)} messages have")
    return {name: np.concatenate([scan.columns[name] for scan in scans]) for name in names}


def _fused(
    path: Path, scans: Sequence[Scan], centers: NDArray[np.float64] | None, notes: Notes
) -> PointCloud:
    columns = _joined(scans, notes)
    if centers is not None:
        counts = [len(scan.columns["x"]) for scan in scans]
        columns[VIEWPOINT_INDEX] = np.repeat(np.arange(len(scans), dtype=np.uint32), counts)
    return cloud_from_columns(path, columns, viewpoints=centers, notes=notes)


def _check_positions(path: Path, topic: Topic, scans: Sequence[Scan]) -> None:
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
        raise wrong_option("message", message, "a number from 0")
    notes = Notes(path)
    with unpacked(path) as there, open_bag(there) as reader:
        chosen = _choose_topic(path, topics_of(reader), topic)
        if message is not None and message >= chosen.count:
            raise wrong_option(
                "message", message, f"less than {chosen.count}, as {chosen.name} has"
            )
        scans = _read_scans(path, reader, chosen, message, notes)
        if not scans:
            raise format_error(path, f"{chosen.name} has no messages")
        _check_positions(path, chosen, scans)
        _drop_no_returns(scans, notes)
        centers = None
        if poses != NO_POSES and (message is None or poses is not None):
            placing = Placing(path, reader, scans[0].frame, poses)
            known = placing.moves(scans[0].frame) or placing.is_fixed(scans[0].frame)
            if known or placing.track or poses == TREE:
                scans, centers = placed(path, scans, placing, frame, notes)
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
