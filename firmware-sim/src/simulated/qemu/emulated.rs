//! The cores that QEMU emulates, images for them, and runs of images that end by themselves.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use super::error::QemuError;
use super::memory::Memory;
use super::programs::{ENDS_WITH_PARENT, root, version_of};

/// How long an image that ends by itself may run. Checks take a second; one that crashes hangs.
const RUN_LIMIT: Duration = Duration::from_mins(3);

/// A core, and how images are made and run for it.
#[derive(Debug, Clone, Copy)]
pub struct Emulated<'a> {
    /// The target that images are compiled for.
    pub target: &'a str,
    /// What is given to the compiler besides.
    pub flags: &'a str,
    /// QEMU's program.
    pub emulator: &'a str,
    /// QEMU's machine.
    pub machine: &'a str,
    /// QEMU's name of the core.
    pub cpu: &'a str,
    /// Where what an image reads is loaded: `_stored_start` in the target's memory map.
    pub stored_at: u32,
}

/// The board of the device.
pub const DEVICE: Emulated<'_> = Emulated {
    target: "thumbv7em-none-eabihf",
    flags: "",
    emulator: "qemu-system-arm",
    machine: "mps2-an386",
    cpu: "cortex-m4",
    stored_at: 0x0004_0000,
};

/// A core without a floating-point unit, whose images run on a board like the device's.
pub const SOFT_FLOAT: Emulated<'_> = Emulated {
    target: "thumbv7m-none-eabi",
    machine: "mps2-an385",
    cpu: "cortex-m3",
    ..DEVICE
};

impl Emulated<'_> {
    /// Builds the images of these names with these features besides, separated by commas, if they are missing or
    /// stale, in one go.
    ///
    /// # Errors
    /// [`QemuError`]; what to install if there is no toolchain is said on standard error.
    pub fn build(&self, images: &[&str], features: &str) -> Result<(), QemuError> {
        self.build_with(images, &["--features", features], &[])
    }

    /// The same with further arguments and environment.
    pub(super) fn build_with(
        &self,
        images: &[&str],
        arguments: &[&str],
        environment: &[(&str, &str)],
    ) -> Result<(), QemuError> {
        let root = root();
        let script = root.join("scripts/embedded-cargo.sh");
        let sources = root.join(self.sources());
        if !script.is_file() {
            return Err(QemuError::NoSources { path: sources });
        }
        let mut command = Command::new(&script);
        command
            .args(["build", "--quiet", "--locked", "--release"])
            .args(["--target", self.target, "--manifest-path"])
            .arg(sources.join("Cargo.toml"))
            .args(arguments)
            .envs(environment.iter().copied())
            .args(images.iter().flat_map(|image| ["--bin", image]));
        if !self.flags.is_empty() {
            // In a folder of their own, so that neither build makes the other's stale.
            command
                .arg("--target-dir")
                .arg(self.target_folder())
                .env("EMBEDDED_RUSTFLAGS", self.flags);
        }
        let status = command
            .stdin(Stdio::null())
            .stdout(std::io::stderr())
            .status()
            .map_err(|source| QemuError::Io {
                what: script.display().to_string(),
                source,
            })?;
        if !status.success() {
            return Err(QemuError::Build {
                image: images.join("`, `"),
                status,
            });
        }
        Ok(())
    }

    /// The crate of its images.
    fn sources(&self) -> &'static str {
        if self.target.starts_with("riscv") {
            "firmware-sim/riscv"
        } else {
            "firmware-sim/cortex-m"
        }
    }

    fn target_folder(&self) -> PathBuf {
        let folder = root().join("target/embedded");
        match self.flags.rsplit_once('=') {
            Some((_, value)) => folder.join(value),
            None => folder,
        }
    }

    /// Where the image of this name is once it has been built; it may be stale.
    pub fn image_path(&self, image: &str) -> PathBuf {
        let folder = self.target_folder().join(self.target);
        folder.join("release").join(image)
    }

    /// Runs an image that ends by itself, such as a check, and returns what it printed over semihosting
    /// and how it ended. One that still runs after three minutes is killed.
    ///
    /// # Errors
    /// [`QemuError`].
    pub fn run_to_end(&self, image: &Path, flash_file: Option<&Path>) -> Result<Output, QemuError> {
        self.run_to_end_with(image, flash_file, &[])
    }

    /// The same in a time of its own, in which every instruction takes 2^`time_shift` nanoseconds and
    /// nothing else takes any: a timer then counts instructions.
    ///
    /// # Errors
    /// [`QemuError`].
    pub fn run_counting(
        &self,
        image: &Path,
        flash_file: &Path,
        time_shift: u32,
    ) -> Result<Output, QemuError> {
        let time = format!("shift={time_shift}");
        self.run_to_end_with(image, Some(flash_file), &["-icount", &time])
    }

    fn run_to_end_with(
        &self,
        image: &Path,
        flash_file: Option<&Path>,
        arguments: &[&str],
    ) -> Result<Output, QemuError> {
        version_of(self.emulator)?;
        let memory = flash_file.map_or(Memory::Zero, Memory::StartsWith);
        let mut child = self
            .command(image, &memory)?
            .args(["-monitor", "none", "-serial", "none"])
            .args(arguments)
            .args(["-semihosting-config", "enable=on,target=native"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .map_err(|source| QemuError::Io {
                what: "starting QEMU through sh".into(),
                source,
            })?;
        // Held open until QEMU has ended or its time is up: its end is what ends QEMU, and
        // `wait_with_output` would close it at once.
        let pipe = child.stdin.take();
        let (ended, end) = mpsc::channel::<()>();
        let watchdog = thread::spawn(move || {
            let _ = end.recv_timeout(RUN_LIMIT);
            drop(pipe);
        });
        let output = child.wait_with_output();
        drop(ended);
        let _ = watchdog.join();
        output.map_err(|source| QemuError::Io {
            what: "waiting for QEMU".into(),
            source,
        })
    }

    /// QEMU on its board with this image, set to end with its parent; the caller adds serial line and
    /// monitor.
    pub(super) fn command(&self, image: &Path, memory: &Memory<'_>) -> Result<Command, QemuError> {
        let mut command = Command::new("sh");
        command.args(["-c", ENDS_WITH_PARENT, "sh", self.emulator]);
        command.args(memory.arguments(self.machine, self.stored_at)?);
        if self.target.starts_with("riscv") {
            // The image is all that runs.
            command.args(["-bios", "none"]);
        }
        command.args(["-cpu", self.cpu, "-display", "none"]);
        command.arg("-kernel").arg(image);
        Ok(command)
    }
}
