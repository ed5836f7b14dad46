//! Rays in fixed point, from the numbers of a table.

use super::float::to_f32;
use super::product::product;
use crate::Ray;

/// A pixel in fixed point: 65536ths, the center of the top-left pixel at (0, 0), u right, v down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FixedPixel {
    /// To the right.
    pub u: i32,
    /// Down.
    pub v: i32,
}

/// A [`Ray`] in fixed point, rig frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FixedRay {
    /// The point nearest to the camera's reference point, in `2^exponent` mm.
    pub origin: [i32; 3],
    /// From the camera into the scene, in 2^-28.
    pub direction: [i32; 3],
    /// See `origin`; the same for all rays of a rig.
    pub exponent: i32,
}

impl FixedRay {
    /// The ray in f32, each number rounded once.
    pub fn to_ray(&self) -> Ray {
        Ray {
            origin_mm: self.origin.map(|x| to_f32(x, self.exponent)),
            direction: self.direction.map(|x| to_f32(x, -28)),
        }
    }
}

/// Where a camera is: the rotation in 2^-30, the translation in the rig's unit of length.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// Row-major.
    pub rotation: [i32; 9],
    pub translation: [i32; 3],
}

/// The half-angle vector and the scaled offset of a pixel: in 2^-28, and in the rig's unit of length.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    pub s: [i32; 2],
    pub n: [i32; 2],
}

/// The largest square of a half-angle vector, in 2^-24.
const MOST_SQUARE: u32 = 16 << 24;
/// What the products are below the exact ones at most, and more.
const BELOW_ZERO: i32 = 8;

/// Origin and direction of a sample's ray. `None` further than 127 degrees off the camera's axis, where the
/// direction has no place in its digits.
#[inline(always)]
pub fn ray(pose: &Pose, sample: Sample, is_central: bool) -> Option<([i32; 3], [i32; 3])> {
    let [s1, s2] = sample.s;
    // In 2^-24.
    let (square1, square2) = (product::<0>(s1, s1), product::<0>(s2, s2));
    let square = square1.wrapping_add(square2);
    // As a number without a sign, for up to 128; the products of small numbers may be some steps below zero.
    if square.wrapping_add(BELOW_ZERO).cast_unsigned() > MOST_SQUARE + BELOW_ZERO.cast_unsigned() {
        return None;
    }
    // A quarter, in 2^-28.
    let drop = square << 2;
    let mut direction = [0; 3];
    let (rows, _) = pose.rotation.as_chunks::<3>();
    for (component, [r1, r2, r3]) in direction.iter_mut().zip(rows) {
        let across = product::<2>(*r1, s1).wrapping_add(product::<2>(*r2, s2));
        *component = (r3 >> 2).wrapping_add(across.wrapping_sub(product::<2>(*r3, drop)));
    }
    let mut origin = pose.translation;
    if !is_central {
        let [n1, n2] = sample.n;
        let difference = square2.wrapping_sub(square1) << 2;
        let half = product::<3>(s1, s2).wrapping_neg();
        let x = n1.wrapping_add(product::<4>(difference, n1).wrapping_add(product::<4>(half, n2)));
        let y = n2.wrapping_add(product::<4>(half, n1).wrapping_sub(product::<4>(difference, n2)));
        let z = product::<4>(s1, n1)
            .wrapping_add(product::<4>(s2, n2))
            .wrapping_neg();
        for (component, [r1, r2, r3]) in origin.iter_mut().zip(rows) {
            let across = product::<2>(*r1, x).wrapping_add(product::<2>(*r2, y));
            *component = component.wrapping_add(across.wrapping_add(product::<2>(*r3, z)));
        }
    }
    Some((origin, direction))
}
