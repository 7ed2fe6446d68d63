"""Writing clouds as MCAP files, which ROS 2 records and plays."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import numpy as np

from surfabet._core import PointCloud
from surfabet.io._columns import columns_from_cloud, viewpoint_columns, warn_lost
from surfabet.io._files import optional_module, written_whole
from surfabet.io.ros._bags import REQUIREMENT
from surfabet.io.ros._point_cloud2 import TYPE, can_encode, encode

_CHANNELS = ("red", "green", "blue")


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
