//! The blob's self-tests, answered by integers.

use super::Rig;
use crate::format::SelfTest;
use crate::{PixelPoint, RayBlob, SelfTestFailure};

/// The numbers of an answer: six of a ray, four of a match.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    numbers: [f32; 6],
    count: usize,
}

impl Answer {
    /// Origin and direction, or point and square of the gap; nothing to a question for standard deviations.
    pub fn numbers(&self) -> &[f32] {
        self.numbers.get(..self.count).unwrap_or_default()
    }
}

impl<const N: usize> Rig<'_, N> {
    /// The answer to a self-test; `None` of a pixel or a match that has none.
    pub fn answer(&self, test: &SelfTest) -> Option<Answer> {
        let pixel = |[u, v]: [f32; 2]| PixelPoint { u, v };
        let numbers = match *test {
            SelfTest::Ray {
                camera, pixel: at, ..
            } => {
                let ray = self.lookup(camera.into(), pixel(at)).ok()?;
                let ([a, b, c], [d, e, f]) = (ray.origin_mm, ray.direction);
                [a, b, c, d, e, f]
            }
            SelfTest::Pair {
                cameras: [a, b],
                pixels: [at_a, at_b],
                ..
            } => {
                let found = self
                    .triangulate((a.into(), pixel(at_a)), (b.into(), pixel(at_b)))
                    .ok()?;
                let [x, y, z] = found.point_mm;
                [x, y, z, found.gap_squared_mm2, 0.0, 0.0]
            }
            SelfTest::Sigma { .. } => [0.0; 6],
        };
        Some(Answer {
            numbers,
            count: test.answer_len(),
        })
    }

    /// Compares every self-test of a blob that has answers for this arithmetic, bit for bit; how many there were. 0 of a blob
    /// without them.
    ///
    /// # Errors
    /// The first test that fails: this target does not compute what the packing host computed.
    pub fn run_self_tests(&self, blob: &RayBlob<'_>) -> Result<usize, SelfTestFailure> {
        let mut count = 0;
        for (test, (question, expected)) in expected(blob).enumerate() {
            if expected.is_empty() {
                continue;
            }
            let is_same = self.answer(&question).is_some_and(|answer| {
                let found = answer.numbers().iter().map(|number| number.to_bits());
                found.eq(expected.iter().map(|bytes| u32::from_le_bytes(*bytes)))
            });
            if !is_same {
                return Err(SelfTestFailure { test });
            }
            count += 1;
        }
        Ok(count)
    }
}

/// The self-tests of a blob, each with the bytes of the numbers that it states for the arithmetic of integers.
pub fn expected<'a>(blob: &RayBlob<'a>) -> impl Iterator<Item = (SelfTest, &'a [[u8; 4]])> {
    let mut answers = blob.arithmetic().map(|arithmetic| arithmetic.answers);
    blob.self_tests().map(move |test| {
        let parts = answers.and_then(|answers| answers.split_at_checked(test.answer_len()));
        answers = parts.map(|(_, rest)| rest);
        (test, parts.map(|(own, _)| own).unwrap_or_default())
    })
}
