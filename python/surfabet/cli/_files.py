"""Files in and out: refused before the work where they must fail, never left half written."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import surfabet
from surfabet import _core
from surfabet._progress import ProgressCallback
from surfabet.cli._options import ReadOptions, UsageError, VocabularyOption
from surfabet.errors import FormatError
from surfabet.files import AnyModel, Vocabulary
from surfabet.io import Format, detect, formats, named_format
from surfabet.io._files import is_same_file
from surfabet.model import is_model

MODEL_SUFFIX = ".sfb"
HTML_SUFFIXES = frozenset({".html", ".htm"})


def cloud_suffixes() -> frozenset[str]:
    """The endings of file names that clouds can be written to."""
    return frozenset(suffix for known in formats() if known.writer for suffix in known.suffixes)


def check_output(path: Path, suffixes: frozenset[str], *inputs: Path) -> None:
    """Refuses an output that cannot be written, before any time goes into it."""
    if path.suffix.lower() not in suffixes:
        known = ", ".join(sorted(suffixes))
        raise UsageError(f"{path}: cannot write this format; the name must end in one of {known}")
    if path.is_dir():
        raise UsageError(f"{path}: is a folder; name a file to write")
    if not path.parent.is_dir():
        raise UsageError(f"{path}: there is no folder {path.parent}")
    if not os.access(path.parent, os.W_OK):
        raise UsageError(f"{path}: no permission to write in {path.parent}")
    for source in inputs:
        if is_same_file(path, source):
            raise UsageError(f"{path}: is the input too; write to another file")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary name beside `path` that becomes `path` only when the block succeeds."""
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
        temporary = Path(folder) / path.name
        yield temporary
        temporary.replace(path)


def format_of(path: Path, options: ReadOptions, *, shared: bool = False) -> Format:
    """The format that a file is read by.

    With `shared` options the one that they name is for files whose first bytes do not show it.
    """
    if options.format is None:
        return detect(path)
    if shared:
        with suppress(FormatError):
            if (found := detect(path)).magic or path.is_dir():
                return found
    return named_format(options.format)


def refuse_model(path: Path) -> None:
    """Refuses a model where a cloud is to be read."""
    if is_model(path):
        raise UsageError(
            f"{path}: is a model, not a cloud; surfabet decompress makes a cloud of it"
        )


def read_cloud(
    path: Path,
    options: ReadOptions,
    progress: ProgressCallback,
    *,
    beside: Format | None = None,
) -> surfabet.PointCloud:
    """The cloud of any readable file or folder.

    Options that are for another file, too, may be those of its format, which is `beside`.
    """
    refuse_model(path)
    known = format_of(path, options, shared=beside is not None)
    given = options.given()
    if beside is not None:
        others = set(beside.read_options) - set(known.read_options)
        given = {name: value for name, value in given.items() if name not in others}
    if wrong := [name for name in given if name not in known.read_options]:
        names = ", ".join(options.spelled(name) for name in wrong)
        owners = [f.name for f in formats() if any(name in f.read_options for name in wrong)]
        raise UsageError(
            f"{names}: not for the format {known.name} of {path}, but for "
            f"{', '.join(owners) or 'none'}"
        )
    progress(f"read {path.name}", 0.0)
    return surfabet.read(path, known.name, viewpoint=options.viewpoint, unit=options.unit, **given)


def load_model(
    path: Path, progress: ProgressCallback, vocabulary: Vocabulary | None = None, **part: Any
) -> AnyModel:
    """The model in a `.sfb` file, which may name a vocabulary instead of holding it, or the `part`
    of one in tiles."""
    refuse_cloud(path)
    progress(f"load {path.name}", 0.0)
    try:
        return surfabet.load(path, vocabulary=vocabulary, **part)
    except FormatError:
        # Damage, which inspecting tells too, or a vocabulary that was not named.
        needed = surfabet.inspect(path).vocabulary
        if vocabulary is not None or needed is None:
            raise
    raise UsageError(
        f"{path}: made with the dictionary {needed} and does not hold it; name the model that does "
        "with --vocabulary"
    )


def refuse_cloud(path: Path) -> None:
    """An error where a folder or a cloud is given in the place of a model."""
    if path.is_dir():
        raise UsageError(f"{path}: is a folder; name a model file ({MODEL_SUFFIX})")
    if is_model(path):
        return
    if path.is_file() and not path.stat().st_size:
        raise FormatError(f"{path}: the file is empty")
    if path.suffix.lower() == MODEL_SUFFIX:
        return
    with suppress(FormatError, OSError):
        known = detect(path)
        raise UsageError(
            f"{path}: is a cloud ({known.name}), not a model; surfabet compress makes a model of it"
        )


def holds_tiles(path: Path) -> bool:
    """True for a model file with tiles."""
    refuse_cloud(path)
    with path.open("rb") as file:
        return _core.holds_tiles(file.read(1 << 13))


def load_vocabulary(option: VocabularyOption, progress: ProgressCallback) -> Vocabulary | None:
    """The dictionary or alphabet of the model that was named, if one was."""
    if (path := option.vocabulary) is None:
        return None
    match load_model(path, progress):
        case surfabet.HscsmModel() as model:
            return model.dictionary
        case surfabet.AlphabetModel() | surfabet.BicAlphabetModel() as model:
            return model.alphabet
        case model:
            raise UsageError(
                f"--vocabulary {path}: --model {model.method} has none; hscsm, alphabet and "
                "bic-alphabet have"
            )


def size_on_disk(path: Path) -> int:
    """Bytes of a file, or of all files in a folder and below."""
    if path.is_dir():
        return sum(entry.stat().st_size for entry in path.rglob("*") if entry.is_file())
    return path.stat().st_size
