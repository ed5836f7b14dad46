//! `DICe`'s camera system in XML (read at commit 5ebcdfaf).
//!
//! Quirks. Elements are `Parameter` with a name, a type and a value; what is zero may be left out. `IMAGE_HEIGHT_WIDTH` is height first. Only
//! `OPENCV_LENS_DISTORTION` is `OpenCV`'s model (the file's comments call it `OPENCV_DIS`, which its reader does not know); the
//! models of Vic-3D are refused. Angles are degrees, `R = Rz(GAMMA) Ry(BETA) Rx(ALPHA)`, or a list of rows. `R` and `T` take points of the
//! world into a camera, or, with `extrinsics_relative_camera_to_camera`, of camera 0 into camera 1. The unit is nowhere: it is asked.
//! `T1` and `T2` (a tilted sensor) are refused, as `DICe` itself does not know their unit.

use crate::foreign::{ForeignCamera, ForeignFile, Format};
use crate::model::{CameraModel, Pinhole};
use crate::read::{Document, Problem, ReadOptions};
use calib_rays::geometry::{RigidTransform, SensorSize};
use nalgebra::{Matrix3, Vector3};

/// Whether it is a file of that kind.
pub(crate) fn is_system(document: &Document<'_>) -> bool {
    document.get("xml_file_format").is_some() || document.get("CAMERA 0").is_some()
}

/// The cameras.
pub(crate) fn read(document: &Document<'_>, options: &ReadOptions) -> Result<ForeignFile, Problem> {
    let unit = options.unit.ok_or(Problem::NeedsUnit)?;
    let is_relative = match document.get("extrinsics_relative_camera_to_camera") {
        Some(flag) => match flag.text()? {
            "true" | "1" => true,
            "false" | "0" => false,
            _ => return Err(flag.wrong("true or false")),
        },
        None => false,
    };
    let mut cameras = Vec::new();
    while let Some(camera) = document.get(&format!("CAMERA {}", cameras.len())) {
        let camera_from_world = camera_from_world(&camera, unit.mm())?;
        if is_relative && cameras.is_empty() && camera_from_world != RigidTransform::identity() {
            return Err(camera.disagrees(
                "extrinsics_relative_camera_to_camera: the first camera has a place of its own",
            ));
        }
        let name = camera.get("CAMERA_ID").and_then(|id| id.text().ok());
        let size = camera.need("IMAGE_HEIGHT_WIDTH")?;
        cameras.push(ForeignCamera {
            name: name.map_or_else(|| format!("camera{}", cameras.len()), str::to_owned),
            sensor: sensor(&size)?,
            model_name: "OPENCV_LENS_DISTORTION".to_owned(),
            model: model(&camera)?,
            rig_from_camera: Some(camera_from_world.inverse()),
            valid: None,
        });
    }
    if cameras.is_empty() {
        return Err(Problem::Missing {
            key: "CAMERA 0".to_owned(),
        });
    }
    if is_relative && cameras.len() > 2 {
        return Err(Problem::Disagrees {
            key: "extrinsics_relative_camera_to_camera".to_owned(),
            other: format!("{} cameras: it is for two", cameras.len()),
        });
    }
    Ok(ForeignFile {
        format: Format::Dice,
        cameras,
        notes: Vec::new(),
    })
}

/// `{ 1200, 1920 }`
fn braces(document: &Document<'_>) -> Result<Vec<f64>, Problem> {
    let text = document.text()?.trim();
    let inner = text
        .strip_prefix('{')
        .and_then(|text| text.strip_suffix('}'));
    let wrong = || document.wrong("numbers in braces");
    inner
        .ok_or_else(wrong)?
        .split(',')
        .map(|word| {
            let value = word.trim().parse::<f64>().map_err(|_| wrong())?;
            if value.is_finite() {
                Ok(value)
            } else {
                Err(document.not_finite())
            }
        })
        .collect()
}

fn sensor(size: &Document<'_>) -> Result<SensorSize, Problem> {
    let side = |value: f64| {
        let is_side = (1.0..=f64::from(u16::MAX)).contains(&value) && value.fract() == 0.0;
        is_side.then_some(value as u32)
    };
    match braces(size)?[..] {
        [height, width] => side(width)
            .zip(side(height))
            .map(|(width, height)| SensorSize::new(width, height)),
        _ => None,
    }
    .ok_or_else(|| size.wrong("height and width in braces"))
}

fn or_zero(camera: &Document<'_>, key: &str) -> Result<f64, Problem> {
    camera.get(key).map_or(Ok(0.0), |value| value.number())
}

fn camera_from_world(camera: &Document<'_>, mm: f64) -> Result<RigidTransform, Problem> {
    let shift = Vector3::new(
        or_zero(camera, "TX")?,
        or_zero(camera, "TY")?,
        or_zero(camera, "TZ")?,
    ) * mm;
    let rows = camera
        .keys()
        .into_iter()
        .find(|key| key.contains("ROTATION"));
    let rotation = if let Some(key) = rows {
        let matrix = camera.need(key)?;
        let mut numbers = Vec::new();
        for row in matrix.keys() {
            numbers.extend(braces(&matrix.need(row)?)?);
        }
        matrix.rotation(&numbers)?
    } else {
        let turn = |key: &str, axis: Vector3<f64>| -> Result<Matrix3<f64>, Problem> {
            let angle_rad = or_zero(camera, key)?.to_radians();
            Ok(calib_rays::geometry::so3::exp(&(axis * angle_rad)))
        };
        turn("GAMMA", Vector3::z())? * turn("BETA", Vector3::y())? * turn("ALPHA", Vector3::x())?
    };
    Ok(RigidTransform::new(rotation, shift))
}

fn model(camera: &Document<'_>) -> Result<Box<dyn CameraModel>, Problem> {
    let distortion = camera.need("LENS_DISTORTION_MODEL")?;
    let is_none = match distortion.text()? {
        "OPENCV_LENS_DISTORTION" => false,
        "NO_LENS_DISTORTION" => true,
        found => {
            return Err(Problem::Model {
                key: distortion.key().to_owned(),
                found: found.to_owned(),
                known: "OPENCV_LENS_DISTORTION, NO_LENS_DISTORTION",
            });
        }
    };
    for key in ["FS", "T1", "T2"] {
        if let Some(value) = camera.get(key)
            && value.number()? != 0.0
        {
            return Err(value.wrong("0: skew and tilt are not read"));
        }
    }
    let fx = camera.need("FX")?;
    let focal_y = camera.need("FY")?.number()?;
    let plane = fx.plane([
        fx.number()?,
        focal_y,
        camera.need("CX")?.number()?,
        camera.need("CY")?.number()?,
    ])?;
    let mut numbers = [0.0; 12];
    if !is_none {
        let keys = [
            "K1", "K2", "P1", "P2", "K3", "K4", "K5", "K6", "S1", "S2", "S3", "S4",
        ];
        for (number, key) in numbers.iter_mut().zip(keys) {
            *number = or_zero(camera, key)?;
        }
    }
    let wrong = || fx.wrong("a pinhole's");
    Ok(Box::new(Pinhole::new(plane, &numbers).ok_or_else(wrong)?))
}
