//! What the checks say, before the parts are put into one list.

use crate::cause::{Cause, Code};
use crate::verdict::Grade;

/// A view that is meant otherwise than it is written.
#[derive(Debug, Clone, PartialEq)]
pub struct Explained {
    /// Number of the pose.
    pub pose: usize,
    /// Index of the camera.
    pub camera_idx: usize,
    /// What it is.
    pub code: Code,
    /// What it is, in words that go on from "the view fits ...".
    pub reading: String,
}

/// A cause without time.
pub fn cause(code: Code, grade: Grade, size: String, cost_mm: f64, text: String) -> Cause {
    Cause {
        code,
        since_pose: None,
        size,
        cost_mm,
        text,
        grade,
    }
}

/// Numbers of poses in words: `pose 3`, `poses 3, 5 and 7`, `poses 0 to 6`.
pub fn pose_list(poses: &[usize]) -> String {
    match poses {
        [] => "no pose".to_owned(),
        [one] => format!("pose {one}"),
        [first, .., last] if poses.len() > 2 && last - first + 1 == poses.len() => {
            format!("poses {first} to {last}")
        }
        [most @ .., last] => {
            const SHOWN: usize = 8;
            let words: Vec<String> = most.iter().take(SHOWN).map(usize::to_string).collect();
            if most.len() > SHOWN {
                format!(
                    "poses {} and {} more",
                    words.join(", "),
                    poses.len() - SHOWN
                )
            } else {
                format!("poses {} and {last}", words.join(", "))
            }
        }
    }
}

/// A length in the unit in which people say it; from mm.
pub fn length(mm: f64) -> String {
    let (value, unit) = match mm.abs() {
        x if x < 0.1 => (1000.0 * mm, "micrometers"),
        x if x < 1000.0 => (mm, "mm"),
        x if x < 1e6 => (mm / 1000.0, "m"),
        _ => (mm / 1e6, "km"),
    };
    format!("{} {unit}", digits(value))
}

/// Three digits that count, without exponent.
pub fn digits(value: f64) -> String {
    let magnitude = value.abs().max(1e-12).log10().floor();
    let decimals = (2.0 - magnitude).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_for_poses_and_lengths() {
        assert_eq!(pose_list(&[3]), "pose 3");
        assert_eq!(pose_list(&[3, 4, 5]), "poses 3 to 5");
        assert_eq!(pose_list(&[3, 5]), "poses 3 and 5");
        assert_eq!(length(0.0234), "23.4 micrometers");
        assert_eq!(length(1834.0), "1.83 m");
        assert_eq!(length(124.0), "124 mm");
    }
}
