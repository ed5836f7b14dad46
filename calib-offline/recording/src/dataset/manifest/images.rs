//! Which image files a camera of the manifest means.

use super::error::ManifestError;
use super::raw::RawCamera;
use super::source::Source;
use crate::dataset::image_files::{matching_files, split_pattern};
use std::path::{Path, PathBuf};
use toml::Spanned;

/// The images of the board, one entry per pose. `has_corners`: files may be missing, as there are
/// corners to read instead.
pub(super) fn images(
    source: &Source,
    folder: &Path,
    camera: &RawCamera,
    name: &str,
    has_corners: bool,
) -> Result<Vec<Option<PathBuf>>, ManifestError> {
    match (&camera.images, &camera.image_list) {
        (None, None) => Ok(Vec::new()),
        (Some(_), Some(list)) => Err(ManifestError::ImagesTwice {
            file: source.file.clone(),
            line: source.line_of(list),
            camera: name.to_owned(),
        }),
        (Some(pattern), None) => {
            let files = pattern_files(source, folder, "images", pattern, has_corners)?;
            Ok(files.into_iter().map(Some).collect())
        }
        (None, Some(list)) => listed_files(source, folder, list, name, has_corners),
    }
}

/// The files that a pattern means, in natural order; at least one unless they may be missing.
pub(super) fn pattern_files(
    source: &Source,
    folder: &Path,
    key: &'static str,
    pattern: &Spanned<String>,
    may_be_missing: bool,
) -> Result<Vec<PathBuf>, ManifestError> {
    let file = source.file.clone();
    let line = source.line_of(pattern);
    let pattern = pattern.get_ref().clone();
    let (pattern_folder, _) = split_pattern(&pattern);
    if pattern_folder.contains(['*', '?']) {
        return Err(ManifestError::PatternInFolder {
            file,
            line,
            key,
            pattern,
        });
    }
    let searched = folder.join(pattern_folder);
    let files = match matching_files(folder, &pattern) {
        Ok(files) => files,
        Err(_) if may_be_missing => Vec::new(),
        Err(source) => {
            return Err(ManifestError::ImageFolder {
                file,
                line,
                key,
                pattern,
                folder: searched,
                source,
            });
        }
    };
    if files.is_empty() && !may_be_missing {
        return Err(ManifestError::NoMatch {
            file,
            line,
            key,
            pattern,
            folder: searched,
        });
    }
    Ok(files)
}

fn listed_files(
    source: &Source,
    folder: &Path,
    list: &Spanned<Vec<String>>,
    name: &str,
    has_corners: bool,
) -> Result<Vec<Option<PathBuf>>, ManifestError> {
    let file = source.file.clone();
    let line = source.line_of(list);
    let camera = name.to_owned();
    if list.get_ref().iter().all(String::is_empty) {
        return Err(ManifestError::EmptyImageList { file, line, camera });
    }
    let mut images = Vec::with_capacity(list.get_ref().len());
    for (pose, image) in list.get_ref().iter().enumerate() {
        let path = folder.join(image);
        if !image.is_empty() && !has_corners && !path.is_file() {
            return Err(ManifestError::ListedImageMissing {
                file,
                line,
                camera,
                pose,
                image: image.clone(),
            });
        }
        images.push((!image.is_empty()).then_some(path));
    }
    Ok(images)
}
