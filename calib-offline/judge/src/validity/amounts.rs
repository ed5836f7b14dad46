//! A change as signed amounts in words that one can act on: which way a camera turned, how much longer a
//! focal length is.

use calib_estimate::explain::{Explanation, Suspect};
use serde::Serialize;

/// One signed number of a change: after it minus before.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Amount {
    /// The camera; `None` for all, and for the board.
    pub camera: Option<String>,
    /// What: positive as the words say. Directions are the camera's own, seen from behind it.
    pub what: &'static str,
    /// How much.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// The unit of both.
    pub unit: &'static str,
}

impl Amount {
    /// In words.
    pub fn words(&self) -> String {
        let Self {
            what,
            value,
            sd,
            unit,
            ..
        } = self;
        // Two digits of the standard deviation.
        let decimals = (1.0 - sd.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
        format!("{what} {value:+.decimals$} +- {sd:.decimals$} {unit}")
    }
}

/// The numbers of an explanation that one can act on; none of those that differ from pose to pose.
pub fn amounts(found: &Explanation, names: &[String], baselines_mm: &[f64]) -> Vec<Amount> {
    let name = |idx: usize| names.get(idx).cloned();
    let amount = |camera: Option<String>, k: usize, what, factor: f64, unit| Amount {
        camera,
        what,
        value: factor * found.values.get(k).copied().unwrap_or(0.0),
        sd: factor.abs() * found.sd.get(k).copied().unwrap_or(0.0),
        unit,
    };
    // The scene turns and moves in the camera: the camera does the contrary.
    let turn = |camera: usize| {
        let degree = -1f64.to_degrees();
        vec![
            amount(name(camera), 1, "turned right by", degree, "degrees"),
            amount(name(camera), 0, "turned up by", degree, "degrees"),
            amount(name(camera), 2, "rolled clockwise by", degree, "degrees"),
        ]
    };
    match found.suspect {
        Suspect::Turned { camera_idx } => turn(camera_idx),
        Suspect::Moved { camera_idx } => {
            let mut all = turn(camera_idx);
            let ways = ["moved right by", "moved down by", "moved forward by"];
            let moved = ways.into_iter().enumerate();
            all.extend(moved.map(|(k, way)| amount(name(camera_idx), 3 + k, way, -1.0, "mm")));
            all
        }
        Suspect::Baseline { camera_idx } => {
            let length_mm = baselines_mm.get(camera_idx).copied().unwrap_or(1.0);
            let share = 100.0 / length_mm;
            vec![
                amount(name(camera_idx), 0, "longer by", 1.0, "mm"),
                amount(name(camera_idx), 0, "longer by", share, "%"),
            ]
        }
        Suspect::Focus { camera_idx } => {
            let camera = camera_idx.and_then(name);
            vec![amount(camera, 0, "focal length longer by", 100.0, "%")]
        }
        Suspect::Shift { camera_idx } => (0..found.values.len() / 2)
            .flat_map(|k| {
                let camera = name(camera_idx.unwrap_or(k));
                [
                    amount(camera.clone(), 2 * k, "u larger by", 1.0, "px"),
                    amount(camera, 2 * k + 1, "v larger by", 1.0, "px"),
                ]
            })
            .collect(),
        Suspect::BoardScale | Suspect::BoardShear => {
            vec![amount(None, 0, "squares longer along a row by", 100.0, "%")]
        }
        Suspect::BoardFlexes | Suspect::Late { .. } | Suspect::RollingShutter => Vec::new(),
    }
}

/// What the data cannot tell about it.
pub fn cannot_tell(found: &Explanation, names: &[String], amounts: &[Amount]) -> Option<String> {
    let [first, second] = [0, 1].map(|k| names.get(k).map_or("", String::as_str));
    match found.suspect {
        Suspect::Turned { .. } | Suspect::Moved { .. } if names.len() == 2 => Some(format!(
            "with two cameras a change of one looks like the contrary change of the other: {second} or {first}"
        )),
        Suspect::Baseline { .. } if names.len() == 2 => {
            let percent = amounts.get(1).map_or(0.0, |amount| -amount.value);
            Some(format!(
                "a board whose squares measure {percent:+.3} % of what they did would look the same, with the \
                 cameras where they were: measure the board"
            ))
        }
        _ => None,
    }
}
