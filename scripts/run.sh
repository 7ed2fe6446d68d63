#!/usr/bin/env bash
# Builds surfabet into .venv, then compresses, decompresses and evaluates a scan and draws both clouds.
#
#   scripts/run.sh          a simulated furnished room
#   scripts/run.sh PATH     a scan of yours: ply, pcd, las, laz, e57, npz, xyz, KITTI bin or an RGB-D folder
#
# The results are written to out/. PYTHON=... chooses the Python that .venv is made from.

input=""
if [[ $# -gt 1 || "${1:-}" == -* ]]; then
    sed -n '2,7s/^# \{0,1\}//p' "$0"
    [[ "${1:-}" == "-h" || "${1:-}" == "--help" ]] && exit 0
    exit 2
elif [[ $# -eq 1 ]]; then
    input=$(realpath -e -- "$1" 2>/dev/null) || { echo "error: no file or folder $1" >&2; exit 1; }
fi

source "$(dirname "${BASH_SOURCE[0]}")/env.sh"

heading "Build and install"
install_surfabet all

mkdir -p out
if [[ -z "$input" ]]; then
    heading "Simulate a scan of a furnished room"
    input=out/demo.npz
    .venv/bin/python -c '
import sys
import surfabet as sb
from surfabet import datasets

cloud = datasets.load_demo().cloud
print(cloud)
sb.write(sys.argv[1], cloud)
' "$input"
fi
name=$(basename "$input")
name=${name%.*}

heading "Compress"
.venv/bin/surfabet compress "$input" "out/$name.sfb" --no-evaluate

heading "Decompress"
.venv/bin/surfabet decompress "out/$name.sfb" "out/$name.decoded.ply"

heading "Evaluate"
.venv/bin/surfabet evaluate "$input" "out/$name.sfb" --picture "out/$name.png"

heading "Produced"
for file in "out/$name.sfb" "out/$name.decoded.ply" "out/$name.png"; do
    printf '%12d bytes  %s\n' "$(wc -c <"$file")" "$file"
done
