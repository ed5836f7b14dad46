//! Where two rays in fixed point meet.
//!
//! With any vector m that is not across the product n of the two directions, `lambda1 = w.(d2 x m) / n.m` and
//! `lambda2 = w.(d1 x m) / n.m` are exact for rays that meet, w being from the first origin to the second. So m
//! needs no more digits than 16, as long as it is the same everywhere: it is n, shifted up and cut.

use super::float::{to_f32, unsigned_to_f32};
use super::product::{leading_zeros, product, product_by_half, reciprocal};
use crate::{MIN_PARALLAX_SIN, MeasureError, Triangulation};

/// A [`Triangulation`] in fixed point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FixedPoint {
    /// Rig frame, in `2^exponent` mm.
    pub point: [i32; 3],
    /// See `point`; the smallest that has a place for the point.
    pub exponent: i32,
    /// Square of the length of the common perpendicular, in `2^gap_squared_exponent` mm2.
    pub gap_squared: u32,
    /// See `gap_squared`.
    pub gap_squared_exponent: i32,
}

impl FixedPoint {
    /// The point in f32, each number rounded once.
    pub fn to_triangulation(&self) -> Triangulation {
        Triangulation {
            point_mm: self.point.map(|x| to_f32(x, self.exponent)),
            gap_squared_mm2: unsigned_to_f32(self.gap_squared, self.gap_squared_exponent),
        }
    }

    /// The point in `2^exponent` mm, rounded down; `None` if it has no place there.
    pub fn point_in(&self, exponent: i32) -> Option<[i32; 3]> {
        let down = exponent.checked_sub(self.exponent)?;
        let mut point = self.point;
        for x in &mut point {
            *x = if down >= 0 {
                *x >> down.min(31)
            } else {
                let up = down.unsigned_abs();
                let shifted = x.checked_shl(up)?;
                Some(shifted).filter(|shifted| shifted >> up == *x)?
            };
        }
        Some(point)
    }
}

/// The middle of the common perpendicular of two rays, each of origin and direction.
#[inline(always)]
pub fn meet(
    (o1, d1): &([i32; 3], [i32; 3]),
    (o2, d2): &([i32; 3], [i32; 3]),
    exponent: i32,
) -> Result<FixedPoint, MeasureError> {
    // In 2^-26.
    let n = cross(d1, d2, product::<2>);
    let up = room(n);
    if up >= CLOSE && is_parallel(d1, d2, n, up) {
        return Err(MeasureError::Parallel);
    }
    let n = n.map(|x| x << (up & 31));
    let m = n.map(|x| x >> 16);
    let square = n.map(|x| {
        let half = x >> 16;
        let low = half.wrapping_mul(x & 0xffff) >> 16;
        half.wrapping_mul(half).wrapping_add(low).cast_unsigned()
    });
    let square = square[0].wrapping_add(square[1]).wrapping_add(square[2]);
    // From 2^28 on, as the largest part of m is from 2^14 on: three zeros at most, and no loop for them.
    let twice = if square >> 30 == 0 { 2 } else { 0 };
    let once = u32::from((square << twice) >> 31 == 0);
    let zeros = twice + once;
    let inverse = reciprocal(square << zeros);

    let w: [i32; 3] = core::array::from_fn(|k| o2[k].wrapping_sub(o1[k]));
    let along = |d: &[i32; 3]| dot(&w, &cross(d, &m, product_by_half));
    let (l1, l2) = (along(d2), along(d1));
    if !(l1 > 0 && l2 > 0) {
        return Err(MeasureError::Behind);
    }
    // No finer than the unit of the origins.
    let down = up.wrapping_add(zeros).wrapping_add(1);
    let finer = leading_zeros((l1 | l2).cast_unsigned())
        .wrapping_sub(2)
        .min(down);
    let down = down.wrapping_sub(finer);
    let end = |o: &[i32; 3], d: &[i32; 3], l: i32| -> [i32; 3] {
        let lambda = product::<1>(l << (finer & 31), inverse);
        core::array::from_fn(|k| (o[k] >> (down & 31)).wrapping_add(product::<1>(lambda, d[k])))
    };
    let (end1, end2) = (end(o1, d1, l1), end(o2, d2, l2));
    let exponent = exponent.wrapping_add_unsigned(down);
    let gap: [i32; 3] = core::array::from_fn(|k| end2[k].wrapping_sub(end1[k]));
    let (gap_squared, gap_exponent) = squared(gap);
    Ok(FixedPoint {
        // Twice the middle, and so in half of the unit.
        point: core::array::from_fn(|k| end1[k].wrapping_add(end2[k])),
        exponent: exponent.wrapping_sub(1),
        gap_squared,
        gap_squared_exponent: 2 * (exponent + gap_exponent),
    })
}

/// From so much room on, rays may be parallel: below it the sine is above 25 times the least.
const CLOSE: u32 = 7;

/// Square of the least sine, in 2^-40.
const LEAST: u32 = (MIN_PARALLAX_SIN * MIN_PARALLAX_SIN * (1_u64 << 40) as f32) as u32;

// As `FORMAT.md` states it.
const _: () = assert!(LEAST == 43_980);

/// Whether the sine of the angle between two directions is at most [`MIN_PARALLAX_SIN`], by 16 binary digits of
/// each number.
#[inline(never)]
fn is_parallel(d1: &[i32; 3], d2: &[i32; 3], n: [i32; 3], up: u32) -> bool {
    // Less than the least of the shortest directions.
    if up >= 19 {
        return true;
    }
    let square = |numbers: [i32; 3]| {
        let [a, b, c] = numbers.map(|x| (x >> 16).wrapping_mul(x >> 16).cast_unsigned());
        a.wrapping_add(b).wrapping_add(c)
    };
    // Both in 2^-11, up to 25.
    let lengths = (square(*d1) >> 13).wrapping_mul(square(*d2) >> 13);
    let (high, low) = (lengths >> 16, lengths & 0xffff);
    // In 2^-46, where the square of the normal is in 2^-(20 + 2 up).
    let limit = (high * LEAST).wrapping_add((low * LEAST) >> 16);
    let normal = square(n.map(|x| x << (up & 31)));
    if up < 13 {
        normal <= limit >> (26 - 2 * up)
    } else {
        normal >> (2 * up - 26) <= limit
    }
}

/// By how many binary digits the largest of three numbers can be shifted up; 30 if all are 0 or -1.
#[inline(always)]
fn room(numbers: [i32; 3]) -> u32 {
    let [a, b, c] = numbers.map(|x| x ^ x >> 31);
    leading_zeros((a | b | c).cast_unsigned()).wrapping_sub(1)
}

#[inline(always)]
fn cross(a: &[i32; 3], b: &[i32; 3], product: impl Fn(i32, i32) -> i32) -> [i32; 3] {
    let part = |i: usize, j: usize| product(a[i], b[j]).wrapping_sub(product(a[j], b[i]));
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// In 2^31 of the product of both units.
#[inline(always)]
fn dot(a: &[i32; 3], b: &[i32; 3]) -> i32 {
    let part = |k: usize| product::<1>(a[k], b[k]);
    part(0).wrapping_add(part(1)).wrapping_add(part(2))
}

/// The square of a length, and the exponent of what it is counted in, halved.
#[inline(always)]
fn squared(numbers: [i32; 3]) -> (u32, i32) {
    // A usual gap needs no more than 16 binary digits.
    let [a, b, c] = numbers.map(|x| x ^ x >> 31);
    let all = a | b | c;
    let down = if all >> 15 == 0 {
        0
    } else {
        17_u32.saturating_sub(leading_zeros(all.cast_unsigned()))
    };
    let [a, b, c] = numbers.map(|x| {
        let x = x >> (down & 31);
        x.wrapping_mul(x).cast_unsigned()
    });
    (a.wrapping_add(b).wrapping_add(c), down.cast_signed())
}
