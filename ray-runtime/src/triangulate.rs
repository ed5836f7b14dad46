//! Where rays meet: the midpoint of the common perpendicular, and least squares for more rays.
//!
//! Plain f32 multiplications and additions in a fixed order and one division for a pair, so that
//! every target gives the same bits.

use crate::vector::Vector;
use crate::{MeasureError, Ray};

/// Two rays closer to parallel than this sine have no usable intersection. The host's f64
/// triangulation uses the same number.
pub const MIN_PARALLAX_SIN: f32 = 2e-4;

const MIN_PARALLAX_SIN_SQUARED: f32 = MIN_PARALLAX_SIN * MIN_PARALLAX_SIN;

/// A triangulated point.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Triangulation {
    /// Rig frame, mm.
    pub point_mm: [f32; 3],
    /// Square of the gap, mm2. Two rays: the gap is the length of their common perpendicular.
    /// More rays: twice the RMS distance of the point from them, which is the same for two.
    pub gap_squared_mm2: f32,
}

impl Triangulation {
    /// The gap, mm.
    pub fn gap_mm(&self) -> f32 {
        libm::sqrtf(self.gap_squared_mm2)
    }
}

/// Midpoint of the common perpendicular of two rays.
///
/// # Errors
/// [`MeasureError::Parallel`] (also for rays that are not finite), [`MeasureError::Behind`].
pub fn triangulate_pair(a: &Ray, b: &Ray) -> Result<Triangulation, MeasureError> {
    Ok(meet(a, b)?.found)
}

/// Two rays' common perpendicular.
pub(crate) struct Meeting {
    /// Its middle and its length.
    pub found: Triangulation,
    /// Where it starts and ends: `origin + lambda * direction` of each ray.
    pub lambda: [f32; 2],
    /// Whether it leads from the first ray to the second along the product of the two directions.
    pub is_along_normal: bool,
    /// The product of the two directions, along it, and the inverse of its square.
    normal: Vector,
    inverse: f32,
}

impl Meeting {
    /// How the middle moves with shifts of the first ray, mm per mm: half of what goes out of the
    /// rays' plane, and along the other ray what goes within it. With the normal n it is
    /// `(n (n.shift) / 2 + d2 ((n x d1).shift)) / n.n`.
    pub fn by_shifts_of_first(&self, a: &Ray, b: &Ray, shifts: [Vector; 2]) -> [Vector; 2] {
        self.by_shifts(a.direction.into(), b.direction.into(), shifts)
    }

    /// The same with shifts of the second ray; exchanging the rays turns the normal round.
    pub fn by_shifts_of_second(&self, a: &Ray, b: &Ray, shifts: [Vector; 2]) -> [Vector; 2] {
        self.by_shifts(b.direction.into(), -Vector::from(a.direction), shifts)
    }

    /// How the gap, with its sign, moves with the pixels that move the middle like this, times half of
    /// the normal's length: a ray that goes out of the rays' plane takes the middle half of the way.
    pub fn gap_by_pixels(&self, by_first: &[Vector; 2], by_second: &[Vector; 2]) -> [f32; 4] {
        let [u1, v1] = by_first.map(|by| -self.normal.dot(by));
        let [u2, v2] = by_second.map(|by| self.normal.dot(by));
        [u1, v1, u2, v2]
    }

    /// What a square of [`gap_by_pixels`](Self::gap_by_pixels) is multiplied with.
    pub fn gap_scale(&self) -> f32 {
        4.0 * self.inverse
    }

    fn by_shifts(&self, own: Vector, other: Vector, shifts: [Vector; 2]) -> [Vector; 2] {
        let across = self.normal.cross(own);
        shifts.map(|shift| {
            let out_of_plane = self.normal * (0.5 * self.normal.dot(shift));
            (out_of_plane + other * across.dot(shift)) * self.inverse
        })
    }
}

/// Where two rays meet.
#[inline(always)]
pub(crate) fn meet(a: &Ray, b: &Ray) -> Result<Meeting, MeasureError> {
    let [o1, d1, o2, d2] = [a.origin_mm, a.direction, b.origin_mm, b.direction].map(Vector::from);
    let w = o2 - o1;
    let normal = d1.cross(d2);
    let normal_squared = normal.norm_squared();
    if !is_wide(normal_squared, d1, d2) {
        return Err(MeasureError::Parallel);
    }
    let inverse = 1.0 / normal_squared;
    let lambda1 = w.cross(d2).dot(normal) * inverse;
    let lambda2 = w.cross(d1).dot(normal) * inverse;
    if !(is_positive(lambda1) && is_positive(lambda2)) {
        return Err(MeasureError::Behind);
    }
    let along = w.dot(normal);
    Ok(Meeting {
        found: Triangulation {
            point_mm: (((o1 + d1 * lambda1) + (o2 + d2 * lambda2)) * 0.5).into(),
            gap_squared_mm2: along * along * inverse,
        },
        lambda: [lambda1, lambda2],
        is_along_normal: along >= 0.0,
        normal,
        inverse,
    })
}

/// Whether the sine between two directions is large enough; NaN counts as parallel.
fn is_wide(normal_squared: f32, d1: Vector, d2: Vector) -> bool {
    normal_squared > MIN_PARALLAX_SIN_SQUARED * (d1.norm_squared() * d2.norm_squared())
}

/// NaN is not positive.
fn is_positive(x: f32) -> bool {
    x > 0.0
}

/// The point nearest to `count` rays in the least-squares sense; `ray` gives each when asked, any
/// number of times, so that nothing needs to be stored.
///
/// Solved are the normal equations of the step from a point that two of the rays give: in f32,
/// solving for the point itself would lose the digits that a step keeps.
pub(crate) fn triangulate_many(
    count: usize,
    ray: impl Fn(usize) -> Result<Ray, MeasureError>,
) -> Result<Triangulation, MeasureError> {
    if count < 2 {
        return Err(MeasureError::TooFewRays { have: count });
    }
    if count == 2 {
        return triangulate_pair(&ray(0)?, &ray(1)?);
    }
    let mut point = start(count, &ray)?;
    for _ in 0..STEPS {
        point += step(count, &ray, point)?;
    }
    let mut distance_squared = 0.0;
    for k in 0..count {
        let ray = ray(k)?;
        let direction = Vector::from(ray.direction);
        let offset = point - ray.origin_mm.into();
        let along = offset.dot(direction);
        if !is_positive(along) {
            return Err(MeasureError::Behind);
        }
        let across = offset - direction * (along / direction.norm_squared());
        distance_squared += across.norm_squared();
    }
    Ok(Triangulation {
        point_mm: point.into(),
        gap_squared_mm2: 4.0 * distance_squared / count as f32,
    })
}

/// Steps on a linear problem: the second removes the round-off of the first.
const STEPS: usize = 2;

/// Where the widest pair of rays that has the first ray in it meets; if all of those are parallel,
/// where any other pair does.
fn start(
    count: usize,
    ray: &impl Fn(usize) -> Result<Ray, MeasureError>,
) -> Result<Vector, MeasureError> {
    // Every ray must exist before any is judged.
    for k in 0..count {
        ray(k)?;
    }
    for i in 0..count {
        let a = ray(i)?;
        let mut widest: Option<(f32, Ray)> = None;
        for k in i + 1..count {
            let b = ray(k)?;
            let [d1, d2] = [a.direction, b.direction].map(Vector::from);
            let normal_squared = d1.cross(d2).norm_squared();
            let sin_squared = normal_squared / d2.norm_squared();
            if is_wide(normal_squared, d1, d2)
                && widest.is_none_or(|(widest, _)| sin_squared > widest)
            {
                widest = Some((sin_squared, b));
            }
        }
        if let Some((_, b)) = widest {
            return Ok(nearest_of_pair(&a, &b));
        }
    }
    Err(MeasureError::Parallel)
}

/// Midpoint of two rays' common perpendicular, wherever it lies.
fn nearest_of_pair(a: &Ray, b: &Ray) -> Vector {
    let [o1, d1, o2, d2] = [a.origin_mm, a.direction, b.origin_mm, b.direction].map(Vector::from);
    let w = o2 - o1;
    let normal = d1.cross(d2);
    let inverse = 1.0 / normal.norm_squared();
    let lambda1 = w.cross(d2).dot(normal) * inverse;
    let lambda2 = w.cross(d1).dot(normal) * inverse;
    ((o1 + d1 * lambda1) + (o2 + d2 * lambda2)) * 0.5
}

/// The step from `point` to the least-squares point.
///
/// The 3x3 system is set up in axes of which the third lies along the first ray. If all rays are
/// nearly parallel, the third pivot is of the order of their angles squared: in these axes it is
/// a sum of small numbers, in the rig's it would be a difference of large ones.
fn step(
    count: usize,
    ray: &impl Fn(usize) -> Result<Ray, MeasureError>,
    point: Vector,
) -> Result<Vector, MeasureError> {
    let axes = axes_along(ray(0)?.direction.into());
    let in_axes = |a: Vector| Vector::new(axes[0].dot(a), axes[1].dot(a), axes[2].dot(a));
    // Upper triangle of the sum of the projections across the rays, and of what they project.
    let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = [0.0; 6];
    let mut right = Vector::ZERO;
    for k in 0..count {
        let ray = ray(k)?;
        let d = in_axes(ray.direction.into());
        let offset = in_axes(Vector::from(ray.origin_mm) - point);
        let inverse = 1.0 / d.norm_squared();
        xx += (d.y * d.y + d.z * d.z) * inverse;
        yy += (d.x * d.x + d.z * d.z) * inverse;
        zz += (d.x * d.x + d.y * d.y) * inverse;
        xy -= d.x * d.y * inverse;
        xz -= d.x * d.z * inverse;
        yz -= d.y * d.z * inverse;
        right += d.cross(offset.cross(d)) * inverse;
    }
    // Cholesky without square roots. The first ray alone makes the first two pivots at least 1.
    let (l_yx, l_zx) = (xy / xx, xz / xx);
    let pivot_y = yy - l_yx * xy;
    let rest_yz = yz - l_zx * xy;
    let l_zy = rest_yz / pivot_y;
    let pivot_z = zz - l_zx * xz - l_zy * rest_yz;
    if !is_positive(pivot_z) {
        return Err(MeasureError::Parallel);
    }
    let y = right.y - l_yx * right.x;
    let z = (right.z - l_zx * right.x - l_zy * y) / pivot_z;
    let y = y / pivot_y - l_zy * z;
    let x = right.x / xx - l_yx * y - l_zx * z;
    Ok(axes[0] * x + axes[1] * y + axes[2] * z)
}

/// Three unit vectors at right angles, the third along `direction`.
fn axes_along(direction: Vector) -> [Vector; 3] {
    let unit = |a: Vector| a * (1.0 / libm::sqrtf(a.norm_squared()));
    let along = unit(direction);
    let least_parallel = if along.x * along.x < 0.5 {
        Vector::new(1.0, 0.0, 0.0)
    } else {
        Vector::new(0.0, 1.0, 0.0)
    };
    let first = unit(along.cross(least_parallel));
    [first, along.cross(first), along]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
        Ray {
            origin_mm: origin,
            direction,
        }
    }

    fn many(rays: &[Ray]) -> Result<Triangulation, MeasureError> {
        triangulate_many(rays.len(), |k| Ok(rays[k]))
    }

    #[test]
    fn skew_lines_meet_midway_between_them() {
        // Along x at z = 0 and along y at z = 2: nearest at (1, 0, 0) and (1, 0, 2).
        let a = ray([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        let b = ray([1.0, -1.0, 2.0], [0.0, 3.0, 0.0]);
        let result = triangulate_pair(&a, &b).unwrap();
        assert_eq!(result.point_mm, [1.0, 0.0, 1.0]);
        assert_eq!(result.gap_squared_mm2, 4.0);
        assert_eq!(result.gap_mm(), 2.0);
    }

    #[test]
    fn the_middle_moves_as_shifts_of_its_rays_say() {
        let target = Vector::new(10.0, -20.0, 300.0);
        let rays = [[0.0, 0.0, 0.0], [100.0, 15.0, 7.0]]
            .map(|o| ray(o, (target - Vector::from(o)).into()));
        let meeting = meet(&rays[0], &rays[1]).unwrap();
        for axis in 0..3 {
            let mut shift = [0.0; 3];
            shift[axis] = 1.0;
            let shift = Vector::from(shift);
            let [by_a, _] = meeting.by_shifts_of_first(&rays[0], &rays[1], [shift; 2]);
            let [by_b, _] = meeting.by_shifts_of_second(&rays[0], &rays[1], [shift; 2]);
            for (shifted, by) in [(0, by_a), (1, by_b)] {
                let mut moved = rays;
                let origin_mm = Vector::from(moved[shifted].origin_mm) + shift;
                moved[shifted].origin_mm = origin_mm.into();
                let point_mm = triangulate_pair(&moved[0], &moved[1]).unwrap().point_mm;
                let change = Vector::from(point_mm) - meeting.found.point_mm.into();
                // The point is linear in the shift; 300 mm have steps of 3e-5 mm.
                assert!(
                    (by - change).norm_squared() < 9e-8,
                    "{shifted} {axis}: {by:?} {change:?}"
                );
            }
        }
    }

    #[test]
    fn parallel_behind_and_nan_are_refused() {
        let a = ray([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let parallel = ray([10.0, 0.0, 0.0], [0.0, 0.0, 2.0]);
        let diverging = ray([10.0, 0.0, 0.0], [0.1, 0.0, 1.0]);
        let third = ray([0.0, 10.0, 0.0], [0.0, 0.1, 1.0]);
        let nan = ray([0.0, 0.0, 0.0], [f32::NAN, 0.0, 1.0]);
        assert_eq!(triangulate_pair(&a, &parallel), Err(MeasureError::Parallel));
        assert_eq!(triangulate_pair(&a, &nan), Err(MeasureError::Parallel));
        assert_eq!(triangulate_pair(&a, &diverging), Err(MeasureError::Behind));
        assert_eq!(many(&[a, diverging, third]), Err(MeasureError::Behind));
        assert_eq!(many(&[a, parallel, a]), Err(MeasureError::Parallel));
        assert_eq!(many(&[a]), Err(MeasureError::TooFewRays { have: 1 }));
        assert_eq!(many(&[]), Err(MeasureError::TooFewRays { have: 0 }));
    }

    #[test]
    fn three_rays_through_one_point_meet_there() {
        let target = Vector::new(10.0, -20.0, 300.0);
        let rays = [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 80.0, 5.0]]
            .map(|o| ray(o, (target - Vector::from(o)).into()));
        let result = many(&rays).unwrap();
        // 300 mm in f32: 3e-5 mm a digit.
        assert!((Vector::from(result.point_mm) - target).norm_squared() < 1e-8);
        assert!(result.gap_mm() < 1e-4);
    }

    #[test]
    fn a_first_ray_parallel_to_all_others_does_not_hide_a_wide_pair() {
        // Against the first: 1.8e-4 to either side; against each other: 3.6e-4.
        let a = ray([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let b = ray([-1.0, 0.0, 0.0], [1.8e-4, 0.0, 1.0]);
        let c = ray([1.0, 0.0, 0.0], [-1.8e-4, 0.0, 1.0]);
        let [_, _, z] = many(&[a, b, c]).unwrap().point_mm;
        assert!((z - 5555.6).abs() < 5.0, "{z}");
    }
}
