//! The command line: what was asked for, who does it, and how the outcome is told.
//!
//! Arguments ([`args`]) become settings ([`settings`]); every verb has a file of its own and
//! returns an [`Outcome`]; everything shown goes through [`output::Console`].

pub mod args;
mod asked_for;
pub mod audit;
pub mod calibrate;
pub mod compare;
pub mod completions;
pub mod demo;
pub mod detect;
mod detect_image;
pub mod detect_target;
pub mod device;
pub mod error;
mod error_causes;
pub mod evaluate;
pub mod export;
mod export_blob;
mod export_folder;
mod export_form;
mod export_help;
mod export_loss;
mod export_mesh;
mod export_options;
mod export_slot;
mod failure;
pub mod flash;
pub mod foreign_args;
pub mod import;
pub mod import_corners;
mod input_file;
pub mod inspect;
mod key_file;
pub mod keygen;
mod lengths;
pub mod man;
pub mod match_noise;
pub mod measure;
pub mod methods;
mod outcome;
pub mod output;
pub mod pack;
pub mod place;
pub mod progress;
pub mod rays;
mod recording;
pub mod report;
mod rig_file;
mod run;
pub mod settings;
pub mod sign;
pub mod simulate;
pub mod target;
pub mod usage_error;
pub mod verify;

pub use outcome::Outcome;
pub use run::main;
