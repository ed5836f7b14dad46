//! The page's section on what was found about the recording.

use super::record::Calibration;
use crate::present::numbers::short;
use maud::{Markup, html};

/// The section; nothing where nothing was found.
pub fn draw(calibration: &Calibration) -> Markup {
    html! {
        @if !calibration.causes.is_empty() {
            section {
                h2 { "What was found about the recording" }
                p.read { strong { "How to read this. " } "Most likely first. Best grade: what the verdict can be at most while this stands. Cost: RMS error that it leaves in measured points at the working distance, beside the noise." }
                div.scroll {
                    table {
                        thead { tr { th { "Cause" } th { "Since pose" } th { "Size" } th { "Cost" } th { "Best grade" } th { "What it is" } } }
                        tbody {
                            @for cause in &calibration.causes {
                                tr {
                                    td { (cause.code.word()) }
                                    td.number { @match cause.since_pose { Some(pose) => (pose), None => "-" } }
                                    td { (cause.size) }
                                    td.number { (short(cause.cost_mm)) " mm" }
                                    td { (cause.grade) }
                                    td { (cause.text) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}
