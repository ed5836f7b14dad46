//! Sections of a blob: what is known is used, what is not known is passed over unless it must be understood, and
//! what is no section is refused.

use crate::test_blob::{AlignedBytes, TestBlob, TestCamera, TestPair, encoding, repair_checksum};
use ray_runtime::format::{Form, MAX_SECTIONS, SECTION_HEADER_LEN, SectionHeader, tag};
use ray_runtime::{MatchNoise, OpenError, PixelPoint, RayBlob};
use split_mix::SplitMix;

const NOISE_PX: f32 = 0.375;

fn section(tag: u16, is_required: bool, content: &[u8]) -> (SectionHeader, Vec<u8>) {
    let header = SectionHeader {
        tag,
        is_required,
        length: content.len() as u32,
    };
    (header, content.to_vec())
}

fn noise() -> (SectionHeader, Vec<u8>) {
    section(tag::MATCH_NOISE, false, &NOISE_PX.to_le_bytes())
}

/// Two cameras, their uncertainty, and these sections.
fn blob_with(sections: &[(SectionHeader, Vec<u8>)]) -> AlignedBytes {
    let mut cameras = vec![
        TestCamera::new("first", -80.0),
        TestCamera::new("second", 80.0),
    ];
    for camera in &mut cameras {
        camera.encoding = encoding(Form::Patches, true);
    }
    let mut blob = TestBlob::new(cameras);
    blob.pairs = vec![TestPair::new([0, 1])];
    blob.sections = sections.to_vec();
    blob.bytes()
}

fn refused(sections: &[(SectionHeader, Vec<u8>)]) -> Option<OpenError> {
    RayBlob::open(blob_with(sections).bytes()).err()
}

const MATCH: [(usize, PixelPoint); 2] = [
    (0, PixelPoint { u: 34.0, v: 20.0 }),
    (1, PixelPoint { u: 24.0, v: 20.5 }),
];

#[test]
fn the_noise_of_matches_takes_the_place_of_the_corners() {
    let plain = blob_with(&[]);
    let noisy = blob_with(&[noise()]);
    let [plain, noisy] = [&plain, &noisy].map(|bytes| RayBlob::open(bytes.bytes()).unwrap());
    assert_eq!(plain.match_noise(), None);
    let stated = MatchNoise::from_px(NOISE_PX).unwrap();
    assert_eq!(noisy.match_noise(), Some(stated));
    let [a, b] = MATCH;
    let corners = plain.triangulate_with_covariance(a, b).unwrap();
    let matches = noisy.triangulate_with_covariance(a, b).unwrap();
    assert_eq!(corners.found, matches.found);
    let (corners, matches) = (corners.covariance.unwrap(), matches.covariance.unwrap());
    assert_eq!(corners.calibration_mm2, matches.calibration_mm2);
    // The corners are off by 0.1 px; both squares are rounded once.
    let times = matches.noise_mm2[2][2] / corners.noise_mm2[2][2];
    assert!((times / 14.0625 - 1.0).abs() < 1e-6, "{times}");
    // What a request says counts, whatever the blob says.
    for blob in [&plain, &noisy] {
        let asked = blob.triangulate_with_noise(a, b, stated).unwrap();
        assert_eq!(asked.covariance, Some(matches));
        let none = blob.triangulate_with_noise(a, b, MatchNoise::NONE).unwrap();
        let none = none.covariance.unwrap();
        assert_eq!(none.total_mm2(), corners.calibration_mm2);
        let [of_matches, of_corners] = [matches, corners].map(|c| c.gap_mm2 - none.gap_mm2);
        // Differences of numbers a few times as large.
        assert!((of_matches / of_corners / 14.0625 - 1.0).abs() < 1e-4);
    }
}

#[test]
fn what_is_not_known_is_passed_over_unless_it_must_be_understood() {
    let unknown = |tag, is_required| section(tag, is_required, b"anything");
    for tag in [
        tag::MANIFEST,
        tag::CONDITIONS,
        77,
        tag::FIRST_PRIVATE,
        u16::MAX,
    ] {
        let bytes = blob_with(&[noise(), unknown(tag, false)]);
        let blob = RayBlob::open(bytes.bytes()).unwrap();
        assert_eq!(blob.match_noise(), MatchNoise::from_px(NOISE_PX));
        assert_eq!(
            refused(&[noise(), unknown(tag, true)]),
            Some(OpenError::UnknownSection { tag })
        );
    }
    // Nothing to be said, and much; what is known may be required.
    assert_eq!(refused(&[section(9, false, &[])]), None);
    assert_eq!(refused(&[section(9, false, &[0xff; 1001])]), None);
    let (header, content) = noise();
    let required = SectionHeader {
        is_required: true,
        ..header
    };
    assert_eq!(refused(&[(required, content)]), None);
}

#[test]
fn what_is_out_of_order_is_refused() {
    let bad = |section| Some(OpenError::BadSection { section });
    let of = |tags: &[u16]| {
        let sections: Vec<_> = tags.iter().map(|tag| section(*tag, false, b"x")).collect();
        refused(&sections)
    };
    assert_eq!(of(&[2, 3, 9]), None);
    assert_eq!(of(&[2, 2]), bad(1));
    assert_eq!(of(&[2, 9, 3]), bad(2));
    assert_eq!(of(&[0]), bad(0));
    assert_eq!(refused(&[noise(), noise()]), bad(1));
    let many: Vec<u16> = (100..100 + MAX_SECTIONS).collect();
    assert_eq!(of(&many), None);
    let too_many: Vec<u16> = (100..=100 + MAX_SECTIONS).collect();
    assert_eq!(of(&too_many), bad(MAX_SECTIONS));
}

#[test]
fn what_is_cut_short_or_reaches_too_far_is_refused() {
    let bad = |section| Some(OpenError::BadSection { section });
    let with_length = |length| {
        let (header, content) = section(9, false, &[0; 16]);
        let first = SectionHeader { length, ..header };
        refused(&[(first, content), section(10, false, b"y")])
    };
    assert_eq!(with_length(16), None);
    // To the end of the blob and beyond it; over the next header, whose bytes then are no padding; and less
    // than there is, after which zeros would be a header.
    assert_eq!(with_length(32), None);
    assert_eq!(with_length(33), bad(0));
    assert_eq!(with_length(u32::MAX), bad(0));
    assert!(matches!(
        with_length(20),
        Some(OpenError::BadPadding { .. })
    ));
    assert_eq!(with_length(8), bad(1));
    // Half a header cannot be: a blob's length is a multiple of 8.
    let bytes = blob_with(&[noise()]);
    let start = bytes.bytes().len() - 2 * SECTION_HEADER_LEN;
    for (at, value) in [(2, 2), (2, 3), (3, 1), (4, 3), (4, 5), (5, 1)] {
        let mut bytes = AlignedBytes::new(bytes.bytes());
        bytes.bytes_mut()[start + at] = value;
        repair_checksum(bytes.bytes_mut());
        let error = RayBlob::open(bytes.bytes()).err();
        assert!(
            error == bad(0) || matches!(error, Some(OpenError::BadPadding { .. })),
            "byte {at} = {value}: {error:?}"
        );
    }
    let mut bytes = AlignedBytes::new(bytes.bytes());
    *bytes.bytes_mut().last_mut().unwrap() = 1;
    repair_checksum(bytes.bytes_mut());
    let error = RayBlob::open(bytes.bytes()).err();
    let at = bytes.bytes().len() as u32 - 4;
    assert_eq!(error, Some(OpenError::BadPadding { at }));
}

#[test]
fn what_is_known_and_wrong_is_refused() {
    let bad = Some(OpenError::BadSection { section: 0 });
    for px in [-0.1, 1e-7, 1000.5, f32::NAN, f32::INFINITY] {
        let content = px.to_le_bytes();
        assert_eq!(refused(&[section(tag::MATCH_NOISE, false, &content)]), bad);
    }
    for content in [&[][..], &[0; 3], &[0; 5], &[0; 8]] {
        assert_eq!(refused(&[section(tag::MATCH_NOISE, false, content)]), bad);
    }
}

#[test]
fn earlier_versions_have_no_sections() {
    for version in [2, 3] {
        let with_version = |sections: &[(SectionHeader, Vec<u8>)]| {
            let mut blob = TestBlob::new(vec![TestCamera::new("one", 0.0)]);
            blob.sections = sections.to_vec();
            let mut bytes = blob.bytes();
            bytes.bytes_mut()[4] = version;
            repair_checksum(bytes.bytes_mut());
            RayBlob::open(bytes.bytes()).err()
        };
        assert_eq!(with_version(&[]), None);
        assert_eq!(with_version(&[noise()]), Some(OpenError::BadHeader));
    }
}

#[test]
fn damage_to_sections_with_a_right_checksum_never_panics() {
    let whole = blob_with(&[
        noise(),
        section(9, false, b"skip me"),
        section(0x9000, false, b"mine"),
    ]);
    let length = whole.bytes().len();
    let mut random = SplitMix(4);
    let (mut opened, mut refused) = (0, 0);
    for _ in 0..50_000 {
        let mut bytes = AlignedBytes::new(whole.bytes());
        for _ in 0..=random.below(3) {
            let at = length - 1 - random.below(48);
            bytes.bytes_mut()[at] = random.next() as u8;
        }
        repair_checksum(bytes.bytes_mut());
        match RayBlob::open(bytes.bytes()) {
            Ok(blob) => {
                opened += 1;
                let measured = blob
                    .triangulate_with_covariance(MATCH[0], MATCH[1])
                    .unwrap();
                let sigma_mm = measured.covariance.unwrap().sigma_mm();
                assert!(sigma_mm.iter().all(|sigma| sigma.is_finite()));
            }
            Err(error) => {
                refused += 1;
                let fits = matches!(
                    error,
                    OpenError::BadSection { .. }
                        | OpenError::UnknownSection { .. }
                        | OpenError::BadPadding { .. }
                );
                assert!(fits, "{error:?}");
            }
        }
    }
    assert!(opened > 1000 && refused > 10_000, "{opened} {refused}");
}
