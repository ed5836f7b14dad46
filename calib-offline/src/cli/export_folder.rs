//! Those forms of `export` that are for other tools: a folder of files, and beside it what they lose.

use super::calibrate::{blob_max_error_px, pack_settings};
use super::error::Error;
use super::export_form::FolderForm;
use super::export_loss::{LossFile, LossObject};
use super::export_options::FolderArgs;
use super::place::check_results_folder;
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use calib_blob::rays::RaySource;
use calib_exchange::{
    ExchangeError, LossMap, NamedFile, Pinholes, ViewMap, Within, dense, kalibr, mrcal,
    nearest_pinholes, nearest_splined, opencv, rectify, remap, ros, undistort,
};
use calib_recording::atomic_file::{check_place, make_folder, write_set};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What was written.
#[derive(Debug, Serialize)]
pub(super) struct Written {
    pub files: Vec<PathBuf>,
    #[serde(skip)]
    pub bytes: usize,
    pub loss: Option<LossObject>,
    /// What else must be known, in words.
    #[serde(skip)]
    pub notes: Vec<String>,
}

/// What a form consists of.
#[derive(Default)]
struct Contents {
    files: Vec<NamedFile>,
    loss: Option<LossObject>,
    maps: Vec<LossMap>,
    notes: Vec<String>,
}

impl Contents {
    fn of_lenses(files: Vec<NamedFile>, lenses: Pinholes) -> Self {
        Self {
            files,
            loss: Some(LossObject::of_lenses(&lenses)),
            maps: lenses
                .cameras
                .into_iter()
                .map(|camera| camera.map)
                .collect(),
            ..Self::default()
        }
    }

    fn of_views(files: Vec<NamedFile>, maps: &[ViewMap], distance_mm: f64) -> Self {
        Self {
            files,
            loss: Some(LossObject::of_views(maps, distance_mm)),
            ..Self::default()
        }
    }
}

/// Writes the folder of a form.
///
/// # Errors
/// [`Error`], with nothing written.
pub(super) fn write(
    rig: &Path,
    form: FolderForm,
    options: &FolderArgs,
    folder: &Path,
    force: bool,
) -> Result<Written, Error> {
    let Contents {
        files,
        loss,
        maps,
        notes,
    } = match RigFile::read(rig)? {
        RigFile::Blob(bytes) => {
            let blob = open(&bytes, rig)?;
            contents(form, options, &blob, blob.working_distance_mm().into())?
        }
        RigFile::Calibration(calibration) => {
            let packed = pack_settings(&calibration, blob_max_error_px(&calibration));
            contents(form, options, &calibration.rig, packed.working_distance_mm)?
        }
    };
    if let (Some(images), Ok(place)) = (&options.images, folder.canonicalize())
        && images.canonicalize().is_ok_and(|images| images == place)
    {
        return Err(Error::Usage(UsageError::OutputIsInput {
            path: folder.to_owned(),
        }));
    }
    let with_maps = loss.as_ref().map(|loss| LossFile { loss, maps: &maps });
    let (files, bytes) = put(folder, files, with_maps.as_ref(), force)?;
    Ok(Written {
        files,
        bytes,
        loss,
        notes,
    })
}

/// Writes files into a folder, and what they lose beside it; the files and how long they are.
///
/// # Errors
/// [`Error`], with nothing written.
pub(super) fn put(
    folder: &Path,
    files: Vec<NamedFile>,
    loss: Option<&impl Serialize>,
    force: bool,
) -> Result<(Vec<PathBuf>, usize), Error> {
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    check_results_folder(folder, &names, force)?;
    let mut files: Vec<(PathBuf, Vec<u8>)> = files
        .into_iter()
        .map(|(name, content)| (folder.join(name), content))
        .collect();
    if let Some(loss) = loss {
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
    let bytes = files.iter().map(|(_, content)| content.len()).sum();
    Ok((files.into_iter().map(|(path, _)| path).collect(), bytes))
}

/// The files of a form, and what they lose.
fn contents(
    form: FolderForm,
    options: &FolderArgs,
    source: &dyn RaySource,
    working_distance_mm: f64,
) -> Result<Contents, Error> {
    check_names(source)?;
    let region = options
        .region
        .map(|region| Within::new(source, region))
        .transpose()?;
    let source = region
        .as_ref()
        .map_or(source, |within| within as &dyn RaySource);
    let distance_mm = options.distance_mm.unwrap_or(working_distance_mm);
    let lenses = || -> Result<Pinholes, Error> {
        Ok(nearest_pinholes(
            source,
            distance_mm,
            &options.lenses(form)?,
        )?)
    };
    Ok(match form {
        FolderForm::OpenCv => {
            let lenses = lenses()?;
            Contents::of_lenses(opencv::files(&lenses)?, lenses)
        }
        FolderForm::Kalibr => {
            let lenses = lenses()?;
            Contents::of_lenses(kalibr::files(&lenses), lenses)
        }
        FolderForm::Ros => {
            let lenses = lenses()?;
            Contents::of_lenses(ros::files(&lenses), lenses)
        }
        FolderForm::Mrcal => {
            let lenses = lenses()?;
            Contents::of_lenses(mrcal::files(source, &lenses), lenses)
        }
        FolderForm::MrcalSplined => {
            let splined = nearest_splined(source, distance_mm)?;
            Contents {
                files: mrcal::splined_files(source, &splined),
                loss: Some(LossObject::of_splined(&splined)),
                maps: splined
                    .cameras
                    .into_iter()
                    .map(|camera| camera.map)
                    .collect(),
                ..Contents::default()
            }
        }
        FolderForm::Remap => {
            let maps = remap::maps(source, distance_mm)?;
            Contents::of_views(remap::files(&maps)?, &maps, distance_mm)
        }
        FolderForm::Rectify => {
            let pair = rectify::rectified(source, distance_mm)?;
            Contents::of_views(pair.files()?, &pair.maps, distance_mm)
        }
        FolderForm::Undistort => undistorted(options, source, distance_mm)?,
        FolderForm::Npy => Contents {
            files: dense::files(source)?,
            ..Contents::default()
        },
    })
}

fn undistorted(
    options: &FolderArgs,
    source: &dyn RaySource,
    distance_mm: f64,
) -> Result<Contents, Error> {
    let folder = options.images.as_ref().ok_or(UsageError::NoImages)?;
    let maps = remap::maps(source, distance_mm)?;
    let images = undistort::images(folder, &maps)?;
    let notes = match &images.passed_over[..] {
        [] => Vec::new(),
        files => vec![format!(
            "passed over, as no PNG of a camera: {}",
            files.join(", ")
        )],
    };
    Ok(Contents {
        notes,
        ..Contents::of_views(images.files, &maps, distance_mm)
    })
}

/// Names make files: those of a dataset do, those of a file from anywhere may not.
pub(super) fn check_names(source: &dyn RaySource) -> Result<(), ExchangeError> {
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
