//! The golden blobs of format versions 3 and 4: the packer writes today what it wrote then. Version 4 is
//! version 3 but for its number, and for sections where there are any.
//!
//! `UPDATE_GOLDEN=1 cargo test --release -p calib-blob --test it golden_blob` writes those of version 4
//! anew. That is right only if the packer was meant to change; a new format version gets a file
//! of its own, and the old one stays.

use calib_blob::pack::{AlignedBytes, PackSettings, Prefer, pack, read_aligned};
use calib_rays::field::spline::{Spline, SplineGrid};
use calib_rays::field::uncertainty::packed;
use calib_rays::field::{
    BaseLens, CalibratedCamera, CoverageMask, PairUncertainty, Projection, RayField, Rig, SmoothMap,
};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};
use nalgebra::{Matrix3, Matrix4, Vector2, Vector3};
use ray_runtime::RayBlob;
use ray_runtime::format::{
    self, CRC_OFFSET, HEADER_LEN, Header, QuantizedHeader, RECORD_LEN, VERSION,
};
use std::path::Path;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/golden");

/// A rotation about y by an angle with this sine and cosine.
fn yaw(sin: f64, cos: f64) -> Matrix3<f64> {
    Matrix3::new(cos, 0.0, sin, 0.0, 1.0, 0.0, -sin, 0.0, cos)
}

/// A central camera with a spline, calibrated in part, and one that is not central. Only sums,
/// products, quotients and square roots go into them, so that every machine packs the same bits.
fn golden_rig() -> Rig {
    let sensor = SensorSize::new(64, 48);
    let base = BaseLens::ideal(Projection::Perspective, 60.0);
    let mut left = RayField::ideal(sensor, base, 3);
    left.direction.polynomial.coefficients[7] = Vector2::new(0.01, -0.005);
    let mut spline = Spline::zero(SplineGrid {
        sensor,
        cells_u: 4,
        cells_v: 3,
    });
    for (k, c) in spline.coefficients.iter_mut().enumerate() {
        *c = Vector2::new((k % 5) as f64 - 2.0, (k % 3) as f64 - 1.0) / 500.0;
    }
    left.direction.spline = Some(spline);

    let mut right = RayField::ideal(sensor, base, 3);
    let mut offset = SmoothMap::zero(2);
    for (k, c) in offset.polynomial.coefficients.iter_mut().enumerate() {
        *c = Vector2::new(0.5 - k as f64 / 8.0, k as f64 / 16.0);
    }
    right.offset = Some(offset);

    let hull = [(4.0, 3.0), (60.0, 5.0), (58.0, 44.0), (8.0, 40.0)];
    let corners = hull.iter().map(|(u, v)| PixelPoint::new(*u, *v));
    Rig {
        uncertainty: vec![golden_uncertainty(sensor)],
        cameras: vec![
            CalibratedCamera {
                name: "left".into(),
                field: left,
                coverage: CoverageMask::from_corners(sensor, corners),
                rig_from_camera: RigidTransform::new(
                    yaw(0.28, 0.96),
                    Vector3::new(-140.0, 0.0, -480.0),
                ),
            },
            CalibratedCamera {
                name: "right".into(),
                field: right,
                coverage: CoverageMask::uniform(sensor, true),
                rig_from_camera: RigidTransform::new(
                    yaw(-0.28, 0.96),
                    Vector3::new(140.0, 0.0, -480.0),
                ),
            },
        ],
        datum_pose: 0,
        frame_is_known: false,
        match_noise_px: None,
    }
}

/// Larger to the right and downwards; the cameras' u go together.
fn golden_uncertainty(sensor: SensorSize) -> PairUncertainty {
    let node = |k: usize| {
        let size = 0.02 + (k % 4) as f64 / 128.0 + (k / 4) as f64 / 256.0;
        let factor = Matrix4::new(
            2.0, 0.0, 0.0, 0.0, //
            0.5, 1.5, 0.0, 0.0, //
            1.5, 0.25, 1.0, 0.0, //
            0.25, 1.25, -0.5, 1.0,
        ) * size;
        packed(&(factor * factor.transpose()))
    };
    PairUncertainty {
        first: 0,
        second: 1,
        sensor,
        nodes_u: 4,
        nodes_v: 3,
        calibration_px2: (0..12).map(node).collect(),
        noise_px2: 0.0025,
    }
}

#[test]
fn the_packer_still_writes_the_golden_blobs() {
    let mixed = golden_rig();
    // The same two cameras, both central, and both not.
    let mut central = golden_rig();
    central.cameras[1].field.offset = None;
    let mut non_central = golden_rig();
    non_central.cameras[0].field.offset = mixed.cameras[1].field.offset.clone();
    for (rig, name) in [
        (&mixed, "stereo"),
        (&central, "central"),
        (&non_central, "non-central"),
    ] {
        still_writes(rig, 3, &format!("{name}-v3-small.rays"), Prefer::Size);
        still_writes(rig, 3, &format!("{name}-v3-fast.rays"), Prefer::Speed);
    }
    let mut noisy = golden_rig();
    noisy.match_noise_px = Some(0.375);
    still_writes(&noisy, 4, "stereo-v4-small.rays", Prefer::Size);
    still_writes(&noisy, 4, "stereo-v4-fast.rays", Prefer::Speed);
    for (name, prefer) in [("small", Prefer::Size), ("fast", Prefer::Speed)] {
        let name = format!("stereo-v4-integer-{name}.rays");
        still_writes_with(&golden_rig(), 4, &name, prefer, true);
    }
    let cubic = "non-central-v3-cubic.rays";
    still_writes(&cubic_rig(), 3, cubic, Prefer::Size);
    let bytes = read_aligned(&Path::new(FOLDER).join(cubic)).unwrap();
    for table in quantized_tables(&bytes) {
        let (direction, offset) = (table.direction, table.offset);
        assert_eq!((direction.degree, direction.number_len), (3, 2));
        assert_eq!((offset.degree, offset.number_len), (3, 0));
    }
}

/// Two cameras as the small form has most of them: knots on a cubic, and a cubic offset.
fn cubic_rig() -> Rig {
    let mut rig = golden_rig();
    let mut field = rig.cameras[0].field.clone();
    let mut offset = SmoothMap::zero(3);
    for (k, c) in offset.polynomial.coefficients.iter_mut().enumerate() {
        *c = Vector2::new(0.5 - k as f64 / 8.0, k as f64 / 16.0) / 64.0;
    }
    field.offset = Some(offset);
    for camera in &mut rig.cameras {
        camera.field = field.clone();
    }
    rig
}

/// The headers of a blob's tables, all of which are quantized.
fn quantized_tables(bytes: &[u8]) -> Vec<QuantizedHeader> {
    let (_, header) = Header::read(bytes).unwrap();
    let records = format::aligned(HEADER_LEN + header.meta_len as usize);
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    (0..usize::from(header.camera_count))
        .map(|camera| {
            // The table's place is the sixth word of a record.
            let start = word(records + camera * RECORD_LEN + 20) as usize;
            let pair = |k: usize| [8 * k, 8 * k + 4].map(|at| f32::from_bits(word(start + at)));
            QuantizedHeader::read(&[0, 1, 2, 3, 4].map(pair)).unwrap()
        })
        .collect()
}

fn still_writes(rig: &Rig, version: u16, name: &str, prefer: Prefer) {
    still_writes_with(rig, version, name, prefer, false);
}

fn still_writes_with(rig: &Rig, version: u16, name: &str, prefer: Prefer, with_integers: bool) {
    let path = Path::new(FOLDER).join(name);
    let settings = PackSettings {
        max_error_px: 0.002,
        working_distance_mm: 500.0,
        identity: *match version {
            3 => b"golden stereo v3",
            _ => b"golden stereo v4",
        },
        prefer,
        with_integers,
        ..PackSettings::default()
    };
    let mut packed = pack(rig, &settings).unwrap().bytes;
    if version < VERSION {
        packed[4..6].copy_from_slice(&version.to_le_bytes());
        let crc = format::checksum(&packed).unwrap().to_le_bytes();
        packed[CRC_OFFSET..CRC_OFFSET + 4].copy_from_slice(&crc);
    } else if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, &packed).unwrap();
    }
    let golden = read_aligned(&path).unwrap();
    let (golden, now) = (
        RayBlob::open(&golden).unwrap(),
        AlignedBytes::from(packed.as_slice()),
    );
    // The program's version stands in the blob; what it computes must not depend on it.
    let fresh = RayBlob::open(&now).unwrap();
    for camera in 0..2 {
        assert_eq!(golden.camera(camera), fresh.camera(camera));
        for v in 0..48 {
            for u in 0..64 {
                let pixel = ray_runtime::PixelPoint::new(u as f32, v as f32);
                assert_eq!(golden.lookup(camera, pixel), fresh.lookup(camera, pixel));
            }
        }
    }
    assert!(golden.self_tests().eq(fresh.self_tests()));
    assert!(golden.uncertain_pairs().eq(fresh.uncertain_pairs()));
    assert_eq!(golden.match_noise(), fresh.match_noise());
    assert_eq!(golden.max_error_px(), fresh.max_error_px());
    assert_eq!(golden.arithmetic(), fresh.arithmetic());
    assert_eq!(golden.arithmetic().is_some(), with_integers);
    if golden.written_by() == fresh.written_by() {
        assert_eq!(std::fs::read(path).unwrap(), packed);
    }
}
