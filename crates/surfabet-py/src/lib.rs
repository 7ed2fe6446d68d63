//! Python bindings: a class or a topic per file, no numerics of their own.
//!
//! Every long call runs through [`run::run`]: the interpreter lock is released, progress reaches a Python
//! callable and Ctrl-C stops the work.

mod arrays;
mod cloud;
mod errors;
mod run;
mod sparse;
mod view;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    run::register(module)?;
    cloud::register(module)?;
    sparse::register(module)?;
    Ok(())
}
