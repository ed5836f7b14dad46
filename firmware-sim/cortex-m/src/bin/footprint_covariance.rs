//! `footprint_measure` with the covariance of the point as well: for the size of
//! the runtime in an image, as `firmware-sim cost` reports it.
//!
//! What the compiler inlines into the four functions below is the runtime's.

#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use firmware_cortex_m::machine;
use ray_runtime::{
    LookupError, MeasureError, Measurement, OpenError, PixelPoint, Ray, RayBlob, Triangulation,
};

type Sighting = (usize, PixelPoint);

#[entry]
fn main() -> ! {
    let flash = machine::flash();
    loop {
        let opened = open(black_box(flash));
        let Ok(blob) = black_box(&opened) else {
            continue;
        };
        let [a, b] = black_box([
            (0, PixelPoint::new(0.0, 0.0)),
            (1, PixelPoint::new(0.0, 0.0)),
        ]);
        black_box(&lookup(blob, a));
        black_box(&triangulate(blob, a, b));
        black_box(&triangulate_with_covariance(blob, a, b));
    }
}

#[inline(never)]
fn open(flash: &[u8]) -> Result<RayBlob<'_>, OpenError> {
    let length = RayBlob::stated_len(flash)? as usize;
    RayBlob::open(flash.get(..length).unwrap_or(flash))
}

#[inline(never)]
fn lookup(blob: &RayBlob<'_>, (camera, pixel): Sighting) -> Result<Ray, LookupError> {
    blob.lookup(camera, pixel)
}

#[inline(never)]
fn triangulate(
    blob: &RayBlob<'_>,
    a: Sighting,
    b: Sighting,
) -> Result<Triangulation, MeasureError> {
    blob.triangulate(a, b)
}

#[inline(never)]
fn triangulate_with_covariance(
    blob: &RayBlob<'_>,
    a: Sighting,
    b: Sighting,
) -> Result<Measurement, MeasureError> {
    blob.triangulate_with_covariance(a, b)
}

/// No panic is reachable in this image: if one were, it would not have linked.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::refuse_to_link()
}
