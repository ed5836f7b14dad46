//! Opens the blob at the start of the flash in every mode of the floating-point unit and prints, a line for each, the
//! checksum of its answers to many matches, or the error's code.

#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m::register::fpscr::{self, Fpscr, RMode};
use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use firmware_cortex_m::machine;
use firmware_cost::same_bits::{FLOAT_MODE_MATCHES, digest};
use ray_runtime::RayBlob;

/// Modes in which nothing may change.
const HARMLESS: [(&str, [bool; 3]); 5] = [
    ("default", [false; 3]),
    ("flush-to-zero", [true, false, false]),
    ("default-nan", [false, true, false]),
    ("alternative-half", [false, false, true]),
    ("all-three", [true; 3]),
];

/// Modes in which no blob opens.
const ROUNDING: [(&str, RMode); 3] = [
    ("up", RMode::PlusInfinity),
    ("down", RMode::MinusInfinity),
    ("to-zero", RMode::Zero),
];

#[entry]
fn main() -> ! {
    let usual = fpscr::read();
    for (name, [flush_to_zero, default_nan, alternative_half]) in HARMLESS {
        let mut mode = usual;
        mode.set_fz(flush_to_zero);
        mode.set_dn(default_nan);
        mode.set_ahp(alternative_half);
        print_in(name, mode, usual);
    }
    for (name, rounding) in ROUNDING {
        let mut mode = usual;
        mode.set_rmode(rounding);
        print_in(name, mode, usual);
    }
    machine::end(true)
}

/// What the runtime does in a mode, printed in the usual one.
fn print_in(name: &str, mode: Fpscr, usual: Fpscr) {
    machine::set_float_mode(mode);
    let flash = black_box(machine::flash());
    let opened = RayBlob::stated_len(flash)
        .and_then(|length| RayBlob::open(flash.get(..length as usize).unwrap_or(flash)));
    let answered = black_box(opened.map(|blob| {
        let is_well = blob.run_self_tests().is_ok();
        (is_well, digest(&blob, FLOAT_MODE_MATCHES))
    }));
    machine::set_float_mode(usual);
    match answered {
        Ok((true, Some(digest))) => hprintln!("{} {:08x}", name, digest.checksum),
        Ok((false, _)) => hprintln!("{} self-test failed", name),
        Ok((true, None)) => hprintln!("{} not two cameras", name),
        Err(error) => hprintln!("{} code {}", name, error.code()),
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    hprintln!("{}", info);
    machine::end(false)
}
