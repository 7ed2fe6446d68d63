"""`surfabet compress`: cloud in, model file out."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter
from cyclopts.validators import Number

import surfabet
from surfabet.cli._files import (
    MODEL_SUFFIX,
    check_output,
    decode,
    load_dictionary,
    read_cloud,
    size_on_disk,
)
from surfabet.cli._format import bytes_text, millimetres, peak_memory, print_json, raw_bytes
from surfabet.cli._options import COMMON, READ_OPTIONS, Common, Flag, ReadOptions, UsageError

PositiveFloat = Annotated[float | None, Parameter(validator=Number(gt=0))]
PositiveInt = Annotated[int | None, Parameter(validator=Number(gte=1))]


@Parameter(name="*", group=Group("Patches", sort_key=1))
@dataclass(frozen=True)
class PatchOptions:
    """Finer options of patches, as `surfabet.learn_patches` documents them; its defaults hold."""

    rate: PositiveFloat = None
    """Rate-distortion: what a bit of geometry must save; larger makes smaller files."""

    color_step: PositiveInt = None
    """Rate-distortion: rounding of colours; larger makes smaller files."""

    color_rate: PositiveFloat = None
    """Rate-distortion: what a bit of colour must save."""

    patch_pixels: PositiveInt = None
    """HSCSM: pixels per side of a patch."""

    max_depth_deviation: PositiveFloat = None
    """HSCSM: pixels whose depth has a larger standard deviation, in metres, go to the level
    below."""

    max_color_deviation: PositiveFloat = None
    """HSCSM: the same for colour, 0 to 255."""

    min_coverage: Annotated[float | None, Parameter(validator=Number(gt=0, lte=1))] = None
    """HSCSM: patches that cover less of their pixels go to the level below."""

    depth_atoms: PositiveInt = None
    """HSCSM: most entries of the depth dictionary."""

    color_atoms: PositiveInt = None
    """HSCSM: most entries of the colour dictionary."""

    depth_sparsity: PositiveInt = None
    """HSCSM: most depth entries that describe one patch."""

    color_sparsity: PositiveInt = None
    """HSCSM: most colour entries that describe one patch."""

    iterations: PositiveInt = None
    """HSCSM: most iterations of dictionary learning."""

    sensor: Literal["structured-light", "constant"] | None = None
    """How the error of a range measurement grows."""

    def given(self) -> dict[str, Any]:
        """The options that were given."""
        return {name: value for name, value in vars(self).items() if value is not None}


PATCH_OPTIONS = PatchOptions()


def compress(
    input_: Annotated[Path, Parameter(name="IN")],
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    model: Literal["patches"] = "patches",
    method: Literal["rate-distortion", "hscsm"] | None = None,
    resolution: PositiveFloat = None,
    max_error: PositiveFloat = None,
    levels: Annotated[int | None, Parameter(validator=Number(gte=1, lte=8))] = None,
    dictionary: Path | None = None,
    random_state: Annotated[int, Parameter(validator=Number(gte=0))] = 0,
    evaluate: Annotated[bool, Parameter(name="--evaluate", show_default=False)] = True,
    json: Flag = False,
    patches: PatchOptions = PATCH_OPTIONS,
    read: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Learn a small model of a scan and write it to a file.

    At the end the file is decoded and held against the input; the last line tells sizes, error and
    seconds.

        surfabet compress room.ply room.sfb
        surfabet compress room.ply room.sfb --resolution 0.005
        surfabet compress room.ply room.sfb --max-error 0.05
        surfabet compress frames/ room.sfb --frame-stride 2 --depth-max 4
        surfabet compress room.ply room.sfb --method hscsm --levels 3
        surfabet compress room2.ply room2.sfb --dictionary room.sfb

    Parameters
    ----------
    input_
        The scan: ply, pcd, las, laz, e57, npz, npy, xyz, csv, txt, KITTI bin, or a folder of RGB-D
        frames.
    output
        The model file to write.
    model
        The family of models. This version knows surface patches only.
    method
        How patches are learned: by least cost on a lattice (the default), or as published, with
        free poses and learned dictionaries (hscsm).
    resolution
        Spacing of the model's finest pixels in metres, 0.01 by default: what is smaller is lost.
    max_error
        No input point is further than this from the decoded cloud, in metres; surfabet verify
        proves it.
    levels
        Levels of detail of the patches; each doubles the size of the one below. By default 2, or 1
        with hscsm.
    dictionary
        A model whose dictionaries to use instead of learning: the file then holds none, and needs
        that model again. Resolution, levels and pixels of a patch are its own.
    random_state
        Seed; the same seed, input and options give the same bytes.
    evaluate
        Decode the file and measure its error against the input (default), or do not.
    json
        Print one JSON object instead of a line.
    """
    check_output(output, frozenset({MODEL_SUFFIX}), input_)
    seconds: dict[str, float] = {}
    quality = None
    with common.progress() as progress:
        shared = load_dictionary(dictionary, progress)
        started = time.perf_counter()
        cloud = read_cloud(input_, read, progress)
        seconds["read"] = time.perf_counter() - started

        started = time.perf_counter()
        sizes = {"resolution": resolution, "levels": levels, "max_error": max_error}
        options: dict[str, Any] = {
            **{name: value for name, value in sizes.items() if value is not None},
            "random_state": random_state,
            "progress": progress,
            **patches.given(),
        }
        learned: surfabet.LatticeModel | surfabet.PatchModel
        if shared is not None:
            if method == "rate-distortion":
                raise UsageError("--dictionary: only --method hscsm uses dictionaries")
            learned = shared.encode(cloud, **options)
        elif method == "hscsm":
            learned = surfabet.learn_patches(cloud, method="hscsm", **options)
        else:
            learned = surfabet.learn_patches(cloud, **options)
        seconds["learn"] = time.perf_counter() - started

        started = time.perf_counter()
        progress(f"write {output.name}", 0.0)
        n_bytes = learned.save(output)
        seconds["write"] = time.perf_counter() - started
        if learned.report.not_kept:
            lost = ", ".join(learned.report.not_kept)
            warnings.warn(
                f"{output}: the model does not keep {lost}",
                surfabet.LostAttributeWarning,
                stacklevel=1,
            )

        if evaluate:
            started = time.perf_counter()
            again = surfabet.load(output, dictionary=shared)
            # Held against a scan that is thick with noise, a thin surface has the scan's own error.
            as_measured = isinstance(again, surfabet.LatticeModel)
            decoded = decode(again, as_measured, progress=progress)
            seconds["decode"] = time.perf_counter() - started
            started = time.perf_counter()
            # Point-to-plane distances take long; the verb `evaluate` has them.
            quality = surfabet.evaluate(
                cloud, decoded, bytes=n_bytes, normal_neighbors=None, progress=progress
            )
            seconds["evaluate"] = time.perf_counter() - started

    n_raw = raw_bytes(len(cloud), cloud.colors is not None)
    encode_seconds = seconds["read"] + seconds["learn"] + seconds["write"]
    if json:
        print_json(
            {
                "input": {
                    "path": str(input_),
                    "points": len(cloud),
                    "raw_bytes": n_raw,
                    "bytes_on_disk": size_on_disk(input_),
                },
                "output": {"path": str(output), "bytes": n_bytes},
                "ratio": n_raw / n_bytes,
                "bits_per_point": 8 * n_bytes / len(cloud),
                "quality": quality and quality.as_dict(),
                "seconds": seconds,
                "peak_memory_bytes": peak_memory(),
                "report": learned.report.as_dict(),
            }
        )
    elif not common.quiet:
        line = (
            f"{output}: {len(cloud):,} points, {bytes_text(n_raw)} -> {bytes_text(n_bytes)}, "
            f"ratio {n_raw / n_bytes:.3g}, "
        )
        if quality:
            line += (
                f"rmse {millimetres(quality.rmse)} (pooled {millimetres(quality.rmse_pooled)}), "
            )
            if quality.color_rmse_pooled is not None:
                line += f"colour rmse {quality.color_rmse_pooled:.3g}, "
        print(line + f"{encode_seconds:.1f} s")
