"""`surfabet places`: which of many places a scan shows, and which places are of one kind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from cyclopts.validators import Number

import surfabet
from surfabet._progress import ProgressCallback
from surfabet.cli._files import MODEL_SUFFIX, load_model, load_vocabulary, read_cloud
from surfabet.cli._format import print_json
from surfabet.cli._numbers import WHOLE
from surfabet.cli._options import (
    COMMON,
    READ_OPTIONS,
    VOCABULARY_OPTION,
    Common,
    Flag,
    ReadOptions,
    UsageError,
    VocabularyOption,
)
from surfabet.files import AnyModel, Vocabulary
from surfabet.places import AnyPlace, PlaceMatch


def places(
    *files: Annotated[Path, Parameter(name="FILE")],
    query: Path | None = None,
    top: Annotated[int, Parameter(validator=Number(gte=1)), WHOLE] = 5,
    verify: Annotated[int, Parameter(validator=Number(gte=0)), WHOLE] = 3,
    kinds: Annotated[int | None, Parameter(validator=Number(gte=1)), WHOLE] = None,
    json: Flag = False,
    options: ReadOptions = READ_OPTIONS,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    common: Common = COMMON,
) -> int | None:
    """Find which of many places a scan shows and where in it, or which places are of one kind.

    Without --query every place is named with its kind and the other place most like it. Models of
    --model alphabet are compared as they are, other models and clouds are described with words
    first.

        surfabet places *.sfb --query scan.pcd
        surfabet places *.sfb --kinds 4 --json

    Parameters
    ----------
    files
        The places: models, or clouds.
    query
        A scan in the frame of its sensor, or a model, that is looked for. The exit code is 1 when
        it is located in none of the places that are tried.
    top
        Most places that are given, the most similar first.
    verify
        In how many of these the scan is located; with 0 similarity alone is given.
    kinds
        How many kinds of places; by default as many as their similarity leaves.
    json
        Print one JSON object instead of lines.
    """
    if not files:
        raise UsageError("name at least one place")
    if query is not None and kinds is not None:
        raise UsageError("--kinds is for places alone, without --query")
    with common.progress() as progress:
        known = load_vocabulary(vocabulary, progress)
        read = [_place(file, options, progress, known) for file in files]
        if query is None:
            _print_kinds(files, read, kinds, json, common.quiet)
            return None
        asked = _place(query, options, progress, known)
        index = surfabet.place_index({str(f): p for f, p in zip(files, read, strict=True)})
        found = index.query(asked, top=top, verify=verify, progress=progress)
    if json:
        print_json({"query": str(query), "places": [_fields(match) for match in found]})
    elif not common.quiet:
        print("similarity  probability        x        y        z      yaw  place")
        for match in found:
            print(_line(match))
    is_located = verify == 0 or any(match.pose is not None for match in found)
    return None if is_located else 1


def _place(
    path: Path, options: ReadOptions, progress: ProgressCallback, known: Vocabulary | None
) -> AnyModel | surfabet.PointCloud:
    if path.suffix.lower() == MODEL_SUFFIX:
        return load_model(path, progress, known)
    return read_cloud(path, options, progress)


def _line(match: PlaceMatch) -> str:
    if match.pose is None:
        why = "not tried" if match.locations is None else match.locations.reason
        return f"{match.similarity:10.3f} {'':48s} {match.name} ({why})"
    assert match.locations is not None
    x, y, z = match.pose[:3, 3]
    yaw = math.degrees(math.atan2(match.pose[1, 0], match.pose[0, 0]))
    return (
        f"{match.similarity:10.3f} {match.locations[0].probability:12.3f} {x:8.3f} {y:8.3f} "
        f"{z:8.3f} {yaw:8.2f}  {match.name}"
    )


def _fields(match: PlaceMatch) -> dict[str, Any]:
    located = match.locations
    return {
        "place": match.name,
        "similarity": match.similarity,
        "tried": located is not None,
        "reason": None if located is None else located.reason,
        "locations": [
            {"pose": place.pose.tolist(), "probability": place.probability, "score": place.score}
            for place in located or ()
        ],
    }


def _print_kinds(
    files: tuple[Path, ...], read: Sequence[AnyPlace], n_kinds: int | None, json: bool, quiet: bool
) -> None:
    index = surfabet.place_index(read)
    kinds = surfabet.label_places(index.models, n_kinds=n_kinds)
    alike = index.similarities - 2.0 * np.eye(len(index))
    nearest = alike.argmax(axis=1)
    rows = [
        {
            "place": str(file),
            "kind": int(kind),
            "nearest": str(files[other]) if len(files) > 1 else None,
            "similarity": float(alike[i, other]) if len(files) > 1 else None,
        }
        for i, (file, kind, other) in enumerate(zip(files, kinds.labels, nearest, strict=True))
    ]
    if json:
        print_json({"kinds": len(kinds), "places": rows})
    elif not quiet:
        print("kind  place")
        for row in rows:
            alone = row["nearest"] is None
            beside = "" if alone else f"  {row['similarity']:.3f} like {row['nearest']}"
            print(f"{row['kind']:4d}  {row['place']}{beside}")
