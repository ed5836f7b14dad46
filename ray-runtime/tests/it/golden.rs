//! Exact bytes: the golden blobs of versions 1, 2 and 4 are read as on the day they were written.

use ray_runtime::format::{self, Encoding, HEADER_LEN, Header, MAGIC, RECORD_LEN, Record};
use ray_runtime::{Aligned, LookupError, MatchNoise, MeasureError, PixelPoint, RayBlob, Region};

static GOLDEN: &Aligned<[u8]> = &Aligned(*include_bytes!("../../../data/golden/stereo-v1.rays"));

#[test]
fn header_and_records_are_where_the_format_says() {
    let bytes = &GOLDEN.0;
    assert_eq!(bytes[..8], [b'R', b'A', b'Y', b'S', 1, 0, 24, 0]);
    let (magic, header) = Header::read(bytes).unwrap();
    assert_eq!(magic, MAGIC);
    assert_eq!(header.total_len as usize, bytes.len());
    assert_eq!((header.meta_len, header.camera_count), (363, 2));
    // Computed by zlib over all bytes but these four.
    assert_eq!(header.crc, 0xb3b1_d3fa);
    assert_eq!(format::checksum(bytes), Some(header.crc));

    let records = format::aligned(HEADER_LEN + 363);
    assert_eq!(records, 392);
    let record = |camera: usize| -> [u32; 32] {
        std::array::from_fn(|k| {
            let at = records + camera * RECORD_LEN + 4 * k;
            u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
        })
    };
    let (left, right) = (record(0), record(1));
    assert_eq!(left[..8], [1, 8, 6, 48, 36, 648, 1440, 0]);
    assert_eq!(right[..8], [2, 5, 4, 48, 36, 1656, 2552, 0]);
    // -0.5, 63.5, 1/8, 8, 0 and 48/64 rounded up; a rotation of 0.96; 140 mm to the left.
    assert_eq!(
        left[8..14],
        [
            0xbf00_0000,
            0x427e_0000,
            0x3e00_0000,
            0x4100_0000,
            0,
            0x3f40_0001
        ]
    );
    assert_eq!(left[20], 0.96f32.to_bits());
    assert_eq!(left[29], (-140.0f32).to_bits());
    // Left: 11 x 9 knots of 2 numbers behind the records; right: 8 x 7 knots of 4.
    assert_eq!(left[5] as usize, records + 2 * RECORD_LEN);
    assert_eq!(
        left[6] as usize,
        648 + Encoding::from_number(1).unwrap().table_len([8, 6]).unwrap()
    );
    assert_eq!(right[5] as usize, 1440 + format::mask_len([48, 36]));
    assert_eq!(Record(&right).cells(), [5, 4]);
}

#[test]
fn metadata_says_what_was_packed() {
    let blob = RayBlob::open(&GOLDEN.0).unwrap();
    assert_eq!(blob.identity(), b"golden stereo v1");
    assert_eq!(blob.frame(), "board at pose 0");
    assert_eq!(blob.working_distance_mm(), 500.0);
    assert!(blob.max_error_px() > 0.0 && blob.max_error_px() <= 0.002);
    assert_eq!(blob.camera_count(), 2);
    let (left, right) = (blob.camera(0).unwrap(), blob.camera(1).unwrap());
    assert_eq!((left.name, right.name), ("left", "right"));
    assert!(left.encoding.is_central && !right.encoding.is_central);
    let whole = Region {
        u: 0,
        v: 0,
        width: 64,
        height: 48,
    };
    assert_eq!((left.region, right.region), (whole, whole));
    assert_eq!(blob.camera_index("right"), Some(1));
}

#[test]
fn answers_keep_their_bits() {
    let blob = RayBlob::open(&GOLDEN.0).unwrap();
    assert_eq!(blob.run_self_tests(), Ok(8));
    let bits = |v: [f32; 3]| v.map(f32::to_bits);
    let right = blob.lookup(1, PixelPoint::new(10.25, 40.5)).unwrap();
    assert_eq!(bits(right.origin_mm), RIGHT_ORIGIN);
    assert_eq!(bits(right.direction), RIGHT_DIRECTION);

    let (a, b) = (PixelPoint::new(30.0, 20.5), PixelPoint::new(33.0, 21.0));
    let point = blob.triangulate((0, a), (1, b)).unwrap();
    assert_eq!(bits(point.point_mm), POINT);
    assert_eq!(point.gap_squared_mm2.to_bits(), GAP_SQUARED);
}

// From a separate evaluation of FORMAT.md's formulas in Python with f32 arithmetic.
// (140.34, 0.055, -479.77) mm; (0.598, -25.17, 48.26) mm with a gap of 4.3 mm.
const RIGHT_ORIGIN: [u32; 3] = [0x430c_5851, 0x3d63_234c, 0xc3ef_e288];
const RIGHT_DIRECTION: [u32; 3] = [0xbf17_4db8, 0x3e8a_4946, 0x3f52_12f4];
const POINT: [u32; 3] = [0x3f18_fc00, 0xc1c9_5abb, 0x4241_0904];
const GAP_SQUARED: u32 = 0x4195_14ed;

#[test]
fn what_is_not_calibrated_has_no_answer() {
    let blob = RayBlob::open(&GOLDEN.0).unwrap();
    let (corner, inside) = (PixelPoint::new(0.0, 47.0), PixelPoint::new(30.0, 20.0));
    assert_eq!(blob.lookup(0, corner), Err(LookupError::Outside));
    assert!(blob.lookup(1, corner).is_ok());
    assert_eq!(
        blob.triangulate((1, inside), (0, corner)),
        Err(MeasureError::Outside { camera: 0 })
    );
}

static GOLDEN_2: &Aligned<[u8]> = &Aligned(*include_bytes!("../../../data/golden/stereo-v2.rays"));

#[test]
fn version_2_has_a_pair_behind_the_tables() {
    let bytes = &GOLDEN_2.0;
    assert_eq!(bytes[..8], [b'R', b'A', b'Y', b'S', 2, 0, 24, 0]);
    let (_, header) = Header::read(bytes).unwrap();
    assert_eq!(header.total_len as usize, bytes.len());
    assert_eq!((header.meta_len, header.camera_count), (425, 2));
    assert_eq!(header.pair_count, 1);
    // Computed by zlib over all bytes but these four.
    assert_eq!(header.crc, 0xe89b_7b5b);
    // 32 bytes and 8 x 6 nodes of 11: the end of the blob, without padding.
    let pair = 2832;
    assert_eq!(bytes.len(), pair + 32 + 8 * 6 * 11);
    assert_eq!(bytes[pair..pair + 8], [0, 0, 1, 0, 8, 0, 6, 0]);
    // The calibrated area begins at (3.5, 2.17) px; nodes every 8.2 and 8.5 px; 0.05 px of noise.
    let numbers: [f32; 6] = std::array::from_fn(|k| {
        let at = pair + 8 + 4 * k;
        f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
    });
    assert_eq!(numbers[0], 3.5);
    assert_eq!(numbers[3], 0.1171875);
    assert_eq!(numbers[5], 0.0025);
    let opened = RayBlob::open(bytes).unwrap();
    let header = opened.uncertain_pairs().next().unwrap();
    assert_eq!((header.cameras, header.nodes), ([0, 1], [8, 6]));
    assert_eq!(header.nodes_per_px, [numbers[2], numbers[3]]);
    assert_eq!(header.step_px, numbers[4]);
}

#[test]
fn standard_deviations_keep_their_bits() {
    let blob = RayBlob::open(&GOLDEN_2.0).unwrap();
    assert_eq!(blob.run_self_tests(), Ok(10));
    let (a, b) = (PixelPoint::new(30.0, 20.5), PixelPoint::new(33.0, 21.0));
    let measured = blob.triangulate_with_covariance((0, a), (1, b)).unwrap();
    let sigma_mm = measured.covariance.unwrap().sigma_mm();
    assert_eq!(sigma_mm.map(f32::to_bits), SIGMA);
}

// From a separate evaluation of FORMAT.md's formulas in Python with f32 arithmetic:
// 0.6851, 0.5877 and 1.4421 mm.
const SIGMA: [u32; 3] = [0x3f2f_612f, 0x3f16_76a4, 0x3fb8_9568];

#[test]
fn version_1_has_no_uncertainty() {
    let blob = RayBlob::open(&GOLDEN.0).unwrap();
    assert_eq!(blob.uncertain_pairs().count(), 0);
    let (a, b) = (PixelPoint::new(30.0, 20.5), PixelPoint::new(33.0, 21.0));
    let measured = blob.triangulate_with_covariance((0, a), (1, b)).unwrap();
    assert_eq!(Ok(measured.found), blob.triangulate((0, a), (1, b)));
    assert_eq!(measured.covariance, None);
}

static GOLDEN_4: &Aligned<[u8]> =
    &Aligned(*include_bytes!("../../../data/golden/stereo-v4-small.rays"));

#[test]
fn version_4_has_the_noise_of_matches_behind_the_pair() {
    let bytes = &GOLDEN_4.0;
    assert_eq!(bytes[..8], [b'R', b'A', b'Y', b'S', 4, 0, 24, 0]);
    let (_, header) = Header::read(bytes).unwrap();
    assert_eq!(header.total_len as usize, bytes.len());
    // Computed by zlib over all bytes but these four.
    assert_eq!(header.crc, 0x94b3_3ecd);
    // Tag 1, not required, four bytes, 0.375, and zeros up to the next multiple of 8: the end of the blob.
    let section = bytes.len() - 16;
    assert_eq!(bytes[section..section + 8], [1, 0, 0, 0, 4, 0, 0, 0]);
    assert_eq!(bytes[section + 8..section + 12], 0.375f32.to_le_bytes());
    assert_eq!(bytes[section + 12..], [0; 4]);
    let blob = RayBlob::open(bytes).unwrap();
    assert_eq!(blob.run_self_tests(), Ok(10));
    assert_eq!(blob.match_noise().map(MatchNoise::px), Some(0.375));
    let (a, b) = (PixelPoint::new(30.0, 20.5), PixelPoint::new(33.0, 21.0));
    let measured = blob.triangulate_with_covariance((0, a), (1, b)).unwrap();
    let sigma_mm = measured.covariance.unwrap().sigma_mm();
    assert_eq!(sigma_mm.map(f32::to_bits), SIGMA_4);
}

// From a separate evaluation of FORMAT.md's formulas in Python with f32 arithmetic:
// 2.5705, 2.4990 and 9.4449 mm.
const SIGMA_4: [u32; 3] = [0x4024_8291, 0x401f_ef89, 0x4117_1e81];
