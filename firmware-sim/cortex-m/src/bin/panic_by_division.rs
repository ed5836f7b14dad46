//! An image that must not link: a division by a number that the compiler cannot prove to be other
//! than zero has slipped in. `firmware-sim/tests/it/cost.rs` builds it and expects the linker's refusal.

#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use firmware_cortex_m::machine;

#[entry]
fn main() -> ! {
    let divisor = black_box(7);
    loop {
        black_box(machine::flash().len() / divisor);
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::refuse_to_link()
}
