//! Counts the instructions that it takes to verify the signature of a manifest, and the chain over 4096 and over 8192
//! bytes of a blob, for `RELIABILITY.md`. QEMU runs it with a fixed time per instruction; whether the signature fits makes no
//! difference to the work, as long as its halves are well formed.

#![no_std]
#![no_main]

use core::fmt::Write;
use core::hint::black_box;

use cortex_m_rt::entry;
use cortex_m_semihosting::hio;
use firmware_cortex_m::machine;
use ray_device::manifest::SIGNED_LENGTH;
use ray_device::protocol::Signature;
use ray_device::storage::trust::{Keys, PublicKey};

/// A key and a signature of RFC 8032, section 7.1, third test.
const KEY: &str = "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025";
const SIGNATURE: [u8; 64] = *include_bytes!("counting_signature.bin");

#[entry]
fn main() -> ! {
    cortex_m::interrupt::disable();
    machine::end(run().is_some())
}

fn run() -> Option<()> {
    let key = PublicKey::from_hex(KEY)?;
    let signature = Signature::from_bytes(&SIGNATURE)?;
    let mut output = hio::hstdout().ok()?;
    machine::counter_start();
    let signed = machine::flash().get(..SIGNED_LENGTH)?;
    let before = machine::timer_ticks();
    let is_signed = black_box(&key).has_signed(black_box(signed), black_box(&signature));
    let ticks = machine::timer_ticks().wrapping_sub(before);
    writeln!(output, "manifest {ticks} {is_signed}").ok()?;
    for length in [4096, 8192] {
        let blob = machine::flash().get(..length)?;
        let before = machine::timer_ticks();
        let [first, ..] = black_box(Keys::one(key)).root(black_box(blob), &mut || ());
        let ticks = machine::timer_ticks().wrapping_sub(before);
        writeln!(output, "{length} {ticks} {first}").ok()?;
    }
    Some(())
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::end(false)
}
