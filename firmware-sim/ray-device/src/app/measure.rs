//! The answer to one match, in numbers of f32.

use ray_runtime::{MatchNoise, MeasureError, PixelPoint, RayBlob};

use crate::health::Health;
use crate::protocol::{Match, Measured, Point};

/// What is asked of matches.
#[derive(Clone, Copy)]
pub enum Asked {
    /// Points alone.
    Points,
    /// Their standard deviations too, of pixels that are so noisy; that is the blob's business where it is not said.
    Sigmas(Option<MatchNoise>),
}

/// The two pixels of a match.
pub fn sightings(asked: &Match) -> [(usize, PixelPoint); 2] {
    [asked.first, asked.second].map(|sighting| {
        (
            usize::from(sighting.camera),
            PixelPoint::new(sighting.u_px, sighting.v_px),
        )
    })
}

pub fn measure_one(blob: &RayBlob<'_>, of: &Match, asked: Asked, health: &mut Health) -> Measured {
    let [first, second] = sightings(of);
    let outcome = match asked {
        Asked::Points => blob.triangulate(first, second).map(Point::from),
        Asked::Sigmas(noise) => {
            let outcome = match noise {
                Some(noise) => blob.triangulate_with_noise(first, second, noise),
                None => blob.triangulate_with_covariance(first, second),
            };
            if let Ok(measured) = &outcome {
                health.note(measured);
            }
            outcome.map(Point::from)
        }
    };
    Measured {
        id: of.id,
        outcome: outcome.map_err(MeasureError::code),
    }
}
