//! A `firmware-sim` process with a device in it.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use firmware_sim::client::DeviceClient;
use tempfile::NamedTempFile;

/// It is killed when this is dropped.
pub struct Running {
    /// The process.
    pub process: Child,
    /// Where the device listens.
    pub address: String,
    blob: Option<NamedTempFile>,
}

impl Running {
    /// A device that starts with a blob, and keeps nothing.
    pub fn with_blob(kind: &str, blob: &[u8]) -> Self {
        let mut file = NamedTempFile::new().unwrap();
        file.write_all(blob).unwrap();
        let mut running = Self::keeping(kind, file.path(), &[]);
        running.blob = Some(file);
        running
    }

    /// A device with this file.
    pub fn keeping(kind: &str, file: &Path, arguments: &[&str]) -> Self {
        let file = file.to_str().unwrap();
        Self::start(kind, &[&["--flash-file", file], arguments].concat())
    }

    /// A device with these arguments.
    pub fn start(kind: &str, arguments: &[&str]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_firmware-sim"))
            .args([kind, "--listen", "127.0.0.1:0"])
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let Some(address) = line.strip_prefix("listening on ") else {
            panic!(
                "firmware-sim {kind} did not start: its message stands above; {:?}",
                process.wait()
            );
        };
        Self {
            address: address.trim_end().to_owned(),
            process,
            blob: None,
        }
    }

    /// A connection to it.
    pub fn client(&self) -> DeviceClient {
        DeviceClient::connect(&format!("tcp:{}", self.address)).unwrap()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
