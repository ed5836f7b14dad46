//! A name for what went into a calibration: equal exactly when the facts are equal.

use super::Dataset;
use calib_rays::board::Layout;
use calib_rays::observed::View;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;

/// SHA-256, hex, over the manifest's facts and the corners.
///
/// The facts, not the files: comments, the order of keys, the folder's place and how a number was
/// written do not matter; every value that an estimate could depend on does, bit for bit. Image
/// files count only through the corners found in them.
pub fn input_sha256(dataset: &Dataset, views: &[View]) -> String {
    let mut facts = String::from("calib-offline/input/1\n");
    let board = &dataset.board;
    // Writing to a String cannot fail.
    let _ = writeln!(
        facts,
        "board {} {} {}",
        board.rows, board.cols, board.square_mm
    );
    // Its scale is in the squares; the rest changes no estimate.
    if let Some(flatness_mm) = dataset.certificate.and_then(|c| c.flatness_mm_sd) {
        let _ = writeln!(facts, "flatness {flatness_mm}");
    }
    for camera in &dataset.cameras {
        let _ = writeln!(facts, "camera {} {}", camera.name, camera.sensor);
    }
    if let Some(stage) = &dataset.stage {
        let _ = writeln!(facts, "stage {:?} {:?}", stage.angles_deg, stage.placement);
    }
    for (pose, known) in &dataset.known_poses {
        let _ = writeln!(facts, "known {pose} {known:?}");
    }
    if let Layout::Rectangles(height_mm) = dataset.board.layout {
        let _ = writeln!(facts, "height {height_mm}");
    }
    if let Layout::Face(places) = &dataset.board.layout {
        let _ = writeln!(facts, "face {places:?}");
    }
    for col in 0..dataset.board.cols {
        if dataset.board.layout.is_grid() {
            break;
        }
        let place = dataset.board.corner_in_board(0, col);
        let sigma_mm = dataset.board.place_sigma_mm(col);
        let _ = writeln!(facts, "place {place:?} {sigma_mm}");
    }
    let _ = writeln!(facts, "exclude {:?}", dataset.excluded_poses);
    let mut hash = Sha256::new();
    hash.update(&facts);
    for view in views {
        facts.clear();
        let _ = writeln!(facts, "view {} {}", view.camera_idx, view.pose);
        for corner in &view.corners {
            let _ = writeln!(
                facts,
                "{} {} {:016x} {:016x} {:016x}",
                corner.row,
                corner.col,
                corner.pixel.u.to_bits(),
                corner.pixel.v.to_bits(),
                corner.sigma_px.map_or(0, f64::to_bits),
            );
        }
        hash.update(&facts);
    }
    hex(&hash.finalize())
}

/// Bytes as hexadecimal digits: how identities are shown.
pub fn hex(bytes: &[u8]) -> String {
    bytes
        .iter()
        .fold(String::with_capacity(2 * bytes.len()), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{BoardKind, CameraSpec, Certificate};
    use calib_rays::board::BoardSpec;
    use calib_rays::geometry::{PixelPoint, SensorSize};
    use calib_rays::observed::Corner;

    #[test]
    fn every_fact_changes_it_and_the_folder_does_not() {
        let dataset = Dataset {
            folder: "a".into(),
            kind: BoardKind::Chessboard,
            board: BoardSpec::chessboard(5, 4, 10.0),
            cameras: vec![CameraSpec {
                name: "left".to_owned(),
                sensor: SensorSize::new(640, 480),
                images: Vec::new(),
                optics: None,
                serial: None,
            }],
            stage: None,
            known_poses: [].into(),
            known_poses_file: None,
            excluded_poses: [3].into(),
            target: None,
            certificate: None,
            recording: None,
        };
        let views = vec![View {
            camera_idx: 0,
            pose: 0,
            corners: vec![Corner {
                row: 1,
                col: 2,
                pixel: PixelPoint::new(1.5, 2.5),
                sigma_px: None,
            }],
        }];
        let hash = input_sha256(&dataset, &views);
        assert_eq!(hash.len(), 64);
        let mut moved = dataset.clone();
        moved.folder = "b".into();
        assert_eq!(input_sha256(&moved, &views), hash);

        let mut changed = vec![dataset.clone(); 4];
        changed[0].board.square_mm = 10.000000000000002;
        changed[1].excluded_poses.clear();
        changed[2].cameras[0].sensor.width = 641;
        changed[3].certificate = Some(Certificate {
            flatness_mm_sd: Some(0.01),
            ..Certificate::default()
        });
        for other in changed {
            assert_ne!(input_sha256(&other, &views), hash);
        }
        let mut other = views.clone();
        other[0].corners[0].pixel.v = 2.5000000000000004;
        assert_ne!(input_sha256(&dataset, &other), hash);
    }
}
