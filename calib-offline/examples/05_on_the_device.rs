//! Triangulation by the device's own code: a blob in flash, two pixels, a point. Nothing here is from the
//! workstation's library; the same lines run on a Cortex-M.
//!
//! ```sh
//! cargo run --release -p calib-offline --example 05_on_the_device
//! ```

use ray_runtime::{Aligned, PixelPoint, RayBlob};
use std::error::Error;

/// As it would lie in flash: on a multiple of 8 bytes.
static BLOB: &Aligned<[u8]> = &Aligned(*include_bytes!("../../data/golden/stereo-v3-small.rays"));

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let rig = RayBlob::open(&BLOB.0).map_err(|error| format!("{error:?}"))?;
    let camera = |name| rig.camera_index(name).ok_or("no such camera");
    let left = (camera("left")?, PixelPoint::new(30.0, 20.5));
    let right = (camera("right")?, PixelPoint::new(33.0, 21.0));
    let found = rig
        .triangulate(left, right)
        .map_err(|error| format!("{error:?}"))?;
    println!("{:?} mm, gap {} mm", found.point_mm, found.gap_mm());
    Ok(())
}
