//! One `[board]` by itself: read as it would be in a manifest, and written.

use super::board;
use super::error::ManifestError;
use super::raw::RawManifest;
use super::source::Source;
use crate::dataset::description::BoardKind;
use calib_rays::board::BoardSpec;
use std::path::Path;

/// What a text with one `[board]` describes, checked as in a manifest; `file` is what errors name.
///
/// # Errors
/// [`ManifestError`], with the line.
pub fn read_board(text: &str, file: &Path) -> Result<(BoardKind, BoardSpec), ManifestError> {
    let source = Source {
        file: file.to_owned(),
        text: text.to_owned(),
    };
    let raw: RawManifest = toml::from_str(text).map_err(|error| ManifestError::Syntax {
        file: file.to_owned(),
        line: source.line(error.span().map_or(0, |span| span.start)),
        message: error.message().replace('\n', " "),
    })?;
    let declared = board::declared(&source, raw.board)?;
    Ok((declared.kind, declared.board))
}
