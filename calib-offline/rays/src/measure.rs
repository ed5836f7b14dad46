//! Who turns a match into a point, and the calibration that does it in f64; `matches` has the blob
//! that does it with the device's own f32 code.

pub use crate::field::Gap;
use crate::field::{MeasureError, Rig};
use crate::geometry::{PixelPoint, RigidTransform, TriangulateError};
use nalgebra::{Matrix3, RealField};
use std::str::FromStr;

/// The numbers that a source computes with. Pixels are read straight into it and points written
/// with the shortest digits that read back to the same bits.
pub trait Number: RealField + Copy + FromStr + zmij::Float + Into<f64> + Send + Sync {}

impl Number for f32 {}
impl Number for f64 {}

/// Camera index and pixel (u, v).
pub type Sighting<N> = (usize, [N; 2]);

/// Why a match has no point, as `POINTS.csv` says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// A pixel lies outside its camera's calibrated area.
    Outside,
    /// The rays are parallel.
    Parallel,
    /// The rays meet behind a camera.
    Behind,
}

impl Status {
    /// The word in the file.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Outside => "outside",
            Self::Parallel => "parallel",
            Self::Behind => "behind",
        }
    }
}

impl From<MeasureError> for Status {
    fn from(error: MeasureError) -> Self {
        match error {
            MeasureError::Outside { .. } => Self::Outside,
            MeasureError::Triangulate(TriangulateError::Behind) => Self::Behind,
            MeasureError::Triangulate(_) => Self::Parallel,
        }
    }
}

/// A triangulated match.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point<N> {
    /// In the frame asked for, mm.
    pub point_mm: [N; 3],
    /// Length of the common perpendicular, mm.
    pub gap_mm: N,
    /// Predicted standard deviation along each axis, mm: what the calibration leaves uncertain, and the
    /// noise of the pixels. `None` where the rig does not say.
    pub sigma_mm: Option<[N; 3]>,
}

/// Turns matches into points.
pub trait PointSource: Sync {
    /// What it computes with.
    type Number: Number;

    /// The names of the rig's cameras, in order.
    fn cameras(&self) -> Vec<String>;

    /// The point seen by two or more cameras. Of more than two, those count whose pixels are calibrated.
    ///
    /// # Errors
    /// [`Status`] where there is none.
    fn point(&self, sightings: &[Sighting<Self::Number>]) -> Result<Point<Self::Number>, Status>;

    /// The gap of two sightings; `None` where there is no point or nothing is known of its uncertainty.
    fn gap(&self, _sightings: &[Sighting<Self::Number>]) -> Option<Gap> {
        None
    }

    /// Covariance of that point in its frame, all that is known of it, mm^2; `None` where the rig does not say.
    fn covariance_mm2(&self, _sightings: &[Sighting<Self::Number>]) -> Option<Matrix3<f64>> {
        None
    }
}

/// Turns many matches of two cameras at once into points: for one that is far away.
pub trait BatchSource {
    /// What it computes with.
    type Number: Number;
    /// Why it gave no answer.
    type Error;

    /// The names of the rig's cameras, in order.
    fn cameras(&self) -> Vec<String>;

    /// One answer for each match, in their order.
    ///
    /// # Errors
    /// If it could not be asked.
    fn points(
        &mut self,
        matches: &[[Sighting<Self::Number>; 2]],
    ) -> Result<Answers<Self::Number>, Self::Error>;
}

/// Points, or why there is none.
pub type Answers<N> = Vec<Result<Point<N>, Status>>;

/// A calibration, evaluated in f64.
#[derive(Debug)]
pub struct RigSource<'a> {
    rig: &'a Rig,
    frame_from_rig: Option<RigidTransform>,
}

impl<'a> RigSource<'a> {
    /// Points in the rig frame, or in the frame of one camera; `None` if there is no such camera.
    pub fn new(rig: &'a Rig, camera_frame: Option<&str>) -> Option<Self> {
        let frame_from_rig = match camera_frame {
            None => None,
            Some(name) => {
                let camera = &rig.cameras[rig.camera_idx(name)?];
                Some(camera.rig_from_camera.inverse())
            }
        };
        Some(Self {
            rig,
            frame_from_rig,
        })
    }

    fn sigma_mm(&self, sightings: &[Sighting<f64>]) -> Option<[f64; 3]> {
        let covariance_mm2 = self.covariance_mm2(sightings)?;
        Some([0, 1, 2].map(|k| covariance_mm2[(k, k)].max(0.0).sqrt()))
    }
}

impl PointSource for RigSource<'_> {
    type Number = f64;

    fn cameras(&self) -> Vec<String> {
        self.rig.cameras.iter().map(|c| c.name.clone()).collect()
    }

    fn point(&self, sightings: &[Sighting<f64>]) -> Result<Point<f64>, Status> {
        let answering;
        let sightings = if sightings.len() > 2 {
            answering = answering_of(sightings, |sighting| {
                let (camera_idx, pixel) = pixel(*sighting);
                let camera = self.rig.cameras.get(camera_idx);
                camera.is_some_and(|camera| camera.coverage.contains(pixel))
            });
            &answering[..]
        } else {
            sightings
        };
        let result = if let [a, b] = *sightings {
            self.rig.triangulate(&[pixel(a), pixel(b)])
        } else {
            let sightings: Vec<_> = sightings.iter().copied().map(pixel).collect();
            self.rig.triangulate(&sightings)
        };
        let found = result?;
        let point_mm = match &self.frame_from_rig {
            None => found.point_mm,
            Some(frame_from_rig) => frame_from_rig.point(&found.point_mm),
        };
        Ok(Point {
            point_mm: point_mm.into(),
            gap_mm: found.gap_mm,
            sigma_mm: self.sigma_mm(sightings),
        })
    }

    fn gap(&self, sightings: &[Sighting<f64>]) -> Option<Gap> {
        let [a, b] = *sightings else { return None };
        self.rig.pair_gap([pixel(a), pixel(b)])
    }

    /// Of two sightings only: a rig knows pairs.
    fn covariance_mm2(&self, sightings: &[Sighting<f64>]) -> Option<Matrix3<f64>> {
        let [a, b] = *sightings else { return None };
        let in_rig = self.rig.pair_covariance([pixel(a), pixel(b)])?.total_mm2();
        Some(match &self.frame_from_rig {
            None => in_rig,
            Some(frame) => frame.rotation * in_rig * frame.rotation.transpose(),
        })
    }
}

/// Of a point that more than two cameras saw, the sightings whose pixels are calibrated, if two are: a camera that
/// has no ray is one that did not see the point. Else all of them, to be refused.
pub fn answering_of<N: Copy>(
    sightings: &[Sighting<N>],
    is_calibrated: impl Fn(&Sighting<N>) -> bool,
) -> Vec<Sighting<N>> {
    let calibrated: Vec<_> = sightings.iter().copied().filter(is_calibrated).collect();
    if calibrated.len() < 2 {
        return sightings.to_vec();
    }
    calibrated
}

fn pixel((camera_idx, [u, v]): Sighting<f64>) -> (usize, PixelPoint) {
    (camera_idx, PixelPoint::new(u, v))
}
