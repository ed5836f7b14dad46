//! Kalibr's `camchain.yaml`, after its reader (commit 1f60227).
//!
//! Quirks. `radtan` has four coefficients and no k3: it is fitted with four; so has `equidistant`, a fisheye's. Lengths are meters. `T_cn_cnm1` takes points of the
//! camera before into this one's frame. `resolution` is whole numbers. `rostopic` is asked for, and made of the camera's
//! name. Lists are in flow style; numbers have a point and a signed exponent, else its reader takes them for text. Lost: as for
//! `OpenCV`.
//!
//! Read: `pinhole` and `omni` with `radtan`, `equidistant`, `fov` or `none`, `eucm` and `ds` with `none`; its reader checks the number of
//! coefficients, and so does this one. The order of the numbers is `xi` before `fx` in `omni` and `ds` (`xi, alpha, fx, ...`), `alpha, beta`
//! before it in `eucm`. Keys of the IMU are tolerated.

use super::yaml::list;
use super::{NamedFile, Pinholes};
use crate::foreign::{ForeignCamera, ForeignFile, Format};
use crate::model::{CameraModel, DoubleSphere, Eucm, Fisheye, Fov, Omni, Pinhole};
use crate::read::{Document, Problem, ReadOptions, Unit};
use calib_rays::geometry::{RigidTransform, SensorSize};
use nalgebra::{Matrix4, Vector3};
use std::fmt::Write as _;

const MM_PER_M: f64 = 1000.0;

/// The file, for lenses with four coefficients.
pub fn files(pinholes: &Pinholes) -> Vec<NamedFile> {
    let mut text = String::new();
    let mut before = None;
    for (number, camera) in pinholes.cameras.iter().enumerate() {
        let lens = &camera.lens;
        let model = if lens.distortion.is_fisheye() {
            "equidistant"
        } else {
            "radtan"
        };
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
            "  camera_model: pinhole\n  intrinsics: {}\n  distortion_model: {}\n  distortion_coeffs: {}\n  \
             resolution: [ {}, {} ]\n  rostopic: \"/{}/image_raw\"\n",
            list(lens.core()),
            model,
            list(lens.coefficients[..4].iter().copied()),
            lens.sensor.width,
            lens.sensor.height,
            camera.name
        );
        before = Some(camera.rig_from_pinhole);
    }
    vec![("camchain.yaml".to_owned(), text.into_bytes())]
}

/// The cameras of a chain, in the frame of the first.
pub(crate) fn read(document: &Document<'_>, options: &ReadOptions) -> Result<ForeignFile, Problem> {
    let mut cameras: Vec<ForeignCamera> = Vec::new();
    let mut place = RigidTransform::identity();
    while let Some(camera) = document.get(&format!("cam{}", cameras.len())) {
        let chained = camera.get("T_cn_cnm1");
        if cameras.is_empty() {
            if let Some(chained) = chained {
                return Err(chained.disagrees("being the first camera, with none before it"));
            }
        } else {
            let chained = match chained {
                Some(chained) => chained,
                None => camera.need("T_cn_cnm1")?,
            };
            let own_from_before = transform(&chained, options.unit.unwrap_or(Unit::M))?;
            place = place * own_from_before.inverse();
        }
        let (model_name, model) = model(&camera)?;
        let resolution = camera.need("resolution")?;
        let sides = resolution.items()?;
        let [width, height] = &sides[..] else {
            return Err(resolution.wrong("a list of width and height"));
        };
        cameras.push(ForeignCamera {
            name: name(&camera, cameras.len()),
            sensor: SensorSize::new(width.side()?, height.side()?),
            model_name,
            model,
            rig_from_camera: Some(place),
            valid: None,
        });
    }
    let beyond = document.keys().into_iter().find(|key| {
        let number = key
            .strip_prefix("cam")
            .and_then(|n| n.parse::<usize>().ok());
        number.is_some_and(|number| number >= cameras.len())
    });
    if beyond.is_some() {
        return Err(Problem::Missing {
            key: format!("cam{}", cameras.len()),
        });
    }
    Ok(ForeignFile {
        format: Format::Kalibr,
        cameras,
        notes: Vec::new(),
    })
}

/// `left` of `/left/image_raw`; else the key.
fn name(camera: &Document<'_>, number: usize) -> String {
    let topic = camera.get("rostopic").and_then(|topic| topic.text().ok());
    let parts = topic.map(|topic| topic.split('/').filter(|part| !part.is_empty()));
    match parts.map(Iterator::collect::<Vec<_>>).as_deref() {
        Some([.., name, _]) => (*name).to_owned(),
        _ => format!("cam{number}"),
    }
}

fn transform(document: &Document<'_>, unit: Unit) -> Result<RigidTransform, Problem> {
    let matrix = document.rows()?;
    if (matrix.rows, matrix.cols) != (4, 4) || matrix.data[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(document.wrong("a rigid transform of 4 x 4"));
    }
    let row = |k: usize| &matrix.data[4 * k..4 * k + 3];
    let rotation = document.rotation(&[row(0), row(1), row(2)].concat())?;
    let shift = Vector3::new(matrix.data[3], matrix.data[7], matrix.data[11]);
    Ok(RigidTransform::new(rotation, shift * unit.mm()))
}

fn model(camera: &Document<'_>) -> Result<(String, Box<dyn CameraModel>), Problem> {
    let intrinsics = camera.need("intrinsics")?;
    let numbers = intrinsics.numbers()?;
    let distortion = camera.need("distortion_model")?;
    let coefficients = camera.need("distortion_coeffs")?;
    let coefficient = coefficients.numbers()?;
    let kind = camera.need("camera_model")?;
    let counted = |count: usize| coefficients.wrong(format!("a list of {count} numbers"));
    let brown = || match coefficient[..] {
        [k1, k2, p1, p2] => Ok([k1, k2, p1, p2, 0.0, 0.0, 0.0, 0.0]),
        _ => Err(counted(4)),
    };
    let none = || match coefficient.len() {
        0 => Ok(()),
        _ => Err(counted(0)),
    };
    let wrong = |count: usize| intrinsics.wrong(format!("a list of {count} numbers"));
    let names = (kind.text()?, distortion.text()?);
    let model: Box<dyn CameraModel> = match names {
        ("pinhole", distortion) => {
            let numbers = <[f64; 4]>::try_from(numbers).map_err(|_| wrong(4))?;
            let plane = intrinsics.plane(numbers)?;
            match distortion {
                "radtan" => Box::new(Pinhole {
                    plane,
                    coefficients: brown()?,
                    prism: [0.0; 4],
                    tilt_rad: [0.0; 2],
                }),
                "equidistant" if coefficient.len() != 4 => return Err(counted(4)),
                "equidistant" => Box::new(Fisheye::radial(plane, &coefficient)),
                "fov" => match coefficient[..] {
                    [angle_rad] if angle_rad > 0.0 && angle_rad < std::f64::consts::PI => {
                        Box::new(Fov { plane, angle_rad })
                    }
                    _ => return Err(coefficients.wrong("one angle above 0, rad")),
                },
                "none" => {
                    none()?;
                    Box::new(Pinhole {
                        plane,
                        coefficients: [0.0; 8],
                        prism: [0.0; 4],
                        tilt_rad: [0.0; 2],
                    })
                }
                _ => return Err(unknown(names)),
            }
        }
        ("omni", "radtan" | "none") => {
            let [xi, fx, fy, cx, cy] = <[f64; 5]>::try_from(numbers).map_err(|_| wrong(5))?;
            let coefficients = if names.1 == "none" {
                none()?;
                [0.0; 8]
            } else {
                brown()?
            };
            Box::new(Omni {
                plane: intrinsics.plane([fx, fy, cx, cy])?,
                xi,
                coefficients,
            })
        }
        ("eucm" | "ds", "none") => {
            none()?;
            let [a, b, fx, fy, cx, cy] = <[f64; 6]>::try_from(numbers).map_err(|_| wrong(6))?;
            let plane = intrinsics.plane([fx, fy, cx, cy])?;
            if names.0 == "eucm" {
                Box::new(Eucm {
                    plane,
                    alpha: a,
                    beta: b,
                })
            } else {
                Box::new(DoubleSphere {
                    plane,
                    xi: a,
                    alpha: b,
                })
            }
        }
        _ => return Err(unknown(names)),
    };
    Ok((format!("{}-{}", names.0, names.1), model))
}

fn unknown((kind, distortion): (&str, &str)) -> Problem {
    Problem::Model {
        key: "camera_model, distortion_model".to_owned(),
        found: format!("{kind}-{distortion}"),
        known: "pinhole with radtan, equidistant, fov or none, omni with radtan or none, eucm-none, ds-none",
    }
}
