//! Answers many matches of the blob at the start of the flash and prints one checksum of all bits.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use firmware_cortex_m::machine;
use firmware_cost::same_bits::digest;
use ray_runtime::RayBlob;

/// As many as the host compares.
const MATCHES: u32 = 100_000;

#[entry]
fn main() -> ! {
    let flash = machine::flash();
    let opened = RayBlob::stated_len(flash)
        .and_then(|length| RayBlob::open(flash.get(..length as usize).unwrap_or(flash)));
    let is_well = match opened.map(|blob| digest(&blob, MATCHES)) {
        Ok(Some(digest)) => {
            hprintln!("{:08x} {}", digest.checksum, digest.points);
            true
        }
        Ok(None) => {
            hprintln!("the blob has not two cameras");
            false
        }
        Err(error) => {
            hprintln!("no blob: {}", error);
            false
        }
    };
    machine::end(is_well)
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    hprintln!("{}", info);
    machine::end(false)
}
