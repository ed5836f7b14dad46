//! A calibration that is judged: whatever projects points, and a rig of rays.

use crate::report::Calibration;
use calib_exchange::model::CameraModel;
use calib_exchange::{Converted, ForeignRig};
use calib_rays::board::{BoardShape, BoardSpec};
use calib_rays::field::Rig;
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector3;

/// How the pixel of a point is found.
#[derive(Debug)]
pub enum Sees {
    /// By another tool's models.
    Models(Vec<Box<dyn CameraModel>>),
    /// By the rig's ray fields.
    Fields,
}

/// A calibration.
#[derive(Debug)]
pub struct Candidate {
    /// What it is called.
    pub title: String,
    /// Its files.
    pub files: Vec<String>,
    /// What its cameras are, in words.
    pub models: Vec<String>,
    /// How points are seen.
    pub sees: Sees,
    /// The rays.
    pub rig: Rig,
    /// Whether it says where its cameras stand.
    pub has_places: bool,
    /// Whether it was made from the corners that it is judged on; `None` where nobody knows.
    pub saw_these: Option<bool>,
    /// What it says of the board's shape.
    pub board_shape: BoardShape,
}

impl Candidate {
    /// A calibration by another tool, its rays converted.
    pub fn foreign(foreign: ForeignRig, converted: Converted) -> Self {
        let names = |foreign: &ForeignRig| {
            let files = foreign.files.iter();
            files
                .map(|file| file.display().to_string())
                .collect::<Vec<_>>()
        };
        Self {
            title: foreign.format.name().to_owned(),
            files: names(&foreign),
            has_places: foreign.has_places(),
            models: foreign
                .cameras
                .iter()
                .map(|c| c.model_name.clone())
                .collect(),
            sees: Sees::Models(foreign.cameras.into_iter().map(|c| c.model).collect()),
            rig: converted.rig,
            saw_these: None,
            board_shape: BoardShape::default(),
        }
    }

    /// A calibration of ours, or one that was imported. Its board's shape holds if it is the recording's board.
    pub fn own(file: String, calibration: Calibration, board: &BoardSpec, sha256: &str) -> Self {
        let imported = calibration.imported.as_ref();
        let models = calibration
            .rig
            .cameras
            .iter()
            .enumerate()
            .map(|(k, camera)| {
                let imported = imported.and_then(|imported| imported.cameras.get(k));
                let kind = if camera.field.is_central() {
                    "central ray field"
                } else {
                    "ray field"
                };
                imported.map_or_else(|| kind.to_owned(), |camera| camera.model.clone())
            });
        Self {
            title: imported.map_or_else(
                || format!("calib-offline, {}", calibration.method),
                |imported| format!("{}, imported", imported.format),
            ),
            files: vec![file],
            models: models.collect(),
            sees: Sees::Fields,
            has_places: true,
            saw_these: match imported {
                Some(_) => None,
                None => Some(calibration.input_sha256 == sha256),
            },
            board_shape: if calibration.board == *board {
                calibration.board_shape
            } else {
                BoardShape::default()
            },
            rig: calibration.rig,
        }
    }

    /// Its cameras in another order: `order[k]` is the place that the recording's camera `k` has now.
    #[must_use]
    pub fn ordered(mut self, order: &[usize]) -> Self {
        self.models = order.iter().map(|k| self.models[*k].clone()).collect();
        self.rig.cameras = order.iter().map(|k| self.rig.cameras[*k].clone()).collect();
        self.rig.uncertainty.clear();
        if let Sees::Models(models) = self.sees {
            let mut left: Vec<Option<Box<dyn CameraModel>>> =
                models.into_iter().map(Some).collect();
            self.sees = Sees::Models(order.iter().filter_map(|k| left[*k].take()).collect());
        }
        self
    }

    /// The pixel that sees a point of a camera's frame, mm.
    pub(super) fn project(&self, camera_idx: usize, point: &Vector3<f64>) -> Option<PixelPoint> {
        match &self.sees {
            Sees::Models(models) => models[camera_idx].project(point),
            Sees::Fields => self.rig.cameras[camera_idx].field.project(point),
        }
    }
}
