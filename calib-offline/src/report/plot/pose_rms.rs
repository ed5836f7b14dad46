//! RMS of the residual vectors per pose and camera, worst first.

use super::{Figure, WIDTH};
use crate::present::axes::{Axes, round_up};
use crate::present::svg::{Anchor, Svg};
use crate::report::Calibration;
use crate::report::record::PoseRecord;

/// Poses shown; the best are left out.
const MAX_POSES: usize = 20;
/// Colors of the style sheet for cameras.
pub(super) const CAMERA_COLORS: usize = 4;

/// One drawing: a group of bars per pose, one bar per camera.
pub fn draw(calibration: &Calibration) -> Option<Figure> {
    let mut poses: Vec<(&PoseRecord, f64)> = calibration
        .poses
        .iter()
        .filter_map(|pose| {
            let worst = pose
                .rms_px
                .iter()
                .flatten()
                .copied()
                .fold(None, |a, b| Some(f64::max(a.unwrap_or(0.0), b)))?;
            Some((pose, worst))
        })
        .collect();
    poses.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.pose.cmp(&b.0.pose)));
    let shown = poses.len().min(MAX_POSES);
    let (_, worst) = poses.first()?;
    let cameras = &calibration.rig.cameras;
    let (bar, gap) = (7.0, 5.0);
    let group = bar * cameras.len() as f64 + gap;
    let top = 24.0;
    let bottom = top + group * shown as f64;
    let axes = Axes {
        across: [52.0, WIDTH - 18.0],
        down: [top, bottom],
        x: [0.0, round_up(*worst)],
        y: [0.0, 1.0],
    };
    let mut svg = Svg::new(WIDTH, bottom + 38.0);
    let mut x = 52.0;
    for (k, camera) in cameras.iter().enumerate() {
        svg.rect(&format!("bar c{}", k % CAMERA_COLORS), [x, 6.0], [9.0, 9.0]);
        svg.text("tick", [x + 13.0, 14.0], Anchor::Start, &camera.name);
        x += 28.0 + 7.0 * camera.name.chars().count() as f64;
    }
    for (g, (pose, _)) in poses.iter().take(shown).enumerate() {
        let y = top + group * g as f64;
        svg.text(
            "tick",
            [47.0, y + (group - gap) / 2.0 + 4.0],
            Anchor::End,
            &pose.pose.to_string(),
        );
        for (k, rms_px) in pose.rms_px.iter().enumerate() {
            let Some(rms_px) = rms_px else { continue };
            let [end, _] = axes.at(*rms_px, 0.0);
            svg.rect(
                &format!("bar c{}", k % CAMERA_COLORS),
                [axes.across[0], y + bar * k as f64],
                [end - axes.across[0], bar - 1.0],
            );
        }
    }
    // What pure noise gives: a vector of two components.
    let [noise, _] = axes.at(
        calibration.estimate.sigma_px * std::f64::consts::SQRT_2,
        0.0,
    );
    if noise <= axes.across[1] {
        svg.line("curve", [noise, top - 4.0], [noise, bottom]);
    }
    svg.line("axis", [axes.across[0], top], [axes.across[0], bottom]);
    axes.draw_x(
        &mut svg,
        "RMS of the residual vectors, px (pose number at the left)",
    );
    let rest = if shown < poses.len() {
        format!("The worst {shown} of {} poses.", poses.len())
    } else {
        format!("All {shown} poses.")
    };
    Some(Figure {
        title: "RMS per pose and camera, worst first".to_owned(),
        svg: svg.finish("RMS of the residual vectors per pose and camera"),
        caption: format!("{rest} The upright line is what the estimated noise alone gives."),
    })
}
