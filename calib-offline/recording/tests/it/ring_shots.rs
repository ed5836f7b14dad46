//! Rendered images of the ring target, and how far what is found in them lies from the truth.

use calib_rays::geometry::{PixelPoint, RigidTransform, so3};
use calib_recording::dataset::TargetSpec;
use calib_recording::dataset::image::GrayImage;
use calib_recording::detect::ring_target::{Located, TargetRefusal, TargetSettings, locate};
use calib_simulate::pattern::{
    DIRECTION_MARKERS, DIRECTION_RADII_MM, RING_COLS, RING_PITCH_MM, RING_RADII_MM, RING_ROWS,
};
use calib_simulate::target::{seen_markers, target_poses};
use calib_simulate::{OpticsKind, RenderSettings, Scene, SceneSettings};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// The simulated target.
pub fn target() -> TargetSpec {
    TargetSpec {
        rows: RING_ROWS,
        cols: RING_COLS,
        pitch_mm: RING_PITCH_MM,
        outer_radius_mm: RING_RADII_MM.0,
        direction_outer_radius_mm: DIRECTION_RADII_MM.0,
        direction: DIRECTION_MARKERS.to_vec(),
        images: Vec::new(),
    }
}

/// One image of the target by the left camera.
pub struct Shot {
    scene: Scene,
    left_from_target: RigidTransform,
    stream: usize,
    /// How it looks.
    pub render: RenderSettings,
}

impl Shot {
    /// The target at the usual distance, turned by degrees about its own middle: about its x, its
    /// y and its z.
    pub fn turned(optics: OpticsKind, turn_deg: [f64; 3]) -> Self {
        let scene = Scene::new(SceneSettings::standard(optics, 1)).expect("a standard scene");
        let straight = target_poses(&scene)[3];
        let middle = target().marker_in_target(3, 4);
        let [x, y, z] = turn_deg.map(f64::to_radians);
        let turn = so3::exp(&Vector3::new(x, y, 0.0)) * so3::exp(&Vector3::new(0.0, 0.0, z));
        let target_from_turned = RigidTransform::new(turn, middle - turn * middle);
        Self {
            left_from_target: straight * target_from_turned,
            scene,
            stream: 1000,
            render: RenderSettings::default(),
        }
    }

    /// The poses that `simulate --target ring` renders.
    pub fn standard(optics: OpticsKind) -> Vec<Self> {
        let scene = Scene::new(SceneSettings::standard(optics, 1)).expect("a standard scene");
        let poses = target_poses(&scene).into_iter().enumerate();
        poses
            .map(|(pose, left_from_target)| Self {
                scene: scene.clone(),
                left_from_target,
                stream: scene.true_poses.len() + pose,
                render: RenderSettings::default(),
            })
            .collect()
    }

    /// Changes how it looks.
    pub fn with(mut self, change: impl FnOnce(&mut RenderSettings)) -> Self {
        change(&mut self.render);
        self
    }

    /// The image in 8 bits.
    pub fn image(&self) -> GrayImage {
        let rendered =
            self.scene
                .render_target(0, &self.left_from_target, &self.render, self.stream);
        let values = rendered.to_u8().into_iter().map(f32::from).collect();
        GrayImage::from_values(rendered.sensor, values, 255.0).expect("as many values as pixels")
    }

    /// Where the centers really are, by (row, col).
    pub fn truth(&self) -> BTreeMap<(usize, usize), PixelPoint> {
        seen_markers(&self.scene, &[self.left_from_target])
            .into_iter()
            .map(|marker| ((marker.row, marker.col), marker.true_pixels[0]))
            .collect()
    }
}

/// What is found in an image.
pub fn located(image: &GrayImage) -> Result<Located, TargetRefusal> {
    locate(image, &target(), &TargetSettings::default())
}

/// Sums over markers of squared errors.
#[derive(Debug, Clone, Copy, Default)]
pub struct Errors {
    /// Markers compared.
    pub count: usize,
    corrected: f64,
    uncorrected: f64,
    predicted: f64,
    /// Largest distance from the truth, px.
    pub worst_px: f64,
}

impl Errors {
    /// The errors of one image; markers without a truth are left out.
    pub fn of(located: &Located, truth: &BTreeMap<(usize, usize), PixelPoint>) -> Self {
        let mut errors = Self::default();
        for marker in &located.markers {
            if let Some(truth) = truth.get(&(marker.row, marker.col)) {
                let distance = marker.ring.pixel.distance_px(*truth);
                errors.count += 1;
                errors.corrected += distance.powi(2);
                errors.uncorrected += marker.uncorrected.distance_px(*truth).powi(2);
                errors.predicted += marker.ring.sigma_px.powi(2);
                errors.worst_px = errors.worst_px.max(distance);
            }
        }
        errors
    }

    /// Those of both.
    pub fn and(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            corrected: self.corrected + other.corrected,
            uncorrected: self.uncorrected + other.uncorrected,
            predicted: self.predicted + other.predicted,
            worst_px: self.worst_px.max(other.worst_px),
        }
    }

    fn rms(&self, sum: f64, axes: f64) -> f64 {
        (sum / (axes * self.count.max(1) as f64)).sqrt()
    }

    /// RMS per axis, px.
    pub fn rms_px(&self) -> f64 {
        self.rms(self.corrected, 2.0)
    }

    /// RMS per axis of the middles of the rings' images, px.
    pub fn uncorrected_rms_px(&self) -> f64 {
        self.rms(self.uncorrected, 2.0)
    }

    /// RMS per axis that the fits predict from their residuals, px.
    pub fn predicted_px(&self) -> f64 {
        self.rms(self.predicted, 1.0)
    }
}
