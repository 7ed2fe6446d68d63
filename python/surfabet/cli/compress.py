"""`surfabet compress`: cloud in, model file out."""

from __future__ import annotations

import math
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Group, Parameter
from cyclopts.validators import Number

import surfabet
from surfabet.cli._files import (
    MODEL_SUFFIX,
    THICK,
    Shared,
    check_output,
    decode,
    load_model,
    read_cloud,
    size_on_disk,
)
from surfabet.cli._format import bytes_text, millimetres, peak_memory, print_json, raw_bytes
from surfabet.cli._options import (
    COMMON,
    READ_OPTIONS,
    SHARED_OPTIONS,
    Common,
    FamilyOptions,
    Flag,
    PositiveFloat,
    PositiveInt,
    ReadOptions,
    SharedOptions,
    UsageError,
)
from surfabet.files import AnyModel


@Parameter(name="*", group=Group("Patches", sort_key=1))
@dataclass(frozen=True)
class HscsmOptions(FamilyOptions):
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


PATCH_OPTIONS = HscsmOptions()


@Parameter(name="*", group=Group("Alphabet", sort_key=1))
@dataclass(frozen=True)
class AlphabetOptions(FamilyOptions):
    """Finer options of alphabets, as `surfabet.learn_alphabet` documents them."""

    preset: Literal["small", "balanced", "fine"] | None = None
    """Smaller files, or more of the scan within sigma."""

    radius: PositiveFloat = None
    """Smallest radius of a word, in metres."""

    scales: Annotated[int | None, Parameter(validator=Number(gte=1, lte=8))] = None
    """Number of radii, each twice the one before."""

    max_words: Annotated[int | None, Parameter(validator=Number(gte=0))] = None
    """Most words beside the plane."""

    inlier_bits: PositiveFloat = None
    """What explaining a point is worth, in bits."""

    outlier_bits: Annotated[float | None, Parameter(validator=Number(gte=0))] = None
    """What a decoded point that explains nothing costs, in bits."""

    sigma_scale: PositiveFloat = None
    """Factor of the tolerance, lambda."""

    angular_resolution: PositiveFloat = None
    """Angle between neighbouring beams, in degrees; estimated by default."""

    noise: Annotated[float | None, Parameter(validator=Number(gte=0))] = None
    """Standard deviation of the scan about its surface, in metres; estimated by default."""

    min_range: Annotated[float | None, Parameter(validator=Number(gte=0))] = None
    """Leave out what is nearer to the sensor, in metres."""

    def given(self) -> dict[str, Any]:
        """The options that were given."""
        options = super().given()
        if self.angular_resolution is not None:
            options["angular_resolution"] = math.radians(self.angular_resolution)
        return options


ALPHABET_OPTIONS = AlphabetOptions()


@Parameter(name="*", group=Group("Gas", sort_key=1))
@dataclass(frozen=True)
class GasOptions(FamilyOptions):
    """Options of a gas, as `surfabet.learn_gas` documents them; its defaults hold."""

    n_neurons: PositiveInt = None
    """Number of neurons, 10000 by default."""

    target_error: PositiveFloat = None
    """Mean distance of points to their neurons, in metres, at which growth ends before."""

    patterns: PositiveInt = None
    """Signals per inserted neuron (lambda)."""

    passes: PositiveFloat = None
    """Number of signals as a multiple of the number of points, instead of patterns per neuron."""

    epsilon_w: PositiveFloat = None
    """Share of the way to a signal that the winner moves."""

    epsilon_n: Annotated[float | None, Parameter(validator=Number(gte=0, lte=1))] = None
    """Share of the way to a signal that the winner's neighbours move."""

    alpha: PositiveFloat = None
    """Factor of the errors of the two neurons that a new one is put between."""

    beta: Annotated[float | None, Parameter(validator=Number(gte=0, lte=0.5))] = None
    """Share of every error that is forgotten with each signal."""

    max_age: PositiveInt = None
    """Age above which an edge is removed."""

    position_step: PositiveFloat = None
    """Rounding of positions in metres."""


GAS_OPTIONS = GasOptions()


@Parameter(name="*", group=Group("Planes", sort_key=1))
@dataclass(frozen=True)
class PlanesOptions:
    """Options of planes, as `surfabet.learn_planes` documents them; its defaults hold."""

    min_grid_size: PositiveFloat = None
    """Smallest grid size in metres: flat is what is flat at this size."""

    initial_patches: Annotated[int | None, Parameter(validator=Number(gte=0))] = None
    """Number of patches to start from, at random; 0, the default, takes them from the data."""

    min_points: Annotated[int | None, Parameter(validator=Number(gte=3))] = None
    """Points that a plane needs."""

    weight_at_grid_size: Annotated[float | None, Parameter(validator=Number(gt=0, lt=1))] = None
    """Weight of a point at the distance of the grid size (W)."""

    split_threshold: Annotated[float | None, Parameter(validator=Number(gte=0, lt=1))] = None
    """A patch is split where its density falls below this share of the mean."""

    merge_tolerance: Annotated[float | None, Parameter(validator=Number(gte=1))] = None
    """Factor by which points may be further from a common plane for two patches to merge."""

    min_purity: Annotated[float | None, Parameter(validator=Number(gte=0, lte=1))] = None
    """Least share of the points before and behind a plane that support it; 0 keeps clutter."""

    min_fill: Annotated[float | None, Parameter(validator=Number(gte=0, lte=1))] = None
    """Least share of a plane's rectangle that points support."""

    max_bend: Annotated[float | None, Parameter(validator=Number(gte=1))] = None
    """Most that points deviate from a plane, per deviation from the mean of their tile."""

    em_steps: PositiveInt = None
    """Passes of EM and trimming before each split and each merge."""

    new_patches_every: PositiveInt = None
    """Iterations after which patches are added where many points support none."""

    max_iterations: PositiveInt = None
    """Most iterations."""

    tolerance: PositiveFloat = None
    """Learning ends when distances change by less than this share."""

    def given(self) -> dict[str, Any]:
        """The options that were given."""
        return {name: value for name, value in vars(self).items() if value is not None}


PLANES_OPTIONS = PlanesOptions()


def learn(
    cloud: surfabet.PointCloud,
    model: Literal["patches", "alphabet", "gas", "planes"],
    method: str | None,
    shared: Shared,
    **options: Any,
) -> AnyModel:
    """The model that the options ask for."""
    if shared.dictionary is not None and method == "rate-distortion":
        raise UsageError("--dictionary: only --method hscsm uses dictionaries")
    learned: AnyModel
    if shared.alphabet is not None:
        learned = shared.alphabet.describe(cloud, **options)
    elif shared.dictionary is not None:
        learned = shared.dictionary.encode(cloud, **options)
    elif model == "gas":
        learned = surfabet.learn_gas(cloud, **options)
    elif model == "planes":
        learned = surfabet.learn_planes(cloud, **options)
    elif model == "alphabet":
        chosen: Any = {} if method is None else {"method": method}
        learned = surfabet.learn_alphabet(cloud, **chosen, **options)
    elif method == "hscsm":
        learned = surfabet.learn_patches(cloud, method="hscsm", **options)
    else:
        learned = surfabet.learn_patches(cloud, **options)
    return learned


def _far_enough(cloud: surfabet.PointCloud, min_range: float | None) -> surfabet.PointCloud:
    """What the model was asked to describe."""
    if min_range is None or cloud.ranges is None:
        return cloud
    return cloud.select(np.flatnonzero(cloud.ranges >= min_range))


METHODS = {
    "patches": ("rate-distortion", "hscsm"),
    "alphabet": ("mdl", "bic"),
    "gas": (),
    "planes": (),
}
"""Methods of each family."""


def check_family(
    model: str, method: str | None, general: dict[str, Any], shared: SharedOptions, **own: Any
) -> None:
    """Refuses options of a family that was not asked for."""
    for family, options in own.items():
        if family != model and options:
            names = ", ".join("--" + name.replace("_", "-") for name in options)
            raise UsageError(f"{names}: only for --model {family}")
    if method is not None and method not in METHODS[model]:
        known = " or ".join(METHODS[model]) or "none"
        raise UsageError(f"--method {method}: --model {model} knows {known}")
    if model != "patches":
        patches = {**general, "dictionary": shared.dictionary}
        given = [f"--{name.replace('_', '-')}" for name, v in patches.items() if v is not None]
        if given:
            raise UsageError(f"{', '.join(given)}: only for --model patches")
    if model != "alphabet" and shared.alphabet is not None:
        raise UsageError("--alphabet: only for --model alphabet")


def compress(
    input_: Annotated[Path, Parameter(name="IN")],
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    model: Literal["patches", "alphabet", "gas", "planes"] = "patches",
    method: Literal["rate-distortion", "hscsm", "mdl", "bic"] | None = None,
    resolution: PositiveFloat = None,
    max_error: PositiveFloat = None,
    levels: Annotated[int | None, Parameter(validator=Number(gte=1, lte=8))] = None,
    random_state: Annotated[int, Parameter(validator=Number(gte=0))] = 0,
    evaluate: Annotated[bool, Parameter(name="--evaluate", show_default=False)] = True,
    json: Flag = False,
    patches: HscsmOptions = PATCH_OPTIONS,
    alphabets: AlphabetOptions = ALPHABET_OPTIONS,
    gas: GasOptions = GAS_OPTIONS,
    planes: PlanesOptions = PLANES_OPTIONS,
    shared: SharedOptions = SHARED_OPTIONS,
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
        surfabet compress scan1.pcd scan1.sfb --model alphabet --viewpoint 0 0 0
        surfabet compress scan2.pcd scan2.sfb --model alphabet --alphabet scan1.sfb
        surfabet compress room.ply map.sfb --model gas --n-neurons 20000
        surfabet compress room.ply walls.sfb --model planes --min-grid-size 0.05

    Parameters
    ----------
    input_
        The scan: ply, pcd, las, laz, e57, npz, npy, xyz, csv, txt, KITTI bin, or a folder of RGB-D
        frames.
    output
        The model file to write.
    model
        The family of models: surface patches, an alphabet of recurrent words, a growing neural gas
        of --n-neurons neurons, or planes.
    method
        How patches are learned: by least cost on a lattice (the default), or as published, with
        free poses and learned dictionaries (hscsm). How an alphabet is learned: by description
        length (mdl, the default), or as published (bic).
    resolution
        Spacing of the model's finest pixels in metres, 0.01 by default: what is smaller is lost.
    max_error
        No input point is further than this from the decoded cloud, in metres; surfabet verify
        proves it.
    levels
        Levels of detail of the patches; each doubles the size of the one below. By default 2, or 1
        with hscsm.
    random_state
        Seed; the same seed, input and options give the same bytes.
    evaluate
        Decode the file and measure its error against the input (default), or do not.
    json
        Print one JSON object instead of a line.
    """
    check_output(output, frozenset({MODEL_SUFFIX}), input_)
    general = {"resolution": resolution, "levels": levels, "max_error": max_error}
    own = {
        "patches": patches.given(),
        "alphabet": alphabets.given(),
        "gas": gas.given(),
        "planes": planes.given(),
    }
    check_family(model, method, general, shared, **own)
    seconds: dict[str, float] = {}
    quality = None
    with common.progress() as progress:
        known = Shared.load(shared, progress)
        started = time.perf_counter()
        cloud = read_cloud(input_, read, progress)
        seconds["read"] = time.perf_counter() - started

        started = time.perf_counter()
        options: dict[str, Any] = {
            **{name: value for name, value in general.items() if value is not None},
            **own[model],
            "progress": progress,
        }
        if known.alphabet is None:
            options["random_state"] = random_state
        learned = learn(cloud, model, method, known, **options)
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
            again = load_model(output, progress, known)
            # Held against a scan that is thick with noise, a thin surface has the scan's own error.
            as_measured = isinstance(again, THICK)
            decoded = decode(again, as_measured, progress=progress)
            seconds["decode"] = time.perf_counter() - started
            started = time.perf_counter()
            tolerance = again.sigma if isinstance(again, surfabet.AlphabetModel) else None
            # Point-to-plane distances take long; the verb `evaluate` has them.
            quality = surfabet.evaluate(
                _far_enough(cloud, alphabets.min_range),
                decoded,
                sigma=tolerance,
                bytes=n_bytes,
                normal_neighbors=None,
                progress=progress,
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
            if quality.inliers is not None and quality.outliers is not None:
                line += f"inliers {quality.inliers:.2%}, outliers {quality.outliers:.2%}, "
            if quality.color_rmse_pooled is not None:
                line += f"colour rmse {quality.color_rmse_pooled:.3g}, "
        print(line + f"{encode_seconds:.1f} s")
