//! The images that `cost` counts: those of this checkout, in QEMU.

use std::path::{Path, PathBuf};
use std::process::Output;

use firmware_cost::{Images, ImagesError};
use firmware_sim::simulated::qemu;

pub struct InQemu;

impl Images for InQemu {
    fn qemu_version(&self) -> Result<String, ImagesError> {
        Ok(qemu::version()?)
    }

    fn build(&self, names: &[&str]) -> Result<(), ImagesError> {
        Ok(qemu::build_images(names)?)
    }

    fn path(&self, name: &str) -> PathBuf {
        qemu::image_path(name)
    }

    fn build_newest_only(&self, name: &str) -> Result<PathBuf, ImagesError> {
        Ok(qemu::build_newest_only_image(name)?)
    }

    fn run_counting(
        &self,
        image: &Path,
        flash: &Path,
        time_shift: u32,
    ) -> Result<Output, ImagesError> {
        Ok(qemu::run_counting(image, flash, time_shift)?)
    }
}
