//! Weights of the uniform cubic B-spline as whole numbers: the same bits on every target, and two to a
//! word for multiplications of 16 by 16 binary digits.
//!
//! They count sixths of 2^-13 and are negative, all of them: the weights along both axes are multiplied
//! in the end, so that the signs cancel. (Of positive ones the compiler knows that they are, and
//! multiplies them as numbers without a sign, for which there are no such instructions; and -4 has a
//! place in 16 binary digits where 4 has none.) Those of the two middle knots follow from the outer
//! two, so that the four always have the same sum and a straight line through the knots comes out as
//! that line: what the outer ones are rounded by, less than one unit, meets second differences of the
//! knots alone.

use crate::format::PLACES_PER_CELL;
use core::hint::black_box;

/// A share of all of a cell: shares count places on the grid.
const CELL: i32 = PLACES_PER_CELL.cast_signed();

/// What four weights add up to, without the sign.
pub(crate) const SUM: i32 = 6 << 13;

/// Weights of four knots, two to a word: in the upper halves those of the first and the last.
#[derive(Clone, Copy)]
pub(crate) struct Weights(i32, i32);

impl Weights {
    /// The weights at a share of a cell, in places, which is less than all of it.
    #[inline(always)]
    pub fn at(share: i32) -> Self {
        let (to_first, to_last) = (share - CELL, -share);
        let (a, d) = (cube(to_first), cube(to_last));
        Self::packed(a, 3 * to_first - 2 * a + d, 3 * to_last - 2 * d + a, d)
    }

    /// The same numbers one by one, in multiplications of 16 by 16 binary digits.
    #[cfg(feature = "integer")]
    #[inline(always)]
    pub fn of_halves(share: i32) -> [i32; 4] {
        let (to_first, to_last) = (share - CELL, -share);
        let cube = |share: i32| {
            let square = share * share;
            // Of the 45 digits behind the point, 29 are left out in two steps.
            ((square >> 16) * share + (((square & 0xffff) * share) >> 16)) >> 13
        };
        let (a, d) = (cube(to_first), cube(to_last));
        [a, 3 * to_first - 2 * a + d, 3 * to_last - 2 * d + a, d]
    }

    /// Half of their derivatives by the share of a cell, 0 to 1.
    pub fn half_slopes(share: i32) -> Self {
        let to_first = CELL - share;
        let (a, d) = ((to_first * to_first) >> 16, (share * share) >> 16);
        let (a, d) = (3 * a, 3 * d);
        let middle = SUM / 2 - a - d;
        Self::packed(a, middle - a, d - middle, -d)
    }

    #[inline(always)]
    fn packed(a: i32, b: i32, c: i32, d: i32) -> Self {
        // The compiler would take the four apart again where it sees how they were put together, and
        // has no registers for eight of them.
        Self(
            black_box((b & 0xffff) | a << 16),
            black_box((c & 0xffff) | d << 16),
        )
    }

    /// The numbers one by one.
    #[inline(always)]
    pub fn each(self) -> [i32; 4] {
        [high(self.0), low(self.0), low(self.1), high(self.1)]
    }

    /// Four numbers of 16 binary digits, weighed.
    #[inline(always)]
    pub fn applied_to(self, [a, b, c, d]: [i32; 4]) -> i32 {
        let [wa, wb, wc, wd] = self.each();
        wa * a + wb * b + wc * c + wd * d
    }
}

/// The cube of a negative share of a cell, rounded down.
#[inline(always)]
fn cube(share: i32) -> i32 {
    // The square counts 2^-28, and 8 times the share 2^-17: of their product's 45 binary digits behind
    // the point 32 are left out.
    ((i64::from(share * share) * i64::from(share * 8)) >> 32) as i32
}

/// The lower half of a word.
#[inline(always)]
pub(crate) fn low(word: i32) -> i32 {
    i32::from(word as i16)
}

/// The upper half of a word.
#[inline(always)]
pub(crate) fn high(word: i32) -> i32 {
    word >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fit_their_words_and_keep_straight_lines() {
        for share in 0..CELL {
            let [a, b, c, d] = Weights::at(share).each();
            assert!([a, b, c, d].iter().all(|w| *w <= 0), "{share}");
            assert_eq!(a + b + c + d, -SUM, "{share}");
            #[cfg(feature = "integer")]
            assert_eq!(Weights::of_halves(share), [a, b, c, d]);
            // Knots at -1, 0, 1 and 2 cells.
            assert_eq!(-a + c + 2 * d, -3 * share, "{share}");
            let t = f64::from(share) / f64::from(CELL);
            let r = 1.0 - t;
            for (outer, exact) in [(a, r * r * r), (d, t * t * t)] {
                let missing = -f64::from(outer) - exact * 8192.0;
                assert!((0.0..1.0).contains(&missing), "{share} {missing}");
            }
        }
    }

    #[test]
    fn slopes_are_those_of_the_weights() {
        for share in 100..CELL - 100 {
            let [before, after] = [share - 100, share + 100].map(|at| Weights::at(at).each());
            let slopes = Weights::half_slopes(share).each();
            assert_eq!(slopes.iter().sum::<i32>(), 0, "{share}");
            for k in 0..4 {
                let difference = f64::from(after[k] - before[k]) * f64::from(CELL) / 200.0;
                // Weights are right to 2 units, 82 to a cell's 200th; squares are rounded down.
                let error = f64::from(2 * slopes[k]) - difference;
                assert!(error.abs() < 4.0 * 82.0 + 20.0, "{share} {k} {error}");
            }
        }
    }
}
