//! From a point to the pixel that sees it, and where in another camera a pixel's ray appears.
//!
//! Nothing is stored for it: Newton's method on the lookup, whose derivative says how far a ray misses
//! the point moves with the pixel. Plain f32 in a fixed order and one division a step: every target
//! gives the same bits. Whoever does not call it has none of it linked.

use crate::format::Record;
use crate::lookup::{self, MovingRay, Views};
use crate::vector::Vector;
use crate::{MeasureError, PixelPoint, ProjectError, Ray, RayBlob};

/// Nodes along each axis of the region that are looked at for a start.
const START_NODES: u16 = 5;
/// Steps from one start: half a dozen are usual, more are needed from far off.
const MAX_STEPS: usize = 20;
/// A step shorter than this is the last: the next one would be of the size of its square, px.
const LAST_STEP_PX: f32 = 1.0 / 256.0;
/// The longest step, as a share of the region: a derivative does not hold much further.
const LONGEST_STEP: f32 = 0.25;

impl RayBlob<'_> {
    /// The pixel of a camera that sees a point (rig frame, mm), to some 0.001 px: round-off of f32 and no
    /// more.
    ///
    /// It costs about 25 lookups for a start and some ten for each of about six steps
    /// ([`project_near`](Self::project_near) saves the start).
    ///
    /// # Errors
    /// [`ProjectError::Unseen`] if no calibrated pixel sees the point, or none was found;
    /// [`ProjectError::NoSuchCamera`].
    pub fn project(&self, camera: usize, point_mm: [f32; 3]) -> Result<PixelPoint, ProjectError> {
        let point_mm = point_mm.into();
        let field = self.field(camera)?;
        let start = field.start(point_mm).ok_or(ProjectError::Unseen)?;
        field.refined(point_mm, start)
    }

    /// The same from a pixel nearby, such as that of the frame before; one further off may do, or not.
    ///
    /// # Errors
    /// Those of [`project`](Self::project).
    pub fn project_near(
        &self,
        camera: usize,
        point_mm: [f32; 3],
        start: PixelPoint,
    ) -> Result<PixelPoint, ProjectError> {
        let field = self.field(camera)?;
        field.refined(point_mm.into(), field.clamped(start))
    }

    /// Where the ray of a pixel appears in another camera: the pixels of points on it, from `far_mm` to
    /// `near_mm` along the ray, `count` of them at equal steps of the inverse distance, which are about
    /// equal steps in the image. Points that the other camera does not see are left out.
    ///
    /// # Errors
    /// [`MeasureError::Outside`] and [`MeasureError::NoSuchCamera`] of the pixel or the other camera.
    /// Distances that are not above zero make an empty curve.
    pub fn epipolar_curve(
        &self,
        (camera, pixel): (usize, PixelPoint),
        other: usize,
        [near_mm, far_mm]: [f32; 2],
        count: u16,
    ) -> Result<EpipolarCurve<'_>, MeasureError> {
        let of_lookup = |error, camera| MeasureError::of_lookup(error, camera);
        let ray = self
            .lookup(camera, pixel)
            .map_err(|error| of_lookup(error, camera))?;
        let record = self
            .record(other)
            .map_err(|error| of_lookup(error, other))?;
        let is_distance = |mm: f32| mm > 0.0 && mm.is_finite();
        let is_range = is_distance(near_mm) && is_distance(far_mm);
        let length = libm::sqrtf(Vector::from(ray.direction).norm_squared());
        let inverse = |mm: f32| length / mm;
        let steps = f32::from(count.saturating_sub(1).max(1));
        Ok(EpipolarCurve {
            field: Field {
                views: self.views(),
                record,
            },
            ray,
            far: inverse(far_mm),
            step: (inverse(near_mm) - inverse(far_mm)) * (1.0 / steps),
            last: None,
            next: 0,
            count: if is_range { count } else { 0 },
        })
    }

    fn field(&self, camera: usize) -> Result<Field<'_>, ProjectError> {
        Ok(Field {
            views: self.views(),
            record: self.record(camera)?,
        })
    }
}

/// A point of an [`EpipolarCurve`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EpipolarPoint {
    /// Where the other camera sees it.
    pub pixel: PixelPoint,
    /// The point itself, rig frame, mm.
    pub point_mm: [f32; 3],
}

/// The image of a ray in another camera ([`RayBlob::epipolar_curve`]), from far to near.
#[derive(Debug, Clone)]
pub struct EpipolarCurve<'a> {
    field: Field<'a>,
    ray: Ray,
    /// Inverse of the last lambda, and its step.
    far: f32,
    step: f32,
    last: Option<PixelPoint>,
    next: u16,
    count: u16,
}

impl Iterator for EpipolarCurve<'_> {
    type Item = EpipolarPoint;

    fn next(&mut self) -> Option<EpipolarPoint> {
        while self.next < self.count {
            let lambda = 1.0 / (self.far + f32::from(self.next) * self.step);
            self.next += 1;
            let point_mm =
                Vector::from(self.ray.origin_mm) + Vector::from(self.ray.direction) * lambda;
            let start = self.last.or_else(|| self.field.start(point_mm));
            let found = start.and_then(|start| self.field.refined(point_mm, start).ok());
            self.last = found;
            if let Some(pixel) = found {
                let point_mm = point_mm.into();
                return Some(EpipolarPoint { pixel, point_mm });
            }
        }
        None
    }
}

/// One camera of a blob.
#[derive(Debug, Clone, Copy)]
struct Field<'a> {
    views: Views<'a>,
    record: Record<'a>,
}

impl Field<'_> {
    /// The calibrated node of a coarse lattice whose ray passes the point under the smallest angle.
    fn start(&self, point_mm: Vector) -> Option<PixelPoint> {
        let mut best: Option<(f32, PixelPoint)> = None;
        for j in 0..START_NODES {
            for i in 0..START_NODES {
                let pixel = PixelPoint::new(
                    self.record.axis_u().at_share(node_share(i)),
                    self.record.axis_v().at_share(node_share(j)),
                );
                let Ok(ray) = self.views.lookup(self.record, pixel) else {
                    continue;
                };
                let direction = Vector::from(ray.direction);
                let along = (point_mm - ray.origin_mm.into()).dot(direction);
                // The cosine's square, with its sign, times the square of a length that hardly changes.
                let closeness = along * libm::fabsf(along) / direction.norm_squared();
                if best.is_none_or(|(most, _)| closeness > most) {
                    best = Some((closeness, pixel));
                }
            }
        }
        best.map(|(_, pixel)| pixel)
    }

    fn refined(&self, point_mm: Vector, start: PixelPoint) -> Result<PixelPoint, ProjectError> {
        let mut pixel = start;
        for _ in 0..MAX_STEPS {
            let ray = self.views.lookup_moving(self.record, pixel)?;
            let [du, dv] = step(&ray, point_mm).ok_or(ProjectError::Unseen)?;
            let next = self.clamped(PixelPoint::new(
                pixel.u + limited(du, self.record.axis_u().extent_px()),
                pixel.v + limited(dv, self.record.axis_v().extent_px()),
            ));
            pixel = next;
            if libm::fabsf(du) < LAST_STEP_PX && libm::fabsf(dv) < LAST_STEP_PX {
                let is_seen = lookup::is_calibrated(self.views.bytes, self.record, pixel);
                return is_seen.then_some(pixel).ok_or(ProjectError::Unseen);
            }
        }
        Err(ProjectError::Unseen)
    }

    /// The nearest pixel of the region; its middle for what is not a number.
    fn clamped(&self, pixel: PixelPoint) -> PixelPoint {
        PixelPoint::new(
            self.record.axis_u().clamped(pixel.u),
            self.record.axis_v().clamped(pixel.v),
        )
    }
}

/// A node's place on its axis: in the middle of its part.
fn node_share(index: u16) -> f32 {
    (f32::from(index) + 0.5) / f32::from(START_NODES)
}

/// The step, but no longer than a share of the region.
fn limited(step_px: f32, extent_px: f32) -> f32 {
    let longest = LONGEST_STEP * extent_px;
    if step_px > longest {
        longest
    } else if step_px < -longest {
        -longest
    } else {
        step_px
    }
}

/// The step of the pixel that brings the ray to the point, by least squares across the ray; `None` for
/// a point behind the camera, and where neighboring pixels see the same.
fn step(moving: &MovingRay, point_mm: Vector) -> Option<[f32; 2]> {
    let direction = Vector::from(moving.ray.direction);
    let w = point_mm - moving.ray.origin_mm.into();
    let inverse = 1.0 / direction.norm_squared();
    let lambda = w.dot(direction) * inverse;
    if !(lambda > 0.0) {
        return None;
    }
    let missed = w - direction * lambda;
    let [by_u, by_v] = moving
        .shifts_at(lambda)
        .map(|shift| shift - direction * (shift.dot(direction) * inverse));
    let (uu, uv, vv) = (by_u.dot(by_u), by_u.dot(by_v), by_v.dot(by_v));
    let (u, v) = (by_u.dot(missed), by_v.dot(missed));
    let determinant = uu * vv - uv * uv;
    // NaN is not above anything.
    if !(determinant > 1e-6 * (uu * vv)) {
        return None;
    }
    let inverse = 1.0 / determinant;
    Some([(vv * u - uv * v) * inverse, (uu * v - uv * u) * inverse])
}
