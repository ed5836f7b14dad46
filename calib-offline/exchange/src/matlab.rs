//! MATLAB's `cameraParameters` and `stereoParameters`, as `jsonencode(toStruct(params))` writes them. From its documents; MATLAB was not run.
//!
//! Quirks. The center of the top-left pixel is (1, 1): one is taken from the principal point. `ImageSize` is rows, then columns.
//! `IntrinsicMatrix` is the transposed of `K`: which of both a file means is checked against where its ones stand. `RadialDistortion` has two or
//! three numbers. `WorldUnits` says the unit; where it is another word than mm or m (or their long forms) it is asked. `RotationOfCamera2` takes rows,
//! `PoseCamera2` columns, but no file says so: `--rotation` is demanded. Skew is refused.

use crate::foreign::{ForeignCamera, ForeignFile, Format};
use crate::model::{CameraModel, ImagePlane, Pinhole};
use crate::read::{Document, Matrix, Problem, ReadOptions, RotationForm, Unit};
use calib_rays::geometry::{RigidTransform, SensorSize};
use nalgebra::Vector3;

/// From MATLAB's pixels to ours.
const FIRST_PIXEL: f64 = 1.0;

/// Whether these are MATLAB's keys.
pub(crate) fn is_parameters(document: &Document<'_>) -> bool {
    let own = ["RadialDistortion", "CameraParameters1"];
    document.any(&own).is_some()
}

/// One camera, called `stem`, or the two of a pair.
pub(crate) fn read(
    document: &Document<'_>,
    stem: &str,
    options: &ReadOptions,
) -> Result<ForeignFile, Problem> {
    let cameras = match document.get("CameraParameters1") {
        None => vec![camera(document, stem.to_owned(), options)?],
        Some(first) => {
            let second = document.need("CameraParameters2")?;
            let mut first_camera = camera(&first, format!("{stem}1"), options)?;
            let mut second_camera = camera(&second, format!("{stem}2"), options)?;
            let unit = unit(&[document.clone(), first], options)?;
            let second_from_first = second_from_first(document, unit, options)?;
            first_camera.rig_from_camera = Some(RigidTransform::identity());
            second_camera.rig_from_camera = Some(second_from_first.inverse());
            vec![first_camera, second_camera]
        }
    };
    Ok(ForeignFile {
        format: Format::Matlab,
        cameras,
        notes: Vec::new(),
    })
}

fn unit(places: &[Document<'_>], options: &ReadOptions) -> Result<Unit, Problem> {
    let said = places.iter().find_map(|place| place.get("WorldUnits"));
    let word = said.as_ref().and_then(|word| word.text().ok());
    let found = match word {
        Some("mm" | "millimeters" | "millimeter") => Some(Unit::Mm),
        Some("m" | "meters" | "meter") => Some(Unit::M),
        _ => None,
    };
    match (found, options.unit, said) {
        (Some(found), Some(asked), Some(said)) if found != asked => Err(said.disagrees("--unit")),
        (Some(unit), ..) | (None, Some(unit), _) => Ok(unit),
        (None, None, _) => Err(Problem::NeedsUnit),
    }
}

fn second_from_first(
    document: &Document<'_>,
    unit: Unit,
    options: &ReadOptions,
) -> Result<RigidTransform, Problem> {
    let (turn, shift) = match document.get("PoseCamera2") {
        Some(pose) => (pose.need("R")?, pose.need("Translation")?),
        None => (
            document.need("RotationOfCamera2")?,
            document.need("TranslationOfCamera2")?,
        ),
    };
    let form = options.rotation.ok_or_else(|| Problem::NeedsRotationForm {
        key: turn.key().to_owned(),
    })?;
    let rotation = turn.rotation(&turn.rows()?.data)?;
    let shift = Vector3::from(flat::<3>(&shift)?) * unit.mm();
    let rotation = match form {
        RotationForm::Row => rotation.transpose(),
        RotationForm::Column => rotation,
    };
    Ok(RigidTransform::new(rotation, shift))
}

/// A vector that may be wrapped in a row of its own.
fn flat<const N: usize>(document: &Document<'_>) -> Result<[f64; N], Problem> {
    match &document.items()?[..] {
        [row] if N > 1 => row.exactly(),
        _ => document.exactly(),
    }
}

fn camera(
    document: &Document<'_>,
    name: String,
    options: &ReadOptions,
) -> Result<ForeignCamera, Problem> {
    let sensor = match (document.get("ImageSize"), options.sensor) {
        (Some(size), said) => {
            let sides = size.items()?;
            let sensor = match &sides[..] {
                [rows, cols] => Some(SensorSize::new(cols.side()?, rows.side()?)),
                [] => None,
                _ => return Err(size.wrong("a list of rows and columns")),
            };
            if let (Some(found), Some(said)) = (sensor, said)
                && found != said
            {
                return Err(size.disagrees(format!("--size {}x{}", said.width, said.height)));
            }
            sensor.or(said)
        }
        (None, said) => said,
    };
    let radial = document.need("RadialDistortion")?;
    let [k1, k2, k3] = match radial.numbers()?[..] {
        [k1, k2] => [k1, k2, 0.0],
        [k1, k2, k3] => [k1, k2, k3],
        _ => return Err(radial.wrong("a list of two or three numbers")),
    };
    let [p1, p2] = document.need("TangentialDistortion")?.exactly()?;
    let plane = plane(document)?;
    let model: Box<dyn CameraModel> = Box::new(Pinhole {
        plane,
        coefficients: [k1, k2, p1, p2, k3, 0.0, 0.0, 0.0],
        prism: [0.0; 4],
        tilt_rad: [0.0; 2],
    });
    Ok(ForeignCamera {
        name,
        sensor: sensor.ok_or(Problem::NeedsSize)?,
        model_name: "cameraParameters".to_owned(),
        model,
        rig_from_camera: None,
        valid: None,
    })
}

fn plane(document: &Document<'_>) -> Result<ImagePlane, Problem> {
    let (key, matrix) = match (document.get("K"), document.get("IntrinsicMatrix")) {
        (Some(key), other) => {
            let matrix = key.rows()?;
            if let Some(other) = other
                && transposed(&other.rows()?) != matrix
            {
                return Err(key.disagrees("\"IntrinsicMatrix\", which is its transposed"));
            }
            (key, matrix)
        }
        (None, Some(key)) => {
            let matrix = transposed(&key.rows()?);
            (key, matrix)
        }
        (None, None) => {
            return Err(Problem::Missing {
                key: "K or IntrinsicMatrix".to_owned(),
            });
        }
    };
    let mut plane = key.camera_matrix(&matrix)?;
    for center in &mut plane.center_px {
        *center -= FIRST_PIXEL;
    }
    Ok(plane)
}

fn transposed(matrix: &Matrix) -> Matrix {
    let Matrix { rows, cols, data } = matrix;
    let places = (0..*cols).flat_map(|col| (0..*rows).map(move |row| row * cols + col));
    Matrix {
        rows: *cols,
        cols: *rows,
        data: places.map(|place| data[place]).collect(),
    }
}
