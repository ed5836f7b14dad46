//! `calibration.json` on the disk. What is read was written by anybody: it is checked before use,
//! so that no later code meets a table of the wrong length.

use super::Calibration;
use super::record::{SCHEMA, SCHEMA_1};
use calib_judge::held_out::Dealt;
use calib_rays::field::polynomial::{MAX_DEGREE, term_count};
use calib_rays::field::{CalibratedCamera, PairUncertainty, SmoothMap};
use calib_rays::remedy::Remedy;
use ray_runtime::MatchNoise;
use ray_runtime::format::IDENTITY_LEN;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Why a file is not a calibration that this version reads.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The system refused to read it.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not JSON, or not this kind.
    #[error("{}:{line}: column {column}: {message}", file.display())]
    Json {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// From 1.
        column: usize,
        /// What the JSON reader says of it.
        message: String,
    },
    /// Another format or version.
    #[error("{}: has the schema \"{found}\", this version reads \"{SCHEMA}\" and \"{SCHEMA_1}\"", file.display())]
    Schema {
        /// The file.
        file: PathBuf,
        /// The file's.
        found: String,
    },
    /// It contradicts itself.
    #[error("{}: {what} {}", file.display(), subject.as_ref().map_or(String::new(), |s| format!("(\"{s}\")")))]
    Inconsistent {
        /// The file.
        file: PathBuf,
        /// What does not fit.
        what: &'static str,
        /// Which camera it concerns.
        subject: Option<String>,
    },
}

/// The one field that every version has.
#[derive(serde::Deserialize)]
struct OnlySchema {
    schema: String,
}

impl Remedy for CalibrationError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Read { .. } => "check the path and the permissions",
            Self::Json { .. } | Self::Inconsistent { .. } => {
                "the file was damaged or edited; calibrate again"
            }
            Self::Schema { .. } => "use the version that wrote it, or calibrate again",
        };
        Some(text.to_owned())
    }
}

impl Calibration {
    /// What its held-out check was dealt from, in words.
    pub fn dealt_word(&self) -> &'static str {
        let poses: BTreeSet<usize> = self.poses.iter().map(|pose| pose.pose).collect();
        let may_be_one_pose = !self.board.layout.is_grid() || !self.known_poses.is_empty();
        Dealt::of_count(poses.len(), may_be_one_pose).map_or("pose", Dealt::word)
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn load(file: &Path) -> Result<Self, CalibrationError> {
        let bytes = std::fs::read(file).map_err(|source| CalibrationError::Read {
            file: file.to_owned(),
            source,
        })?;
        Self::from_json(file, &bytes)
    }

    /// Reads and checks the content of a file; `file` is for messages only.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn from_json(file: &Path, bytes: &[u8]) -> Result<Self, CalibrationError> {
        let json_error = |error: serde_json::Error| CalibrationError::Json {
            file: file.to_owned(),
            line: error.line(),
            column: error.column(),
            message: error.to_string(),
        };
        // The schema first: of another version only this field is known to exist.
        let OnlySchema { schema } = serde_json::from_slice(bytes).map_err(json_error)?;
        if ![SCHEMA, SCHEMA_1].contains(&schema.as_str()) {
            return Err(CalibrationError::Schema {
                file: file.to_owned(),
                found: schema.chars().take(60).collect(),
            });
        }
        let mut calibration: Self = serde_json::from_slice(bytes).map_err(json_error)?;
        // Whatever it was read from, this is what it would be written as.
        SCHEMA.clone_into(&mut calibration.schema);
        match calibration.contradiction() {
            None => Ok(calibration),
            Some((what, subject)) => Err(CalibrationError::Inconsistent {
                file: file.to_owned(),
                what,
                subject,
            }),
        }
    }

    /// The content of a file; every number reads back to the same bits.
    ///
    /// # Errors
    /// What the JSON writer says; it has no reason to.
    pub fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut bytes = serde_json::to_vec(self)?;
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// What the blob of this calibration carries as its identity: the first bytes of the SHA-256
    /// of the file's content.
    pub fn identity(&self) -> [u8; IDENTITY_LEN] {
        let mut identity = [0; IDENTITY_LEN];
        let hash = Sha256::digest(self.to_json().unwrap_or_default());
        identity.copy_from_slice(&hash[..IDENTITY_LEN]);
        identity
    }

    fn contradiction(&self) -> Option<(&'static str, Option<String>)> {
        let cameras = &self.rig.cameras;
        if cameras.is_empty() {
            return Some(("there is no camera", None));
        }
        for (k, camera) in cameras.iter().enumerate() {
            let problem = if cameras[..k].iter().any(|c| c.name == camera.name) {
                Some("two cameras have one name")
            } else {
                camera_contradiction(camera)
            };
            if let Some(what) = problem {
                return Some((what, Some(camera.name.clone())));
            }
        }
        let checks = [
            (
                self.corners.iter().all(|c| c.camera_idx < cameras.len()),
                "a corner belongs to no camera",
            ),
            (
                self.poses.iter().all(|p| p.rms_px.len() == cameras.len()),
                "a pose has not one RMS per camera",
            ),
            (
                self.rig
                    .uncertainty
                    .iter()
                    .all(|pair| pair_is_whole(pair, cameras)),
                "the uncertainty of a pair of cameras has the wrong length or is not finite",
            ),
            (
                self.rig
                    .match_noise_px
                    .is_none_or(|px| MatchNoise::from_px(px as f32).is_some()),
                "the noise of matches is not 0 to 1000 px",
            ),
            (
                self.imported.is_some()
                    || self.board.rows > 0 && self.board.cols > 0 && self.board.square_mm > 0.0,
                "the board has no size",
            ),
        ];
        checks
            .iter()
            .find(|(holds, _)| !holds)
            .map(|(_, what)| (*what, None))
    }
}

fn camera_contradiction(camera: &CalibratedCamera) -> Option<&'static str> {
    let (field, coverage) = (&camera.field, &camera.coverage);
    let sensor = field.sensor;
    if sensor.width == 0 || sensor.height == 0 || coverage.sensor != sensor {
        return Some("the sensor size of a camera is zero or not that of its mask");
    }
    let cells = coverage.cells_u.checked_mul(coverage.cells_v);
    if cells == Some(0) || cells != Some(coverage.covered.len()) {
        return Some("the mask of a camera has the wrong length");
    }
    if field.base.focal_px <= 0.0 || field.base.reach <= 0.0 {
        return Some("the focal length of a camera, or the reach of its lens, is not above zero");
    }
    let maps = std::iter::once(&field.direction).chain(&field.offset);
    if maps.into_iter().any(|map| !map_is_whole(map)) {
        return Some("the ray field of a camera has a table of the wrong length");
    }
    None
}

fn pair_is_whole(pair: &PairUncertainty, cameras: &[CalibratedCamera]) -> bool {
    let nodes = pair.nodes_u.checked_mul(pair.nodes_v);
    pair.first < pair.second
        && pair.second < cameras.len()
        && pair.sensor == cameras[pair.first].field.sensor
        && pair.nodes_u.min(pair.nodes_v) >= 2
        && nodes == Some(pair.calibration_px2.len())
        && pair.calibration_px2.iter().flatten().all(|x| x.is_finite())
        && pair.noise_px2 >= 0.0
        && pair.noise_px2.is_finite()
}

fn map_is_whole(map: &SmoothMap) -> bool {
    let polynomial = &map.polynomial;
    let spline_is_whole = map.spline.as_ref().is_none_or(|spline| {
        let grid = &spline.grid;
        let knots = grid
            .cells_u
            .checked_add(3)
            .zip(grid.cells_v.checked_add(3))
            .and_then(|(u, v)| u.checked_mul(v));
        grid.cells_u > 0
            && grid.cells_v > 0
            && grid.sensor.width > 0
            && grid.sensor.height > 0
            && knots == Some(spline.coefficients.len())
    });
    polynomial.degree <= MAX_DEGREE
        && polynomial.coefficients.len() == term_count(polynomial.degree)
        && spline_is_whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::example;
    use serde_json::Value;

    fn changed(change: impl Fn(&mut Value)) -> Result<Calibration, CalibrationError> {
        let json = example::calibration().to_json().unwrap();
        let mut value: Value = serde_json::from_slice(&json).unwrap();
        change(&mut value);
        Calibration::from_json(Path::new("c.json"), value.to_string().as_bytes())
    }

    #[test]
    fn what_is_written_reads_back_to_the_same_bits() {
        let calibration = example::calibration();
        let json = calibration.to_json().unwrap();
        let back = Calibration::from_json(Path::new("c.json"), &json).unwrap();
        assert_eq!(back, calibration);
        assert_eq!(back.to_json().unwrap(), json);
    }

    #[test]
    fn another_version_is_told_from_a_damaged_file() {
        let error = changed(|v| v["schema"] = "calib-offline/calibration/3".into()).unwrap_err();
        assert!(matches!(error, CalibrationError::Schema { .. }));
        let error = Calibration::from_json(Path::new("c.json"), b"{\n  x").unwrap_err();
        assert!(error.to_string().starts_with("c.json:2: "), "{error}");
        let json = example::calibration().to_json().unwrap();
        for len in [0, 1, json.len() / 2, json.len() - 3] {
            assert!(Calibration::from_json(Path::new("c.json"), &json[..len]).is_err());
        }
    }

    #[test]
    fn tables_of_the_wrong_length_are_refused() {
        let camera = |v: &mut Value| v["rig"]["cameras"][1].take();
        let put = |v: &mut Value, c: Value| v["rig"]["cameras"][1] = c;
        let changes: [fn(&mut Value); 7] = [
            |c| c["field"]["direction"]["polynomial"]["degree"] = 16.into(),
            |c| c["field"]["direction"]["polynomial"]["degree"] = 2.into(),
            |c| c["field"]["sensor"]["width"] = 0.into(),
            |c| c["field"]["base"]["focal_px"] = 0.0.into(),
            |c| c["coverage"]["cells_u"] = 1.into(),
            |c| c["coverage"]["covered"] = Value::Array(Vec::new()),
            |c| c["name"] = "left".into(),
        ];
        for change in &changes {
            let error = changed(|v| {
                let mut c = camera(v);
                change(&mut c);
                put(v, c);
            })
            .unwrap_err();
            assert!(
                matches!(error, CalibrationError::Inconsistent { .. }),
                "{error}"
            );
        }
        let error = changed(|v| v["corners"][0]["camera_idx"] = 2.into()).unwrap_err();
        assert!(error.to_string().contains("belongs to no camera"));
    }

    #[test]
    fn the_noise_of_matches_is_in_range_or_absent() {
        let with = |px: f64| changed(|v| v["rig"]["match_noise_px"] = px.into());
        let noise_px = |px: f64| with(px).unwrap().rig.match_noise_px;
        assert_eq!([0.0, 0.2].map(noise_px), [Some(0.0), Some(0.2)]);
        assert_eq!(example::calibration().rig.match_noise_px, None);
        for px in [-0.1, 1e-9, 2000.0] {
            let error = with(px).unwrap_err().to_string();
            assert!(error.contains("noise of matches"), "{error}");
        }
    }
}
