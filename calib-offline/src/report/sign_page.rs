//! What stands on the printed page to sign, beside verdict and figures: the user's measurement, what is declared of
//! the board, who recorded and when, and a line for the signature.

use super::record::{Calibration, CameraRecord};
use super::task;
use crate::present::numbers::short;
use maud::{Markup, html};

/// The sections. On a screen there is nothing to sign, and no empty section.
pub fn draw(calibration: &Calibration) -> Markup {
    html! {
        (measurement(calibration))
        (declared(calibration))
        (signature(calibration))
    }
}

fn measurement(calibration: &Calibration) -> Markup {
    html! {
        @if let Some(found) = &calibration.task {
            section.task {
                h2 { "Length of " (found.task.length_mm) " mm at " (found.task.distance_mm) " mm" }
                p { "Expected error: standard deviation " strong { (short(found.sd_mm)) " mm" } ", 95 % of errors within " strong { (short(found.error95_mm)) " mm" } ". Worst line: " (short(found.worst.sd_mm)) " mm, 95 % within " (short(found.worst.error95_mm)) " mm." }
                div.cards {
                    @for (name, share) in task::share_rows(&found.shares_mm) {
                        div.card { p.name { (name) } p.value { (share) } }
                    }
                }
                p.read { "By direction: " (task::by_direction(found)) ". " (task::assumed(found)) "." }
                p.read { "The five make it up: their squares add up. What is not declared is not in it ([board.certificate] in dataset.toml). This is a prediction from the estimate, and no acceptance test: measure --lengths checks known lengths." }
            }
        }
    }
}

fn declared(calibration: &Calibration) -> Markup {
    let facts = task::certificate(calibration);
    html! {
        @if !facts.is_empty() {
            section.certificate {
                h2 { "Declared of the board" }
                dl { @for (name, fact) in &facts { dt { (name) } dd { (fact) } } }
            }
        }
    }
}

fn signature(calibration: &Calibration) -> Markup {
    let recording = calibration.recording.clone().unwrap_or_default();
    let serial =
        |camera: &CameraRecord| Some(format!("{} {}", camera.name, camera.serial.as_ref()?));
    let serials: Vec<String> = calibration.cameras.iter().filter_map(serial).collect();
    let serials = (!serials.is_empty()).then(|| serials.join(", "));
    let field = |name: &str, value: Option<&String>| {
        html! { p { span.field { (name) } span.blank { @if let Some(value) = value { (value) } } } }
    };
    html! {
        section.sign {
            (field("Recording", recording.name.as_ref()))
            (field("Recorded by", recording.by.as_ref()))
            (field("Recorded on", recording.date.as_ref()))
            (field("Serial numbers", serials.as_ref()))
            (field("Input SHA-256", Some(&calibration.input_sha256)))
            (field("Date", None))
            (field("Name", None))
            (field("Signature", None))
        }
    }
}
