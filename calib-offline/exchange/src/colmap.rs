//! COLMAP's `cameras.txt`: a line a camera, `ID MODEL WIDTH HEIGHT PARAMS...`.
//!
//! Quirks. COLMAP's pixels have their origin at the corner of the image: the center of the top-left one is (0.5, 0.5), so half a pixel is
//! taken from the principal point. Models with one focal length have three numbers before their own. Intrinsics only: where
//! cameras stand is a matter of images there (`images.txt`), in a frame and a unit that a reconstruction leaves open, so that of several
//! cameras one at a time can be taken. `EQUIRECTANGULAR` has no numbers, and is refused.

use crate::foreign::{ForeignCamera, ForeignFile, Format};
use crate::model::{CameraModel, Division, Eucm, Fisheye, Fov, ImagePlane, Pinhole};
use crate::read::{Document, Node, Problem, Value};
use calib_rays::geometry::SensorSize;

/// From COLMAP's pixels to ours.
const HALF_PIXEL: f64 = 0.5;

const KNOWN: &str = "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE, FOV, \
    SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, THIN_PRISM_FISHEYE, RAD_TAN_THIN_PRISM_FISHEYE, SIMPLE_DIVISION, DIVISION, \
    SIMPLE_FISHEYE, FISHEYE, EUCM";

/// Lines that say something.
fn lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let lines = text.lines().enumerate();
    lines
        .map(|(number, line)| (number + 1, line.split_whitespace().collect::<Vec<_>>()))
        .filter(|(_, words)| words.first().is_some_and(|word| !word.starts_with('#')))
}

/// Whether a file begins as cameras do: a number, a word in capitals, two numbers.
pub(crate) fn is_cameras(text: &str) -> bool {
    let Some((_, words)) = lines(text).next() else {
        return false;
    };
    let [id, model, width, height, ..] = &words[..] else {
        return false;
    };
    let is_name = |word: &str| word.chars().all(|c| c.is_ascii_uppercase() || c == '_');
    [id, width, height]
        .iter()
        .all(|word| word.parse::<u64>().is_ok())
        && is_name(model)
}

/// The cameras, called by their numbers.
pub(crate) fn cameras(text: &str) -> Result<ForeignFile, Problem> {
    let mut cameras = Vec::new();
    for (line, words) in lines(text) {
        let syntax = |message: &str| Problem::Syntax {
            line,
            message: message.to_owned(),
        };
        let [id, model_name, width, height, numbers @ ..] = &words[..] else {
            return Err(syntax("a camera is ID MODEL WIDTH HEIGHT PARAMS"));
        };
        let side = |word: &str| {
            let side = word.parse::<u32>().ok();
            side.filter(|side| (1..=u32::from(u16::MAX)).contains(side))
                .ok_or_else(|| syntax("a side of the image is a whole number from 1 to 65535"))
        };
        let node = Node::map(vec![(
            format!("PARAMS of camera {id}"),
            Node(Value::List(
                numbers.iter().map(|word| Node::plain(*word)).collect(),
            )),
        )])?;
        let document = Document::new(&node);
        let params = document.need(&format!("PARAMS of camera {id}"))?;
        cameras.push(ForeignCamera {
            name: (*id).to_owned(),
            sensor: SensorSize::new(side(width)?, side(height)?),
            model_name: (*model_name).to_owned(),
            model: model(model_name, &params)?,
            rig_from_camera: None,
            valid: None,
        });
    }
    Ok(ForeignFile {
        format: Format::Colmap,
        cameras,
        notes: Vec::new(),
    })
}

fn model(name: &str, params: &Document<'_>) -> Result<Box<dyn CameraModel>, Problem> {
    // Focal lengths, and numbers of its own.
    let (focal_count, own_count) = match name {
        "SIMPLE_PINHOLE" | "SIMPLE_FISHEYE" => (1, 0),
        "SIMPLE_RADIAL" | "SIMPLE_RADIAL_FISHEYE" | "SIMPLE_DIVISION" => (1, 1),
        "RADIAL" | "RADIAL_FISHEYE" => (1, 2),
        "PINHOLE" | "FISHEYE" => (2, 0),
        "FOV" | "DIVISION" => (2, 1),
        "EUCM" => (2, 2),
        "OPENCV" | "OPENCV_FISHEYE" => (2, 4),
        "FULL_OPENCV" | "THIN_PRISM_FISHEYE" => (2, 8),
        "RAD_TAN_THIN_PRISM_FISHEYE" => (2, 12),
        _ => {
            return Err(Problem::Model {
                key: params.key().to_owned(),
                found: name.to_owned(),
                known: KNOWN,
            });
        }
    };
    let numbers = params.numbers()?;
    let count = focal_count + 2 + own_count;
    if numbers.len() != count {
        return Err(params.wrong(format!("a list of {count} numbers for {name}")));
    }
    let (core, own) = numbers.split_at(focal_count + 2);
    let [cx, cy] = [core[focal_count], core[focal_count + 1]].map(|c| c - HALF_PIXEL);
    let plane: ImagePlane = params.plane([core[0], core[focal_count - 1], cx, cy])?;
    let brown = |coefficients: &[f64]| -> Box<dyn CameraModel> {
        let mut all = [0.0; 8];
        all[..coefficients.len()].copy_from_slice(coefficients);
        Box::new(Pinhole {
            plane,
            coefficients: all,
            prism: [0.0; 4],
            tilt_rad: [0.0; 2],
        })
    };
    Ok(match (name, own) {
        ("FOV", [angle_rad]) if *angle_rad > 0.0 => Box::new(Fov {
            plane,
            angle_rad: *angle_rad,
        }),
        ("FOV", _) => return Err(params.wrong("with omega above 0")),
        ("SIMPLE_DIVISION" | "DIVISION", [k]) => Box::new(Division {
            plane,
            coefficient: *k,
        }),
        ("EUCM", [alpha, beta]) => Box::new(Eucm {
            plane,
            alpha: *alpha,
            beta: *beta,
        }),
        ("THIN_PRISM_FISHEYE", [k1, k2, p1, p2, k3, k4, s1, s3]) => Box::new(Fisheye {
            plane,
            radial: vec![*k1, *k2, *k3, *k4],
            tangential: [*p1, *p2],
            prism: [*s1, 0.0, *s3, 0.0],
            is_in_turn: false,
        }),
        ("RAD_TAN_THIN_PRISM_FISHEYE", [radial @ .., p0, p1, s0, s1, s2, s3]) => {
            Box::new(Fisheye {
                plane,
                radial: radial.to_vec(),
                // COLMAP's first one is Brown's second.
                tangential: [*p1, *p0],
                prism: [*s0, *s1, *s2, *s3],
                is_in_turn: true,
            })
        }
        (name, own) if name.ends_with("FISHEYE") => Box::new(Fisheye::radial(plane, own)),
        (_, own) => brown(own),
    })
}
