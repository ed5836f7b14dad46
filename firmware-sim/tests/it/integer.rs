//! Devices that compute in integers: on the host behind a port, and the same bits in images for cores with and without a
//! floating-point unit.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use firmware_cost::same_bits::digest_of_integers;
use firmware_sim::client::DeviceClient;
use firmware_sim::simulated::flash_file;
use firmware_sim::simulated::host::SimulatedDevice;
use ray_device::protocol::{Arithmetic, Match, Sighting};
use ray_runtime::integer::Rig;
use ray_runtime::{MeasureError, PixelPoint, RayBlob};

/// As many as the image answers of each blob.
const MATCHES: u32 = 20_000;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn aligned(contents: &[u8]) -> Vec<u64> {
    let mut words = vec![0_u64; contents.len().div_ceil(8)];
    let (bytes, _) = bytemuck::cast_slice_mut(&mut words).split_at_mut(contents.len());
    bytes.copy_from_slice(contents);
    words
}

fn golden(name: &str) -> Vec<u8> {
    std::fs::read(root().join("data/golden").join(name)).unwrap()
}

fn matches() -> Vec<Match> {
    (0..60)
        .map(|id| {
            let sighting = |camera, shift| Sighting {
                camera,
                u_px: 12.25 + (id % 8) as f32 * 5.0 + shift,
                v_px: 9.5 + (id / 8) as f32 * 4.0,
            };
            Match {
                id,
                first: sighting(0, 0.0),
                second: sighting(1, 3.0),
            }
        })
        .collect()
}

#[test]
fn a_device_measures_in_integers_and_says_so() {
    for name in [
        "stereo-v4-integer-small.rays",
        "stereo-v4-integer-fast.rays",
    ] {
        let contents = golden(name);
        let words = aligned(&contents);
        let blob = RayBlob::open(&bytemuck::cast_slice(&words)[..contents.len()]).unwrap();
        let rig = Rig::<2>::prepare(&blob).unwrap();
        let flash = || flash_file::holding(&contents, None).unwrap();
        let any = "127.0.0.1:0".parse().unwrap();
        let connect = |device: &SimulatedDevice| {
            DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap()
        };
        let mut integers = connect(&SimulatedDevice::start_in_integers(any, flash()).unwrap());
        let mut floats = connect(&SimulatedDevice::start_with(any, flash()).unwrap());
        assert_eq!(integers.status().unwrap().arithmetic, Arithmetic::Integer);
        assert_eq!(floats.status().unwrap().arithmetic, Arithmetic::Float);

        let asked = matches();
        let (mut count, mut others) = (0, 0);
        let found = integers.measure(&asked).unwrap();
        let points = floats.measure_points(&asked).unwrap();
        let sigmas = floats.measure(&asked).unwrap();
        for (k, asked) in asked.iter().enumerate() {
            let pixel = |s: Sighting| (usize::from(s.camera), PixelPoint::new(s.u_px, s.v_px));
            let here = rig.triangulate(pixel(asked.first), pixel(asked.second));
            match (found[k].outcome, here) {
                (Ok(there), Ok(here)) => {
                    let here = here.point_mm.map(f32::to_bits);
                    assert_eq!(there.point_mm.map(f32::to_bits), here);
                    assert_eq!(there.sigma_mm, None);
                    count += 1;
                }
                (there, here) => assert_eq!(there.err(), here.map_err(MeasureError::code).err()),
            }
            // Points alone are those with standard deviations.
            match (points[k].outcome, sigmas[k].outcome) {
                (Ok(point), Ok(with_sigma)) => {
                    assert_eq!(point.to_bits()[..4], with_sigma.to_bits()[..4]);
                    assert!(point.sigma_mm.is_none() && with_sigma.sigma_mm.is_some());
                    others += u32::from(found[k].outcome != Ok(point));
                }
                (point, with_sigma) => assert_eq!(point.err(), with_sigma.err()),
            }
        }
        // Another arithmetic, other bits.
        assert!(count > 20 && others > 20, "{count} {others}");
        for client in [&mut integers, &mut floats] {
            let report = client.self_test().unwrap();
            assert!(
                report.tests > 4 && report.equal == report.tests,
                "{report:?}"
            );
        }
        assert!(integers.status().unwrap().gaps.is_none());
    }
}

/// The image of this name for a target.
fn build(image: &str, target: &str) -> PathBuf {
    let script = root().join("scripts/embedded-cargo.sh");
    let folder = root().join("target/embedded/integer");
    let is_built = Command::new(script)
        .args([
            "build",
            "--quiet",
            "--locked",
            "--release",
            "--features",
            "integer",
        ])
        .args(["--bin", image, "--target", target, "--target-dir"])
        .arg(&folder)
        .stdout(std::io::stderr())
        .status()
        .unwrap();
    assert!(is_built.success());
    folder.join(target).join("release").join(image)
}

/// What an image prints on one of QEMU's machines.
fn printed(image: &str, target: &str, machine: [&str; 2]) -> String {
    let image = build(image, target);
    let [machine, cpu] = machine;
    let output = Command::new("timeout")
        .args(["300", "qemu-system-arm", "-machine", machine, "-cpu", cpu])
        // An instruction takes 1024 ns.
        .args(["-icount", "shift=10"])
        .args(["-display", "none", "-monitor", "none", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(image)
        .stdin(std::process::Stdio::null())
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{target}: {text}");
    text
}

/// The lines of the image, computed here.
fn here() -> String {
    let mut names: Vec<_> = std::fs::read_dir(root().join("data/golden"))
        .unwrap()
        .map(|file| file.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "rays"))
        .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    let mut lines = String::new();
    for name in &names {
        let contents = golden(name);
        let words = aligned(&contents);
        let blob = RayBlob::open(&bytemuck::cast_slice(&words)[..contents.len()]).unwrap();
        let tests = Rig::<2>::prepare(&blob)
            .unwrap()
            .run_self_tests(&blob)
            .unwrap();
        let digest = digest_of_integers(&blob, MATCHES).unwrap();
        assert!(digest.points > MATCHES / 5, "{name}");
        writeln!(
            lines,
            "{:08x} {:08x} {tests:08x} ",
            digest.checksum, digest.points
        )
        .unwrap();
    }
    lines
}

#[test]
fn integers_give_the_same_bits_on_the_host_a_cortex_m4f_and_a_core_without_a_floating_point_unit() {
    let here = here();
    for (target, machine) in [
        ("thumbv7em-none-eabihf", ["mps2-an386", "cortex-m4"]),
        ("thumbv6m-none-eabi", ["mps2-an385", "cortex-m3"]),
    ] {
        assert_eq!(printed("integer_bits", target, machine), here, "{target}");
    }
}

/// It links only if no panic is reachable.
#[test]
fn no_panic_is_reachable_in_integers() {
    build("footprint_integer", "thumbv6m-none-eabi");
}
