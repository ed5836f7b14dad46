//! How noisy corners are, without any lens: along a row of the board pixels change smoothly, and the
//! fourth differences of five neighbors have next to nothing left but noise.

use super::finding::{cause, digits};
use super::look::Look;
use crate::cause::{Cause, Code};
use crate::verdict::Grade;
use calib_estimate::adjust::observations::ViewBlock;
use calib_rays::board::BoardSpec;
use calib_rays::numerics::median;
use std::collections::BTreeMap;

/// Standard deviation per axis, px, from which corners are noisy: sub-pixel detectors reach 0.02 to 0.1 px
/// on sharp images; more means blur, or a board that is not what the manifest says.
const NOISY_PX: f64 = 0.3;
/// Weights of the fourth difference, and the sum of their squares.
const FOURTH: [f64; 5] = [1.0, -4.0, 6.0, -4.0, 1.0];
const SQUARES: f64 = 70.0;
/// A median of absolute values of Gaussian noise is this much of its standard deviation.
const MEDIAN_SHARE: f64 = 0.6745;
/// A difference beyond so many standard deviations has a wrong corner in it.
const WRONG_SIGMA: f64 = 8.0;
/// A larger share of wrong corners says that something is wrong with how they are found.
const MANY_WRONG: f64 = 0.03;
/// Labels whose steps along a row differ by less than this part of one are evenly spaced.
const EVEN: f64 = 1e-6;
/// Fewer differences than this say nothing of a camera.
const LEAST: usize = 30;

/// Noise and wrong corners of each camera.
pub fn noise_and_outliers(look: &Look<'_>, error_mm_per_px: Option<f64>) -> Vec<Cause> {
    let mut causes = Vec::new();
    for camera_idx in 0..look.dataset.cameras.len() {
        let views = look.observations.views.iter();
        let differences: Vec<[f64; 2]> = views
            .filter(|view| view.camera_idx == camera_idx)
            .flat_map(|view| differences(view, &look.dataset.board))
            .collect();
        if differences.len() < LEAST {
            continue;
        }
        let all = differences.iter().flatten();
        let Some(typical) = median(all.map(|d| d.abs())) else {
            continue;
        };
        let sigma = typical / MEDIAN_SHARE;
        let sigma_px = sigma / SQUARES.sqrt();
        let name = look.name(camera_idx);
        let cost_mm = error_mm_per_px.map_or(0.0, |error| error * sigma_px);
        if sigma_px > NOISY_PX {
            causes.push(cause(
                Code::Noise,
                Grade::Doubtful,
                format!("{} px", digits(sigma_px)),
                cost_mm,
                format!(
                    "the corners of camera {name} scatter by {} px per axis against their neighbors, above \
                     {NOISY_PX} px: look at sharpness, exposure and light, and at what found the corners",
                    digits(sigma_px)
                ),
            ));
        }
        // Each wrong corner stands in five differences along its row, at its ends in fewer.
        let wrong = differences
            .iter()
            .filter(|[u, v]| u.hypot(*v) > WRONG_SIGMA * sigma)
            .count();
        let share = wrong as f64 / FOURTH.len() as f64 / differences.len() as f64;
        if share > MANY_WRONG {
            causes.push(cause(
                Code::Outliers,
                Grade::Doubtful,
                format!("{:.0} % of the corners", 100.0 * share),
                cost_mm,
                format!(
                    "some {:.0} % of the corners of camera {name} lie far from where their neighbors say: wrong \
                     corners are left out one by one, but so many mean that something is found that is no \
                     corner; look at the images with calib-offline detect --overlay DIR",
                    100.0 * share
                ),
            ));
        }
    }
    causes
}

/// Fourth differences of u and v along the rows of a view, px: of neighbors, or where the print is not even, of every
/// second label, as on tags with gaps between them.
fn differences(view: &ViewBlock, board: &BoardSpec) -> Vec<[f64; 2]> {
    let mut rows: BTreeMap<usize, BTreeMap<usize, [f64; 2]>> = BTreeMap::new();
    for corner in &view.corners {
        let row = rows.entry(corner.row).or_default();
        row.insert(corner.col, [corner.pixel.u, corner.pixel.v]);
    }
    let even = |row: usize, cols: &[usize; FOURTH.len()]| {
        let at = cols.map(|col| board.corner_in_board(row, col));
        let bend = |k: usize| (at[k - 1] - at[k] * 2.0 + at[k + 1]).norm();
        (1..FOURTH.len() - 1).all(|k| bend(k) < EVEN * (at[1] - at[0]).norm())
    };
    let of = |row: usize, pixels: &BTreeMap<usize, [f64; 2]>, first: usize| {
        let cols = [1, 2]
            .map(|step| std::array::from_fn(|k| first + k * step))
            .into_iter()
            .find(|cols| cols.iter().all(|col| pixels.contains_key(col)) && even(row, cols))?;
        let mut sum = [0.0; 2];
        for (col, weight) in cols.iter().zip(FOURTH) {
            let pixel = pixels.get(col)?;
            sum[0] += weight * pixel[0];
            sum[1] += weight * pixel[1];
        }
        Some(sum)
    };
    rows.iter()
        .flat_map(|(row, pixels)| pixels.keys().filter_map(|col| of(*row, pixels, *col)))
        .collect()
}
