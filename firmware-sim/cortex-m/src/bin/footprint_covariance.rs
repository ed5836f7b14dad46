//! `footprint_measure` with the covariance of the point as well: for the size of
//! the runtime in an image, as `firmware-sim cost` reports it.

#![no_std]
#![no_main]

mod footprint;

use core::hint::black_box;

use cortex_m_rt::entry;
use footprint::Sighting;
use ray_runtime::{MeasureError, Measurement, RayBlob};

#[entry]
fn main() -> ! {
    footprint::run(|blob, a, b| {
        black_box(&triangulate_with_covariance(blob, a, b));
    })
}

#[inline(never)]
fn triangulate_with_covariance(
    blob: &RayBlob<'_>,
    a: Sighting,
    b: Sighting,
) -> Result<Measurement, MeasureError> {
    blob.triangulate_with_covariance(a, b)
}
