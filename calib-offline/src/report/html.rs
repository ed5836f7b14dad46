//! The report page: one HTML file that needs nothing else, no network and no scripts.

use super::BlobFacts;
use super::causes_page;
use super::choices_page;
use super::facts::{Facts, pair};
use super::left_out_page;
use super::plot::{
    Figure, blob_curve, cost, coverage, histogram, pose_rms, residual_vectors, scene,
    uncertainty_map,
};
use super::procedure;
use super::record::{Calibration, HeldOutRecord};
use super::sign_page;
use super::words;
use crate::present::numbers::short;
use calib_judge::half_data::HalfDataCheck;
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// The page as a file's content.
pub fn page(calibration: &Calibration, blob: Option<&BlobFacts>) -> String {
    let facts = Facts::of(calibration);
    let names: Vec<&str> = facts.cameras.iter().map(|c| c.name.as_str()).collect();
    let title = format!("Calibration of {}", names.join(" and "));
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="generator" content={ "calib-offline " (calibration.tool_version) };
                title { (title) }
                style { (PreEscaped(include_str!("page.css"))) }
            }
            body {
                main {
                    h1 { (title) }
                    (verdict(&facts))
                    (causes_page::draw(calibration))
                    (headline(calibration, &facts, blob))
                    (sign_page::draw(calibration))
                    (figures(calibration))
                    @if let Some(blob) = blob {
                        (group("Blob", blob_curve::draw(blob).as_slice(),
                            "What the rays cost on the device: the bytes of all cameras' tables, without mask, metadata and uncertainty, against the largest error of any ray. Choose with calib-offline pack: --max-error-px or --max-bytes."))
                    }
                    (procedure::draw(calibration))
                    (choices_page::draw(calibration))
                    (left_out_page::draw(calibration))
                    (provenance(calibration))
                }
            }
        }
    }
    .into_string()
}

fn verdict(facts: &Facts) -> Markup {
    html! {
        section class={ "verdict " (facts.verdict.word()) } {
            p.grade { "Verdict: " strong { (facts.verdict.word()) } }
            @if !facts.reasons.is_empty() {
                ul { @for reason in &facts.reasons { li { (reason) } } }
            }
        }
    }
}

/// One number with its name, unit and what it means.
fn card(name: &str, value: &str, note: &str) -> Markup {
    html! {
        div.card {
            p.name { (name) }
            p.value { (value) }
            @if !note.is_empty() { p.note { (note) } }
        }
    }
}

fn headline(calibration: &Calibration, facts: &Facts, blob: Option<&BlobFacts>) -> Markup {
    let held_out = calibration.held_out.as_ref();
    let px = |value: f64| format!("{} px", short(value));
    html! {
        section.cards {
            @if let (Some(percent), Some(mm)) = (facts.held_out_neighbor_percent, facts.held_out_neighbor_mm) {
                (card(
                    "Held-out length error",
                    &format!("{} %", short(percent)),
                    &format!("RMS of neighboring-corner distances: {} mm of {} mm", short(mm), calibration.board.square_mm),
                ))
            }
            @if let Some(mm) = facts.held_out_rigid_mm {
                (card("Held-out shape error", &format!("{} mm", short(mm)), "RMS distance of triangulated corners from the rigid board"))
            }
            @if let Some(value) = facts.held_out_rms_px {
                (card("Held-out residual", &px(value), "RMS residual vector, board pose refitted"))
            }
            @if let Some(held_out) = held_out {
                (card("Held-out check", &format!("{} folds", held_out.folds), &format!("by {}; {} points, {} outside the calibrated area{}", calibration.dealt_word(), held_out.point_count, held_out.outside_count, failed_folds(held_out))))
            } @else {
                (card("Held-out check", "none", "too few poses to leave some out"))
            }
            @if let Some(checks) = &calibration.checks {
                @match &checks.half_data {
                    HalfDataCheck::Compared(halves) => {
                        (card("Half-data check", &format!("ratio {:.2}", halves.ratio), &format!("two halves of the poses differ by {} mm RMS, {} predicted", short(halves.difference_rms_mm), short(halves.predicted_rms_mm))))
                    }
                    HalfDataCheck::Skipped(_) => (card("Half-data check", "none", &words::half_data(&checks.half_data))),
                }
            }
            (card("Corner noise", &px(facts.sigma_px), "standard deviation per axis, robust estimate"))
            (card("Residual", &px(facts.rms_px), &format!("RMS residual vector of the {} corners used", facts.corners_used)))
            @for (k, baseline_mm) in facts.baseline_mm.iter().enumerate() {
                (card("Baseline", &format!("{baseline_mm:.2} mm"), &pair(facts, k)))
            }
            @if let Some(distance) = facts.working_distance_mm {
                (card("Working distance", &format!("{:.0} mm", distance.median), &format!("camera to board, {:.0} to {:.0} mm", distance.least, distance.most)))
            }
            (card("Images", &facts.views_used.to_string(), &format!("of {} poses; left out in whole or in part: {}", facts.poses_used, facts.left_out)))
            (card("Rejected corners", &facts.corners_rejected.to_string(), &share_rejected(facts)))
            @for camera in &facts.cameras {
                (card(
                    &format!("Camera {}", camera.name),
                    &format!("{:.0} %", 100.0 * camera.covered_share),
                    &format!("of {} x {} px calibrated, {} images{}", camera.sensor_px[0], camera.sensor_px[1], camera.views, if camera.central { "" } else { ", non-central" }),
                ))
                @if let (Some([fx, fy]), Some([cx, cy]), Some(rms_px)) = (camera.focal_px, camera.principal_point_px, camera.pinhole_rms_px) {
                    (card(
                        &format!("Nearest pinhole of {}", camera.name),
                        &format!("{fx:.1} px"),
                        &format!("focal length along u, {fy:.1} along v; principal point ({cx:.1}, {cy:.1}); {} px RMS from the rays", short(rms_px)),
                    ))
                }
            }
            @if let Some(blob) = blob {
                (card("Blob", &format!("{} kB", short(blob.bytes as f64 / 1000.0)), &blob.warning().unwrap_or_else(|| format!("{} bytes, within {} px of the calibration", blob.bytes, short(blob.max_error_px)))))
            }
        }
    }
}

fn failed_folds(held_out: &HeldOutRecord) -> String {
    let failures = held_out.fold_failures.iter();
    failures.fold(String::new(), |text, failed| {
        text + &format!("; fold {} gave no estimate: {}", failed.fold, failed.reason)
    })
}

fn share_rejected(facts: &Facts) -> String {
    let offered = facts.corners_used + facts.corners_rejected;
    if offered == 0 {
        return String::new();
    }
    let percent = 100.0 * facts.corners_rejected as f64 / offered as f64;
    format!("{} % of {offered}", short(percent))
}

fn figures(calibration: &Calibration) -> Markup {
    html! {
        (group("Coverage", &coverage::draw(calibration),
            "Each dot is a corner. Shaded parts of the sensor are not calibrated: a pixel there gets no ray. Good: dots everywhere, to the edges. To enlarge the calibrated area, record poses with the board over the shaded parts."))
        (group("Uncertainty of points", &uncertainty_map::draw(calibration),
            "Predicted from the estimate, as if nothing were wrong with the model: compare with the held-out errors above. Good: even colors where you measure. The calibration alone grows towards the border of the calibrated area: record more poses there if it matters. A rigid motion of all points together is not in it."))
        (group("Residual vectors", &residual_vectors::draw(calibration),
            "Each line is what the model did not explain at one corner, colored by its direction. Good: short lines in mixed colors. Bad: neighbors with one color, which is a pattern that noise does not make: a lens the model cannot follow, a bent board, or something that moved between the cameras."))
        (group("Distribution", histogram::draw(calibration).as_slice(),
            "Bars are the residuals, the line is Gaussian noise of the size found. Good: bars under the line and centered on zero. Long tails are poor corners; a shifted or doubled peak is a mistake in the data."))
        (group("Poses", pose_rms::draw(calibration).as_slice(),
            "Good: all bars near the upright line. A pose that stands out was blurred, moved or mislabeled: look at its images, and leave it out with --exclude. If one camera is longer throughout, look at its focus."))
        (group("Cameras and boards", &scene::draw(calibration),
            "Good: the distances are those of the real set-up, and every board lies before the cameras. Boards that fill the space you measure in, at several tilts, determine the rays best."))
        (group("Convergence", cost::draw(calibration).as_slice(),
            "Good: falls quickly and ends flat. A curve that still falls at its end was stopped too early."))
    }
}

fn group(title: &str, figures: &[Figure], how_to_read: &str) -> Markup {
    html! {
        @if !figures.is_empty() {
            section {
                h2 { (title) }
                p.read { strong { "How to read this. " } (how_to_read) }
                div.figures {
                    @for figure in figures {
                        figure {
                            @if figure.title != title { h3 { (figure.title) } }
                            (PreEscaped(&figure.svg))
                            figcaption { (figure.caption) }
                        }
                    }
                }
            }
        }
    }
}

fn provenance(calibration: &Calibration) -> Markup {
    let board = &calibration.board;
    html! {
        footer {
            dl {
                dt { "Program" } dd { "calib-offline " (calibration.tool_version) ", method " (calibration.method) }
                dt { "Board" } dd { (board.words()) }
                dt { "Input" } dd { "SHA-256 " code { (calibration.input_sha256) } }
                dt { "Conventions" } dd { "Millimeters. The center of the top-left pixel is (0, 0), u right, v down. The rig frame is the " (calibration.rig.frame()) "." }
                dt { "Numbers" } dd { "Everything drawn here stands in calibration.json." }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::example;
    use crate::snapshot::{assert_snapshot, visible_text};
    use calib_blob::pack::CurvePoint;

    fn blob() -> BlobFacts {
        let point = |bytes, error_px| CurvePoint {
            bytes,
            error_px,
            error_mm: 0.4 * error_px,
        };
        BlobFacts {
            bytes: 48_320,
            max_error_px: 0.00042,
            max_error_mm: 0.00017,
            wanted_error_px: 0.001,
            search_ended_early: false,
            curve: vec![point(160, 0.7), point(672, 0.012), point(2400, 0.0004)],
        }
    }

    #[test]
    fn the_page_stands_alone() {
        let page = page(&example::calibration(), Some(&blob()));
        // To look at it: EXAMPLE_REPORT=page.html cargo test the_page_stands_alone
        if let Some(path) = std::env::var_os("EXAMPLE_REPORT") {
            std::fs::write(path, &page).unwrap();
        }
        for part in [
            "http:", "https:", "<script", "src=", "href=", "@import", "url(",
        ] {
            assert!(!page.contains(part), "{part} in the page");
        }
        assert!(!page.contains("NaN"));
        assert_snapshot("page", &visible_text(&page));
    }

    #[test]
    fn names_and_reasons_cannot_break_the_page() {
        let mut calibration = example::calibration();
        calibration.rig.cameras[0].name = "<b>&".to_owned();
        calibration.left_out[0].reason = "<script>".to_owned();
        let page = page(&calibration, None);
        assert!(!page.contains("<b>&"));
        assert!(!page.contains("<script>"));
    }

    #[test]
    fn a_bare_calibration_gives_a_page_too() {
        let mut calibration = example::calibration();
        calibration.cameras = Vec::new();
        calibration.rig.cameras.truncate(1);
        calibration.corners.clear();
        calibration.poses.clear();
        calibration.left_out.clear();
        calibration.held_out = None;
        calibration.choices = None;
        calibration.checks = None;
        (calibration.task, calibration.certificate) = (None, None);
        calibration.recording = None;
        calibration.estimate.cost_per_iteration.clear();
        calibration.estimate.sigma_px = f64::NAN;
        assert_snapshot("bare_page", &visible_text(&page(&calibration, None)));
    }
}
