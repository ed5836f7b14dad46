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
