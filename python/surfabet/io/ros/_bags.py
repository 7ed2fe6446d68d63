"""Opening bags of ROS 1 and ROS 2: their topics and messages."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from surfabet.errors import FormatError
from surfabet.io._files import format_error, optional_module
from surfabet.io.ros._chunks import bound_chunks, check_files

REQUIREMENT = "rosbags>=0.11"
_METADATA = "metadata.yaml"
_STORAGE_SUFFIXES = (".db3", ".mcap")


@dataclass(frozen=True)
class Topic:
    """A topic of a bag."""

    name: str
    type: str
    """Of its messages, as `sensor_msgs/msg/PointCloud2`."""
    count: int
    """How many messages it has."""


def is_bag(folder: Path) -> bool:
    """Whether a folder is a bag of ROS 2."""
    if not (folder / _METADATA).is_file():
        return False
    # The files may be packed, as `.db3.zstd`.
    names = [entry.suffixes for entry in folder.iterdir()]
    return any(suffix in suffixes for suffixes in names for suffix in _STORAGE_SUFFIXES)


def _unreadable(path: Path, error: Exception) -> FormatError:
    return format_error(path, f"not a readable bag: {str(error) or type(error).__name__}")


@contextmanager
def open_bag(path: Path) -> Iterator[Any]:
    """The bag's reader, which knows the types of its messages."""
    purpose = "reading ROS bags"
    highlevel = optional_module("rosbags.highlevel", REQUIREMENT, purpose)
    typesys = optional_module("rosbags.typesys", REQUIREMENT, purpose)
    # Bags before ROS 2 Iron have no definitions; those of the messages read here never changed.
    store = typesys.get_typestore(typesys.Stores.LATEST)
    try:
        check_files(path)
        reader = highlevel.AnyReader([path], default_typestore=store)
        reader.open()
    except FormatError:
        raise
    except Exception as error:
        # The package raises errors of its own, and what struct, sqlite and YAML raise.
        raise _unreadable(path, error) from error
    try:
        bound_chunks(path, reader)
        yield reader
    finally:
        reader.close()


def topics_of(reader: Any) -> list[Topic]:
    """The topics of an open bag, by name."""
    return [
        Topic(name, topic.msgtype or "several types", topic.msgcount)
        for name, topic in sorted(reader.topics.items())
    ]


def messages(
    path: Path, reader: Any, topics: Collection[str], only: int | None = None
) -> Iterator[tuple[str, int, Any]]:
    """Topic, time in nanoseconds and content of each message in order, or of one by its number."""
    connections = [c for c in reader.connections if c.topic in topics]
    if not connections:
        return
    try:
        for number, (connection, stamp, data) in enumerate(reader.messages(connections)):
            if only is None or number == only:
                yield connection.topic, stamp, reader.deserialize(data, connection.msgtype)
            if number == only:
                return
    except FormatError:
        raise
    except Exception as error:
        raise _unreadable(path, error) from error


@contextmanager
def as_defined(path: Path, what: str) -> Iterator[None]:
    """Bags define the types of their messages; where they do so wrongly, members are missing."""
    try:
        yield
    except FormatError:
        raise
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise format_error(path, f"{what} is not defined as usual: {error}") from error


def stamp_of(message: Any, otherwise: int) -> int:
    """Nanoseconds at which a message's content was measured, if its header says."""
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec) or otherwise


def frame_of(name: str) -> str:
    """The name of a frame; ROS 1 allowed a slash before it."""
    return name.removeprefix("/")
