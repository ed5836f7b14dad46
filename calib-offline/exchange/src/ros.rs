//! ROS' `camera_info` in YAML, a file a camera, after the reader of `camera_calibration_parsers` (commit f6e4ab6).
//!
//! Quirks. Five coefficients are `plumb_bob` (of four the fifth is 0), eight, twelve and fourteen `rational_polynomial`, a fisheye's `equidistant`. Matrices carry a `dt`, which ROS ignores and without which
//! `OpenCV` sees no matrices in the file. It is that of a camera by itself: the rectification is the identity and the projection is the
//! camera matrix. Lost: where the cameras stand to each other, and as for `OpenCV`.
//!
//! Read: lengths are meters. A pair that was rectified stands in its files: `rectification_matrix` turns a camera into the frame of the
//! pair, the last column of `projection_matrix` over the focal length moves it there. Binning and regions are tolerated where they do nothing.

use super::distortion::Distortion;
use super::nearest::CameraPinhole;
use super::yaml::matrix;
use super::{NamedFile, Pinholes};
use crate::foreign::{ForeignCamera, ForeignFile, Format};
use crate::model::{CameraModel, Fisheye, Pinhole};
use crate::read::{Document, Problem, ReadOptions, Unit};
use calib_rays::geometry::{RigidTransform, SensorSize};
use nalgebra::{Matrix3, Vector3};

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
        Distortion::Eight | Distortion::Twelve | Distortion::Fourteen => "rational_polynomial",
        Distortion::Equidistant => "equidistant",
    };
    // `plumb_bob` has five.
    let coefficients = match lens.distortion {
        Distortion::Four => &lens.coefficients[..5],
        _ => lens.own_coefficients(),
    };
    let projection = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    format!(
        "image_width: {}\nimage_height: {}\ncamera_name: \"{}\"\n{}distortion_model: {model}\n{}{}{}",
        lens.sensor.width,
        lens.sensor.height,
        camera.name,
        matrix("camera_matrix", "", [3, 3], &lens.camera_matrix()),
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

const KNOWN: &str = "plumb_bob, rational_polynomial, equidistant";

/// The only camera of a file.
pub(crate) fn read(document: &Document<'_>, options: &ReadOptions) -> Result<ForeignFile, Problem> {
    let name = document.need("camera_name")?.text()?.to_owned();
    let sensor = SensorSize::new(
        document.need("image_width")?.side()?,
        document.need("image_height")?.side()?,
    );
    for key in ["binning_x", "binning_y"] {
        if let Some(binning) = document.get(key)
            && binning.number()? > 1.0
        {
            return Err(binning.wrong("0 or 1: a calibration of the whole image"));
        }
    }
    let matrix = document.need("camera_matrix")?;
    let plane = matrix.camera_matrix(&matrix.matrix()?)?;
    let distortion = document.need("distortion_coefficients")?;
    let numbers = distortion.vector()?;
    let model = document.need("distortion_model")?;
    let model_name = model.text()?;
    let (counts, is_fisheye): (&[usize], bool) = match model_name {
        "plumb_bob" => (&[4, 5], false),
        "rational_polynomial" => (&[8, 12, 14], false),
        "equidistant" | "fisheye" => (&[4], true),
        found => {
            return Err(Problem::Model {
                key: "distortion_model".to_owned(),
                found: found.to_owned(),
                known: KNOWN,
            });
        }
    };
    let counted = || distortion.wrong(format!("the coefficients of {model_name} ({counts:?})"));
    if !counts.contains(&numbers.len()) {
        return Err(counted());
    }
    let camera_model: Box<dyn CameraModel> = if is_fisheye {
        Box::new(Fisheye::radial(plane, &numbers))
    } else {
        Box::new(Pinhole::new(plane, &numbers).ok_or_else(counted)?)
    };
    let unit = options.unit.unwrap_or(Unit::M);
    Ok(ForeignFile {
        format: Format::Ros,
        cameras: vec![ForeignCamera {
            name,
            sensor,
            model_name: model_name.to_owned(),
            model: camera_model,
            rig_from_camera: pair_from_camera(document, unit)?,
            valid: None,
        }],
        notes: Vec::new(),
    })
}

/// Where a camera stands in its rectified pair; `None` where the file is that of a camera by itself.
fn pair_from_camera(
    document: &Document<'_>,
    unit: Unit,
) -> Result<Option<RigidTransform>, Problem> {
    let turn = document.need("rectification_matrix")?;
    let rotation = turn.rotation(&turn.matrix()?.data)?;
    let projection = document.need("projection_matrix")?;
    let matrix = projection.matrix()?;
    if (matrix.rows, matrix.cols) != (3, 4) {
        return Err(projection.wrong("a matrix of 3 x 4"));
    }
    let (fx, fy) = (matrix.data[0], matrix.data[5]);
    if !(fx > 0.0 && fy > 0.0) {
        return Err(projection.wrong("with focal lengths above zero"));
    }
    let shift = Vector3::new(matrix.data[3] / fx, matrix.data[7] / fy, 0.0) * unit.mm();
    let is_alone = rotation == Matrix3::identity() && shift == Vector3::zeros();
    Ok((!is_alone).then(|| RigidTransform::new(rotation, -shift)))
}
