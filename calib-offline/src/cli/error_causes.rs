//! What is wrong with a recording where an error says so already: the same codes as those of a calibration.

use super::error::Error;
use crate::pipeline::CalibrateError;
use calib_judge::verdict::Grade;
use calib_judge::{Cause, Code};
use calib_recording::dataset::image::ImageError;
use calib_recording::dataset::{CornersError, ManifestError, SufficiencyError};
use calib_recording::detect::{DetectError, OddImage};
use std::error::Error as _;

impl Error {
    /// Causes, most likely first; empty where the recording is not at fault.
    pub fn causes(&self) -> Vec<Cause> {
        if let Self::Calibrate(CalibrateError::Implausible { causes, .. }) = self {
            return causes.clone();
        }
        let code = match self {
            Self::Manifest(error) => of_manifest(error),
            Self::Calibrate(error) => of_calibration(error),
            _ => None,
        };
        let text = self
            .source()
            .map_or_else(|| self.to_string(), ToString::to_string);
        code.into_iter()
            .map(|code| Cause {
                code,
                since_pose: None,
                size: String::new(),
                cost_mm: 0.0,
                text: text.clone(),
                grade: Grade::Fail,
            })
            .collect()
    }
}

fn of_manifest(error: &ManifestError) -> Option<Code> {
    match error {
        ManifestError::UnequalImages { .. } | ManifestError::StageLength { .. } => {
            Some(Code::PoseNumbering)
        }
        ManifestError::ImageUsedTwice { .. } => Some(Code::Duplicates),
        ManifestError::SquareSize { .. } => Some(Code::SquareUnit),
        _ => None,
    }
}

fn of_calibration(error: &CalibrateError) -> Option<Code> {
    match error {
        CalibrateError::Corners(error) => of_corners(error),
        CalibrateError::Misread { known, .. } => known.code(),
        CalibrateError::Detect(DetectError::BrokenImage { source, .. }) => match &**source {
            ImageError::WrongSize {
                found, expected, ..
            } if (found.width, found.height) == (expected.height, expected.width) => {
                Some(Code::UvExchanged)
            }
            ImageError::WrongSize { .. } => Some(Code::ImageSize),
            _ => None,
        },
        CalibrateError::Detect(DetectError::WrongSizes { images, .. }) => {
            let is_turned = |image: &OddImage| {
                (image.found.width, image.found.height)
                    == (image.expected.height, image.expected.width)
            };
            Some(if images.iter().all(is_turned) {
                Code::UvExchanged
            } else {
                Code::ImageSize
            })
        }
        CalibrateError::Detect(DetectError::WrongCount { found, stated, .. })
            if (found.rows, found.cols) == (stated.cols, stated.rows) =>
        {
            Some(Code::RowsColsSwapped)
        }
        CalibrateError::Sufficiency(source) | CalibrateError::FewImages { source, .. } => {
            match source {
                SufficiencyError::SameView { .. } => Some(Code::Duplicates),
                SufficiencyError::TooFewPoses { .. }
                | SufficiencyError::Flat { .. }
                | SufficiencyError::FewPoints { .. } => Some(Code::FewPoses),
                _ => None,
            }
        }
        _ => None,
    }
}

fn of_corners(error: &CornersError) -> Option<Code> {
    match error {
        CornersError::OutOfBoard {
            rows,
            cols,
            largest_row,
            largest_col,
            ..
        } => Some(if largest_row < cols && largest_col < rows {
            Code::RowsColsSwapped
        } else {
            Code::LabelsShifted
        }),
        CornersError::OutsideImage { sensor, most, .. } => {
            let fits = |u: f64, v: f64| u < f64::from(sensor.width) && v < f64::from(sensor.height);
            Some(if fits(most.v, most.u) {
                Code::UvExchanged
            } else {
                Code::ImageSize
            })
        }
        CornersError::StageLength { .. } => Some(Code::PoseNumbering),
        _ => None,
    }
}
