"""ROS bags without ROS: `PointCloud2` from bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap, folders).

Messages are placed by the tree of `/tf` and `/tf_static`, or by a topic of odometry or poses, at
the times of their headers. Written are MCAP files of one message.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from surfabet._checks import check_flag, check_integer, check_text
from surfabet._core import PointCloud
from surfabet.errors import InvalidInputError, wrong_value
from surfabet.io._columns import (
    VIEWPOINT_INDEX,
    Column,
    Part,
    cloud_from_columns,
    clouds_of_parts,
    no_returns,
)
from surfabet.io._files import existing, format_error, path_of
from surfabet.io._notes import HeldNotes, Notes
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
from surfabet.io.ros._placing import (
    NO_POSES,
    TREE,
    Place,
    Placing,
    Scan,
    places_of,
    put,
)
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
    with unpacked(existing(path_of("path", path))) as there, open_bag(there) as reader:
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
        raise wrong_value("topic", name, f"one with PointCloud2 messages: {known}")
    return chosen


def _scans(
    path: Path, reader: Any, topic: Topic, number: int | None, notes: Notes
) -> Iterator[Scan]:
    """The messages of a topic in order, or one by its number."""
    for _, stamp, message in messages(path, reader, [topic.name], number):
        with as_defined(path, topic.type):
            frame = frame_of(message.header.frame_id)
            scan = Scan(decode(path, message, notes), stamp_of(message, stamp), frame)
        yield scan


def _drop_no_returns(scan: Scan, notes: Notes) -> None:
    """Leaves out points at exactly 0 0 0, which would become the sensor's position."""
    empty = no_returns(np.stack([scan.columns[axis] for axis in "xyz"], axis=1))
    notes.left_out(
        "at exactly 0 0 0 (no returns) in the frame of the sensor", int(empty.sum()), len(empty)
    )
    if empty.any():
        scan.columns = {name: column[~empty] for name, column in scan.columns.items()}


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


def _check_positions(path: Path, topic: Topic, scan: Scan) -> None:
    if not {"x", "y", "z"} <= scan.columns.keys():
        raise format_error(
            path, f"{topic.name} has no fields x, y and z among {sorted(scan.columns)}"
        )


def _as_they_are(n: int) -> list[Place]:
    """Messages that stay in their own frame."""
    return [Place(number, np.eye(4), False) for number in range(n)]


def _route(
    path: Path,
    reader: Any,
    topic: Topic,
    heads: Sequence[tuple[str, int]],
    options: tuple[str | None, str | None],
    is_one: bool,
    notes: Notes,
) -> tuple[list[Place], NDArray[np.float64] | None] | None:
    """Where the messages go, by `poses` and `frame`; None to leave them as they are.

    `is_one` says that nothing more than one message is asked for, or clouds one by one.
    """
    poses, target = options
    first = heads[0][0]
    placing = Placing(path, reader, first, poses)
    known = placing.moves(first) or placing.is_fixed(first)
    if known or placing.track or poses == TREE:
        return places_of(path, heads, placing, target, notes)
    if not is_one:
        raise InvalidInputError(
            f"{path} has {len(heads)} messages on {topic.name} and no poses for them; "
            "read one with message=, or all in the sensor's frame with poses='none'"
        )
    return None


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
    path = existing(path_of("path", path))
    check_flag("fused", fused)
    if message is not None:
        check_integer("message", message, 0)
    for name, text in (("topic", topic), ("poses", poses), ("frame", frame)):
        if text is not None:
            check_text(name, text)
    notes = Notes(path)
    with unpacked(path) as there, open_bag(there) as reader:
        chosen = _choose_topic(path, topics_of(reader), topic)
        if message is not None and message >= chosen.count:
            raise wrong_value("message", message, f"less than {chosen.count}, as {chosen.name} has")
        scans = list(_scans(path, reader, chosen, message, notes))
        if not scans:
            raise format_error(path, f"{chosen.name} has no messages")
        for scan in scans:
            _check_positions(path, chosen, scan)
        places, centers = _as_they_are(len(scans)), None
        if poses != NO_POSES and (message is None or poses is not None):
            heads = [(scan.frame, scan.stamp) for scan in scans]
            is_one = not fused or len(scans) == 1
            route = _route(path, reader, chosen, heads, (poses, frame), is_one, notes)
            places, centers = route or (places, centers)
        for place in places:
            _drop_no_returns(scans[place.number], notes)
        scans = [put(scans[place.number], place) for place in places]
    if fused:
        return _fused(path, scans, centers, notes)
    clouds = [
        _fused(path, [scan], None if centers is None else centers[i : i + 1], Notes(path))
        for i, scan in enumerate(scans)
    ]
    notes.warn()
    return clouds


@dataclass(frozen=True)
class _Head:
    """What is kept of a message while others are read."""

    frame: str
    stamp: int
    types: Mapping[str, np.dtype[Any]]
    """Of its columns as they are, and placed."""
    placed: Mapping[str, np.dtype[Any]]

    @classmethod
    def of(cls, scan: Scan) -> _Head:
        types = {name: column.dtype for name, column in scan.columns.items()}
        one = Scan({name: np.zeros(1, dtype) for name, dtype in types.items()}, 0, scan.frame)
        put(one, Place(0, np.eye(4), True))
        return cls(
            scan.frame, scan.stamp, types, {name: c.dtype for name, c in one.columns.items()}
        )


def read_bag_chunks(path: Path, n: int) -> Iterator[PointCloud]:
    """The messages of a bag as clouds of at most `n` points, with the points and attributes of
    `read_bag` in its order; one message is in memory at a time.

    The bag is read three times: for the times of its messages, for what is known of all points, and
    for these.

    Raises
    ------
    FormatError, InvalidInputError, MissingDependencyError
        As `read_bag`.
    """
    notes = HeldNotes(path)
    with open_bag(path) as reader:
        topic = _choose_topic(path, topics_of(reader), None)
        heads: list[_Head] = []
        for scan in _scans(path, reader, topic, None, HeldNotes(path)):
            _check_positions(path, topic, scan)
            heads.append(_Head.of(scan))
        if not heads:
            raise format_error(path, f"{topic.name} has no messages")
        route = _route(
            path, reader, topic, [(head.frame, head.stamp) for head in heads], (None, None),
            len(heads) == 1, notes,
        )  # fmt: skip
        places, centers = route or (_as_they_are(len(heads)), None)
        types = _common_types(heads, places, notes)

        def parts(notes: Notes) -> Iterator[Part]:
            for i, scan in enumerate(_in_order(path, reader, topic, places, notes)):
                columns = {name: scan.columns[name].astype(types[name]) for name in types}
                if centers is not None:
                    columns[VIEWPOINT_INDEX] = np.zeros(len(columns["x"]), np.uint32)
                for start in range(0, len(columns["x"]), n):
                    part = {name: c[start : start + n] for name, c in columns.items()}
                    yield part, None if centers is None else centers[i : i + 1]

        yield from clouds_of_parts(path, parts, notes)


def _common_types(
    heads: Sequence[_Head], places: Sequence[Place], notes: Notes
) -> dict[str, np.dtype[Any]]:
    """The columns that all messages have, of types that are wide enough for all."""
    of_all = [
        heads[place.number].placed if place.is_moved else heads[place.number].types
        for place in places
    ]
    types = {}
    for name in dict.fromkeys(name for own in of_all for name in own):
        found = [own[name] for own in of_all if name in own]
        if len(found) == len(of_all):
            types[name] = np.result_type(*set(found))
        else:
            notes.aside(f"{name!r:.40}, which {len(found)} of {len(of_all)} messages have")
    return types


def _in_order(
    path: Path, reader: Any, topic: Topic, places: Sequence[Place], notes: Notes
) -> Iterator[Scan]:
    """The scans that are placed, in the order of their places: once through the bag for each
    frame."""
    at = 0
    while at < len(places):
        for number, scan in enumerate(_scans(path, reader, topic, None, notes)):
            if at < len(places) and places[at].number == number:
                _drop_no_returns(scan, notes)
                yield put(scan, places[at])
                at += 1
