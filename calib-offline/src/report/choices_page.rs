//! The page's section on what the estimate chose by itself, and what a central model would cost.

use super::record::{Calibration, ChoicesRecord};
use super::words;
use crate::present::numbers::short;
use calib_estimate::joint::Family;
use calib_estimate::joint::choice::NEEDED_GAIN;
use calib_judge::CrossChecks;
use maud::{Markup, html};

/// The sections; nothing for a record of an earlier version.
pub fn draw(calibration: &Calibration) -> Markup {
    html! {
        @if let Some(checks) = &calibration.checks { (cross_checks(calibration, checks)) }
        @if let Some(choices) = &calibration.choices { (chosen(calibration, choices)) }
    }
}

fn cross_checks(calibration: &Calibration, checks: &CrossChecks) -> Markup {
    html! {
        section {
            h2 { "Checks against itself" }
            p.read { strong { "How to read this. " } "The half-data check calibrates from every other pose and from the rest, and compares points of the same pixels at the working distance, a rigid motion apart. Good: a ratio within what chance allows. Above it, errors go together in a way that the estimate does not know, so its standard deviations are too small. What both halves have in common cancels and is not seen: the square's size, a board that is always bent the same way, detail of the lens that both halves smooth away alike (then the ratio is small)." }
            dl {
                dt { "Half-data check" } dd { (words::half_data(&checks.half_data)) }
                dt { "Central model" } dd { (words::central_model(&checks.central_model)) }
            }
            div.scroll {
                table {
                    thead { tr { th { "Camera" } th { "Model" } th { "Nearest point x, y, z, camera frame" } } }
                    tbody {
                        @for (camera_idx, (camera, found)) in calibration.rig.cameras.iter().zip(&checks.centrality).enumerate() {
                            tr {
                                td { (camera.name) }
                                td { @match words::camera_model(calibration, camera_idx) { Some(model) => (model), None => "-" } }
                                td.number {
                                    @for (k, x) in found.point_in_camera_mm.iter().enumerate() { @if k > 0 { ", " } (short(*x)) }
                                    " mm"
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Families of numbers that any camera has, in the order of the record.
fn families(choices: &ChoicesRecord) -> Vec<Family> {
    let mut families = Vec::new();
    for found in &choices.smoothness {
        if !families.contains(&found.family) {
            families.push(found.family);
        }
    }
    families
}

fn chosen(calibration: &Calibration, choices: &ChoicesRecord) -> Markup {
    html! {
        section {
            h2 { "Chosen by the data" }
            p.read { strong { "How to read this. " } "Evidence is twice the logarithm of how probable a model makes the data: a more flexible model is taken if it gains more than " (NEEDED_GAIN) ", and kept as long as a simpler one loses more than that. Of the numbers that a model has, the data use as many as they determine; the others are held by smoothness. Offsets and splines are also held against boards that no fold learned from: t is the mean change of their residuals in its own standard deviations, above 0 if the simpler model is worse; what they speak against beyond the limit is dropped." }
            dl {
                @if calibration.board.layout.is_grid() {
                    dt { "Board's shape" } dd { (words::board(choices)) }
                }
                dt { "Noise" } dd { (words::noise(choices)) }
                @if let Some(found) = &choices.unseen {
                    dt { "Unseen boards" } dd { (words::model_choice(found)) }
                }
            }
            div.figures {
                div.scroll {
                    table {
                        thead { tr { th { "Tried" } th { "Evidence" } th { "Taken" } } }
                        tbody {
                            @for choice in &choices.tried {
                                tr {
                                    td { (words::alternative(choice, calibration)) }
                                    td.number { (words::gain(choice)) }
                                    td { (if choice.taken { "yes" } else { "no" }) }
                                }
                            }
                        }
                    }
                }
                div.scroll {
                    table {
                        thead { tr { th { "Numbers used" } @for camera in &calibration.rig.cameras { th { (camera.name) } } } }
                        tbody {
                            @for family in families(choices) {
                                tr {
                                    td { (words::family(family)) }
                                    @for camera_idx in 0..calibration.rig.cameras.len() {
                                        td.number {
                                            @match choices.numbers(camera_idx, |own| own == family) {
                                                Some(numbers) => { (format!("{:.1}", numbers.effective)) " of " (numbers.all) }
                                                None => "-",
                                            }
                                        }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}
