//! What a calibration says of itself: `calibration.json` and the report page. Computes nothing new.

pub mod blob_facts;
mod causes_page;
mod choices_page;
pub mod facts;
pub mod html;
pub mod import;
pub mod left_out_page;
pub mod nearest_pinhole;
pub mod plot;
mod procedure;
pub mod record;
pub mod schema;
mod sign_page;
pub mod store;
pub mod task;
pub mod text;
pub mod words;

#[cfg(test)]
pub(crate) mod example;

pub use blob_facts::BlobFacts;
pub use record::Calibration;
