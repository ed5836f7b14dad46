//! What a recording covers, before any estimate: which views there are, where on the sensor
//! corners were seen, and which shot to add.

use crate::dataset::{BoardKind, Dataset, check_sufficiency};
use calib_rays::field::CoverageMask;
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::observed::{Corner, View, poses};
use serde::Serialize;

/// Fewer poses than this leave little to hold out.
const FEW_POSES: usize = 10;
/// A smaller calibrated share of the sensor is worth a word.
const SMALL_SHARE: f64 = 0.7;
/// Fewer corners than this share of an even spread make a region of the sensor empty.
const EMPTY_REGION_SHARE: f64 = 0.1;

/// What a recording covers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Capture {
    /// Poses with corners.
    pub poses: usize,
    /// Poses that every camera saw.
    pub poses_seen_by_all: usize,
    /// Per camera, in the dataset's order.
    pub cameras: Vec<CameraCapture>,
    /// What to look at before calibrating.
    pub warnings: Vec<String>,
}

/// What one camera saw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CameraCapture {
    /// Its name.
    pub name: String,
    /// Views with corners.
    pub views: usize,
    /// All corners.
    pub corners: usize,
    /// Smallest, middle and largest number of corners in a view.
    pub corners_per_view: Option<[usize; 3]>,
    /// Share of the sensor that would be calibrated, 0 to 1.
    pub covered_share: f64,
    /// Corners in each ninth of the sensor, row by row.
    pub corners_per_ninth: [usize; 9],
}

const NINTHS: [&str; 9] = [
    "top left",
    "top",
    "top right",
    "left",
    "middle",
    "right",
    "bottom left",
    "bottom",
    "bottom right",
];

impl Capture {
    /// Looks at views of a dataset; poses that the user excludes should not be among them.
    pub fn of(dataset: &Dataset, views: &[View]) -> Self {
        let cameras: Vec<CameraCapture> = dataset
            .cameras
            .iter()
            .enumerate()
            .map(|(camera_idx, camera)| {
                let of_camera = views.iter().filter(|view| view.camera_idx == camera_idx);
                camera_capture(&camera.name, camera.sensor, &of_camera)
            })
            .collect();
        let all_poses = poses(views);
        let seen_by_all = |pose: &&usize| {
            let seen = views.iter().filter(|view| view.pose == **pose).count();
            seen == dataset.cameras.len()
        };
        let mut capture = Self {
            poses: all_poses.len(),
            poses_seen_by_all: all_poses.iter().filter(seen_by_all).count(),
            cameras,
            warnings: Vec::new(),
        };
        capture.warnings = capture.warnings(dataset, views);
        capture
    }

    fn warnings(&self, dataset: &Dataset, views: &[View]) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Err(error) = check_sufficiency(dataset, views) {
            warnings.push(format!("this cannot be calibrated: {error}"));
        } else if self.poses < FEW_POSES
            && dataset.board.layout.is_grid()
            && dataset.known_poses.is_empty()
        {
            warnings.push(format!(
                "{} poses are few: add tilts and distances, ten or more",
                self.poses
            ));
        }
        warnings.extend(board_warning(dataset, views));
        for (camera, spec) in self.cameras.iter().zip(&dataset.cameras) {
            warnings.extend(camera.warning(spec.sensor, views_reach(dataset, views, &camera.name)));
        }
        let without: Vec<String> = known_without_corners(dataset, views)
            .iter()
            .map(ToString::to_string)
            .collect();
        if !without.is_empty() {
            warnings.push(format!(
                "[poses] known has places of poses that no camera has corners of: {}",
                without.join(", ")
            ));
        }
        for pose in &dataset.excluded_poses {
            if views.iter().any(|view| view.pose == *pose) {
                warnings.push(format!("pose {pose} is excluded, but still counted here"));
            }
        }
        warnings
    }
}

/// Poses whose places are known, and of which no corners are there though nobody left them out.
pub fn known_without_corners(dataset: &Dataset, views: &[View]) -> Vec<usize> {
    let known = dataset.known_poses.keys().copied();
    known
        .filter(|pose| !dataset.excluded_poses.contains(pose))
        .filter(|pose| !views.iter().any(|view| view.pose == *pose))
        .collect()
}

impl CameraCapture {
    fn warning(&self, sensor: SensorSize, reach: PixelPoint) -> Option<String> {
        if self.corners == 0 {
            return None;
        }
        if reach.u < f64::from(sensor.width) / 2.0 && reach.v < f64::from(sensor.height) / 2.0 {
            return Some(format!(
                "camera {}: every corner lies in the top left quarter of {sensor} pixels; is that the size of the images?",
                self.name
            ));
        }
        let even = self.corners as f64 / 9.0;
        let empty: Vec<&str> = self
            .corners_per_ninth
            .iter()
            .zip(NINTHS)
            .filter(|(count, _)| (**count as f64) < EMPTY_REGION_SHARE * even)
            .map(|(_, name)| name)
            .collect();
        if empty.is_empty() && self.covered_share >= SMALL_SHARE {
            return None;
        }
        let share = 100.0 * self.covered_share;
        Some(if empty.is_empty() {
            format!(
                "camera {}: only {share:.0} % of the sensor would be calibrated; add poses with the board at the edges",
                self.name
            )
        } else {
            format!(
                "camera {}: hardly any corner at the {}; {share:.0} % of the sensor would be calibrated; add poses with the board there",
                self.name,
                empty.join(", ")
            )
        })
    }
}

fn camera_capture<'a>(
    name: &str,
    sensor: SensorSize,
    views: &(impl Iterator<Item = &'a View> + Clone),
) -> CameraCapture {
    let mut counts: Vec<usize> = views.clone().map(|view| view.corners.len()).collect();
    counts.sort_unstable();
    let pixels = || views.clone().flat_map(|v| &v.corners).map(|c| c.pixel);
    let mut corners_per_ninth = [0; 9];
    for pixel in pixels().filter(|p| sensor.contains(*p)) {
        let third =
            |value: f64, extent: u32| ((3.0 * (value + 0.5) / f64::from(extent)) as usize).min(2);
        corners_per_ninth[3 * third(pixel.v, sensor.height) + third(pixel.u, sensor.width)] += 1;
    }
    CameraCapture {
        name: name.to_owned(),
        views: counts.len(),
        corners: counts.iter().sum(),
        corners_per_view: match counts[..] {
            [] => None,
            [least, ..] => Some([least, counts[counts.len() / 2], counts[counts.len() - 1]]),
        },
        covered_share: CoverageMask::from_corners(sensor, pixels()).covered_share(),
        corners_per_ninth,
    }
}

fn views_reach(dataset: &Dataset, views: &[View], camera: &str) -> PixelPoint {
    views
        .iter()
        .filter(|view| dataset.cameras[view.camera_idx].name == camera)
        .flat_map(|view| &view.corners)
        .fold(PixelPoint::new(0.0, 0.0), |reach, corner| {
            PixelPoint::new(reach.u.max(corner.pixel.u), reach.v.max(corner.pixel.v))
        })
}

/// A board of which no view shows the last row or column may have been counted in squares.
fn board_warning(dataset: &Dataset, views: &[View]) -> Option<String> {
    let largest = |pick: fn(&Corner) -> usize| {
        let corners = views.iter().flat_map(|view| &view.corners);
        corners.map(pick).max().map(|largest| largest + 1)
    };
    let (rows, cols) = (largest(|c| c.row)?, largest(|c| c.col)?);
    let board = &dataset.board;
    let points = dataset.kind.points_in_a_word();
    let why = match dataset.kind {
        BoardKind::Chessboard | BoardKind::MarkedChessboard(_) | BoardKind::Charuco(_) => {
            "does the manifest count squares instead of inner corners?".to_owned()
        }
        _ => format!("are rows and cols those of its {}?", dataset.kind.counted()),
    };
    (rows < board.rows || cols < board.cols).then(|| {
        format!(
            "the {points} reach over {rows} rows and {cols} cols of a board with {} and {}: {why}",
            board.rows, board.cols
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::CameraSpec;
    use calib_rays::board::BoardSpec;
    use calib_rays::geometry::RigidTransform;
    use calib_rays::observed::KnownPose;

    fn dataset(sensor: SensorSize) -> Dataset {
        Dataset {
            folder: ".".into(),
            kind: BoardKind::Chessboard,
            board: BoardSpec::chessboard(4, 5, 10.0),
            cameras: vec![CameraSpec {
                name: "left".to_owned(),
                sensor,
                images: Vec::new(),
                optics: None,
                serial: None,
            }],
            stage: None,
            known_poses: [].into(),
            known_poses_file: None,
            excluded_poses: [].into(),
            target: None,
            certificate: None,
            recording: None,
        }
    }

    /// Full boards that fill a rectangle of the sensor, each a little less than the one before.
    fn views(count: usize, [u0, v0, u1, v1]: [f64; 4]) -> Vec<View> {
        let corner = |pose: usize, row: usize, col: usize| {
            let margin = 2.0 * pose as f64;
            Corner {
                row,
                col,
                pixel: PixelPoint::new(
                    u0 + margin + (u1 - u0 - margin) * col as f64 / 4.0,
                    v0 + margin + (v1 - v0 - margin) * row as f64 / 3.0,
                ),
                sigma_px: None,
            }
        };
        (0..count)
            .map(|pose| View {
                camera_idx: 0,
                pose,
                corners: (0..20).map(|k| corner(pose, k / 5, k % 5)).collect(),
            })
            .collect()
    }

    fn warnings(views: &[View]) -> Vec<String> {
        Capture::of(&dataset(SensorSize::new(900, 600)), views).warnings
    }

    #[test]
    fn a_full_recording_has_no_warning() {
        let views = views(12, [5.0, 5.0, 890.0, 590.0]);
        let capture = Capture::of(&dataset(SensorSize::new(900, 600)), &views);
        assert_eq!(capture.warnings, Vec::<String>::new());
        assert_eq!((capture.poses, capture.poses_seen_by_all), (12, 12));
        assert_eq!(capture.cameras[0].corners_per_view, Some([20, 20, 20]));
        assert_eq!(
            capture.cameras[0].corners_per_ninth.iter().sum::<usize>(),
            240
        );
    }

    #[test]
    fn known_poses_without_corners_are_named() {
        let mut dataset = dataset(SensorSize::new(900, 600));
        let place = |pose| {
            let known = KnownPose {
                rig_from_board: RigidTransform::identity(),
                sigma_mm: 0.0,
                sigma_rad: 0.0,
            };
            (pose, known)
        };
        dataset.known_poses = [0, 11, 12, 14].map(place).into();
        dataset.excluded_poses = [14].into();
        let views = views(12, [5.0, 5.0, 890.0, 590.0]);
        assert_eq!(known_without_corners(&dataset, &views), [12]);
        let warnings = Capture::of(&dataset, &views).warnings;
        assert!(
            warnings.iter().any(|w| w.ends_with("corners of: 12")),
            "{warnings:?}"
        );
    }

    #[test]
    fn empty_regions_are_named() {
        let all = warnings(&views(12, [5.0, 5.0, 500.0, 590.0]));
        assert_eq!(all.len(), 1);
        assert!(
            all[0].contains("top right, right, bottom right"),
            "{}",
            all[0]
        );
    }

    #[test]
    fn an_image_size_that_is_too_large_shows() {
        let all = warnings(&views(12, [5.0, 5.0, 440.0, 290.0]));
        assert!(all[0].contains("top left quarter of 900x600"), "{}", all[0]);
    }

    #[test]
    fn squares_counted_instead_of_corners_show() {
        let mut views = views(12, [5.0, 5.0, 890.0, 590.0]);
        for view in &mut views {
            view.corners.retain(|c| c.row < 3 && c.col < 4);
        }
        assert!(
            warnings(&views)
                .iter()
                .any(|w| w.contains("3 rows and 4 cols"))
        );
    }

    #[test]
    fn few_poses_and_too_few() {
        let full = [5.0, 5.0, 890.0, 590.0];
        assert!(warnings(&views(9, full))[0].contains("9 poses are few"));
        assert!(warnings(&views(2, full))[0].contains("cannot be calibrated"));
        assert!(warnings(&[])[0].contains("there are no corners"));
    }
}
