//! The baseline as a rig of ray fields, so that everything that judges or measures with a rig can
//! do so with it.

use super::{BrownCamera, PinholeError, PinholeRig};
use crate::adjust::Observations;
use calib_rays::field::from_rays::{
    FromRaysSettings, SampledRay, field_of_rays, lattice_around, ray_error_px,
};
use calib_rays::field::{BaseLens, CalibratedCamera, CoverageMask, Projection, RayField, Rig};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};
use nalgebra::Vector2;

/// The baseline's cameras as ray fields.
#[derive(Debug, Clone)]
pub struct FieldRig {
    /// The cameras, all central. The rig frame is the board at the first pose that was placed.
    pub rig: Rig,
    /// Per pose index of the observations; `None` where no camera could place the board.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Largest difference of direction between a field and its camera over the calibrated area, px.
    pub worst_error_px: f64,
}

/// Cells of the fields' splines along the longer side of the sensor, tried in turn.
const CELLS: [f64; 3] = [24.0, 48.0, 96.0];
/// A field that is nearer to its camera than this is near enough, px: a hundredth of what a blob
/// may be off.
const NEAR_ENOUGH_PX: f64 = 1e-5;
/// Samples per cell along each axis; where the field is compared they lie 4/3 as dense.
const SAMPLES_PER_CELL: f64 = 3.0;
/// For central rays any distance will do, mm.
const ANY_DISTANCE_MM: f64 = 1000.0;

impl PinholeRig {
    /// The same cameras as ray fields. The calibrated area of a camera is that of the corners used,
    /// without the mask's cells that have a pixel beyond the fold of the distortion.
    ///
    /// `observations` are those of the calibration, `names` the cameras' in order.
    ///
    /// # Errors
    /// [`PinholeError::NoRays`] if nothing of a calibrated area is before the fold,
    /// [`PinholeError::NoPose`].
    pub fn rig(
        &self,
        names: &[String],
        observations: &Observations,
    ) -> Result<FieldRig, PinholeError> {
        let placed = self.first_from_board.iter().zip(&observations.poses);
        let datum = placed.filter_map(|(pose, number)| Some((pose.as_ref()?, *number)));
        let (first_from_datum, datum_pose) =
            datum.into_iter().next().ok_or(PinholeError::NoPose)?;
        let rig_from_first = first_from_datum.inverse();
        let mut worst_error_px = 0.0_f64;
        let mut cameras = Vec::with_capacity(self.cameras.len());
        for (camera_idx, (camera, name)) in self.cameras.iter().zip(names).enumerate() {
            let mut coverage =
                observations.coverage(camera_idx, |view, corner| self.is_used[view][corner]);
            keep_before_fold(&mut coverage, camera);
            let (field, error_px) =
                field_of(camera, &coverage).ok_or(PinholeError::NoRays { camera_idx })?;
            worst_error_px = worst_error_px.max(error_px);
            cameras.push(CalibratedCamera {
                name: name.clone(),
                field,
                coverage,
                rig_from_camera: rig_from_first * self.camera_from_first[camera_idx].inverse(),
            });
        }
        let to_rig = |pose: &Option<RigidTransform>| pose.map(|pose| rig_from_first * pose);
        Ok(FieldRig {
            rig: Rig {
                cameras,
                datum_pose,
                frame_is_known: false,
                match_noise_px: None,
                uncertainty: Vec::new(),
            },
            rig_from_board: self.first_from_board.iter().map(to_rig).collect(),
            worst_error_px,
        })
    }
}

/// Takes cells out of the calibrated area that have a corner or a middle without a ray.
fn keep_before_fold(coverage: &mut CoverageMask, camera: &BrownCamera) {
    let (width_px, height_px) = coverage.cell_size_px();
    let has_ray = |i: f64, j: f64| {
        let pixel = PixelPoint::new(i * width_px - 0.5, j * height_px - 0.5);
        camera.ray(pixel).is_some()
    };
    for (k, covered) in coverage.covered.iter_mut().enumerate() {
        let (i, j) = ((k % coverage.cells_u) as f64, (k / coverage.cells_u) as f64);
        let places = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)];
        *covered &= places.into_iter().all(|(di, dj)| has_ray(i + di, j + dj));
    }
}

/// The field of a camera, and its largest error over the calibrated area, px. The grid is refined
/// until that is small.
fn field_of(camera: &BrownCamera, coverage: &CoverageMask) -> Option<(RayField, f64)> {
    let sensor: SensorSize = camera.sensor;
    let middle = sensor.center();
    let [fx, fy] = camera.focal_px;
    let center = Vector2::from(camera.center_px) - Vector2::new(middle.u, middle.v);
    let base = BaseLens {
        center_px: center.into(),
        ..BaseLens::ideal(Projection::Perspective, (fx + fy) / 2.0)
    };
    let sample = |spacing_px: f64| -> Vec<SampledRay> {
        lattice_around(coverage, spacing_px)
            .into_iter()
            .filter_map(|pixel| {
                Some(SampledRay {
                    pixel,
                    ray: camera.ray(pixel)?,
                    near_mm: ANY_DISTANCE_MM,
                    far_mm: ANY_DISTANCE_MM,
                })
            })
            .collect()
    };
    let mut found = None;
    for cells in CELLS {
        let cell_px = f64::from(sensor.width.max(sensor.height)) / cells;
        let rays = sample(cell_px / SAMPLES_PER_CELL);
        let settings = FromRaysSettings {
            cell_px,
            is_central: true,
        };
        let field = field_of_rays(sensor, base, &rays, &settings)?;
        let between = sample(0.75 * cell_px / SAMPLES_PER_CELL);
        let errors = between
            .iter()
            .filter(|ray| coverage.contains(ray.pixel))
            .map(|ray| ray_error_px(&field, ray).unwrap_or(f64::INFINITY));
        let error_px = errors.fold(0.0, f64::max);
        found = Some((field, error_px));
        if error_px <= NEAR_ENOUGH_PX {
            break;
        }
    }
    found
}
