//! The figures, each an SVG file of its own.

use super::Evaluation;
use super::known::KnownExperiment;
use super::spread::{PUBLISHED_CHOICE_PX, SpreadExperiment, SpreadPoint};
use super::stage::StageExperiment;
use super::target::{CloudPoint, TargetExperiment, TargetMethod, TargetPose};
use crate::methods::METHODS;
use crate::present::axes::round_up;
use crate::present::chart::{Axis, Mark, PLOT, Panel, Series, draw};

/// Name and content of every figure that there is.
pub fn figures(evaluation: &Evaluation) -> Vec<(&'static str, String)> {
    let mut figures = Vec::new();
    if let Some(spread) = &evaluation.spread {
        figures.push(("fig7_spread.svg", spread_figure(spread)));
    }
    if let Some(stage) = &evaluation.stage_angles {
        figures.push(("fig8_stage_angles.svg", stage_figure(stage)));
    }
    if let Some(target) = evaluation.target.as_ref().filter(|t| !t.cloud.is_empty()) {
        figures.push(("fig10_point_cloud.svg", cloud_figure(target)));
    }
    let panels = distance_panels(evaluation.target.as_ref(), evaluation.known_points.as_ref());
    if !panels.is_empty() {
        let text = draw(&panels, "Measurement error against distance");
        figures.push(("fig11_error_over_distance.svg", text));
    }
    figures
}

/// Every method has its color in all figures: the program's own is always the first.
fn color(method: &str) -> usize {
    let place = METHODS.iter().position(|known| known.name() == method);
    match place {
        Some(place) if place + 1 < METHODS.len() => place + 1,
        _ => 0,
    }
}

fn series(name: &str, color: usize, mark: Mark, points: Vec<[f64; 2]>) -> Series {
    Series {
        name: name.to_owned(),
        color,
        mark,
        points,
    }
}

fn spread_figure(spread: &SpreadExperiment) -> String {
    let curve = |points: &[SpreadPoint], of: fn(&SpreadPoint) -> Option<f64>| -> Vec<[f64; 2]> {
        points
            .iter()
            .filter_map(|p| Some([p.spread_px, of(p)?]))
            .collect()
    };
    let corners = |points: &[SpreadPoint]| {
        vec![
            series(
                "training",
                0,
                Mark::Line,
                curve(points, |p| Some(p.training_rms_mm)),
            ),
            series(
                "corners left out",
                1,
                Mark::Line,
                curve(points, |p| Some(p.left_out_rms_mm)),
            ),
        ]
    };
    let markers = |points: &[SpreadPoint]| {
        vec![series(
            "auxiliary markers, 160 mm apart",
            2,
            Mark::Line,
            curve(points, |p| p.marker_rms_mm),
        )]
    };
    let published_mark = || (PUBLISHED_CHOICE_PX, "publication: 6000 px".to_owned());
    let mut wide_marks = vec![
        published_mark(),
        (
            spread.best_px,
            format!("least left out: {:.0} px", spread.best_px),
        ),
    ];
    wide_marks.extend(
        spread
            .alternating_px
            .map(|px| (px, format!("alternating *: {px:.0} px"))),
    );
    let narrow = |title: &str, label: &str, series| Panel {
        title: title.to_owned(),
        x: Axis::linear("spread, px"),
        y: Axis::linear(label),
        series,
        marks: vec![published_mark()],
    };
    let wide = |title: &str, label: &str, series, marks| Panel {
        title: title.to_owned(),
        x: Axis::logarithmic("spread, px (logarithmic)"),
        y: Axis::logarithmic(label),
        series,
        marks,
    };
    let mut panels = vec![
        narrow(
            "The published range",
            "RMS error on the board, mm",
            corners(&spread.published),
        ),
        wide(
            "From 100 px on (* with a homography first)",
            "RMS error on the board, mm (logarithmic)",
            corners(&spread.wide),
            wide_marks,
        ),
    ];
    if spread.marker_pairs > 0 {
        panels.push(narrow(
            "Auxiliary markers, the published range",
            "RMS error of a distance of 160 mm, mm",
            markers(&spread.published),
        ));
        panels.push(wide(
            "Auxiliary markers, from 100 px on",
            "RMS error of a distance of 160 mm, mm (logarithmic)",
            markers(&spread.wide),
            vec![published_mark()],
        ));
    }
    draw(&panels, "Error of the networks against their spread")
}

fn stage_figure(stage: &StageExperiment) -> String {
    let mut placements: Vec<usize> = stage
        .methods
        .iter()
        .flat_map(|m| m.angles.iter().map(|a| a.placement))
        .collect();
    placements.sort_unstable();
    placements.dedup();
    let panels: Vec<Panel> = placements
        .iter()
        .map(|placement| Panel {
            title: format!("Placement {placement}"),
            x: Axis::linear("angle of the stage, degrees"),
            y: Axis::linear("found minus dial, mean taken out, degrees"),
            series: stage
                .methods
                .iter()
                .map(|method| {
                    let here = method.angles.iter().filter(|a| a.placement == *placement);
                    let mut points: Vec<[f64; 2]> =
                        here.map(|a| [a.dial_deg, a.error_deg]).collect();
                    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
                    let name = format!("{}, RMS {:.4} deg", method.method, method.rms_deg);
                    series(&name, color(method.method), Mark::LineDots, points)
                })
                .collect(),
            marks: Vec::new(),
        })
        .collect();
    draw(&panels, "Angles of the poses against the dial of the stage")
}

fn cloud_figure(target: &TargetExperiment) -> String {
    let method = target.cloud_method.unwrap_or("");
    let views: [(&str, [&str; 2], [usize; 2]); 2] = [
        (
            "Seen along z",
            ["x of the datum board, mm", "y of the datum board, mm"],
            [0, 1],
        ),
        (
            "Seen along y",
            ["x of the datum board, mm", "z of the datum board, mm"],
            [0, 2],
        ),
    ];
    let mut panels: Vec<Panel> = views
        .iter()
        .map(|(title, [x_label, y_label], [i, j])| {
            let project = |of: fn(&CloudPoint) -> nalgebra::Vector3<f64>| -> Vec<[f64; 2]> {
                let points = target.cloud.iter().map(of);
                points.map(|p| [p[*i], p[*j]]).collect()
            };
            let measured = project(|p| p.measured_mm);
            let [x, y] = equal_ranges(&measured);
            Panel {
                title: (*title).to_owned(),
                x: Axis {
                    range: Some(x),
                    ..Axis::linear(x_label)
                },
                y: Axis {
                    range: Some(y),
                    ..Axis::linear(y_label)
                },
                series: vec![
                    series(
                        "nominal, best placed",
                        4,
                        Mark::Rings,
                        project(|p| p.nominal_mm),
                    ),
                    series(&format!("measured, {method}"), 0, Mark::Dots, measured),
                ],
                marks: Vec::new(),
            }
        })
        .collect();
    panels.extend(error_panel(target, &panels));
    draw(&panels, "Measured point cloud of the target")
}

/// The first panel again with the errors as lines, long enough to be seen.
fn error_panel(target: &TargetExperiment, panels: &[Panel]) -> Option<Panel> {
    let errors = || target.cloud.iter().map(|p| p.measured_mm - p.nominal_mm);
    let squares = errors().map(|e| e.norm_squared()).sum::<f64>();
    let rms_mm = (squares / target.cloud.len().max(1) as f64).sqrt();
    // A typical line is then 2 to 5 mm long.
    let times = round_up(2.0 / rms_mm.max(1e-9));
    let mut lines: Vec<Series> = target
        .cloud
        .iter()
        .zip(errors())
        .map(|(point, error)| {
            let (from, to) = (point.nominal_mm, point.nominal_mm + error * times);
            series("", 1, Mark::Line, vec![[from.x, from.y], [to.x, to.y]])
        })
        .collect();
    if let Some(first) = lines.first_mut() {
        first.name = format!("measured minus nominal, {times:.0} times as long");
    }
    let dots = target
        .cloud
        .iter()
        .map(|p| [p.nominal_mm.x, p.nominal_mm.y]);
    lines.push(series(
        "nominal, best placed",
        4,
        Mark::Dots,
        dots.collect(),
    ));
    Some(Panel {
        title: "Errors, seen along z".to_owned(),
        series: lines,
        ..panels.first()?.clone()
    })
}

/// Ranges around points in which a millimeter is as long across as upwards.
fn equal_ranges(points: &[[f64; 2]]) -> [[f64; 2]; 2] {
    let ends = |axis: usize| {
        let values = points.iter().map(|p| p[axis]);
        let least = values.clone().fold(f64::INFINITY, f64::min);
        (least, values.fold(f64::NEG_INFINITY, f64::max))
    };
    let [(left, right), (low, high)] = [ends(0), ends(1)];
    let mm_per_unit = ((right - left) / PLOT[0])
        .max((high - low) / PLOT[1])
        .max(1e-6)
        * 1.1;
    let around = |a: f64, b: f64, units: f64| {
        let (middle, half) = (f64::midpoint(a, b), units * mm_per_unit / 2.0);
        [middle - half, middle + half]
    };
    [around(left, right, PLOT[0]), around(low, high, PLOT[1])]
}

fn distance_panels(
    target: Option<&TargetExperiment>,
    known: Option<&KnownExperiment>,
) -> Vec<Panel> {
    let x = || Axis::linear("distance from the middle of the cameras, mm");
    let mut panels = Vec::new();
    if let Some(target) = target {
        let by_method = |of: fn(&TargetPose) -> Option<f64>| -> Vec<Series> {
            let one = |method: &TargetMethod| {
                let poses = method.poses.iter();
                let mut points: Vec<[f64; 2]> = poses
                    .filter_map(|p| Some([p.distance_mm, of(p)?]))
                    .collect();
                points.sort_by(|a, b| a[0].total_cmp(&b[0]));
                let name = method.method;
                series(name, color(method.method), Mark::LineDots, points)
            };
            target.methods.iter().map(one).collect()
        };
        panels.push(Panel {
            title: "Target: markers from the best-placed nominal one".to_owned(),
            x: x(),
            y: Axis::linear("RMS distance of a pose's markers, mm"),
            series: by_method(|p| Some(p.errors.rms_mm)),
            marks: Vec::new(),
        });
        panels.push(Panel {
            title: "Target: distances of neighboring markers".to_owned(),
            x: x(),
            y: Axis::linear("RMS error of a pose, mm"),
            series: by_method(|p| p.neighbor_rms_mm),
            marks: Vec::new(),
        });
        if target.methods.iter().any(|m| m.true_rms_mm.is_some()) {
            panels.push(Panel {
                title: "Target: markers from their true places".to_owned(),
                x: x(),
                y: Axis::linear("RMS error of a pose, frame placed once, mm"),
                series: by_method(|p| p.true_rms_mm),
                marks: Vec::new(),
            });
        }
    }
    if let Some(known) = known {
        let mut all: Vec<Series> = known
            .methods
            .iter()
            .map(|method| {
                let points = method.bins.iter().map(|b| [b.distance_mm, b.placed_rms_mm]);
                let name = method.method;
                series(name, color(method.method), Mark::LineDots, points.collect())
            })
            .collect();
        let points = known
            .oracle
            .iter()
            .map(|b| [b.distance_mm, b.placed_rms_mm]);
        all.push(series(
            "true rays, same pixels",
            4,
            Mark::Dashed,
            points.collect(),
        ));
        panels.push(Panel {
            title: "Points with known truth".to_owned(),
            x: x(),
            y: Axis::linear("RMS error, frame placed, mm"),
            series: all,
            marks: Vec::new(),
        });
    }
    panels
}
