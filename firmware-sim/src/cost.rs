//! The images that `cost` counts: those of this checkout, in QEMU.

use std::path::{Path, PathBuf};
use std::process::Output;

use firmware_cost::{Core, Images, ImagesError};
use firmware_sim::simulated::qemu::{self, Emulated};

pub struct InQemu;

fn emulated(core: &Core) -> Emulated<'_> {
    Emulated {
        target: core.target,
        flags: core.flags,
        emulator: core.emulator,
        machine: core.machine,
        cpu: core.cpu,
        stored_at: core.stored_at,
    }
}

impl Images for InQemu {
    fn qemu_version(&self, core: &Core) -> Result<String, ImagesError> {
        Ok(qemu::version_of(core.emulator)?)
    }

    fn build(&self, core: &Core, names: &[&str], features: &str) -> Result<(), ImagesError> {
        Ok(emulated(core).build(names, features)?)
    }

    fn path(&self, core: &Core, name: &str) -> PathBuf {
        emulated(core).image_path(name)
    }

    fn build_with(&self, name: &str, features: &str) -> Result<PathBuf, ImagesError> {
        Ok(qemu::build_image_with(name, features)?)
    }

    fn run_counting(
        &self,
        core: &Core,
        image: &Path,
        flash: &Path,
        time_shift: u32,
    ) -> Result<Output, ImagesError> {
        Ok(emulated(core).run_counting(image, flash, time_shift)?)
    }
}
