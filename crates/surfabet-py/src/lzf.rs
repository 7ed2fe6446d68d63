//! LZF, the compression inside PCD files (`DATA binary_compressed`): the only file that names the crate `lzf`.

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::{internal, invalid_input};

/// The crate counts bytes in `i32`.
const LARGEST: usize = i32::MAX as usize;
/// Three bytes stand for at most 264.
const LARGEST_EXPANSION: usize = 88;
/// A literal run: one byte of length (less one), then up to this many bytes as they are.
const LONGEST_LITERAL: usize = 32;

/// The bytes as literal runs, which every LZF decoder reads: for data that does not compress.
fn literals(data: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(data.len() + data.len().div_ceil(LONGEST_LITERAL));
    for run in data.chunks(LONGEST_LITERAL) {
        out.push((run.len() - 1) as u8);
        out.extend_from_slice(run);
    }
    out
}

/// Compresses `data`, at most 2^31 - 1 bytes; larger by 1/32 at worst.
#[pyfunction]
fn lzf_compress<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
    if data.len() > LARGEST {
        return Err(invalid_input(format!(
            "LZF compresses at most {LARGEST} bytes at a time, not {}",
            data.len()
        )));
    }
    let packed = py.detach(|| {
        std::panic::catch_unwind(|| lzf::compress(data).unwrap_or_else(|_| literals(data)))
    });
    let packed = packed.map_err(|_| internal("the LZF encoder failed"))?;
    Ok(PyBytes::new(py, &packed))
}

/// Exactly `size` bytes from LZF `data`; anything else is an error, found before more than that is allocated.
#[pyfunction]
fn lzf_decompress<'py>(py: Python<'py>, data: &[u8], size: usize) -> PyResult<Bound<'py, PyBytes>> {
    if size == 0 && data.is_empty() {
        return Ok(PyBytes::new(py, &[]));
    }
    if size > LARGEST || size > data.len().saturating_mul(LARGEST_EXPANSION) {
        return Err(invalid_input(format!(
            "{} bytes of LZF data cannot expand to {size} bytes",
            data.len()
        )));
    }
    let unpacked = py.detach(|| std::panic::catch_unwind(|| lzf::decompress(data, size)));
    match unpacked {
        Ok(Ok(bytes)) if bytes.len() == size => Ok(PyBytes::new(py, &bytes)),
        Ok(Ok(bytes)) => Err(invalid_input(format!(
            "LZF data expands to {} bytes instead of {size}",
            bytes.len()
        ))),
        Ok(Err(lzf::LzfError::BufferTooSmall)) => {
            Err(invalid_input(format!("LZF data expands to more than {size} bytes")))
        }
        Ok(Err(_)) | Err(_) => Err(invalid_input("LZF data is corrupt")),
    }
}

/// Adds this file's functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(lzf_compress, module)?)?;
    module.add_function(wrap_pyfunction!(lzf_decompress, module)?)?;
    Ok(())
}
