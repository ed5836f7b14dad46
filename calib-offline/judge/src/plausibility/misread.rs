//! Why known places or poses have no answer: they are read in the other ways that slips leave them in, and whichever
//! fits the corners names the slip.

use crate::cause::Code;
use calib_estimate::adjust::Observations;
use calib_estimate::init::focal_scan::start_camera;
use calib_rays::board::{BoardSpec, KnownPlace, Layout};
use calib_rays::geometry::{RigidTransform, so3};
use calib_rays::observed::View;
use calib_rays::remedy::Remedy;
use calib_recording::dataset::Dataset;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

/// A reading fits if it leaves less than this share of the sensor's width in the middle: some twenty times corner noise,
/// and a tenth of what any wrong reading that starts at all leaves.
pub const FITS_PER_WIDTH: f64 = 1e-3;

/// What is wrong with places or poses that were known.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Misread {
    /// Places as in a mirror.
    #[error(
        "the places are those of a mirrored target: with one axis reversed they fit the pixels to {fit_px:.2} px"
    )]
    MirroredPlaces {
        /// Median residual of that reading, px.
        fit_px: f64,
    },
    /// Poses that fit when read in another way.
    #[error("the known poses contradict the corners; {reading} they fit to {fit_px:.2} px")]
    Poses {
        /// In words.
        reading: &'static str,
        /// What the slip is called, if it has a name.
        code: Option<Code>,
        /// Median residual of that reading, px.
        fit_px: f64,
    },
    /// Poses that fit in no way, while the boards by themselves do.
    #[error(
        "the known poses contradict the corners: with poses that are free, camera \"{camera}\" explains its corners to \
         {fit_px:.2} px"
    )]
    NoReading {
        /// The camera that was asked.
        camera: String,
        /// Median residual without what is known, px.
        fit_px: f64,
    },
}

impl Misread {
    /// The slip's name among the causes.
    pub fn code(&self) -> Option<Code> {
        match self {
            Self::MirroredPlaces { .. } => Some(Code::LabelsMirrored),
            Self::Poses { code, .. } => *code,
            Self::NoReading { .. } => None,
        }
    }

    /// The file that it stands in.
    pub fn file(&self, dataset: &Dataset) -> PathBuf {
        let poses = dataset.known_poses_file.clone();
        poses
            .filter(|_| !matches!(self, Self::MirroredPlaces { .. }))
            .unwrap_or_else(|| dataset.corners_path())
    }
}

impl Remedy for Misread {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::MirroredPlaces { .. } => {
                "reverse the sign of x_mm, y_mm or z_mm in every line: the three axes are right-handed; pixels count to the right and down"
            }
            Self::Poses { .. } => {
                "write them so: rig_from_board, x_mm to z_mm where the board's corner (0, 0) stands, rx_deg to rz_deg its rotation vector in degrees"
            }
            Self::NoReading { .. } => {
                "check each line: millimeters, degrees of a rotation vector, rig_from_board, and the number of the pose; or leave [poses] known out"
            }
        };
        Some(text.to_owned())
    }
}

/// A way to read a pose.
type Reading = (
    &'static str,
    Option<Code>,
    fn(&RigidTransform) -> RigidTransform,
);

const READINGS: [Reading; 8] = [
    ("read in meters", Some(Code::SquareUnit), |p| {
        moved(p, 1000.0)
    }),
    ("read in centimeters", Some(Code::SquareUnit), |p| {
        moved(p, 10.0)
    }),
    ("read in inches", Some(Code::SquareUnit), |p| moved(p, 25.4)),
    (
        "read as board_from_rig, inverted,",
        None,
        RigidTransform::inverse,
    ),
    ("with angles in radians", None, |p| {
        let turn = so3::log(&p.rotation).map(f64::to_degrees);
        RigidTransform::new(so3::exp(&turn), p.translation_mm)
    }),
    (
        "with the board turned by 90 degrees in its plane",
        Some(Code::LabelsTurned),
        |p| turned(p, 1.0),
    ),
    (
        "with the board turned by 180 degrees in its plane",
        Some(Code::LabelsTurned),
        |p| turned(p, 2.0),
    ),
    (
        "with the board turned by -90 degrees in its plane",
        Some(Code::LabelsTurned),
        |p| turned(p, 3.0),
    ),
];

fn moved(pose: &RigidTransform, factor: f64) -> RigidTransform {
    RigidTransform::new(pose.rotation, factor * pose.translation_mm)
}

fn turned(pose: &RigidTransform, quarters: f64) -> RigidTransform {
    let turn = so3::exp(&Vector3::new(0.0, 0.0, -quarters * FRAC_PI_2));
    RigidTransform::new(pose.rotation * turn, pose.translation_mm)
}

/// What is wrong with the places or poses that a dataset knows; `None` if it knows none, or nothing is to be said.
///
/// Cost: a start of one camera for each reading.
pub fn misread(dataset: &Dataset, views: &[View]) -> Option<Misread> {
    let sensors = || dataset.cameras.iter().map(|camera| camera.sensor).collect();
    let of = |board: BoardSpec| Observations::new(board, sensors(), views);
    let corners = |camera_idx: usize| {
        let own = views.iter().filter(|view| view.camera_idx == camera_idx);
        own.map(|view| view.corners.len()).sum::<usize>()
    };
    let camera_idx = (0..dataset.cameras.len()).max_by_key(|idx| corners(*idx))?;
    let camera = &dataset.cameras[camera_idx];
    let limit_px = FITS_PER_WIDTH * f64::from(camera.sensor.width);
    let fit = |observations: &Observations| {
        let own = observations.with_known_as_one().of_camera(camera_idx);
        let start = start_camera(&own, camera_idx).ok()?;
        Some(start.median_px).filter(|px| *px < limit_px)
    };
    if let Layout::Points(places) = &dataset.board.layout
        && dataset.known_poses.is_empty()
    {
        let mirror = |place: &KnownPlace| KnownPlace {
            at_mm: Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0)) * place.at_mm,
            ..*place
        };
        if fit(&of(dataset.board.clone())).is_some() {
            return None;
        }
        let mirrored = BoardSpec::points(places.iter().map(mirror).collect());
        let fit_px = fit(&of(mirrored))?;
        return Some(Misread::MirroredPlaces { fit_px });
    }
    let free = of(dataset.board.clone());
    let known = |read: fn(&RigidTransform) -> RigidTransform| {
        let mut known = dataset.known_poses.clone();
        for pose in known.values_mut() {
            pose.rig_from_board = read(&pose.rig_from_board);
        }
        free.clone().with_known_poses(known)
    };
    if dataset.known_poses.is_empty() || fit(&known(|pose| *pose)).is_some() {
        return None;
    }
    let fits: Vec<Option<f64>> = READINGS
        .par_iter()
        .map(|(_, _, read)| fit(&known(*read)))
        .collect();
    let found = READINGS.iter().zip(fits);
    let best = found
        .filter_map(|(reading, fit_px)| Some((reading, fit_px?)))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((&(reading, code, _), fit_px)) = best {
        return Some(Misread::Poses {
            reading,
            code,
            fit_px,
        });
    }
    Some(Misread::NoReading {
        fit_px: fit(&free)?,
        camera: camera.name.clone(),
    })
}
