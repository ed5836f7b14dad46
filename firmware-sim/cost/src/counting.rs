//! What the counting image is asked and what it answers: the one definition that the image and
//! `firmware-sim cost` share.
//!
//! The host puts a blob at the start of the flash and a [`Job`] behind it. The image runs every
//! [`Probe`] on every match of the job and writes a [`Record`] for each run to its standard output.
//!
//! A new row of the table is a new [`Probe`] here, a function that does it in
//! `probes.rs`, and a line in `WORK` of `count.rs`.

use ray_runtime::PixelPoint;

use crate::yardstick::{BilinearTable, Brown};

/// A piece of work that is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Probe {
    /// A call that does nothing: what the counting itself costs.
    Nothing = 0,
    /// A call that runs [`KNOWN_INSTRUCTIONS`] instructions: the check of the counting.
    Known,
    /// `RayBlob::open`.
    Open,
    /// The checksum of the blob, which is part of opening it.
    Checksum,
    /// `RayBlob::lookup` in the first camera of the match.
    LookupFirst,
    /// `RayBlob::lookup` in the second camera of the match.
    LookupSecond,
    /// `RayBlob::triangulate`.
    Triangulate,
    /// `RayBlob::triangulate_with_covariance`.
    Covariance,
    /// Yardstick: four channels of a bilinear table at the pixel of the first camera.
    BilinearLookup,
    /// Yardstick: two bilinear tables, and the runtime's midpoint.
    BilinearTriangulate,
    /// Yardstick: the ideal image point of the pixel of the first camera by Brown's model.
    BrownUndistortion,
    /// Yardstick: two cameras of Brown's model, and the runtime's midpoint.
    BrownTriangulate,
    /// `RayBlob::lookup_row` of [`ROW_LEN`] pixels, the one of the match among them, in the first camera.
    RowFirst,
    /// The same in the second camera.
    RowSecond,
    /// `integer::Rig::prepare`.
    IntegerPrepare,
    /// `integer::Rig::lookup_fixed` in the first camera of the match.
    IntegerLookupFixedFirst,
    /// The same in the second camera.
    IntegerLookupFixedSecond,
    /// `integer::Rig::lookup`, the same from f32 to f32, in the first camera.
    IntegerLookupFirst,
    /// The same in the second camera.
    IntegerLookupSecond,
    /// `integer::Rig::triangulate_fixed`.
    IntegerTriangulateFixed,
    /// `integer::Rig::triangulate`, the same from f32 to f32.
    IntegerTriangulate,
}

/// Pixels of a row.
pub const ROW_LEN: usize = 64;

/// What [`Probe::Known`] runs.
pub const KNOWN_INSTRUCTIONS: u32 = 100;

impl Probe {
    /// All of them.
    pub const ALL: [Self; 21] = [
        Self::Nothing,
        Self::Known,
        Self::Open,
        Self::Checksum,
        Self::LookupFirst,
        Self::LookupSecond,
        Self::Triangulate,
        Self::Covariance,
        Self::BilinearLookup,
        Self::BilinearTriangulate,
        Self::BrownUndistortion,
        Self::BrownTriangulate,
        Self::RowFirst,
        Self::RowSecond,
        Self::IntegerPrepare,
        Self::IntegerLookupFixedFirst,
        Self::IntegerLookupFixedSecond,
        Self::IntegerLookupFirst,
        Self::IntegerLookupSecond,
        Self::IntegerTriangulateFixed,
        Self::IntegerTriangulate,
    ];

    /// Whether it depends on the pixels, and is run for every match. The others are run once.
    pub const fn is_per_match(self) -> bool {
        !matches!(
            self,
            Self::Nothing | Self::Known | Self::Open | Self::Checksum | Self::IntegerPrepare
        )
    }
}

/// One run of a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record {
    /// Number of the [`Probe`].
    pub probe: u32,
    /// Which match, from 0.
    pub match_idx: u32,
    /// Whether the work came to a result: 1, or 0 for an error.
    pub answered: u32,
    /// Ticks of the counter between the two looks at it, or [`WRAPPED`].
    pub ticks: u32,
    /// Bytes of stack below the caller's frame.
    pub stack_bytes: u32,
}

/// In place of ticks: the counter has gone round.
pub const WRAPPED: u32 = u32::MAX;

/// Length of a [`Record`], bytes.
pub const RECORD_LEN: usize = 20;

impl Record {
    /// Five little-endian words.
    pub fn to_bytes(self) -> [u8; RECORD_LEN] {
        let words = [
            self.probe,
            self.match_idx,
            self.answered,
            self.ticks,
            self.stack_bytes,
        ];
        let mut bytes = [0; RECORD_LEN];
        for (place, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(words) {
            *place = word.to_le_bytes();
        }
        bytes
    }

    /// The reverse of [`Record::to_bytes`].
    pub fn from_bytes(bytes: &[u8; RECORD_LEN]) -> Self {
        let word = |k: usize| {
            let chunk = bytes.as_chunks::<4>().0.get(k);
            u32::from_le_bytes(chunk.copied().unwrap_or_default())
        };
        Self {
            probe: word(0),
            match_idx: word(1),
            answered: word(2),
            ticks: word(3),
            stack_bytes: word(4),
        }
    }
}

/// Two pixels that see the same point, in the first and the second camera of a job.
pub type PixelPair = [PixelPoint; 2];

/// What a job asks, borrowed from the flash.
///
/// In the flash everything is an `f32`, counts too, in the order in which
/// [`Job::to_bytes`] writes it.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    /// The two cameras of the matches.
    pub cameras: [usize; 2],
    /// u, v in the first camera and in the second, px.
    pub matches: &'a [[f32; 4]],
    /// Yardstick of each camera.
    pub tables: [BilinearTable<'a>; 2],
    /// Yardstick of each camera.
    pub browns: [Brown; 2],
}

/// First number of a job: no blob, no remains of one.
const MAGIC: f32 = 20_071.0;
const BROWN_LEN: usize = 21;
const TABLE_LEN: usize = 7;
const HEAD_LEN: usize = 4 + 2 * (BROWN_LEN + TABLE_LEN);

/// The first byte of a job behind a blob of this length.
pub const fn job_start(blob_len: usize) -> usize {
    blob_len.next_multiple_of(16)
}

impl<'a> Job<'a> {
    /// The job at the start of these numbers; `None` if there is none or not all of it.
    pub fn read(numbers: &'a [f32]) -> Option<Self> {
        let (head, rest) = numbers.split_first_chunk::<HEAD_LEN>()?;
        let ([magic, first, second, match_count], head) = head.split_first_chunk::<4>()?;
        let (brown_first, head) = head.split_first_chunk::<BROWN_LEN>()?;
        let (brown_second, head) = head.split_first_chunk::<BROWN_LEN>()?;
        let (table_first, head) = head.split_first_chunk::<TABLE_LEN>()?;
        let (table_second, _) = head.split_first_chunk::<TABLE_LEN>()?;
        if *magic != MAGIC {
            return None;
        }
        let rest = rest.as_chunks::<4>().0;
        let (matches, rest) = rest.split_at_checked(*match_count as usize)?;
        let (table_first, rest) = read_table(table_first, rest)?;
        let (table_second, _) = read_table(table_second, rest)?;
        Some(Self {
            cameras: [*first as usize, *second as usize],
            matches,
            tables: [table_first, table_second],
            browns: [read_brown(brown_first), read_brown(brown_second)],
        })
    }

    /// What stands in the flash: head, matches, nodes of the two tables.
    #[cfg(feature = "std")]
    pub fn to_bytes(&self) -> std::vec::Vec<u8> {
        let [first, second] = self.cameras;
        let mut numbers = vec![
            MAGIC,
            first as f32,
            second as f32,
            self.matches.len() as f32,
        ];
        for brown in &self.browns {
            numbers.extend(brown.inverse_focal);
            numbers.extend(brown.center_px);
            numbers.extend(brown.k);
            numbers.extend(brown.p);
            numbers.extend(brown.rotation);
            numbers.extend(brown.center_mm);
        }
        for table in &self.tables {
            numbers.extend(table.nodes.map(|count| count as f32));
            numbers.extend(table.first_px);
            numbers.extend(table.nodes_per_px);
            numbers.push(table.z_mm);
        }
        numbers.extend(self.matches.as_flattened());
        for table in &self.tables {
            numbers.extend(table.values.as_flattened());
        }
        numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
    }
}

fn read_table<'a>(
    head: &[f32; TABLE_LEN],
    rest: &'a [[f32; 4]],
) -> Option<(BilinearTable<'a>, &'a [[f32; 4]])> {
    let [nodes_u, nodes_v, first_u, first_v, per_px_u, per_px_v, z_mm] = *head;
    let nodes = [nodes_u as usize, nodes_v as usize];
    let (values, rest) = rest.split_at_checked(nodes[0].checked_mul(nodes[1])?)?;
    let table = BilinearTable {
        nodes,
        first_px: [first_u, first_v],
        nodes_per_px: [per_px_u, per_px_v],
        z_mm,
        values,
    };
    Some((table, rest))
}

fn read_brown(numbers: &[f32; BROWN_LEN]) -> Brown {
    let [fu, fv, cu, cv, k1, k2, k3, p1, p2, rest @ ..] = *numbers;
    let [r11, r12, r13, r21, r22, r23, r31, r32, r33, x, y, z] = rest;
    Brown {
        inverse_focal: [fu, fv],
        center_px: [cu, cv],
        k: [k1, k2, k3],
        p: [p1, p2],
        rotation: [r11, r12, r13, r21, r22, r23, r31, r32, r33],
        center_mm: [x, y, z],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "std")]
    #[test]
    fn a_job_reads_as_it_was_written_and_not_cut_short() {
        let matches = [[1.5, 2.5, 3.5, 4.5], [5.5, 6.5, 7.5, 8.5]];
        let values = [[0.25; 4], [0.5; 4], [0.75; 4], [1.0; 4]];
        let table = |z_mm| BilinearTable {
            nodes: [2, 2],
            first_px: [-0.5, 0.5],
            nodes_per_px: [0.125, 0.25],
            z_mm,
            values: &values,
        };
        let brown = |p1| Brown {
            inverse_focal: [0.001, 0.002],
            center_px: [320.0, 240.0],
            k: [0.1, 0.2, 0.3],
            p: [p1, 0.5],
            rotation: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
            center_mm: [10.0, 20.0, 30.0],
        };
        let job = Job {
            cameras: [3, 1],
            matches: &matches,
            tables: [table(7.0), table(8.0)],
            browns: [brown(0.4), brown(0.6)],
        };
        let bytes = job.to_bytes();
        let numbers: Vec<f32> = bytes
            .as_chunks::<4>()
            .0
            .iter()
            .map(|number| f32::from_le_bytes(*number))
            .collect();
        let found = Job::read(&numbers).unwrap();
        assert_eq!(format!("{found:?}"), format!("{job:?}"));
        for length in 0..numbers.len() {
            assert!(Job::read(&numbers[..length]).is_none(), "{length}");
        }
    }

    #[test]
    fn a_record_and_its_number_come_back() {
        let record = Record {
            probe: 1,
            match_idx: 0x0203_0405,
            answered: 1,
            ticks: u32::MAX,
            stack_bytes: 7,
        };
        assert_eq!(Record::from_bytes(&record.to_bytes()), record);
        for (number, probe) in Probe::ALL.into_iter().enumerate() {
            assert_eq!(probe as usize, number);
        }
    }
}
