"""`surfabet compress`: cloud in, model file out."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

import surfabet
from surfabet._progress import ProgressCallback
from surfabet.cli._files import (
    MODEL_SUFFIX,
    check_output,
    load_model,
    load_vocabulary,
    read_cloud,
    whole_file,
)
from surfabet.cli._format import print_json
from surfabet.cli._learn import Learner
from surfabet.cli._learn_options import LEARN_OPTIONS, LearnOptions, ModelName
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
from surfabet.cli._result import Result
from surfabet.cli._scan import incomplete, unit_in_doubt, without
from surfabet.cli._tiles import TILE_OPTIONS, TileOptions, compress_tiles, print_result
from surfabet.files import AnyModel, Vocabulary


def compress(
    input_: Annotated[Path, Parameter(name="IN")],
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    model: ModelName | None = None,
    evaluate: Annotated[bool, Parameter(name="--evaluate", show_default=False)] = True,
    json: Flag = False,
    learning: LearnOptions = LEARN_OPTIONS,
    tiles: TileOptions = TILE_OPTIONS,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    read: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Learn a small model of a scan and write it to a file.

    At the end the file is decoded and compared with the input; the last line has sizes, error and
    seconds. A map in tiles is not compared: `surfabet evaluate` does.

        surfabet compress room.ply room.sfb
        surfabet compress room.ply room.sfb --resolution 0.005
        surfabet compress room.ply room.sfb --max-error 0.05
        surfabet compress frames/ room.sfb --frame-stride 2 --depth-max 4
        surfabet compress room.ply room.sfb --model hscsm --levels 3
        surfabet compress room2.ply room2.sfb --vocabulary room.sfb
        surfabet compress huge.laz map.sfb --max-memory 2G
        surfabet compress scan1.pcd scan1.sfb --model alphabet --viewpoint 0 0 0
        surfabet compress scan2.pcd scan2.sfb --vocabulary scan1.sfb
        surfabet compress room.ply map.sfb --model gas --n-neurons 20000
        surfabet compress room.ply walls.sfb --model planes --min-grid-size 0.05

    Parameters
    ----------
    input_
        The scan: ply, pcd, las, laz, e57, npz, npy, xyz, csv, txt, pts, ptx, KITTI bin, a ROS
        bag, or a folder of RGB-D frames.
    output
        The model file to write.
    model
        What to learn: surface patches (patches, the default), hierarchical sparse-coded patches
        (hscsm), recurrent words by description length (alphabet) or as published (bic-alphabet),
        planes, or a growing neural gas (gas). With --vocabulary, the model that the file is of.
    evaluate
        Decode the file and measure its error against the input (default), or do not.
    json
        Print one JSON object instead of a line.
    """
    check_output(output, frozenset({MODEL_SUFFIX}), input_)
    if tiles.is_given:
        if vocabulary.vocabulary is not None:
            raise UsageError("--vocabulary: not together with --tile or --max-memory")
        with common.progress() as progress:
            report, seconds = compress_tiles(input_, output, tiles, model, learning, read, progress)
        print_result(input_, output, report, tiles.tile, seconds, json, common.quiet)
        return
    result = Result(input_, output)
    with common.progress() as progress:
        words = load_vocabulary(vocabulary, progress)
        learner = Learner.choose(model, learning.given(), words)
        with _timed(result, "read"):
            cloud = read_cloud(input_, read, progress)
        result.of(cloud)
        with _timed(result, "learn"):
            learned = learner(cloud, progress)
        if len(learned) == 0:
            raise surfabet.InvalidInputError(
                f"{input_}: --model {learned.method} found no surface in {len(cloud):,} points to "
                f"describe, so that {output.name} is not written"
            )
        result.report = learned.report
        scene = _scene(input_, cloud, learning, learned)
        with whole_file(output) as temporary, _timed(result, "write"):
            progress(f"write {output.name}", 0.0)
            result.n_bytes = learned.save(temporary, note=result.note())
        _warn_of_losses(output, learned)
        if evaluate:
            _evaluate(result, output, scene, words, progress)
        if (lost := incomplete(output, learned, result.quality)) is not None:
            warnings.warn(lost, surfabet.IncompleteModelWarning, stacklevel=1)
    if json:
        print_json(result.as_dict())
    elif not common.quiet:
        if (chosen := result.chosen()) is not None:
            print(chosen)
        print(result.line())


@contextmanager
def _timed(result: Result, stage: str) -> Iterator[None]:
    """Notes the seconds of a stage."""
    started = time.perf_counter()
    yield
    result.seconds[stage] = time.perf_counter() - started


def _warn_of_losses(output: Path, learned: AnyModel) -> None:
    """Names the attributes that the model does not keep."""
    if learned.report.not_kept:
        lost = ", ".join(learned.report.not_kept)
        warnings.warn(
            f"{output}: the model does not keep {lost}",
            surfabet.LostAttributeWarning,
            stacklevel=1,
        )


def _scene(
    path: Path,
    cloud: surfabet.PointCloud,
    learning: LearnOptions,
    learned: AnyModel,
) -> surfabet.PointCloud:
    """The points that the model was asked to describe; says when their unit is in doubt."""
    survey = learned.report.survey
    if (doubt := unit_in_doubt(path, cloud, survey)) is not None:
        warnings.warn(doubt, surfabet.UnitWarning, stacklevel=1)
    if learned.report.left_out:
        cloud = without(cloud, survey.outliers if learned.method == "gas" else survey.strays)
    if learning.min_range is None or cloud.ranges is None:
        return cloud
    return cloud.select(np.flatnonzero(cloud.ranges >= learning.min_range))


def _evaluate(
    result: Result,
    file: Path,
    original: surfabet.PointCloud,
    words: Vocabulary | None,
    progress: ProgressCallback,
) -> None:
    """Decodes the file and compares it with the original."""
    with _timed(result, "decode"):
        again = load_model(file, progress, words)
        # Compared with a scan that is thick with noise, a thin surface has the scan's own error.
        decoded = again.decode(as_measured=again.keeps_thickness, progress=progress)
    with _timed(result, "evaluate"):
        allowed = result.report.tolerance if result.report else 0.0
        tolerance = again.sigma if isinstance(again, surfabet.AlphabetModel) else allowed or None
        result.within = tolerance if isinstance(tolerance, float) else None
        # Point-to-plane distances take long; the verb `evaluate` has them.
        result.quality = surfabet.evaluate(
            original,
            decoded,
            sigma=tolerance,
            bytes=result.n_bytes,
            normal_neighbors=None,
            progress=progress,
        )
