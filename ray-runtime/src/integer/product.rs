//! Products and a reciprocal out of multiplications of 16 by 16 binary digits, as cores have them whose
//! multiplier gives 32 digits: a dozen instructions in place of a call for one of 64.
//!
//! What is left out of a product is part of its definition, so that every core comes to the same bits.

/// `a * b / 2^(32 - KEPT)`: without the product of the two lower halves, the two mixed products rounded down.
///
/// It is at most `2 + 2^KEPT` below the exact quotient, and never above it.
#[inline(always)]
pub fn product<const KEPT: u32>(a: i32, b: i32) -> i32 {
    let ((a_high, a_low), (b_high, b_low)) = (halves(a), halves(b));
    let highs = a_high.wrapping_mul(b_high) << KEPT;
    let mixed = |high: i32, low: i32| high.wrapping_mul(low) >> (16 - KEPT);
    highs
        .wrapping_add(mixed(b_high, a_low))
        .wrapping_add(mixed(a_high, b_low))
}

/// `a * b / 2^16`, rounded down, for `b` of 16 binary digits.
#[inline(always)]
pub fn product_by_half(a: i32, b: i32) -> i32 {
    let (high, low) = halves(a);
    high.wrapping_mul(b).wrapping_add(low.wrapping_mul(b) >> 16)
}

/// `a * b / 2^32` of numbers without a sign: at most 3 below the exact quotient, never above it.
#[inline(always)]
pub fn product_unsigned(a: u32, b: u32) -> u32 {
    let (a_high, a_low, b_high, b_low) = (a >> 16, a & 0xffff, b >> 16, b & 0xffff);
    (a_high * b_high)
        .wrapping_add((a_low * b_high) >> 16)
        .wrapping_add((a_high * b_low) >> 16)
}

/// The upper half, rounded down, and the lower half without a sign.
#[inline(always)]
fn halves(a: i32) -> (i32, i32) {
    (a >> 16, a & 0xffff)
}

/// Zeros before the highest binary digit of a number that is not 0 (of which there are 31), in half of the
/// instructions of the function that cores without one for it call.
#[inline(always)]
pub fn leading_zeros(mut number: u32) -> u32 {
    let mut zeros = 0;
    for step in [16, 8, 4, 2, 1] {
        if number >> (32 - step) == 0 {
            zeros += step;
            number <<= step;
        }
    }
    zeros
}

/// `2^62 / divisor` for a divisor from 2^31 on, to 2^-27 of it: 2^30 to 2^31 - 1.
///
/// Newton's method from the straight line that is off by 1/17 at most. Two steps need 16 digits.
#[inline(always)]
pub fn reciprocal(divisor: u32) -> i32 {
    let (high, low) = (divisor >> 16, divisor & 0xffff);
    // 48/17 - 32/17 x for x = high / 2^16, counted in 2^-15.
    let mut inverse = 92_521_u32.wrapping_sub((high * 61_681) >> 16);
    for _ in 0..2 {
        // 2 - x * inverse, in 2^-31.
        let rest = (high * inverse).wrapping_neg();
        inverse = (inverse * (rest >> 16)) >> 15;
    }
    let rest = (high * inverse)
        .wrapping_add((low * inverse) >> 16)
        .wrapping_neg();
    let inverse = (inverse * (rest >> 16)).wrapping_add((inverse * (rest & 0xffff)) >> 16);
    inverse.min(i32::MAX.cast_unsigned()).cast_signed()
}

#[cfg(test)]
mod tests {
    use super::*;
    use split_mix::SplitMix;

    fn word(random: &mut SplitMix) -> i32 {
        let shift = random.next() % 32;
        (random.next() as i32) >> shift
    }

    #[test]
    fn products_are_below_the_exact_ones_by_no_more_than_stated() {
        let mut random = SplitMix(1);
        for _ in 0..100_000 {
            let (a, b) = (word(&mut random), word(&mut random) >> 4);
            let exact = i64::from(a) * i64::from(b);
            for (kept, found) in [(0, product::<0>(a, b)), (2, product::<2>(a, b))] {
                let below = (exact >> (32 - kept)) - i64::from(found);
                assert!(
                    (0..=2 + (1 << kept)).contains(&below),
                    "{a} {b} {kept} {below}"
                );
            }
            let half = b >> 12;
            let exact = i64::from(a) * i64::from(half);
            assert_eq!(i64::from(product_by_half(a, half)), exact >> 16);
            let (a, b) = (a.cast_unsigned(), b.cast_unsigned());
            let below = ((u64::from(a) * u64::from(b)) >> 32) - u64::from(product_unsigned(a, b));
            assert!(below <= 3, "{a} {b} {below}");
        }
    }

    #[test]
    fn zeros_are_counted() {
        for digit in 0..32 {
            for number in [1 << digit, u32::MAX >> (31 - digit)] {
                assert_eq!(leading_zeros(number), number.leading_zeros());
            }
        }
        assert_eq!(leading_zeros(0), 31);
    }

    #[test]
    fn reciprocals_are_right_to_27_digits() {
        let mut random = SplitMix(2);
        let ends = [1 << 31, (1 << 31) + 1, u32::MAX, 0xffff_0000, 0x8000_ffff];
        let inner = (0..100_000).map(|_| random.next() as u32 | 1 << 31);
        for divisor in ends.into_iter().chain(inner) {
            let exact = 2.0f64.powi(62) / f64::from(divisor);
            let off = f64::from(reciprocal(divisor)) / exact - 1.0;
            assert!(off.abs() < 2.0f64.powi(-27), "{divisor} {off:e}");
        }
    }
}
