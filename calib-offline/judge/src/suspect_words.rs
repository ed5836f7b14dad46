//! Explanations in words.

use super::cause::Code;
use calib_estimate::explain::{Explanation, Suspect};
use calib_estimate::joint::Estimate;
use calib_rays::board::{BoardSpec, Layout};
use nalgebra::Vector3;

/// What is told of an explanation.
pub(crate) struct Told {
    /// Its code.
    pub code: Code,
    /// How large it is.
    pub size: String,
    /// What happened.
    pub what: String,
}

/// An explanation in words.
pub(crate) fn told(found: &Explanation, estimate: &Estimate, names: &[String]) -> Told {
    let name = |camera_idx: usize| {
        let name = names.get(camera_idx).map_or("", String::as_str);
        format!("camera {name}")
    };
    let beside = |camera_idx: usize| {
        if camera_idx == 0 {
            "the others".to_owned()
        } else {
            name(0)
        }
    };
    let who = |camera_idx: Option<usize>| camera_idx.map_or_else(|| "all cameras".to_owned(), name);
    let at = |k: usize| found.values.get(k).copied().unwrap_or(0.0);
    let sd = |k: usize| found.sd.get(k).copied().unwrap_or(0.0);
    let degrees = |from: usize| {
        Vector3::new(at(from), at(from + 1), at(from + 2))
            .norm()
            .to_degrees()
    };
    match found.suspect {
        Suspect::BoardScale | Suspect::BoardShear => squares(found, &estimate.observations.board),
        Suspect::BoardFlexes => flexes(found),
        Suspect::Shift { camera_idx } => {
            let code = match found.half_pixels() {
                Some(pixels) if pixels.iter().all(|x| x.abs() <= 1.0) => Code::PixelOrigin,
                _ => Code::WindowShifted,
            };
            let pairs = (0..found.values.len() / 2)
                .map(|k| format!("({:.2}, {:.2}) px", at(2 * k), at(2 * k + 1)));
            Told {
                code,
                size: pairs.collect::<Vec<_>>().join(" and "),
                what: format!("the pixels of {} moved", who(camera_idx)),
            }
        }
        Suspect::Focus { camera_idx } => Told {
            code: Code::FocusChanged,
            size: format!(
                "focal length {:+.3} +- {:.3} %",
                100.0 * at(0),
                100.0 * sd(0)
            ),
            what: format!("the focus of {} changed", who(camera_idx)),
        },
        Suspect::Turned { camera_idx } => Told {
            code: Code::CameraMoved,
            size: format!("{:.4} degrees", degrees(0)),
            what: format!("{} turned against {}", name(camera_idx), beside(camera_idx)),
        },
        Suspect::Moved { camera_idx } => {
            let moved_mm = Vector3::new(at(3), at(4), at(5)).norm();
            Told {
                code: Code::CameraMoved,
                size: format!("{:.4} degrees and {moved_mm:.3} mm", degrees(0)),
                what: format!("{} moved against {}", name(camera_idx), beside(camera_idx)),
            }
        }
        Suspect::Baseline { camera_idx } => {
            let baseline = estimate.model.cameras.get(camera_idx);
            let length_mm = baseline.map_or(0.0, |c| c.camera_from_rig.translation_mm.norm());
            Told {
                code: Code::BaselineChanged,
                size: format!("{:.3} mm of {length_mm:.1} mm", at(0).abs()),
                what: format!(
                    "the distance from {} to {} changed",
                    name(0),
                    name(camera_idx)
                ),
            }
        }
        Suspect::Late { camera_idx } => {
            let moved_mm = (0..3).map(|k| found.rms(k, 3).powi(2)).sum::<f64>().sqrt();
            Told {
                code: Code::NotSimultaneous,
                size: format!("the board moved by {moved_mm:.3} mm RMS between the exposures"),
                what: format!(
                    "{} and {} did not expose at the same instant",
                    name(0),
                    name(camera_idx)
                ),
            }
        }
        Suspect::RollingShutter => Told {
            code: Code::RollingShutter,
            size: format!(
                "{:.3} px RMS from the middle to the edge",
                calib_rays::numerics::rms(&found.values).unwrap_or(0.0)
            ),
            what: "images are sheared differently in every pose".to_owned(),
        },
    }
}

fn squares(found: &Explanation, board: &BoardSpec) -> Told {
    let at = |k: usize| found.values.get(k).copied().unwrap_or(0.0);
    let sd_percent = 100.0 * found.sd.first().copied().unwrap_or(0.0);
    let longer = if at(0) > 0.0 { "row" } else { "column" };
    let shear = if found.suspect == Suspect::BoardShear {
        format!(
            ", rows and columns {:.3} degrees from a right angle",
            at(1).to_degrees()
        )
    } else {
        String::new()
    };
    Told {
        code: Code::SquareScaleAxis,
        size: format!(
            "squares {:.3} +- {sd_percent:.3} % longer along a {longer}{shear}{}",
            100.0 * at(0).abs(),
            line_to_write(board, at(0))
        ),
        what: match board.layout {
            Layout::Rectangles(_) => "the board's squares are not as high as described".to_owned(),
            _ => "the board's squares are not square".to_owned(),
        },
    }
}

/// What the description would be of a chessboard whose squares are longer by this share along a row than stated,
/// against along a column: which of the two is off the images do not tell, so the one along a row is kept.
fn line_to_write(board: &BoardSpec, longer: f64) -> String {
    if !matches!(board.layout, Layout::Grid | Layout::Rectangles(_)) {
        return String::new();
    }
    let [width_mm, height_mm] = board.square_sides_mm();
    format!(
        " (if square_mm = {width_mm} is right along a row, write square_height_mm = {:.4})",
        height_mm / (1.0 + longer)
    )
}

fn flexes(found: &Explanation) -> Told {
    let bend = calib_rays::numerics::rms(&found.values).unwrap_or(0.0);
    Told {
        code: Code::BoardFlexes,
        size: format!("{bend:.3} mm RMS in each term of its shape"),
        what: "the board has another shape in every pose".to_owned(),
    }
}

/// What to do about it.
pub(crate) fn advice(code: Code) -> &'static str {
    match code {
        Code::SquareScaleAxis => {
            "measure the board along both directions, and write both (square_mm along a row, square_height_mm along a column), or print it anew"
        }
        Code::BoardFlexes => "use a stiffer board, or hold it without force",
        Code::PixelOrigin => "take all corners with one tool and one convention",
        Code::WindowShifted => "record all images with one region of the sensor",
        Code::FocusChanged => "lock the focus and calibrate again",
        Code::CameraMoved | Code::BaselineChanged => "fix the cameras and calibrate again",
        Code::NotSimultaneous => "trigger the cameras together, or hold the board still",
        Code::RollingShutter => "hold the board still, or use a global shutter",
        _ => "look at the recording",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_to_write_makes_the_squares_as_high_as_they_were_found() {
        let board = BoardSpec::chessboard(6, 9, 20.0);
        // Squares that are 0.5 % longer along a row are lower by as much.
        let line = line_to_write(&board, 0.005);
        assert!(line.contains("square_height_mm = 19.9005"), "{line}");
        let corrected = BoardSpec::rectangles(6, 9, 20.0, 19.9);
        let line = line_to_write(&corrected, -0.001);
        assert!(line.contains("square_height_mm = 19.9199"), "{line}");
        assert_eq!(line_to_write(&BoardSpec::points(Vec::new()), 0.005), "");
    }
}
