//! What would be lost if every camera were taken to have one center of projection.

use super::working_volume::{Match, PointDifference, compare};
use calib_estimate::joint::{Alternative, Choice, Estimate};
use calib_rays::field::Rig;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Twice the log evidence that says something against what a camera is declared to be: "very strong" (Kass and Raftery
/// 1995), as for every fault.
const DECLARED_GAIN: f64 = 10.0;

/// The cost of a central model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CentralModel {
    /// Nothing: every camera is central.
    IsCentral {
        /// Twice the log evidence that offsets would have gained, below 0 if they lose; `None` if
        /// the data leave them open.
        offsets_gain: Option<f64>,
    },
    /// The rig was estimated again without offsets.
    Costs {
        /// Twice the log evidence lost.
        evidence_loss: f64,
        /// How far points of the volume with boards move, a rigid motion apart; `None` for one
        /// camera, which measures none.
        points: Option<PointDifference>,
    },
    /// Without offsets there is no estimate.
    NoEstimate,
    /// Cameras are declared to be central, and the data would have offsets for them.
    Declared {
        /// Twice the log evidence that a model with offsets for all cameras would gain, above 10.
        offsets_gain: f64,
        /// How far points of the volume with boards would move, a rigid motion apart; `None` for one camera.
        points: Option<PointDifference>,
    },
}

/// Estimates without offsets, and compares.
///
/// Cost: a few rounds of the estimate; none for a central rig.
pub fn central_model(estimate: &Estimate, rig: &Rig, matches: &[Match]) -> CentralModel {
    let names = || {
        rig.cameras
            .iter()
            .map(|c| c.name.clone())
            .collect::<Vec<_>>()
    };
    let moved = |other: &Estimate| {
        let compared = compare(rig, &other.rig(&names()), matches);
        compared.map(|compared| compared.difference)
    };
    let forbidden = estimate.forbidden.as_ref();
    if let Some(forbidden) = forbidden.filter(|forbidden| forbidden.gain > DECLARED_GAIN) {
        return CentralModel::Declared {
            offsets_gain: forbidden.gain,
            points: estimate.made_non_central().as_ref().and_then(moved),
        };
    }
    if rig.cameras.iter().all(|camera| camera.field.is_central()) {
        return CentralModel::IsCentral {
            offsets_gain: forbidden
                .map(|forbidden| forbidden.gain)
                .or_else(|| offsets_gain(&estimate.choices)),
        };
    }
    let central = estimate.made_central().ok();
    let Some(central) = central.filter(|central| central.evidence_loss.is_finite()) else {
        return CentralModel::NoEstimate;
    };
    CentralModel::Costs {
        evidence_loss: central.evidence_loss,
        points: moved(&central.estimate),
    }
}

/// What offsets would have gained a rig that ended without them.
fn offsets_gain(choices: &[Choice]) -> Option<f64> {
    let mut offered = choices.iter().filter(|choice| {
        use Alternative::{Offsets, OffsetsAfresh, OffsetsFirst, OffsetsForSpline};
        matches!(
            choice.tried,
            Offsets | OffsetsAfresh | OffsetsFirst | OffsetsForSpline
        )
    });
    if !offered.clone().any(|choice| choice.taken) {
        // Of several offers the later stands: the earlier was against a spline.
        return offered.next_back()?.gain;
    }
    // They were taken at first, and dropped later with a gain of its own.
    let dropped = choices.iter().filter(|choice| {
        use Alternative::{AllCentral, Central};
        choice.taken && matches!(choice.tried, AllCentral | Central { .. })
    });
    dropped
        .map(|choice| choice.gain)
        .sum::<Option<f64>>()
        .map(|gain| -gain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_that_were_dropped_again_lose_what_dropping_gained() {
        let choice = |tried, gain, taken| Choice {
            tried,
            gain: Some(gain),
            taken,
        };
        let refused = [choice(Alternative::Offsets, -7.0, false)];
        assert_eq!(offsets_gain(&refused), Some(-7.0));
        let dropped = [
            choice(Alternative::Offsets, 30.0, true),
            choice(Alternative::Central { camera_idx: 0 }, -12.0, false),
            choice(Alternative::Central { camera_idx: 0 }, 2.0, true),
            choice(Alternative::Central { camera_idx: 1 }, -1.0, true),
        ];
        assert_eq!(offsets_gain(&dropped), Some(-1.0));
        assert_eq!(offsets_gain(&[]), None);
    }
}
