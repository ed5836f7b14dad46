//! The blob's schema, the only definition of it: what the runtime reads and the packer writes.
//! `FORMAT.md` says the same byte by byte.
//!
//! ```text
//! header | metadata (postcard) | pad to 8 | records | tables | pairs | sections
//! ```

#[cfg(feature = "integer")]
mod arithmetic;
mod axis;
mod encoding;
mod header;
mod message;
mod meta;
mod pair;
mod quantized;
mod record;
mod section;

#[cfg(feature = "integer")]
pub use arithmetic::{ARITHMETIC_HEADER_LEN, Arithmetic, INTEGER};
pub use axis::Axis;
pub use encoding::{Encoding, Form, PATCH_LEN, coefficient_count};
pub use header::{
    ALIGNMENT, CRC_OFFSET, HEADER_LEN, Header, IDENTITY_LEN, MAGIC, MAX_CAMERAS, MAX_CELLS,
    MAX_EXTENT_PX, MAX_MAGNITUDE, OLDEST_VERSION, VERSION, aligned, checksum, checksum_from_all,
    mask_len,
};
pub(crate) use message::Messages;
pub use meta::{CameraMeta, LengthUnit, Meta, PixelConvention, SelfTest};
pub use pair::{MAX_NODES, MAX_STEP_PX, NODE_LEN, PAIR_HEADER_LEN, PairHeader, TRIANGLE};
pub use quantized::{
    MAX_DEGREE, PLACES_PER_CELL, QUANTIZED_HEADER_LEN, QuantizedHeader, QuantizedLayout,
    QuantizedMap, UNITS_PER_STEP, places_per_px,
};
pub(crate) use quantized::{QUANTIZED_HEADER_PAIRS, knots_len};
pub(crate) use record::is_moderate;
pub use record::{RECORD_LEN, RECORD_WORDS, Record, RecordFields};
pub use section::{MAX_SECTIONS, SECTION_HEADER_LEN, SECTIONS_SINCE, Section, SectionHeader, tag};
