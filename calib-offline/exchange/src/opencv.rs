//! `OpenCV`'s `FileStorage`. Written in YAML: a file a camera, and `extrinsics.yml`. Read in YAML, XML and JSON, of 4.x and 5.x.
//!
//! Quirks. The head is `%YAML:1.0`: version 5 writes `%YAML 1.2`, and every version reads this one. Matrices carry their tag and
//! `dt`, lists are in flow style, text is in quotes. Eight coefficients mean the rational model only if a call says so
//! (`CALIB_RATIONAL_MODEL`); functions that take coefficients take eight, twelve and fourteen as they are. Those of a fisheye are for `cv::fisheye`: the file says
//! `fisheye_model: 1`, as `OpenCV`'s sample does. Lost: that rays do not meet in a point, where
//! the camera is calibrated, uncertainty, and the rig's frame.
//!
//! Read: version 5 writes `%YAML 1.2`, vectors as `sizes` instead of rows and columns, flags as `true`; 4 writes `True` as a matrix, which is
//! refused where a flag is wanted. JSON may hold `.Nan`. Keys are those of `OpenCV`'s samples and of its functions' arguments, with
//! `1` and `2` behind them for a pair. The file says no unit, its size often not, and four coefficients may be those of a fisheye: then it is
//! asked. `R` and `T` are those of `stereoCalibrate`: they take points of the first camera's frame into the second's.

use super::distortion::Distortion;
use super::nearest::{CameraPinhole, Pinholes};
use super::yaml::{matrix, rows};
use super::{ExchangeError, NamedFile};
use crate::foreign::{Content, ForeignCamera, ForeignFile, Format};
use crate::model::{CameraModel, Fisheye, Omni, Pinhole};
use crate::read::{Document, Hint, Problem, ReadOptions};
use calib_rays::geometry::{RigidTransform, SensorSize};
use nalgebra::Vector3;
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
    let coefficients = lens.own_coefficients();
    // Four coefficients may be of either kind: the file says which.
    let kind = match lens.distortion {
        Distortion::Equidistant => "fisheye_model: 1\n",
        Distortion::Four => "fisheye_model: 0\n",
        _ => "",
    };
    format!(
        "image_width: {}\nimage_height: {}\n{kind}{}{}",
        lens.sensor.width,
        lens.sensor.height,
        matrix("camera_matrix", tag, [3, 3], &lens.camera_matrix()),
        matrix(
            "distortion_coefficients",
            tag,
            [1, coefficients.len()],
            coefficients
        ),
    )
}

const MATRIX_KEYS: [&str; 6] = [
    "camera_matrix",
    "cameraMatrix",
    "Camera_Matrix",
    "K",
    "M",
    "mtx",
];
const DISTORTION_KEYS: [&str; 7] = [
    "distortion_coefficients",
    "distCoeffs",
    "dist_coeffs",
    "Distortion_Coefficients",
    "D",
    "dist",
    "distortion",
];

/// A file with cameras, or with `R` and `T` alone; `stem` names a single camera.
pub(crate) fn read(
    document: &Document<'_>,
    stem: &str,
    options: &ReadOptions,
) -> Result<Content, Problem> {
    let second_from_first = second_from_first(document, options);
    let pair = ["1", "2"].map(|ending| find(document, &MATRIX_KEYS, ending));
    let mut cameras = match pair {
        [Some(_), Some(_)] => ["1", "2"]
            .into_iter()
            .map(|ending| camera(document, ending, format!("{stem}{ending}"), options))
            .collect::<Result<Vec<_>, _>>()?,
        [None, None] if find(document, &MATRIX_KEYS, "").is_some() => {
            vec![camera(document, "", stem.to_owned(), options)?]
        }
        [None, None] => {
            return match second_from_first? {
                Some(second_from_first) => Ok(Content::Extrinsics(second_from_first)),
                None => Err(Problem::UnknownFormat),
            };
        }
        [found, _] => {
            let number = if found.is_some() { 2 } else { 1 };
            return Err(Problem::Missing {
                key: format!("camera matrix of camera {number}"),
            });
        }
    };
    if let [first, second] = &mut cameras[..]
        && let Some(second_from_first) = second_from_first?
    {
        first.rig_from_camera = Some(RigidTransform::identity());
        second.rig_from_camera = Some(second_from_first.inverse());
    }
    Ok(Content::Cameras(ForeignFile {
        format: Format::OpenCv,
        cameras,
        notes: Vec::new(),
    }))
}

/// A key of several, with an ending of its own or behind a line.
fn find<'a>(document: &Document<'a>, keys: &[&str], ending: &str) -> Option<Document<'a>> {
    keys.iter().find_map(|key| {
        let named = document.get(&format!("{key}{ending}"));
        named.or_else(|| document.get(&format!("{key}_{ending}")))
    })
}

fn second_from_first(
    document: &Document<'_>,
    options: &ReadOptions,
) -> Result<Option<RigidTransform>, Problem> {
    let (Some(turn), Some(shift)) = (document.get("R"), document.get("T")) else {
        return Ok(None);
    };
    let rotation = turn.rotation(&turn.matrix()?.data)?;
    let [x, y, z] = shift.vector()?[..] else {
        return Err(shift.wrong("three numbers"));
    };
    let unit = options.unit.ok_or(Problem::NeedsUnit)?;
    Ok(Some(RigidTransform::new(
        rotation,
        Vector3::new(x, y, z) * unit.mm(),
    )))
}

fn sensor(document: &Document<'_>, options: &ReadOptions) -> Result<SensorSize, Problem> {
    let sides = [
        ["image_width", "image_Width", "imageWidth", "width"],
        ["image_height", "image_Height", "imageHeight", "height"],
    ];
    let [width, height] = sides.map(|keys| document.any(&keys));
    let listed = document.any(&["imageSize", "image_size", "img_size"]);
    let found = match (width, height, listed) {
        (Some(width), Some(height), _) => Some(SensorSize::new(width.side()?, height.side()?)),
        (_, _, Some(size)) => match &size.items()?[..] {
            [width, height] => Some(SensorSize::new(width.side()?, height.side()?)),
            _ => return Err(size.wrong("a list of width and height")),
        },
        _ => None,
    };
    match (found, options.sensor) {
        (Some(found), Some(said)) if found != said => Err(Problem::Disagrees {
            key: "image_width, image_height".to_owned(),
            other: format!("--size {}x{}", said.width, said.height),
        }),
        (Some(sensor), _) | (None, Some(sensor)) => Ok(sensor),
        (None, None) => Err(Problem::NeedsSize),
    }
}

/// `fisheye_model` of `OpenCV`'s sample: `None` where the file does not have it.
fn is_fisheye(document: &Document<'_>) -> Result<Option<bool>, Problem> {
    let Some(flag) = document.get("fisheye_model") else {
        return Ok(None);
    };
    match flag.text().unwrap_or_default() {
        "0" | "false" => Ok(Some(false)),
        "1" | "true" => Ok(Some(true)),
        _ => Err(flag.wrong("0 or 1")),
    }
}

fn camera(
    document: &Document<'_>,
    ending: &str,
    name: String,
    options: &ReadOptions,
) -> Result<ForeignCamera, Problem> {
    let missing = |key: &str| Problem::Missing {
        key: format!("{key}{ending}"),
    };
    let matrix = find(document, &MATRIX_KEYS, ending).ok_or_else(|| missing(MATRIX_KEYS[0]))?;
    let plane = matrix.camera_matrix(&matrix.matrix()?)?;
    let distortion =
        find(document, &DISTORTION_KEYS, ending).ok_or_else(|| missing(DISTORTION_KEYS[0]))?;
    let numbers = distortion.vector()?;
    let xi = find(document, &["xi"], ending);
    let said = match is_fisheye(document)? {
        Some(true) => Some(Hint::Fisheye),
        Some(false) => Some(Hint::Pinhole),
        None => options.model,
    };
    let (model_name, model): (String, Box<dyn CameraModel>) = if let Some(xi) = xi {
        let value = if xi.is_group() {
            xi.matrix()?.data[0]
        } else {
            xi.number()?
        };
        let [k1, k2, p1, p2] = numbers[..] else {
            return Err(distortion.wrong("the four coefficients of omnidir"));
        };
        let coefficients = [k1, k2, p1, p2, 0.0, 0.0, 0.0, 0.0];
        let omni = Omni {
            plane,
            xi: value,
            coefficients,
        };
        ("omnidir".to_owned(), Box::new(omni))
    } else {
        match (numbers.len(), said) {
            (4, None) => return Err(Problem::NeedsModel),
            (4, Some(Hint::Fisheye)) => (
                "fisheye".to_owned(),
                Box::new(Fisheye::radial(plane, &numbers)),
            ),
            (_, Some(Hint::Fisheye)) => {
                return Err(distortion.wrong("the four coefficients of a fisheye"));
            }
            (count, _) => {
                let pinhole = Pinhole::new(plane, &numbers)
                    .ok_or_else(|| distortion.wrong("4, 5, 8, 12 or 14 coefficients"))?;
                (format!("pinhole, {count} coefficients"), Box::new(pinhole))
            }
        }
    };
    Ok(ForeignCamera {
        name,
        sensor: sensor(document, options)?,
        model_name,
        model,
        rig_from_camera: None,
        valid: None,
    })
}
