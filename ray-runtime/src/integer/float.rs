//! Numbers of f32 taken apart and put together by operations of integers: no call of a floating-point
//! library, and the same bits on every core.

use super::product::leading_zeros;

/// Exponent of the highest digit of an f32's significand when that is shifted to the top of a word: a number is
/// `word * 2^(exponent - WORD)`.
const WORD: u32 = 127 + 31;

/// What a fixed-point number counts: one is `2^digits`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Digits(u32);

impl Digits {
    /// 2^-`digits`; below -64 or above 96 it is some other.
    pub const fn new(digits: i32) -> Self {
        Self(WORD.wrapping_sub(digits.cast_unsigned()))
    }

    /// The number, rounded towards zero; 0 also of one that does not fit, which is what
    /// [`magnitude`](Self::magnitude) is for.
    #[inline(always)]
    pub fn fixed(self, number: f32) -> i32 {
        let bits = number.to_bits();
        let shift = self.0.wrapping_sub((bits << 1) >> 24);
        let magnitude = if shift < 32 {
            (bits << 8 | 1 << 31) >> shift
        } else {
            0
        };
        let sign = bits.cast_signed() >> 31;
        (magnitude.cast_signed() ^ sign).wrapping_sub(sign)
    }

    /// The product of the number's first 15 binary digits with one of 16 in 2^-15, rounded down; the digits must be
    /// [`for_short_products`](Self::for_short_products). Some other of a number whose magnitude is not below 4 of the highest
    /// digits.
    #[inline(always)]
    pub fn short_product(self, number: f32, power: u32) -> i32 {
        let bits = number.to_bits();
        let shift = self.0.wrapping_sub((bits << 1) >> 24).min(31);
        let magnitude = (bits << 8 | 1 << 31) >> 17;
        let sign = bits.cast_signed() >> 31;
        // The sign before the shift: it costs registers behind it, as the compiler puts it off.
        let digits = (magnitude.cast_signed() ^ sign).wrapping_sub(sign);
        digits.wrapping_mul(power.cast_signed()) >> shift
    }

    /// What [`short_product`](Self::short_product) takes.
    pub fn for_short_products(self) -> Self {
        Self(self.0.wrapping_sub(2))
    }

    /// No less than the number's magnitude; the largest word if that has no place in one.
    pub fn magnitude(self, number: f32) -> u32 {
        let bits = number.to_bits() << 1;
        let shift = self.0.wrapping_sub(bits >> 24);
        match shift {
            _ if bits == 0 => 0,
            0 => u32::MAX,
            1..32 => ((bits << 7 | 1 << 31) >> shift).saturating_add(1),
            _ if shift >> 31 == 0 => 1,
            _ => u32::MAX,
        }
    }
}

/// The digits of a positive number in a word whose highest is set, and the exponent that goes with them:
/// it is `word * 2^exponent`. A number with the exponent of zero counts as a small one.
pub fn normalized(number: f32) -> (u32, i32) {
    let bits = number.to_bits() << 1;
    let exponent = (bits >> 24).wrapping_sub(WORD).cast_signed();
    (bits << 7 | 1 << 31, exponent)
}

/// `number * 2^exponent`, rounded to the nearest f32, ties to even. What lies beyond f32 is zero or infinite.
pub fn to_f32(number: i32, exponent: i32) -> f32 {
    let bits = unsigned_to_bits(number.unsigned_abs(), exponent);
    f32::from_bits(bits | number.cast_unsigned() & 1 << 31)
}

/// The same of a number without a sign.
pub fn unsigned_to_f32(number: u32, exponent: i32) -> f32 {
    f32::from_bits(unsigned_to_bits(number, exponent))
}

#[inline(never)]
fn unsigned_to_bits(number: u32, exponent: i32) -> u32 {
    let zeros = leading_zeros(number);
    let shifted = number.wrapping_shl(zeros);
    // Of the f32 whose significand this is, one less: the highest digit adds the one.
    let stated = exponent.wrapping_add(157).wrapping_sub_unsigned(zeros);
    if number == 0 || stated < 0 {
        return 0;
    }
    if stated > 253 {
        return f32::INFINITY.to_bits();
    }
    let kept = shifted >> 8;
    let half_up = (shifted & 0xff) + 0x7f + (kept & 1);
    (stated.cast_unsigned() << 23)
        .wrapping_add(kept)
        .wrapping_add(half_up >> 8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use split_mix::SplitMix;

    #[test]
    fn numbers_are_taken_apart_as_they_are() {
        let mut random = SplitMix(3);
        let twenty_eight = Digits::new(28);
        for _ in 0..100_000 {
            let exponent = 90 + (random.next() % 40) as u32;
            let number = f32::from_bits(exponent << 23 | random.next() as u32 & 0x807f_ffff);
            let exact = f64::from(number) * f64::from(1 << 28);
            assert_eq!(twenty_eight.fixed(number), exact as i32, "{number}");
            let magnitude = f64::from(twenty_eight.magnitude(number));
            assert!(magnitude >= exact.abs() && magnitude <= exact.abs() + 1.0);
            let (word, exponent) = normalized(number.abs());
            assert_eq!(
                f64::from(word) * 2.0f64.powi(exponent),
                f64::from(number.abs())
            );
        }
        assert_eq!(twenty_eight.fixed(0.0), 0);
        assert_eq!(twenty_eight.magnitude(-0.0), 0);
        assert_eq!(twenty_eight.magnitude(1e-30), 1);
        for large in [16.0, -1e30, f32::INFINITY, f32::NAN] {
            assert_eq!(twenty_eight.magnitude(large), u32::MAX);
        }
    }

    #[test]
    fn numbers_are_put_together_as_the_compiler_rounds_them() {
        let mut random = SplitMix(4);
        for _ in 0..100_000 {
            let shift = random.next() % 32;
            let number = (random.next() as i32) >> shift;
            let exponent = (random.next() % 80) as i32 - 60;
            let exact = f64::from(number) * 2.0f64.powi(exponent);
            assert_eq!(to_f32(number, exponent).to_bits(), (exact as f32).to_bits());
            let unsigned = number.cast_unsigned();
            let exact = f64::from(unsigned) * 2.0f64.powi(exponent);
            assert_eq!(unsigned_to_f32(unsigned, exponent), exact as f32);
        }
        assert_eq!(to_f32(i32::MIN, 0), -2_147_483_648.0);
        assert_eq!(to_f32(1, 128), f32::INFINITY);
        assert_eq!(to_f32(1, -127).to_bits(), 0);
        assert_eq!(to_f32(-1, -126), -f32::MIN_POSITIVE);
    }
}
