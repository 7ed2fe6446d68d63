"""Where frames were and when: the tree of `/tf` and `/tf_static`, and odometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet.io._files import format_error
from surfabet.io._notes import Notes
from surfabet.io.ros._bags import as_defined, frame_of, messages, stamp_of, topics_of

_TF_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_STATIC = "tf_static"
ODOMETRY_TYPE = "nav_msgs/msg/Odometry"
_POSE_TYPE = "geometry_msgs/msg/PoseStamped"
_TRANSFORM_TYPE = "geometry_msgs/msg/TransformStamped"
TRACK_TYPES = (
    ODOMETRY_TYPE,
    _POSE_TYPE,
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    _TRANSFORM_TYPE,
)
"""The types of messages that say where one frame is."""
# Below this cosine's distance to 1, slerp divides by nearly nothing, and is linear anyway.
_NEARLY_ALIKE = 1e-9
_UNIT_TOLERANCE = 0.01


@dataclass
class Edge:
    """Where a frame is in its parent, by time."""

    child: str
    parent: str
    static: bool
    # Nanoseconds; x, y, z; quaternions x, y, z, w.
    stamps: list[int] = field(default_factory=list)
    translations: list[tuple[float, float, float]] = field(default_factory=list)
    rotations: list[tuple[float, float, float, float]] = field(default_factory=list)

    def add(self, stamp: int, translation: Any, rotation: Any) -> bool:
        """Another pose, unless it is none."""
        q = (rotation.x, rotation.y, rotation.z, rotation.w)
        t = (translation.x, translation.y, translation.z)
        if not np.isfinite([*q, *t]).all() or abs(np.linalg.norm(q) - 1) > _UNIT_TOLERANCE:
            return False
        self.stamps.append(stamp)
        self.translations.append(t)
        self.rotations.append(q)
        return True

    def at(self, stamps: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Child-to-parent matrices, (n, 4, 4), at these times, and which of them are known.

        Between two known poses, positions are interpolated linearly and rotations along the
        shortest arc.
        """
        times, order = np.unique(np.array(self.stamps, np.int64), return_index=True)
        shifts = np.array(self.translations, np.float64).reshape(-1, 3)[order]
        turns = np.array(self.rotations, np.float64).reshape(-1, 4)[order]
        if len(times) == 0:
            return np.zeros((len(stamps), 4, 4)), np.zeros(len(stamps), bool)
        if self.static:
            # The last word counts.
            last = np.full(len(stamps), len(times) - 1)
            return _matrices(shifts[last], turns[last]), np.ones(len(stamps), bool)
        known = (stamps >= times[0]) & (stamps <= times[-1])
        before = np.clip(np.searchsorted(times, stamps, "right") - 1, 0, max(0, len(times) - 2))
        after = np.minimum(before + 1, len(times) - 1)
        span = np.maximum(times[after] - times[before], 1)
        share = ((stamps - times[before]) / span).clip(0, 1)[:, None]
        shift = shifts[before] + share * (shifts[after] - shifts[before])
        return _matrices(shift, _slerp(turns[before], turns[after], share)), known


def _slerp(
    a: NDArray[np.float64], b: NDArray[np.float64], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Unit quaternions at a share of the shorter arc from `a` to `b`."""
    cosine = (a * b).sum(axis=1, keepdims=True)
    b = np.where(cosine < 0, -b, b)
    cosine = np.abs(cosine).clip(0, 1)
    angle = np.arccos(cosine)
    alike = 1 - cosine < _NEARLY_ALIKE
    sine = np.where(alike, 1, np.sin(angle))
    weight_a = np.where(alike, 1 - share, np.sin((1 - share) * angle) / sine)
    weight_b = np.where(alike, share, np.sin(share * angle) / sine)
    return np.asarray(weight_a * a + weight_b * b)


def _matrices(shift: NDArray[np.float64], turn: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z, w = (turn / np.linalg.norm(turn, axis=1, keepdims=True)).T
    matrices = np.zeros((len(shift), 4, 4))
    matrices[:, 0, 0] = 1 - 2 * (y * y + z * z)
    matrices[:, 0, 1] = 2 * (x * y - z * w)
    matrices[:, 0, 2] = 2 * (x * z + y * w)
    matrices[:, 1, 0] = 2 * (x * y + z * w)
    matrices[:, 1, 1] = 1 - 2 * (x * x + z * z)
    matrices[:, 1, 2] = 2 * (y * z - x * w)
    matrices[:, 2, 0] = 2 * (x * z - y * w)
    matrices[:, 2, 1] = 2 * (y * z + x * w)
    matrices[:, 2, 2] = 1 - 2 * (x * x + y * y)
    matrices[:, :3, 3] = shift
    matrices[:, 3, 3] = 1
    return matrices


class TransformTree:
    """The frames of a bag, each with its parent."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.edges: dict[str, Edge] = {}
        self.n_invalid = 0

    def add(self, parent: str, child: str, static: bool, stamp: int, pose: tuple[Any, Any]) -> None:
        """Another pose of `child` in `parent`: translation and quaternion."""
        edge = self.edges.setdefault(child, Edge(child, parent, static))
        if edge.parent != parent:
            raise format_error(
                self.path,
                f"frame {child!r:.60} hangs on both {edge.parent!r:.60} and {parent!r:.60}; give "
                "poses= another source, or 'none'",
            )
        if not edge.add(stamp, *pose):
            self.n_invalid += 1

    def chain(self, frame: str, target: str | None = None) -> list[Edge]:
        """The steps from a frame up to `target`, or to the root; up to the root without it."""
        steps: list[Edge] = []
        while frame != target and frame in self.edges:
            if len(steps) > len(self.edges):
                raise format_error(self.path, f"the frames above {frame!r:.60} form a ring")
            steps.append(self.edges[frame])
            frame = steps[-1].parent
        return steps


def read_tree(path: Path, reader: Any) -> TransformTree:
    """The tree of a bag's `/tf` and `/tf_static`."""
    tree = TransformTree(path)
    names = [topic.name for topic in topics_of(reader) if topic.type in _TF_TYPES]
    for topic, stamp, message in messages(path, reader, names):
        static = topic.rpartition("/")[2] == _STATIC
        with as_defined(path, topic):
            for step in message.transforms:
                parent, child = frame_of(step.header.frame_id), frame_of(step.child_frame_id)
                pose = step.transform.translation, step.transform.rotation
                tree.add(parent, child, static, stamp_of(step, stamp), pose)
    return tree


def _tracked(message: Any, type_: str) -> tuple[str, tuple[Any, Any]]:
    """The frame that a message is about, if it says, and its translation and quaternion."""
    if type_ == _TRANSFORM_TYPE:
        step = message.transform
        return frame_of(message.child_frame_id), (step.translation, step.rotation)
    body = message.pose if type_ == _POSE_TYPE else message.pose.pose
    child = frame_of(message.child_frame_id) if type_ == ODOMETRY_TYPE else ""
    return child, (body.position, body.orientation)


def read_track(path: Path, reader: Any, topic: str, type_: str, frame: str) -> Edge:
    """The poses that one topic gives; those without a frame of their own are of `frame`."""
    track: Edge | None = None
    for _, stamp, message in messages(path, reader, [topic]):
        with as_defined(path, type_):
            child, pose = _tracked(message, type_)
            parent = frame_of(message.header.frame_id)
            track = track or Edge(child or frame, parent, static=False)
            if (child or frame, parent) != (track.child, track.parent):
                raise format_error(
                    path, f"{topic} has poses of several frames; give poses= another"
                )
            track.add(stamp_of(message, stamp), *pose)
    if track is None:
        raise format_error(path, f"{topic} has no messages")
    return track


def poses_along(
    steps: Sequence[Edge], stamps: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Matrices from the first frame to the last parent at these times, and which are known."""
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    known = np.ones(len(stamps), bool)
    for step in steps:
        matrices, there = step.at(stamps)
        poses = matrices @ poses
        known &= there
    return poses, known


def note_invalid(tree: TransformTree, notes: Notes) -> None:
    """Notes how many transforms were none."""
    if tree.n_invalid:
        notes.aside(f"{tree.n_invalid} transforms that are not finite or no rotation")
