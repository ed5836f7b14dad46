//! Rays that do not meet in a point, behind optics that were declared to be ordinary.

use super::cause::{Cause, Code};
use super::central_model::CentralModel;
use super::grade::Grade;
use calib_rays::field::Rig;
use calib_recording::dataset::{Dataset, ExpectedOptics};

/// A reason of its own where the data want offsets for cameras whose `optics` is `plain`; `None` where
/// nothing was declared, or no ray asks for it.
pub fn unexpected_optics(dataset: &Dataset, rig: &Rig, central: &CentralModel) -> Option<Cause> {
    let CentralModel::Costs {
        points,
        evidence_loss,
    } = central
    else {
        return None;
    };
    let cameras = dataset.cameras.iter().zip(&rig.cameras);
    let names: Vec<&str> = cameras
        .filter(|(declared, found)| {
            declared.optics == Some(ExpectedOptics::Plain) && !found.field.is_central()
        })
        .map(|(declared, _)| declared.name.as_str())
        .collect();
    if names.is_empty() {
        return None;
    }
    let cost_mm = points.map_or(0.0, |points| points.rms_mm);
    Some(Cause {
        code: Code::NonCentralUnexpected,
        since_pose: None,
        size: format!("a central model would lose {evidence_loss:.0} of evidence"),
        cost_mm,
        text: format!(
            "the rays of camera {} do not meet in a point although its optics is \"plain\"; it moves \
             measured points by {cost_mm:.3} mm RMS; look for a fault of the board or of the recording, or \
             declare what stands before the lens (optics = \"window\")",
            names.join(" and ")
        ),
        grade: Grade::Doubtful,
    })
}
