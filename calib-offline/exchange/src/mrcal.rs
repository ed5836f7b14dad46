//! mrcal's `.cameramodel`: a Python literal, a file a camera.
//!
//! Written: both `extrinsics`, which 2.2 needs, and `rt_cam_ref`, from the same numbers, or 2.5 would refuse the file; lengths are meters, the reference is
//! the rig's frame. Numbers are decimals with all their digits; mrcal reads no `nan` and no `2*500`. `fov_x_deg` of a splined
//! model is a whole number. The valid region has its first vertex again at its end: an open polygon would be dropped. It is the widest run of calibrated
//! pixels of some rows, so that holes of the calibrated area are not in it. Comments are lost when mrcal writes the file anew, and an exported model has no
//! `optimization_inputs`, so that mrcal can show no uncertainty. Lost: that rays do not meet in a point, and uncertainty.
//!
//! Read: mrcal itself writes ten digits. `extrinsics` (2.2) and `rt_cam_ref` (2.5) are the same six numbers, a rotation vector and a
//! translation that take points of the reference frame into the camera's; a file may have both, and they must agree. The unit is not in
//! the file: mrcal's own documents and tools mean meters, which is taken unless another is said. The valid region is a
//! polygon with its first vertex repeated; `[]` is a region that is empty, and an open polygon counts as none, as for mrcal. Only orders 2 and 3 of
//! the splined model are there, and it is never asked beyond its knots. `optimization_inputs` are passed over. Older files, with
//! `distortion_model`, are refused.

use crate::NamedFile;
use crate::foreign::{ForeignCamera, ForeignFile, Format};
use crate::model::{
    Cahvor, CameraModel, Circle, Entrance, ImagePlane, LonLat, Order, Pinhole, Splined,
    Stereographic,
};
use crate::nearest::Pinholes;
use crate::read::{Document, Problem, ReadOptions, Unit};
use crate::splined_fit::SplinedCameras;
use crate::valid_region::valid_polygon;
use crate::yaml::list;
use calib_blob::rays::RaySource;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use nalgebra::Vector3;

const KNOWN: &str = "PINHOLE, STEREOGRAPHIC, LONLAT, LATLON, OPENCV4, 5, 8, 12, CAHVOR, CAHVORE_linearity=..., \
    SPLINED_STEREOGRAPHIC_order=..._Nx=..._Ny=..._fov_x_deg=...";

const MM_PER_M: f64 = 1000.0;

/// The files of pinholes with 4, 5 or 8 coefficients.
pub fn files(source: &dyn RaySource, pinholes: &Pinholes) -> Vec<NamedFile> {
    let cameras = pinholes.cameras.iter().enumerate();
    cameras
        .map(|(camera_idx, camera)| {
            let lens = &camera.lens;
            let core = lens.core();
            let written = Written {
                name: &camera.name,
                model: format!("LENSMODEL_OPENCV{}", lens.distortion.count()),
                intrinsics: core
                    .iter()
                    .chain(lens.own_coefficients())
                    .copied()
                    .collect(),
                sensor: lens.sensor,
                reference_from_camera: camera.rig_from_pinhole,
                valid: valid_polygon(source, camera_idx, lens.sensor),
            };
            written.file()
        })
        .collect()
}

/// The files of splined cameras.
pub fn splined_files(source: &dyn RaySource, splined: &SplinedCameras) -> Vec<NamedFile> {
    let cameras = splined.cameras.iter().enumerate();
    cameras
        .map(|(camera_idx, camera)| {
            let [nx, ny] = camera.knots;
            let written = Written {
                name: &camera.name,
                model: format!(
                    "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx={nx}_Ny={ny}_fov_x_deg={}",
                    camera.fov_x_deg
                ),
                intrinsics: camera.core.iter().chain(&camera.shifts).copied().collect(),
                sensor: camera.sensor,
                reference_from_camera: camera.rig_from_camera,
                valid: valid_polygon(source, camera_idx, camera.sensor),
            };
            written.file()
        })
        .collect()
}

/// What a file holds.
struct Written<'a> {
    name: &'a str,
    model: String,
    intrinsics: Vec<f64>,
    sensor: SensorSize,
    reference_from_camera: RigidTransform,
    valid: Vec<PixelPoint>,
}

impl Written<'_> {
    fn file(&self) -> NamedFile {
        let camera_from_reference = self.reference_from_camera.inverse();
        let turn = so3::log(&camera_from_reference.rotation);
        let shift_m = camera_from_reference.translation_mm / MM_PER_M;
        let place = list(turn.iter().chain(shift_m.iter()).copied());
        let vertices: Vec<String> = self
            .valid
            .iter()
            .map(|pixel| list([pixel.u, pixel.v]))
            .collect();
        let text = format!(
            "# Lengths in meters, the reference is the frame of the rig.\n\
             {{\n    'lensmodel':  '{}',\n\n    'intrinsics': {},\n\n    'extrinsics': {place},\n    'rt_cam_ref': {place},\n\n    \
             'imagersize': [ {}, {} ],\n\n    'valid_intrinsics_region': [ {} ],\n}}\n",
            self.model,
            list(self.intrinsics.iter().copied()),
            self.sensor.width,
            self.sensor.height,
            vertices.join(", "),
        );
        (format!("{}.cameramodel", self.name), text.into_bytes())
    }
}

/// The only camera of a file; `stem` is its name.
pub(crate) fn read(
    document: &Document<'_>,
    stem: &str,
    options: &ReadOptions,
) -> Result<ForeignFile, Problem> {
    let unit = options.unit.unwrap_or(Unit::M);
    let size = document.need("imagersize")?;
    let sides = size.items()?;
    let [width, height] = &sides[..] else {
        return Err(size.wrong("a list of width and height"));
    };
    let name = document.need("lensmodel")?;
    let (model_name, model) = model(&name, &document.need("intrinsics")?, unit)?;
    let mut notes = Vec::new();
    if options.unit.is_none() {
        notes.push("lengths taken for meters, as mrcal's documents have them".to_owned());
    }
    Ok(ForeignFile {
        format: Format::Mrcal,
        cameras: vec![ForeignCamera {
            name: stem.to_owned(),
            sensor: SensorSize::new(width.side()?, height.side()?),
            model_name,
            model,
            rig_from_camera: Some(camera_from_reference(document, unit)?.inverse()),
            valid: valid_region(document, &mut notes)?,
        }],
        notes,
    })
}

fn camera_from_reference(document: &Document<'_>, unit: Unit) -> Result<RigidTransform, Problem> {
    let [new, old] = ["rt_cam_ref", "extrinsics"].map(|key| document.get(key));
    let numbers = match (new, old) {
        (Some(new), Some(old)) => {
            let numbers = new.exactly::<6>()?;
            if numbers != old.exactly::<6>()? {
                return Err(new.disagrees("\"extrinsics\""));
            }
            numbers
        }
        (Some(only), None) | (None, Some(only)) => only.exactly()?,
        (None, None) => {
            return Err(Problem::Missing {
                key: "rt_cam_ref or extrinsics".to_owned(),
            });
        }
    };
    let [rx, ry, rz, x, y, z] = numbers;
    Ok(RigidTransform::new(
        so3::exp(&Vector3::new(rx, ry, rz)),
        Vector3::new(x, y, z) * unit.mm(),
    ))
}

fn valid_region(
    document: &Document<'_>,
    notes: &mut Vec<String>,
) -> Result<Option<Vec<PixelPoint>>, Problem> {
    let Some(region) = document.get("valid_intrinsics_region") else {
        return Ok(None);
    };
    if region.is_nothing() {
        return Ok(None);
    }
    let vertices = region.items()?;
    let points = vertices.iter().map(|vertex| {
        let [u, v] = vertex.exactly()?;
        Ok(PixelPoint::new(u, v))
    });
    let points = points.collect::<Result<Vec<_>, Problem>>()?;
    if !points.is_empty() && (points.len() < 4 || points.first() != points.last()) {
        notes.push("the valid region is an open polygon, which counts as none".to_owned());
        return Ok(None);
    }
    Ok(Some(points))
}

/// A number of a configuration such as `order=3_Nx=30_Ny=18_fov_x_deg=150`.
fn configured(name: &Document<'_>, config: &str, key: &str) -> Result<f64, Problem> {
    // `fov_x_deg` has lines in its name, so keys are looked for and not cut.
    let found = config.split(&format!("_{key}=")).nth(1);
    let value = found.map(|rest| rest.split('_').next().unwrap_or(rest));
    value
        .and_then(|value| value.parse().ok())
        .filter(|value: &f64| value.is_finite())
        .ok_or_else(|| name.wrong(format!("a model with {key}=...")))
}

fn whole(name: &Document<'_>, config: &str, key: &str) -> Result<usize, Problem> {
    let value = configured(name, config, key)?;
    if (1.0..=10_000.0).contains(&value) && value.fract() == 0.0 {
        Ok(value as usize)
    } else {
        Err(name.wrong(format!("a model with a whole number for {key}")))
    }
}

fn model(
    name: &Document<'_>,
    intrinsics: &Document<'_>,
    unit: Unit,
) -> Result<(String, Box<dyn CameraModel>), Problem> {
    let full = name.text()?;
    let short = full.strip_prefix("LENSMODEL_").unwrap_or_default();
    let numbers = intrinsics.numbers()?;
    let [fx, fy, cx, cy, own @ ..] = &numbers[..] else {
        return Err(intrinsics.wrong("a list that begins with fx, fy, cx, cy"));
    };
    let plane: ImagePlane = intrinsics.plane([*fx, *fy, *cx, *cy])?;
    let counted = |count: usize| {
        if own.len() == count {
            Ok(())
        } else {
            Err(intrinsics.wrong(format!("a list of {} numbers for {full}", 4 + count)))
        }
    };
    let model: Box<dyn CameraModel> = match short {
        "STEREOGRAPHIC" => {
            counted(0)?;
            Box::new(Stereographic { plane })
        }
        "LONLAT" | "LATLON" => {
            counted(0)?;
            let circle = match short {
                "LONLAT" => Circle::AlongU,
                _ => Circle::AlongV,
            };
            Box::new(LonLat { plane, circle })
        }
        "PINHOLE" | "OPENCV4" | "OPENCV5" | "OPENCV8" | "OPENCV12" => {
            let count = short.strip_prefix("OPENCV").map_or(Ok(0), str::parse);
            counted(count.unwrap_or(0))?;
            let wrong = || intrinsics.wrong("coefficients of OpenCV's");
            Box::new(Pinhole::new(plane, own).ok_or_else(wrong)?)
        }
        "CAHVOR" => {
            counted(5)?;
            Box::new(Cahvor {
                plane,
                axis_rad: [own[0], own[1]],
                radial: [own[2], own[3], own[4]],
                entrance: None,
            })
        }
        _ if short.starts_with("CAHVORE_") => {
            counted(8)?;
            Box::new(Cahvor {
                plane,
                axis_rad: [own[0], own[1]],
                radial: [own[2], own[3], own[4]],
                entrance: Some(Entrance {
                    shift_mm: [own[5], own[6], own[7]].map(|e| e * unit.mm()),
                    linearity: configured(name, short, "linearity")?,
                }),
            })
        }
        _ if short.starts_with("SPLINED_STEREOGRAPHIC_") => {
            let order = match whole(name, short, "order")? {
                2 => Order::Quadratic,
                3 => Order::Cubic,
                _ => return Err(name.wrong("a splined model of order 2 or 3")),
            };
            let knots = [whole(name, short, "Nx")?, whole(name, short, "Ny")?];
            counted(2 * knots[0] * knots[1])?;
            let fov_x_deg = configured(name, short, "fov_x_deg")?;
            let splined = Splined::new(plane, order, knots, fov_x_deg, own);
            let wrong =
                || name.wrong("a splined model with 4 knots or more each way and a field of view");
            Box::new(splined.ok_or_else(wrong)?)
        }
        _ => {
            return Err(Problem::Model {
                key: name.key().to_owned(),
                found: full.to_owned(),
                known: KNOWN,
            });
        }
    };
    Ok((full.to_owned(), model))
}
