//! Answers many matches of every golden blob in integers and prints a checksum of all bits, a line for each: on any core, so
//! the blobs are in the image.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::hio::{self, HostStream};
use firmware_cortex_m::machine;
use firmware_cost::same_bits::digest_of_integers;
use ray_runtime::integer::Rig;
use ray_runtime::{Aligned, RayBlob};

/// As many as the host compares.
const MATCHES: u32 = 20_000;

macro_rules! golden {
    ($($name:literal),* $(,)?) => {
        &[$(&Aligned(*include_bytes!(concat!("../../../../data/golden/", $name, ".rays"))) as &Aligned<[u8]>),*]
    };
}

/// In the order of their names.
static BLOBS: &[&Aligned<[u8]>] = golden!(
    "central-v3-fast",
    "central-v3-small",
    "non-central-v3-cubic",
    "non-central-v3-fast",
    "non-central-v3-small",
    "stereo-v1",
    "stereo-v2",
    "stereo-v3-fast",
    "stereo-v3-small",
    "stereo-v4-fast",
    "stereo-v4-integer-fast",
    "stereo-v4-integer-small",
    "stereo-v4-small",
);

#[entry]
fn main() -> ! {
    let is_well = hio::hstdout().is_ok_and(|mut output| {
        BLOBS
            .iter()
            .all(|bytes| answer(&mut output, &bytes.0).is_some())
    });
    machine::end(is_well)
}

/// Checksum, points, and self-tests that gave the bits stated for integers.
fn answer(output: &mut HostStream, bytes: &[u8]) -> Option<()> {
    let blob = RayBlob::open(bytes).ok()?;
    let rig = Rig::<2>::prepare(&blob).ok()?;
    let tests = rig.run_self_tests(&blob).ok()?;
    let digest = digest_of_integers(&blob, MATCHES)?;
    for word in [digest.checksum, digest.points, tests as u32] {
        let mut line = [b' '; 9];
        for (k, digit) in line.iter_mut().take(8).enumerate() {
            *digit = hex_digit(word >> (28 - 4 * k as u32) & 15);
        }
        output.write_all(&line).ok()?;
    }
    output.write_all(b"\n").ok()
}

const fn hex_digit(value: u32) -> u8 {
    let value = value as u8;
    if value < 10 {
        b'0' + value
    } else {
        b'a' + value - 10
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::end(false)
}
