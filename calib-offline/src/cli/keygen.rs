//! `keygen`: a key for the owner of devices.

use super::Outcome;
use super::error::Error;
use super::output::Console;
use super::usage_error::UsageError;
use calib_recording::atomic_file::{WriteError, check_place, is_standard_output};
use clap::Args;
use firmware_sim::owner::{OwnerKey, public_pem};
use serde::Serialize;
use std::io::Write as _;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline keygen -o key.pem
  firmware-sim host --public-key key.pub.pem --flash-file device.flash
  calib-offline sign rig.rays --key key.pem --version 1";

const FORMATS: &str = "\
Writes the private key (Ed25519, PKCS#8, PEM; readable by you alone) and beside it the public one
(SubjectPublicKeyInfo, PEM), and prints the public key's 64 hexadecimal digits. Other programs read and
write the same files: openssl genpkey -algorithm ed25519. An existing file is never replaced.

Whoever has the private key can change every device that was built for it; without it, nobody can. Keep
a copy where the first cannot be lost with it.

With --json, schema calib-offline/keygen/1:
  key, public_key_file
  public_key    64 hexadecimal digits";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct KeygenArgs {
    /// Where the private key goes; the public one goes beside it, as NAME.pub.pem
    #[arg(short, long, value_name = "KEY.pem")]
    pub output: PathBuf,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct KeygenObject<'a> {
    schema: &'static str,
    key: &'a Path,
    public_key_file: &'a Path,
    public_key: String,
}

/// Runs the command.
///
/// # Errors
/// [`Error`]; then no file was written.
pub fn run(args: &KeygenArgs, console: &Console) -> Result<Outcome, Error> {
    if is_standard_output(&args.output) {
        return Err(WriteError::NoFolderOnStandardOutput.into());
    }
    let public_file = args.output.with_extension("pub.pem");
    for path in [&args.output, &public_file] {
        check_place(path)?;
        if path.symlink_metadata().is_ok() {
            return Err(Error::Usage(UsageError::KeyExists { path: path.clone() }));
        }
    }
    let key = OwnerKey::generate().map_err(UsageError::NoRandomness)?;
    write_new(&public_file, &public_pem(&key.public()), true)?;
    if let Err(error) = write_new(&args.output, &key.to_pem(), false) {
        // Ours, from just now.
        let _ = std::fs::remove_file(&public_file);
        return Err(error);
    }
    let object = KeygenObject {
        schema: "calib-offline/keygen/1",
        key: &args.output,
        public_key_file: &public_file,
        public_key: key.public().to_string(),
    };
    let words = format!(
        "{}\nprivate key: {}, for you alone; public key: {}, for devices",
        object.public_key,
        object.key.display(),
        object.public_key_file.display()
    );
    console.result(&words, &object);
    Ok(Outcome::Done)
}

/// Writes a file whole or not at all, and never in place of another. It is for its owner alone, or for all to
/// read.
fn write_new(path: &Path, text: &str, is_public: bool) -> Result<(), Error> {
    let failed = |source| WriteError::Io {
        path: path.to_owned(),
        source,
    };
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    // Such a file is readable by its owner alone from the start.
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    #[cfg(unix)]
    if is_public {
        use std::os::unix::fs::PermissionsExt as _;
        let for_all = std::fs::Permissions::from_mode(0o644);
        file.as_file().set_permissions(for_all).map_err(failed)?;
    }
    file.write_all(text.as_bytes()).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    file.persist_noclobber(path).map_err(|error| {
        if error.error.kind() == std::io::ErrorKind::AlreadyExists {
            return Error::Usage(UsageError::KeyExists {
                path: path.to_owned(),
            });
        }
        failed(error.error).into()
    })?;
    Ok(())
}
