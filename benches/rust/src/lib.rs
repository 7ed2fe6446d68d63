//! Criterion benchmarks of the workspace; run them with `cargo bench -p surfabet-benches`.
