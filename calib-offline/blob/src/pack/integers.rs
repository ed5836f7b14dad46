//! What a blob says of the arithmetic of integers: its largest error over the pixels that `proof` compares, and its
//! answers to the blob's self-tests.

use super::encode;
use super::error::PackError;
use super::proof::{self, IntegerRig, Rays};
use calib_rays::field::Rig;
use calib_rays::progress::Progress;
use ray_runtime::RayBlob;
use ray_runtime::format::Arithmetic;

/// What was proven.
pub struct Integers {
    /// Largest error, px.
    pub error_px: f64,
    /// Content of the section.
    pub content: Vec<u8>,
}

impl Integers {
    /// Looks every calibrated pixel of a blob of this rig up, and quarter pixels along the edge.
    ///
    /// # Errors
    /// [`PackError::Integers`], [`PackError::IntegerRays`].
    pub fn prove(
        rig: &Rig,
        blob: &RayBlob<'_>,
        working_distance_mm: f64,
        progress: &dyn Progress,
    ) -> Result<Self, PackError> {
        let integers = Box::new(IntegerRig::prepare(blob).map_err(PackError::Integers)?);
        let mut error_px = 0.0_f64;
        for (idx, camera) in rig.cameras.iter().enumerate() {
            let rays = Rays::Integer(&integers, idx);
            let edges = proof::prove_edges(camera, rays, working_distance_mm);
            let all = proof::prove(camera, rays, working_distance_mm, 1, progress).merged(edges);
            if !all.worst_error_px.is_finite() {
                return Err(PackError::IntegerRays {
                    camera: camera.name.clone(),
                });
            }
            error_px = error_px.max(all.worst_error_px);
        }
        let mut numbers = Vec::new();
        for test in blob.self_tests() {
            let answer = integers.answer(&test).ok_or(PackError::IntegerRays {
                camera: String::new(),
            })?;
            numbers.extend_from_slice(answer.numbers());
        }
        // Twelve answers of a camera, of 64 at most.
        let count = u16::try_from(numbers.len()).unwrap_or(u16::MAX);
        let mut content = Arithmetic::header(encode::rounded_up(error_px), count).to_vec();
        content.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        Ok(Self { error_px, content })
    }
}
