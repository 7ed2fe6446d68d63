# Sourced by the other scripts: finds Python and Rust, keeps .venv, builds the package into it.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1

fail() {
    echo "error: $*" >&2
    exit 1
}

heading() {
    printf '\n== %s\n' "$*"
}

is_new_enough() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1
}

# Prints the first Python of at least 3.11: $PYTHON if set, else the usual names.
find_python() {
    local candidate
    if [[ -n "${PYTHON:-}" ]]; then
        is_new_enough "$PYTHON" || fail "PYTHON=$PYTHON is not a Python of at least 3.11"
        echo "$PYTHON"
        return
    fi
    for candidate in python3 python3.14 python3.13 python3.12 python3.11 python; do
        if is_new_enough "$candidate"; then
            echo "$candidate"
            return
        fi
    done
    fail "no Python of at least 3.11 found; install one, or name it: PYTHON=/path/to/python $0"
}

# rustup's place, for shells that have not read its profile.
if ! command -v cargo >/dev/null && [[ -x "$HOME/.cargo/bin/cargo" ]]; then
    export PATH="$HOME/.cargo/bin:$PATH"
fi

check_rust() {
    local wanted found
    command -v cargo >/dev/null || fail "cargo not found; install Rust from https://rustup.rs"
    wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
    found=$(rustc --version | cut -d ' ' -f 2)
    if [[ "$(printf '%s\n%s\n' "$wanted" "$found" | sort -V | head -n 1)" != "$wanted" ]]; then
        fail "Rust $found is too old, $wanted is needed; with rustup: rustup update stable"
    fi
    echo "Rust $found"
}

ensure_venv() {
    local python
    if [[ -d .venv ]] && is_new_enough .venv/bin/python; then
        return
    fi
    python=$(find_python)
    "$python" -c 'import ensurepip, venv' 2>/dev/null \
        || fail "$python cannot create environments; on Debian or Ubuntu: apt-get install python3-venv"
    rm -rf .venv
    "$python" -m venv .venv
}

# Prints what the package and its extra $1 need, a line each; an extra that names others of the package is followed.
requirements() {
    python - "$1" <<'END'
import re
import sys
import tomllib

with open("pyproject.toml", "rb") as file:
    project = tomllib.load(file)["project"]
needed, extras = list(project["dependencies"]), [sys.argv[1]]
while extras:
    for line in project["optional-dependencies"][extras.pop()]:
        if own := re.fullmatch(rf"{project['name']}\[(.*)\]", line):
            extras += own[1].split(",")
        else:
            needed.append(line)
print("\n".join(needed))
END
}

# Builds the package in release mode into .venv, with the extras named in $1; quick when nothing changed.
install_surfabet() {
    ensure_venv
    .venv/bin/python --version
    check_rust
    .venv/bin/pip install --quiet 'maturin>=1.9,<2'
    # The libraries are fetched while the extension compiles. pip builds the package itself only after that: two
    # maturins at once would move the same file in target/. If the first build fails, pip's own fails alike and
    # says why. Bash would let Ctrl-C pass by what runs behind `&`.
    local -x PATH="$PWD/.venv/bin:$PATH" VIRTUAL_ENV="$PWD/.venv"
    (trap - INT && exec maturin develop --quiet --release --skip-install) >/dev/null 2>&1 &
    requirements "$1" | python -m pip install --quiet --requirement /dev/stdin
    wait $! || true
    # Without isolation the build keeps its place in target/, so that the next one is quick. Both builds name
    # Python alike, as `python`, so that the second finds nothing changed.
    python -m pip install --quiet --no-build-isolation --editable ".[$1]"
    echo "installed into .venv: $(.venv/bin/surfabet --version)"
}

has_avx2() {
    [[ "$(uname -m)" == x86_64 ]] && grep -qw avx2 /proc/cpuinfo && grep -qw fma /proc/cpuinfo
}

# Cargo for examples/embed, a program outside the workspace. It is built for AVX2 and FMA where the processor has
# them, unlike all else, so that check_portable.sh finds two builds to compare.
embed_cargo() {
    local flags=""
    if has_avx2; then
        flags="-C target-cpu=x86-64-v3"
    fi
    # What the workspace's profiles say of libraries of which nothing is called, or all of it is compiled with its callers.
    local name options=()
    for name in faer gemm-c32 gemm-c64 nano-gemm-c32 nano-gemm-c64 nano-gemm-f64 nalgebra simba matrixmultiply; do
        options+=(--config "profile.dev.package.$name.opt-level=0")
    done
    CARGO_TARGET_DIR=target/embed RUSTFLAGS="$flags" cargo "$1" --quiet "${options[@]}" \
        --manifest-path examples/embed/Cargo.toml "${@:2}"
}
