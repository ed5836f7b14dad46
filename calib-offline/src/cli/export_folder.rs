//! Those forms of `export` that are for other tools: a folder of files, and beside it what they lose.

use super::calibrate::{blob_max_error_px, pack_settings};
use super::error::Error;
use super::place::check_results_folder;
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use crate::present::numbers::short;
use calib_blob::rays::RaySource;
use calib_exchange::{
    Distortion, ExchangeError, Loss, NamedFile, Pinholes, dense, kalibr, nearest_pinholes, opencv,
    ros,
};
use calib_recording::atomic_file::{check_place, make_folder, write_set};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A form for other tools.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FolderForm {
    OpenCv,
    Kalibr,
    Ros,
    Npy,
}

/// What was written.
#[derive(Debug, Serialize)]
pub(super) struct Written {
    pub files: Vec<PathBuf>,
    #[serde(skip)]
    pub bytes: usize,
    pub loss: Option<LossObject>,
}

/// What pinholes lose: the file `PATH.loss.json`.
#[derive(Debug, Serialize)]
pub(super) struct LossObject {
    #[serde(flatten)]
    all: Loss,
    distance_mm: f64,
    cameras: Vec<CameraLoss>,
}

#[derive(Debug, Serialize)]
struct CameraLoss {
    name: String,
    coefficients: usize,
    #[serde(flatten)]
    loss: Loss,
}

impl LossObject {
    fn new(pinholes: &Pinholes) -> Self {
        let cameras = pinholes.cameras.iter();
        Self {
            all: pinholes.loss(),
            distance_mm: pinholes.distance_mm,
            cameras: cameras
                .map(|camera| CameraLoss {
                    name: camera.name.clone(),
                    coefficients: camera.lens.distortion.count(),
                    loss: camera.loss,
                })
                .collect(),
        }
    }

    /// A sentence.
    pub fn in_words(&self) -> String {
        let cameras = self.cameras.iter().map(|camera| {
            let loss = &camera.loss;
            format!(
                "{}: {} px RMS, {} px at most ({} mm, {} mm)",
                camera.name,
                short(loss.rms_px),
                short(loss.max_px),
                short(loss.rms_mm),
                short(loss.max_mm)
            )
        });
        format!(
            "lost by the pinholes at {} mm: {}",
            short(self.distance_mm),
            cameras.collect::<Vec<_>>().join("; ")
        )
    }
}

/// Writes the folder of a form.
///
/// # Errors
/// [`Error`], with nothing written.
pub(super) fn write(
    rig: &Path,
    form: FolderForm,
    folder: &Path,
    force: bool,
) -> Result<Written, Error> {
    let (files, loss) = match RigFile::read(rig)? {
        RigFile::Blob(bytes) => {
            let blob = open(&bytes, rig)?;
            contents(form, &blob, blob.working_distance_mm().into())?
        }
        RigFile::Calibration(calibration) => {
            let packed = pack_settings(&calibration, blob_max_error_px(&calibration));
            contents(form, &calibration.rig, packed.working_distance_mm)?
        }
    };
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    check_results_folder(folder, &names, force)?;
    let mut files: Vec<(PathBuf, Vec<u8>)> = files
        .into_iter()
        .map(|(name, content)| (folder.join(name), content))
        .collect();
    if let Some(loss) = &loss {
        let path = loss_path(folder);
        if !force && path.exists() {
            return Err(Error::Usage(UsageError::Exists { path }));
        }
        if path.exists() {
            check_place(&path)?;
        }
        let mut text = serde_json::to_vec_pretty(loss)?;
        text.push(b'\n');
        files.push((path, text));
    }
    let existed = folder.exists();
    make_folder(folder)?;
    let set: Vec<(PathBuf, &[u8])> = files
        .iter()
        .map(|(path, content)| (path.clone(), content.as_slice()))
        .collect();
    if let Err(error) = write_set(&set) {
        if !existed {
            // Only if it is empty: then it is the one just made.
            let _ = std::fs::remove_dir(folder);
        }
        return Err(error.into());
    }
    Ok(Written {
        bytes: files.iter().map(|(_, content)| content.len()).sum(),
        files: files.into_iter().map(|(path, _)| path).collect(),
        loss,
    })
}

/// The files of a form, and what they lose.
fn contents(
    form: FolderForm,
    source: &dyn RaySource,
    distance_mm: f64,
) -> Result<(Vec<NamedFile>, Option<LossObject>), Error> {
    check_names(source)?;
    let pinholes = |forms: &[Distortion]| nearest_pinholes(source, distance_mm, forms);
    let (files, pinholes) = match form {
        FolderForm::OpenCv => {
            let pinholes = pinholes(&[Distortion::Five, Distortion::Eight])?;
            (opencv::files(&pinholes)?, pinholes)
        }
        FolderForm::Kalibr => {
            let pinholes = pinholes(&[Distortion::Four])?;
            (kalibr::files(&pinholes), pinholes)
        }
        FolderForm::Ros => {
            let pinholes = pinholes(&[Distortion::Five, Distortion::Eight])?;
            (ros::files(&pinholes), pinholes)
        }
        FolderForm::Npy => return Ok((dense::files(source)?, None)),
    };
    Ok((files, Some(LossObject::new(&pinholes))))
}

/// Names make files: those of a dataset do, those of a file from anywhere may not.
fn check_names(source: &dyn RaySource) -> Result<(), ExchangeError> {
    let is_usable = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.');
    let mut cameras = source.cameras().into_iter();
    match cameras.find(|camera| !camera.name.chars().all(is_usable)) {
        Some(camera) => Err(ExchangeError::Name {
            camera: camera.name,
        }),
        None => Ok(()),
    }
}

/// `PATH.loss.json` beside the folder PATH.
fn loss_path(folder: &Path) -> PathBuf {
    // Of `.` and `..` the name is known once they are looked up.
    let known = match folder.file_name() {
        Some(_) => folder.to_owned(),
        None => folder.canonicalize().unwrap_or_else(|_| folder.to_owned()),
    };
    let mut name = known.file_name().unwrap_or_default().to_owned();
    name.push(".loss.json");
    known.with_file_name(name)
}
