//! A ray field from sampled rays: how cameras that know their rays by other means (a distortion
//! model, a line per pixel) become the type that everything else works with.
//!
//! Direction and offset are splines on one grid. Their errors are coupled: of a ray that is known
//! between two distances, only where it passes there matters, and an error of the offset that an
//! error of the direction makes good counts for nothing. So each ray gives two equations per
//! component, one for each of its two distances, and both splines are found together.

use super::knot_order::KnotOrder;
use super::spline::{Spline, SplineGrid};
use super::{BaseLens, CoverageMask, RayField, SmoothMap, transport};
use crate::geometry::{PixelPoint, Ray, SensorSize};
use crate::numerics::banded_system::BandedSystem;
use nalgebra::{Vector2, Vector3};

/// A pixel, and the ray that it sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledRay {
    /// The pixel.
    pub pixel: PixelPoint,
    /// Camera frame, mm; any point of the line may be its origin.
    pub ray: Ray,
    /// Distance from the camera's reference point from which on the ray is known, mm.
    pub near_mm: f64,
    /// Distance up to which it is known, mm; above [`Self::near_mm`] unless the field is central.
    pub far_mm: f64,
}

/// What field is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FromRaysSettings {
    /// Spacing of the splines' knots, about, px. A cubic spline's error falls with its fourth power.
    pub cell_px: f64,
    /// Whether all rays are to meet in the reference point; the rays' offsets are ignored then.
    pub is_central: bool,
}

/// Weight of the thin-plate energy of the knots, in half-angle vectors (rad) against errors of
/// direction (rad). It decides what no ray decides, off the sampled area; within it, a spline that
/// bends by b per cell is off by some 1e-9 b.
const THIN_PLATE_WEIGHT: f64 = 1e-9;

/// The field nearest to some rays: base lens plus splines, least squares of where rays pass at their
/// two distances, as angles. Where no ray was sampled it goes on as it was bent last.
///
/// `None` if a ray points straight backwards or has no length, if a distance is not above zero, if
/// rays with offsets have no extent, or if there are too few rays to decide anything.
///
/// Cost: one banded system of 2 unknowns per knot (1 if central), some 10 ms for 24 x 20 cells.
pub fn field_of_rays(
    sensor: SensorSize,
    base: BaseLens,
    rays: &[SampledRay],
    settings: &FromRaysSettings,
) -> Option<RayField> {
    let usable = sensor.width > 0 && sensor.height > 0 && settings.cell_px > 0.0;
    if !usable || rays.is_empty() {
        return None;
    }
    let components = if settings.is_central { 1 } else { 2 };
    let grid = SplineGrid::with_spacing(sensor, settings.cell_px);
    let order = KnotOrder::new(grid);
    let unit_mm = offset_unit_mm(rays)?;
    let mut system = BandedSystem::new(
        components * order.knot_count(),
        order.half_bandwidth(components),
    );
    for stencil in order.thin_plate() {
        let weight = stencil.weight * THIN_PLATE_WEIGHT;
        for component in 0..components {
            let mut terms = [(0, 0.0); 4];
            let count = stencil.terms().len();
            for (term, (place, factor)) in terms.iter_mut().zip(stencil.terms()) {
                *term = (components * place + component, *factor);
            }
            system.add_square(&terms[..count], [0.0; 4], weight);
        }
    }
    let ideal = RayField::ideal(sensor, base, 0);
    for sampled in rays {
        add_ray(&mut system, &order, &ideal, sampled, settings, unit_mm)?;
    }
    let solution = system.solve()?;
    let spline = |component: usize, unit: f64| Spline {
        grid,
        coefficients: (0..order.knot_count())
            .map(|number| {
                let [u, v, ..] = solution[components * order.from_row_major(number) + component];
                Vector2::new(u, v) * unit
            })
            .collect(),
    };
    let map = |spline: Spline| SmoothMap {
        spline: Some(spline),
        ..SmoothMap::zero(0)
    };
    Some(RayField {
        direction: map(spline(0, 1.0)),
        offset: (!settings.is_central).then(|| map(spline(1, unit_mm))),
        ..ideal
    })
}

/// The unit of the offsets' unknowns: a distance that makes them count like angles. `None` if the
/// distances are none.
fn offset_unit_mm(rays: &[SampledRay]) -> Option<f64> {
    let mut sum = 0.0;
    for ray in rays {
        if !(ray.near_mm > 0.0 && ray.far_mm >= ray.near_mm && ray.far_mm.is_finite()) {
            return None;
        }
        sum += ray.near_mm;
    }
    Some(sum / rays.len() as f64)
}

/// Two rows for a ray (one if central): at a distance lambda, a change of s moves the ray across
/// itself by `lambda kappa ds`, kappa = 4 / (4 + |s|^2), and a change of m by itself. Both are
/// divided by lambda.
fn add_ray(
    system: &mut BandedSystem,
    order: &KnotOrder,
    ideal: &RayField,
    sampled: &SampledRay,
    settings: &FromRaysSettings,
    unit_mm: f64,
) -> Option<()> {
    let s = transport::half_angle(&sampled.ray.direction)?;
    let m_mm = transport::across(&s).tr_mul(&sampled.ray.foot_point(&Vector3::zeros()));
    let wanted = s - ideal.sample(sampled.pixel).s;
    let kappa = 4.0 / (4.0 + s.norm_squared());
    let grid = order.grid();
    let knots = order.around(
        &grid.weights_u(sampled.pixel.u),
        &grid.weights_v(sampled.pixel.v),
    );
    if !(wanted.norm() + m_mm.norm()).is_finite() {
        return None;
    }
    if settings.is_central {
        let terms = knots.map(|(place, weight)| (place, kappa * weight));
        let value = wanted * kappa;
        system.add_square(&terms, [value.x, value.y, 0.0, 0.0], 1.0);
        return Some(());
    }
    for lambda_mm in [sampled.near_mm, sampled.far_mm] {
        let value = wanted * kappa + m_mm / lambda_mm;
        let mut terms = [(0, 0.0); 32];
        for (pair, (place, weight)) in terms.chunks_exact_mut(2).zip(knots) {
            pair[0] = (2 * place, kappa * weight);
            pair[1] = (2 * place + 1, unit_mm / lambda_mm * weight);
        }
        system.add_square(&terms, [value.x, value.y, 0.0, 0.0], 1.0);
    }
    Some(())
}

/// An even lattice of pixels over the calibrated cells and their neighbors, for sampling rays. Pixels
/// off the sensor are not in it.
pub fn lattice_around(coverage: &CoverageMask, spacing_px: f64) -> Vec<PixelPoint> {
    let (width_px, height_px) = coverage.cell_size_px();
    let sensor = coverage.sensor;
    let is_near = |pixel: PixelPoint| {
        [-1.0, 0.0, 1.0].into_iter().any(|j| {
            [-1.0, 0.0, 1.0].into_iter().any(|i| {
                let near = PixelPoint::new(pixel.u + i * width_px, pixel.v + j * height_px);
                coverage.contains(near)
            })
        })
    };
    let axis = |extent: u32| {
        let steps = (f64::from(extent) / spacing_px).ceil().max(1.0);
        (0..=steps as u32).map(move |k| f64::from(k) / steps * f64::from(extent) - 0.5)
    };
    axis(sensor.height)
        .flat_map(|v| axis(sensor.width).map(move |u| PixelPoint::new(u, v)))
        .filter(|pixel| is_near(*pixel))
        .collect()
}

/// How far a field passes from a sampled ray, at the worse of the ray's two distances: px of that
/// pixel's neighborhood. `None` where the field is singular.
pub fn ray_error_px(field: &RayField, sampled: &SampledRay) -> Option<f64> {
    let sample = field.sample(sampled.pixel);
    let direction = sampled.ray.direction.normalize();
    let foot = sampled.ray.foot_point(&Vector3::zeros());
    let frame = transport::frame(&sample.s);
    [sampled.near_mm, sampled.far_mm]
        .into_iter()
        .map(|lambda_mm| {
            let local = frame.tr_mul(&(foot + direction * lambda_mm));
            let by_s = transport::local_point_derivative(&sample.s, &local);
            let mm_per_px = by_s.fixed_rows::<2>(0) * sample.ds - sample.dm;
            Some((mm_per_px.try_inverse()? * (local.xy() - sample.m_mm)).norm())
        })
        .try_fold(0.0_f64, |worst, error| Some(worst.max(error?)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Projection;
    use calib_simulate::optics::{
        CameraOptics, Distortion, FlatWindow, Lens, Media, PerspectiveLens,
    };

    const SENSOR: SensorSize = SensorSize::new(1280, 1024);

    /// Every so many pixels, the sensor's edge included.
    fn sampled(
        spacing_px: u32,
        [near_mm, far_mm]: [f64; 2],
        ray: impl Fn(PixelPoint) -> Option<Ray>,
    ) -> Vec<SampledRay> {
        let axis = |extent: u32| (0..=extent / spacing_px).map(move |k| f64::from(k * spacing_px));
        axis(SENSOR.height)
            .flat_map(|v| axis(SENSOR.width).map(move |u| PixelPoint::new(u - 0.5, v - 0.5)))
            .map(|pixel| SampledRay {
                pixel,
                ray: ray(pixel).unwrap(),
                near_mm,
                far_mm,
            })
            .collect()
    }

    fn worst_px(field: &RayField, rays: &[SampledRay]) -> f64 {
        let errors = rays.iter().map(|ray| ray_error_px(field, ray).unwrap());
        errors.fold(0.0, f64::max)
    }

    fn camera(media: Media) -> CameraOptics {
        let lens = Lens::Perspective(PerspectiveLens {
            focal_px: [1200.0, 1196.0],
            principal: PixelPoint::new(645.0, 505.0),
            distortion: Distortion::Brown {
                k1: -0.28,
                k2: 0.12,
                k3: -0.03,
                p1: 6e-4,
                p2: -4e-4,
            },
            bumps: Vec::new(),
        });
        CameraOptics::new(SENSOR, lens, media)
    }

    fn settings(is_central: bool) -> FromRaysSettings {
        FromRaysSettings {
            cell_px: 1280.0 / 24.0,
            is_central,
        }
    }

    #[test]
    fn a_distorted_lens_comes_back() {
        let camera = camera(Media::Air);
        let base = BaseLens::ideal(Projection::Perspective, 1200.0);
        let rays = sampled(16, [300.0, 500.0], |pixel| camera.ray(pixel));
        let field = field_of_rays(SENSOR, base, &rays, &settings(true)).unwrap();
        assert!(field.is_central());
        // Between the samples too. A cubic's error at 53 px: (0.044)^4 / 384 of the fourth
        // derivative, 10 or so, times the focal length.
        let between = sampled(7, [300.0, 500.0], |pixel| camera.ray(pixel));
        let worst = worst_px(&field, &between);
        assert!(worst < 1e-3, "{worst}");
    }

    #[test]
    fn a_flat_port_comes_back_where_its_rays_are_known() {
        let window = FlatWindow {
            distance_mm: 30.0,
            normal: Vector3::new(0.05, -0.03, 1.0).normalize(),
            thickness_mm: 10.0,
            index: 1.52,
            index_behind: 1.333,
        };
        let camera = camera(Media::Flat(window));
        let base = BaseLens::ideal(Projection::Perspective, 1600.0);
        let range = [300.0, 500.0];
        let rays = sampled(16, range, |pixel| camera.ray(pixel));
        let field = field_of_rays(SENSOR, base, &rays, &settings(false)).unwrap();
        let worst = worst_px(&field, &sampled(7, range, |pixel| camera.ray(pixel)));
        assert!(worst < 1e-3, "{worst}");
        // Its rays are some millimeters off any one point: a central field cannot have them.
        let central = field_of_rays(SENSOR, base, &rays, &settings(true)).unwrap();
        assert!(worst_px(&central, &rays) > 1.0);
    }

    #[test]
    fn errors_that_cancel_between_the_distances_do_not_count() {
        // Half the rays are turned about their point at 400 mm: between 399 and 401 mm that moves
        // them by 0.01 mm, though the foot point moves by 4 mm.
        let base = BaseLens::ideal(Projection::Perspective, 1200.0);
        let lens = RayField::ideal(SENSOR, base, 0);
        let turned = |pixel: PixelPoint| {
            let direction = lens.ray(pixel).direction.normalize();
            let sign = if (pixel.u / 16.0).round() as i64 % 2 == 0 {
                0.01
            } else {
                -0.01
            };
            Some(Ray {
                origin_mm: direction * 400.0,
                direction: direction + Vector3::x() * sign,
            })
        };
        let rays = sampled(16, [399.0, 401.0], turned);
        let field = field_of_rays(SENSOR, base, &rays, &settings(false)).unwrap();
        let straight = sampled(16, [399.0, 401.0], |pixel| Some(lens.ray(pixel)));
        // 0.01 mm at 400 mm is 0.03 px, of which neighbors of other sign leave little.
        let worst = worst_px(&field, &straight);
        assert!(worst < 0.03, "{worst}");
    }

    #[test]
    fn rays_without_a_direction_or_distance_have_no_field() {
        let base = BaseLens::ideal(Projection::Perspective, 1200.0);
        let lens = RayField::ideal(SENSOR, base, 0);
        let good = sampled(64, [300.0, 500.0], |pixel| Some(lens.ray(pixel)));
        let with = |change: fn(&mut SampledRay)| {
            let mut rays = good.clone();
            change(&mut rays[5]);
            field_of_rays(SENSOR, base, &rays, &settings(false))
        };
        assert!(with(|_| ()).is_some());
        assert!(with(|ray| ray.near_mm = 0.0).is_none());
        assert!(with(|ray| ray.far_mm = f64::NAN).is_none());
        assert!(with(|ray| ray.ray.direction = -Vector3::z()).is_none());
        assert!(with(|ray| ray.ray.direction = Vector3::zeros()).is_none());
        assert!(field_of_rays(SENSOR, base, &[], &settings(true)).is_none());
    }
}
