//! The surface that the edges describe.
//!
//! | file | computes |
//! |---|---|
//! | `mesh` | triangles |
//! | `topology` | connected components, shortest paths along the edges |

mod mesh;
pub(super) mod topology;
