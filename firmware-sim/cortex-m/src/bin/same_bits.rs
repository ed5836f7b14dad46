//! Answers many matches of the blob at the start of the flash and prints one checksum of all bits.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use firmware_cortex_m::machine;
use firmware_sim::same_bits::digest;
use ray_runtime::RayBlob;

/// As many as the host compares.
const MATCHES: u32 = 100_000;

#[entry]
fn main() -> ! {
    let flash = machine::flash();
    let opened = RayBlob::stated_len(flash)
        .and_then(|length| RayBlob::open(flash.get(..length as usize).unwrap_or(flash)));
    let status = match opened.map(|blob| digest(&blob, MATCHES)) {
        Ok(Some(digest)) => {
            hprintln!("{:08x} {}", digest.checksum, digest.points);
            debug::EXIT_SUCCESS
        }
        Ok(None) => {
            hprintln!("the blob has not two cameras");
            debug::EXIT_FAILURE
        }
        Err(error) => {
            hprintln!("no blob: {}", error);
            debug::EXIT_FAILURE
        }
    };
    loop {
        debug::exit(status);
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    hprintln!("{}", info);
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
