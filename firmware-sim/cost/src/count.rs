//! Runs the counting image on a blob and makes rows of what it writes.

use std::io::Write;
use std::path::Path;

use crate::blobs::{Asked, MATCH_COUNT};
use crate::cores::Core;
use crate::counting::{KNOWN_INSTRUCTIONS, Probe, RECORD_LEN, ROW_LEN, Record, WRAPPED};
use crate::error::CostError;
use crate::image::Image;
use crate::images::Images;
use crate::report::{BlobCost, Conditions, Row, Spread};

/// Name of the image.
pub const COUNTING: &str = "counting";
/// What it is built with besides.
pub const COUNTING_FEATURES: &str = "integer";
/// Where the functions are that do the work.
const PROBES: &str = "firmware_cost::probes";

/// An instruction takes 2^8 ns of QEMU's time: some ticks of every counter, whose 24 bits go round after two million.
pub const TIME_SHIFT: u32 = 8;

/// Counts the work on one blob; what was found out about the counting itself goes into
/// `conditions`.
///
/// # Errors
/// [`CostError`].
pub fn cost_of_blob(
    images: &impl Images,
    core: &Core,
    image: &Image,
    path: &Path,
    asked: &Asked,
    conditions: &mut Conditions,
) -> Result<BlobCost, CostError> {
    let records = run(images, core, path, asked)?;
    if records.iter().any(|record| record.ticks == WRAPPED) {
        return Err(CostError::TooLong {
            path: path.to_owned(),
        });
    }
    let instructions = |record: &Record| instructions(record, core);
    let of = |probe: Probe| {
        records
            .iter()
            .filter(move |record| record.probe == probe as u32)
    };
    let first_count = |probe| of(probe).next().map_or(0, &instructions);
    let overhead = first_count(Probe::Nothing);
    let known = first_count(Probe::Known) - overhead;
    if known != i64::from(KNOWN_INSTRUCTIONS) {
        return Err(CostError::Miscounted { counted: known });
    }
    conditions.overhead = overhead;
    conditions.known_block_counted = known;

    let mut rows = Vec::new();
    for work in WORK {
        let is_asked = match work.probe {
            Probe::Covariance => asked.has_uncertainty,
            Probe::IntegerPrepare | Probe::IntegerLookupFixedFirst | Probe::IntegerLookupFirst => {
                asked.has_integers
            }
            Probe::IntegerLookupFixedSecond
            | Probe::IntegerLookupSecond
            | Probe::IntegerTriangulateFixed
            | Probe::IntegerTriangulate => asked.has_integers && asked.cameras.len() > 1,
            Probe::LookupSecond
            | Probe::RowSecond
            | Probe::Triangulate
            | Probe::BilinearTriangulate
            | Probe::BrownTriangulate => asked.cameras.len() > 1,
            _ => true,
        };
        if !is_asked {
            continue;
        }
        let answered: Vec<_> = of(work.probe)
            .filter(|record| record.answered != 0)
            .collect();
        let failed = of(work.probe).count() - answered.len();
        if failed > 0 && !(work.is_yardstick || work.is_row) {
            return Err(CostError::NoResult {
                path: path.to_owned(),
                what: work.name,
                failed,
            });
        }
        let Some(spread) = Spread::of(
            answered
                .iter()
                .map(|record| work.each(instructions(record) - overhead)),
        ) else {
            continue;
        };
        let camera = work.camera.and_then(|k| asked.cameras.get(k));
        rows.push(Row {
            work: work.name,
            camera: camera.map(|camera| camera.name.clone()),
            is_yardstick: work.is_yardstick,
            runs: answered.len(),
            instructions: spread,
            stack_bound: image.stack_bound(PROBES, work.function),
            stack_bytes: answered.iter().map(|r| r.stack_bytes).max().unwrap_or(0),
        });
    }
    let checksum = first_count(Probe::Checksum) - overhead;
    let name = path.file_name().unwrap_or(path.as_os_str());
    Ok(BlobCost {
        blob: name.to_string_lossy().into_owned(),
        bytes: asked.length,
        cameras: asked.cameras.clone(),
        matches: MATCH_COUNT,
        checksum_instructions_per_byte: checksum as f64 / asked.length as f64,
        rows,
    })
}

/// Runs the counting image on a blob.
fn run(
    images: &impl Images,
    core: &Core,
    path: &Path,
    asked: &Asked,
) -> Result<Vec<Record>, CostError> {
    let io = |source| CostError::Io {
        what: "a temporary file for the flash".into(),
        source,
    };
    let mut flash = tempfile::NamedTempFile::new().map_err(io)?;
    flash.write_all(&asked.flash).map_err(io)?;
    let output =
        images.run_counting(core, &images.path(core, COUNTING), flash.path(), TIME_SHIFT)?;
    if !output.status.success() {
        return Err(CostError::Failed {
            path: path.to_owned(),
            status: output.status,
        });
    }
    let (records, rest) = output.stdout.as_chunks::<RECORD_LEN>();
    let per_match = Probe::ALL
        .iter()
        .filter(|probe| probe.is_per_match())
        .count();
    let expected = MATCH_COUNT * per_match + (Probe::ALL.len() - per_match);
    if records.len() != expected || !rest.is_empty() {
        return Err(CostError::Records {
            records: records.len(),
            expected,
        });
    }
    Ok(records.iter().map(Record::from_bytes).collect())
}

/// Ticks are whole, so their number is off by less than one, and an instruction is two of them at least.
fn instructions(record: &Record, core: &Core) -> i64 {
    let instruction_ps = 1000 << TIME_SHIFT;
    let ps = u64::from(record.ticks) * core.tick_ps;
    ((ps + instruction_ps / 2) / instruction_ps) as i64
}

impl Spread {
    fn of(counts: impl Iterator<Item = i64>) -> Option<Self> {
        let counts: Vec<i64> = counts.collect();
        Some(Self {
            min: *counts.iter().min()?,
            mean: counts.iter().sum::<i64>() as f64 / counts.len() as f64,
            max: *counts.iter().max()?,
        })
    }
}

/// A row of the table.
struct Work {
    probe: Probe,
    /// What the report calls it.
    name: &'static str,
    /// The function of `probes` that does it.
    function: &'static str,
    /// Which of the two, for work on one.
    camera: Option<usize>,
    is_yardstick: bool,
    /// Whether it is done for a row of pixels at once; rows that are not wholly calibrated are left out.
    is_row: bool,
}

/// The rows of the table, in its order.
const WORK: [Work; 19] = [
    Work::of_blob(Probe::Open, "open"),
    Work::of_blob(Probe::Checksum, "checksum"),
    Work::lookup(Probe::LookupFirst, "lookup_first", 0),
    Work::lookup(Probe::LookupSecond, "lookup_second", 1),
    Work::row(Probe::RowFirst, "row_first", 0),
    Work::row(Probe::RowSecond, "row_second", 1),
    Work::of_blob(Probe::Triangulate, "triangulate"),
    Work::of_blob(Probe::Covariance, "triangulate_with_covariance"),
    Work::of_blob(Probe::IntegerPrepare, "integer_prepare"),
    Work::integer_lookup(
        Probe::IntegerLookupFixedFirst,
        "integer_lookup_fixed",
        "integer_lookup_fixed_first",
        0,
    ),
    Work::integer_lookup(
        Probe::IntegerLookupFixedSecond,
        "integer_lookup_fixed",
        "integer_lookup_fixed_second",
        1,
    ),
    Work::integer_lookup(
        Probe::IntegerLookupFirst,
        "integer_lookup",
        "integer_lookup_first",
        0,
    ),
    Work::integer_lookup(
        Probe::IntegerLookupSecond,
        "integer_lookup",
        "integer_lookup_second",
        1,
    ),
    Work::of_blob(Probe::IntegerTriangulateFixed, "integer_triangulate_fixed"),
    Work::of_blob(Probe::IntegerTriangulate, "integer_triangulate"),
    Work::yardstick(Probe::BilinearLookup, "bilinear_lookup"),
    Work::yardstick(Probe::BrownUndistortion, "brown_undistortion"),
    Work::yardstick(Probe::BilinearTriangulate, "bilinear_triangulate"),
    Work::yardstick(Probe::BrownTriangulate, "brown_triangulate"),
];

impl Work {
    const fn of_blob(probe: Probe, name: &'static str) -> Self {
        Self {
            probe,
            name,
            function: name,
            camera: None,
            is_yardstick: false,
            is_row: false,
        }
    }

    const fn lookup(probe: Probe, function: &'static str, camera: usize) -> Self {
        Self {
            function,
            camera: Some(camera),
            ..Self::of_blob(probe, "lookup")
        }
    }

    const fn integer_lookup(
        probe: Probe,
        name: &'static str,
        function: &'static str,
        camera: usize,
    ) -> Self {
        Self {
            name,
            ..Self::lookup(probe, function, camera)
        }
    }

    const fn row(probe: Probe, function: &'static str, camera: usize) -> Self {
        Self {
            name: "a ray in a row of 64",
            is_row: true,
            ..Self::lookup(probe, function, camera)
        }
    }

    /// What one of them takes, rounded up.
    fn each(&self, instructions: i64) -> i64 {
        let length = if self.is_row { ROW_LEN as i64 } else { 1 };
        (instructions + length - 1) / length
    }

    const fn yardstick(probe: Probe, name: &'static str) -> Self {
        Self {
            is_yardstick: true,
            ..Self::of_blob(probe, name)
        }
    }
}
