//! The same bits everywhere: 100,000 random matches of every golden blob, on the host, on a Cortex-M4F
//! and on a Cortex-M3, which has no floating-point unit, both in QEMU.

use std::path::{Path, PathBuf};

use firmware_cost::same_bits::{Digest, digest};
use firmware_sim::simulated::qemu::{DEVICE, Emulated, SOFT_FLOAT};
use ray_runtime::RayBlob;

const MATCHES: u32 = 100_000;
const IMAGE: &str = "same_bits";

pub fn blobs() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden");
    let files = std::fs::read_dir(folder).unwrap();
    let mut blobs: Vec<PathBuf> = files
        .map(|file| file.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "rays"))
        .collect();
    blobs.sort();
    assert!(blobs.len() >= 4, "{blobs:?}");
    blobs
}

fn on_host(path: &Path) -> Digest {
    digest_on_host(path, MATCHES)
}

pub fn digest_on_host(path: &Path, matches: u32) -> Digest {
    let contents = std::fs::read(path).unwrap();
    let mut words = vec![0_u64; contents.len().div_ceil(8)];
    let (bytes, _) = bytemuck::cast_slice_mut(&mut words).split_at_mut(contents.len());
    bytes.copy_from_slice(&contents);
    digest(&RayBlob::open(bytes).unwrap(), matches).unwrap()
}

fn on(core: &Emulated<'_>, blob: &Path) -> Digest {
    let image = core.image_path(IMAGE);
    let output = core.run_to_end(&image, Some(blob)).unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{}: {printed}", blob.display());
    let (checksum, points) = printed.trim().split_once(' ').unwrap();
    Digest {
        checksum: u32::from_str_radix(checksum, 16).unwrap(),
        points: points.parse().unwrap(),
    }
}

#[test]
fn host_and_cortex_m4f_answer_the_same_bits() {
    DEVICE.build(&[IMAGE], "").unwrap();
    for blob in blobs() {
        let host = on_host(&blob);
        // A fifth of the pairs see something in front of both cameras.
        assert!(host.points > MATCHES / 5, "{}: {host:?}", blob.display());
        assert_eq!(on(&DEVICE, &blob), host, "{}", blob.display());
    }
}

#[test]
fn without_a_floating_point_unit_the_bits_are_the_same() {
    SOFT_FLOAT.build(&[IMAGE], "").unwrap();
    let blobs = blobs();
    // By far the longest of these tests: half of the blobs beside the others.
    let (first, second) = blobs.split_at(blobs.len() / 2);
    let check = |blobs: &[PathBuf]| {
        for blob in blobs {
            let (found, host) = (on(&SOFT_FLOAT, blob), on_host(blob));
            assert_eq!(found, host, "{}", blob.display());
        }
    };
    std::thread::scope(|threads| {
        threads.spawn(|| check(first));
        check(second);
    });
}
