//! Where on the sensor corners were seen, and which part is calibrated because of them.

use super::{Figure, WIDTH};
use crate::present::svg::{Svg, point};
use crate::report::Calibration;
use calib_rays::field::CalibratedCamera;
use calib_rays::geometry::{PixelPoint, SensorSize};
use std::fmt::Write as _;

/// From sensor to drawing: the whole sensor, outer edge to outer edge.
#[derive(Debug, Clone, Copy)]
pub(super) struct SensorView {
    pub units_per_px: f64,
    pub height: f64,
}

impl SensorView {
    pub fn new(sensor: SensorSize) -> Self {
        let units_per_px = WIDTH / f64::from(sensor.width);
        Self {
            units_per_px,
            height: f64::from(sensor.height) * units_per_px,
        }
    }

    pub fn at(&self, pixel: PixelPoint) -> [f64; 2] {
        [
            (pixel.u + 0.5) * self.units_per_px,
            (pixel.v + 0.5) * self.units_per_px,
        ]
    }
}

/// One drawing per camera.
pub fn draw(calibration: &Calibration) -> Vec<Figure> {
    calibration
        .rig
        .cameras
        .iter()
        .enumerate()
        .map(|(camera_idx, camera)| draw_camera(calibration, camera_idx, camera))
        .collect()
}

fn draw_camera(calibration: &Calibration, camera_idx: usize, camera: &CalibratedCamera) -> Figure {
    let sensor = camera.field.sensor;
    let view = SensorView::new(sensor);
    let mut svg = Svg::new(WIDTH, view.height);
    svg.rect("sensor", [0.0, 0.0], [WIDTH, view.height]);
    draw_mask(&mut svg, camera, &view);
    let (mut used, mut rejected) = (String::new(), String::new());
    let mut count = 0;
    for corner in calibration
        .corners
        .iter()
        .filter(|c| c.camera_idx == camera_idx)
    {
        // A line without length and with round ends is a dot.
        let dots = if corner.weight > 0.0 {
            &mut used
        } else {
            &mut rejected
        };
        // Writing to a String cannot fail.
        let _ = write!(dots, "M{}h0", point(view.at(corner.observed)));
        count += 1;
    }
    svg.path("dots", &used);
    svg.path("dots rejected", &rejected);
    let share = 100.0 * camera.coverage.covered_share();
    Figure {
        title: camera.name.clone(),
        svg: svg.finish(&format!("Coverage of camera {}", camera.name)),
        caption: format!(
            "{count} corners on {sensor} pixels; {share:.0} % of the sensor is calibrated. Full width is {} px.",
            sensor.width
        ),
    }
}

/// Cells outside the calibrated area, one rectangle per run of cells in a row.
fn draw_mask(svg: &mut Svg, camera: &CalibratedCamera, view: &SensorView) {
    let mask = &camera.coverage;
    let (width_px, height_px) = mask.cell_size_px();
    let (width, height) = (width_px * view.units_per_px, height_px * view.units_per_px);
    let mut data = String::new();
    for (j, row) in mask.covered.chunks(mask.cells_u.max(1)).enumerate() {
        let mut i = 0;
        for run in row.chunk_by(|a, b| a == b) {
            if !run[0] {
                let from = [i as f64 * width, j as f64 * height];
                let length = run.len() as f64 * width;
                let _ = write!(
                    data,
                    "M{}h{length:.1}v{height:.1}h-{length:.1}z",
                    point(from)
                );
            }
            i += run.len();
        }
    }
    svg.path("masked", &data);
}
