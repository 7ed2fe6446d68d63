//! Files that need not be trusted cannot make a reader take memory: alone in its process, so that the peak is theirs.
#![allow(missing_docs)]

use peak_alloc::PeakAlloc;
use surfabet::{
    AlphabetModel, BicAlphabetModel, GasModel, HscsmModel, PatchModel, PlaneModel, SurfaceModel,
    for_each_method,
};
use surfabet_tests::LIMITS;
use surfabet_tests::contract::{hostile_headers_are_refused_by_name, small};

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

macro_rules! peaks {
    ($($(#[$_doc:meta])* $_variant:ident($model:ty),)+) => {
        [$({
            // Learned before, so that only reading and decoding count.
            small::<$model>();
            ALLOCATED.reset_peak_usage();
            let before = ALLOCATED.current_usage();
            hostile_headers_are_refused_by_name::<$model>();
            (<$model as SurfaceModel>::METHOD, ALLOCATED.peak_usage() - before)
        },)+]
    };
}

#[test]
fn hostile_headers_take_no_memory_beyond_the_limits() {
    for (method, peak) in for_each_method!(peaks) {
        // What is read and decoded to 100 000 points of some 40 bytes takes 5 MB at most; counts in headers, nothing.
        assert!((peak as u64) < LIMITS.max_bytes / 8, "{method}: {peak} bytes");
    }
}
