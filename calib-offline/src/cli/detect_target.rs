//! `detect --target`: from a dataset's images of the measurement target to labelled markers, with a
//! verdict on every image.

use super::detect::DetectArgs;
use super::detect_image::{Found, ImageObject, Verdict, camera_name, in_words};
use super::error::Error;
use calib_rays::observed::View;
use calib_rays::progress::Progress;
use calib_recording::dataset::Dataset;
use calib_recording::detect::ring_target::{
    TargetDetection, TargetError, TargetFigures, TargetImage, TargetSettings, detect_target,
    overlay::write_all,
};
use serde::Serialize;
use std::fmt::{self, Display};

/// What the command found.
#[derive(Debug)]
pub struct TargetReport {
    /// The markers to write to `markers.csv`; at least one view.
    pub views: Vec<View>,
    /// What `--json` prints.
    pub object: TargetObject,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
pub struct TargetObject {
    schema: &'static str,
    images: Vec<ImageObject<FiguresObject>>,
    /// Images with markers.
    pub used: usize,
    /// Markers in all of them.
    pub marker_count: usize,
}

#[derive(Debug, Serialize)]
struct FiguresObject {
    contrast_percent: f64,
    edge_px: f64,
    radius_px: f64,
    residual_percent: f64,
    sigma_px: f64,
    perspective_px: f64,
}

/// Finds the markers and writes the overlays that are asked for; `markers.csv` is the caller's. Tells
/// `narrate` of the verdicts if no image can be used.
///
/// # Errors
/// [`Error::Target`], [`Error::Overlay`].
pub fn run(
    args: &DetectArgs,
    dataset: &Dataset,
    progress: &dyn Progress,
    narrate: impl Fn(&str),
) -> Result<TargetReport, Error> {
    let detection = detect_target(dataset, &TargetSettings::default(), progress)?;
    if let Some(folder) = &args.overlay {
        write_all(folder, dataset, &detection, progress)?;
    }
    let object = TargetObject::new(dataset, &detection);
    let views = detection.into_views().inspect_err(|error| {
        if matches!(error, TargetError::AllRefused { .. }) {
            narrate(&object.in_words());
        }
    })?;
    Ok(TargetReport { views, object })
}

impl TargetObject {
    fn new(dataset: &Dataset, detection: &TargetDetection) -> Self {
        let image =
            |image: &TargetImage| image_object(image, camera_name(dataset, image.camera_idx));
        Self {
            schema: "calib-offline/detect-target/1",
            images: detection.images.iter().map(image).collect(),
            used: detection.views.len(),
            marker_count: detection.views.iter().map(|v| v.corners.len()).sum(),
        }
    }

    /// The report in words: a line per image.
    pub fn in_words(&self) -> String {
        let found = Found::Markers(self.marker_count);
        in_words(&self.images, None, self.used, found)
    }
}

fn image_object(image: &TargetImage, camera: String) -> ImageObject<FiguresObject> {
    let located = image.outcome.as_ref();
    ImageObject {
        camera,
        pose: image.pose,
        file: image.path.clone(),
        verdict: located.map_or(Verdict::Refused, |_| Verdict::Ok),
        found: Found::Markers(located.map_or(0, |located| located.markers.len())),
        partial: image.figures.is_some_and(|figures| figures.partial),
        missing: None,
        quarter_turns: located.ok().map(|located| located.quarter_turns),
        reason: located.err().map(ToString::to_string),
        figures: image.figures.as_ref().map(FiguresObject::from),
    }
}

impl Display for FiguresObject {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(
            f,
            "contrast {:.0} %, edges {:.1} px wide, sigma {:.4} px, perspective {:.3} px",
            self.contrast_percent, self.edge_px, self.sigma_px, self.perspective_px
        )
    }
}

impl From<&TargetFigures> for FiguresObject {
    fn from(figures: &TargetFigures) -> Self {
        Self {
            contrast_percent: figures.contrast_percent,
            edge_px: figures.edge_px,
            radius_px: figures.radius_px,
            residual_percent: figures.residual_percent,
            sigma_px: figures.sigma_px,
            perspective_px: figures.perspective_px,
        }
    }
}
