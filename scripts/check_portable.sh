#!/usr/bin/env bash
# Learns a scene by every method, with the core built for any x86-64 processor and built for AVX2 and FMA, and
# compares the files byte by byte. What is built at run time for the processor that is found (faer's products)
# is the same in both.

source "$(dirname "${BASH_SOURCE[0]}")/env.sh"

has_avx2 || { echo "nothing to compare: this processor has no AVX2 and FMA"; exit 0; }
check_rust

rm -rf out/portable
cargo build --quiet --workspace --examples --profile test
target/debug/examples/every_method out/portable/any
embed_cargo run --bin every_method -- out/portable/avx2

for file in out/portable/any/*.sfb; do
    cmp "$file" "out/portable/avx2/${file##*/}" || fail "AVX2 or FMA change the bytes of ${file##*/}"
    printf '%8d bytes, the same  %s\n' "$(wc -c <"$file")" "${file##*/}"
done
