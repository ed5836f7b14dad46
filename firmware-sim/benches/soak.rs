//! 10,000 updates of a simulated device over TCP, one after the other, each checked; every tenth is
//! left behind half-way first. Its flash is in a file.
//!
//! `cargo bench -p firmware-sim --bench soak`

use std::time::Instant;

use firmware_sim::client::{DeviceClient, FlashOptions};
use firmware_sim::simulated::flash_file::FlashFile;
use firmware_sim::simulated::host::SimulatedDevice;
use ray_device::frame::checksum;
use ray_device::protocol::NewBlob;
use ray_runtime::{Aligned, RayBlob};

const UPDATES: u32 = 10_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let golden = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/golden");
    let mut blobs = Vec::new();
    for name in ["stereo-v2", "stereo-v3-small", "stereo-v3-fast"] {
        let bytes = std::fs::read(format!("{golden}/{name}.rays"))?;
        let mut aligned = Box::new(Aligned([0; 1 << 14]));
        let place = aligned.0.get_mut(..bytes.len()).ok_or("a larger blob")?;
        place.copy_from_slice(&bytes);
        let blob = RayBlob::open(place).map_err(|error| format!("{name}: {error}"))?;
        blobs.push((*blob.identity(), bytes));
    }
    let folder = tempfile::tempdir()?;
    let file = FlashFile::open(&folder.path().join("device.flash"), None)?;
    let device = SimulatedDevice::start_with("127.0.0.1:0".parse()?, file.flash)?;
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address()))?;
    let options = FlashOptions::default();

    let start = Instant::now();
    let mut tests = 0_u64;
    for round in 0..UPDATES {
        let of = |round: u32| &blobs[round as usize % blobs.len()];
        let (identity, blob) = of(round);
        if round % 10 == 5 {
            let (identity, other) = of(round + 1);
            client.begin_update(&NewBlob {
                length: other.len() as u32,
                checksum: checksum(other),
                identity: *identity,
                rig_serial: None,
                signature: None,
            })?;
            client.chunk(0, &other[..512])?;
        }
        let flashed = client.flash(blob, &options, &mut |_| {})?;
        let status = client.status()?;
        let active = status.blob.map_err(|code| format!("no blob: {code}"))?;
        assert_eq!(active.identity, *identity, "round {round}");
        assert_eq!(flashed.stored.sequence, round + 1);
        let report = client.self_test()?;
        assert_eq!(report.equal, report.tests, "round {round}");
        tests += u64::from(report.tests);
    }
    println!(
        "{UPDATES} updates, {} half-way ones, {tests} self-tests equal to the bit, {:.1} s",
        UPDATES / 10,
        start.elapsed().as_secs_f64()
    );
    Ok(())
}
