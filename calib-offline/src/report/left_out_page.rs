//! The page's sections on what was left out, and on what was used otherwise than recorded.

use super::record::Calibration;
use maud::{Markup, html};

/// Both sections; the second only if there is something in it.
pub fn draw(calibration: &Calibration) -> Markup {
    html! {
        (left_out(calibration))
        (renumbered(calibration))
    }
}

fn left_out(calibration: &Calibration) -> Markup {
    html! {
        section {
            h2 { "Left out" }
            @if calibration.left_out.is_empty() {
                p { "Nothing: every image was used." }
            } @else {
                div.scroll {
                    table {
                        thead { tr { th { "Pose" } th { "Camera" } th { "Corners" } th { "Reason" } } }
                        tbody {
                            @for left in &calibration.left_out {
                                tr {
                                    td.number { (left.pose) }
                                    td { (left.camera.as_deref().unwrap_or("all")) }
                                    td.number { (left.corner_count) }
                                    td { (left.reason) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn renumbered(calibration: &Calibration) -> Markup {
    html! {
        @if !calibration.renumbered.is_empty() {
            section {
                h2 { "Renumbered" }
                p.read { "These images are used, with their corners numbered from the other end of the board." }
                div.scroll {
                    table {
                        thead { tr { th { "Pose" } th { "Camera" } th { "Reason" } } }
                        tbody {
                            @for view in &calibration.renumbered {
                                tr { td.number { (view.pose) } td { (view.camera) } td { (view.reason) } }
                            }
                        }
                    }
                }
            }
        }
    }
}
