//! The least that measures: opens the blob in the flash, looks rays up, triangulates. For the size of
//! the runtime in an image, as `firmware-sim cost` reports it; it does nothing else.

#![no_std]
#![no_main]

mod footprint;

use cortex_m_rt::entry;

#[entry]
fn main() -> ! {
    footprint::run(|_, _, _| ())
}
