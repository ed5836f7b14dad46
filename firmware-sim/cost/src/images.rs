//! What counting needs of whoever builds images and runs them.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::cores::Core;

/// Why there is no image, or why it did not run.
pub type ImagesError = Box<dyn Error + Send + Sync>;

/// Builds the images of `cortex-m` and `riscv` and runs them in QEMU.
pub trait Images {
    /// What QEMU for this core says of its version.
    ///
    /// # Errors
    /// If it is not installed.
    fn qemu_version(&self, core: &Core) -> Result<String, ImagesError>;

    /// Builds the images of these names with these features besides, separated by commas, for a core if they are
    /// missing or stale.
    ///
    /// # Errors
    /// If that fails, or there is nothing to build them with.
    fn build(&self, core: &Core, names: &[&str], features: &str) -> Result<(), ImagesError>;

    /// Where the image of this name is once it has been built.
    fn path(&self, core: &Core, name: &str) -> PathBuf;

    /// Builds the image of this name with these features of the runtime alone, and returns where it is until
    /// another one is built so.
    ///
    /// # Errors
    /// As [`Images::build`].
    fn build_with(&self, name: &str, features: &str) -> Result<PathBuf, ImagesError>;

    /// Runs an image to its end on a flash that starts with this file; every instruction takes
    /// 2^`time_shift` ns of its time, and nothing else takes any.
    ///
    /// # Errors
    /// If it cannot be run.
    fn run_counting(
        &self,
        core: &Core,
        image: &Path,
        flash: &Path,
        time_shift: u32,
    ) -> Result<Output, ImagesError>;
}
