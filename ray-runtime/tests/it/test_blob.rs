//! Blobs made by hand from the schema, so that they can also be made wrong.

use ray_runtime::format::{
    self, Axis, CameraMeta, Encoding, Form, HEADER_LEN, Header, LengthUnit, Meta, PLACES_PER_CELL,
    PairHeader, PixelConvention, QuantizedHeader, QuantizedMap, RECORD_LEN, RecordFields,
    SectionHeader, SelfTest, UNITS_PER_STEP, VERSION,
};

/// Bytes that start on a multiple of 8.
pub struct AlignedBytes {
    words: Vec<u64>,
    start: usize,
    len: usize,
}

impl AlignedBytes {
    pub fn new(bytes: &[u8]) -> Self {
        Self::shifted(bytes, 0)
    }

    /// Bytes that start `shift` after a multiple of 8.
    pub fn shifted(bytes: &[u8], shift: usize) -> Self {
        let mut words = vec![0u64; (bytes.len() + shift).div_ceil(8) + 1];
        let all: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
        all[shift..shift + bytes.len()].copy_from_slice(bytes);
        Self {
            words,
            start: shift,
            len: bytes.len(),
        }
    }

    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[self.start..self.start + self.len]
    }

    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[self.start..self.start + self.len]
    }
}

pub const fn encoding(form: Form, is_central: bool) -> Encoding {
    Encoding { form, is_central }
}

/// A camera whose half-angle vector is linear in the pixel: every form reproduces it.
#[derive(Clone)]
pub struct TestCamera {
    pub name: &'static str,
    pub sensor: [u32; 2],
    /// First column and row, columns and rows.
    pub region: [u32; 4],
    pub cells: [u32; 2],
    pub mask_cells: [u32; 2],
    pub mask: Vec<bool>,
    pub encoding: Encoding,
    /// The half-angle vector is the pixel's offset from the sensor's center divided by this.
    pub focal_px: f32,
    /// Scaled offset, the same for every pixel, mm.
    pub offset_mm: [f32; 2],
    pub rotation: [f32; 9],
    pub translation_mm: [f32; 3],
}

pub const IDENTITY: [f32; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// What quantized knots hold of the slope along v.
const KNOTS_SHARE: f64 = 1.0 / 16.0;

impl TestCamera {
    pub fn new(name: &'static str, x_mm: f32) -> Self {
        Self {
            name,
            sensor: [64, 48],
            region: [0, 0, 64, 48],
            cells: [3, 2],
            mask_cells: [4, 3],
            mask: vec![true; 12],
            encoding: encoding(Form::Spline, true),
            focal_px: 50.0,
            offset_mm: [0.0; 2],
            rotation: IDENTITY,
            translation_mm: [x_mm, 0.0, 0.0],
        }
    }

    fn meta(&self) -> CameraMeta<'_> {
        let [region_u, region_v, region_width, region_height] = self.region;
        CameraMeta {
            name: self.name,
            sensor_width: self.sensor[0],
            sensor_height: self.sensor[1],
            region_u,
            region_v,
            region_width,
            region_height,
        }
    }

    /// Half-angle vector at a pixel.
    pub fn s(&self, u: f32, v: f32) -> [f32; 2] {
        let center = |extent: u32| extent as f32 / 2.0 - 0.5;
        [
            (u - center(self.sensor[0])) / self.focal_px,
            (v - center(self.sensor[1])) / self.focal_px,
        ]
    }

    /// Half-angle vector, and the offset if there is one, at a pixel of the region.
    fn numbers(&self, u: f32, v: f32) -> Vec<f32> {
        let [s1, s2] = self.s(u, v);
        let numbers = [s1, s2, self.offset_mm[0], self.offset_mm[1]];
        numbers[..self.encoding.channels()].to_vec()
    }

    /// Outer edge of cell `i` along an axis, px.
    fn edge(&self, axis: usize, i: f32) -> f32 {
        let (first, extent) = (self.region[axis] as f32, self.region[axis + 2] as f32);
        first - 0.5 + i * extent / self.cells[axis] as f32
    }

    /// Where a lookup finds this share of cell `i`, px.
    fn at_share(&self, axis: usize, i: u32, share: f32) -> f32 {
        let (first, extent) = (self.region[axis], self.region[axis + 2]);
        let numbers = Axis::new(first, extent, self.cells[axis], self.mask_cells[axis]);
        numbers.min_px + i as f32 * numbers.cell_high_px + share / numbers.cells_per_px
    }

    fn table(&self) -> Vec<u8> {
        let f32_bytes = |numbers: Vec<f32>| numbers.into_iter().flat_map(f32::to_le_bytes);
        let [cells_u, cells_v] = self.cells;
        let mut bytes = Vec::new();
        match self.encoding.form {
            // A B-spline whose knots hold a linear function is that linear function.
            Form::Spline => {
                for j in 0..cells_v + 3 {
                    for i in 0..cells_u + 3 {
                        let (u, v) = (self.edge(0, i as f32 - 1.0), self.edge(1, j as f32 - 1.0));
                        bytes.extend(f32_bytes(self.numbers(u, v)));
                    }
                }
            }
            Form::Patches => {
                for j in 0..cells_v {
                    for i in 0..cells_u {
                        let at = |x: f32, y: f32| {
                            self.numbers(self.at_share(0, i, x), self.at_share(1, j, y))
                        };
                        let (zero, by_x, by_y) = (at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0));
                        for k in (0..zero.len()).step_by(2) {
                            let mut cubic = [[0.0; 2]; 10];
                            for c in 0..2 {
                                cubic[5][c] = by_y[k + c] - zero[k + c];
                                cubic[8][c] = by_x[k + c] - zero[k + c];
                                cubic[9][c] = zero[k + c];
                            }
                            bytes.extend(f32_bytes(cubic.concat()));
                        }
                    }
                }
            }
            Form::Quantized => bytes = self.quantized_table(),
        }
        bytes
    }

    /// Knots of a 16th of the slope along v, in whole steps; the polynomial has the rest of it, and all
    /// of that along u.
    fn quantized_table(&self) -> Vec<u8> {
        const STEPS_PER_ROW: i16 = 1024;
        let f32_bytes = |numbers: Vec<f32>| numbers.into_iter().flat_map(f32::to_le_bytes);
        let [first_u, first_v, width, height] = self.region;
        let [cells_u, cells_v] = self.cells;
        let is_central = self.encoding.is_central;
        let map = |degree, number_len, step: f64| QuantizedMap {
            degree,
            number_len,
            unit: (step / f64::from(UNITS_PER_STEP)) as f32,
        };
        let focal_px = f64::from(self.focal_px);
        // Of a cell, in units of the half-angle vector.
        let by_knots = KNOTS_SHARE * f64::from(height) / f64::from(cells_v) / focal_px;
        let direction = map(1, 2, by_knots / f64::from(STEPS_PER_ROW));
        let offset = (!is_central).then_some(map(0, 1, 0.25));
        let header = QuantizedHeader::new(direction, offset, [width, height], self.cells);
        let layout = header.layout(self.cells);

        // Places are rounded down, by half of one on average.
        let by_place = by_knots / f64::from(PLACES_PER_CELL);
        let by_px = by_place * f64::from(header.places_per_px[1]);
        let slope_u = f64::from(width) / 2.0 / focal_px;
        let slope_v = f64::from(height) / 2.0 * (1.0 / focal_px - by_px);
        let [s1, s2] = self
            .s(first_u as f32 - 0.5, first_v as f32 - 0.5)
            .map(f64::from);
        let zero = [s1 + slope_u, s2 + slope_v + 0.5 * by_place];
        let mut bytes = header.to_bytes().to_vec();
        let linear = [0.0, slope_v, slope_u, 0.0, zero[0], zero[1]];
        bytes.extend(f32_bytes(linear.map(|x| x as f32).to_vec()));
        if !is_central {
            bytes.extend(f32_bytes(vec![self.offset_mm[0], self.offset_mm[1] - 1.0]));
        }
        for j in 0..cells_v as i16 + 3 {
            let knot = [0, STEPS_PER_ROW * (j - 1)];
            let row = knot.map(i16::to_le_bytes).concat();
            bytes.extend(row.repeat(cells_u as usize + 3));
        }
        if !is_central {
            bytes.resize(layout.offset_knots, 0);
            bytes.extend([0, 4].repeat(((cells_u + 3) * (cells_v + 3)) as usize));
        }
        bytes
    }

    /// By how much a lookup may miss the half-angle vector.
    pub fn round_off(&self) -> f32 {
        // |s| is below 0.8: four roundings of 6e-8.
        let of_numbers = 2.5e-7;
        match self.encoding.form {
            Form::Spline | Form::Patches => of_numbers,
            // The slope of the knots, by half a place. (Their rows are weighed without the last binary
            // digits: 4 of 36864 units to a step, of which the knots here have 1024 to a row.)
            Form::Quantized => {
                let cell_px = self.region[3] as f32 / self.cells[1] as f32;
                let half_place_px = 0.5 * cell_px / PLACES_PER_CELL as f32;
                of_numbers + KNOTS_SHARE as f32 * half_place_px / self.focal_px
            }
        }
    }

    fn mask_bytes(&self) -> Vec<u8> {
        let mut bytes = vec![0; format::mask_len(self.mask_cells)];
        for (k, _) in self.mask.iter().enumerate().filter(|(_, set)| **set) {
            bytes[k / 8] |= 1 << (k % 8);
        }
        bytes
    }
}

/// The uncertainty of a pair, the same at every node.
#[derive(Clone)]
pub struct TestPair {
    pub header: PairHeader,
    /// Scale and the ten numbers of the lower triangle.
    pub node: [u8; format::NODE_LEN],
}

impl TestPair {
    /// 3 x 2 nodes over a sensor of 64 x 48 px; steps of 0.001 px, noise of 0.1 px.
    pub fn new(cameras: [u16; 2]) -> Self {
        Self {
            header: PairHeader {
                cameras,
                nodes: [3, 2],
                first_px: [-0.5, -0.5],
                nodes_per_px: [2.0 / 64.0, 1.0 / 48.0],
                step_px: 0.001,
                noise_px2: 0.01,
            },
            node: [2, 50, 0, 50, 20, 0, 30, 0, 0xf6, 5, 40],
        }
    }

    fn bytes(&self) -> Vec<u8> {
        let [nodes_u, nodes_v] = self.header.nodes;
        let mut bytes = self.header.to_bytes().to_vec();
        bytes.extend(
            self.node
                .repeat(usize::from(nodes_u) * usize::from(nodes_v)),
        );
        bytes
    }
}

/// The parts of a blob, each of which a test may spoil.
pub struct TestBlob {
    pub cameras: Vec<TestCamera>,
    pub pairs: Vec<TestPair>,
    /// Sections with their contents, behind each of which zeros are added.
    pub sections: Vec<(SectionHeader, Vec<u8>)>,
    pub max_error_px: f32,
    pub identity: Vec<u8>,
    pub self_tests: Vec<SelfTest>,
}

impl TestBlob {
    pub fn new(cameras: Vec<TestCamera>) -> Self {
        Self {
            cameras,
            pairs: Vec::new(),
            sections: Vec::new(),
            max_error_px: 0.001,
            identity: (0..16).collect(),
            self_tests: Vec::new(),
        }
    }

    pub fn bytes(&self) -> AlignedBytes {
        let meta = Meta {
            identity: &self.identity,
            frame: "test",
            written_by: "hand",
            pixel_convention: PixelConvention::TopLeftPixelCenter,
            length_unit: LengthUnit::Millimeter,
            max_error_px: self.max_error_px,
            working_distance_mm: 500.0,
            self_test_count: self.self_tests.len() as u16,
        };
        let mut metadata: Vec<u8> = postcard::to_extend(&meta, Vec::new()).unwrap();
        for camera in &self.cameras {
            metadata = postcard::to_extend(&camera.meta(), metadata).unwrap();
        }
        for test in &self.self_tests {
            metadata = postcard::to_extend(test, metadata).unwrap();
        }
        let records_start = format::aligned(HEADER_LEN + metadata.len());
        let tables_start = records_start + self.cameras.len() * RECORD_LEN;
        let (mut records, mut tables) = (Vec::new(), Vec::new());
        for camera in &self.cameras {
            let grid_offset = (tables_start + tables.len()) as u32;
            tables.extend(camera.table());
            pad(&mut tables);
            let mask_offset = (tables_start + tables.len()) as u32;
            tables.extend(camera.mask_bytes());
            pad(&mut tables);
            let fields = RecordFields {
                encoding: camera.encoding.number(),
                cells: camera.cells,
                mask_cells: camera.mask_cells,
                grid_offset,
                mask_offset,
                axes: [0, 1].map(|k| {
                    Axis::new(
                        camera.region[k],
                        camera.region[k + 2],
                        camera.cells[k],
                        camera.mask_cells[k],
                    )
                }),
                rotation: camera.rotation,
                translation_mm: camera.translation_mm,
            };
            records.extend(fields.to_words().iter().flat_map(|w| w.to_le_bytes()));
        }
        for pair in &self.pairs {
            tables.extend(pair.bytes());
            pad(&mut tables);
        }
        for (header, content) in &self.sections {
            tables.extend(header.to_bytes());
            tables.extend(content);
            pad(&mut tables);
        }
        let header = Header {
            version: VERSION,
            header_len: HEADER_LEN as u16,
            total_len: (tables_start + tables.len()) as u32,
            crc: 0,
            meta_len: metadata.len() as u32,
            camera_count: self.cameras.len() as u16,
            pair_count: self.pairs.len() as u16,
        };
        let mut blob = header.to_bytes().to_vec();
        blob.extend(metadata);
        pad(&mut blob);
        blob.extend(records);
        blob.extend(tables);
        repair_checksum(&mut blob);
        AlignedBytes::new(&blob)
    }
}

fn pad(bytes: &mut Vec<u8>) {
    bytes.resize(format::aligned(bytes.len()), 0);
}

/// Makes the checksum fit what the bytes are.
pub fn repair_checksum(blob: &mut [u8]) {
    if let Some(crc) = format::checksum(blob) {
        blob[12..16].copy_from_slice(&crc.to_le_bytes());
    }
}

/// Where the records start, read from the header.
pub fn records_start(blob: &[u8]) -> usize {
    let (_, header) = Header::read(blob).unwrap();
    format::aligned(HEADER_LEN + header.meta_len as usize)
}
