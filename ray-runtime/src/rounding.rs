//! Whether this processor rounds as the blob's bits were computed: to nearest, ties to even.
//!
//! Flush-to-zero, default NaN and the alternative half precision change no answer; another rounding mode
//! changes nearly all of them, and a good blob would be refused as damaged where a number is checked
//! against what follows from others.

use core::hint::black_box;

/// A rounding mode in which no blob opens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rounding {
    /// Up: RP of an Arm FPSCR, RUP of RISC-V.
    TowardPositive,
    /// Down: RM, RDN.
    TowardNegative,
    /// Off: RZ, RTZ.
    TowardZero,
    /// To nearest, but ties away from zero: RMM of RISC-V.
    TiesAway,
}

/// Half of the step from 1 to the next f32.
const HALF_STEP: f32 = f32::EPSILON / 2.0;

/// The mode that the processor rounds in now; `None` to nearest, ties to even. A handful of sums, which the
/// compiler must leave to the processor.
#[inline(never)]
pub(crate) fn wrong_rounding() -> Option<Rounding> {
    let [one, half_step] = [1.0, HALF_STEP].map(black_box);
    let tie_goes_up = black_box(one + half_step) > one;
    let tie_goes_down = black_box(-one - half_step) < -one;
    let more_than_half_stays = black_box(one + 1.5 * half_step) == one;
    match (tie_goes_up, tie_goes_down) {
        (true, true) => Some(Rounding::TiesAway),
        (true, false) => Some(Rounding::TowardPositive),
        (false, true) => Some(Rounding::TowardNegative),
        (false, false) => more_than_half_stays.then_some(Rounding::TowardZero),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The other modes are set in QEMU: `firmware-sim/tests/it/float_modes.rs`.
    #[test]
    fn this_processor_rounds_to_nearest() {
        assert_eq!(wrong_rounding(), None);
    }
}
