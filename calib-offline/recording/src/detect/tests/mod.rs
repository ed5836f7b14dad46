//! Detection on rendered boards with known corners, and on the real images if they are there.

mod accuracy;
mod datasets;
mod exact;
mod noise;
mod photo;
mod sharp;
mod single;

use photo::{Photo, tilted};

use super::*;
use crate::dataset::{BoardKind, CameraSpec, StageSpec};
use crate::detect::consistency::ConsistencyError;
use calib_rays::geometry::SensorSize;
use calib_rays::progress::Silent;
use std::path::Path;

const SENSOR: SensorSize = SensorSize::new(640, 480);

fn board(rows: usize, cols: usize) -> BoardSpec {
    BoardSpec::chessboard(rows, cols, 10.0)
}

/// Writes the photos as PNG and describes them as a dataset; one list of photos per camera.
fn dataset(folder: &Path, board: BoardSpec, stage: bool, cameras: &[Vec<Photo>]) -> Dataset {
    let cameras = cameras
        .iter()
        .enumerate()
        .map(|(camera_idx, photos)| CameraSpec {
            name: format!("camera{camera_idx}"),
            sensor: SENSOR,
            images: photos
                .par_iter()
                .enumerate()
                .map(|(pose, photo)| {
                    let path = folder.join(format!("{camera_idx}_{pose}.png"));
                    photo.save(&path);
                    Some(path)
                })
                .collect(),
            optics: None,
            serial: None,
        })
        .collect();
    Dataset {
        folder: folder.to_path_buf(),
        kind: BoardKind::Chessboard,
        board,
        cameras,
        stage: stage.then(StageSpec::default),
        known_poses: [].into(),
        known_poses_file: None,
        excluded_poses: std::collections::BTreeSet::new(),
        target: None,
        certificate: None,
        recording: None,
    }
}

fn detect(dataset: &Dataset) -> Result<Detection, DetectError> {
    detect_dataset(dataset, &DetectSettings::default(), &Silent)
}

/// The largest distance of a view's corners from the photo's, each compared with the corner of the
/// same label, px.
fn worst_px(view: &View, photo: &Photo) -> f64 {
    let distance = |c: &Corner| photo.true_corner(c.row, c.col).distance_px(c.pixel);
    view.corners.iter().map(distance).fold(0.0, f64::max)
}

/// As [`worst_px`], if all labels are turned by half a turn.
fn worst_half_turned_px(view: &View, photo: &Photo) -> f64 {
    let distance = |c: &Corner| {
        let (row, col) = photo.board.half_turned(c.row, c.col);
        photo.true_corner(row, col).distance_px(c.pixel)
    };
    view.corners.iter().map(distance).fold(0.0, f64::max)
}
