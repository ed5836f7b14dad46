//! Which pixel of a camera sees a point, from its rays alone: a blob and a calibration are asked alike, and nothing but calibrated pixels
//! is found.
//!
//! [`calib_rays::field::RayField::project`] does it for one point from nowhere, at a hundred lookups; a mesh or a map asks for a million points,
//! near a guess, at some four to six lookups each.

use calib_blob::rays::RaySource;
use calib_rays::geometry::{PixelPoint, Ray, SensorSize};
use nalgebra::{Matrix2, Vector2, Vector3};

/// Places along the longer side of the sensor among which a start is picked.
const START_PLACES: f64 = 24.0;
const STEPS: usize = 24;
/// So many steps are taken with the slope of a neighbor.
const STEPS_WITH_OLD_SLOPE: usize = 3;
/// Longest step, as a share of the sensor's longer side.
const LONGEST_STEP_SHARE: f64 = 0.25;
/// A step shorter than this is the last, px ...
const SETTLED_PX: f64 = 1e-7;
/// ... or this, after some: a blob's rays have the round-off of f32.
const ROUND_OFF_PX: f64 = 2e-3;
/// A step that leaves the calibrated area is halved so often ...
const HALVINGS: usize = 6;
/// ... and after so many such steps the point counts as unseen.
const MOST_CUT_STEPS: usize = 10;
/// The slope is taken over this distance, px.
const SLOPE_PX: f64 = 0.5;

/// A camera of a rig as one that sees points.
pub(super) struct Sight<'a> {
    source: &'a dyn RaySource,
    camera_idx: usize,
    longest_px: f64,
    starts: Vec<(PixelPoint, Ray)>,
}

/// A point to be seen, and a plane through it across the line of sight.
pub(super) struct Target {
    point_mm: Vector3<f64>,
    across: [Vector3<f64>; 2],
    along: Vector3<f64>,
}

/// The pixel that sees a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub pixel: PixelPoint,
    /// How far the ray moves beside the point with the pixel, mm/px.
    pub slope: Matrix2<f64>,
}

impl Target {
    /// The point as seen from a place nearby.
    pub fn new(point_mm: Vector3<f64>, from_mm: &Vector3<f64>) -> Self {
        let along = (point_mm - from_mm).normalize();
        let least = along.iamin();
        let other = Vector3::from_fn(|k, _| if k == least { 1.0 } else { 0.0 });
        let first = along.cross(&other).normalize();
        Self {
            point_mm,
            across: [first, along.cross(&first)],
            along,
        }
    }
}

impl<'a> Sight<'a> {
    pub fn new(source: &'a dyn RaySource, camera_idx: usize, sensor: SensorSize) -> Self {
        let longest = f64::from(sensor.width.max(sensor.height));
        let along = |length: u32| {
            let count = (f64::from(length) / longest * START_PLACES).ceil();
            (0..count as u32).map(move |k| (f64::from(k) + 0.5) / count * f64::from(length) - 0.5)
        };
        let starts = along(sensor.height)
            .flat_map(|v| along(sensor.width).map(move |u| PixelPoint::new(u, v)))
            .filter_map(|pixel| Some((pixel, source.ray(camera_idx, pixel)?)))
            .collect();
        Self {
            source,
            camera_idx,
            longest_px: LONGEST_STEP_SHARE * longest,
            starts,
        }
    }

    /// The calibrated pixel that sees a point; `None` if there is none, or none was found. `near` is a guess, `slope` that of
    /// a neighbor.
    pub fn seen(
        &self,
        target: &Target,
        near: Option<PixelPoint>,
        slope: Option<Matrix2<f64>>,
    ) -> Option<Seen> {
        near.and_then(|near| self.refined(target, near, slope))
            .or_else(|| self.refined(target, self.start(target)?, None))
    }

    /// The place whose ray passes under the smallest angle.
    fn start(&self, target: &Target) -> Option<PixelPoint> {
        let closeness = |ray: &Ray| {
            let seen = target.point_mm - ray.origin_mm;
            seen.dot(&ray.direction) / seen.norm()
        };
        self.starts
            .iter()
            .map(|(pixel, ray)| (closeness(ray), *pixel))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, pixel)| pixel)
    }

    /// By how much the ray of a pixel misses, in the plane across, mm.
    fn missed(&self, target: &Target, pixel: PixelPoint) -> Option<Vector2<f64>> {
        let ray = self.source.ray(self.camera_idx, pixel)?;
        let lambda =
            (target.point_mm - ray.origin_mm).dot(&target.along) / ray.direction.dot(&target.along);
        if !(lambda > 0.0) {
            return None;
        }
        let by = ray.origin_mm + ray.direction * lambda - target.point_mm;
        let [x, y] = &target.across;
        Some(Vector2::new(x.dot(&by), y.dot(&by)))
    }

    fn slope(
        &self,
        target: &Target,
        pixel: PixelPoint,
        missed: &Vector2<f64>,
    ) -> Option<Matrix2<f64>> {
        let column = |du: f64, dv: f64| {
            [1.0, -1.0].into_iter().find_map(|sign| {
                let beside = PixelPoint::new(pixel.u + sign * du, pixel.v + sign * dv);
                Some((self.missed(target, beside)? - missed) * (sign / SLOPE_PX))
            })
        };
        Some(Matrix2::from_columns(&[
            column(SLOPE_PX, 0.0)?,
            column(0.0, SLOPE_PX)?,
        ]))
    }

    fn refined(
        &self,
        target: &Target,
        near: PixelPoint,
        slope: Option<Matrix2<f64>>,
    ) -> Option<Seen> {
        let mut pixel = near;
        let mut missed = self.missed(target, pixel)?;
        let mut slope = match slope {
            Some(slope) => slope,
            None => self.slope(target, pixel, &missed)?,
        };
        let mut cut_steps = 0;
        for k in 0..STEPS {
            if k >= STEPS_WITH_OLD_SLOPE {
                slope = self.slope(target, pixel, &missed)?;
            }
            let mut step: Vector2<f64> = -(slope.try_inverse()? * missed);
            if !step.norm().is_finite() {
                return None;
            }
            if step.norm() > self.longest_px {
                step *= self.longest_px / step.norm();
            }
            let mut halvings = 0;
            loop {
                let next = PixelPoint::new(pixel.u + step.x, pixel.v + step.y);
                if let Some(by) = self.missed(target, next) {
                    (pixel, missed) = (next, by);
                    break;
                }
                if halvings == HALVINGS {
                    return None;
                }
                halvings += 1;
                step *= 0.5;
            }
            if halvings > 0 {
                cut_steps += 1;
                if cut_steps == MOST_CUT_STEPS {
                    return None;
                }
                continue;
            }
            let settled_px = if k <= STEPS_WITH_OLD_SLOPE {
                SETTLED_PX
            } else {
                ROUND_OFF_PX
            };
            if step.norm() < settled_px {
                return Some(Seen { pixel, slope });
            }
        }
        None
    }
}
