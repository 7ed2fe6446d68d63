#!/usr/bin/env bash
# Builds the documentation site into out/docs; a warning is an error.
#
#   scripts/docs.sh              with .venv, into which surfabet and its extra `docs` are installed
#   scripts/docs.sh FOLDER       into another folder
#   PYTHON=... scripts/docs.sh   with another Python that has them

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:-out/docs}
python=${PYTHON:-.venv/bin/python}

"$python" -m sphinx --version >/dev/null 2>&1 || {
    echo "error: $python has no sphinx; $python -m pip install '.[docs]'" >&2
    exit 1
}
"$python" -m sphinx -q -W --keep-going -b html docs "$out"
echo "site: $out/index.html"
