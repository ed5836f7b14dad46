//! `OpenCV`'s `FileStorage` in YAML: a file a camera, and `extrinsics.yml`.
//!
//! Quirks. The head is `%YAML:1.0`: version 5 writes `%YAML 1.2`, and every version reads this one. Matrices carry their tag and
//! `dt`, lists are in flow style, text is in quotes. Eight coefficients mean the rational model only if a call says so
//! (`CALIB_RATIONAL_MODEL`); functions that take coefficients take eight as they are. Lost: that rays do not meet in a point, where
//! the camera is calibrated, uncertainty, and the rig's frame.

use super::nearest::{CameraPinhole, Pinholes};
use super::yaml::{matrix, rows};
use super::{ExchangeError, NamedFile};
use std::fmt::Write as _;

const HEAD: &str = "%YAML:1.0\n---\n";
const MATRIX: &str = " !!opencv-matrix";
const EXTRINSICS: &str = "extrinsics";

/// The files. Of a single camera there are no extrinsics; `R` and `T` (mm) take points of the first camera's frame into
/// the second's, `R_3` and `T_3` into the third's, and so on.
///
/// # Errors
/// [`ExchangeError::Name`].
pub fn files(pinholes: &Pinholes) -> Result<Vec<NamedFile>, ExchangeError> {
    let mut files = Vec::new();
    for camera in &pinholes.cameras {
        if camera.name == EXTRINSICS {
            return Err(ExchangeError::Name {
                camera: camera.name.clone(),
            });
        }
        let text = format!("{HEAD}{}", intrinsics(camera, MATRIX));
        files.push((format!("{}.yml", camera.name), text.into_bytes()));
    }
    if let [first, others @ ..] = &pinholes.cameras[..]
        && !others.is_empty()
    {
        let mut text = HEAD.to_owned();
        for (number, other) in (2..).zip(others) {
            let ending = match number {
                2 => String::new(),
                number => format!("_{number}"),
            };
            let other_from_first = other.rig_from_pinhole.inverse() * first.rig_from_pinhole;
            let rotation = rows(&other_from_first.rotation);
            let translation_mm = other_from_first.translation_mm;
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "# \"{}\" from \"{}\"; T in mm",
                other.name, first.name
            );
            text += &matrix(&format!("R{ending}"), MATRIX, [3, 3], &rotation);
            text += &matrix(
                &format!("T{ending}"),
                MATRIX,
                [3, 1],
                translation_mm.as_slice(),
            );
        }
        files.push((format!("{EXTRINSICS}.yml"), text.into_bytes()));
    }
    Ok(files)
}

fn intrinsics(camera: &CameraPinhole, tag: &str) -> String {
    let lens = &camera.lens;
    let ([fx, fy], [cx, cy]) = (lens.focal_px, lens.center_px);
    let camera_matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
    let coefficients = lens.own_coefficients();
    format!(
        "image_width: {}\nimage_height: {}\n{}{}",
        lens.sensor.width,
        lens.sensor.height,
        matrix("camera_matrix", tag, [3, 3], &camera_matrix),
        matrix(
            "distortion_coefficients",
            tag,
            [1, coefficients.len()],
            coefficients
        ),
    )
}
