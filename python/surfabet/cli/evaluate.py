"""`surfabet evaluate`: how far two clouds lie apart, whoever made them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Table

import surfabet
from surfabet.cli._files import (
    HTML_SUFFIXES,
    MODEL_SUFFIX,
    check_output,
    format_of,
    load_model,
    load_vocabulary,
    read_cloud,
    size_on_disk,
    whole_file,
)
from surfabet.cli._format import Output, bytes_text, length_text, print_json
from surfabet.cli._options import (
    COMMON,
    POSITIVE,
    READ_OPTIONS,
    VOCABULARY_OPTION,
    Common,
    Flag,
    PositiveFloat,
    ReadOptions,
    UsageError,
    VocabularyOption,
)


def _length(value: float, unit: str) -> str:
    return length_text(value, unit)


def _percent(share: float, unit: str) -> str:
    return f"{share:.2%}"


def _count(n: int, unit: str) -> str:
    return f"{n:,}"


def _bytes(n: int, unit: str) -> str:
    return bytes_text(n)


def _plain(value: float, unit: str) -> str:
    return f"{value:.4g}"


DIRECTED = (
    ("rmse", "rmse", _length),
    ("mean", "mean", _length),
    ("p95", "95th percentile", _length),
    ("p99", "99th percentile", _length),
    ("max", "maximum", _length),
    ("plane_rmse", "rmse to planes", _length),
    ("color_rmse", "colour rmse", _plain),
)
SINGLE: tuple[tuple[str, str, Callable[[Any, str], str]], ...] = (
    ("reference_points", "original points", _count),
    ("decoded_points", "decoded points", _count),
    ("d1_psnr", "D1 PSNR (dB)", _plain),
    ("d2_psnr", "D2 PSNR (dB)", _plain),
    ("psnr_peak", "peak of the PSNR", _length),
    ("inliers", "original within sigma", _percent),
    ("outliers", "decoded beyond sigma", _percent),
    ("bytes", "file", _bytes),
    ("ratio", "ratio", _plain),
    ("bits_per_point", "bits per original point", _plain),
)


def evaluate(
    reference: Annotated[Path, Parameter(name="REFERENCE")],
    decoded: Annotated[Path, Parameter(name="DECODED")],
    /,
    *,
    sigma: PositiveFloat = None,
    angular_resolution: PositiveFloat = None,
    sigma_scale: Annotated[float, Parameter(validator=POSITIVE)] = 3.0,
    as_measured: Flag = False,
    picture: Path | None = None,
    html: Path | None = None,
    json: Flag = False,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    read: ReadOptions = READ_OPTIONS,
    read_decoded: Annotated[ReadOptions, Parameter(name="--decoded", show=False)] = READ_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Measure how far a decoded cloud lies from the original, both ways.

        surfabet evaluate room.ply again.ply
        surfabet evaluate room.ply room.sfb --picture room.png
        surfabet evaluate room.ply room.sfb --html room.html
        surfabet evaluate room.ply draco.ply --json
        surfabet evaluate part.ply again.ply --unit mm --decoded.unit m

    The options that say how clouds are read are for both files, as far as their formats have them;
    `--format` is for those whose first bytes do not show it, and `--viewpoint` for REFERENCE alone.
    With `--decoded.unit`, `--decoded.columns` and so on, DECODED is read by these alone.

    Parameters
    ----------
    reference
        The original: any readable cloud or a folder of RGB-D frames.
    decoded
        The cloud to judge, from any codec; a model file is decoded, and then its bytes are counted
        too.
    sigma
        Distance in metres within which a point counts as found; without it inliers and outliers are
        left out, unless the model was made for a tolerance of its own.
    angular_resolution
        Angle between neighbouring beams in degrees: sigma grows with the range, as sigma_scale *
        tan(angle / 2) * range. The original needs ranges, a viewpoint, or --viewpoint.
    sigma_scale
        Factor of a sigma that grows with the range.
    as_measured
        Decode a model file with the thickness that the scan had, not as the surface in its middle.
    picture
        Draw both clouds and the histogram of errors into this file: png, jpg, pdf, svg or webp.
    html
        Write one page with all measures, both clouds, errors both ways and their histogram into
        this file; it needs no other file and no network.
    json
        Print one JSON object instead of a table.
    """
    if html is not None:
        from surfabet import report

        check_output(html, HTML_SUFFIXES, reference, decoded)
        report.check_pictures()
    if picture is not None:
        from surfabet import report

        check_output(picture, report.PICTURE_SUFFIXES, reference, decoded)
    tolerance: float | surfabet.RangeSigma | None = sigma
    if angular_resolution is not None:
        if sigma is not None:
            raise UsageError("--sigma and --angular-resolution: give one of both")
        tolerance = surfabet.RangeSigma(sigma_scale, angular_resolution)
    with common.progress() as progress:
        n_bytes = None
        is_model = decoded.suffix.lower() == MODEL_SUFFIX
        shared = not is_model and read_decoded == READ_OPTIONS
        beside = [format_of(path, read, shared=True) for path in (decoded, reference) if shared]
        original = read_cloud(reference, read, progress, beside=beside[0] if shared else None)
        if is_model:
            n_bytes = size_on_disk(decoded)
            model = load_model(decoded, progress, load_vocabulary(vocabulary, progress))
            judged = model.decode(as_measured=as_measured, progress=progress)
            if tolerance is None and isinstance(model, surfabet.AlphabetModel):
                of_range = isinstance(model.sigma, surfabet.RangeSigma)
                # Another original may not know its ranges.
                if not of_range or original.ranges is not None or original.viewpoints is not None:
                    tolerance = model.sigma
        else:
            options = replace(read, viewpoint=None) if shared else read_decoded
            judged = read_cloud(decoded, options, progress, beside=beside[1] if shared else None)
        quality = surfabet.evaluate(
            original, judged, sigma=tolerance, bytes=n_bytes, progress=progress
        )
        if picture is not None:
            progress("draw the picture", 0.0)
            with whole_file(picture) as temporary:
                report.draw_comparison(temporary, original, judged, quality)
        if html is not None:
            progress("write the page", 0.0)
            title = f"{decoded.name} beside {reference.name}"
            tables = [_directed(quality), _single(quality)]
            with whole_file(html) as temporary:
                report.save_page(temporary, original, judged, quality, title, tables)
    if json:
        print_json({"reference": str(reference), "decoded": str(decoded), **quality.as_dict()})
    elif not common.quiet:
        _print_table(quality)


def _directed(quality: surfabet.Quality) -> list[tuple[str, ...]]:
    """The measures that have directions, after their heading."""
    values, unit = quality.as_dict(), quality.unit
    rows: list[tuple[str, ...]] = [
        ("measure", "decoded to original", "original to decoded", "pooled")
    ]
    for name, label, text in DIRECTED:
        forward, backward = values[f"{name}_forward"], values[f"{name}_backward"]
        directions = (forward, backward, values.get(f"{name}_pooled"))
        if forward is not None and backward is not None:
            rows.append((label, *("" if v is None else text(v, unit) for v in directions)))
    for name, errors in quality.attributes.items():
        share_text = _percent if errors.labels else _plain
        label = f"{name} equal" if errors.labels else f"{name} rmse"
        shares = (errors.forward, errors.backward, errors.pooled)
        rows.append((label, *(share_text(value, unit) for value in shares)))
    return rows


def _single(quality: surfabet.Quality) -> list[tuple[str, ...]]:
    """All other measures, after their heading."""
    values = quality.as_dict()
    filled = [
        (label, text_of(values[name], quality.unit))
        for name, label, text_of in SINGLE
        if values[name] is not None
    ]
    return [("measure", "value"), *filled]


def _print_table(quality: surfabet.Quality) -> None:
    directed, single = _directed(quality), _single(quality)
    console = Output(highlight=False, soft_wrap=True)
    table = Table(*directed[0], box=None)
    for column in table.columns[1:]:
        column.justify = "right"
    for row in directed[1:]:
        table.add_row(*row)
    console.print(table)
    console.print()
    table = Table(*single[0], box=None)
    for row in single[1:]:
        table.add_row(*row)
    console.print(table)
