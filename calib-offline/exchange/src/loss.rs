//! By how much a camera of another form misses the rays that it stands for.

use super::fit::Sample;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use nalgebra::{Matrix2x3, Vector2, Vector3};
use serde::Serialize;

/// By how much a camera misses its rays, at the distance of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Loss {
    /// RMS distance of the pixels, px.
    pub rms_px: f64,
    /// The largest, px.
    pub max_px: f64,
    /// RMS distance of the points from the camera's rays, to first order, mm.
    pub rms_mm: f64,
    /// The largest, mm.
    pub max_mm: f64,
    /// Pixels compared.
    #[serde(skip)]
    pub count: usize,
}

/// By how much one ray is missed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Missed {
    /// Where the camera sees the point, less the pixel of its ray.
    pub by_px: Vector2<f64>,
    /// The point's distance from the camera's ray.
    pub by_mm: f64,
}

/// Where a camera sees a point of its own frame, and how that moves with it, px/mm; `None` where it does not.
pub(super) type See<'a> = &'a dyn Fn(&Vector3<f64>) -> Option<(PixelPoint, Matrix2x3<f64>)>;

/// By how much a sample is missed; `None` where the camera does not see it.
pub(super) fn missed(see: See<'_>, (pixel, point): &Sample) -> Option<Missed> {
    let (seen, by_point) = see(point)?;
    let by_px = Vector2::new(seen.u - pixel.u, seen.v - pixel.v);
    // The shortest move of the point that makes up for it: across its ray.
    let across = by_point.transpose() * ((by_point * by_point.transpose()).try_inverse()? * by_px);
    Some(Missed {
        by_px,
        by_mm: across.norm(),
    })
}

impl Loss {
    /// Of samples; `None` where the camera does not see one of them.
    pub(super) fn of(see: See<'_>, samples: &[Sample]) -> Option<Self> {
        let each: Option<Vec<_>> = samples
            .iter()
            .map(|sample| missed(see, sample).map(|missed| (missed.by_px.norm(), missed.by_mm)))
            .collect();
        Some(Self::of_each(&each?))
    }

    /// Of distances in px and in mm.
    pub(super) fn of_each(each: &[(f64, f64)]) -> Self {
        let count = each.len();
        let rms = |of: fn(&(f64, f64)) -> f64| {
            let sum: f64 = each.iter().map(|pair| of(pair).powi(2)).sum();
            (sum / count.max(1) as f64).sqrt()
        };
        let max = |of: fn(&(f64, f64)) -> f64| each.iter().map(of).fold(0.0, f64::max);
        Self {
            rms_px: rms(|pair| pair.0),
            max_px: max(|pair| pair.0),
            rms_mm: rms(|pair| pair.1),
            max_mm: max(|pair| pair.1),
            count,
        }
    }

    /// Of several cameras together.
    pub fn together(losses: &[Self]) -> Self {
        let count: usize = losses.iter().map(|loss| loss.count).sum();
        let rms = |of: fn(&Self) -> f64| {
            let sum: f64 = losses
                .iter()
                .map(|loss| of(loss).powi(2) * loss.count as f64)
                .sum();
            (sum / count.max(1) as f64).sqrt()
        };
        let max = |of: fn(&Self) -> f64| losses.iter().map(of).fold(0.0, f64::max);
        Self {
            rms_px: rms(|loss| loss.rms_px),
            max_px: max(|loss| loss.max_px),
            rms_mm: rms(|loss| loss.rms_mm),
            max_mm: max(|loss| loss.max_mm),
            count,
        }
    }
}

/// The loss over the sensor, on a lattice of pixels; `None` where there is no ray.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LossMap {
    /// The camera.
    pub camera: String,
    /// From the frame of the other form's camera to the rig's: the rotation row by row.
    pub rotation: [f64; 9],
    /// And where that camera is, mm.
    pub translation_mm: [f64; 3],
    /// Columns of the lattice, px.
    pub u_px: Vec<f64>,
    /// Its rows, px.
    pub v_px: Vec<f64>,
    /// By row and column: where the camera of the other form sees what the pixel sees, less the pixel, along u, px.
    pub du_px: Vec<Vec<Option<f64>>>,
    /// The same along v.
    pub dv_px: Vec<Vec<Option<f64>>>,
    /// By row and column: distance of the point from the camera's ray, mm.
    pub mm: Vec<Vec<Option<f64>>>,
}

impl LossMap {
    /// Of what is missed at each place of a lattice, row by row.
    pub(super) fn new(
        camera: String,
        rig_from_lens: &RigidTransform,
        (u_px, v_px): (Vec<f64>, Vec<f64>),
        missed: impl Fn(PixelPoint) -> Option<Missed>,
    ) -> Self {
        let rows: Vec<Vec<Option<Missed>>> = v_px
            .iter()
            .map(|v| {
                u_px.iter()
                    .map(|u| missed(PixelPoint::new(*u, *v)))
                    .collect()
            })
            .collect();
        let table = |of: fn(&Missed) -> f64| {
            let row = |row: &Vec<Option<Missed>>| row.iter().map(|m| m.as_ref().map(of)).collect();
            rows.iter().map(row).collect()
        };
        Self {
            du_px: table(|missed| missed.by_px.x),
            dv_px: table(|missed| missed.by_px.y),
            mm: table(|missed| missed.by_mm),
            camera,
            rotation: std::array::from_fn(|k| rig_from_lens.rotation[(k / 3, k % 3)]),
            translation_mm: rig_from_lens.translation_mm.into(),
            u_px,
            v_px,
        }
    }
}
