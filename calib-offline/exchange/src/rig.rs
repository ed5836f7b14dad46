//! The rig of rays nearest to cameras of another tool.

use crate::foreign::ForeignCamera;
use crate::foreign_rig::ForeignRig;
use crate::model::CameraModel;
use crate::read::{ImportError, Problem};
use calib_rays::field::from_rays::{
    FromRaysSettings, SampledRay, field_of_rays, lattice_around, ray_error_px,
};
use calib_rays::field::{BaseLens, CalibratedCamera, CoverageMask, Projection, RayField, Rig};
use calib_rays::geometry::{PixelPoint, SensorSize};
use nalgebra::Vector3;

/// Cells of a field's splines along the longer side of the sensor, tried in turn.
const CELLS: [f64; 3] = [24.0, 48.0, 96.0];
/// A field that is nearer to its model than this, px, is near enough: a hundredth of what a blob may be off.
const NEAR_ENOUGH_PX: f64 = 1e-5;
/// Samples a cell along each axis; where the field is compared they lie 4/3 as dense.
const SAMPLES_PER_CELL: f64 = 3.0;
/// For rays that meet in a point any distance will do, mm.
const ANY_DISTANCE_MM: f64 = 1000.0;
/// Rays that do not meet are held from this share of the working distance ...
const NEAR_SHARE: f64 = 0.5;
/// ... to this.
const FAR_SHARE: f64 = 2.0;
/// Where a field cannot come nearer to its model than this, px, nothing is calibrated: so it is just before a fold.
const FARTHEST_PX: f64 = 0.05;
/// A lens that sees farther off axis is equidistant at heart, rad (60 degrees).
const PERSPECTIVE_UP_TO_RAD: f64 = 1.05;

/// A rig of rays made of cameras of another tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Converted {
    /// The rig, in the file's own frame, without uncertainty.
    pub rig: Rig,
    /// What each camera lost.
    pub cameras: Vec<ConvertedCamera>,
}

/// What a camera lost on the way.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvertedCamera {
    /// Its name.
    pub name: String,
    /// RMS difference of the field from the model over the calibrated area, px.
    pub rms_px: f64,
    /// The largest.
    pub max_px: f64,
    /// Share of the sensor for which there are rays.
    pub covered_share: f64,
}

impl ForeignRig {
    /// Whether the rays of every camera meet in a point.
    pub fn is_central(&self) -> bool {
        self.cameras.iter().all(|camera| camera.model.is_central())
    }

    /// The rig of rays. Its calibrated area is that for which the model has rays, within the region that the file calls
    /// valid. `distance_mm` is how far away things are: needed where rays do not meet in a point.
    ///
    /// # Errors
    /// [`Problem::NoRays`].
    pub fn rays(&self, distance_mm: Option<f64>) -> Result<Converted, ImportError> {
        let mut converted = Converted {
            rig: Rig {
                cameras: Vec::new(),
                datum_pose: 0,
                // The file's frame, not that of a board.
                frame_is_known: true,
                uncertainty: Vec::new(),
                match_noise_px: None,
            },
            cameras: Vec::new(),
        };
        for camera in &self.cameras {
            let no_rays = || {
                let file = self.files.first().cloned().unwrap_or_default();
                let camera = camera.name.clone();
                Problem::NoRays { camera }.in_file(&file)
            };
            let mut coverage = coverage(camera);
            let (field, errors) = field_of(camera, &coverage, distance_mm).ok_or_else(no_rays)?;
            for (pixel, error_px) in &errors {
                // Written so that NaN is too far.
                if !(*error_px <= FARTHEST_PX)
                    && let Some(cell) = coverage.cell_of(*pixel)
                {
                    coverage.covered[cell] = false;
                }
            }
            let kept: Vec<f64> = errors
                .iter()
                .filter(|(pixel, _)| coverage.contains(*pixel))
                .map(|(_, error_px)| *error_px)
                .collect();
            if kept.is_empty() {
                return Err(no_rays());
            }
            let squares: f64 = kept.iter().map(|error| error * error).sum();
            converted.cameras.push(ConvertedCamera {
                name: camera.name.clone(),
                rms_px: (squares / kept.len() as f64).sqrt(),
                max_px: kept.iter().copied().fold(0.0, f64::max),
                covered_share: coverage.covered_share(),
            });
            converted.rig.cameras.push(CalibratedCamera {
                name: camera.name.clone(),
                field,
                coverage,
                rig_from_camera: camera
                    .rig_from_camera
                    .unwrap_or_else(calib_rays::geometry::RigidTransform::identity),
            });
        }
        Ok(converted)
    }
}

/// The cells of the sensor whose corners and middle have rays, inside the region that is valid.
fn coverage(camera: &ForeignCamera) -> CoverageMask {
    let mut coverage = CoverageMask::uniform(camera.sensor, true);
    let (width_px, height_px) = coverage.cell_size_px();
    let is_good = |i: f64, j: f64| {
        let pixel = PixelPoint::new(i * width_px - 0.5, j * height_px - 0.5);
        let is_valid = camera
            .valid
            .as_ref()
            .is_none_or(|polygon| inside(polygon, pixel));
        is_valid && camera.model.ray(pixel).is_some()
    };
    for (k, covered) in coverage.covered.iter_mut().enumerate() {
        let (i, j) = ((k % coverage.cells_u) as f64, (k / coverage.cells_u) as f64);
        let places = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)];
        *covered = places.into_iter().all(|(di, dj)| is_good(i + di, j + dj));
    }
    coverage
}

/// Whether a pixel lies in a polygon, or less than half a pixel beside it: a region that ends with the pixels' centers is the
/// whole image.
fn inside(polygon: &[PixelPoint], pixel: PixelPoint) -> bool {
    if polygon.is_empty() {
        return false;
    }
    let mut is_inside = false;
    let mut nearest_px = f64::INFINITY;
    for (k, a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        if (a.v > pixel.v) != (b.v > pixel.v)
            && pixel.u < a.u + (pixel.v - a.v) / (b.v - a.v) * (b.u - a.u)
        {
            is_inside = !is_inside;
        }
        let (du, dv) = (b.u - a.u, b.v - a.v);
        let along = ((pixel.u - a.u) * du + (pixel.v - a.v) * dv) / (du * du + dv * dv);
        let share = if along.is_finite() {
            along.clamp(0.0, 1.0)
        } else {
            0.0
        };
        let foot = PixelPoint::new(a.u + share * du, a.v + share * dv);
        nearest_px = nearest_px.min(foot.distance_px(pixel));
    }
    // The corner of a pixel is that far from its center.
    is_inside || nearest_px <= 0.5 * std::f64::consts::SQRT_2 + 1e-9
}

/// The ideal lens to start from: where the axis is seen, and how fast pixels turn there.
fn base(model: &dyn CameraModel, sensor: SensorSize, coverage: &CoverageMask) -> Option<BaseLens> {
    let middles = coverage.covered_middles();
    let middle = sensor.center();
    let center = model
        .project(&Vector3::new(0.0, 0.0, ANY_DISTANCE_MM))
        .unwrap_or(middle);
    let angle = |pixel: PixelPoint| {
        let direction = model.ray(pixel)?.direction;
        Some(direction.xy().norm().atan2(direction.z))
    };
    let widest = middles
        .iter()
        .filter_map(|pixel| angle(*pixel))
        .fold(0.0, f64::max);
    // The mean over all cells: nothing depends on a pixel.
    let (mut radii, mut angles) = (0.0, 0.0);
    let is_wide = widest > PERSPECTIVE_UP_TO_RAD;
    for pixel in &middles {
        radii += pixel.distance_px(center);
        let angle = angle(*pixel)?;
        angles += if is_wide { angle } else { angle.tan() };
    }
    let focal_px = radii / angles;
    let projection = if is_wide {
        Projection::Equidistant
    } else {
        Projection::Perspective
    };
    let is_sound = focal_px > 0.0 && focal_px.is_finite();
    is_sound.then(|| BaseLens {
        center_px: [center.u - middle.u, center.v - middle.v],
        ..BaseLens::ideal(projection, focal_px)
    })
}

/// Pixels, and how far a field is off there, px.
type Errors = Vec<(PixelPoint, f64)>;

/// The field of a camera, and its errors over the calibrated area. The grid is refined until they are small.
fn field_of(
    camera: &ForeignCamera,
    coverage: &CoverageMask,
    distance_mm: Option<f64>,
) -> Option<(RayField, Errors)> {
    let (model, sensor) = (&*camera.model, camera.sensor);
    let base = base(model, sensor, coverage)?;
    let is_central = model.is_central();
    let distance_mm = distance_mm.unwrap_or(ANY_DISTANCE_MM);
    let [near_mm, far_mm] = if is_central {
        [distance_mm; 2]
    } else {
        [NEAR_SHARE * distance_mm, FAR_SHARE * distance_mm]
    };
    let sample = |spacing_px: f64| -> Vec<SampledRay> {
        lattice_around(coverage, spacing_px)
            .into_iter()
            .filter_map(|pixel| {
                Some(SampledRay {
                    pixel,
                    ray: model.ray(pixel)?,
                    near_mm,
                    far_mm,
                })
            })
            .collect()
    };
    let largest = |errors: &Errors| errors.iter().map(|(_, px)| *px).fold(0.0, f64::max);
    let mut found: Option<(RayField, Errors)> = None;
    for cells in CELLS {
        let cell_px = f64::from(sensor.width.max(sensor.height)) / cells;
        let settings = FromRaysSettings {
            cell_px,
            is_central,
        };
        let rays = sample(cell_px / SAMPLES_PER_CELL);
        let field = field_of_rays(sensor, base, &rays, &settings)?;
        let between = sample(0.75 * cell_px / SAMPLES_PER_CELL);
        let errors: Errors = between
            .iter()
            .filter(|ray| coverage.contains(ray.pixel))
            .map(|ray| {
                let error_px = ray_error_px(&field, ray);
                (ray.pixel, error_px.unwrap_or(f64::INFINITY))
            })
            .collect();
        let is_near = largest(&errors) <= NEAR_ENOUGH_PX;
        let is_nearest = found
            .as_ref()
            .is_none_or(|(_, before)| largest(&errors) < largest(before));
        if is_nearest {
            found = Some((field, errors));
        }
        if is_near {
            break;
        }
    }
    found
}
