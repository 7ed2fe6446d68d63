"""`surfabet locate`: where in a saved model a scan was taken."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number

from surfabet.cli._files import load_model, load_vocabulary, read_cloud
from surfabet.cli._format import print_json
from surfabet.cli._numbers import WHOLE
from surfabet.cli._options import (
    COMMON,
    READ_OPTIONS,
    VOCABULARY_OPTION,
    Common,
    Flag,
    PositiveFloat,
    ReadOptions,
    UsageError,
    VocabularyOption,
)
from surfabet.locate import Location

Prior = tuple[float, float, float, float]


def locate(
    file: Annotated[Path, Parameter(name="FILE")],
    scan: Annotated[Path, Parameter(name="SCAN")],
    /,
    *,
    prior: Annotated[Prior | None, Parameter(negative=())] = None,
    radius: PositiveFloat = None,
    angle: PositiveFloat = None,
    upright: Annotated[bool | None, Parameter(negative="--any-tilt")] = None,
    top: Annotated[int, Parameter(validator=Number(gte=1)), WHOLE] = 5,
    json: Flag = False,
    options: ReadOptions = READ_OPTIONS,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    common: Common = COMMON,
) -> int | None:
    """Find where in a model a scan was taken, from the model alone.

    The scan is in the frame of its sensor, which stands at zero. Several places are given where
    they look alike, none where none can be defended; the exit code is 1 then. Where that is since
    the scan fits in several places, they are shown, though none is accepted.

        surfabet locate map.sfb scan.pcd
        surfabet locate map.sfb scan.pcd --prior 1.2 0.4 0 90 --radius 2 --json

    Parameters
    ----------
    file
        The model file.
    scan
        The scan: any cloud that surfabet reads.
    prior
        What is known of the pose: `X Y Z YAW` of the sensor, metres and degrees.
    radius
        How far the sensor may be from the prior, metres; by default 1.
    angle
        How far the scan may be turned from the prior, degrees; by default 20.
    upright
        The vertical of the scan is that of the map within 45 degrees; with --any-tilt it may be
        any. By default upright poses are tried first, then all others.
    top
        Most places that are given.
    json
        Print one JSON object instead of lines.
    """
    if prior is None and (radius is not None or angle is not None):
        raise UsageError("--radius and --angle go with --prior")
    with common.progress() as progress:
        model = load_model(file, progress, load_vocabulary(vocabulary, progress))
        found = model.locate(
            read_cloud(scan, options, progress),
            prior=prior,
            radius=radius,
            angle=angle,
            upright=upright,
            top=top,
            progress=progress,
        )
    if json:
        print_json(
            {
                "path": str(file),
                "scan": str(scan),
                "locations": [_fields(place) for place in found],
                "is_ambiguous": found.is_ambiguous,
                "n_places": found.n_places,
                "refusal": found.refusal,
                "reason": found.reason,
                "free_along": found.free_along.tolist(),
                "free_about": found.free_about.tolist(),
                "rejected": [_fields(place) for place in found.rejected],
            }
        )
    elif not common.quiet:
        if not found:
            print(f"no place: {found.reason}")
        shown = [p for p in (*found, *found.rejected) if p.probability > 0]
        if shown:
            print("probability  score        x        y        z      yaw  explained  contradicted")
        for place in shown:
            x, y, z = place.pose[:3, 3]
            yaw = math.degrees(math.atan2(place.pose[1, 0], place.pose[0, 0]))
            print(
                f"{place.probability:11.3f}  {place.score:.3f} {x:8.3f} {y:8.3f} {z:8.3f} "
                f"{yaw:8.2f} {place.explained:10.3f} {place.contradicted:13.3f}"
            )
    return None if found else 1


def _fields(place: Location) -> dict[str, Any]:
    return {
        "probability": place.probability,
        "score": place.score,
        "pose": place.pose.tolist(),
        "covariance": place.covariance.tolist(),
        "explained": place.explained,
        "contradicted": place.contradicted,
        "in_front": place.in_front,
    }
