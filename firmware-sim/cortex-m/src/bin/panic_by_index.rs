//! An image that must not link: an index that the compiler cannot prove to be in range has slipped
//! in. `firmware-sim/tests/it/cost.rs` builds it and expects the linker's refusal.

#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use firmware_cortex_m::machine;

#[entry]
fn main() -> ! {
    let place = black_box(7);
    loop {
        black_box(machine::flash()[place]);
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::refuse_to_link()
}
