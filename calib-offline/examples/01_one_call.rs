//! One call: a folder with `dataset.toml` and images or corners becomes a calibration and a blob.
//!
//! ```sh
//! cargo run --release -p calib-offline --example 01_one_call [-- FOLDER]
//! ```

use calib_blob::pack::{PackSettings, pack};
use calib_offline::pipeline::{CalibrateSettings, calibrate};
use calib_rays::progress::Silent;
use calib_recording::dataset::Dataset;
use std::error::Error;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).map(PathBuf::from);
    run(folder.as_deref().unwrap_or(Path::new(SHIPPED)))
}

/// Thirteen real pairs.
pub(crate) const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/opencv-stereo");

pub(crate) fn run(folder: &Path) -> Result<(), Box<dyn Error>> {
    let dataset = Dataset::load(folder)?;

    // Five folds by pose judge it: each board is measured by a calibration that never saw it.
    let calibration = calibrate(&dataset, &CalibrateSettings::default(), &Silent)?.calibration;
    println!("{:?}", calibration.verdict);
    for camera in &calibration.rig.cameras {
        let share = camera.coverage.covered_share();
        println!("{}: {:.0} % of the sensor", camera.name, 100.0 * share);
    }

    // What a device opens: no pixel's ray is further off than a thousandth of a pixel.
    let packed = pack(&calibration.rig, &PackSettings::default())?;
    println!(
        "{} bytes, {:.1e} px at worst",
        packed.bytes.len(),
        packed.worst_error_px
    );
    Ok(())
}
