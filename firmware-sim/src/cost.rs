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

    fn build_with(&self, name: &str, features: &str) -> Result<PathBuf, ImagesError> {
        Ok(qemu::build_image_with(name, features)?)
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
