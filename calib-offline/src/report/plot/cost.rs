//! The cost after each accepted step of the estimate.

use super::{Figure, WIDTH};
use crate::present::axes::{Axes, decades, round_up, ticks};
use crate::present::numbers::short;
use crate::present::svg::Svg;
use crate::report::Calibration;

/// One drawing; the cost on a logarithmic scale where it falls far.
pub fn draw(calibration: &Calibration) -> Option<Figure> {
    let costs = &calibration.estimate.cost_per_iteration;
    let usable = |c: &f64| c.is_finite() && *c >= 0.0;
    if costs.len() < 2 || !costs.iter().all(usable) {
        return None;
    }
    let most = costs.iter().copied().fold(0.0, f64::max);
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let logarithmic = least > 0.0 && most / least > 20.0;
    let (y, y_ticks) = if logarithmic {
        let (from, to) = (least.log10().floor(), most.log10().ceil());
        ([from, to], decades(from as i32, to as i32))
    } else {
        let y = [0.0, round_up(most)];
        (y, ticks(y, 5))
    };
    let axes = Axes {
        across: [48.0, WIDTH - 18.0],
        down: [10.0, 190.0],
        x: [0.0, (costs.len() - 1) as f64],
        y,
    };
    let mut svg = Svg::new(WIDTH, 226.0);
    axes.draw_y(&mut svg, &y_ticks);
    let points: Vec<[f64; 2]> = costs
        .iter()
        .enumerate()
        .map(|(k, cost)| axes.at(k as f64, if logarithmic { cost.log10() } else { *cost }))
        .collect();
    svg.polyline("curve", &points);
    if points.len() <= 60 {
        for point in &points {
            svg.circle("bar c0", *point, 2.5);
        }
    }
    axes.draw_x(&mut svg, "accepted steps");
    Some(Figure {
        title: "Cost per iteration".to_owned(),
        svg: svg.finish("Cost after each accepted step"),
        caption: format!(
            "Robust sum of squared residuals{}, from {} to {}. It stopped because {}.",
            if logarithmic { ", logarithmic" } else { "" },
            short(costs[0]),
            short(costs[costs.len() - 1]),
            calibration.estimate.stop_reason
        ),
    })
}
