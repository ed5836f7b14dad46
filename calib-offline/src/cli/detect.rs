//! `detect`: from a dataset's images to labelled corners, with a verdict on every image.

use super::detect_image::{Found, ImageObject, MissingObject, Verdict, camera_name, in_words};
use super::error::Error;
use calib_rays::observed::View;
use calib_rays::progress::Progress;
use calib_recording::dataset::Dataset;
use calib_recording::detect::overlay::write_all;
use calib_recording::detect::verdict::{ImageFigures, ImageVerdict, Outcome};
use calib_recording::detect::{DetectSettings, Detection, PairCheck, TurnedImage, detect_dataset};
use clap::Args;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

const EXAMPLE: &str = "\
Example:
  calib-offline detect recordings/monday --overlay /tmp/monday
  calib-offline calibrate recordings/monday -o results/monday
  calib-offline detect recordings/monday --target";

const FORMATS: &str = "\
Finds the board of dataset.toml in every image that is not excluded and writes
DATASET/corners.csv (camera,pose,row,col,u,v,sigma_px). Every image gets a verdict; a refused one
says why. The same corner has the same label in every image of every camera; what cannot be
decided is an error. The overlay shows row 0 in orange, corner (0, 0) in a red square, and an empty
diamond where a corner of the board should be and was not found.

With --json, schema calib-offline/detect/1:
  images (camera, pose, file, verdict, corner_count, partial, missing_count, missing_in_view,
    quarter_turns, reason, figures (
    contrast_percent, edge_px, square_px, residual_percent, sigma_px))
  turned (camera, pose, quarter_turns)
  pair_checks (first_camera, second_camera, poses, median_px, worst_pose, worst_px)
  used, corner_count

With --target, the ring markers of [target] are found in the target_images instead, and written to
DATASET/markers.csv in the same format, their centers corrected for the perspective; pose counts the
target images. With --json, schema calib-offline/detect-target/1:
  images (camera, pose, file, verdict, marker_count, partial, quarter_turns, reason, figures (
    contrast_percent, edge_px, radius_px, residual_percent, sigma_px, perspective_px))
  used, marker_count";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct DetectArgs {
    /// The folder with dataset.toml
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// Write each image with its corners drawn in, as PNG, to this folder
    #[arg(long, value_name = "DIR")]
    pub overlay: Option<PathBuf>,
    /// Find the measurement target instead of the board
    #[arg(long)]
    pub target: bool,
    /// Replace corners.csv (or markers.csv) if it exists
    #[arg(long)]
    pub force: bool,
}

/// What the command found.
#[derive(Debug)]
pub struct DetectReport {
    /// The corners to write to `corners.csv`; none if no image could be used: exit code 3.
    pub views: Vec<View>,
    /// What `--json` prints.
    pub object: DetectObject,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
pub struct DetectObject {
    schema: &'static str,
    images: Vec<ImageObject<FiguresObject>>,
    turned: Vec<TurnedObject>,
    pair_checks: Vec<PairObject>,
    /// Images with corners.
    pub used: usize,
    /// Corners in all of them.
    pub corner_count: usize,
}

#[derive(Debug, Serialize)]
struct FiguresObject {
    contrast_percent: f64,
    edge_px: f64,
    square_px: f64,
    residual_percent: f64,
    sigma_px: f64,
}

#[derive(Debug, Serialize)]
struct TurnedObject {
    camera: String,
    pose: usize,
    quarter_turns: u8,
}

#[derive(Debug, Serialize)]
struct PairObject {
    first_camera: String,
    second_camera: String,
    poses: usize,
    median_px: f64,
    worst_pose: usize,
    worst_px: f64,
}

/// Finds the corners and writes the overlays that are asked for; `corners.csv` is the caller's.
///
/// # Errors
/// That of the detection, [`Error::Overlay`].
pub fn run(
    args: &DetectArgs,
    dataset: &Dataset,
    progress: &dyn Progress,
) -> Result<DetectReport, Error> {
    let detection = detect_dataset(dataset, &DetectSettings::default(), progress)?;
    if let Some(folder) = &args.overlay {
        write_all(folder, dataset, &detection, progress)?;
    }
    let object = DetectObject::new(dataset, &detection);
    Ok(DetectReport {
        views: detection.views,
        object,
    })
}

impl DetectObject {
    fn new(dataset: &Dataset, detection: &Detection) -> Self {
        let name = |camera_idx| camera_name(dataset, camera_idx);
        let turned = |turned: &TurnedImage| TurnedObject {
            camera: name(turned.camera_idx),
            pose: turned.pose,
            quarter_turns: turned.quarter_turns,
        };
        let pair = |check: &PairCheck| PairObject {
            first_camera: name(0),
            second_camera: name(check.camera_idx),
            poses: check.pose_count,
            median_px: check.median_px,
            worst_pose: check.worst_pose,
            worst_px: check.worst_px,
        };
        let image = |image: &ImageVerdict| image_object(image, name(image.camera_idx));
        Self {
            schema: "calib-offline/detect/1",
            images: detection.images.iter().map(image).collect(),
            turned: detection.turned.iter().map(turned).collect(),
            pair_checks: detection.pair_checks.iter().map(pair).collect(),
            used: detection.views.len(),
            corner_count: detection.views.iter().map(|v| v.corners.len()).sum(),
        }
    }

    /// The report in words: a line per image, then what stands out.
    pub fn in_words(&self) -> String {
        let turned = self.turned.iter().map(TurnedObject::in_words);
        let remarks = turned.chain(self.pair_checks.iter().map(PairObject::in_words));
        let found = Found::Corners(self.corner_count);
        in_words(&self.images, remarks, self.used, found)
    }
}

impl TurnedObject {
    fn in_words(&self) -> String {
        let degrees = i32::from(self.quarter_turns) * 90;
        format!(
            "turned: {} pose {} by {} degrees against most images",
            self.camera,
            self.pose,
            if degrees > 180 {
                degrees - 360
            } else {
                degrees
            }
        )
    }
}

impl PairObject {
    fn in_words(&self) -> String {
        format!(
            "{} and {} agree to {:.2} px (median distance from epipolar lines, {} poses; \
             worst pose {}: {:.2} px)",
            self.first_camera,
            self.second_camera,
            self.median_px,
            self.poses,
            self.worst_pose,
            self.worst_px
        )
    }
}

fn image_object(image: &ImageVerdict, camera: String) -> ImageObject<FiguresObject> {
    let (corner_count, partial, quarter_turns, reason) = match &image.outcome {
        Outcome::Used {
            corner_count,
            partial,
            quarter_turns,
        } => (*corner_count, *partial, Some(*quarter_turns), None),
        Outcome::Refused(refusal) => (0, false, None, Some(refusal.to_string())),
    };
    ImageObject {
        camera,
        pose: image.pose,
        file: image.path.clone(),
        verdict: match reason {
            None => Verdict::Ok,
            Some(_) => Verdict::Refused,
        },
        found: Found::Corners(corner_count),
        partial,
        missing: Some(MissingObject {
            missing_count: image.missing.len(),
            missing_in_view: image.missing.iter().filter(|c| c.pixel.is_some()).count(),
        }),
        quarter_turns,
        reason,
        figures: image.figures.as_ref().map(FiguresObject::from),
    }
}

impl Display for FiguresObject {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (contrast, edge, sigma) = (self.contrast_percent, self.edge_px, self.sigma_px);
        write!(
            f,
            "contrast {contrast:.0} %, edges {edge:.1} px wide, sigma {sigma:.3} px"
        )
    }
}

impl From<&ImageFigures> for FiguresObject {
    fn from(figures: &ImageFigures) -> Self {
        Self {
            contrast_percent: figures.contrast_percent,
            edge_px: figures.edge_px,
            square_px: figures.square_px,
            residual_percent: figures.residual_percent,
            sigma_px: figures.sigma_px,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::board::BoardSpec;
    use calib_rays::geometry::SensorSize;
    use calib_rays::progress::Silent;
    use calib_recording::dataset::{BoardKind, CameraSpec};

    #[test]
    fn a_refused_image_is_named_in_words_and_in_json_and_framed_in_its_overlay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("left07.png");
        image::GrayImage::from_pixel(64, 48, image::Luma([90]))
            .save(&path)
            .unwrap();
        let dataset = Dataset {
            folder: folder.path().to_path_buf(),
            kind: BoardKind::Chessboard,
            board: BoardSpec::chessboard(6, 9, 25.0),
            cameras: vec![CameraSpec {
                name: "left".to_string(),
                sensor: SensorSize::new(64, 48),
                images: vec![None, Some(path)],
                optics: None,
                serial: None,
            }],
            stage: None,
            known_poses: [].into(),
            known_poses_file: None,
            excluded_poses: std::collections::BTreeSet::new(),
            target: None,
            certificate: None,
            recording: None,
        };
        let overlays = folder.path().join("overlays");
        let args = DetectArgs {
            dataset: folder.path().to_path_buf(),
            overlay: Some(overlays.clone()),
            target: false,
            force: false,
        };
        let report = run(&args, &dataset, &Silent).unwrap();
        assert!(report.views.is_empty());
        let words = report.object.in_words();
        assert!(words.contains("left pose 1 (left07.png): refused: too little contrast"));
        assert!(words.ends_with("0 of 1 images used, 0 corners"));
        let json = serde_json::to_value(&report.object).unwrap();
        assert_eq!(json["images"][0]["verdict"], "refused");
        assert_eq!(json["images"][0]["pose"], 1);
        let overlay = image::open(overlays.join("left_001.png"))
            .unwrap()
            .to_rgb8();
        assert_eq!(overlay.get_pixel(0, 0).0, [255, 0, 0]);
    }
}
