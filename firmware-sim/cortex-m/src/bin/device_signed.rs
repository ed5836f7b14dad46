//! The device that takes only blobs signed by the owner of one key: the environment variable
//! `RAYS_PUBLIC_KEY` of the build, 64 hexadecimal digits.
//!
//! The crate that verifies has bounds checks that the compiler cannot rule out, so this image, unlike the
//! others, is not proved to be free of panics. One would reset the device, which then has the blob in use
//! that it had before.

#![no_std]
#![no_main]

use cortex_m::peripheral::SCB;
use cortex_m_rt::entry;
use firmware_cortex_m::device;
use ray_device::storage::trust::{PublicKey, Trust};

const KEY: PublicKey = match PublicKey::from_hex(env!("RAYS_PUBLIC_KEY")) {
    Some(key) => key,
    None => panic!("RAYS_PUBLIC_KEY is no key: 64 hexadecimal digits are"),
};

#[entry]
fn main() -> ! {
    device::run(Trust::Signed(KEY))
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    SCB::sys_reset()
}
