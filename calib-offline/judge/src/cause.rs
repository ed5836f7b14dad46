//! What is wrong with a recording: one vocabulary for what is seen before a fit, what the fit shows,
//! and what a later check of the calibration finds.

use super::grade::Grade;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Something found about a recording or a calibration.
///
/// A list of them is sorted, most likely first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Cause {
    /// What it is.
    #[serde(rename = "cause")]
    pub code: Code,
    /// First pose that it concerns; `None` if all do, or if that is no question of time.
    pub since_pose: Option<usize>,
    /// How large it is, with its unit, in words.
    pub size: String,
    /// RMS error that it leaves in measured points at the working distance, mm.
    pub cost_mm: f64,
    /// A sentence: what was found, how one sees it, and what to do.
    pub text: String,
    /// The best grade that a calibration with it can have.
    pub grade: Grade,
}

/// The kinds of [`Cause`].
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Code {
    /// Meters, centimeters or inches taken for millimeters.
    SquareUnit,
    /// Squares that are not square: another scale along one axis, or shear.
    SquareScaleAxis,
    /// Rows taken for columns.
    RowsColsSwapped,
    /// Labels from the board's other end.
    LabelsTurned,
    /// Labels as in a mirror.
    LabelsMirrored,
    /// Labels off by whole rows or columns.
    LabelsShifted,
    /// Views of one camera under another's name.
    CamerasExchanged,
    /// v counted upwards.
    VUpwards,
    /// u and v exchanged.
    UvExchanged,
    /// Another resolution or binning.
    ImageSize,
    /// Another region of the sensor.
    WindowShifted,
    /// A half or a whole pixel between tools.
    PixelOrigin,
    /// The cameras did not expose at the same instant.
    NotSimultaneous,
    /// The board's shape changes from pose to pose.
    BoardFlexes,
    /// The board is not flat.
    BoardBowed,
    /// One or both focal lengths changed.
    FocusChanged,
    /// One camera turned or moved against the other.
    CameraMoved,
    /// The same image or corners more than once.
    Duplicates,
    /// The board was hardly tilted.
    FewTilts,
    /// All boards at one distance, seen frontally.
    OneDepth,
    /// Few poses.
    FewPoses,
    /// A small part of the sensor was used.
    Coverage,
    /// Noisy corners.
    Noise,
    /// Corners that do not belong to the rest.
    Outliers,
    /// Lines of one image exposed at different times.
    RollingShutter,
    /// Dial readings that contradict the poses found.
    StageAngles,
    /// Poses counted from 1, a dropped or doubled frame.
    PoseNumbering,
    /// The distance between two cameras changed.
    BaselineChanged,
    /// Rays that do not meet in a point, where the optics ought to be ordinary.
    NonCentralUnexpected,
    /// Unsharp images.
    Blur,
}

impl Code {
    /// Whether data were taken for others than they are: no fit of them means anything.
    pub const fn is_misread(self) -> bool {
        matches!(
            self,
            Self::SquareUnit
                | Self::RowsColsSwapped
                | Self::LabelsTurned
                | Self::LabelsMirrored
                | Self::LabelsShifted
                | Self::CamerasExchanged
                | Self::VUpwards
                | Self::UvExchanged
                | Self::ImageSize
                | Self::Duplicates
                | Self::PoseNumbering
        )
    }

    /// Its name in files.
    pub fn word(self) -> String {
        serde_json::to_value(self)
            .ok()
            .and_then(|value| value.as_str().map(str::to_owned))
            .unwrap_or_default()
    }
}

/// Sorts causes: those that lower the grade first, then by what they cost.
pub fn sort(causes: &mut [Cause]) {
    causes.sort_by(|a, b| {
        let costs = b.cost_mm.total_cmp(&a.cost_mm);
        b.grade.cmp(&a.grade).then(costs)
    });
}
