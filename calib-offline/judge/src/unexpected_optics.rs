//! Rays that do not meet in a point, behind optics that were declared to be ordinary.

use super::cause::{Cause, Code};
use super::central_model::CentralModel;
use super::grade::Grade;
use calib_recording::dataset::{Dataset, ExpectedOptics};

/// A reason of its own where the data want offsets for cameras whose `optics` is `plain`, which have none for that;
/// `None` where nothing was declared, or no ray asks for it.
pub fn unexpected_optics(dataset: &Dataset, central: &CentralModel) -> Option<Cause> {
    let CentralModel::Declared {
        points,
        offsets_gain,
    } = central
    else {
        return None;
    };
    let declared = dataset.cameras.iter();
    let names: Vec<&str> = declared
        .filter(|camera| camera.optics == Some(ExpectedOptics::Plain))
        .map(|camera| camera.name.as_str())
        .collect();
    let cost_mm = points.map_or(0.0, |points| points.rms_mm);
    let moved = points.map_or(String::new(), |_| {
        format!(" and move measured points by {cost_mm:.3} mm RMS")
    });
    Some(Cause {
        code: Code::NonCentralUnexpected,
        since_pose: None,
        size: format!("rays that need not meet would gain {offsets_gain:.0} of evidence"),
        cost_mm,
        text: format!(
            "the optics of camera {} is \"plain\", so its rays meet in a point; rays that need not would gain \
             {offsets_gain:.0} of evidence{moved}; look for a fault of the board or of the recording, or declare \
             what stands before the lens (optics = \"window\")",
            names.join(" and ")
        ),
        grade: Grade::Doubtful,
    })
}
