//! `detect --target`: from a dataset's images of the measurement target to labelled markers, with a
//! verdict on every image.

use super::detect::DetectArgs;
use super::error::Error;
use calib_rays::observed::View;
use calib_rays::progress::Progress;
use calib_recording::dataset::Dataset;
use calib_recording::detect::ring_target::{
    TargetDetection, TargetError, TargetFigures, TargetImage, TargetSettings, detect_target,
    overlay::write_all,
};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::PathBuf;

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
    images: Vec<ImageObject>,
    /// Images with markers.
    pub used: usize,
    /// Markers in all of them.
    pub marker_count: usize,
}

#[derive(Debug, Serialize)]
struct ImageObject {
    camera: String,
    pose: usize,
    file: PathBuf,
    verdict: &'static str,
    marker_count: usize,
    partial: bool,
    quarter_turns: Option<u8>,
    reason: Option<String>,
    figures: Option<FiguresObject>,
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
        let image = |image: &TargetImage| {
            let camera = dataset.cameras.get(image.camera_idx);
            let name = camera.map_or_else(|| image.camera_idx.to_string(), |c| c.name.clone());
            ImageObject::new(image, name)
        };
        Self {
            schema: "calib-offline/detect-target/1",
            images: detection.images.iter().map(image).collect(),
            used: detection.views.len(),
            marker_count: detection.views.iter().map(|v| v.corners.len()).sum(),
        }
    }

    /// The report in words: a line per image.
    pub fn in_words(&self) -> String {
        let mut text = String::new();
        for image in &self.images {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{}", image.in_words());
        }
        let _ = write!(
            text,
            "{} of {} images used, {} markers",
            self.used,
            self.images.len(),
            self.marker_count
        );
        text
    }
}

impl ImageObject {
    fn new(image: &TargetImage, camera: String) -> Self {
        let located = image.outcome.as_ref();
        Self {
            camera,
            pose: image.pose,
            file: image.path.clone(),
            verdict: if located.is_ok() { "ok" } else { "refused" },
            marker_count: located.map_or(0, |located| located.markers.len()),
            partial: image.figures.is_some_and(|figures| figures.partial),
            quarter_turns: located.ok().map(|located| located.quarter_turns),
            reason: located.err().map(ToString::to_string),
            figures: image.figures.as_ref().map(FiguresObject::from),
        }
    }

    fn in_words(&self) -> String {
        let file = self.file.file_name().unwrap_or_default().to_string_lossy();
        let head = format!("{} target pose {} ({file}): ", self.camera, self.pose);
        match (&self.reason, &self.figures) {
            (Some(reason), _) => format!("{head}refused: {reason}"),
            (None, None) => format!("{head}{} markers", self.marker_count),
            (None, Some(figures)) => format!(
                "{head}{} markers{}, contrast {:.0} %, edges {:.1} px wide, sigma {:.4} px, \
                 perspective {:.3} px",
                self.marker_count,
                if self.partial {
                    " (part of the target)"
                } else {
                    ""
                },
                figures.contrast_percent,
                figures.edge_px,
                figures.sigma_px,
                figures.perspective_px
            ),
        }
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
