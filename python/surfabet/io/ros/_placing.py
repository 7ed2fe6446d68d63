"""Placing messages in a common frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet.errors import InvalidInputError, wrong_value
from surfabet.io._columns import Column
from surfabet.io._files import format_error
from surfabet.io._notes import Notes
from surfabet.io.ros._bags import topics_of
from surfabet.io.ros._transforms import (
    ODOMETRY_TYPE,
    TRACK_TYPES,
    Edge,
    note_invalid,
    poses_along,
    read_track,
    read_tree,
)

NO_POSES = "none"
TREE = "tf"
_NORMALS = (("normal_x", "normal_y", "normal_z"), ("nx", "ny", "nz"))


@dataclass
class Scan:
    """One message."""

    columns: dict[str, Column]
    stamp: int
    frame: str


class Placing:
    """How frames get into the common one: the steps from each."""

    def __init__(self, path: Path, reader: Any, frame: str, source: str | None) -> None:
        """`frame` is that of the clouds; `source` is the user's, or what the bag has."""
        self.path = path
        self.tree = read_tree(path, reader)
        self.track: Edge | None = None
        tracks = [topic for topic in topics_of(reader) if topic.type in TRACK_TYPES]
        if source not in (None, TREE, NO_POSES):
            chosen = next((topic for topic in tracks if topic.name == source), None)
            if chosen is None:
                known = ", ".join(topic.name for topic in tracks) or "none here"
                raise wrong_value(
                    "poses", source, f"tf, none, or a topic of odometry or poses: {known}"
                )
            self.track = read_track(path, reader, chosen.name, chosen.type, frame)
        elif source is None and not self.moves(frame) and not self.is_fixed(frame):
            odometry = [topic for topic in tracks if topic.type == ODOMETRY_TYPE]
            if len(odometry) > 1:
                known = ", ".join(topic.name for topic in odometry)
                raise InvalidInputError(f"{path} has several odometries; name one: poses={known}")
            if odometry:
                self.track = read_track(path, reader, odometry[0].name, ODOMETRY_TYPE, frame)
        if source == TREE and not self.tree.chain(frame) and not self.is_fixed(frame):
            raise wrong_value("poses", source, f"another source, since /tf has no frame {frame!r}")

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
            raise wrong_value("frame", target, f"one of those above the cloud's: {known}")
        return steps


def _place(scan: Scan, pose: NDArray[np.float64]) -> None:
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


@dataclass(frozen=True)
class Place:
    """Where a message goes."""

    number: int
    pose: NDArray[np.float64]
    is_moved: bool
    """Whether its points are in another frame than the common one."""


def places_of(
    path: Path,
    heads: Sequence[tuple[str, int]],
    placing: Placing,
    target: str | None,
    notes: Notes,
) -> tuple[list[Place], NDArray[np.float64] | None]:
    """The messages that can be placed, given by frame and time, frame by frame, and where the
    sensor was for each."""
    found: list[Place] = []
    moved = False
    for frame in dict.fromkeys(frame for frame, _ in heads):
        own = [number for number, (other, _) in enumerate(heads) if other == frame]
        steps = placing.steps(frame, target, notes)
        moved = moved or bool(steps)
        poses, known = poses_along(steps, np.array([heads[i][1] for i in own], np.int64))
        for number, pose, there in zip(own, poses, known, strict=True):
            if there:
                found.append(Place(number, pose, bool(steps)))
    note_invalid(placing.tree, notes)
    if n_lost := len(heads) - len(found):
        notes.points(
            f"left out {n_lost} of {len(heads)} messages, for whose times there is no pose"
        )
    if not found:
        raise format_error(
            path, "no message could be placed; read one with message=, or all with poses='none'"
        )
    return found, np.array([place.pose[:3, 3] for place in found]) if moved else None


def put(scan: Scan, place: Place) -> Scan:
    """The scan in the common frame; changes it."""
    if place.is_moved:
        _place(scan, place.pose)
    return scan
