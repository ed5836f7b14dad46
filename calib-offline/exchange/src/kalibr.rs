//! Kalibr's `camchain.yaml`, after its reader (commit 1f60227).
//!
//! Quirks. `radtan` has four coefficients and no k3: it is fitted with four. Lengths are meters. `T_cn_cnm1` takes points of the
//! camera before into this one's frame. `resolution` is whole numbers. `rostopic` is asked for, and made of the camera's
//! name. Lists are in flow style; numbers have a point and a signed exponent, else its reader takes them for text. Lost: as for
//! `OpenCV`.

use super::yaml::list;
use super::{NamedFile, Pinholes};
use nalgebra::Matrix4;
use std::fmt::Write as _;

const MM_PER_M: f64 = 1000.0;

/// The file, for pinholes with four coefficients.
pub fn files(pinholes: &Pinholes) -> Vec<NamedFile> {
    let mut text = String::new();
    let mut before = None;
    for (number, camera) in pinholes.cameras.iter().enumerate() {
        let lens = &camera.lens;
        let ([fx, fy], [cx, cy]) = (lens.focal_px, lens.center_px);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "cam{number}:");
        if let Some(rig_from_before) = before {
            let own_from_before = camera.rig_from_pinhole.inverse() * rig_from_before;
            text += "  T_cn_cnm1:\n";
            let mut matrix = Matrix4::identity();
            matrix
                .fixed_view_mut::<3, 3>(0, 0)
                .copy_from(&own_from_before.rotation);
            matrix
                .fixed_view_mut::<3, 1>(0, 3)
                .copy_from(&(own_from_before.translation_mm / MM_PER_M));
            for row in matrix.row_iter() {
                let _ = writeln!(text, "    - {}", list(row.iter().copied()));
            }
        }
        let _ = write!(
            text,
            "  camera_model: pinhole\n  intrinsics: {}\n  distortion_model: radtan\n  distortion_coeffs: {}\n  \
             resolution: [ {}, {} ]\n  rostopic: \"/{}/image_raw\"\n",
            list([fx, fy, cx, cy]),
            list(lens.coefficients[..4].iter().copied()),
            lens.sensor.width,
            lens.sensor.height,
            camera.name
        );
        before = Some(camera.rig_from_pinhole);
    }
    vec![("camchain.yaml".to_owned(), text.into_bytes())]
}
