//! The bytes of a blob, by the runtime's own schema.

use super::PackError;
use super::table::Table;
use calib_rays::field::{CalibratedCamera, CoverageMask, Rig};
use ray_runtime::format::{
    self, Axis, CameraMeta, HEADER_LEN, Header, IDENTITY_LEN, LengthUnit, Meta, PixelConvention,
    RECORD_LEN, RecordFields, SectionHeader, SelfTest, VERSION, tag,
};
use ray_runtime::{MatchNoise, OpenError};
use serde::Serialize;

/// What stands in a blob besides cameras and grids.
pub struct BlobParts {
    /// See [`Meta`].
    pub identity: [u8; IDENTITY_LEN],
    /// See [`Meta`].
    pub frame: String,
    /// See [`Meta`].
    pub max_error_px: f32,
    /// See [`Meta`].
    pub working_distance_mm: f32,
    /// Questions with their answers.
    pub self_tests: Vec<SelfTest>,
    /// Header and nodes of each pair of cameras whose uncertainty is known, in ascending order.
    pub pairs: Vec<Vec<u8>>,
    /// How noisy matches are, if it is known.
    pub match_noise: Option<MatchNoise>,
    /// What is proven of the arithmetic of integers, if it was asked for.
    pub arithmetic: Option<Vec<u8>>,
}

impl BlobParts {
    /// The blob of these cameras; `tables` in their order.
    ///
    /// # Errors
    /// [`PackError::TooLarge`]; what else may be wrong, `RayBlob::open` finds.
    pub fn encode<'g>(
        &self,
        rig: &Rig,
        tables: impl Iterator<Item = &'g Table>,
    ) -> Result<Vec<u8>, PackError> {
        let cameras: Vec<_> = rig.cameras.iter().zip(tables).collect();
        self.encode_cameras(&cameras)
    }

    /// The blob of these cameras.
    ///
    /// # Errors
    /// As [`encode`](Self::encode).
    pub fn encode_cameras(
        &self,
        cameras: &[(&CalibratedCamera, &Table)],
    ) -> Result<Vec<u8>, PackError> {
        let meta = self.metadata(cameras)?;
        let records_start = format::aligned(HEADER_LEN + meta.len());
        let tables_start = records_start + cameras.len() * RECORD_LEN;

        let (mut records, mut tables) = (Vec::new(), Vec::new());
        for (camera, table) in cameras {
            let grid_offset = tables_start + tables.len();
            tables.extend(&table.bytes);
            pad(&mut tables);
            let mask_offset = tables_start + tables.len();
            push_mask(&mut tables, &camera.coverage);
            pad(&mut tables);
            let record = record(camera, table, length(grid_offset)?, length(mask_offset)?);
            records.extend(record.to_words().iter().flat_map(|word| word.to_le_bytes()));
        }

        for pair in &self.pairs {
            tables.extend(pair);
            pad(&mut tables);
        }
        if let Some(noise) = self.match_noise {
            push_section(&mut tables, tag::MATCH_NOISE, &noise.px().to_le_bytes())?;
        }

        if let Some(content) = &self.arithmetic {
            push_section(&mut tables, tag::ARITHMETIC, content)?;
        }

        let mut header = Header {
            version: VERSION,
            header_len: HEADER_LEN as u16,
            total_len: length(tables_start + tables.len())?,
            crc: 0,
            meta_len: length(meta.len())?,
            // More cameras than the count can say are more than the format allows.
            camera_count: u16::try_from(cameras.len()).unwrap_or(u16::MAX),
            pair_count: u16::try_from(self.pairs.len()).unwrap_or(u16::MAX),
        };
        let mut blob = header.to_bytes().to_vec();
        blob.extend(meta);
        pad(&mut blob);
        blob.extend(records);
        blob.extend(tables);
        header.crc = format::checksum(&blob).ok_or(OpenError::BadHeader)?;
        blob[..HEADER_LEN].copy_from_slice(&header.to_bytes());
        Ok(blob)
    }

    /// The postcard messages, one behind the other.
    fn metadata(&self, cameras: &[(&CalibratedCamera, &Table)]) -> Result<Vec<u8>, PackError> {
        let meta = Meta {
            identity: &self.identity,
            frame: &self.frame,
            written_by: concat!("calib-offline ", env!("CARGO_PKG_VERSION")),
            pixel_convention: PixelConvention::TopLeftPixelCenter,
            length_unit: LengthUnit::Millimeter,
            max_error_px: self.max_error_px,
            working_distance_mm: self.working_distance_mm,
            self_test_count: self.self_tests.len() as u16,
        };
        let mut bytes = message(Vec::new(), &meta)?;
        for (camera, _) in cameras {
            let sensor = camera.field.sensor;
            let camera_meta = CameraMeta {
                name: &camera.name,
                sensor_width: sensor.width,
                sensor_height: sensor.height,
                region_u: 0,
                region_v: 0,
                region_width: sensor.width,
                region_height: sensor.height,
            };
            bytes = message(bytes, &camera_meta)?;
        }
        for test in &self.self_tests {
            bytes = message(bytes, test)?;
        }
        Ok(bytes)
    }
}

/// Appends a postcard message.
fn message(bytes: Vec<u8>, value: &impl Serialize) -> Result<Vec<u8>, PackError> {
    // It fails for types that postcard cannot write; these it can.
    postcard::to_extend(value, bytes).map_err(|_| PackError::Refused(OpenError::BadMeta))
}

fn record(
    camera: &CalibratedCamera,
    table: &Table,
    grid_offset: u32,
    mask_offset: u32,
) -> RecordFields {
    let (sensor, mask) = (camera.field.sensor, &camera.coverage);
    let mask_cells = [mask.cells_u as u32, mask.cells_v as u32];
    let pose = &camera.rig_from_camera;
    RecordFields {
        encoding: table.encoding.number(),
        cells: table.cells,
        mask_cells,
        grid_offset,
        mask_offset,
        axes: [
            Axis::new(0, sensor.width, table.cells[0], mask_cells[0]),
            Axis::new(0, sensor.height, table.cells[1], mask_cells[1]),
        ],
        rotation: std::array::from_fn(|k| pose.rotation[(k / 3, k % 3)] as f32),
        translation_mm: std::array::from_fn(|k| pose.translation_mm[k] as f32),
    }
}

/// One bit per cell, row-major, the lowest bit of a byte first.
fn push_mask(tables: &mut Vec<u8>, mask: &CoverageMask) {
    tables.extend(mask.covered.chunks(8).map(|cells| {
        cells
            .iter()
            .enumerate()
            .fold(0, |byte, (bit, covered)| byte | u8::from(*covered) << bit)
    }));
}

/// A section that readers which do not know it may pass over.
fn push_section(bytes: &mut Vec<u8>, tag: u16, content: &[u8]) -> Result<(), PackError> {
    let header = SectionHeader {
        tag,
        is_required: false,
        length: length(content.len())?,
    };
    bytes.extend(header.to_bytes());
    bytes.extend(content);
    pad(bytes);
    Ok(())
}

fn pad(bytes: &mut Vec<u8>) {
    bytes.resize(format::aligned(bytes.len()), 0);
}

fn length(bytes: usize) -> Result<u32, PackError> {
    u32::try_from(bytes).map_err(|_| PackError::TooLarge { bytes })
}

/// The smallest f32 that is not below `x`, and above zero.
pub fn rounded_up(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) >= x && nearest > 0.0 {
        nearest
    } else {
        nearest.next_up()
    }
}
