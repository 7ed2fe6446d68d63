"""README and the guides: relative links and their anchors resolve, Python examples compile."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("benches/**/*.md")])
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
TABLES = re.compile(r"<!-- options: (learn_\w+) -->")


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", FENCE.sub("", page.read_text("utf-8")), re.MULTILINE)
    plain = [re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings]
    return {heading.strip().replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_relative_links_resolve(page: Path) -> None:
    broken = []
    for link in LINK.findall(FENCE.sub("", page.read_text("utf-8"))):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    assert not broken


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_python_examples_compile(page: Path) -> None:
    for language, code in FENCE.findall(page.read_text("utf-8")):
        if language == "python":
            compile(code, name(page), "exec")


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_shell_examples_parse_and_their_scripts_exist(page: Path) -> None:
    for language, code in FENCE.findall(page.read_text("utf-8")):
        if language != "sh":
            continue
        subprocess.run(["bash", "-n"], input=code, text=True, check=True)
        for script in re.findall(r"python ((?:benches|docs)/\S+\.py)", code):
            assert (ROOT / script).exists()


def test_each_method_has_one_table_of_options() -> None:
    found = [(method, page.stem) for page in PAGES for method in TABLES.findall(page.read_text())]
    methods = ["alphabet", "bic_alphabet", "gas", "hscsm", "patches", "planes"]
    assert sorted(found) == [(f"learn_{method}", method) for method in methods]


def tree() -> list[str]:
    """The paths that the tree in CONTRIBUTING.md names."""
    block = (ROOT / "CONTRIBUTING.md").read_text("utf-8").split("## The tree")[1].split("```")[1]
    above: list[tuple[int, str]] = []
    found = []
    for line in filter(str.strip, block.splitlines()):
        indent, word = len(line) - len(line.lstrip()), line.split()[0]
        if indent > 20:
            # The description above goes on.
            continue
        while above and above[-1][0] >= indent:
            above.pop()
        found.append("".join(part for _, part in above) + word.removesuffix("/"))
        above.append((indent, word))
    return found


PLAIN = {"src", "tests", "scenes", "benches", "examples"}
"""Names of folders that hold the code of the folder above them, which is named."""


def test_the_tree_of_folders_is_that_of_the_repository() -> None:
    named = tree()
    assert len(named) > 90
    assert [path for path in named if not (ROOT / path).exists()] == []
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("no git, or no repository")
    command = ["git", "-C", str(ROOT), "ls-files"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True)
    files = [Path(line) for line in listed.stdout.splitlines()]
    folders = {str(folder) for file in files for folder in file.parents if folder != Path()}
    covered = {str(folder) for path in named for folder in [Path(path), *Path(path).parents]}
    missing = folders - covered
    assert [folder for folder in sorted(missing) if Path(folder).name not in PLAIN | {".ci"}] == []
