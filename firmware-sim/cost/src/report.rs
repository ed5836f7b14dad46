//! What is reported: the layout of the JSON object.

use std::collections::BTreeMap;

use serde::Serialize;

/// Version of the layout of [`Cost`] as JSON.
pub const SCHEMA: u32 = 1;

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
    /// Code of the runtime in the first of them without the feature `old-versions`.
    pub newest_only_code_bytes: u64,
}

/// What it was measured with.
#[derive(Debug, Serialize)]
pub struct Conditions {
    /// The target that the images are compiled for.
    pub target: &'static str,
    /// The board and its core.
    pub machine: String,
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
    /// The two cameras of the matches, or the only one that there is.
    pub cameras: Vec<CameraCost>,
    /// How many matches were asked.
    pub matches: usize,
    /// Instructions of the checksum by byte.
    pub checksum_instructions_per_byte: f64,
    /// In the order of the work.
    pub rows: Vec<Row>,
}

/// A camera whose pixels were asked.
#[derive(Debug, Clone, Serialize)]
pub struct CameraCost {
    /// Its name.
    pub name: String,
    /// What kind of ray field it has, in a word or two.
    pub kind: String,
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
    /// Most stack that it was seen to write to below its caller's frame, bytes.
    pub stack_bytes: u32,
    /// Upper bound of the same, from the code.
    pub stack_bound: StackBound,
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
    /// Code of everything but start-up and `main`: the runtime's with all it needs, in an image that
    /// does nothing but call the runtime. `None` for the application.
    pub runtime_code_bytes: Option<u64>,
    /// Code by the crate it comes from.
    pub code_by_origin: BTreeMap<String, u64>,
    /// Every function.
    pub functions: Vec<Function>,
    /// Every named static.
    pub statics: Vec<Static>,
    /// Functions that have to do with panics: none, or it would not link.
    pub panics: Vec<String>,
    /// Bound of the stack by function, and of all that runs from reset on.
    pub stack_bounds: BTreeMap<&'static str, StackBound>,
}

/// A function of an image.
#[derive(Debug, Clone, Serialize)]
pub struct Function {
    /// Its path, without a hash.
    pub name: String,
    /// Crate that it comes from; `startup` for what runs before and around everything, `callers` for
    /// the image's own.
    pub origin: String,
    /// Bytes of code.
    pub bytes: u64,
    /// Where it starts.
    #[serde(skip)]
    pub address: u64,
}

/// A static of an image.
#[derive(Debug, Clone, Serialize)]
pub struct Static {
    /// Its path, without a hash.
    pub name: String,
    /// Bytes.
    pub bytes: u64,
}

/// Bound of the stack of a function with all that it calls.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StackBound {
    /// Bytes below the caller's frame.
    Bytes(u32),
    /// None could be found; why.
    Unknown(String),
}
