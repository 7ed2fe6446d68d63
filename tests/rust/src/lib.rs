//! Integration tests that cross crates: a member of its own, since a virtual workspace runs no top-level `tests/`.
