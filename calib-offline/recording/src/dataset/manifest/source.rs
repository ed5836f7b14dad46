//! The manifest's text, and where in it something stands.

use super::error::ManifestError;
use crate::dataset::description::Dataset;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// The manifest's text, to name lines of it.
pub(super) struct Source {
    pub file: PathBuf,
    pub text: String,
}

impl Source {
    pub fn line(&self, byte: usize) -> usize {
        self.text.as_bytes()[..byte.min(self.text.len())]
            .split(|b| *b == b'\n')
            .count()
    }

    pub fn line_of<T>(&self, value: &Spanned<T>) -> usize {
        self.line(value.span().start)
    }
}

/// The manifest of a dataset: a folder with `dataset.toml`, or that file.
pub(super) fn read(path: &Path) -> Result<Source, ManifestError> {
    let file = if path.is_dir() {
        path.join(Dataset::MANIFEST)
    } else {
        path.to_owned()
    };
    let named_so = file.file_name().is_some_and(|n| n == Dataset::MANIFEST);
    if !named_so || !file.is_file() {
        return Err(ManifestError::NotFound {
            path: path.to_owned(),
        });
    }
    let bytes = std::fs::read(&file).map_err(|source| ManifestError::Read {
        file: file.clone(),
        source,
    })?;
    match String::from_utf8(bytes) {
        // The mark that some editors put before UTF-8 is no part of the text.
        Ok(text) => Ok(Source {
            text: match text.strip_prefix('\u{feff}') {
                Some(rest) => rest.to_owned(),
                None => text,
            },
            file,
        }),
        Err(error) => Err(ManifestError::NotText {
            file,
            byte: error.utf8_error().valid_up_to(),
        }),
    }
}

/// A whole number that must be there and lie from `least` to `most`.
pub(super) fn ranged(
    source: &Source,
    table_line: usize,
    value: Option<Spanned<i64>>,
    key: &'static str,
    least: i64,
    most: i64,
) -> Result<i64, ManifestError> {
    let value = value.ok_or_else(|| ManifestError::Missing {
        file: source.file.clone(),
        line: table_line,
        key,
    })?;
    if (least..=most).contains(value.get_ref()) {
        return Ok(value.into_inner());
    }
    Err(ManifestError::OutOfRange {
        file: source.file.clone(),
        line: source.line_of(&value),
        key,
        value: value.into_inner(),
        least,
        most,
    })
}
