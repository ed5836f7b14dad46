//! What the runtime costs on a Cortex-M4F: instructions and stack from QEMU, code from the images.
//!
//! The image `counting` runs every piece of work between two looks at a timer. QEMU gives each
//! instruction the same time and everything else none, so the timer counts instructions: exactly,
//! and the same in every run. What the two looks and an empty call take is subtracted; a block of a
//! hundred instructions must then count a hundred, or nothing is reported.

mod blobs;
mod image;
mod stack;
mod text;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use thiserror::Error;

use crate::counting::{KNOWN_INSTRUCTIONS, Probe, RECORD_LEN, Record};
use crate::qemu::{self, QemuError};
use blobs::Asked;
use image::Image;

pub use blobs::{MATCH_COUNT, built_in};
pub use image::{Function, Static};
pub use stack::StackBound;

/// Version of the layout of [`Cost`] as JSON.
pub const SCHEMA: u32 = 1;

/// An instruction takes 2^10 ns of QEMU's time, the most that it can be set to.
const TIME_SHIFT: u32 = 10;
/// A tick of the board's timer, ns.
const TICK_NS: u64 = 40;

const COUNTING: &str = "counting";
/// The images whose size is reported, and the functions of each whose stack is.
const IMAGES: [(&str, &str, &[&str]); 3] = [
    (
        "footprint_measure",
        "open, lookup, triangulate",
        &["open", "lookup", "triangulate"],
    ),
    (
        "footprint_covariance",
        "the same and triangulate_with_covariance",
        &[
            "open",
            "lookup",
            "triangulate",
            "triangulate_with_covariance",
        ],
    ),
    ("device", "the device application", &[]),
];

/// Why nothing could be counted.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CostError {
    /// There is no QEMU, or no image.
    #[error(transparent)]
    Qemu(#[from] QemuError),
    /// A file could not be read or written.
    #[error("{what}")]
    Io {
        /// Which.
        what: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file is not a blob.
    #[error("{} cannot be opened", path.display())]
    Blob {
        /// The file.
        path: PathBuf,
        /// What the runtime says.
        source: ray_runtime::OpenError,
    },
    /// A blob has one camera.
    #[error("{} has one camera, and a match needs two", path.display())]
    OneCamera {
        /// The file.
        path: PathBuf,
    },
    /// No pixels of two cameras were found whose rays meet.
    #[error("{}: of {tries} random pairs of pixels, none gives a point", path.display())]
    NoMatches {
        /// The file.
        path: PathBuf,
        /// Pairs that were tried.
        tries: usize,
    },
    /// An image is no ELF file.
    #[error("{} cannot be read as an image", path.display())]
    Elf {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: object::Error,
    },
    /// The counting image failed.
    #[error("the counting image failed on {} ({status})", path.display())]
    Failed {
        /// The blob that it was given.
        path: PathBuf,
        /// How it ended.
        status: std::process::ExitStatus,
    },
    /// The counting image did not write what it should have written.
    #[error("the counting image wrote {records} records, not {expected}")]
    Records {
        /// How many came.
        records: usize,
        /// How many there should be.
        expected: usize,
    },
    /// The check of the counting failed: this QEMU does not count.
    #[error("a block of {KNOWN_INSTRUCTIONS} instructions was counted as {counted}")]
    Miscounted {
        /// What came out.
        counted: i64,
    },
    /// The runtime gave no result where it gave one on this computer.
    #[error("{}: `{what}` came to no result in {failed} runs", path.display())]
    NoResult {
        /// The blob.
        path: PathBuf,
        /// The work.
        what: &'static str,
        /// Runs without result.
        failed: usize,
    },
}

/// Everything that is reported.
#[derive(Debug, Serialize)]
pub struct Cost {
    /// [`SCHEMA`].
    pub schema: u32,
    /// What it was measured with.
    pub conditions: Conditions,
    /// Per blob: instructions and stack.
    pub blobs: Vec<BlobCost>,
    /// Per image: code, memory, bound of the stack.
    pub images: Vec<ImageCost>,
}

/// What it was measured with.
#[derive(Debug, Serialize)]
pub struct Conditions {
    /// The target that the images are compiled for.
    pub target: &'static str,
    /// The board.
    pub machine: &'static str,
    /// QEMU's own line.
    pub qemu: String,
    /// The compiler's own line, as it stands in the image.
    pub compiler: String,
    /// How the images are compiled.
    pub profile: &'static str,
    /// Instructions of the known block.
    pub known_block: u32,
    /// What was counted for it, in every run.
    pub known_block_counted: i64,
    /// What an empty call between two looks at the timer takes, instructions: subtracted.
    pub overhead: i64,
}

/// What one blob costs.
#[derive(Debug, Serialize)]
pub struct BlobCost {
    /// Name of the file.
    pub blob: String,
    /// Its length.
    pub bytes: usize,
    /// The two cameras of the matches.
    pub cameras: [CameraCost; 2],
    /// How many matches were asked.
    pub matches: usize,
    /// Instructions of the checksum by byte.
    pub checksum_instructions_per_byte: f64,
    /// In the order of the work.
    pub rows: Vec<Row>,
}

/// A camera whose pixels were asked.
#[derive(Debug, Serialize)]
pub struct CameraCost {
    /// Its name.
    pub name: String,
    /// Whether it has no offset field.
    pub is_central: bool,
}

/// What one piece of work costs on one blob.
#[derive(Debug, Serialize)]
pub struct Row {
    /// A word for it, the same in every version.
    pub work: &'static str,
    /// The camera, for work on one.
    pub camera: Option<String>,
    /// Whether it is there for comparison.
    pub is_yardstick: bool,
    /// Runs that came to a result; the others are not counted.
    pub runs: usize,
    /// Instructions, without the call.
    pub instructions: Spread,
    /// Most stack that it wrote to below its caller's frame, bytes.
    pub stack_bytes: u32,
}

/// Least, mean and most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Least.
    pub min: i64,
    /// Mean.
    pub mean: f64,
    /// Most.
    pub max: i64,
}

/// What one image holds.
#[derive(Debug, Serialize)]
pub struct ImageCost {
    /// Its name.
    pub image: &'static str,
    /// What it does.
    pub does: &'static str,
    /// Loaded sections and those that take memory, bytes.
    pub sections: BTreeMap<String, u64>,
    /// `.data`, `.bss` and `.uninit`.
    pub ram_besides_stack: u64,
    /// Code of everything but start-up and `main`: in an image that does nothing but call the
    /// runtime, the runtime's with all it needs.
    pub runtime_code_bytes: u64,
    /// Code by the crate it comes from.
    pub code_by_origin: BTreeMap<String, u64>,
    /// Every function.
    pub functions: Vec<Function>,
    /// Every named static.
    pub statics: Vec<Static>,
    /// Functions that have to do with panics: none, or it would not link.
    pub panics: Vec<String>,
    /// Bound of the stack by function.
    pub stack_bounds: BTreeMap<&'static str, StackBound>,
}

/// Counts the given blobs; the images are built first when they are missing or stale.
///
/// # Errors
/// [`CostError`].
pub fn measure(paths: &[PathBuf]) -> Result<Cost, CostError> {
    let qemu = qemu::version()?;
    let asked = paths
        .iter()
        .map(|path| Asked::read(path))
        .collect::<Result<Vec<_>, _>>()?;
    let mut names = vec![COUNTING];
    names.extend(IMAGES.map(|(name, ..)| name));
    qemu::build_images(&names)?;

    let counting = qemu::image_path(COUNTING);
    let mut conditions = Conditions {
        target: "thumbv7em-none-eabihf",
        machine: "mps2-an386, cortex-m4",
        qemu,
        compiler: Image::read(&counting)?.compiler.unwrap_or_default(),
        profile: "opt-level 3, fat LTO, one codegen unit, panic = abort",
        known_block: KNOWN_INSTRUCTIONS,
        known_block_counted: 0,
        overhead: 0,
    };
    let mut blobs = Vec::new();
    for (path, asked) in paths.iter().zip(&asked) {
        blobs.push(count(&counting, path, asked, &mut conditions)?);
    }
    let images = IMAGES
        .iter()
        .map(|(name, does, functions)| image_cost(name, does, functions))
        .collect::<Result<_, _>>()?;
    Ok(Cost {
        schema: SCHEMA,
        conditions,
        blobs,
        images,
    })
}

fn count(
    image: &Path,
    path: &Path,
    asked: &Asked,
    conditions: &mut Conditions,
) -> Result<BlobCost, CostError> {
    let records = run(image, path, asked)?;
    let of = |probe: Probe| {
        records
            .iter()
            .filter(move |record| record.probe == probe as u32)
    };
    let first_count = |probe| of(probe).next().map_or(0, instructions);
    let overhead = first_count(Probe::Nothing);
    let known = first_count(Probe::Known) - overhead;
    if known != i64::from(KNOWN_INSTRUCTIONS) {
        return Err(CostError::Miscounted { counted: known });
    }
    conditions.overhead = overhead;
    conditions.known_block_counted = known;

    let mut rows = Vec::new();
    for work in WORK {
        if work.probe == Probe::Covariance && !asked.has_uncertainty {
            continue;
        }
        let answered: Vec<_> = of(work.probe)
            .filter(|record| record.answered != 0)
            .collect();
        let failed = of(work.probe).count() - answered.len();
        if failed > 0 && !work.is_yardstick {
            return Err(CostError::NoResult {
                path: path.to_owned(),
                what: work.name,
                failed,
            });
        }
        let Some(spread) = Spread::of(answered.iter().map(|r| instructions(r) - overhead)) else {
            continue;
        };
        rows.push(Row {
            work: work.name,
            camera: work
                .camera
                .and_then(|k| asked.cameras.get(k))
                .map(|(name, _)| name.clone()),
            is_yardstick: work.is_yardstick,
            runs: answered.len(),
            instructions: spread,
            stack_bytes: answered.iter().map(|r| r.stack_bytes).max().unwrap_or(0),
        });
    }
    let checksum = first_count(Probe::Checksum) - overhead;
    let name = path.file_name().unwrap_or(path.as_os_str());
    Ok(BlobCost {
        blob: name.to_string_lossy().into_owned(),
        bytes: asked.length,
        cameras: asked
            .cameras
            .clone()
            .map(|(name, is_central)| CameraCost { name, is_central }),
        matches: MATCH_COUNT,
        checksum_instructions_per_byte: checksum as f64 / asked.length as f64,
        rows,
    })
}

/// Runs the counting image on a blob.
fn run(image: &Path, path: &Path, asked: &Asked) -> Result<Vec<Record>, CostError> {
    let io = |source| CostError::Io {
        what: "a temporary file for the flash".into(),
        source,
    };
    let mut flash = tempfile::NamedTempFile::new().map_err(io)?;
    flash.write_all(&asked.flash).map_err(io)?;
    let output = qemu::run_counting(image, flash.path(), TIME_SHIFT)?;
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

/// Ticks are whole, so their number is off by less than one, and an instruction is 25.6 of them.
fn instructions(record: &Record) -> i64 {
    let ns = u64::from(record.ticks) * TICK_NS;
    ((ns + (1 << (TIME_SHIFT - 1))) >> TIME_SHIFT) as i64
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
    name: &'static str,
    /// Which of the two, for work on one.
    camera: Option<usize>,
    is_yardstick: bool,
}

/// The rows of the table, in its order.
const WORK: [Work; 10] = [
    Work::of_blob(Probe::Open, "open"),
    Work::of_blob(Probe::Checksum, "checksum"),
    Work::of_camera(Probe::LookupFirst, "lookup", 0),
    Work::of_camera(Probe::LookupSecond, "lookup", 1),
    Work::of_blob(Probe::Triangulate, "triangulate"),
    Work::of_blob(Probe::Covariance, "triangulate_with_covariance"),
    Work::yardstick(Probe::BilinearLookup, "bilinear_lookup"),
    Work::yardstick(Probe::BrownUndistortion, "brown_undistortion"),
    Work::yardstick(Probe::BilinearPair, "bilinear_triangulate"),
    Work::yardstick(Probe::BrownPair, "brown_triangulate"),
];

impl Work {
    const fn of_blob(probe: Probe, name: &'static str) -> Self {
        Self {
            probe,
            name,
            camera: None,
            is_yardstick: false,
        }
    }

    const fn of_camera(probe: Probe, name: &'static str, camera: usize) -> Self {
        Self {
            camera: Some(camera),
            ..Self::of_blob(probe, name)
        }
    }

    const fn yardstick(probe: Probe, name: &'static str) -> Self {
        Self {
            is_yardstick: true,
            ..Self::of_blob(probe, name)
        }
    }
}

fn image_cost(
    name: &'static str,
    does: &'static str,
    functions: &[&'static str],
) -> Result<ImageCost, CostError> {
    let image = Image::read(&qemu::image_path(name))?;
    let code_by_origin = image.code_by_origin();
    let of_runtime = code_by_origin
        .iter()
        .filter(|(origin, _)| *origin != image::STARTUP);
    let bound = |function: &&'static str| Some((*function, image.stack_bound(name, function)?));
    Ok(ImageCost {
        image: name,
        does,
        ram_besides_stack: image.ram_besides_stack(),
        runtime_code_bytes: of_runtime.map(|(_, bytes)| bytes).sum(),
        panics: image.panics(),
        stack_bounds: functions.iter().filter_map(bound).collect(),
        code_by_origin,
        sections: image.sections,
        functions: image.functions,
        statics: image.statics,
    })
}
