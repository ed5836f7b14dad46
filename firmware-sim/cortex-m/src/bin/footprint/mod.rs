//! What the footprint images share: the runtime called, and nothing else.
//!
//! What the compiler inlines into these functions is the runtime's.

use core::hint::black_box;

use firmware_cortex_m::machine;
use ray_runtime::{LookupError, MeasureError, OpenError, PixelPoint, Ray, RayBlob, Triangulation};

pub type Sighting = (usize, PixelPoint);

/// Opens the blob in the flash, looks a ray up and triangulates, then does what else is asked. A part of
/// `main`, which is not counted.
#[inline(always)]
pub fn run(more: impl Fn(&RayBlob<'_>, Sighting, Sighting)) -> ! {
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
        more(blob, a, b);
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

/// No panic is reachable in these images: if one were, they would not have linked.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::refuse_to_link()
}
