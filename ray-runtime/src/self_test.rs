//! Questions with known answers that travel in the blob, so that a device can check that it
//! computes the same bits as the host that packed it.

use crate::format::{Messages, SelfTest};
use crate::{PixelPoint, RayBlob};

/// Iterator over a blob's self-tests.
#[derive(Debug, Clone)]
pub struct SelfTests<'a> {
    /// Those that are left.
    pub(crate) messages: Messages<'a>,
    /// How many there are left.
    pub(crate) left: u16,
}

impl Iterator for SelfTests<'_> {
    type Item = SelfTest;

    fn next(&mut self) -> Option<SelfTest> {
        self.left = self.left.checked_sub(1)?;
        self.messages.self_test()
    }
}

/// The first self-test that did not give the bits it should.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SelfTestFailure {
    /// Number of the test, from 0.
    pub test: usize,
}

impl SelfTest {
    /// How many numbers another arithmetic answers with ([`Arithmetic`](crate::format::Arithmetic)).
    #[cfg(feature = "integer")]
    pub const fn answer_len(&self) -> usize {
        match self {
            Self::Ray { .. } => 6,
            Self::Pair { .. } => 4,
            Self::Sigma { .. } => 0,
        }
    }

    /// Whether the blob gives the answer, bit for bit.
    pub fn passes(&self, blob: &RayBlob<'_>) -> bool {
        match *self {
            Self::Ray {
                camera,
                pixel: [u, v],
                origin_mm,
                direction,
            } => blob
                .lookup(camera.into(), PixelPoint { u, v })
                .is_ok_and(|ray| {
                    same_bits(ray.origin_mm, origin_mm) && same_bits(ray.direction, direction)
                }),
            Self::Pair {
                cameras: [camera_a, camera_b],
                pixels: [[u_a, v_a], [u_b, v_b]],
                point_mm,
                gap_squared_mm2,
            } => blob
                .triangulate(
                    (camera_a.into(), PixelPoint { u: u_a, v: v_a }),
                    (camera_b.into(), PixelPoint { u: u_b, v: v_b }),
                )
                .is_ok_and(|result| {
                    same_bits(result.point_mm, point_mm)
                        && result.gap_squared_mm2.to_bits() == gap_squared_mm2.to_bits()
                }),
            Self::Sigma {
                cameras: [camera_a, camera_b],
                pixels: [[u_a, v_a], [u_b, v_b]],
                sigma_mm,
            } => blob
                .triangulate_with_covariance(
                    (camera_a.into(), PixelPoint { u: u_a, v: v_a }),
                    (camera_b.into(), PixelPoint { u: u_b, v: v_b }),
                )
                .is_ok_and(|result| {
                    let covariance = result.covariance;
                    covariance.is_some_and(|c| same_bits(c.sigma_mm(), sigma_mm))
                }),
        }
    }
}

fn same_bits([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> bool {
    a.to_bits() == x.to_bits() && b.to_bits() == y.to_bits() && c.to_bits() == z.to_bits()
}

impl RayBlob<'_> {
    /// Runs every self-test; how many there were.
    ///
    /// # Errors
    /// The first test that fails: this target does not compute what the packing host computed.
    pub fn run_self_tests(&self) -> Result<usize, SelfTestFailure> {
        let mut count = 0;
        for test in self.self_tests() {
            if !test.passes(self) {
                return Err(SelfTestFailure { test: count });
            }
            count = count.saturating_add(1);
        }
        Ok(count)
    }
}
