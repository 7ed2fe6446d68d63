#!/usr/bin/env python3
"""Writes what follows from the records of options in Rust; `--check` only says what is stale.

The records are `crates/surfabet-models/src/*/options.rs`, as the installed surfabet has them. From
them come the keywords and docstrings of the learn functions in `python/surfabet/*.py`, the options
of `surfabet compress`, `find` and `recurring` in `python/surfabet/cli/_*_options.py`, and the
tables between `<!-- options: FUNCTION -->` and `<!-- /options -->` in `docs/*.md`.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from surfabet import _core

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "python" / "surfabet"
CLI = PACKAGE / "cli" / "_learn_options.py"
CLI_FIND = PACKAGE / "cli" / "_find_options.py"
CLI_RECURRING = PACKAGE / "cli" / "_recurring_options.py"
RECOGNITION = ROOT / "docs" / "recognition.md"
WIDTH = 100


@dataclass(frozen=True)
class Option:
    """The record of an option."""

    name: str
    kind: str
    choices: list[str]
    optional: bool
    default: Any
    none: str
    low: tuple[float, bool] | None
    high: tuple[float, bool] | None
    step: float | None
    unit: str | None
    range: str
    requirement: str
    documentation: str
    another_scene: bool

    @property
    def annotation(self) -> str:
        """Its type in a signature."""
        of_kind = {"bool": "bool", "int": "int", "float": "float"}
        of_kind |= {"floats": "Sequence[float]", "texts": "Sequence[str]"}
        if self.kind == "choice":
            annotation = f"Literal[{', '.join(map(quoted, self.choices))}]"
        else:
            annotation = of_kind[self.kind]
        return f"{annotation} | None" if self.optional else annotation

    @property
    def default_in_code(self) -> str:
        """Its default in a signature."""
        if isinstance(self.default, list):
            return f"({', '.join(map(number, self.default))})"
        if isinstance(self.default, str):
            return quoted(self.default)
        return number(self.default)

    @property
    def default_in_words(self) -> str:
        """Its default for people."""
        if self.default is None:
            return self.none
        if isinstance(self.default, list):
            return ", ".join(f"{value:.12g}" for value in self.default)
        if isinstance(self.default, float):
            return f"{self.default:.4g}"
        return str(self.default)

    @property
    def requirement_in_cli(self) -> str:
        """What a value must be on the command line."""
        return "names with commas between them" if self.kind == "texts" else self.requirement

    @property
    def summary(self) -> str:
        """The first sentence of its documentation."""
        return re.split(r"(?<=\.) (?=[A-Z'`])", self.documentation)[0]


@dataclass(frozen=True)
class Method:
    """Where the options of a method go."""

    name: str
    """Of the command line, and with an underscore of Python's file and the guide's page."""
    another_scene: str | None = None
    """The method in Python that describes, or takes in, another scene."""
    extra: tuple[str, ...] = ()
    """Keywords in Python that are no options; they come before these."""

    @property
    def module(self) -> str:
        """Name of the Python file, and of the guide's page."""
        return self.name.replace("-", "_")

    @property
    def function(self) -> str:
        """The function that learns."""
        return f"learn_{self.module}"


METHODS = (
    Method("patches"),
    Method("hscsm", another_scene="HscsmDictionary.describe"),
    Method("alphabet", another_scene="Alphabet.describe"),
    Method("bic-alphabet", another_scene="BicAlphabet.describe"),
    Method("planes", extra=("weights",)),
    Method("gas", another_scene="GasModel.update"),
)


FIND = "AlphabetModel.find"
RECURRING = "recurring"
"""The search in Python, which has a record of its own."""


def quoted(text: str) -> str:
    """A string as Python code, in double quotes."""
    return f'"{text}"'


def number(value: Any) -> str:
    """A default as Python code, integers with underscores."""
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:_}" if abs(value) >= 10_000 else str(value)
    return repr(value)


def filled(text: str, indent: int) -> list[str]:
    """A paragraph as lines."""
    prefix = " " * indent
    return textwrap.wrap(
        text, WIDTH, initial_indent=prefix, subsequent_indent=prefix, break_on_hyphens=False
    )


def capital(text: str) -> str:
    """The text with a large first letter."""
    return text[:1].upper() + text[1:]


# ------------------------------------------------------------------------------------- Python


def find_function(tree: ast.Module, path: str) -> ast.FunctionDef:
    """The function with the dotted name `path`."""
    node: Any = tree
    for name in path.split("."):
        node = next(
            child
            for child in node.body
            if isinstance(child, ast.FunctionDef | ast.ClassDef) and child.name == name
        )
    if not isinstance(node, ast.FunctionDef):
        raise SystemExit(f"{path} is no function")
    return node


def described(option: Option, indent: int) -> list[str]:
    """The entry of an option in a docstring."""
    rule = f"{capital(option.requirement)}; by default {option.default_in_words}."
    if option.optional and option.default is not None:
        rule += f" None: {option.none}."
    return [" " * indent + option.name, *filled(f"{option.documentation} {rule}", indent + 4)]


def parameters(docstring: list[str], indent: int) -> tuple[int, int, dict[str, list[str]]]:
    """First and last line (exclusive) of the entries in the section Parameters, and the entries."""
    head = next(i for i, line in enumerate(docstring) if line.strip() == "Parameters")
    start = head + 2
    end = next(
        (i for i in range(start, len(docstring)) if not docstring[i].strip()), len(docstring)
    )
    # A docstring without further sections ends with its quotes.
    if docstring[end - 1].strip() == '"""':
        end -= 1
    entries: dict[str, list[str]] = {}
    for line in docstring[start:end]:
        if not line.startswith(" " * (indent + 1)):
            name = line.strip()
            entries[name] = []
        entries[name].append(line)
    return start, end, entries


def with_options(source: str, path: str, options: list[Option], extra: tuple[str, ...]) -> str:
    """The source with the options in signature, docstring and body of a function."""
    function = find_function(ast.parse(source), path)
    lines = source.splitlines()
    indent = function.col_offset + 4

    # From the end to the start of the file, so that line numbers stay what they were.
    body = next(
        node
        for node in function.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "options"
    )
    pairs = [" " * (indent + 4) + f'"{option.name}": {option.name},' for option in options]
    assert body.end_lineno is not None
    lines[body.lineno - 1 : body.end_lineno] = [
        " " * indent + "options = {",
        *pairs,
        " " * indent + "}",
    ]

    text = function.body[0]
    assert text.end_lineno is not None
    docstring = lines[text.lineno - 1 : text.end_lineno]
    start, end, entries = parameters(docstring, indent)
    positional = [a.arg for a in function.args.args if a.arg != "self"]
    new = [line for name in (*positional, *extra) for line in entries[name]]
    new += [line for option in options for line in described(option, indent)]
    new += entries["progress"]
    docstring[start:end] = new
    lines[text.lineno - 1 : text.end_lineno] = docstring

    keywords = {a.arg: a for a in function.args.kwonlyargs}
    defaults = dict(zip(keywords, function.args.kw_defaults, strict=True))

    def as_it_was(name: str) -> str:
        annotation, default = keywords[name].annotation, defaults[name]
        assert annotation is not None
        assert default is not None
        return f"{name}: {ast.unparse(annotation)} = {ast.unparse(default)},"

    new = [
        *map(as_it_was, extra),
        *(f"{o.name}: {o.annotation} = {o.default_in_code}," for o in options),
        as_it_was("progress"),
    ]
    first = min(a.lineno for a in keywords.values())
    last = max(a.lineno for a in keywords.values())
    lines[first - 1 : last] = [" " * indent + line for line in new]
    return "\n".join(lines) + "\n"


def python_files(
    records: dict[str, list[Option]], search: list[Option]
) -> Iterator[tuple[Path, str]]:
    """The file of each method, with its options."""
    for method in METHODS:
        path = PACKAGE / f"{method.module}.py"
        options = records[method.name]
        source = with_options(path.read_text(), method.function, options, method.extra)
        if method.another_scene:
            again = [option for option in options if option.another_scene]
            source = with_options(source, method.another_scene, again, ())
        if method.name == "alphabet":
            source = with_options(source, FIND, search, ("point", "radius", "box"))
        yield path, source


# ------------------------------------------------------------------------------------- command line


CLI_HEAD = '''"""Options of learning, for all models; written by scripts/generate_options.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter

from surfabet.cli._numbers import WHOLE

__all__ = ["LEARN_OPTIONS", "LearnOptions", "ModelName"]

'''


def cli_help(models: dict[str, Option]) -> str:
    """Help of an option: what it does, then range and default, for each model that has it."""
    summaries: dict[str, list[str]] = {}
    rules: dict[str, list[str]] = {}
    for model, option in models.items():
        summaries.setdefault(option.summary, []).append(model)
        rule = f"{option.requirement_in_cli}; by default {option.default_in_words}"
        rules.setdefault(rule, []).append(model)
    if len(models) == 1:
        (summary,), (rule,) = summaries, rules
        return f"{summary} {capital(rule)}."
    sentences = [f"{', '.join(who)}: {summary}" for summary, who in summaries.items()]
    if len(rules) == 1:
        sentences += [f"{capital(rule)}." for rule in rules]
    else:
        sentences += [f"For {', '.join(who)} {rule}." for rule, who in rules.items()]
    return " ".join(sentences)


def cli_annotation(option: Option) -> str:
    """Type of an option that may not be given."""
    of_kind = {"bool": "bool | None", "int": "int | None", "float": "float | None"}
    if option.kind == "choice":
        return f"Literal[{', '.join(map(quoted, option.choices))}] | None"
    if option.kind == "floats":
        return "Sequence[float] | None"
    if option.kind == "texts":
        return "str | None"
    return of_kind[option.kind]


def cli_file(records: dict[str, list[Option]]) -> str:
    """All options as one dataclass, each once; those of several models first."""
    union: dict[str, dict[str, Option]] = {}
    for model, options in records.items():
        for option in options:
            union.setdefault(option.name, {})[model] = option
    for name, models in union.items():
        if len({cli_annotation(option) for option in models.values()}) > 1:
            raise SystemExit(f"{name} has another type in each of {', '.join(models)}")

    lines = [CLI_HEAD]
    lines.append(f"ModelName = Literal[{', '.join(map(quoted, records))}]\n")
    lines.append('"""What `--model` takes."""\n\n')
    lines.append('SHARED = Group("Options of several models", sort_key=1)\n')
    for k, model in enumerate(records):
        lines.append(f'{group(model)} = Group("Options of --model {model}", sort_key={k + 2})\n')
    names = [name for name, models in union.items() if next(iter(models.values())).kind == "texts"]
    lines.append(f"\nNAMES = frozenset({{{', '.join(map(quoted, names))}}})\n")
    lines.append('"""Options that take names with commas between them."""\n')
    lines.append(
        '\n\n@Parameter(name="*")\n@dataclass(frozen=True)\nclass LearnOptions:\n'
        '    """Options of learning; None leaves them to the model."""\n'
    )
    ordered = [*((n, m) for n, m in union.items() if len(m) > 1)]
    ordered += [(n, m) for n, m in union.items() if len(m) == 1]
    for name, models in ordered:
        of_group = "SHARED" if len(models) > 1 else group(next(iter(models)))
        annotation = cli_annotation(next(iter(models.values())))
        lines.append("\n" + cli_field(name, annotation, of_group))
        text = f'"""{cli_help(models)}"""'
        lines.append("\n".join(filled(text, 4)) + "\n")
    lines.append(cli_tail("LEARN_OPTIONS", "LearnOptions", splits=True))
    return "".join(lines)


SEARCH_HEAD = '''"""Options of the verb `{verb}`; written by scripts/generate_options.py."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from cyclopts import Group, Parameter

from surfabet.cli._numbers import WHOLE

__all__ = ["{constant}", "{of_class}"]

SEARCH = Group("Options of the search", sort_key=1)


@Parameter(name="*")
@dataclass(frozen=True)
class {of_class}:
    """Options of the search; None leaves them to it."""
'''


def search_file(search: list[Option], function: str, verb: str) -> str:
    """The options of a search as a dataclass."""
    constant, of_class = f"{verb.upper()}_OPTIONS", f"{verb.capitalize()}Options"
    lines = [SEARCH_HEAD.format(verb=verb, constant=constant, of_class=of_class)]
    for option in search:
        lines.append("\n" + cli_field(option.name, cli_annotation(option), "SEARCH"))
        text = f'"""{cli_help({function: option})}"""'
        lines.append("\n".join(filled(text, 4)) + "\n")
    lines.append(cli_tail(constant, of_class))
    return "".join(lines)


def group(model: str) -> str:
    """The constant with the group of a model's own options."""
    return model.replace("-", "_").upper()


def cli_field(name: str, annotation: str, of_group: str) -> str:
    """The declaration of one field, broken as the formatter breaks it."""
    extra = ", consume_multiple=True, negative=()" if annotation.startswith("Sequence") else ""
    whole = ", WHOLE" if annotation.startswith("int") else ""
    parameter = f"Parameter(group={of_group}{extra}){whole}"
    declared = f"    {name}: Annotated[{annotation}, {parameter}]"
    if len(declared) + len(" = None") <= WIDTH:
        return f"{declared} = None\n"
    if len(declared) + len(" = (") <= WIDTH:
        return f"{declared} = (\n        None\n    )\n"
    return f"    {name}: Annotated[\n        {annotation}, {parameter}\n    ] = None\n"


def cli_tail(constant: str, of_class: str, splits: bool = False) -> str:
    """What follows the fields of a dataclass, and the one without any option."""
    of_all = "{name: value for name, value in vars(self).items() if value is not None}"
    if splits:
        summary = "The options that were given; names with commas between them as lists."
        body = [
            f"given = {of_all}",
            "for name in NAMES.intersection(given):",
            '    given[name] = [part.strip() for part in given[name].split(",") if part.strip()]',
            "return given",
        ]
    else:
        summary = "The options that were given."
        body = [f"return {of_all}"]
    text = "".join(f"        {line}\n" for line in [f'"""{summary}"""', *body])
    return f"""
    def given(self) -> dict[str, Any]:
{text}

{constant} = {of_class}()
"""


# ------------------------------------------------------------------------------------- guide


def table(options: Iterable[Option]) -> str:
    """The table of a guide page."""
    rows = ["| option | default | unit | range | meaning |", "|---|---|---|---|---|"]
    for option in options:
        default = option.default_in_words
        if option.default is not None and option.kind != "floats":
            default = f"`{default}`"
        elif option.kind == "floats":
            default = f"`{option.default_in_code}`"
        cells = [f"`{option.name}`", default, option.unit or "", option.range, option.documentation]
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows)


def with_table(text: str, function: str, options: list[Option]) -> str:
    """A guide page with the table of a function between its marks."""
    new, n = re.subn(
        rf"(<!-- options: {re.escape(function)} -->\n).*?(<!-- /options -->)",
        lambda found: f"{found[1]}{table(options)}\n{found[2]}",
        text,
        flags=re.DOTALL,
    )
    if n != 1:
        raise SystemExit(f"the guide needs one table between marks for {function}")
    return new


def guide_pages(
    records: dict[str, list[Option]], search: list[Option]
) -> Iterator[tuple[Path, str]]:
    """The guide page of each method, with its table."""
    for method in METHODS:
        path = ROOT / "docs" / f"{method.module}.md"
        text = with_table(path.read_text(), method.function, records[method.name])
        if method.name == "alphabet":
            text = with_table(text, FIND, search)
        yield path, text


def main() -> int:
    """Runs the script."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing, fail where needed")
    arguments = parser.parse_args()
    records = {
        method: [Option(**record) for record in options]
        for method, options in _core.option_specs().items()
    }
    if list(records) != [method.name for method in METHODS]:
        raise SystemExit(f"METHODS here are not those of the binary: {', '.join(records)}")
    search = [Option(**record) for record in _core.find_option_specs()]
    recurring = [Option(**record) for record in _core.recurring_option_specs()]
    recurring_py = PACKAGE / "recurring.py"
    files = [
        *python_files(records, search),
        (recurring_py, with_options(recurring_py.read_text(), RECURRING, recurring, ())),
        (CLI_RECURRING, search_file(recurring, RECURRING, "recurring")),
        (CLI, cli_file(records)),
        (CLI_FIND, search_file(search, FIND, "find")),
        *guide_pages(records, search),
        (RECOGNITION, with_table(RECOGNITION.read_text(), RECURRING, recurring)),
    ]
    stale = [(path, text) for path, text in files if not path.exists() or path.read_text() != text]
    for path, text in stale:
        name = path.relative_to(ROOT)
        if arguments.check:
            print(f"{name}: out of date; run scripts/generate_options.py", file=sys.stderr)
        else:
            path.write_text(text)
            print(f"{name}: written")
    return 1 if stale and arguments.check else 0


if __name__ == "__main__":
    sys.exit(main())
