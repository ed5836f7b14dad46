//! What the model did not explain, corner by corner, over the image: length by a stated scale,
//! color by direction. Random colors are noise; an area of one color is a pattern.

use super::coverage::SensorView;
use super::{Figure, WIDTH};
use crate::present::svg::{Anchor, Svg, point};
use crate::report::Calibration;
use crate::report::record::CornerRecord;
use calib_rays::field::CalibratedCamera;

/// Length of the reference arrow, units.
const ARROW: f64 = 10.0;
/// What the reference arrow means on the usual scale, px.
const USUAL_ARROW_PX: f64 = 0.1;
/// Classes of the style sheet, one per eighth of the circle, from +u towards +v.
const DIRECTIONS: usize = 8;
/// More vectors than this per camera make a black area.
const MAX_VECTORS: usize = 3000;
/// Rejected corners may be far off; longer vectors are cut to this, units.
const MAX_LENGTH: f64 = 60.0;

/// One drawing per camera, all on the same scale.
pub fn draw(calibration: &Calibration) -> Vec<Figure> {
    let arrow_px = arrow_px(calibration.estimate.rms_px);
    calibration
        .rig
        .cameras
        .iter()
        .enumerate()
        .map(|(camera_idx, camera)| draw_camera(calibration, camera_idx, camera, arrow_px))
        .collect()
}

/// The usual scale wherever residuals can be seen on it; else the power of ten that shows them.
fn arrow_px(rms_px: f64) -> f64 {
    let ratio = rms_px / USUAL_ARROW_PX;
    if (0.15..6.0).contains(&ratio) || !(ratio.is_finite() && ratio > 0.0) {
        USUAL_ARROW_PX
    } else {
        10f64.powf(rms_px.log10().round().max(-12.0))
    }
}

fn draw_camera(
    calibration: &Calibration,
    camera_idx: usize,
    camera: &CalibratedCamera,
    arrow_px: f64,
) -> Figure {
    const FOOT: f64 = 26.0;
    let view = SensorView::new(camera.field.sensor);
    let mut svg = Svg::new(WIDTH, view.height + FOOT);
    svg.rect("sensor", [0.0, 0.0], [WIDTH, view.height]);
    let of_camera = || {
        calibration
            .corners
            .iter()
            .filter(|c| c.camera_idx == camera_idx)
    };
    let count = of_camera().count();
    let every = count.div_ceil(MAX_VECTORS).max(1);
    let mut directions = vec![String::new(); DIRECTIONS];
    let mut rejected = String::new();
    for corner in of_camera().step_by(every) {
        let data = vector(corner, &view, arrow_px);
        if corner.weight > 0.0 {
            directions[direction(corner)].push_str(&data);
        } else {
            rejected.push_str(&data);
        }
    }
    for (k, data) in directions.iter().enumerate() {
        svg.path(&format!("vector d{k}"), data);
    }
    svg.path("vector rejected", &rejected);
    draw_legend(&mut svg, view.height + FOOT - 8.0, arrow_px);
    let scale = if arrow_px == USUAL_ARROW_PX {
        "the same in every report"
    } else {
        "not the usual 0.1 px, because these residuals would not fit it"
    };
    let thinned = if every > 1 {
        format!(" Drawn is one of every {every} of the {count} corners.")
    } else {
        format!(" {count} corners.")
    };
    Figure {
        title: camera.name.clone(),
        svg: svg.finish(&format!("Residual vectors of camera {}", camera.name)),
        caption: format!(
            "The arrow below the image is {arrow_px} px ({scale}).{thinned} Observed minus predicted, rejected corners dashed."
        ),
    }
}

fn vector(corner: &CornerRecord, view: &SensorView, arrow_px: f64) -> String {
    let from = view.at(corner.observed);
    let mut step = corner.residual_px * (ARROW / arrow_px);
    let length = step.norm();
    if !length.is_finite() {
        return String::new();
    }
    if length > MAX_LENGTH {
        step *= MAX_LENGTH / length;
    }
    format!("M{}l{}", point(from), point([step.x, step.y]))
}

fn direction(corner: &CornerRecord) -> usize {
    let turn = corner.residual_px.y.atan2(corner.residual_px.x) / std::f64::consts::TAU;
    ((turn * DIRECTIONS as f64).round() as i64).rem_euclid(DIRECTIONS as i64) as usize
}

fn draw_legend(svg: &mut Svg, y: f64, arrow_px: f64) {
    svg.path(
        "arrow",
        &format!("M4 {y}h{ARROW}m-3 -3l3 3l-3 3", y = y - 4.0),
    );
    svg.text(
        "tick",
        [ARROW + 10.0, y],
        Anchor::Start,
        &format!("{arrow_px} px"),
    );
    // A wheel would be small; the eight colors stand in a row with their directions.
    let names = ["→", "↘", "↓", "↙", "←", "↖", "↑", "↗"];
    for (k, name) in names.iter().enumerate() {
        let x = WIDTH - 8.0 - 24.0 * (DIRECTIONS - 1 - k) as f64;
        svg.text(&format!("tick t{k}"), [x, y], Anchor::Middle, name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_is_fixed_unless_nothing_could_be_seen() {
        for rms_px in [0.02, 0.07, 0.3, 0.55, 0.0, f64::NAN] {
            assert_eq!(arrow_px(rms_px), USUAL_ARROW_PX);
        }
        assert_eq!(arrow_px(0.9), 1.0);
        assert_eq!(arrow_px(1e-6), 1e-6);
    }
}
