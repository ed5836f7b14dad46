//! Decimal numbers as files of pixels have them, read fast: digits, perhaps a point and more digits.
//!
//! Whatever is written otherwise (an exponent, a space, 20 digits), and whatever lies too near the middle between two
//! numbers for a single division to tell, is left to the standard library: this module never gives other bits.

use calib_rays::measure::Number;

/// Most digits that surely fit 64 bits.
const MOST_DIGITS: usize = 19;
/// Most decimals: beyond, powers of ten are no exact `f64`.
const MOST_DECIMALS: usize = 22;

/// Powers of ten, exact.
const POWERS: [f64; MOST_DECIMALS + 1] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];
/// The same of whole numbers, for as many digits as are read at a time.
const WHOLE_POWERS: [u64; CHUNK + 1] = [
    1,
    10,
    100,
    1_000,
    10_000,
    100_000,
    1_000_000,
    10_000_000,
    100_000_000,
];
/// Characters read at a time.
const CHUNK: usize = 8;

/// The number at the start of `bytes`, and what follows it; `None` if it is not for this module.
#[inline]
pub(super) fn leading<N: Number>(bytes: &[u8]) -> Option<(N, &[u8])> {
    let (is_negative, rest) = match bytes {
        [b'-', rest @ ..] => (true, rest),
        _ => (false, bytes),
    };
    let (whole, rest) = digits(0, rest);
    let mut found = whole.digits;
    let mut count = whole.count;
    let mut decimals = 0;
    let mut rest = rest;
    if let [b'.', behind @ ..] = rest {
        let (fraction, behind) = digits(found, behind);
        found = fraction.digits;
        decimals = fraction.count;
        count += decimals;
        rest = behind;
    }
    if count == 0 || count > MOST_DIGITS {
        return None;
    }
    let value = N::quotient(found, *POWERS.get(decimals)?)?;
    Some((if is_negative { -value } else { value }, rest))
}

/// Digits as one whole number, of no meaning if there are more than fit.
struct Digits {
    digits: u64,
    count: usize,
}

/// The digits at the start of `bytes`, appended to those before them, and what follows.
#[inline]
fn digits(before: u64, bytes: &[u8]) -> (Digits, &[u8]) {
    let mut found = Digits {
        digits: before,
        count: 0,
    };
    let mut rest = bytes;
    loop {
        let chunk = u64::from_le_bytes(chunk(rest));
        let count = leading_digits(chunk);
        found.digits = found
            .digits
            .wrapping_mul(WHOLE_POWERS[count])
            .wrapping_add(number(chunk, count));
        found.count += count;
        rest = rest.get(count..).unwrap_or(&[]);
        if count < CHUNK {
            return (found, rest);
        }
    }
}

/// The first characters, filled up with zero bytes.
#[inline]
fn chunk(bytes: &[u8]) -> [u8; CHUNK] {
    if let Some(chunk) = bytes.first_chunk() {
        return *chunk;
    }
    let mut chunk = [0; CHUNK];
    for (place, byte) in chunk.iter_mut().zip(bytes) {
        *place = *byte;
    }
    chunk
}

/// How many of eight characters, the first in the lowest byte, are digits before one is none.
#[inline]
fn leading_digits(chunk: u64) -> usize {
    // Above '9' the sum reaches the highest bit, below '0' the difference does. Carries reach later characters alone.
    let above = chunk.wrapping_add(0x4646_4646_4646_4646);
    let below = chunk.wrapping_sub(0x3030_3030_3030_3030);
    ((above | below) & 0x8080_8080_8080_8080).trailing_zeros() as usize / 8
}

/// The number that the first `count` of eight characters, all digits, write.
#[inline]
fn number(chunk: u64, count: usize) -> u64 {
    if count == 0 {
        return 0;
    }
    // The digits to the highest bytes, zeros in front of them.
    let digits = chunk.wrapping_sub(0x3030_3030_3030_3030) << (64 - 8 * count);
    // Two, then four, then eight together.
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8) & 0x00ff_00ff_00ff_00ff;
    let fours = pairs.wrapping_mul(100).wrapping_add(pairs >> 16) & 0x0000_ffff_0000_ffff;
    fours.wrapping_mul(10_000).wrapping_add(fours >> 32) & 0xffff_ffff
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bits of the standard library, or nothing.
    fn check(text: &str) -> [bool; 2] {
        let single = leading::<f32>(text.as_bytes()).map(|(found, rest)| {
            assert!(rest.is_empty(), "{text}");
            let expected: f32 = text.parse().unwrap();
            assert_eq!(found.to_bits(), expected.to_bits(), "{text}");
        });
        let double = leading::<f64>(text.as_bytes()).map(|(found, rest)| {
            assert!(rest.is_empty(), "{text}");
            let expected: f64 = text.parse().unwrap();
            assert_eq!(found.to_bits(), expected.to_bits(), "{text}");
        });
        [single.is_some(), double.is_some()]
    }

    /// Numbers without an order to them.
    fn random() -> impl Iterator<Item = u64> {
        let mut state = 1u64;
        std::iter::from_fn(move || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            Some(state ^ state >> 29)
        })
    }

    #[test]
    fn digits_have_the_bits_of_the_standard_library() {
        let mut fast = [0, 0];
        for bits in random().take(200_000) {
            let px = (bits >> 11) as f64 / (1u64 << 53) as f64 * 4000.0 - 10.0;
            for text in [
                format!("{px}"),
                format!("{}", px as f32),
                format!("{px:.3}"),
                format!("{}", f64::from(px as f32)),
                format!("{}.{}", bits % 5000, bits >> 40),
            ] {
                for (count, is_fast) in fast.iter_mut().zip(check(&text)) {
                    *count += u32::from(is_fast);
                }
            }
        }
        // Of 10^6: all but those too near a middle (10 in 2^29), and for f64 those of 17 digits or of 16 beyond 2^53.
        assert!(fast[0] > 999_000 && fast[1] > 500_000, "{fast:?}");
    }

    #[test]
    fn middles_between_two_numbers_are_left_to_the_standard_library_or_right() {
        for bits in random().take(20_000) {
            let low = f32::from_bits(0x3f80_0000 + (bits % 0x0600_0000) as u32);
            let high = f32::from_bits(low.to_bits() + 1);
            let middle = f64::midpoint(low.into(), high.into());
            for step in -3i64..=3 {
                let near = f64::from_bits(middle.to_bits().wrapping_add_signed(step));
                check(&format!("{near}"));
                check(&format!("-{near:.12}"));
            }
        }
    }

    #[test]
    fn only_plain_digits_are_read() {
        for text in [
            "",
            "-",
            ".",
            "+1",
            "x",
            "nan",
            "12345678901234567890",
            "0.00000000000000000000001",
        ] {
            assert!(leading::<f32>(text.as_bytes()).is_none(), "{text}");
        }
        let rest = |text: &'static str| {
            leading::<f64>(text.as_bytes()).map(|(n, rest)| (n, str::from_utf8(rest).unwrap()))
        };
        assert_eq!(rest("12345678.5,7"), Some((12_345_678.5, ",7")));
        assert_eq!(rest("1e5"), Some((1.0, "e5")));
        assert_eq!(rest("1.2.3"), Some((1.2, ".3")));
        assert_eq!(rest("5.,"), Some((5.0, ",")));
        assert_eq!(rest(".5"), Some((0.5, "")));
        assert_eq!(rest("12\u{3b1}"), Some((12.0, "\u{3b1}")));
        assert!(leading::<f64>(b"-0").unwrap().0.is_sign_negative());
    }
}
