#!/usr/bin/env bash
# Installs what the tests need and runs every check; stops at the first that fails and names it.
#
#   scripts/test.sh

source "$(dirname "${BASH_SOURCE[0]}")/env.sh"

[[ $# -eq 0 ]] || fail "scripts/test.sh takes no arguments, not $*: it runs every check"

current="start"
passed=0
interrupted=""
job=""

finish() {
    local status=$?
    if [[ -n "$interrupted" ]]; then
        printf '\nINTERRUPTED by SIG%s: %s (after %d passed checks)\n' "$interrupted" "$current" "$passed" >&2
    elif [[ $status -eq 0 ]]; then
        printf '\nAll %d checks passed in %d min %02d s.\n' "$passed" $((SECONDS / 60)) $((SECONDS % 60))
    else
        printf '\nFAILED: %s (after %d passed checks)\n' "$current" "$passed" >&2
    fi
}
trap finish EXIT

# Ends the running check, with all its children, and the script with it.
interrupt() {
    trap '' HUP INT TERM
    interrupted=$1
    if [[ -n "$job" ]] && kill -TERM -- "-$job" 2>/dev/null; then
        wait "$job" 2>/dev/null || true
    fi
    exit $((128 + $2))
}
trap 'interrupt HUP 1' HUP
trap 'interrupt INT 2' INT
trap 'interrupt TERM 15' TERM

# Each check is a job with a process group of its own: bash waits for a foreground command before it looks at
# a signal, but not for a job.
set -m
step() {
    current=$1
    shift
    heading "$current"
    local began=$SECONDS
    "$@" &
    job=$!
    wait "$job"
    job=""
    passed=$((passed + 1))
    echo "-- $current: passed in $((SECONDS - began)) s"
}

build_docs() {
    RUSTDOCFLAGS="-D warnings" cargo doc --quiet --workspace --no-deps
}

# A program outside the workspace, as others would write it, on a square of 0.5 m.
embed_example() {
    mkdir -p out
    .venv/bin/python -c '
for i in range(10_000):
    print(i % 100 * 0.005, i // 100 * 0.005, 1.0)
' > out/square.xyz
    embed_cargo run -- out/square.xyz out/square.sfb
}

step "Build and install" install_surfabet test
step "Options up to date with their records" .venv/bin/python scripts/generate_options.py --check
step "Rust format" cargo fmt --all --check
step "Python lints" .venv/bin/ruff check python tests/python benches docs scripts
step "Rust lints" cargo clippy --quiet --workspace --all-targets -- -D warnings
step "Licences of dependencies" .venv/bin/python scripts/check_licenses.py
step "Rust tests" cargo test --quiet --workspace
step "Rust documentation" build_docs
# With the libraries that the tests were built with: as `cargo bench` builds them would be all of them once more.
step "Rust benchmarks build" cargo bench --quiet --workspace --no-run --profile test
step "Example of embedding" embed_example
step "Same bytes with and without AVX2" scripts/check_portable.sh
step "Python types" .venv/bin/mypy
step "Python stubs against the binary" .venv/bin/python -m mypy.stubtest surfabet._core --allowlist tests/python/stubtest_allowlist.txt
step "Wheel and source distribution" scripts/check_wheel.sh
step "Documentation site" scripts/docs.sh
# A process per core: most of what Python does takes one.
step "Python tests" .venv/bin/pytest --quiet --numprocesses auto
