//! `dataset.toml`: reading it strictly. A key that means nothing is an error, and so is a value
//! that cannot be meant; each names the line.

mod board;
mod board_problem;
mod board_text;
mod declared;
mod error;
mod images;
mod limits;
mod printed_board;
mod raw;
mod source;
mod target;
mod target_problem;

pub use board_problem::BoardProblem;
pub use board_text::read_board;
pub use error::ManifestError;
pub use limits::{
    MAX_CAMERAS, MAX_CORNERS_PER_SIDE, MAX_NAME_CHARS, MAX_SENSOR_PX, MAX_SQUARE_MM,
    MIN_CORNERS_PER_SIDE, MIN_SQUARE_MM,
};
pub use target_problem::TargetProblem;

use super::description::{BoardKind, CameraSpec, Dataset, StageSpec};
use super::{corners, known_poses};
use calib_rays::geometry::SensorSize;
use raw::{RawCamera, RawManifest, RawStage};
use source::{Source, ranged, read};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use toml::Spanned;

impl Dataset {
    /// Reads the manifest of a dataset: a folder with `dataset.toml`, or that file.
    ///
    /// Images are looked up but not opened. Where `corners.csv` stands beside the manifest it is
    /// what counts, and images that a manifest names may be missing.
    ///
    /// # Errors
    /// [`ManifestError`], with the line.
    pub fn load(path: &Path) -> Result<Self, ManifestError> {
        let source = read(path)?;
        let raw: RawManifest =
            toml::from_str(&source.text).map_err(|error| ManifestError::Syntax {
                file: source.file.clone(),
                line: source.line(error.span().map_or(0, |span| span.start)),
                message: error.message().replace('\n', " "),
            })?;
        let folder = match source.file.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        let board::Declared {
            kind,
            board,
            certificate,
        } = board::declared(&source, raw.board)?;
        let has_corners = folder.join(Self::CORNERS).exists();
        let cameras = cameras(&source, &folder, &raw.camera, has_corners)?;
        let mut dataset = Self {
            folder,
            kind,
            board,
            cameras,
            stage: None,
            known_poses: BTreeMap::new(),
            known_poses_file: None,
            excluded_poses: BTreeSet::new(),
            target: None,
            certificate,
            recording: raw
                .recording
                .map(|raw| declared::recording(&source, raw))
                .transpose()?,
        };
        dataset.target = target::target(&source, &dataset, raw.target, &raw.camera)?;
        if let Some(known) = raw.poses.and_then(|poses| poses.known) {
            let file = dataset.folder.join(known);
            dataset.known_poses =
                known_poses::read(&file).map_err(|source| ManifestError::KnownPoses { source })?;
            dataset.known_poses_file = Some(file);
        }
        if dataset.kind == BoardKind::Points && !has_corners {
            return Err(ManifestError::NoPlaces { file: source.file });
        }
        if dataset.kind == BoardKind::Points {
            let places = corners::read_places(&dataset)
                .map_err(|source| ManifestError::Places { source })?;
            let expansion_ppm = dataset.certificate.and_then(|c| c.expansion_ppm());
            dataset.board = match expansion_ppm {
                Some(ppm) => places.scaled(1.0 + 1e-6 * ppm),
                None => places,
            };
        }
        let pose_count = (!has_corners).then(|| dataset.image_pose_count());
        if let Some(raw) = raw.stage {
            dataset.stage = Some(stage(&source, raw, pose_count)?);
        }
        for pose in raw.dataset.map(|d| d.exclude).unwrap_or_default() {
            match pose_count {
                Some(count) if *pose.get_ref() >= count => {
                    return Err(ManifestError::ExcludedUnknown {
                        line: source.line_of(&pose),
                        pose: *pose.get_ref(),
                        last: count.saturating_sub(1),
                        file: source.file,
                    });
                }
                _ => dataset.excluded_poses.insert(pose.into_inner()),
            };
        }
        Ok(dataset)
    }
}

fn cameras(
    source: &Source,
    folder: &Path,
    raw: &[Spanned<RawCamera>],
    has_corners: bool,
) -> Result<Vec<CameraSpec>, ManifestError> {
    let file = &source.file;
    if raw.is_empty() {
        return Err(ManifestError::Missing {
            file: file.clone(),
            line: 1,
            key: "[[camera]]",
        });
    }
    if let Some(table) = raw.get(MAX_CAMERAS) {
        return Err(ManifestError::TooManyCameras {
            file: file.clone(),
            line: source.line_of(table),
            have: raw.len(),
        });
    }
    let mut cameras: Vec<(usize, CameraSpec)> = Vec::with_capacity(raw.len());
    for table in raw {
        let table_line = source.line_of(table);
        let camera = table.get_ref();
        let name = camera_name(source, table_line, camera)?;
        let line = camera
            .name
            .as_ref()
            .map_or(table_line, |n| source.line_of(n));
        if let Some((first_line, _)) = cameras.iter().find(|(_, c)| c.name == name) {
            return Err(ManifestError::DuplicateCamera {
                file: file.clone(),
                line,
                name,
                first_line: *first_line,
            });
        }
        let side = |value: &Option<Spanned<i64>>, key| {
            ranged(source, table_line, value.clone(), key, 1, MAX_SENSOR_PX)
        };
        let width = side(&camera.width, "[[camera]] width")?;
        let height = side(&camera.height, "[[camera]] height")?;
        let images = images::images(source, folder, camera, &name, has_corners)?;
        if images.is_empty() && !has_corners {
            return Err(ManifestError::NothingToRead {
                file: file.clone(),
                line,
                camera: name,
            });
        }
        cameras.push((
            line,
            CameraSpec {
                name,
                sensor: SensorSize::new(width as u32, height as u32),
                images,
                optics: camera.optics,
                serial: camera.serial.clone(),
            },
        ));
    }
    check_images_fit_together(file, &cameras)?;
    Ok(cameras.into_iter().map(|(_, camera)| camera).collect())
}

fn camera_name(
    source: &Source,
    table_line: usize,
    camera: &RawCamera,
) -> Result<String, ManifestError> {
    let name = camera.name.as_ref().ok_or_else(|| ManifestError::Missing {
        file: source.file.clone(),
        line: table_line,
        key: "[[camera]] name",
    })?;
    let usable = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.');
    let text = name.get_ref();
    let length = text.chars().count();
    if length == 0 || length > MAX_NAME_CHARS || !text.chars().all(usable) {
        return Err(ManifestError::CameraName {
            file: source.file.clone(),
            line: source.line_of(name),
            name: text.chars().take(MAX_NAME_CHARS).collect(),
        });
    }
    Ok(text.clone())
}

/// Same number of images for every camera that has any, and no image for two views.
fn check_images_fit_together(
    file: &Path,
    cameras: &[(usize, CameraSpec)],
) -> Result<(), ManifestError> {
    let mut with_images = cameras.iter().filter(|(_, c)| !c.images.is_empty());
    if let Some((_, first)) = with_images.next()
        && let Some((line, other)) = with_images.find(|(_, c)| c.images.len() != first.images.len())
    {
        return Err(ManifestError::UnequalImages {
            file: file.to_owned(),
            line: *line,
            first_camera: first.name.clone(),
            first_count: first.images.len(),
            camera: other.name.clone(),
            count: other.images.len(),
        });
    }
    let mut seen = std::collections::HashMap::new();
    for (line, camera) in cameras {
        for (pose, image) in camera.images.iter().enumerate() {
            let Some(image) = image else { continue };
            if let Some((first_camera, first_pose)) = seen.insert(image, (&camera.name, pose)) {
                return Err(ManifestError::ImageUsedTwice {
                    file: file.to_owned(),
                    line: *line,
                    image: image.clone(),
                    first_camera: first_camera.clone(),
                    first_pose,
                    camera: camera.name.clone(),
                    pose,
                });
            }
        }
    }
    Ok(())
}

/// `pose_count` is known where the images are the poses.
fn stage(
    source: &Source,
    raw: RawStage,
    pose_count: Option<usize>,
) -> Result<StageSpec, ManifestError> {
    let check_length = |key, line, have| match pose_count {
        Some(need) if need != have => Err(ManifestError::StageLength {
            file: source.file.clone(),
            line,
            key,
            have,
            need,
        }),
        _ => Ok(()),
    };
    if let Some(angles) = &raw.angles_deg {
        let line = source.line_of(angles);
        check_length("angles_deg", line, angles.get_ref().len())?;
        let broken = angles.get_ref().iter().position(|a| !a.is_finite());
        if let Some(index) = broken {
            return Err(ManifestError::StageAngle {
                file: source.file.clone(),
                line,
                index,
                value: angles.get_ref()[index],
            });
        }
    }
    if let Some(placement) = &raw.placement {
        let line = source.line_of(placement);
        check_length("placement", line, placement.get_ref().len())?;
    }
    Ok(StageSpec {
        angles_deg: raw.angles_deg.map(Spanned::into_inner),
        placement: raw.placement.map(Spanned::into_inner),
    })
}

#[cfg(test)]
mod tests;
