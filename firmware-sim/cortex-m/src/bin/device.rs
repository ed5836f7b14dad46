//! The device, which takes anybody's blobs.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware_cortex_m::{device, machine};
use ray_device::storage::trust::Trust;

#[entry]
fn main() -> ! {
    device::run(Trust::Anybody)
}

/// No panic is reachable in this image: if one were, it would not have linked.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::refuse_to_link()
}
