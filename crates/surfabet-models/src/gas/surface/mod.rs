//! The surface that the edges describe.
//!
//! | file | computes |
//! |---|---|
//! | `mesh` | triangles |
//! | `topology` | connected components, distances along the edges |

mod mesh;
mod topology;
