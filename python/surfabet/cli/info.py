"""`surfabet info`: what is in a model file, a cloud or a bag."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.markup import escape
from rich.table import Table

import surfabet
from surfabet._methods import METHODS
from surfabet._progress import ProgressCallback
from surfabet.cli._files import (
    MODEL_SUFFIX,
    check_output,
    load_model,
    load_vocabulary,
    read_cloud,
    refuse_cloud,
    size_on_disk,
    whole_file,
)
from surfabet.cli._format import Output, bytes_text, length_text, points_text, print_json
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
from surfabet.files import AnyModel
from surfabet.io import detect, list_topics, named_format, read_bag
from surfabet.io._crs import unit_of
from surfabet.learning import note_of, unit_in
from surfabet.model import is_model

MOST_POINTS = 20_000_000
"""The box of a model that decodes to more is left out: showing what a file holds takes seconds."""


def info(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    picture: Path | None = None,
    json: Flag = False,
    vocabulary: VocabularyOption = VOCABULARY_OPTION,
    read: ReadOptions = READ_OPTIONS,
    common: Common = COMMON,
) -> None:
    """Show what a file holds.

    Of a model: what it is made of, its box, how to decode it, sizes and options, and bytes by part;
    a file that names a vocabulary instead of holding it shows these only with --vocabulary. Of a
    cloud: format, points, attributes and extent. Of a ROS bag: its topics, and with --topic the
    cloud.

        surfabet info room.sfb
        surfabet info room.sfb --json
        surfabet info scan.laz
        surfabet info drive.mcap

    Parameters
    ----------
    file
        A model file, or any readable cloud, folder of RGB-D frames or ROS bag.
    picture
        Draw the words of an alphabet, with how often each occurs, into this file: png, jpg, pdf,
        svg or webp.
    json
        Print one JSON object instead of tables.
    """
    if file.is_dir() or not (file.suffix.lower() == MODEL_SUFFIX or is_model(file)):
        if picture is not None:
            raise UsageError(f"--picture: {file} is no model and has no words to draw")
        _info_of_cloud(file, read, common, json)
        return
    refuse_cloud(file)
    found = surfabet.inspect(file)
    with common.progress() as progress:
        words = load_vocabulary(vocabulary, progress)
        model = None
        if found.vocabulary is None or words is not None:
            model = load_model(file, progress, words)
        decoded = None if model is None else _decoded(model, progress)
    if picture is not None:
        _draw(file, picture, model)
    n_bytes = size_on_disk(file)
    if json:
        known: dict[str, Any] = {"holds": _holds(found), "unit": unit_in(found.note)}
        if model is not None:
            known |= {"n_points": model.n_points, "info": model.info}
        if model is not None and decoded is not None:
            known |= {"bounds": decoded.bounds, "decoded_points": len(decoded)}
            known |= {"attributes": decoded.attributes, "keeps_thickness": model.keeps_thickness}
        print_json({"path": str(file), "bytes": n_bytes, **found.as_dict(), **known})
        return
    if common.quiet:
        return
    console = Output(highlight=False, soft_wrap=True)
    made_from = f"made from {points_text(model.n_points)}, " if model else ""
    console.print(
        f"{file}: {found.method}, {bytes_text(n_bytes)}, {made_from}"
        f"read by surfabet {found.version} and newer",
        markup=False,
    )
    for line in _in_words(file, found, model, decoded, vocabulary):
        console.print(line, markup=False)
    if model:
        sizes = Table("content", "value", box=None, header_style="bold")
        for name, value in model.info.items():
            sizes.add_row(
                _in_unit(name, unit_in(found.note)),
                f"{value:.6g}" if isinstance(value, float) else str(value),
            )
        console.print(sizes)
    parts = Table("part", "bytes", "share", box=None, header_style="bold")
    for column in parts.columns[1:]:
        column.justify = "right"
    # What no section holds is the file's own frame: magic, table of sections, checksums.
    frame = n_bytes - sum(found.sections.values())
    for name, part in [*found.sections.items(), ("frame of the file", frame)]:
        parts.add_row(name, f"{part:,}", f"{part / n_bytes:.1%}")
    console.print(parts)


def _in_unit(name: str, unit: str) -> str:
    """The name of a figure, with the unit that lengths have in its brackets."""
    return name.replace("(m)", f"({unit})").replace("(m2)", f"({unit}2)")


def _holds(found: surfabet.FileInfo) -> str:
    """What a model is made of, for people."""
    method = METHODS.get(found.method)
    return f"a model of the method {found.method}" if method is None else method.content


def _decoded(model: AnyModel, progress: ProgressCallback) -> surfabet.PointCloud | None:
    """What the model decodes to, for its box; None where that would take long."""
    try:
        return model.decode(max_points=MOST_POINTS, progress=progress)
    except surfabet.InvalidInputError:
        return None


def _in_words(
    file: Path,
    found: surfabet.FileInfo,
    model: AnyModel | None,
    decoded: surfabet.PointCloud | None,
    vocabulary: VocabularyOption,
) -> Iterator[str]:
    """What the file holds, where, and how to get it out again."""
    yield f"It holds {_holds(found)}."
    if found.note is not None:
        head = "Noted" if found.note == note_of({}, unit_in(found.note)) else "Chosen by the data"
        yield f"{head}: {found.note}"
    if found.vocabulary is not None:
        yield f"The file names a vocabulary by its hash: {found.vocabulary}"
    unit = unit_in(found.note)
    spacing = "METRES" if unit == "m" else unit.upper()
    words = "" if vocabulary.vocabulary is None else f" --vocabulary {vocabulary.vocabulary}"
    if model is None:
        yield "It is decoded with --vocabulary FILE, a model that holds this vocabulary."
        return
    if decoded is None:
        yield (
            f"Decode: surfabet decompress {file} out.ply --resolution {spacing} (more than "
            f"{MOST_POINTS:,} points at its own spacing, so that its box is not measured here)"
        )
        return
    kept = ["positions", *decoded.attributes]
    if model.keeps_thickness:
        kept.append("the thickness of the scan")
    yield f"Kept: {', '.join(kept)}."
    if (bound := getattr(model, "max_error", None)) is not None:
        furthest = length_text(bound, unit)
        yield (
            f"No point of the scan is further than {furthest} from the cloud decoded as measured; "
            f"surfabet verify SCAN {file} proves it."
        )
    if decoded.bounds is not None:
        sides = " x ".join(f"{high - low:.3f}" for low, high in zip(*decoded.bounds, strict=True))
        along = ", ".join(
            f"{axis} {low:.3f} to {high:.3f}"
            for axis, low, high in zip("xyz", *decoded.bounds, strict=True)
        )
        yield f"Box: {sides} {unit}; {along}."
    yield (
        f"Decode: surfabet decompress {file} out.ply{words} ({len(decoded):,} points at its own "
        "spacing)"
    )
    yield f"        --resolution {spacing} gives another spacing" + (
        ", --as-measured the thickness of the scan" if model.keeps_thickness else ""
    )


def _info_of_cloud(file: Path, read: ReadOptions, common: Common, json: bool) -> None:
    known = detect(file) if read.format is None else named_format(read.format)
    about: dict[str, Any] = {
        "path": str(file),
        "bytes": size_on_disk(file),
        "format": known.name,
    }
    head = f"{file}: {known.name}, {bytes_text(about['bytes'])}"
    if known.reader is read_bag and read == READ_OPTIONS:
        topics = list_topics(file)
        about["topics"] = [asdict(topic) for topic in topics]
        table = Table("topic", "type", "messages", box=None, header_style="bold")
        table.columns[2].justify = "right"
        for topic in topics:
            table.add_row(escape(topic.name), topic.type, f"{topic.count:,}")
    else:
        with common.progress() as progress:
            cloud = read_cloud(file, read, progress)
        about |= {
            "n_points": len(cloud),
            "attributes": cloud.attributes,
            "bounds": cloud.bounds,
            "unit": unit_of(cloud),
            "n_viewpoints": 0 if cloud.viewpoints is None else len(cloud.viewpoints),
        }
        head += f", {points_text(len(cloud))} ({', '.join(['positions', *cloud.attributes])})"
        lengths = (f"{name} ({unit_of(cloud)})" for name in ("lowest", "highest", "extent"))
        table = Table("axis", *lengths, box=None, header_style="bold")
        for column in table.columns[1:]:
            column.justify = "right"
        for axis, low, high in zip("xyz", *(cloud.bounds or ((), ())), strict=False):
            table.add_row(axis, f"{low:.3f}", f"{high:.3f}", f"{high - low:.3f}")
    if json:
        print_json(about)
    elif not common.quiet:
        console = Output(highlight=False, soft_wrap=True)
        console.print(head, markup=False)
        console.print(table)


def _draw(file: Path, picture: Path, model: AnyModel | None) -> None:
    from surfabet import report

    check_output(picture, report.PICTURE_SUFFIXES, file)
    if not isinstance(model, surfabet.AlphabetModel):
        raise UsageError(f"--picture: {file} has no words to draw")
    with whole_file(picture) as temporary:
        report.draw_words(temporary, model)
