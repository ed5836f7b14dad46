//! What `detect` says of an image, whether it looked for the board or for the measurement target.

use calib_recording::dataset::Dataset;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// How many of what was looked for.
#[derive(Debug, Clone, Copy, Serialize)]
pub enum Found {
    /// Corners of the board.
    #[serde(rename = "corner_count")]
    Corners(usize),
    /// Markers of the measurement target.
    #[serde(rename = "marker_count")]
    Markers(usize),
}

/// An image in JSON. Figures are told in words after what was found.
#[derive(Debug, Serialize)]
pub struct ImageObject<Figures> {
    /// Name of its camera.
    pub camera: String,
    /// Number of the pose.
    pub pose: usize,
    /// Where it is.
    pub file: PathBuf,
    /// Whether it is used.
    pub verdict: Verdict,
    /// What was found.
    #[serde(flatten)]
    pub found: Found,
    /// Whether that is less than there is.
    pub partial: bool,
    /// Corners of the board that were not found, and how many of them should be in the image.
    #[serde(flatten)]
    pub missing: Option<MissingObject>,
    /// How the labels were turned, if it is used.
    pub quarter_turns: Option<u8>,
    /// Why it is refused.
    pub reason: Option<String>,
    /// What was measured in it.
    pub figures: Option<Figures>,
}

/// What was not found of the board in an image that is used.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct MissingObject {
    /// Corners of the board.
    pub missing_count: usize,
    /// Those of them whose place lies in the image.
    pub missing_in_view: usize,
}

impl Display for MissingObject {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (count, in_view) = (self.missing_count, self.missing_in_view);
        write!(f, "; {count} not found, {in_view} of them in view")
    }
}

/// Whether an image is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It is.
    Ok,
    /// It is not.
    Refused,
}

impl Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Corners(count) => write!(f, "{count} corners"),
            Self::Markers(count) => write!(f, "{count} markers"),
        }
    }
}

impl<Figures: Display> ImageObject<Figures> {
    fn in_words(&self) -> String {
        let file = self.file.file_name().unwrap_or_default().to_string_lossy();
        let (pose, whole) = match self.found {
            Found::Corners(_) => ("pose", "board"),
            Found::Markers(_) => ("target pose", "target"),
        };
        let found = match (&self.reason, &self.figures) {
            (Some(reason), _) => format!("refused: {reason}"),
            (None, None) => self.found.to_string(),
            (None, Some(figures)) if self.partial => {
                let missing = self.missing.map_or_else(String::new, |m| m.to_string());
                format!("{} (part of the {whole}{missing}), {figures}", self.found)
            }
            (None, Some(figures)) => format!("{}, {figures}", self.found),
        };
        format!("{} {pose} {} ({file}): {found}", self.camera, self.pose)
    }
}

/// A line per image, `remarks` of one line each, and the sum.
pub fn in_words<Figures: Display>(
    images: &[ImageObject<Figures>],
    remarks: impl IntoIterator<Item = String>,
    used: usize,
    found: Found,
) -> String {
    let lines = images.iter().map(ImageObject::in_words).chain(remarks);
    let lines: String = lines.map(|line| line + "\n").collect();
    format!("{lines}{used} of {} images used, {found}", images.len())
}

/// The name of a camera; its number if the dataset has none.
pub fn camera_name(dataset: &Dataset, camera_idx: usize) -> String {
    let camera = dataset.cameras.get(camera_idx);
    camera.map_or_else(|| camera_idx.to_string(), |c| c.name.clone())
}
