"""Holds the licence of every locked crate against the list in deny.toml."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path


def is_allowed(expression: str, allowed: set[str]) -> bool:
    """True when the SPDX expression can be satisfied with `allowed` licences."""
    # Older crates write "MIT/Apache-2.0" for OR; AND binds closer than OR, as in Python.
    expression = expression.replace("/", " OR ")
    words = re.findall(r"\(|\)|[^\s()]+(?: WITH [^\s()]+)?", expression)
    python = {"AND": "and", "OR": "or", "(": "(", ")": ")"}
    return bool(eval(" ".join(python.get(word) or str(word in allowed) for word in words)))


def main() -> int:
    with Path("deny.toml").open("rb") as file:
        allowed = set(tomllib.load(file)["licenses"]["allow"])
    command = ["cargo", "metadata", "--format-version", "1"]
    metadata = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    refused = [
        f"{package['name']} {package['version']}: {package['license'] or 'no licence named'}"
        for package in metadata["packages"]
        if not is_allowed(package["license"] or "none", allowed)
    ]
    for line in refused:
        print(line, file=sys.stderr)
    print(f"{len(metadata['packages'])} crates, {len(refused)} with a licence that is not allowed")
    return 1 if refused else 0


if __name__ == "__main__":
    sys.exit(main())
