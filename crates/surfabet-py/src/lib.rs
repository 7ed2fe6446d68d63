//! Python bindings: a class or a topic per file, no numerics of their own.
//!
//! Every long call runs through [`run::run`]: the interpreter lock is released, progress reaches a Python
//! callable and Ctrl-C stops the work.

mod alphabet;
mod arguments;
mod arrays;
mod bic_alphabet;
mod bricks;
mod changes;
mod cloud;
mod errors;
mod files;
mod find;
mod gas;
mod hscsm;
mod kdtree;
mod locate;
mod lzf;
mod metrics;
mod model;
mod normals;
mod octree;
mod options;
mod patches;
mod places;
mod planes;
mod range_image;
mod reduce;
mod report;
mod run;
mod sim;
mod sparse;
mod survey;
mod tiles;
mod view;
mod voxel_grid;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("LARGEST_UNSHIFTED", surfabet_geom::LARGEST_UNSHIFTED)?;
    module.add("MAX_NOTE", surfabet::MAX_NOTE)?;
    module.add("RESERVED_NAMES", surfabet_geom::RESERVED_NAMES)?;
    run::register(module)?;
    cloud::register(module)?;
    model::register(module)?;
    alphabet::register(module)?;
    bic_alphabet::register(module)?;
    find::register(module)?;
    locate::register(module)?;
    places::register(module)?;
    files::register(module)?;
    gas::register(module)?;
    reduce::register(module)?;
    hscsm::register(module)?;
    patches::register(module)?;
    planes::register(module)?;
    lzf::register(module)?;
    sim::register(module)?;
    kdtree::register(module)?;
    metrics::register(module)?;
    normals::register(module)?;
    octree::register(module)?;
    options::register(module)?;
    range_image::register(module)?;
    voxel_grid::register(module)?;
    sparse::register(module)?;
    changes::register(module)?;
    survey::register(module)?;
    tiles::register(module)?;
    bricks::register(module)?;
    Ok(())
}
