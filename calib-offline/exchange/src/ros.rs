//! ROS' `camera_info` in YAML, a file a camera, after the reader of `camera_calibration_parsers` (commit f6e4ab6).
//!
//! Quirks. Five coefficients are `plumb_bob`, eight `rational_polynomial`. Matrices carry a `dt`, which ROS ignores and without which
//! `OpenCV` sees no matrices in the file. It is that of a camera by itself: the rectification is the identity and the projection is the
//! camera matrix. Lost: where the cameras stand to each other, and as for `OpenCV`.

use super::lens::Distortion;
use super::nearest::CameraPinhole;
use super::yaml::matrix;
use super::{NamedFile, Pinholes};

/// The files.
pub fn files(pinholes: &Pinholes) -> Vec<NamedFile> {
    let cameras = pinholes.cameras.iter();
    cameras
        .map(|camera| (format!("{}.yaml", camera.name), file(camera).into_bytes()))
        .collect()
}

fn file(camera: &CameraPinhole) -> String {
    let lens = &camera.lens;
    let ([fx, fy], [cx, cy]) = (lens.focal_px, lens.center_px);
    let model = match lens.distortion {
        Distortion::Four | Distortion::Five => "plumb_bob",
        Distortion::Eight => "rational_polynomial",
    };
    let camera_matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
    let projection = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let coefficients = lens.own_coefficients();
    format!(
        "image_width: {}\nimage_height: {}\ncamera_name: \"{}\"\n{}distortion_model: {model}\n{}{}{}",
        lens.sensor.width,
        lens.sensor.height,
        camera.name,
        matrix("camera_matrix", "", [3, 3], &camera_matrix),
        matrix(
            "distortion_coefficients",
            "",
            [1, coefficients.len()],
            coefficients
        ),
        matrix("rectification_matrix", "", [3, 3], &identity),
        matrix("projection_matrix", "", [3, 4], &projection),
    )
}
