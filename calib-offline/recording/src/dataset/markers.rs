//! `markers.csv`: the labelled markers of the measurement target.

use super::corners::error::CornersError;
use super::corners::read_corners;
use super::description::Dataset;
use calib_rays::board::BoardSpec;
use calib_rays::observed::View;

/// The labelled markers beside the manifest, in the format of `corners.csv`; `None` if there is no
/// `markers.csv` or the manifest has no target.
///
/// A pose is the index of a target image; views come by pose, then camera.
///
/// # Errors
/// [`CornersError`], with the line; rows and columns are those of the target.
pub fn load_markers(dataset: &Dataset) -> Result<Option<Vec<View>>, CornersError> {
    let path = dataset.markers_path();
    match &dataset.target {
        Some(target) if path.exists() => {
            // The reader checks labels against a board: this one has the target's rows and columns.
            let labels = Dataset {
                board: BoardSpec::chessboard(target.rows, target.cols, target.pitch_mm),
                ..dataset.clone()
            };
            read_corners(&labels, &path).map(Some)
        }
        _ => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{BoardKind, CameraSpec, TargetSpec};
    use calib_rays::geometry::SensorSize;

    #[test]
    fn markers_are_read_with_the_rows_and_columns_of_the_target() {
        let folder = tempfile::tempdir().unwrap();
        let mut dataset = Dataset {
            folder: folder.path().to_owned(),
            kind: BoardKind::Chessboard,
            board: BoardSpec::chessboard(3, 3, 10.0),
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
            excluded_poses: std::collections::BTreeSet::new(),
            target: Some(TargetSpec {
                rows: 7,
                cols: 9,
                pitch_mm: 12.0,
                outer_radius_mm: 4.0,
                direction_outer_radius_mm: 5.0,
                direction: vec![(2, 3)],
                images: Vec::new(),
            }),
            certificate: None,
            recording: None,
        };
        assert_eq!(load_markers(&dataset).unwrap(), None);
        let write = |rows: &str| {
            std::fs::write(
                folder.path().join("markers.csv"),
                format!("camera,pose,row,col,u,v\n{rows}"),
            )
            .unwrap();
        };
        write("left,4,6,8,1.5,2\n");
        let views = load_markers(&dataset).unwrap().unwrap();
        assert_eq!((views[0].pose, views[0].corners[0].row), (4, 6));
        write("left,4,7,8,1.5,2\n");
        let error = load_markers(&dataset).unwrap_err();
        assert!(matches!(error, CornersError::OutOfBoard { rows: 7, .. }));
        dataset.target = None;
        assert_eq!(load_markers(&dataset).unwrap(), None);
    }
}
