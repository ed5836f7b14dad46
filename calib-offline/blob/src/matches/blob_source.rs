//! Points from a blob, with the device's own f32 code.

use crate::pack::IntegerRig;
use calib_rays::measure::{Gap, Point, PointSource, Sighting, Status, answering_of};
use nalgebra::{Matrix3, Vector3};
use ray_runtime::integer::Unsuited;
use ray_runtime::{MatchNoise, Measurement, PixelPoint, RayBlob};

/// A blob, evaluated by the device's own library.
#[derive(Debug)]
pub struct BlobSource<'a> {
    blob: &'a RayBlob<'a>,
    noise: Option<MatchNoise>,
    /// The blob prepared for the arithmetic of integers, where that is to be used.
    integers: Option<Box<IntegerRig<'a>>>,
    /// Whether it carries the uncertainty of any two cameras.
    is_uncertain: bool,
    /// Turned about the origin after subtracting the camera's place.
    rig_from_frame: Option<ray_runtime::RigFromCamera>,
}

impl<'a> BlobSource<'a> {
    /// Points in the blob's frame, or in the frame of one camera; `None` if there is no such
    /// camera.
    pub fn new(blob: &'a RayBlob<'a>, camera_frame: Option<&str>) -> Option<Self> {
        let rig_from_frame = match camera_frame {
            None => None,
            Some(name) => Some(blob.camera(blob.camera_index(name)?)?.rig_from_camera),
        };
        Some(Self {
            blob,
            noise: None,
            integers: None,
            is_uncertain: blob.uncertain_pairs().next().is_some(),
            rig_from_frame,
        })
    }

    /// The same, of pixels that are as noisy as this, whatever the blob says of them.
    #[must_use]
    pub fn with_noise(mut self, noise: MatchNoise) -> Self {
        self.noise = Some(noise);
        self
    }

    /// The same in the arithmetic of integers: points of the first two pixels of a match that have rays, without standard
    /// deviations.
    ///
    /// # Errors
    /// [`Unsuited`] if it has no place for the blob's numbers.
    pub fn in_integers(mut self) -> Result<Self, Unsuited> {
        self.integers = Some(Box::new(IntegerRig::prepare(self.blob)?));
        Ok(self)
    }

    fn pair(
        &self,
        a: Sighting<f32>,
        b: Sighting<f32>,
    ) -> Result<Measurement, ray_runtime::MeasureError> {
        let (a, b) = (pixel(a), pixel(b));
        if let Some(integers) = &self.integers {
            return Ok(Measurement {
                found: integers.triangulate(a, b)?,
                is_second_above: false,
                covariance: None,
            });
        }
        if !self.is_uncertain {
            // The same bits, without the derivatives.
            return Ok(Measurement {
                found: self.blob.triangulate(a, b)?,
                is_second_above: false,
                covariance: None,
            });
        }
        match self.noise {
            Some(noise) => self.blob.triangulate_with_noise(a, b, noise),
            None => self.blob.triangulate_with_covariance(a, b),
        }
    }
}

fn pixel((camera_idx, [u, v]): Sighting<f32>) -> (usize, PixelPoint) {
    (camera_idx, PixelPoint::new(u, v))
}

impl PointSource for BlobSource<'_> {
    type Number = f32;

    fn cameras(&self) -> Vec<String> {
        (0..self.blob.camera_count())
            .filter_map(|k| self.blob.camera(k))
            .map(|camera| camera.name.to_owned())
            .collect()
    }

    fn point(&self, sightings: &[Sighting<f32>]) -> Result<Point<f32>, Status> {
        let answering;
        let sightings = if sightings.len() > 2 {
            answering = answering_of(sightings, |sighting| {
                let (camera_idx, pixel) = pixel(*sighting);
                self.blob.lookup(camera_idx, pixel).is_ok()
            });
            let most = if self.integers.is_some() {
                2
            } else {
                usize::MAX
            };
            &answering[..answering.len().min(most)]
        } else {
            sightings
        };
        // A blob knows pairs.
        let result = if let [a, b] = *sightings {
            self.pair(a, b)
        } else {
            let sightings: Vec<_> = sightings.iter().copied().map(pixel).collect();
            let found = self.blob.triangulate_many(&sightings);
            found.map(|found| Measurement {
                found,
                // Of more than two rays none is above another.
                is_second_above: false,
                covariance: None,
            })
        };
        let Measurement {
            found, covariance, ..
        } = result.map_err(|error| match error {
            ray_runtime::MeasureError::Behind => Status::Behind,
            ray_runtime::MeasureError::Parallel => Status::Parallel,
            _ => Status::Outside,
        })?;
        let point_mm = match &self.rig_from_frame {
            None => found.point_mm,
            Some(rig_from_frame) => in_frame(rig_from_frame, found.point_mm),
        };
        Ok(Point {
            point_mm,
            gap_mm: found.gap_mm(),
            sigma_mm: covariance.map(|covariance| match &self.rig_from_frame {
                // In the blob's own frame these are the device's bits.
                None => covariance.sigma_mm(),
                Some(rig_from_frame) => {
                    sigma_in_frame(rig_from_frame, &covariance.total_matrix_mm2())
                }
            }),
        })
    }

    fn gap(&self, sightings: &[Sighting<f32>]) -> Option<Gap> {
        let [a, b] = *sightings else { return None };
        let with = |noise| {
            let measured = self.blob.triangulate_with_noise(pixel(a), pixel(b), noise);
            let measured = measured.ok()?;
            let variance_mm2 = f64::from(measured.covariance?.gap_mm2);
            Some((f64::from(measured.found.gap_mm()), variance_mm2))
        };
        let (gap_mm, calibration_mm2) = with(MatchNoise::NONE)?;
        let (_, of_one_px_mm2) = with(MatchNoise::from_px(1.0)?)?;
        Some(Gap {
            gap_mm,
            calibration_mm2,
            mm2_per_px2: of_one_px_mm2 - calibration_mm2,
        })
    }

    fn covariance_mm2(&self, sightings: &[Sighting<f32>]) -> Option<Matrix3<f64>> {
        let [a, b] = *sightings else { return None };
        let in_rig = self.pair(a, b).ok()?.covariance?.total_matrix_mm2();
        let covariance_mm2 = match &self.rig_from_frame {
            None => in_rig,
            Some(rig_from_frame) => covariance_in_frame(rig_from_frame, &in_rig),
        };
        Some(covariance_mm2.map(f64::from))
    }
}

fn covariance_in_frame(
    rig_from_frame: &ray_runtime::RigFromCamera,
    covariance_mm2: &Matrix3<f32>,
) -> Matrix3<f32> {
    let rotation = rig_from_frame.rotation_matrix();
    let rotation = rotation.matrix();
    rotation.transpose() * covariance_mm2 * rotation
}

fn sigma_in_frame(
    rig_from_frame: &ray_runtime::RigFromCamera,
    covariance_mm2: &Matrix3<f32>,
) -> [f32; 3] {
    let in_frame = covariance_in_frame(rig_from_frame, covariance_mm2);
    // Round-off may leave less than nothing of a variance near zero.
    [0, 1, 2].map(|k| in_frame[(k, k)].max(0.0).sqrt())
}

fn in_frame(rig_from_frame: &ray_runtime::RigFromCamera, point_mm: [f32; 3]) -> [f32; 3] {
    let [point_mm, translation_mm] = [point_mm, rig_from_frame.translation_mm].map(Vector3::from);
    let frame_from_rig = rig_from_frame.rotation_matrix().inverse();
    (frame_from_rig * (point_mm - translation_mm)).into()
}
