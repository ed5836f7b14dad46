//! Polynomials of two variables for two channels, in fixed point: the coefficients as they stand in the
//! blob, in the order of their use, or prepared.

use super::float::Digits;
use super::product::{product, product_by_share};

/// Coefficients of a cubic.
pub const CUBIC: usize = crate::format::coefficient_count(3);

/// A cubic over the whole region, of prepared coefficients; x and y in 2^-31.
#[inline(always)]
pub fn prepared_cubic(coefficients: &[[i32; 2]; CUBIC], x: i32, y: i32) -> [i32; 2] {
    let mut sums = [0; 2];
    let [y3, y2x, y2, yx2, yx, y1, x3, x2, x1, one] = coefficients;
    for (k, sum) in sums.iter_mut().enumerate() {
        let c = |pair: &[i32; 2]| if k == 0 { pair[0] } else { pair[1] };
        let step = |a: i32, by: i32, b: &[i32; 2]| product::<1>(a, by).wrapping_add(c(b));
        let of_y2 = step(c(y2x), x, y2);
        let of_y = step(step(c(yx2), x, yx), x, y1);
        let of_one = step(step(step(c(x3), x, x2), x, x1), x, one);
        let of_y2 = product::<1>(c(y3), y).wrapping_add(of_y2);
        let of_y = product::<1>(of_y2, y).wrapping_add(of_y);
        *sum = product::<1>(of_y, y).wrapping_add(of_one);
    }
    sums
}

/// The cubic of a cell; x and y are its shares, in 2^-30.
///
/// What is multiplied once more has them with 15 binary digits: within a cell a polynomial is all but straight.
#[inline(always)]
pub fn patch(coefficients: &[[f32; 2]; CUBIC], digits: Digits, x: i32, y: i32) -> [i32; 2] {
    let half = |share: i32| share.wrapping_add(1 << 14) >> 15;
    let (half_x, half_y) = (half(x), half(y));
    let [y3, y2x, y2, yx2, yx, y1, x3, x2, x1, one] = coefficients;
    let mut sums = [0; 2];
    for (k, sum) in sums.iter_mut().enumerate() {
        let c = |pair: &[f32; 2]| digits.fixed(if k == 0 { pair[0] } else { pair[1] });
        let short = |a: i32, by: i32, b: i32| product_by_share(a, by).wrapping_add(b);
        let long = |a: i32, by: i32, b: i32| product::<2>(a, by).wrapping_add(b);
        let rest = short(c(y3), half_y, c(y2));
        let of_y2 = short(c(y2x), half_x, rest);
        let of_y = short(short(c(yx2), half_x, c(yx)), half_x, c(y1));
        let of_y = short(of_y2, half_y, of_y);
        let of_one = short(short(c(x3), half_x, c(x2)), half_x, c(x1));
        let of_one = long(of_one, x, c(one));
        *sum = long(of_y, y, of_one);
    }
    sums
}

/// Any polynomial over the whole region; x and y in 2^-31.
#[inline(never)]
pub fn any(coefficients: &[[f32; 2]], digits: Digits, x: i32, y: i32) -> [i32; 2] {
    let mut sums = [0; 2];
    let mut rest = coefficients;
    let mut length = 1;
    while let Some((row, after)) = rest.split_at_checked(length).filter(|_| !rest.is_empty()) {
        for (k, sum) in sums.iter_mut().enumerate() {
            let along_x = row.iter().fold(0, |along_x, pair| {
                let next = digits.fixed(if k == 0 { pair[0] } else { pair[1] });
                product::<1>(along_x, x).wrapping_add(next)
            });
            *sum = product::<1>(*sum, y).wrapping_add(along_x);
        }
        rest = after;
        length += 1;
    }
    sums
}
