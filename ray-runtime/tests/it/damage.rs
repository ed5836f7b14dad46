//! Bytes that are not quite a blob: each is refused, with the reason that fits, and none panics.

use crate::test_blob::{
    AlignedBytes, TestBlob, TestCamera, TestPair, encoding, records_start, repair_checksum,
};
use ray_runtime::format::{
    Form, HEADER_LEN, MAGIC, OLDEST_VERSION, PAIR_HEADER_LEN, PairHeader, RECORD_LEN, SelfTest,
    VERSION,
};
use ray_runtime::{OpenError, PixelPoint, RayBlob, Table};
use split_mix::SplitMix;

/// One central and one non-central camera, with a mask whose last byte is not full, and their
/// uncertainty.
fn sample() -> TestBlob {
    sample_of(Form::Spline)
}

fn sample_of(form: Form) -> TestBlob {
    let mut first = TestCamera::new("first", -80.0);
    first.encoding = encoding(form, true);
    let mut second = TestCamera::new("second", 80.0);
    second.encoding = encoding(form, false);
    second.offset_mm = [0.5, -0.25];
    let mut blob = TestBlob::new(vec![first, second]);
    blob.pairs = vec![TestPair::new([0, 1])];
    blob.self_tests = vec![SelfTest::Ray {
        camera: 1,
        pixel: [1.0, 2.0],
        origin_mm: [0.0; 3],
        direction: [0.0; 3],
    }];
    blob
}

const FORMS: [Form; 3] = [Form::Spline, Form::Patches, Form::Quantized];

fn refused(bytes: &[u8]) -> OpenError {
    RayBlob::open(bytes).expect_err("should be refused")
}

/// Opens the sample with some bytes replaced and the checksum repaired.
fn refused_with(at: usize, replacement: &[u8]) -> OpenError {
    let mut bytes = sample().bytes();
    bytes.bytes_mut()[at..at + replacement.len()].copy_from_slice(replacement);
    repair_checksum(bytes.bytes_mut());
    refused(bytes.bytes())
}

#[test]
fn truncation_at_every_length_is_refused() {
    FORMS.into_iter().for_each(truncations_are_refused);
}

fn truncations_are_refused(form: Form) {
    let whole = sample_of(form).bytes();
    let whole = whole.bytes();
    assert!(RayBlob::open(whole).is_ok());
    for length in 0..whole.len() {
        let need = if length < HEADER_LEN {
            HEADER_LEN
        } else {
            whole.len()
        };
        assert_eq!(
            refused(&whole[..length]),
            OpenError::Truncated {
                need: need as u32,
                have: length as u32
            }
        );
    }
}

#[test]
fn a_flip_of_every_bit_is_refused() {
    FORMS.into_iter().for_each(flips_are_refused);
}

fn flips_are_refused(form: Form) {
    let mut bytes = sample_of(form).bytes();
    for bit in 0..bytes.bytes().len() * 8 {
        bytes.bytes_mut()[bit / 8] ^= 1 << (bit % 8);
        let error = refused(bytes.bytes());
        let fits = match bit / 8 {
            0..4 => matches!(error, OpenError::BadMagic { .. }),
            // A bit away from one version there may be another.
            4..6 => matches!(
                error,
                OpenError::WrongVersion { .. } | OpenError::BadCrc { .. }
            ),
            8..12 => matches!(
                error,
                OpenError::Truncated { .. } | OpenError::TrailingBytes { .. }
            ),
            _ => matches!(error, OpenError::BadCrc { .. }),
        };
        assert!(fits, "bit {bit}: {error:?}");
        bytes.bytes_mut()[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(RayBlob::open(bytes.bytes()).is_ok());
}

#[test]
fn every_other_alignment_than_eight_is_refused() {
    let whole = sample().bytes();
    for shift in 1..8 {
        let shifted = AlignedBytes::shifted(whole.bytes(), shift);
        let offset = shift as u8;
        assert_eq!(refused(shifted.bytes()), OpenError::Misaligned { offset });
    }
}

#[test]
fn bytes_behind_the_end_are_refused_and_the_length_is_known_beforehand() {
    let whole = sample().bytes();
    let mut long = whole.bytes().to_vec();
    long.resize(long.len() + 64, 0xff);
    let long = AlignedBytes::new(&long);
    let (need, have) = (whole.bytes().len() as u32, long.bytes().len() as u32);
    assert_eq!(
        refused(long.bytes()),
        OpenError::TrailingBytes { need, have }
    );
    let stated = RayBlob::stated_len(long.bytes()).unwrap();
    assert!(RayBlob::open(&long.bytes()[..stated as usize]).is_ok());
    assert_eq!(
        RayBlob::stated_len(&[0xff; 100]),
        Err(OpenError::BadMagic { found: u32::MAX })
    );
}

#[test]
fn each_part_of_the_header_is_judged() {
    let zeros = [0; 4];
    let found = u32::from_le_bytes(zeros);
    assert_eq!(refused_with(0, &zeros), OpenError::BadMagic { found });
    assert_ne!(zeros, MAGIC);
    for found in [0, OLDEST_VERSION - 1, VERSION + 1, u16::MAX] {
        let supported = VERSION;
        assert_eq!(
            refused_with(4, &found.to_le_bytes()),
            OpenError::WrongVersion { found, supported }
        );
    }
    // Version 1 has no pairs.
    assert_eq!(refused_with(4, &1u16.to_le_bytes()), OpenError::BadHeader);
    // Header length, metadata length (three ways), camera count, pair count.
    assert_eq!(refused_with(6, &32u16.to_le_bytes()), OpenError::BadHeader);
    assert_eq!(
        refused_with(16, &u32::MAX.to_le_bytes()),
        OpenError::BadHeader
    );
    assert_eq!(refused_with(20, &0u16.to_le_bytes()), OpenError::BadHeader);
    assert_eq!(refused_with(20, &65u16.to_le_bytes()), OpenError::BadHeader);
    // Then the pair would be a section.
    assert_eq!(
        refused_with(22, &0u16.to_le_bytes()),
        OpenError::BadSection { section: 0 }
    );
    assert_eq!(
        refused_with(22, &2u16.to_le_bytes()),
        OpenError::BadPair { pair: 1 }
    );
    let no_cameras = TestBlob::new(Vec::new()).bytes();
    assert_eq!(refused(no_cameras.bytes()), OpenError::BadHeader);
}

#[test]
fn each_part_of_the_metadata_is_judged() {
    let spoiled = |spoil: fn(&mut TestBlob)| {
        let mut content = sample();
        spoil(&mut content);
        refused(content.bytes().bytes())
    };
    let spoils: [fn(&mut TestBlob); 15] = [
        |b| b.max_error_px = f32::NAN,
        |b| b.max_error_px = -1.0,
        |b| b.max_error_px = f32::INFINITY,
        |b| b.identity = vec![0; 15],
        |b| b.cameras[0].name = "",
        |b| b.cameras[0].name = "second",
        |b| b.cameras[0].sensor = [63, 48],
        |b| b.cameras[0].region = [1, 0, 64, 48],
        |b| b.cameras[0].region = [0, 0, 0, 48],
        |b| b.cameras[0].region = [u32::MAX, 0, 1, 48],
        |b| b.cameras[0].region = [0, 40, 64, u32::MAX],
        |b| b.cameras[0].sensor = [65536, 48],
        |b| {
            b.self_tests[0] = SelfTest::Ray {
                camera: 2,
                pixel: [0.0; 2],
                origin_mm: [0.0; 3],
                direction: [0.0; 3],
            }
        },
        |b| {
            b.self_tests[0] = SelfTest::Pair {
                cameras: [0, 2],
                pixels: [[0.0; 2]; 2],
                point_mm: [0.0; 3],
                gap_squared_mm2: 0.0,
            }
        },
        |b| {
            b.pairs.clear();
            b.self_tests[0] = SelfTest::Sigma {
                cameras: [0, 1],
                pixels: [[0.0; 2]; 2],
                sigma_mm: [0.0; 3],
            }
        },
    ];
    for (k, spoil) in spoils.into_iter().enumerate() {
        assert_eq!(spoiled(spoil), OpenError::BadMeta, "number {k}");
    }
    // Text that is not UTF-8: the frame follows the 17 bytes of the identity and a length.
    assert_eq!(refused_with(HEADER_LEN + 18, &[0xff]), OpenError::BadMeta);
    // A pixel convention that does not exist: behind "test" and "hand".
    assert_eq!(refused_with(HEADER_LEN + 27, &[1]), OpenError::BadMeta);
    // More self-tests than there are.
    let count_at = HEADER_LEN + 27 + 2 + 8;
    assert_eq!(refused_with(count_at, &[2]), OpenError::BadMeta);
    // Fewer: what is left over is no part of anything.
    assert_eq!(refused_with(count_at, &[0]), OpenError::BadMeta);
}

#[test]
fn padding_that_is_not_zero_is_refused() {
    let bytes = sample().bytes();
    let start = records_start(bytes.bytes());
    assert!(matches!(
        refused_with(start - 1, &[1]),
        OpenError::BadPadding { .. }
    ));
    // Behind 32 bytes and 6 nodes of 11 there are 6 zeros.
    let end = bytes.bytes().len();
    assert_eq!(
        refused_with(end - 1, &[1]),
        OpenError::BadPadding { at: end as u32 - 6 }
    );
    let end = end - 104;
    assert_eq!(
        refused_with(end - 1, &[1]),
        OpenError::BadPadding { at: end as u32 - 6 }
    );
    // Bits of the last mask byte behind the 12 cells.
    let number = OpenError::BadNumber {
        camera: 1,
        table: Table::Mask,
    };
    assert_eq!(refused_with(end - 7, &[0x1f]), number);
}

#[test]
fn each_part_of_a_record_is_judged() {
    let start = records_start(sample().bytes().bytes());
    let word = |camera: usize, word: usize| start + camera * RECORD_LEN + 4 * word;
    assert_eq!(
        refused_with(word(1, 0), &9u32.to_le_bytes()),
        OpenError::UnknownEncoding {
            camera: 1,
            found: 9
        }
    );
    let layout = |camera, table| OpenError::BadLayout { camera, table };
    let number = |camera, table| OpenError::BadNumber { camera, table };
    for count_word in 1..=4 {
        for count in [0u32, 1025, u32::MAX] {
            let error = refused_with(word(0, count_word), &count.to_le_bytes());
            assert_eq!(error, layout(0, Table::Record));
        }
    }
    // Other counts do not fit the working numbers.
    assert_eq!(
        refused_with(word(0, 1), &4u32.to_le_bytes()),
        number(0, Table::Record)
    );
    assert_eq!(
        refused_with(word(0, 5), &0u32.to_le_bytes()),
        layout(0, Table::Grid)
    );
    assert_eq!(
        refused_with(word(1, 6), &8u32.to_le_bytes()),
        layout(1, Table::Mask)
    );
    assert_eq!(
        refused_with(word(0, 7), &1u32.to_le_bytes()),
        layout(0, Table::Record)
    );
    for number_word in 8..32 {
        let error = refused_with(word(1, number_word), &f32::NAN.to_le_bytes());
        assert_eq!(error, number(1, Table::Record), "word {number_word}");
    }
    // A reflection, and a rotation that is stretched.
    assert_eq!(
        refused_with(word(0, 20), &(-1.0f32).to_le_bytes()),
        number(0, Table::Record)
    );
    assert_eq!(
        refused_with(word(0, 28), &1.0001f32.to_le_bytes()),
        number(0, Table::Record)
    );
    // The other encoding would need a longer grid.
    assert!(matches!(
        refused_with(word(1, 0), &1u32.to_le_bytes()),
        OpenError::BadLayout { .. } | OpenError::BadPadding { .. }
    ));
}

#[test]
fn every_number_of_a_grid_must_be_finite() {
    let whole = sample().bytes();
    let start = records_start(whole.bytes()) + 2 * RECORD_LEN;
    for number in 0..6 * 5 * 2 {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            assert_eq!(
                refused_with(start + 4 * number, &bad.to_le_bytes()),
                OpenError::BadNumber {
                    camera: 0,
                    table: Table::Grid
                }
            );
        }
    }
}

#[test]
fn forms_of_a_later_version_are_refused_in_an_earlier_one() {
    for form in [Form::Patches, Form::Quantized] {
        let mut bytes = sample_of(form).bytes();
        bytes.bytes_mut()[4] = 2;
        repair_checksum(bytes.bytes_mut());
        let found = encoding(form, true).number();
        assert_eq!(
            refused(bytes.bytes()),
            OpenError::UnknownEncoding { camera: 0, found }
        );
    }
    let mut bytes = sample().bytes();
    bytes.bytes_mut()[4] = 2;
    repair_checksum(bytes.bytes_mut());
    assert!(RayBlob::open(bytes.bytes()).is_ok());
}

#[test]
fn each_part_of_a_quantized_table_is_judged() {
    let content = sample_of(Form::Quantized);
    let whole = content.bytes();
    let start = records_start(whole.bytes()) + 2 * RECORD_LEN;
    let refused_with = |at: usize, replacement: &[u8]| {
        let mut bytes = content.bytes();
        bytes.bytes_mut()[start + at..start + at + replacement.len()].copy_from_slice(replacement);
        repair_checksum(bytes.bytes_mut());
        refused(bytes.bytes())
    };
    let layout = OpenError::BadLayout {
        camera: 0,
        table: Table::Grid,
    };
    let number = OpenError::BadNumber {
        camera: 0,
        table: Table::Grid,
    };
    // Degree, bytes of a number, and any offset of a camera that has none.
    assert_eq!(refused_with(0, &[10]), layout);
    assert_eq!(refused_with(0, &[2]), layout);
    assert_eq!(refused_with(1, &[3]), layout);
    assert_eq!(refused_with(2, &[1]), layout);
    assert_eq!(refused_with(3, &[1]), layout);
    assert_eq!(refused_with(12, &1f32.to_le_bytes()), layout);
    // Where the knots start.
    assert_eq!(refused_with(4, &8u32.to_le_bytes()), layout);
    // Unit, scales, places, coefficients.
    for word in (2..3).chain(4..14) {
        for bad in [f32::NAN, f32::INFINITY, -1e30] {
            assert_eq!(refused_with(4 * word, &bad.to_le_bytes()), number, "{word}");
        }
    }
    // Any knots are knots.
    let mut bytes = content.bytes();
    bytes.bytes_mut()[start + 56..start + 60].fill(0xff);
    repair_checksum(bytes.bytes_mut());
    assert!(RayBlob::open(bytes.bytes()).is_ok());
}

#[test]
fn each_part_of_a_pair_is_judged() {
    let spoiled = |spoil: fn(&mut PairHeader)| {
        let mut content = sample();
        spoil(&mut content.pairs[0].header);
        refused(content.bytes().bytes())
    };
    let spoils: [fn(&mut PairHeader); 14] = [
        |h| h.cameras = [0, 0],
        |h| h.cameras = [1, 0],
        |h| h.cameras = [0, 2],
        |h| h.nodes[0] = 1,
        |h| h.nodes[1] = 0,
        |h| h.nodes[1] = 65,
        |h| h.first_px[0] = f32::NAN,
        |h| h.first_px[1] = 2e6,
        |h| h.nodes_per_px[0] = 0.0,
        |h| h.nodes_per_px[1] = f32::INFINITY,
        |h| h.step_px = -1e-9,
        |h| h.step_px = 1.01,
        |h| h.noise_px2 = f32::NAN,
        |h| h.noise_px2 = -1.0,
    ];
    for (k, spoil) in spoils.into_iter().enumerate() {
        assert_eq!(spoiled(spoil), OpenError::BadPair { pair: 0 }, "number {k}");
    }
    // More nodes than there are bytes for; fewer leave bytes that must be zero, or too many.
    let bytes = sample().bytes();
    let start = bytes.bytes().len() - 104;
    assert_eq!(
        refused_with(start + 4, &[4, 0]),
        OpenError::BadPair { pair: 0 }
    );
    assert!(matches!(
        refused_with(start + 4, &[2, 0]),
        OpenError::BadPadding { .. } | OpenError::BadSection { .. }
    ));
    // Any node is a factor of some covariance.
    let mut any = sample();
    any.pairs[0].node = [0xff; 11];
    assert!(RayBlob::open(any.bytes().bytes()).is_ok());
    assert_eq!(PAIR_HEADER_LEN + 6 * 11 + 6, 104);
}

#[test]
fn pairs_that_stand_there_twice_or_out_of_order_are_refused() {
    let mut content = sample();
    content.cameras.push(TestCamera::new("third", 200.0));
    let refused_at_1 = |pairs: &[[u16; 2]]| {
        content.pairs = pairs
            .iter()
            .map(|cameras| TestPair::new(*cameras))
            .collect();
        RayBlob::open(content.bytes().bytes()).err()
    };
    let mut check = refused_at_1;
    let bad = Some(OpenError::BadPair { pair: 1 });
    assert_eq!(check(&[[0, 1], [0, 1]]), bad);
    assert_eq!(check(&[[1, 2], [0, 1]]), bad);
    assert_eq!(check(&[[0, 1], [0, 2], [1, 2]]), None);
}

/// Whatever opens must answer; nothing may panic. The checksum is repaired, so the damage gets
/// past it.
#[test]
fn random_damage_with_a_right_checksum_never_panics() {
    FORMS.into_iter().for_each(random_damage_never_panics);
}

fn random_damage_never_panics(form: Form) {
    let whole = sample_of(form).bytes();
    let mut random = SplitMix(2024);
    let (mut opened, mut refused) = (0, 0);
    for round in 0..100_000 {
        let mut bytes = AlignedBytes::new(whole.bytes());
        let length = bytes.bytes().len();
        // Half of the rounds aim at header and metadata, where structure is.
        let reach = if round % 2 == 0 { 120 } else { length };
        for _ in 0..=random.below(3) {
            let at = random.below(reach);
            bytes.bytes_mut()[at] = match random.below(3) {
                0 => random.next() as u8,
                1 => bytes.bytes()[at] ^ 1 << random.below(8),
                _ => [0, 1, 0x7f, 0x80, 0xff][random.below(5)],
            };
        }
        if random.below(4) != 0 {
            let total = (length as u32).to_le_bytes();
            bytes.bytes_mut()[8..12].copy_from_slice(&total);
        }
        repair_checksum(bytes.bytes_mut());
        let Ok(blob) = RayBlob::open(bytes.bytes()) else {
            refused += 1;
            continue;
        };
        opened += 1;
        let pixels = [(-0.5, -0.5), (63.5, 47.5), (30.0, 20.0), (1e9, f32::NAN)];
        for camera in 0..blob.camera_count() {
            assert!(blob.camera(camera).is_some());
            for (u, v) in pixels {
                if let Ok(ray) = blob.lookup(camera, PixelPoint::new(u, v)) {
                    assert!(ray.origin_mm.iter().all(|x| x.is_finite()));
                    assert!(ray.direction.iter().all(|x| x.is_finite()));
                }
            }
        }
        let pixel = PixelPoint::new(30.0, 20.0);
        let _ = blob.triangulate_with_covariance((1, pixel), (0, pixel));
        let _ = blob.triangulate_many(&[(0, pixel), (1, pixel), (0, PixelPoint::new(1.0, 1.0))]);
        let _ = blob.run_self_tests();
        for camera in 0..2 {
            let _ = blob.project(camera, [1.0, 2.0, 300.0]);
        }
        let _ = blob
            .epipolar_curve((0, pixel), 1, [100.0, 500.0], 3)
            .map(Iterator::count);
    }
    // Most damage is refused; some (a name, a number of a table) is not damage to the format.
    assert!(opened > 1000 && refused > 10_000, "{opened} {refused}");
}
