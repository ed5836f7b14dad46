//! The device with an owner, who alone may change it. The owner's public keys are two environment variables of the
//! build, 64 hexadecimal digits each: `RAYS_PUBLIC_KEY`, and if there is a key 1, `RAYS_PUBLIC_KEY_1`.
//!
//! The crate that verifies has bounds checks that the compiler cannot rule out, so this image, unlike the
//! others, is not proved to be free of panics. One would reset the device, which then has the blob in use
//! that it had before.

#![no_std]
#![no_main]

use cortex_m::peripheral::SCB;
use cortex_m_rt::entry;
use firmware_cortex_m::device;
use ray_device::storage::trust::{Keys, PublicKey, Trust};

const KEYS: Keys = {
    let key_0 = key(env!("RAYS_PUBLIC_KEY"));
    match option_env!("RAYS_PUBLIC_KEY_1") {
        Some(key_1) if !key_1.is_empty() => Keys::two(key_0, key(key_1)),
        _ => Keys::one(key_0),
    }
};

const fn key(digits: &str) -> PublicKey {
    match PublicKey::from_hex(digits) {
        Some(key) => key,
        None => panic!("RAYS_PUBLIC_KEY or RAYS_PUBLIC_KEY_1 is no key: 64 hexadecimal digits are"),
    }
}

#[entry]
fn main() -> ! {
    device::run(Trust::Owner(KEYS))
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    SCB::sys_reset()
}
