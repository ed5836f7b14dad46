//! A stereo blob made by hand from the runtime's schema, and matches on it: small, but with a
//! central and a non-central camera, knots and nodes that no formula gives, and a hole in a mask.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use ray_device::protocol::{Match, Sighting};
use ray_runtime::format::{
    ALIGNMENT, Axis, CRC_OFFSET, CameraMeta, Encoding, Form, HEADER_LEN, Header, LengthUnit, Meta,
    NODE_LEN, PairHeader, PixelConvention, RECORD_LEN, RecordFields, VERSION, aligned, checksum,
    mask_len,
};

use serde::Serialize;

/// Identity of the blob.
pub const IDENTITY: [u8; 16] = *b"hand-made stereo";
/// Name, width and height of its cameras.
pub const CAMERAS: [(&str, u32, u32); 2] = [("left", 640, 480), ("right", 600, 500)];

const CELLS: [u32; 2] = [8, 6];
const MASK_CELLS: [u32; 2] = [16, 12];
const ENCODINGS: [Encoding; 2] = [spline(true), spline(false)];

const fn spline(is_central: bool) -> Encoding {
    Encoding {
        form: Form::Spline,
        is_central,
    }
}

/// The blob's bytes.
pub fn blob() -> Vec<u8> {
    blob_of(IDENTITY)
}

/// The same rig under another identity.
pub fn blob_of(identity: [u8; 16]) -> Vec<u8> {
    let mut meta = encoded(&Meta {
        identity: &identity,
        frame: "rig",
        written_by: "a test",
        pixel_convention: PixelConvention::TopLeftPixelCenter,
        length_unit: LengthUnit::Millimeter,
        max_error_px: 0.001,
        working_distance_mm: 500.0,
        self_test_count: 0,
    });
    for (name, sensor_width, sensor_height) in CAMERAS {
        let camera = CameraMeta {
            name,
            sensor_width,
            sensor_height,
            region_u: 0,
            region_v: 0,
            region_width: sensor_width,
            region_height: sensor_height,
        };
        meta.extend(encoded(&camera));
    }
    let records_start = aligned(HEADER_LEN + meta.len());
    let tables_start = records_start + CAMERAS.len() * RECORD_LEN;

    let mut records = Vec::new();
    let mut tables = Vec::new();
    for (camera, encoding) in ENCODINGS.into_iter().enumerate() {
        let grid_offset = tables_start + tables.len();
        tables.extend(grid(camera, encoding));
        tables.resize(aligned(tables.len()), 0);
        let mask_offset = tables_start + tables.len();
        tables.extend(mask(camera));
        tables.resize(aligned(tables.len()), 0);
        let (_, width, height) = CAMERAS[camera];
        let record = RecordFields {
            encoding: encoding.number(),
            cells: CELLS,
            mask_cells: MASK_CELLS,
            grid_offset: grid_offset as u32,
            mask_offset: mask_offset as u32,
            axes: [
                Axis::new(0, width, CELLS[0], MASK_CELLS[0]),
                Axis::new(0, height, CELLS[1], MASK_CELLS[1]),
            ],
            rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            translation_mm: [if camera == 0 { -60.0 } else { 60.0 }, 0.0, 0.0],
        };
        records.extend(record.to_words().iter().flat_map(|word| word.to_le_bytes()));
    }

    tables.extend(pair());
    tables.resize(aligned(tables.len()), 0);

    let header = Header {
        version: VERSION,
        header_len: HEADER_LEN as u16,
        total_len: (tables_start + tables.len()) as u32,
        crc: 0,
        meta_len: meta.len() as u32,
        camera_count: CAMERAS.len() as u16,
        pair_count: 1,
    };
    let mut blob = header.to_bytes().to_vec();
    blob.extend(meta);
    blob.resize(records_start, 0);
    blob.extend(records);
    blob.extend(tables);
    let crc = checksum(&blob).unwrap().to_le_bytes();
    blob[CRC_OFFSET..CRC_OFFSET + 4].copy_from_slice(&crc);
    assert_eq!(blob.len() % ALIGNMENT, 0);
    blob
}

fn encoded(message: &impl Serialize) -> Vec<u8> {
    postcard::to_slice(message, &mut [0; 256]).unwrap().to_vec()
}

/// Half-angle vectors that look about 35 degrees to each side and, between the knots, anywhere.
fn grid(camera: usize, encoding: Encoding) -> Vec<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(camera as u64);
    let mut bytes = Vec::new();
    for row in 0..CELLS[1] + 3 {
        for col in 0..CELLS[0] + 3 {
            let mut from_center = |index: u32, cells: u32| {
                0.06 * (index as f32 - (cells + 2) as f32 / 2.0)
                    + random.random_range(-0.004..0.004_f32)
            };
            let mut knot = vec![from_center(col, CELLS[0]), from_center(row, CELLS[1])];
            while knot.len() < encoding.channels() {
                knot.push(random.random_range(-0.1..0.1));
            }
            bytes.extend(knot.iter().flat_map(|number| number.to_le_bytes()));
        }
    }
    bytes
}

/// The uncertainty of the two cameras: any bytes at all are nodes.
fn pair() -> Vec<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let header = PairHeader {
        cameras: [0, 1],
        nodes: [5, 4],
        first_px: [20.25, -0.5],
        nodes_per_px: [1.0 / 150.0, 1.0 / 160.0],
        step_px: 3e-5,
        noise_px2: 0.0025,
    };
    let mut nodes = vec![0; 5 * 4 * NODE_LEN];
    random.fill(&mut nodes[..]);
    [&header.to_bytes()[..], &nodes].concat()
}

/// Everything calibrated, but for the first 8 mask cells of the left camera.
fn mask(camera: usize) -> Vec<u8> {
    let mut bytes = vec![0xff; mask_len(MASK_CELLS)];
    if camera == 0 {
        bytes[0] = 0;
    }
    bytes
}

/// Matches all over both sensors and a little beyond, so that points and every kind of refusal
/// occur; among them a camera that does not exist and pixels that are not numbers.
pub fn matches(count: usize, seed: u64) -> Vec<Match> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count as u32)
        .map(|id| {
            let u_px = random.random_range(-10.0..650.0_f32);
            let v_px = random.random_range(-10.0..490.0_f32);
            let first = Sighting {
                camera: 0,
                u_px,
                v_px,
            };
            let u_px = u_px + random.random_range(-200.0..40.0);
            let v_px = v_px + random.random_range(-2.0..2.0);
            let second = Sighting {
                camera: 1,
                u_px,
                v_px,
            };
            match id % 50 {
                47 => Match {
                    id,
                    first: Sighting {
                        u_px: f32::NAN,
                        ..first
                    },
                    second,
                },
                48 => Match {
                    id,
                    first,
                    second: Sighting {
                        camera: 7,
                        ..second
                    },
                },
                49 => Match {
                    id,
                    first,
                    second: first,
                },
                _ => Match { id, first, second },
            }
        })
        .collect()
}
