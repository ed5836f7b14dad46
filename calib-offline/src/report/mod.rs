//! What a calibration says of itself: `calibration.json` and the report page. Computes nothing new.

pub mod choices_page;
pub mod facts;
pub mod html;
pub mod left_out_page;
pub mod plot;
mod procedure;
pub mod record;
pub mod store;
pub mod text;
pub mod words;

#[cfg(test)]
pub(crate) mod example;

pub use html::BlobFacts;
pub use record::Calibration;
