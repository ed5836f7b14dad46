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

/// The polynomial with these coefficients, as many as its total degree has: up to the ninth, written
/// out, because the compiler unrolls one loop but not a loop of loops.
///
/// A pair, because that comes back in registers.
#[inline(never)]
pub(crate) fn evaluate(coefficients: &[[f32; 2]], x: f32, y: f32) -> (f32, f32) {
    let Some(([a, b], rest)) = coefficients.split_first() else {
        return (0.0, 0.0);
    };
    let (mut sum_a, mut sum_b) = (*a, *b);
    // A polynomial of a lower degree is one that ends sooner.
    macro_rules! rows {
        ($rest:ident: $length:literal $($more:literal)*) => {
            let Some((row, rest)) = $rest.split_first_chunk::<$length>() else {
                return (sum_a, sum_b);
            };
            let (a, b) = along_x(row, x);
            (sum_a, sum_b) = (sum_a * y + a, sum_b * y + b);
            rows!(rest: $($more)*);
        };
        ($rest:ident:) => {
            let _ = $rest;
        };
    }
    rows!(rest: 2 3 4 5 6 7 8 9 10);
    (sum_a, sum_b)
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

/// [`evaluate`] with derivatives, in a loop: for size, where that is for speed.
#[inline(never)]
pub(crate) fn evaluate_moving(coefficients: &[[f32; 2]], x: Dual, y: Dual) -> [Dual; 2] {
    let mut sums = [Dual::from(0.0); 2];
    let mut rest = coefficients;
    let mut length = 1;
    while let Some((row, after)) = rest.split_at_checked(length).filter(|_| !rest.is_empty()) {
        for (k, sum) in sums.iter_mut().enumerate() {
            let mut numbers = row
                .iter()
                .map(|pair| if k == 0 { pair[0] } else { pair[1] });
            let first = Dual::from(numbers.next().unwrap_or(0.0));
            let row = numbers.fold(first, |row, next| row * x + next.into());
            *sum = if length == 1 { row } else { *sum * y + row };
        }
        rest = after;
        length += 1;
    }
    sums
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

/// [`cubic`] at one y: the same bits, with the product that does not depend on x computed once.
#[derive(Clone, Copy)]
pub(crate) struct AlongX<'a> {
    coefficients: &'a [[f32; 2]; 10],
    y: f32,
    of_y3: [f32; 2],
    /// The first of each row: the others are added, and so are copied anyway.
    firsts: [[f32; 2]; 3],
}

impl<'a> AlongX<'a> {
    #[inline(always)]
    pub fn new(coefficients: &'a [[f32; 2]; 10], y: f32) -> Self {
        let [[a, b], y2x, _, yx2, _, _, x3, ..] = *coefficients;
        Self {
            coefficients,
            y,
            of_y3: [a * y, b * y],
            firsts: [y2x, yx2, x3],
        }
    }

    #[inline(always)]
    pub fn at(&self, x: f32) -> [f32; 2] {
        let [_, _, y2, _, yx, y1, _, x2, x1, one] = self.coefficients;
        let [y2x, yx2, x3] = &self.firsts;
        let mut sums = self.of_y3;
        for (k, sum) in sums.iter_mut().enumerate() {
            let c = |pair: &[f32; 2]| if k == 0 { pair[0] } else { pair[1] };
            let of_y2 = c(y2x) * x + c(y2);
            let of_y = (c(yx2) * x + c(yx)) * x + c(y1);
            let of_one = ((c(x3) * x + c(x2)) * x + c(x1)) * x + c(one);
            *sum = ((*sum + of_y2) * self.y + of_y) * self.y + of_one;
        }
        sums
    }
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
                let found = evaluate(&coefficients[..coefficient_count(degree)], x, y);
                // Powers of 3/4 and 1/2 up to the ninth fit 24 binary digits.
                let expected = x.powi(i as i32) * y.powi(j as i32);
                assert_eq!(found, (expected, -2.0 * expected), "{degree} {j} {i}");
            }
        }
    }

    #[test]
    fn what_is_written_out_has_the_bits_of_the_loop() {
        let coefficients: [[f32; 2]; 55] =
            core::array::from_fn(|k| [libm::sinf(k as f32 * 1.7), libm::cosf(k as f32 * 0.9)]);
        for k in 0..100 {
            let (x, y) = (k as f32 / 99.0, (k * 37 % 100) as f32 / 99.0);
            for degree in 0..=9 {
                let coefficients = &coefficients[..coefficient_count(degree)];
                let (a, b) = evaluate(coefficients, x, y);
                let looped = evaluate_moving(coefficients, x.into(), y.into());
                assert_eq!(
                    looped.map(|sum| sum.value.to_bits()),
                    [a, b].map(f32::to_bits)
                );
                if let Ok(ten) = coefficients.try_into() {
                    let cubics = [cubic(ten, x, y), AlongX::new(ten, y).at(x)];
                    assert_eq!(
                        cubics.map(|sums| sums.map(f32::to_bits)),
                        [[a, b].map(f32::to_bits); 2]
                    );
                }
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let coefficients: [[f32; 2]; 21] =
            core::array::from_fn(|k| [libm::sinf(k as f32 * 1.7), libm::cosf(k as f32 * 0.9)]);
        let (x, y) = (0.4, -0.7);
        let at = |x: f32, y: f32| <[f32; 2]>::from(evaluate(&coefficients, x, y));
        let dual = |value, by_u, by_v| Dual { value, by_u, by_v };
        let found = evaluate_moving(&coefficients, dual(x, 2.0, 0.0), dual(y, 0.0, 4.0));
        let h = 0.015625;
        for (k, found) in found.into_iter().enumerate() {
            assert_eq!(found.value.to_bits(), at(x, y)[k].to_bits());
            // Central differences of degree 5: h^2 / 6 times third derivatives of up to 60, here 2e-3.
            let by_u = (at(x + h, y)[k] - at(x - h, y)[k]) / (2.0 * h);
            let by_v = (at(x, y + h)[k] - at(x, y - h)[k]) / (2.0 * h);
            assert!((found.by_u / 2.0 - by_u).abs() < 5e-3, "{k}");
            assert!((found.by_v / 4.0 - by_v).abs() < 5e-3, "{k}");
        }
    }
}
