#!/usr/bin/env bash
# Packs what is built in target/ into a wheel, installs it into a fresh environment with numpy only and no Rust, and does
# there what a new user does; then the command line with its extra. The source distribution is packed too, and checked for
# all that it must hold; it is not built from, which would compile everything once more.
#
# Needs .venv with maturin, as scripts/run.sh makes it. Nothing is compiled if that was built before.

source "$(dirname "${BASH_SOURCE[0]}")/env.sh"

[[ -x .venv/bin/maturin ]] || fail ".venv has no maturin; scripts/run.sh installs it"
check_rust
out=out/wheel
rm -rf "$out"
mkdir -p "$out"

# With the options of the other builds, so that nothing is new to Cargo.
VIRTUAL_ENV="$PWD/.venv" PATH="$PWD/.venv/bin:$PATH" maturin build --verbose --release --interpreter python --out "$out" \
    >"$out/build.log" 2>&1 || { cat "$out/build.log" >&2; fail "the wheel cannot be built"; }
echo "crates compiled: $(grep -cE '^ +Compiling ' "$out/build.log" || true)"
wheels=("$out"/surfabet-*-cp311-abi3-*.whl)
[[ ${#wheels[@]} -eq 1 && -f "${wheels[0]}" ]] || fail "no wheel for any Python from 3.11 in $(ls "$out")"
wheel=$(realpath "${wheels[0]}")
printf '%8d bytes  %s\n' "$(wc -c <"$wheel")" "${wheel##*/}"

# Runs a command of the fresh environment, without the variables of this shell and without Rust on the PATH.
fresh() {
    (cd "$out/work" && env -i HOME="$HOME" PIP_DISABLE_PIP_VERSION_CHECK=1 PATH="$OLDPWD/$out/fresh/bin:/usr/bin:/bin" "$@")
}

mkdir "$out/work"
.venv/bin/python -m venv "$out/fresh"
fresh pip install --quiet --only-binary :all: "$wheel"
fresh python - <<'END'
import sys
import time
from importlib.metadata import packages_distributions, requires

before = set(sys.modules)
started = time.perf_counter()
import numpy as np

numpy_done = time.perf_counter()
import surfabet as sb

done = time.perf_counter()
print(f"import: {done - started:.3f} s, of which numpy {numpy_done - started:.3f} s")
own = {"numpy", "surfabet"}
packages = {name.partition(".")[0] for name in set(sys.modules) - before}
others = packages & set(packages_distributions()) - own
assert not others, f"import surfabet imports {others}"
needed = [line for line in requires("surfabet") if "extra ==" not in line]
assert len(needed) == 1 and needed[0].startswith("numpy"), needed

from pathlib import Path

from surfabet import datasets

folder = Path(sb.__file__).parent
assert (folder / "py.typed").exists() and (folder / "_core.pyi").exists()
cloud = datasets.simulated_room(n_poses=2).cloud
sb.write("room.ply", cloud)
model = sb.learn_patches(sb.read("room.ply"))
model.save("room.sfb")
again = sb.load("room.sfb").decode(as_measured=True)
quality = sb.evaluate(cloud, again)
assert quality.rmse < 2 * model.report.tolerance, quality
sb.view("room.sfb", "room.html")
print(f"{len(cloud):,} points in {Path('room.sfb').stat().st_size:,} bytes, {1000 * quality.rmse:.1f} mm")
END
if fresh surfabet --help 2>"$out/help.log"; then
    fail "the command line runs without its extra"
fi
grep -q "pip install 'surfabet\[cli\]'" "$out/help.log" || fail "without its extra the command line says: $(cat "$out/help.log")"
fresh pip install --quiet --only-binary :all: "$wheel[cli]"
fresh surfabet --help >"$out/help.txt"
grep -q compress "$out/help.txt" || fail "surfabet --help names no verb compress"
fresh surfabet info room.sfb --json >/dev/null
fresh surfabet decompress room.sfb again.ply --quiet
echo "surfabet --help, info, decompress: done"

.venv/bin/maturin sdist --out "$out" >"$out/sdist.log" 2>&1 || { cat "$out/sdist.log" >&2; fail "the sources cannot be packed"; }
sdists=("$out"/surfabet-*.tar.gz)
tar -xzf "${sdists[0]}" -C "$out/work"
source=$(realpath "$out"/work/surfabet-*/)
git ls-files Cargo.lock Cargo.toml README.md 'LICENSE-*' pyproject.toml crates python | while read -r file; do
    [[ -f "$source/$file" ]] || fail "the source distribution lacks $file"
done
# All members of the workspace, and versions of all libraries among those that are here.
cargo metadata --offline --quiet --format-version 1 --manifest-path "$source/Cargo.toml" \
    --filter-platform "$(rustc -vV | sed -n 's/^host: //p')" >/dev/null
printf '%8d bytes  %s\n' "$(wc -c <"${sdists[0]}")" "${sdists[0]##*/}"
