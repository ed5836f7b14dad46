//! Files are written whole or not at all: first beside their place, then renamed into it. The place "-" is standard output.

use calib_rays::remedy::Remedy;
use std::fs::{self, File};
use std::io::{self, BufWriter, Stdout, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Why a file was not written. Nothing is left behind.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The place is a folder.
    #[error("{}: is a folder, a file was to be written there", path.display())]
    IsFolder {
        /// The place.
        path: PathBuf,
    },
    /// The folder around the file does not exist, or is a file.
    #[error("{}: the folder {} does not exist", path.display(), folder.display())]
    NoFolder {
        /// The file that was to be written.
        path: PathBuf,
        /// The folder it was to be written in.
        folder: PathBuf,
    },
    /// A folder is needed where a file stands.
    #[error("{}: is a file, a folder is needed there", path.display())]
    NotFolder {
        /// The place.
        path: PathBuf,
    },
    /// Several files were to be written to standard output.
    #[error("- is standard output, and several files are to be written")]
    NoFolderOnStandardOutput,
    /// The system refused.
    #[error("{}: cannot be written", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

impl Remedy for WriteError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::IsFolder { .. } => "name a file inside the folder",
            Self::NoFolder { .. } => "make the folder first, or choose another place",
            Self::NotFolder { .. } => "choose another place; nothing was replaced",
            Self::NoFolderOnStandardOutput => "name a place; one called - is ./-",
            Self::Io { .. } => "check the permissions and the space left; nothing was written",
        };
        Some(text.to_owned())
    }
}

/// A file that comes into being on [`PendingFile::commit`]; dropped before that, it never was.
#[derive(Debug)]
pub struct PendingFile {
    path: PathBuf,
    target: Target,
}

#[derive(Debug)]
enum Target {
    /// Beside its place, to be renamed into it.
    Beside(BufWriter<NamedTempFile>),
    /// A device or a pipe has no "beside" and must not be replaced by a file.
    Direct(BufWriter<File>),
    /// Whose reader may go away before the end.
    Standard(BufWriter<Stdout>),
}

/// Whether a place is standard output.
pub fn is_standard_output(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// A reader of standard output that has read enough is no error.
fn unless_reader_left<T>(outcome: io::Result<T>, done: T) -> io::Result<T> {
    match outcome {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(done),
        outcome => outcome,
    }
}

impl PendingFile {
    /// Opens a new file that will become `path`.
    ///
    /// # Errors
    /// [`WriteError`]; a place that cannot work is refused here, before any content is made.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let io_error = |source| WriteError::Io {
            path: path.to_owned(),
            source,
        };
        if is_standard_output(path) {
            return Ok(Self {
                path: path.to_owned(),
                target: Target::Standard(BufWriter::with_capacity(1 << 16, io::stdout())),
            });
        }
        check_place(path)?;
        let target = match fs::metadata(path) {
            Ok(found) if !found.is_file() => {
                let file = File::options().write(true).open(path).map_err(io_error)?;
                Target::Direct(BufWriter::with_capacity(1 << 16, file))
            }
            _ => {
                // A link stays a link: what it points to is replaced.
                let resolved = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
                let mut builder = tempfile::Builder::new();
                builder.prefix(".calib-offline-");
                #[cfg(unix)]
                {
                    use std::os::unix::fs::PermissionsExt;
                    builder.permissions(fs::Permissions::from_mode(0o666));
                }
                let file = builder
                    .tempfile_in(folder_of(&resolved))
                    .map_err(io_error)?;
                return Ok(Self {
                    path: resolved,
                    target: Target::Beside(BufWriter::with_capacity(1 << 16, file)),
                });
            }
        };
        Ok(Self {
            path: path.to_owned(),
            target,
        })
    }

    /// Puts the file in its place, replacing what stood there.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn commit(self) -> Result<(), WriteError> {
        let path = self.path;
        let io_error = |source| WriteError::Io {
            path: path.clone(),
            source,
        };
        match self.target {
            Target::Direct(mut writer) => writer.flush().map_err(io_error),
            Target::Standard(mut writer) => {
                unless_reader_left(writer.flush(), ()).map_err(io_error)
            }
            Target::Beside(writer) => {
                let file = writer
                    .into_inner()
                    .map_err(|failed| io_error(failed.into_error()))?;
                file.as_file().sync_data().map_err(io_error)?;
                file.persist(&path)
                    .map(|_| ())
                    .map_err(|failed| io_error(failed.error))
            }
        }
    }
}

impl Write for PendingFile {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        match &mut self.target {
            Target::Beside(writer) => writer.write(buffer),
            Target::Direct(writer) => writer.write(buffer),
            Target::Standard(writer) => unless_reader_left(writer.write(buffer), buffer.len()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.target {
            Target::Beside(writer) => writer.flush(),
            Target::Direct(writer) => writer.flush(),
            Target::Standard(writer) => unless_reader_left(writer.flush(), ()),
        }
    }
}

/// Writes one file whole or not at all.
///
/// # Errors
/// [`WriteError`]; what stood there before is untouched.
pub fn write(path: &Path, content: &[u8]) -> Result<(), WriteError> {
    write_set(&[(path.to_owned(), content)])
}

/// Writes several files together: all contents are on the disk before the first takes its place.
///
/// # Errors
/// [`WriteError`]; unless a rename itself fails, nothing has changed.
pub fn write_set(files: &[(PathBuf, &[u8])]) -> Result<(), WriteError> {
    let mut pending = Vec::with_capacity(files.len());
    for (path, content) in files {
        let mut file = PendingFile::create(path)?;
        file.write_all(content)
            .and_then(|()| file.flush())
            .map_err(|source| WriteError::Io {
                path: path.clone(),
                source,
            })?;
        pending.push(file);
    }
    pending.into_iter().try_for_each(PendingFile::commit)
}

/// Whether a file could be written at `path`, as far as can be seen without writing.
///
/// # Errors
/// [`WriteError::IsFolder`], [`WriteError::NoFolder`], [`WriteError::NotFolder`].
pub fn check_place(path: &Path) -> Result<(), WriteError> {
    if is_standard_output(path) {
        return Ok(());
    }
    if path.is_dir() {
        return Err(WriteError::IsFolder {
            path: path.to_owned(),
        });
    }
    let folder = folder_of(path);
    if folder.is_dir() {
        return Ok(());
    }
    Err(if folder.exists() {
        WriteError::NotFolder {
            path: folder.to_owned(),
        }
    } else {
        WriteError::NoFolder {
            path: path.to_owned(),
            folder: folder.to_owned(),
        }
    })
}

/// Whether `path` is a folder or could be made one.
///
/// # Errors
/// [`WriteError::NotFolder`] if it, or anything it would lie in, is a file; [`WriteError::NoFolderOnStandardOutput`].
pub fn check_folder(path: &Path) -> Result<(), WriteError> {
    if is_standard_output(path) {
        return Err(WriteError::NoFolderOnStandardOutput);
    }
    let standing = path
        .ancestors()
        .map(|p| {
            if p.as_os_str().is_empty() {
                Path::new(".")
            } else {
                p
            }
        })
        .find(|p| p.exists());
    match standing {
        Some(p) if !p.is_dir() => Err(WriteError::NotFolder { path: p.to_owned() }),
        _ => Ok(()),
    }
}

/// Whether files can be made in `folder`, or in what stands of the folders around it: a long
/// calculation should not end at a closed door. Nothing is left there.
///
/// # Errors
/// [`WriteError::NotFolder`], [`WriteError::Io`].
pub fn check_writable(folder: &Path) -> Result<(), WriteError> {
    check_folder(folder)?;
    let standing = folder.ancestors().find(|p| p.is_dir());
    let standing = standing.unwrap_or_else(|| Path::new("."));
    tempfile::Builder::new()
        .prefix(".calib-offline-")
        .tempfile_in(standing)
        .map(|_| ())
        .map_err(|source| WriteError::Io {
            path: folder.to_owned(),
            source,
        })
}

/// Makes a folder and all it lies in, unless it exists.
///
/// # Errors
/// [`WriteError::NotFolder`], [`WriteError::Io`].
pub fn make_folder(path: &Path) -> Result<(), WriteError> {
    check_folder(path)?;
    fs::create_dir_all(path).map_err(|source| WriteError::Io {
        path: path.to_owned(),
        source,
    })
}

/// The folder that holds `path`; the current one for a bare name.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_dropped_before_its_commit_never_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        fs::write(&path, "before").unwrap();
        let mut file = PendingFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(fs::read_to_string(&path).unwrap(), "before");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_set_with_one_impossible_place_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let good = folder.path().join("a.json");
        let bad = folder.path().join("b.json");
        fs::create_dir(&bad).unwrap();
        let result = write_set(&[(good.clone(), b"1"), (bad, b"2")]);
        assert!(matches!(result, Err(WriteError::IsFolder { .. })));
        assert!(!good.exists());
    }

    #[test]
    fn folder_below_a_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("notes");
        fs::write(&file, "x").unwrap();
        for place in [file.clone(), file.join("deeper/still")] {
            let error = check_folder(&place).unwrap_err();
            assert!(matches!(error, WriteError::NotFolder { path } if path == file));
        }
        assert!(check_folder(&folder.path().join("new/folder")).is_ok());
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_to_and_not_replaced() {
        write(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let real = folder.path().join("real");
        let link = folder.path().join("link");
        fs::write(&real, "old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write(&link, b"new").unwrap();
        assert_eq!(fs::read_to_string(&real).unwrap(), "new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }
}
