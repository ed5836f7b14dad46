//! The splined stereographic camera of mrcal's nearest to the rays of each camera of a rig.
//!
//! Its axes are those of the nearest lens ([`super::nearest`]). What the stereographic projection leaves to the spline is linear in the knots, so
//! that one banded system has the answer. Knots that no ray touches go on evenly; nothing is asked of them.

use super::camera_rays::{CameraRays, samples};
use super::distortion::Distortion;
use super::error::ExchangeError;
use super::fit::Sample;
use super::line;
use super::loss::{Loss, LossMap, missed};
use super::model::{CameraModel, ImagePlane, Order, Splined, stereographic};
use super::nearest::{LOSS_PLACES, MAP_PLACES, nearest};
use calib_blob::rays::RaySource;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use calib_rays::numerics::banded_system::BandedSystem;
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};

/// Cells between knots along x, tried in turn.
const CELLS: [usize; 5] = [8, 12, 18, 27, 40];
/// More cells are taken where they leave at most this share of the loss ...
const WORTH_MORE: f64 = 0.8;
/// ... of more than this, RMS, px: a tenth of what the corners of a print are good for is a hundred times that.
const NEGLIGIBLE_PX: f64 = 1e-4;
/// Rays a cell along each axis, and at least so many along the longer side.
const RAYS_PER_CELL: u32 = 4;
const LEAST_ALONG: u32 = 65;
/// Weight of a second difference of knots against one ray ...
const EVEN: f64 = 1e-6;
/// ... and of a knot itself, so that there is one answer.
const SMALL: f64 = 1e-9;
/// How far the knots reach beyond the outermost ray, degrees.
const MARGIN_DEG: f64 = 0.5;
/// Knots beyond the last cell on each side together, and the least knots of a cubic.
const BEYOND: usize = 3;
const LEAST_KNOTS: usize = 4;
/// Half a step of differences, as a share of the distance.
const DIFFERENCE: f64 = 1e-5;

/// A camera as mrcal's splined stereographic one, of order 3.
#[derive(Debug, Clone, PartialEq)]
pub struct SplinedCamera {
    /// Unique in the rig.
    pub name: String,
    /// The sensor.
    pub sensor: SensorSize,
    /// `fx, fy, cx, cy`.
    pub core: [f64; 4],
    /// `Nx, Ny`.
    pub knots: [usize; 2],
    /// What the knots span along x, less a cell on each side; whole degrees.
    pub fov_x_deg: u32,
    /// x and y of each knot, row by row.
    pub shifts: Vec<f64>,
    /// Where it is.
    pub rig_from_camera: RigidTransform,
    /// What it loses.
    pub loss: Loss,
    /// Where on the sensor.
    pub map: LossMap,
}

/// The cameras of a rig as splined ones.
#[derive(Debug, Clone, PartialEq)]
pub struct SplinedCameras {
    /// In the rig's order.
    pub cameras: Vec<SplinedCamera>,
    /// Where on the rays they were fitted, mm from the camera.
    pub distance_mm: f64,
}

impl SplinedCamera {
    /// As a camera that sees points; `None` cannot happen to one that was fitted.
    pub fn model(&self) -> Option<Splined> {
        let plane = ImagePlane::new(self.core);
        Splined::new(
            plane,
            Order::Cubic,
            self.knots,
            f64::from(self.fov_x_deg),
            &self.shifts,
        )
    }
}

/// Fits a splined camera to each camera of a rig. Cost: some tenths of a second a camera.
///
/// # Errors
/// [`ExchangeError`].
pub fn nearest_splined(
    source: &dyn RaySource,
    distance_mm: f64,
) -> Result<SplinedCameras, ExchangeError> {
    let cameras = source.cameras();
    let fitted = cameras.iter().enumerate().map(|(camera_idx, camera)| {
        splined(&CameraRays::new(source, camera_idx, camera), distance_mm)
    });
    Ok(SplinedCameras {
        cameras: fitted.collect::<Result<_, _>>()?,
        distance_mm,
    })
}

/// Where the camera stands, and how it is turned.
fn frame(rays: &CameraRays<'_>, distance_mm: f64) -> Result<RigidTransform, ExchangeError> {
    let forms = [Distortion::Five, Distortion::Eight, Distortion::Equidistant];
    match nearest(rays, distance_mm, &forms) {
        Ok(found) => Ok(found.rig_from_pinhole),
        Err(ExchangeError::NoPinhole { .. }) => {
            // No lens comes near: along the mean of all rays.
            let (to_fit, center_mm) = rays.to_fit(LEAST_ALONG)?;
            let sum: Vector3<f64> = to_fit.iter().map(|(_, ray)| ray.direction).sum();
            let axis = sum
                .try_normalize(0.0)
                .ok_or_else(|| rays.no_lens("they go to all sides"))?;
            let across = Vector3::z().cross(&axis);
            let angle = across.norm().atan2(axis.z);
            let turn = across
                .try_normalize(0.0)
                .map_or_else(Matrix3::identity, |around| so3::exp(&(around * angle)));
            Ok(rays.rig_from_camera * RigidTransform::new(turn, center_mm))
        }
        Err(error) => Err(error),
    }
}

fn splined(rays: &CameraRays<'_>, distance_mm: f64) -> Result<SplinedCamera, ExchangeError> {
    let rig_from_camera = frame(rays, distance_mm)?;
    let own_from_field = rig_from_camera.inverse() * rays.rig_from_camera;
    let seen_on = |places: u32| -> Vec<Sample> {
        let seen = samples(&rays.on_lattice(places), distance_mm, &Vector3::zeros());
        let own = |(pixel, point): Sample| (pixel, own_from_field.point(&point));
        seen.into_iter().map(own).collect()
    };
    let compared_at = seen_on(LOSS_PLACES);
    let backwards = || rays.no_lens("one of them goes straight backwards");
    let places = places_of(&compared_at).ok_or_else(backwards)?;
    let core =
        core_of(&compared_at, &places).ok_or_else(|| rays.no_lens("the image is mirrored"))?;
    let reach = |axis: usize| {
        places
            .iter()
            .map(|place| place[axis].abs())
            .fold(0.0, f64::max)
    };
    let needed_deg = (4.0 * (reach(0) / 2.0).atan()).to_degrees() + 2.0 * MARGIN_DEG;
    let fov_x_deg = needed_deg.ceil().max(1.0);
    if fov_x_deg >= 360.0 {
        return Err(backwards());
    }
    let edge = 2.0 * (fov_x_deg.to_radians() / 4.0).tan();
    let mut best: Option<(SplinedCamera, Splined)> = None;
    for cells in CELLS {
        let density = cells as f64 / (2.0 * edge);
        let rows = (2.0 * (reach(1) * density + 1.0)).ceil() as usize + 2;
        let knots = [cells + BEYOND, rows.max(LEAST_KNOTS)];
        let fitted_at = seen_on((cells as u32 * RAYS_PER_CELL + 1).max(LEAST_ALONG));
        let places = places_of(&fitted_at).ok_or_else(backwards)?;
        let Some(shifts) = knot_shifts(core, knots, density, &fitted_at, &places) else {
            continue;
        };
        let plane = ImagePlane::new(core);
        let Some(model) = Splined::new(plane, Order::Cubic, knots, fov_x_deg, &shifts) else {
            continue;
        };
        let Some(loss) = Loss::of(&|point| see(&model, point), &compared_at) else {
            continue;
        };
        let before = best.as_ref().map(|(camera, _)| camera.loss.rms_px);
        let is_better = before
            .is_none_or(|before| before > NEGLIGIBLE_PX && loss.rms_px <= WORTH_MORE * before);
        if !is_better {
            break;
        }
        let name = rays.camera.name.clone();
        let lattice = rays.lattice(MAP_PLACES);
        let map = LossMap::new(name.clone(), &rig_from_camera, lattice, |pixel| {
            let ray = rays.ray(pixel)?;
            let point = own_from_field.point(&(ray.origin_mm + ray.direction * distance_mm));
            missed(&|point| see(&model, point), &(pixel, point))
        });
        let camera = SplinedCamera {
            name,
            sensor: rays.camera.sensor,
            core,
            knots,
            fov_x_deg: fov_x_deg as u32,
            shifts,
            rig_from_camera,
            loss,
            map,
        };
        best = Some((camera, model));
    }
    let (camera, _) = best.ok_or_else(|| rays.no_lens("the image folds back"))?;
    Ok(camera)
}

/// The stereographic places of points.
fn places_of(samples: &[Sample]) -> Option<Vec<Vector2<f64>>> {
    samples
        .iter()
        .map(|(_, point)| stereographic::place(point))
        .collect()
}

/// Focal lengths and principal point of the plain projection that comes nearest; `None` for a mirrored image.
fn core_of(samples: &[Sample], places: &[Vector2<f64>]) -> Option<[f64; 4]> {
    let along = |axis: usize, px: fn(&PixelPoint) -> f64| {
        let both = places.iter().zip(samples);
        line::rising(both.map(|(place, (pixel, _))| (place[axis], px(pixel))))
    };
    let ((fx, cx), (fy, cy)) = (along(0, |pixel| pixel.u)?, along(1, |pixel| pixel.v)?);
    Some([fx, fy, cx, cy])
}

/// The knots by linear least squares over pixels.
fn knot_shifts(
    [fx, fy, cx, cy]: [f64; 4],
    [nx, ny]: [usize; 2],
    density: f64,
    samples: &[Sample],
    places: &[Vector2<f64>],
) -> Option<Vec<f64>> {
    let mut system = BandedSystem::new(nx * ny, 3 * nx + 3);
    for ((pixel, _), place) in samples.iter().zip(places) {
        let (i, along_x) = Splined::cubic_weights(place.x, nx, density)?;
        let (j, along_y) = Splined::cubic_weights(place.y, ny, density)?;
        let terms: [(usize, f64); 16] = std::array::from_fn(|k| {
            let (row, column) = (k / 4, k % 4);
            ((j + row) * nx + i + column, along_y[row] * along_x[column])
        });
        let wanted = [(pixel.u - cx) / fx - place.x, (pixel.v - cy) / fy - place.y];
        system.add_square(&terms, [wanted[0], wanted[1], 0.0, 0.0], 1.0);
    }
    for row in 0..ny {
        for column in 0..nx {
            let at = row * nx + column;
            system.add_square(&[(at, 1.0)], [0.0; 4], SMALL);
            for (is_inside, step) in [(column + 2 < nx, 1), (row + 2 < ny, nx)] {
                if is_inside {
                    let second = [(at, 1.0), (at + step, -2.0), (at + 2 * step, 1.0)];
                    system.add_square(&second, [0.0; 4], EVEN);
                }
            }
        }
    }
    let found = system.solve()?;
    Some(found.iter().flat_map(|[x, y, ..]| [*x, *y]).collect())
}

/// Where the camera sees a point, and how that moves with it, by differences.
fn see(model: &Splined, point: &Vector3<f64>) -> Option<(PixelPoint, Matrix2x3<f64>)> {
    let pixel = model.project(point)?;
    let half = DIFFERENCE * point.norm();
    let mut by_point = Matrix2x3::zeros();
    for axis in 0..3 {
        let at = |by: f64| {
            let mut moved = *point;
            moved[axis] += by;
            model.project(&moved)
        };
        let (more, less) = (at(half)?, at(-half)?);
        let slope = Vector2::new(more.u - less.u, more.v - less.v) / (2.0 * half);
        by_point.set_column(axis, &slope);
    }
    Some((pixel, by_point))
}
