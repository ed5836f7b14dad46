//! How the residuals are distributed, beside the Gaussian of the noise that was estimated.

use super::{Figure, WIDTH};
use crate::present::axes::{Axes, round_up, ticks};
use crate::present::numbers::short;
use crate::present::svg::Svg;
use crate::report::Calibration;

/// Shown on either side of zero, in standard deviations.
const REACH_SIGMA: f64 = 5.0;
/// Bins per standard deviation.
const BINS_PER_SIGMA: f64 = 4.0;

/// One drawing: both components of all corners used.
pub fn draw(calibration: &Calibration) -> Option<Figure> {
    let sigma_px = calibration.estimate.sigma_px;
    let components: Vec<f64> = calibration
        .corners
        .iter()
        .filter(|c| c.weight > 0.0)
        .flat_map(|c| [c.residual_px.x, c.residual_px.y])
        .collect();
    if components.is_empty() || !(sigma_px.is_finite() && sigma_px > 0.0) {
        return None;
    }
    let bin_count = (2.0 * REACH_SIGMA * BINS_PER_SIGMA) as usize;
    let bin_px = sigma_px / BINS_PER_SIGMA;
    let mut bins = vec![0usize; bin_count];
    let mut beyond = 0;
    for value in &components {
        let bin = (value / bin_px + bin_count as f64 / 2.0).floor();
        if (0.0..bin_count as f64).contains(&bin) {
            bins[bin as usize] += 1;
        } else {
            beyond += 1;
        }
    }
    let total = components.len() as f64;
    let share = |count: usize| 100.0 * count as f64 / total;
    // Height of the Gaussian, percent per bin.
    let peak = 100.0 / (BINS_PER_SIGMA * std::f64::consts::TAU.sqrt());
    let most = bins.iter().copied().map(share).fold(peak, f64::max);
    let reach_px = REACH_SIGMA * sigma_px;
    let axes = Axes {
        across: [38.0, WIDTH - 8.0],
        down: [10.0, 210.0],
        x: [-reach_px, reach_px],
        y: [0.0, round_up(most)],
    };
    let mut svg = Svg::new(WIDTH, 246.0);
    axes.draw_y(&mut svg, &ticks(axes.y, 5));
    for (k, count) in bins.iter().enumerate() {
        let from = axes.at(k as f64 * bin_px - reach_px, share(*count));
        let to = axes.at((k + 1) as f64 * bin_px - reach_px, 0.0);
        svg.rect("bar c0", from, [to[0] - from[0] - 0.5, to[1] - from[1]]);
    }
    let curve: Vec<[f64; 2]> = (0..=200)
        .map(|k| {
            let z = REACH_SIGMA * (f64::from(k) / 100.0 - 1.0);
            axes.at(z * sigma_px, peak * (-z * z / 2.0).exp())
        })
        .collect();
    svg.polyline("curve", &curve);
    axes.draw_x(
        &mut svg,
        "residual along u or v, px (upwards: % of the components)",
    );
    Some(Figure {
        title: "Histogram of residuals".to_owned(),
        svg: svg.finish("Histogram of residuals with the Gaussian of the estimated noise"),
        caption: format!(
            "Percent of {} components per bin of a quarter standard deviation; the line is a Gaussian of {} px. {beyond} components lie beyond 5 standard deviations, {} corners were rejected.",
            components.len(),
            short(sigma_px),
            calibration.estimate.corners_rejected
        ),
    })
}
