//! By how much a pinhole misses the rays that it stands for.

use super::fit::{Sample, Turned};
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

/// By how much a camera's pinhole misses its rays, at the distance of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Loss {
    /// RMS distance of the pixels, px.
    pub rms_px: f64,
    /// The largest, px.
    pub max_px: f64,
    /// RMS distance of the points from the pinhole's rays, to first order, mm.
    pub rms_mm: f64,
    /// The largest, mm.
    pub max_mm: f64,
    /// Pixels compared.
    #[serde(skip)]
    pub count: usize,
}

impl Loss {
    /// Of samples; `None` where the lens does not see one of them.
    pub(super) fn of((lens, turn): &Turned, samples: &[Sample]) -> Option<Self> {
        let mut each = Vec::with_capacity(samples.len());
        for (pixel, point) in samples {
            let point = turn * point;
            let seen = lens.see(&point)?;
            let missed = Vector2::new(seen.pixel.u - pixel.u, seen.pixel.v - pixel.v);
            let ideal = seen.by_ideal.try_inverse()? * missed;
            let shift = Vector3::new(ideal.x, ideal.y, 0.0) * point.z;
            let across = shift - point * (shift.dot(&point) / point.norm_squared());
            each.push((missed.norm(), across.norm()));
        }
        let count = each.len();
        let rms = |of: fn(&(f64, f64)) -> f64| {
            let sum: f64 = each.iter().map(|pair| of(pair).powi(2)).sum();
            (sum / count.max(1) as f64).sqrt()
        };
        let max = |of: fn(&(f64, f64)) -> f64| each.iter().map(of).fold(0.0, f64::max);
        Some(Self {
            rms_px: rms(|pair| pair.0),
            max_px: max(|pair| pair.0),
            rms_mm: rms(|pair| pair.1),
            max_mm: max(|pair| pair.1),
            count,
        })
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
