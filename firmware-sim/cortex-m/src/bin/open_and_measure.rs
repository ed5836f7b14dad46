//! Opens the blob at the start of the flash, runs its self-tests, which compare bits, and
//! triangulates a few matches of cameras 0 and 1, printed to a tenth of a millimeter with their
//! standard deviations.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use firmware_cortex_m::machine;
use ray_runtime::{PixelPoint, RayBlob};

/// (u, v) in camera 0 and in camera 1, px.
const MATCHES: [[f32; 4]; 6] = [
    [23.75, 19.75, 25.0, 20.0],
    [51.75, 11.0, 49.0, 8.5],
    [18.5, 37.0, 20.25, 35.5],
    // Seen too far to the right by the right camera: the rays meet behind them.
    [10.0, 24.0, 60.0, 24.0],
    // Outside the sensor, and no number.
    [-1.0, 24.0, 20.0, 24.0],
    [f32::NAN, 24.0, 20.0, 24.0],
];

#[entry]
fn main() -> ! {
    let flash = machine::flash();
    let opened = RayBlob::stated_len(flash)
        .and_then(|length| RayBlob::open(flash.get(..length as usize).unwrap_or(flash)));
    let blob = match opened {
        Ok(blob) => blob,
        Err(error) => {
            hprintln!("no blob: {}", error);
            machine::end(false)
        }
    };
    hprintln!(
        "{} bytes, frame {}, {} cameras",
        blob.len(),
        blob.frame(),
        blob.camera_count()
    );
    for camera in (0..blob.camera_count()).filter_map(|index| blob.camera(index)) {
        hprintln!(
            "{}: {} x {} px",
            camera.name,
            camera.sensor_width,
            camera.sensor_height
        );
    }
    match blob.run_self_tests() {
        Ok(count) => hprintln!("{} self-tests give the bits they should", count),
        Err(failure) => {
            hprintln!("self-test {} gives other bits", failure.test);
            machine::end(false)
        }
    }
    for [u0, v0, u1, v1] in MATCHES {
        let (a, b) = (PixelPoint::new(u0, v0), PixelPoint::new(u1, v1));
        match blob.triangulate_with_covariance((0, a), (1, b)) {
            Ok(measured) => {
                let found = measured.found;
                let [x, y, z] = found.point_mm;
                hprintln!(
                    "point {:.1} {:.1} {:.1} mm, gap {:.1} mm",
                    x,
                    y,
                    z,
                    found.gap_mm()
                );
                if let Some(covariance) = measured.covariance {
                    let [x, y, z] = covariance.sigma_mm();
                    hprintln!("sigma {:.2} {:.2} {:.2} mm", x, y, z);
                }
            }
            Err(error) => hprintln!("{}", error),
        }
    }
    machine::end(true)
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    hprintln!("{}", info);
    machine::end(false)
}
