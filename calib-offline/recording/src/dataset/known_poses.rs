//! `[poses] known`: where the target stood, by other means than the cameras, such as a plate on a linear stage.
//! One row per pose, header `pose,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg` with optional `sigma_mm,sigma_deg`.

use super::corners::fields::{shortened, unquoted};
use super::corners::row::FARTHEST_MM;
use calib_rays::geometry::{RigidTransform, so3};
use calib_rays::observed::KnownPose;
use calib_rays::remedy::Remedy;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The header without the optional columns.
pub const HEADER: &str = "pose,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg";
/// The header with them.
pub const HEADER_WITH_SIGMAS: &str = "pose,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg,sigma_mm,sigma_deg";

/// A rotation vector's components are no larger than a whole turn.
const MOST_DEG: f64 = 360.0;

/// Why the file was not accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KnownPosesError {
    /// The system refused to read it.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The first line is not the header.
    #[error("{}:1: the header is \"{found}\", it must be \"{HEADER}\" or \"{HEADER_WITH_SIGMAS}\"", file.display())]
    Header {
        /// The file.
        file: PathBuf,
        /// What stands there, shortened.
        found: String,
    },
    /// It has only a header.
    #[error("{}:1: there is no pose in it", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// Too few or too many fields.
    #[error("{}:{line}: has {have} fields, the header has {need}", file.display())]
    FieldCount {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// Fields.
        have: usize,
        /// Columns.
        need: usize,
    },
    /// A field that is no number.
    #[error("{}:{line}: {column} is \"{text}\", it must be a {expected}", file.display())]
    Number {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The column.
        column: &'static str,
        /// The field, shortened.
        text: String,
        /// What it must be.
        expected: &'static str,
    },
    /// A place or a turn that is beyond all bounds.
    #[error("{}:{line}: {column} is {value:e}; it lies between -{most} and {most}", file.display())]
    Beyond {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The column.
        column: &'static str,
        /// The value.
        value: f64,
        /// The most.
        most: f64,
    },
    /// One pose twice.
    #[error("{}:{line}: pose {pose} stands already in line {first_line}", file.display())]
    Duplicate {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// Line of the first one.
        first_line: usize,
        /// The pose.
        pose: usize,
    },
}

impl Remedy for KnownPosesError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Read { .. } => "check the path and the permissions, or leave [poses] known out",
            Self::Header { .. } => {
                "the first line names the columns, in this order: place and rotation vector of the target in the rig's frame"
            }
            Self::Empty { .. } => "add poses, or leave [poses] known out",
            Self::FieldCount { .. } => {
                "each line has one pose; decimal points are points, not commas"
            }
            Self::Number { .. } => "correct the field; poses count from 0",
            Self::Beyond { .. } => {
                "correct the field: millimeters, and degrees of a rotation vector"
            }
            Self::Duplicate { .. } => "keep the better of the two lines",
        };
        Some(text.to_owned())
    }
}

/// Reads the file.
///
/// # Errors
/// [`KnownPosesError`], with the line.
pub fn read(file: &Path) -> Result<BTreeMap<usize, KnownPose>, KnownPosesError> {
    let text = std::fs::read_to_string(file).map_err(|source| KnownPosesError::Read {
        file: file.to_owned(),
        source,
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut lines = text.lines().enumerate();
    let header = lines.next().map_or("", |(_, line)| line.trim());
    let names: Vec<&str> = header.split(',').map(unquoted).collect();
    let need = match names.join(",").as_str() {
        HEADER => 7,
        HEADER_WITH_SIGMAS => 9,
        _ => {
            return Err(KnownPosesError::Header {
                file: file.to_owned(),
                found: shortened(header),
            });
        }
    };
    let mut poses = BTreeMap::new();
    let mut line_of = BTreeMap::new();
    for (index, text) in lines {
        if text.trim().is_empty() {
            continue;
        }
        let line = index + 1;
        let (number, pose) = row(file, line, text, need)?;
        if let Some(first_line) = line_of.insert(number, line) {
            return Err(KnownPosesError::Duplicate {
                file: file.to_owned(),
                line,
                first_line,
                pose: number,
            });
        }
        poses.insert(number, pose);
    }
    if poses.is_empty() {
        return Err(KnownPosesError::Empty {
            file: file.to_owned(),
        });
    }
    Ok(poses)
}

fn row(
    file: &Path,
    line: usize,
    text: &str,
    need: usize,
) -> Result<(usize, KnownPose), KnownPosesError> {
    const COLUMNS: [&str; 9] = [
        "pose",
        "x_mm",
        "y_mm",
        "z_mm",
        "rx_deg",
        "ry_deg",
        "rz_deg",
        "sigma_mm",
        "sigma_deg",
    ];
    let fields: Vec<&str> = text.split(',').map(unquoted).collect();
    if fields.len() != need {
        return Err(KnownPosesError::FieldCount {
            file: file.to_owned(),
            line,
            have: fields.len(),
            need,
        });
    }
    let not_a = |k: usize, expected| KnownPosesError::Number {
        file: file.to_owned(),
        line,
        column: COLUMNS[k],
        text: shortened(fields[k]),
        expected,
    };
    let number = fields[0]
        .parse::<usize>()
        .map_err(|_| not_a(0, "whole number from 0"))?;
    let mut values = [0.0; 9];
    for (k, field) in fields.iter().enumerate().skip(1) {
        let is_sigma = k >= 7;
        if is_sigma && field.is_empty() {
            continue;
        }
        let expected = if is_sigma {
            "number from 0, or empty for a pose that counts as exact"
        } else {
            "finite number"
        };
        let most = match k {
            1..=3 => FARTHEST_MM,
            4..=6 => MOST_DEG,
            _ => f64::INFINITY,
        };
        values[k] = field
            .parse::<f64>()
            .ok()
            .filter(|value| value.is_finite() && (!is_sigma || *value >= 0.0))
            .ok_or_else(|| not_a(k, expected))?;
        if values[k].abs() > most {
            return Err(KnownPosesError::Beyond {
                file: file.to_owned(),
                line,
                column: COLUMNS[k],
                value: values[k],
                most,
            });
        }
    }
    let [_, x, y, z, rx, ry, rz, sigma_mm, sigma_deg] = values;
    let turn = Vector3::new(rx, ry, rz).map(f64::to_radians);
    Ok((
        number,
        KnownPose {
            rig_from_board: RigidTransform::new(so3::exp(&turn), Vector3::new(x, y, z)),
            sigma_mm,
            sigma_rad: sigma_deg.to_radians(),
        },
    ))
}
