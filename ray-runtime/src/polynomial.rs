//! Polynomials of two variables, for two channels at once, with or without derivatives.
//!
//! The coefficients stand in the order of their use: by falling power of y, and within one power of y
//! by falling power of x. Both Horner schemes, the general one and the written-out cubic, multiply
//! and add in that order: the same bits on every target.

use core::ops::{Add, Mul};

/// A number with its derivatives by u and v, or without them.
pub(crate) trait Number: Copy + From<f32> + Add<Output = Self> + Mul<Output = Self> {}

impl Number for f32 {}

/// A number and its derivatives by the pixel coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dual {
    pub value: f32,
    pub by_u: f32,
    pub by_v: f32,
}

impl Number for Dual {}

impl From<f32> for Dual {
    fn from(value: f32) -> Self {
        Self {
            value,
            by_u: 0.0,
            by_v: 0.0,
        }
    }
}

impl Add for Dual {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            by_u: self.by_u + other.by_u,
            by_v: self.by_v + other.by_v,
        }
    }
}

impl Mul for Dual {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            by_u: self.by_u * other.value + self.value * other.by_u,
            by_v: self.by_v * other.value + self.value * other.by_v,
        }
    }
}

/// The polynomial of a total degree with these coefficients, and whatever stands behind them.
///
/// A pair, because that comes back in registers. Where there are too few coefficients, those that are
/// missing do not count: the size of a table is checked when it is opened.
#[inline(always)]
pub(crate) fn evaluate(coefficients: &[[f32; 2]], degree: u8, x: f32, y: f32) -> (f32, f32) {
    let found = match degree {
        3 => coefficients
            .first_chunk()
            .map(|all| cubic(all, x, y).into()),
        5 => coefficients
            .first_chunk()
            .and_then(|all| fifth_degree(all, x, y)),
        7 => coefficients
            .first_chunk()
            .and_then(|all| seventh_degree(all, x, y)),
        _ => None,
    };
    found.unwrap_or_else(|| row_by_row(coefficients, degree, x, y))
}

/// [`evaluate`] in a loop, the same bits.
#[inline(never)]
pub(crate) fn row_by_row<T: Number>(coefficients: &[[f32; 2]], degree: u8, x: T, y: T) -> (T, T) {
    let Some(([first_a, first_b], mut rest)) = coefficients.split_first() else {
        return (0.0.into(), 0.0.into());
    };
    let (mut sum_a, mut sum_b) = (T::from(*first_a), T::from(*first_b));
    for others in 1..=usize::from(degree) {
        let Some(([a, b], after)) = rest.split_first() else {
            break;
        };
        let Some((row, after)) = after.split_at_checked(others) else {
            break;
        };
        let (mut a, mut b) = (T::from(*a), T::from(*b));
        for [next_a, next_b] in row {
            a = a * x + (*next_a).into();
            b = b * x + (*next_b).into();
        }
        (sum_a, sum_b) = (sum_a * y + a, sum_b * y + b);
        rest = after;
    }
    (sum_a, sum_b)
}

/// The rows of a polynomial, written out: the compiler unrolls one loop, but not a loop of loops.
macro_rules! written_out {
    ($coefficients:expr, $x:expr, $y:expr, $($length:literal)*) => {{
        let ([a, b], rest) = $coefficients.split_first()?;
        let (sum_a, sum_b) = (*a, *b);
        $(
            let (row, rest) = rest.split_first_chunk::<$length>()?;
            let (a, b) = along_x(row, $x);
            let (sum_a, sum_b) = (sum_a * $y + a, sum_b * $y + b);
        )*
        let _: &[[f32; 2]] = rest;
        Some((sum_a, sum_b))
    }};
}

/// [`evaluate`] of a degree up to 3. `None` if there are too few coefficients.
#[inline(always)]
pub(crate) fn up_to_cubic(
    coefficients: &[[f32; 2]],
    degree: u8,
    x: f32,
    y: f32,
) -> Option<(f32, f32)> {
    match degree {
        0 => written_out!(coefficients, x, y,),
        1 => written_out!(coefficients, x, y, 2),
        2 => written_out!(coefficients, x, y, 2 3),
        _ => written_out!(coefficients, x, y, 2 3 4),
    }
}

#[inline(never)]
fn fifth_degree(coefficients: &[[f32; 2]; 21], x: f32, y: f32) -> Option<(f32, f32)> {
    written_out!(coefficients, x, y, 2 3 4 5 6)
}

#[inline(never)]
fn seventh_degree(coefficients: &[[f32; 2]; 36], x: f32, y: f32) -> Option<(f32, f32)> {
    written_out!(coefficients, x, y, 2 3 4 5 6 7 8)
}

/// One row.
#[inline(always)]
fn along_x<const LENGTH: usize>(row: &[[f32; 2]; LENGTH], x: f32) -> (f32, f32) {
    let [mut a, mut b] = row[0];
    for [next_a, next_b] in &row[1..] {
        a = a * x + next_a;
        b = b * x + next_b;
    }
    (a, b)
}

/// [`evaluate`] of a cubic, written out.
#[inline(always)]
pub(crate) fn cubic<T: Number>(coefficients: &[[f32; 2]; 10], x: T, y: T) -> [T; 2] {
    let [y3, y2x, y2, yx2, yx, y1, x3, x2, x1, one] = coefficients;
    let mut sums = [x; 2];
    for (k, sum) in sums.iter_mut().enumerate() {
        let c = |pair: &[f32; 2]| -> T { (if k == 0 { pair[0] } else { pair[1] }).into() };
        let of_y2 = c(y2x) * x + c(y2);
        let of_y = (c(yx2) * x + c(yx)) * x + c(y1);
        let of_one = ((c(x3) * x + c(x2)) * x + c(x1)) * x + c(one);
        *sum = ((c(y3) * y + of_y2) * y + of_y) * y + of_one;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::coefficient_count;

    /// Powers of y and x in the order of the coefficients.
    fn powers(degree: usize) -> impl Iterator<Item = (usize, usize)> {
        (0..=degree)
            .rev()
            .flat_map(move |j| (0..=degree - j).rev().map(move |i| (j, i)))
    }

    #[test]
    fn every_coefficient_belongs_to_its_power() {
        let (x, y) = (0.75, -0.5);
        for degree in 0..=9 {
            for (k, (j, i)) in powers(degree).enumerate() {
                let mut coefficients = [[0.0; 2]; coefficient_count(9)];
                coefficients[k] = [1.0, -2.0];
                let found = evaluate(&coefficients, degree as u8, x, y);
                // Powers of 3/4 and 1/2 up to the ninth fit 24 binary digits.
                let expected = x.powi(i as i32) * y.powi(j as i32);
                assert_eq!(found, (expected, -2.0 * expected), "{degree} {j} {i}");
            }
        }
    }

    #[test]
    fn what_is_written_out_has_the_bits_of_the_loop() {
        let coefficients: [[f32; 2]; 36] =
            core::array::from_fn(|k| [libm::sinf(k as f32 * 1.7), libm::cosf(k as f32 * 0.9)]);
        for k in 0..100 {
            let (x, y) = (k as f32 / 99.0, (k * 37 % 100) as f32 / 99.0);
            for degree in [3, 5, 7] {
                let (a, b) = evaluate(&coefficients, degree, x, y);
                let (c, d) = row_by_row(&coefficients, degree, x, y);
                assert_eq!([a, b].map(f32::to_bits), [c, d].map(f32::to_bits));
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let coefficients: [[f32; 2]; 21] =
            core::array::from_fn(|k| [libm::sinf(k as f32 * 1.7), libm::cosf(k as f32 * 0.9)]);
        let (x, y) = (0.4, -0.7);
        let at = |x: f32, y: f32| <[f32; 2]>::from(evaluate(&coefficients, 5, x, y));
        let dual = |value, by_u, by_v| Dual { value, by_u, by_v };
        let (a, b) = row_by_row(&coefficients, 5, dual(x, 2.0, 0.0), dual(y, 0.0, 4.0));
        let h = 0.015625;
        for (k, found) in [a, b].into_iter().enumerate() {
            assert_eq!(found.value.to_bits(), at(x, y)[k].to_bits());
            // Central differences of degree 5: h^2 / 6 times third derivatives of up to 60, here 2e-3.
            let by_u = (at(x + h, y)[k] - at(x - h, y)[k]) / (2.0 * h);
            let by_v = (at(x, y + h)[k] - at(x, y - h)[k]) / (2.0 * h);
            assert!((found.by_u / 2.0 - by_u).abs() < 5e-3, "{k}");
            assert!((found.by_v / 4.0 - by_v).abs() < 5e-3, "{k}");
        }
    }
}
