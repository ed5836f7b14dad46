//! The least that measures in integers: opens the blob in the flash, prepares it, looks rays up, triangulates, all in fixed
//! point. For its size; it does nothing else, and no panic is reachable in it: if one were, it would not have linked.

#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use firmware_cortex_m::machine;
use ray_runtime::RayBlob;
use ray_runtime::integer::{FixedPixel, Rig};

#[entry]
fn main() -> ! {
    let flash = machine::flash();
    loop {
        let flash = black_box(flash);
        let opened = RayBlob::stated_len(flash)
            .and_then(|length| RayBlob::open(flash.get(..length as usize).unwrap_or(flash)));
        let Ok(blob) = black_box(&opened) else {
            continue;
        };
        let Ok(rig) = Rig::<2>::prepare(blob) else {
            continue;
        };
        let rig = black_box(&rig);
        let pixel = black_box(FixedPixel { u: 0, v: 0 });
        black_box(&rig.lookup_fixed(0, pixel));
        black_box(&rig.triangulate_fixed((0, pixel), (1, pixel)));
        black_box(&rig.run_self_tests(blob));
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::refuse_to_link()
}
