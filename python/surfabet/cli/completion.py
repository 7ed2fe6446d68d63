"""`surfabet completion`: verbs, options and their values by the Tab key."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter
from cyclopts.completion import ShellDetectionError, detect_shell

from surfabet.cli._options import COMMON, Common, Flag, UsageError

Shell = Literal["bash", "zsh", "fish", "powershell"]


def completion(
    shell: Annotated[Shell | None, Parameter(name="SHELL")] = None,
    /,
    *,
    install: Flag = False,
    common: Common = COMMON,
) -> None:
    """Print the script that makes a shell complete verbs, options and their values.

        surfabet completion --install
        surfabet completion bash > /etc/bash_completion.d/surfabet

    Parameters
    ----------
    shell
        bash, zsh, fish or powershell; by default the one that this runs in.
    install
        Write it where the shell looks for it, in your home folder, and print the file. For bash
        and zsh a line in .bashrc or .zshrc loads it.
    """
    # All verbs, of which this is one.
    from surfabet.cli._app import app

    if shell is None:
        try:
            shell = detect_shell()
        except ShellDetectionError:
            raise UsageError(
                "the shell is not known here; name it: surfabet completion bash|zsh|fish|powershell"
            ) from None
    if not install:
        print(app.generate_completion(shell=shell), end="")
        return
    path = app.install_completion(shell=shell)
    if not common.quiet:
        print(f"{path}: completes surfabet in {shell}, from the next shell that you open")
