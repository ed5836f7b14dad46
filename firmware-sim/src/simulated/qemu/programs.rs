//! The programs that build and run images: where their sources are, which version they are of, how they end.

use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};

use super::error::QemuError;

/// Runs its arguments and ends them when standard input closes. The parent holds the other end, so
/// they end with it however it ends, a kill included.
pub const ENDS_WITH_PARENT: &str = r#"
exec 3<&0
"$@" </dev/null 3<&- &
child=$!
{ read -r _ <&3; kill -KILL $child; } 2>/dev/null &
watchdog=$!
{ wait $child; } 2>/dev/null
status=$?
kill -KILL $watchdog 2>/dev/null
exit $status
"#;

/// The workspace's folder.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap_or(Path::new("."))
}

/// What one of QEMU's programs says of its version.
///
/// # Errors
/// [`QemuError::NotInstalled`], with the remedy in its text.
pub fn version_of(emulator: &str) -> Result<String, QemuError> {
    let output = Command::new(emulator)
        .arg("--version")
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output();
    match output {
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stdout);
            Ok(text.lines().next().unwrap_or_default().trim().to_owned())
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Err(QemuError::NotInstalled {
            program: emulator.to_owned(),
        }),
        Err(source) => Err(QemuError::Io {
            what: format!("{emulator} --version"),
            source,
        }),
    }
}
