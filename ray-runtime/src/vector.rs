//! Three numbers along x, y and z, and what is computed with them.
//!
//! Sums of three are taken from the left, as `FORMAT.md` says: every target gives the same bits.

use core::ops::{Add, AddAssign, Mul, Neg, Sub};

/// A point, a direction or a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Vector {
    pub x: f32,
    pub y: f32,
    pub z: f32,
}

impl Vector {
    pub const ZERO: Self = Self::new(0.0, 0.0, 0.0);

    #[inline(always)]
    pub const fn new(x: f32, y: f32, z: f32) -> Self {
        Self { x, y, z }
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> f32 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    #[inline(always)]
    pub fn norm_squared(self) -> f32 {
        self.dot(self)
    }
}

impl From<[f32; 3]> for Vector {
    #[inline(always)]
    fn from([x, y, z]: [f32; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<Vector> for [f32; 3] {
    #[inline(always)]
    fn from(Vector { x, y, z }: Vector) -> Self {
        [x, y, z]
    }
}

impl Add for Vector {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl AddAssign for Vector {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Vector {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Neg for Vector {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

impl Mul<f32> for Vector {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f32) -> Self {
        Self::new(self.x * factor, self.y * factor, self.z * factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_have_the_signs_of_a_right_handed_frame() {
        let (a, b) = (Vector::new(1.0, 2.0, 3.0), Vector::new(-4.0, 5.0, 6.0));
        assert_eq!(a.cross(b), Vector::new(-3.0, -18.0, 13.0));
        assert_eq!(a.dot(b), 24.0);
        assert_eq!((-a * 2.0 + b - a).norm_squared(), 59.0);
        assert_eq!(
            <[f32; 3]>::from(Vector::from([1.0, 2.0, 3.0])),
            [1.0, 2.0, 3.0]
        );
    }

    #[test]
    fn sums_are_taken_from_the_left() {
        // From the right the large numbers would swallow the one.
        let a = Vector::new(1e8, -1e8, 1.0);
        assert_eq!(a.dot(Vector::new(1.0, 1.0, 1.0)), 1.0);
    }
}
