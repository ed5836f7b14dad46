//! The same application as a Cortex-M4F image in QEMU, its UART on a TCP port.

mod emulated;
mod error;
mod memory;
mod programs;

pub use emulated::{DEVICE, Emulated, SOFT_FLOAT};
pub use error::QemuError;
pub use programs::version_of;

use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus, Stdio};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use crate::client::DeviceClient;
use crate::simulated::flash_file::{self, FlashFile};

use ray_device::storage::trust::Keys;

use memory::{Backing, Memory};
use programs::root;

/// From the start of QEMU to the first answer of the device. It takes about a quarter of a second;
/// the rest is for machines under load.
const START_LIMIT: Duration = Duration::from_secs(30);

/// Free ports tried before giving up: between the choice of one and QEMU's use of it, somebody else
/// may take it.
const PORT_TRIES: usize = 5;

/// A device in QEMU. It ends when this is dropped, and when this process ends in any way.
#[derive(Debug)]
pub struct QemuDevice {
    child: Child,
    address: SocketAddr,
    /// Held until QEMU has ended.
    _flash: Arc<Backing>,
}

impl QemuDevice {
    /// Starts `image` with its UART on `listen` (port 0 takes a free one) and its flash in
    /// `flash_file`, as [`FlashFile::open`] takes it; without one, the flash is blank and in memory.
    /// Returns once the device has answered.
    ///
    /// # Errors
    /// [`QemuError`].
    pub fn start(
        listen: SocketAddr,
        image: &Path,
        flash_file: Option<&Path>,
    ) -> Result<Self, QemuError> {
        let flash = match flash_file {
            Some(path) => FlashFile::open(path, None)?,
            None => FlashFile::in_memory(flash_file::blank(None)?),
        };
        Self::start_with(listen, image, flash)
    }

    /// The same with a flash that has been opened.
    ///
    /// # Errors
    /// [`QemuError`].
    pub fn start_with(
        listen: SocketAddr,
        image: &Path,
        flash: FlashFile,
    ) -> Result<Self, QemuError> {
        require_qemu()?;
        let backing = Backing::of(flash).map_err(|source| QemuError::Io {
            what: "a temporary file for the flash".into(),
            source,
        })?;
        let backing = Arc::new(backing);
        let tries = if listen.port() == 0 { PORT_TRIES } else { 1 };
        let mut tried = 1;
        loop {
            match Self::start_on(free_address(listen)?, image, &backing) {
                Err(QemuError::Ended { .. }) if tried < tries => tried += 1,
                outcome => return outcome,
            }
        }
    }

    /// Where its UART can be reached.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Waits until QEMU ends.
    ///
    /// # Errors
    /// [`QemuError::Io`] if it cannot be waited for.
    pub fn wait(mut self) -> Result<ExitStatus, QemuError> {
        // `Child::wait` would close the pipe, which would end QEMU at once.
        let pipe = self.child.stdin.take();
        let status = self.child.wait().map_err(|source| QemuError::Io {
            what: "waiting for QEMU".into(),
            source,
        });
        drop(pipe);
        status
    }

    fn start_on(
        address: SocketAddr,
        image: &Path,
        backing: &Arc<Backing>,
    ) -> Result<Self, QemuError> {
        let mut command = DEVICE.command(image, &Memory::File(backing.path()))?;
        command.args(["-monitor", "none"]);
        command.args([
            "-serial",
            &format!("tcp:{address},server=on,wait=off,nodelay=on"),
        ]);
        let not_started = |source| QemuError::Io {
            what: "starting QEMU through sh".into(),
            source,
        };
        let child = command
            .stdin(Stdio::piped())
            .stdout(backing.lock().map_err(not_started)?)
            .spawn()
            .map_err(not_started)?;
        let mut device = Self {
            child,
            address,
            _flash: Arc::clone(backing),
        };
        device.wait_until_it_answers()?;
        Ok(device)
    }

    fn wait_until_it_answers(&mut self) -> Result<(), QemuError> {
        let deadline = Instant::now() + START_LIMIT;
        loop {
            let remaining = deadline
                .saturating_duration_since(Instant::now())
                .max(Duration::from_millis(1));
            match DeviceClient::connect_within(&format!("tcp:{}", self.address), remaining) {
                Ok(_) => return Ok(()),
                Err(error) if Instant::now() >= deadline => return Err(QemuError::Silent(error)),
                Err(_) => {}
            }
            if let Ok(Some(status)) = self.child.try_wait() {
                return Err(QemuError::Ended { status });
            }
            thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for QemuDevice {
    fn drop(&mut self) {
        // The pipe first: its end is what ends QEMU. Then the shell, so that no zombie stays.
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}

/// Builds the image of this name for the device's board if it is missing or stale, and returns where it is.
///
/// # Errors
/// [`QemuError`]; what to install if there is no toolchain is said on standard error.
pub fn build_image(image: &str) -> Result<PathBuf, QemuError> {
    DEVICE.build(&[image], "")?;
    Ok(DEVICE.image_path(image))
}

/// Builds the image of this name with these features alone, separated by commas, and returns where it is until
/// another one is built so.
///
/// # Errors
/// As [`build_image`].
pub fn build_image_with(image: &str, features: &str) -> Result<PathBuf, QemuError> {
    let folder = root().join("target/embedded/only");
    let folder_argument = folder.display().to_string();
    DEVICE.build_with(
        &[image],
        &[
            "--no-default-features",
            "--features",
            features,
            "--target-dir",
            &folder_argument,
        ],
        &[],
    )?;
    Ok(folder.join(DEVICE.target).join("release").join(image))
}

/// Builds the image of this name for the owner of these keys, who alone may change its device.
///
/// # Errors
/// As [`build_image`].
pub fn build_signed_image(image: &str, keys: Keys) -> Result<PathBuf, QemuError> {
    let [key_0, key_1] = keys.all().map(|key| match key {
        Some(key) => key.to_string(),
        None => String::new(),
    });
    let keys = [
        ("RAYS_PUBLIC_KEY", key_0.as_str()),
        ("RAYS_PUBLIC_KEY_1", key_1.as_str()),
    ];
    DEVICE.build_with(&[image], &["--features", "signed"], &keys)?;
    Ok(DEVICE.image_path(image))
}

/// Makes sure that QEMU is installed.
///
/// # Errors
/// As [`version_of`].
pub fn require_qemu() -> Result<(), QemuError> {
    version_of(DEVICE.emulator).map(|_| ())
}

/// `listen` with a free port in place of 0, after a look whether it can be had at all.
fn free_address(listen: SocketAddr) -> Result<SocketAddr, QemuError> {
    let listener = TcpListener::bind(listen).map_err(|source| QemuError::Listen {
        address: listen,
        source,
    })?;
    listener.local_addr().map_err(|source| QemuError::Listen {
        address: listen,
        source,
    })
}
