//! What goes over TCP to the simulated device: points measured a second, and the time of an update.
//!
//! `cargo bench -p firmware-sim --bench link`

use std::time::Instant;

use firmware_sim::client::{DeviceClient, FlashOptions};
use firmware_sim::simulated::host::SimulatedDevice;
use ray_device::protocol::{Match, Sighting};
use split_mix::SplitMix;

const MATCHES: usize = 500_000;
const ROUNDS: usize = 3;
const UPDATES: usize = 100;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let golden = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/golden");
    let blobs = ["stereo-v3-small", "stereo-v3-fast"]
        .map(|name| std::fs::read(format!("{golden}/{name}.rays")));
    let [small, fast] = blobs;
    let blobs = [small?, fast?];
    let device = SimulatedDevice::start("127.0.0.1:0".parse()?, &[])?;
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address()))?;
    let options = FlashOptions::default();

    let start = Instant::now();
    for round in 0..UPDATES {
        let blob = &blobs[round % 2];
        client.flash(blob, &options, &mut |_| {})?;
    }
    let bytes: usize = blobs.iter().map(Vec::len).sum::<usize>() * UPDATES / 2;
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{:.2} ms an update, {:.1} MB/s",
        1e3 * seconds / UPDATES as f64,
        1e-6 * bytes as f64 / seconds
    );

    let mut random = SplitMix(1);
    let mut sighting = |camera| Sighting {
        camera,
        u_px: 64.0 * random.unit(),
        v_px: 48.0 * random.unit(),
    };
    let matches: Vec<Match> = (0..MATCHES as u32)
        .map(|id| Match {
            id,
            first: sighting(0),
            second: sighting(1),
        })
        .collect();
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let measured = client.measure(&matches)?;
        let seconds = start.elapsed().as_secs_f64();
        let points = measured.iter().filter(|m| m.outcome.is_ok()).count();
        println!(
            "{:.0} matches a second, {:.0} points a second",
            MATCHES as f64 / seconds,
            points as f64 / seconds
        );
    }
    Ok(())
}
