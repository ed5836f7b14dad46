//! The pixel that sees a point: the search over pixels whose ray passes through it.
//!
//! One search serves every kind of optics, so a new kind needs only its rays.

use calib_rays::geometry::{PixelPoint, Ray, SensorSize};
use nalgebra::{Matrix2, Vector2, Vector3};

/// Cells of the start lattice along the sensor's width and height.
const LATTICE: (u32, u32) = (32, 24);
/// A step below this ends the search, px. What remains after it is far smaller, for Newton's last
/// steps are quadratic; 1e-11 px is about the round-off of a ray at half a meter.
const STEP_PX: f64 = 2e-11;

/// A sensor whose pixels have rays.
pub(super) trait Rays {
    /// Size of the sensor.
    fn sensor(&self) -> SensorSize;

    /// See [`super::CameraOptics::ray`].
    fn ray(&self, pixel: PixelPoint) -> Option<Ray>;
}

/// Rays of a lattice over the sensor, its edges included; pixels without a ray are left out.
pub(super) fn start_lattice(camera: &impl Rays) -> Vec<(PixelPoint, Ray)> {
    let sensor = camera.sensor();
    let (nu, nv) = LATTICE;
    let mut lattice = Vec::new();
    for j in 0..=nv {
        for i in 0..=nu {
            let pixel = PixelPoint::new(
                f64::from(sensor.width) * f64::from(i) / f64::from(nu) - 0.5,
                f64::from(sensor.height) * f64::from(j) / f64::from(nv) - 0.5,
            );
            if let Some(ray) = camera.ray(pixel) {
                lattice.push((pixel, ray));
            }
        }
    }
    lattice
}

/// Solves `ray(pixel)` through `point`; `None` if the search leaves the optics' domain.
pub(super) fn solve(
    camera: &impl Rays,
    lattice: &[(PixelPoint, Ray)],
    point: &Vector3<f64>,
) -> Option<PixelPoint> {
    let (start, start_ray) = nearest(lattice, point)?;
    let miss = Miss::new(&start_ray, *point);
    let width = f64::from(camera.sensor().width);
    let max_step = width / 8.0;
    let mut pixel = start;
    let mut residual = miss.of(&start_ray)?;
    let mut jacobian_inverse = None;
    for _ in 0..60 {
        let inverse = match jacobian_inverse {
            Some(inverse) => inverse,
            None => miss.jacobian(camera, pixel)?.try_inverse()?,
        };
        let mut step: Vector2<f64> = -(inverse * residual);
        if step.norm() > max_step {
            step *= max_step / step.norm();
        }
        let (next, next_residual) = accept(camera, &miss, pixel, step, residual.norm())?;
        let moved = next.distance_px(pixel);
        pixel = next;
        residual = next_residual;
        if moved < STEP_PX {
            return Some(pixel);
        }
        // Close to the end the Jacobian no longer changes; the frozen one still gains three
        // digits and more per step.
        jacobian_inverse = (moved < 1e-2).then_some(inverse);
    }
    None
}

/// Takes the step, halved as long as it leaves the domain or makes things worse.
fn accept(
    camera: &impl Rays,
    miss: &Miss,
    from: PixelPoint,
    step: Vector2<f64>,
    residual_norm: f64,
) -> Option<(PixelPoint, Vector2<f64>)> {
    let mut scale = 1.0;
    for _ in 0..30 {
        let to = PixelPoint::new(from.u + scale * step.x, from.v + scale * step.y);
        if let Some(residual) = camera.ray(to).and_then(|ray| miss.of(&ray)) {
            // At round-off the residual trembles and may grow by a hair.
            if residual.norm() < residual_norm || scale * step.norm() < 1e-8 {
                return Some((to, residual));
            }
        }
        scale /= 2.0;
    }
    None
}

/// The lattice pixel whose ray points best at the point.
fn nearest(lattice: &[(PixelPoint, Ray)], point: &Vector3<f64>) -> Option<(PixelPoint, Ray)> {
    // Directions have unit length; where rays are parallel the offset decides, so the measure is
    // the distance from the ray over the distance from its origin.
    let measure = |ray: &Ray| {
        let to_point = point - ray.origin_mm;
        let along = to_point.dot(&ray.direction);
        if along > 0.0 {
            ray.direction.cross(&to_point).norm_squared() / to_point.norm_squared()
        } else {
            f64::INFINITY
        }
    };
    lattice
        .iter()
        .map(|entry| (measure(&entry.1), entry))
        .filter(|(sine_squared, _)| sine_squared.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, entry)| *entry)
}

/// By how much a ray misses a point, in the plane through the point across the start ray, mm.
struct Miss {
    point: Vector3<f64>,
    normal: Vector3<f64>,
    e1: Vector3<f64>,
    e2: Vector3<f64>,
}

impl Miss {
    fn new(start: &Ray, point: Vector3<f64>) -> Self {
        let normal = (point - start.origin_mm).normalize();
        let helper = if normal.x.abs() < 0.7 {
            Vector3::x()
        } else {
            Vector3::y()
        };
        let e1 = normal.cross(&helper).normalize();
        let e2 = normal.cross(&e1);
        Self {
            point,
            normal,
            e1,
            e2,
        }
    }

    fn of(&self, ray: &Ray) -> Option<Vector2<f64>> {
        let cos = ray.direction.dot(&self.normal);
        if cos.is_nan() || cos <= 1e-3 {
            return None;
        }
        let to_point = ray.origin_mm - self.point;
        let miss = to_point - ray.direction * (to_point.dot(&self.normal) / cos);
        Some(Vector2::new(miss.dot(&self.e1), miss.dot(&self.e2)))
    }

    /// Derivative by the pixel, mm per px, by central differences (its error only slows the
    /// search, it does not move the solution).
    fn jacobian(&self, camera: &impl Rays, at: PixelPoint) -> Option<Matrix2<f64>> {
        const H_PX: f64 = 0.01;
        let column = |du: f64, dv: f64| {
            let sample = |sign: f64| {
                let pixel = PixelPoint::new(at.u + sign * du, at.v + sign * dv);
                camera.ray(pixel).and_then(|ray| self.of(&ray))
            };
            match (sample(1.0), sample(-1.0)) {
                (Some(plus), Some(minus)) => Some((plus - minus) / (2.0 * H_PX)),
                // At the border of the image circle one side is missing.
                (Some(plus), None) => Some((plus - sample(0.0)?) / H_PX),
                (None, Some(minus)) => Some((sample(0.0)? - minus) / H_PX),
                (None, None) => None,
            }
        };
        Some(Matrix2::from_columns(&[
            column(H_PX, 0.0)?,
            column(0.0, H_PX)?,
        ]))
    }
}
