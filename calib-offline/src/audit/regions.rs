//! Where on a sensor a calibration is wrong: nine regions.

use super::record::{Region, rms};
use calib_rays::geometry::{PixelPoint, SensorSize};
use nalgebra::Vector2;

/// Row by row.
const NAMES: [&str; 9] = [
    "upper left",
    "top",
    "upper right",
    "left",
    "middle",
    "right",
    "lower left",
    "bottom",
    "lower right",
];

/// The residuals of each third of a sensor both ways, those without corners left out.
pub(super) fn regions(sensor: SensorSize, residuals: &[(PixelPoint, Vector2<f64>)]) -> Vec<Region> {
    let third = |at: f64, extent: u32| ((3.0 * (at + 0.5) / f64::from(extent)) as usize).min(2);
    let mut sorted: [Vec<Vector2<f64>>; 9] = Default::default();
    for (pixel, residual) in residuals {
        let place = 3 * third(pixel.v, sensor.height) + third(pixel.u, sensor.width);
        sorted[place].push(*residual);
    }
    let named = NAMES.into_iter().zip(sorted);
    named
        .filter(|(_, found)| !found.is_empty())
        .map(|(name, found)| {
            let mean = found.iter().sum::<Vector2<f64>>() / found.len() as f64;
            let lengths: Vec<f64> = found.iter().map(Vector2::norm).collect();
            Region {
                name,
                corners: found.len(),
                rms_px: rms(&lengths).unwrap_or(0.0),
                mean_px: mean.into(),
            }
        })
        .collect()
}
