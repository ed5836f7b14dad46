//! Which format a file has is found from what it holds; each is a file of this crate.

use crate::foreign::Content;
use crate::read::{Document, ImportError, Problem, ReadOptions, tree};
use crate::{colmap, dice, kalibr, matlab, mrcal, opencv, ros};
use std::path::Path;

/// Reads a file; `file` is for messages, and its stem names a camera that has no name.
pub(crate) fn content(
    file: &Path,
    bytes: &[u8],
    options: &ReadOptions,
) -> Result<Content, ImportError> {
    let fail = |problem: Problem| problem.in_file(file);
    let text = std::str::from_utf8(bytes).map_err(|_| fail(Problem::UnknownFormat))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if colmap::is_cameras(text) {
        let cameras = colmap::cameras(text).map_err(fail)?;
        return Ok(Content::Cameras(cameras));
    }
    let node = tree(text).map_err(fail)?;
    let document = Document::new(&node);
    let stem = file
        .file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let has = |key: &str| document.get(key).is_some();
    let cameras = if has("lensmodel") || has("distortion_model") && has("imagersize") {
        mrcal::read(&document, &stem, options)
    } else if has("cam0") {
        kalibr::read(&document, options)
    } else if dice::is_system(&document) {
        dice::read(&document, options)
    } else if matlab::is_parameters(&document) {
        matlab::read(&document, &stem, options)
    } else if has("distortion_model") && has("camera_matrix") {
        ros::read(&document, options)
    } else {
        return opencv::read(&document, &stem, options).map_err(fail);
    };
    Ok(Content::Cameras(cameras.map_err(fail)?))
}
