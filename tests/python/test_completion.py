"""Completion of the command line, by the shells themselves."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("cyclopts", reason="pip install 'surfabet[cli]'")

from cyclopts.completion import ShellDetectionError

from surfabet.cli import main

# What `bash` does when Tab is pressed after the words that are given.
BASH = """
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMP_LINE="$*"; COMP_POINT=${#COMP_LINE}
_surfabet
printf '%s\\n' "${COMPREPLY[@]}"
"""


def need(shell: str) -> str:
    found = shutil.which(shell)
    if found is None:
        pytest.skip(f"{shell} is not installed")
    return found


@pytest.fixture
def script(
    request: pytest.FixtureRequest, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> Path:
    assert main(["completion", request.param]) == 0
    path = tmp_path / "completion"
    path.write_text(capsys.readouterr().out)
    return path


def completed(script: Path, *words: str) -> list[str]:
    done = subprocess.run(
        [need("bash"), "-c", BASH, "bash", script, "surfabet", *words],
        capture_output=True,
        text=True,
        cwd=script.parent,
        check=True,
    )
    return done.stdout.split()


@pytest.mark.parametrize("script", ["bash"], indirect=True)
def test_bash_completes_verbs_options_and_values(script: Path) -> None:
    assert set(completed(script, "com")) == {"compress", "compare", "completion"}
    assert "--max-error" in completed(script, "compress", "--max-e")
    models = completed(script, "compress", "--model", "")
    assert set(models) == {"patches", "hscsm", "alphabet", "bic-alphabet", "planes", "gas"}
    assert completed(script, "completion", "z") == ["zsh"]


@pytest.mark.parametrize("script", ["bash"], indirect=True)
def test_bash_completes_files(script: Path) -> None:
    (script.parent / "scan of a room.ply").touch()
    (script.parent / "room.sfb").touch()
    assert completed(script, "view", "ro") == ["room.sfb"]


@pytest.mark.parametrize("script", ["zsh"], indirect=True)
def test_zsh_reads_its_script(script: Path) -> None:
    subprocess.run([need("zsh"), "-n", script], check=True)
    # The file is the body of the function.
    load = 'fpath=("$1" $fpath); autoload -Uz compinit; compinit -D -u; print $_comps[surfabet]'
    folder = script.parent / "functions"
    folder.mkdir()
    script.rename(folder / "_cyclopts_surfabet")
    done = subprocess.run(
        [need("zsh"), "-fc", load, "zsh", folder],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["_cyclopts_surfabet"]


@pytest.mark.parametrize("script", ["fish"], indirect=True)
def test_fish_completes_verbs_options_and_values(script: Path) -> None:
    def completed(line: str) -> list[str]:
        done = subprocess.run(
            [
                need("fish"),
                "--no-config",
                "-c",
                "source $argv[1]; complete -C $argv[2]",
                script,
                line,
            ],
            capture_output=True,
            text=True,
            check=True,
        )
        return [found.partition("\t")[0] for found in done.stdout.splitlines()]

    assert {"compress", "compare", "completion"} <= set(completed("surfabet com"))
    assert "--max-error" in completed("surfabet compress --max-e")
    assert "bic-alphabet" in completed("surfabet compress --model b")


def test_it_is_installed_into_the_home_folder_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / ".bashrc").write_text("alias ll='ls -l'")
    for _ in range(2):
        assert main(["completion", "bash", "--install"]) == 0
    path = tmp_path / ".local/share/bash-completion/completions/surfabet"
    assert capsys.readouterr().out.startswith(f"{path}: completes surfabet in bash")
    assert "complete -F _surfabet surfabet" in path.read_text()
    lines = (tmp_path / ".bashrc").read_text().splitlines()
    assert lines[0] == "alias ll='ls -l'"
    assert sum(str(path) in line for line in lines) == 1


def test_a_shell_that_is_not_known_is_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["completion", "tcsh"]) == 2
    assert "tcsh" in capsys.readouterr().err

    def unknown() -> str:
        raise ShellDetectionError

    # The module, which the package's verb of the same name hides.
    module = sys.modules["surfabet.cli.completion"]
    monkeypatch.setattr(module, "detect_shell", unknown)
    assert main(["completion"]) == 2
    assert "name it: surfabet completion bash|zsh|fish" in capsys.readouterr().err


def test_the_package_runs_as_a_module() -> None:
    for module in ("surfabet", "surfabet.cli"):
        done = subprocess.run(
            [sys.executable, "-m", module, "--version"], capture_output=True, text=True, check=True
        )
        assert done.stdout.strip()
