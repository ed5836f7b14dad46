//! What was found in a dataset's images of the target.

use super::error::TargetError;
use super::verdict::TargetImage;
use calib_rays::observed::View;

/// The target's markers in a dataset's images of it.
#[derive(Debug)]
pub struct TargetDetection {
    /// The labelled markers by camera and pose, in the form of corners: `pose` is the index of the
    /// target image, row and column are those on the target.
    pub views: Vec<View>,
    /// One verdict per image, by camera and pose.
    pub images: Vec<TargetImage>,
}

impl TargetDetection {
    /// The views.
    ///
    /// # Errors
    /// [`TargetError::AllRefused`] if there are none.
    pub fn into_views(self) -> Result<Vec<View>, TargetError> {
        if !self.views.is_empty() {
            return Ok(self.views);
        }
        let first = self.images.iter().find_map(|image| {
            let refusal = image.outcome.as_ref().err()?;
            Some(format!("{}: {refusal}", image.path.display()))
        });
        Err(TargetError::AllRefused {
            total: self.images.len(),
            first: first.unwrap_or_default(),
        })
    }
}
