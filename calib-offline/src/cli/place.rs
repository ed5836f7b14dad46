//! Where results may be written, settled before any work begins.
//!
//! A file of the user's is never replaced without `--force`. Points and blobs are cheap to make
//! again from their inputs, so an earlier file of the same kind may be replaced by a new one; a
//! calibration is not cheap, so its folder must not hold one.

use super::error::Error;
use super::usage_error::UsageError;
use calib_recording::atomic_file::{check_place, check_writable, is_standard_output};
use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Refuses a place for one file: no folder around it, a folder in its place, one of the command's
/// own inputs, or an existing file that does not begin with `own_start`, unless forced.
///
/// # Errors
/// [`Error::Write`], [`Error::Usage`].
pub fn check_file(
    path: &Path,
    own_start: &[u8],
    inputs: &[&Path],
    force: bool,
) -> Result<(), Error> {
    check_place(path)?;
    if is_standard_output(path) {
        return Ok(());
    }
    if let Ok(place) = path.canonicalize()
        && inputs
            .iter()
            .any(|input| input.canonicalize().is_ok_and(|input| input == place))
    {
        return Err(Error::Usage(UsageError::OutputIsInput {
            path: path.to_owned(),
        }));
    }
    if force || !path.is_file() || begins_with(path, own_start) {
        return Ok(());
    }
    Err(Error::Usage(UsageError::Exists {
        path: path.to_owned(),
    }))
}

/// A place in words.
pub fn place_in_words(path: &Path) -> Cow<'_, str> {
    if is_standard_output(path) {
        "standard output".into()
    } else {
        path.to_string_lossy()
    }
}

/// Refuses a folder for several files: a file in its place, no permission to write there, or any
/// of the files in it, unless forced.
///
/// # Errors
/// [`Error::Write`], [`Error::Usage`].
pub fn check_results_folder(folder: &Path, files: &[&str], force: bool) -> Result<(), Error> {
    check_writable(folder)?;
    for name in files {
        let path = folder.join(name);
        if !force && path.exists() && !path.is_dir() {
            return Err(Error::Usage(UsageError::Exists { path }));
        }
        if folder.is_dir() {
            check_place(&path)?;
        }
    }
    Ok(())
}

/// Whether the file is empty or begins so.
fn begins_with(path: &Path, start: &[u8]) -> bool {
    let mut found = Vec::with_capacity(start.len());
    let read =
        File::open(path).and_then(|file| file.take(start.len() as u64).read_to_end(&mut found));
    read.is_ok() && (found.is_empty() || found == start)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn only_files_of_the_same_kind_are_replaced_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points.csv");
        let check = |force| check_file(&path, b"id,x", &[], force);
        assert!(check(false).is_ok());
        for (content, may) in [
            ("", true),
            ("id,x,y\n1", true),
            ("id,u", false),
            ("id", false),
        ] {
            fs::write(&path, content).unwrap();
            assert_eq!(check(false).is_ok(), may, "{content:?}");
            assert!(check(true).is_ok());
        }
    }

    #[test]
    fn an_input_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.csv");
        fs::write(&path, "").unwrap();
        let same = folder.path().join(".").join("m.csv");
        let error = check_file(&path, b"id", &[&same], true).unwrap_err();
        assert!(matches!(
            error,
            Error::Usage(UsageError::OutputIsInput { .. })
        ));
    }

    #[test]
    fn a_folder_with_results_needs_force() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("out");
        assert!(check_results_folder(&place, &["a.json"], false).is_ok());
        fs::create_dir(&place).unwrap();
        fs::write(place.join("other"), "").unwrap();
        assert!(check_results_folder(&place, &["a.json"], false).is_ok());
        fs::write(place.join("a.json"), "").unwrap();
        let error = check_results_folder(&place, &["a.json"], false).unwrap_err();
        assert!(matches!(error, Error::Usage(UsageError::Exists { .. })));
        assert!(check_results_folder(&place, &["a.json"], true).is_ok());
        fs::create_dir(place.join("b.json")).unwrap();
        assert!(check_results_folder(&place, &["b.json"], true).is_err());
        let file = place.join("a.json");
        assert!(check_results_folder(&file, &["a.json"], true).is_err());
    }
}
