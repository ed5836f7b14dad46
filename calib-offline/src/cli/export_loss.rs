//! What a form of `export` loses, in words and as `PATH.loss.json`.

use crate::present::numbers::short;
use calib_exchange::{Loss, LossMap, Pinholes, SplinedCameras, ViewMap};
use serde::Serialize;

/// What lenses or views lose.
#[derive(Debug, Serialize)]
pub(super) struct LossObject {
    #[serde(flatten)]
    all: Loss,
    distance_mm: f64,
    cameras: Vec<CameraLoss>,
    #[serde(skip)]
    kind: Kind,
}

/// The file: the same, and where on the sensors.
#[derive(Debug, Serialize)]
pub(super) struct LossFile<'a> {
    #[serde(flatten)]
    pub loss: &'a LossObject,
    pub maps: &'a [LossMap],
}

#[derive(Debug, Serialize)]
struct CameraLoss {
    name: String,
    model: String,
    coefficients: usize,
    #[serde(flatten)]
    loss: Loss,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Lens,
    View,
}

impl LossObject {
    /// Of lenses of another tool.
    pub fn of_lenses(pinholes: &Pinholes) -> Self {
        let cameras = pinholes.cameras.iter();
        let cameras = cameras.map(|camera| CameraLoss {
            name: camera.name.clone(),
            model: camera.lens.distortion.name().to_owned(),
            coefficients: camera.lens.distortion.count(),
            loss: camera.loss,
        });
        Self::new(pinholes.distance_mm, cameras.collect(), Kind::Lens)
    }

    /// Of splined cameras.
    pub fn of_splined(splined: &SplinedCameras) -> Self {
        let cameras = splined.cameras.iter();
        let cameras = cameras.map(|camera| CameraLoss {
            name: camera.name.clone(),
            model: format!("splined, {} x {} knots", camera.knots[0], camera.knots[1]),
            coefficients: camera.shifts.len(),
            loss: camera.loss,
        });
        Self::new(splined.distance_mm, cameras.collect(), Kind::Lens)
    }

    /// Of views: at half of the distance and at twice that.
    pub fn of_views(maps: &[ViewMap], distance_mm: f64) -> Self {
        let cameras = maps.iter().map(|map| CameraLoss {
            name: map.view.camera.clone(),
            model: "map".to_owned(),
            coefficients: 0,
            loss: map.loss,
        });
        Self::new(distance_mm, cameras.collect(), Kind::View)
    }

    fn new(distance_mm: f64, cameras: Vec<CameraLoss>, kind: Kind) -> Self {
        let losses: Vec<Loss> = cameras.iter().map(|camera| camera.loss).collect();
        Self {
            all: Loss::together(&losses),
            distance_mm,
            cameras,
            kind,
        }
    }

    /// A sentence.
    pub fn in_words(&self) -> String {
        let cameras = self.cameras.iter().map(|camera| {
            let loss = &camera.loss;
            format!(
                "{}: {} px RMS, {} px at most ({} mm, {} mm)",
                camera.name,
                short(loss.rms_px),
                short(loss.max_px),
                short(loss.rms_mm),
                short(loss.max_mm)
            )
        });
        let distance = short(self.distance_mm);
        let what = match self.kind {
            Kind::Lens => format!("lost by the lenses at {distance} mm"),
            Kind::View => format!("exact at {distance} mm; at half and at twice that"),
        };
        format!("{what}: {}", cameras.collect::<Vec<_>>().join("; "))
    }
}
