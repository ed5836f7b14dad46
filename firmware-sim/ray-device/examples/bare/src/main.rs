//! Two ways of having a blob in an application, without an operating system, storage or link: compiled in, and in a region of flash
//! of its own that a flash tool writes. Both are opened in place, tested, and measured with.
//!
//! `tests/run bare` runs it in QEMU: `qemu-system-arm -machine mps2-an386 -cpu cortex-m4 -nographic -semihosting-config
//! enable=on,target=native -kernel IMAGE`, which ends with 0 if all was as it should be.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::debug;
use panic_halt as _;
use ray_runtime::{Aligned, PixelPoint, RayBlob};

/// Compiled in. A blob must start on a multiple of 8.
static COMPILED_IN: &Aligned<[u8]> =
    &Aligned(*include_bytes!("../../../../../ray-runtime/example.rays"));

/// Put into the region RAYS of `memory.x` by the linker. It is not read by this name: the compiler would take the bytes that it knows,
/// and miss those that a flash tool wrote there later.
#[used]
#[unsafe(link_section = ".rays")]
#[allow(unsafe_code, reason = "a section that nothing else is put into")]
static PUT_IN_PLACE: Aligned<[u8; EXAMPLE.len()]> = Aligned(*EXAMPLE);

const EXAMPLE: &[u8; include_bytes!("../../../../../ray-runtime/example.rays").len()] =
    include_bytes!("../../../../../ray-runtime/example.rays");

/// The region RAYS: a blob, and whatever is behind it.
#[allow(
    unsafe_code,
    reason = "the linker's symbols, and the memory between them"
)]
fn region() -> &'static [u8] {
    unsafe extern "C" {
        static _rays_start: u8;
        static _rays_length: u8;
    }
    // SAFETY: addresses alone are taken of both: that of the region, and the one that is its length. It is flash that this program never
    // writes, of any bytes.
    unsafe { core::slice::from_raw_parts(&raw const _rays_start, (&raw const _rays_length).addr()) }
}

/// The depth of the point that two pixels see, mm, if the blob can be used here.
fn depth_mm(blob: &[u8]) -> Option<f32> {
    let rig = RayBlob::open(blob).ok()?;
    // Whether this target computes the bits that the packing host computed.
    rig.run_self_tests().ok()?;
    let (left, right) = (rig.camera_index("left")?, rig.camera_index("right")?);
    let (first, second) = (PixelPoint::new(30.0, 20.5), PixelPoint::new(33.0, 21.0));
    let point = rig.triangulate((left, first), (right, second)).ok()?;
    Some(point.point_mm[2])
}

/// The blob at the start of longer memory.
fn first_blob(bytes: &[u8]) -> Option<&[u8]> {
    let length = RayBlob::stated_len(bytes).ok()?;
    bytes.get(..length as usize)
}

#[entry]
fn main() -> ! {
    let found = [
        depth_mm(&COMPILED_IN.0),
        first_blob(region()).and_then(depth_mm),
    ];
    let is_right = |depth_mm: Option<f32>| depth_mm.is_some_and(|z| (48.25..48.27).contains(&z));
    let status = if found.into_iter().all(is_right) {
        debug::EXIT_SUCCESS
    } else {
        debug::EXIT_FAILURE
    };
    loop {
        debug::exit(status);
    }
}
